"""Decks of SINDA and ESATAN, read and written."""

from thermid.interop._decks.esatan import read_esatan as read_esatan
from thermid.interop._decks.network_file import NetworkFile as NetworkFile
from thermid.interop._decks.results import agreement as agreement, balance as balance, printed_temperatures as printed_temperatures
from thermid.interop._decks.sinda import read_sinda as read_sinda
from thermid.interop._decks.written import to_esatan as to_esatan, to_sinda as to_sinda
