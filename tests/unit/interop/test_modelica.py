"""Modelica packages: compiled and run by rumoca, without a library and on the Standard Library; parameters as formulas; refusals."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.interop.modelica import to_modelica
from unit.interop.networks import SIGNALS, hot_box
from unit.interop.test_c99 import MODELS, STILL, TIGHT, plate

CLOSE = 1e-5
"""[K]"""
RUN = (
    "linear",
    "radiation",
    "thermostat",
    "schedule",
    "gas gap",
    "schedule of lines",
    "massless",
    "massless and radiation",
    "table of property",
    "leakage",
)


def library() -> Path:
    """The folder of the Standard Library and its services, read where it lies."""
    folder = Path(os.environ.get("THERMID_PUBLIC", "/nowhere")) / "modelica/ModelicaStandardLibrary"
    if not (folder / "Modelica/package.mo").is_file():
        pytest.skip("modelica/ModelicaStandardLibrary is not under THERMID_PUBLIC")
    return folder


def farthest(text: str, model: td.Model, scenario: td.Scenario, roots: list[str], **values: float) -> float:
    """Largest difference of the nodes with mass between a package and `simulate`. [K]"""
    rumoca = pytest.importorskip("rumoca", reason="rumoca, a Modelica compiler, is not installed (pip install rumoca)")
    built = rumoca.Session(roots=roots).loads(text, model="Unit.Run")
    if values:
        built = built.with_params(**values)
    found = built.simulate(
        t=(0.0, scenario.seconds), dt=scenario.seconds / 24, config=rumoca.SimConfig(solver="bdf", rtol=1e-11, atol=1e-11)
    )
    times = np.asarray(found.time)
    rows = np.flatnonzero(np.append(np.diff(times) > 0.0, True) & (times > 0.0))
    ours = td.simulate(model, scenario, times=times[rows], options=TIGHT)
    nodes = [n for n in model.nodes if f"network.{n}.T" in found.names]
    assert nodes
    return max(float(np.abs(np.asarray(found[f"network.{n}.T"])[rows] - ours[n].kelvin).max()) for n in nodes)


@pytest.mark.parametrize("name", RUN)
def test_a_package_without_library_agrees(name: str) -> None:
    make, scenario = MODELS[name]
    model = make()
    text = to_modelica(model, scenario, name="Unit", library="none")
    assert "  Modelica." not in text
    assert farthest(text, model, scenario, []) < CLOSE


@pytest.mark.parametrize("name", ["radiation", "massless"])
def test_a_package_on_the_standard_library_agrees(name: str) -> None:
    make, scenario = MODELS[name]
    model = make()
    text = to_modelica(model, scenario, name="Unit")
    assert "Modelica.Thermal.HeatTransfer.Components.HeatCapacitor" in text
    assert "package Library" not in text
    assert farthest(text, model, scenario, [str(library())]) < CLOSE


def test_parameters_stay_formulas() -> None:
    text = to_modelica(hot_box(), SIGNALS, name="Unit", library="none")
    assert 'parameter Real p_glow_area = p_share*p_area "glow.area [m^2]";' in text
    changed = text.replace("parameter Real p_share = 0.25 ", "parameter Real p_share = 0.5 ")
    assert changed != text
    other = hot_box().with_values({"share": "0.5"})
    assert farthest(changed, other, SIGNALS, []) < CLOSE


def test_words_of_an_author_stay_in_their_strings() -> None:
    said: dict[str, Any] = plate(title='plate" end x; "\\', parameters={"model": {"value": "3", "note": 'a "quoted" \\ note'}})
    said["conductors"]["bolt"]["conductance"] = "0.1 [W/K]*model"
    model = td.model_from_dict(said)
    text = to_modelica(model, STILL, name="Unit", library="none")
    assert farthest(text, model, STILL, []) < CLOSE


def test_what_cannot_be_written_is_refused() -> None:
    make, scenario = MODELS["proportional"]
    with raises_code("output.not-expressible", match="'heater'"):
        to_modelica(make(), scenario, name="Unit")
    make, scenario = MODELS["smooth table"]
    with raises_code("output.not-expressible", match="'strap'.*'linear'"):
        to_modelica(make(), scenario, name="Unit")
    with raises_code("name.unknown", match="'msl'"):
        to_modelica(td.model_from_dict(plate()), STILL, name="Unit", library="msl")
    rows = {"times": [f"{k} [s]" for k in range(600)], "values": [str(k % 2) for k in range(600)], "hold": True}
    with raises_code("output.not-expressible", match="'heater'.*600.*500"):
        to_modelica(td.model_from_dict(plate()), STILL.with_(commands={"heater": rows}), name="Unit")


@pytest.mark.parametrize("name", ["2boxes", "model", "hot-box", "Modelica"])
def test_a_name_that_is_none_for_a_package_is_refused(name: str, tmp_path: Path) -> None:
    with raises_code("name.not-valid"):
        to_modelica(td.model_from_dict(plate()), STILL, tmp_path / f"{name}.mo")
    assert list(tmp_path.iterdir()) == []
