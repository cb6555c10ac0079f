"""One view of a stage: what text, JSON, page and studio print are its numbers."""

from __future__ import annotations

import re

import pytest

from thermid.base.units import unit
from thermid.campaign.stages import Campaign
from thermid.fit.calibration import Calibration
from thermid.reporting._blocks.content import Table
from thermid.reporting._pages import tables
from thermid.reporting._pages.views import calibration_object, fit_object, view

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


def test_the_text_says_the_view_s_values(fit: Calibration) -> None:
    lines = {line.split()[0]: line for line in str(fit).splitlines() if "random +-" in line}
    assert set(lines) == set(view(fit).values)
    for path, q in view(fit).values.items():
        value, random, total, start = re.match(r"\s*\S+\s+(\S+).*random \+- (\S+)\s+total \+- (\S+).*start ([^\s,]+)", lines[path]).groups()  # type: ignore[union-attr]
        assert q.unit in lines[path]
        for text, number in ((value, q.value), (random, q.random), (total, q.error), (start, q.start)):
            assert is_rounded(text, number), (path, text, number)


def test_the_text_says_the_view_s_sensors(fit: Calibration) -> None:
    for name, s in view(fit).sensors.items():
        (line,) = (one for one in str(fit).splitlines() if one.strip().startswith(f"{name}: RMSE"))
        rmse, largest = re.search(r"RMSE (\S+) K\s+largest (\S+) K", line).groups()  # type: ignore[union-attr]
        assert is_rounded(rmse, s.rmse)
        assert is_rounded(largest, abs(s.largest))
        assert ("white: yes" in line) == s.white


def test_the_page_says_the_view_s_numbers(fit: Calibration) -> None:
    shown = view(fit)
    for row in columns(tables.parameters(fit)):
        q = shown.values[row["parameter"]]
        for column, number in (("before", q.start), ("after", q.value), ("± random", q.random), ("± total", q.error)):
            assert is_rounded(row[column], number), (column, row[column], number)
    for row in columns(tables.sensors(fit)):
        s = shown.sensors[row["sensor"]]
        for column, number in (("RMSE, K", s.rmse), ("median RMSE, K", s.median_rmse), ("mean, K", s.mean), ("largest, K", s.largest)):
            assert is_rounded(row[column], number), (column, row[column], number)
        assert is_rounded(row["bias, K"], s.bias)


def test_json_and_studio_say_the_view_s_numbers(fit: Calibration) -> None:
    shown, said, studio = view(fit), calibration_object(fit), fit_object(fit)
    assert said["shown"] == {p: q.answer() for p, q in shown.values.items()}
    assert studio["values"] == {p: said["shown"][p] for p in fit.values.parameters}
    for path, q in shown.values.items():
        of = unit(q.unit)
        assert said["values"][path] == pytest.approx(q.value * float(of.factor) + float(of.offset))
        assert said["errors"][path] == pytest.approx(q.random * float(of.factor))
        assert said["errors_total"][path] == pytest.approx(q.error * float(of.factor))
    for name, s in shown.sensors.items():
        assert studio["sensors"][name] == {"rmse": s.rmse, "bias": s.bias}
        assert said["sensors"][name] == {"rmse_K": s.rmse, "bias_K": s.bias, "mean_K": s.mean, "max_K": abs(s.largest), "n": s.samples}
        assert said["median_rmse_K"][name] == s.median_rmse
