"""``thermid``: the table of its commands, and how errors are printed. A command's module is imported when it is called."""

from __future__ import annotations

import gc
import json
import sys
import warnings
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, NamedTuple, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command_from_info
from typer.models import CommandInfo

from thermid.app.cli.screen import show
from thermid.base.errors import MissingExtraError, StoppedError, ThermidError, ThermidWarning, missing
from thermid.base.files import command


class Place(NamedTuple):
    """Where a command stands: its function below `thermid.app.cli`, its group and line in the help, examples, the extra of its part."""

    function: str
    group: str
    summary: str
    examples: tuple[str, ...]
    extra: str = ""


GROUPS = ("Start", "Build", "Fit", "Predict", "Qualify", "Bench", "Exchange")
"""Groups of commands, in the order of work."""


COMMANDS = {
    "example": Place(
        "start.example",
        "Start",
        "Copy a shipped example with its data; list parts, materials.",
        ("thermid example", "thermid example tclab --to lab", "thermid example --parts"),
    ),
    "look": Place(
        "logs.look",
        "Start",
        "Show layout, clock, gaps, faults and columns of logs.",
        ("thermid look bench.csv", "thermid look a.csv b.csv --time stamp --json"),
    ),
    "init": Place(
        "start.init",
        "Start",
        "Propose a model for a log; write deck, scenario and campaign.",
        ("thermid init bench.csv --to project", "thermid init --template box --to project"),
    ),
    "studio": Place(
        "studio.studio",
        "Start",
        "Open or begin a deck or campaign, as a page on this machine.",
        ("thermid studio campaign.toml", "thermid studio box.toml --port 8000 --no-browser"),
        "studio",
    ),
    "check": Place(
        "build.check",
        "Build",
        "Check a deck or campaign for errors and questionable values.",
        ("thermid check campaign.toml", "thermid check box.toml --verbose"),
    ),
    "simulate": Place(
        "build.simulate",
        "Build",
        "Run a model in a scenario and print its temperatures.",
        (
            "thermid simulate box.toml --scenario hot.toml --csv hot.csv",
            "thermid simulate box.toml --boundary air=24 --for '2 [h]' --at '1 [h]'",
        ),
    ),
    "steady": Place(
        "build.steady_state",
        "Build",
        "Print steady temperatures and their margins, least margin first.",
        (
            "thermid steady box.toml --boundary air='40 [degC]' --flows",
            "thermid steady box.toml --scenario hot.toml --limit '*.case=-40..85'",
        ),
    ),
    "size": Place(
        "design.size_value",
        "Build",
        "Find the window of a design value in which limits hold.",
        ("thermid size unit.toml panel.area --scenario hot.toml --limit 'unit=-20..50' --between '0.01 [m^2]..0.5 [m^2]'",),
    ),
    "worst": Place(
        "design.worst",
        "Build",
        "Find the worst hot and cold case within ranges.",
        ("thermid worst unit.toml --scenario orbit.toml --limit 'unit=-20..50' --range chips='2 [W]..9 [W]'",),
    ),
    "compare": Place(
        "design.compare_versions",
        "Build",
        "Compare two versions of a deck, the largest effect first.",
        ("thermid compare a.toml b.toml", "thermid compare unit.toml fitted.toml --scenario hot.toml --scenario cold.toml"),
    ),
    "diagram": Place(
        "design.diagram",
        "Build",
        "Draw a model as SVG: masses, conductors, loads, boundaries.",
        ("thermid diagram box.toml --to box.svg", "thermid diagram stack.toml --to stack.svg --fold ele"),
    ),
    "moisture": Place(
        "site.moisture",
        "Build",
        "Print the margin to the dew point of every surface.",
        ("thermid moisture box.toml --scenario pad.toml --humidity air='60 [%]'",),
        "site",
    ),
    "schema": Place(
        "build.schema", "Build", "Print the JSON Schema of a file, for editors.", ("thermid schema deck", "thermid schema campaign")
    ),
    "identify": Place(
        "fit.identify",
        "Fit",
        "Show which parameters the logs can identify, before a fit.",
        ("thermid identify campaign.toml --stage box", "thermid identify campaign.toml --after"),
    ),
    "calibrate": Place(
        "fit.calibrate",
        "Fit",
        "Fit the stages of a campaign to logs and judge hold-out records.",
        ("thermid calibrate campaign.toml", "thermid calibrate campaign.toml --data logs --to results -v"),
    ),
    "report": Place(
        "fit.report",
        "Fit",
        "Run a campaign and write its report as a page or a PDF.",
        ("thermid report campaign.toml --to report.html", "thermid report campaign.toml --to report.pdf"),
    ),
    "criticise": Place(
        "start.criticise",
        "Fit",
        "Test the residuals of a fit and try missing elements.",
        ("thermid criticise campaign.toml --stage box",),
    ),
    "plausibility": Place(
        "start.plausibility",
        "Fit",
        "Compare fitted values with correlations and physical ranges.",
        ("thermid plausibility campaign.toml --weight case='0.41 [kg]'",),
    ),
    "improve": Place(
        "start.improve",
        "Fit",
        "Search for a better structure of a stage and write its files.",
        ("thermid improve campaign.toml --stage box --evaluations 20000",),
    ),
    "estimate": Place(
        "fit.estimate",
        "Fit",
        "Fit a stage with process noise and compare its forecasts.",
        ("thermid estimate campaign.toml --noise wall=free --horizon '30 [min]'",),
    ),
    "fleet": Place(
        "fit.fleet",
        "Fit",
        "Fit the units of one design: means, spreads, odd units.",
        ("thermid fleet fleet.toml", "thermid fleet fleet.toml --scenario hot.toml --workers 2"),
    ),
    "credibility": Place(
        "fit.credibility",
        "Fit",
        "List source, state, tests, date and range of every value.",
        ("thermid credibility campaign.toml --to credibility.json",),
    ),
    "swap": Place(
        "fit.swap",
        "Fit",
        "Plan the replacement of a part: which tests and fits are due.",
        ("thermid swap campaign.toml pre.ele EleGFO_v2.toml", "thermid swap campaign.toml pre.ele EleGFO_v2.toml --new-data logs"),
    ),
    "predict": Place(
        "fit.predict",
        "Predict",
        "Predict scenarios with a fitted stage, with 95 % bands.",
        ("thermid predict campaign.toml --scenario hot.toml --at '1 [h]'", "thermid predict campaign.toml --record 'bench_*'"),
    ),
    "hold": Place(
        "fit.hold",
        "Predict",
        "Compute how long limits are kept, with probabilities.",
        ("thermid hold hold.toml", "thermid hold hold.toml --members 2000 --figure hold.svg"),
    ),
    "profile": Place(
        "qualify.profile",
        "Qualify",
        "Print an environmental test profile, or run it on a deck.",
        ("thermid profile", "thermid profile SMC-S-016 'unit thermal cycle' --lowest -5 --highest 40"),
    ),
    "plan": Place(
        "qualify.plan", "Qualify", "Predict each test of a qualification plan; lock the plan.", ("thermid plan plan.toml --lock",)
    ),
    "qualify": Place(
        "qualify.qualify",
        "Qualify",
        "Run a qualification plan: limits, margins and verdicts on logs.",
        ("thermid qualify plan.toml --to report.html",),
    ),
    "correlate": Place(
        "qualify.correlate",
        "Qualify",
        "Compare measured and simulated logs against criteria.",
        ("thermid correlate measured.csv simulated.csv --steady 3600:7200 --to page.html",),
    ),
    "deliver": Place(
        "qualify.deliver",
        "Qualify",
        "Write a delivery folder: decks, values, reduced deck, checks.",
        ("thermid deliver box.toml --scenario hot.toml --to delivery", "thermid deliver delivery --check"),
    ),
    "log": Place(
        "bench.log",
        "Bench",
        "Log sensors and heaters of a bench to disk, with faults marked.",
        ("thermid log bench.log --sensors sensors.toml", "thermid log trial.log --for '1 [min]'"),
        "log",
    ),
    "watch": Place(
        "watch.watch",
        "Bench",
        "Watch a running test: when to stop, and what went wrong.",
        ("thermid watch bench.log --model box.toml --scenario bench.toml", "thermid watch bench.csv --look once"),
    ),
    "settle": Place(
        "watch.settle",
        "Bench",
        "Check whether a log is stable and forecast where it ends.",
        ("thermid settle bench.csv --rule '3 C/h'", "thermid settle bench.csv --channel T1 --within '0.5 [K]'"),
    ),
    "import": Place(
        "exchange.import_file",
        "Exchange",
        "Read a SINDA or ESATAN deck, or an InitFcn script.",
        ("thermid import unit.inp --to unit.toml --scenario unit_case.toml",),
        "symbolic",
    ),
    "export": Place(
        "exchange.export",
        "Exchange",
        "Write a model as C, Modelica, FMI, Octave, SPICE, SINDA, ESATAN.",
        ("thermid export box.toml --as spice --scenario hot.toml --to box.cir",),
        "symbolic",
    ),
    "write-back": Place(
        "exchange.write_back",
        "Exchange",
        "Write fitted values into copies of a SINDA or ESATAN deck.",
        ("thermid write-back unit.inp unit.toml --values unit.values.toml --to fitted",),
        "symbolic",
    ),
    "equations": Place(
        "exchange.equations",
        "Exchange",
        "Derive the state equations of a linear model as symbols.",
        ("thermid equations box.toml --as latex --to box.tex",),
        "symbolic",
    ),
}
"""Command word -> where the command stands, in the order of the help."""

