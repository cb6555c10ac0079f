"""``thermid import, export, equations``: from a script to a run and to other tools, and what is refused."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from unit.app.cli.conftest import Call
from unit.interop.programs import STRICT, c99, octave

SCRIPT = """TempC = 24; % Ambient temperature [Celsius].
SpH = 480; % Spec. heat [J/(kg*K)].
Acc_SpH = SpH;
R = Inf; % Open [K/W].
P = 15*0.015; h = 6; % Power [W], coefficient [W/(m^2 K)].
m = 0.054; % Mass [kg].
A = ... % Area [m^2]
    0.001406 + 1.08*0.002592;
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    file = tmp_path / "Acc.m"
    file.write_text(SCRIPT, encoding="utf-8")
    return file


def test_a_script_becomes_a_deck_that_runs(call: Call, script: Path) -> None:
    deck = script.with_name("Acc.toml")
    said = call("import", script, "--block", "--to", deck)
    assert (said.code, said.err) == (0, "")
    assert said.out.splitlines()[0] == "TempC    24 [degC]                       Ambient temperature"
    assert said.out.splitlines()[-1].startswith("written: ")
    run = call("simulate", deck, "--boundary", "air=24", "--for", "5 [h]", "--json").object
    assert run["nodes"]["case"]["steady_C"] == pytest.approx(32.917191, abs=1e-6)
    assert call("check", deck).code == 0


def test_without_a_block_the_values_are_written_alone(call: Call, script: Path) -> None:
    deck = script.with_name("values.toml")
    said = call("import", script, "--to", deck)
    assert str(deck) in said.out.splitlines()[-1]
    assert not td.load_model(deck).nodes
    assert td.load_model(deck).parameters["Acc_SpH"].text == "SpH"


def test_the_object_of_an_import(call: Call, script: Path) -> None:
    found = call("import", script, "--json").object
    assert found["parameters"]["P"] == {"text": "15*0.015 [W]", "number": 0.225, "note": "Power , coefficient"}
    assert found["parameters"]["R"]["number"] is None  # infinite
    assert (found["status"], found["remarks"]) == ("ok", [])


def test_an_import_does_not_write_over_a_deck(call: Call, script: Path) -> None:
    deck = script.with_name("Acc.toml")
    deck.write_text("title = 'mine'\n", encoding="utf-8")
    said = call("import", script, "--to", deck)
    assert said.code == 2
    assert said.codes == ("output.over-another-file",)
    assert re.search(f"^error: {re.escape(str(deck))}: .*deck Acc.*--force", said.err)
    assert deck.read_text(encoding="utf-8") == "title = 'mine'\n"


def test_a_line_that_is_not_understood_is_named(call: Call, script: Path) -> None:
    script.write_text(SCRIPT + "x = magic(2);\n", encoding="utf-8")
    said = call("import", script)
    assert said.code == 2
    assert "Acc.m:9: 'magic(2)': 'magic(2)'" in said.err


def test_a_workbook_is_named_as_one(call: Call, tmp_path: Path) -> None:
    book = tmp_path / "box.xlsx"
    with zipfile.ZipFile(book, "w") as file:
        file.writestr("xl/workbook.xml", "<workbook/>")
    said = call("import", book)
    assert (said.code, said.codes) == (2, ("file.another-kind",))
    assert "spreadsheet.md" in said.err


def test_a_model_goes_to_octave(call: Call, accelerometer: Path, tmp_path: Path) -> None:
    said = call("export", accelerometer, "--boundary", "air=24", "--for", "5 [h]", "--load", "electronics=0.45", "--to", tmp_path / "acc.m")
    assert (said.code, said.err) == (0, "")
    found = octave(tmp_path / "acc.m", np.array([18000.0]))
    assert found[0, 0] - 24.0 == pytest.approx(2 * 8.917191, abs=2e-6)


def test_a_model_goes_to_spice(call: Call, accelerometer: Path) -> None:
    said = call("export", accelerometer, "--as", "spice", "--boundary", "air=24", "--for", "5 [h]", "--param", "area=0.005 [m^2]")
    assert all(part in said.out for part in ("R_skin", "air 33.3333333333"))
    assert (
        call("export", accelerometer, "--as", "spice", "--boundary", "air=24", "--for", "5 [h]", "--json").object["text"].endswith(".end\n")
    )


