"""``thermid plan``, ``thermid qualify`` and ``thermid correlate``: a plan before data, its verdicts, and two logs side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thermid.cli.pages import Force, Page, Pdf, ready, written
from thermid.cli.standing import Accept, leave

if TYPE_CHECKING:
    from thermid.judge.correlation import Correlation
    from thermid.qualify.programme import Qualification

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
PlanPath = Annotated[Path, typer.Argument(help="A qualification plan (TOML).")]
Data = Annotated[Path | None, typer.Option("--data", help="Folder of logs outside the project.")]
LEAVES = {True: 0, False: 1, None: 4}
"""Verdict -> exit code."""


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("plan")(plan)
    app.command("qualify")(qualify)
    app.command("correlate")(correlate)


def plan(
    file: PlanPath,
    lock: Annotated[bool, typer.Option("--lock", help="Write hash, date and predictions beside the plan, before any log is read.")] = False,
    data: Data = None,
    accept: Accept = None,
    as_json: Json = False,
) -> None:
    """Say what a plan predicts of each test, and whether it stands as it was locked."""
    from thermid.cli.output import clean
    from thermid.qualify.lock import lock_plan, lock_status
    from thermid.qualify.plan import load_plan
    from thermid.qualify.predictions import pre_test
    from thermid.units import counted

    given = load_plan(file, data)
    told, standing = pre_test(given), given.known.standing.accept(accept or ())
    if lock:
        lock_plan(given, clean(told))
    status = lock_status(given)
    if as_json:
        shown = {
            "state": status.state,
            "sha256": status.sha256,
            "locked": status.date,
            "looked": status.looked,
            "changed": list(status.changed),
        }
        object_ = {"schema": 1, "status": "ok", "title": given.title, "standing": standing.to_dict(), "plan": shown, "predictions": told}
        typer.echo(json.dumps(clean(object_)))
        leave(standing)
    many = ((given.tests, "test"), (given.content.sensors, "sensor"), (given.limits, "reference point"))
    typer.echo(standing.over(f"{given.title}: {', '.join(counted(len(several), noun) for several, noun in many)}"))
    for test, sensors in told.items():
        typer.echo(f"  {test}")
        for sensor, p in sensors.items():
            ends = [f"{p[f'{end}_C']:.1f} +- {_size(1.96 * p[f'{end}_error_K'])}" for end in ("lowest", "highest")]
            typer.echo(f"    {sensor}: {' .. '.join(ends)} degC (95 %)")
    typer.echo(str(status))
    leave(standing)


def _size(kelvin: float) -> str:
    """Return an error as text; a question mark where nothing is known of it."""
    return f"{kelvin:.1f}" if kelvin > 0 else "?"


def qualify(
    file: PlanPath,
    to: Page = None,
    pdf: Pdf = None,
    data: Data = None,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Work a plan through: limits, margins, and the verdict on every log. Exit code 1 if something is not met, 4 if not decided."""
    from thermid.cli.output import clean
    from thermid.qualify.programme import run_plan

    def notice(name: str) -> None:
        if not as_json:
            typer.echo(name, err=True)

    ready(to, pdf)
    found = run_plan(file, data=data, notice=notice, accept=accept or ())
    page = written(lambda path: _qualification(found, path), to, pdf)
    if as_json:
        typer.echo(json.dumps(clean(found.to_dict() | page)))
    else:
        typer.echo(str(found))
        for path in page.values():
            typer.echo(f"report: {path}")
    leave(found.standing, LEAVES[found.passed])


def _qualification(found: Qualification, to: Path) -> Path:
    from thermid.reporting.qualification.page import qualification_report

    return qualification_report(found, to=to)


def _correlation(found: Correlation, to: Path, synthetic: bool) -> Path:
    from thermid.reporting.qualification.page import correlation_report

    return correlation_report(found, to=to, synthetic=synthetic)


def correlate(
    measured: Annotated[Path, typer.Argument(help="A log of readings (CSV).")],
    simulated: Annotated[Path, typer.Argument(help="A log of the simulation (CSV); temperatures of one name are compared.")],
    criteria: Annotated[list[str] | None, typer.Option("--criteria", help="A named set of criteria; may be repeated.")] = None,
    steady: Annotated[list[str] | None, typer.Option("--steady", help="A settled stretch in seconds, BEGIN:END; may be repeated.")] = None,
    accuracy: Annotated[str, typer.Option("--accuracy", help="Standard deviation of the sensors' constant error.")] = "0.5 [K]",
    time: Annotated[str | None, typer.Option("--time", help="The time column.")] = None,
    to: Page = None,
    pdf: Pdf = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Compare two logs column by column: metrics, verdicts, an overlay with the sensors' errors. Exit code 1 if not met, 4 if open."""
    from thermid.cli.output import clean
    from thermid.errors import ScenarioError
    from thermid.judge.correlation import correlate as compare
    from thermid.judge.correlation import read_two
    from thermid.sourced import weigh

    ready(to, pdf)
    windows = []
    for text in steady or []:
        begin, _, end = text.partition(":")
        try:
            windows.append((float(begin), float(end)))
        except ValueError:
            raise ScenarioError(f"'{text}' is no stretch; write BEGIN:END in seconds, such as 3600:7200.", "--steady") from None
        if not windows[-1][0] < windows[-1][1]:
            raise ScenarioError(f"'{text}' ends before it begins.", "--steady")
    first, second = read_two(measured, simulated, accuracy=accuracy, time=time)
    found = compare(
        (first, second),
        criteria or ["MIL-HDBK-340, transient"],
        steady={first.name: windows} if windows else None,
        title=f"{measured.name} against {simulated.name}",
    )
    page = written(lambda path: _correlation(found, path, first.origin.synthetic), to, pdf)
    if as_json:
        typer.echo(json.dumps(clean({"schema": 1, "status": "ok", "title": found.title, **found.to_dict(), **page})))
    else:
        typer.echo(str(found))
        for path in page.values():
            typer.echo(f"report: {path}")
    leave(found.standing, LEAVES[weigh(found.verdicts.values())])
