"""One question has one answer at every door: twelve models, and every way of asking for their temperatures.

Deterministic doors agree within 1e-6 K, written models within twice the step error that they state, draws without spread within 1e-6 K,
draws with a spread within three of their standard errors of what derivatives say, with the same draws within 1e-6 K, and a band of
predictions within 1 % of its half-width. A campaign has one verdict, state, RMSE and exit code at every door.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from properties.door_cases import CASES
from thermid.app.cli.app import app, main
from thermid.app.studio.courses import outcome_object
from thermid.app.studio.project import Project
from thermid.app.studio.work import Work
from thermid.base.errors import ThermidError
from thermid.interop.c99 import to_c
from thermid.interop.modelica import to_modelica
from unit.app.studio.test_one_truth import agree, opened
from unit.interop.programs import FAST, c99, octave
from unit.interop.test_fmu import CLOSE as FMU_CLOSE, fmpy_run
from unit.interop.test_modelica import CLOSE as MODELICA_CLOSE, farthest

Array = np.ndarray[Any, Any]
CLOSE = 1e-6
"""[K]"""
TIGHT = td.Options(error=4e-8)
SAMPLE = ("massless nodes", "two heights", "PI")
"""Models whose programs are compiled in every run of the tests."""
every_model = pytest.mark.parametrize("name", CASES)
written_models = pytest.mark.parametrize("name", [n if n in SAMPLE else pytest.param(n, marks=pytest.mark.campaign) for n in CASES])


class Asked:
    """A model and a scenario in a folder, and what `simulate` says of them."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        self.model, self.scenario = CASES[name].written(folder)
        self.times = np.linspace(0.0, self.scenario.seconds, 25)
        self.run = td.simulate(self.model, self.scenario, times=self.times, options=TIGHT)
        self.nodes = [n for n in self.run.nodes if n not in self.scenario.boundaries]
        self.spread = {next(p for p in ("bolt.conductance", "first.conductance", "low.conductance") if self._has(p)): "2 [%]"}

    def _has(self, path: str) -> bool:
        return path in td.simulation.compile_network(self.model).flat.parameters.table

    def farthest(self, found: Mapping[str, Array]) -> float:
        """Largest difference of temperatures (times,) from `simulate`. [K]"""
        return max(float(np.abs(found[n] - self.run[n].kelvin).max()) for n in self.nodes)

    def drawn(self, spread: Mapping[str, Any], n: int) -> td.qualify.UncertainRuns:
        """Runs of members at the times of `simulate`."""
        step = self.scenario.seconds / 24
        return td.qualify.uncertain_runs(self.model, self.scenario, spread=spread, n=n, seed=3, nodes=self.nodes, every=step, options=TIGHT)


@pytest.fixture
def asked(name: str, tmp_path: Path) -> Asked:
    return Asked(name, tmp_path)


def centred(found: Any, asked: Asked) -> dict[str, Array]:
    """Node -> the run of a prediction at the times of `simulate`; what moves its centre from there is what it names."""
    for n in asked.nodes:
        band = found[n]
        moved = sum(band.moved.values(), np.zeros(band.times.size))
        assert band.simulated + moved == pytest.approx(band.kelvin, abs=CLOSE)
    return {n: found[n].simulated[np.searchsorted(found[n].times, asked.times - 1e-6)] for n in asked.nodes}


def foreseen(asked: Asked) -> dict[str, Array]:
    known = td.design.Knowledge.of_source(asked.model)
    nothing = {p: "0 [%]" for p in asked.spread}
    found = td.design.foresee(known, asked.scenario, times=asked.times, spread=nothing, options=TIGHT).prediction
    assert all(not found[n].error.any() for n in asked.nodes)
    return centred(found, asked)


def predicted(asked: Asked) -> dict[str, Array]:
    channels = {
        f"T {n}": td.Channel.from_array(f"T {n}", asked.run[n].kelvin, unit="K", role="node", target=n, noise=0.01) for n in asked.nodes
    }
    told = td.compare(asked.model, td.Record.from_arrays("run", asked.times, channels), scenario=asked.scenario)
    return centred(td.predict(told, asked.scenario, times=asked.times, options=TIGHT), asked)


def drawn_without_spread(asked: Asked) -> dict[str, Array]:
    runs = asked.drawn({p: "0 [%]" for p in asked.spread}, 2)
    return {n: runs.node_temperatures(n)[1] for n in asked.nodes}


def prepared(asked: Asked) -> dict[str, Array]:
    found = td.prepare(asked.model, asked.scenario, list(asked.spread), times=asked.times, options=TIGHT).run(sensitivities=True)
    return {n: found[n].kelvin for n in asked.nodes}


