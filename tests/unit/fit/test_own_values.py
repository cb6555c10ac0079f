"""What runs of a fit say of the room and start of a further one. Synthetic records."""

from __future__ import annotations

import numpy as np
import pytest

import thermid as td
from thermid.fit._error_model.own_values import BALANCE, Beside, OwnValue, own_value, own_values_kept
from thermid.fit.calibration import Calibration
from thermid.fit.error_model import BandCause
from thermid.measure.records import Channel, Record
from thermid.prediction.bands import predict_record

FREE = ("plate.capacitance", "skin.conductance", "joint.conductance")


def plate(skin: float = 0.30, joint: float = 0.50, mass: float = 900.0) -> td.Model:
    return td.model_from_dict(
        {
            "title": "Plate",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": f"{mass} [J/K]"}, "box": {"capacitance": "400 [J/K]"}},
            "conductors": {
                "skin": {
                    "kind": "conduction",
                    "between": ["plate", "air"],
                    "conductance": {"value": f"{skin} [W/K]", "min": 0.01, "max": 5},
                },
                "joint": {
                    "kind": "conduction",
                    "between": ["plate", "box"],
                    "conductance": {"value": f"{joint} [W/K]", "min": 0.01, "max": 5},
                },
            },
            "loads": {"heat": {"into": "plate", "power": "4 [W]"}, "other": {"into": "box", "power": "2 [W]"}},
        }
    )


def own(fit: Calibration, name: str, start: str) -> OwnValue | None:
    return own_value(own_values_kept([fit.values.provenance]), name, start)


def test_rooms_differ_from_run_to_run_by_what_was_planted() -> None:
    rng = np.random.default_rng(5)
    records, times = [], np.linspace(0.0, 10800.0, 181)
    for k in range(10):
        off = 0.8 * rng.standard_normal()
        given = td.Scenario(
            "r", boundaries={"air": f"{20.0 + off} [degC]"}, start="20 [degC]", duration="3 [h]", loads={"heat": "4 [W]", "other": "0 [W]"}
        )
        run = td.simulate(plate(), given, times=times)
        channels = {
            s: Channel.from_array(s, run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05)
            for s, n in (("T1", "plate"), ("T2", "box"))
        }
        records.append(Record.from_arrays(f"run {k}", times, channels, synthetic=False))
    given = td.Scenario("r", loads={"heat": "4 [W]", "other": "0 [W]"}, start="20 [degC]")
    fit = td.calibrate(plate(), records, FREE, scenario=given, local={"air": {"start": "20 [degC]", "sd": "2 [K]"}})
    found = own(fit, "air", "20 [degC]")
    assert found is not None
    assert found.runs == 10
    assert 0.4 < found.sd < 1.6
    assert abs(found.mean) < 0.8
    other = own(fit, "air", "T1")
    assert other is not None
    assert other.mean == 0.0
    assert other.sd >= found.sd


def warm_runs(count: int, step: float, past: float = 0.0, seed: int = 7) -> list[Record]:
    """Return runs of a plate that begins warm by what is left of the run before, in a box that has cooled down."""
    rng, times, records = np.random.default_rng(seed), np.linspace(0.0, 10800.0, 181), []
    for k in range(count):
        room, left = 20.0 + rng.standard_normal(), past * rng.uniform()
        given = td.Scenario(
            "r",
            boundaries={"air": f"{room} [degC]"},
            initial={"plate": f"{room + left} [degC]", "box": f"{room} [degC]"},
            duration="3 [h]",
            loads={"heat": f"{1.0 + step * k} [W]", "other": "0 [W]"},
        )
        run = td.simulate(plate(), given, times=times)
        channels = {
            s: Channel.from_array(s, run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05)
            for s, n in (("T1", "plate"), ("T2", "box"))
        }
        channels["P"] = Channel.from_array("P", np.full(times.size, 1.0 + step * k), quantity="power", role="load", target="heat")
        records.append(Record.from_arrays(f"run {k}", times, channels, synthetic=False))
    return records


