"""Every file is read by every reader that names its kind, and refused by the others in one sentence that says what is wrong."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError
from thermid.base.files import file_kinds
from thermid.bench.bench_files import load_programme, load_sensors
from thermid.campaign.stages import CampaignSource, load_limits
from thermid.interop.decks import read_sinda
from thermid.interop.initfcn import read_initfcn
from thermid.measure.readers import read_plain
from thermid.values.store import hand_values
from torture.seeds import KINDS, LOGS, make

READERS: dict[str, tuple[Callable[[Path], Any], tuple[str, ...]]] = {
    "check, simulate, steady": (td.load_model, ("deck", "deck of elements", "surfaces in orbit")),
    "--scenario": (td.load_scenario, ("scenario", "orbit", "surroundings")),
    "calibrate, check": (CampaignSource.read, ("campaign",)),
    "load_study": (td.design.load_study, ("study",)),
    "plan, qualify": (td.qualify.load_plan, ("plan",)),
    "a plan's lock": (lambda f: td.qualify.load_plan(f.with_name("plan.toml")).lock_status(), ("lock",)),
    "--limits": (load_limits, ("limits",)),
    "hold": (td.qualify.load_hold, ("hold",)),
    "profile": (td.qualify.load_profile, ("profile",)),
    "--values": (lambda f: hand_values(f, td.load_model(f.parent / "unit.toml"), "s", "here"), ("values", "values by hand")),
    "--sensors": (load_sensors, ("sensor map",)),
    "--programme": (load_programme, ("programme",)),
    "look, init, settle": (read_plain, (*LOGS, "weather", "trajectory")),
    "import": (read_sinda, ("deck of SINDA",)),
    "import of a script": (read_initfcn, ("script",)),
}
"""Reader, named after the commands and options that use it -> the kinds that it reads."""
FILES = {kind: of.file for kind, of in KINDS.items()} | {"surfaces in orbit": "cube.toml"}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kinds")
    make(folder)
    return folder


@pytest.mark.parametrize("reader", READERS)
def test_a_file_is_read_by_the_readers_of_its_kind_and_refused_by_others_in_one_sentence(project: Path, reader: str) -> None:
    read, reads = READERS[reader]
    for kind, file in FILES.items():
        path = project / file
        if kind in reads:
            read(path)
            continue
        if reader == "a plan's lock" or (reader.startswith("look") and kind == "script"):
            continue  # a lock lies beside its plan, under a name that is not given; two lines of a script make a table without times
        with pytest.raises(ThermidError) as raised:
            read(path)
        text = str(raised.value)
        assert "\n" not in text, (reader, kind, text)
        assert len(text) < 300, (reader, kind, text)
        assert os.path.basename(file) in text, (reader, kind, text)


def test_every_kind_with_a_grammar_has_a_reader_here() -> None:
    """A kind of file that somebody adds stands in this table too."""
    words = {"sensors": "sensor map", "looks": "looks", "delivery": ""}
    assert {words.get(kind, kind) for kind in file_kinds()} - {"", *FILES} == set()
    assert {kind for _, reads in READERS.values() for kind in reads} | {"looks", "kept fit"} == {*FILES}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('title = "x"\n[nodes]\na = {}\n', "this is a deck, not a scenario."),
        ("stages = []\n[records]\n", "this is a campaign, not a scenario."),
        ('[values]\n"a.b" = "1 [W/K]"\n', "this is a file of values, not a scenario."),
        ('[case]\nnode = "case"\noperating = ["0 [degC]", "50 [degC]"]\n', "this is a file of limits, not a scenario."),
        ('steps = [{ at = "0 [s]", heater1 = 1 }]\n', "this is a programme, not a scenario."),
    ],
)
def test_a_file_is_named_by_what_it_is(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ThermidError) as raised:
        td.load_scenario(tmp_path / "x.toml")
    assert str(raised.value).startswith(f"x.toml: {said}")
    assert raised.value.code == "file.another-kind"


def test_a_misspelt_key_is_still_a_misspelt_key(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text('title = "x"\nduratoin = "1 [h]"\nstart = "20 [degC]"\nboundaries = {}\n', encoding="utf-8")
    with raises_code("file.unknown-key", match="'duratoin'.*'duration'"):
        td.load_scenario(tmp_path / "x.toml")
