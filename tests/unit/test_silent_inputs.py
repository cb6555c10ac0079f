"""What a run rests on and nobody said: starts, powers, missing logs, tails. One test for each, named after what was seen."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

import thermid as td
from by_code import raises_code
from plain_errors import errors_in_full
from thermid.app.cli import summary
from thermid.app.cli.app import app
from thermid.base.errors import DeckError, code_of
from thermid.campaign.stages import check_campaign
from thermid.measure.records import Channel
from thermid.model.tree import TableSignal, load_model

pytestmark = pytest.mark.usefixtures("errors_in_turn")

ZERO = 273.15
NOISE = 0.05
STEP = 20.0


def box(rows: dict[str, float], load: str = "core") -> td.Model:
    """Return a core that is heated, a case around it and a cover; what a row names is a start of its own."""
    at = {"link": 0.6, "cover": 0.3, "htc": 10.0, "core": 200.0, "case": 300.0, "lid": 120.0, "power": 3.2} | rows
    return td.model_from_dict(
        {
            "title": "box",
            "needs": ["air"],
            "nodes": {
                "core": {"capacitance": f"{at['core']!r} [J/K]"},
                "case": {"capacitance": f"{at['case']!r} [J/K]"},
                "lid": {"capacitance": f"{at['lid']!r} [J/K]"},
            },
            "conductors": {
                "link": {"kind": "conduction", "between": ["core", "case"], "conductance": f"{at['link']!r} [W/K]"},
                "hinge": {"kind": "conduction", "between": ["case", "lid"], "conductance": f"{at['cover']!r} [W/K]"},
            },
            "surfaces": {
                "skin": {"of": "case", "to": "air", "area": "0.03 [m^2]", "effective_htc": f"{at['htc']!r} [W/(m^2 K)]"},
                "top": {"of": "lid", "to": "air", "area": "0.02 [m^2]", "effective_htc": "8 [W/(m^2 K)]"},
            },
            "loads": {"heat": {"into": load, "power": f"{at['power']!r} [W]"}},
        }
    )


def temperature(run: Any, node: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(run[node].at(times), dtype=float) + ZERO


def logged(name: str, times: NDArray[np.float64], case: NDArray[np.float64], power: NDArray[np.float64] | None = None) -> td.Record:
    """Return a log of case and air, and of the power where one is given."""
    channels = {
        "T": Channel.from_array("T", case, unit="K", role="node", target="case", noise=NOISE),
        "A": Channel.from_array("A", np.full(times.size, 20.0 + ZERO), unit="K", role="boundary", target="air", noise=0.01),
    }
    if power is not None:
        channels["P"] = Channel.from_array("P", power, role="load", target="heat", quantity="power")
    return td.Record.from_arrays(name, times, channels)


def warm(seed: int) -> tuple[dict[str, float], td.Model, td.Record]:
    """Return the true values, the deck that is fitted, and the log of a test that began while the box was still warm.

    The box has a past: it was heated for 5 min to 2 h with 2 to 8 W and cooled for up to 15 min before the log begins.
    """
    rng = np.random.default_rng(seed)
    spread = {k: float(np.exp(rng.normal(0.0, 0.4))) for k in ("htc", "core")}
    drawn = {"link": float(rng.uniform(0.2, 1.5)), "cover": float(rng.uniform(0.1, 0.6)), "lid": float(rng.uniform(40.0, 200.0))}
    truth = box(drawn | {"htc": 10.0 * spread["htc"], "core": 200.0 * spread["core"]})
    heated, cooled = float(rng.uniform(300.0, 7200.0)), float(rng.uniform(0.0, 900.0))
    on, off = float(rng.uniform(2.0, 8.0)), float(rng.uniform(600.0, 1200.0))
    air = {"air": "20 [degC]"}
    past = TableSignal(np.array([0.0, heated, heated + cooled + 1.0]), np.array([on, 0.0, 0.0]), True)
    before = td.simulate(truth, td.Scenario("past", boundaries=air, start="air", loads={"heat": past}, duration=heated + cooled))
    initial = {n: f"{before[n].final} [degC]" for n in ("core", "case", "lid")}
    times = np.arange(0.0, 3601.0, STEP)
    power = np.where(times < off, 0.0, 4.0)
    now = TableSignal(times, power, True)
    scenario = td.Scenario("now", boundaries=air, start="air", initial=initial, loads={"heat": now}, duration=3600.0)
    case = temperature(td.simulate(truth, scenario), "case", times) + NOISE * rng.standard_normal(times.size)
    true = {"skin.effective_htc": 10.0 * spread["htc"], "core.capacitance": 200.0 * spread["core"]}
    return true, box(drawn), logged(f"warm {seed}", times, case, power)


def held(seed: int) -> list[bool]:
    """Return, of each fitted value, whether its 95 % interval holds the truth."""
    true, deck, record = warm(seed)
    fit = td.calibrate(deck, record, list(true), name="warm")
    return [abs(np.log(fit[p].value / v)) <= 1.959964 * fit[p].error / fit[p].value for p, v in true.items()]


# starts of nodes without a sensor -----------------------------------------------------------------------------------------------------


def test_a_hidden_node_beside_a_warm_one_does_not_start_at_the_boundary() -> None:
    """A coefficient of about 10 came out as 19.4 +- 0.9 with no warning: the core began at the air's 20 degC, its case at 35."""
    deck = box({})
    initial = {"core": "36 [degC]", "case": "35 [degC]", "lid": "33 [degC]"}
    times = np.arange(0.0, 1801.0, STEP)
    past = td.Scenario("cools", boundaries={"air": "20 [degC]"}, start="air", initial=initial, loads={"heat": "0 [W]"}, duration=1800.0)
    case = temperature(td.simulate(deck, past), "case", times) + NOISE * np.random.default_rng(1).standard_normal(times.size)
    fit = td.calibrate(box({"htc": 6.0}), logged("cools", times, case, np.zeros(times.size)), ["skin.effective_htc"])
    assert fit["skin.effective_htc"].value == pytest.approx(10.0, abs=3.0 * fit["skin.effective_htc"].error)
    assert fit["skin.effective_htc"].error < 1.0
    starts = {i.name: i.value - ZERO for i in fit.local}
    assert starts["initial.core"] == pytest.approx(36.0, abs=1.5)
    second = str(fit).splitlines()[1]
    assert second.split()[:2] == ["assumed", "start"]
    assert re.search(r"core, lid: .* \+- [\d.]+ K", second)


