"""B2: the electrical analogue of Fig. 4, v_inf = V + R I and tau = R C, as a netlist; ngspice solves it to the same numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from unit.interop.programs import ngspice

pytestmark = pytest.mark.document
DECKS = Path(__file__).parents[2] / "examples" / "sisnav"
BENCH = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
TIGHT = td.Options(error=4e-8)


def test_b2_the_circuit_of_fig_4() -> None:
    text = td.interop.to_spice(td.load_model(DECKS / "Acc.toml"), BENCH)
    number = {name: float(value) for name, value in re.findall(r"^([VCRI]_\w+) .*?([\d.e+-]+)(?: IC=24)?$", text, re.MULTILINE)}
    assert number["R_skin"] == pytest.approx(39.63196, abs=1e-5)
    assert number["V_cv"] + number["R_skin"] * number["I_1"] == pytest.approx(32.917191, abs=1e-6)
    assert number["R_skin"] * number["C_case"] == pytest.approx(1027.2604, abs=1e-4)


@pytest.mark.parametrize("deck", ["Acc", "m_PrE", "m_AccS", "m_IMU", "m_Sd"])
def test_b2_ngspice_gives_the_same_numbers(deck: str, tmp_path: Path) -> None:
    """Every node at every step of ngspice within 2e-5 K; its trapezoidal steps are 1/5000 of the run."""
    model = td.load_model(DECKS / f"{deck}.toml")
    td.interop.to_spice(model, BENCH, tmp_path / f"{deck}.cir")
    times, found = ngspice(tmp_path / f"{deck}.cir")
    ours = td.simulate(model, BENCH, times=np.minimum(times, BENCH.seconds), options=TIGHT)
    for node in set(ours.nodes) - {"cv"}:
        assert np.abs(found[node.lower().replace(".", "_")] - ours[node].celsius)[1:].max() < 2e-5, node


def test_b2_ngspice_gives_the_row_of_drift_and_step(tmp_path: Path) -> None:
    model = td.load_model(DECKS / "m_PrE.toml")
    step = BENCH.with_(
        boundaries={"cv": {"times": ["0 [s]", "5 [h]"], "values": ["24 [degC]", "24.7 [degC]"]}},
        loads={"ele.electronics": {"times": ["0 [s]", "3 [h]"], "values": ["2.168 [W]", "0 [W]"], "hold": True}},
    )
    td.interop.to_spice(model, step, tmp_path / "pair.cir")
    _, found = ngspice(tmp_path / "pair.cir")
    assert found["proc_case"][-1] == pytest.approx(34.268324, abs=1e-5)
    assert found["ele_case"][-1] == pytest.approx(30.946902, abs=1e-5)
