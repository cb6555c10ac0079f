"""docs/levels.md: what the swap of a part of the navigation unit costs, against refitting everything."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
STUDY = ROOT / "examples" / "sisnav"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    sys.path.insert(0, str(STUDY))
    try:
        spec = importlib.util.spec_from_file_location("sisnav_swap", STUDY / "swap.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules["sisnav_swap"] = module
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(STUDY))
    return module


@pytest.mark.campaign
def test_a_swap_costs_a_local_retune(script: ModuleType, tmp_path: Path) -> None:
    found = script.study(tmp_path)
    for name, most in (("EleGFO", 3), ("a gyro", 3)):
        swap = found[name]
        plan = swap.plan
        assert len(plan.freed) <= most
        assert len(plan.tests) <= (len(plan.tests) + len(plan.kept_tests)) / 2
        assert swap.apart < 0.2
        assert swap.seconds[0] < 0.6 * swap.seconds[1]  # a third; how much exactly depends on what else the machine does
        kept = [s for s in plan.stages if s.action == "kept"]
        assert kept
        assert all(s.identity[0] == s.identity[1] for s in kept)
    gyro = {s.name: s.action for s in found["a gyro"].plan.stages}
    assert gyro["FOG_l"] == "kept", "the other gyro of that type keeps its values"
    assert gyro["FOG_l at imu.fog_y"] == "run"
    assert found["a gyro"].plan.freed == ("m_Sd: imu.fog_y.skin.effective_htc",)
    page = (ROOT / "docs" / "levels.md").read_text(encoding="utf-8")
    for name, swap in found.items():
        (row,) = re.findall(rf"^\| {name} \|(.*)\|$", page, re.MULTILINE)
        cells = [c.strip() for c in row.split("|")]
        assert int(cells[0]) == len(swap.plan.freed)
        assert cells[3] == f"{len(swap.plan.tests)} of {len(swap.plan.tests) + len(swap.plan.kept_tests)}"
        assert float(cells[5]) == pytest.approx(swap.apart, abs=0.02)
        assert [float(c) for c in cells[6:]] == pytest.approx(swap.rmse, abs=0.005)
