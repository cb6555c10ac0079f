"""Actions 1 to 7 of the study from one call: logs, both structures of the campaign, what they say of the hidden unit, scenarios.

Run by the demonstration and by ``write_study.py``. Nothing here reads what the laboratory hides before all fits and verdicts are done.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import laboratory
import numpy as np
import structures
from numpy.typing import NDArray

import thermid as td
from thermid.physics.radiation import radiation_coefficient, radiation_conductance

Array = NDArray[np.float64]
HERE = Path(__file__).parent
HOUR = 3600.0
BENCH = td.Scenario("bench at 24 °C", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
MEMBERS, SEED = 400, 20261121
LEVEL = 0.95
LEVELS = ("Component", "m_AccS", "m_IMU", "m_PrE", "Sd")
LEVEL_OF = {"m_AccS": "m_AccS", "m_IMU": "m_IMU", "m_PrE": "m_PrE", "m_Sd": "Sd"}
PLACES = {
    "ProcSISNAV": {"ProcSISNAV": "skin", "m_PrE": "proc.skin", "m_Sd": "pre.proc.skin"},
    "EleGFO": {"EleGFO": "skin", "m_PrE": "ele.skin", "m_Sd": "pre.ele.skin"},
    "Acc": {"Acc": "skin", "m_AccS": "acc_x.skin", "m_IMU": "acc.acc_x.skin", "m_Sd": "imu.acc.acc_x.skin"},
    "AccS": {"m_AccS": "support_skin", "m_IMU": "acc.support_skin", "m_Sd": "imu.acc.support_skin"},
    "IMU support": {"m_IMU": "support_skin", "m_Sd": "imu.support_skin"},
    "FOG_h": {"FOG_h": "skin", "m_IMU": "fog_x.skin", "m_Sd": "imu.fog_x.skin"},
    "FOG_l": {"FOG_l": "skin", "m_IMU": "fog_y.skin", "m_Sd": "imu.fog_y.skin"},
    "disk": {"m_Sd": "disk_skin"},
}
"""Row of Table 2 -> stage -> the surface that it is there; the disk has no row in the document."""


@dataclass(frozen=True)
class Value:
    """A found value with its standard error, in SI."""

    value: float
    error: float


@dataclass(frozen=True)
class Recovered:
    """A value of a stage beside the hidden one; `truth` is None where the hidden unit has no such value."""

    stage: str
    name: str
    found: Value
    truth: float
    unit: str

    @property
    def inside(self) -> bool:
        """Whether the truth lies within two standard errors."""
        return abs(self.found.value - self.truth) <= 2 * self.found.error


@dataclass(frozen=True)
class Vacuum:
    """One node without gas: interval [degC] over time, the hidden truth, and the printed bound."""

    node: str
    times: Array
    low: Array
    middle: Array
    high: Array
    truth: Array
    printed: Array
    settles: float

    @property
    def half_width(self) -> float:
        """Half the interval at the end over the rise. [-]"""
        return float((self.high[-1] - self.low[-1]) / 2 / (self.middle[-1] - self.middle[0]))

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth at the end."""
        return bool(self.low[-1] <= self.truth[-1] <= self.high[-1])

    @property
    def beyond(self) -> float:
        """By how much the truth leaves the interval on the way at most. [K]"""
        return float(max(np.max(self.low - self.truth), np.max(self.truth - self.high), 0.0))


@dataclass(frozen=True)
class Hidden:
    """A held-out prediction against the hidden temperature: largest error, largest half-width of its 95 % band [K], time inside [-]."""

    record: str
    sensor: str
    error: float
    half_width: float
    inside: float


