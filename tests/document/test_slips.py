"""The document's 25 slips: each is handled, and where a test shows it, the test exists. E21 and E25 are shown here."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

import thermid as td

from .test_rows import every_test

pytestmark = pytest.mark.document
DECKS = Path(__file__).parents[2] / "examples" / "sisnav"
SLIPS = tomllib.loads((DECKS / "document.toml").read_text(encoding="utf-8"))["slips"]
BENCH = td.Scenario("bench", boundaries={"cv": "24 [degC]"})
GYRO = "imu.fog_y.case"


def test_there_are_25_of_them() -> None:
    assert [s["id"] for s in SLIPS] == [f"E{k}" for k in range(1, 26)]
    assert all(s["where"] and s["printed"] and s["meant"] and s["handled"] for s in SLIPS)


@pytest.mark.parametrize("slip", [s for s in SLIPS if "test" in s], ids=lambda s: s["id"])
def test_what_handles_a_slip_is_tested(slip: dict[str, str]) -> None:
    assert slip["test"] in every_test()


def test_E21_several_effects_of_like_size() -> None:  # noqa: N802
    """The gyros' slight increase in the full model has several causes: the processor is one of them, of no more weight than others."""
    whole, alone = td.load_model(DECKS / "m_Sd.toml"), td.load_model(DECKS / "m_IMU.toml")
    gyro = td.steady(whole, BENCH)[GYRO] - 273.15
    before = td.steady(alone, BENCH)["fog_y.case"] - 273.15
    assert (before, gyro) == pytest.approx((31.298, 32.109), abs=1e-3)
    cold = td.steady(whole, BENCH.with_(loads={"pre.proc.electronics": "0 [W]", "pre.ele.electronics": "0 [W]"}))[GYRO] - 273.15
    kept = {"imu.support_skin": 5.0, "imu.fog_x.skin": 4.8, "imu.fog_y.skin": 5.0, "imu.fog_z.skin": 5.0}
    airy = whole.with_values({f"{p}.effective_htc": {"value": f"{h} [W/(m^2 K)]", "min": 0} for p, h in kept.items()})
    bare = whole.with_values({"disk_skin.effective_htc": "0 [W/(m^2 K)]"})
    lower = {"support_skin": 3.5, "fog_x.skin": 3.8, "fog_y.skin": 3.0, "fog_z.skin": 3.0}
    still = alone.with_values({f"{p}.effective_htc": {"value": f"{h} [W/(m^2 K)]", "min": 0} for p, h in lower.items()})
    found = [cold, *(td.steady(m, BENCH)[n] - 273.15 for m, n in ((airy, GYRO), (bare, GYRO), (still, "fog_y.case")))]
    # the sheet: pair off, coefficients kept at their values in m_IMU, disk not convecting, m_IMU alone with the full model's coefficients
    assert found == pytest.approx([30.59, 30.50, 35.60, 34.27], abs=0.01)


def test_E25_bulk_aluminium_cannot_hold_the_printed_differences() -> None:  # noqa: N802
    """At the full model 2.5 W cross the processor's joint. Bulk aluminium would drop 0.03 K there; the decks' joint drops over 3 K."""
    whole = td.load_model(DECKS / "m_Sd.toml")
    network = td.simulation.compile_network(whole)
    values = network.numbers().values
    area, conductance = float(values["pre.stack.area"]), float(values["pre.stack.contact_conductance"])
    rest = td.steady(whole, BENCH)
    drop = rest["pre.proc.case"] - rest["pre.cd"]
    heat = drop * conductance * area
    assert heat == pytest.approx(2.5, abs=0.1)
    assert heat * 0.005 / (130.0 * area) == pytest.approx(0.033, abs=0.002)
    assert drop == pytest.approx(3.46, abs=0.01)
    assert conductance == pytest.approx(246.3, abs=0.1)
