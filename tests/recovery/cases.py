"""Hidden truths, drawn as the stated priors say; logs of them; and whether a fit's 95 % interval holds the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import ThermidError
from thermid.base.units import quantity
from thermid.fit.calibration import calibrate
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, load_model, model_from_dict
from thermid.simulation.runs import Scenario, simulate

STACK = Path(__file__).parents[2] / "examples" / "02_stack" / "m_PrE.toml"
ICE = 273.15
Z95 = 1.959963984540054


@dataclass(frozen=True)
class Bench:
    """What is measured in every draw of a case.

    Parameters
    ----------
    model : Model
    ranges : dict       Parameter -> lowest, highest and unit of its truth; drawn evenly, or by its prior where it has one.
    nodes : dict        Sensor -> node.
    boundary : str      Of the logged room.
    runs : tuple        For every log: load -> power [W], and the start above the room [K].
    accuracy : float    Of the sensors, the room's among them. [K]
    meter : float       Of the power meters, relative; 0 when the powers are known. [-]
    noise : float       [K]
    step : float        Resolution of the sensors, 0 for none. [K]
    priors : dict       Parameter -> (mean, sd), in its unit.
    hours : float
    """

    model: Model
    ranges: Mapping[str, tuple[float, float, str]]
    nodes: Mapping[str, str]
    boundary: str
    runs: Sequence[tuple[Mapping[str, float], float]]
    accuracy: float
    meter: float
    noise: float = 0.05
    priors: Mapping[str, tuple[float, float]] | None = None
    hours: float = 5.0
    samples: int = 101
    step: float = 0.0


def draw(bench: Bench, rng: np.random.Generator) -> tuple[dict[str, float], list[Record]]:
    """Return a truth (values in the units of the ranges) and the logs that its sensors would have written."""
    truth = {}
    for path, (low, high, _) in bench.ranges.items():
        prior = (bench.priors or {}).get(path)
        truth[path] = rng.uniform(low, high) if prior is None else float(prior[0] * np.exp(prior[1] / prior[0] * rng.standard_normal()))
    hidden = bench.model.with_values({p: f"{v!r} [{bench.ranges[p][2]}]" for p, v in truth.items()})
    bias = {s: bench.accuracy * rng.standard_normal() for s in (*bench.nodes, "ROOM")}
    gain = {load: 1.0 + bench.meter * rng.standard_normal() for load in {k for powers, _ in bench.runs for k in powers}}
    return truth, [log(bench, hidden, k, bias, gain, rng) for k in range(len(bench.runs))]


def log(bench: Bench, hidden: Model, k: int, bias: Mapping[str, float], gain: Mapping[str, float], rng: np.random.Generator) -> Record:
    """Return what the sensors of run `k` would have written of a hidden model, their constant errors and its meters' factors given."""
    powers, above = bench.runs[k]
    times = np.linspace(0.0, 3600.0 * bench.hours, bench.samples)
    air = ICE + 24.0 + 0.5 * np.sin(times / 4000.0 + rng.uniform(0, 6))
    scenario = Scenario(
        f"run{k}",
        boundaries={bench.boundary: (times, quantity(air, unit="K"))},
        loads={load: f"{watts!r} [W]" for load, watts in powers.items()},
        start=f"{24.0 + above + rng.standard_normal()!r} [degC]",
        duration=float(times[-1]),
    )
    run = simulate(hidden, scenario, times=times)
    accuracy = bench.accuracy or None

    def shown(kelvin: np.ndarray) -> np.ndarray:
        return np.round((kelvin - ICE) / bench.step) * bench.step + ICE if bench.step else kelvin

    channels = {
        s: Channel.from_array(
            s,
            shown(run[node].kelvin + bias[s] + bench.noise * rng.standard_normal(times.size)),
            unit="K",
            role="node",
            target=node,
            noise=bench.noise,
            accuracy=accuracy,
            resolution=bench.step or None,
        )
        for s, node in bench.nodes.items()
    }
    channels["ROOM"] = Channel.from_array(
        "ROOM", shown(air + bias["ROOM"]), unit="K", role="boundary", target=bench.boundary, accuracy=accuracy
    )
    for load, watts in powers.items():
        metered = np.full(times.size, watts / gain[load])
        size = bench.meter * max(p[load] for p, _ in bench.runs) or None
        channels[f"P {load}"] = Channel.from_array(f"P {load}", metered, quantity="power", role="load", target=load, accuracy=size)
    return Record.from_arrays(f"run{k}", times, channels)


