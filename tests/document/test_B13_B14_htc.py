"""B13: theoretical and effective coefficient of the printed example (Eq. 7). B14: Biot numbers (section 2.4). The accelerometer's times."""

from __future__ import annotations

import pytest

import thermid as td
from by_code import of_code, warns_code

pytestmark = pytest.mark.document
AIR = (0.026, 1.6e-5, 0.71)


def elegfo(**more: object) -> td.inference.HtcComparison:
    """Section 'Example: EleGFO' of the source document."""
    return td.inference.compare_htc(2.168, 0.082241, "35.938 [degC]", "24 [degC]", 0.02492, air=AIR, **more)


def test_b13_eq7_and_the_effective_coefficient() -> None:
    found = elegfo(errors={"drift": "0.7 [K]"})
    assert found.theoretical == pytest.approx(6.797937, abs=1e-6)
    assert found.effective == pytest.approx(2.208205, abs=1e-6)
    assert round(found.theoretical, 3) == 6.798
    assert round(found.effective, 3) == 2.208
    assert round(found.error, 2) == 0.13  # two DS18B20 of 0.5 K
    assert round(found.error_drift, 2) == 0.13  # a room that varies by 0.7 K
    assert found.correlations[0].rayleigh == pytest.approx(16582.50, abs=0.01)


def test_b13_it_warns_above_a_rayleigh_number_of_1e9() -> None:
    with warns_code("physics.outside-range", match=r"2\.69e\+09.*0.*1e\+09"):
        td.inference.compare_htc(200.0, 2.0, "60 [degC]", "24 [degC]", "1 [m]")


def test_b14_biot_numbers() -> None:
    case = elegfo(parts={"case": (0.02492, 130.0)}).biot["case"]
    assert [float(f"{b:.1e}") for b in case] == [4.2e-4, 1.3e-3]
    # as a part of its own, at the coefficient that it is tuned to: what conducts, the sheet's number, and whether one node is enough
    for length, conductivity, htc, biot in (
        (0.05, 130.0, 5.0, 1.9e-3),  # FOG, 50 mm
        (0.05, 130.0, 6.0, 2.3e-3),  # ProcSISNAV
        (0.025, 15.0, 6.0, 1.0e-2),  # accelerometer, steel
        (0.020, 0.25, 5.0, 0.4),  # fibre coil
        (0.010, 0.026, 6.0, 2.3),  # gap of air
    ):
        part = td.inference.compare_htc(htc * 0.1 * 10.0, 0.1, "310 [K]", "300 [K]", 0.1, parts={"x": (length, conductivity)})
        assert float(f"{part.biot['x'][0]:.1e}") == pytest.approx(biot, rel=0.03)
        assert bool(of_code(part.remarks, "physics.not-one-temperature", "x")) == (biot > 0.1)


def test_the_accelerometer_settles_three_times_as_slowly_as_its_mass_says() -> None:
    """17 minutes by Fig. 16 against 'approximately 4 hours' in the text: section 4, conflict 1 of the acceptance sheet."""
    found = td.inference.compare_htc(
        0.225, 0.00420536, td.celsius(24.0 + 8.917191), td.celsius(24.0), 0.025, capacitance="0.054*480 [J/K]", settled_after="4 [h]"
    )
    settling = found.settling
    assert settling is not None
    assert settling.from_mass / 60 == pytest.approx(17.12, abs=0.01)
    assert settling.differs
    assert [r * found.settling.from_data[k] / settling.from_mass for k, r in ((0, 1.0), (1, 1.0))] == pytest.approx([3.6, 3.04], abs=0.02)
    assert of_code(found.remarks, "htc.differs", r" 3 .* 4 h .* 1\.31 h .* 99 %")


def test_the_power_supply_settles_as_its_mass_says() -> None:
    """Its mass was chosen so: 99 % after the printed 5 h."""
    found = elegfo(capacitance="0.737*960 [J/K]", settled_after="5 [h]")
    assert found.settling is not None
    assert not found.settling.differs
    assert found.settling.ratio == pytest.approx(1.0, abs=0.01)
