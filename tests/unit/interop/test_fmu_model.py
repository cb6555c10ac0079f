"""Somebody's FMU as the model of a campaign: the same values, errors, verdicts and refusals as a deck's; synthetic readings throughout."""

from __future__ import annotations

import gc
import json
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from thermid.app.cli.app import app
from thermid.base.errors import RecordError, ScenarioError, SolverError, ThermidError
from thermid.base.files import command
from thermid.interop._fmu.as_model import fmu_model
from thermid.interop._fmu.export import to_fmu
from thermid.model.tree import TableSignal
from unit.interop.fmus import BOX, reference_fmu

pytest.importorskip("fmpy", reason="FMPy is not installed (pip install 'thermid[fmu]')")

TIMES = np.linspace(0.0, 1200.0, 21)


@pytest.fixture(autouse=True)
def _trusted(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """FMUs of these tests may run; what is remembered of them is forgotten."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
    with command(trust=True):
        yield


TRUTH = {"g": "1.1 [W/K]", "c": "41 [J/K]"}
BOUNDED = {"g": {"value": "0.8 [W/K]", "min": 0.1, "max": 5}, "c": {"value": "50 [J/K]", "min": 10, "max": 200}, "power": "5 [W]"}
DECK: dict[str, Any] = {**BOX, "parameters": BOUNDED}
NAMES = {"a": "T.a", "b": "T.b", "air": "T.air", "heat": "load.heat"}


def bench(power: float = 6.0, wave: float = 900.0) -> td.Scenario:
    """A room that swings and a heater that is switched."""
    air = 293.15 + 2.0 * np.sin(TIMES / wave)
    heat = np.where((TIMES // 300) % 2 == 0, power, 0.5 * power)
    plain = td.Scenario("bench", boundaries={"air": "20 [degC]"}, loads={"heat": "5 [W]"}, start="20 [degC]", duration="1200 [s]")
    return plain.with_(boundaries={"air": TableSignal(TIMES, air)}, loads={"heat": TableSignal(TIMES, heat, True)})


def log(path: Path, seed: int, scenario: td.Scenario | None = None, off: float = 0.0) -> Path:
    """A log of both nodes with noise of 50 mK, the room and the power."""
    scenario = scenario or bench()
    found = td.simulate(td.model_from_dict(BOX).with_values(TRUTH), scenario, times=TIMES)
    rng = np.random.default_rng(seed)
    noise = 0.05 * rng.standard_normal((2, TIMES.size))
    columns = [TIMES, found["a"].celsius + noise[0] + off, found["b"].celsius + noise[1], found["air"].celsius]
    columns.append(scenario.loads["heat"].at(TIMES))
    rows = ["time [s],a [degC],b [degC],air [degC],heat [W]", *(",".join(f"{x:.6f}" for x in row) for row in zip(*columns, strict=True))]
    path.write_text("\n".join(rows) + "\n")
    return path


def record(path: Path, names: dict[str, str] | None = None, nodes: tuple[str, ...] = ("a", "b")) -> td.Record:
    """A log bound by names of the deck, or of the FMU."""
    of = names or {n: n for n in NAMES}
    kelvin = {n: {"node": of[n], "noise": "0.05 [K]"} for n in nodes}
    return td.read_record(path, {**kelvin, "air": {"boundary": of["air"]}, "heat": {"load": of["heat"]}}, time="time")


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The box, its power an input in watts."""
    path = tmp_path_factory.mktemp("fmu") / "box.fmu"
    watts = td.Scenario("bench", boundaries={"air": "20 [degC]"}, loads={"heat": "5 [W]"}, start="20 [degC]", duration="1200 [s]")
    to_fmu(td.model_from_dict(DECK), watts, path)
    return path


def without(fmu: Path, to: Path, pattern: str) -> Path:
    """A copy whose description lacks what a pattern says."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(to, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                assert re.search(pattern, text)
                content = re.sub(pattern, "", text).encode()
            new.writestr(name, content)
    return to


HOW = {
    "directional": ("", 1e-4, ""),
    "differences": (r' providesDirectionalDerivatives="true"', 1e-3, "the FMU offers none"),
    "co-simulation": (r"<ModelExchange[^>]*/>", 2e-2, "co-simulation"),
}


@pytest.mark.parametrize("how", ["directional", pytest.param("differences", marks=pytest.mark.campaign), "co-simulation"])
def test_the_same_as_the_deck(how: str, fmu: Path, tmp_path: Path) -> None:
    """Values and errors of a fit with logged inputs, whatever makes the derivatives; co-simulation holds inputs over a step."""
    pattern, close, why = HOW[how]
    model = fmu_model(without(fmu, tmp_path / "other.fmu", pattern) if pattern else fmu)
    logs = [log(tmp_path / f"run{k}.csv", k, bench(6.0 - 2.0 * k, 900.0 - 300.0 * k)) for k in range(2)]
    native = td.calibrate(td.model_from_dict(DECK), [record(p) for p in logs], ["g", "c"])
    found = td.calibrate(model, [record(p, NAMES) for p in logs], ["p.g", "p.c"])
    for own, other in (("g", "p_g"), ("c", "p_c")):
        assert abs(found[other].value - native[own].value) < max(
            close * abs(native[own].value), 0.2 * (how == "co-simulation") * native[own].error
        )
        assert found[other].error == pytest.approx(native[own].error, rel=max(close, 1e-3))
    assert found.chi_square == pytest.approx(native.chi_square, rel=max(close, 1e-3))  # runs of a fit err by up to 1 mK of 50 mK of noise
    assert any(re.search(rf" FMU '\w+\.fmu' .*{why}", w) for w in found.warnings) == bool(why)


def campaign(folder: Path, fmu: Path, limit: str = "0.1 [K]", free: str = '"p.g", "p.c"', off: float = 0.0) -> Path:
    """A campaign of two records, priors, and a record that no stage uses."""
    (folder / "box.fmu").write_bytes(fmu.read_bytes())
    lines = ['title = "box"']
    for k, power in enumerate((6.0, 3.0, 8.0)):
        log(folder / f"run{k}.csv", k, bench(power), off if k == 2 else 0.0)
        lines += [f"[records.run{k}]", f'file = "run{k}.csv"', 'time = "time"']
        lines += [f'channels.{n} = {{ node = "T.{n}", noise = "0.05 [K]" }}' for n in ("a", "b")]
        lines += ['channels.air = { boundary = "T.air" }', 'channels.heat = { load = "load.heat" }']
    lines += ["[[stages]]", 'name = "box"', 'model = "box.fmu"', 'records = ["run0", "run1"]', f"free = [{free}]"]
    lines += ['priors."p.c" = { sd = "30 [J/K]" }' if "p.c" in free else ""]
    lines += ["[[verdicts]]", 'model = "box"', 'record = "run2"', f'criteria = {{ rmse = "{limit}" }}']
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n")
    return folder / "campaign.toml"


def ask(*words: object) -> tuple[int, Any]:
    """Exit code and object of a command."""
    done = CliRunner().invoke(app, [*map(str, words), "--json"])
    if isinstance(done.exception, ThermidError):
        return done.exception.exit_code, {"message": str(done.exception), "code": done.exception.code}
    return done.exit_code, json.loads(done.stdout)


def test_a_campaign_by_the_command_line(fmu: Path, tmp_path: Path) -> None:
    """Calibrated, judged on a record that no stage used, predicted, named."""
    path = campaign(tmp_path, fmu)
    code, said = ask("calibrate", path)
    assert code == 0
    assert said["verdicts"][0]["passed"]
    stage = said["stages"][0]
    assert stage["standing"]["state"] == "credible"
    for name, truth in (("p_g", 1.1), ("p_c", 41.0)):
        assert abs(stage["values"][name] - truth) < 3.0 * stage["errors_total"][name]
    code, said = ask("predict", path, "--record", "run2")
    assert code == 0
    assert said["records"][0]["rmse_K"] < 0.06
    assert any("does not show" in w or "structure is not known" in w for w in said["records"][0]["warnings"])
    code, said = ask("credibility", path)
    assert set(said["values"]) == {"p_g", "p_c", "p_b_capacitance", "p_out_conductance"}
    assert ask("check", path)[0] == 0


@pytest.mark.campaign
def test_a_failed_verdict(fmu: Path, tmp_path: Path) -> None:
    """Exit code 1, as of a deck."""
    code, said = ask("calibrate", campaign(tmp_path, fmu, off=0.5))
    assert code == 1
    assert said["stages"][0]["standing"]["state"] == "failed"


def double_campaign(tmp_path: Path) -> Path:
    """A campaign of an FMU whose power and a share of it act as a product alone."""
    double = {
        **DECK,
        "parameters": {**BOUNDED, "share": {"value": "1", "min": 0.1, "max": 3}},
        "loads": {"heat": {"into": "a", "power": "power*share"}},
    }
    quiet = td.Scenario("test", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1200 [s]")
    to_fmu(td.model_from_dict(double), quiet, tmp_path / "double.fmu")
    path = campaign(tmp_path, tmp_path / "double.fmu", free='"p.power", "p.share"')
    path.write_text(path.read_text().replace('channels.heat = { load = "load.heat" }', "").replace("[[stages]]", "[[stages]]\n"))
    return path


@pytest.mark.campaign
def test_what_cannot_be_told(tmp_path: Path) -> None:
    """Named before a fit."""
    code, said = ask("identify", double_campaign(tmp_path))
    assert code == 0
    assert "p_share" in json.dumps(said)


@pytest.mark.campaign
def test_what_cannot_be_told_is_not_fitted(tmp_path: Path) -> None:
    """Refused with exit code 4, with the product that is known."""
    path = double_campaign(tmp_path)
    code, said = ask("calibrate", path)
    assert code == 4
    assert "'p_power' and 'p_share' cannot be separated" in said["message"]


def test_starts(fmu: Path, tmp_path: Path) -> None:
    """A node without a sensor begins at the start of the FMU, said as assumed; one with a sensor at its reading, which is fitted."""
    only = record(log(tmp_path / "run.csv", 1), NAMES, ("a",))
    found = td.calibrate(fmu_model(fmu), only, ["p.g", "p.c"])
    assert [i.name for i in found.local] == ["initial.T_a"]
    rows = {(r.kind, r.name): r for r in found.inputs.rows}
    assert rows["start", "T_b"].source == "assumed"
    assert "FMU" in rows["start", "T_b"].words
    assert rows["start", "T_b"].mean == pytest.approx(293.15)


def test_events(tmp_path: Path) -> None:
    """A thermostat switches: differences of runs, said; the same values as those of the deck."""
    switched = {"into": "a", "power": "8 [W]", "thermostat": {"on_below": "28 [degC]", "off_above": "32 [degC]"}}
    deck = {**DECK, "loads": {"heat": switched}}
    quiet = td.Scenario("test", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="360 [s]")
    model = td.model_from_dict(deck)
    to_fmu(model, quiet, tmp_path / "box.fmu")
    there = fmu_model(tmp_path / "box.fmu")
    times = TIMES[TIMES <= 360.0]
    found = td.simulate(model.with_values({"g": "1.1 [W/K]"}), quiet, times=times)
    switched_at = np.flatnonzero(np.diff(np.sign(np.diff(found["a"].celsius))))
    assert switched_at.size >= 3, "it switches"
    rng = np.random.default_rng(3)
    text = ["time [s],a [degC],b [degC]"]
    text += [
        f"{t},{x:.5f},{y:.5f}"
        for t, x, y in zip(times, *(found[n].celsius + 0.05 * rng.standard_normal(times.size) for n in "ab"), strict=True)
    ]
    (tmp_path / "log.csv").write_text("\n".join(text) + "\n")

    def read(names: tuple[str, str]) -> td.Record:
        return td.read_record(
            tmp_path / "log.csv", {n: {"node": w, "noise": "0.05 [K]"} for n, w in zip("ab", names, strict=True)}, time="time"
        )

    native = td.calibrate(model, read(("a", "b")), ["g"], scenario=quiet)
    other = td.calibrate(there, read(("T.a", "T.b")), ["p.g"], scenario=replace(quiet, boundaries={"T.air": quiet.boundaries["air"]}))
    assert other["p_g"].value == pytest.approx(native["g"].value, rel=1e-3)
    assert any("it has events" in w for w in other.warnings)
    del there, other
    gc.collect()  # warns, which is an error here, where a program is still running


def test_refusals(fmu: Path, tmp_path: Path) -> None:
    """What an FMU cannot do is refused in words."""
    model, path = fmu_model(fmu), log(tmp_path / "run.csv", 1)
    given = {"air": {"boundary": "T.air"}, "heat": {"load": "load.heat"}}
    lagging = td.read_record(path, {"a": {"node": "T.a", "lag": "20 [s]"}, **given}, time="time")
    with raises_code("model.element-not-supported", RecordError, match="FMU"):
        td.calibrate(model, lagging, ["p.g"])
    ready, alone = record(path, NAMES), record(path, NAMES, ("a",))
    with raises_code("model.element-not-supported", ScenarioError):
        td.calibrate(model, ready, ["p.g"], scenario=td.Scenario("x", start="steady"))
    with raises_code("model.element-not-supported", ScenarioError):
        td.calibrate(model, alone, ["p.g"], scenario=td.Scenario("x", prescribed={"T.b": "20 [degC]"}))
    with raises_code("model.element-not-supported", ScenarioError):
        td.calibrate(model, ready, ["p.g"], scenario=td.Scenario("x", schedule={"p.c": "50 [J/K]"}))
    with pytest.raises((SolverError, ScenarioError), match=r"^box: .* FMU "):
        td.steady(model, td.Scenario("x", boundaries={"T.air": "20 [degC]"}))
    found = td.calibrate(model, ready, ["p.g", "p.c"])
    with pytest.raises(ScenarioError, match=r"^box: .* FMU "):
        td.inference.criticise(found, elements=True)
    assert td.inference.criticise(found).traces


@pytest.mark.parametrize("content", [b"PK nothing", b""], ids=["damaged", "empty"])
def test_a_file_that_is_no_fmu(content: bytes, fmu: Path, tmp_path: Path) -> None:
    """The place in the campaign, and what is wrong."""
    path = campaign(tmp_path, fmu)
    (tmp_path / "box.fmu").write_bytes(content)
    code, said = ask("calibrate", path)
    assert code == 2
    assert said["code"] == "file.another-kind"
    assert "stages.0" in said["message"]


def test_an_unknown_parameter(fmu: Path, tmp_path: Path) -> None:
    code, said = ask("calibrate", campaign(tmp_path, fmu, free='"p.gg"'))
    assert code == 2
    assert "p.g" in said["message"]


REFERENCE = {"VanDerPol": ("mu", 1.0, 2.3, "x0", 20.0), "Dahlquist": ("k", 1.0, 1.7, "x", 3.0)}


def fitted_reference(name: str, seeds: range, folder: Path) -> list[float]:
    """Errors of the parameter of a Reference-FMU over its standard error, a seed each."""
    import fmpy

    file = reference_fmu(name, folder)
    parameter, _, truth, output, end = REFERENCE[name]
    times = np.linspace(0.0, end, 101)
    exact = fmpy.simulate_fmu(
        str(file),
        fmi_type="ModelExchange",
        stop_time=end,
        output_interval=times[1],
        relative_tolerance=1e-9,
        start_values={parameter: truth},
        output=[output],
    )[output]
    out = []
    for seed in seeds:
        noisy = exact + 0.02 * np.random.default_rng(seed).standard_normal(101)
        (folder / "log.csv").write_text("\n".join(["time [s],y [degC]", *(f"{t},{y:.6f}" for t, y in zip(times, noisy, strict=True))]))
        run = td.read_record(folder / "log.csv", {"y": {"node": output, "noise": "0.02 [K]"}}, time="time")
        start = {n: f"{s} [degC]" for n, s in (("x0", 2.0), ("x1", 0.0), ("x", 1.0)) if n in fmu_model(file).nodes}
        found = td.calibrate(fmu_model(file), run, [parameter], scenario=td.Scenario("x", start="0 [degC]", initial=start))
        assert any("count as degC" in w for w in found.warnings)
        out.append((found[parameter].value - truth) / found[parameter].error)
    return out


@pytest.mark.parametrize("name", REFERENCE)
def test_a_reference_fmu(name: str, tmp_path: Path) -> None:
    """Compiled here from the sources of the Modelica Association: within two errors, one seed."""
    assert abs(fitted_reference(name, range(3, 4), tmp_path)[0]) < 2.0


@pytest.mark.campaign
@pytest.mark.parametrize("name", REFERENCE)
def test_many_seeds_of_a_reference_fmu(name: str, tmp_path: Path) -> None:
    """20 seeds: at most three beyond two errors, none beyond four."""
    off = np.abs(fitted_reference(name, range(20), tmp_path))
    assert (off > 2.0).sum() <= 3
    assert off.max() < 4.0


def test_names_and_units(fmu: Path, tmp_path: Path) -> None:
    """Names with other signs are kept as aliases; two that would be one are refused; units are converted."""
    model = fmu_model(fmu)
    assert model.canonical("p.b.capacitance") == "p_b_capacitance"
    assert str(model.parameters["p_g"].text) == "0.8 [W/K]"
    assert model.parameters["p_g"].maximum == 5.0
    with raises_code("name.taken", match="'p_g'"):
        fmu_model(renamed(fmu, tmp_path / "twice.fmu", 'name="p.c"', 'name="p_g"'))


def renamed(fmu: Path, to: Path, old: str, new: str) -> Path:
    """A copy with another text in its description."""
    with zipfile.ZipFile(fmu) as before, zipfile.ZipFile(to, "w") as after:
        for name in before.namelist():
            content = before.read(name)
            if name == "modelDescription.xml":
                assert old.encode() in content
                content = content.replace(old.encode(), new.encode())
            after.writestr(name, content)
    return to
