"""What a fit could not follow goes with its values: into margins, and into every member of a campaign of runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.fit.error_model import BandCause
from thermid.prediction._budget import SILENT, UNFITTED
from thermid.prediction._predict import IN_TESTS
from thermid.values.store import load_values
from unit.qualify.things import UNIT, soak, unit


@pytest.fixture(scope="module")
def fit() -> td.Calibration:
    """One conductance, fitted to a log with a slow wave of 0.4 K that the model cannot follow."""
    rng = np.random.default_rng(4)
    times = np.arange(0.0, 6 * 3600.0, 60.0)
    run = td.simulate(unit(), soak(25.0), times=times)
    wave = 0.4 * np.sin(2 * np.pi * times / 5400.0)
    made = {
        n: td.Channel.from_array(
            n, run[n].kelvin + wave + 0.1 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.1, accuracy=0.3
        )
        for n in ("proc", "ele", "plate")
    }
    return td.calibrate(unit(), td.Record.from_arrays("log", times, made), ["out.conductance"], scenario=soak(25.0))


def test_values_keep_it_and_predictions_from_them_count_it(fit: td.Calibration, tmp_path: Path) -> None:
    fit.values.save(tmp_path / "values.toml")
    values = load_values(tmp_path / "values.toml")
    (errors,) = td.design.Knowledge(fit.model, (values,)).errors
    kept = sum(w.weight * w.left_over**2 for w in errors.ways)
    seen = td.design.foresee(td.design.Knowledge(fit.model, (values,)), soak(40.0))
    assert seen.prediction["proc"].parts[BandCause.UNEXPLAINED] == pytest.approx(kept, rel=1e-6)
    assert not seen.prediction["air"].parts[BandCause.UNEXPLAINED].any()
    told = td.predict(fit, soak(40.0))
    assert seen.prediction["proc"].parts[BandCause.UNEXPLAINED][0] == pytest.approx(told["proc"].parts[BandCause.UNEXPLAINED][0])


def test_of_two_accounts_of_it_the_larger_counts(fit: td.Calibration) -> None:
    seen = td.design.foresee(td.design.Knowledge(fit.model, (fit.values,)), soak(40.0), nodes=["proc"])
    for size, cause in ((2.0, IN_TESTS), (0.01, BandCause.UNEXPLAINED)):
        wide = seen.widen({"proc": size}, IN_TESTS, "x").prediction["proc"].parts
        assert {c for c in (BandCause.UNEXPLAINED, IN_TESTS) if c in wide} == {cause}
        assert wide[cause][-1] == pytest.approx(max(size**2, seen.prediction["proc"].parts[BandCause.UNEXPLAINED][-1]))


def test_a_plan_counts_what_its_own_logs_show(tmp_path: Path) -> None:
    from unit.qualify.project import LOG, PLAN, measured, project

    measured(tmp_path, offset=1.5)
    text = PLAN[: PLAN.index('\n[[tests]]\nname = "experiment')]
    (before,) = {m.not_counted[0] for m in td.qualify.run_plan(project(tmp_path, text)).margins if not m.is_start_value}
    assert before == UNFITTED
    found = td.qualify.run_plan(project(tmp_path, text + LOG))
    hot = next(m for m in found.margins if m.side == "hot")
    assert hot.shares == {IN_TESTS: pytest.approx(1.0)}
    assert found["hot"].correlation is not None
    (proc,) = [d for d in found["hot"].correlation.deviations if (d.sensor, d.kind) == ("T_PROC", "transient")]
    assert 1.2 < proc["rmse"] < 1.5
    assert hot.error == pytest.approx(proc["rmse"])
    assert "not counted" not in str(hot)


def test_a_margin_counts_the_constant_coefficients_of_a_values_file_or_names_them(tmp_path: Path) -> None:
    """Of two surfaces with constant coefficients one was fitted; the other is assumed and counted as that."""
    from unit.qualify.project import PLAN, project

    surface = {"area": "0.05 [m^2]", "htc": {"value": "8 [W/(m^2 K)]", "min": 3, "max": 20}}
    deck = {**UNIT, "surfaces": {f"skin_{n}": {"of": n, "to": "air", **surface} for n in ("proc", "ele")}}
    model = td.model_from_dict(deck)
    times = np.arange(0.0, 4 * 3600.0, 120.0)
    run = td.simulate(model, soak(25.0, hours=4.0), times=times)
    rng = np.random.default_rng(2)
    made = {
        n: td.Channel.from_array(n, run[n].kelvin + 0.1 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.1)
        for n in ("proc", "ele")
    }
    fit = td.calibrate(model, td.Record.from_arrays("log", times, made), ["skin_proc.htc"], scenario=soak(25.0, hours=4.0))
    fit.values.save(tmp_path / "fit.values.toml")
    file = project(tmp_path, PLAN.replace('deck = "unit.toml"', 'deck = "unit.toml"\nvalues = "fit.values.toml"'))
    td.save_model(model, tmp_path / "unit.toml")
    counted = td.qualify.run_plan(file).margins
    assert not any(why == SILENT for m in counted for why in m.not_counted)
    assert any(m.shares.get("extrapolation", 0.0) > 0.05 for m in counted)
    # what elements may differ by, from their laws and from one test to the next, is most of it
    assert all(m.shares["extrapolation"] + m.shares["differences between tests"] > 0.8 for m in counted)
    # a file of before does not hold the fit's response
    old = replace(fit.values, provenance={k: v for k, v in fit.values.provenance.items() if k != "errors"})
    old.save(tmp_path / "fit.values.toml")
    assert SILENT in {why for m in td.qualify.run_plan(file).margins for why in m.not_counted}
