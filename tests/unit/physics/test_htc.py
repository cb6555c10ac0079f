"""Coefficients side by side: numbers, errors, and what is said of their difference."""

from __future__ import annotations

import math
import re
import warnings

import ht
import pytest

import thermid as td
from by_code import of_code, raises_code, warns_code
from thermid.base.errors import code_of
from thermid.physics.htc import CORRELATION_ERROR

PRINTED = (0.026, 1.6e-5, 0.71)
SIDE = 0.17939  # of a square box 24.92 mm high with the printed area


def elegfo(**more: object) -> td.inference.HtcComparison:
    return td.inference.compare_htc("2.168 [W]", "0.082241 [m^2]", "35.938 [degC]", "24 [degC]", "24.92 [mm]", air=PRINTED, **more)


def box() -> td.inference.HtcComparison:
    with warns_code("physics.outside-range", match="9.67e"):
        return elegfo(box=(SIDE, SIDE))


def test_faces_agree_with_the_ht_library() -> None:
    """Its Nu_horizontal_plate_McAdams is the same law from another hand."""
    one, other = (c for c in box().correlations if "McAdams" in c.name)
    grashof, length = one.rayleigh / PRINTED[2], SIDE / 4
    nusselt = [ht.Nu_horizontal_plate_McAdams(Pr=PRINTED[2], Gr=grashof, buoyancy=up) for up in (True, False)]
    assert one.htc == pytest.approx(nusselt[0] * PRINTED[0] / length, rel=1e-12)
    assert other.htc == pytest.approx(nusselt[1] * PRINTED[0] / length, rel=1e-12)


def test_the_box_is_the_mean_over_its_faces() -> None:
    assert box().theoretical == pytest.approx(4.72, abs=0.005)
    assert box().correlations[-1].htc == box().theoretical


def test_air_is_that_of_the_mean_temperature_where_none_is_given() -> None:
    found = td.inference.compare_htc(2.168, 0.082241, "309.088 [K]", "297.15 [K]", 0.02492)
    assert found.theoretical == pytest.approx(6.917, rel=0.01)


def test_errors_of_power_and_area_join_those_of_the_sensors() -> None:
    found = elegfo(errors={"power": "0.1 [W]", "area": "0.004 [m^2]", "sensor": "0.25 [K]"})
    relative = math.hypot(0.1 / 2.168, 0.004 / 0.082241, 0.25 * math.sqrt(2) / 11.938)
    assert found.error == pytest.approx(found.effective * relative, rel=1e-12)


def test_above_the_laminar_range_it_warns_and_goes_on() -> None:
    with warns_code("physics.outside-range", match=r"1\.[0-9]+e\+09.*0.*1e\+09"):
        found = td.inference.compare_htc(100.0, 1.0, "320.0 [K]", "290.0 [K]", 0.8)
    assert [c.name.partition("(")[2] for c in found.correlations] == ["Churchill and Chu; Eq. 7)", "Churchill and Chu)"]
    assert found.theoretical == found.correlations[1].htc
    assert code_of(found.remarks[0]) == "physics.outside-range"
    assert "0 to 1e+09" in found.remarks[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert elegfo().correlations[0].rayleigh == pytest.approx(16582.5, abs=0.1)


def test_a_low_coefficient_is_not_explained_by_what_lies_inside() -> None:
    first, second = elegfo().remarks
    assert code_of(first) == "htc.differs"
    assert code_of(first) == "htc.differs"
    assert code_of(second) == "htc.differs"
    assert "32 % of 0.082241 m^2" in second
    assert code_of(second) == "htc.differs"
    assert "2.168 W" in second
    assert of_code(box().remarks, "htc.differs", r"47 % of 0\.082241 m\^2")


def test_a_high_coefficient_can_be_radiation_or_mounts() -> None:
    (remark,) = td.inference.compare_htc(8.0, 0.082241, "309.088 [K]", "297.15 [K]", 0.2).remarks
    assert code_of(remark) == "htc.differs"
    assert "0.6 to 5.3 W/(m^2 K)" in remark
    assert code_of(remark) == "htc.differs"
    (told,) = td.inference.compare_htc(20.0, 0.082241, "309.088 [K]", "297.15 [K]", 0.2, emissivity=0.85).remarks
    assert code_of(told) == "htc.differs"


def test_a_difference_within_the_errors_is_no_difference() -> None:
    found = elegfo()
    power = found.theoretical * (1 + CORRELATION_ERROR) * 0.082241 * 11.938
    (remark,) = td.inference.compare_htc(power, 0.082241, "309.088 [K]", "297.15 [K]", 0.02492, air=PRINTED).remarks
    assert code_of(remark) == "htc.agrees"


def test_a_cold_part_has_a_coefficient_too() -> None:
    """A part that takes up heat: everything with the other sign, but for the mean temperature of the air."""
    found = td.inference.compare_htc(-2.168, 0.082241, "285.212 [K]", "297.15 [K]", 0.02492, air=PRINTED)
    assert found.effective == pytest.approx(elegfo().effective, rel=1e-12)
    assert found.error == pytest.approx(elegfo().error, rel=1e-12)


def test_a_box_of_another_area_is_remarked() -> None:
    with pytest.warns(td.ThermidWarning):
        found = elegfo(box=("0.1 [m]", "0.1 [m]"))
    assert of_code(found.remarks, "htc.area-of-other-faces", r" 0\.029968 m\^2 .* 0\.082241 m\^2")


def test_it_prints() -> None:
    text = str(
        elegfo(
            errors={"drift": "0.7 [K]"}, parts={"case": (0.02492, 130.0)}, capacitance="707.52 [J/K]", settled_after="5 [h]", emissivity=0.3
        )
    )
    lines = [
        r" 2\.208 W/\(m\^2 K\)   \+- 0\.13 .* \+- 0\.13 ",
        r" 6\.798 W/\(m\^2 K\)   .*\(Churchill and Chu; Eq\. 7\)   Ra 1\.658e\+04",
        r" 1\.896 W/\(m\^2 K\) ",
        r" 0\.00042 .* 0\.0013 .* case",
        r" 3895\.9 s .* 3909 s \(2606 to 4601 s for 99\.9 to 98 %\)",
    ]
    assert [bool(re.search(wanted, line)) for wanted, line in zip(lines, text.splitlines(), strict=False)] == [True] * 5


@pytest.mark.parametrize(
    ("arguments", "code", "match"),
    [
        (
            (2.0, 0.1, "290.0 [K]", "300.0 [K]", 0.1),
            "value.contradicts",
            "2.*-10",
        ),
        ((2.0, 0.1, "300.0 [K]", "300.0 [K]", 0.1), "value.contradicts", "2.*0"),
        ((2.0, 0.0, "310.0 [K]", "300.0 [K]", 0.1), "value.outside-range", "compare_htc"),
        (("2 [m]", 0.1, "310.0 [K]", "300.0 [K]", 0.1), "unit.wrong-dimension", r"'\[m\]'.*\[W\]"),
        (("x", 0.1, "310.0 [K]", "300.0 [K]", 0.1), "value.wrong-kind", "'x'"),
    ],
)
def test_what_makes_no_coefficient_is_refused(arguments: tuple[str | float, ...], code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.inference.compare_htc(*arguments)
