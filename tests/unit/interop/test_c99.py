"""C headers: the numbers of `simulate` to the stated error, compiled strictly and under sanitizers; values that change; refusals."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import SolverError
from thermid.interop import c99 as writing
from thermid.interop.c99 import COUPLED, DRIFT, GAMMA, STAGES, TIMES, _Stepper, nice_steps, step_grid, to_c
from unit.interop.networks import SIGNALS, hot_box
from unit.interop.programs import FAST, STRICT, c99

TIGHT = td.Options(error=4e-8)


def plate(**changed: Any) -> dict[str, Any]:
    return {
        "title": "plate",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": "200 [J/K]"}, "lid": {"capacitance": "60 [J/K]"}},
        "conductors": {
            "bolt": {"kind": "conduction", "between": ["plate", "lid"], "conductance": "0.5 [W/K]"},
            "skin": {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "0.05 [m^2]"},
        },
        "loads": {"heater": {"into": "lid", "power": "6 [W]"}},
        **changed,
    }


AIR = {"mean": "20 [degC]", "amplitude": "5 [K]", "period": "2 [h]"}
PULSE = {"times": ["0 [s]", "0.5 [h]", "1.5 [h]"], "values": ["1", "0.2", "0.7"], "hold": True}
LINEAR = td.Scenario("linear", boundaries={"air": AIR}, commands={"heater": PULSE}, start="25 [degC]", duration="2 [h]")
STILL = td.Scenario("still", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="2 [h]")
THERMOSTAT = {"on_below": "30 [degC]", "off_above": "33 [degC]", "sensor": "plate"}
GLOW = {"kind": "radiation", "between": ["lid", "air"], "emissivity": 0.8, "area": "0.1 [m^2]"}
STEPS = {"times": ["0 [s]", "1 [h]"], "values": ["8 [W/(m^2 K)]", "2 [W/(m^2 K)]"], "hold": True}
RAMP = {"times": ["0 [s]", "1 [h]", "2 [h]"], "values": ["8 [W/(m^2 K)]", "2 [W/(m^2 K)]", "9 [W/(m^2 K)]"]}
SMOOTH = {
    "over": "temperature",
    "interpolation": "smooth",
    "points": [["0 [degC]", "0.1 [W/K]"], ["30 [degC]", "0.4 [W/K]"], ["60 [degC]", "0.5 [W/K]"]],
}
K_OF_T = {"points": [["0 [degC]", "20 [W/(m K)]"], ["35 [degC]", "60 [W/(m K)]"], ["90 [degC]", "30 [W/(m K)]"]]}
TITANIUM = {"kind": "conduction", "between": ["plate", "lid"], "conductivity": K_OF_T, "area": "1 [cm^2]", "thickness": "5 [mm]"}


def chattering() -> tuple[td.Model, td.Scenario]:
    """Return a small mass that a thermostat switches some 50 times a second, and 30 s of it."""
    switch = {"on_below": "30 [degC]", "off_above": "30.2 [degC]", "sensor": "lid"}
    small = plate(
        nodes={"lid": {"capacitance": "1 [J/K]"}},
        conductors={"skin": {"kind": "convection", "between": ["lid", "air"], "htc": "20 [W/(m^2 K)]", "area": "0.05 [m^2]"}},
        loads={"heater": {"into": "lid", "power": "20 [W]", "thermostat": switch}},
    )
    return td.model_from_dict(small), td.Scenario("still", boundaries={"air": "20 [degC]"}, start="25 [degC]", duration="30 [s]")


def with_rows(**rows: dict[str, Any]) -> td.Model:
    base = plate()
    return td.model_from_dict({**base, "conductors": {**base["conductors"], **rows}})


def with_loads(**loads: dict[str, Any]) -> td.Model:
    return td.model_from_dict(plate(loads=loads))


BLOWN = {"kind": "duct", "width": "5 [mm]", "height": "40 [mm]", "length": "10 [cm]", "between": ["lid", "air"], "volume_flow": "1 [m^3/h]"}
"""Laminar from 1.9 m^3/h on down, turbulent from 3.3 m^3/h on up."""
SLOWS = {"times": ["0 [s]", "0.5 [h]", "1 [h]"], "values": ["6 [m^3/h]", "3 [m^3/h]", "1 [m^3/h]"], "hold": True}


MODELS: dict[str, tuple[Callable[[], td.Model], td.Scenario]] = {
    "linear": (lambda: td.model_from_dict(plate()), LINEAR),
    "radiation": (lambda: with_rows(glow=GLOW), LINEAR),
    "thermostat": (lambda: with_loads(heater={"into": "lid", "power": "25 [W]", "thermostat": THERMOSTAT}), STILL),
    "two thermostats": (
        lambda: with_loads(
            heater={"into": "lid", "power": "15 [W]", "thermostat": THERMOSTAT},
            other={"into": "plate", "power": "9 [W]", "thermostat": {"on_below": "31 [degC]", "off_above": "32 [degC]", "sensor": "lid"}},
        ),
        LINEAR.with_(commands={}),
    ),
    "schedule": (lambda: td.model_from_dict(plate()), STILL.with_(schedule={"skin.htc": STEPS})),
    "schedule of lines": (lambda: td.model_from_dict(plate()), STILL.with_(schedule={"skin.htc": RAMP})),
    "schedule through three flows": (lambda: with_rows(slot=BLOWN), STILL.with_(schedule={"slot.volume_flow": SLOWS})),
    "massless": (hot_box, SIGNALS),
    "massless and radiation": (
        lambda: hot_box(bent={"kind": "radiation", "between": ["glue", "wall"], "emissivity": 0.5, "area": "0.1 [m^2]"}),
        SIGNALS,
    ),
    "table of property": (lambda: with_rows(bolt=TITANIUM), LINEAR),
    "smooth table": (lambda: with_rows(strap={"kind": "table", "between": ["lid", "air"], "table": SMOOTH}), LINEAR),
    "gas gap": (lambda: with_rows(gap={"kind": "gas", "between": ["lid", "air"], "area": "0.04 [m^2]", "gap": "25 [mm]"}), LINEAR),
    "proportional": (
        lambda: with_loads(heater={"into": "lid", "power": "25 [W]", "proportional": {"setpoint": "40 [degC]", "band": "5 [K]"}}),
        STILL,
    ),
    "leakage": (
        lambda: with_loads(
            chip={"into": "lid", "power": "0.5 [W]", "exponential_coefficient": "0.02 [1/K]", "reference_temperature": "20 [degC]"},
            coil={"into": "plate", "power": "3 [W]", "temperature_coefficient": "0.004 [1/K]", "reference_temperature": "20 [degC]"},
        ),
        STILL,
    ),
}


def stated(text: str) -> tuple[float, float]:
    """Step [s] and error [K] that a header states."""
    step, error = (float(re.search(rf"#define \w+_{word} (\S+)", text).group(1)) for word in ("STEP", "ERROR"))  # type: ignore[union-attr]
    return step, error


def differences(
    model: td.Model, scenario: td.Scenario, header: Path, p: str = "", options: tuple[str, ...] = STRICT
) -> np.ndarray[Any, Any]:
    times = np.linspace(0.0, scenario.seconds, 38)[1:]
    found = c99(header, times, p, options)
    ours = td.simulate(model, scenario, times=times, options=TIGHT)
    nodes = re.findall(r"_NODE_\w+ \d+ /\* (\S+) \*/", header.read_text())
    return np.array(np.abs(found - np.column_stack([ours[n].kelvin for n in nodes])).max(axis=0))


@pytest.mark.parametrize("name", MODELS)
def test_a_compiled_header_agrees_to_its_stated_error(name: str, tmp_path: Path) -> None:
    make, scenario = MODELS[name]
    model = make()
    text = to_c(model, scenario, tmp_path / "unit_a.h")
    step, error = stated(text)
    assert error <= 1e-3
    assert step >= scenario.seconds / 20_000
    assert differences(model, scenario, tmp_path / "unit_a.h").max() <= error


@pytest.mark.parametrize("name", ["two thermostats", "massless and radiation", "gas gap"])
def test_an_optimised_header_agrees_as_well(name: str, tmp_path: Path) -> None:
    make, scenario = MODELS[name]
    model = make()
    error = stated(to_c(model, scenario, tmp_path / "unit_b.h"))[1]
    assert differences(model, scenario, tmp_path / "unit_b.h", options=FAST).max() <= error


@pytest.mark.parametrize(("step", "most"), [(200.0, 1.0), (5.0, 1e-5)])
def test_a_step_that_is_given_states_its_own_error(step: float, most: float, tmp_path: Path) -> None:
    model = with_rows(glow=GLOW)
    text = to_c(model, STILL, tmp_path / "own.h", step=step)
    assert stated(text)[0] == step
    error = stated(text)[1]
    assert 1e-6 <= error <= most
    assert differences(model, STILL, tmp_path / "own.h").max() <= error


def test_parameters_can_be_changed(tmp_path: Path) -> None:
    model = hot_box()
    text = to_c(model, SIGNALS, tmp_path / "hot.h")
    other = model.with_values({"share": "0.5", "leak.conductance": "0.2 [W/K]"})
    found = differences(other, SIGNALS, tmp_path / "hot.h", "p.share = 0.5; p.leak_conductance = 0.2;")
    assert found.max() <= 10 * stated(text)[1]
    assert "const double v_glow_area = p->share*p->area; /* [m^2] */" in text
    assert "c[4] = v_glow_emissivity*5.670374419e-08*v_glow_area; /* glow */" in text


def test_the_method_is_of_its_order() -> None:
    """Conditions of order, from the coefficients that the header has too."""
    a, c = np.zeros((6, 6)), np.zeros((6, 6))
    for s in range(6):
        a[s, :s], c[s, :s] = STAGES[s], COUPLED[s]
    gamma = np.linalg.inv(np.eye(6) / GAMMA - c)
    alpha = a @ gamma
    weights = np.append(np.array(STAGES[5]), 1.0) @ gamma
    at, beta = alpha.sum(axis=1), (alpha + gamma)
    slope = beta.sum(axis=1)
    conditions = {
        "1": (weights.sum(), 1.0),
        "2": (weights @ slope, 1 / 2),
        "3": (weights @ at**2, 1 / 3),
        "3 of the slope": (weights @ beta @ slope, 1 / 6),
        "4": (weights @ at**3, 1 / 4),
        "4 mixed": (weights @ (at * (alpha @ slope)), 1 / 8),
        "4 of the square": (weights @ beta @ at**2, 1 / 12),
        "4 of the slope": (weights @ beta @ beta @ slope, 1 / 24),
    }
    for name, (found, wanted) in conditions.items():
        assert found == pytest.approx(wanted, abs=1e-12), name
    np.testing.assert_allclose(at, TIMES, atol=1e-12)
    np.testing.assert_allclose(gamma.sum(axis=1), DRIFT, atol=1e-12)
    header = (Path(str(writing.__file__)).parent / "fixed_step.h").read_text()
    for number in {n for row in (*STAGES, *COUPLED, TIMES, DRIFT) for n in row}:
        assert re.search(rf"[{{ ]{re.escape(repr(number))}0*[,}}]", header), number


def test_steps_are_cut_where_an_input_jumps() -> None:
    grid = step_grid([25.0, 40.0], 60.0, 10.0)
    np.testing.assert_allclose(grid, [0, 10, 20, 25, 35, 40, 50, 60])
    assert list(nice_steps(7200.0))[:4] == [100.0, 50.0, 20.0, 10.0]


def test_one_step_at_a_time_with_inputs_of_the_caller(tmp_path: Path) -> None:
    """Model in the loop: the caller's own inputs, the scenario left out."""
    import shutil
    import subprocess

    model = td.model_from_dict(plate())
    to_c(model, STILL, tmp_path / "loop.h")
    (tmp_path / "main.c").write_text(
        """
#define loop_WITHOUT_SCENARIO
#include <stdio.h>
#include "loop.h"
int main(void) {
    static loop_model m;
    loop_parameters p;
    loop_inputs u;
    int k;
    loop_defaults(&p);
    u.T_air = 300.0;
    u.command_heater = 0.5;
    if (loop_start(&m, &p, &u)) return 1;
    for (k = 0; k < 40000; ++k) if (loop_step(&m, &p, &u, &u, 10.0)) return 2;
    printf("%.9f %.9f %g\\n", m.T[loop_NODE_plate], m.T[loop_NODE_lid], m.time);
    return 0;
}
""",
        encoding="ascii",
    )
    compiler = shutil.which("gcc") or pytest.skip("there is no C compiler")
    subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "main.c", "-o", "main", "-lm"], cwd=tmp_path, check=True)
    out = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True).stdout.split()
    assert [float(x) for x in out] == pytest.approx([307.5, 313.5, 400_000.0], abs=1e-6)


