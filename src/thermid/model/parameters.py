"""Parameters: a value with its unit, its standing and its spread."""

from thermid.model._parts.parameter import (
    CREDIBLE as CREDIBLE,
    POSITIVE as POSITIVE,
    UNJUDGED as UNJUDGED,
    Parameter as Parameter,
    Standing as Standing,
    State as State,
    exact as exact,
    parameter as parameter,
    worst as worst,
)
