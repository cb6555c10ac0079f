"""One store for the hierarchy: what a stage found or tuned arrives at every level above, with its errors and where they come from."""

from __future__ import annotations

from pathlib import Path

import pytest

from thermid.identify.stages import Campaign, run_stages
from unit.identify.trees import joined, leaf, record_table, stage_table, write_decks, write_logs

COMPONENT = leaf("component", 0.20)
PAIR = joined("pair", {"p": COMPONENT}, (0.30, 0.30))
WHOLE = joined("whole", {"s": PAIR}, (0.30, 0.25))
G, J, E = "g.conductance", "to_p.conductance", "e.conductance"


def three_levels(folder: Path, inherit: str = 'as = "fixed"', **more: str) -> Campaign:
    """A component of truth 0.20, a joint of 0.30, a whole of 0.25 W/K; every deck says 0.30."""
    write_decks(folder, WHOLE)
    write_logs(folder, (COMPONENT, PAIR, WHOLE))
    stages = [
        stage_table("component", COMPONENT, [G]),
        stage_table("pair", PAIR, [J], f'p = {{ stage = "component", {inherit} }}'),
        stage_table("whole", WHOLE, [E], f's = {{ stage = "pair", {inherit} }}', more.get("whole", "")),
    ]
    path = folder / "campaign.toml"
    path.write_text("\n".join(['title = "Three levels"', *map(record_table, (COMPONENT, PAIR, WHOLE)), *stages]))
    return run_stages(path)


@pytest.mark.parametrize("how", ["fixed", "prior"])
def test_what_the_component_found_reaches_the_third_level(tmp_path: Path, how: str) -> None:
    found = three_levels(tmp_path, f'as = "{how}"')
    whole = found["whole"]
    assert whole.fitted_model.at(f"s.p.{G}").expression.literal.value == pytest.approx(0.20, abs=0.002)
    assert whole.fitted_model.at(f"s.{J}").expression.literal.value == pytest.approx(0.30, abs=0.01)
    assert abs(whole[E].value - 0.25) < 3 * whole[E].error < 0.02
    assert whole.store[f"s.p.{G}"].origin.stage == ("component" if how == "fixed" else "whole")


def test_a_fit_lists_what_it_was_given_and_by_whom(tmp_path: Path) -> None:
    text = str(three_levels(tmp_path)["whole"]).splitlines()
    assert any(line.split()[0] == f"s.p.{G}" and line.endswith("(stage 'component', fixed)") for line in text)
    assert any(line.split()[0] == f"s.{J}" and line.endswith("(stage 'pair', fixed)") for line in text)
