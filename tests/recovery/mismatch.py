"""Hidden truths whose law is not that of the model: natural convection and radiation behind a constant coefficient."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from recovery.cases import ICE, STACK
from thermid.base.errors import IdentificationError
from thermid.base.units import quantity
from thermid.fit.calibration import calibrate
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, load_model, model_from_dict
from thermid.prediction.bands import predict
from thermid.simulation.runs import Scenario, simulate

STEP = 0.0625
SCENARIOS = ("as fitted", "room at +61 C", "room at -34 C", "double power", "half the power")


@dataclass(frozen=True)
class Mismatch:
    """A model of constant coefficients, and how its hidden truth is drawn.

    Parameters
    ----------
    model : Model
    free : tuple            What is fitted.
    sensors : dict          Sensor -> node.
    boundary : str
    powers : dict           Load -> power. [W]
    """

    model: Model
    free: tuple[str, ...]
    sensors: Mapping[str, str]
    boundary: str
    powers: Mapping[str, float]


def lawful(deck: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Return a deck whose surfaces convect by c dT^0.25 and radiate."""
    out = dict(deck) | {"surfaces": {}}
    for name, surface in deck.get("surfaces", {}).items():
        kept = {k: v for k, v in surface.items() if k != "effective_htc"}
        natural = {"coefficient": f"{rng.uniform(0.8, 2.2)!r} [W/(m^2 K)]", "exponent": 0.25}
        out["surfaces"][name] = kept | {"htc": natural, "emissivity": float(rng.uniform(0.05, 0.9))}
    return out


BOX: dict[str, Any] = {
    "title": "Box",
    "needs": ["air"],
    "nodes": {"case": {"mass": {"value": "1.5 [kg]", "min": 0.3, "max": 6}, "specific_heat": "900 [J/(kg K)]"}},
    "surfaces": {
        "skin": {"of": "case", "to": "air", "area": "0.05 [m^2]", "effective_htc": {"value": "6 [W/(m^2 K)]", "min": 0.5, "max": 40}}
    },
    "loads": {"heat": {"into": "case", "power": "4 [W]"}},
}


def box(rng: np.random.Generator) -> tuple[Mismatch, Model]:
    """One node: its coefficient and its mass are fitted."""
    study = Mismatch(model_from_dict(BOX), ("skin.effective_htc", "case.mass"), {"T": "case"}, "air", {"heat": 4.0})
    hidden = lawful(BOX, rng)
    hidden["nodes"] = {"case": {"mass": f"{rng.uniform(1.0, 2.5)!r} [kg]", "specific_heat": "900 [J/(kg K)]"}}
    return study, model_from_dict(hidden)


def stack(rng: np.random.Generator) -> tuple[Mismatch, Model]:
    """m_PrE: both coefficients and the joint are fitted."""
    free = ("proc.skin.effective_htc", "ele.skin.effective_htc", "stack.contact_conductance")
    powers = {"proc.electronics": 4.11, "ele.electronics": 2.168}
    study = Mismatch(load_model(STACK), free, {"T1": "proc.case", "T2": "ele.case"}, "cv", powers)
    decks = {n: tomllib.loads((STACK.parent / f"{n}.toml").read_text(encoding="utf-8")) for n in ("ProcSISNAV", "EleGFO")}
    parts = {n: model_from_dict(lawful(deck, rng)) for n, deck in decks.items()}
    top = tomllib.loads(STACK.read_text(encoding="utf-8"))
    del top["set"]
    for part in top["submodels"].values():
        part["use"] = parts[part["use"].removesuffix(".toml")]
    joint = top["joints"]["stack"]
    joint["contact_conductance"] = f"{rng.uniform(150.0, 400.0)!r} [W/(m^2 K)]"
    return study, model_from_dict(top)


CASES = {"box": box, "stack": stack}


