"""Property tables are straight lines between their points, in every run; their knees are not stepped over."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, SolverError
from thermid.model._laws.stores import curve, store
from thermid.model._tree.identity import to_dict

CONDUCTANCE = [(0.0, 0.1), (10.0, 0.1), (20.0, 0.5), (40.0, 0.3)]
LARGE = ["RKC2", "TR-BDF2"]
"""Methods of large networks."""
POWER = [(0.0, 40.0), (15.0, 34.0), (30.0, 28.0), (80.0, 5.0)]
SWING = [(-40.0, 0.3), (-5.0, 1.0), (5.0, 0.2), (60.0, 1.5)]


def points(table: list[tuple[float, float]], of: str, unit: str = "degC") -> list[list[str]]:
    return [[f"{x!r} [{unit}]", f"{y!r} [{of}]"] for x, y in table]


def lines(table: list[tuple[float, float]], at: Any) -> Any:
    return np.interp(at, *zip(*table, strict=True))


def box(table: dict[str, Any] | None = None, power: Any = None, **more: Any) -> td.Model:
    law = {"points": points(CONDUCTANCE, "W/K")} if table is None else table
    heat = {"into": "x", "table": {"points": points(POWER, "W")}} if power is None else {"into": "x", "power": power}
    deck = {
        "title": "box",
        "needs": ["air"],
        "nodes": {"x": {"capacitance": "50 [J/K]"}},
        "conductors": {"link": {"kind": "table", "between": ["x", "air"], "table": law}},
        "loads": {"heat": heat},
    }
    return td.model_from_dict(deck | more)


def bench(**more: Any) -> td.Scenario:
    return td.Scenario("bench", **({"boundaries": {"air": "0 [degC]"}, "start": "0 [degC]", "duration": "10 [min]"} | more))


def exact(times: Any, start: float = 0.0, air: float = 0.0) -> Any:
    """Temperatures of the box [degC] by an integrator of its own."""

    def rate(_: float, t: Any) -> Any:
        return (lines(POWER, t) - lines(CONDUCTANCE, 0.5 * (t + air)) * (t - air)) / 50.0

    return solve_ivp(rate, (0.0, times[-1]), [start], rtol=1e-11, atol=1e-11, max_step=1.0, t_eval=times).y[0]


# the tables themselves ---------------------------------------------------------------------------------------------------------------


def test_a_table_is_numpys_interp() -> None:
    given = curve("temperature", CONDUCTANCE)
    at = np.linspace(-20.0, 100.0, 4001)
    assert np.abs(given.evaluate(at) - lines(CONDUCTANCE, at)).max() < 1e-14


def test_a_conductivity_of_10_to_20_gives_the_mean_and_no_bend() -> None:
    """k from 10 to 20 W/(m K) over 0 to 100 degC, 1 W through 1 m of 1/... : the middle of two halves lies at 41.42 degC, not 43.54."""
    k = {"points": [["0 [degC]", "10 [W/(m K)]"], ["100 [degC]", "20 [W/(m K)]"]]}
    half = {"kind": "conduction", "conductivity": k, "area": "1 [cm^2]", "thickness": "1 [cm]"}
    model = td.model_from_dict(
        {
            "title": "bar",
            "needs": ["hot", "cold"],
            "nodes": {"m": {"capacitance": "1 [J/K]"}},
            "conductors": {"a": half | {"between": ["cold", "m"]}, "b": half | {"between": ["m", "hot"]}},
        }
    )
    ends = td.Scenario("ends", boundaries={"cold": "0 [degC]", "hot": "100 [degC]"}, start="cold", duration="1 [h]")
    # integral of 10 + t/10 up to T is half of that up to 100: T^2 / 20 + 10 T = 750
    middle = -100.0 + np.sqrt(100.0**2 + 20.0 * 750.0)
    assert td.steady(model, ends)["m"] - 273.15 == pytest.approx(middle, abs=1e-9)
    assert td.simulate(model, ends)["m"].final == pytest.approx(middle, abs=1e-6)


def test_smooth_is_asked_for() -> None:
    smooth = {"points": points(CONDUCTANCE, "W/K"), "interpolation": "smooth"}
    kept = to_dict(box(smooth))["conductors"]["link"]["table"]
    assert kept["interpolation"] == "smooth"
    assert "interpolation" not in to_dict(box())["conductors"]["link"]["table"]
    given = box(smooth).conductors["link"].curve
    assert given is not None
    assert given.slopes[0] == 0.0
    assert box(smooth).identity() != box().identity()
    run = td.simulate(box(smooth), bench())
    assert np.abs(run["x"].celsius - exact(run.times)).max() > 0.05


# runs --------------------------------------------------------------------------------------------------------------------------------


def test_a_run_over_knees_is_right() -> None:
    run = td.simulate(box(), bench(), every=5.0)
    assert np.abs(run["x"].celsius - exact(run.times)).max() < 2e-5
    assert run.heat_balance().relative < 1e-9
    seen = run["x"].celsius
    assert np.abs(run.heat_flow("link") - lines(CONDUCTANCE, 0.5 * seen) * seen).max() < 1e-9
    assert np.abs(run.load_powers["heat"] - lines(POWER, seen)).max() < 1e-9


def test_members_of_an_ensemble_are_single_runs() -> None:
    model, air = box(), [-10.0, 0.0, 7.0, 20.0, 35.0]
    many = td.ensemble(model, bench(), {"air": td.celsius(air)})
    assert many.statistics["one_by_one"] == 0
    for k, a in enumerate(air):
        alone = exact(many.times, air=a)
        assert np.abs(many.temperatures("x")[:, k] - 273.15 - alone).max() < 1e-4


@pytest.mark.parametrize("method", LARGE)
def test_large_networks_read_the_same_tables_to_a_millikelvin(method: str) -> None:
    """At the tolerance that is theirs where a table is read; 3e-3 K left 8.8 mK."""
    run = td.simulate(box(), bench(), every=5.0, options=td.Options(method=method))
    assert np.abs(run["x"].celsius - exact(run.times)).max() < 1e-3
    assert run.heat_balance().relative < 1e-12
    one = td.simulate(box({"points": points([(-100.0, 0.1), (200.0, 0.5)], "W/K")}, "40 [W]"), bench(), options=td.Options(method=method))
    assert one["x"].final == pytest.approx(
        td.simulate(box({"points": points([(-100.0, 0.1), (200.0, 0.5)], "W/K")}, "40 [W]"), bench())["x"].final, abs=1e-3
    )


@pytest.mark.parametrize("method", LARGE)
def test_a_rough_step_of_a_large_network_does_not_pass_over_a_melting_point(method: str) -> None:
    """At a tolerance of 0.1 K the estimate of a step of TR-BDF2 saw nothing of the knee between its stages: 1.4 K."""
    model = lump(wax([*WAX[:2], (27.0, 258e3), WAX[3]]), "0 [W]", "2 [W/K]")
    hot = bench(boundaries={"air": "60 [degC]"}, duration="5 [h]")
    fine = td.simulate(model, hot, every=60.0)
    run = td.simulate(model, hot, every=60.0, options=td.Options(error=9e-2, method=method))
    assert np.abs(run["x"].celsius - fine["x"].celsius).max() < 0.2


@pytest.mark.parametrize("name", ["air", "initial.x"])
def test_sensitivities_across_a_knee(name: str) -> None:
    run = td.prepare(box(), bench(), [name], every=5.0).run(sensitivities=True)
    step = 1e-3
    if name == "air":
        up, down = (exact(run.times, air=s) for s in (step, -step))
    else:
        up, down = (exact(run.times, start=s) for s in (step, -step))
    slope = (up - down) / (2.0 * step)
    assert np.abs(run.sensitivity("x", name) - slope).max() < 1e-3


def test_a_table_over_a_difference() -> None:
    law = {"over": "difference", "points": points(SWING, "W/K", "K")}
    run = td.simulate(box(law, "3 [W]"), bench(start="-30 [degC]"), every=5.0, options=td.Options(error=4e-6))
    fine = solve_ivp(
        lambda _, t: (3.0 - lines(SWING, t) * t) / 50.0, (0.0, 600.0), [-30.0], rtol=1e-11, atol=1e-11, t_eval=run.times, max_step=1.0
    )
    assert np.abs(run["x"].celsius - fine.y[0]).max() < 5e-5


def test_a_node_that_rests_on_a_knee_and_one_that_swings_over_it() -> None:
    """5 W meet 5 W at a mean temperature of 20 degC: the knee; a sine of the air carries it to and fro."""
    rest = td.simulate(box(power="5 [W]"), bench(boundaries={"air": "15 [degC]"}, start="25 [degC]", duration="5 [h]"))
    assert rest["x"].celsius[-1] == pytest.approx(25.0, abs=1e-6)
    assert rest.statistics["steps"] < 200
    air = {"mean": "15 [degC]", "amplitude": "0.1 [K]", "period": "10 [min]"}
    run = td.simulate(
        box(power="5 [W]"), bench(boundaries={"air": air}, start="25 [degC]", duration="1 [h]"), every=60.0, options=td.Options(error=4e-6)
    )

    def rate(s: float, t: Any) -> Any:
        a = 15.0 + 0.1 * np.sin(2.0 * np.pi * s / 600.0)
        return (5.0 - lines(CONDUCTANCE, 0.5 * (t + a)) * (t - a)) / 50.0

    fine = solve_ivp(rate, (0.0, 3600.0), [25.0], rtol=1e-10, atol=1e-11, t_eval=run.times, max_step=1.0)
    assert np.abs(run["x"].celsius - fine.y[0]).max() < 1e-5


@pytest.mark.parametrize("air", [-20.0, 10.0, 25.0, 34.9, 60.0])
def test_steady_states_on_either_side_of_knees(air: float) -> None:
    rest = td.steady(box(), bench(boundaries={"air": f"{air} [degC]"}))["x"] - 273.15
    assert abs(lines(POWER, rest) - lines(CONDUCTANCE, 0.5 * (rest + air)) * (rest - air)) < 1e-8


def test_a_heat_pipe_is_the_table_through_its_points() -> None:
    pipe = {"kind": "heat_pipe", "between": ["x", "air"], "on_conductance": "0.5 [W/K]", "off_conductance": "0.1 [W/K]"}
    pipe |= {"start_temperature": "15 [degC]", "transition": "10 [K]"}
    law = {"points": points([(10.0, 0.1), (20.0, 0.5)], "W/K")}
    runs = [td.simulate(m, bench(), every=5.0)["x"].celsius for m in (box(law), box(conductors={"link": pipe}))]
    assert np.abs(runs[0] - runs[1]).max() < 2e-5


def test_steady_states_pass_knees_that_newton_alone_rests_at() -> None:
    """A conductance that falls steeply and a load that falls: less heat left over leads to a knee, and not to the balance."""
    steep = points([(16.82, 0.9316), (17.93, 0.4998), (27.5, 0.348), (46.8, 0.6105)], "W/K")
    k = points([(11.36, 12.92), (19.25, 14.66), (29.49, 12.02), (32.99, 7.793)], "W/(m K)")
    swing = points([(-27.1, 0.6129), (-16.12, 0.9267), (9.107, 0.9416), (22.9, 0.3814), (26.34, 0.9224)], "W/K", "K")
    power = points([(14.18, 25.96), (20.95, 11.875), (25.9, 7.82), (36.33, 7.695)], "W")
    chain = {
        "t": {"kind": "table", "between": ["x", "air"], "table": {"points": steep}},
        "k1": {"kind": "conduction", "between": ["x", "m"], "conductivity": {"points": k}, "area": "1 [cm^2]", "thickness": "2 [mm]"},
        "k2": {"kind": "table", "between": ["m", "y"], "table": {"points": steep}},
        "d": {"kind": "table", "between": ["y", "air"], "table": {"over": "difference", "points": swing}},
    }
    nodes = {"x": {"capacitance": "50 [J/K]"}, "m": {}, "y": {"capacitance": "30 [J/K]"}}
    model = box(nodes=nodes, conductors=chain, loads={"p": {"into": "x", "table": {"points": power}}})
    calm = bench(boundaries={"air": "11.4854 [degC]"}, start="44 [degC]", duration="3 [h]")
    rest, late = td.steady(model, calm), td.simulate(model, calm)
    for node in nodes:
        assert rest[node] - 273.15 == pytest.approx(late[node].final, abs=1e-5)


# outside its points ------------------------------------------------------------------------------------------------------------------


def short(outside: str | None = None, over: str = "temperature") -> td.Model:
    table = {"over": over, "points": [["0 [degC]", "1 [W/K]"], ["20 [degC]", "2 [W/K]"]]}
    return box(table | ({"outside": outside} if outside else {}), "150 [W]")


def test_a_table_is_held_outside_its_points_and_the_run_says_so() -> None:
    run = td.simulate(short(), bench())
    assert any("'link'" in w and "law, 273.15 to 293.15 K" in w for w in run.warnings)
    assert run["x"].final == pytest.approx(75.0, abs=1e-3)


def test_a_table_goes_on_as_a_straight_line_where_that_is_chosen() -> None:
    run = td.simulate(short("linear"), bench())
    final = run["x"].final
    assert (1.0 + 0.05 * 0.5 * final) * final == pytest.approx(150.0, abs=1e-3)
    (straight,), (held,) = ([w for w in r.warnings if "'link'" in w] for r in (run, td.simulate(short(), bench())))
    assert straight != held
    assert to_dict(short("linear"))["conductors"]["link"]["table"]["outside"] == "linear"
    falling = box({"outside": "linear", "points": [["0 [degC]", "2 [W/K]"], ["5 [degC]", "1 [W/K]"]]}, "30 [W]")
    with raises_code("run.did-not-finish", SolverError, match=r"'link'.*-inf to 283\.1 K"):
        td.simulate(falling, bench())


@pytest.mark.parametrize("options", [td.Options(), *(td.Options(method=m) for m in LARGE)])
def test_a_run_that_leaves_a_table_is_refused_where_that_is_chosen(options: td.Options) -> None:
    with raises_code("run.did-not-finish", SolverError, match=r"\d+\.\d+ s of 600 s 'link'.*273\.15 to 293\.15 K"):
        td.simulate(short("refuse"), bench(), options=options)
    within = td.simulate(short("refuse"), bench(duration="10 [s]"), options=options)
    assert within["x"].final == pytest.approx(td.simulate(short(), bench(duration="10 [s]"))["x"].final, abs=1e-3)


def test_steady_states_and_members_outside_a_table_are_refused() -> None:
    with raises_code("run.no-steady-state", SolverError, match=r"'link'.*273\.15.*293\.15"):
        td.steady(short("refuse"), bench())
    many = td.ensemble(short("refuse"), bench(), {"heat.power": [10.0, 150.0]})
    assert list(many.failed) == [1]
    assert all(part in many.failed[1] for part in ("s of 600 s 'link'", "273.15 to 293.15 K"))


def test_a_conductivity_and_a_specific_heat_are_refused_outside_their_tables() -> None:
    hot = {
        "mass": "0.1 [kg]",
        "specific_heat": {"outside": "refuse", "points": [["0 [degC]", "500 [J/(kg K)]"], ["20 [degC]", "600 [J/(kg K)]"]]},
    }
    with raises_code("run.did-not-finish", SolverError, match=r"'x'.*273\.15 to 293\.15 K"):
        td.simulate(box(power="150 [W]", nodes={"x": hot}), bench())
    k = {"outside": "refuse", "points": [["0 [degC]", "10 [W/(m K)]"], ["20 [degC]", "20 [W/(m K)]"]]}
    link = {"kind": "conduction", "between": ["x", "air"], "conductivity": k, "area": "1 [m^2]", "thickness": "1 [m]"}
    with raises_code("run.did-not-finish", SolverError, match=r"'link'.*273\.15 to 293\.15 K"):
        td.simulate(box(power="400 [W]", conductors={"link": link}), bench(duration="1 [h]"))


# stored heat -------------------------------------------------------------------------------------------------------------------------

C = [(0.0, 400.0), (100.0, 500.0), (300.0, 900.0)]
WALL = [(["wall", "a"], "3 [W/K]"), (["a", "b"], "1.5 [W/K]"), (["b", "air"], "0.4 [W/K]")]
WAX = [(0.0, 0.0), (27.0, 54e3), (29.0, 258e3), (80.0, 360e3)]


def lump(node: dict[str, Any], power: str = "50 [W]", conductance: str = "0 [W/K]") -> td.Model:
    link = {"kind": "conduction", "between": ["x", "air"], "conductance": conductance}
    return box(power=power, nodes={"x": {"mass": "0.5 [kg]"} | node}, conductors={"link": link})


def wax(table: list[tuple[float, float]]) -> dict[str, Any]:
    return {"enthalpy": {"points": points(table, "J/kg")}}


def test_a_specific_heat_by_lines_is_integrated_exactly() -> None:
    run = td.simulate(lump({"specific_heat": {"points": points(C, "J/(kg K)")}}), bench(duration="20 [min]"))
    fine = np.linspace(0.0, 300.0, 300_001)
    heat = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(fine) * (lines(C, fine[1:]) + lines(C, fine[:-1])))))
    assert np.abs(run["x"].celsius - np.interp(50.0 * run.times / 0.5, heat, fine)).max() < 2e-6
    assert run.heat_balance().stored == pytest.approx(0.5 * np.interp(run["x"].final, fine, heat), rel=1e-8)
    assert run.heat_balance().relative < 1e-9


def test_temperatures_over_enthalpy_are_inverted_to_1e_12() -> None:
    shape = store("specific_heat", curve("temperature", [(273.15 + t, c) for t, c in C]))
    at = np.linspace(273.15, 573.15, 20_011)
    assert np.abs(shape.curve.evaluate(shape.level(at)) - at).max() < 2e-12


@pytest.mark.parametrize("melt", [27.0, 29.0])
def test_enthalpy_is_straight_and_may_melt_at_one_temperature(melt: float) -> None:
    table = [WAX[0], WAX[1], (melt, 258e3), WAX[3]]
    run = td.simulate(lump(wax(table)), bench(duration="1 [h]"), every=10.0)
    heats, temperatures = [h for _, h in table], [t for t, _ in table]
    assert np.abs(run["x"].celsius - np.interp(50.0 * run.times / 0.5, heats, temperatures)).max() < 1e-6
    assert run.heat_balance().relative < 1e-9


def test_latent_heat_is_the_enthalpy_of_four_rows() -> None:
    fields = {"specific_heat": "2 [kJ/(kg K)]", "latent_heat": "200 [kJ/kg]", "melts_from": "27 [degC]", "melts_to": "29 [degC]"}
    runs = [
        td.simulate(lump(node, "0 [W]", "2 [W/K]"), bench(boundaries={"air": "60 [degC]"}, duration="5 [h]")) for node in (fields, wax(WAX))
    ]
    assert np.abs(runs[0]["x"].celsius - runs[1]["x"].celsius).max() < 1e-6
    pure = {k: v for k, v in fields.items() if k != "melts_to"}
    run = td.simulate(lump(pure), bench(duration="1 [h]"), every=10.0)
    expected = np.interp(100.0 * run.times, [0.0, 54e3, 254e3, 360e3], [0.0, 27.0, 27.0, 80.0])
    assert np.abs(run["x"].celsius - expected).max() < 1e-6
    assert not any(re.search(r"'x' .*\d to [\d.]+ K", w) for w in run.warnings)


@pytest.mark.parametrize("melt", [27.0, 29.0, 45.0])
def test_a_range_of_any_width_melts_as_a_fine_reference_of_the_same_table(melt: float) -> None:
    """Two lumps of wax between a warm wall and the air, melting at one temperature, over 2 K and over 18 K."""
    table = [WAX[0], WAX[1], (melt, 258e3), WAX[3]]
    heats, temperatures = [h for _, h in table], [t for t, _ in table]

    def rate(_: float, heat: Any) -> Any:
        a, b = np.interp(np.asarray(heat) / 0.5, heats, temperatures)
        return [3.0 * (60.0 - a) - 1.5 * (a - b), 1.5 * (a - b) - 0.4 * (b - 20.0)]

    links = {f"c{k}": {"kind": "conduction", "between": ends, "conductance": g} for k, (ends, g) in enumerate(WALL)}
    node = {"mass": "0.5 [kg]"} | wax(table)
    model = box(needs=["air", "wall"], nodes={"a": node, "b": node}, conductors=links, loads={})
    scenario = bench(boundaries={"wall": "60 [degC]", "air": "20 [degC]"}, start="20 [degC]", duration="2 [h]")
    fine = None
    for method, allowed in (("integrator", 1e-4), ("RKC2", 1e-3), ("TR-BDF2", 1e-3)):
        run = td.simulate(model, scenario, every=120.0, options=td.Options(method=method))
        if fine is None:
            begin = [0.5 * float(np.interp(20.0, temperatures[:2], heats[:2]))] * 2
            found = solve_ivp(rate, (0.0, 7200.0), begin, rtol=1e-10, atol=1e-6, max_step=10.0, t_eval=run.times)
            fine = np.interp(found.y / 0.5, heats, temperatures)
        assert max(np.abs(run[n].celsius - fine[k]).max() for k, n in enumerate("ab")) < allowed
        assert run.heat_balance().relative < 1e-9
    assert fine is not None
    assert (fine[:, -1] > melt).any()


@pytest.mark.parametrize("melt", [27.0, 29.0])
def test_steady_states_of_what_melts_need_no_slope_of_its_heat(melt: float) -> None:
    """Temperature does not move with heat at a melting point: 'the equations are singular' was the answer."""
    model = lump(wax([*WAX[:2], (melt, 258e3), WAX[3]]), "4 [W]", "2 [W/K]")
    for air in (10.0, 25.0, 26.0, 40.0):
        calm = bench(boundaries={"air": f"{air} [degC]"}, start="steady", duration="1 [h]")
        assert td.steady(model, calm)["x"] - 273.15 == pytest.approx(air + 2.0, abs=1e-9)
        for method in ("auto", "large"):
            assert td.simulate(model, calm, options=td.Options(method=method))["x"].final == pytest.approx(air + 2.0, abs=1e-6)


def test_a_state_of_what_melts_that_comes_back_comes_back() -> None:
    air = {"mean": "25 [degC]", "amplitude": "15 [K]", "period": "2 [h]"}
    for melt in (27.0, 29.0):
        model = lump(wax([*WAX[:2], (melt, 258e3), WAX[3]]), "0 [W]", "30 [W/K]")
        run = td.simulate(model, bench(boundaries={"air": air}, start="periodic", duration="2 [h]"))
        assert run["x"].final == pytest.approx(run["x"].celsius[0], abs=1e-5)


def test_freezing_and_melting_again_stores_nothing() -> None:
    air = {"mean": "28 [degC]", "amplitude": "15 [K]", "period": "2 [h]"}
    run = td.simulate(lump(wax([*WAX[:2], (27.0, 258e3), WAX[3]]), "0 [W]", "30 [W/K]"), bench(boundaries={"air": air}, duration="10 [h]"))
    balance = run.heat_balance()
    assert balance.relative < 1e-9
    assert float(np.sum(np.abs(run["x"].celsius - 27.0) < 1e-9)) > 50


@pytest.mark.parametrize(
    ("node", "code", "match"),
    [
        (wax([(0.0, 0.0), (0.0, 5.0), (9.0, 9.0)]), "model.law-refused", r"nodes\.x\.enthalpy"),
        (wax([(0.0, 0.0), (5.0, 5.0), (5.0, 4.0), (9.0, 9.0)]), "model.law-refused", r"nodes\.x\.enthalpy"),
        ({"specific_heat": {"points": points([(0.0, 4.0), (0.0, 5.0)], "J/(kg K)")}}, "model.law-refused", r"nodes\.x\.specific_heat"),
        ({"specific_heat": "2 [kJ/(kg K)]", "latent_heat": "200 [kJ/kg]"}, "value.incomplete", "specific_heat.*latent_heat"),
        (
            {"specific_heat": "2 [J/(kg K)]", "latent_heat": "9 [J/kg]", "melts_from": "27 [degC]", "melts_to": "20 [degC]"},
            "value.outside-range",
            "melts_to",
        ),
    ],
)
def test_stored_heat_that_cannot_be(node: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, DeckError, match=match):
        lump(node)


def test_decks_with_every_choice_are_written_back(tmp_path: Path) -> None:
    melts = {"specific_heat": "2 [kJ/(kg K)]", "latent_heat": "200 [kJ/kg]", "melts_from": "27 [degC]"}
    for model in (short("linear"), short("refuse"), lump(melts), lump(wax([*WAX[:2], (27.0, 258e3), WAX[3]]))):
        td.save_model(model, tmp_path / "deck.toml")
        assert td.load_model(tmp_path / "deck.toml").identity() == model.identity()


def test_a_steady_state_with_stored_heat_says_where_its_heat_goes() -> None:
    deck = {
        "title": "wax",
        "needs": ["room"],
        "nodes": {
            "wax": {"mass": "1 [kg]", "specific_heat": {"points": [["0 [degC]", "900 [J/(kg K)]"], ["80 [degC]", "1200 [J/(kg K)]"]]}}
        },
        "conductors": {"wall": {"kind": "conduction", "between": ["wax", "room"], "conductance": "0.5 [W/K]"}},
        "loads": {"heater": {"into": "wax", "power": "10 [W]"}},
    }
    settled = td.steady(td.model_from_dict(deck), td.Scenario("room", boundaries={"room": "20 [degC]"}))
    assert settled["wax"] == pytest.approx(313.15, abs=1e-9)
    assert settled.heat is not None
