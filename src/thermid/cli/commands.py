"""The commands that stand in modules of their own; each registers itself."""

from __future__ import annotations

from thermid.cli import (
    credibility,
    deliver,
    diagram,
    exchange,
    hold,
    log,
    look,
    moisture,
    predict,
    profile,
    qualifying,
    settle,
    studio,
    swap,
    trust,
)

MODULES = (
    studio,
    diagram,
    exchange,
    log,
    look,
    predict,
    swap,
    moisture,
    credibility,
    trust,
    profile,
    settle,
    qualifying,
    hold,
    deliver,
)
