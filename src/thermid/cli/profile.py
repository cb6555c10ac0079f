"""The command of an environmental test: profile."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.cli.options import Force, Json, Parameters, pairs, say, with_unit, writable
from thermid.errors import ScenarioError
from thermid.files import PICTURE, TABLE
from thermid.model.deck.modelfile import load_model
from thermid.profile_runs.conduct import run_profile
from thermid.profiles.profile import SLOTS, ThermalProfile
from thermid.profiles.standards import load_profile, profile_names, profile_of
from thermid.reporting.pictures import trust
from thermid.simulation.scenario_file import load_scenario
from thermid.units import TEMPERATURE


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
    watch: Annotated[list[str], typer.Option("--watch", help="Node that must be stable; all by default.")] = [],  # noqa: B006
    param: Parameters = [],  # noqa: B006
    scenario: Annotated[Path | None, typer.Option("--scenario", help="Scenario with what else is done (TOML).")] = None,
    chamber_ramp: Annotated[str | None, typer.Option("--chamber-ramp", help="What the chamber can, such as '2 [K/min]'.")] = None,
    every: Annotated[str, typer.Option("--every", help="Interval of the stored samples.")] = "1 [min]",
    save: Annotated[Path | None, typer.Option("--save", help="Write the profile as a file to edit.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the temperatures of the run.")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the run (png, svg, pdf).")] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Print a profile of an environmental test with clauses and marks, or run it on a deck: each dwell waits for the unit."""
    if not standard:
        _list(as_json)
        return
    course = _profile(standard, name, level, lowest, highest, change)
    if save is not None:
        course.save(save)
    if on is None:
        for option, path in (("--csv", csv), ("--picture", picture)):
            if path is not None:
                raise ScenarioError("there is no run to write: name the deck with --on.", option)
        say(as_json, _object(course), course)
        return
    writable((csv, TABLE), (picture, PICTURE))
    run = run_profile(
        load_model(on),
        course,
        chamber=tuple(chamber),
        base=base,
        watch=watch,
        values=pairs(param, "--param") or None,
        scenario=None if scenario is None else load_scenario(scenario),
        chamber_ramp=None if chamber_ramp is None else with_unit(chamber_ramp, "K/min"),
        every=with_unit(every, "s"),
    )
    if csv is not None:
        run.solution.to_csv(csv)
    if picture is not None:
        trust.picture(run, picture)
    say(as_json, run.as_object(), run)


def _list(as_json: bool) -> None:
    """Print the standards with their profiles and levels."""
    known = profile_names()
    lines = []
    for standard, profiles in known.items():
        lines.append(standard)
        lines += [f"  {name}{': ' + ', '.join(levels) if levels else ''}" for name, levels in profiles.items()]
    say(as_json, {"standards": known}, "\n".join(lines))


def _profile(standard: str, name: str, level: str, lowest: str | None, highest: str | None, change: list[str]) -> ThermalProfile:
    """Return the profile that was asked for, from the library or a file."""
    if (lowest is None) != (highest is None):
        raise ScenarioError("give both --lowest and --highest.", "command line")
    predicted = None if lowest is None or highest is None else (with_unit(lowest, "degC"), with_unit(highest, "degC"))
    if standard.endswith(".toml"):
        if name or level:
            raise ScenarioError("a file says itself which profile and level it is like.", standard)
        course = load_profile(standard)
    else:
        course = profile_of(standard, name, level=level)
    numbers: dict[str, Any] = {k: _number(k, v) for k, v in pairs(change, "--set").items()}
    return course.with_(predicted=predicted, **numbers)


def _number(name: str, text: str) -> str | float:
    """Return a value in the usual unit where none is written."""
    usual = {TEMPERATURE: "degC", "K/s": "K/min", "s": "h", "1": "1"}
    slot = SLOTS.get(name)
    if slot == "1":
        try:
            return float(text)
        except ValueError:
            return text
    return text if slot is None else with_unit(text, usual.get(slot, slot))


def _object(course: ThermalProfile) -> dict[str, Any]:
    """Return a profile as JSON holds it."""
    numbers = {k: {"text": n.text, "mark": n.mark, "clause": n.clause, "note": n.note} for k, n in course.used.items()}
    return {
        "profile": course.title,
        "kind": course.kind,
        "clause": course.clause,
        "mark": course.mark,
        "decides": course.decides,
        "trust": course.trust,
        "numbers": numbers,
        "steps": [s.name for s in course.steps],
        "remarks": list(course.check()),
    }
