"""What a search of structures proves becomes the next structure of a campaign: decks and campaign written beside the old ones."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomlkit
from tomlkit.items import AoT

from thermid.base.errors import DeckError, IdentificationError, ThermidError, refuse_unknown
from thermid.base.files import read_text, unsealed
from thermid.base.units import short
from thermid.campaign._file import CampaignSource
from thermid.campaign._stages import run_stages
from thermid.campaign._start.project import TEMPLATE
from thermid.fit.calibration import Calibration, Request, fit
from thermid.inference.criticism import EVALUATIONS, MissingElement, StructureSearch, search_structure
from thermid.measure.records import Record
from thermid.model.tree import Model, Parameter, save_model
from thermid.simulation.runs import Workers, refuse_unseen

if TYPE_CHECKING:
    from thermid.campaign._schema import RecordTable

LATE = "logged powers and commands act late"
DELAY = "delay"
"""What the delay of a record is called among the local values of a fit."""
NEXT = "next"
"""Folder of the new decks, and what the new campaign's name ends in."""


@dataclass(frozen=True)
class Delay:
    """Logged powers and commands that act late, as the campaign says it of a record table.

    Parameters
    ----------
    table : str             Its name.
    ends : (low, high)      Where the fit finds the delay. [s]
    channels : tuple        What is late; empty for every load and command.
    found : dict            Record -> delay and its standard error. [s]
    others : tuple of str   Further stages and verdicts that take records of this table.
    """

    table: str
    ends: tuple[float, float]
    channels: tuple[str, ...]
    found: Mapping[str, tuple[float, float]]
    others: tuple[str, ...] = ()

    @property
    def step(self) -> dict[str, Any]:
        """The step of `prepare`."""
        return {"delay": {"by": [f"{t:.6g} [s]" for t in self.ends], **({"channels": list(self.channels)} if self.channels else {})}}

    def to_dict(self) -> dict[str, Any]:
        """Return table, range [s], delays found [s] and who else takes its records."""
        delays = {n: {"delay_s": value, "error_s": error} for n, (value, error) in self.found.items()}
        return {"records": self.table, "range_s": list(self.ends), "found": delays, "also_in": list(self.others)}

    def __str__(self) -> str:
        """Return what was found, where it is written, and for whom else it holds."""
        delays = ", ".join(f"{n} {short(value, 3)} +- {short(error, 2)} s" for n, (value, error) in self.found.items())
        also = f" It also applies in {', '.join(self.others)}." if self.others else ""
        return f"delay: {delays}; written into [records.{self.table}].{also}"


@dataclass(frozen=True, eq=False)
class Improved:
    """A stage before and after.

    Parameters
    ----------
    search : StructureSearch        The first one.
    before, after : Calibration     The stage as it is, and with what is proposed; the same where nothing is.
    files : tuple of Path           What was written; empty where nothing is proposed.
    delays : tuple of Delay         Of logged powers and commands, by record table of the campaign.
    then : StructureSearch          The search beside these delays, for what else changes; None where there are none.
    refused : str                   Why a full fit refuses the proposal, so that nothing was written; empty where it does not.
    """

    search: StructureSearch
    before: Calibration
    after: Calibration
    files: tuple[Path, ...]
    delays: tuple[Delay, ...] = ()
    then: StructureSearch | None = None
    refused: str = ""

    @property
    def last(self) -> StructureSearch:
        """The last search."""
        return self.then or self.search

    @property
    def changes(self) -> tuple[str, ...]:
        """What is proposed."""
        if self.then is None:
            return tuple(c.name for c in self.search.proposed.changes)
        return (LATE, *(c.name for c in self.then.proposed.changes))

    def rows(self) -> list[dict[str, Any]]:
        """Return sensor, RMSE before and after [K], median over records, and independent samples per record."""
        return [{"sensor": s, "before_K": self.before.median_rmse(s), "after_K": self.after.median_rmse(s)} for s in self.before.sensors]

    def __str__(self) -> str:
        """Return the proposal, both fits side by side, and the files."""
        lines = (
            [str(self.search)] if self.then is None else [f"Proposed: {LATE}.", *(f"  {d}" for d in self.delays), f"With it: {self.then}"]
        )
        lines += [f"  nothing was written, because a full fit refuses the proposal: {self.refused}"] if self.refused else []
        if self.files:
            lines += [f"  {'RMSE [K]':<16}{'before':>10}{'after':>10}"]
            lines += [f"  {r['sensor']:<16}{short(r['before_K'], 3):>10}{short(r['after_K'], 3):>10}" for r in self.rows()]
            lines.append(f"  {'free values':<16}{len(self.before.fitted):>10}{len(self.after.fitted):>10}")
            lines += [f"wrote {file}" for file in self.files]
        return "\n".join(lines)


