"""What commands share: options, what they read and write (models with fitted values, scenarios, pages, JSON), and exit codes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn

import typer

from thermid.app.cli.screen import Progress, show
from thermid.base.codes import add_codes, mark_codes
from thermid.base.errors import ScenarioError, spoken
from thermid.base.extensions import require
from thermid.base.files import NETCDF, PAPER, PICTURE, check_ending, command, may_write
from thermid.campaign.stages import Campaign, read_campaign, run_stages
from thermid.measure.amounts import pairs as pairs, with_unit as with_unit
from thermid.model.deck import load_model
from thermid.model.elements import Standing, literal
from thermid.model.tree import Model
from thermid.prediction.bands import Filed, filed
from thermid.reporting.objects import VIEW_SCHEMA, clean
from thermid.reporting.pages import check_page, page_to_pdf
from thermid.simulation.runs import Workers
from thermid.simulation.scenario_files import Scenario, load_scenario
from thermid.values.store import model_standing

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
ValuesPath = Annotated[Path | None, typer.Option("--values", help="A file of fitted values to lay over the deck.")]
KeepValues = Annotated[
    bool, typer.Option("--keep-values", help="Keep values whose decks say otherwise by now; without it they are left out and listed.")
]
Processes = Annotated[int, typer.Option("--workers", help="Processes of this machine.", min=1)]
Cluster = Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler, tcp://host:8786.")]
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
Page = Annotated[Path | None, typer.Option("--to", help="The page to write; a PDF where the name ends in .pdf.")]
Audience = Annotated[
    str, typer.Option("--for", help="summary (2 sheets), agency (what a reviewer reads) or all; long tables are CSV files beside it.")
]
Pdf = Annotated[Path | None, typer.Option("--pdf", help="The page as PDF, printed by an installed Chromium, Chrome or Edge.")]

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


WORTH_SAYING: Final = 10.0
"""What a descent or a search will take at least where a line of its own says it beforehand. [s]"""


class CampaignProgress(Progress):
    """How far the fits of a campaign are.

    The time left is an estimate: a stage is weighed by what it frees, and a search of some evaluations is taken to be half done after
    `HALF` of them.

    Parameters
    ----------
    weights : dict      Stage -> its share of the work, in any unit.
    """

    HALF = 6

    def __init__(self, weights: Mapping[str, float]) -> None:
        super().__init__("reading logs")
        self._weights = dict(weights)
        self._finished: dict[str, None] = {}
        self._until: float | None = None

    def __call__(self, stage: str, count: int, rms: float) -> None:
        """Show how far a stage is."""
        before = sum(self._weights.get(name, 1.0) for name in self._finished if name != stage)
        self._finished[stage] = None
        whole = sum(self._weights.values()) or 1.0
        inside = self._weights.get(stage, 0.0) * count / (count + self.HALF)
        if stage not in self._finished or not count:
            self._until = None
        words = f"{stage}: evaluation {count}, weighted RMS {rms:.3g}" if count else stage
        self.now(words, (before + inside) / whole, stage)

    def ahead(self, stage: str, words: str, seconds: float) -> None:
        """Say what follows in a stage, and what it will take [s]."""
        self._until = time.monotonic() + seconds
        if seconds >= WORTH_SAYING:
            self.say(f"{stage}: {words}, about {spoken(seconds)}. The interrupt key ends it with the best values so far.")

    def time_left(self) -> str:
        """Return the time left in words: of what is being done, where that was priced, beside that of the whole."""
        whole, now = super().time_left(), time.monotonic()
        if self._until is None or self._until - now < 1.0:
            return whole
        return f", about {spoken(self._until - now)} left of this stage" + whole.replace(" left", " of the campaign")


def campaign_progress(path: Path) -> CampaignProgress:
    """Return the progress of a campaign's fits."""
    return CampaignProgress({stage.name: 1.0 + len(stage.free) for stage in read_campaign(path).content.stages})


def executor_of(workers: int, cluster: str) -> Workers:
    """Return who does tasks, as the options say; None for this process alone."""
    return cluster or (workers if workers > 1 else None)


