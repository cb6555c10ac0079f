"""`thermid criticise` and `thermid plausibility`: what residuals ask for, and whether values are physical, in text and as an object."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from thermid.campaign._file import CampaignSource

from .conftest import Call

pytestmark = pytest.mark.usefixtures("values_alone")


@pytest.fixture
def lagging(campaign: Path) -> Path:
    """The project with its first log read through a sensor that lags by two minutes."""
    log = campaign.parent / "logs" / "box_bench.csv"
    head, *rows = log.read_text().splitlines()
    seen, out = None, [head]
    for row in rows:
        time, reading, *rest = row.split(",")
        seen = float(reading) if seen is None else seen + 0.4 * (float(reading) - seen)
        out.append(",".join([time, f"{seen:.4f}", *rest]))
    log.write_text("\n".join(out) + "\n")
    return campaign


def test_noise_needs_no_element(fitted_campaign: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    """A hold-out record says nothing of residuals, and stays unopened."""
    opened: set[str] = set()
    bound = CampaignSource.bound
    monkeypatch.setattr(CampaignSource, "bound", lambda source, name, stage: (opened.add(name), bound(source, name, stage))[1])
    said = call("criticise", fitted_campaign, "--stage", "box")
    assert said.code == 0
    assert "1 of 1" in said.out
    assert "candidates, each alone" not in said.out
    assert [v.record for v in CampaignSource.read(fitted_campaign).content.verdicts] == ["pair_two"]
    assert opened == {"box_bench"}  # of the stage that is asked about, and of what it inherits from
    found = call("criticise", fitted_campaign, "--stage", "box", "--json").object["stages"]["box"]
    assert (found["suggested"], found["candidates"], found["traces"][0]["white"]) == (None, [], True)


def test_a_missing_element_is_named_in_text_and_as_an_object(lagging: Path, call: Call, tmp_path: Path) -> None:
    """The second time its refits are read from the job's folder."""
    job = tmp_path / "job"
    said = call("criticise", lagging, "--stage", "box", "--job", job)
    assert "T_A in box_bench: RMSE" in said.out
    assert "  candidates, each alone:" in said.out
    finished = {path: path.stat().st_mtime_ns for path in job.iterdir()}
    assert len(finished) > 1
    found = call("criticise", lagging, "--stage", "box", "--json", "--job", job).object["stages"]["box"]
    assert {path: path.stat().st_mtime_ns for path in job.iterdir()} == finished
    best = max((c for c in found["candidates"] if c["tried"]), key=lambda c: c["evidence"])
    assert best["evidence"] > 10.0
    assert best["name"] in said.out


def test_all_stages_and_one_that_is_not_there(fitted_campaign: Path, call: Call) -> None:
    assert list(call("criticise", fitted_campaign, "--json").object["stages"]) == ["box", "pair"]
    said = call("criticise", fitted_campaign, "--stage", "boxx")
    assert said.code == 2
    assert "name.unknown" in said.codes
    assert "'boxx'" in said.err


def test_values_are_compared_with_what_is_physical(fitted_campaign: Path, call: Call) -> None:
    said = call("plausibility", fitted_campaign, "--stage", "box")
    assert said.out.startswith("box: ")
    assert "skin.effective_htc = " in said.out
    found = call("plausibility", fitted_campaign, "--stage", "box", "--json").object["stages"]["box"]
    assert found["findings"][0]["path"] == "skin.effective_htc"
    assert (said.code == 0) == found["physical"]


def test_a_weight_that_cannot_be_is_not_physical(fitted_campaign: Path, call: Call) -> None:
    said = call("plausibility", fitted_campaign, "--stage", "box", "--weight", "case=20 [g]", "--json")
    assert said.code == 1
    mass = next(f for f in said.object["stages"]["box"]["findings"] if f["path"].endswith("mass"))
    assert mass["verdict"] == "not physical"
    assert "0.02 kg" in mass["meaning"]
    assert call("plausibility", fitted_campaign, "--weight", "case").code == 2


def test_a_capture_is_cut_at_the_restarts_of_its_board(tmp_path: Path, call: Call) -> None:
    rows = [*range(3, 30000, 1000), *range(5, 20000, 1000)]
    (tmp_path / "a.csv").write_text("\n".join(["millis,T1 [degC]", *(f"{n},{22 + 1e-5 * n:.2f}" for n in rows)]) + "\n")
    assert call("look", tmp_path / "a.csv").code == 2
    said = call("look", tmp_path / "a.csv", "--cut", tmp_path / "parts")
    assert said.code == 0
    assert re.match(rf"2 .* {re.escape(str(tmp_path / 'parts'))}$", said.out.splitlines()[-1])
    assert call("look", *(tmp_path / "parts" / f"a_{k}.csv" for k in (1, 2))).code == 0
    assert "record.does-not-apply" in call("look", tmp_path / "parts" / "a_1.csv", "--cut", tmp_path / "more").codes


PARTS = """
title = "cut"

[[stages]]
name     = "unit"
model    = "unit.toml"
records  = ["room"]
free     = ["skin.htc"]

[records.room]
file     = "room.csv"
channels = { ROOM = { boundary = "air" } }
joined   = [{ record = "a_1" }, { record = "a_2", offset = "40 [s]" }, { record = "a_3", offset = "70 [s]" }]

"""
DECK = """
title = "unit"
needs = ["air"]

[nodes]
T_1   = { capacitance = "50 [J/K]" }
T_1_2 = { capacitance = "50 [J/K]" }

[conductors]
joint = { kind = "conduction", between = ["T_1", "T_1_2"], conductance = "1 [W/K]" }

[surfaces]
skin = { of = "T_1", to = "air", area = "0.01 [m^2]", htc = { value = "5 [W/(m^2 K)]", min = 1, max = 20 }, emissivity = 0.5 }
"""


