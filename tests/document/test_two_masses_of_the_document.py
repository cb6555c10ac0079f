"""Section 2.2 of the acceptance sheet: m_PrE of Fig. 19, Eqs. 4 to 6. Rows B5, B6, B8, B9, A3, V1 and N2."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from oracles.two_nodes import TwoNodes
from strategies import TIGHTER
from thermid.base.errors import NameNotFoundError

pytestmark = pytest.mark.document
EXAMPLE = Path(__file__).parents[2] / "examples" / "02_stack" / "m_PrE.toml"
DATA = Path(__file__).parents[3] / "shared" / "seed" / "data"
BENCH = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
R1, R2, R3, RD = 3.593502946672416, 7.223653709599008, 9.328358208955224, 1.3904109589041098
CLOSED = TwoNodes.from_resistances((1468.8, 707.52), (4.11, 2.168), (R1, R2), (RD, RD), R3)


def _example() -> td.Model:
    return td.load_model(EXAMPLE)


def _resistances(third: str = f"{R3} [K/W]", **more: Any) -> td.Model:
    """Return Fig. 19 written in resistances, as Fig. 20 has it."""
    links = {"rcn1": ("proc", "cv", R1), "rcn2": ("ele", "cv", R2), "rcd1": ("proc", "cd", RD), "rcd2": ("ele", "cd", RD)}
    conductors: dict[str, Any] = {
        n: {"kind": "conduction", "between": [a, b], "resistance": f"{r} [K/W]"} for n, (a, b, r) in links.items()
    }
    if third:
        conductors["rcn3"] = {"kind": "conduction", "between": ["cd", "cv"], "resistance": third}
    return td.model_from_dict(
        {
            "title": "Fig. 19",
            "needs": ["cv"],
            "nodes": {"proc": {"capacitance": "1468.8 [J/K]"}, "ele": {"capacitance": "707.52 [J/K]"}, "cd": {}},
            "conductors": conductors,
            "loads": {"q1": {"into": "proc", "power": "4.11 [W]"}, "q2": {"into": "ele", "power": "2.168 [W]"}, **more},
        }
    )


TABLE = [(0.5, 28.183726, 28.308554), (1, 30.971352, 30.999444), (2, 33.998710, 33.863691), (5, 36.077771, 35.821535)]


@pytest.mark.parametrize("written", ["areas", "resistances"])
def test_table_of_section_2_2(written: str) -> None:
    """The deck with its area ledger and the network in resistances give the printed temperatures."""
    model = _example() if written == "areas" else _resistances()
    proc, ele = ("proc.case", "ele.case") if written == "areas" else ("proc", "ele")
    solution = td.simulate(model, BENCH, times=[3600.0 * h for h, *_ in TABLE], options=TIGHTER)
    assert solution[proc].celsius == pytest.approx([row[1] for row in TABLE], abs=1e-6)
    assert solution[ele].celsius == pytest.approx([row[2] for row in TABLE], abs=1e-6)
    steady = td.steady(model, BENCH)
    assert [steady[n] - 273.15 for n in (proc, ele, "cd")] == pytest.approx((36.252540, 35.986075, 35.278747), abs=1e-6)
    assert solution.time_constants == pytest.approx((4223.721, 1048.561), abs=1e-3)


def test_whole_curve() -> None:
    """Row 2.2: every minute of five hours, against Eq. 6 and, where the sheet's table is at hand, against it."""
    solution = td.simulate(_example(), BENCH, every="60 [s]", options=TIGHTER)
    found = np.column_stack((solution["proc.case"].celsius, solution["ele.case"].celsius))
    assert found.shape == (301, 2)
    assert np.abs(found - CLOSED.temperatures(solution.times, 24.0)).max() < 1e-6
    if (DATA / "pre_reference.csv").is_file():
        table = np.loadtxt(DATA / "pre_reference.csv", delimiter=",", skiprows=1)
        assert np.array_equal(table[:, 0], solution.times)
        for columns in ((1, 2), (3, 4), (5, 6)):  # Eq. 6, scipy, Octave with tight tolerances
            assert np.abs(found - table[:, columns]).max() < 1e-6


