"""What a new process loads before it answers: light things first, the heavy libraries only when they are needed."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from by_code import raises_code
from thermid.app.cli.app import COMMANDS, OnDemand
from thermid.base.errors import ThermidError

NEVER = {"scipy", "pandas", "matplotlib", "pint", "xarray", "jinja2", "h5py", "h5netcdf", "hypothesis"}
"""Nothing on the way to a first result needs these."""
HELP = "from thermid.app.cli import main\nsys.argv = ['thermid', '--help']\ntry:\n    main()\nexcept SystemExit:\n    pass"
RESULT = """
import thermid as td
deck = {"title": "x", "needs": ["air"], "nodes": {"a": {"capacitance": "9 [J/K]"}}, "loads": {"p": {"into": "a", "power": "1 [W]"}},
        "conductors": {"g": {"kind": "conduction", "between": ["a", "air"], "conductance": "1 [W/K]"}}}
assert td.simulate(td.model_from_dict(deck), td.Scenario("s", boundaries={"air": "20 [degC]"}, duration=60.0))["a"].final > 20
"""

DECK = """
title = "x"
needs = ["air"]
[nodes]
a = { capacitance = "9 [J/K]" }
[surfaces]
skin = { of = "a", to = "air", area = "0.1 [m^2]", effective_htc = "5 [W/(m^2 K)]" }
"""


def loaded(code: str) -> set[str]:
    """Names of the packages that a fresh interpreter holds after running `code`."""
    script = f"import sys\nbefore = set(sys.modules)\n{code}\nimport json\nprint(json.dumps(sorted(set(sys.modules) - before)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    names = json.loads(done.stdout.splitlines()[-1])
    return {name.partition(".")[0] for name in names} | {"numpy.ma"}.intersection(names)


def test_what_is_loaded_is_seen() -> None:
    assert "numpy" in loaded("import numpy")


def test_import_loads_the_package_alone() -> None:
    assert not loaded("import thermid") & (NEVER | {"numpy", "pydantic", "tomlkit", "typer", "rich", "threadpoolctl"})


def test_help_loads_no_numbers() -> None:
    assert not loaded(HELP) & (NEVER | {"numpy", "pydantic", "tomlkit", "threadpoolctl"})


def test_a_first_result_needs_numpy_and_the_deck_reader_alone() -> None:
    found = loaded(RESULT)
    assert "numpy" in found
    assert not found & (NEVER | {"typer", "rich", "tomlkit", "numpy.ma"})


def test_a_command_for_a_deck_or_a_log_loads_no_fit_and_no_campaign(tmp_path: Path) -> None:
    """All three in one process: what one of them loads would be there."""
    (tmp_path / "deck.toml").write_text(DECK)
    (tmp_path / "log.csv").write_text("time_s,T1 [degC]\n" + "".join(f"{k},{20 + k % 3}.5\n" for k in range(30)))
    commands = ("simulate deck.toml --boundary air=20 --for 60 --start air", "check deck.toml", "look log.csv")
    start = f"import os\nos.chdir({str(tmp_path)!r})\nfrom thermid.app.cli import main\n"
    runs = "".join(
        f"sys.argv = {['thermid', *words.split()]!r}\ntry:\n    main()\nexcept SystemExit as left:\n    assert not left.code\n"
        for words in commands
    )
    rooms = "sys.modules.update({'room ' + n.split('.')[1]: sys for n in list(sys.modules) if n.startswith('thermid.')})"
    found = loaded(f"{start}{runs}{rooms}")
    assert "room measure" in found
    assert not found & (
        NEVER | {"rich", "tomlkit"} | {f"room {name}" for name in ("fit", "inference", "prediction", "campaign", "qualify")}
    )


def test_help_of_the_whole_says_what_the_help_of_each_command_begins_with() -> None:
    for word, place in COMMANDS.items():
        module, _, function = place.function.partition(".")
        said = inspect.getdoc(getattr(import_module(f"thermid.app.cli.{module}"), function)) or ""
        assert said.partition("\n")[0] == place.summary, word


def test_a_command_without_its_optional_part_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "thermid.app.studio.server", None)
    monkeypatch.delitem(sys.modules, "thermid.app.cli.studio", raising=False)
    with raises_code("extra.not-installed", ThermidError, match="thermid.app.studio.server"):
        OnDemand("studio", COMMANDS["studio"]).loaded()


def test_whether_values_moved_is_judged_without_the_library_of_statistics() -> None:
    """It would take half a second of every `thermid calibrate`; `scipy.special` has the distribution."""
    code = """
import numpy as np
from thermid.fit._uncertainty.moved import normal_together
assert normal_together(np.array([3.0]), np.eye(1)).chance < 0.01
assert "scipy.special" in sys.modules
assert "scipy.stats" not in sys.modules
"""
    assert "scipy" in loaded(code)
