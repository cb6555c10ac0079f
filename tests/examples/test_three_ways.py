"""docs/levels.md: the three ways from parts to an assembly reach what the page says, and teach what it says."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SAO_PAULO = ROOT.parent / "shared" / "data" / "tclabsp"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("three_ways", ROOT / "scripts" / "three_ways.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["three_ways"] = module
    spec.loader.exec_module(module)
    return module


def printed(name: str) -> dict[str, list[float]]:
    """Way -> RMSE of a table of the page. [K]"""
    text = (ROOT / "docs" / "levels.md").read_text(encoding="utf-8").partition(f"<!-- {name} -->\n")[2].partition("<!-- end -->")[0]
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")][2:]
    return {row[0].strip(): [float(x) for x in re.findall(r"(\d\.\d{3}) \(largest", "|".join(row))] for row in rows}


def found(script: ModuleType, rows: list[Any], name: str, key: str) -> dict[str, list[float]]:
    table = script.tables({key: rows})[name]
    lines = [line.strip("|").split("|") for line in table.splitlines() if line.startswith("|")][2:]
    return {row[0].strip(): [float(x) for x in re.findall(r"(\d\.\d{3}) \(largest", "|".join(row))] for row in lines}


@pytest.mark.campaign
def test_on_the_navigation_unit(script: ModuleType, tmp_path: Path) -> None:
    script.laboratory(tmp_path)
    rows = script.sisnav(tmp_path)
    reached, page = found(script, rows, "sisnav", "sisnav"), printed("sisnav")
    assert set(reached) == set(page)
    for way, figures in page.items():
        assert reached[way] == pytest.approx(figures, abs=0.01)
    constants, joint = reached["constants upward"], reached["... and a joint fit"]
    assert joint[1] < 0.85 * constants[1], "below the top constants cost most, where no test has a pause"
    assert reached["all at once, no stages"] == pytest.approx(reached["... and a joint fit"], abs=0.005)
    assert "imu.support_mass" in rows[-1].refused
    assert {w.name: w.moved for w in rows if w.moved} == dict.fromkeys(
        ("constants upward", "... and a joint fit", "priors upward"), "moved"
    )


@pytest.mark.campaign
@pytest.mark.skipif(not SAO_PAULO.is_dir(), reason="the logs of the Sao Paulo board are not in ../shared/data/tclabsp")
def test_on_the_heater_board(script: ModuleType) -> None:
    rows = script.tclab(SAO_PAULO)
    for name in ("tclab T1", "tclab T2"):
        reached, page = found(script, rows, name, "tclab"), printed(name)
        assert set(reached) == set(page)
        for way, figures in page.items():
            assert reached[way] == pytest.approx(figures, abs=0.02)
    first = found(script, rows, "tclab T1", "tclab")
    assert first["priors upward"][0] < 0.85 * first["constants upward"][0]