def test_default_tolerances_are_good_to_a_tenth_of_a_millikelvin() -> None:
    solution = td.simulate(_example(), BENCH)
    found = np.column_stack((solution["proc.case"].celsius, solution["ele.case"].celsius))
    assert np.abs(found - CLOSED.temperatures(solution.times, 24.0)).max() < 1e-4


def test_elegfo_is_the_warmer_one_until_an_hour() -> None:
    solution = td.simulate(_example(), BENCH, every="36 [s]", options=TIGHTER)
    lead = solution["proc.case"].kelvin - solution["ele.case"].kelvin
    (k,) = np.flatnonzero(np.diff(np.sign(lead[1:]))) + 1
    change = solution.times[k] - lead[k] * (solution.times[k + 1] - solution.times[k]) / (lead[k + 1] - lead[k])
    assert change / 3600 == pytest.approx(1.1348, abs=1e-4)  # the sheet says 1.14 h


def test_A3_submodel_equals_eq_6() -> None:  # noqa: N802
    """To 1e-9 K, by the modes of the network rather than by steps."""
    space = td.simulation.state_space(td.simulation.compile_network(_example()))
    power = space.B_load @ [{"proc.electronics": 4.11, "ele.electronics": 2.168}[n] for n in space.loads]
    steady = np.linalg.solve(space.A, -(space.B_boundary[:, 0] * 24.0 + power))
    modes = td.simulation.modes(space)
    weights = np.linalg.solve(modes.shapes, 24.0 - steady)
    t = np.linspace(0, 18000, 61)
    found = steady + (np.exp(-t[:, None] / modes.time_constants) * weights) @ modes.shapes.T
    order = [space.nodes.index(n) for n in ("proc.case", "ele.case")]
    assert np.abs(found[:, order] - CLOSED.temperatures(t, 24.0)).max() < 1e-9


@pytest.mark.parametrize("source", ["table", "schedule"])
def test_B6_drift_and_step(source: str) -> None:  # noqa: N802
    """T_amb + 0.7 K over five hours, Q2 off at three: 34.268324 and 30.946902 degC at the end, to 1e-6 K."""
    off = {"times": ["0 [s]", "3 [h]"], "values": ["2.168 [W]", "0 [W]"], "hold": True}
    scenario = BENCH.with_(boundaries={"cv": {"times": ["0 [s]", "5 [h]"], "values": ["24 [degC]", "24.7 [degC]"]}})
    scenario = scenario.with_(loads={"ele.electronics": off}) if source == "table" else scenario.with_(schedule={"ele.power": off})
    solution = td.simulate(_example(), scenario, every="60 [s]", options=TIGHTER)
    assert solution["proc.case"].final == pytest.approx(34.268324, abs=1e-6)
    assert solution["ele.case"].final == pytest.approx(30.946902, abs=1e-6)
    assert solution.heat_balance().relative < 1e-9
    if (DATA / "pre_reference_extra.csv").is_file():
        table = np.loadtxt(DATA / "pre_reference_extra.csv", delimiter=",", skiprows=1)
        found = np.column_stack((solution["proc.case"].celsius, solution["ele.case"].celsius))
        assert np.abs(found - table[:, 1:3]).max() < 1e-6


