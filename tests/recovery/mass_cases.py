"""Synthetic benches whose truth has what the document's structure lacks: natural convection, radiation, powers that grow and settle.

A bench is one part, two joined ones or three in a row, under two or three levels of power. The first structure is that of the document:
constant effective coefficients, constant powers. Then what the tool itself proposes is taken and fitted in full.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import thermid as td
from recovery.mismatch import BOX, ICE, STEP, lawful
from thermid.base.errors import ThermidError
from thermid.fit.calibration import Calibration, fit
from thermid.inference.criticism import adopted, criticise, search_structure
from thermid.measure.records import Channel, Record
from thermid.model.elements import TableSignal
from thermid.model.tree import Model
from thermid.simulation.runs import Scenario, simulate

TIMES = np.arange(0.0, 21600.0 + 1.0, 60.0)
SEED = 20261123
NOISE = 0.05
MORE = ("lid", "base")


def deck(parts: int) -> dict[str, Any]:
    """The document's structure of some parts in a row."""
    out = copy.deepcopy(BOX)
    before = "case"
    for name in MORE[: parts - 1]:
        out["nodes"][name] = {"mass": {"value": "0.6 [kg]", "min": 0.1, "max": 3}, "specific_heat": "900 [J/(kg K)]"}
        seam = {"value": "0.5 [W/K]", "min": 0.02, "max": 20}
        out.setdefault("conductors", {})[f"{name}_seam"] = {"kind": "conduction", "between": [before, name], "conductance": seam}
        skin = {"value": "6 [W/(m^2 K)]", "min": 0.5, "max": 40}
        out["surfaces"][f"{name}_skin"] = {"of": name, "to": "air", "area": "0.02 [m^2]", "effective_htc": skin}
        before = name
    return out


@dataclass(frozen=True)
class Drawn:
    """A bench: the model of the document, what is free, the log, and the true masses [kg]."""

    model: Model
    free: tuple[str, ...]
    record: Record
    masses: Mapping[str, float]


def drawn(seed: int, parts: int | None = None, matched: bool = False, said: float | None = NOISE) -> Drawn:
    """Return a bench; its log has the power that was set, not what it became, and says a noise [K] or None.

    `matched`: the truth has the document's structure.
    """
    rng = np.random.default_rng([SEED, seed])
    plain = deck(1 + seed % 3 if parts is None else parts)
    truth = lawful(plain, rng) if not matched else copy.deepcopy(plain)
    masses = {f"{n}.mass": float(rng.uniform(1.0, 2.5) if n == "case" else rng.uniform(0.3, 1.0)) for n in plain["nodes"]}
    truth["nodes"] = copy.deepcopy(plain["nodes"])
    for path, mass in masses.items():
        truth["nodes"][path.removesuffix(".mass")]["mass"] = f"{mass!r} [kg]"
    for name, seam in plain.get("conductors", {}).items():
        truth["conductors"] = {**truth["conductors"], name: {**seam, "conductance": f"{rng.uniform(0.2, 1.5)!r} [W/K]"}}
    share = 0.0 if matched else 1.0
    power = {"temperature_coefficient": f"{share * rng.uniform(0.0, 0.004)!r} [1/K]", "reference_temperature": "25 [degC]"}
    truth["loads"] = {"heat": {"into": "case", "power": "1 [W]", **power}}
    begin, later = float(rng.choice([60.0, 600.0, 1800.0])), float(rng.uniform(10000.0, 14000.0))
    watts = np.where(TIMES < begin, 0.0, np.where(TIMES < later, rng.uniform(4.0, 8.0), rng.uniform(0.0, 2.5)))
    if rng.uniform() < 0.3:
        watts = np.where(TIMES > 17000.0, rng.uniform(3.0, 6.0), watts)
    pace = rng.uniform(900.0, 3600.0)
    settled = 1.0 + share * rng.uniform(0.0, 0.06) * np.exp(-np.maximum(TIMES - begin, 0.0) / pace)
    air = ICE + 23.0 + 0.4 * np.sin(TIMES / 5000.0 + rng.uniform(0, 6))
    given = Scenario(
        "bench", boundaries={"air": (TIMES, td.quantity(air, unit="K"))}, start=f"{float(air[0])!r} [K]", duration=float(TIMES[-1])
    )
    run = simulate(td.model_from_dict(truth), given.with_(commands={"heat": TableSignal(TIMES, watts * settled, True)}), times=TIMES)

    def read(kelvin: np.ndarray) -> np.ndarray:
        return np.asarray(np.round((kelvin + NOISE * rng.standard_normal(TIMES.size) - ICE) / STEP) * STEP + ICE)

    channels = {
        n: Channel.from_array(n, read(run[n].kelvin), unit="K", role="node", target=n, noise=said, resolution=STEP) for n in plain["nodes"]
    }
    channels["air"] = Channel.from_array("air", read(air), unit="K", role="boundary", target="air", noise=said, resolution=STEP)
    channels["P"] = Channel.from_array("P", watts, quantity="power", role="load", target="heat")
    free = [*masses, *(f"{s}.effective_htc" for s in plain["surfaces"]), *(f"{c}.conductance" for c in plain.get("conductors", {}))]
    return Drawn(td.model_from_dict(plain), tuple(free), Record.from_arrays("bench", TIMES, channels), masses)


