"""The decks of examples/sisnav, level by level: A1, A3, A5, B10, N1 to N4, V1 and section 2.5 of the acceptance sheet.

Steady temperatures, times to 99 % and vacuum as printed are those of the sheet's table; the ambient is 24 degC.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code

pytestmark = pytest.mark.document
DECKS = Path(__file__).parents[2] / "examples" / "sisnav"
HOURS = 3600.0

# deck, node, steady [degC], 99 % of the rise [h], vacuum as printed: after 5 h [degC], late slope [K/h]
TABLE = [
    ("Acc", "case", 32.9172, 1.3141, 180.2500, 31.25),
    ("FOG_h", "case", 39.0000, 5.4942, 86.8638, 12.573),
    ("FOG_l", "case", 39.0137, 4.9997, 93.1454, 13.829),
    ("EleGFO", "case", 35.9825, 5.0023, 79.1560, 11.031),
    ("ProcSISNAV", "case", 34.9250, 4.9944, 74.3676, 10.074),
    ("m_PrE", "m_PrE_PrS", 36.2525, 5.4167, 75.8095, 10.385),
    ("m_PrE", "m_PrE_EleG", 35.9861, 5.3717, 76.1628, 10.385),
    ("m_PrE", "cd", 35.2787, 5.3947, 75.9861, 10.385),
    ("m_AccS", "AccS", 29.2008, 3.0933, 68.5385, 9.008),
    ("m_AccS", "Acc_x", 30.1162, 2.9045, 70.2784, 9.008),
    ("m_IMU", "IMUS", 30.7898, 5.6373, 54.0878, 6.0223),
    ("m_IMU", "m_IMU_FOG1", 31.3177, 5.6422, 54.0539, 6.0223),
    ("m_IMU", "m_IMU_FOG2", 31.2982, 5.6392, 54.0688, 6.0223),
    ("m_IMU", "m_IMU_FOG3", 31.2982, 5.6392, 54.0688, 6.0223),
    ("m_IMU", "acc.AccS", 30.6647, 5.5886, 54.4503, 6.0223),
    ("m_IMU", "acc.Acc_z", 31.2873, 5.2705, 56.4238, 6.0223),
    ("m_Sd", "m_Sd_PrS", 33.9771, 6.6093, 50.6186, 4.8284),
    ("m_Sd", "m_Sd_EleG", 32.1236, 6.6869, 49.3395, 4.8284),
    ("m_Sd", "PrE.cd", 30.5143, 7.0091, 47.6450, 4.8284),
    ("m_Sd", "m_IMU.AccS", 31.2612, 6.9366, 48.7023, 4.8284),
    ("m_Sd", "m_Sd_Acc", 31.7645, 6.5614, 50.7694, 4.8284),
    ("m_Sd", "m_IMU.IMUS", 31.4759, 7.0055, 48.1946, 4.8284),
    ("m_Sd", "m_Sd_FOG1", 32.0551, 6.9898, 48.3515, 4.8284),
    ("m_Sd", "m_Sd_FOG2", 32.1089, 6.9893, 48.3545, 4.8284),
    ("m_Sd", "disk", 29.6048, 7.2249, 46.6097, 4.8284),
]
BENCH = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="100 [h]")


@lru_cache
def model(deck: str) -> td.Model:
    return td.load_model(DECKS / f"{deck}.toml")


@lru_cache
def runs(deck: str) -> tuple[td.Solution, td.Solution]:
    """Return the run in the room, and the one with every coefficient zero."""
    times = np.unique(np.concatenate([np.arange(0.0, 15.0, 0.01), np.arange(15.0, 100.01, 1.0)])) * HOURS
    return td.simulate(model(deck), BENCH, times=times), td.simulate(model(deck), BENCH.vacuum(as_printed=True), times=times)


@pytest.mark.parametrize(("deck", "node", "steady", "t99", "ramp", "slope"), TABLE, ids=[f"{d}:{n}" for d, n, *_ in TABLE])
def test_2_5_every_node_of_every_level(deck: str, node: str, steady: float, t99: float, ramp: float, slope: float) -> None:
    room, vacuum = (run[node] for run in runs(deck))
    assert room.final == pytest.approx(steady, abs=1e-3)
    reached = 24.0 + 0.99 * (room.final - 24.0)
    assert room.crossing(td.celsius(reached)) / HOURS == pytest.approx(t99, abs=2e-3)  # type: ignore[operator]
    assert float(vacuum.at(5 * HOURS)) == pytest.approx(ramp, abs=1e-3)
    late = (float(vacuum.at(100 * HOURS)) - float(vacuum.at(99 * HOURS))) / 1.0
    assert late == pytest.approx(slope, abs=1e-3)


@pytest.mark.parametrize("deck", ["m_PrE", "m_AccS", "m_IMU", "m_Sd"])
def test_b10_areas_add_up_in_the_decks(deck: str) -> None:
    for line in td.model.ledger(model(deck)):
        assert line.exposed + line.contact + line.gap == pytest.approx(line.total, abs=1e-12)


def test_b10_the_printed_example_of_the_ledger() -> None:
    exposed = {line.surface: line.exposed for line in td.model.ledger(model("m_Sd"))}
    assert exposed["pre.ele.skin"] == pytest.approx(0.059241, abs=1e-12)
    assert exposed["imu.support_skin"] == pytest.approx(0.13305, abs=1e-12)
    assert exposed["disk_skin"] == pytest.approx(0.25831, abs=1e-12)


def test_a3_components_are_unchanged_in_a_submodel() -> None:
    """Only convective areas change, and they through the ledger; Table 2 changes EleGFO's coefficient."""
    alone = {"proc": model("ProcSISNAV"), "ele": model("EleGFO")}
    for name, part in alone.items():
        inside = model("m_PrE").submodels[name].model
        assert inside.identity() == part.identity()


@pytest.mark.parametrize(
    ("deck", "names"),
    [
        ("m_IMU", ("m_IMU_FOG1", "FOG_x", "fog_x.case")),
        ("m_PrE", ("m_PrE_EleG", "EleG.case", "ele.case")),
        ("m_PrE", ("m_PrE_PrS", "PrS.case", "proc.case")),
        ("m_Sd", ("m_Sd_PrS", "PrE.PrS.case", "m_PrE.m_PrE_PrS", "pre.proc.case")),
        ("m_Sd", ("m_Sd_FOG1", "FOG_x", "m_IMU.m_IMU_FOG1", "imu.fog_x.case")),
    ],
)
def test_n1_n2_n3_names_of_the_document_mean_one_node(deck: str, names: tuple[str, ...]) -> None:
    network = td.simulation.compile_network(model(deck))
    assert {network.find(name) for name in names} == {names[-1]}


def test_n2_an_alias_depends_on_where_it_is_used() -> None:
    """AccS alone is the support; m_AccS is the submodel; PrE is the pair and PrS the processor in it."""
    unit = model("m_Sd")
    assert unit.canonical("m_IMU.AccS") == "imu.acc.support"
    assert unit.canonical("m_IMU.m_AccS") == "imu.acc"
    assert unit.canonical("PrE") == "pre"
    with raises_code("name.unknown", match=r"'m_IMU\.AccZ'"):
        td.simulation.compile_network(unit).find("m_IMU.AccZ")
