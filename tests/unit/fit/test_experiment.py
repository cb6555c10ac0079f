"""A record meets a model: what each channel becomes, where the run starts, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, NameNotFoundError, RecordError, ScenarioError
from thermid.fit._calibrate import calibrate
from thermid.fit._inputs import InputTable
from thermid.fit._problem.experiment import Experiment, Inputs, first_reading
from thermid.fit._problem.gather import build_problem
from thermid.fit._problem.request import Request
from thermid.measure.readers import read_record
from thermid.measure.records import Channel, Record
from thermid.model.tree import Constant, Model, TableSignal, model_from_dict
from thermid.simulation.runs import Scenario, simulate
from unit.fit.bench import HTC, ICE, MASS, box, log, metered, pair, room

pytestmark = pytest.mark.usefixtures("errors_in_turn")


@pytest.fixture(scope="module")
def model() -> Model:
    return box()


@pytest.fixture(scope="module")
def record(model: Model) -> Record:
    return log(model, {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, samples=31)


def bound(record: Record, **changes: str | None) -> Record:
    """Return the record with one channel bound otherwise; ``bound(record, T="air")`` or with a role, ``T="load:heat"``."""
    out = record
    for name, text in changes.items():
        role, _, target = (text or "").rpartition(":")
        out = out.with_channels(replace(out[name], role=role or "auto", target=target or None))
    return out


def test_automatic_roles_follow_what_the_target_is(model: Model, record: Record) -> None:
    watts = Channel.from_array("P", np.full(31, 3.0), quantity="power", target="heat")
    found = Experiment.bind(model, bound(record, T="case", ROOM="air").with_channels(watts))
    assert [(o.sensor, o.node) for o in found.observations] == [("T", "case")]
    assert isinstance(found.scenario.boundaries["air"], TableSignal)
    np.testing.assert_array_equal(found.scenario.loads["heat"].values, 3.0)
    assert found.scenario.loads["heat"].hold


@pytest.mark.parametrize(("watts", "means"), [(10.0, {"scale.q": 0.02}), (0.0, {})])
def test_the_error_of_a_mean_is_a_part_of_its_power_and_of_none_where_that_is_off(watts: float, means: dict[str, float]) -> None:
    inputs = Inputs({"gains": {}, "loads": {}})
    meter = Channel.from_array("P", np.full(5, watts), quantity="power", role="load", target="q", common=0.2)
    inputs.take(meter, "load", "q", Constant(watts), None)
    assert inputs.means == pytest.approx(means)


def test_a_channel_without_a_target_is_bound_by_its_name(model: Model, record: Record) -> None:
    times = record.times
    named = Record.from_arrays("r", times, {"case": record["T"].values, "air": record["ROOM"].values}, unit="K")
    found = Experiment.bind(model, named)
    assert found.observations[0].node == "case"
    assert "air" in found.scenario.boundaries


def test_an_alias_leads_to_the_canonical_path() -> None:
    stack = pair()
    record = log(stack, {}, {"T": "a.case"}, boundary="room", samples=31)
    found = Experiment.bind(stack, bound(record, T="node:first.case"))
    assert found.observations[0].node == "a.case"


def test_command_and_gain_drive_a_load(model: Model, record: Record) -> None:
    duty = Channel.from_array("Q", np.linspace(0, 1, 31), quantity="command", role="command", target="heat")
    plain = Experiment.bind(model, record.with_channels(duty))
    assert plain.scenario.commands["heat"].hold
    assert plain.scenario.gains == {}
    geared = Experiment.bind(model, record.with_channels(replace(duty, role="load", gain="power")))
    assert geared.scenario.gains == {"heat": "power"}
    assert geared.scenario.loads == {}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"T": "boundary:case"}, r"bench, T: 'case' is a node of Box, not a boundary"),
        ({"ROOM": "node:air"}, r"bench, ROOM: 'air' is a boundary of Box, not a node"),
        ({"T": "load:case"}, r"bench, T: no load 'case' in Box"),
        ({"T": "load:heet"}, r"bench, T: no load 'heet' in Box\. Did you mean 'heat'"),
    ],
)
def test_a_wrong_role_is_refused(model: Model, record: Record, change: dict[str, str], words: str) -> None:
    with pytest.raises(RecordError, match=words):
        Experiment.bind(model, bound(record, **change))


def test_an_unknown_target_names_the_nearest(model: Model, record: Record) -> None:
    with raises_code("name.unknown", NameNotFoundError, match="'cse'.*'case'"):
        Experiment.bind(model, bound(record, T="cse"))


def test_a_record_must_observe_a_node(model: Model, record: Record) -> None:
    with raises_code("record.does-not-apply", RecordError):
        Experiment.bind(model, record.select("ROOM"))


def test_a_power_is_no_temperature(model: Model, record: Record) -> None:
    watts = Channel.from_array("P", np.full(31, 3.0), quantity="power", target="case")
    with raises_code("record.does-not-apply", RecordError, match="'case'"):
        Experiment.bind(model, record.select("ROOM").with_channels(watts))


def test_a_load_read_without_a_unit_is_not_taken_for_degrees(tmp_path: Path, model: Model) -> None:
    # a column without unit is read in degC, and a load of 4 W would become 277
    file = tmp_path / "run.csv"
    file.write_text("time_s,T,P\n0,24,4\n60,24.1,4\n120,24.3,4\n")
    air = Scenario("x", boundaries={"air": "24 [degC]"})
    with raises_code("record.does-not-apply", RecordError, match="'heat'.*'heat'"):
        Experiment.bind(model, read_record(file, {"case": "T", "heat": "P"}, time="time_s"), air)
    found = Experiment.bind(model, read_record(file, {"case": "T", "P": {"load": "heat"}}, time="time_s"), air)
    np.testing.assert_array_equal(found.scenario.loads["heat"].values, 4.0)


def test_first_readings_are_medians_over_the_window_of_valid_samples(record: Record) -> None:
    values = np.array([250.0, 299.0, 310.0, 301.0, 302.0])
    channel = Channel("T", values, np.array([False, True, True, True, True]), role="node", target="case")
    made = Record.from_arrays("r", np.arange(5) * 60.0, {"T": channel})
    assert first_reading(made, "T") == 299.0
    assert first_reading(made, "T", 119.0) == 304.5
    assert first_reading(made, "T", 120.0) == 301.0


def test_times_count_from_the_first_sample(model: Model, record: Record) -> None:
    late = replace(record, times=record.times + 86400.0)
    one, two = Experiment.bind(model, record), Experiment.bind(model, late)
    np.testing.assert_allclose(two.times, one.times)
    np.testing.assert_allclose(two.scenario.boundaries["air"].times, one.scenario.boundaries["air"].times)
    assert two.scenario.seconds == one.scenario.seconds


def test_masked_samples_are_no_observations(model: Model, record: Record) -> None:
    found = Experiment.bind(model, record.mask("T", 600.0, 1800.0))
    kept = found.times[found.observations[0].index]
    assert not np.any((kept >= 600.0) & (kept <= 1800.0))
    assert kept.size == found.observations[0].measured.size == 31 - 3


class TestStarts:
    def test_measured(self) -> None:
        stack = pair()
        record = log(stack, {}, {"A": "a.case", "B": "b.case"}, boundary="room", samples=31, start="30 [degC]")
        found = Experiment.bind(stack, record, Scenario("s", start="measured"))
        assert tuple(found.loose) == ("a.case", "b.case")
        assert found.scenario.initial["a.case"] == first_reading(record, "A")
        assert found.scenario.start == pytest.approx(np.mean([first_reading(record, n) for n in "AB"]), rel=1e-15)

    def test_nothing_given_with_one_boundary_starts_the_rest_there(self) -> None:
        stack = pair()
        record = log(stack, {}, {"A": "a.case"}, boundary="room", samples=31)
        found = Experiment.bind(stack, record)
        assert tuple(found.loose) == ("a.case",)
        assert found.scenario.start == ""

    def test_boundary(self, model: Model, record: Record) -> None:
        found = Experiment.bind(model, record, Scenario("s", start="air"))
        assert not found.loose
        assert found.scenario.start == "air"
        assert found.scenario.initial == {}

    def test_steady(self, model: Model) -> None:
        warm = log(model, {}, {"T": "case"}, noise=None, start="steady", swing=0.0)
        found = calibrate(model, warm, [], scenario=Scenario("s", start="steady"))
        assert found.sensors["T"].rmse < 1e-4
        assert found.local == ()

    def test_a_channel_by_name(self, model: Model, record: Record) -> None:
        found = Experiment.bind(model, record, Scenario("s", start="ROOM"))
        assert found.readings == {"case": "ROOM"}
        assert found.scenario.initial["case"] == first_reading(record, "ROOM")

    def test_one_node_by_a_channel(self, model: Model, record: Record) -> None:
        found = Experiment.bind(model, record, Scenario("s", initial={"case": "T"}))
        assert found.readings == {"case": "T"}
        assert not found.loose

    def test_an_unknown_word_is_refused(self, model: Model, record: Record) -> None:
        with raises_code("name.unknown", ScenarioError, match="'RAUM'"):
            calibrate(model, record, [MASS], scenario=Scenario("s", start="RAUM"))

    def test_a_massless_node_has_no_start_to_look_for(self) -> None:
        stack = pair(second=box({"parameters/power": "0.5 [W]"}))
        record = log(stack, {}, {"A": "a.case", "M": "mid"}, boundary="room", samples=61)
        found = calibrate(stack, record, ["stack.contact_conductance"], scenario=Scenario("s", start="measured"))
        assert [i.name for i in found.local] == ["initial.a.case"]
        assert found.sensors["M"].rmse < 0.1


class TestConstantErrorsOfInstruments:
    def test_a_meter_that_reads_zero_throughout_has_no_error_to_look_for(self, model: Model) -> None:
        record = metered(log(model, {}, {"T": "case"}, loads={"heat": 0.0}, start="60 [degC]"), "heat", 0.0, accuracy=0.04)
        found = calibrate(model, record, [MASS])
        assert abs(found[MASS].value - 1.5) < 4 * found[MASS].error
        assert "METER error" not in found.values

    @pytest.mark.parametrize("order", [1, -1])
    def test_the_record_with_the_largest_power_says_how_well_it_is_known(self, model: Model, order: int) -> None:
        weak = metered(log(model, {}, {"T": "case"}, name="weak", loads={"heat": 0.5}, start="60 [degC]"), "heat", 0.5, accuracy=0.04)
        on = metered(log(model, {}, {"T": "case"}, name="on", seed=2), "heat", 4.0, accuracy=0.04)
        found = calibrate(model, [weak, on][::order], [HTC, MASS])
        assert found["METER error"].prior == (0.0, pytest.approx(0.01))
        assert found["METER error"].error <= 0.01 * (1 + 1e-9)

    @pytest.mark.parametrize(
        "law",
        [
            {"temperature_coefficient": "-0.01 [1/K]", "reference_temperature": "20 [degC]"},
            {"exponential_coefficient": "0.01 [1/K]", "reference_temperature": "20 [degC]"},
            {"thermostat": {"on_below": "0 [degC]", "off_above": "1 [degC]"}},
        ],
        ids=lambda law: next(iter(law)),
    )
    def test_a_logged_power_is_what_heated(self, model: Model, law: dict[str, object]) -> None:
        record = metered(log(model, {}, {"T": "case"}, samples=61), "heat", 4.0)
        other = box({f"loads/heat/{name}": value for name, value in law.items()})
        ends = [simulate(m, Experiment.bind(m, record).scenario, times=record.times)["case"].kelvin for m in (model, other)]
        np.testing.assert_allclose(*ends, rtol=0, atol=1e-6)

    def test_pauses_do_not_make_a_meter_worse(self, model: Model) -> None:
        watts = np.where(np.arange(301) % 100 < 20, 4.0, 0.0)
        found = Experiment.bind(model, metered(log(model, {}, {"T": "case"}), "heat", watts, accuracy=0.04))
        assert found.shared["METER"] == ("scale.heat", pytest.approx(0.01))

    def test_a_logged_boundary_has_no_local_value(self, model: Model, record: Record) -> None:
        # it would be added to the log: a room of 24 degC would be 297 K above what was measured
        with raises_code("fit.nothing-free", IdentificationError, match=r"local\.air.*'air'"):
            calibrate(model, record, [HTC], local={"air": {"start": "24 [degC]", "sd": "1 [K]"}})


def test_the_logged_boundary_wins_over_the_scenario(model: Model, record: Record) -> None:
    found = Experiment.bind(model, record, Scenario("s", boundaries={"air": "0 [degC]"}))
    np.testing.assert_allclose(found.scenario.boundaries["air"].values, room(record.times), rtol=1e-15)


def test_what_the_log_does_not_say_comes_from_the_scenario(model: Model, record: Record) -> None:
    found = Experiment.bind(model, record.select("T"), Scenario("s", boundaries={"air": "24 [degC]"}))
    assert found.scenario.boundaries["air"] == Constant(ICE + 24.0)


def test_a_boundary_without_a_temperature_is_refused(model: Model, record: Record) -> None:
    with raises_code("run.input-missing", ScenarioError, match="'air'"):
        calibrate(model, record.select("T"), [HTC])


def test_a_scenario_for_a_record_that_is_not_there(model: Model, record: Record) -> None:
    with raises_code("name.unknown", RecordError, match="'bensch'.*'bench'"):
        calibrate(model, record, [HTC], scenario={"bensch": Scenario("s")})


def later(record: Record, sensor: str, hours: float) -> Record:
    """Return a record in which a sensor begins to read only after some time."""
    channel = record[sensor]
    return record.with_channels(replace(channel, valid=channel.valid & (record.times >= 3600.0 * hours)))


class TestASensorThatBeginsLater:
    @pytest.fixture
    def two(self) -> Record:
        """Two sensors on one node that warms by 14 K within the hours before the second one begins, listed last."""
        return later(log(box(), {}, {"T": "case", "T2": "case"}, loads={"heat": 4.0}), "T2", 2.0)

    def test_says_nothing_of_the_start_of_its_node(self, model: Model, two: Record) -> None:
        found = Experiment.bind(model, two)
        assert two["T2"].values[two["T2"].valid][0] > first_reading(two, "T") + 5.0
        assert found.scenario.initial["case"] == pytest.approx(first_reading(two, "T"))
        assert found.loose == {"case": ("T",)}

    def test_says_it_where_no_other_does(self, model: Model, two: Record) -> None:
        alone = two.select("T2", "ROOM")
        assert Experiment.bind(model, alone).scenario.initial["case"] == pytest.approx(first_reading(two, "T2"))

    def test_counts_where_it_has_read_when_the_first_reads_again(self, model: Model, two: Record) -> None:
        beside = later(log(box(), {}, {"T": "case", "T2": "case"}, loads={"heat": 4.0}), "T2", 1.0 / 60.0)
        mean = np.mean([first_reading(beside, s) for s in ("T", "T2")])
        assert Experiment.bind(model, beside).scenario.initial["case"] == pytest.approx(mean)

    @pytest.mark.parametrize("fit_start", [True, False])
    def test_is_not_where_a_run_begins(self, model: Model, two: Record, fit_start: bool) -> None:
        request = Request(model, (two,), free=(HTC,), fit_start=fit_start)
        found = build_problem(request)
        (start,) = (i for i in InputTable.of_request(request, found.experiments).rows if i.kind == "start")
        assert start.words == "first reading of T"
        assert start.mean == pytest.approx(first_reading(two, "T"))


def test_no_control_acts_on_a_logged_power_again() -> None:
    """A heater's log was switched again by the deck's thermostat: a conductance was 0.032 +- 0.002 W/K for 0.1, another load 47 % off."""
    heater = {"into": "b", "power": "5 [W]", "thermostat": {"on_below": "30 [degC]", "off_above": "32 [degC]"}}
    bench = {"title": "b", "needs": ["room"], "nodes": {"b": {"capacitance": "100 [J/K]"}}, "loads": {"h": heater}}
    bench["conductors"] = {"s": {"kind": "conduction", "between": ["b", "room"], "conductance": "0.1 [W/K]"}}
    model, times = model_from_dict(bench), np.arange(0.0, 3601.0, 60.0)
    power = Channel.from_array("P", np.where(times < 1800.0, 3.0, 0.0), unit="W", quantity="power", role="load", target="h")
    made = {
        n: Channel.from_array(n, np.full(times.size, 313.15), unit="K", role=r, target=n) for n, r in (("b", "node"), ("room", "boundary"))
    }
    bound = Experiment.bind(model, Record.from_arrays("r", times, made | {"P": power}))
    run = simulate(*bound.as_fitted(model, {}), times=times)
    assert run.load_powers["h"][:30].tolist() == [3.0] * 30


FAN = {
    "title": "box with a fan",
    "needs": ["air"],
    "parameters": {"speed": "3000 [rpm]", "blown": {"value": "0.4 [W/K]", "min": "0.05 [W/K]", "max": "5 [W/K]"}},
    "nodes": {"box": {"capacitance": "400 [J/K]"}},
    "conductors": {
        "still": {"kind": "conduction", "between": ["box", "air"], "conductance": "0.05 [W/K]"},
        "fan": {"kind": "conduction", "between": ["box", "air"], "conductance": "blown * (speed / 3000 [rpm])**0.8"},
    },
    "loads": {"heat": {"into": "box", "power": "20 [W]"}},
}


def test_what_a_schedule_stands_for_is_said(tmp_path: Path) -> None:
    """A fan that a controller moves all the time, and a loss of its motor: held samples bias, and 0 rpm was never logged."""
    made = FAN | {"loads": FAN["loads"] | {"motor": {"into": "box", "power": "2 [W] * (speed / 3000 [rpm])**3"}}}
    model, times = model_from_dict(made), np.arange(0.0, 3601.0, 60.0)
    rpm = 2250.0 + 750.0 * np.sin(times / 400.0)
    truth = {"speed": {"times": [f"{t:g} [s]" for t in times], "values": [f"{n:.3f} [rpm]" for n in rpm]}}
    bench = td.Scenario("b", boundaries={"air": "23 [degC]"}, schedule=truth, start="23 [degC]", duration="1 [h]")
    read = td.simulate(model, bench, times=times)["box"].celsius + np.random.default_rng(1).normal(0.0, 0.02, times.size)
    rows = [f"{t:g},{celsius:.3f},23,{n:.0f}" for t, celsius, n in zip(times, read, rpm, strict=True)]
    (tmp_path / "fan.csv").write_text("\n".join(["time [s],BOX [degC],AIR [degC],FAN [rpm]", *rows]))
    fits = {}
    for interpolation in ("", "linear", "previous", "sampled"):
        fan = {"schedule": "speed"} | ({"interpolation": interpolation} if interpolation else {})
        fan = {"schedule": "speed", "prompt": False} if interpolation == "sampled" else fan
        channels = {"BOX": {"node": "box", "noise": "0.02 [K]"}, "AIR": {"boundary": "air"}, "FAN": fan}
        fits[interpolation] = calibrate(model, read_record(tmp_path / "fan.csv", channels), free=["blown"])
    told = {i: "\n".join(f.warnings) for i, f in fits.items()}
    assert ["'FAN' 0." in told[i] for i in fits] == [True, False, False, False]
    assert "prompt = false" not in told["sampled"]  # it has the effect that changes lie in the middle of an interval
    assert abs(fits["sampled"]["blown"].value - 0.4) < 5e-4
    assert fits["linear"]["blown"].error < 0.1 * fits[""]["blown"].error
    (motor,) = (row for row in fits[""].inputs.rows if row.name == "motor")
    assert (motor.source, motor.words) == ("log", "follows 'speed'")
    asked = {n: bench.with_(schedule={"speed": f"{n} [rpm]"}) for n in (0, 1490, 2000, 4000)}
    known = td.design.Knowledge(model, fits["linear"].values)  # as from a file
    warned = {n: "\n".join(td.predict(known, s, times=[0.0, 1800.0, 3600.0]).warnings) for n, s in asked.items()}
    assert ["never" in w for w in warned.values()] == [True, False, False, True]
    assert "0 rpm" in warned[0]
    assert "(1500 to 3000 rpm)" in warned[0]
    assert "speed 3000 rpm" not in "\n".join(td.predict(known, bench.with_(schedule={}), times=[0.0, 1800.0, 3600.0]).warnings)


def test_a_column_of_speeds_drives_a_parameter_and_a_factor_of_it_is_fitted(tmp_path: Path) -> None:
    model, times = model_from_dict(FAN), np.arange(0.0, 7200.0, 60.0)
    rpm = np.array([1500.0, 3000.0, 600.0])[(times // 2400.0).astype(int)]
    read = [23.0]
    for n in rpm[:-1]:  # exact over each minute: C dT/dt = P - G (T - T_air)
        conductance = 0.05 + 0.6 * (n / 3000.0) ** 0.8
        settled = 23.0 + 20.0 / conductance
        read.append(settled + (read[-1] - settled) * np.exp(-conductance * 60.0 / 400.0))
    rows = [f"{t:g},{celsius:.3f},23,{n:g}" for t, celsius, n in zip(times, read, rpm, strict=True)]
    (tmp_path / "fan.csv").write_text("\n".join(["time [s],BOX [degC],AIR [degC],FAN [rpm]", *rows]))
    channels = {
        "BOX": {"node": "box", "noise": "0.01 [K]"},
        "AIR": {"boundary": "air"},
        "FAN": {"schedule": "speed"},
    }
    fit = calibrate(model, read_record(tmp_path / "fan.csv", channels), free=["blown"])
    assert fit["blown"].value == pytest.approx(0.6, rel=1e-3)
    record = read_record(tmp_path / "fan.csv", channels)
    alone = read_record(tmp_path / "fan.csv", {n: c for n, c in channels.items() if n != "FAN"})
    fan = read_record(tmp_path / "fan.csv", {"FAN": channels["FAN"]}, name="counter")
    fit = calibrate(model, alone.joined(fan, ("-90 [s]", "90 [s]")), free=["blown"])  # a counter of its own clock
    assert fit["blown"].value == pytest.approx(0.6, rel=5e-3)
    with raises_code("unit.wrong-dimension", match="blown"):
        wrong = record.with_channels(replace(record["FAN"], target="blown"))
        calibrate(model, wrong, free=["box.capacitance"])
    with raises_code("name.unknown", match="spede"):
        Experiment.bind(model, record.with_channels(replace(record["FAN"], target="spede")))