def test_a_model_goes_to_c(call: Call, accelerometer: Path, tmp_path: Path) -> None:
    """The page's program runs with the header that the page's command writes."""
    held = ("export", accelerometer, "--as", "c", "--boundary", "air=24", "--load", "electronics=0.45", "--for", "5 [h]")
    said = call(*held, "--to", tmp_path / "acc.h")
    assert (said.code, said.err, said.out) == (0, "", f"written: {tmp_path / 'acc.h'}\n")
    found = c99(tmp_path / "acc.h", np.array([18000.0]))
    assert found[0, 0] - 297.15 == pytest.approx(2 * 8.917191, abs=2e-3)
    page = (Path(__file__).parents[4] / "docs/exchange.md").read_text(encoding="utf-8")
    (tmp_path / "main.c").write_text(page.partition("```c file main.c\n")[2].partition("```")[0], encoding="ascii")
    subprocess.run(["gcc", *STRICT, "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    shown = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True).stdout
    assert 273.15 + 24.0 < float(shown) < 273.15 + 60.0
    assert call(*held, "--step", "5 [s]", "--to", tmp_path / "acc.h", "--force").code == 0
    assert "acc_STEP 5.0" in (tmp_path / "acc.h").read_text()


def test_a_fitted_model_and_a_vacuum_go_out(call: Call, accelerometer: Path, tmp_path: Path) -> None:
    from thermid.values.store import FittedValue, FittedValues

    value = FittedValue("area", 0.005, 1e-5, 1e-5, True, "m^2", 0.0042, (0.003, 0.006))
    FittedValues("s", {"area": value}, np.array([[1e-6]])).save(tmp_path / "v.toml")
    plain = ("export", accelerometer, "--as", "spice", "--boundary", "air=24", "--for", "5 [h]")
    assert all(part in call(*plain, "--values", tmp_path / "v.toml").out for part in ("R_skin", "air 33.3333333333"))
    closed = call(*plain, "--as-printed").out
    assert "R_skin" not in closed
    assert "\n* skin: " in closed
    assert "model.needs-gas-law" in call(*plain, "--vacuum").codes
    assert "'skin'" in call(*plain, "--vacuum").err
    assert "value.excludes-another" in call(*plain, "--vacuum", "--as-printed").codes


def test_equations_are_written(call: Call, stack: Path, tmp_path: Path) -> None:
    pytest.importorskip("sympy", reason="sympy is not installed (thermid[symbolic])")
    said = call("equations", stack, "--name", "stack.gap=R_cn3", "--name", "cv=T_amb")
    assert "R_cn3*(T_proc_case - T_ele_case)/Delta" in said.out
    assert call("equations", stack, "--as", "latex", "--to", tmp_path / "eq.tex").code == 0
    assert (tmp_path / "eq.tex").read_text(encoding="utf-8").startswith("\\begin{align}")
    assert call("equations", stack, "--json").object["symbols"]["R_stack_gap"] == "resistance of stack.gap [K/W]"
    for form in ("python", "octave"):
        assert "derivatives(t, T, p)" in call("equations", stack, "--as", form).out


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        (
            ("export", "DECK", "--as", "spyce"),
            "name.unknown",
            "--as: .*'spyce'.* 'spice'.* octave, c, modelica, spice, sinda, esatan, fmu",
        ),
        (("export", "DECK", "--as", "spice", "--step", "5 [s]"), "value.without-effect", "--step: .*'spice'"),
        (("export", "DECK", "--boundary", "air=24"), "value.outside-range", 'command line: .* = "5'),
        (("equations", "DECK", "--as", "tex"), "name.unknown", "--as: .*'tex'.* 'text'"),
    ],
)
def test_refusals(call: Call, accelerometer: Path, arguments: tuple[str, ...], code: str, match: str) -> None:
    said = call(*(accelerometer if a == "DECK" else a for a in arguments))
    assert (said.code, said.out, said.codes) == (2, "", (code,))
    assert re.search(match, said.err)


def test_a_change_without_a_number_of_its_own_is_said_first(call: Call, tmp_path: Path) -> None:
    case = tmp_path / "strap.inp"
    case.write_text(
        "HEADER CONTROL DATA, GLOBAL\n  ABSZRO = -273.15\n"
        "HEADER NODE DATA, A\n  -1, 20., 0.\n  2, 20., 5.\n  3, 20., 5.\nHEADER CONDUCTOR DATA, A\n  1, 1, 2, 2, 3, 0.5\n"
    )
    assert call("import", case, "--to", tmp_path / "strap.toml").code == 0
    back = ("write-back", case, tmp_path / "strap.toml", "--to", tmp_path / "back")
    said = call(*back, "--param", "A_G1_2.conductance=0.8 [W/K]", "--param", "A.T2.capacitance=6 [J/K]")
    assert re.fullmatch("INCOMPLETE: 1 .*: A_G1_2.conductance", said.out.splitlines()[0])
    assert "2, 20., 6 $" in (tmp_path / "back" / "strap.inp").read_text()
    found = call(*back, "--param", "A_G1_2.conductance=0.8 [W/K]", "--json").object
    assert (found["files"], found["not_written"]) == ([], ["A_G1_2.conductance"])


