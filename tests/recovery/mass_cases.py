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
from thermid.inference.criticism import criticise, search_structure
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, TableSignal
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
class Truth:
    """What a bench really is: its deck, its power and air, and the numbers that were drawn.

    Parameters
    ----------
    deck : dict         Of the truth, with other numbers; the power is a command.
    values : dict       What was drawn -> its value.
    spreads : dict      The same -> standard deviation of the range that it was drawn from; of a mass that of its logarithm.
    begin : float       When the power sets in. [s]
    watts : array       The power that was set (times,). [W]
    air : array         (times,) [K]
    """

    deck: Mapping[str, Any]
    values: Mapping[str, float]
    spreads: Mapping[str, float]
    begin: float
    watts: np.ndarray
    air: np.ndarray

    def temperatures(self, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Return node -> temperature (times,) with some values. [K]"""
        made = copy.deepcopy(dict(self.deck))
        for path, value in values.items():
            name, _, what = path.partition(".")
            if what == "mass":
                made["nodes"][name]["mass"] = f"{value!r} [kg]"
            elif what == "coefficient":
                made["surfaces"][name]["htc"]["coefficient"] = f"{value!r} [W/(m^2 K)]"
            elif what == "emissivity":
                made["surfaces"][name]["emissivity"] = value
            elif what == "conductance":
                made["conductors"][name]["conductance"] = f"{value!r} [W/K]"
        power = {"temperature_coefficient": f"{values['growth']!r} [1/K]", "reference_temperature": "25 [degC]"}
        made["loads"] = {"heat": {"into": "case", "power": "1 [W]", **power}}
        settled = 1.0 + values["settling"] * np.exp(-np.maximum(TIMES - self.begin, 0.0) / values["pace"])
        boundaries = {"air": (TIMES, td.quantity(self.air, unit="K"))}
        given = Scenario("bench", boundaries=boundaries, start=f"{float(self.air[0])!r} [K]", duration=float(TIMES[-1]))
        commands = {"heat": TableSignal(TIMES, self.watts * settled, True)}
        run = simulate(td.model_from_dict(made), given.with_(commands=commands), times=TIMES)
        return {n: run[n].kelvin for n in made["nodes"]}

    def oracle(self) -> dict[str, float]:
        """Return the half-width of the 95 % interval of each mass, in parts of it, by the true laws and all that was drawn from.

        The posterior of a straight line about the truth, whose priors are normal: ``(J'J / sigma^2 + P^-1)^-1``.
        """
        sizes = {p: s * (self.values[p] if p.endswith(".mass") else 1.0) for p, s in self.spreads.items()}

        def apart(path: str) -> np.ndarray:
            ends = [self.temperatures({**self.values, path: self.values[path] + side * 0.02 * sizes[path]}) for side in (1.0, -1.0)]
            return np.concatenate([ends[0][n] - ends[1][n] for n in ends[0]]) / 0.04

        rows = np.column_stack([apart(p) for p in sizes]) / np.hypot(NOISE, STEP / 12**0.5)
        spread = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows + np.eye(len(sizes)))))
        return {p: 1.959964 * float(s) * self.spreads[p] for p, s in zip(sizes, spread, strict=True) if p.endswith(".mass")}


@dataclass(frozen=True)
class Drawn:
    """A bench: the model of the document, what is free, the log, the true masses [kg], and all of the truth."""

    model: Model
    free: tuple[str, ...]
    record: Record
    masses: Mapping[str, float]
    truth: Truth


def truth_of(rng: np.random.Generator, plain: Mapping[str, Any], matched: bool = False) -> Truth:
    """Return a truth that is drawn; `matched`: it has the document's structure."""
    values: dict[str, float] = {}
    spreads: dict[str, float] = {}

    def draw(name: str, low: float, high: float, share: float = 1.0) -> None:
        values[name] = share * float(rng.uniform(low, high))
        spreads[name] = float(np.log(high / low) if name.endswith(".mass") else high - low) / 12**0.5

    truth = lawful(dict(plain), rng) if not matched else copy.deepcopy(dict(plain))
    for name in truth["surfaces"] if not matched else ():  # as `lawful` drew them
        surface = truth["surfaces"][name]
        values |= {f"{name}.coefficient": float(surface["htc"]["coefficient"].split()[0]), f"{name}.emissivity": surface["emissivity"]}
        spreads |= {f"{name}.coefficient": 1.4 / 12**0.5, f"{name}.emissivity": 0.85 / 12**0.5}
    for name in plain["nodes"]:
        draw(f"{name}.mass", *((1.0, 2.5) if name == "case" else (0.3, 1.0)))
    for name in plain.get("conductors", {}):
        draw(f"{name}.conductance", 0.2, 1.5)
    draw("growth", 0.0, 0.004, 0.0 if matched else 1.0)
    begin, later = float(rng.choice([60.0, 600.0, 1800.0])), float(rng.uniform(10000.0, 14000.0))
    watts = np.where(TIMES < begin, 0.0, np.where(TIMES < later, rng.uniform(4.0, 8.0), rng.uniform(0.0, 2.5)))
    if rng.uniform() < 0.3:
        watts = np.where(TIMES > 17000.0, rng.uniform(3.0, 6.0), watts)
    draw("pace", 900.0, 3600.0)
    draw("settling", 0.0, 0.06, 0.0 if matched else 1.0)
    air = ICE + 23.0 + 0.4 * np.sin(TIMES / 5000.0 + rng.uniform(0, 6))
    return Truth(copy.deepcopy(truth), values, spreads, begin, watts, air)


def drawn(seed: int, parts: int | None = None, matched: bool = False, said: float | None = NOISE) -> Drawn:
    """Return a bench; its log has the power that was set, not what it became, and says a noise [K] or None.

    `matched`: the truth has the document's structure.
    """
    rng = np.random.default_rng([SEED, seed])
    plain = deck(1 + seed % 3 if parts is None else parts)
    truth = truth_of(rng, plain, matched)
    masses = {p: x for p, x in truth.values.items() if p.endswith(".mass")}

    def read(kelvin: np.ndarray) -> np.ndarray:
        return np.asarray(np.round((kelvin + NOISE * rng.standard_normal(TIMES.size) - ICE) / STEP) * STEP + ICE)

    channels = {
        n: Channel.from_array(n, read(kelvin), unit="K", role="node", target=n, noise=said, resolution=STEP)
        for n, kelvin in truth.temperatures(truth.values).items()
    }
    channels["air"] = Channel.from_array("air", read(truth.air), unit="K", role="boundary", target="air", noise=said, resolution=STEP)
    channels["P"] = Channel.from_array("P", truth.watts, quantity="power", role="load", target="heat")
    free = [*masses, *(f"{s}.effective_htc" for s in plain["surfaces"]), *(f"{c}.conductance" for c in plain.get("conductors", {}))]
    return Drawn(td.model_from_dict(plain), tuple(free), Record.from_arrays("bench", TIMES, channels), masses, truth)


def scores(found: Calibration, masses: Mapping[str, float]) -> list[float]:
    """Return by how many standard errors each mass is off, in logarithms as it is fitted."""
    return [float(np.log(found.values[p].in_unit / m) * found.values[p].value / found.values[p].error) for p, m in masses.items()]


def halves(found: Calibration, masses: Mapping[str, float]) -> list[float]:
    """Return the half-width of the 95 % interval of each mass, in parts of it."""
    return [1.959964 * found.values[p].error / found.values[p].value for p in masses]


def searched(first: Calibration) -> Calibration:
    """Return the fit of the structure that a search proposes, as `thermid improve` takes it."""
    assert first.request is not None
    search = search_structure(first.request)
    return fit(search.proposed.full_request) if search.proposed is not search.start else first


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
