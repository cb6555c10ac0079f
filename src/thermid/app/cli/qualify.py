"""Commands of environmental tests: profile, plan, qualify, correlate, deliver."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.app.cli.options import (
    Accept,
    Data,
    Force,
    Json,
    KeepValues,
    Page,
    Parameters,
    Whole,
    filled_model,
    leave,
    pairs,
    say,
    with_unit,
    writable,
)
from thermid.app.cli.screen import working
from thermid.app.cli.summary import check_target, named_page
from thermid.base.errors import DeckError, RecordError, ScenarioError
from thermid.base.files import FileKinds
from thermid.base.results import clean, weigh
from thermid.base.units import HALF_WIDTH_95, counted
from thermid.campaign import stages as correlation
from thermid.measure.readers import log_cells, name_and_unit, read_record
from thermid.measure.records import Record
from thermid.model.tree import load_model
from thermid.qualify.plans import check_delivery, deliver as write_delivery, load_plan, pre_test, run_plan
from thermid.qualify.profiles import ThermalProfile, load_profile, profile_names, profile_of, run_profile, typed
from thermid.reporting import pictures as trust
from thermid.reporting.pages import correlation_report, qualification_report
from thermid.simulation.runs import load_scenario

_METER = re.compile(r"[PQIU](_|\d|\Z)")
"""How the name of a column begins that holds a power, a heat, a current or a voltage."""
_TEMPERATURES = ("degC", "°C", "K", "degF")

PlanPath = Annotated[Path, typer.Argument(help="A qualification plan (TOML).")]


LEAVES = {True: 0, False: 1, None: 4}
"""Verdict -> exit code."""


def plan(
    file: PlanPath,
    lock: Annotated[bool, typer.Option("--lock", help="Write hash, date and predictions beside the plan, before any log is read.")] = False,
    data: Data = None,
    accept: Accept = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Predict each test of a qualification plan; lock the plan.

    With --lock, predictions and hash are written before any log is read.
    """
    planned = load_plan(file, data)
    predictions, standing = pre_test(planned), planned.knowledge.standing.accept(accept or ())
    if lock:
        planned.lock(clean(predictions))
    status = planned.lock_status()
    seal = {"state": status.state, "sha256": status.sha256, "locked": status.date, "looked": status.looked}
    shown = {**seal, "changed": list(status.changed)}
    counts = ((planned.tests, "test"), (planned.content.sensors, "sensor"), (planned.limits, "reference point"))
    lines = [standing.over(f"{planned.title}: {', '.join(counted(len(rows), noun) for rows, noun in counts)}")]
    for test, sensors in predictions.items():
        lines.append(f"  {test}")
        for sensor, p in sensors.items():
            half_widths = {end: HALF_WIDTH_95 * p[f"{end}_error_K"] for end in ("lowest", "highest")}
            ends = [f"{p[f'{end}_C']:.1f}" + (f" +- {half:.1f}" if half > 0.0 else "") for end, half in half_widths.items()]
            known = "95 %" if p["highest_error_K"] > 0.0 else "no error is known, because no fit stands behind the model"
            lines.append(f"    {sensor}: {' .. '.join(ends)} degC ({known})")
    answer = {"title": planned.title, "standing": standing.to_dict(), "plan": shown, "predictions": predictions}
    say(as_json, answer, "\n".join([*lines, str(status)]), verbose)
    leave(standing)