@dataclass(frozen=True)
class Work:
    """What the study found.

    Parameters
    ----------
    folder : Path           Logs, what is hidden, decks of the second structure, results.
    study : Study
    constant, natural       The campaign with one constant coefficient a surface, and with convection and radiation apart.
    """

    folder: Path
    study: td.design.Study
    constant: td.Campaign
    natural: td.Campaign

    @cached_property
    def document(self) -> dict[str, Any]:
        """What the document prints, and its slips."""
        return tomllib.loads((HERE / "document.toml").read_text(encoding="utf-8"))

    @cached_property
    def hidden(self) -> laboratory.World:
        """The hidden unit, looked at when everything is fitted and judged."""
        return laboratory.World.make()

    @cached_property
    def gyros(self) -> dict[str, tuple[float, float]]:
        """Gyro -> its power at 24 degC [W], and how it changes with temperature [1/K], as they were logged."""
        logs = {"FOG_h": ("fog_h.csv", "T_FOG1"), "FOG_l": ("fog_l.csv", "T_FOG2")}
        return {gyro: structures.gyro_power(self.folder / "logs" / file, sensor) for gyro, (file, sensor) in logs.items()}

    def model(self, stage: str) -> td.Model:
        """Return the calibrated model of a stage, its gyros' power following their temperature as it was logged."""
        fitted = self.natural[stage].model
        measured = {}
        for path in td.simulation.compile_network(fitted).flat.parameters.table:
            if path.endswith("electronics.temperature_coefficient"):
                level, slope = self.gyros["FOG_h" if stage == "FOG_h" or "fog_x" in path else "FOG_l"]
                measured[path] = f"{slope!r} [1/K]"
                measured[path.replace("electronics.temperature_coefficient", "power")] = f"{level!r} [W]"
        return fitted.with_values(measured, "logged power")

    def draws(self, stage: str) -> dict[str, Array]:
        """Return values of a stage drawn from their covariance (members,)."""
        return self.natural[stage].values.draws(MEMBERS, SEED)

    def effective(self, stage: str, surface: str) -> Value:
        """Return the effective coefficient of a surface, radiation in it, where the stage's model settles on the bench. [W/(m^2 K)]"""
        model = self.natural[stage].model
        kelvin, found = _settled(model, surface), td.simulation.compile_network(model).numbers().values
        drawn = self.draws(stage)

        def of(name: str) -> Array:
            path = f"{surface}.{name}"
            return np.asarray(drawn.get(path, float(found[path])))

        def total(coefficient: Any, emissivity: Any) -> Any:
            convection = coefficient * (kelvin - laboratory.AMBIENT) ** structures.EXPONENT
            return convection + radiation_conductance(radiation_coefficient(emissivity, 1.0), kelvin, laboratory.AMBIENT)

        one = float(total(found[f"{surface}.htc.coefficient"], found[f"{surface}.emissivity"]))
        many = np.broadcast_to(total(of("htc.coefficient"), of("emissivity")), (MEMBERS,))
        return Value(one, float(many.std(ddof=1)))

    def true_effective(self, stage: str, surface: str) -> float:
        """Return the hidden unit's effective coefficient at the same temperature. [W/(m^2 K)]"""
        calibration = self.natural[stage]
        kelvin = _settled(calibration.model, surface)
        values = td.simulation.compile_network(self.hidden.models[calibration.model.title]).numbers().values
        convection = float(values[f"{surface}.htc.coefficient"]) * (kelvin - laboratory.AMBIENT) ** structures.EXPONENT
        radiation = radiation_conductance(radiation_coefficient(float(values[f"{surface}.emissivity"]), 1.0), kelvin, laboratory.AMBIENT)
        return convection + float(radiation)

    @cached_property
    def recovered(self) -> tuple[Recovered, ...]:
        """Everything that the campaign found, beside what is hidden; coefficients as effective ones, convection and radiation."""
        out = []
        for stage in self.natural:
            truth = td.simulation.compile_network(self.hidden.models[self.natural[stage].model.title]).numbers().values
            for path, v in self.natural[stage].values.parameters.items():
                if path.endswith(".htc.coefficient"):
                    surface = path.removesuffix(".htc.coefficient")
                    found, true = self.effective(stage, surface), self.true_effective(stage, surface)
                    out.append(Recovered(stage, f"{surface}, effective", found, true, "W/(m^2 K)"))
                else:
                    out.append(Recovered(stage, path, Value(v.value, v.error), float(truth[path]), v.unit))
        return tuple(out)

    def vacuum(self, stage: str, nodes: dict[str, str]) -> list[Vacuum]:
        """Return what a stage's model says without gas at nodes (label -> path), beside the hidden truth and the printed bound."""
        times = np.linspace(0.0, BENCH.seconds, 61)
        fit, model, empty = self.natural[stage], self.model(stage), BENCH.vacuum()
        meters = {f"scale.{load.path}": f"{laboratory.POWER_ACCURACY}" for load in td.simulation.compile_network(model).flat.loads}
        told = td.predict(fit, empty, model=model, spread=meters, times=times, nodes=list(nodes.values()), draws=MEMBERS, seed=SEED)
        truth = td.simulate(self.hidden.models[fit.model.title], empty, times=times)
        printed = td.simulate(td.load_model(HERE / f"{fit.model.title}.toml"), BENCH.vacuum(as_printed=True), times=times)
        out = []
        for label, node in nodes.items():
            band, rest = told[node], told.settled[td.simulation.compile_network(model).find(node)]
            low, high = band.interval(LEVEL)
            out.append(Vacuum(label, times, low, band.celsius, high, truth[node].celsius, printed[node].celsius, rest.celsius))
        return out

    def hidden_errors(self) -> list[Hidden]:
        """Return the predictions of the held-out logs against the hidden temperatures, sensor by sensor."""
        out = []
        for verdict in self.natural.verdicts:
            truth = np.genfromtxt(self.folder / "hidden" / f"{verdict.record}.csv", delimiter=",", names=True, skip_header=1)
            (experiment,), fit, times = verdict.prediction.experiments, self.natural[verdict.model], truth["time_s"]
            nodes = {o.sensor: o.node for o in experiment.observations}
            told = td.predict(fit, as_read(experiment, fit), as_logged=True, times=times, nodes=list(nodes.values()))
            for sensor, node in nodes.items():
                error, wide = told[node].celsius - truth[sensor], told[node].half_width
                out.append(
                    Hidden(verdict.record, sensor, float(np.abs(error).max()), float(wide.max()), float(np.mean(np.abs(error) <= wide)))
                )
        return out


