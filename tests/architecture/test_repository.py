"""Nothing in the repository names the machine it was written on; the locks pin all that the project asks for, and nothing but."""

from __future__ import annotations

import re
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path

import pytest

from .source import ROOT

LOCKS = ("requirements.lock", "requirements-test.lock")
ADDRESS = re.compile(r"://|\bfile:|^\s*-|\s@\s|\b[\w-]+\.(?:org|com|net|io|dev|local|internal)\b|(?<![\w.])[.~]*/\w", re.MULTILINE)
MACHINE = re.compile(r"/(?:root|work|farm)/|(?<![\w.-])/(?:home|tmp|mnt|Users)/")
# Tests make up paths for messages; a made-up one may begin with these.
MACHINE_IN_TESTS = re.compile(r"/(?:root|work|farm)/")


def tracked() -> list[Path]:
    """Files that are, or would be, committed; without git (an unpacked archive) all that .gitignore does not name."""
    try:
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
        files = [ROOT / name for name in listed if name]
    except (OSError, subprocess.CalledProcessError):
        ignored = [".git", *(line.strip("/") for line in (ROOT / ".gitignore").read_text(encoding="utf-8").split())]
        files = [
            path for path in ROOT.rglob("*") if not any(fnmatch(part, name) for part in path.relative_to(ROOT).parts for name in ignored)
        ]
    return [path for path in files if path.is_file()]


def machine_paths(text: str, in_tests: bool) -> list[str]:
    """`line number: line` of each line that names a path of a machine."""
    pattern = MACHINE_IN_TESTS if in_tests else MACHINE
    return [f"{number}: {line.strip()[:120]}" for number, line in enumerate(text.splitlines(), 1) if pattern.search(line)]


def test_no_file_names_a_path_of_a_machine() -> None:
    files = tracked()
    assert ROOT / "pyproject.toml" in files
    problems = []
    for path in files:
        relative = path.relative_to(ROOT)
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture or another binary file
        problems += [f"{relative}:{line}" for line in machine_paths(text, relative.parts[0] == "tests")]
    assert not problems, "\n" + "\n".join(problems)


def test_a_path_of_a_machine_is_seen() -> None:
    for start in ("root", "work", "home", "tmp"):
        assert machine_paths(f"x = '/{start}/ana/log.csv'", in_tests=False)
    assert not machine_paths("see docs/home/start.md and W/m", in_tests=False)
    assert machine_paths("see '/{}/x'".format("work"), in_tests=True)


def pinned(lock: str) -> dict[str, int]:
    """Number of hashes of each pinned package."""
    counts: dict[str, int] = {}
    name = ""
    for line in (ROOT / lock).read_text(encoding="utf-8").splitlines():
        if found := re.match(r"([A-Za-z0-9._-]+)==", line):
            name = found[1]
            counts[name] = 0
        counts[name] = counts.get(name, 0) + line.count("--hash=sha256:") if name else 0
    counts.pop("", None)
    return counts


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_names_no_address_and_pins_by_hash(lock: str) -> None:
    text = (ROOT / lock).read_text(encoding="utf-8")
    body = re.sub(r"^\s*--hash=sha256:[0-9a-f]{64}(?: \\)?$", "", text, flags=re.MULTILINE)
    assert not ADDRESS.search(body)
    assert all(pinned(lock).values())


@pytest.mark.parametrize(
    "line", ["x @ https://host/x.whl", "--index-url http://host", "-e .", "./wheels/x.whl", "x @ file:///x", "# from pypi.org"]
)
def test_an_address_in_a_lock_is_seen(line: str) -> None:
    assert ADDRESS.search(line)


def canonical(requirement: str) -> str:
    return re.split(r"[^A-Za-z0-9._-]", requirement)[0].lower().replace("_", "-")


def test_the_locks_pin_what_the_project_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    build = [*project["dependency-groups"]["build"], *project["build-system"]["requires"]]
    demo = {canonical(name) for name in [*project["project"]["dependencies"], *extras["report"], *build]}
    everything = (demo | {canonical(name) for names in extras.values() for name in names}) - {"thermid"}
    assert demo <= set(pinned(LOCKS[0]))
    assert everything <= set(pinned(LOCKS[1]))
    assert set(pinned(LOCKS[0])) <= set(pinned(LOCKS[1]))
