"""``thermid simulate``: every option, the JSON object to the letter, and refusals."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

from thermid.model.tree import load_model
from thermid.simulation.runs import Scenario, simulate
from unit.app.cli.conftest import Call

RISE, TAU = 0.225 / (6 * 0.00420536), 25.92 / (6 * 0.00420536)


def case(call: Call, deck: Path, *more: object) -> dict[str, object]:
    """The object of node `case` after an hour in 24 degC, with more options."""
    said = call("simulate", deck, "--boundary", "air=24", "--for", "1 [h]", "--json", *more)
    assert said.code == 0, said.out
    return said.object["nodes"]["case"]


def expected(seconds: float, air: float = 24.0, start: float = 24.0, rise: float = RISE) -> float:
    return air + rise + (start - air - rise) * math.exp(-seconds / TAU)


class TestJson:
    def test_the_object_is_that_of_the_description(self, call: Call, accelerometer: Path) -> None:
        said = call("simulate", accelerometer, "--boundary", "air=24 [degC]", "--for", "5 [h]", "--at", "1 [h]", "--at", "600", "--json")
        assert (said.code, said.err) == (0, "")
        assert said.out.count("\n") == 1
        found = said.object
        assert list(found) == [
            "schema",
            "status",
            "title",
            "scenario",
            "nodes",
            "time_constants_s",
            "heat_balance",
            "duty_cycles",
            "steady_of",
            "warnings",
            "standing",
        ]
        assert (found["schema"], found["status"], found["warnings"]) == (1, "ok", [])
        assert set(found["nodes"]) == {"case", "air"}
        node = found["nodes"]["case"]
        assert set(node) == {"final_C", "max_C", "max_time_s", "min_C", "min_time_s", "at_C", "steady_C"}
        assert node["at_C"] == pytest.approx([expected(3600.0), expected(600.0)], abs=1e-4), "in the order of --at"
        assert node["final_C"] == pytest.approx(expected(18000.0), abs=1e-4)
        assert node["max_C"] == pytest.approx(node["final_C"], abs=1e-4)
        assert node["steady_C"] == pytest.approx(24.0 + RISE, abs=1e-8)
        assert found["time_constants_s"] == pytest.approx([TAU], rel=1e-9)
        balance = found["heat_balance"]
        assert set(balance) == {"loads", "boundaries", "stored", "residual", "relative"}
        assert balance["loads"] == pytest.approx(0.225 * 18000.0)
        assert balance["stored"] == pytest.approx(25.92 * (node["final_C"] - 24.0), rel=1e-6)
        assert balance["loads"] - balance["boundaries"] - balance["stored"] == pytest.approx(balance["residual"], abs=1e-9)
        assert abs(balance["relative"]) < 1e-6

    def test_at_is_met_between_stored_samples(self, call: Call, accelerometer: Path) -> None:
        assert case(call, accelerometer, "--at", "1234.5")["at_C"] == pytest.approx([expected(1234.5)], abs=1e-4)

    def test_at_the_ends(self, call: Call, accelerometer: Path) -> None:
        assert case(call, accelerometer, "--at", "0", "--at", "3600")["at_C"] == pytest.approx([24.0, expected(3600.0)], abs=1e-4)

    def test_a_submodel_by_its_canonical_path_and_its_massless_node(self, call: Call, stack: Path) -> None:
        said = call("simulate", stack, "--boundary", "cv=24", "--for", "5 [h]", "--json").object
        assert {"proc.case", "ele.case", "cv"} <= set(said["nodes"])
        # the reference case of the acceptance sheet, section 2.2
        assert said["nodes"]["proc.case"]["final_C"] == pytest.approx(36.077771, abs=1e-4)
        assert said["nodes"]["ele.case"]["final_C"] == pytest.approx(35.821535, abs=1e-4)
        assert said["nodes"]["proc.case"]["steady_C"] == pytest.approx(36.252540, abs=1e-5)
        assert said["time_constants_s"] == pytest.approx([4223.721, 1048.561], rel=1e-6)

    def test_vacuum_as_printed_has_no_steady_state_and_no_time_constant(self, call: Call, accelerometer: Path) -> None:
        said = call("simulate", accelerometer, "--boundary", "air=24", "--for", "5 [h]", "--as-printed", "--at", "1 [h]", "--json")
        assert "NaN" not in said.out
        assert "Infinity" not in said.out
        found = said.object
        node = found["nodes"]["case"]
        assert node["steady_C"] is None
        assert found["time_constants_s"] == [None]
        assert node["at_C"] == pytest.approx([24.0 + 31.25], abs=1e-6)
        assert node["final_C"] == pytest.approx(180.25, abs=1e-6)
        assert any("'case'" in words and "31.25 K/h" in words for words in found["warnings"])

    def test_vacuum_is_refused_where_a_coefficient_hides_radiation(self, call: Call, accelerometer: Path) -> None:
        said = call("simulate", accelerometer, "--boundary", "air=24", "--for", "5 [h]", "--vacuum", "--json")
        assert (said.code, said.err) == (2, "")
        assert list(said.object) == ["schema", "status", "code", "message", "where"]
        assert (said.object["schema"], said.object["status"]) == (1, "error")
        assert said.object["code"] == "model.needs-gas-law"
        assert said.object["where"] == "accelerometer.toml:15, surfaces.skin"

    def test_vacuum_where_it_is_known(self, call: Call) -> None:
        from unit.app.cli.conftest import EXAMPLES

        deck = EXAMPLES / "05_vacuum" / "accelerometer.toml"
        node = case(call, deck, "--vacuum", "--for", "24 [h]")
        sigma, kelvin = 5.670374419e-8, 297.15
        steady = (kelvin**4 + 0.225 / (0.3 * sigma * 0.00420536)) ** 0.25 - 273.15
        assert node["steady_C"] == pytest.approx(steady, abs=1e-6)
        assert node["final_C"] == pytest.approx(steady, abs=1e-2)


class TestOptions:
    def test_param(self, call: Call, accelerometer: Path) -> None:
        assert case(call, accelerometer, "--param", "area=0.005 [m^2]")["steady_C"] == pytest.approx(24 + 0.225 / 0.03, abs=1e-8)

    def test_param_wins_over_values(self, call: Call, accelerometer: Path, tmp_path: Path) -> None:
        from thermid.values.store import FittedValue, FittedValues

        value = FittedValue("area", 0.004, 1e-5, 1e-5, True, "m^2", 0.0042, (0.003, 0.006))
        FittedValues("s", {"area": value}, np.array([[1e-6]])).save(tmp_path / "v.toml")
        laid = case(call, accelerometer, "--values", tmp_path / "v.toml")["steady_C"]
        both = case(call, accelerometer, "--values", tmp_path / "v.toml", "--param", "area=0.005 [m^2]")["steady_C"]
        assert laid == pytest.approx(24 + 0.225 / 0.024, abs=1e-8)
        assert both == pytest.approx(24 + 0.225 / 0.03, abs=1e-8)

    @pytest.mark.parametrize("text", ["electronics=0.45 [W]", "electronics=450 [mW]", "electronics=0.45"])
    def test_load(self, call: Call, accelerometer: Path, text: str) -> None:
        assert case(call, accelerometer, "--load", text)["steady_C"] == pytest.approx(24 + 2 * RISE, abs=1e-8)

    @pytest.mark.parametrize("text", ["air=30", "air=30 [degC]", "air = 303.15 [K]", "air=3e1"])
    def test_boundary(self, call: Call, accelerometer: Path, text: str) -> None:
        found = call("simulate", accelerometer, "--boundary", text, "--for", "3600", "--json").object["nodes"]["case"]
        assert found["final_C"] == pytest.approx(expected(3600.0, 30.0, 30.0), abs=1e-4)

    def test_a_cold_boundary_without_a_unit(self, call: Call, accelerometer: Path) -> None:
        found = call("simulate", accelerometer, "--boundary", "air=-40", "--for", "3600", "--json").object["nodes"]
        assert found["air"]["final_C"] == pytest.approx(-40.0)

    @pytest.mark.parametrize(("start", "first"), [("50", 50.0), ("50 [degC]", 50.0), ("air", 24.0), ("steady", 24.0 + RISE)])
    def test_start(self, call: Call, accelerometer: Path, start: str, first: float) -> None:
        found = case(call, accelerometer, "--start", start, "--at", "0", "--at", "1800")
        assert found["at_C"] == pytest.approx([first, expected(1800.0, start=first)], abs=1e-4)

    @pytest.mark.parametrize(("start", "first"), [("50 [degC]", 50.0), ("air", 24.0), ("steady", 24.0 + RISE)])
    def test_a_start_of_the_command_line_wins_over_initial(
        self, call: Call, accelerometer: Path, tmp_path: Path, start: str, first: float
    ) -> None:
        """Imported decks give every node a temperature: the option had no effect."""
        file = tmp_path / "s.toml"
        file.write_text('duration = "1 [h]"\n[boundaries]\nair = "24 [degC]"\n[initial]\ncase = "10 [degC]"\n')
        done = call("simulate", accelerometer, "--scenario", file, "--start", start, "--at", "0", "--json")
        assert done.object["nodes"]["case"]["at_C"] == pytest.approx([first], abs=1e-4)
        assert "[initial]" in done.err
        plain = call("simulate", accelerometer, "--scenario", file, "--at", "0", "--json")
        assert plain.object["nodes"]["case"]["at_C"] == pytest.approx([10.0])
        assert not plain.err

    def test_a_start_that_has_no_effect_is_refused(self, call: Call, accelerometer: Path, tmp_path: Path) -> None:
        file = tmp_path / "s.toml"
        file.write_text('duration = "1 [h]"\nstart = "steady"\n[boundaries]\nair = "24 [degC]"\n[initial]\ncase = "10 [degC]"\n')
        done = call("simulate", accelerometer, "--scenario", file)
        assert done.code == 2
        assert "= 'steady'" in done.err

    def test_every_and_csv(self, call: Call, accelerometer: Path, tmp_path: Path) -> None:
        file = tmp_path / "run.csv"
        case(call, accelerometer, "--every", "10 [min]", "--csv", file)
        rows = list(csv.reader(line for line in file.read_text().splitlines() if not line.startswith("#")))
        assert [float(r[0]) for r in rows[1:]] == [600.0 * k for k in range(7)]
        assert float(rows[-1][1]) == pytest.approx(expected(3600.0), abs=1e-3)

    def test_netcdf(self, call: Call, accelerometer: Path, tmp_path: Path) -> None:
        xarray = pytest.importorskip("xarray")
        pytest.importorskip("h5netcdf")
        pytest.importorskip("h5py")
        case(call, accelerometer, "--netcdf", tmp_path / "run.nc")
        with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as found:
            assert found.sizes

    def test_a_scenario_file_with_options_over_it(self, call: Call, accelerometer: Path, tmp_path: Path) -> None:
        file = tmp_path / "s.toml"
        file.write_text('duration = "1 [h]"\nstart = "20 [degC]"\n[boundaries]\nair = "24 [degC]"\n')
        plain = call("simulate", accelerometer, "--scenario", file, "--json").object
        assert plain["scenario"] == "s"
        assert plain["nodes"]["case"]["final_C"] == pytest.approx(expected(3600.0, start=20.0), abs=1e-4)
        over = call(
            "simulate", accelerometer, "--scenario", file, "--boundary", "air=30", "--start", "30", "--for", "1800", "--json"
        ).object
        assert over["nodes"]["case"]["final_C"] == pytest.approx(expected(1800.0, 30.0, 30.0), abs=1e-4)

    def test_the_same_as_from_python(self, call: Call, stack: Path) -> None:
        found = call("simulate", stack, "--boundary", "cv=24", "--for", "5 [h]", "--json").object
        run = simulate(load_model(stack), Scenario("x", boundaries={"cv": "24 [degC]"}, duration="5 [h]"))
        assert {n: v["final_C"] for n, v in found["nodes"].items()} == pytest.approx({n: run[n].final for n in run.nodes}, abs=1e-9)

    def test_text(self, call: Call, accelerometer: Path) -> None:
        said = call("simulate", accelerometer, "--boundary", "air=24", "--for", "1 [h]", "--at", "1800")
        assert said.code == 0
        assert f"1800 s: case {expected(1800.0):.3f}, air 24.000 degC" in said.out
        assert "1027.26 s" in said.out
        assert "810 J" in said.out


CL = "command line"
REFUSED = [
    (["--param", "areaa=1 [m^2]"], "name.unknown", "Accelerometer", r"'areaa'.* 'area'"),
    (["--param", "area=1 [m^2]"], "value.outside-range", f"{CL}, area", r"^1 .*0\.006 \[m\^2\]"),
    (["--param", "area=0.005 [m]"], "unit.wrong-dimension", f"{CL}, area", r"'\[m\]' .*\[m\^2\]"),
    (["--param", "area"], "value.wrong-kind", "--param", "'area' .*PATH=VALUE"),
    (["--param", "=1 [m^2]"], "value.wrong-kind", "--param", r"'=1 \[m\^2\]' .*PATH=VALUE"),
    (["--load", "electronic=1 [W]"], "name.unknown", CL, "'electronic'.* 'electronics'"),
    (["--load", "electronics=1 [K]"], "unit.wrong-dimension", f"{CL}, loads.electronics", r"'\[K\]' .*\[W\]"),
    (["--boundary", "airr=24"], "name.unknown", CL, "'airr'.* 'air'"),
    (["--boundary", "case=24"], "value.wrong-kind", CL, "'case' .*'prescribed'"),
    (["--boundary", "air=24 [W]"], "unit.wrong-dimension", f"{CL}, boundaries.air", r"'\[W\]' .*\[degC\] or \[K\]"),
    (["--boundary", "air=warm"], "value.wrong-kind", f"{CL}, boundaries.air", "'warm'"),
    (["--start", "airr"], "name.unknown", f"{CL}, start", "'airr'.* 'air'"),
    (["--at", "2 [h]"], "value.outside-range", "--at", "^7200 s .* 3600 s"),
    (["--at", "-1"], "value.outside-range", "--at", "^-1 s .* 3600 s"),
    (["--at", "noon"], "value.wrong-kind", "--at", r"'noon' .*'5 \[s\]'"),
    (["--at", "1 [K]"], "unit.wrong-dimension", "--at", r"'\[K\]' .*\[s\]"),
    (["--for", "0"], "value.outside-range", f"{CL}, duration", '--for "5'),
    (["--for", "-1 [h]"], "value.outside-range", f"{CL}, duration", ""),
    (["--for", "1 [kg]"], "unit.wrong-dimension", f"{CL}, duration", r"'\[kg\]' .*\[s\]"),
    (["--every", "0 [s]"], "value.outside-range", CL, ""),
    (["--vacuum", "--as-printed"], "value.excludes-another", "", "--vacuum .*--as-printed"),
    (["--values", "gone.toml"], "file.not-found", "", "'gone.toml'"),
    (["--scenario", "gone.toml"], "file.not-found", "", "'gone.toml'"),
    (["--csv", "no/such/folder/run.csv"], "file.refused-by-system", "", "'no/such/folder/run.csv' .*'no/such/folder'"),
    (["--csv", "."], "file.refused-by-system", "", r"'\.'"),
    (["--every", "1e-9 [s]"], "cap.exceeded", CL, r"1e-09 s .* 3\.6e\+12 .* 10,000,000"),
    (["--for", "inf [h]"], "value.outside-range", f"{CL}, duration", r"'inf \[h\]'"),
    (["--boundary", "air=-300"], "value.outside-range", f"{CL}, boundaries.air", "^-300 degC .* 0 K"),
    (["--start", "-300"], "value.outside-range", f"{CL}, start", "^-300 degC .* 0 K"),
    (["--boundary", "air=22,5"], "expression.decimal-comma", f"{CL}, boundaries.air", r"'22,5'.*'22\.5'"),
    (["--boundary", "air=22 C"], "expression.not-arithmetic", f"{CL}, boundaries.air", r"'22 C' .*'22 \[degC\]'"),
    (["--boundary", "air=22 [Celsius]"], "unit.unknown", f"{CL}, boundaries.air", r"'\[Celsius\]' .*\[degC\]"),
    (["--param", "area=0.005"], "unit.wrong-dimension", f"{CL}, area", r'\[m\^2\].*"2\.5 \[m\^2\]"'),
    (["--bogus"], "command.not-understood", CL, "--bogus"),
    (["--for"], "command.not-understood", CL, "'--for'"),
]
"""Options, the code of the refusal, its place, and what its text holds of names, numbers and units."""


@pytest.mark.parametrize(("options", "code", "where", "match"), REFUSED, ids=[" ".join(row[0]) for row in REFUSED])
def test_refusals(call: Call, accelerometer: Path, options: list[str], code: str, where: str, match: str) -> None:
    start = ["simulate", accelerometer, "--boundary", "air=24", "--for", "3600"]
    said = call(*start, "--json", *options)
    assert (said.code, said.err) == (2, "")
    assert set(said.object) == {"schema", "status", "code", "message", "where"}
    assert (said.object["code"], said.object["where"]) == (code, where)
    assert re.search(match, said.object["message"])
    plain = call(*start, *options)
    assert (plain.code, plain.out) == (2, "")
    shown = " ".join(plain.err.replace("│", " ").split())
    of_parser = code == "command.not-understood"  # shown in a frame by the parser of options, before any command
    assert plain.codes == (() if of_parser else (code,))
    assert (options[0] if of_parser else ": ".join(filter(None, (where, said.object["message"])))) in shown


def test_a_package_that_is_not_installed_is_named(call: Call, accelerometer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "xarray", None)
    said = call("simulate", accelerometer, "--boundary", "air=24", "--for", "60", "--netcdf", tmp_path / "x.nc", "--json")
    assert said.code == 2
    assert "xarray" in said.object["message"]
    assert said.object["code"] == "extra.not-installed"
    assert "-m pip " in said.object["message"]


def test_a_deck_that_is_not_there(call: Call, tmp_path: Path) -> None:
    said = call("simulate", tmp_path / "gone.toml", "--for", "1", "--json")
    assert (said.code, said.object["code"]) == (2, "file.not-found")
    assert re.search(rf"'gone\.toml' .* {tmp_path.name}/\.$", said.object["message"])


def test_a_run_that_cannot_end_is_the_solvers(call: Call, tmp_path: Path) -> None:
    deck = tmp_path / "deck.toml"
    deck.write_text(
        'title = "Away"\nneeds = ["air"]\n[nodes]\ncase = { capacitance = "1 [J/K]" }\n'
        '[conductors]\nc = { kind = "conduction", between = ["case", "air"], conductance = "0.001 [W/K]" }\n'
        '[loads]\nq = { into = "case", power = "1 [W]", exponential_coefficient = "0.05 [1/K]", reference_temperature = "20 [degC]" }\n'
    )
    said = call("simulate", deck, "--boundary", "air=20", "--for", "1 [h]", "--json")
    assert said.code == 3
    assert said.object["code"] == "run.did-not-finish"
    assert "'case'" in said.object["message"]


def test_as_flown_leaves_out_what_is_for_the_test_only(call: Call, tmp_path: Path) -> None:
    deck = tmp_path / "wired.toml"
    deck.write_text(
        'title = "wired"\nneeds = ["air"]\n[nodes]\nbox = { capacitance = "100 [J/K]" }\n[surfaces]\n'
        'skin = { of = "box", to = "air", area = "0.02 [m^2]", htc = "5 [W/(m^2 K)]" }\n[conductors]\n'
        'leads = { kind = "lead", between = ["box", "air"], conductivity = "390 [W/(m K)]", diameter = "1 [mm]", length = "0.3 [m]", '
        'htc = "20 [W/(m^2 K)]", to = "air", count = 4, test_only = true }\n[loads]\nheat = { into = "box", power = "1 [W]" }\n'
    )
    run = ["simulate", deck, "--boundary", "air=20", "--for", "5 [h]", "--json"]
    bench, flown = (call(*run, *more).object["nodes"]["box"]["final_C"] for more in ([], ["--as-flown"]))
    assert flown == pytest.approx(30.0, abs=1e-3)
    assert bench < 29.6


def test_intervals_may_be_plain_seconds(call: Call, accelerometer: Path, tmp_path: Path) -> None:
    call("simulate", accelerometer, "--boundary", "air=24", "--for", "60", "--every", "20", "--csv", tmp_path / "run.csv")
    times = [line.partition(",")[0] for line in (tmp_path / "run.csv").read_text().splitlines() if line[:1].isdigit()]
    assert [float(t) for t in times] == [0.0, 20.0, 40.0, 60.0]


def test_a_room_that_looks_like_kelvin_is_remarked(call: Call, accelerometer: Path) -> None:
    said = call("simulate", accelerometer, "--boundary", "air=297.15", "--for", "60")
    assert said.code == 0
    assert re.search(r"^\w+: air=297\.15 .*'air=297\.15 \[K\]'", said.err)
    for plain in ("air=24", "air=297.15 [K]", "air=250 [degC]"):
        assert call("simulate", accelerometer, "--boundary", plain, "--for", "60").err == ""


def test_version_and_short_help(call: Call) -> None:
    from importlib.metadata import version

    assert call("--version").out == f"thermid {version('thermid')}\n"
    assert call("-h").out == call("--help").out
    assert call("check", "-h").code == 0


@pytest.mark.parametrize(
    ("text", "code", "match"),
    [
        ("duration = '2 [h]'\nboundaries = { air = '20 [degC]' }\n", "file.another-kind", "--scenario"),
        ("[limits.a]\n[[tests]]\n", "file.another-kind", "`thermid plan`"),
        ("needs = [air]\n", "file.not-valid", "other.toml: .* TOML: "),
    ],
)
def test_another_file_than_a_deck(call: Call, tmp_path: Path, text: str, code: str, match: str) -> None:
    (tmp_path / "other.toml").write_text(text)
    said = call("check", tmp_path / "other.toml")
    assert (said.code, said.codes) == (2, (code,))
    assert re.search(match, said.err)


@pytest.mark.parametrize(
    ("line", "code", "words"),
    [
        ("duration = '2 h'", "expression.not-arithmetic", "cold.toml:1, duration: '2 h' "),
        ("duration = '2 [h]'\nboundaries = { air = '20 [W]' }", "unit.wrong-dimension", "boundaries.air: '[W]' "),
        (
            "title = 'x'\n[boundaries.air]\ntimes = ['1 [h]', '0 [h]']\nvalues = ['1 [degC]', '2 [degC]']",
            "value.outside-range",
            "cold.toml:2, boundaries.air: ",
        ),
    ],
)
def test_a_scenario_file_is_named_with_its_line(call: Call, accelerometer: Path, tmp_path: Path, line: str, code: str, words: str) -> None:
    (tmp_path / "cold.toml").write_text(f"{line}\n")
    said = call("simulate", accelerometer, "--scenario", tmp_path / "cold.toml")
    assert (said.code, said.codes) == (2, (code,))
    assert "cold.toml" in said.err
    assert words in said.err