@every_model
@pytest.mark.parametrize("door", [prepared, foreseen, drawn_without_spread])
def test_every_door_gives_the_temperatures_of_a_run(asked: Asked, door: Callable[[Asked], dict[str, Array]]) -> None:
    assert asked.farthest(door(asked)) < CLOSE


@pytest.mark.parametrize("name", [n if n != "thermostat" else pytest.param(n, marks=pytest.mark.campaign) for n in CASES])
def test_a_prediction_is_the_run_and_what_it_says_that_moves_it(asked: Asked) -> None:
    assert asked.farthest(predicted(asked)) < CLOSE


@every_model
def test_a_run_that_starts_settled_starts_at_the_steady_state(asked: Asked) -> None:
    settled = asked.scenario.with_(start="steady")
    if "thermostat" in str(CASES[asked.name].deck):  # it keeps switching, and both say so
        for ask in (td.steady, td.simulate):
            with raises_code("run.no-steady-state"):
                ask(asked.model, settled)
        return
    found = td.steady(asked.model, settled)
    begun = td.simulate(asked.model, settled, times=[0.0, 1.0], options=TIGHT)
    assert max(abs(found[n] - begun[n].kelvin[0]) for n in asked.nodes) < CLOSE


@every_model
def test_hold_times_are_of_the_run(asked: Asked) -> None:
    """A limit a millionth of a kelvin below the highest temperature is passed by every member, and one as much above it by none."""
    runs, node = asked.drawn({p: "0 [%]" for p in asked.spread}, 40), asked.nodes[0]
    top = td.simulate(asked.model, asked.scenario, options=TIGHT)[node].highest + 273.15
    kept = [td.qualify.hold(runs, {node: td.quantity(top + d, unit="K")})[node].never for d in (-CLOSE, CLOSE)]
    assert kept == [0.0, 1.0]


@pytest.mark.parametrize("name", [n for n in CASES if n != "thermostat"])
def test_draws_scatter_as_derivatives_say(asked: Asked) -> None:
    """Three standard errors of the mean and of the standard deviation of 400 members; the same draws give the same temperatures."""
    count, (path,) = 400, asked.spread
    known = td.design.Knowledge.of_source(asked.model)
    band = td.design.foresee(known, asked.scenario, times=asked.times, spread=asked.spread, options=TIGHT).prediction
    runs = asked.drawn(asked.spread, count)
    for n in asked.nodes:
        end, at = runs.node_temperatures(n)[:, -1], np.searchsorted(band[n].times, asked.times[-1] - 1e-6)
        error = float(band[n].error[at])
        assert abs(end.mean() - band[n].kelvin[at]) < 3.0 * error / np.sqrt(count) + CLOSE, n
        assert abs(end.std() - error) < 3.0 * error / np.sqrt(2.0 * count) + CLOSE, n
    again = td.ensemble(asked.model, asked.scenario, {path: runs.draws[path][:20]}, times=asked.times, options=TIGHT)
    for n in asked.nodes:
        assert np.abs(again.temperatures(n).T - runs.node_temperatures(n)[:20]).max() < CLOSE, n


@every_model
def test_a_prediction_and_runs_of_the_same_draws_have_one_band(asked: Asked) -> None:
    """Both read one budget with the numbers of one seed: their centres and half-widths are within 1 % of the half-width."""
    count, known = 60, td.design.Knowledge.of_source(asked.model)
    told = td.predict(known, asked.scenario, spread=asked.spread, times=asked.times, draws=count, seed=3, options=TIGHT)
    compared(asked, told, asked.drawn(asked.spread, count))


def compared(asked: Asked, told: td.Prediction, runs: td.qualify.UncertainRuns) -> None:
    """Fail where the 95 % band of a prediction at the end is not that of runs."""
    for n in asked.nodes:
        drawn, at = runs.node_temperatures(n)[:, -1] - 273.15, np.searchsorted(told[n].times, asked.times[-1] - 1e-6)
        low, high = (float(ends[at]) for ends in told[n].interval())
        half = 0.5 * (high - low)
        found = np.quantile(drawn, [0.025, 0.975])
        assert abs(0.5 * float(found[1] - found[0]) - half) < 0.01 * half + CLOSE, n
        assert np.abs(found - [low, high]).max() < 0.02 * half + CLOSE, n
        assert abs(float(drawn.mean()) - float(told[n].celsius[at])) < 0.01 * half + CLOSE, n


def ended(work: Work) -> None:
    for _ in range(3000):
        if work.state()["ended"]:
            return
        time.sleep(0.01)
    pytest.fail(f"it never ended: {work.state()}")


