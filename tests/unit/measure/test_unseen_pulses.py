"""A power that is switched faster than its log reads it: pulses between two readings were not seen, and nothing said so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import thermid as td
from thermid.app.cli.app import app
from thermid.base.errors import code_of
from thermid.campaign.stages import check_campaign

CODE = "record.unseen-pulses"
CHANNELS = {"T": {"node": "case", "noise": "0.05 [K]"}, "ROOM": {"boundary": "air"}, "P": {"load": "heat"}}
DECK = """
title = "box"
needs = ["air"]
nodes.case.capacitance = "300 [J/K]"
surfaces.skin = { of = "case", to = "air", area = "0.03 [m^2]", effective_htc = "10 [W/(m^2 K)]" }
loads.heat = { into = "case", power = "20 [W]" }
"""
CAMPAIGN = """
title = "pulses"
[records.log]
file = "log.csv"
channels = { T = { node = "case", noise = "0.05 [K]" }, ROOM = { boundary = "air" }, P = { load = "heat" } }
[[stages]]
name = "only"
model = "box.toml"
records = ["log"]
free = ["skin.effective_htc"]
"""


def pulses(on: float, off: float, every: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return times and readings of a heater of 20 W whose phases vary by a second, and its temperature, over three hours."""
    phases = np.tile([off, on], int(10800.0 / (on + off)) + 1)
    phases = phases + np.random.default_rng(seed).normal(0.0, 1.0, phases.size)
    fine = np.arange(0.0, 10800.0)
    watts = 20.0 * (np.searchsorted(np.cumsum(phases), fine, side="right") % 2)
    warm = [0.0]
    for power in watts[:-1]:
        warm.append(warm[-1] + (power - 0.3 * warm[-1]) / 300.0)
    kept = fine % every == 0.0
    return fine[kept], np.column_stack([watts[kept], 21.0 + np.array(warm)[kept]])


def write(path: Path, on: float, off: float, every: float, seed: int = 1) -> Path:
    """Write the log of such a heater."""
    times, columns = pulses(on, off, every, seed)
    noise = np.random.default_rng(seed).normal(0.0, 0.03, times.size)
    rows = [f"{t:g},{c + e:.3f},21.00,{p:g}" for t, (p, c), e in zip(times, columns, noise, strict=True)]
    path.write_text("\n".join(["time_s,T [degC],ROOM [degC],P [W]", *rows]) + "\n")
    return path


@pytest.mark.parametrize(("on", "off", "every"), [(20.0, 40.0, 30.0), (40.0, 20.0, 30.0), (7.0, 31.0, 20.0), (25.0, 26.0, 30.0)])
def test_pulses_that_fall_between_readings_are_named_by_all_readers(tmp_path: Path, on: float, off: float, every: float) -> None:
    path = write(tmp_path / "log.csv", on, off, every)
    record = td.read_record(path, CHANNELS)
    times, columns = pulses(on, off, every)
    frame = {"P": td.Channel.from_array("P", columns[:, 0], unit="W", quantity="power", role="load", target="heat")}
    for seen in (td.look(path), record, td.Record.from_arrays("frame", times, frame)):
        assert [code_of(question) for question in seen.questions] == [CODE]


@pytest.mark.parametrize(("on", "off", "every"), [(20.0, 40.0, 10.0), (50.0, 73.0, 30.0), (42.0, 50.0, 30.0), (3600.0, 3600.0, 60.0)])
@pytest.mark.parametrize("seed", range(3))
def test_a_log_that_sees_every_pulse_leaves_nothing_open(tmp_path: Path, on: float, off: float, every: float, seed: int) -> None:
    """Changes of an on/off heater lie between its samples, so the lines for a campaign have a fit find them."""
    seen = td.look(write(tmp_path / "log.csv", on, off, every, seed))
    assert seen.questions == ()
    assert ("prompt = false" in seen.campaign()) is (on < 3600.0)


@pytest.mark.parametrize(
    "readings",
    [
        lambda r: 5.0 + 0.01 * r.integers(0, 2, 300),
        lambda r: 5.0 + 0.05 * r.standard_normal(300),
        lambda r: r.uniform(0.0, 20.0, 300),
        lambda r: 20.0 * np.clip(r.normal(0.4, 0.15, 300), 0.0, 1.0),
        lambda r: np.repeat([0.0, 60.0, 29.93], [60, 480, 180]) + 0.05 * r.standard_normal(720),
    ],
    ids=["last digit", "noise", "a computer", "means", "a level in the middle"],
)
def test_other_powers_that_change_at_every_reading_are_no_pulses(readings) -> None:  # type: ignore[no-untyped-def]
    channel = td.Channel.from_array("P", readings(np.random.default_rng(3)), unit="W", quantity="power", role="load", target="heat")
    assert td.Record.from_arrays("log", 30.0 * np.arange(channel.values.size), {"P": channel}).questions == ()


def test_a_log_with_a_row_at_every_change_and_one_of_means_are_right(tmp_path: Path) -> None:
    times = np.cumsum(np.tile([20.0, 40.0], 100))
    by_change = td.Channel.from_array("P", np.tile([0.0, 20.0], 100), unit="W", quantity="power", role="load", target="heat")
    assert td.Record.from_arrays("by change", times, {"P": by_change}).questions == ()
    path = write(tmp_path / "log.csv", 20.0, 40.0, 30.0)
    for stated in ({"prompt": True}, {"prompt": False}, {"samples": "average"}):
        assert td.read_record(path, {**CHANNELS, "P": {"load": "heat", **stated}}).questions == ()


def test_look_check_and_calibrate_name_it_first(tmp_path: Path) -> None:
    write(tmp_path / "log.csv", 20.0, 40.0, 30.0)
    (tmp_path / "box.toml").write_text(DECK)
    file = tmp_path / "c.toml"
    file.write_text(CAMPAIGN)
    (question,) = td.read_record(tmp_path / "log.csv", CHANNELS).questions
    assert check_campaign(file)[0][0].code == CODE
    assert CODE in [code_of(w) for w in td.run_stages(file).stages["only"].warnings]
    for command in ("look", "check", "calibrate"):
        said = CliRunner().invoke(app, [command, str(tmp_path / "log.csv" if command == "look" else file)]).stdout.split("\n")
        assert next(k for k, line in enumerate(said) if question[:40] in line) <= 1 + (command == "calibrate"), said[:5]