def as_read(experiment: Any, fit: td.Calibration) -> td.Scenario:
    """Return the scenario of a held-out log as its instruments read it: a verdict corrects these by what the fit found of them."""
    found = {target: fit.instrument_errors[channel] for channel, (target, _) in experiment.shared.items()}
    scenario = experiment.bare
    boundaries = {b: s.raised(found[b]) for b, s in scenario.boundaries.items() if b in found}
    loads = {x: s.scaled(1.0 / (1.0 - found[f"scale.{x}"])) for x, s in scenario.loads.items() if f"scale.{x}" in found}
    return scenario.with_(boundaries=boundaries, loads=loads)


def _settled(model: td.Model, surface: str) -> float:
    """Return the temperature at which the node behind a surface settles on the bench. [K]"""
    *parts, name = surface.split(".")
    owner = model
    for part in parts:
        owner = owner.submodels[part].model
    return td.steady(model, BENCH)[td.simulation.compile_network(model).find(".".join([*parts, owner.surfaces[name].of]))]


def run(folder: Path, say: Callable[[str], None] = lambda text: None) -> Work:
    """Return the whole study, worked through in a folder."""
    study = td.design.load_study(HERE / "study.toml")
    say(f"{len(study.components)} physical items, {len(study.content.actions)} actions; making {len(laboratory.TESTS)} synthetic logs")
    laboratory.main(folder)

    def told(what: str) -> Callable[[str, int, float], None]:
        seen: set[str] = set()

        def notice(stage: str, count: int, rms: float) -> None:
            if stage not in seen:
                seen.add(stage)
                say(f"  {what}: {stage}")

        return notice

    say("calibrating as the document does: one constant coefficient a surface")
    constant = td.run_stages(study.campaign, data=folder, notice=told("constant"))
    say("calibrating with natural convection and radiation apart, values handed on with their covariance")
    natural = td.run_stages(structures.main(folder / "natural"), data=folder, notice=told("natural"))
    for campaign, name in ((constant, "constant"), (natural, "natural")):
        campaign.save(folder / "results" / name)
        for verdict in campaign.verdicts:
            say(f"  {name}: {verdict.model} on {verdict.record}: {'passed' if verdict.passed else 'FAILED'}")
    return Work(folder, study, constant, natural)