@dataclass(frozen=True)
class Outcome:
    """How far each fitted value lies from the truth, in standard errors (draws, parameters), in its fitted form."""

    paths: tuple[str, ...]
    scores: np.ndarray

    @property
    def coverage(self) -> dict[str, float]:
        """Parameter -> share of draws whose 95 % interval holds the truth."""
        return dict(zip(self.paths, np.mean(np.abs(self.scores) <= Z95, axis=0), strict=True))

    @property
    def pooled(self) -> float:
        """The same share over all parameters."""
        return float(np.mean(np.abs(self.scores) <= Z95))

    def __str__(self) -> str:
        each = ", ".join(f"{p} {c:.3f}" for p, c in self.coverage.items())
        return f"{self.scores.shape[0]} draws: coverage {each}; mean square {np.mean(self.scores**2, axis=0).round(2).tolist()}"


def outcome(bench: Bench, draws: int, seed: int, **more: Any) -> Outcome:
    """Return how the fits of many draws meet their truths; a refused fit is an error."""
    rng = np.random.default_rng(seed)
    rows = []
    priors = {p: (f"{m!r} [{bench.ranges[p][2]}]", f"{sd!r} [{bench.ranges[p][2]}]") for p, (m, sd) in (bench.priors or {}).items()}
    for k in range(draws):
        truth, records = draw(bench, rng)
        try:
            found = calibrate(bench.model, records, list(bench.ranges), priors=priors, **more)
        except ThermidError as error:
            raise AssertionError(f"draw {k} of seed {seed} was refused: {error}") from error
        hidden = bench.model.with_values({p: f"{v!r} [{bench.ranges[p][2]}]" for p, v in truth.items()})
        rows.append([_score(found[p], hidden.at(p).expression.literal.value) for p in bench.ranges])
    return Outcome(tuple(bench.ranges), np.array(rows))


def _score(found: Any, truth: float) -> float:
    if found.log:
        return float(np.log(found.value / truth) / (found.error / found.value))
    return float((found.value - truth) / found.error)


def _box(**skin: Any) -> Model:
    return model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"mass": {"value": "1.5 [kg]", "min": 0.3, "max": 6}, "specific_heat": "900 [J/(kg K)]"}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.05 [m^2]", **skin}},
            "loads": {"heat": {"into": "case", "power": "4 [W]"}},
        }
    )


def _effective() -> Model:
    return _box(effective_htc={"value": "6 [W/(m^2 K)]", "min": 0.5, "max": 40})


HTC = "skin.effective_htc"
ONE = {"T": "case"}


def one_htc() -> Bench:
    """One node, its coefficient, a biased sensor."""
    return Bench(_effective(), {HTC: (3.0, 10.0, "W/(m^2 K)")}, ONE, "air", [({"heat": 4.0}, 0.0)], 0.5, 0.0)


def one_htc_mass() -> Bench:
    """One node, its coefficient and its mass, a biased sensor and a meter good to 1 %."""
    ranges = {HTC: (3.0, 10.0, "W/(m^2 K)"), "case.mass": (0.8, 3.0, "kg")}
    return Bench(_effective(), ranges, ONE, "air", [({"heat": 4.0}, 0.0)], 0.25, 0.01)


def stack_interfaces() -> Bench:
    """The joint of m_PrE and what its level tunes of the supply, component values known."""
    ranges = {
        "stack.contact_conductance": (120.0, 500.0, "W/(m^2 K)"),
        "stack.gap.htc": (2.0, 7.0, "W/(m^2 K)"),
        "ele.skin.effective_htc": (1.6, 3.5, "W/(m^2 K)"),
    }
    both, one = {"proc.electronics": 4.11, "ele.electronics": 2.168}, {"proc.electronics": 4.11, "ele.electronics": 0.0}
    return Bench(load_model(STACK), ranges, {"T1": "proc.case", "T2": "ele.case"}, "cv", [(both, 0.0), (one, 0.0)], 0.1, 0.005)


def law_and_radiation() -> Bench:
    """Natural convection by a power law beside radiation, the emissivity known to 10 % before; a hot start."""
    model = _box(
        htc={"coefficient": {"value": "1.8 [W/(m^2 K)]", "min": 0.2, "max": 8}, "exponent": 0.25},
        emissivity={"value": "0.6", "min": 0.05, "max": 1},
    )
    ranges = {"skin.htc.coefficient": (1.0, 3.0, "W/(m^2 K)"), "skin.emissivity": (0.3, 0.9, "1")}
    return Bench(model, ranges, ONE, "air", [({"heat": 4.0}, 60.0)], 0.25, 0.01, priors={"skin.emissivity": (0.6, 0.06)})


CASES: dict[str, Callable[[], Bench]] = {f.__name__: f for f in (one_htc, one_htc_mass, stack_interfaces, law_and_radiation)}
