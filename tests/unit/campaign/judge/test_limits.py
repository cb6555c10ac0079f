"""Limits: their order, states of a unit, crossings in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import NameNotFoundError, ScenarioError, code_of
from thermid.campaign._judge.limits import Limits, check_limits, load_limits, read_limits

ONE = td.model_from_dict(
    {
        "title": "box",
        "needs": ["air"],
        "nodes": {"box": {"capacitance": "1000 [J/K]"}},
        "conductors": {"g": {"kind": "conduction", "between": ["box", "air"], "conductance": "1 [W/K]"}},
        "loads": {"heater": {"into": "box", "power": "20 [W]"}},
    }
)
TAU = 1000.0


def kelvin(celsius: float) -> float:
    return celsius + 273.15


def run(**more: object) -> td.Solution:
    given = {"boundaries": {"air": "20 [degC]"}, "start": "20 [degC]", "duration": "2 [h]"} | more
    return td.simulate(ONE, td.Scenario("test", **given), every="5 [s]")


def limits(low: float = -10.0, high: float = 35.0, **more: object) -> Limits:
    return Limits("box", "box", td.celsius((low, high)), **more)


def test_a_crossing_stands_where_the_closed_form_has_it() -> None:
    """20 (1 - exp(-t/tau)) = 15 at tau ln 4; it ends at 40 degC less what is left after 7.2 tau."""
    (check,) = check_limits(run(), [limits()])
    (crossing,) = check.crossings
    assert crossing.side == "high"
    assert crossing.time == pytest.approx(TAU * np.log(4.0), abs=0.05)
    assert crossing.outside == pytest.approx(7200.0 - TAU * np.log(4.0), abs=0.05)
    assert crossing.worst == pytest.approx(kelvin(40.0 - 20.0 * np.exp(-7.2)), abs=1e-4)
    assert (crossing.worst_time, check.passed, check.room) == (7200.0, False, pytest.approx(-4.985, abs=1e-3))
    assert "1386 s" in str(check)


def test_within_limits_the_room_is_told() -> None:
    (check,) = check_limits(run(), [limits(high=55.0)])
    assert check.passed
    assert check.room == pytest.approx(15.015, abs=1e-3)
    assert "15.0 K" in str(check)


def test_the_low_side_counts_as_well() -> None:
    (check,) = check_limits(run(boundaries={"air": "-30 [degC]"}, loads={"heater": "0 [W]"}), [limits()], state="operating")
    (crossing,) = check.crossings
    assert crossing.side == "low"
    assert crossing.time == pytest.approx(TAU * np.log(50.0 / 20.0), abs=0.05)


def test_a_unit_is_off_then_on_and_is_started_where_it_is_switched_on() -> None:
    command = {"heater": {"times": ["0 [s]", "3000 [s]"], "values": [0, 1], "hold": True}}
    cold = run(boundaries={"air": "-30 [degC]"}, commands=command)
    known = limits(-25.0, 30.0, non_operating=td.celsius((-40.0, 60.0)), start_up=td.celsius((-20.0, 30.0)), loads=("heater",))
    checks = {c.state: c for c in check_limits(cold, [known])}
    assert checks["non-operating"].passed
    assert checks["non-operating"].lowest == pytest.approx(kelvin(-30 + 50 * np.exp(-3.0)), abs=0.02)
    assert checks["start-up"].lowest_time == 3000.0
    (crossing,) = checks["start-up"].crossings
    assert crossing.time == 3000.0
    assert not checks["start-up"].passed
    # on, it warms from -27.5 towards -10: beyond -25 for tau ln(17.51 / 15)
    (crossing,) = checks["operating"].crossings
    assert crossing.time == 3000.0
    assert crossing.outside == pytest.approx(TAU * np.log((20.0 - 50 * np.exp(-3.0)) / 15.0), abs=1.0)


def test_limits_from_memory_decide_nothing() -> None:
    (check,) = check_limits(run(), [limits(mark="memory")])
    assert check.crossings
    assert check.passed is None
    assert "not decided" in str(check)


@pytest.mark.parametrize(
    ("given", "code", "data"),
    [
        ({"operating": ("300.0 [K]", "290.0 [K]")}, "value.outside-range", "one, 16.9 degC"),
        (
            {"operating": ("250.0 [K]", "330.0 [K]"), "non_operating": ("260.0 [K]", "340.0 [K]")},
            "value.outside-range",
            "-23.1 degC",
        ),
        (
            {"operating": ("250.0 [K]", "350.0 [K]"), "non_operating": ("240.0 [K]", "340.0 [K]")},
            "value.outside-range",
            "76.9 degC",
        ),
        (
            {"operating": ("250.0 [K]", "330.0 [K]"), "non_operating": ("240.0 [K]", "340.0 [K]"), "start_up": ("230.0 [K]", "330.0 [K]")},
            "value.outside-range",
            "",
        ),
        ({"operating": ("250.0 [K]", "330.0 [K]"), "mark": "heard"}, "name.unknown", "'heard'"),
    ],
)
def test_limits_in_the_wrong_order_are_refused(given: dict[str, object], code: str, data: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Limits("box", "box", **given)
    assert code_of(str(caught.value)) == code
    assert data in str(caught.value)


@pytest.mark.parametrize(
    ("tables", "code", "data"),
    [
        ({}, "value.incomplete", ""),
        ({"box": 3}, "file.wrong-kind", "limits.toml, box"),
        ({"box": {"node": "box"}}, "file.key-missing", "limits.toml, box.operating"),
        ({"box": {"node": "box", "operating": "40 [degC]"}}, "file.wrong-kind", "'40 [degC]'"),
        ({"box": {"node": "box", "operting": []}}, "file.key-missing", "'operating'?"),
    ],
)
def test_a_faulty_table_of_limits_is_refused(tables: dict[str, object], code: str, data: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        read_limits(tables, "limits.toml")
    assert code_of(str(caught.value)) == code
    assert data in str(caught.value)


def test_a_file_of_limits(tmp_path) -> None:
    file = tmp_path / "limits.toml"
    file.write_text(
        '[box]\nnode = "box"\noperating = ["", "50 [degC]"]\nnon_operating = ["-40 [degC]", "70 [degC]"]\nsource = "data sheet"\n',
        encoding="utf-8",
    )
    (one,) = load_limits(file)
    assert one.operating == (-np.inf, kelvin(50.0))
    assert one.source == "data sheet"


def test_names_that_are_not_there() -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'heater'"):
        check_limits(run(), [limits(loads=("heatr",))])
    with raises_code("value.wrong-kind", ScenarioError, match="'asleep'"):
        check_limits(run(), [limits()], state="asleep")
