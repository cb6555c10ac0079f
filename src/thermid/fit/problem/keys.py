"""The key of a stage: the hash of everything that its result depends on, by named ingredients."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from thermid.fit.problem.request import Request
from thermid.measure import Channel, Record
from thermid.model.tree.identity import definition_of


def _channel_key(c: Channel) -> list[Any]:
    """Return what a fit depends on of a channel beside its numbers in the file, whose hash is of them as they are written."""
    known = [c.role, c.target, c.gain, c.unit, c.quantity, c.noise, c.accuracy, c.resolution, c.prompt, c.correction, c.samples]
    return [*known, *([repr(c.part)] if c.part else [])]


def _record_key(r: Record) -> list[Any]:
    second = [repr(r.second)] if r.second else []
    return [r.origin.sha256, list(r.steps), *second, {n: _channel_key(c) for n, c in r.channels.items()}]


def ingredients_of(request: Request, below: list[str]) -> dict[str, str]:
    """Return name -> hash of everything that a stage's result depends on.

    What it inherits is a result of the stages below, whose keys say what that depends on: no value is an ingredient, for a fit that was
    recalled computes them anew, with other last digits than the search that came upon it.

    Parameters
    ----------
    request : Request   What the stage asks.
    below : list        Keys of the stages that it inherits from.
    """
    records = {r.name: _record_key(r) for r in request.records}
    scenario = [
        request.scenarios,
        repr(sorted(request.local.items())),
        repr(sorted((n, sorted(t.items())) for n, t in request.record_local.items())),
        repr(sorted(request.readings.items())),
        request.window,
    ]
    how = [request.loss, request.knee, request.search, repr(request.options), sorted(request.weights.items()), request.fit_start]
    held = None if request.held_errors is None else sorted(request.held_errors.items())
    priors = [repr(sorted(request.priors.items())), repr(sorted(request.held_bias.items())), repr(held)]
    content = {
        "deck": definition_of(request.model),
        "records": records,
        "scenario": scenario,
        "free and fixed": [request.free, request.prior, [(p, s.hidden) for p, s in request.store.states.items()], how],
        "priors": priors,
        "cuts": [request.untie, request.model.cuts],
        "values by hand": _by_hand(request),
        "below": below,
        "version": version("thermid"),
    }
    return {name: digest(x) for name, x in content.items()}


def key_of(request: Request, below: list[str]) -> str:
    """Return the hash of all ingredients of a stage's result."""
    return digest(ingredients_of(request, below))


def key_for(request: Request) -> str:
    """Return the key of a request; of one made in Python, that of all it says, of values laid over its model, and of earlier fits."""
    below = sorted({s.origin.key for s in request.store.states.values()})
    return request.key or digest([key_of(request, below), request.model.identity()])


def _by_hand(request: Request) -> list[str]:
    if request.hand is None:
        return []
    return [repr(list(request.hand.states.values())), repr(request.hand.root.tolist())]


def in_full(value: Any) -> Any:
    """Return what JSON cannot hold in a form that it can, every digit of every sample kept."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    return str(value)


def digest(content: object) -> str:
    """Return the hash of what JSON can hold, `in_full` helping."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=in_full).encode()).hexdigest()
