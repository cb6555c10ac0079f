"""No output of any command destroys a file that it reads, or one that thermid did not write there before."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import get_type_hints

import pytest
from typer.main import get_command

from thermid.app.cli.app import COMMANDS, app
from thermid.base.errors import ScenarioError
from thermid.interop.decks import read_sinda
from thermid.model.tree import save_model
from torture.seeds import SINDA
from unit.app.cli.conftest import Call
from unit.fit.project import make_project
from unit.qualify.project import PLAN, project

pytestmark = pytest.mark.usefixtures("board")

SCENARIO = 'title = "warm"\nstart = "24 [degC]"\nduration = "10 [min]"\n\n[boundaries]\n{} = "24 [degC]"\n'
SCRIPT = "m = 1.25; % mass [kg]\n"
QUESTION = 'model = "box.toml"\nscenario = "warm.toml"\nmembers = 40\n[limits]\ncase = "60 [degC]"\n[spread]\n"scale.heat" = "5 [%]"\n'
UNIT = """
[records.{0}]
file     = "logs/box_bench.csv"
time     = "time_s"
channels = {{ T_A = {{ node = "case", noise = "0.05 [K]", accuracy = "0.3 [K]" }}, ROOM = {{ boundary = "air" }} }}
"""
STAGE = '\n[[stages]]\nname = "box"\nmodel = "box.toml"\nrecords = ["p", "q", "r"]\nfree = ["skin.effective_htc"]\n\n[fleet.units]\n'
FLEET = "\n".join(['title = "boxes"', *map(UNIT.format, "pqr"), STAGE, *(f'{n} = {{ records = ["{n}"] }}' for n in "pqr"), ""])
FREE = {
    "limits.toml": '[limits.processor]\nnode = "case"\noperating = ["-20 [degC]", "70 [degC]"]\n',
    "heaters.toml": '[[steps]]\nat = "0 [s]"\nduty = { a = 50 }\n',
    "sensors.toml": '[sensors.T1]\nrom = "28FF641E0F000001"\n',
    "weather.csv": "time,dry_bulb\n2026-03-21T06:00,20\n2026-03-21T07:00,21\n2026-03-21T08:00,22\n",
    "tune.m": SCRIPT,
    "by_hand.values.toml": 'schema = 1\nstage = "box"\n',
    "again.csv": "time_s,T [degC]\n0,20\n10,21\n20,22\n0,20\n10,21\n20,22\n",
    "notes.txt": "what I saw in the laboratory\n",
    "net.cc": SINDA,
    "fleet.toml": FLEET,
    "knobs.cc": "HEADER REGISTER DATA\nmcp = 100.0\n" + SINDA.replace("100.0", "mcp"),
}


def laboratory(folder: Path) -> None:
    """Make a folder with a file of every kind that a command reads."""
    make_project(folder)
    project(folder, PLAN)
    for name, text in FREE.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "warm.toml").write_text(SCENARIO.format("air"), encoding="utf-8")
    (folder / "pair_warm.toml").write_text(SCENARIO.format("room"), encoding="utf-8")
    (folder / "hold.toml").write_text(QUESTION, encoding="utf-8")
    save_model(read_sinda(folder / "knobs.cc").model(), folder / "knobs.toml")
    for deck in (folder / name for name in ("knobs.toml", "MAIN.toml", "unit.toml")):
        deck.write_text("# changed by hand\n" + deck.read_text(encoding="utf-8"), encoding="utf-8")


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Such a folder, the working directory of every command here."""
    folder = tmp_path_factory.mktemp("bench")
    laboratory(folder)
    before = Path.cwd()
    os.chdir(folder)
    yield folder
    os.chdir(before)