def qualify(
    file: PlanPath,
    to: Page = None,
    data: Data = None,
    accept: Accept = None,
    force: Force = False,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Run a qualification plan: limits, margins and verdicts on logs.

    Exit code 1 if something is not met, 4 if it is not decided.
    """
    check_target(to)
    planned, done = load_plan(file, data), 0

    def notice(name: str) -> None:
        """Move the progress on by one test."""
        nonlocal done
        progress.now(name, done / len(planned.tests))
        done += 1

    with working("") as progress:
        result = run_plan(planned, notice=notice, accept=accept or ())
    pages = named_page(qualification_report(result, to=to)) if to is not None else {}
    say(as_json, result.to_dict() | pages, _with_pages(result, pages), verbose)
    leave(result.standing, LEAVES[result.passed])


def _with_pages(result: object, pages: dict[str, str]) -> str:
    """Return a result as text, and where its pages were written."""
    return "\n".join([str(result), *(f"report: {path}" for path in pages.values())])


def correlate(
    measured: Annotated[Path, typer.Argument(help="A log of readings (CSV).")],
    simulated: Annotated[Path, typer.Argument(help="A log of the simulation (CSV); temperatures of one name are compared.")],
    criteria: Annotated[list[str] | None, typer.Option("--criteria", help="A named set of criteria; may be repeated.")] = None,
    steady: Annotated[list[str] | None, typer.Option("--steady", help="A settled stretch in seconds, BEGIN:END; may be repeated.")] = None,
    accuracy: Annotated[str, typer.Option("--accuracy", help="Standard deviation of the sensors' constant error.")] = "0.5 [K]",
    time: Annotated[str | None, typer.Option("--time", help="The time column.")] = None,
    to: Page = None,
    force: Force = False,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Compare measured and simulated logs against criteria.

    Columns of one name are compared, with the sensors' errors. Exit code 1 if not met, 4 if not decided.
    """
    check_target(to)
    windows = []
    for text in steady or []:
        begin, _, end = text.partition(":")
        try:
            windows.append((float(begin), float(end)))
        except ValueError:
            raise ScenarioError(
                f"'{text}' is no stretch; write BEGIN:END in seconds, such as 3600:7200.", "--steady", code="value.wrong-kind"
            ) from None
        if not windows[-1][0] < windows[-1][1]:
            raise ScenarioError(f"'{text}' ends before it begins.", "--steady", code="value.outside-range")
    first, second = read_two(measured, simulated, accuracy=accuracy, time=time)
    result = correlation.correlate(
        (first, second),
        criteria or ["MIL-HDBK-340, transient"],
        steady={first.name: windows} if windows else None,
        title=f"{measured.name} against {simulated.name}",
    )
    pages = named_page(correlation_report(result, to=to, synthetic=first.origin.synthetic)) if to is not None else {}
    say(as_json, {"title": result.title, **result.to_dict(), **pages}, _with_pages(result, pages), verbose)
    leave(result.standing, LEAVES[weigh(result.verdicts.values())])


def deliver(
    deck: Annotated[Path, typer.Argument(help="A deck (TOML), or with --check a delivery folder.")],
    scenario: Annotated[list[Path], typer.Option("--scenario", help="A scenario (TOML) that must be met; may be repeated.")] = [],  # noqa: B006
    to: Annotated[Path | None, typer.Option("--to", help="The folder to write.")] = None,
    values: Annotated[list[Path], typer.Option("--values", help="A file of fitted values to lay over; may be repeated.")] = [],  # noqa: B006
    at: Annotated[str, typer.Option("--at", help="The submodel to reduce, which fitted values belong to; the whole by default.")] = "",
    nodes: Annotated[int, typer.Option("--nodes", help="Masses that the reduced deck has.", min=0)] = 0,
    within: Annotated[str, typer.Option("--within", help="As few masses as keep reference points within this, such as '0.2 [K]'.")] = "",
    check: Annotated[bool, typer.Option("--check", help="Check a delivery in place of writing one.")] = False,
    keep_values: KeepValues = False,
    accept: Accept = None,
    as_json: Json = False,
) -> None:
    """Write a delivery folder: decks, values, reduced deck, checks.

    The delivery is checked from its folder; --check repeats that on a folder that was received.
    """
    if check:
        met = check_delivery(deck)
        say(as_json, {"met_K": met}, f"{deck.name}: as delivered, {counted(len(met), 'scenario')} met")
        return
    if to is None:
        raise DeckError("a delivery needs a folder: --to FOLDER.", "command line", code="value.incomplete")
    if at and not (nodes or within or values):
        raise DeckError(
            f"'{at}' is the part that is reduced or has values; give --nodes, --within or --values with it.",
            "--at",
            code="value.incomplete",
        )
    model, values_laid = load_model(deck), []
    for file in values:
        filled = filled_model(model, file, keep_values, at)
        model = filled.model
        values_laid.append(filled.values)
    standing = model.standing.accept(accept or ())
    target = write_delivery(model, scenario, to, values=values_laid, nodes=nodes or None, within=within or None, at=at)
    record = json.loads(target.read_text(encoding="utf-8"))
    mark = f" ({record['watermark']})" if record["watermark"] else ""
    runs = counted(len(record["runs"]), "scenario")
    lines = [standing.over(f"{to}: {record['title']} {record['model']['identity']}, {runs} met" + mark)]
    if "reduced" in record:
        small = record["reduced"]
        (masses, masses_left), (before, after) = small["masses"], small["nodes"]
        lines.append(f"  {small['part']}: {masses_left} masses of {masses}, {after} nodes of {before}")
        lines += [f"  {node}: {off:+.3f} K at most" for node, off in small["largest_K"].items()]
        lines += [f"  remark: {remark}" for remark in small["remarks"]]
    content = {"checks": str(target), **{k: v for k, v in record.items() if k != "schema"}, "standing": standing.to_dict()}
    say(as_json, content, "\n".join(lines))
    leave(standing)


def profile(
    standard: Annotated[str, typer.Argument(help="A standard, such as SMC-S-016, or a profile file; all are listed without one.")] = "",
    name: Annotated[str, typer.Argument(help="Profile of the standard, such as 'unit thermal cycle'.")] = "",
    level: Annotated[str, typer.Option("--level", help="Level or category, such as acceptance.")] = "",
    lowest: Annotated[str | None, typer.Option("--lowest", help="Lowest predicted temperature, model uncertainty included.")] = None,
    highest: Annotated[str | None, typer.Option("--highest", help="Highest predicted temperature, likewise.")] = None,
    change: Annotated[list[str], typer.Option("--set", help="NUMBER=VALUE in place of the standard's; may be repeated.")] = [],  # noqa: B006
    on: Annotated[Path | None, typer.Option("--on", help="Run it on this deck.")] = None,
    chamber: Annotated[list[str], typer.Option("--chamber", help="Boundary that is the chamber; may be repeated.")] = [],  # noqa: B006
    base: Annotated[str, typer.Option("--base", help="Base plate: the levels hold there.")] = "",
    param: Parameters = [],  # noqa: B006
    scenario: Annotated[Path | None, typer.Option("--scenario", help="Scenario with what else is done (TOML).")] = None,
    every: Annotated[str, typer.Option("--every", help="Interval of the stored samples.")] = "1 [min]",
    save: Annotated[Path | None, typer.Option("--save", help="Write the profile as a file to edit.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the temperatures of the run.")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the run (png, svg, pdf).")] = None,
    force: Force = False,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Print an environmental test profile, or run it on a deck.

    Numbers carry their clauses. On a deck, each dwell waits until the unit is stable.
    """
    if not standard:
        _list(as_json, verbose)
        return
    course = _profile(standard, name, level, lowest, highest, change)
    if save is not None:
        course.save(save)
    if on is None:
        for option, path in (("--csv", csv), ("--picture", picture)):
            if path is not None:
                raise ScenarioError("there is no run to write: name the deck with --on.", option, code="value.incomplete")
        content = {k: getattr(course, k) for k in ("kind", "clause", "mark", "decides", "trust")}
        content |= {"numbers": {k: n.to_dict() for k, n in course.used.items()}, "steps": [s.name for s in course.steps]}
        say(as_json, {"profile": course.title, **content, "remarks": list(course.check())}, course, verbose)
        return
    writable((csv, FileKinds.TABLE), (picture, FileKinds.PICTURE))
    run = run_profile(
        load_model(on),
        course,
        chamber=tuple(chamber),
        base=base,
        values=pairs(param, "--param") or None,
        scenario=None if scenario is None else load_scenario(scenario),
        every=with_unit(every, "s"),
    )
    if csv is not None:
        run.solution.to_csv(csv)
    if picture is not None:
        trust.picture(run, picture)
    say(as_json, run.as_object(), run, verbose)


def _list(as_json: bool, verbose: bool) -> None:
    """Print the standards with their profiles and levels."""
    profiles_by_standard = profile_names()
    lines = []
    for standard, profiles in profiles_by_standard.items():
        lines.append(standard)
        lines += [f"  {name}{': ' + ', '.join(levels) if levels else ''}" for name, levels in profiles.items()]
    say(as_json, {"standards": profiles_by_standard}, "\n".join(lines), verbose)


def _profile(standard: str, name: str, level: str, lowest: str | None, highest: str | None, change: list[str]) -> ThermalProfile:
    """Return the profile that was asked for, from the library or a file."""
    if (lowest is None) != (highest is None):
        raise ScenarioError("give both --lowest and --highest.", "command line", code="value.incomplete")
    predicted = None if lowest is None or highest is None else (with_unit(lowest, "degC"), with_unit(highest, "degC"))
    if standard.endswith(".toml"):
        if name or level:
            raise ScenarioError("a file says itself which profile and level it is like.", standard, code="value.excludes-another")
        course = load_profile(standard)
    else:
        course = profile_of(standard, name, level=level)
    numbers: dict[str, Any] = {k: typed(k, v) for k, v in pairs(change, "--set").items()}
    return course.with_(predicted=predicted, **numbers)


def read_two(measured: Path, simulated: Path, *, accuracy: str = "", time: str | None = None) -> tuple[Record, Record]:
    """Return the temperatures that two logs have in common; a column with another unit, or named as a meter's (``P_ACC``), is none.

    Parameters
    ----------
    measured, simulated : Path  The logs.
    accuracy : str              Standard deviation of the sensors' constant error, as text.
    time : str                  The time column, where it has no usual name.

    Raises
    ------
    RecordError   When they have no column in common.
    """
    first, second = _columns(measured), _columns(simulated)
    common = [c for c in first if c in second and c != (time or first[0])]
    if not common:
        raise RecordError(
            f"'{measured.name}' and '{simulated.name}' have no column name in common besides the time: {', '.join(first)} against "
            f"{', '.join(second)}. Name the columns of the simulation like the sensors.",
            "two logs",
            code="record.not-overlapping",
        )
    extra: dict[str, object] = {"accuracy": accuracy} if accuracy else {}
    one = read_record(measured, {c: {"node": c} | extra for c in common}, time=time, name=measured.stem)
    return one, read_record(simulated, {c: {"node": c} for c in common}, time=time, name=f"{simulated.stem}, simulated")


def _columns(path: Path) -> list[str]:
    """Return the names of a log's columns, without units."""
    named = [name_and_unit(c) for c in log_cells(path).header]
    return [n for place, (n, u) in enumerate(named) if place == 0 or u in _TEMPERATURES or (u is None and not _METER.match(n))]
