"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.interop.c99 import to_c as to_c
from thermid.interop.decks import to_esatan as to_esatan, to_sinda as to_sinda
from thermid.interop.equations import Equations as Equations, equations as equations
from thermid.interop.fmu import fmu_model as fmu_model, to_fmu as to_fmu
from thermid.interop.initfcn import InitFcn as InitFcn, read_initfcn as read_initfcn
from thermid.interop.modelica import to_modelica as to_modelica
from thermid.interop.octave import to_octave as to_octave
from thermid.interop.spice import to_spice as to_spice
