"""Kinds of run: told by what acts, deviations planted and found, what a further kind is given, what a file keeps. Synthetic records.

Records are marked as measured here: of records that a law made nothing is estimated.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.fit._calibration import Calibration
from thermid.fit._discrepancy.regime_runs import kind_of_run, regimes_of
from thermid.fit._discrepancy.regimes import BALANCE, FEW, Beside, KindsSeen, OwnValue, Regimes, regimes_kept
from thermid.measure.records import Channel, Record
from thermid.prediction._budget import KINDS
from thermid.prediction._known import known_of
from thermid.prediction._records import ROOM, START
from thermid.prediction.bands import predict_record
from thermid.simulation.runs import prepare
from thermid.values.fitted import load_values

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


RUNS = {  # watts of both loads, and what is done with them
    "one": (4.0, 0.0, "steady"),
    "half": (2.0, 0.0, "steady"),
    "low": (1.0, 0.0, "steady"),
    "both": (4.0, 2.0, "steady"),
    "other": (0.0, 2.0, "steady"),
    "steps": (4.0, 0.0, "switched"),
    "hot": (0.0, 0.0, "hot"),
    "cold room": (4.0, 0.0, "cold"),
}


def log(name: str, rng: np.random.Generator, deviation: float, synthetic: bool = False) -> Record:
    first, second, shape = RUNS[name]
    times = np.linspace(0.0, 10800.0, 181)
    heat = np.full(times.size, first)
    if shape == "switched":
        heat *= (times // 2700.0) % 2 == 0
    room = -20.0 if shape == "cold" else 20.0
    start = 60.0 if shape == "hot" else room
    factors = np.exp(deviation * rng.standard_normal(3))
    hidden = plate(0.30 * factors[0], 0.50 * factors[1], 900.0 * factors[2])
    given = td.Scenario(
        "bench",
        boundaries={"air": f"{room} [degC]"},
        start=f"{start} [degC]",
        duration="3 [h]",
        loads={"heat": (times, heat), "other": f"{second} [W]"},
    )
    run = td.simulate(hidden, given, times=times)
    channels = {
        s: Channel.of(s, run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05)
        for s, n in (("T1", "plate"), ("T2", "box"))
    }
    channels["ROOM"] = Channel.of("ROOM", np.full(times.size, room + 273.15), unit="K", role="boundary", target="air")
    channels["P1"] = Channel.of("P1", heat, quantity="power", role="load", target="heat")
    channels["P2"] = Channel.of("P2", np.full(times.size, second), quantity="power", role="load", target="other")
    return Record.from_arrays(name, times, channels, synthetic=synthetic)


def fitted(names: list[str], deviation: float, seed: int = 1, synthetic: bool = False) -> Calibration:
    rng = np.random.default_rng(seed)
    return td.calibrate(plate(), [log(n, rng, deviation, synthetic) for n in names], FREE)


def seen(fit: Calibration) -> KindsSeen:
    return KindsSeen.of([fit.values.provenance])


@pytest.fixture(scope="module")
def deviating() -> Calibration:
    return fitted([n for n in RUNS if n != "hot"], 0.06)


@pytest.fixture(scope="module")
def alike() -> Calibration:
    return fitted([n for n in RUNS if n != "hot"], 0.0)


def test_kinds_are_told_by_what_acts(deviating: Calibration) -> None:
    kinds = seen(deviating).kinds
    assert len(kinds) == len(RUNS) - 1
    assert all(len(records) == 1 for records in kinds.values())
    by_record = {records[0]: kind for kind, records in kinds.items()}
    assert "heat steady about 4 W" in by_record["one"]
    assert "heat and other" in by_record["both"]
    assert "switched" in by_record["steps"]
    assert "at -30 to -10 degC" in by_record["cold room"]


@pytest.mark.parametrize(("start", "words"), [("60 [degC]", "from hot"), ("-5 [degC]", "from cold"), ("20 [degC]", "")])
def test_a_start_is_part_of_a_kind(start: str, words: str) -> None:
    given = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start=start, duration="1 [h]")
    ready = prepare(plate(), given, ())
    kind = kind_of_run(ready.wiring, ready.engine, None)
    assert words in kind
    assert ("from" in kind) == bool(words)


def test_thin_gas_is_another_kind() -> None:
    given = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]")
    thin = given.with_(environment={"*": td.simulation.Environment("1000 [Pa]")})
    kinds = []
    for scenario in (given, thin):
        ready = prepare(plate(), scenario, ())
        kinds.append(kind_of_run(ready.wiring, ready.engine, None))
    assert kinds[0] != kinds[1]
    assert "1000 Pa" in kinds[1]


def test_planted_deviations_are_found(deviating: Calibration, alike: Calibration) -> None:
    planted, none = seen(deviating), seen(alike)
    assert 0.02 < planted.size("coefficient") < 0.12
    assert none.size("coefficient") < 0.01
    assert none.size("power") < 0.01


def test_a_further_kind_is_given_a_deviation_of_its_own(deviating: Calibration, alike: Calibration) -> None:
    further = td.Scenario(
        "further", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="3 [h]", loads={"heat": "8 [W]", "other": "4 [W]"}
    )
    wide, narrow = (td.predict(f, further)["plate"].final for f in (deviating, alike))
    rise = wide.celsius - 20.0
    assert wide.shares[KINDS] > 0.5
    assert 0.02 * rise < wide.error < 0.15 * rise
    assert narrow.error < 0.3 * wide.error
    without = td.predict(deviating, further, without=[KINDS])
    assert without["plate"].final.error < 0.5 * wide.error
    assert any(KINDS in x.what for x in without.left_out)


def test_of_a_kind_that_was_fitted_the_fit_has_followed_a_part(deviating: Calibration) -> None:
    run = {"boundaries": {"air": "20 [degC]"}, "start": "20 [degC]", "duration": "3 [h]"}
    one = td.predict(deviating, td.Scenario("one", loads={"heat": "4 [W]", "other": "0 [W]"}, **run))["plate"].final
    new = td.predict(deviating, td.Scenario("new", loads={"heat": "16 [W]", "other": "0 [W]"}, **run))["plate"].final
    assert one.error / (one.celsius - 20.0) < new.error / (new.celsius - 20.0)


def test_a_single_kind_says_nothing_of_itself_and_the_prior_decides_of_others() -> None:
    fit = fitted(["one"], 0.0)
    known = seen(fit)
    assert "one kind of run (1 records), too few for an estimate: the prior of 10 % is used" in known.words
    assert 0.05 < known.size("coefficient") < 0.15
    run = {"boundaries": {"air": "20 [degC]"}, "start": "20 [degC]", "duration": "3 [h]"}
    same = td.predict(fit, td.Scenario("same", loads={"heat": "4 [W]", "other": "0 [W]"}, **run))
    new = td.predict(fit, td.Scenario("new", loads={"heat": "8 [W]", "other": "4 [W]"}, **run))
    assert same["plate"].final.error < 0.2 * new["plate"].final.error
    assert new["plate"].final.error > 1.0
    assert any("prior" in w for w in new.warnings)


def test_the_words_count_kinds_and_records(deviating: Calibration) -> None:
    assert len(seen(deviating).kinds) >= FEW
    assert f"estimated over {len(RUNS) - 1} kinds of run ({len(RUNS) - 1} records)" in seen(deviating).words


def test_nothing_is_said_of_synthetic_records() -> None:
    fit = fitted(["one", "half"], 0.05, synthetic=True)
    assert regimes_of(fit, {}) is None
    assert not seen(fit)


def test_a_file_says_what_the_fit_says(deviating: Calibration, tmp_path: Path) -> None:
    deviating.save(tmp_path / "plate.toml")
    values = load_values(tmp_path / "plate.toml")
    further = td.Scenario("further", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="3 [h]", loads={"heat": "8 [W]"})
    live = td.predict(deviating, further)["box"].final
    filed = td.predict(known_of(values, plate()), further)["box"].final
    assert filed.error == pytest.approx(live.error, rel=1e-4)


def test_what_is_kept_reads_back(deviating: Calibration) -> None:
    kept = regimes_kept(deviating.values.provenance)
    assert kept is not None
    again = Regimes.from_dict(kept.to_dict())
    assert again.to_dict() == kept.to_dict()
    assert again.names == kept.names


def test_a_stage_whose_records_a_later_one_holds_counts_once(deviating: Calibration) -> None:
    one = deviating.values.provenance
    assert KindsSeen.of([one, one]).size("coefficient") == KindsSeen.of([one]).size("coefficient")


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
            s: Channel.of(s, run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05)
            for s, n in (("T1", "plate"), ("T2", "box"))
        }
        records.append(Record.from_arrays(f"run {k}", times, channels, synthetic=False))
    given = td.Scenario("r", loads={"heat": "4 [W]", "other": "0 [W]"}, start="20 [degC]")
    fit = td.calibrate(plate(), records, FREE, scenario=given, local={"air": {"start": "20 [degC]", "sd": "2 [K]"}})
    own = seen(fit).own_value("air", "20 [degC]")
    assert own is not None
    assert own.runs == 10
    assert 0.4 < own.sd < 1.6
    assert abs(own.mean) < 0.8
    other = seen(fit).own_value("air", "T1")
    assert other is not None
    assert other.mean == 0.0
    assert other.sd >= own.sd


@pytest.mark.parametrize(("levels", "words"), [("held", "switched"), ("anew", "in closed loop"), ("one", "steady")])
def test_a_command_that_is_set_anew_at_every_sample_is_a_controllers(levels: str, words: str) -> None:
    times = np.linspace(0.0, 3600.0, 361)
    rng = np.random.default_rng(2)
    given = {"held": np.repeat(rng.uniform(0.2, 1.0, 20), 19)[:361], "anew": 0.5 + 0.1 * rng.standard_normal(361), "one": np.full(361, 0.5)}
    run = td.Scenario("c", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="1 [h]", commands={"heat": (times, given[levels])})
    ready = prepare(plate(), run.with_(loads={"other": "0 [W]"}), ())
    assert f"heat {words} about" in kind_of_run(ready.wiring, ready.engine, None)


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
            s: Channel.of(s, run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05)
            for s, n in (("T1", "plate"), ("T2", "box"))
        }
        channels["P"] = Channel.of("P", np.full(times.size, 1.0 + step * k), quantity="power", role="load", target="heat")
        records.append(Record.from_arrays(f"run {k}", times, channels, synthetic=False))
    return records


def test_first_readings_of_two_sensors_say_more_of_a_room_than_one() -> None:
    # the room is T2 = T1 + 1 (T2 - T1); before any run the slope is 0 +- 0.5
    records = warm_runs(14, 0.3, past=3.0)
    given = td.Scenario("r", loads={"other": "0 [W]"})
    fit = td.calibrate(plate(), records[:12], FREE, scenario=given, local={"air": {"start": "T1", "sd": "5 [K]"}})
    own = seen(fit).own_value("air", "T1")
    assert own is not None
    assert [b.channel for b in own.beside] == ["T2"]
    assert own.beside[0].slope > 0.5
    assert abs(own.beside[0].slope - 1.0) < 2.0 * own.beside[0].error
    assert own.sd < 0.5
    for record in records[12:]:
        first = {s: float(record.channels[s].values[0]) for s in ("T1", "T2")}
        mean, error = own.given(first)
        alone, _ = own.given({"T1": first["T1"]})
        room = first["T2"]
        assert abs(first["T1"] + mean - room) < 3.0 * error
        assert abs(first["T1"] + mean - room) <= abs(first["T1"] + alone - room) + 0.2
        told = predict_record(fit, record, scenario=given, readings={"air": "T1"})
        assert told.inside() > 0.8
        assert ROOM in told.bands["T1"].parts


def test_what_is_known_of_rooms_reads_back_with_the_other_sensors() -> None:
    one = OwnValue("air", "T1", 0.3, 0.5, 9, (Beside("T2", -1.0, 0.4, 0.2),))
    assert OwnValue.from_dict(one.to_dict()) == one
    old = {"name": "air", "start": "T1", "mean": 0.3, "sd": 0.5, "runs": 9}
    assert OwnValue.from_dict(old).to_dict() == old
    mean, error = one.given({"T1": 20.0, "T2": 20.0})
    assert mean == pytest.approx(0.3 + 0.4)
    assert error == pytest.approx(np.hypot(0.5 * np.sqrt(1 + 1 / 9), 0.2))
    assert one.given({"T1": 20.0})[0] == pytest.approx(0.3)


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
        channels = {"T1": Channel.of("T1", noisy, unit="K", role="node", target="plate", noise=0.05)}
        channels["ROOM"] = Channel.of("ROOM", np.full(times.size, 293.15), unit="K", role="boundary", target="air")
        records.append(Record.from_arrays(f"down {k}", times, channels, synthetic=False))
    return records


def test_a_hidden_node_starts_off_its_balance_as_on_the_fitted_runs() -> None:
    records = hot_runs(6)
    given = td.Scenario("down", loads={"heat": "0 [W]", "other": "0 [W]"})
    fit = td.calibrate(plate(), records[:5], ["skin.conductance", "joint.conductance"], scenario=given)
    own = seen(fit).own_value("initial.box", BALANCE)
    assert own is not None
    assert own.runs == 5
    told = predict_record(fit, records[5], scenario=given)
    assert START in told.bands["T1"].parts
    assert told.inside() > 0.9
    assert seen(fit).own_value("initial.box", "T1") is not None
    assert KindsSeen(()).own_value("initial.box", BALANCE) is None