def test_a_log_that_begins_at_rest_gets_no_further_unknowns() -> None:
    deck = box({})
    times = np.arange(0.0, 1801.0, STEP)
    scenario = td.Scenario("rest", boundaries={"air": "20 [degC]"}, start="air", loads={"heat": "3 [W]"}, duration=1800.0)
    case = temperature(td.simulate(deck, scenario), "case", times) + NOISE * np.random.default_rng(1).standard_normal(times.size)
    fit = td.calibrate(deck, logged("rest", times, case, np.full(times.size, 3.0)), ["skin.effective_htc"])
    assert [i.name for i in fit.local] == ["initial.case"]
    assert [r.name for r in fit.inputs.assumed] == ["core", "lid"]


def test_a_start_that_was_given_stays() -> None:
    _, deck, record = warm(3)
    for scenario in (td.Scenario("s", start="22 [degC]"), td.Scenario("s", initial={"core": "30 [degC]", "lid": "22 [degC]"})):
        fit = td.calibrate(deck, record, ["skin.effective_htc"], scenario=scenario)
        assert not {i.name for i in fit.local} & {"initial.core", "initial.lid"}
        assert {r.source for r in fit.inputs.rows if r.name == "core"} == {"scenario"}


def test_a_verdict_starts_hidden_nodes_where_a_fit_would() -> None:
    """Nothing is fitted to a record that is held out, so the balance itself stands there, and that it is not counted is said."""
    _, deck, record = warm(3)
    judged = td.compare(deck, record)
    assert not judged.local
    rows = [r for r in judged.inputs.assumed if r.kind == "start"]
    assert [r.name for r in rows] == ["core", "lid"]
    assert all("not counted" in r.words and not r.fitted for r in rows)
    # within half the spread of the case (21.9 degC) and the air (20 degC)
    assert all(20.9 < r.mean - ZERO < 22.0 for r in rows)


