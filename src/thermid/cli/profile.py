"""``thermid profile``: the profiles of the standards, printed, saved, and run on a deck."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thermid.cli.pages import Force

if TYPE_CHECKING:
    from thermid.profile_runs.profile_run import ProfileRun
    from thermid.profiles.profile import ThermalProfile

Texts = list[str]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("profile")(profile)


def profile(
    standard: Annotated[str, typer.Argument(help="A standard, such as SMC-S-016, or a profile file; all are listed without one.")] = "",
    name: Annotated[str, typer.Argument(help="Profile of the standard, such as 'unit thermal cycle'.")] = "",
    level: Annotated[str, typer.Option("--level", help="Level or category, such as acceptance.")] = "",
    lowest: Annotated[str | None, typer.Option("--lowest", help="Lowest predicted temperature, model uncertainty included.")] = None,
    highest: Annotated[str | None, typer.Option("--highest", help="Highest predicted temperature, likewise.")] = None,
    change: Annotated[Texts, typer.Option("--set", help="NUMBER=VALUE in place of the standard's; may be repeated.")] = [],  # noqa: B006
    on: Annotated[Path | None, typer.Option("--on", help="Run it on this deck.")] = None,
    chamber: Annotated[Texts, typer.Option("--chamber", help="Boundary that is the chamber; may be repeated.")] = [],  # noqa: B006
    base: Annotated[str, typer.Option("--base", help="Base plate: the levels hold there.")] = "",
    watch: Annotated[Texts, typer.Option("--watch", help="Node that must be stable; all by default.")] = [],  # noqa: B006
    param: Annotated[Texts, typer.Option("--param", help="PARAMETER=VALUE; wins over the deck.")] = [],  # noqa: B006
    scenario: Annotated[Path | None, typer.Option("--scenario", help="Scenario with what else is done (TOML).")] = None,
    chamber_ramp: Annotated[str | None, typer.Option("--chamber-ramp", help="What the chamber can, such as '2 [K/min]'.")] = None,
    every: Annotated[str, typer.Option("--every", help="Interval of the stored samples.")] = "1 [min]",
    save: Annotated[Path | None, typer.Option("--save", help="Write the profile as a file to edit.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the temperatures of the run.")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the run (png, svg, pdf).")] = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Print a profile of an environmental test with clauses and marks, or run it on a deck: each dwell waits for the unit."""
    from thermid.cli.output import clean
    from thermid.files import PICTURE, TABLE, may_write

    if not standard:
        _list(as_json)
        return
    found = _profile(standard, name, level, lowest, highest, change)
    if save is not None:
        found.save(save)
    if on is None:
        _unused(csv, picture)
        typer.echo(json.dumps(clean({"schema": 1, "status": "ok", **_object(found)})) if as_json else str(found))
        return
    for path, kind in ((csv, TABLE), (picture, PICTURE)):
        if path is not None:
            may_write(path, kind)
    run = _run(found, on, chamber, base, watch, param, scenario, chamber_ramp, every)
    if csv is not None:
        run.solution.to_csv(csv)
    if picture is not None:
        from thermid.reporting.pictures.trust import picture as draw

        draw(run, picture)
    typer.echo(json.dumps(clean({"schema": 1, "status": "ok", **run.as_object()})) if as_json else str(run))


def _unused(csv: Path | None, picture: Path | None) -> None:
    """Refuse what only a run can give."""
    from thermid.errors import ScenarioError

    for option, given in (("--csv", csv), ("--picture", picture)):
        if given is not None:
            raise ScenarioError("there is no run to write: name the deck with --on.", option)


def _list(as_json: bool) -> None:
    """Print the standards with their profiles and levels."""
    from thermid.profiles.standards import profile_names

    known = profile_names()
    if as_json:
        typer.echo(json.dumps({"schema": 1, "status": "ok", "standards": known}))
        return
    for standard, profiles in known.items():
        typer.echo(standard)
        for name, levels in profiles.items():
            typer.echo(f"  {name}{': ' + ', '.join(levels) if levels else ''}")


def _profile(standard: str, name: str, level: str, lowest: str | None, highest: str | None, change: Texts) -> ThermalProfile:
    """Return the profile that was asked for, from the library or a file."""
    from thermid.cli.app import _pairs, _with_unit
    from thermid.errors import ScenarioError
    from thermid.profiles.standards import load_profile, profile_of

    if (lowest is None) != (highest is None):
        raise ScenarioError("give both --lowest and --highest.", "command line")
    predicted = None if lowest is None or highest is None else (_with_unit(lowest, "degC"), _with_unit(highest, "degC"))
    if standard.endswith(".toml"):
        if name or level:
            raise ScenarioError("a file says itself which profile and level it is like.", standard)
        found = load_profile(standard)
    else:
        found = profile_of(standard, name, level=level)
    numbers: dict[str, Any] = {k: _number(k, v) for k, v in _pairs(change, "--set").items()}
    return found.with_(predicted=predicted, **numbers)


def _number(name: str, text: str) -> str | float:
    """Return a value in the usual unit where none is written."""
    from thermid.cli.app import _with_unit
    from thermid.profiles.number import SLOTS
    from thermid.units import TEMPERATURE

    usual = {TEMPERATURE: "degC", "K/s": "K/min", "s": "h", "1": "1"}
    slot = SLOTS.get(name)
    if slot == "1":
        try:
            return float(text)
        except ValueError:
            return text
    return text if slot is None else _with_unit(text, usual.get(slot, slot))


def _run(
    found: ThermalProfile,
    deck: Path,
    chamber: Texts,
    base: str,
    watch: Texts,
    param: Texts,
    scenario: Path | None,
    chamber_ramp: str | None,
    every: str,
) -> ProfileRun:
    from thermid.cli.app import _pairs, _with_unit
    from thermid.model.deck.modelfile import load_model
    from thermid.profile_runs.conduct import run_profile
    from thermid.simulation.scenario_file import load_scenario

    return run_profile(
        load_model(deck),
        found,
        chamber=tuple(chamber),
        base=base,
        watch=watch,
        values=dict(_pairs(param, "--param")) or None,
        scenario=None if scenario is None else load_scenario(scenario),
        chamber_ramp=None if chamber_ramp is None else _with_unit(chamber_ramp, "K/min"),
        every=_with_unit(every, "s"),
    )


def _object(found: ThermalProfile) -> dict[str, Any]:
    """Return a profile as JSON holds it."""
    numbers = {k: {"text": n.text, "mark": n.mark, "clause": n.clause, "note": n.note} for k, n in found.used.items()}
    return {
        "profile": found.title,
        "kind": found.kind,
        "clause": found.clause,
        "mark": found.mark,
        "decides": found.decides,
        "trust": found.trust,
        "numbers": numbers,
        "steps": [s.name for s in found.steps],
        "remarks": list(found.check()),
    }
