"""Equations in symbols: as numbers the same as the state space, as code the same as the symbols, and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from unit.interop.networks import HOT, hot_box
from unit.interop.programs import octave

sympy = pytest.importorskip("sympy", reason="sympy is not installed (thermid[symbolic])")
DECKS = Path(__file__).parents[3] / "examples" / "sisnav"


def straight() -> td.Model:
    """The linear part of the hot box, with two massless nodes in a row, one of them heated, and two paths side by side."""
    kept = {n: c for n, c in HOT["conductors"].items() if c["kind"] in ("conduction", "contact")}
    kept["beside"] = {"kind": "conduction", "between": ["box", "seam"], "conductance": "0.7 [W/K]"}
    kept["lid_wall"] = {"kind": "conduction", "between": ["lid", "wall"], "conductance": "0.3 [W/K]"}
    return td.model_from_dict({**HOT, "conductors": kept})


def rates(model: td.Model, temperatures: np.ndarray, boundaries: np.ndarray, powers: np.ndarray) -> np.ndarray:
    space = td.simulation.state_space(td.simulation.compile_network(model))
    return space.A @ temperatures + space.B_boundary @ boundaries + space.B_load @ powers


@pytest.mark.parametrize("deck", ["", "m_PrE", "m_AccS", "m_Sd"])
def test_the_code_gives_the_rates_of_the_state_space(deck: str) -> None:
    model = td.load_model(DECKS / f"{deck}.toml") if deck else straight()
    found = td.interop.equations(model)
    space = td.simulation.state_space(td.simulation.compile_network(model))
    rng = np.random.default_rng(4)
    t, b, q = (rng.uniform(280.0, 330.0, n) for n in (len(space.nodes), len(space.boundaries), len(space.loads)))
    names: dict[str, object] = {}
    exec(found.python(), names)
    held = {**found.values, **{str(s): (lambda _, v=v: v) for s, v in zip(found.inputs, (*b, *q), strict=True)}}
    assert names["derivatives"](0.0, t, held) == pytest.approx(rates(model, t, b, q), rel=1e-10)
    # eliminated one after the other, massless nodes do not multiply each other: m_Sd had abbreviations of 7,224 operations
    assert max((meaning.count_ops() for meaning in found.auxiliaries.values()), default=0) < 100
    assert sum(q.count_ops() for q in found.heat) < 500


def test_the_matrix_is_that_of_the_state_space() -> None:
    model = straight()
    found, space = td.interop.equations(model), td.simulation.state_space(td.simulation.compile_network(model))
    a = np.array(found.expanded(found.matrix).subs(found.values).tolist(), dtype=float)
    assert a == pytest.approx(space.A, rel=1e-12)


def test_the_steady_state_is_that_of_the_simulator() -> None:
    model = straight()
    held = td.steady(model, td.Scenario(boundaries={"air": "20 [degC]", "wall": "30 [degC]"}))
    found = td.interop.equations(model)
    given = {**found.values, "T_air": 293.15, "T_wall": 303.15, "Q_heater": 30.0, "Q_seam_heater": 2.0}
    settled = {str(s): float(e.subs(given)) for s, e in found.steady.items()}
    assert settled == pytest.approx({"T_box": held["box"], "T_lid": held["lid"]}, rel=1e-9)
    given |= settled
    for symbol, expression in found.massless.items():  # each needs no other than those before it
        given[str(symbol)] = float(found.expanded(expression).subs(given))
    assert (given["T_seam"], given["T_glue"]) == pytest.approx((held["seam"], held["glue"]), rel=1e-9)


def test_the_octave_code_runs(tmp_path: Path) -> None:
    """The function in the place of the exported one's own: the same temperatures."""
    model = td.load_model(DECKS / "m_PrE.toml")
    found = td.interop.equations(model)
    scenario = td.Scenario(boundaries={"cv": "24 [degC]"}, duration="1 [h]")
    times = np.array([0.0, 1200.0, 3600.0])
    held = " ".join(f"p.{n} = {v!r};" for n, v in found.values.items())
    held += " ".join(f"p.{s}_fun = @(t) {v};" for s, v in zip(found.inputs, (297.15, 4.11, 2.168), strict=True))
    driver = "function [t, T] = code(t, p)\n  if ischar(t), t = struct(); return, end\n"
    driver += "  options = odeset('RelTol', 1e-9, 'AbsTol', 1e-9);\n"
    driver += "  [~, T] = ode15s(@(t, T) derivatives(t, T, p), t, [297.15; 297.15], options);\n  T = T - 273.15;\nend\n"
    (tmp_path / "code.m").write_text(driver + found.octave(), encoding="utf-8")
    ours = td.simulate(model, scenario, times=times)
    assert (
        np.abs(octave(tmp_path / "code.m", times, held) - np.column_stack([ours[n].celsius for n in ("proc.case", "ele.case")])).max()
        < 1e-5
    )


def test_one_node_is_eq_3() -> None:
    found = td.interop.equations(td.load_model(DECKS / "Acc.toml"), {"skin": "R_conv", "case": "T_m", "cv": "T_k", "electronics": "Q_k"})
    assert str(found).splitlines()[:2] == ["Acc", "  C_m dT_m/dt = Q_k - (T_m - T_k)/R_conv"]
    assert [str(e) for e in found.steady.values()] == ["Q_k*R_conv + T_k"]
    assert found.values == pytest.approx({"C_m": 25.92, "R_conv": 39.63196}, rel=1e-6)
    assert found.symbols["R_conv"] == "resistance of skin [K/W]"
    assert "    (T_m,) = T\n" in found.python()


@pytest.mark.parametrize(
    ("names", "code", "match"),
    [
        ({"firts": "R_1"}, "name.unknown", "'firts'.*'first'"),
        ({"first": "R 1"}, "name.not-valid", "'R 1'"),
        ({"first": "R_third"}, "name.taken", "'R_third'"),
    ],
)
def test_names_that_do_not_fit_are_refused(names: dict[str, str], code: str, match: str) -> None:
    with raises_code(code, match=match):
        td.interop.equations(straight(), names)


def test_a_law_that_is_not_linear_is_refused() -> None:
    with raises_code("model.element-not-supported", match="'free'"):
        td.interop.equations(hot_box())


def test_a_steady_state_that_nobody_reads_or_that_is_none_is_refused() -> None:
    with raises_code("model.element-not-supported", match="m_Sd.*10.*6"):
        _ = td.interop.equations(td.load_model(DECKS / "m_Sd.toml")).steady
    alone = {"title": "pair", "nodes": {"a": {"capacitance": "1 [J/K]"}, "b": {"capacitance": "1 [J/K]"}}}
    alone["conductors"] = {"ab": {"kind": "conduction", "between": ["a", "b"], "conductance": "1 [W/K]"}}
    with raises_code("run.no-steady-state"):
        _ = td.interop.equations(td.model_from_dict(alone)).steady


def test_without_sympy_the_command_that_installs_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with raises_code("extra.not-installed", match="'sympy'"):
        td.interop.equations(straight())
