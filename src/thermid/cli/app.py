"""``thermid``: the table of its commands, and how errors are printed. A command's module is imported when it is called."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated, Any, NamedTuple, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info
from typer.models import CommandInfo

from thermid.errors import ThermidError
from thermid.files import command


class Place(NamedTuple):
    """Where a command stands: its function below `thermid.cli`, the beginning of its help, the extra that it needs."""

    function: str
    summary: str
    extra: str = ""


COMMANDS = {
    "check": Place(
        "build.check", "Check a deck or campaign, with its logs, for errors and questionable values. Exit code 2 if it cannot be used."
    ),
    "simulate": Place("build.simulate", "Run a model in a scenario and print where its temperatures go."),
    "steady": Place(
        "build.steady_state",
        "Print where a model settles: temperatures with margins, sorted; with --flows where its heat goes.",
    ),
    "calibrate": Place(
        "fit.calibrate",
        "Run the stages and verdicts of a campaign. Exit code 1 if a verdict failed or a fit is not credible, 4 if data cannot tell.",
    ),
    "criticise": Place("explain.criticise", "Test the residuals of a fit, and try missing elements in refits where they are not noise."),
    "plausibility": Place(
        "explain.plausibility", "Compare fitted values with correlations and physical ranges. Exit code 1 if one is not physical."
    ),
    "report": Place("fit.report", "Run a campaign and write its report page, its PDF, or both."),
    "schema": Place("build.schema", "Print the JSON Schema of a file, for editors."),
    "studio": Place(
        "studio.studio", "Open a deck or campaign as a page on this machine: sliders, levels, scenarios, a log that grows.", "studio"
    ),
    "diagram": Place("build.diagram", "Draw a model as SVG: masses, conductors by kind, loads, boundaries, submodels as boxes."),
    "import": Place(
        "exchange.import_file", "Read a deck of SINDA or ESATAN as a model and a scenario, or the values of an InitFcn script.", "symbolic"
    ),
    "write-back": Place(
        "exchange.write_back",
        "Write fitted values into copies of a SINDA or ESATAN deck: equal but for the numbers that changed, each with a comment.",
        "symbolic",
    ),
    "export": Place(
        "exchange.export",
        "Write a model in a scenario for another tool: Octave or MATLAB, C, Modelica, SPICE, SINDA, ESATAN.",
        "symbolic",
    ),
    "equations": Place("exchange.equations", "Derive the state equations of a linear model as symbols (needs sympy).", "symbolic"),
    "htc": Place(
        "build.htc",
        "Compare the coefficient that a settled test shows with the one of correlations, and say what their difference can mean.",
    ),
    "log": Place(
        "bench.log",
        "Log a bench: every line on disk before the next is read; faults, resets and cable pulls are marks, and it goes on.",
        "log",
    ),
    "look": Place(
        "logs.look",
        "Show layout, clock, gaps, faults and columns of logs, and the lines for a campaign. Exit code 2 if times cannot be read.",
    ),
    "predict": Place("fit.predict", "Say what a fitted stage predicts for a scenario, with 95 % bands and what they come from."),
    "swap": Place(
        "fit.swap", "Plan the replacement of a part: what is assumed, which tests and fits are due; with the new logs, fit only these."
    ),
    "moisture": Place(
        "site.moisture", "Say of every surface its margin to the dew point, the minutes of condensation, and when it is dry.", "site"
    ),
    "credibility": Place("fit.credibility", "Say of every value its source, state, level, tests, date, range and origin."),
    "identify": Place(
        "fit.identify", "Say what the logs of each stage can tell of the parameters that it frees, what they cannot, and what would help."
    ),
    "estimate": Place(
        "fit.estimate",
        "Fit a stage with process noise beside output error, and say which foresees left-out readings better over a horizon.",
    ),
    "profile": Place(
        "qualify.profile",
        "Print a profile of an environmental test with clauses and marks, or run it on a deck: each dwell waits for the unit.",
    ),
    "settle": Place(
        "logs.settle",
        "Check whether a log is stable by a rule and forecast where it will end. Exit code 1 if it is not, 4 if the log cannot decide.",
    ),
    "watch": Place(
        "watch.watch",
        "Watch a running test: when to stop, what nobody measures, what went wrong. Exit code 0 at a stop, 1 with an alarm, 4 if declined.",
    ),
    "plan": Place("qualify.plan", "Say what a plan predicts of each test, and whether it stands as it was locked."),
    "qualify": Place(
        "qualify.qualify",
        "Work a plan through: limits, margins, and the verdict on every log. Exit code 1 if something is not met, 4 if not decided.",
    ),
    "correlate": Place(
        "qualify.correlate",
        "Compare two logs column by column: metrics, verdicts, an overlay with the sensors' errors. Exit code 1 if not met, 4 if open.",
    ),
    "hold": Place(
        "fit.hold",
        "Say how long limits are kept: the probability of passing them against time, the time that is safe, what decides it.",
    ),
    "init": Place("start.init", "Propose a model for a log and write deck, scenario and campaign. Exit code 4 if the log cannot tell."),
    "improve": Place(
        "start.improve", "Search for the next structure of a stage; write deck and campaign with it, before and after side by side."
    ),
    "example": Place(
        "start.example", "Copy a shipped example with its data into a new folder; published measurements are fetched and checked."
    ),
    "deliver": Place(
        "qualify.deliver", "Write decks, values, a reduced deck and what must come out into a folder, and check it from there."
    ),
}
"""Command word -> where the command stands, in the order of the help."""

INTERRUPTED = 130
"""Exit code after the interrupt key, as shells have it."""


class OnDemand(TyperCommand):
    """A command of which the help of the whole knows the summary; calling it imports its module."""

    def __init__(self, word: str, place: Place) -> None:
        super().__init__(name=word, help=place.summary)
        self.place = place

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the command itself, with its options."""
        return self.loaded().make_context(info_name, args, parent, **extra)

    def loaded(self) -> Any:
        """Import the command.

        Raises
        ------
        ThermidError   When an optional part of thermid that it needs is not installed.
        """
        module, _, function = self.place.function.partition(".")
        try:
            callback = getattr(import_module(f"thermid.cli.{module}"), function)
        except ModuleNotFoundError as error:
            if not self.place.extra:
                raise
            raise ThermidError(
                f"'{self.name}' needs {error.name}, which is not installed: pip install 'thermid[{self.place.extra}]'."
            ) from error
        return get_command_from_info(CommandInfo(name=self.name, callback=callback), pretty_exceptions_short=False, rich_markup_mode=None)


class Commands(TyperGroup):
    """The commands of the table."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for word, place in COMMANDS.items():
            self.add_command(OnDemand(word, place))


app = typer.Typer(
    name="thermid",
    cls=Commands,
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
        typer.echo(f"thermid {version_of('thermid')}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version and leave.")] = False,
) -> None:
    context.with_resource(command())


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
