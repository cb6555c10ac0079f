"""What commands of a campaign share: its run with progress, its pages, and what it says on one screen."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from thermid.app.cli.screen import SCREEN, Progress, console, folded, severity, show_lines, width
from thermid.base.errors import NameNotFoundError, refuse_unknown, require, spoken
from thermid.base.results import VERDICTS
from thermid.base.units import counted, digits, short
from thermid.campaign.stages import Campaign, CampaignSource, Check, Verdict, run_stages
from thermid.fit.calibration import FIRST, LOUD, Calibration
from thermid.measure.records import open_questions
from thermid.reporting.pages import check_page
from thermid.simulation.runs import Workers
from thermid.values.store import FittedValue

Row = tuple[str, ...]
WORTH_SAYING: Final = 10.0
"""What a descent or a search will take at least where a line of its own says it beforehand. [s]"""
LEAST_VALUES: Final = 3
"""Values of each stage that a terminal shows at least, the most uncertain first, however many stages there are."""
NAMED_INPUTS: Final = 3
"""Inputs of a kind that are named where they are assumed; of more, their number is."""


class CampaignProgress(Progress):
    """How far the fits of a campaign are.

    The time left is an estimate from the stages that are finished, each weighed by what it frees.

    Parameters
    ----------
    weights : dict      Stage -> its share of the work, in any unit.
    """

    def __init__(self, weights: Mapping[str, float]) -> None:
        super().__init__("reading logs")
        self._weights = dict(weights)
        self._stages: dict[str, None] = {}
        self._until: float | None = None

    def __call__(self, stage: str, count: int, rms: float) -> None:
        """Show how far a stage is."""
        if stage not in self._stages or not count:
            self._until = None
        self._stages[stage] = None
        before = sum(self._weights.get(name, 1.0) for name in self._stages if name != stage)
        whole = sum(self._weights.values()) or 1.0
        words = f"{stage}: evaluation {count}, weighted RMS {rms:.3g}" if count else stage
        self.now(words, before / whole, stage)

    def ahead(self, stage: str, words: str, seconds: float) -> None:
        """Say what follows in a stage, and what it will take [s]."""
        self._stages[stage] = None
        self._until = time.monotonic() + seconds
        if seconds >= WORTH_SAYING:
            self.say(f"{stage}: {words}")

    def time_left(self) -> str:
        """Return the time left in words: of what is being done, where that was priced, beside that of the whole."""
        whole, now = super().time_left(), time.monotonic()
        if self._until is None or self._until - now < 1.0:
            return whole
        return f", about {spoken(self._until - now)} left of this stage" + whole.replace(" left", " of the campaign")


def campaign_progress(path: Path) -> CampaignProgress:
    """Return the progress of a campaign's fits."""
    return CampaignProgress({stage.name: 1.0 + len(stage.free) for stage in CampaignSource.read(path).content.stages})


def staged(
    path: Path,
    data: Path | None,
    results: Path | None,
    accept: Sequence[str] | None = None,
    fresh: bool = False,
    executor: Workers = None,
    stage: str = "",
    records: Sequence[str] = (),
    judged: bool = True,
) -> Campaign:
    """Run a campaign with progress, taking finished stages from the results folder: beside the campaign by default.

    Of one `stage`, what it inherits from is run alone. What asks nothing of verdicts leaves hold-out records unopened (`judged`).

    Raises
    ------
    NameNotFoundError   When the campaign has no stage of the name that an option gives; before anything is fitted.
    RecordError         When it has no record of a name or pattern; before anything is fitted.
    """
    folder = results if results is not None else path.parent / "results"
    source = CampaignSource.read(path, data)
    refuse_unknown([stage] if stage else [], [s.name for s in source.content.stages], path.name, "no stage '{}'.", NameNotFoundError)
    source.pick(records, "--record")
    with campaign_progress(path) as progress:
        only = [stage] if stage else []
        asked = source if judged else source.unjudged
        return run_stages(asked, notice=progress, cache=folder, accept=accept or (), fresh=fresh, only=only, executor=executor)


def check_target(to: Path | None) -> None:
    """Look for what a page needs, and at the file that is written, before anything long begins; a page whose name ends in .pdf is a PDF.

    Raises
    ------
    MissingExtraError   When a package that draws pages is not installed.
    NoBrowserError      When a PDF is asked for and nothing can print it.
    OutputError         When the file may not be written, or has the ending of another format.
    """
    if to is not None:
        require("report", "a report")
        check_page(to)


def named_page(to: Path) -> dict[str, str]:
    """Return a page that was written by its name in the JSON object: a page or a PDF."""
    return {"pdf" if to.suffix.lower() == ".pdf" else "page": str(to)}