@every_model
def test_the_studio_and_the_command_give_the_run(asked: Asked, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """As both ask: with the tolerance that is usual, which a run in Python has too."""
    usual = td.simulate(asked.model, asked.scenario)
    work = Work(Project(asked.folder / "unit.toml"))
    ended(work)
    for run in work._project.desk(work._project.stages[0]).curves({}):
        ends = {c.node: c.simulated[-1] for c in run.curves if c.node in asked.nodes}
        assert ends == pytest.approx({n: float(usual[n].celsius[-1]) for n in ends}, abs=1e-4)  # at times of its own, to its tolerance
    work.scenario(asked.model.title, "scenario 0", {}, {})
    ended(work)
    assert work.outcome is not None
    found = outcome_object(work.outcome)
    assert {c["name"] for c in found["curves"]} >= set(asked.nodes)
    for curve in found["curves"]:
        stored = np.isin(usual.times, curve["times"])  # between them lie turning points, which are found to the tolerance of a run
        assert np.count_nonzero(stored) >= 50
        shown = np.interp(usual.times[stored], curve["times"], curve["values"])
        assert shown == pytest.approx(usual[curve["name"]].celsius[stored], abs=CLOSE), curve["name"]
    words = ["thermid", "simulate", str(asked.folder / "unit.toml"), "--scenario", str(asked.folder / "run.toml"), "--json"]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as left:
        main()
    said = json.loads(capsys.readouterr().out)
    assert not left.value.code
    for n in asked.nodes:
        assert said["nodes"][n]["final_C"] == pytest.approx(float(usual[n].celsius[-1]), abs=CLOSE), n


def campaign_of(asked: Asked, limit: str) -> Path:
    """Write a campaign of one stage about the model, its two logs with noise, and a limit of the RMSE of the second one."""
    folder, said, rng = asked.folder, CASES[asked.name].scenario, np.random.default_rng(6)
    (folder / "thermid.toml").write_text("", encoding="utf-8")
    times = np.linspace(0.0, asked.scenario.seconds, 121)
    run = td.simulate(asked.model, asked.scenario, times=times, options=TIGHT)
    heads = {f"T{k}": n for k, n in enumerate(asked.nodes)}
    channels: dict[str, Any] = {head: {"node": n, "noise": "0.05 [K]"} for head, n in heads.items()} | {"AIR": {"boundary": "air"}}
    channels |= {load.upper(): {"load": load} for load in asked.scenario.commands}
    units = ["time_s", *(f"{head} [degC]" for head in (*heads, "AIR")), *(f"{load.upper()} [W]" for load in asked.scenario.commands)]
    for name in ("fitted", "judged"):
        noisy = [run[n].celsius + 0.05 * rng.standard_normal(times.size) for n in asked.nodes]
        rows = np.column_stack([times, *noisy, run["air"].celsius, *(run.load_powers[load] for load in asked.scenario.commands)])
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=",".join(units), comments="", fmt="%.4f")
    scenario = {key: said[key] for key in ("start", "schedule") if key in said}
    stage = {"name": "unit", "model": "unit.toml", "records": ["fitted"], "free": [*asked.spread], "scenario": scenario}
    asks = {
        "title": "doors",
        "note": "Synthetic.",
        "records": {r: {"file": f"{r}.csv", "time": "time_s", "channels": channels} for r in ("fitted", "judged")},
        "stages": [stage],
        "verdicts": [{"model": "unit", "record": "judged", "criteria": {"rmse": limit}}],
    }
    file = folder / "campaign.toml"
    file.write_text(tomlkit.dumps(asks), encoding="utf-8")
    return file


def command(*words: str) -> tuple[dict[str, Any], int]:
    """Return what a command prints as JSON, and its exit code."""
    done = CliRunner().invoke(app, [*words, "--json"])
    assert done.stdout, done.exception
    return json.loads(done.stdout), done.exit_code


def rows_of(page: Path) -> list[list[str]]:
    """Return the cells of every row of the tables of a page."""
    rows = re.findall(r"<tr.*?</tr>", page.read_text(encoding="utf-8"), re.DOTALL)
    return [[re.sub(r"<[^>]+>", "", cell).strip() for cell in re.findall(r"<t[dh].*?</t[dh]>", row, re.DOTALL)] for row in rows]


