"""Unmeasured powers: their history, and shapes of their courses."""

from thermid.fit._power.courses import ONE_TURN as ONE_TURN, SHAPES as SHAPES, PowerCourse as PowerCourse
from thermid.fit._power.history import (
    PowerHistory as PowerHistory,
    PowerLaw as PowerLaw,
    power_history as power_history,
    watts as watts,
    with_load as with_load,
)
