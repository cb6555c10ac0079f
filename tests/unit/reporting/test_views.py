"""What text, JSON, page and studio print of a stage are its numbers."""

from __future__ import annotations

import re

import pytest

from thermid.app.objects import calibration_object, fit_object
from thermid.base.units import unit
from thermid.campaign.stages import Campaign
from thermid.fit.calibration import Calibration
from thermid.reporting._blocks.content import Table
from thermid.reporting._pages import tables
from thermid.values.store import FittedValue

STAGES = ["component", "submodel"]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@pytest.fixture(params=STAGES)
def fit(request: pytest.FixtureRequest, campaign: Campaign) -> Calibration:
    return campaign.stages[request.param]


def is_rounded(text: str, number: float) -> bool:
    """Whether a text is the number with as many decimals as it has; of at least two digits."""
    said = NUMBER.search(text)
    assert said, text
    digits, _, exponent = said[0].partition("e")
    last = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return abs(float(said[0]) - number) <= 0.5001 * last


def columns(table: Table) -> list[dict[str, str]]:
    return [{head.title: cell.text for head, cell in zip(table.columns, row, strict=True)} for row in table.rows]


def found(fit: Calibration) -> dict[str, FittedValue]:
    return {p: v for p, v in fit.values.items() if v.kind in ("parameter", "level")}


def in_unit(v: FittedValue) -> dict[str, float]:
    return {"start": v.converted(v.start), "value": v.in_unit, "random": v.shown(v.error_random), "error": v.shown(v.error)}


def test_the_text_says_the_values(fit: Calibration) -> None:
    lines = {line.split()[0]: line for line in str(fit).splitlines() if "random +-" in line}
    assert set(lines) == set(found(fit))
    for path, v in found(fit).items():
        said = re.match(r"\s*\S+\s+(\S+).*random \+- (\S+)\s+total \+- (\S+).*start ([^\s,]+)", lines[path]).groups()  # type: ignore[union-attr]
        assert v.unit in lines[path]
        for text, name in zip(said, ("value", "random", "error", "start"), strict=True):
            assert is_rounded(text, in_unit(v)[name]), (path, text, name)


def test_the_text_says_the_sensors(fit: Calibration) -> None:
    for name, s in fit.sensors.items():
        (line,) = (one for one in str(fit).splitlines() if one.strip().startswith(f"{name}: RMSE"))
        rmse, largest = re.search(r"RMSE (\S+) K\s+largest (\S+) K", line).groups()  # type: ignore[union-attr]
        assert is_rounded(rmse, s.rmse)
        assert is_rounded(largest, abs(s.largest))
        assert ("white: yes" in line) == s.white


def test_the_page_says_the_numbers(fit: Calibration) -> None:
    for row in columns(tables.parameters(fit)):
        numbers = in_unit(fit.values[row["parameter"]])
        for column, name in (("before", "start"), ("after", "value"), ("± random", "random"), ("± total", "error")):
            assert is_rounded(row[column], numbers[name]), (column, row[column], name)
    for row in columns(tables.sensors(fit)):
        name = row["sensor"]
        s, median = fit.sensors[name], fit.median_rmse(name)
        for column, number in (("RMSE, K", s.rmse), ("median RMSE, K", median), ("mean, K", s.mean), ("largest, K", s.largest)):
            assert is_rounded(row[column], number), (column, row[column], number)
        assert is_rounded(row["bias, K"], fit.sensor_bias(name)[0])


def test_json_and_studio_say_the_numbers(fit: Calibration) -> None:
    said, studio = calibration_object(fit), fit_object(fit)
    assert studio["values"] == {p: said["shown"][p] for p in fit.values.parameters}
    assert set(said["shown"]) == set(found(fit))
    for path, v in found(fit).items():
        shown, of = said["shown"][path], unit(v.unit)
        assert shown["unit"] == v.unit
        assert said["values"][path] == pytest.approx(shown["value"] * float(of.factor) + float(of.offset))
        assert said["errors"][path] == pytest.approx(shown["random"] * float(of.factor))
        assert said["errors_total"][path] == pytest.approx(shown["error"] * float(of.factor))
    for name, s in fit.sensors.items():
        fitted = fit.values.sensors.get(name)
        assert studio["sensors"][name] == {"rmse": s.rmse, "bias": s.bias if fitted is None else fitted.value}
