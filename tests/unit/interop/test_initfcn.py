"""InitFcn scripts: what is read, with which unit, and what is refused at which line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code


def texts(script: str) -> dict[str, str]:
    return {n: p.text for n, p in td.interop.read_initfcn(script).parameters.items()}


@pytest.mark.parametrize(
    ("script", "text", "number"),
    [
        ("a = 1e-3; % [m]", "1e-3 [m]", 1e-3),
        ("a = .5 % share [-]", ".5 [1]", 0.5),
        ("a = 3.^2*2; % [W]", "3.**2*2 [W]", 18.0),
        ("a = 6./4; % [W]", "6./4 [W]", 1.5),
        ("a = -2^2; % [K]", "-2**2 [K]", -4.0),
        ("a = 2^-1; % [K]", "2**-1 [K]", 0.5),
        ("a = 2*pi; % [-]", "2*3.141592653589793 [1]", 6.283185307179586),
        ("a = Inf; % [K/W]", "inf [K/W]", float("inf")),
        ("a = 24; % [Celsius]", "24 [degC]", 24.0),
        ("a = 24; % [deg C]", "24 [degC]", 24.0),
        ("a = 7; % see [3], power [W]", "7 [W]", 7.0),
        ("a = ... % half\n  1 + ...\n  2; % [W]", "1 + 2 [W]", 3.0),
        ("a = 5 # Octave's sign [W]", "5 [W]", 5.0),
    ],
)
def test_a_value_is_read(script: str, text: str, number: float) -> None:
    found = td.interop.read_initfcn(script)
    assert found.parameters["a"].text == text
    assert found.numbers["a"] == pytest.approx(number, rel=1e-15)
    assert found.remarks == ()


def test_names_stay_where_their_units_say_the_same() -> None:
    found = td.interop.read_initfcn("L = 25; % [mm]\nA = L^2; % [mm^2]\nB = L*L;\nC = A; V = A*L; % [mm^2] [mm^3]\n")
    assert texts("L = 25; % [mm]\nA = L^2; % [mm^2]\nB = L*L;\nC = A;") == {"L": "25 [mm]", "A": "L**2", "B": "L*L", "C": "A"}
    assert found.parameters["V"].text == "A*L"
    assert found.numbers["V"] == 15625.0
    assert found.remarks == ()


def test_units_that_do_not_agree_are_remarked_and_the_comment_wins() -> None:
    found = td.interop.read_initfcn("L = 25; % [mm]\nA = L*L; % [m^2]\nB = L; % [kg]")
    assert found.parameters["A"].text == "625.0 [m^2]"
    assert found.parameters["A"].basis.startswith("L*L ")
    area, mass = found.remarks
    assert re.search(r" 2: 'A' .* 625\.0 \[m\^2\] .*'L\*L' .* 0\.000625 .* 625$", area)
    assert re.search(r" 3: 'B' .* 25\.0 \[kg\] .*'L' ", mass)


def test_a_plain_factor_takes_no_part_in_the_units() -> None:
    """1.08 has no unit in its comment and scales what has one."""
    found = td.interop.read_initfcn("f = 1.08; a = 2; % area [m^2]\nb = f*a; % [m^2]")
    assert found.parameters["b"].text == "2.16 [m^2]"  # two values, one bracket: neither has a unit
    assert [re.findall(r"'\w+'|\d+", r)[:4] for r in found.remarks] == [["1", "'f'", "1", "2"], ["1", "'a'", "1", "2"]]


def test_several_values_take_the_brackets_of_their_line_in_order() -> None:
    assert texts("a = 1; b = 2, c = 3 % three [m] [kg] [s]") == {"a": "1 [m]", "b": "2 [kg]", "c": "3 [s]"}


def test_temperatures_are_not_added_to_by_their_units() -> None:
    found = td.interop.read_initfcn("T = 24; % [Celsius]\nTK = T + 273.15;\nT0 = T;")
    assert {n: p.text for n, p in found.parameters.items()} == {"T": "24 [degC]", "TK": "297.15", "T0": "T"}
    (remark,) = found.remarks
    assert re.search(r" 2: 'TK' .*'T \+ 273\.15' .* 297\.15 ", remark)
    kelvin = td.interop.read_initfcn("T = 24; % [Celsius]\nTK = T + 273.15; % [K]")
    assert kelvin.parameters["TK"].text == "297.15 [K]"
    assert kelvin.remarks == ()


def test_blocks_of_comments_and_printed_line_numbers_are_taken_off() -> None:
    assert texts("%{\nx = sqrt(2)\n%}\na = 1; % [m]") == {"a": "1 [m]"}
    assert texts("1 % Head\n2\n3 a = 4; % [m]") == {"a": "4 [m]"}


def test_a_script_is_shown_with_its_remarks() -> None:
    found = td.interop.read_initfcn("mass = 2; % Mass [kg].\nn = 3;")
    assert str(found) == f"remark: {found.remarks[0]}\nmass  2 [kg]  Mass\nn     3"
    assert " 2: 'n' " in found.remarks[0]


@pytest.mark.parametrize(
    ("script", "code", "match"),
    [
        ("a = 1;\nb = sind(a);", "expression.not-arithmetic", r"2.*'sind\(a\)'.*'sind\(a\)'"),
        ("a = [1:3];", "import.not-understood", "1.*'1:3'.*':3'"),
        ("a = 'steel';", "import.not-understood", "''.*''"),
        ("a = 3';", "import.not-understood", "'3'.*': '.*''"),
        ("a = 2\\3;", "import.not-understood", r"'2\\3'.*'\\3'"),
        ("a = 1j;", "import.not-understood", "'1j'"),
        ("a = 1;\n\nclear all", "import.not-understood", "3.*'clear all'"),
        ("p.x\n", "import.not-understood", r"1.*'p\.x'"),
        ("a == 2", "import.not-understood", "'a == 2'"),
        ("if 1, a = 2; end", "import.not-understood", "sets no name outside of branches"),
        ("a = 2^3^2;", "import.not-understood", r"'2\^3\^2'"),
        ("a = 2^-(3)^2;", "import.not-understood", r"'2\^-\(3\)\^2'"),
        ("b = a;\na = 1;", "import.not-understood", "1.*'b'.*'a'"),
        ("b = c;", "import.not-understood", "'b'.*'c'"),
        ("pi = 3;", "name.not-valid", "'pi'"),
        ("a = ;", "import.not-understood", ""),
        ("a = 1/0;", "expression.no-finite-value", "1.*'1/0'"),
        ("a = 0; b = 1/a;", "expression.no-finite-value", "'1/a'"),
        ("a = (1 + 2;", "import.not-understood", r"'\(1 \+ 2;'.*';'"),
        ("a = [1 2;\nb = 3;", "import.not-understood", r"1.*'\['"),
        ("a = 1 + ...", "import.not-understood", r"1.*'\['"),
        ("%{\na = 1;", "import.not-understood", r"'%\{'.*'%\}'"),
        ("% nothing\n\n", "import.not-understood", r"'Acc_m = 0\.054; % Mass \[kg\]\.'"),
    ],
)
def test_what_is_not_understood_is_refused_with_its_line(script: str, code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.interop.read_initfcn(script)


def test_files_are_read_and_missing_ones_named(tmp_path: Path) -> None:
    file = tmp_path / "Acc.m"
    file.write_bytes("m = 0.054; % Massa do aceler\u00f4metro [kg].".encode("latin-1"))
    found = td.interop.read_initfcn(file)
    assert (found.file, found.parameters["m"].note) == ("Acc.m", "Massa do aceler\u00f4metro")
    file.write_text("x = y;", encoding="utf-8")
    with raises_code("import.not-understood", match=r"^Acc\.m:1.*'x'.*'y'"):
        td.interop.read_initfcn(str(file))
    with raises_code("file.not-found", match=r"'Gyro\.m'"):
        td.interop.read_initfcn(tmp_path / "Gyro.m")


BLOCK = "m = 2; % [kg]\nc = 500; % [J/(kg K)]\nA = 0.1; % [m^2]\nh = 5; % [W/(m^2 K)]\nP = 3; % [W]\n"


def test_a_block_is_made_of_the_values_by_their_units() -> None:
    model = td.model_from_dict(td.interop.read_initfcn(BLOCK).block("box"))
    run = td.simulate(model, td.Scenario(boundaries={"air": "20 [degC]"}, duration="1 [h]"))
    assert run.time_constants == pytest.approx([2000.0])
    assert td.steady(model, td.Scenario(boundaries={"air": "20 [degC]"}))["case"] == pytest.approx(293.15 + 6.0)


def test_a_block_that_is_open_is_refused() -> None:
    with raises_code("import.not-understood", match="'m'.*'n'"):
        td.interop.read_initfcn(BLOCK + "n = 1; % [kg]").block("box")
    with raises_code("import.not-understood"):
        td.interop.read_initfcn(BLOCK.replace("[W]", "")).block("box")


def test_the_parameters_go_through_a_deck(tmp_path: Path) -> None:
    td.save_model(td.model_from_dict(td.interop.read_initfcn(BLOCK).block("box")), tmp_path / "box.toml")
    back = td.load_model(tmp_path / "box.toml")
    assert {n: p.text for n, p in back.parameters.items()} == texts(BLOCK)
