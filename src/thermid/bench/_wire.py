"""Lines of the bench: what the board sends, with CRC, and how a line of its log looks. `docs/bench.md` describes both."""

from __future__ import annotations

import re
from binascii import crc_hqx
from functools import lru_cache
from typing import Final, NamedTuple

from thermid.base.errors import RecordError

MAGIC: Final = "# thermid bench log 1"
"""First line of a bench log."""

_VALUE: Final = re.compile(r"D,(\d{1,10}),(\d{1,10}),([0-9A-F]{16}|[HVI][1-9]),(-?\d{1,6})?,(ok|crc|lost|short|power)\Z", re.ASCII)
_OTHER: Final = re.compile(r"([BSCRE]),(\d{1,10}),(\d{1,10}),([ -)+-~]{1,80})\Z", re.ASCII)
_FIELDS: Final = {"B": (3, 3), "S": (2, 2), "C": (3, 3), "R": (2, 2), "E": (1, 2)}
COUNTER_RANGE: Final = 1 << 32
"""Where the counters of the board, of lines and of milliseconds, begin again."""


class BoardLine(NamedTuple):
    """One line of the board, parsed.

    Parameters
    ----------
    kind : str               B (board), S (sensor), C (settings), D (value), R (reply) or E (event).
    number : int             Sequence number since the reset.
    ms : int                 The board's time. [ms]
    fields : tuple of str    Further fields; of a value: source, raw value or an empty text, status.
    """

    kind: str
    number: int
    ms: int
    fields: tuple[str, ...]

    @property
    def raw(self) -> int | None:
        """Raw value of a `D` line; None where the board had none."""
        return int(self.fields[1]) if self.kind == "D" and self.fields[1] else None


def crc16(body: str) -> str:
    """Return the CRC-16 (polynomial 1021, start FFFF) of a text as four hexadecimal digits.

    >>> crc16("123456789")
    '29B1'
    """
    return f"{crc_hqx(body.encode('latin-1', 'replace'), 0xFFFF):04X}"


def crc8(data: bytes) -> int:
    """Return the CRC-8 of a 1-Wire device (polynomial 31, least significant bit first; Maxim application note 27).

    >>> crc8(bytes.fromhex("021CB801000000A2"))
    0
    """
    crc = 0
    for byte in data:
        for bit in range(8):
            mixed = (crc ^ (byte >> bit)) & 1
            crc = (crc >> 1) ^ (0x8C if mixed else 0)
    return crc


@lru_cache(maxsize=1024)
def rom_is_good(rom: str) -> bool:
    """Whether a ROM of 16 hexadecimal digits carries its own CRC and is not all zeros."""
    return crc8(bytes.fromhex(rom)) == 0 and rom != "0" * 16


def sealed(body: str, mark: str = "*") -> str:
    """Return a line with its CRC behind a mark, without a line feed. The mark is ``*`` over the wire and a space in a log.

    >>> sealed("4,alive")
    '4,alive*6905'
    """
    return f"{body}{mark}{crc16(body)}"


def unsealed(text: str, mark: str = "*") -> str:
    """Return a line without the mark and CRC that `sealed` put behind it.

    Raises
    ------
    RecordError   When it has no CRC or a wrong one.
    """
    body, sign, crc = text.rpartition(mark)
    if not sign:
        raise RecordError("it has no CRC.", code="bench.protocol")
    if crc != crc16(body):
        raise RecordError(f"its CRC is {crc[:8]!r}, but its text has {crc16(body)}.", code="bench.protocol")
    return body


def parse_line(text: str) -> BoardLine:
    """Parse one line of the board.

    Raises
    ------
    RecordError   When its CRC is wrong or missing, or it is not of the protocol.
    """
    body = unsealed(text)
    value = _VALUE.match(body)
    if value is not None:
        number, ms, source, raw, status = value.groups()
        if (status in ("ok", "power")) != bool(raw):
            raise RecordError(
                f"a value with status '{status}' {'has no' if not raw else 'cannot have a'} raw value.", code="bench.protocol"
            )
        if len(source) == 16 and not rom_is_good(source):
            raise RecordError(f"ROM {source} has a wrong CRC.", code="bench.protocol")
        return _checked(BoardLine("D", int(number), int(ms), (source, raw or "", status)))
    other = _OTHER.match(body)
    if other is None:
        raise RecordError(f"'{body[:40]}' is not a line of the protocol.", code="bench.protocol")
    kind, number, ms, rest = other.groups()
    fields = tuple(rest.split(","))
    least, most = _FIELDS[kind]
    if not least <= len(fields) <= most:
        raise RecordError(f"a line {kind} has {least} to {most} fields, this one {len(fields)}.", code="bench.protocol")
    if kind == "S" and not (re.fullmatch("[0-9A-F]{16}", fields[0]) and rom_is_good(fields[0]) and fields[1] in ("9", "10", "11", "12")):
        raise RecordError(f"'{rest[:40]}' is not a ROM with a resolution.", code="bench.protocol")
    return _checked(BoardLine(kind, int(number), int(ms), fields))


def _checked(line: BoardLine) -> BoardLine:
    """Return the line itself.

    Raises
    ------
    RecordError   When its number or time does not fit into 32 bits.
    """
    if line.number >= COUNTER_RANGE or line.ms >= COUNTER_RANGE:
        raise RecordError("its number or time does not fit 32 bits.", code="bench.protocol")
    return line
