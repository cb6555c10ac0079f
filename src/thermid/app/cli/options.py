"""What commands share: options, what they read and write (models with fitted values, scenarios, pages, JSON), and exit codes."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from thermid.app.cli.screen import show
from thermid.app.texts import add_codes, mark_codes, pairs as pairs, with_unit as with_unit
from thermid.base.errors import NameNotFoundError, ScenarioError, require
from thermid.base.files import FileKinds, command
from thermid.base.results import clean
from thermid.model.tree import Model, Standing, literal, load_model
from thermid.simulation.runs import KeptTasks, Scenario, Workers as Workers, load_scenario
from thermid.values.store import Filed

Deck = Annotated[Path, typer.Argument(help="A deck (TOML).")]
CampaignPath = Annotated[Path, typer.Argument(help="A campaign (TOML).")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
Data = Annotated[Path | None, typer.Option("--data", help="Folder of logs outside the project; THERMID_DATA does the same.")]
Results = Annotated[Path | None, typer.Option("--results", help="Folder of finished stages; 'results' beside the campaign.")]
ScenarioPath = Annotated[Path | None, typer.Option("--scenario", help="A scenario (TOML).")]
Boundaries = Annotated[list[str], typer.Option("--boundary", help="BOUNDARY=TEMPERATURE, such as air='24 [degC]'.")]
Parameters = Annotated[list[str], typer.Option("--param", help="PARAMETER=VALUE; wins over the deck.")]
Loads = Annotated[list[str], typer.Option("--load", help="LOAD=POWER, in place of the deck's.")]
Start = Annotated[str | None, typer.Option("--start", help="A temperature, a boundary, or 'steady'.")]
Duration = Annotated[str | None, typer.Option("--for", help="Duration, such as '5 [h]'.")]
Error = Annotated[str, typer.Option("--error", help="Error that temperatures may have, such as '1 [mK]'.")]
Moments = Annotated[list[str], typer.Option("--at", help="A time to report, such as '1 [h]'; may be repeated.")]
Vacuum = Annotated[bool, typer.Option("--vacuum", help="No gas: convection goes, radiation stays.")]
AsPrinted = Annotated[bool, typer.Option("--as-printed", help="No gas, every coefficient zero, radiation too: an upper bound.")]
ValuesPath = Annotated[
    Path | None, typer.Option("--values", help="Fitted values to lay over the deck: FILE, or PART=FILE where they are of a part of it.")
]
KeepValues = Annotated[
    bool, typer.Option("--keep-values", help="Keep values whose decks say otherwise by now; without it they are left out and listed.")
]
Processes = Annotated[int, typer.Option("--workers", help="Processes of this machine.", min=1)]
Cluster = Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler, tcp://host:8786.")]
Job = Annotated[
    Path | None, typer.Option("--job", help="Folder where finished tasks are kept; after an interrupt the same command goes on.")
]
Accept = Annotated[
    list[str] | None,
    typer.Option("--accept", help="A stage that is accepted as it is: its state stays, the exit code does not count it; may be repeated."),
]


def _force(context: typer.Context, wanted: bool) -> bool:
    """Let this command replace any file that its options name."""
    if wanted:
        context.with_resource(command(force=True))
    return wanted


Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print all details in place of the summary.")]
Whole = Annotated[bool, typer.Option("--verbose", "-v", help="Print all lines in a terminal too, not what fits on a screen.")]
Force = Annotated[
    bool, typer.Option("--force", callback=_force, help="Write also over an input, or over a file that thermid did not write.")
]
Page = Annotated[Path | None, typer.Option("--to", help="The page to write; where its name ends in .pdf, a PDF by an installed browser.")]
Audience = Annotated[
    str, typer.Option("--for", help="summary (2 sheets), agency (what a reviewer reads) or all; long tables are CSV files beside it.")
]

VIEW_SCHEMA = 1
"""Version of the JSON objects of commands."""
PRECEDENCE = (2, 3, 4, 1, 5, 0)
"""Exit codes, the one that wins first."""


def say(as_json: bool, content: Mapping[str, Any], text: object, verbose: bool | None = None) -> None:
    """Print an answer: one JSON object with the codes of its remarks, or text.

    With `verbose` the text is whole and remarks have their codes, without it what fits on a screen, where it is a terminal; None is for a
    command without the option: whole, no codes.
    """
    if as_json:
        typer.echo(json.dumps(clean(add_codes({"schema": VIEW_SCHEMA, "status": "ok", **content}))))
    else:
        show(mark_codes(str(text), content) if verbose else str(text), whole=verbose is not False)


def executor_of(workers: int, cluster: str, job: Path | None = None) -> Workers:
    """Return who does tasks, as the options say, kept in a folder where one is given; None for this process alone."""
    by = cluster or (workers if workers > 1 else None)
    if job is not None:
        job.mkdir(parents=True, exist_ok=True)  # a file of that name is refused before long work
    return KeptTasks(job, by) if job is not None else by


def add_worker_options(run_command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with --workers, --cluster and --job in place of its argument `executor`, which is what they say."""

    @wraps(run_command)
    def run(*, workers: int, cluster: str, job: Path | None, **options: Any) -> None:
        """Run the command."""
        run_command(executor=executor_of(workers, cluster, job), **options)

    form = signature(run_command, eval_str=True)
    options = [
        form.parameters["executor"].replace(name=n, annotation=kind, default=start)
        for n, kind, start in (("workers", Processes, 1), ("cluster", Cluster, ""), ("job", Job, None))
    ]
    parameters = [p for one in form.parameters.values() for p in (options if one.name == "executor" else [one])]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    run.__dict__["__signature__"] = form.replace(parameters=parameters)
    return run


