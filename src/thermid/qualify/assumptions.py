"""Assumed values ranked by what they do in kelvin, and runs outside of where a model was calibrated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thermid.dual import value_of
from thermid.model.laws.signal import literal
from thermid.model.tree.tree import parameter_table
from thermid.physics.constants import ATMOSPHERE, ICE_POINT
from thermid.prediction.budget import assumed_values
from thermid.prediction.foresight import Foresight
from thermid.prediction.known import Known
from thermid.simulation.simulator import prepare
from thermid.units import TEMPERATURE

if TYPE_CHECKING:
    from thermid.qualify.plan_schema import TestTable, ValidityTable


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
    return ranked([a for name, run in runs.items() for a in effects(known[name], name, run, nodes[name])])


def ranked(effects_: Sequence[Assumption]) -> tuple[Assumption, ...]:
    """Return every assumed value once, where it moves a reference point most, the largest effect first."""
    best: dict[str, Assumption] = {}
    for a in effects_:
        if a.path not in best or a.effect > best[a.path].effect:
            best[a.path] = a
    return tuple(sorted(best.values(), key=lambda a: (a.fitted_around, -a.effect)))


def effects(known: Known, name: str, run: Foresight, nodes: Mapping[str, str]) -> list[Assumption]:
    """Return every assumed value at every reference point in one run; arguments as in `assumptions`."""
    model = known.model
    ahead = f"{known.at}." if known.at else ""
    fitted = {ahead + p for v in known.values for p in (*v, *(q for w in v.values() for q in w.also))}
    table = parameter_table(model)
    loose = assumed_values(model, run.scenario, fitted)
    if not loose:
        return []
    times = run.solution.times[:: max(1, run.solution.times.size // 60)]
    ready = prepare(model, run.scenario, [a.path for a in loose], times=times)
    found = ready.run(sensitivities=True)
    slopes = {n: np.abs(found.slopes(n)).max(axis=0) for n in nodes}
    out = []
    numbers = ready.wiring.network.numbers().values
    for k, one in enumerate(loose):
        path, given, value = one.path, table[one.path].parameter, abs(float(value_of(numbers[one.path])))
        key, around = path.removeprefix(ahead), bool(fitted) and path.startswith(ahead)
        for node, point in nodes.items():
            effect = float(slopes[node][k]) * one.size
            out.append(Assumption(key, given.text, given.basis, one.size / value, effect, point, name, one.ranged, around))
    return out


def uncounted(found: Sequence[Assumption], point: str, run: str, stated: Sequence[str]) -> float:
    """Return what assumed values that no fit was made around, and that no spread names, may move a point by: 95 %, together. [K]

    Parameters
    ----------
    found : sequence    Of `effects`.
    point, run : str    Reference point and run.
    stated : sequence   Names that are spread in that run, as in the model; ``scale.<load>`` stands for the load's power.
    """
    names = {*stated, *(f"{n.removeprefix('scale.')}.power" for n in stated if n.startswith("scale."))}
    own = [a.effect for a in found if (a.point, a.run) == (point, run) and not a.fitted_around and a.path not in names]
    return 1.96 * float(np.sqrt(np.sum(np.square(own))))


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
    unsaid = [k for k in ("temperature", "pressure", "power", "gravity", "orientation") if not getattr(validity, k)]
    if unsaid:
        out.append(f"{', '.join(unsaid)}: the plan does not say where the model was calibrated")
    unsaid = [k for k in ("gravity", "orientation") if getattr(validity, k) and not getattr(test, k)]
    if unsaid:
        out.append(f"{', '.join(unsaid)}: the test does not say")
    if validity.temperature:
        low, high = (literal(t, TEMPERATURE, "validity.temperature") - ICE_POINT for t in validity.temperature)
        seen = [run.prediction[n].celsius for n in nodes]
        least, most = min(float(s.min()) for s in seen), max(float(s.max()) for s in seen)
        if least < low - 0.05 or most > high + 0.05:
            out.append(f"temperature {least:.0f} .. {most:.0f} degC; calibrated {low:.0f} .. {high:.0f} degC")
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
