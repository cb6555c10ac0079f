"""The navigation unit qualified: one plan, one page, and what it says of itself."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import thermid as td
from webpage import crossings, faults, limited, without_script

EXAMPLES = Path(__file__).parents[2] / "examples"
ORDER = [
    *("objectives", "configuration", "sensors", "tests", "power", "stabilisation", "predicted", "heat", "parameters", "deviations"),
    *("overlays", "excluded", "discrepancies", "margins", "validity", "assumptions", "delivery"),
]
"""What a balance-test correlation report contains, in its order (SMC-S-016 8.2.6 and 8.3.7, MIL-HDBK-340 8.7.3)."""
KINDS = {"thermal cycling", "thermal vacuum", "humidity", "hold", "ascent", "on-board"}


def test_the_plan_stands_as_it_was_locked_and_says_that_logs_came_first() -> None:
    """Its decks, values, limits and scenarios among it; the logs are synthetic and were run while the plan was written."""
    pass

    plan = td.qualify.load_plan(EXAMPLES / "sisnav" / "qualification" / "plan.toml")
    status = plan.lock_status()
    assert (status.state, status.changed) == ("late", ())
    assert {t.kind for t in plan.tests} == KINDS


@pytest.mark.campaign
def test_the_unit_qualified_on_one_page(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    found = td.qualify.run_plan(tmp_path / "examples" / "sisnav" / "qualification" / "plan.toml")
    assert all(t.within for t in found.trials)
    assert found.worst is not None
    assert (found.worst.point, found.worst.test) == ("FOG_x", "thermal vacuum")
    logged = [t for t in found.trials if t.correlation is not None]
    assert {t.test.kind for t in logged} == {"thermal cycling", "thermal vacuum", "humidity"}
    assert all(t.correlation.passed("ECSS") for t in logged if t.correlation is not None and "ECSS" in t.correlation.verdicts)
    assert all(m.margin > 0 for m in found.margins)
    assert any("assumed values without a stated spread" in why for m in found.margins for why in m.not_counted)
    assert found.passed is False
    assert any("before the plan was locked" in why for why in found.open)
    (cycles,) = (r for r in found["thermal cycling"].remarks if "the clause requires 20 cycles in all" in r)
    assert cycles.endswith("the profile runs 16 and other tests of the plan 4")  # none is missing
    assert [max(p.cycle for p in found[t].course.phases) for t in ("thermal cycling", "thermal vacuum")] == [16, 4]
    assert found.demonstration.startswith("demonstration: 53 assumed parameters, synthetic data")
    text = td.reporting.qualification_report(found, to=tmp_path / "page.html").read_text(encoding="utf-8")
    assert "DEMONSTRATION: 53 ASSUMED PARAMETERS, SYNTHETIC DATA" in text
    assert "EXTRAPOLATION" in text
    without_script(text)
    assert faults(text) == []
    assert [c for c, figure in limited(text) if crossings(figure) and not c.endswith("NOT met")] == []
    assert len(limited(text)) == len(found.trials)
    sections = [s for s in re.findall(r'<section id="([\w-]+)"', text) if s in ORDER]
    assert sections == ORDER
    assert len(text) < 2_000_000
