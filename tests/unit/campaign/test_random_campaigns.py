"""Random campaigns: every value, with its error, is that of a separate least-squares fit, and every place that reads no result is named."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from thermid.campaign._stages import run_stages
from thermid.fit.calibration import Calibration
from unit.campaign.campaigns_at_random import Drawing, Known, Stage, held, joint_reference, reference

VALUES, ERRORS = 0.1, 0.02
"""What may differ: of a value in its standard errors, of a standard error in itself. [-]"""


@dataclass(frozen=True)
class Compared:
    """What a campaign came to: values compared, the largest differences, and whether all errors are those of the stated noise."""

    values: int
    apart: float
    wider: float
    plain: bool


def compare(seed: int, folder: Path) -> Compared:
    """Run a random campaign and compare each stage with the reference."""
    drawn = Drawing(seed)
    ran = run_stages(drawn.write(folder))
    done: dict[str, list[Known]] = {}
    values, apart, wider, plain = 0, 0.0, 0.0, True
    for name, stage in drawn.stages.items():
        fit = ran[name]
        # white noise looks as if it wandered once in a hundred traces; errors are wider then, and weights above lower
        plain = fit.autocorrelation is None or all(t.white_variance == 0.0 for t in fit.autocorrelation.traces)
        tried = {p: float(fit.model.at(p).expression.literal.value) for p in stage.deck.paths()}
        found = reference(stage, done, None if stage.hand else tried)
        done[name] = found.known
        every = {q: s for s in fit.store.parameters.values() for q in s.paths}
        assert {q for k in found.known for q in k.paths} == {*every}, (seed, name)
        for k in found.known:
            state = every[k.paths[0]]
            assert all(every[q].is_same(state) for q in k.paths), (seed, name, k.paths)
            assert state.origin.stage == k.stage, (seed, name, k.paths)
            values += 1
            apart = max(apart, abs(np.log(state.value) - k.value) / k.error)
            assert apart < VALUES, (seed, name, k.paths, state.value, np.exp(k.value), k.error)
            if plain:
                wider = max(wider, abs(fit.store.error(state.path) / state.value / k.error - 1.0))
                assert wider < ERRORS, (seed, name, k.paths, fit.store.error(state.path) / state.value, k.error)
        check_places(seed, stage, fit, done)
        if not plain:
            break
    if plain and ran.joint is not None and all(t.white_variance == 0.0 for t in ran.joint.autocorrelation.traces):
        for k in joint_reference(drawn.stages, drawn.found):
            v = next(v for v in ran.joint.values.values() if k.paths[0] in (v.path, *v.also))
            assert {v.path, *v.also} == {*k.paths}, (seed, "joint", k.paths, v.path, v.also)
            values += 1
            apart = max(apart, abs(np.log(v.value) - k.value) / k.error)
            assert apart < VALUES, (seed, "joint", k.paths, v.value, np.exp(k.value), k.error)
            wider = max(wider, abs(v.error / v.value / k.error - 1.0))
            assert wider < ERRORS, (seed, "joint", k.paths, v.error / v.value, k.error)
    return Compared(values, apart, wider, plain)


def check_places(seed: int, stage: Stage, fit: Calibration, done: dict[str, list[Known]]) -> None:
    """Every place of a model has the value that it should have, and those that read no result of their twins are named first."""
    if stage.hand:
        return
    now = held(stage, done)
    told = [w for w in fit.warnings if w.startswith("check:")]
    for p in now.silent:
        assert any(f"'{p}'" in w for w in told), (seed, stage.name, p, told)
    hidden = {p for k in now.every for p in k.paths if p not in now.acting}
    for p in hidden:
        assert any(f"'{p}' is" in w and "overrides" in w for w in fit.warnings), (seed, stage.name, p)
    for p in stage.deck.paths():
        value = float(fit.model.at(p).expression.literal.value)
        reads = p in fit.values.assignments or p in now.acting
        assert value == (fit.store[p].value if reads else stage.deck.value(p, False)), (seed, stage.name, p)


@pytest.mark.parametrize("seed", [*range(4), 33140, 33894])
def test_a_random_campaign_is_as_a_separate_fit_has_it(tmp_path: Path, seed: int) -> None:
    compare(seed, tmp_path)


@pytest.mark.campaign
def test_two_hundred_random_campaigns_are_as_a_separate_fit_has_them(tmp_path: Path) -> None:
    found = []
    for seed in range(1000, 1200):
        (tmp_path / str(seed)).mkdir()
        found.append(compare(seed, tmp_path / str(seed)))
    plain = [c for c in found if c.plain]
    print(
        f"{len(found)} campaigns, {sum(c.values for c in found)} values: at most {max(c.apart for c in found):.3f} standard errors apart; "
        f"{len(plain)} with white residuals, errors at most {100 * max(c.wider for c in plain):.2f} % apart"
    )
    assert len(plain) >= 150