def improve(
    path: Path,
    stage: str = "",
    evaluations: int = EVALUATIONS,
    data: Path | None = None,
    results: Path | None = None,
    *,
    executor: Workers = None,
) -> Improved:
    """Search for the next structure of a stage and write it beside the campaign.

    Parameters
    ----------
    path : Path         The campaign.
    stage : str         One of its stages; the last by default.
    evaluations : int   Budget of the search.
    data : Path         Folder of logs outside the project.
    results : Path      Folder of finished stages; ``results`` beside the campaign by default.
    executor            As in `ensemble`: who makes the refits of a round, and of the stages below; the same proposal from all.

    Raises
    ------
    DeckError               When there is no such stage, or it fits nothing.
    OutputError             When a file is there that thermid did not write.
    """
    source, name, before, request = _stage_to_improve(path, stage, data, results, executor)
    may = _may_delay(source, request)
    first = search_structure(
        request, changes=lambda s: [c for c in s.changes() if may or not c.delay], evaluations=evaluations, executor=executor
    )
    if first.proposed is first.start:
        return Improved(first, before, before, ())
    longest = 2.0 * sum(c.delay for c in first.proposed.changes)
    if not longest:
        try:
            after = _full_fit(first.proposed.full_request, name, first.proposed.changes)
        except IdentificationError as error:
            return Improved(first, before, before, (), refused=error.message)
        return Improved(first, before, after, tuple(_written(path, name, request, first.proposed.full_request, ())))
    # a delay in whole samples leaves residuals that other changes would answer: they are asked again beside the delay that a fit finds
    ranged = replace(request, records=tuple(_ranged(r, longest) for r in request.records))
    delays_found = _delays_of(_full_fit(ranged, name))
    late = replace(
        request, records=tuple(r.delayed(delays_found[r.name][0], _driven(r)) if r.name in delays_found else r for r in request.records)
    )
    remaining = max(evaluations - first.evaluations, evaluations // 2)
    then = search_structure(
        late, changes=lambda s: [c for c in s.changes() if _beside_a_delay(c, late.records)], evaluations=remaining, executor=executor
    )
    new, longest = then.proposed.full_request, max(longest, float(f"{2.0 * max(value for value, _ in delays_found.values()):.3g}"))
    new = replace(new, records=tuple(_rebound(_ranged(old, longest), one) for old, one in zip(request.records, new.records, strict=True)))
    try:
        after = _full_fit(new, name, then.proposed.changes)
    except IdentificationError as error:
        return Improved(first, before, before, (), then=then, refused=error.message)
    delays = _delay_of_tables(source, name, request, after, longest)
    return Improved(first, before, after, tuple(_written(path, name, request, new, delays)), delays, then)


def _stage_to_improve(
    path: Path, stage: str, data: Path | None, results: Path | None, executor: Workers
) -> tuple[CampaignSource, str, Calibration, Request]:
    """Return the campaign, the name of the stage, its fit and its request.

    Raises
    ------
    DeckError     When there is no such stage, or it fits nothing.
    OutputError   When a file is there that thermid did not write.
    """
    source = CampaignSource.read(path, data)
    names = [s.name for s in source.content.stages]
    name = stage or names[-1]
    refuse_unknown([name], names, path.name, "no stage '{}'.", DeckError)
    TEMPLATE.titled(f"{path.stem}_{NEXT}").may_write(path.with_name(f"{path.stem}_{NEXT}.toml"))  # refused before the search
    before = run_stages(source.unjudged, cache=results or path.parent / "results", executor=executor).stages[name]
    if (request := before.request) is None or not request.records:
        raise DeckError(
            f"stage '{name}' has values tuned by hand and fits nothing, so structures cannot be compared. Give a stage that fits records.",
            path.name,
            code="campaign.refused",
        )
    refuse_unseen(request.model, "a search for another structure")
    return source, name, before, request


def _full_fit(request: Request, stage: str, changes: Sequence[MissingElement] = ()) -> Calibration:
    """Return the full fit of a proposed structure.

    Raises
    ------
    IdentificationError   When it is refused, or ends where a change is not physically possible.
    """
    try:
        fitted = fit(request)
    except ThermidError as error:
        raise IdentificationError(error.message, stage, code=error.code) from None
    for words, possible in (c.judge(fitted) for c in changes):
        if not possible:
            raise IdentificationError(f"it finds {words}, which is not physically possible.", stage, code="physics.not-possible")
    return fitted


def _driven(record: Record) -> list[str]:
    """Return the powers and commands that a record logs."""
    return [n for n, c in record.channels.items() if c.role in ("command", "load")]


def _may_delay(source: CampaignSource, request: Request) -> bool:
    """Return whether the campaign can say that powers and commands of the stage act late.

    It cannot where they come from a joined log, whose clock has an offset of its own, or where only the stage says that they are powers.
    A record whose clock the fit finds already has no second one.
    """
    if any(r.clocks for r in request.records):
        return False
    for r in request.records:
        if (driven := _driven(r)) and (
            r.name not in source.names() or source.names()[r.name][1].joined or not set(driven) <= set(_driven(source.record(r.name)))
        ):
            return False
    return True


def _rebound(record: Record, like: Record) -> Record:
    """Return a record whose sensors read what those of another one do."""
    return replace(record, channels={n: replace(c, target=like[n].target) for n, c in record.channels.items()})


def _ranged(record: Record, longest: float) -> Record:
    """Return a record with a delay that the fit finds, up to the longest [s]; as it is where it drives nothing."""
    return record.delayed((0.0, longest), _driven(record)) if _driven(record) else record


def _beside_a_delay(change: MissingElement, records: Sequence[Record]) -> bool:
    """Whether a change is asked for beside a delay: no other delay, and no course of a power where a log has its changes to a sample only.

    A power that changed earlier in an interval than in the mean of all leaves what a power that grows or settles would answer.
    """
    sampled = any(not r[n].prompt for r in records for n in _driven(r))
    return not change.delay and not (sampled and change.of_power)


def _delays_of(fit: Calibration) -> dict[str, tuple[float, float]]:
    """Return record -> delay and its standard error. [s]"""
    return {v.record: (v.value, v.error) for v in fit.local if v.name == DELAY}


def _delay_of_tables(source: CampaignSource, stage: str, request: Request, after: Calibration, longest: float) -> tuple[Delay, ...]:
    """Return what each record table of the campaign gets, what the fit found in its records, and who else takes them."""
    out: dict[str, Delay] = {}
    delays_of_record = _delays_of(after)
    for r in (r for r in request.records if r.name in delays_of_record):
        table = source.names()[r.name][1]
        group = next(g for g, t in source.content.records.items() if t is table)
        if group not in out:
            others = [s.name for s in source.content.stages if s.name != stage and _takes(source, s.records, table)]
            others += [f"the verdict on {v.record}" for v in source.content.verdicts if _takes(source, [v.record], table)]
            channels = () if _driven(r) == _driven(source.record(r.name)) else tuple(_driven(r))
            out[group] = Delay(group, (0.0, longest), channels, {}, tuple(dict.fromkeys(others)))
        out[group] = replace(out[group], found={**out[group].found, r.name: delays_of_record[r.name]})
    return tuple(out.values())


def _takes(source: CampaignSource, patterns: Sequence[str], table: RecordTable) -> bool:
    """Whether patterns of a stage take the records of a table."""
    return any(source.names()[n][1] is table for n in source.pick(patterns, source.path.name))


def _written(path: Path, stage: str, before: Request, after: Request, delays: Sequence[Delay]) -> list[Path]:
    """Write the deck of the new structure, those that have it as a part, and the campaign that takes them."""
    folder, campaign = path.parent / NEXT, path.with_name(f"{path.stem}_{NEXT}.toml")
    document = tomlkit.parse(unsealed(read_text(path)))
    table = next(t for t in document["stages"] if t["name"] == stage)
    before_deck = str(table["model"])
    deck = folder / Path(before_deck).name
    table["model"] = f"{NEXT}/{deck.name}"
    table["free"] = list(after.free)
    priors = {p: {"mean": mean, "sd": sd} for p, (mean, sd) in after.priors.items() if p not in before.priors}
    if priors:
        table["priors"] = tomlkit.item({**dict(table.get("priors", {})), **priors})
    if after.structural_errors:
        table["structural_errors"] = True
        table["search"] = after.search
    moved = {
        c.name: {c.role: str(c.target)}
        for one, other in zip(before.records, after.records, strict=True)
        for c in other.channels.values()
        if (c.role == "node" and c.target != one[c.name].target) or (c.role == "command" and one[c.name].role == "load")
    }
    if moved:
        table["bind"] = tomlkit.item({**dict(table.get("bind", {})), **moved})
    scenario, old = after.scenarios.get("*"), before.scenarios.get("*")
    if scenario is not None and old is not None and scenario.initial != old.initial:
        scenario_table = dict(table.get("scenario", {}))
        scenario_table["initial"] = {n: c if isinstance(c, str) else f"{c!r} [K]" for n, c in scenario.initial.items()}
        table["scenario"] = tomlkit.item(scenario_table)
    local = {n: s.to_table() for n, s in after.local.items() if n not in before.local}
    if local:
        table["local"] = tomlkit.item({**dict(table.get("local", {})), **local})
    for delay in delays:
        with_step(document["records"][delay.table], delay)
    folder.mkdir(exist_ok=True)
    save_model(replace(with_basis(after.model, stage), title=f"{after.model.title} {NEXT}"), deck)
    decks = {(path.parent / before_deck).resolve(): deck.resolve()}
    for other in (t for t in document["stages"] if t is not table and "model" in t):
        other["model"] = os.path.relpath(with_part(path.parent / str(other["model"]), decks), path.parent)
    TEMPLATE.titled(campaign.stem).save_text(campaign, tomlkit.dumps(document))
    return [deck, *(new for new in decks.values() if new.parent != deck.parent.resolve()), campaign]


def with_basis(model: Model, stage: str) -> Model:
    """Return a model whose values that fits laid over its deck are derived ones, on the basis of fit and deck."""
    given = {path: entry.parameter for path, entry in replace(model, layers=()).parameter_table().items()}

    def derived(path: str, fitted: Parameter) -> Parameter:
        """Return a fitted value with its source."""
        parameter = given.get(path, fitted)
        basis = filter(None, (f"fit of {fitted.note or repr(stage)}", parameter.source, parameter.basis))
        return replace(fitted, source="derived", basis="; ".join(basis))

    values = ({p: v if v.source else derived(p, v) for p, v in layer.values.items()} for layer in model.layers)
    return replace(model, layers=tuple(replace(layer, values=v) for layer, v in zip(model.layers, values, strict=True)))


def with_part(deck: Path, decks: dict[Path, Path]) -> Path:
    """Return the deck in which parts are those of `decks` (old -> new): itself where it has none of them, else written beside it.

    What is written joins `decks`.

    Raises
    ------
    OutputError   When a file is there that thermid did not write.
    """
    if deck.resolve() in decks:
        return decks[deck.resolve()]
    document, is_other = tomlkit.parse(unsealed(read_text(deck))), False
    for part in document.get("submodels", {}).values():
        file = deck.parent / str(part["use"])
        if file.exists() and (new := with_part(file, decks)) != file:
            part["use"], is_other = os.path.relpath(new, deck.parent), True
    if not is_other:
        return deck
    new = deck.with_name(f"{deck.stem}_{NEXT}.toml").resolve()
    TEMPLATE.titled(new.stem).save_text(new, tomlkit.dumps(document))
    decks[deck.resolve()] = new
    return new


def with_step(table: Any, delay: Delay) -> None:
    """Add a delay to what is done with the log of a record table, after all else."""
    if isinstance(table.get("prepare"), AoT):
        table["prepare"].append(tomlkit.item(delay.step))
        return
    if "prepare" not in table:
        table["prepare"] = tomlkit.array()
    step = tomlkit.inline_table()
    step.update(delay.step)
    table["prepare"].append(step)