def test_many_hidden_nodes_move_together() -> None:
    """Twelve nodes behind one sensor are one unknown: a network of a thousand would be a thousand."""
    nodes = {"case": {"capacitance": "300 [J/K]"}} | {f"n{k}": {"capacitance": "20 [J/K]"} for k in range(12)}
    links = {f"k{k}": {"kind": "conduction", "between": [f"n{k}", "case"], "conductance": "0.2 [W/K]"} for k in range(12)}
    skin = {"of": "case", "to": "air", "area": "0.03 [m^2]", "effective_htc": "10 [W/(m^2 K)]"}
    model = td.model_from_dict({"title": "star", "needs": ["air"], "nodes": nodes, "conductors": links, "surfaces": {"skin": skin}})
    times = np.arange(0.0, 1801.0, STEP)
    initial = {"case": "35 [degC]"} | {f"n{k}": "36 [degC]" for k in range(12)}
    past = td.Scenario("cools", boundaries={"air": "20 [degC]"}, start="air", initial=initial, duration=1800.0)
    case = temperature(td.simulate(model, past), "case", times) + NOISE * np.random.default_rng(1).standard_normal(times.size)
    fit = td.calibrate(model, logged("cools", times, case), ["skin.effective_htc"])
    assert len(fit.local) == 2
    assert fit["skin.effective_htc"].value == pytest.approx(10.0, abs=3.0 * fit["skin.effective_htc"].error)


@pytest.mark.parametrize(("count", "low", "high"), [(20, 33, 40), pytest.param(1000, 1862, 1934, marks=pytest.mark.campaign)])
def test_intervals_of_warm_starts_hold_the_truth(count: int, low: int, high: int) -> None:
    """Of two values in each of 1,000 campaigns, 93.1 to 96.7 % lie in their 95 % intervals; of 20, chance leaves 33 of 40 or more."""
    every = np.array([held(seed) for seed in range(count)])
    assert low <= every.sum() <= high
    if count == 1000:
        assert np.all((every.mean(axis=0) >= 0.931) & (every.mean(axis=0) <= 0.967))


# powers that nobody gave --------------------------------------------------------------------------------------------------------------


def test_a_load_without_a_channel_stands_first() -> None:
    """A heater that was off ran at the deck's 3.2 W, and nobody was told."""
    _, deck, record = warm(3)
    fit = td.calibrate(deck, record.select("T", "A"), ["skin.effective_htc"])
    first = next(line for line in str(fit).splitlines() if line.startswith("  assumed"))
    assert "3.2 W" in first
    assert "'heat'" in first
    (row,) = [r for r in fit.inputs.rows if r.kind == "load"]
    assert (row.source, row.mean) == ("assumed", pytest.approx(3.2))
    said = td.calibrate(deck, record.select("T", "A"), ["skin.effective_htc"], scenario=td.Scenario("by hand", loads={"heat": "2.8 [W]"}))
    assert [r.source for r in said.inputs.rows if r.kind == "load"] == ["scenario"]
    free = td.calibrate(deck, record.select("T", "A"), ["skin.effective_htc", "heat.power"], priors={"heat.power": ("3 [W]", "1 [W]")})
    assert [(r.source, r.words) for r in free.inputs.rows if r.kind == "load"] == [("deck", "fitted here")]


def test_a_duty_in_per_cent_that_is_taken_as_watts_is_questioned() -> None:
    """100 % became 100 W, 16 times the deck's power, in a column without a unit."""
    _, deck, record = warm(3)
    channel = replace(record.channels["P"], values=np.where(record.channels["P"].values > 0, 50.0, 0.0), assumed=True)
    with errors_in_full():  # what a model of error says of these logs does not stand before it
        fit = td.calibrate(deck, record.with_channels(channel), ["skin.effective_htc"])
    head = " ".join(str(fit).splitlines()[:4])
    said = td.calibrate(deck, record.with_channels(replace(channel, assumed=False)), ["skin.effective_htc"])
    assert "full_scale" in head
    assert "full_scale" not in str(said)


