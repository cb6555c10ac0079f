"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.interop.equations import Equations as Equations
from thermid.interop.equations import equations as equations
from thermid.interop.initfcn import InitFcn as InitFcn
from thermid.interop.initfcn import read_initfcn as read_initfcn
from thermid.interop.octave import to_octave as to_octave
from thermid.interop.spice import to_spice as to_spice