OUTPUTS = {
    "simulate --csv": ["simulate", "box.toml", "--scenario", "warm.toml", "--csv"],
    "simulate --netcdf": ["simulate", "pair.toml", "--scenario", "pair_warm.toml", "--netcdf"],
    "export --as octave": ["export", "box.toml", "--scenario", "warm.toml", "--to"],
    "export --as c": ["export", "box.toml", "--scenario", "warm.toml", "--as", "c", "--to"],
    "export --as modelica": ["export", "box.toml", "--scenario", "warm.toml", "--as", "modelica", "--to"],
    "export --as spice": ["export", "box.toml", "--scenario", "warm.toml", "--as", "spice", "--to"],
    "export --as sinda": ["export", "box.toml", "--scenario", "warm.toml", "--as", "sinda", "--to"],
    "export --as esatan": ["export", "box.toml", "--scenario", "warm.toml", "--as", "esatan", "--to"],
    "export --as fmu": ["export", "box.toml", "--scenario", "warm.toml", "--as", "fmu", "--to"],
    "import of SINDA": ["import", "net.cc", "--to"],
    "init": ["init", "logs/pair_one.csv", "--to"],
    "example": ["example", "box", "--to"],
    "calibrate": ["calibrate", "campaign.toml", "--to"],
    "equations": ["equations", "box.toml", "--to"],
    "import": ["import", "tune.m", "--to"],
    "diagram": ["diagram", "pair.toml", "--to"],
    "profile --save": ["profile", "SMC", "unit thermal cycle", "--lowest", "-5", "--highest", "40", "--save"],
    "profile --csv": ["profile", "SMC", "unit thermal cycle", "--lowest", "-5", "--highest", "40", "--on", "box.toml", "--csv"],
    "profile --picture": ["profile", "SMC", "unit thermal cycle", "--lowest", "-5", "--highest", "40", "--on", "box.toml", "--picture"],
    "correlate": ["correlate", "logs/pair_one.csv", "logs/pair_two.csv", "--to"],
    "credibility": ["credibility", "campaign.toml", "--results", "r", "--to"],
    "predict": ["predict", "campaign.toml", "--scenario", "pair_warm.toml", "--results", "r", "--csv"],
    "report": ["report", "campaign.toml", "--results", "r", "--to"],
    "qualify": ["qualify", "plan.toml", "--to"],
    "hold --figure": ["hold", "hold.toml", "--to", "r", "--figure"],
    "deliver": ["deliver", "box.toml", "--scenario", "warm.toml", "--to"],
    "log": ["log", "--for", "2 [s]"],
    "look": ["look", "logs/pair_one.csv", "--svg"],
    "look --cut": ["look", "again.csv", "--cut"],
    "look --join": ["look", "logs/pair_one.csv", "logs/box_bench.csv", "--offset", "0", "--join"],
    "import --scenario": ["import", "net.cc", "--scenario"],
    "write-back": ["write-back", "knobs.cc", "knobs.toml", "--param", "mcp=90", "--to"],
    "swap": ["swap", "campaign.toml", "a", "cool.toml", "--results", "r", "--new-data", "logs", "--to"],
    "hold": ["hold", "hold.toml", "--job"],
    "calibrate --job": ["calibrate", "campaign.toml", "--job"],
    "report --job": ["report", "campaign.toml", "--to", "new.html", "--job"],
    "criticise --job": ["criticise", "campaign.toml", "--job"],
    "improve --job": ["improve", "campaign.toml", "--job"],
    "identify --job": ["identify", "campaign.toml", "--job"],
    "estimate --job": ["estimate", "campaign.toml", "--noise", "case=free", "--job"],
    "swap --job": ["swap", "campaign.toml", "a", "cool.toml", "--job"],
    "predict --job": ["predict", "campaign.toml", "--scenario", "pair_warm.toml", "--job"],
    "credibility --job": ["credibility", "campaign.toml", "--job"],
    "plausibility --job": ["plausibility", "campaign.toml", "--job"],
    "fleet --job": ["fleet", "fleet.toml", "--scenario", "warm.toml", "--job"],
    "report --results": ["report", "campaign.toml", "--to", "new.html", "--results"],
}
READ = frozenset(
    (
        *("data", "originals", "results", "scenario", "values", "log", "logs", "new_data", "measured", "simulated"),
        *("sensors", "programme", "model", "on", "deck", "file", "campaign", "question", "old", "new"),
    )
)
"""Names of options and arguments that a command only reads."""
ALSO_WRITTEN = (("log", "file"), ("report", "results"))
"""Those of them that a command writes."""
ENDINGS = {
    "diagram": ".svg",
    "look": ".svg",
    "look --join": ".csv",
    "export --as fmu": ".fmu",
    "hold --figure": ".png",
    "profile --picture": ".pdf",
}
FOLDERS = ("init", "example", "calibrate")
"""What writes a folder; aimed at a file it is refused."""
TWICE = (
    "simulate --csv",
    "simulate --netcdf",
    "export --as octave",
    "export --as spice",
    "import",
    "diagram",
    "profile --save",
    "correlate",
)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file() and not p.is_symlink()}


def aimed(call: Call, bench: Path, output: str, every: int) -> int:
    """Aim an output at the files of the bench by name, full path, hard link and symbolic link; return how many runs were refused."""
    before, refused, at = contents(bench), 0, list(OUTPUTS).index(output)
    assert len(before) >= 19
    twin, link = (bench / f"{word}{ENDINGS.get(output, '.csv')}" for word in ("twin", "link"))
    for k, name in enumerate(before):
        os.link(bench / name, twin)
        link.symlink_to(name)
        for j, target in enumerate((name, bench / name, twin.name, link.name)):
            if (4 * k + j + at) % every:
                continue
            said = call(*OUTPUTS[output], target)
            assert said.code == 2, f"{output} {target} ({name}): {said.out}{said.err}"
            assert said.err.startswith("error: ")
            refused += 1
        link.unlink()
        twin.unlink()
    assert contents(bench) == before
    return refused


@pytest.mark.parametrize("output", OUTPUTS)
def test_no_output_destroys_an_input(call: Call, bench: Path, output: str) -> None:
    assert aimed(call, bench, output, 29) >= 2