@dataclass(frozen=True)
class StageRows:
    """The table of a stage: a line of its own, rows of its values, and sentences below that nobody may miss."""

    name: str
    state: str
    sensor: str
    values: tuple[Row, ...]
    notes: tuple[str, ...]

    def lines(self, most: int) -> int:
        """How many lines it takes with so many values at most."""
        return 1 + min(len(self.values), most) + sum(map(_rows, self.notes))

    def head(self, most: int) -> str:
        """Return its own line."""
        count = len(self.values)
        shown = f"{counted(count, 'value')}{f', {most} shown' if 0 < most < count else ''}"
        return f"{self.name}: {self.state}; {shown}; {self.sensor}"


def show_campaign(campaign: Campaign, files: Sequence[str]) -> None:
    """Print a campaign: summary first, then a table a stage.

    Parameters
    ----------
    campaign : Campaign  What ran.
    files : sequence    Names of the values files that were written.
    """
    from rich.table import Table

    out = console()
    printed: set[str] = set()
    top, blocks = list(_top(campaign)), [_block(campaign, name, fit, printed) for name, fit in campaign.stages.items()]
    assumed = list(_assumed_lines(campaign))
    judged = [line for v in campaign.verdicts for line in (_verdict_line(v), *(f"{v.record}: {question}" for question in v.questions))]
    below = [*judged, *_closing_lines(campaign, files)]
    around = sum(map(_rows, (*top, *assumed, *below))) + 2
    fitting = (n for n in (12, 8, 6, 5, 4) if around + sum(b.lines(n) for b in blocks) <= SCREEN)
    most = next(fitting, LEAST_VALUES) if out.is_terminal else max(len(b.values) for b in blocks)
    show_lines(out, [*top, ""])
    widths = [max((len(row[k]) for b in blocks for row in b.values[:most]), default=0) for k in range(5)]
    for block in blocks:
        show_lines(out, [block.head(most)], severity(f"state: {block.state}"))
        table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
        for k, size in enumerate(widths):
            table.add_column(justify="right" if k in (1, 4) else "left", min_width=min(size, 40), overflow="fold")
        for row in block.values[:most]:
            table.add_row(*row)
        if block.values[:most]:
            out.print(table)
        show_lines(out, block.notes, "yellow")
    show_lines(out, assumed, "yellow")
    out.print()
    show_lines(out, below)


def _rows(line: str) -> int:
    """Return how many rows of the terminal a line takes."""
    return len(folded(line, width()))


def _top(campaign: Campaign) -> Iterator[str]:
    """Yield the answer: what must not be used, what passed, the worst sensor of the hold-out records, what would explain a bad fit."""
    yield from _questions_to_owner(campaign)
    if line := campaign.standing.line(link="stage"):
        yield line
    judged = [v for v in campaign.verdicts if v.passed is not None]
    synthetic = ", synthetic data" if any(fit.synthetic for fit in campaign.stages.values()) else ""
    yield f"{campaign.title}: {campaign.counts}{synthetic}"
    checks = [(v, c) for v in judged for c in v.checks]
    if checks:
        v, c = max(checks, key=lambda pair: pair[1].used)
        yield f"worst hold-out sensor: {_check_text(c)}, in {v.record}"
    for name, mistakes in campaign.mistakes.items():
        yield from (f"{name}: {line}" for line in mistakes.lines())
    for clause, stages in _common(campaign).items():
        where = f"all {len(stages)} stages" if len(stages) == len(campaign.stages) else f"stages {', '.join(stages)}"
        yield f"{clause} ({where}; -v says more of each)"


def _common(campaign: Campaign) -> dict[str, list[str]]:
    """Return what several stages are to be checked for, in the same words -> these stages."""
    stages_of: dict[str, list[str]] = {}
    for name, fit in campaign.stages.items():
        for clause in dict.fromkeys(_clause(w) for w in fit.warnings if w.startswith(FIRST) and w not in _questions_to_owner(campaign)):
            stages_of.setdefault(clause, []).append(name)
    return {clause: stages for clause, stages in stages_of.items() if len(stages) > 1}


def _clause(warning: str) -> str:
    """Return what a warning says before it comes to the names and figures of its own stage."""
    before, quote, _ = warning.partition("'")
    return before.rpartition(", ")[0] if quote and ", " in before else warning


def _questions_to_owner(campaign: Campaign) -> tuple[str, ...]:
    """Return what the owner of the logs should answer first."""
    records = [r for fit in campaign.stages.values() if fit.request is not None for r in fit.request.records]
    return tuple(f"{FIRST}{question}" for question in open_questions(records))


