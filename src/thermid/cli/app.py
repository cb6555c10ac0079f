"""``thermid``: check, simulate, calibrate, report. Everything heavy is imported inside the command that needs it."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from thermid.cli.commands import MODULES
from thermid.cli.pages import Force, Page, Pdf, ready, written
from thermid.cli.standing import Accept, KeepValues, leave, with_fitted
from thermid.errors import DeckError, ScenarioError, SolverError, ThermidError, nearest
from thermid.toml_files import read_toml

if TYPE_CHECKING:
    from collections.abc import Callable

    from thermid.campaign.stages import Campaign
    from thermid.fit.inputs import InputTable
    from thermid.model.tree.model import Model
    from thermid.simulation.scenarios.scenario import Scenario

app = typer.Typer(
    name="thermid",
    help="Lumped thermal models of equipment: built part by part, fitted to logs level by level, and asked about the rest.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _say_version(wanted: bool) -> None:
    """Print the version and leave."""
    if wanted:
        from importlib.metadata import version

        typer.echo(f"thermid {version('thermid')}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version and leave.")] = False,
) -> None:
    from thermid.files import command

    context.with_resource(command())


Deck = Annotated[Path, typer.Argument(help="A deck (TOML).")]
CampaignPath = Annotated[Path, typer.Argument(help="A campaign (TOML).")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
Data = Annotated[Path | None, typer.Option("--data", help="Folder of logs outside the project; THERMID_DATA does the same.")]
Pairs = list[str]


INTERRUPTED = 130
"""Exit code after the interrupt key, as shells have it."""


def main() -> None:
    """Run the command line and leave with its exit code."""
    try:
        _run()
        return
    except KeyboardInterrupt:
        pass
    except SystemExit as left:  # typer turns the interrupt key into this exit, without a word
        if left.code != INTERRUPTED:
            raise
    typer.echo("stopped by the interrupt key; files that were complete before remain.", err=True)
    raise SystemExit(INTERRUPTED)


def _run() -> None:
    """Run a command; every error is one line, or one object."""
    as_json = "--json" in sys.argv[1:]
    try:
        # with --json a wrong option is an object too, so typer must not print its own words
        code = app(standalone_mode=not as_json)
    except ThermidError as error:
        _fail(error, as_json)
    except OSError as error:
        _fail(ThermidError(_refused(error)), as_json)
    except ImportError as error:
        # netCDF and the report page stand on packages that a plain installation does not bring
        _fail(ThermidError(f"{str(error).strip(' .')}. Install thermid with its extras: thermid[report,export]."), as_json)
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        _fail(ThermidError(error.format_message(), "command line"), as_json)
    raise SystemExit(code)


def _refused(error: OSError) -> str:
    """Return what the system refused, in words, with the path and what to do."""
    if error.filename is None:
        return f"{error.strerror or error}."
    path = Path(str(error.filename))
    if isinstance(error, FileNotFoundError) and not path.parent.is_dir():
        return f"'{path}' cannot be reached: there is no folder '{path.parent}'. Make it, or give another path."
    if isinstance(error, IsADirectoryError):
        return f"'{path}' is a folder; the path of a file is needed."
    if isinstance(error, FileExistsError | NotADirectoryError):
        return f"'{path}' is a file; the path of a folder is needed."
    return f"{error.strerror or error}: '{path}'."


def _fail(error: ThermidError, as_json: bool) -> NoReturn:
    """Say what went wrong and leave."""
    if as_json:
        typer.echo(json.dumps({"schema": 1, "status": "error", "message": error.message, "where": error.where}))
    else:
        typer.echo(f"error: {error}", err=True)
    raise SystemExit(error.exit_code)


def _pairs(given: Pairs, option: str) -> dict[str, str]:
    """Return ``PATH=VALUE`` options as a dictionary."""
    out = {}
    for text in given:
        path, equals, value = text.partition("=")
        if not equals or not path.strip() or not value.strip():
            raise ScenarioError(f"'{text}' must be written as PATH=VALUE, such as air=24 [degC].", option)
        out[path.strip()] = value.strip()
    return out


def _with_unit(value: str, unit: str) -> str:
    """Return a value with a unit, the usual one where none is written."""
    return value if "[" in value or not value.replace(".", "").replace("-", "").replace("e", "").isdigit() else f"{value} [{unit}]"


@app.command()
def check(deck: Deck, data: Data = None, as_json: Json = False) -> None:
    """Check a deck or campaign, with its logs, for errors and questionable values. Exit code 2 if it cannot be used."""
    from thermid.model.deck.modelfile import load_model

    content, _ = read_toml(deck)
    inputs: dict[str, InputTable] = {}
    if "stages" in content:
        from thermid.campaign.survey import check_campaign

        findings, inputs = check_campaign(deck, data)
    else:
        findings = tuple(load_model(deck).check())
    found = [{"severity": f.severity, "where": f.where, "message": f.message} for f in findings]
    bad = any(f["severity"] == "error" for f in found)
    if as_json:
        first = next((f for f in found if f["severity"] == "error"), None)
        error = {"message": first["message"], "where": first["where"]} if first is not None else {}
        tables = {"inputs": {stage: i.to_dict() for stage, i in inputs.items()}} if "stages" in content else {}
        typer.echo(json.dumps({"schema": 1, "status": "error" if bad else "ok", **error, "findings": found, **tables}))
    else:
        for f in found:
            typer.echo(f"{f['severity']}: {f['where']}: {f['message']}")
        for stage, table in inputs.items():
            typer.echo(f"{stage}: inputs\n{table.indented}")
        count = {s: sum(f["severity"] == s for f in found) for s in ("error", "warning", "note")}
        typer.echo(f"{deck.name}: {count['error']} errors, {count['warning']} warnings, {count['note']} notes")
    raise SystemExit(2 if bad else 0)


@app.command()
def simulate(
    deck: Deck,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="A scenario (TOML).")] = None,
    boundary: Annotated[Pairs, typer.Option("--boundary", help="BOUNDARY=TEMPERATURE, such as air='24 [degC]'.")] = [],  # noqa: B006
    param: Annotated[Pairs, typer.Option("--param", help="PARAMETER=VALUE; wins over the deck.")] = [],  # noqa: B006
    load: Annotated[Pairs, typer.Option("--load", help="LOAD=POWER, in place of the deck's.")] = [],  # noqa: B006
    start: Annotated[
        str | None, typer.Option("--start", help="A temperature, a boundary, 'steady', 'steady, mean', 'steady, 2 [h]' or 'periodic'.")
    ] = None,
    duration: Annotated[str | None, typer.Option("--for", help="Duration, such as '5 [h]'.")] = None,
    at: Annotated[Pairs, typer.Option("--at", help="A time to report, such as '1 [h]'; may be repeated.")] = [],  # noqa: B006
    every: Annotated[str | None, typer.Option("--every", help="Interval of the stored samples.")] = None,
    vacuum: Annotated[bool, typer.Option("--vacuum", help="No gas: convection goes, radiation stays.")] = False,
    as_printed: Annotated[
        bool, typer.Option("--as-printed", help="No gas, every coefficient zero, radiation too: an upper bound.")
    ] = False,
    as_flown: Annotated[bool, typer.Option("--as-flown", help="Without what is for the test only: sensors, leads, stands.")] = False,
    values: Annotated[Path | None, typer.Option("--values", help="A file of fitted values to lay over the deck.")] = None,
    keep_values: KeepValues = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write the temperatures to a CSV file.")] = None,
    netcdf: Annotated[Path | None, typer.Option("--netcdf", help="Write everything to a netCDF file.")] = None,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a model in a scenario and print where its temperatures go."""
    import numpy as np

    from thermid.cli.output import solution_object
    from thermid.files import NETCDF, TABLE, may_write
    from thermid.knowledge.store import model_standing
    from thermid.model.deck.modelfile import load_model
    from thermid.model.laws.signal import literal
    from thermid.simulation.simulator import output_times
    from thermid.simulation.steady import steady as settle
    from thermid.simulation.transient import simulate as run

    model = with_fitted(load_model(deck), values, keep_values)
    if param:
        model = model.with_values(_pairs(param, "--param"), "command line")
    model = model.without_test_only() if as_flown else model
    standing = model_standing(model).accept(accept or ())
    given = _scenario(model, scenario, boundary, load, start, duration)
    if vacuum and as_printed:
        raise ScenarioError("--vacuum keeps radiation and --as-printed drops it; give one of them.")
    if vacuum or as_printed:
        given = given.vacuum(as_printed=as_printed)
    times = [literal(_with_unit(t, "s"), "s", "--at") for t in at]
    outside = [t for t in times if not 0 <= t <= given.seconds]
    if outside:
        raise ScenarioError(f"{outside[0]:g} s lies outside the run of {given.seconds:g} s.", "--at")
    grid = np.union1d(output_times(given, every and _with_unit(every, "s"), None), times)
    for path, kind in ((csv, TABLE), (netcdf, NETCDF)):
        if path is not None:
            may_write(path, kind)
    solution = run(model, given, times=grid)
    try:
        final = settle(model, given, given.seconds)
    except SolverError:
        final = None
    if csv is not None:
        solution.to_csv(csv)
    if netcdf is not None:
        solution.to_netcdf(netcdf)
    if as_json:
        typer.echo(json.dumps(solution_object(solution, final, times) | {"standing": standing.to_dict()}))
        leave(standing)
    typer.echo(standing.over(str(solution)))
    for t in times:
        row = ", ".join(f"{n} {float(solution[n].at(t)):.3f}" for n in solution.nodes)
        typer.echo(f"  at {t:g} s: {row} degC")
    typer.echo("  time constants: " + ", ".join(f"{c:.6g} s" for c in solution.time_constants))
    balance = solution.heat_balance()
    typer.echo(f"  heat: loads {balance.loads:.6g} J, to boundaries {balance.boundaries:.6g} J, stored {balance.stored:.6g} J")
    leave(standing)


