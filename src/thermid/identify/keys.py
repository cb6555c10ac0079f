"""The key of a stage: the hash of everything that its result depends on."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version
from typing import Any

from thermid.identify.cache import in_full
from thermid.identify.request import Request
from thermid.measure import Channel

__all__ = ["key_for", "key_of"]


def _channel_key(c: Channel) -> list[Any]:
    """Return what a fit depends on of a channel beside its numbers in the file, whose hash is of them as they are written."""
    known = [c.role, c.target, c.gain, c.unit, c.quantity, c.noise, c.accuracy, c.resolution, c.prompt, c.correction]
    return [*known, *([repr(c.part)] if c.part else [])]


def key_of(request: Request, below: list[str]) -> str:
    """Return the hash of everything that a stage's result depends on.

    What it inherits is a result of the stages below, whose keys say what that depends on. Inherited errors are left out: a fit that was
    recalled computes them anew, with other last digits than the search that came upon it.
    """
    content = {
        "version": version("thermid"),
        "model": request.model.identity(),
        "records": {
            r.name: [
                r.origin.sha256,
                list(r.steps),
                *([repr(r.second)] if r.second else []),
                {n: _channel_key(c) for n, c in r.channels.items()},
            ]
            for r in request.records
        },
        "free": request.free,
        "scenario": request.scenarios,
        "local": repr(sorted(request.local.items())),
        "priors": repr(sorted(request.priors.items())),
        "bias": repr(sorted(request.held_bias.items())),
        "record_local": repr(sorted((n, sorted(t.items())) for n, t in request.record_local.items())),
        "how": [request.untie, request.loss, request.knee, request.search, request.window, repr(request.options)],
        "readings": repr(sorted(request.readings.items())),
        "weights": sorted(request.weights.items()),
        "prior": request.prior,
        "below": below,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=in_full).encode()).hexdigest()


def key_for(request: Request) -> str:
    """Return the key of a request; of one that was made in Python, that of what it says itself."""
    return request.key or key_of(request, [])