def test_a_mass_that_moves_a_thousand_times_is_questioned_first() -> None:
    """54 g became 54.6 kg, "residuals white: yes"."""
    _, deck, record = warm(8)
    long = td.Record.from_arrays("ms", 1000.0 * record.times, dict(record.channels))
    fit = td.calibrate(deck, long, ["core.capacitance", "case.capacitance", "skin.effective_htc"])
    moved = r"core\.capacitance \w+ \d+ J/K, \d{3} .* 200 J/K\. "
    assert any(re.search(moved, line) for line in str(fit).splitlines()[1:5]), str(fit)


# one statement about residuals --------------------------------------------------------------------------------------------------------


def test_residuals_are_not_white_and_white_in_one_output() -> None:
    """ "residuals white: yes" stood above "residuals of the trace are autocorrelated"."""
    _, deck, record = warm(3)
    rng = np.random.default_rng(0)
    slow = 0.035 * np.sin(2.0 * np.pi * record.times / 1500.0) + 0.02 * rng.standard_normal(record.times.size)
    channel = replace(record.channels["T"], values=record.channels["T"].values + slow)
    said = 0
    for scale in (0.3, 0.6, 1.0):
        drifting = replace(channel, values=record.channels["T"].values + scale * slow)
        fit = td.calibrate(deck, record.with_channels(drifting), ["skin.effective_htc"])
        wandering = fit.sensors["T"].wanders
        said += wandering
        assert not (wandering and "residuals white: yes" in str(fit))
    assert said
    from thermid.fit.calibration import SensorStatistics

    assert SensorStatistics(0.1, 0.0, 0.2, 1000, 0.0, 0.0, 1000.0).white
    assert not SensorStatistics(0.1, 0.0, 0.2, 1000, 0.0, 0.0, 400.0).white


# tails --------------------------------------------------------------------------------------------------------------------------------


def test_the_blank_tail_of_a_channel_is_said() -> None:
    """A boundary that was no longer logged was held at its last value to the end of the record without a word."""
    _, deck, record = warm(3)
    fit = td.calibrate(deck, record.mask("A", "1800 [s]", "end"), ["skin.effective_htc"])
    (row,) = [r for r in fit.inputs.rows if r.kind == "boundary"]
    assert row.source == "assumed"
    assert "1820 s" in row.words
    assert "1820 s" in " ".join(str(fit).splitlines()[:4])


def test_a_tail_too_short_to_matter_is_not_said() -> None:
    """A supply that began 25 s after a logger of 10 h was a warning in every summary."""
    _, deck, record = warm(3)
    times = np.arange(0.0, 36000.0, 10.0)
    values = {n: np.interp(times, record.times, c.values) for n, c in record.channels.items()}
    channels = {n: replace(c, values=values[n], valid=np.isfinite(values[n])) for n, c in record.channels.items()}
    long = td.Record.from_arrays("long", times, channels)
    for log, said in ((long.mask("A", "start", "25 [s]"), False), (long.mask("A", "start", "60 [s]"), True)):
        rows = [r for r in td.calibrate(deck, log, ["skin.effective_htc"]).inputs.rows if r.kind == "boundary"]
        assert [r.partly for r in rows] == [said]


def test_a_channel_that_begins_late_is_not_called_missing(campaign: Path) -> None:
    """A power that a second logger began 50 s later stood under "neither log nor scenario gives it"."""
    rows = "\n".join(f"{10 * k},{30 - 0.1 * k:.2f},20.0,{'' if k < 5 else '3.2'}" for k in range(30))
    (campaign.parent / "a.csv").write_text(f"time_s,T [degC],A [degC],P [W]\n{rows}\n")
    campaign.write_text(CAMPAIGN.replace('A = { boundary = "air" }', 'A = { boundary = "air" }\nP = { load = "heat" }'))
    said = " ".join(CliRunner().invoke(app, ["calibrate", str(campaign)]).output.split())
    (partly,) = re.findall("[^:]*: box: heat [(]load[)]", said)
    campaign.write_text(CAMPAIGN)
    said = " ".join(CliRunner().invoke(app, ["calibrate", str(campaign)]).output.split())
    (missing,) = re.findall("[^:]*: box: heat [(]load[)]", said)
    assert partly != missing


# check opens the logs -----------------------------------------------------------------------------------------------------------------

