"""From a bare log to a project: roles told by names, structure by held-out readings, files that the other commands take as they stand."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from by_code import of_code, raises_code
from thermid.app.cli.app import app
from thermid.base.errors import IdentificationError, NameNotFoundError, OutputError, RecordError, ThermidError, code_of
from thermid.campaign._start.project import TEMPLATES, parted, write_template
from thermid.campaign._start.proposal import KnownMass, StatedFacts, _within, propose, request_of
from thermid.campaign._start.roles import named_part, noise_of, part_name, roles_of, with_noise
from thermid.inference.criticism import Fitted, fitted_structure
from thermid.model.tree import TableSignal

pytestmark = pytest.mark.usefixtures("values_alone")


def bench(
    path: Path, hidden: float = 260.0, noise: float = 0.05, header: str = "time_s,T_plate_C,T_room_C,P_heater_W", duty: bool = False
) -> Path:
    """A synthetic log of a plate of 150 J/K, 0.3 W/K to the room, and 0.4 W/K to a mass inside that no sensor sees."""
    times = np.arange(0.0, 7200.0, 20.0)
    watts = np.select([times < 300, times < 2400, times < 3600, times < 5400], [0.0, 12.0, 3.0, 9.0], 0.0)
    room = 22.0 + 0.5 * np.sin(times / 2000.0)
    plate = inside = room[0]
    rng, rows = np.random.default_rng(1), [header]
    for t, p, air in zip(times, watts, room, strict=True):
        shown = p / 12.0 * 100.0 if duty else p
        rows.append(f"{t:g},{plate + noise * rng.standard_normal():.3f},{air:.3f},{shown:g}")
        for _ in range(20):
            flow = 0.4 * (plate - inside) if hidden else 0.0
            plate += (p - flow - 0.3 * (plate - air)) / 150.0
            inside += flow / hidden if hidden else 0.0
    path.write_text("\n".join(rows) + "\n")
    return path


def run(*arguments: str, code: int = 0) -> Any:
    found = CliRunner().invoke(app, [*arguments, "--json"])
    if isinstance(found.exception, ThermidError):  # `main` makes an object of it
        assert found.exception.exit_code == code, found.exception
        return {"message": found.exception.message}
    said = json.loads(found.stdout)
    open_ = arguments[0] == "init" and (said.get("cannot_tell") or said.get("unexplained") or said.get("not_physical"))
    assert found.exit_code == (code or (4 if open_ else 0)), found.output
    return said


def test_a_hidden_mass_is_found_written_checked_and_validated(tmp_path: Path) -> None:
    log = bench(tmp_path / "test.csv")
    made = run("init", str(log), "--to", str(tmp_path / "p"), "--name", "plate")
    assert made["masses"] == 2
    assert made["unexplained"] == ""
    checked = run("check", str(tmp_path / "p" / "campaign.toml"))
    assert not [f for f in checked["findings"] if f["severity"] == "error"]
    done = run("calibrate", str(tmp_path / "p" / "campaign.toml"))
    assert done["status"] == "ok"
    fitted = td.load_values(tmp_path / "p" / "results" / "first_fit.values.toml")
    assert fitted["plate.capacitance"].value == pytest.approx(150.0, rel=0.05)
    for name, kind in (("plate", "deck"), ("scenario", "scenario"), ("campaign", "campaign")):
        assert (tmp_path / "p" / f"{name}.toml").read_text().startswith(f"#:schema ./schema/{kind}.schema.json\n")
        assert (tmp_path / "p" / "schema" / f"{kind}.schema.json").is_file()
    text = (tmp_path / "p" / "plate.toml").read_text()
    assert "T_plate_C" in text
    assert "hidden: " in text
    run("simulate", str(tmp_path / "p" / "plate.toml"), "--scenario", str(tmp_path / "p" / "scenario.toml"))


def test_one_mass_stays_one_and_what_cannot_be_told_is_said(tmp_path: Path) -> None:
    made = run("init", str(bench(tmp_path / "test.csv", hidden=0.0)), "--to", str(tmp_path / "p"))
    assert made["masses"] == 1
    assert made["changes"] == []
    assert made["cannot_tell"] in ([], [1, 2])


def test_codes_of_a_sensor_are_masked_and_said_first(tmp_path: Path) -> None:
    code = "9999"
    log = bench(tmp_path / "test.csv")
    rows = log.read_text().splitlines()
    for k in (40, 41, 170):
        t, _, air, watts = rows[k].split(",")
        rows[k] = f"{t},{code},{air},{watts}"
    log.write_text("\n".join(rows) + "\n")
    found = CliRunner().invoke(app, ["init", str(log), "--to", str(tmp_path / "p"), "--name", "plate", "--evaluations", "700"])
    first, second, *_ = found.stdout.split("\n")
    assert "RMSE 0.0" in first
    assert re.match(r"T_plate_C: 3 .*\(9999\)", second)
    assert f"# {second}; " in (tmp_path / "p" / "campaign.toml").read_text()
    assert run("check", str(tmp_path / "p" / "campaign.toml"))["findings"] == []
    raw = tmp_path / "p" / "raw.toml"
    shutil.copy(log, tmp_path / "p" / "raw.csv")
    raw.write_text(
        'title = "raw"\n[records.t]\nfile = "raw.csv"\n[records.t.channels]\nT_plate_C = { node = "plate" }\n'
        'T_room_C = { boundary = "surroundings" }\nP_heater_W = { load = "heat_heater" }\n'
        '[[stages]]\nname = "a"\nmodel = "plate.toml"\nrecords = ["t"]\nfree = ["plate.capacitance"]\n'
    )
    (finding,) = run("check", str(raw))["findings"]
    assert finding["severity"] == "warning"
    assert finding["code"] == "record.stray-readings"
    assert re.search(r"'T_plate_C' .*'t' .*\(9999\)\. .*prepare = ", finding["message"])
    fitted = CliRunner().invoke(app, ["calibrate", str(raw)])
    told = " ".join(f"{fitted.output} {fitted.exception}".split())
    assert "(9999)" in told
    assert "ikely mistake" not in told


def test_a_duty_without_full_scale_gives_ratios_and_says_so(tmp_path: Path) -> None:
    log = bench(tmp_path / "test.csv", header="time_s,T_plate_C,T_room_C,heater_pct", duty=True)
    made = run("init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "150")
    assert "plate.capacitance = 100 J/K" in made["assumed"]
    assert "Assumed: plate.capacitance = 100 J/K" in (tmp_path / "p" / "test.toml").read_text()
    known = run("init", str(log), "--to", str(tmp_path / "q"), "--full-scale", "heater_pct=12 [W]", "--evaluations", "150")
    assert known["assumed"] == ""


def test_files_of_others_are_never_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says so before it searches for minutes."""

    def searched(*_: object, **__: object) -> None:
        raise AssertionError("it was searched before anybody asked whether the files may be written")

    monkeypatch.setattr("thermid.app.cli.start.propose", searched)
    log = bench(tmp_path / "test.csv")
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "campaign.toml").write_text("mine = 1\n")
    found = run("init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "100", code=2)
    assert code_of(found["message"]) == "output.over-another-file"
    assert (tmp_path / "p" / "campaign.toml").read_text() == "mine = 1\n"
    assert not (tmp_path / "p" / "logs" / "fit.csv").exists()
    assert isinstance(CliRunner().invoke(app, ["init", str(log), "--to", str(log)]).exception, NotADirectoryError)


def test_a_log_in_which_nothing_moves_is_declined(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = ["time_s,T_plate_C,P_W", *(f"{10 * k},{22 + 0.05 * rng.standard_normal():.3f},0.5" for k in range(200))]
    (tmp_path / "still.csv").write_text("\n".join(rows))
    found = run("init", str(tmp_path / "still.csv"), "--to", str(tmp_path / "p"), code=4)
    assert code_of(found["message"]) == "fit.not-determined"


def test_a_log_without_its_power_is_explained_by_no_structure(tmp_path: Path) -> None:
    log = bench(tmp_path / "test.csv")
    rows = [row.rpartition(",")[0] for row in log.read_text().splitlines()]
    log.write_text("\n".join(rows) + "\n")
    found = run("init", str(log), "--to", str(tmp_path / "q"), "--name", "plate", "--evaluations", "800", code=4)
    assert code_of(found["message"]) == "fit.not-determined"
    assert code_of(found["message"]) == "fit.not-determined"
    assert not (tmp_path / "q").exists()  # a deck of 4.5e-4 J/K was written


def test_a_current_is_asked_about_with_its_voltage_unless_a_power_is_their_product(tmp_path: Path) -> None:
    """Volts, amperes and revolutions were two questions and none."""
    rows = [f"{10 * k},{22 + 0.1 * k},12,{0.1 * (k > 20)},{1.2 * (k > 20)},{3000 * (k > 40)}" for k in range(80)]
    head = "time_s,T_box_C,V_IN [V],I_IN [A],P_IN [W],FAN_RPM"
    for cut, asked in ((slice(None), ["FAN_RPM"]), (slice(4), ["I_IN"])):
        (tmp_path / "log.csv").write_text("\n".join(",".join(row.split(",")[cut]) for row in (head, *rows)))
        questions = roles_of(tmp_path / "log.csv").questions
        assert [q.partition(" ")[0] for q in questions] == asked
    assert questions[0].endswith("--formula P='V_IN * I_IN'.")


def test_roles_by_names_units_and_by_hand(tmp_path: Path) -> None:
    log = bench(tmp_path / "test.csv")
    roles = roles_of(log)
    assert dict(roles.parts) == {"T_plate_C": "plate"}
    assert (roles.surroundings, [p.column for p in roles.powers]) == ("T_room_C", ["P_heater_W"])
    both = roles_of(log, ["T_plate_C=lid", "T_room_C=box"], "20 [degC]", ["P_heater_W=box"])
    assert dict(both.parts) == {"T_plate_C": "lid", "T_room_C": "box"}
    assert both.powers[0].node == "box"
    assert not both.logged
    with pytest.raises(NameNotFoundError, match="T_plate_C"):
        roles_of(log, ["T_plat_C"])
    (tmp_path / "none.csv").write_text("time_s,alpha\n0,1\n1,2\n2,3\n")
    with pytest.raises(RecordError, match="--temperature COLUMN=PART"):
        roles_of(tmp_path / "none.csv")


def test_a_part_is_named_in_any_case_or_by_its_column_and_what_is_dropped_stands_first(tmp_path: Path) -> None:
    """`--power P2=housingA` was refused, because the part of the column housingA is 'housinga'."""
    log = bench(tmp_path / "test.csv", header="time_s,housingA_C,T_room_C,P_heater_W")
    for name in ("housingA", "housinga", "housingA_C"):
        assert roles_of(log, powers=[f"P_heater_W={name}"]).powers[0].node == "housinga"
    assert named_part("conv", {"a": "b"}) == "conv"
    assert "--temperature" in roles_of(log, ["housingA_C"], "22 [degC]", ["P_heater_W"]).ignored["T_room_C"]  # not only that it is one
    rows = log.read_text().splitlines()
    log.write_text("\n".join([f"{rows[0]},alpha", *(f"{row},{k % 7}" for k, row in enumerate(rows[1:]))]) + "\n")
    found = CliRunner().invoke(app, ["init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "12"])
    assert found.stdout.split("\n")[1].startswith("Not used: alpha: ")


def test_stated_paths_are_the_paths(tmp_path: Path) -> None:
    """A contact between parts that `--path` did not name was proposed."""
    log = bench(tmp_path / "test.csv", hidden=0.0, header="time_s,T_plate_C,T_room_C,P_heater_W")
    rows = [row.split(",") for row in log.read_text().splitlines()]
    log.write_text("\n".join(",".join([t, a, a, a, *rest]) for t, a, *rest in rows).replace("T_plate_C,T_plate_C,T_plate_C", "a_C,b_C,c_C"))
    roles = replace(roles_of(log), powers=tuple(replace(p, node="a") for p in roles_of(log).powers))
    names: dict[bool, list[str]] = {}
    for stated in (True, False):
        facts = StatedFacts(paths=(("a", "b"), ("a", "c"))) if stated else StatedFacts()
        request = request_of(roles, [with_noise(roles.read(log))[0]], 150.0, 0.1, facts=StatedFacts(paths=(("a", "b"), ("a", "c"))))
        begun = fitted_structure((), request, {}, None, None, 2)
        names[stated] = [c.name for c in _within(roles, facts)(Fitted.of_problem(request, begun.problem, begun.end.fitted))]
    assert any("'b' and 'c'" in words for words in names[False])
    assert names[True] == [n for n in names[False] if not of_code([n], "element.contact", "'b' .*'c'")]


def test_names_of_parts() -> None:
    assert [part_name(c) for c in ("T1_C", "CASE", "1st sensor", "Stator_Body_C")] == ["t1", "case", "part_1st_sensor", "stator_body"]
    assert [part_name(c) for c in ("Potência", "Gehäuse außen")] == ["potencia", "gehause_aussen"]


def test_noise_is_that_of_second_differences_on_a_slope() -> None:
    rng = np.random.default_rng(2)
    values = 300.0 + np.linspace(0.0, 40.0, 2000) + 0.2 * rng.standard_normal(2000)
    assert noise_of(td.Channel.from_array("T", values, unit="K")) == pytest.approx(0.2, rel=0.1)
    steps = np.round(300.0 + np.linspace(0.0, 3.0, 2000) / 0.5) * 0.5
    assert noise_of(td.Channel.from_array("T", steps, unit="K")) == pytest.approx(0.5 / 12.0**0.5, rel=1e-6)


def test_the_last_three_tenths_judge_and_nothing_is_in_both(tmp_path: Path) -> None:
    roles = roles_of(bench(tmp_path / "test.csv"))
    record = roles.read(tmp_path / "test.csv")
    (fitted,), kept, _ = parted([record])
    assert fitted.times.size + kept.times.size == record.times.size
    assert fitted.duration == pytest.approx(0.7 * record.duration, rel=0.01)
    assert kept.times[0] == 0.0
    several, last, _ = parted([record, record])
    assert len(several) == 1
    assert last.name == "holdout"
    # a sensor that dies before the end judges nothing, and that is said
    name = next(n for n, c in record.channels.items() if c.quantity == "temperature")
    dead = replace(record[name], valid=record[name].valid & (np.arange(record.times.size) < 0.6 * record.times.size))
    (fitted,), kept, remarks = parted([record.with_channels(dead)])
    assert name in fitted.channels
    assert set(record.channels) - set(kept.channels) == {name}
    assert [r.partition(" ")[0] for r in remarks] == [name]


def test_a_power_that_nobody_placed_goes_where_the_readings_say(tmp_path: Path) -> None:
    """Two parts, the second one heated; the column's name says nothing."""
    deck = {
        "title": "Two",
        "needs": ["surroundings"],
        "nodes": {"a": {"capacitance": "100 [J/K]"}, "b": {"capacitance": "60 [J/K]"}},
        "conductors": {
            "ab": {"kind": "conduction", "between": ["a", "b"], "conductance": "0.2 [W/K]"},
            "a_out": {"kind": "conduction", "between": ["a", "surroundings"], "conductance": "0.3 [W/K]"},
        },
        "loads": {"heat": {"into": "b", "power": "0 [W]"}},
    }
    times = np.arange(0.0, 4000.0, 20.0)
    watts = np.where((times // 800).astype(int) % 2 == 0, 5.0, 0.0)
    given = td.Scenario(
        "s",
        boundaries={"surroundings": "22 [degC]"},
        loads={"heat": TableSignal(times, watts, True)},
        start="22 [degC]",
        duration="3980 [s]",
    )
    run_ = td.simulate(td.model_from_dict(deck), given, times=times)
    rng = np.random.default_rng(3)
    rows = ["time_s,T_left_C,T_right_C,T_room_C,P_W"]
    rows += [
        f"{t:g},{a + 0.05 * rng.standard_normal():.3f},{b + 0.05 * rng.standard_normal():.3f},22,{p:g}"
        for t, a, b, p in zip(times, run_["a"].celsius, run_["b"].celsius, watts, strict=True)
    ]
    (tmp_path / "two.csv").write_text("\n".join(rows))
    roles = roles_of(tmp_path / "two.csv")
    found = propose(roles, [roles.read(tmp_path / "two.csv")], evaluations=800)
    assert found.roles.powers[0].node == "right"
    assert found.chosen.nodes == 2


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_template_is_a_project(tmp_path: Path, name: str) -> None:
    command, files = write_template(name, tmp_path / "t")
    deck = next(f for f in files if f.stem in ("part", "box"))
    assert not [f for f in td.load_model(deck).check() if f.severity == "error"]
    assert "/schema/deck.schema.json\n" in deck.read_text()
    assert "/schema/scenario.schema.json\n" in (tmp_path / "t" / "scenario.toml").read_text()
    assert {f.name for f in files if "schema" in f.parts} == {"deck.schema.json", "scenario.schema.json"}
    assert all(f.is_file() for f in files)
    write_template(name, tmp_path / "t")  # again over what nobody changed
    assert run(*command.split()[1:])["status"] == "ok"
    deck.write_text("mine = 1\n")
    with pytest.raises(OutputError):
        write_template(name, tmp_path / "t")


def test_without_a_log_a_template_is_asked_for() -> None:
    found = run("init", code=2)
    assert all(f"{name} (" in found["message"] for name in ("part", "box", "chamber"))
    assert code_of(run("init", "--template", "brick", code=2)["message"]) == "name.unknown"
    assert "'brick'" in run("init", "--template", "brick", code=2)["message"]


def test_a_budget_that_ends_keeps_what_was_fitted_before(tmp_path: Path) -> None:
    """It ended within the second beginning, which keeps parts within their weight, and nothing was left of the first."""
    log = bench(tmp_path / "test.csv")
    roles = roles_of(log)
    facts = StatedFacts(masses={"plate": KnownMass(0.05, 30.0, 60.0, 10.0)})
    found = propose(roles, [roles.read(log)], 28, facts)
    assert found.chosen.values["plate.capacitance"] > 60.0
    assert not found.search.complete
    for few in (0, 3):
        with raises_code("fit.not-determined", IdentificationError):
            propose(roles, [roles.read(log)], few)


def test_declined_in_python_too(tmp_path: Path) -> None:
    times = np.arange(0.0, 1000.0, 10.0)
    still = td.Record.from_arrays("r", times, {"T": td.Channel.from_array("T", np.full(100, 300.0), unit="K", role="node", target="t")})
    (tmp_path / "l.csv").write_text("time_s,T\n0,1\n10,2\n")
    with raises_code("fit.not-determined", IdentificationError):
        propose(roles_of(tmp_path / "l.csv"), [with_noise(still)[0]])
