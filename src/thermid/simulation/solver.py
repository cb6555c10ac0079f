"""The kernel from Python: engines, options, wiring of inputs, extremes."""

from thermid.simulation._solver.engine import Engine as Engine, Squares as Squares, Weighing as Weighing, settle as settle
from thermid.simulation._solver.extremes import Dense as Dense, MemberTurnings as MemberTurnings, resolved as resolved
from thermid.simulation._solver.problem import (
    Answer as Answer,
    Options as Options,
    Traces as Traces,
    kept_for as kept_for,
    refuse_unseen as refuse_unseen,
)
from thermid.simulation._solver.wiring import Assembled as Assembled, Wiring as Wiring, read_schedule as read_schedule