def _scenario(model: Model, file: Path | None, boundary: Pairs, load: Pairs, start: str | None, duration: str | None) -> Scenario:
    """Return the scenario of the options, laid over the one of a file."""
    from thermid.simulation.scenario_file import load_scenario
    from thermid.simulation.scenarios.scenario import Scenario

    base = load_scenario(file) if file is not None else Scenario("command line")
    for name, text in _pairs(boundary, "--boundary").items():
        if _with_unit(text, "degC") != text and 200.0 <= float(text) <= 400.0:
            typer.echo(f"note: {name}={text} is read in degC; in kelvin it is written '{name}={text} [K]'.", err=True)
    changes: dict[str, Any] = {
        "boundaries": {k: _with_unit(v, "degC") for k, v in _pairs(boundary, "--boundary").items()},
        "loads": {k: _with_unit(v, "W") for k, v in _pairs(load, "--load").items()},
    }
    if start is not None:
        changes["start"] = _with_unit(start, "degC")
    if duration is not None:
        changes["duration"] = _with_unit(duration, "s")
    return base.with_(**changes)


class _Progress:
    """A line on standard error once something takes over two seconds."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._shown = 0.0
        self._last = ""

    def __call__(self, stage: str, count: int, rms: float) -> None:
        now = time.monotonic()
        if now - self._begun < 2.0 or (now - self._shown < 0.5 and stage == self._last):
            return
        self._shown, fresh = now, stage != self._last
        self._last = stage
        text = f"{stage}: evaluation {count}, weighted RMS {rms:.3g}" if count else stage
        if sys.stderr.isatty():
            typer.echo(f"\r\x1b[2K{text}", nl=False, err=True)
        elif fresh:
            typer.echo(text, err=True)

    def end(self) -> None:
        """Leave the line."""
        if self._last and sys.stderr.isatty():
            typer.echo("\r\x1b[2K", nl=False, err=True)


def _campaign(path: Path, data: Path | None, to: Path | None, fresh: bool, accept: list[str] | None) -> tuple[Campaign, list[Path]]:
    """Run a campaign with progress, taking finished stages from the results folder."""
    from thermid.campaign.cache import file_name
    from thermid.campaign.file import read_campaign
    from thermid.campaign.stages import run_stages
    from thermid.files import VALUES, may_write

    folder = to if to is not None else path.parent / "results"
    for stage in read_campaign(path).content.stages if folder.is_dir() else ():
        may_write(folder / f"{file_name(stage.name)}.values.toml", VALUES.of(stage.name))
    progress = _Progress()
    try:
        campaign = run_stages(path, data=data, notice=progress, cache=None if fresh else folder, accept=accept or ())
    finally:
        progress.end()
    return campaign, campaign.save(folder)


Results = Annotated[Path | None, typer.Option("--to", help="Folder for the values files; 'results' beside the campaign by default.")]
Fresh = Annotated[bool, typer.Option("--fresh", help="Run every stage, also those whose model, logs and request are unchanged.")]


@app.command()
def calibrate(
    campaign: CampaignPath,
    data: Data = None,
    to: Results = None,
    fresh: Fresh = False,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run the stages and verdicts of a campaign. Exit code 1 if a verdict failed or a fit is not credible, 4 if data cannot tell."""
    from thermid.cli.output import campaign_object

    result, files = _campaign(campaign, data, to, fresh, accept)
    if as_json:
        typer.echo(json.dumps(campaign_object(result, [f.name for f in files])))
    else:
        typer.echo(str(result))
        for stage, fit in result.stages.items():
            if fit.inputs.rows:
                typer.echo(f"\n{stage}: inputs\n{fit.inputs.indented}")
        for stage, changed in result.changed.items():
            if changed:
                typer.echo(f"\nfitted again: {stage}; changed since the results were kept: {', '.join(changed)}")
        typer.echo(f"\nvalues: {', '.join(f.name for f in files)}")
    leave(result.standing, result.exit_code)


