"""Every consumer of a likelihood under every kind of noise: a sample with fixed seeds, the whole campaign, and the page that shows it."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from recovery.noise_cases import CONSUMERS, KINDS, Cell, campaign

pytestmark = [pytest.mark.recovery, pytest.mark.usefixtures("errors_in_turn")]
ROOT = Path(__file__).parents[2]
QUICK = {"fit": 1, "profile": 1, "next_test": 1, "steady point": 2, "energy_balance": 1}
SEED = 20261122


def pooled(cells: list[Cell]) -> tuple[int, int]:
    """Return how many intervals held, and how many there were."""
    return sum(sum(c.held.values()) for c in cells), sum(sum(c.claims.values()) for c in cells)


@pytest.mark.parametrize("consumer", QUICK)
def test_a_sample_of_the_table(consumer: str) -> None:
    """All kinds together: values of one log are correlated, so that they count as one and a half independent ones a log."""
    cells = [campaign(consumer, kind, QUICK[consumer], SEED) for kind in KINDS]
    held, count = pooled(cells)
    assert count
    independent = 1.5 * QUICK[consumer] * len(KINDS)
    assert held / count > 0.95 - 3.5 * np.sqrt(0.95 * 0.05 / independent)


def test_without_the_noise_of_logged_inputs_intervals_miss(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thermid.fit._uncertainty.noise.answers_to_inputs", lambda *_: {})
    monkeypatch.setattr("thermid.fit._calibrate._suspect", lambda *_: False)  # errors of a refuted structure would hide it
    cell = campaign("fit", "noisy ambient", 8, SEED)
    assert max(cell.squares.values()) > 1.5**2
    assert min(cell.shares.values()) < 0.9


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("consumer", CONSUMERS)
def test_each_cell_in_four_hundred_logs(consumer: str, kind: str) -> None:
    logs = 400 if consumer in QUICK else 100
    cell = campaign(consumer, kind, logs, SEED + 1)
    print(consumer, kind, cell)
    for name, share in cell.shares.items():
        # the 99 % range of a binomial, below which nothing lies
        assert share >= 0.95 - 2.576 * np.sqrt(0.95 * 0.05 / cell.claims[name]), name
    if kind.startswith("noisy") and consumer in ("fit", "next_test"):
        # noise of an input counts once: intervals are not too wide either
        assert max(cell.shares.values()) <= 0.95 + 2.576 * np.sqrt(0.95 * 0.05 / logs)
    if consumer.startswith("next_test"):
        assert all(0.85 <= np.sqrt(v) <= 1.15 for v in cell.squares.values())


def test_the_page_has_every_consumer_and_kind() -> None:
    spec = importlib.util.spec_from_file_location("noise_table", ROOT / "scripts" / "noise_table.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    page = (ROOT / "docs" / "coverage.md").read_text(encoding="utf-8")
    own = page[page.index(script.BEGIN) : page.index(script.END)]
    rows = {line.split("|")[1].strip(): line.count("|") for line in own.splitlines() if line.startswith("| ")}
    assert all(kind in own for kind in KINDS)
    assert [rows[c] for c in CONSUMERS] == [len(KINDS) + 3] * len(CONSUMERS)
    assert script.binomial_range(400) == pytest.approx((0.92, 0.9775), abs=0.006)