def staged(
    path: Path,
    data: Path | None,
    results: Path | None,
    accept: Sequence[str] | None = None,
    fresh: bool = False,
    executor: Workers = None,
) -> Campaign:
    """Run a campaign with progress, taking finished stages from the results folder: beside the campaign by default."""
    folder = results if results is not None else path.parent / "results"
    with campaign_progress(path) as progress:
        return run_stages(path, data=data, notice=progress, cache=None if fresh else folder, accept=accept or (), executor=executor)


def leave(standing: Standing, code: int = 0) -> NoReturn:
    """End a command whose answer was given: with its own exit code, or that of the values which the answer rests on."""
    raise SystemExit(min(code, standing.exit_code, key=PRECEDENCE.index))


def answer(standing: Standing, as_json: bool, content: Mapping[str, Any], text: object, verbose: bool | None = None) -> NoReturn:
    """Print an answer below the standing of the values that it rests on, as `say` does, and end the command by that."""
    say(as_json, {**content, "standing": standing.to_dict()}, standing.over(str(text)), verbose)
    leave(standing)


NEEDS = {PICTURE.name: "report", NETCDF.name: "export"}
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
            may_write(path, kind)


def ready(to: Path | None, pdf: Path | None) -> tuple[Path | None, Path | None]:
    """Return the page and the PDF to write; look for what they need, and at the files, before anything long begins.

    A page whose name ends in .pdf is a PDF.

    Raises
    ------
    ScenarioError       When two PDFs are asked for.
    MissingExtraError   When a package that draws pages is not installed.
    NoBrowserError      When a PDF is asked for and nothing can print it.
    OutputError         When a file may not be written, or has the ending of another format.
    """
    if to is not None and to.suffix.lower() == ".pdf":
        if pdf is not None:
            raise ScenarioError(f"'{to}' and '{pdf}' are both PDFs. Give one of them; the page itself ends in .html.", "--to")
        to, pdf = None, to
    if to is not None or pdf is not None:
        require("report", "a report")
    if pdf is not None:
        check_ending(pdf, PAPER)
    for path in (to, pdf):
        if path is not None:
            check_page(path)
    return to, pdf


def written(write: Callable[[Path], Path], to: Path | None, pdf: Path | None) -> dict[str, str]:
    """Write a page, its PDF, or both; return what was written by its name in the JSON object."""
    out = {"page": str(write(to))} if to is not None else {}
    if pdf is not None:
        out["pdf"] = str(write(pdf) if to is None else page_to_pdf(to, pdf))
    return out


def fitted_model(deck: Path, values: Path | None, keep: bool | None = False, param: Sequence[str] = ()) -> Model:
    """Return a deck's model with a values file and parameters laid over it; what the file lacks and what is left out is told first.

    Parameters
    ----------
    keep : bool     Whether to keep values that the decks give otherwise by now; None for a command that cannot.
    """
    model = load_model(deck)
    if values is not None:
        filled = filed(values, model, keep=bool(keep))
        say_first(filled, values, " --keep-values keeps it." * (keep is not None))
        model = filled.model
    return model.with_values(pairs(list(param), "--param"), "command line") if param else model


def judged_model(
    deck: Path, values: Path | None, keep: bool = False, param: Sequence[str] = (), accept: Sequence[str] | None = None
) -> tuple[Model, Standing]:
    """Return a model as `fitted_model` does, and how far its values may be trusted, stages that are accepted as they are apart."""
    model = fitted_model(deck, values, keep, param)
    return model, model_standing(model).accept(accept or ())


def say_first(filled: Filed, file: Path, advice: str = " --keep-values keeps it.") -> None:
    """Tell what a values file lacks, what of it is left out with an advice, and what is hidden."""
    for line in (*filled.lacks, *(f"{gone}{advice}" for gone in filled.gone), *filled.hidden):
        show(f"{file.name}: {line}", err=True)


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
        raise ScenarioError("--vacuum keeps radiation and --as-printed drops it; give one of them.")
    return scenario.vacuum(as_printed=as_printed) if vacuum or as_printed else scenario


def moments(texts: list[str], seconds: float) -> list[float]:
    """Return the times of ``--at`` within a run of that length. [s]"""
    times = [literal(with_unit(t, "s"), "s", "--at") for t in texts]
    outside = [t for t in times if not 0 <= t <= seconds]
    if outside:
        raise ScenarioError(f"{outside[0]:g} s lies outside the run of {seconds:g} s.", "--at")
    return times
