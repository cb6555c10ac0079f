"""The first hour with raw logs: thermometers that disagree at rest, masses from a scale, a deck to begin with, and what cannot be."""

from __future__ import annotations

import importlib.util
import itertools
import json
import re
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.base.errors import ThermidError, code_of
from thermid.campaign._start.proposal import Proposal, StatedFacts, _begun, base_deck, known_masses, not_physical, weights
from thermid.campaign._start.roles import roles_of, with_noise
from thermid.campaign.start import Roles
from thermid.inference.criticism import EvaluationBudget
from thermid.model.tree import model_from_dict

pytestmark = pytest.mark.usefixtures("values_alone")

SCRIPTS = Path(__file__).parents[4] / "scripts"


@pytest.fixture(scope="module")
def hour() -> ModuleType:
    """The simulated bench: a box with a board and a converter on a plate."""
    spec = importlib.util.spec_from_file_location("first_hour", SCRIPTS / "first_hour.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["first_hour"] = module
    spec.loader.exec_module(module)
    return module


def said(*arguments: str) -> tuple[int, Any]:
    """Run a command; return its exit code and its object."""
    found = CliRunner().invoke(app, [*arguments, "--json"])
    if isinstance(found.exception, ThermidError):
        return found.exception.exit_code, found.exception.message
    return found.exit_code, json.loads(found.stdout)


def plate(
    path: Path,
    columns: str = "T_plate [degC],T_room [degC],P [W]",
    scale: float = 1.0,
    offset: float = 0.0,
    rest: float = 600.0,
    step: float = 15.0,
) -> Path:
    """Write a log of a plate of 150 J/K with 0.3 W/K to the room, whose thermometer reads an offset too much; its power times a scale."""
    rng, rows, hot = np.random.default_rng(4), [f"time [s],{columns}"], 22.0
    for t in np.arange(0.0, 5400.0, step):
        watts = 0.0 if t < rest else 12.0 if t < 2400.0 else 3.0
        rows.append(f"{t:g},{hot + offset + 0.03 * rng.standard_normal():.3f},{22.0 + 0.03 * rng.standard_normal():.3f},{scale * watts:g}")
        hot += step * (watts - 0.3 * (hot - 22.0)) / 150.0
    path.write_text("\n".join(rows) + "\n")
    return path


def test_offsets_at_rest_are_found_said_and_written(hour: ModuleType, tmp_path: Path) -> None:
    """With offsets taken as heat the plate of 2700 J/K was proposed with 88 J/K, and two sensors lagged by 347 and 70 s."""
    bench = hour.Bench()
    log = hour.one_log(bench, tmp_path / "box.csv", step=60.0)
    code, made = said("init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "900")
    assert code in (0, 4)
    assert made["not_physical"] == []
    for column, part in (("BOX", "box"), ("PLATE", "plate")):
        true = bench.offsets[column] - bench.offsets["AMB"]
        assert abs(made["offsets_K"][column]["value"] - true) < 0.15, part
    campaign = (tmp_path / "p" / "campaign.toml").read_text()
    assert campaign.count('accuracy = "0.707 [K]"') == 4  # two thermometers, fitted and judged, against that of the room
    assert "BOX -0." in campaign
    assert "of AMB, +- 0.0" in campaign
    assert tomllib.loads(campaign)["records"]["fit"]["local"].keys() == {"initial.box", "initial.plate"}
    code, done = said("calibrate", str(tmp_path / "p" / "campaign.toml"))
    assert code in (0, 5)
    values = done["stages"][0]["values"]
    inside = sum(v for path, v in values.items() if path.endswith(".capacitance") and not path.startswith("plate"))
    assert inside == pytest.approx(1080.0 + 130.0 + 45.0, rel=0.25)
    assert values["plate.capacitance"] == pytest.approx(2700.0, rel=0.25)


def test_every_fit_counts_in_the_budget_and_the_best_beginning_is_kept(hour: ModuleType, tmp_path: Path) -> None:
    """On two long logs the fits before the search were not counted, and init did not end within 17 minutes."""
    log = hour.one_log(hour.Bench(), tmp_path / "box.csv", step=120.0)
    roles = roles_of(log)
    record, _ = with_noise(roles.read(log))
    roles = replace(roles, powers=tuple(replace(p, node="box", told=False) for p in roles.powers))
    spent = {}
    for allowed in (150, 2000):
        budget = EvaluationBudget(allowed)
        _, begun = _begun(roles, [record], StatedFacts(), budget)
        spent[allowed] = budget.spent, begun.end.cost
    assert 100 < spent[150][0] <= 150
    assert 150 < spent[2000][0] < 600  # twelve fits to the end took above 1000
    assert spent[2000][1] <= spent[150][1]


def test_a_late_power_does_not_make_one_body_of_a_box_and_its_plate(hour: ModuleType, tmp_path: Path) -> None:
    """The power heats a board first. A plate of 1683 J/K was proposed with 72 J/K, its contact of 3.7 W/K with .16, without a word."""
    bench = hour.varied(18)
    log = hour.faulty_log(bench, tmp_path / "box.csv", 18)
    mass = f"box={bench.capacities['box'] / 896.0:.3f} [kg]"
    code, made = said("init", str(log), "--to", str(tmp_path / "p"), "--mass", mass, "--material", "box=aluminium", "--evaluations", "700")
    assert code == 4
    assert all(part in made["powers"] for part in ("P_IN", "'box"))  # and not the board and the converter in it, of which it knows nothing
    assert made["powers"].split(". ")[0] in (tmp_path / "p" / "campaign.toml").read_text()
    assert [c["path"] for c in made["not_physical"]] == ["box.capacitance"]  # at the most that its weight allows
    deck = tomllib.loads((tmp_path / "p" / "box.toml").read_text())
    found = {path: float(deck[a][b][c].split()[0]) for path, a, b, c in (
        ("plate", "nodes", "plate", "capacitance"), ("contact", "conductors", "box_to_plate", "conductance"),
    )}  # fmt: skip
    assert 1 / 3 < found["plate"] / bench.capacities["plate"] < 3
    assert 1 / 3 < found["contact"] / bench.contact < 3


def test_a_weighed_part_beyond_its_weight_comes_back_by_several_changes(hour: ModuleType, tmp_path: Path) -> None:
    """The parts alone made a box of 1.75 of its heat; each change was refused because the box was still too heavy, and nothing proposed."""
    bench = hour.varied(11)
    log, weight = hour.faulty_log(bench, tmp_path / "box.csv", 11), f"box={bench.capacities['box'] / 896.0:.3f} [kg]"
    _, made = said("init", str(log), "--to", str(tmp_path / "p"), "--mass", weight, "--material", "box=aluminium 6061")
    assert made["not_physical"] == []
    assert made["masses"] == 3
    nodes = tomllib.loads((tmp_path / "p" / "box.toml").read_text())["nodes"]
    found = {name: float(node["capacitance"].split()[0]) for name, node in nodes.items()}
    plate = found.pop("plate")
    truth = dict(bench.capacities)
    assert plate == pytest.approx(truth.pop("plate"), rel=0.15)
    assert sum(found.values()) == pytest.approx(sum(truth.values()), rel=0.15)


def test_the_answer_is_the_same_under_a_clock_that_jumps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = plate(tmp_path / "log.csv", offset=0.6)
    first = CliRunner().invoke(app, ["init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "150"])
    ticks = itertools.count(step=50.0)
    monkeypatch.setattr(time, "monotonic", lambda: float(next(ticks)))
    again = CliRunner().invoke(app, ["init", str(log), "--to", str(tmp_path / "q"), "--evaluations", "150"])
    assert again.stdout.replace(f"{tmp_path}/q", f"{tmp_path}/p") == first.stdout
    assert (tmp_path / "q" / "log.toml").read_bytes() == (tmp_path / "p" / "log.toml").read_bytes()
    assert (tmp_path / "q" / "campaign.toml").read_bytes() == (tmp_path / "p" / "campaign.toml").read_bytes()


def test_a_log_of_another_logger_is_no_further_test(tmp_path: Path) -> None:
    """The first try of a test engineer with two loggers: "no column 'box'" did not say what to do."""
    log = plate(tmp_path / "log.csv", "T_plate [degC],T_room [degC],P [W]")
    (tmp_path / "supply.csv").write_text("time [s],V_IN [V],I_IN [A]\n" + "".join(f"{t},24.0,0.5\n" for t in range(50)))
    code, message = said("init", str(log), str(tmp_path / "supply.csv"), "--to", str(tmp_path / "p"))
    assert code == 2
    assert code_of(message) == "record.nothing-there"
    assert "`thermid look FIRST OTHER --join joined.csv`" in message
    joined, offset = tmp_path / "joined.csv", "5"
    code, _ = said("look", str(log), str(tmp_path / "supply.csv"), "--join", str(joined), "--offset", offset)
    roles = roles_of(joined, formulas={"P2": "V_IN * I_IN"}, powers=["P2=plate"])
    assert (code, dict(roles.parts), roles.surroundings) == (0, {"T_plate": "plate"}, "T_room")
    assert np.nanmax(roles.read(joined)["P2"].values) == 12.0
    first = joined.read_bytes()
    bare = tmp_path / "bare.csv"
    bare.write_text("time [s],V_IN [V],I_IN [A],K7\n" + "".join(f"{t},24.0,0.5,{t % 7}\n" for t in range(50)))
    done = CliRunner().invoke(app, ["look", str(log), str(bare), "--join", str(joined), "--offset", offset])
    assert done.exit_code == 0  # a log that thermid joined is written anew
    assert re.search(r"joined\.csv, \w+ K7: .*\[1\]", done.stdout.splitlines()[-1])
    assert joined.read_bytes() == first


def test_a_power_in_other_units_gives_a_part_that_cannot_be(tmp_path: Path) -> None:
    log = plate(tmp_path / "log.csv", scale=1e-3)  # kilowatts under a header of watts
    code, made = said("init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "100")
    assert code == 4
    (row,) = [r for r in made["not_physical"] if r["path"] == "t_plate.capacitance" or r["path"] == "plate.capacitance"]
    assert row["high"] > row["low"] > row["value"]
    assert "''" not in row["meaning"]  # no mass without a sensor may be this part
    assert f"# Not physical: {row['path']} = 0.1" in (tmp_path / "p" / "log.toml").read_text()


def test_a_mass_from_a_scale_gives_the_scale_of_a_duty(tmp_path: Path) -> None:
    log = plate(tmp_path / "log.csv", "T_plate [degC],T_room [degC],heater [%]", scale=100.0 / 12.0)
    _, ratios = said("init", str(log), "--to", str(tmp_path / "p"), "--evaluations", "150")
    assert "--mass plate=" in ratios["assumed"]
    weighed = ("--mass", "T_plate=0.167 [kg]", "--material", "plate=aluminium 6061")
    _, made = said("init", str(log), "--to", str(tmp_path / "q"), "--evaluations", "150", *weighed)
    assert made["assumed"] == ""
    (stage,) = tomllib.loads((tmp_path / "q" / "campaign.toml").read_text())["stages"]
    assert stage["priors"] == {"plate.capacitance": {"mean": "149.6 [J/K]", "sd": "10 [%]"}}
    code, message = said("init", str(log), "--to", str(tmp_path / "r"), "--mass", "lid=0.167 [kg]")
    assert (code, re.findall(r"'\w+'|plate", message)) == (2, ["'lid'", "plate"])
    code, message = said("init", str(log), "--to", str(tmp_path / "r"), "--mass", "plate=0.167 [kg]", "--material", "plate=wood")
    assert code == 2
    assert code_of(message) == "name.unknown"
    assert "'wood'. Known" in message


def test_a_deck_to_begin_with_is_kept(tmp_path: Path) -> None:
    log = plate(tmp_path / "log.csv", offset=-0.4)
    (tmp_path / "mine.toml").write_text(
        'title = "mine"\nneeds = ["lab"]\nnodes.plate = { capacitance = "90 [J/K]" }\n'
        'conductors.film = { kind = "convection", between = ["plate", "lab"], htc = "5 [W/(m^2 K)]", '
        'area = { value = "0.03 [m^2]", source = "measured" } }\nloads.foil = { into = "plate", power = "0 [W]" }\n'
    )
    _, made = said("init", str(log), "--to", str(tmp_path / "p"), "--deck", str(tmp_path / "mine.toml"), "--evaluations", "100")
    assert made["masses"] == 1
    assert made["offsets_K"]["T_plate"]["value"] == pytest.approx(-0.4, abs=0.05)
    text = (tmp_path / "p" / "campaign.toml").read_text()
    assert '= ["plate.capacitance", "film.htc"]' in text
    assert '= "foil"' in text
    assert '= "lab"' in text
    _, done = said("calibrate", str(tmp_path / "p" / "campaign.toml"))
    assert done["stages"][0]["values"]["plate.capacitance"] == pytest.approx(150.0, rel=0.03)
    assert done["stages"][0]["values"]["film.htc"] == pytest.approx(10.0, rel=0.03)


@pytest.mark.parametrize(
    ("unit", "formula"),
    [
        ("A2", "--formula P='X * "),
        ("kW/m2", "--formula P='X * "),
        ("A", "--formula P='V * X'"),
        ("1/min", "?"),
    ],
)
def test_a_column_that_only_its_owner_can_explain_is_asked_about(tmp_path: Path, unit: str, formula: str) -> None:
    log = plate(tmp_path / "log.csv", f"T_plate [degC],T_room [degC],X [{unit}]")
    (question,) = roles_of(log).questions
    assert question.startswith("X ")
    assert f"[{unit}]: " in question
    assert formula in question


def test_a_power_by_formula_is_taken_from_volts_and_amperes(tmp_path: Path) -> None:
    """Volts scatter, as meters do, and the log is a long one: its power is a mean, and changes when it was switched."""
    log = plate(tmp_path / "log.csv", "T_plate [degC],T_room [degC],I_IN [A]", scale=1.0 / 24.0, step=5.0)
    rows, volts = log.read_text().splitlines(), 24.0 + 0.01 * np.random.default_rng(6).standard_normal(1080)
    log.write_text("\n".join([rows[0] + ",V_IN [V]", *(f"{row},{v:.3f}" for row, v in zip(rows[1:], volts, strict=True))]))
    code, made = said("init", str(log), "--to", str(tmp_path / "p"), "--formula", "P_IN=V_IN * I_IN", "--evaluations", "200")
    assert code in (0, 4)
    assert made["questions"] == []
    _, done = said("calibrate", str(tmp_path / "p" / "campaign.toml"))
    assert done["stages"][0]["values"]["plate.capacitance"] == pytest.approx(150.0, rel=0.03)


def test_a_second_log_with_other_names_judges_what_the_first_one_proposes(tmp_path: Path) -> None:
    first = plate(tmp_path / "first.csv")
    second = plate(tmp_path / "zweite.csv", "Platte [degC],Raum [degC],Heizung [W]")
    second.write_text(second.read_text().replace("time [s]", "Zeit [s]"))
    names = ("--same", "T_plate=Platte", "--same", "T_room=Raum", "--same", "P=Heizung")
    code, _ = said("init", str(first), str(second), "--to", str(tmp_path / "p"), "--evaluations", "100", *names)
    assert code in (0, 4)
    code, done = said("calibrate", str(tmp_path / "p" / "campaign.toml"))
    assert code == 0
    assert done["verdicts"][0]["passed"]
    assert done["stages"][0]["values"]["plate.capacitance"] == pytest.approx(150.0, rel=0.03)
    code, message = said("init", str(first), str(second), "--to", str(tmp_path / "q"), "--same", "T_plate=Kasten")
    assert code == 2
    assert code_of(message) == "name.unknown"
    assert "'Kasten'. Columns: Zeit, Platte, Raum, Heizung" in message
    code, message = said("init", str(first), str(second), "--to", str(tmp_path / "q"), "--same", "BOX=Platte")
    assert code == 2
    assert code_of(message) == "name.unknown"
    assert "log. Columns: T_plate" in message


@pytest.mark.parametrize(("part", "masses", "word"), [(38.0, {}, True), (70.0, {}, False), (38.0, {"plate": "42 [g]"}, False)])
def test_a_part_that_is_only_what_follows_its_sensor_is_open(part: float, masses: dict[str, str], word: bool) -> None:
    """Of 38 J/K under a sensor and 600 J/K behind it the 600 may be the plate; a diode on a housing has both, so it is possible."""
    values = {"plate.capacitance": part, "inner.capacitance": 600.0}
    one: Any = SimpleNamespace(
        values=values,
        rmse=0.05,
        errors=lambda: dict.fromkeys(values, 0.05),
        problem=SimpleNamespace(experiments=[SimpleNamespace(network=SimpleNamespace(numbers=lambda _: SimpleNamespace(capacitances={})))]),
        request=SimpleNamespace(model=SimpleNamespace(conductors={})),
    )
    roles, known = Roles({"T": "plate"}, "Tamb"), known_masses(masses, dict.fromkeys(masses, "aluminium"))
    assert not not_physical(one, roles, known)
    proposal = Proposal(roles, SimpleNamespace(proposed=one, alike=()), {}, "", StatedFacts(masses=known))
    assert proposal.depending == ({"plate.capacitance": (38.0, 638.0)} if word else {})


def test_a_weighed_part_counts_what_is_fixed_to_it() -> None:
    """A hidden mass of 2000 J/K behind a box of 1.2 kg was proposed in place of the plate, whose heat capacity was then a tenth."""
    deck = {
        "title": "x",
        "needs": ["air"],
        "nodes": {n: {"capacitance": "1 [J/K]"} for n in ("box", "board", "plate", "between")},
        "conductors": {
            "rails": {"kind": "conduction", "between": ["board", "box"], "conductance": "1 [W/K]"},
            "up": {"kind": "conduction", "between": ["between", "board"], "conductance": "1 [W/K]"},
            "down": {"kind": "conduction", "between": ["between", "plate"], "conductance": "1 [W/K]"},
            "out": {"kind": "conduction", "between": ["box", "air"], "conductance": "1 [W/K]"},
        },
    }
    roles, masses = Roles({"BOX": "box", "PLATE": "plate"}), known_masses({"box": "1.2 [kg]"}, {"box": "aluminium 6061"})
    values = {"box.capacitance": 1000.0, "board.capacitance": 200.0, "plate.capacitance": 3000.0, "between.capacitance": 900.0}
    loose = {"rails.conductance": 1.0, "up.conductance": 0.1, "down.conductance": 0.2, "out.conductance": 9.0}
    (check,) = weights(model_from_dict(deck), values | loose, roles, masses)
    assert (check.path, check.value, check.verdict) == ("box.capacitance", 1200.0, "possible")
    (check,) = weights(model_from_dict(deck), values | loose | {"up.conductance": 0.3}, roles, masses)
    assert (check.value, check.verdict) == (2100.0, "not physical")


def test_a_value_that_other_structures_have_otherwise_is_named() -> None:
    def fitted(plate: float) -> Any:
        values = {"box.capacitance": 900.0, "plate.capacitance": plate, "box_to_plate.conductance": plate / 1000.0}
        ends = {"box_to_plate": SimpleNamespace(between=("box", "plate"))}
        request = SimpleNamespace(model=SimpleNamespace(conductors=ends))
        return SimpleNamespace(values=values, request=request)

    one = fitted(500.0)

    def found(*others: Any) -> Proposal:
        return Proposal(Roles({"BOX": "box", "PLATE": "plate"}), SimpleNamespace(proposed=one, alike=others), {}, "")

    assert found(fitted(1400.0)).depending == {}
    seen = found(fitted(1600.0))
    assert seen.depending == {"plate.capacitance": (500.0, 1600.0), "box_to_plate.conductance": (0.5, 1.6)}


def supplied(path: Path, power: str, seed: int) -> Path:
    """A synthetic log of a box of 900 J/K with a board of 130 and a converter of 70: they share the power of one meter, 75 and 25 %."""
    times = np.arange(0.0, 9000.0, 20.0)
    watts = np.select([times < 600, times < 3600, times < 5400, times < 7400], [0.0, 20.0, 5.0, 15.0], 0.0)
    rng, kelvin, rows = (
        np.random.default_rng(seed),
        np.full(3, 22.0),
        [f"time [s],BOX [degC],BOARD [degC],PSU [degC],AMB [degC],{power} [W]"],
    )
    for t, p in zip(times, watts, strict=True):
        rows.append(",".join([f"{t:g}", *(f"{x:.3f}" for x in kelvin + 0.03 * rng.standard_normal(3)), f"22,{p:g}"]))
        for _ in range(20):
            up, side = 1.1 * (kelvin[1] - kelvin[0]), 0.8 * (kelvin[2] - kelvin[0])
            flows = np.array([up + side - 0.9 * (kelvin[0] - 22.0), 0.75 * p - up, 0.25 * p - side])
            kelvin = kelvin + flows / np.array([900.0, 130.0, 70.0])
    path.write_text("\n".join(rows) + "\n")
    return path


def test_a_power_that_parts_share_has_fitted_shares(tmp_path: Path) -> None:
    """With all of it in one part a log of three parts had a fourth, and a converter of 0.02 J/K; nothing said how to share it."""
    first, second = supplied(tmp_path / "first.csv", "P_IN", 1), supplied(tmp_path / "second.csv", "Supply", 2)
    _, alone = said("init", str(first), "--to", str(tmp_path / "alone"), "--evaluations", "60")
    assert all(f"--power P_IN={part}" in alone["powers"] for part in ("board", "box", "psu"))
    shares = ("--power", "P_IN=board", "--power", "P_IN=psu", "--same", "P_IN=Supply")
    code, made = said("init", str(first), str(second), "--to", str(tmp_path / "p"), "--evaluations", "120", *shares)
    assert code in (0, 4)
    assert made["masses"] == 3
    assert re.match(r"Shares: 7\S* \+- \d", made["powers"])  # a share without an error was read as known
    code, done = said("calibrate", str(tmp_path / "p" / "campaign.toml"))
    assert code == 0
    assert done["verdicts"][0]["passed"]
    found = done["stages"][0]["values"]
    assert found["in_to_psu"] == pytest.approx(0.25, rel=0.1)
    assert found["psu.capacitance"] == pytest.approx(70.0, rel=0.15)
    assert found["board.capacitance"] == pytest.approx(130.0, rel=0.05)
    code, _ = said("init", str(first), "--to", str(tmp_path / "twice"), "--power", "P_IN=board", "--power", "P_IN=board")
    assert code == 2


def test_heat_that_leaves_with_light_is_a_share_of_the_surroundings(tmp_path: Path) -> None:
    """Shares of parts had to sum to one."""
    found = roles_of(supplied(tmp_path / "log.csv", "P_IN", 1), powers=["P_IN=board", "P_IN=psu", "P_IN=surroundings"])
    assert [p.node for p in found.powers] == ["board", "psu", "surroundings"]
    model = td.model_from_dict(base_deck(found, 100.0, 1.0))
    room = td.Scenario("s", boundaries={"surroundings": "22 [degC]"}, loads={p.load: "10 [W]" for p in found.powers})
    gains = {p.load: p.share for p in found.powers}
    rises = [
        td.steady(model.with_values({"in_to_psu": "0", "in_to_surroundings": share}), room.with_(gains=gains))["board"] - 295.15
        for share in ("0", "0.4")
    ]
    assert rises[1] == pytest.approx(0.6 * rises[0], rel=1e-3)


def test_gas_in_a_box_has_a_mass_too() -> None:
    assert known_masses({"inside": "2.4 [g]"}, {"inside": "air"})["inside"].capacitance == pytest.approx(0.0024 * 1007.0)
