"""A stage whose values were tuned by hand: a `Calibration` without records."""

from __future__ import annotations

from thermid.fit.calibration import Calibration
from thermid.fit.problem.request import Request
from thermid.fit.standings import rests_on
from thermid.fit.stored import in_place
from thermid.knowledge.store import Store
from thermid.knowledge.values import view
from thermid.model.parts.standing import UNJUDGED


def tuned_by_hand(request: Request, hand: Store) -> Calibration:
    """Return a stage that takes values as somebody tuned them, over what the stages below found."""
    store = in_place(request.store, hand)
    values = view(store, list(hand.states), request.name)
    return Calibration(
        request.name,
        request.model,
        values,
        (),
        (),
        {},
        {},
        {},
        0.0,
        0,
        0,
        request.loss,
        request.remarks,
        seen=store.seen,
        request=request,
        own=UNJUDGED,
        rests=rests_on(request, values),
        store=store,
    )