DECK = """
title = "box"
needs = ["air"]
[nodes]
case = { capacitance = "300 [J/K]" }
[surfaces]
skin = { of = "case", to = "air", area = "0.03 [m^2]", effective_htc = "10 [W/(m^2 K)]" }
[loads]
heat = { into = "case", power = "3.2 [W]" }
"""
CAMPAIGN = """
title = "one"
[records.a]
file = "a.csv"
time = "time_s"
[records.a.channels]
T = { node = "case", noise = "0.05 [K]" }
A = { boundary = "air" }
[[stages]]
name = "box"
model = "box.toml"
records = ["a"]
free = ["skin.effective_htc"]
"""


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    (tmp_path / "box.toml").write_text(DECK)
    rows = "\n".join(f"{10 * k},{30 - 0.1 * k:.2f},20.0" for k in range(30))
    (tmp_path / "a.csv").write_text(f"time_s,T [degC],A [degC]\n{rows}\n")
    file = tmp_path / "campaign.toml"
    file.write_text(CAMPAIGN)
    return file


@pytest.mark.parametrize(
    ("old", "new", "code", "data"),
    [
        ('"a.csv"', '"b.csv"', "record.log-missing", "log 'b.csv'"),
        ("A = {", "AA = {", "name.unknown", "'AA'"),
        ('A = { boundary = "air" }', "", "run.input-missing", ""),
        ('node = "case"', 'node = "cas"', "name.unknown", "'cas'"),
    ],
)
def test_check_opens_the_logs_of_a_campaign(campaign: Path, old: str, new: str, code: str, data: str) -> None:
    """A missing file, column or boundary were "0 errors"."""
    findings, inputs = check_campaign(campaign)
    assert not [f for f in findings if f.severity == "error"]
    first = inputs["box"].rows[0]
    assert (first.source, first.kind, first.name) == ("assumed", "load", "heat")
    campaign.write_text(CAMPAIGN.replace(old, new))
    findings, _ = check_campaign(campaign)
    errors = [f for f in findings if f.severity == "error"]
    assert len(errors) == 1
    assert code_of(errors[0].message) == code
    assert data in errors[0].message
    assert errors[0].where.startswith("campaign.toml:")


def test_a_file_that_is_not_there_is_refused_at_the_line_that_names_it(campaign: Path) -> None:
    """The message named neither the deck nor the line."""
    (campaign.parent / "pair.toml").write_text('title = "pair"\n[submodels]\na = { use = "bxo.toml" }\n')
    with raises_code("file.not-found", DeckError, match=r"pair\.toml:3.*submodels\.a\.use.*'bxo\.toml'"):
        td.load_model(campaign.parent / "pair.toml")
    campaign.write_text(CAMPAIGN.replace('"box.toml"', '"bxo.toml"'))
    with raises_code("file.not-found", DeckError, match=r"^campaign\.toml:\d+, stages\.0\.model.*'bxo\.toml'"):
        check_campaign(campaign)


