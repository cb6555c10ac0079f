"""A record says in which gas its test ran: two pressures separate gas and radiation, in stages, verdicts and whatever runs the record."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, RecordError
from thermid.campaign.stages import RunningTest, check_campaign
from thermid.inference.criticism import find_mistakes
from thermid.measure.records import Channel, Record
from thermid.model.tree import save_model

pytestmark = pytest.mark.usefixtures("values_alone")

THIN = td.simulation.Environment("0.1 [Pa]")
HTC, GRAY = "skin.htc", "skin.emissivity"
TRUTH = {HTC: 4.6, GRAY: 0.62}
CAMPAIGN = """
title = "Two pressures"

[records.air]
file = "air.csv"
time = "time_s"
channels = CHANNELS

[records.thin]
file = "thin.csv"
time = "time_s"
channels = CHANNELS
environment = { "*" = { pressure = "0.1 [Pa]" } }

[records.meter]
file = "meter.csv"
time = "time_s"
channels = { P = { load = "heat", prompt = true } }
prepare = [{ trim = ["10 [min]", "end"] }]

[records.held_out]
file = "held_out.csv"
time = "time_s"
joined = { record = "meter" }
channels = { T = { node = "case", noise = "0.05 [K]" }, ROOM = { boundary = "air" } }
environment = { air = { pressure = { file = "held_out.csv", column = "GAUGE", unit = "Pa" } } }
prepare = [{ trim = ["10 [min]", "end"] }]

[[stages]]
name = "box"
model = "box.toml"
records = ["air", "thin"]
search = "local"
free = ["skin.htc", "skin.emissivity"]

