"""Every file that a command writes is read by every command whose help names its kind; the others refuse it in one sentence."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from unit.app.cli.conftest import Call
from unit.app.cli.test_outputs import FOLDERS, OUTPUTS, laboratory

pytestmark = pytest.mark.usefixtures("board")

LOGS = {"look", "settle", "watch"}
DECKS = {"check", "simulate", "steady", "compare", "diagram", "export", "deliver", "equations"}
CAMPAIGNS = {"check", "identify", "calibrate", "report", "credibility", "improve", "plausibility", "criticise"}
READ_BY = {
    "simulate --csv": LOGS,
    "simulate --netcdf": LOGS,
    "export --as sinda": {"import"},
    "export --as esatan": {"import"},
    "init/campaign.toml": CAMPAIGNS,
    "init/pair_one.toml": {"check", "compare", "diagram", "equations"},
    "init/logs/fit.csv": LOGS,
    "init/logs/holdout.csv": LOGS,
    "calibrate/box.values.toml": {"--values"},
    "import": {"check"},
    "profile --save": {"profile"},
    "profile --csv": LOGS,
    "predict": LOGS,
    "deliver/full/model.toml": DECKS,
    "deliver/scenarios/warm.toml": {"--scenario"},
    "log": {"look", "watch"},
    "write-back/knobs.cc": {"import"},
    "swap/box.values.toml": {"--values"},
}
"""Output, of a folder with the file in it -> who reads it; a log of two seconds is too short to settle."""
READERS = {
    "look": ["look", "@"],
    "settle": ["settle", "@"],
    "watch": ["watch", "@", "--look", "once"],
    "correlate": ["correlate", "@", "logs/pair_two.csv"],
    "check": ["check", "@"],
    "simulate": ["simulate", "@", "--scenario", "warm.toml"],
    "steady": ["steady", "@", "--scenario", "warm.toml"],
    "export": ["export", "@", "--scenario", "warm.toml"],
    "moisture": ["moisture", "@", "--scenario", "warm.toml"],
    "deliver": ["deliver", "@", "--scenario", "warm.toml", "--to", "delivered"],
    "diagram": ["diagram", "@", "--to", "drawn.svg"],
    "compare": ["compare", "@", "box.toml"],
    "equations": ["equations", "@"],
    "watch --model": ["watch", "logs/pair_one.csv", "--look", "once", "--model", "@"],
    "--scenario": ["simulate", "box.toml", "--scenario", "@"],
    "--values": ["simulate", "box.toml", "--scenario", "warm.toml", "--values", "@"],
    "plan": ["plan", "@"],
    "qualify": ["qualify", "@"],
    "hold": ["hold", "@"],
    "profile": ["profile", "@"],
    "import": ["import", "@"],
    **{word: [word, "@"] for word in ("identify", "calibrate", "credibility", "improve", "plausibility", "criticise", "fleet")},
    "report": ["report", "@", "--to", "reported.html"],
    "swap": ["swap", "@", "a", "cool.toml"],
    "--programme": ["log", "logged.csv", "--for", "2 [s]", "--programme", "@"],
    "--sensors": ["log", "logged.csv", "--for", "2 [s]", "--sensors", "@"],
}
ENDINGS = {"--netcdf": ".nc", "sinda": ".cc", "esatan": ".d", "c": ".h", "look": ".svg", "diagram": ".svg", "fmu": ".fmu"}
ENDINGS |= {"--figure": ".png", "--picture": ".pdf", **dict.fromkeys(("import", "--save", "--scenario"), ".toml"), "credibility": ".json"}
ENDINGS |= dict.fromkeys(("correlate", "report", "qualify"), ".html")
HOLDS = (*FOLDERS, "deliver", "write-back", "swap")
"""What writes a folder."""
NOTHING = ("import of SINDA", "example", "hold", "report --results", "look --cut")
"""What needs a deck of another kind, cuts nothing here, or writes over what is here or a folder of pieces."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a file of every kind, the working directory of every command here."""
    folder, before = tmp_path_factory.mktemp("written"), Path.cwd()
    laboratory(folder)
    os.chdir(folder)
    yield folder
    os.chdir(before)


def refused_in_one_sentence(said: str) -> bool:
    """Whether a command said one error, without a list of faults."""
    return said.startswith("error: ") and said.strip().count("\n") == 0 and len(said) < 450


def ways_of(call: Call, name: str) -> list[str]:
    """Give what one output writes to every reader, but the empty mark of a project; return what was not as it should be."""
    place = Path("written_" + re.sub(r"\W+", "_", name)).with_suffix("" if name in HOLDS else ENDINGS.get(name.split()[-1], ".csv"))
    made = call(*OUTPUTS[name], place)
    assert place.exists(), made.err
    out = []
    for file in sorted(p for p in place.rglob("*") if p.is_file() and p.name != "thermid.toml") if place.is_dir() else [place]:
        named = f"{name}/{file.relative_to(place).as_posix()}" if place.is_dir() else name
        for reader, words in READERS.items():
            said = call(*(str(file) if w == "@" else w for w in words))
            if said.code == 2 and not refused_in_one_sentence(said.err):
                out.append(f"{reader} of {named}: {said.err[:200]}")
            if said.code == 2 and reader in READ_BY.get(named, ()):
                out.append(f"{reader} does not read {named}: {said.err[:200]}")
    return out


@pytest.mark.parametrize(
    "name", [n if n == "credibility" else pytest.param(n, marks=pytest.mark.campaign) for n in OUTPUTS if n not in NOTHING]
)
def test_what_a_command_writes_is_read_or_refused_in_one_sentence(call: Call, bench: Path, name: str) -> None:
    assert ways_of(call, name) == []