def test_the_lines_printed_for_the_parts_of_a_log_can_be_joined(tmp_path: Path, call: Call) -> None:
    """They named the same channels in every part, which `check` refused."""
    rows = [*range(0, 30000, 500), *range(0, 20000, 500), *range(0, 20000, 500)]
    text = "\n".join(["millis,T_1 [degC],T_1_2 [degC]", *(f"{n},{22 + 0.3 * (k % 3):.2f},23.5" for k, n in enumerate(rows))]) + "\n"
    (tmp_path / "a.csv").write_text(text)
    said = call("look", tmp_path / "a.csv", "--cut", tmp_path).out
    lines = "\n".join(line.removeprefix("    ") for line in said.splitlines() if line.startswith("    "))
    (tmp_path / "room.csv").write_text("time_s,ROOM [degC]\n" + "".join(f"{k},22.1\n" for k in range(100)))
    (tmp_path / "unit.toml").write_text(DECK)
    (tmp_path / "cut.toml").write_text(PARTS + lines)
    checked = call("check", tmp_path / "cut.toml")
    assert checked.code == 0, checked.out
    record = CampaignSource.read(tmp_path / "cut.toml").record("room")
    assert sorted(record.channels) == ["ROOM", "T_1", "T_1_2", "T_1_2_2", "T_1_2_3", "T_1_3", "T_1_4"]
    assert [record.channels[n].target for n in ("T_1", "T_1_3", "T_1_4", "T_1_2_3")] == ["T_1", "T_1", "T_1", "T_1_2"]
    printed = re.findall(r'node = "T_1", noise = "(.*?) \[K\]"', said)
    assert [record.channels[n].noise for n in ("T_1", "T_1_3", "T_1_4")] == [float(text) for text in printed]


CAPTURE = "09:59:59.000 -> 2 x DS18B20\n" + "".join(
    f"10:00:{k:02d}.000 -> T1: {20 + 0.1 * k:.2f} C  T2: {21 + 0.1 * k:.2f} C\n" for k in range(0, 50, 5)
)
SHEET = "Data;Hora;P (W)\n" + "".join(f"20/11/2026;10:00:{k:02d};4,1\n" for k in range(12, 60, 6))


def test_look_shows_the_clocks_of_one_test(tmp_path: Path, call: Call) -> None:
    (tmp_path / "bench.txt").write_text(CAPTURE)
    (tmp_path / "supply.csv").write_text(SHEET)
    (tmp_path / "plain.csv").write_text("time_s,T [degC]\n0,20\n10,21\n20,22\n")
    said = call("look", *(tmp_path / n for n in ("bench.txt", "supply.csv", "plain.csv")))
    assert "3 clocks " in said.out
    assert all(part in said.out for part in ("supply.csv", "12 s", "bench.txt"))
    assert "plain.csv" in said.out
    assert '"supply", offset = ["-288 [s]", "312 [s]"] }' in said.out
    assert '"plain", offset = "... [s]" }' in said.out
    clocks = call("look", tmp_path / "bench.txt", tmp_path / "supply.csv", "--json").object["clocks"]
    assert [(c["record"], c["offset"], c["at"]["error"]) for c in clocks] == [("supply", 12.0, 100.0)]  # the clocks of two computers
    assert "clocks" not in call("look", tmp_path / "bench.txt", "--json").object
    joining = call("look", tmp_path / "bench.txt", tmp_path / "supply.csv", "--join", tmp_path / "both.csv").out
    assert "-288 .. 312 s" in joining.partition("joined log: ")[2]


def test_a_form_of_stamps_is_for_the_log_that_has_it(tmp_path: Path, call: Call) -> None:
    (tmp_path / "board.csv").write_text("ms,T1 [degC]\n" + "".join(f"{1000 * k},{20 + 0.1 * k}\n" for k in range(20)))
    (tmp_path / "supply.csv").write_text("time;U (V)\n" + "".join(f"9h{k:02d};4,1\n" for k in range(12, 60, 6)))
    said = call("look", tmp_path / "board.csv", tmp_path / "supply.csv", "--clock", "%Hh%M", "--json")
    assert (said.code, [one["sampling"]["step"] for one in said.object["logs"]]) == (0, [1.0, 360.0])
    assert call("look", tmp_path / "board.csv", "--clock", "%Hh%M").code == 2


def test_logs_of_one_test_are_joined_on_the_clock_of_the_first(tmp_path: Path, call: Call) -> None:
    board, supply, joined = (tmp_path / n for n in ("board.csv", "supply.csv", "joined.csv"))
    board.write_text("t_s,T1 [degC]\n0,20\n10,-127\n20,22\n30,23\n")
    supply.write_text("t_s,I [A],U [V]\n-5,0,12\n0,2,12\n15,1,\n")
    assert call("look", board, supply, "--join", joined).code == 2
    assert call("look", board, supply, "--join", joined, "--offset", "5").code == 0
    head, *rows = joined.read_text().splitlines()
    assert head.split(",") == ['"time [s]"', "T1 [degC]", "I [A]", "U [V]"]
    assert rows == ["0,20,,", "5,,0,12", "10,,2,12", "20,22,,", "25,,1,", "30,23,,"]
