"""Parameters of FMUs fitted to synthetic readings with noise: our own, and two Reference-FMUs of the Modelica Association."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import IdentificationError
from thermid.interop._fmu.export import to_fmu
from thermid.interop._fmu.fitted import calibrate_fmu
from unit.interop.fmus import BOX, reference_fmu

pytest.importorskip("fmpy", reason="FMPy is not installed (pip install 'thermid[fmu]')")

QUIET = td.Scenario("test", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1200 [s]")
TIMES = np.linspace(0.0, 1200.0, 121)


def read(seed: int, **truth: str) -> dict[str, np.ndarray]:
    """Synthetic readings of both nodes with noise of 50 mK."""
    found = td.simulate(td.model_from_dict(BOX).with_values(truth), QUIET, times=TIMES)
    rng = np.random.default_rng(seed)
    return {f"T.{n}": found[n].kelvin + 0.05 * rng.standard_normal(TIMES.size) for n in ("a", "b")}


def test_our_own(tmp_path: Path) -> None:
    """Conductance, capacitance and power within two errors, for three seeds: 9 values, of which at most one may lie outside."""
    to_fmu(td.model_from_dict(BOX), QUIET, tmp_path / "box.fmu")
    outside = 0
    for seed in range(3):
        readings = read(seed, g="1.1 [W/K]", c="41 [J/K]", power="6 [W]")
        asked = {"p.g": (0.1, 5.0), "p.c": (10.0, 200.0), "p.power": (1.0, 20.0)}
        fit = calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, dict.fromkeys(readings, 0.05), asked)
        assert fit.converged
        assert 0.85 < fit.ratio < 1.15
        assert fit.remarks == ()
        for name, truth in (("p.g", 1.1), ("p.c", 41.0), ("p.power", 6.0)):
            outside += abs(fit.values[name] - truth) > 2.0 * fit.errors[name]
            assert fit.errors[name] < 0.02 * truth
    assert outside <= 1


def test_what_readings_do_not_tell_is_named(tmp_path: Path) -> None:
    """A load's command and its power act as a product alone."""
    double = {**BOX, "parameters": {**BOX["parameters"], "share": "1"}, "loads": {"heat": {"into": "a", "power": "power*share"}}}  # type: ignore[dict-item]
    to_fmu(td.model_from_dict(double), QUIET, tmp_path / "box.fmu")
    readings = read(4)
    asked = {"p.power": (1.0, 20.0), "p.share": (0.2, 3.0)}
    fit = calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, dict.fromkeys(readings, 0.05), asked)
    assert fit.undetermined == (("p.power", "p.share"),)
    assert str(fit).startswith("NOT DETERMINED: p.power and p.share")
    assert np.isinf(fit.errors["p.power"])


def test_a_model_that_misses_its_readings_says_so(tmp_path: Path) -> None:
    to_fmu(td.model_from_dict(BOX), QUIET, tmp_path / "box.fmu")
    readings = read(5)
    readings["T.b"] = readings["T.b"] + 2.0 * np.sin(TIMES / 200.0)
    fit = calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, dict.fromkeys(readings, 0.05), {"p.g": (0.1, 5.0)})
    assert "NOT ADEQUATE" in str(fit)
    assert "T.b" in str(fit).partition("wander")[0]


def test_noise_is_stated_with_its_unit_as_everywhere(tmp_path: Path) -> None:
    to_fmu(td.model_from_dict(BOX), QUIET, tmp_path / "box.fmu")
    readings, asked = read(7), {"p.g": (0.1, 5.0)}
    ways = (0.05, "50 [mK]", td.quantity(0.05, unit="K"))
    fits = [calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, dict.fromkeys(readings, way), asked) for way in ways]
    assert {tuple(fit.noise.values()) for fit in fits} == {(0.05, 0.05)}
    assert len({(fit.values["p.g"], fit.errors["p.g"]) for fit in fits}) == 1
    for wrong, words in (("0.05 [W]", "a temperature difference"), ("0.05 [degC]", "in degC or degF"), ("0.05", "K")):
        with pytest.raises(td.errors.UnitError, match=words):
            calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, dict.fromkeys(readings, wrong), asked)


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    to_fmu(td.model_from_dict(BOX), QUIET, tmp_path / "box.fmu")
    readings, noise = read(6), {"T.a": 0.05, "T.b": 0.05}
    for asked, words in (
        ({"p.gg": (0.1, 5.0)}, "no variable 'p.gg'"),
        ({"p.g": (2.0, 5.0)}, "must lie between"),
        ({}, "no parameter"),
        ({"heat.air": (0.0, 1.0)}, "is no parameter"),
    ):
        with pytest.raises(IdentificationError, match=words):
            calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, noise, asked)
    with pytest.raises(IdentificationError, match="equal steps"):
        calibrate_fmu(tmp_path / "box.fmu", TIMES**1.1, readings, noise, {"p.g": (0.1, 5.0)})
    with pytest.raises(IdentificationError, match="standard deviation"):
        calibrate_fmu(tmp_path / "box.fmu", TIMES, readings, {"T.a": 0.05}, {"p.g": (0.1, 5.0)})
    (tmp_path / "no.fmu").write_bytes(b"PK nothing")
    with pytest.raises(td.ThermidError, match="no FMU"):
        calibrate_fmu(tmp_path / "no.fmu", TIMES, readings, noise, {"p.g": (0.1, 5.0)})


REFERENCE = {"VanDerPol": ("mu", 2.3, "x0", 20.0), "Dahlquist": ("k", 1.7, "x", 3.0)}


@pytest.mark.parametrize("name", REFERENCE)
def test_a_reference_fmu(name: str, tmp_path: Path) -> None:
    """Compiled here from their sources: an FMU that thermid knows nothing of."""
    packed_file = reference_fmu(name, tmp_path)
    parameter, truth, output, end = REFERENCE[name]
    import fmpy

    times = np.linspace(0.0, end, 101)
    exact = fmpy.simulate_fmu(
        str(packed_file), fmi_type="CoSimulation", stop_time=end, output_interval=times[1], start_values={parameter: truth}, output=[output]
    )
    readings = exact[output] + 0.02 * np.random.default_rng(3).standard_normal(101)
    fit = calibrate_fmu(packed_file, times, {output: readings}, {output: 0.02}, {parameter: (0.2, 5.0)})
    assert abs(fit.values[parameter] - truth) < 2.0 * fit.errors[parameter]
    assert fit.errors[parameter] < 0.05 * truth