LOST = """HEADER CONTROL DATA, GLOBAL
  ABSZRO = -273.15
HEADER NODE DATA, BOX
  -1, 20., 0.
  2, 20., 50.
HEADER CONDUCTOR DATA, BOX
  1, 1, 2, 0.5
HEADER VARIABLES 1, BOX
  CALL ORBITAL(HEATS)
  CALL HEATRATE(Q2)
"""


def test_an_incomplete_import_marks_every_result(call: Call, tmp_path: Path) -> None:
    """The deck computed -139.9 degC where the tool prints 7 to 11, with exit code 0."""
    case, deck, bench = (tmp_path / name for name in ("lost.inp", "lost.toml", "bench.toml"))
    case.write_text(LOST)
    said = call("import", case, "--to", deck, "--scenario", bench)
    assert said.code == 5
    assert said.out.startswith("INCOMPLETE: ")
    model = td.load_model(deck)
    assert re.match("[123] .* SINDA ", model.incomplete)
    assert any(f.severity == "warning" and model.incomplete in f.message for f in model.check())
    for command in (
        ("simulate", deck, "--scenario", bench, "--for", "1 [h]"),
        ("steady", deck, "--scenario", bench),
        ("export", deck, "--scenario", bench, "--for", "1 [h]", "--as", "spice"),
    ):
        done = call(*command)
        assert (done.code, "INCOMPLETE: " in done.out + done.err) == (5, True), command
    for first in (("write-back", case, deck, "--param", "BOX.T2.capacitance=60 [J/K]", "--to", tmp_path / "back"), ("steady", deck)):
        done = call(*first, *(("--scenario", bench) if first[0] == "steady" else ()))
        assert (done.code, done.out.splitlines()[0].startswith("INCOMPLETE: ")) == (5, True), first
    done = call("simulate", deck, "--scenario", bench, "--for", "1 [h]", "--json").object
    assert done["standing"]["state"] == "incomplete"
    scenario = td.load_scenario(bench).with_(duration="1 [h]")
    assert any(w.startswith("INCOMPLETE") for w in td.simulate(model, scenario).warnings)
    mended = tmp_path / "mended.toml"
    mended.write_text("\n".join(line for line in deck.read_text().splitlines() if not line.startswith(("incomplete", "#"))) + "\n")
    assert call("simulate", mended, "--scenario", bench, "--for", "1 [h]").code == 0


def test_values_fitted_to_an_incomplete_deck_are_marked(call: Call, tmp_path: Path) -> None:
    (tmp_path / "lost.inp").write_text(LOST)
    call("import", tmp_path / "lost.inp", "--to", tmp_path / "lost.toml")
    model = td.load_model(tmp_path / "lost.toml")
    times = np.linspace(0.0, 600.0, 31)
    reading = td.Channel.from_array("T", 20.0 + 10.0 * np.exp(-times / 90.0), unit="degC", role="node", target="BOX.T2", noise=0.05)
    room = td.Channel.from_array("R", np.full(31, 20.0), unit="degC", role="boundary", target=model.needs[0])
    fit = td.calibrate(model, td.Record.from_arrays("log", times, {"T": reading, "R": room}), ["BOX.T2.capacitance"])
    assert (fit.standing.state, fit.standing.exit_code) == ("incomplete", 5)


def test_a_deck_that_states_no_unit_of_temperature_is_questioned(call: Call, tmp_path: Path) -> None:
    case = tmp_path / "warm.inp"
    bare = LOST.partition("HEADER VARIABLES")[0].replace("  ABSZRO = -273.15\n", "").replace("20.", "70.")
    case.write_text(bare)
    said = call("import", case)
    assert said.code == 2
    assert "--units" in said.err
    assert call("import", case, "--units", "BTU h ft F").code == 0
    for stated in ("  ABSZRO = -459.67\n  UID = ENG\n", "  ABSZRO = 0.0\n"):
        case.write_text(bare.replace("GLOBAL\n", f"GLOBAL\n{stated}"))
        assert call("import", case).code == 0


def test_two_imports_into_one_folder_keep_their_parts(call: Call, tmp_path: Path) -> None:
    bare = LOST.partition("HEADER VARIABLES")[0]
    decks = {}
    for name, heat in (("a", "50."), ("b", "80.")):
        case = tmp_path / f"{name}.inp"
        case.write_text(bare.replace("50.", heat))
        assert call("import", case, "--to", tmp_path / f"{name}.toml").code == 0
        decks[name] = heat
    for name, heat in decks.items():
        (node,) = (n for s in td.load_model(tmp_path / f"{name}.toml").submodels.values() for n in s.model.nodes.values())
        assert node.fields["capacitance"].text == f"{float(heat)!r} [J/K]"
    before = sorted(tmp_path.glob("*.toml"))
    assert call("import", tmp_path / "b.inp", "--to", tmp_path / "b.toml").code == 0
    assert sorted(tmp_path.glob("*.toml")) == before