SHARED_OPTIONS = ("-v", "--verbose", "--json")
"""Options of commands that may also stand before the command."""
INTERRUPTED = StoppedError.exit_code
"""Exit code after the interrupt key, as shells have it."""
EXITS = {
    0: "done; every verdict passed; the values used are credible or unjudged",
    1: "a verdict failed or was not judged; or values used are not credible",
    2: "bad input: an option, file, name, unit, scenario, log; or no extra",
    3: "a run ended before its time, or nothing balances",
    4: "the data cannot decide what was asked",
    5: "the answer rests on inadequate values or on an incomplete deck",
    INTERRUPTED: "stopped by the interrupt key; files that were complete remain",
}
"""Exit code -> what it means, for every command; where several hold, 2, 3, 4, 1, 5 is the order of precedence."""


class OnDemand(TyperCommand):
    """A command of which the help of the whole knows the summary; calling it imports its module."""

    def __init__(self, word: str, place: Place) -> None:
        super().__init__(name=word, help=place.summary)
        self.place = place

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the command itself, with its options."""
        return self.loaded().make_context(info_name, args, parent, **extra)

    def loaded(self) -> Any:
        """Import the function of the command and return it as a command of click, with its examples and exit codes.

        Raises
        ------
        MissingExtraError     When an optional part of thermid that it needs is not installed.
        ModuleNotFoundError   When a module is missing though the command needs no optional part.
        """
        module, _, function = f"thermid.app.cli.{self.place.function}".rpartition(".")
        gc.disable()  # what is imported stays: looking through it for garbage, now or at the end, is a fifth of a first result
        try:
            callback = getattr(import_module(module), function)
        except ModuleNotFoundError as error:
            if not self.place.extra:
                raise
            raise MissingExtraError(missing([error.name or self.place.extra], f"thermid {self.name}")) from error
        finally:
            if getattr(sys.modules["__main__"], "main", None) is main:  # in a process of its own: others look at what refers to what
                gc.freeze()
            gc.enable()
        epilog = "\n".join(
            (
                "\b\nExamples:",
                *(f"  {example}" for example in self.place.examples),
                "\n\b\nExit codes:",
                *(f"  {code:<5}{meaning}" for code, meaning in EXITS.items()),
            )
        )
        whole, trust = (
            get_command_from_info(entry, pretty_exceptions_short=False, rich_markup_mode=None)
            for entry in (CommandInfo(name=self.name, callback=callback, epilog=epilog), CommandInfo(name="trust", callback=_trusting))
        )
        if self.name == "check" or any(p.name == "campaign" for p in whole.params):
            whole.params.insert(-1, trust.params[0])
        return whole


def _trust(context: typer.Context, wanted: bool) -> None:
    """Let a command run programs that others wrote."""
    if wanted:
        context.with_resource(command(trust=True))


def _trusting(
    trust: Annotated[
        bool,
        typer.Option(
            "--trust",
            callback=_trust,
            expose_value=False,
            help="Run the campaign's FMUs, programs with your rights; asked once for each.",
        ),
    ] = False,
) -> None:
    """Have the option of every command that reads a campaign."""


class Commands(TyperGroup):
    """The commands of the table."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for word, place in COMMANDS.items():
            self.add_command(OnDemand(word, place))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return what is left of the arguments; options that commands share may stand before the command."""
        before = list(takewhile(SHARED_OPTIONS.__contains__, args))
        word, *others = args[len(before) :] or [""]
        return super().parse_args(ctx, [word, *before, *others] if word else args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands by group, each with its whole line."""
        width = max(map(len, COMMANDS)) + 2
        for group in GROUPS:
            with formatter.section(group):
                for word, place in COMMANDS.items():
                    if place.group == group:
                        formatter.write(f"{'':{formatter.current_indent}}{word:<{width}}{place.summary}\n")

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the table of exit codes."""
        with formatter.section("Exit codes"):
            for code, meaning in EXITS.items():
                formatter.write(f"{'':{formatter.current_indent}}{code:<5}{meaning}\n")


app = typer.Typer(
    name="thermid",
    cls=Commands,
    help="Lumped thermal models of equipment: build them part by part, fit them to logs, predict, qualify.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _say_version(wanted: bool) -> None:
    """Print the version and end."""
    if wanted:
        typer.echo(f"thermid {import_module('importlib.metadata').version('thermid')}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version.")] = False,
) -> None:
    """Options of `thermid` itself, before any command: its version."""
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


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Print what thermid warns of as a sentence; with ``-v`` its code too. What packages below say is for their developers."""
    if isinstance(message, ThermidWarning):
        show(f"warning: {message}{_code_shown(message.code)}", err=True)