def test_V1_vacuum_as_printed() -> None:  # noqa: N802
    """The mean ramp, the constant difference late, its time constant, and the curve."""
    solution = td.simulate(_example(), BENCH.vacuum(as_printed=True).with_(duration="12 [h]"), every="60 [s]", options=TIGHTER)
    proc, ele = solution["proc.case"], solution["ele.case"]
    assert (float(proc.at(18000.0)), float(ele.at(18000.0))) == pytest.approx((75.809512, 76.162750), abs=1e-6)
    assert (proc.kelvin[-1] - proc.kelvin[-61], ele.kelvin[-1] - ele.kelvin[-61]) == pytest.approx((10.384870, 10.384870), abs=1e-6)
    assert proc.kelvin[-1] - ele.kelvin[-1] == pytest.approx(-0.353239, abs=1e-6)
    assert solution.time_constants[0] == np.inf
    assert solution.time_constants[1] == pytest.approx(1327.859, abs=1e-3)
    closed = CLOSED.vacuum().temperatures(solution.times[:301], 24.0)
    assert np.abs(np.column_stack((proc.celsius, ele.celsius))[:301] - closed).max() < 1e-6
    if (DATA / "pre_reference_extra.csv").is_file():
        table = np.loadtxt(DATA / "pre_reference_extra.csv", delimiter=",", skiprows=1)
        assert np.abs(np.column_stack((proc.celsius, ele.celsius))[:301] - table[:, 5:7]).max() < 1e-6
    with raises_code("model.no-path-to-boundary", match="'proc.case'.*'ele.case'.*10.3849"):
        td.steady(_example(), BENCH.vacuum(as_printed=True))


def test_B5_massless_node_eliminated_or_solved() -> None:  # noqa: N802
    """T_cd by star to mesh, and as an equation of its own beside the states: a load of no watts keeps it there."""
    out = td.simulate(_resistances(), BENCH, options=TIGHTER)
    solved = td.simulate(_resistances(keep={"into": "cd", "power": "0 [W]"}), BENCH, options=TIGHTER)
    assert "cd" not in out._run.assembled.reduced.nodes
    assert "cd" in solved._run.assembled.reduced.nodes
    for node in ("proc", "ele", "cd"):
        assert np.abs(out[node].kelvin - solved[node].kelvin).max() < 1e-8
    assert td.steady(_resistances(keep={"into": "cd", "power": "0 [W]"}), BENCH) == pytest.approx(
        td.steady(_resistances(), BENCH), abs=1e-9
    )


def test_B8_matrix_closed_form_and_eigenvalues() -> None:  # noqa: N802
    space = td.simulation.state_space(td.simulation.compile_network(_example()))
    assert space.nodes == ("proc.case", "ele.case")
    assert space.A == pytest.approx(CLOSED.matrix(), rel=1e-12)
    rates = -1 / td.simulation.modes(space).time_constants
    assert rates == pytest.approx((-2.3675805e-4, -9.5368836e-4), rel=5e-8)
    delta = RD * RD + 2 * RD * R3
    assert delta == pytest.approx(27.873746, abs=1e-6)
    assert np.linalg.det(space.A) == pytest.approx(169.778572 / (1468.8 * 707.52 * R1 * R2 * delta), rel=1e-8)
    recovered = dict(space.recover)["cd"]
    weights = {"proc.case": RD * R3 / delta, "ele.case": RD * R3 / delta, "cv": RD * RD / delta}
    assert recovered == pytest.approx(weights, rel=1e-12)


def test_B8_eigenvalues_are_real_and_negative_for_a_thousand_sets() -> None:  # noqa: N802
    network = td.simulation.compile_network(_resistances())
    generator = np.random.default_rng(8)
    names = (
        "proc.capacitance",
        "ele.capacitance",
        "rcn1.resistance",
        "rcn2.resistance",
        "rcn3.resistance",
        "rcd1.resistance",
        "rcd2.resistance",
    )
    for _ in range(1000):
        values = 10 ** generator.uniform((1, 1, -2, -2, -2, -2, -2), (5, 5, 3, 3, 3, 3, 3))
        space = td.simulation.state_space(network, network.numbers(dict(zip(names, values.tolist(), strict=True))))
        rates = np.linalg.eigvals(space.A)
        assert np.all(np.isreal(rates))
        assert np.all(rates.real < 0)
        assert rates[0] != rates[1]
        assert sorted(rates.real) == pytest.approx(sorted(-1 / td.simulation.modes(space).time_constants), rel=1e-6)


