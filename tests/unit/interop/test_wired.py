"""The flattened network for exporters: parameters in order, loads with their laws and controls, courses of parameters, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError
from thermid.interop._wired import Formula, Text, conductance_text, named, wired, with_formulas
from thermid.interop.c99 import C
from thermid.model.tree import Law
from thermid.simulation._network.rows import CONDUCTORS, heat
from thermid.simulation.runs import ConductorRow
from unit.interop.networks import SIGNALS, hot_box

WIDE = C


def pipe(**changed: Any) -> td.Model:
    """Parameters with every function of an expression."""
    deck = {
        "title": "pipe",
        "needs": ["air"],
        "parameters": {
            "outer": "0.03 [m]",
            "inner": "0.02 [m]",
            "root": "sqrt(outer*inner)",
            "wide": "max(outer, 2*inner)",
            "slim": "min(outer, inner) + abs(inner - outer)",
            "share": "exp(-0.5*outer/inner)",
        },
        "nodes": {"core": {"capacitance": "200 [J/K]"}, "shell": {"capacitance": "300 [J/K]"}},
        "conductors": {
            "wall": {
                "kind": "conduction",
                "between": ["core", "shell"],
                "conductivity": "0.3 [W/(m K)]",
                "area": "0.05 [m]*inner",
                "thickness": "outer - inner",
            },
            "skin": {"kind": "convection", "between": ["shell", "air"], "htc": "8 [W/(m^2 K)]", "area": "share*wide*(root + slim)"},
        },
        "loads": {"heater": {"into": "core", "power": "3 [W]"}},
    }
    return td.model_from_dict({**deck, **changed})


STILL = td.Scenario(boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]")


def test_functions_stay_formulas() -> None:
    """The functions of expressions follow their parameters, by text and by value."""
    model = pipe()
    network = td.simulation.compile_network(model)
    plain, made = network.numbers(), with_formulas(network)
    for one, other in zip(plain.conductors, made.conductors, strict=True):
        assert [float(c) for c in other.coefficients] == [float(c) for c in one.coefficients]
    w = wired(model, STILL, WIDE)
    values = {each.path: each.value for each in w.parameters}
    made_of = {"outer": 0.045, "inner": 0.02}
    other = {p: float(v) for p, v in td.simulation.compile_network(model.with_values({"outer": "45 [mm]"})).numbers().values.items()}
    names: dict[str, Any] = {"exp": math.exp, "sqrt": math.sqrt, "log": math.log, "min": min, "max": max}
    for each in w.parameters:
        if each.formula is not None:
            text = Text(lambda path: f"v[{path!r}]", "**").text_of(each.formula)
            assert eval(text, {**names, "v": values}) == pytest.approx(each.value, rel=1e-14)
    changed = {**values, **made_of}
    for each in w.parameters:
        if each.formula is not None:
            changed[each.path] = eval(Text(lambda path: f"v[{path!r}]", "**").text_of(each.formula), {**names, "v": changed})
    assert changed == pytest.approx({p: other[p] for p in changed}, rel=1e-14)
    wall = next(row for label, row in w.conductors if label == "wall")
    assert wall.coefficients[0].paths() >= {"wall.area", "wall.thickness"}  # type: ignore[union-attr]


def test_numpy_on_a_formula_makes_a_formula() -> None:
    a = named("a", 2.0)
    made = np.float64(3.0) * np.log(a) - np.maximum(a, 1.0) ** np.float64(0.5)
    assert isinstance(made, Formula)
    assert Text(lambda path: path).text_of(made) == "3*log(a) - max(a, 1)^0.5"
    assert float(made) == pytest.approx(3.0 * np.log(2.0) - np.sqrt(2.0))
    with pytest.raises(TypeError):
        np.cos(a)


def test_parameters_stand_after_what_they_are_made_of() -> None:
    w = wired(pipe(), STILL, WIDE)
    seen: set[str] = set()
    for each in w.parameters:
        assert each.formula is None or each.formula.paths() <= seen
        seen.add(each.path)
    units = {each.path: each.unit for each in w.parameters}
    assert units["outer"] == "m"
    assert units["share"] == "-"
    assert "skin.htc" in seen


def test_loads_keep_their_law_and_their_control() -> None:
    loads = {
        "leak": {"into": "core", "power": "3 [W]", "temperature_coefficient": "0.01 [1/K]", "reference_temperature": "20 [degC]"},
        "heater": {
            "into": "core",
            "power": "5 [W]",
            "thermostat": {"on_below": "30 [degC]", "off_above": "35 [degC]", "sensor": "shell"},
        },
    }
    model = pipe(loads=loads)
    leak, heater = wired(model, STILL, WIDE).sources
    assert (leak.form, [float(c) for c in leak.rest], leak.sensor, leak.control) == ("polynomial", [0.01, 0.0, 293.15], "core", "")
    assert (heater.form, heater.control, heater.watched) == ("signal", "thermostat", "shell")
    assert [float(c) for c in heater.settings] == [303.15, 308.15]
    with raises_code("output.not-expressible", match="'leak'.*SPICE"):
        wired(model, STILL, "SPICE")


def test_a_parameter_that_follows_a_signal_is_no_quantity() -> None:
    steps = {"times": ["0 [s]", "600 [s]"], "values": ["8 [W/(m^2 K)]", "4 [W/(m^2 K)]"], "hold": True}
    w = wired(pipe(), STILL.with_(schedule={"skin.htc": steps}), WIDE)
    assert list(w.courses) == ["skin.htc"]
    assert w.breaks() == [600.0]
    assert "skin.htc" not in {each.path for each in w.parameters}


def test_straight_lines_of_a_parameter_that_is_no_factor_are_refused() -> None:
    lines = {"times": ["0 [s]", "600 [s]", "1 [h]"], "values": ["30 [mm]", "40 [mm]", "30 [mm]"]}
    with raises_code("output.not-expressible", match="'wall'.*'outer'"):
        wired(pipe(), STILL.with_(schedule={"outer": lines}), WIDE)
    wired(pipe(), STILL.with_(schedule={"outer": {**lines, "hold": True}}), WIDE)
    factor = {**lines, "values": ["8 [W/(m^2 K)]", "4 [W/(m^2 K)]", "8 [W/(m^2 K)]"]}
    wired(pipe(), STILL.with_(schedule={"skin.htc": factor}), WIDE)


def test_the_network_of_octave_is_as_before() -> None:
    w = wired(hot_box(), SIGNALS, "Octave")
    assert {s.form for s in w.sources} == {"signal"}
    assert w.courses == {}


@pytest.mark.parametrize("form", CONDUCTORS)
def test_a_law_in_text_is_that_of_the_kernel_or_refused(form: str) -> None:
    """Octave got a constant conductance for every law that its writer did not know."""
    given = {"c": 0.4e-8, "n": 0.31}
    row = ConductorRow("path", ("a", "b"), Law(form, tuple(given.values())[: CONDUCTORS[form].coefficients]))
    if form not in ("linear", "flow", "power", "radiation", "potential"):  # tables are read where they are
        with raises_code("output.not-expressible", DeckError, match=f"{form}. Export an FMU"):
            conductance_text(row, [*given], "a", "b", lambda curve, at: "")
        return
    text = conductance_text(row, [*given], "a", "b", lambda curve, at: "").replace("^", "**")
    if form != "potential":  # its integrals stand beside the text
        hot, cold = np.array([330.0, 290.0]), np.array([300.0, 341.0])
        asked = eval(text, {}, {**given, "a": hot, "b": cold})
        np.testing.assert_allclose(asked * (hot - cold), heat(form, row.coefficients, None, hot, cold), rtol=1e-12)