def _code_shown(code: str) -> str:
    """Return the code of a remark in brackets where ``-v`` asks for it."""
    return f" [{code}]" if code and {"-v", "--verbose"} & set(sys.argv[1:]) else ""


def _run() -> None:
    """Run a command; every error is one line, or one object."""
    as_json = "--json" in sys.argv[1:]
    if not sys.warnoptions:  # python -W, or PYTHONWARNINGS, asks for them as they are
        warnings.showwarning = _show_warning
    try:
        # with --json a wrong option is an object too, so typer must not print its own words
        code = app(standalone_mode=not as_json)
    except ThermidError as error:
        _fail(error, as_json)
    except OSError as error:
        _fail(ThermidError(_refused(error), code="file.refused-by-system"), as_json)
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] == "thermid":
            raise
        _fail(MissingExtraError(missing([error.name.partition(".")[0]], "this command")), as_json)
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        _fail(ThermidError(error.format_message(), "command line", code="command.not-understood"), as_json)
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
    """Say what went wrong and leave; with ``-v`` the code of it too."""
    if as_json:
        content = {"schema": 1, "status": "error", "code": error.code, "message": error.message, "where": error.where}
        typer.echo(json.dumps(content))
    else:
        show(f"error: {error}{_code_shown(error.code)}", err=True)
    raise SystemExit(error.exit_code)
