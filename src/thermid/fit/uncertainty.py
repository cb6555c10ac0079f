"""Errors of fitted values: information, groups that cannot be separated, noise, values that moved."""

from thermid.fit._uncertainty.groups import (
    Group as Group,
    listed as listed,
    percent as percent,
    practical_groups as practical_groups,
    structural_groups as structural_groups,
)
from thermid.fit._uncertainty.information import Information as Information, elsewhere as elsewhere
from thermid.fit._uncertainty.moved import (
    MOVED as MOVED,
    NOT_REJECTED as NOT_REJECTED,
    UNDECIDED as UNDECIDED,
    Move as Move,
    MovedGroup as MovedGroup,
    Moves as Moves,
    moves_from as moves_from,
    part_of as part_of,
)
from thermid.fit._uncertainty.noise import (
    TraceNoise as TraceNoise,
    answers_to_inputs as answers_to_inputs,
    autocorrelation as autocorrelation,
    binned as binned,
    evidences as evidences,
    score_excess as score_excess,
    stretch_means as stretch_means,
)