def test_B9_gap_omitted() -> None:  # noqa: N802
    """R_cn3 infinite, absent, and very large are one thing: the two joints in series; all numbers are finite."""
    models = {"infinite": _resistances("inf [K/W]"), "absent": _resistances(""), "large": _resistances("1e13 [K/W]")}
    runs = {name: td.simulate(m, BENCH, options=TIGHTER) for name, m in models.items()}
    for run in runs.values():
        assert np.isfinite(run.temperatures).all()
        assert all(np.isfinite(q).all() for q in run.heat_flows.values())
        assert np.abs(run.temperatures - runs["absent"].temperatures).max() < 1e-8
        through = (run["proc"].kelvin - run["ele"].kelvin) / (2 * RD)
        assert run.heat_flow("rcd1") == pytest.approx(through, abs=1e-9)
        assert run.heat_flow("rcd2") == pytest.approx(-through, abs=1e-9)
    assert np.all(runs["infinite"].heat_flow("rcn3") == 0.0)
    steady = td.steady(models["infinite"], BENCH)
    assert steady["proc"] - steady["ele"] == pytest.approx(2 * RD * (4.11 * R1 - 2.168 * R2) / (2 * RD + R1 + R2), abs=1e-9)


def test_B9_gap_of_a_joint_without_its_loss() -> None:  # noqa: N802
    """The same by the deck: the gap's coefficient at exactly zero; its area no longer convects, as before."""
    gone = _example().with_values({"stack.gap.htc": {"value": "0 [W/(m^2 K)]", "min": 0}})
    nearly = _example().with_values({"stack.gap.htc": {"value": "1e-12 [W/(m^2 K)]", "min": 0}})
    a, b = (td.simulate(m, BENCH, options=TIGHTER) for m in (gone, nearly))
    assert np.isfinite(a.temperatures).all()
    assert np.abs(a.temperatures - b.temperatures).max() < 1e-8
    closed = TwoNodes.from_resistances((1468.8, 707.52), (4.11, 2.168), (R1, R2), (RD, RD))
    assert np.abs(a["proc.case"].celsius - closed.temperatures(a.times, 24.0)[:, 0]).max() < 1e-6


def test_B9_both_convections_omitted_too() -> None:  # noqa: N802
    """Fig. 20's formula gives NaN in the two cases the text discusses; conductances do not."""
    model = td.model_from_dict(
        {
            "title": "Fig. 19 the resistance in vacuum is",
            "needs": ["cv"],
            "nodes": {"proc": {"capacitance": "1468.8 [J/K]"}, "ele": {"capacitance": "707.52 [J/K]"}, "cd": {}},
            "conductors": {
                n: {"kind": "conduction", "between": list(ends), "resistance": r}
                for n, (*ends, r) in {
                    "rcn1": ("proc", "cv", "inf [K/W]"),
                    "rcn2": ("ele", "cv", "inf [K/W]"),
                    "rcn3": ("cd", "cv", "inf [K/W]"),
                    "rcd1": ("proc", "cd", f"{RD} [K/W]"),
                    "rcd2": ("ele", "cd", f"{RD} [K/W]"),
                }.items()
            },
            "loads": {"q1": {"into": "proc", "power": "4.11 [W]"}, "q2": {"into": "ele", "power": "2.168 [W]"}},
        }
    )
    solution = td.simulate(model, BENCH, options=TIGHTER)
    assert (solution["proc"].final, solution["ele"].final) == pytest.approx((75.809512, 76.162750), abs=1e-6)


def test_N2_aliases() -> None:  # noqa: N802
    """PrS is the processor, EleG the gyros' supply; a name that stands for nothing is an error."""
    solution = td.simulate(_example(), BENCH)
    for alias, path in (("m_PrE_PrS", "proc.case"), ("PrS.case", "proc.case"), ("m_PrE_EleG", "ele.case"), ("EleG.case", "ele.case")):
        assert solution[alias].path == path
    assert _example().at("EleG") is _example().at("ele") or _example().at("EleG") == _example().at("ele")
    warm = _example().with_values({"PrS.power": "5 [W]"})
    assert td.simulation.compile_network(warm).numbers().values["proc.power"] == 5.0
    with raises_code("name.unknown", NameNotFoundError, match="'m_PrE_Pr'"):
        solution["m_PrE_Pr"]
