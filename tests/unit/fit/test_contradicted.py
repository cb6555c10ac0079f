"""A fit that meets its readings only with grossly wrong sensors, powers or priors says so at its head, and does not pass."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.fit._calibrate import ASIDE, _beyond_accuracy, own_standing
from thermid.fit._calibration import CONTRADICTION_DEVIATIONS, contradicted
from thermid.fit._problem.residuals import Prior, Unknown
from thermid.fit._uncertainty.moved import Moves
from thermid.model.tree import TableSignal
from thermid.values.store import FittedValue, FittedValues
from unit.fit.bench import BOX, HTC, box, deck, log, metered
from unit.fit.project import make_project, write_log

pytestmark = pytest.mark.usefixtures("errors_in_turn")

CAMPAIGN = """title = "box"

[records.bench]
file     = "logs/bench.csv"
time     = "time_s"
channels = { T_A = { node = "case", noise = "0.05 [K]", accuracy = "0.3 [K]" }, ROOM = { boundary = "air" } }

[[stages]]
name    = "box"
model   = "box.toml"
records = ["bench"]
free    = ["skin.effective_htc"]
"""


def project(folder: Path, bias: float) -> Path:
    path = make_project(folder, CAMPAIGN)
    write_log(log(box(), {HTC: "7 [W/(m^2 K)]"}, {"T_A": "case"}, bias={"T_A": bias}, samples=61, seed=3), folder / "logs" / "bench.csv")
    return path


def test_a_sensor_that_is_grossly_wrong_fails_the_campaign(tmp_path: Path) -> None:
    path = project(tmp_path, 180.0)
    told = CliRunner().invoke(app, ["calibrate", str(path), "-v"])
    assert told.exit_code == 1
    lines = told.stdout.splitlines()
    assert all(part in lines[0] for part in ("NOT CREDIBLE", "'box' (T_A"))
    head = next(line for line in lines if line.startswith("box: NOT CREDIBLE: T_A ") and " +1" in line)
    assert head.index("0.3 K") < head.index("'skin.effective_htc'")  # what a bound holds follows
    made = json.loads(CliRunner().invoke(app, ["calibrate", str(path), "--json"]).output)
    assert made["passed"] is False
    assert list(made["stages"][0]["contradicted"]) == ["sensor T_A"]
    page = tmp_path / "page.html"
    assert CliRunner().invoke(app, ["report", str(path), "--to", str(page)]).exit_code == 1
    shown = page.read_text(encoding="utf-8")
    assert 'class="sum bad"' in shown


def test_an_honest_sensor_passes(tmp_path: Path) -> None:
    campaign = td.run_stages(project(tmp_path, 0.4))
    assert campaign.passed
    assert not campaign["box"].contradicted
    assert "NOT CREDIBLE" not in str(campaign)


PLAIN = FittedValue("sensor T1", 3.1, 0.1, 0.0, False, "K", 0.0, (0.0, 0.0), kind="sensor", prior=(0.0, 0.3))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (PLAIN, "T1 would need an error of +3.1 K, 10 times its accuracy of 0.3 K"),
        (
            replace(PLAIN, path="ROOM error", kind="input", value=-6.0),
            "ROOM would need an error of -6 K, 20 times its accuracy of 0.3 K",
        ),
        (
            replace(PLAIN, path="P error", kind="input", value=0.5, unit="1", prior=(0.0, 0.01)),
            "P would need an error of +50 %, 50 times its accuracy of 1 %",
        ),
        (
            replace(PLAIN, path="lag of T1", kind="instrument", value=200.0, unit="s", log=True, prior=(2.302585, 0.1)),
            "lag of T1 would have to be 200 s to meet the readings, 30 standard deviations from the stated value",
        ),
        (
            replace(PLAIN, path="skin.htc", kind="parameter", value=12.0, unit="W/(m^2 K)", prior=(6.0, 0.5)),
            "skin.htc would have to be 12 W/(m^2 K) to meet the readings, 12 standard deviations from its prior",
        ),
    ],
)
def test_what_would_have_to_be_wrong_is_said(value: FittedValue, words: str) -> None:
    import numpy as np

    assert list(contradicted(FittedValues("s", {value.path: value}, np.eye(1))).values()) == [words]
    assert value.prior is not None
    mean, sd = value.prior
    near = mean + 0.99 * CONTRADICTION_DEVIATIONS * sd
    calm = replace(value, value=float(np.exp(near)) if value.log else near)
    assert not contradicted(FittedValues("s", {value.path: calm}, np.eye(1)))
    assert not contradicted(FittedValues("s", {value.path: replace(value, prior=None)}, np.eye(1)))


def test_what_was_stated_with_a_probability_is_named_before_a_bound() -> None:
    """A power seven deviations off stood behind a value at its bound, which is but where its search ended."""
    film, power = (
        Unknown("skin.htc", "parameter", (), 5.0, low=1.0, high=10.0),
        Unknown("P error", "input", (), 0.0, prior=Prior(0.0, 0.01)),
    )
    asked, problem = SimpleNamespace(name="s", adequate=0.0, accepted=""), SimpleNamespace(unknowns=(film, power), coupled=())
    own = own_standing(asked, problem, {}, [10.0, 0.07], [0.1, 0.001], None, Moves())  # type: ignore[arg-type]
    assert own.state == "not adequate"
    assert 0 < own.because.index(power.name) < own.because.index(film.name)


@pytest.mark.parametrize(("factor", "state"), [(1.0, "credible"), (1.15, "not credible")])
def test_a_power_that_departures_make_up_for_is_named(factor: float, state: str) -> None:
    """A meter of 1 % reads 15 % too much beside a stated mass: heat that comes late explained it, the film 5 errors off, and credible."""
    skin = {"of": "case", "to": "air", "area": "0.05 [m^2]", "emissivity": 0.8}
    htc = {"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}
    truth = td.model_from_dict({**deck(base=BOX), "surfaces": {"skin": {**skin, "htc": htc}}})
    watts, logs = np.where(np.arange(121) < 73, 1.0, 0.0), []
    for k, power in enumerate((4.0, 2.0)):
        on = TableSignal(np.linspace(0.0, 18000.0, 121), power * watts, hold=True)
        bare = log(truth, {}, {"T": "case"}, name=f"run {k}", loads={"heat": on}, noise=0.05, accuracy=0.1, samples=121, seed=k)
        logs.append(metered(bare, "heat", (factor * power * watts).tolist(), 0.01 * power))
    fit = td.calibrate(box(), logs, [HTC], search="local")
    assert fit.standing.state == state
    assert [*fit.contradicted] == ["METER error"] * (factor > 1.0)


@pytest.mark.usefixtures("errors_in_full_here")
@pytest.mark.parametrize("exponent", [0.25, 0.6])
def test_a_fit_and_its_verdict_stand_on_expected_values(exponent: float) -> None:
    """A stated exponent of 0.6 for 0.25 shifts all fitted errors of sensors together; expected values and their curves hold."""

    def bar(exponent: float) -> td.Model:
        skin = {"to": "air", "area": "0.03 [m^2]", "htc": {"coefficient": "film", "exponent": exponent}}
        path = {"kind": "conduction", "conductance": "0.3 [W/K]"}
        return td.model_from_dict(
            {
                "title": "Bar",
                "needs": ["air"],
                "parameters": {"film": "2 [W/(m^2 K)]"},
                "nodes": {n: {"capacitance": "200 [J/K]"} for n in "abc"},
                "surfaces": {f"skin_{n}": skin | {"of": n} for n in "abc"},
                "conductors": {"ab": path | {"between": ["a", "b"]}, "bc": path | {"between": ["b", "c"]}},
                "loads": {"heat": {"into": "a", "power": "5 [W]"}},
            }
        )

    times, scatter, logs = np.linspace(0.0, 10800.0, 61), np.random.default_rng(3), []
    for name, power in (("low", 3.0), ("high", 8.0), ("held out", 5.0)):
        given = td.Scenario(name, {"air": "22 [degC]"}, loads={"heat": f"{power} [W]"}, start="22 [degC]", duration="3 [h]")
        run = td.simulate(bar(0.25), given, times=times)
        channels = {
            n: td.Channel.from_array(
                n, run[n].kelvin + scatter.normal(0.0, 0.05, 61), unit="K", role="node", target=n, noise=0.1, accuracy=0.3
            )
            for n in "abc"
        }
        channels["P"] = td.Channel.from_array("P", np.full(61, power), quantity="power", role="load", target="heat")
        room = np.full(61, 295.15)
        channels["air"] = td.Channel.from_array("air", room, unit="K", role="boundary", target="air", accuracy=0.3)
        logs.append(td.Record.from_arrays(name, times, channels, synthetic=True))
    free = ["film", "ab.conductance", "bc.conductance", *(f"{n}.capacitance" for n in "abc")]
    found = td.calibrate(bar(exponent), logs[:2], free)
    (_, shift), wrong = _beyond_accuracy(found.problem, [*found.fitted.values()]), exponent == 0.6  # type: ignore[arg-type]
    assert ("together" in shift, bool(found.expected)) == (wrong, wrong)
    assert found.own.state == "credible"
    for path in free[1:]:
        value = found[path]
        assert abs(value.value - value.start) < 2.0 * value.error, path
    verdict, fitted = td.validate(found, logs[2], td.Criteria(rmse="0.1 [K]")), td.compare(found.model, logs[2])
    assert verdict.passed
    assert all((s.rmse > 2.0) == wrong for s in fitted.sensors.values())


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ((2.6, 1.7, 2.5, 2.8, 1.6), "all sensors would read about 2.4 K high together, 4.6 times"),
        ((2.6, -2.6, 2.6, -2.6, 0.0), "5 instruments would err by -2.6 to +2.6 K, 4.7 times"),
        ((1.4, 1.4, 1.4, 1.4, 1.4), ""),  # as instruments may that share their error
        ((4.0, 0.1, -0.2, 0.1, 0.1), "5 instruments would err by -0.2 to +4 K"),  # one of them alone
        ((0.1, 0.1, 0.1, 0.1, -4.0), "5 instruments would err by -4 to +0.1 K"),  # the room's alone: the sensors do not read high
        ((2.0, 0.1, -0.2, 0.1, 0.1), ""),  # a remark names it
    ],
)
def test_errors_of_all_instruments_that_contradict_their_accuracies_are_told(errors: tuple[float, ...], words: str) -> None:
    kinds = [("sensor", f"sensor T{k}") for k in range(4)] + [("input", "ROOM error")]
    unknowns = [Unknown(name, kind, (), 0.0, prior=Prior(0.0, 0.5), unit="K") for kind, name in kinds]
    told = _beyond_accuracy(SimpleNamespace(unknowns=unknowns), errors)  # type: ignore[arg-type]
    assert (told[0] > ASIDE) == bool(words)
    assert words in told[1]


@pytest.mark.parametrize(
    ("accuracy", "shift", "state"),
    [(0.3, 0.48, "credible"), (0.5, 1.0, "credible"), (0.3, 1.5, "not adequate"), (0.5, 3.0, "not adequate")],
)
def test_a_common_shift_is_held_against_what_thermometers_of_one_logger_share(accuracy: float, shift: float, state: str) -> None:
    """Sixteen thermometers that were all high by 1.6 of their accuracies condemned a perfect model at 5.3 standard deviations."""
    seats = {f"T{k}": "case" for k in range(16)}
    record = log(box(), {HTC: "7 [W/(m^2 K)]"}, seats, bias=dict.fromkeys(seats, shift), samples=61, noise=0.02, seed=3, accuracy=accuracy)
    fit = td.calibrate(box(), record, [HTC])
    assert fit.standing.state == state
    assert bool(re.search(r"\bK\b", fit.standing.because)) is (state != "credible")


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("count", [2, 5, 16])
def test_right_accuracies_are_called_contradicted_in_at_most_one_fit_of_370(correlation: float, count: int) -> None:
    """However much of their errors the instruments share; 200,000 draws, and four standard deviations of their number."""
    rng, draws = np.random.default_rng(7), 200_000
    common, own = rng.standard_normal((draws, 1)), rng.standard_normal((draws, count))
    errors = math.sqrt(correlation) * common + math.sqrt(1.0 - correlation) * own
    beyond = int(np.count_nonzero(np.sqrt(np.mean(errors**2, axis=1)) > ASIDE))
    expected = draws * math.erfc(ASIDE / math.sqrt(2.0))
    assert beyond <= expected + 4.0 * math.sqrt(expected)


@pytest.mark.parametrize(("share", "is_named"), [(0.5, True), (0.95, False)])
def test_a_heater_that_came_loose_in_one_log_is_named(share: float, is_named: bool) -> None:
    """Its log has all of the power, of which half goes elsewhere; the mean of that power is known to 2 %. Another log is right."""
    times, watts = np.linspace(0.0, 14400.0, 241), np.where(np.linspace(0.0, 14400.0, 241) < 7200.0, 12.0, 3.0)
    skin = {"of": "case", "to": "air", "area": "0.05 [m^2]", "htc": {"value": "10 [W/(m^2 K)]", "min": 1, "max": 60}, "carried_by": "fan"}
    case = {"mass": "0.9 [kg]", "specific_heat": {"value": "900 [J/(kg K)]", "min": 300, "max": 3000}}
    parts = {"nodes": {"case": case}, "surfaces": {"skin": skin}, "loads": {"heat": {"into": "case", "power": "1 [W]"}}}
    model, records = td.model_from_dict({"title": "Box", "needs": ["air"], **parts}), []
    given = td.Scenario("bench", {"air": "22 [degC]"}, start="22 [degC]", duration="4 [h]")
    for k, acting in enumerate((1.0, 1.0, share)):
        run = td.simulate(model, given.with_(commands={"heat": TableSignal(times, acting * watts, True)}), times=times)
        reading = run["case"].kelvin + np.random.default_rng(k).normal(0.0, 0.03, times.size)
        channels = {
            "T": td.Channel.from_array("T", reading, unit="K", role="node", target="case", noise=0.03),
            "air": td.Channel.from_array("air", np.full(times.size, 295.15), unit="K", role="boundary", target="air"),
            "P": td.Channel.from_array("P", watts, quantity="power", role="load", target="heat", prompt=True, common=0.02 * watts.mean()),
        }
        records.append(td.Record.from_arrays(f"log {k}", times, channels, synthetic=True))
    fit = td.calibrate(model, records, ["case.specific_heat", "skin.htc"])
    names = ["log 2: error of the mean of heat"] if is_named else []
    assert [*fit.contradicted] == names
    assert (fit.own.state == "not credible") is is_named
    assert all(name in fit.own.because for name in names)
