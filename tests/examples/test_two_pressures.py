"""A second record at low pressure against a log in air alone, on the virtual laboratory's components; the table of the study's README."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.campaign, pytest.mark.document]
STUDY = Path(__file__).parents[2] / "examples" / "sisnav"
LINE = re.compile(r"(\w+) +(\d) log\(s\) +([\d.]+) degC +half-width +([\d.]+)% of the rise +truth (inside|OUTSIDE)")


def test_a_second_record_at_low_pressure(tmp_path: Path) -> None:
    """The hidden truth inside every interval; half-width at most 10 % with the second record, 25 % in air but for the accelerometer."""
    told = subprocess.run([sys.executable, STUDY / "two_pressures.py", tmp_path], check=True, capture_output=True, text=True).stdout
    found = LINE.findall(told)
    assert len(found) == 10
    assert {inside for *_, inside in found} == {"inside"}
    half = {(part, int(count)): float(width) for part, count, _, width, _ in found}
    assert max(width for (_, count), width in half.items() if count == 2) <= 10.0
    assert {part for (part, count), width in half.items() if count == 1 and width > 25.0} == {"Acc"}
    rows = re.findall(r"^\| (\w+) \| ([\d.]+) % \| ([\d.]+) % \|$", (STUDY / "README.md").read_text(encoding="utf-8"), re.M)
    assert len(rows) == 5
    for part, air, both in rows:
        assert float(air) == pytest.approx(half[part, 1], abs=0.6)
        assert float(both) == pytest.approx(half[part, 2], abs=0.06)
