"""How far a model may be trusted: by the worst standing among the values that act in it."""

from __future__ import annotations

from thermid.model.parts.parameter import CREDIBLE as CREDIBLE
from thermid.model.parts.parameter import UNJUDGED as UNJUDGED
from thermid.model.parts.parameter import Standing as Standing
from thermid.model.parts.parameter import State as State
from thermid.model.parts.parameter import worst as worst
from thermid.model.tree.model import Model
from thermid.model.tree.tree import parameter_table


def of_model(model: Model) -> Standing:
    """Return the worst standing of the values that act in a model; unjudged where all are those of its decks.

    A value that was laid over the model carries its standing; one that a [set] hides does not act.
    """
    laid = [s for e in parameter_table(model).values() if (s := e.parameter.standing) is not None]
    return worst(laid) if laid else UNJUDGED
