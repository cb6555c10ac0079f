"""Commands of the first afternoon (example, init, improve), and those that judge a fit: criticise, plausibility."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import typer

from thermid.app.cli.options import CampaignPath, Data, Json, Results, Whole, Workers, add_worker_options, leave, pairs, say
from thermid.app.cli.screen import searching, show, working
from thermid.app.cli.summary import staged
from thermid.app.examples import EXAMPLES, copies, copy_example, example_named
from thermid.base.errors import IdentificationError, NameNotFoundError, ScenarioError, nearest, refuse_unknown
from thermid.base.units import amount
from thermid.campaign import start as improved
from thermid.campaign.start import (
    ACCURACY,
    TEMPLATES,
    Roles,
    StatedFacts,
    known_masses,
    may_write_project,
    parted,
    propose,
    roles_of,
    seated,
    word,
    write_project,
    write_template,
)
from thermid.fit.calibration import Calibration
from thermid.inference.criticism import EVALUATIONS, criticise as criticised, plausibility as ranges_of
from thermid.model.tree import Standing, load_model, standard_parts
from thermid.physics.finishes import FINISHES
from thermid.physics.materials import Material

Stage = Annotated[str, typer.Option("--stage", help="One stage; all that were fitted to logs without it.")]


def init(
    logs: Annotated[list[Path] | None, typer.Argument(help="Logs of one unit, in any format; the last of several judges.")] = None,
    to: Annotated[Path, typer.Option("--to", help="Folder of the project.")] = Path("."),
    temperature: Annotated[
        list[str] | None, typer.Option("--temperature", help="COLUMN or COLUMN=PART; all that look like temperatures by default.")
    ] = None,
    surroundings: Annotated[
        str, typer.Option("--surroundings", help="The column of the surroundings, or their temperature: '23 [degC]'.")
    ] = "",
    power: Annotated[list[str] | None, typer.Option("--power", help="COLUMN or COLUMN=PART, again for every part that shares it.")] = None,
    full_scale: Annotated[
        list[str] | None, typer.Option("--full-scale", help="COLUMN=POWER of a duty at 100 %, such as Q1='1.2 [W]'.")
    ] = None,
    formula: Annotated[
        list[str] | None, typer.Option("--formula", help="NAME=FORMULA of columns for a power in watts, such as P='V_IN * I_IN'.")
    ] = None,
    name: Annotated[str, typer.Option("--name", help="Name of the model.")] = "",
    time: Annotated[str | None, typer.Option("--time", help="The time column, where it cannot be told.")] = None,
    template: Annotated[str, typer.Option("--template", help="Without a log: part, box or chamber.")] = "",
    evaluations: Annotated[int, typer.Option("--evaluations", help="Budget of the search of a structure, in runs.")] = EVALUATIONS,
    same: Annotated[list[str] | None, typer.Option("--same", help="COLUMN=NAME in further logs, such as BOX=Kasten.")] = None,
    accuracy: Annotated[str, typer.Option("--accuracy", help="Constant error of the thermometers, one standard deviation.")] = "",
    mass: Annotated[list[str] | None, typer.Option("--mass", help="PART=MASS from a scale, such as box='1.2 [kg]'.")] = None,
    material: Annotated[list[str] | None, typer.Option("--material", help="PART=MATERIAL of a part with a mass: box=aluminium.")] = None,
    path: Annotated[list[str] | None, typer.Option("--path", help="PART=PART that heat passes between; all pairs by default.")] = None,
    deck: Annotated[Path | None, typer.Option("--deck", help="A deck to begin with, instead of all parts joined to all.")] = None,
    as_json: Json = False,
) -> None:
    """Propose a model for a log; write deck, scenario and campaign.

    Exit code 4 if the log cannot decide between structures, or none explains it or can be built. Files are written all the same, unless
    the log has no power and none explains it.
    """
    if not logs:
        _from_template(template, to, as_json)
        return
    if template:
        raise ScenarioError("a template is for a project without a log; give one of them.", "--template", code="value.excludes-another")
    source, title = ", ".join(log.name for log in logs), name or word(logs[0].name.partition(".")[0])
    may_write_project(to, title)
    scales, formulas = pairs(full_scale or [], "--full-scale"), pairs(formula or [], "--formula")
    roles = roles_of(logs[0], temperature or (), surroundings, power or (), scales, time, formulas)
    roles = _ask_for_roles(logs[0], roles, time, bool(temperature), bool(power)) if sys.stdin.isatty() and not as_json else roles
    roles, facts = _stated_facts(roles, accuracy, mass or [], material or [], path or [], deck)
    read = [roles.read_further_log(log, pairs(same or [], "--same") if k else {}, time).drop_strays() for k, log in enumerate(logs)]
    fitted, holdout, silent = parted([record for record, _ in read])
    masked = [*(remark for _, lines in read for remark in lines), *silent]
    with searching("searching for a structure") as progress:
        proposal = propose(roles, [r.thin() for r in fitted], evaluations, facts=facts, progress=progress)
    project = write_project(to, proposal, fitted, holdout, source, title, masked)
    say(as_json, project.to_dict(), str(project))
    if not proposal.decided:
        raise SystemExit(IdentificationError.exit_code)


def _stated_facts(
    roles: Roles, accuracy: str, masses: Sequence[str], materials: Sequence[str], paths: Sequence[str], deck: Path | None
) -> tuple[Roles, StatedFacts]:
    """Return the roles, seated in the deck where there is one, and what is known beside the log; a part may be named by its column."""
    parts = list(roles.parts.values())
    weights, made_of = (
        {roles.part_named(n): v for n, v in pairs(*pairs_and_option).items()}
        for pairs_and_option in ((masses, "--mass"), (materials, "--material"))
    )
    ends = ([end.strip() for end in text.partition("=")[::2]] for text in paths)
    joined = tuple((roles.part_named(a), roles.part_named(b)) for a, b in ends)
    for option, names in (("--mass", weights), ("--material", made_of), ("--path", [n for pair in joined for n in pair])):
        refuse_unknown(names, parts, option, "no part '{}'. Parts: {known}.")
    size = amount(accuracy, "K", "--accuracy") if accuracy else ACCURACY
    model = load_model(deck) if deck is not None else None
    facts = StatedFacts(size, known_masses(weights, made_of), joined, model)
    return (roles if model is None else seated(roles, model)), facts


def _from_template(name: str, to: Path, as_json: bool) -> None:
    """Write a project of a template."""
    if not name:
        templates = ", ".join(f"{template} ({words})" for template, (words, _) in TEMPLATES.items())
        text = f"give a log, or --template with one of {templates}."
        raise ScenarioError(text, "init", code="value.incomplete")
    command, files = write_template(name, to)
    lines = [*(f"wrote {file}" for file in files), f"next: {command}"]
    say(as_json, {"files": [str(f) for f in files], "next": command}, "\n".join(lines))


def _ask_for_roles(log: Path, roles: Roles, time: str | None, temperatures: bool, powers: bool) -> Roles:
    """Return the roles after at most four questions; a question whose flag was given is not asked, an empty answer keeps what is shown."""
    typer.echo("Press return to keep what is shown.", err=True)
    parts = [f"{c}={n}" for c, n in roles.parts.items()]
    if not temperatures:
        parts = _several("1 of 4. Temperatures of parts, COLUMN=PART", parts)
    around = roles.surroundings
    if not around or not roles.logged:
        around = typer.prompt(
            "2 of 4. Surroundings: a column, or a temperature such as 23 [degC]; - if unknown", default=around or "-", err=True
        )
        around = "" if around == "-" else around
    heats = [f"{p.column}={p.node}" if p.node else p.column for p in roles.powers if p.node or not p.formula]
    if not powers:
        heats = _several("3 of 4. Powers and duties, COLUMN or COLUMN=PART; - for none", heats)
    scales = {p.column: p.full_scale for p in roles.powers if p.full_scale}
    duty = next((p.column for p in roles.powers if p.anchored), "")
    if duty:
        answer = typer.prompt(f"4 of 4. Power of '{duty}' at 100 %, such as 1.2 [W]; - if unknown", default="-", err=True)
        scales |= {} if answer == "-" else {duty: answer}
    return roles_of(log, parts, around, heats, scales, time, {p.column: p.formula for p in roles.powers if p.formula})


def _several(question: str, shown: Sequence[str]) -> list[str]:
    """Ask a question whose answer is a list with commas; ``-`` is none."""
    answer = typer.prompt(question, default=", ".join(shown) or "-", err=True)
    return [] if answer == "-" else [part.strip() for part in answer.split(",") if part.strip()]


@add_worker_options
def improve(
    campaign: CampaignPath,
    stage: Annotated[str, typer.Option("--stage", help="The stage; the last one by default.")] = "",
    evaluations: Annotated[int, typer.Option("--evaluations", help="Budget of the search of a structure, in runs.")] = EVALUATIONS,
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    as_json: Json = False,
) -> None:
    """Search for a better structure of a stage and write its files.

    Deck and campaign are written beside the old ones, with a comparison before and after.
    """
    with working("searching for a structure"):
        improved_model = improved.improve(campaign, stage, evaluations, data, results, executor=executor)
    content = {
        "changes": list(improved_model.changes),
        "gain": improved_model.search.likelihood(improved_model.search.proposed),
        "cannot_tell": [t.name for t in improved_model.last.ties if t.masses != improved_model.last.proposed.masses],
        "sensors": improved_model.rows(),
        "delays": [d.to_dict() for d in improved_model.delays],
        "refused": improved_model.refused,
        "files": [str(f) for f in improved_model.files],
    }
    say(as_json, content, str(improved_model))


def example(
    name: Annotated[str, typer.Argument(help="Name of an example; without it, the list.")] = "",
    to: Annotated[Path | None, typer.Option("--to", help="A new folder; the example's name by default.")] = None,
    parts: Annotated[bool, typer.Option("--parts", help='List standard parts, for use = "std:NAME" in a deck.')] = False,
    made_of: Annotated[bool, typer.Option("--materials", help="List materials and finishes with their sources.")] = False,
    as_json: Json = False,
) -> None:
    """Copy a shipped example with its data; list parts, materials.

    Published measurements are fetched and checked.
    """
    if parts:
        say(as_json, *_parts_listed())
        return
    if made_of:
        library = Material.table()
        figures = [
            {k: getattr(m, k) for k in ("name", "density", "specific_heat", "conductivity", "source", "read")} for m in library.values()
        ]
        finishes = [{"name": f.name, "emissivity": f.typical, "low": f.low, "high": f.high, "basis": f.basis} for f in FINISHES.values()]
        lines = [
            f"{len(library)} materials near 300 K, for material = NAME of nodes and conductors, each with what was read to check it",
            f"{'':<34} {'kg/m3':>7} {'J/(kg K)':>9} {'W/(m K)':>9}",
            *(
                f"{m.name:<34} {m.density:>7g} {m.specific_heat:>9g} {m.conductivity:>9g}  {m.basis.partition('; ')[2]}"
                for m in library.values()
            ),
            f"{len(finishes)} finishes, for finish = NAME of surfaces: emissivity, 95 % of parts",
            *(f"{f.name:<34} {f.typical:>7g} {f.low:>9g} {f.high:>9g}  {f.basis.partition(': ')[2]}" for f in FINISHES.values()),
        ]
        say(as_json, {"materials": figures, "finishes": finishes}, "\n".join(lines))
        return
    if not name:
        rows = [{"name": e.name, "shows": e.shows, "data": data.words if (data := e.data) else ""} for e in EXAMPLES.values()]
        width = max(len(n) for n in EXAMPLES)
        text = "\n".join(f"{r['name']:<{width}}  {r['shows']}" + (f"\n{'':<{width}}  {r['data']}" if r["data"] else "") for r in rows)
        say(as_json, {"examples": rows}, text)
        return
    chosen = example_named(name)
    if (data := chosen.data) is not None and not as_json:
        show(data.words, err=True)
    with working("making the synthetic logs" if chosen.makes else ""):
        copied = copy_example(
            name,
            to,
            copies(),
            (lambda n, whole: typer.echo(f"\r\x1b[2K{n} of {whole} logs", nl=n == whole, err=True))
            if data is not None and sys.stderr.isatty()
            else None,
        )
    content = {"folder": str(copied.folder), "logs": copied.logs, "checked": copied.checked, "next": chosen.first}
    say(as_json, content, str(copied))


NOT_CHECKED = "not checked against the print"
"""How the decks of standard parts mark such values."""


def _parts_listed() -> tuple[dict[str, object], str]:
    """Return the standard parts, each with its needs and how many of its values were not checked."""
    rows, lines, open_values = [], [], 0
    for name, file in standard_parts().items():
        part = load_model(file)
        values = [entry for _, _, entry in part.own_parameters() if entry.basis]
        unchecked = sum(NOT_CHECKED in p.basis for p in values)
        open_values += unchecked
        row = {"name": name, "use": part.use, "needs": list(part.needs), "values": len(values), "not_checked": unchecked}
        rows.append(row | {"deck": str(file)})
        lines.append(f"{name:<22} {part.use}; needs {', '.join(part.needs)}; {unchecked} of {len(values)} values {NOT_CHECKED}")
    head = f'{len(rows)} standard parts, for use = "std:NAME" in [submodels]; {open_values} of their values were {NOT_CHECKED}'
    return {"parts": rows}, "\n".join([head, *lines])


def _fits(campaign: Path, stage: str, data: Path | None, results: Path | None, executor: Workers) -> Mapping[str, Calibration]:
    """Return the fits of a stage, or of all stages that were fitted to logs.

    Raises
    ------
    NameNotFoundError   When no stage of that name was fitted to logs.
    """
    done = staged(campaign, data, results, executor=executor, stage=stage, judged=False).stages
    fitted = {name: fit for name, fit in done.items() if fit.records}
    if not stage:
        return fitted
    if stage not in fitted:
        raise NameNotFoundError(f"stage '{stage}' was tuned by hand, so it has no residuals.{nearest(stage, fitted)}", campaign.name)
    return {stage: fitted[stage]}


@add_worker_options
def criticise(
    campaign: CampaignPath,
    stage: Stage = "",
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Test the residuals of a fit and try missing elements.

    Missing elements are tried in refits where the residuals are more than noise.
    """
    fits = _fits(campaign, stage, data, results, executor)
    criticisms = {}
    for name, fit in fits.items():
        with searching(f"missing elements of stage {name}") as progress:
            criticisms[name] = criticised(fit, executor=executor, progress=progress)
    say(as_json, {"stages": {n: c.to_dict() for n, c in criticisms.items()}}, "\n\n".join(map(str, criticisms.values())), verbose)
    leave(Standing.worst(f.standing for f in fits.values()))


@add_worker_options
def plausibility(
    campaign: CampaignPath,
    stage: Stage = "",
    weight: Annotated[
        list[str], typer.Option("--weight", help="NODE=MASS of a part that was weighed, such as case='0.41 [kg]'; may be repeated.")
    ] = [],  # noqa: B006
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Compare fitted values with correlations and physical ranges.

    Exit code 1 if a value is not physical.
    """
    weights = pairs(weight, "--weight")
    fits = _fits(campaign, stage, data, results, executor)
    checks = {name: ranges_of(fit, weights=weights) for name, fit in fits.items()}
    say(as_json, {"stages": {n: p.to_dict() for n, p in checks.items()}}, "\n\n".join(map(str, checks.values())), verbose)
    leave(Standing.worst(f.standing for f in fits.values()), 0 if all(p.physical for p in checks.values()) else 1)
