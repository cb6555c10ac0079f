"""Assumed values ranked by what they do in kelvin, and runs outside of where a model was calibrated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thermid.dual import value_of
from thermid.model.resolve import ParameterSet, parameter_table
from thermid.model.signal import literal
from thermid.network.network import compile_network
from thermid.physics.constants import ATMOSPHERE, ICE_POINT
from thermid.qualify.foresight import Foresight, Known
from thermid.simulation.simulator import prepare
from thermid.units import TEMPERATURE

if TYPE_CHECKING:
    from thermid.qualify.plan_schema import TestTable, ValidityTable

__all__ = ["Assumption", "assumptions", "extrapolations"]

TENTH = 0.1
"""Standard deviation of an assumed value whose deck gives no range: a tenth of it."""


@dataclass(frozen=True)
class Assumption:
    """An assumed value and what it does.

    Parameters
    ----------
    path, text, basis : str     In the model; as written; what the deck says that it rests on.
    spread : float              Standard deviation over the value, by its range or a tenth. [-]
    effect : float              What that does to the point that it moves most, everything else held. [K]
    point, run : str            Where and in which run.
    ranged : bool               Whether the deck gave the range.
    fitted_around : bool        Whether values of the same part were fitted with it; then they take up most of a change.
    """

    path: str
    text: str
    basis: str
    spread: float
    effect: float
    point: str
    run: str
    ranged: bool
    fitted_around: bool


def assumptions(
    known: Mapping[str, Known], runs: Mapping[str, Foresight], nodes: Mapping[str, Mapping[str, str]]
) -> tuple[Assumption, ...]:
    """Return the assumed values, those that move a reference point most first; those that no fit was made around before the others.

    A value that a fit was made around moves less than it says here: the fitted ones take up most of a change.

    Parameters
    ----------
    known : dict    Run -> its model.
    runs : dict     Run -> what is expected of it.
    nodes : dict    Run -> node -> name of its reference point.
    """
    best: dict[str, Assumption] = {}
    for name, run in runs.items():
        model = known[name].model
        ahead = f"{known[name].at}." if known[name].at else ""
        fitted = {ahead + p for v in known[name].values for p in (*v, *(q for w in v.values() for q in w.also))}
        table = parameter_table(model)
        numbers = compile_network(model, media=run.scenario.media()).numbers().values
        loose = [p for p, e in table.items() if e.parameter.source == "assumed" and e.parameter.is_literal and p not in fitted]
        driven = {model.canonical(p) for p in (*run.scenario.schedule, *run.scenario.gains.values())}
        moved = {p for name in driven if name in table for p in (name, ParameterSet(model).literal_behind(name))}
        free = [p for p in loose if value_of(numbers[p]) and p not in moved]
        if not free:
            continue
        times = run.solution.times[:: max(1, run.solution.times.size // 60)]
        ready = prepare(model, run.scenario, free, times=times)
        found = ready.run(sensitivities=True)
        slopes = {n: np.abs(found.slopes(n)).max(axis=0) for n in nodes[name]}
        for k, path in enumerate(ready.free):
            given, value = table[path].parameter, abs(float(value_of(numbers[path])))
            low, high = given.minimum, given.maximum
            ranged = low is not None and high is not None and bool(np.isfinite(high - low))
            size = (high - low) / 12**0.5 if low is not None and high is not None and ranged else TENTH * value
            node = max(slopes, key=lambda n: float(slopes[n][k]))
            effect = float(slopes[node][k]) * size
            key, around = path.removeprefix(ahead), bool(fitted) and path.startswith(ahead)
            if key not in best or effect > best[key].effect:
                best[key] = Assumption(key, given.text, given.basis, size / value, effect, nodes[name][node], name, ranged, around)
    return tuple(sorted(best.values(), key=lambda a: (a.fitted_around, -a.effect)))


def extrapolations(test: TestTable, run: Foresight, validity: ValidityTable, nodes: Sequence[str], ahead: str = "") -> tuple[str, ...]:
    """Return in words where a run leaves the conditions under which the model was calibrated; nothing stated is nothing known.

    Parameters
    ----------
    test : TestTable            The test, with its gravity and orientation.
    run : Foresight             What is expected of it.
    validity : ValidityTable    Temperature, pressure, power of the whole unit, gravity and orientation of the calibration.
    nodes : sequence of str     Nodes whose temperature counts.
    ahead : str                 What the paths of the unit's loads begin with.
    """
    out = []
    if validity.temperature:
        low, high = (literal(t, TEMPERATURE, "validity.temperature") - ICE_POINT for t in validity.temperature)
        seen = [run.prediction[n].celsius for n in nodes]
        least, most = min(float(s.min()) for s in seen), max(float(s.max()) for s in seen)
        if least < low - 0.05 or most > high + 0.05:
            out.append(f"temperature {least:.0f} .. {most:.0f} degC; calibrated {low:.0f} .. {high:.0f} degC")
    else:
        out.append("temperature: the plan does not say where the model was calibrated")
    if validity.pressure:
        low, high = (literal(t, "Pa", "validity.pressure") for t in validity.pressure)
        least, most = _pressures(run)
        if least < low * 0.999 or most > high * 1.001:
            out.append(f"pressure {least:.3g} .. {most:.3g} Pa; calibrated {low:.3g} .. {high:.3g} Pa")
    if validity.power:
        low, high = (literal(t, "W", "validity.power") for t in validity.power)
        own = [np.broadcast_to(w, run.solution.times.shape) for load, w in run.solution.load_powers.items() if load.startswith(ahead)]
        total = np.sum(own, axis=0) if own else np.zeros(1)
        if float(total.min()) < low - 0.001 * high or float(total.max()) > 1.001 * high:
            out.append(f"power {float(total.min()):.3g} .. {float(total.max()):.3g} W; calibrated {low:.3g} .. {high:.3g} W")
    if validity.gravity and test.gravity:
        low, high = (literal(t, "m/s^2", "validity.gravity") for t in (validity.gravity[0], validity.gravity[-1]))
        here = literal(test.gravity, "m/s^2", f"{test.name}, gravity")
        if not low - 1e-6 <= here <= high + 1e-6:
            out.append(f"gravity {here:.3g} m/s^2; calibrated {low:.3g} .. {high:.3g} m/s^2")
    if validity.orientation and test.orientation and test.orientation not in validity.orientation:
        out.append(f"orientation {test.orientation}; calibrated {', '.join(validity.orientation)}")
    return tuple(out)


def _pressures(run: Foresight) -> tuple[float, float]:
    """Return the lowest and highest pressure of a run's gases. [Pa]"""
    times = run.solution.times
    found = [np.asarray(e.pressure.at(times), dtype=float) for e in run.scenario.environment.values()]
    every = [float(x) for p in found for x in (np.min(p), np.max(p))] or [ATMOSPHERE]
    return min(every), max(every)