def test_words_of_an_author_stay_in_their_comments(tmp_path: Path) -> None:
    said = plate(title="plate */ int x; /* ??/", parameters={"int": {"value": "3", "note": "*/ system(1); /* a"}})
    said["loads"] = {"heater": {"into": "lid", "power": "int*2 [W]"}} | {"heater": {"into": "lid", "power": "6 [W]"}}
    said["conductors"]["bolt"]["conductance"] = "0.1 [W/K]*int"
    model = td.model_from_dict(said)
    to_c(model, STILL, tmp_path / "words.h")
    assert differences(model, STILL, tmp_path / "words.h").max() <= 1e-3


CONTROLLED = plate(
    controls={"fan": {"follows": "lid", "proportional": {"setpoint": "30 [degC]", "band": "5 [K]"}}},
    loads={"heater": {"into": "lid", "power": "6 [W]", "control": "fan"}},
)


@pytest.mark.parametrize(
    ("model", "scenario", "code", "match"),
    [
        (
            plate(
                nodes={
                    "plate": {
                        "mass": "1 [kg]",
                        "specific_heat": {
                            "points": [["0 [degC]", "900 [J/(kg K)]"], ["90 [degC]", "990 [J/(kg K)]"]],
                        },
                    },
                    "lid": {"capacitance": "60 [J/K]"},
                }
            ),
            {},
            "output.not-expressible",
            "'plate'",
        ),
        (CONTROLLED, {}, "model.element-not-supported", "'fan'"),
        (plate(), {"duration": 0.0}, "value.outside-range", r'"5 \[h\]".*"5 \[h\]"'),
        (
            plate(),
            {
                "schedule": {
                    "bolt.conductance": {**RAMP, "values": ["1 [W/K]", "2 [W/K]", "1 [W/K]"]},
                    "skin.area": {**RAMP, "values": ["1 [m^2]", "2 [m^2]", "1 [m^2]"]},
                    "skin.htc": RAMP,
                }
            },
            "output.not-expressible",
            "'skin'",
        ),
        (
            {**plate(), "conductors": {**plate()["conductors"], "slot": BLOWN}},
            {"schedule": {"slot.volume_flow": {**STEPS, "values": ["6 [m^3/h]", "0 [m^3/h]"]}}},
            "output.not-expressible",
            r"'slot'.*3600.*'slot\.volume_flow'",
        ),
    ],
)
def test_what_cannot_be_written_is_refused(model: dict[str, Any], scenario: dict[str, Any], code: str, match: str) -> None:
    with raises_code(code, match=match):
        to_c(td.model_from_dict(model), STILL.with_(**scenario))