def written() -> set[tuple[str, str]]:
    """Command and option, or argument, of everything that a command is given a path for and does not only read."""
    found, whole = set(), get_command(app)
    for word, place in COMMANDS.items():
        module, _, function = place.function.partition(".")
        kinds = get_type_hints(getattr(import_module(f"thermid.app.cli.{module}"), function))
        for given in whole.commands[word].loaded().params:  # type: ignore[attr-defined]
            if "Path" in str(kinds.get(given.name)) and (given.name not in READ or (word, given.name) in ALSO_WRITTEN):
                found.add((word, given.opts[0] if given.opts[0].startswith("-") else ""))
    return found


def test_every_output_of_the_command_line_is_aimed() -> None:
    """A new option that writes a file, or a new command, fails here until it is aimed at inputs too."""
    covered = {(words[0], words[-1] if words[-1].startswith("--") and words[0] != "log" else "") for words in OUTPUTS.values()}
    assert written() == covered


@pytest.mark.campaign
@pytest.mark.parametrize("output", OUTPUTS)
def test_no_output_destroys_any_input_by_any_name(call: Call, bench: Path, output: str) -> None:
    assert aimed(call, bench, output, 1) >= 76


@pytest.mark.campaign
@pytest.mark.parametrize("output", [o for o in OUTPUTS if o not in FOLDERS])
def test_every_one_of_these_commands_can_write(call: Call, bench: Path, output: str, tmp_path: Path) -> None:
    target = tmp_path / f"made{ENDINGS.get(output, '')}"
    said = call(*OUTPUTS[output], target)
    assert said.code in (0, 1, 4, 5), said.err
    assert target.exists()
    shutil.rmtree("r", ignore_errors=True)


@pytest.mark.parametrize(
    "command", ["calibrate", "report", "identify", "estimate", "swap", "predict", "credibility", "criticise", "plausibility"]
)
def test_stages_are_fitted_by_the_workers_that_are_asked_for(
    call: Call, bench: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    def run(*_: object, executor: object, **__: object) -> None:
        asked.append(executor)
        raise ScenarioError("stop here")

    for module in ("thermid.app.cli.summary", "thermid.campaign._survey"):
        monkeypatch.setattr(f"{module}.run_stages", run)
    words = OUTPUTS[f"{command} --job"][:-1] + ["--after"] * (command == "identify")
    assert call(*words, "--workers", "3").code == 2
    assert call(*words, "--cluster", "tcp://127.0.0.1:1", "--job", "jobs").code == 2
    shutil.rmtree("jobs")
    assert (asked[0], asked[1].folder, asked[1].workers) == (3, Path("jobs"), "tcp://127.0.0.1:1")  # type: ignore[attr-defined]


def test_folders_of_results_hold_what_others_wrote(call: Call, bench: Path) -> None:
    before = contents(bench)
    for k, name in enumerate(before):
        put = os.link if k % 2 else os.symlink
        file = ("box.values.toml", "pair.values.toml")[k // 2 % 2]
        Path("r").mkdir()
        put(bench / name, f"r/{file}")
        said = call("calibrate", "campaign.toml", "--to", "r")
        assert (said.code, file in said.err) == (2, True), f"{file} is {name}: {said.out}{said.err}"
        shutil.rmtree("r")
    shutil.copy("logs/pair_one.csv", "plan.lock.json")
    assert call("plan", "plan.toml", "--lock").code == 2
    assert Path("plan.lock.json").read_bytes() == before["logs/pair_one.csv"]
    Path("plan.lock.json").unlink()
    assert contents(bench) == before


def test_copies_are_not_written_over_what_they_are_copies_of(call: Call, bench: Path) -> None:
    before = contents(bench)
    for folder in (".", bench, bench / "logs/.."):
        said = call(*OUTPUTS["write-back"], folder)
        assert (said.code, "knobs.cc" in said.err) == (2, True)
    assert contents(bench) == before


@pytest.mark.parametrize("output", TWICE)
def test_the_same_command_again_needs_no_force(call: Call, bench: Path, output: str, tmp_path: Path) -> None:
    target = tmp_path / f"made{ENDINGS.get(output, '')}"
    for _ in range(2):
        said = call(*OUTPUTS[output], target)
        assert said.code in (0, 1), said.err
    whole = target.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == [target.name]
    target.write_bytes(b"% by hand\n" + whole)
    refused = call(*OUTPUTS[output], target)
    assert (refused.code, "--force" in refused.err) == (2, True)
    assert target.read_bytes() == b"% by hand\n" + whole
    assert call(*OUTPUTS[output], target, "--force").code == said.code
    assert target.stat().st_size == pytest.approx(len(whole), abs=4000 if output == "simulate --netcdf" else 20)


def test_what_a_command_reads_is_refused_even_if_thermid_wrote_it(call: Call, bench: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    assert call("profile", "SMC", "unit thermal cycle", "--save", own).code == 0
    before = own.read_bytes()
    said = call("profile", own, "--set", "cycles=2", "--save", own)
    assert said.code == 2
    assert said.codes == ("output.over-input",)
    assert own.read_bytes() == before
    assert call("profile", own, "--set", "cycles=2", "--save", own, "--force").code == 0
    assert own.read_bytes() != before