def leave(standing: Standing, code: int = 0) -> NoReturn:
    """End a command whose answer was given: with its own exit code, or that of the values which the answer rests on."""
    raise SystemExit(min(code, standing.exit_code, key=PRECEDENCE.index))


def answer(standing: Standing, as_json: bool, content: Mapping[str, Any], text: object, verbose: bool | None = None) -> NoReturn:
    """Print an answer below the standing of the values that it rests on, as `say` does, and end the command by that."""
    say(as_json, {**content, "standing": standing.to_dict()}, standing.over(str(text)), verbose)
    leave(standing)


NEEDS = {FileKinds.PICTURE.name: "report", FileKinds.NETCDF.name: "export"}
"""Kind of file -> the extra that writes it."""


def writable(*files: tuple[Path | None, Any]) -> None:
    """Refuse files that may not be written, or for which a package is missing, before anything long begins.

    Raises
    ------
    MissingExtraError   When a package that writes such a file is not installed.
    OutputError         When a file may not be written.
    """
    for path, kind in files:
        if path is not None:
            if kind.name in NEEDS:
                require(NEEDS[kind.name], f"writing '{path.name}'")
            kind.may_write(path)


def fitted_model(deck: Path, values: Path | None, keep: bool | None = False, param: Sequence[str] = ()) -> Model:
    """Return a deck's model with a values file and parameters laid over it; what the file lacks and what is left out is told first.

    Parameters
    ----------
    keep : bool     Whether to keep values that the decks give otherwise by now; None for a command that cannot.
    """
    model = filled_model(load_model(deck), values, keep).model if values is not None else load_model(deck)
    return model.with_values(pairs(list(param), "--param"), "command line") if param else model


def filled_model(model: Model, values: Path, keep: bool | None = False, at: str = "") -> Filed:
    """Return a model with a values file laid over it, PART=FILE over a part of it; what the file lacks and what is left out is told first.

    Parameters
    ----------
    at : str    The part of a FILE without one.
    """
    part, _, file = ("", "", str(values)) if values.is_file() else str(values).rpartition("=")
    try:
        filled = Filed.read(Path(file), model, at=part or at, keep=bool(keep))
    except NameNotFoundError as error:
        name = next((n for n in model.submodels if not (part or at) and _is_of_part(Path(file), model, n)), "")
        raise error.reworded(f"{error.message} If they are of a part, name it: --values {name}={file}.") if name else error from None
    for line in (*(f"{gone}{' --keep-values keeps it.' * (keep is not None)}" for gone in filled.gone), *filled.hidden):
        show(f"{Path(file).name}: {line}", err=True)
    return filled


def _is_of_part(file: Path, model: Model, part: str) -> bool:
    """Return whether a submodel has every value of a values file."""
    try:
        Filed.read(file, model, at=part)
    except NameNotFoundError:
        return False
    return True


def judged_model(
    deck: Path, values: Path | None, keep: bool = False, param: Sequence[str] = (), accept: Sequence[str] | None = None
) -> tuple[Model, Standing]:
    """Return a model as `fitted_model` does, and how far its values may be trusted, stages that are accepted as they are apart."""
    model = fitted_model(deck, values, keep, param)
    return model, model.standing.accept(accept or ())


def scenario_of(
    file: Path | None,
    boundary: list[str],
    load: list[str],
    start: str | None,
    duration: str | None,
    vacuum: bool = False,
    as_printed: bool = False,
) -> Scenario:
    """Return the scenario of the options, laid over the one of a file."""
    base = load_scenario(file) if file is not None else Scenario("command line")
    for name, text in pairs(boundary, "--boundary").items():
        if with_unit(text, "degC") != text and 200.0 <= float(text) <= 400.0:
            show(f"note: {name}={text} is read in degC; in kelvin it is written '{name}={text} [K]'.", err=True)
    changes: dict[str, Any] = {
        "boundaries": {k: with_unit(v, "degC") for k, v in pairs(boundary, "--boundary").items()},
        "loads": {k: with_unit(v, "W") for k, v in pairs(load, "--load").items()},
    }
    if start is not None:
        changes["start"] = with_unit(start, "degC")
        if base.initial:
            show(f"note: --start {start} replaces the temperatures of {len(base.initial)} nodes under [initial] of the scenario.", err=True)
            base = replace(base, initial={})
    if duration is not None:
        changes["duration"] = with_unit(duration, "s")
    scenario = base.with_(**changes)
    if vacuum and as_printed:
        raise ScenarioError("--vacuum keeps radiation and --as-printed drops it; give one of them.", code="value.excludes-another")
    return scenario.vacuum(as_printed=as_printed) if vacuum or as_printed else scenario


def moments(texts: list[str], seconds: float) -> list[float]:
    """Return the times of ``--at`` within a run of that length. [s]"""
    times = [literal(with_unit(t, "s"), "s", "--at") for t in texts]
    outside = [t for t in times if not 0 <= t <= seconds]
    if outside:
        raise ScenarioError(f"{outside[0]:g} s lies outside the run of {seconds:g} s.", "--at", code="value.outside-range")
    return times


def limit_ends(text: str, pattern: str) -> tuple[float, float]:
    """Return limits written LOW..HIGH, or HIGH alone. [K]"""
    low, dots, high = text.rpartition("..")
    where = f"--limit {pattern}"
    ends = (
        literal(with_unit(low.strip(), "degC"), "temperature", where) if dots and low.strip() else -math.inf,
        literal(with_unit(high.strip(), "degC"), "temperature", where) if high.strip() else math.inf,
    )
    if not ends[0] < ends[1]:
        raise ScenarioError("the lower limit is not below the upper one.", where, code="value.outside-range")
    return ends