@pytest.mark.parametrize(("limit", "passed"), [("0.1 [K]", True), ("0.01 [K]", False)], ids=["met", "failed"])
@pytest.mark.parametrize("name", [n if n == "PI" else pytest.param(n, marks=pytest.mark.campaign) for n in CASES])
def test_a_campaign_has_one_verdict_at_every_door(asked: Asked, limit: str, passed: bool) -> None:
    """In Python, by `calibrate`, `predict --record` and `report`, in the studio."""
    file, page = campaign_of(asked, limit), asked.folder / "page.html"
    # the fit, which every other door finds again
    made, (said, code) = td.run_stages(file, cache=asked.folder / "results"), command("calibrate", str(file))
    (verdict,), (told,), (stage,), fit = made.verdicts, said["verdicts"], said["stages"], made["unit"]
    assert (verdict.passed, told["passed"], said["passed"], code) == (passed, passed, passed, 0 if passed else 1)
    assert {n: s["rmse_K"] for n, s in stage["sensors"].items()} == pytest.approx({n: s.rmse for n, s in fit.sensors.items()}, abs=CLOSE)
    assert fit.standing.to_dict("unit") == stage["standing"]
    assert stage["standing"]["state"] == ("credible" if passed else "failed")
    agree(opened(file), said)
    (record,) = command("predict", str(file), "--record", "judged")[0]["records"]
    judged = {n: s["rmse_K"] for n, s in told["sensors"].items()}
    assert {n: s["rmse_K"] for n, s in record["sensors"].items()} == pytest.approx(judged, abs=CLOSE)
    assert record["standing"]["state"] == stage["standing"]["state"]
    assert "()" not in record["standing"]["because"]
    assert command("report", str(file), "--to", str(page))[1] == code
    rows = ((row, row.index("RMSE")) for row in rows_of(page) if "RMSE" in row[1:4])
    shown = {row[k - 1]: (float(row[k + 1]), row[k + 4]) for row, k in rows if row[k - 1] in judged}
    mark = "✓ met" if passed else "✗ not met"
    assert {n: seen[1] for n, seen in shown.items()} == dict.fromkeys(judged, mark)
    assert {n: seen[0] for n, seen in shown.items()} == pytest.approx(judged, rel=5e-3)  # three digits


@written_models
def test_the_report_page_shows_the_run(asked: Asked) -> None:
    """Start, end, highest and lowest of every node, to the last digit that the page prints."""
    page = asked.folder / "page.html"
    td.report(td.Campaign("doors", {}, (), {}), to=page, scenarios=[("run", asked.run)])
    shown = {row[0]: [float(x) for x in row[1:]] for row in rows_of(page) if row and row[0] in asked.nodes and len(row) == 5}
    traces = {n: asked.run[n] for n in asked.nodes}
    found = {n: [t.celsius[0], t.final, t.highest, t.lowest] for n, t in traces.items()}
    assert {*shown} == {*asked.nodes}
    for n in asked.nodes:
        assert shown[n] == pytest.approx(found[n], abs=0.005 + CLOSE)


def written(write: Callable[[], str], kind: str) -> str:
    """Return a written model; skips where the kind of file refuses what the model has, with words that say so."""
    try:
        return write()
    except ThermidError as error:
        if error.code not in ("output.not-expressible", "model.element-not-supported"):
            raise
        pytest.skip(f"{kind} refuses: {error.message}")


@written_models
def test_c_gives_the_run_within_the_error_that_it_states(asked: Asked) -> None:
    header = asked.folder / "unit_c.h"
    text = written(lambda: to_c(asked.model, asked.scenario, header), "C")
    error = float(re.search(r"#define \w+_ERROR (\S+)", text).group(1))  # type: ignore[union-attr]
    found = c99(header, asked.times[1:], options=FAST)
    nodes = re.findall(r"_NODE_\w+ \d+ /\* (\S+) \*/", text)
    assert set(nodes) == set(asked.nodes)
    ours = np.column_stack([asked.run[n].kelvin[1:] for n in nodes])
    assert np.abs(found - ours).max() < 2.0 * error


@written_models
@pytest.mark.parametrize("form", ["CoSimulation", "ModelExchange"])
def test_an_fmu_gives_the_run(asked: Asked, form: str) -> None:
    td.interop.to_fmu(asked.model, asked.scenario, asked.folder / "unit.fmu")
    assert asked.farthest(fmpy_run(asked.folder / "unit.fmu", form, asked.times, tuple(asked.nodes))) < FMU_CLOSE


@written_models
def test_octave_gives_the_run(asked: Asked) -> None:
    file = asked.folder / "unit_m.m"
    written(lambda: td.interop.to_octave(asked.model, asked.scenario, file), "Octave")
    masses = [n for n in asked.nodes if asked.model.at(n).fields] if asked.model.nodes else asked.nodes
    found = octave(file, asked.times)
    assert found.shape[1] == len(masses)
    assert np.abs(found - np.column_stack([asked.run[n].celsius for n in masses])).max() < 2e-6


@every_model
def test_modelica_gives_the_run(asked: Asked) -> None:
    text = written(lambda: to_modelica(asked.model, asked.scenario, name="Unit", library="none"), "Modelica")
    assert farthest(text, asked.model, asked.scenario, []) < MODELICA_CLOSE