@app.command()
def report(
    campaign: CampaignPath,
    to: Page = None,
    pdf: Pdf = None,
    data: Data = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder for the values files.")] = None,
    fresh: Fresh = False,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a campaign and write its report page, its PDF, or both."""
    from thermid.cli.output import campaign_standing
    from thermid.reporting.pages.campaign import report as write

    if to is None and pdf is None:
        raise ScenarioError("say where the report goes: --to page.html, --pdf page.pdf, or both.", "command line")
    ready(to, pdf)
    result, _ = _campaign(campaign, data, results, fresh, accept)
    made = written(lambda path: write(result, to=path), to, pdf)
    if as_json:
        typer.echo(json.dumps({"schema": 1, "status": "ok", **made, "passed": result.passed, "standing": campaign_standing(result)}))
    else:
        typer.echo(result.standing.over("\n".join(f"report: {path}" for path in made.values()), "stage"))
    leave(result.standing, result.exit_code)


@app.command()
def schema(kind: Annotated[str, typer.Argument(help="deck or campaign")] = "deck") -> None:
    """Print the JSON Schema of a file, for editors."""
    makers: dict[str, Callable[[], dict[str, Any]]] = {}
    from thermid.campaign.schema import json_schema as campaign_schema
    from thermid.model.deck.schema import json_schema as deck_schema

    makers |= {"deck": deck_schema, "campaign": campaign_schema}
    if kind not in makers:
        raise DeckError(f"there is no schema '{kind}'.{nearest(kind, makers)} There are deck and campaign.")
    typer.echo(json.dumps(makers[kind](), indent=2))


for _module in MODULES:
    _module.register(app)


if __name__ == "__main__":
    main()
