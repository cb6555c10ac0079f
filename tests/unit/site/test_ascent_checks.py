"""Ascents beside the limits of launchers: what is met, what is not, and what decides nothing."""

from __future__ import annotations

import re
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ScenarioError
from thermid.base.results import Figure
from thermid.site.ascent import ASCENT_LIMITS


def curve(*points: tuple[float, float], **more: Any) -> td.Scenario:
    table = {"times": [f"{t} [s]" for t, _ in points], "values": [f"{p} [kPa]" for _, p in points]}
    return td.site.ascent_scenario(pressure=table, air_temperature="20 [degC]", duration=f"{points[-1][0]} [s]", **more)


def test_a_slow_decay_meets_the_usual_limit() -> None:
    (only,) = td.site.ascent_checks(curve((0, 101), (50, 1), (60, 0)))
    assert (only.name, only.met) == ("pressure decay", True)
    assert only.value == pytest.approx(2000.0)
    assert "read: SpaceX Rideshare" in str(only)


def test_a_brief_faster_decay_is_allowed_and_a_long_one_not() -> None:
    brief = {c.name: c for c in td.site.ascent_checks(curve((0, 101), (20, 61), (23, 49), (80, 0)))}
    assert brief["brief pressure decay"].value == pytest.approx(4000.0)
    assert brief["brief pressure decay"].met
    assert brief["time of brief decay"].value == pytest.approx(3.0, abs=1.0)
    assert brief["time of brief decay"].met
    long = {c.name: c for c in td.site.ascent_checks(curve((0, 101), (20, 61), (30, 21), (80, 0)))}
    assert not long["time of brief decay"].met
    fast = {c.name: c for c in td.site.ascent_checks(curve((0, 101), (10, 61), (12, 45), (80, 0)))}
    assert not fast["brief pressure decay"].met


def test_a_limit_from_memory_decides_nothing() -> None:
    stream = td.simulation.Irradiation(
        stream={"times": ["0 [s]", "50 [s]", "60 [s]"], "values": ["0 [W/m^2]", "2000 [W/m^2]", "100 [W/m^2]"]}
    )
    made = curve((0, 101), (50, 1), (60, 0)).with_(irradiation={"panel": stream})
    checks = {c.name: c for c in td.site.ascent_checks(made)}
    assert checks["molecular heating"].met is True
    assert checks["gentle molecular heating"].met is None
    assert re.search(r"1135: .*\(memory: ", str(checks["gentle molecular heating"]))
    assert checks["gentle molecular heating"].at == 50.0


def test_a_project_has_limits_of_its_own() -> None:
    own = {"pressure decay": Figure(1500.0, "project", "interface document")}
    (only,) = td.site.ascent_checks(curve((0, 101), (50, 1), (60, 0)), limits=own)
    assert only.met is False


def test_a_vented_bay_is_checked_by_its_own_pressure() -> None:
    """A bay with a time constant of 5 s follows a ramp of 2 kPa/s 5 s behind, as fast as the ramp."""
    bay = td.simulation.Environment(vented="ambient", time_constant="5 [s]")
    (only,) = td.site.ascent_checks(curve((0, 101), (50, 1), (60, 0), environment={"bay": bay}), "bay")
    assert only.what == "bay"
    assert only.value == pytest.approx(2000.0, rel=0.01)
    assert only.at > 20.0


def test_no_ascent_is_said() -> None:
    with raises_code("value.without-effect", ScenarioError, match="'ambient'"):
        td.site.ascent_checks(td.site.ascent_scenario(pressure="1 [Pa]", air_temperature="20 [degC]", duration="9 [s]"))
    with raises_code("name.unknown", ScenarioError, match="'bay'"):
        td.site.ascent_checks(curve((0, 101), (50, 1)), "bay")


def test_every_limit_says_where_it_is_from() -> None:
    assert all(f.source for f in ASCENT_LIMITS.values())