@pytest.mark.parametrize(
    "words", ["predict --stage=bxo --scenario=run.toml", "predict --record=bb", "estimate --stage=bxo --noise=case=free"]
)
def test_names_are_refused_before_anything_is_fitted(campaign: Path, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A misspelt stage took minutes."""
    monkeypatch.setattr(summary, "run_stages", lambda *_, **__: pytest.fail("stages ran"))
    run = 'title = "run"\nduration = "1 [h]"\nstart = "20 [degC]"\nboundaries = { air = "20 [degC]" }\n'
    (campaign.parent / "run.toml").write_text(run)
    command, *options = words.replace("run.toml", str(campaign.parent / "run.toml")).split()
    shown = CliRunner().invoke(app, [command, str(campaign), *options])
    assert re.match(r"no (stage 'bxo'\. Did you mean 'box'|record 'bb')", str(getattr(shown.exception, "message", shown.exception)))


def test_check_compares_a_logged_power_with_the_load_of_the_deck(campaign: Path) -> None:
    """Watts declared as milliwatts gave 0 warnings, and were blamed on kilowatts after a fit."""
    rows = "\n".join(f"{10 * k},{30 - 0.1 * k:.2f},20.0,2.1" for k in range(30))
    (campaign.parent / "a.csv").write_text(f"time_s,T [degC],A [degC],P\n{rows}\n")
    for unit, far in (("mW", True), ("W", False)):
        campaign.write_text(CAMPAIGN.replace("A = {", f'P = {{ load = "heat", unit = "{unit}" }}\nA = {{'))
        found = [f.message for f in check_campaign(campaign)[0] if f.code == "record.power-far-from-deck"]
        assert bool(found) is far, found
        assert all("= \"W\" for 'P'" in words for words in found)


def test_check_opens_what_a_verdict_holds_out_and_shows_none_of_its_numbers(campaign: Path) -> None:
    verdict = '[[verdicts]]\nmodel = "box"\nrecord = "b"\ncriteria = { rmse = "1 [K]" }\n'
    other = CAMPAIGN.replace("[[stages]]", '[records.b]\nfile = "b.csv"\ntime = "time_s"\nchannels = { X = "X" }\n[[stages]]')
    campaign.write_text(other + verdict)
    (campaign.parent / "b.csv").write_text("time_s,X [degC]\n0,30\n10,29\n20,28\n")
    findings, inputs = check_campaign(campaign)
    (error,) = [f for f in findings if f.severity == "error"]
    assert "'X'" in error.message
    assert {r.record for r in inputs["box"].rows} == {"a"}


def test_a_gain_uses_its_parameter_and_a_verdict_before_a_refit_is_named(tmp_path: Path) -> None:
    """`check` said that nothing uses a share which a gain names, and nothing of a verdict by values that were fitted anew."""
    (tmp_path / "box.toml").write_text(
        'title = "box"\nneeds = ["air"]\nparameters = { rf = 0.3, share = "1 - rf", spare = 2 }\n'
        '[nodes]\ncase = { capacitance = "90 [J/K]" }\n'
        '[surfaces]\nskin = { of = "case", to = "air", area = "0.03 [m^2]", effective_htc = "8 [W/(m^2 K)]" }\n'
        '[loads]\nheat = { into = "case", power = "0 [W]" }\n'
    )
    for name in ("a", "b"):
        rows = "".join(f"{60 * k},{20 + 0.1 * k:.2f},20.0,{5 * (k > 9)}\n" for k in range(60))
        (tmp_path / f"{name}.csv").write_text(f"t [s],T [degC],room [degC],P [W]\n{rows}")
    channels = 'T = { node = "case" }\nroom = { boundary = "air" }\nP = { load = "heat", gain = "share" }\n'
    records = "".join(f'[records.{n}]\nfile = "{n}.csv"\ntime = "t [s]"\n[records.{n}.channels]\n{channels}' for n in "ab")
    stages = "".join(
        f'[[stages]]\nname = "{n}"\nmodel = "box.toml"\nrecords = ["a"]\nfree = ["{v}"]\n'
        for n, v in (("first", "skin.effective_htc"), ("again", "case.capacitance"))
    )
    (tmp_path / "c.toml").write_text(
        f'title = "c"\n{records}{stages}[[verdicts]]\nmodel = "first"\nrecord = "b"\ncriteria = {{ rmse = "1 [K]" }}\n'
    )
    found = {f.code: f.message for f in check_campaign(tmp_path / "c.toml")[0]}
    assert "'spare'" in found["model.unused"]
    assert "'again'" in found["campaign.verdict-before-refit"]
    named = [f.message for f in check_campaign(tmp_path / "c.toml")[0] if f.code == "model.unused"]
    assert len(named) == 1
    whole = (tmp_path / "c.toml").read_text()
    (tmp_path / "c.toml").write_text(whole.replace("T = {", "X = {"))
    wrong = check_campaign(tmp_path / "c.toml")[0]
    assert "name.unknown" in {f.code for f in wrong}
    assert [f.message for f in wrong if f.code == "model.unused"] == named
    (tmp_path / "c.toml").write_text(whole.partition("[[stages]]")[0])
    found = CliRunner().invoke(app, ["check", str(tmp_path / "c.toml")])
    assert code_of(str(found.exception)) == "file.key-missing"
    with raises_code("file.another-kind", DeckError, match=r"c\.toml.*'model'"):
        load_model(tmp_path / "c.toml")
