"""Eight jobs that write, each run by a process of its own: `python interrupted.py JOB FOLDER`.

With `python interrupted.py JOB FOLDER HOW` a child is forked for each call of this process that writes, and killed, or told that the
disk is full, at that call. What each of them left is compared with the files before and after an undisturbed run.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from datetime import datetime, tzinfo
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2] / "examples" / "bench")]

CALLS = ("fsync", "replace", "unlink", "mkdir", "open", "chmod")
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def _command(*arguments: str) -> None:
    from thermid.app.cli.app import main

    sys.argv = ["thermid", *arguments]
    try:
        main()
    except SystemExit as left:
        if left.code not in (0, 1, 4):
            raise


def simulate() -> None:
    every = "10 [s]" if Path("new").exists() else "20 [s]"
    _command("simulate", "box.toml", "--scenario", "warm.toml", "--every", every, "--csv", "out/run.csv", "--netcdf", "out/run.nc")


def calibrate() -> None:
    _command("calibrate", "campaign.toml", "--to", "out")


class Still(datetime):
    """A clock that stands: a page says the minute in which it was made."""

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Still:
        return cls(2026, 1, 2, 3, 4, tzinfo=tz)


def report() -> None:
    from thermid.reporting._pages import tables

    tables.datetime = Still  # type: ignore[attr-defined, misc]
    _command("report", "campaign.toml", "--results", "out", "--to", "out/page.html")


def hold() -> None:
    _command("hold", "hold.toml", "--members", "60" if Path("new").exists() else "40", "--to", "out", "--figure", "out/hold.svg")


def plan() -> None:
    _command("plan", "out/plan.toml", "--lock")


def values() -> None:
    import numpy as np

    from thermid.values.store import FittedValue, FittedValues

    v = 6.0 if Path("new").exists() else 5.0
    item = FittedValue("skin.htc", v, 0.1, 0.1, True, "W/(m^2 K)", 5.0, (2.0, 12.0), "by hand")
    FittedValues("box", {"skin.htc": item}, np.array([[0.01]])).save("out/box.values.toml")


def decks() -> None:
    import thermid as td

    capacitance = 60 if Path("new").exists() else 50
    parts = {name: {"title": f"{name} {capacitance}", "nodes": {"b": {"capacitance": f"{capacitance} [J/K]"}}} for name in ("one", "two")}
    for name, part in parts.items():
        td.save_model(td.model_from_dict({**part, "title": name}), f"out/{name}.toml")
    td.save_model(td.load_model("pair.toml").with_values({"stack.contact_conductance": f"{capacitance} [W/(m^2 K)]"}), "out/pair.toml")


def studio() -> None:
    from thermid.app.studio.project import Project

    project = Project("campaign.toml", results=Path("out"))
    moved = {s.path: s.value * 1.01 for s in project.desk("box").sliders[:1]}
    project.save("box", moved, "by hand")


JOBS: dict[str, Callable[[], None]] = {j.__name__: j for j in (simulate, calibrate, report, hold, plan, values, decks, studio)}


def prepare(folder: Path) -> None:
    """Make the project, and what a run of every job before has left."""
    from unit.app.cli.test_outputs import QUESTION, SCENARIO
    from unit.fit.project import make_project
    from unit.qualify.project import PLAN, project

    make_project(folder)
    (folder / "out").mkdir()
    project(folder / "out", PLAN)
    (folder / "out/thermid.toml").unlink()
    (folder / "warm.toml").write_text(SCENARIO.format("air"), encoding="utf-8")
    (folder / "hold.toml").write_text(QUESTION, encoding="utf-8")


def renew(folder: Path) -> None:
    """Change what the jobs depend on, so that their files must change."""
    (folder / "new").touch()
    for name, old, new in (
        ("campaign.toml", 'rmse = "0.5 [K]"', 'rmse = "0.0001 [K]"'),
        ("campaign.toml", 'title = "Two levels"', 'title = "Two levels, again"'),
        ("campaign.toml", '"skin.effective_htc", "case.mass"', '"skin.effective_htc"'),
        ("out/plan.toml", 'mean = "1 [K]"', 'mean = "2 [K]"'),
    ):
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def judged(job: str, left: dict[str, bytes], again: dict[str, bytes], old: dict[str, bytes], new: dict[str, bytes]) -> list[str]:
    """Return what is wrong with the files that a disturbed run left, and with those of the next run."""
    wrong = [f"{n} is neither old nor new" for n, data in left.items() if ".half." not in n and data not in (old.get(n), new.get(n))]
    wrong += [f"{n} is gone" for n in old if n not in left]
    extra = {"out/by_hand_3.values.toml"} if job == "studio" else set()  # what was saved before the kill is kept, and saved again
    wrong += [f"stray {n}" for n in again if n not in new and n not in extra]
    wrong += [f"{n} is not new after the next run" for n, data in new.items() if again.get(n) != data]
    return wrong


def _disturbed(at: int, how: str) -> Callable[[], int]:
    """Disturb the call number `at` of this process that writes; return how to ask for the number so far."""
    count = 0

    def reached() -> None:
        nonlocal count
        count += 1
        if count == at:
            if how == "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def watched(name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **more: Any) -> Any:
            if name != "open" or (len(arguments) > 1 and arguments[1] & WRITES):
                if how == "full" and name in ("unlink",):  # a full disk can always remove
                    return real(*arguments, **more)
                reached()
            return real(*arguments, **more)

        return call

    for name in CALLS:
        setattr(os, name, watched(name, getattr(os, name)))
    sys.addaudithook(
        lambda event, a: reached() if event == "open" and isinstance(a[1], str) and set(a[1]) & set("wax+") and a[0] != os.devnull else None
    )
    return lambda: count


def _child(job: str, folder: Path, at: int, how: str) -> tuple[int, int]:
    """Run a job in a child that is disturbed; return its status and how many calls it made that write."""
    inner, outer = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        os.close(inner)
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        os.chdir(folder)
        so_far = _disturbed(at, how)
        status = 0
        try:
            JOBS[job]()
        except BaseException:
            status = 1
        os.write(outer, json.dumps(so_far()).encode())
        os._exit(status)
    os.close(outer)
    with os.fdopen(inner) as pipe:
        told = pipe.read()
    return os.waitpid(pid, 0)[1], int(told or 0)


def torture(job: str, folder: Path, how: str, every: int) -> dict[str, Any]:
    """Disturb a job at each of its calls, or every so many, and return how many, and what was wrong."""
    base = folder / "base"
    base.mkdir()
    prepare(base)
    assert _child(job, base, 0, how)[0] == 0
    renew(base)
    fresh = folder / "fresh"
    shutil.copytree(base, fresh)
    status, calls = _child(job, fresh, 0, how)
    assert status == 0
    old, new = contents(base), contents(fresh)
    assert old != new
    wrong: list[str] = []
    runs = 0
    for at in range(1, calls + 1, every):
        place = folder / f"run{at}"
        shutil.copytree(base, place)
        status, _ = _child(job, place, at, how)
        left = contents(place)
        ended = os.WIFSIGNALED(status) if how == "kill" else os.WIFEXITED(status)
        wrong += [] if ended else [f"call {at}: status {status}"]
        if _child(job, place, 0, how)[0] != 0:
            wrong.append(f"call {at}: the next run failed")
        wrong += [f"call {at}: {each}" for each in judged(job, left, contents(place), old, new)]
        shutil.rmtree(place)
        runs += 1
    return {"job": job, "how": how, "calls": calls, "runs": runs, "wrong": wrong}


if __name__ == "__main__":
    if len(sys.argv) == 3:
        os.chdir(sys.argv[2])
        JOBS[sys.argv[1]]()
    else:
        import thermid.app.cli.app  # noqa: F401  # once, before any child is forked

        made = torture(sys.argv[1], Path(sys.argv[2]).resolve(), sys.argv[3], int(sys.argv[4]) if len(sys.argv) > 4 else 1)
        sys.stdout.write(json.dumps(made) + "\n")