def bench(study: Mismatch, hidden: Model, rng: np.random.Generator) -> Record:
    """Return the log of a bench test at 24 C: DS18B20 with 0.25 K of constant error and steps of 1/16 K, meters good to 1 %."""
    times = np.linspace(0.0, 18000.0, 301)
    air = ICE + 24.0 + 0.5 * np.sin(times / 4000.0 + rng.uniform(0, 6))
    given = Scenario("bench", boundaries={study.boundary: (times, quantity(air, unit="K"))}, start="24 [degC]", duration=18000.0)
    run = simulate(hidden, given.with_(loads={k: f"{w} [W]" for k, w in study.powers.items()}), times=times)

    def read(kelvin: np.ndarray) -> np.ndarray:
        seen = kelvin + 0.25 * rng.standard_normal() + 0.05 * rng.standard_normal(times.size)
        return np.asarray(np.round((seen - ICE) / STEP) * STEP + ICE)

    channels = {
        s: Channel.from_array(s, read(run[n].kelvin), unit="K", role="node", target=n, noise=0.054, accuracy=0.25)
        for s, n in study.sensors.items()
    }
    channels["ROOM"] = Channel.from_array("ROOM", read(air), unit="K", role="boundary", target=study.boundary, accuracy=0.25)
    for load, watts in study.powers.items():
        shown = np.full(times.size, watts * (1.0 + 0.01 * rng.standard_normal()))
        channels[f"P {load}"] = Channel.from_array(f"P {load}", shown, quantity="power", role="load", target=load, accuracy=0.01 * watts)
    return Record.from_arrays("bench", times, channels)


def scenario(study: Mismatch, which: str) -> Scenario:
    """Return a scenario that was not fitted."""
    room = {"room at +61 C": 61.0, "room at -34 C": -34.0}.get(which, 24.0)
    times = {"double power": 2.0, "half the power": 0.5}.get(which, 1.0)
    loads = {k: f"{times * w} [W]" for k, w in study.powers.items()}
    return Scenario(which, boundaries={study.boundary: f"{room} [degC]"}, loads=loads, start=f"{room} [degC]", duration="5 [h]")


@dataclass(frozen=True)
class Hits:
    """Of one node in one scenario, draw by draw: truth less prediction, and its standard error, with and without the discrepancy. [K]

    `refused` counts draws whose fit was refused, since its log could not tell a value; nothing is predicted from them.
    """

    missed: np.ndarray
    wide: np.ndarray
    missed_plain: np.ndarray
    narrow: np.ndarray
    rise: np.ndarray
    refused: int = 0

    def coverage(self, wide: bool = True) -> float:
        """Share of draws whose 95 % band holds the truth."""
        missed, error = (self.missed, self.wide) if wide else (self.missed_plain, self.narrow)
        return float(np.mean(np.abs(missed) <= 1.959964 * error))

    def rms(self, wide: bool = True) -> float:
        """Root mean square of truth less prediction. [K]"""
        return float(np.sqrt(np.mean((self.missed if wide else self.missed_plain) ** 2)))

    def half_width(self, wide: bool = True) -> float:
        """Median half-width of the 95 % band. [K]"""
        return float(1.959964 * np.median(self.wide if wide else self.narrow))


def campaign(case: str, draws: int, seed: int) -> dict[tuple[str, str], Hits]:
    """Return (scenario, node) -> how predictions meet hidden truths."""
    rng = np.random.default_rng(seed)
    rows: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    refused = 0
    for _ in range(draws):
        study, hidden = CASES[case](rng)
        try:
            found = calibrate(study.model, bench(study, hidden, rng), list(study.free))
        except IdentificationError:
            refused += 1
            continue
        for which in SCENARIOS:
            given = scenario(study, which)
            truth = simulate(hidden, given)
            wide, narrow = (predict(found, given, times=[9000.0, 18000.0], without=w) for w in ((), ("structural", "misfit")))
            for node in study.sensors.values():
                a, b = wide[node].final, narrow[node].final
                rise = truth[node].final - given.boundaries[study.boundary].value + ICE
                end = truth[node].final
                rows.setdefault((which, node), []).append((end - a.celsius, a.error, end - b.celsius, b.error, rise))
    return {key: Hits(*np.array(several).T, refused) for key, several in rows.items()}