[[verdicts]]
model = "box"
record = "held_out"
criteria = { rmse = "0.2 [K]", max_error = "0.5 [K]" }
""".replace("CHANNELS", '{ T = { node = "case", noise = "0.05 [K]" }, ROOM = { boundary = "air" }, P = { load = "heat", prompt = true } }')


def box() -> td.Model:
    return td.model_from_dict(
        {
            "title": "Box",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": "600 [J/K]"}},
            "surfaces": {
                "skin": {
                    "of": "case",
                    "to": "air",
                    "area": "0.05 [m^2]",
                    "htc": {"value": "6 [W/(m^2 K)]", "min": 1, "max": 20},
                    "emissivity": {"value": 0.4, "min": 0.05, "max": 1},
                }
            },
            "loads": {"heat": {"into": "case", "power": "5 [W]"}},
        }
    )


def measured(name: str, gas: td.simulation.Environment, seed: int) -> Record:
    room = td.Scenario(name, boundaries={"air": "20 [degC]"}, start="air", duration="4 [h]", environment={"*": gas})
    times = np.linspace(0.0, 4 * 3600.0, 61)
    truth = box().with_values({HTC: f"{TRUTH[HTC]} [W/(m^2 K)]", GRAY: str(TRUTH[GRAY])})
    run = td.simulate(truth, room, times=times)["case"].celsius
    noisy = run + 0.05 * np.random.default_rng(seed).standard_normal(times.size)
    channels = {
        "T": Channel.from_array("T", noisy, unit="degC", role="node", target="case", noise=0.05),
        "ROOM": Channel.from_array("ROOM", np.full(times.size, 20.0), unit="degC", role="boundary", target="air"),
        "P": Channel.from_array("P", np.full(times.size, 5.0), quantity="power", role="load", target="heat", prompt=True),
    }
    return Record.from_arrays(name, times, channels, synthetic=False)


PUMPED = td.simulation.Environment({"times": ["0 [h]", "1 [h]", "4 [h]"], "values": ["1 [atm]", "20 [Pa]", "20 [Pa]"]})
GASES = {"air": td.simulation.Environment(), "thin": THIN, "held_out": PUMPED}


@pytest.fixture(scope="module")
def records() -> dict[str, Record]:
    return {name: measured(name, gas, seed) for seed, (name, gas) in enumerate(GASES.items())}


@pytest.fixture(scope="module")
def project(records: dict[str, Record], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gas")
    save_model(box(), folder / "box.toml")
    for name, record in records.items():
        columns = [
            record.times,
            record["T"].values - 273.15,
            record["ROOM"].values - 273.15,
            record["P"].values,
            GASES[name].pressure.at(record.times),
        ]
        np.savetxt(folder / f"{name}.csv", np.column_stack(columns), delimiter=",", header="time_s,T,ROOM,P,GAUGE", comments="")
    shutil.copy(folder / "held_out.csv", folder / "meter.csv")
    (folder / "campaign.toml").write_text(CAMPAIGN)
    return folder / "campaign.toml"


def test_two_pressures_separate_gas_and_radiation_and_a_verdict_runs_in_the_gas_of_its_record(project: Path) -> None:
    findings, inputs = check_campaign(project)
    assert not [f for f in findings if f.severity == "error"]
    assert "gas       *: 0.1 Pa" in str(inputs["box"])
    campaign = td.run_stages(project)
    fit = campaign["box"]
    assert fit.standing.fair
    for path, truth in TRUTH.items():
        assert abs(fit[path].value - truth) < 4.0 * fit[path].error
        assert fit[path].error < 0.03 * truth
    (verdict,) = campaign.verdicts
    assert verdict.passed
    test = RunningTest.of_campaign(campaign, "thin")
    assert test.conditions(campaign.source.record("thin")).environment == {"*": THIN}
    silent = project.with_name("silent.toml")
    silent.write_text("\n".join(line for line in CAMPAIGN.splitlines() if not line.startswith("environment")))
    blind = td.run_stages(silent)
    assert not blind["box"].standing.fair
    said = find_mistakes(blind["box"].request).lines()  # of a node with one heater, a draught in the other record does the same
    assert any("'thin'" in line for line in said)
    assert not all(v.passed for v in blind.verdicts)


def test_python_states_it_with_the_record(records: dict[str, Record]) -> None:
    air, thin = (records[n] for n in ("air", "thin"))
    stated = thin.with_environment({"*": THIN})
    by_record = td.calibrate(box(), [air, stated], [HTC, GRAY])
    by_scenario = td.calibrate(box(), [air, thin], [HTC, GRAY], scenario={"thin": td.Scenario("chamber", environment={"*": THIN})})
    assert by_record[HTC].value == by_scenario[HTC].value
    assert stated.trim("1 [h]").resample("5 [min]").environment == {"*": THIN}
    meter = replace(stated.select("P"), name="meter")
    rest = thin.select("T", "ROOM")
    assert rest.joined(meter).environment == {"*": THIN}
    with raises_code("value.excludes-another", RecordError, match=r"'\*'.*air at 5 Pa; air at 0\.1 Pa"):
        rest.with_environment({"*": td.simulation.Environment("5 [Pa]")}).joined(meter)
    both = {"thin": td.Scenario("chamber", environment={"*": td.simulation.Environment("5 [Pa]")})}
    with raises_code("value.excludes-another", RecordError, match=r"'thin', environment\.\*.*0\.1 Pa.*'chamber'.*5 Pa"):
        td.calibrate(box(), [air, stated], [HTC], scenario=both)
    with raises_code("value.wrong-kind", RecordError, match=r"td\.simulation\.Environment"):
        thin.with_environment({"*": {"pressure": "0.1 [Pa]"}})


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('environment = { "*"', 'environment = { "airr"', r"'airr'.* 'air'"),
        ("0.1 [Pa]", "-0.1 [Pa]", r"records\.thin\.environment\.\*"),
        ("GAUGE", "GAGUE", r"records\.held_out\.environment\.air.*'GAGUE'.*'GAUGE'"),
    ],
)
def test_check_names_a_gas_that_cannot_be(project: Path, old: str, new: str, words: str) -> None:
    wrong = project.with_name("wrong.toml")
    wrong.write_text(CAMPAIGN.replace(old, new))
    assert [f for f in check_campaign(wrong)[0] if f.severity == "error" and re.search(words, f"{f.where} {f.message}")]


def test_a_gas_in_the_scenario_of_a_stage_is_sent_to_the_record(project: Path) -> None:
    wrong = project.with_name("stage.toml")
    wrong.write_text(CAMPAIGN.replace("free = [", 'scenario = { environment = { "*" = { pressure = "1 [Pa]" } } }\nfree = ['))
    with raises_code("file.unknown-key", DeckError, match=r"'environment'.* \[records\.NAME\]"):
        check_campaign(wrong)
