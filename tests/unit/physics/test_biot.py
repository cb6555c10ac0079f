"""Section 2.4 of the acceptance sheet."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

from by_code import warns_code
from thermid.base.errors import ThermidWarning
from thermid.physics.htc import biot_number, biot_warning

# htc [W/(m^2 K)], length [m], conductivity [W/(m K)], Biot number, relative tolerance of its printed digits
UNIFORM = [
    pytest.param(6.798, 0.02492, 130.0, 1.3e-3, 0.04, id="EleGFO case, theoretical"),
    pytest.param(2.2, 0.02492, 130.0, 4.2e-4, 0.012, id="EleGFO case, effective"),
    pytest.param(5.0, 0.050, 130.0, 1.9e-3, 0.027, id="FOG case"),
    pytest.param(6.0, 0.050, 130.0, 2.3e-3, 0.022, id="ProcSISNAV case"),
    pytest.param(6.0, 0.054 / 7900 / 0.00420536, 15.0, 6.5e-4, 0.008, id="accelerometer, volume over area"),
    pytest.param(6.0, 0.025, 15.0, 1.0e-2, 0.005, id="accelerometer, 25 mm"),
    pytest.param(6.0, 0.0016 / 2, 0.3, 0.016, 1e-9, id="board of 1.6 mm, half its thickness"),
]
LAYERED = [
    pytest.param(5.0, 0.020, 0.25, 0.4, 1e-9, id="fibre coil"),
    pytest.param(6.0, 0.010, 0.026, 2.3, 0.022, id="air gap"),
]


@pytest.mark.parametrize(("htc", "length", "conductivity", "biot", "tolerance"), UNIFORM)
def test_one_node_is_enough(htc: float, length: float, conductivity: float, biot: float, tolerance: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert biot_number(htc, length, conductivity) == pytest.approx(biot, rel=tolerance)


@pytest.mark.parametrize(("htc", "length", "conductivity", "biot", "tolerance"), LAYERED)
def test_one_node_is_not_enough(htc: float, length: float, conductivity: float, biot: float, tolerance: float) -> None:
    with warns_code("physics.not-one-temperature", match=r"0\.1"):
        found = biot_number(htc, length, conductivity)
    assert found == pytest.approx(biot, rel=tolerance)


def test_text_names_the_part() -> None:
    assert re.search(r"'fog\.coil' is 0\.4", biot_warning(0.4, "'fog.coil'"))
    assert biot_warning(0.1) == ""


def test_array_warns_for_its_largest() -> None:
    with pytest.warns(ThermidWarning, match=r"is 0\.4"):
        biot_number(5.0, np.array([0.0001, 0.020]), 0.25)