def _check_text(c: Check) -> str:
    """Return a check of a verdict as text: sensor, what was found and its limit. [K]"""
    return f"{c.sensor}, {c.title} {short(c.found, 3)} K, limit {short(c.limit, 3)} K".removeprefix(", ")


def _assumed_lines(campaign: Campaign) -> Iterator[str]:
    """Yield what the fits assumed, each reason once, with the stages and what of each: names of a few of a kind, else their number."""
    reasons = (
        (lambda i: i.kind == "accuracy", "accuracy not stated, so readings count as exact"),
        (lambda i: i.kind != "accuracy" and not i.partly, "assumed, because neither log nor scenario gives it"),
        (lambda i: i.kind != "accuracy" and i.partly, "assumed where the log is silent, because its channel begins late or ends early"),
    )
    for of_reason, words in reasons:
        stages = []
        for name, fit in campaign.stages.items():
            kinds: dict[str, dict[str, None]] = {}
            for i in filter(of_reason, fit.inputs.assumed):
                kinds.setdefault("channel" if i.kind == "accuracy" else i.kind, {})[i.name] = None
            texts = [f"{', '.join(n)} ({kind})" if len(n) <= NAMED_INPUTS else counted(len(n), kind) for kind, n in kinds.items()]
            stages += [f"{name}: {', '.join(texts)}"] if texts else []
        if stages:
            yield f"{words}: {'; '.join(stages)}"


def _block(campaign: Campaign, name: str, fit: Calibration, printed: set[str]) -> StageRows:
    """Return the table of a stage; advice that was `printed` for an earlier stage is left out, and other advice is added to that."""
    fitted = [v for v in fit.estimates.values() if v.kind in ("parameter", "level")]
    worst = max(fit.sensors.items(), key=lambda item: item[1].rmse, default=None)
    sensor = (
        f"worst sensor {worst[0]}, RMSE {short(worst[1].rmse, 2)} K" if worst is not None else "tuned by hand" if fitted else "not fitted"
    )
    elsewhere = {*_questions_to_owner(campaign), *_common(campaign)}
    notes = []
    for warning in (w for w in fit.warnings if w.startswith(FIRST) and not {w, _clause(w)} & elsewhere):
        finding, _, advice = warning.partition(". ")
        notes.append(f"{name}: {f'{finding}.' if advice in printed and advice else warning}")
        printed.add(advice)
    if step := campaign.next_step(name):
        notes.append(f"{name}: next: {step}")
    rows = sorted(fitted, key=lambda v: -v.relative if math.isfinite(v.relative) else 0.0)
    notes += [f"{name}: {clock} {words}" for clock, words in fit.clocks.items()]
    notes += [f"{name}: {w}" for w in fit.warnings if any(w.startswith(f"'{clock}' ") for clock in fit.clocks)]
    return StageRows(name, fit.standing.state, sensor, tuple(map(_value, rows)), tuple(notes))


def _value(v: FittedValue) -> Row:
    """Return the cells of an estimate: path, value, standard error, unit and relative error."""
    error = v.shown(v.error)
    per_cent = f"{short(100.0 * v.relative, 2)} %" if math.isfinite(v.relative) else ""
    return (f"  {v.path}", digits(v.in_unit, error), f"+- {short(error)}", v.unit, per_cent)


def _verdict_line(v: Verdict) -> str:
    """Return a verdict with the criterion that decides it."""
    if v.passed is None:
        return f"{v.head}; the record was not opened"
    before = f", no longer independent: {counted(len(v.failed_before), 'failed verdict')} before" if v.failed_before else ""
    if (c := v.worst) is None:
        return v.head + before
    count = f"; {len(v.missed)} of {len(v.checks)} criteria not met" if v.missed else ""
    return f"{v.head}{before}; {_check_text(c)}: {VERDICTS[c.passed]}{count}"


def _closing_lines(campaign: Campaign, files: Sequence[str]) -> Iterator[str]:
    """Yield how many warnings are not shown, which stages were fitted again and why, and the files with the values."""
    warned = {name: n for name, fit in campaign.stages.items() if (n := sum(not w.startswith((LOUD, FIRST)) for w in fit.warnings))}
    if warned:
        yield f"{counted(sum(warned.values()), 'warning')} in {counted(len(warned), 'stage')}; -v prints them with all details"
    again: dict[str, list[str]] = {}
    for stage, changed in campaign.changed.items():
        if changed:
            again.setdefault(", ".join(changed), []).append(stage)
    for what, stages_again in again.items():
        yield f"fitted again, because {what} changed since the results were kept: {', '.join(stages_again)}"
    yield f"values: {files[0]} and {len(files) - 1} more" if len(files) > 3 else f"values: {', '.join(files)}"