def test_first_readings_of_two_sensors_say_more_of_a_room_than_one() -> None:
    # the room is T2 = T1 + 1 (T2 - T1); before any run the slope is 0 +- 0.5
    records = warm_runs(14, 0.3, past=3.0)
    given = td.Scenario("r", loads={"other": "0 [W]"})
    fit = td.calibrate(plate(), records[:12], FREE, scenario=given, local={"air": {"start": "T1", "sd": "5 [K]"}})
    found = own(fit, "air", "T1")
    assert found is not None
    assert [b.channel for b in found.beside] == ["T2"]
    assert found.beside[0].slope > 0.5
    assert abs(found.beside[0].slope - 1.0) < 2.0 * found.beside[0].error
    assert found.sd < 0.5
    for record in records[12:]:
        first = {s: float(record.channels[s].values[0]) for s in ("T1", "T2")}
        mean, error = found.expected_from(first)
        alone, _ = found.expected_from({"T1": first["T1"]})
        room = first["T2"]
        assert abs(first["T1"] + mean - room) < 3.0 * error
        assert abs(first["T1"] + mean - room) <= abs(first["T1"] + alone - room) + 0.2
        told = predict_record(fit, record, scenario=given, readings={"air": "T1"})
        assert told.inside() > 0.8
        assert BandCause.ROOM in told.bands["T1"].parts


def test_what_is_known_of_rooms_reads_back_with_the_other_sensors() -> None:
    one = OwnValue("air", "T1", 0.3, 0.5, 9, (Beside("T2", -1.0, 0.4, 0.2),))
    assert OwnValue.from_dict(one.to_dict()) == one
    old = {"name": "air", "start": "T1", "mean": 0.3, "sd": 0.5, "runs": 9}
    assert OwnValue.from_dict(old).to_dict() == old
    mean, error = one.expected_from({"T1": 20.0, "T2": 20.0})
    assert mean == pytest.approx(0.3 + 0.4)
    assert error == pytest.approx(np.hypot(0.5 * np.sqrt(1 + 1 / 9), 0.2))
    assert one.expected_from({"T1": 20.0})[0] == pytest.approx(0.3)


def hot_runs(count: int) -> list[Record]:
    """Return runs that cool down after an hour of heating; no sensor on the box."""
    rng, times, records = np.random.default_rng(3), np.linspace(0.0, 10800.0, 181), []
    for k in range(count):
        watts = 6.0 + k
        heated = td.simulate(
            plate(),
            td.Scenario("up", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]", loads={"heat": f"{watts} [W]"}),
            times=np.array([0.0, 3600.0]),
        )
        given = td.Scenario(
            "down",
            boundaries={"air": "20 [degC]"},
            initial={n: f"{float(heated[n].kelvin[-1])} [K]" for n in ("plate", "box")},
            duration="3 [h]",
            loads={"heat": "0 [W]", "other": "0 [W]"},
        )
        run = td.simulate(plate(), given, times=times)
        noisy = run["plate"].kelvin + 0.05 * rng.standard_normal(times.size)
        channels = {"T1": Channel.from_array("T1", noisy, unit="K", role="node", target="plate", noise=0.05)}
        channels["ROOM"] = Channel.from_array("ROOM", np.full(times.size, 293.15), unit="K", role="boundary", target="air")
        records.append(Record.from_arrays(f"down {k}", times, channels, synthetic=False))
    return records


def test_a_hidden_node_starts_off_its_balance_as_on_the_fitted_runs() -> None:
    records = hot_runs(6)
    given = td.Scenario("down", loads={"heat": "0 [W]", "other": "0 [W]"})
    fit = td.calibrate(plate(), records[:5], ["skin.conductance", "joint.conductance"], scenario=given)
    found = own(fit, "initial.box", BALANCE)
    assert found is not None
    assert found.runs == 5
    told = predict_record(fit, records[5], scenario=given)
    assert BandCause.START in told.bands["T1"].parts
    assert told.inside() > 0.9
    assert own(fit, "initial.box", "T1") is not None
    assert own_value((), "initial.box", BALANCE) is None
