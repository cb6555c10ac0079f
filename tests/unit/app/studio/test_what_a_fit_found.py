"""What the studio shows after a fit is that fit's: curves with its errors of sensors and starts, pictures with the powers of the record."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from planted import campaign
from thermid.app.objects import fit_object
from thermid.app.studio.desk import Desk
from thermid.app.studio.project import Project, StageState
from thermid.simulation.runs import prepare

pytestmark = pytest.mark.usefixtures("values_alone")

EXAMPLES = Path(__file__).parents[4] / "examples"
TIMES = 50
LOAD = re.compile(r"(?<=[>\s])([\w.]+) into ([\w.]+): ([^<,;]*) W(?=[;<])")


@pytest.fixture(scope="module")
def project(run_before: Callable[[], Project]) -> Project:
    """Three levels, all of them run: none has anything planted, and each says that it may be used."""
    return run_before()


def rmse(desk: Desk, values: dict[str, float]) -> dict[tuple[str, str], float]:
    return {(run.name, c.name): c.rmse for run in desk.curves(values) for c in run.curves}


def fitted(project: Project, name: str, values: dict[str, float]) -> dict[str, float]:
    """Return what the page holds after *Fit these*."""
    free = tuple(s.path for s in project.desk(name).sliders if s.free)
    found = fit_object(project.fit(name, values, free))
    return {p: v["value"] for p, v in found["values"].items()} | found["others"]


def shifted(desk: Desk, share: float) -> dict[str, float]:
    """Return every slider that the stage fits away from where it stands, within its bounds."""
    return {s.path: float(np.clip(share * s.value, s.low, s.high)) for s in desk.sliders if s.free}


def test_after_fit_these_the_curves_are_those_of_a_run(three_levels: Path, tmp_path: Path) -> None:
    """Within 2 mK at every sensor of every stage, never run before or run, from where the sliders stand or, by turns, from elsewhere."""
    project = Project(campaign(tmp_path))
    (tmp_path / "results").mkdir()

    def ran(name: str) -> StageState:
        for file in (three_levels / "results").glob(f"{name}.*"):
            shutil.copy(file, tmp_path / "results")
        return project.look(name)

    apart_of(project, ran)


@pytest.mark.campaign
def test_the_navigation_unit_s_stages_and_pictures_say_what_its_fits_found(tmp_path: Path) -> None:
    """The same of nine stages; and the powers drawn balance what is lost and stored at 50 random times of every record."""
    subprocess.run([sys.executable, str(EXAMPLES / "sisnav" / "laboratory.py"), str(tmp_path / "logs")], check=True, capture_output=True)
    project = Project(EXAMPLES / "sisnav" / "campaign.toml", tmp_path / "logs", tmp_path / "results")
    apart_of(project, project.run)
    assert worst_imbalance(project) < 0.01


def apart_of(project: Project, run: Callable[[str], StageState]) -> None:
    """Fail where curves after *Fit these* have another RMSE than after *Run*."""
    worst = gained = 0.0
    for k, name in enumerate(project.stages):
        project.look(name)
        before = project.desk(name)
        shown = [rmse(before, fitted(project, name, shifted(before, 1.3) if k % 2 else {}))]
        assert run(name).state == "done"
        desk = project.desk(name)
        ran = rmse(desk, {})
        shown += [rmse(desk, fitted(project, name, {} if k % 2 else shifted(desk, 0.8)))]
        worst = max([worst, *(abs(s[k] - ran[k]) for s in shown for k in ran)])
        gained = max(gained, *(rmse(before, {})[k] / ran[k] for k in ran))
    print(f"RMSE after Fit these less RMSE after Run: at most {1e3 * worst:.3f} mK")
    assert worst <= 0.002
    assert gained > 2.0  # there was something to find


def test_an_unticked_parameter_stays_where_its_slider_is_though_the_stage_has_a_prior_for_it(project: Project) -> None:
    found = project.fit("pair", {"foot_x.conductance": 0.9}, ("x.skin.effective_htc",))
    assert set(found.values.parameters) == {"x.skin.effective_htc"}
    assert found.model.parameter_table()["foot_x.conductance"].parameter.expression.literal.value == pytest.approx(0.9)
    again = project.fit("pair", {"foot_x.conductance": 0.9}, ("x.skin.effective_htc", "foot_x.conductance"))
    assert (
        again.values["foot_x.conductance"].prior == project.done["pair"].values["foot_x.conductance"].prior
    )  # the deck's, not the slider's


def test_a_picture_has_the_powers_of_the_record_times_the_factor_that_was_found(project: Project) -> None:
    rng, none = np.random.default_rng(11), 0
    for name in project.stages:
        desk, fit = project.desk(name), project.done[name]
        assert desk.problem is not None
        for run, experiment in enumerate(desk.problem.experiments):
            factors = {
                c.target: 1.0 - fit.values[f"{n} error"].value for n, c in experiment.record.channels.items() if f"{n} error" in fit.values
            }
            for time in rng.uniform(0.0, experiment.scenario.seconds, TIMES):
                picture = unescape(desk.moment({}, run, float(time)).drawn())
                drawn = {load: float(watts) for load, _, watts in LOAD.findall(picture)}
                assert set(drawn) == set(experiment.scenario.loads)
                for load, signal in experiment.scenario.loads.items():
                    true = float(signal.at(np.array([time]))[0]) * factors.get(load, 1.0)
                    none += true == 0.0
                    assert drawn[load] == pytest.approx(true, rel=6e-3, abs=1e-9)  # three digits are drawn
    assert none > TIMES  # the deck says 6 W, and the record has 0 W at many of these times


def test_what_goes_in_less_what_goes_out_is_stored(project: Project) -> None:
    """Within one per cent of the largest of the three, of every mass and of the whole, at random times of every record."""
    assert worst_imbalance(project) < 0.01


def worst_imbalance(project: Project) -> float:
    rng, worst = np.random.default_rng(12), 0.0
    for name in project.stages:
        desk = project.desk(name)
        assert desk.problem is not None
        for run, experiment in enumerate(desk.problem.experiments):
            ends = np.unique(np.concatenate([s.times for s in experiment.scenario.loads.values()]))
            k = rng.integers(0, ends.size - 1, TIMES)
            for time in ends[k] + rng.uniform(0.2, 0.8, TIMES) * (ends[k + 1] - ends[k]):  # not where a power switches
                worst = max(worst, imbalance(desk, run, float(time)))
    print(f"in - out - stored: at most {100 * worst:.3f} % of the largest of the three")
    return worst


def imbalance(desk: Desk, run: int, time: float, step: float = 2.0) -> float:
    """Return what does not add up of a picture, over the largest of what comes in, goes out and is stored."""
    now = desk.moment({}, run, time)
    model, scenario = desk.run_of(run, {})
    simulator = prepare(model, scenario, times=np.array([time - step, time + step]))
    network = simulator.wiring.network
    ends = simulator.run()
    held = {n: float(c) for n, c in network.numbers().capacitances.items() if c is not None}
    stored = {n: c * float(np.diff(ends[n].kelvin)[0]) / (2.0 * step) for n, c in held.items()}
    into = dict.fromkeys(held, 0.0)
    out = dict.fromkeys(held, 0.0)
    for load in network.flat.loads:
        into[load.node] += now.powers[load.path]
    for c in network.flat.conductors:
        for end, sign in zip(c.ends, (-1.0, 1.0), strict=True):
            if end in held:
                flow = sign * now.flows[c.path]
                into[end] += max(flow, 0.0)
                out[end] += max(-flow, 0.0)
    whole = max(*into.values(), *out.values(), 1e-3)
    return max(abs(into[n] - out[n] - stored[n]) / max(into[n], out[n], abs(stored[n]), 0.01 * whole) for n in held)


def test_the_picture_has_the_temperatures_of_the_curves(project: Project) -> None:
    desk = project.desk("pair")
    assert desk.problem is not None
    for run, curves in enumerate(desk.curves({})):
        for c in curves.curves:
            k = c.times.size // 2
            now = desk.moment({}, run, float(c.times[k]))
            bias = project.done["pair"].bias.get(c.name, 0.0)
            assert now.temperatures[c.node] - 273.15 + bias == pytest.approx(c.simulated[k], abs=2e-3)


def test_vacuum_and_scenarios_begin_where_the_fit_did(project: Project) -> None:
    """A record run again as its log was made: what the fit found of its boundaries and powers goes with it."""
    desk = project.desk("pair")
    model, scenario = desk.run_of(0, {}, sensors=False)
    found = project.done["pair"]
    solution = prepare(model, scenario, times=found.experiments[0].times).run()
    for o in found.experiments[0].observations:
        left = o.measured - solution[o.node].kelvin[o.index] - found.bias.get(o.sensor, 0.0)
        assert np.sqrt(np.mean(left**2)) == pytest.approx(found.statistics["pair_both"][o.sensor].rmse, abs=2e-3)


def test_a_sensor_that_touches_the_hardware_is_drawn_with_what_it_takes(tmp_path: Path) -> None:
    """Its tip, its lag as fitted, and its leads are part of what was run; so is the heat that they carry."""
    file = campaign(tmp_path)
    text, part = file.read_text(encoding="utf-8"), 'T1 = { node = "case", '
    more = 'lag = "90 [s]", lag_accuracy = "20 [s]", mass = "20 [g]", specific_heat = "500 [J/(kg K)]", gain_accuracy = "1 [%]", '
    assert part in text
    file.write_text(text.replace(part, part + more), encoding="utf-8")
    project = Project(file)
    project.look("part")
    project.run("part")
    desk = project.desk("part")
    values = fitted(project, "part", {})
    assert {"lag of T1", "scale of T1"} <= set(values)
    assert rmse(desk, values) == pytest.approx(rmse(desk, {}), abs=2e-3)
    assert "sensor_T1" in desk.moment(values, 0, 3000.0).drawn()
    now = desk.moment({}, 0, 3000.0)
    assert now.temperatures["sensor_T1.tip"] < now.temperatures["case"]  # it is warming up
    assert imbalance(desk, 0, 3000.0 + 30.0) < 0.01
    model, scenario = desk.run_of(0, {}, sensors=False)
    without = prepare(model, scenario).run()["case"].kelvin[-1]
    assert without == pytest.approx(desk.moment({}, 0, scenario.seconds).temperatures["case"], abs=0.3)