def scores(found: Calibration, masses: Mapping[str, float]) -> list[float]:
    """Return by how many standard errors each mass is off, in logarithms as it is fitted."""
    return [float(np.log(found[p].in_unit / m) * found[p].value / found[p].error) for p, m in masses.items()]


def halves(found: Calibration, masses: Mapping[str, float]) -> list[float]:
    """Return the half-width of the 95 % interval of each mass, in parts of it."""
    return [1.959964 * found[p].error / found[p].value for p in masses]


def searched(first: Calibration) -> Calibration:
    """Return the fit of the structure that a search proposes, as `thermid improve` takes it."""
    assert first.request is not None
    search = search_structure(first.request)
    return fit(adopted(search.proposed)) if search.proposed is not search.start else first


def criticised(first: Calibration) -> Calibration:
    """Return the fit with the element that criticism suggests."""
    best = criticise(first).suggested
    return first if best is None or best.fit is None else best.fit


def departed(first: Calibration) -> Calibration:
    """Return the fit with its values and errors as they are expected if elements depart from their laws."""
    return replace(first, values=replace(first.values, items_=first.estimates))


STEPS: dict[str, Callable[[Calibration], Calibration]] = {
    "first structure": lambda first: first,
    "if elements depart": departed,
    "after `criticise`": criticised,
    "after `improve`": searched,
}


@dataclass
class Masses:
    """What became of the masses of several benches after one step.

    Parameters
    ----------
    off : list          Errors of masses in standard errors. [-]
    told : list         Whether the fit of each says that it is not adequate, and so does not stand for its interval.
    half : list         Half-widths of their 95 % intervals, in parts of the values. [-]
    refused : list      Messages of refusals.
    widened : int       Fits whose errors count what the structure may lack.
    inadequate : int    Fits that say of themselves that they are not adequate.
    """

    off: list[float] = field(default_factory=list)
    told: list[bool] = field(default_factory=list)
    half: list[float] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    widened: int = 0
    inadequate: int = 0

    @property
    def inside(self) -> float:
        """Share of the masses inside their 95 % intervals."""
        return float(np.mean(np.abs(self.off) < 1.959964)) if self.off else float("nan")

    @property
    def honest(self) -> float:
        """Share of the masses inside their 95 % intervals, or of a fit that says that it is not adequate."""
        return float(np.mean((np.abs(self.off) < 1.959964) | np.array(self.told, dtype=bool)))

    def take(self, found: Calibration, masses: Mapping[str, float]) -> None:
        """Count a fit."""
        self.off += scores(found, masses)
        self.half += halves(found, masses)
        self.told += [found.standing.state == "not adequate"] * len(masses)
        self.widened += found.structural_errors
        self.inadequate += found.standing.state == "not adequate"


def campaign(
    seeds: range, steps: tuple[str, ...] = tuple(STEPS), matched: bool = False, told: bool = False, said: float | None = NOISE
) -> dict[str, Masses]:
    """Return step -> what became of the masses of benches of some seeds, whose logs say a noise. [K]"""
    out = {step: Masses() for step in steps}
    for seed in seeds:
        bench = drawn(seed, matched=matched, said=said)
        try:
            first = td.calibrate(bench.model, bench.record, list(bench.free))
        except ThermidError as refusal:
            for step in steps:
                out[step].refused.append(str(refusal))
            continue
        for step in steps:
            try:
                found = STEPS[step](first)
            except ThermidError as refusal:
                out[step].refused.append(str(refusal))
                continue
            out[step].take(found, bench.masses)
            if told:
                off, half = ([round(x, 2) for x in f(found, bench.masses)] for f in (scores, halves))
                print(seed, step, found.standing.state, found.structural_errors, round(found.reduced_chi_square, 2), off, half, flush=True)
    return out