@pytest.mark.parametrize("name", ["2boxes", "double", "hot-box", "x" * 42])
def test_a_name_that_is_none_for_c_is_refused(name: str, tmp_path: Path) -> None:
    with raises_code("name.not-valid"):
        to_c(td.model_from_dict(plate()), STILL, tmp_path / f"{name}.h")
    assert list(tmp_path.iterdir()) == []


def test_a_step_without_length_is_refused() -> None:
    with raises_code("value.outside-range"):
        to_c(td.model_from_dict(plate()), STILL, step=0.0)


def test_too_many_nodes_are_refused() -> None:
    nodes = {f"n{k}": {"capacitance": "10 [J/K]"} for k in range(201)}
    rows = {f"g{k}": {"kind": "conduction", "between": [f"n{k}", "air"], "conductance": "1 [W/K]"} for k in range(201)}
    model = td.model_from_dict({"title": "many", "needs": ["air"], "nodes": nodes, "conductors": rows})
    with raises_code("output.not-expressible", match="200.*201"):
        to_c(model, STILL)


def test_steps_within_which_a_thermostat_switches_too_often_have_no_stated_error(tmp_path: Path) -> None:
    """The header would return CHATTER for such a step: it is refused where it was asked for, and passed over where it is chosen."""
    model, scenario = chattering()
    with raises_code("run.did-not-finish", SolverError):
        to_c(model, scenario, tmp_path / "asked.h", step=10.0)
    w = writing.wired(model, scenario, writing.C)
    assert writing.stated_error(w, next(nice_steps(30.0))) == np.inf
    step, error = writing.chosen_step(w, 100.0)
    assert step < next(nice_steps(30.0))
    assert error <= 100.0


class _Curved(_Stepper):
    """A state that is the time, whose one thermostat switches where exp(5 t) has become 10; `steps` counts the steps that were tried."""

    def __init__(self) -> None:
        self.controls, self.grid, self.steps, self.switched_at = [0], np.array([0.0, 1.0]), 0, np.nan

    def _step(self, state: Any, begin: float, end: float, last: float) -> Any:
        self.steps += 1
        return np.array([end])

    def _due(self, state: Any, time: float) -> float:
        return -1.0 if self.switched_at <= state[0] else float(np.exp(5.0 * state[0])) - 10.0

    def _switched(self, state: Any, time: float, tolerance: float) -> Any:
        self.switched_at = state[0] if tolerance else np.nan
        return state


def test_the_time_of_a_switching_is_found_faster_than_by_regula_falsi() -> None:
    """In its Illinois form 12 tries are enough here; where the end that stays keeps its value, 200 do not come as near."""
    stepper = _Curved()
    stepper._advance(np.zeros(1), 0.0, 1.0)
    assert stepper.switched_at == pytest.approx(np.log(10.0) / 5.0, abs=1e-12)
    assert stepper.steps < 16
