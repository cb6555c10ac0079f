"""Signals over time, curves over temperature, and heat stores: what laws of elements are made of."""

from thermid.model._laws.curves import (
    EXTENSION_REACH as EXTENSION_REACH,
    Curve as Curve,
    evaluate as evaluate,
    slopes as slopes,
    value_and_slope as value_and_slope,
    whole as whole,
)
from thermid.model._laws.law import law as law
from thermid.model._laws.signal import (
    Constant as Constant,
    Drawn as Drawn,
    MeanOf as MeanOf,
    Mixed as Mixed,
    Signal as Signal,
    Sine as Sine,
    TableSignal as TableSignal,
    added as added,
    check_span as check_span,
    common_cycle as common_cycle,
    conducted as conducted,
    in_run as in_run,
    joined as joined,
    literal as literal,
    multiplied as multiplied,
    own_signal as own_signal,
    pulses as pulses,
    signal as signal,
    together as together,
)
from thermid.model._laws.stores import HeatStore as HeatStore, Melt as Melt
