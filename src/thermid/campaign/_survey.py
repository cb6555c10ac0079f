"""What the logs of each stage can tell; whether a campaign can run at all; its predictions; a fleet's units; a test that still runs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.base.errors import (
    DeckError,
    IdentificationError,
    NameNotFoundError,
    RecordError,
    ThermidError,
    code_of,
    errors_at,
    refuse_unknown,
)
from thermid.base.files import resolve_inside
from thermid.base.units import kelvin, value_of
from thermid.campaign._file import CampaignSource, bound_by, plain_tables, scenario_of
from thermid.campaign._judge.limits import Limits
from thermid.campaign._judge.predictions import CampaignPrediction
from thermid.campaign._stages import Campaign, Notice, keyed, readings_of, request_of, run_stages
from thermid.fit.calibration import (
    FIRST,
    Calibration,
    Input,
    InputTable,
    LocalSpec,
    Request,
    Unknown,
    build_problem,
    first_reading,
    fit,
    strange_powers,
)
from thermid.inference.fleets import Fleet, fleet_of
from thermid.inference.intervals import Identifiability, identifiability
from thermid.measure.records import Record, open_questions, stray_readings
from thermid.model.tree import Finding, Model
from thermid.prediction.bands import predict
from thermid.simulation.runs import Environment, Scenario, Workers, compile_network, load_scenario
from thermid.values.store import Normal, Source, State, Store, ValueOrigin

if TYPE_CHECKING:
    from thermid.campaign._schema import PredictionTable, RecordTable, StageTable, VerdictTable


@dataclass(frozen=True, eq=False)
class RunningTest:
    """What a campaign says of a log that it has not yet.

    Parameters
    ----------
    model : Model               Of the stage, with its fitted values.
    table : RecordTable         Of the record that the log is like.
    stage : StageTable          Its bindings and conditions.
    first : dict                Boundary -> channel whose first reading stands there, and what is added to it [K].
    title : str                 Of the campaign.
    environment : dict          Gas node -> its state, as the record's table has it.
    """

    model: Model
    table: RecordTable
    stage: StageTable
    first: Mapping[str, tuple[str, float]]
    title: str
    environment: Mapping[str, Environment] = field(default_factory=dict)

    @property
    def options(self) -> dict[str, Any]:
        """What `read_record` is told beside the channels."""
        t = self.table
        return {"time": t.time, "separator": t.separator, "decimal": t.decimal, "clock": t.clock, "units": t.units}

    def bound(self, record: Record) -> Record:
        """Return a record with the bindings of the stage."""
        return bound_by(record, self.stage)

    def conditions(self, record: Record, stated: Scenario | None = None) -> Scenario:
        """Return what a log does not say: as told, else as the stage has it."""
        out = scenario_of(self.stage.scenario, record.name)
        if stated is not None and stated.start != "":
            out = replace(out, initial={})
        starts = {n: t.start for n, t in {**self.stage.local, **self.table.local}.items() if n.startswith("initial.")}
        out = out.with_(initial={**{n.removeprefix("initial."): t for n, t in starts.items()}, **out.initial})
        if stated is not None:
            start = {} if stated.start == "" else {"start": stated.start}
            out = out.with_(boundaries=stated.boundaries, loads=stated.loads, initial=stated.initial, **start)
        out = out.with_(environment={**self.environment, **(stated.environment if stated is not None else {})})
        targets = {c.target or c.name for c in record.channels.values()}
        open_ = {b: first_value for b, first_value in self.first.items() if b not in out.boundaries and b not in targets}
        read = {b: f"{first_reading(record, channel) + added} [K]" for b, (channel, added) in open_.items()}
        return out.with_(boundaries=read)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader must know of it."""
        steps = [next(iter(step)) for step in self.table.prepare]
        omitted = (f"preparation of the record ({', '.join(steps)}) is left out, because the log still grows",) if steps else ()
        return (
            *omitted,
            *(f"temperature of {b}: the first reading of {c}, unless --boundary gives it" for b, (c, _) in self.first.items()),
        )

    @staticmethod
    def of_campaign(campaign: Campaign, record: str = "") -> RunningTest:
        """Return what a campaign says of a test that runs, with the model and values of the last stage that fits such a record.

        Where no stage fits it, the last stage counts.

        Parameters
        ----------
        campaign : Campaign  Its result, from a file.
        record : str        The record that the log is like; not needed where there is one.

        Raises
        ------
        RecordError             When there is no such record, or several and none is named.
        IdentificationError     When the campaign was made in Python.
        """
        source = campaign.source
        if source is None:
            raise IdentificationError(
                "a campaign made in Python has no records of a file. Give its file.", campaign.title, code="campaign.not-from-file"
            )
        record = _named(record, list(source.content.records), campaign.title)
        name = [*campaign, *(n for n, request in campaign.requests.items() if record in {r.name for r in request.records})][-1]
        model = campaign[name].model
        stage_table = next(s for s in source.content.stages if s.name == name)
        table = source.table_of(record)
        first = {n: (t.start, 0.0) for n, t in {**stage_table.local, **table.local}.items() if "." not in n and t.start in table.channels}
        values, gases = compile_network(model).numbers().values, source.environment_of(record, table)
        for n, reading in stage_table.readings.items():
            channel, path = (reading, "") if isinstance(reading, str) else (reading.channel, reading.offset)
            first[n] = (channel, float(value_of(values[path])) if path else 0.0)
        return RunningTest(
            model, table, stage_table, {n: f for n, f in first.items() if not n.startswith("initial.")}, campaign.title, gases
        )


def _named(record: str, names: Sequence[str], title: str) -> str:
    """Return the record that is asked for."""
    if not record and len(names) > 1:
        raise RecordError(
            f"the campaign has several records. Name the one that the log is like: {', '.join(names)}.", title, code="name.unknown"
        )
    return record or names[0]


def survey(
    campaign: str | os.PathLike[str],
    stage: str = "",
    *,
    after: bool = False,
    data: str | os.PathLike[str] | None = None,
    cache: str | os.PathLike[str] | None = None,
    notice: Notice | None = None,
    executor: Workers = None,
) -> dict[str, Identifiability]:
    """Return stage -> what its logs can tell of what it frees, before its own fit, so that a stage that would be refused is explained too.

    Parameters
    ----------
    campaign : path         The campaign file.
    stage : str             One stage; all of them when empty. Stages below it are fitted, since it starts from what they found.
    after : bool            Look at the ends of the fits and not at their starts.
    data : path             A folder of logs outside the project.
    cache, notice, executor    As in `run_stages`.

    Raises
    ------
    NameNotFoundError   When there is no such stage.
    """
    folder = Path(cache) if cache is not None else None
    source = replace(CampaignSource.read(campaign, data), results=folder)
    stages = source.content.stages
    names = [s.name for s in stages]
    wanted = [stage] if stage else names
    refuse_unknown(wanted, names, source.content.title, "no stage '{}'.", NameNotFoundError)
    fits = {*wanted} if after else source.below(wanted)
    run = run_stages(source.unjudged, notice=notice, cache=folder, only=fits, executor=executor) if fits else None
    done, keys = (run.stages, dict(run.keys)) if run is not None else ({}, {})
    if after:
        return {name: identifiability(done[name]) for name in wanted if done[name].values.parameters}
    out = {}
    for k, table in enumerate(stages):
        if table.name in wanted:
            with errors_at(source.where(f"stages.{k}"), ": "):
                request, _ = keyed(request_of(source, table, k, done), table, keys)
                if request.free:
                    out[table.name] = Identifiability.of_problem(request)
    return out


def check_campaign(
    campaign: str | os.PathLike[str], data: str | os.PathLike[str] | None = None
) -> tuple[tuple[Finding, ...], dict[str, InputTable]]:
    """Return what would stop or mislead a campaign, and the inputs of each stage; every log is opened and bound, and none is fitted.

    Of records that verdicts hold out, files, columns and bindings are checked; none of their numbers is shown.

    Parameters
    ----------
    campaign : path     The campaign file.
    data : path         A folder of logs outside the project.

    Raises
    ------
    DeckError   When the campaign or a deck does not follow its grammar.
    """
    source = CampaignSource.read(campaign, data)
    tables = source.content.stages
    files = {stage.model: source.where(f"stages.{k}.model") for k, stage in enumerate(tables)}
    findings: list[Finding] = []
    questions: list[Finding] = []
    inputs: dict[str, InputTable] = {}
    requests: dict[str, Request] = {}
    below: dict[str, Calibration] = {}
    # as the tables have them: a stage with an error binds nothing, and what its logs scale by is used all the same
    tied = [t for r in source.content.records.values() for t in r.channels.values()] + [t for s in tables for t in s.bind.values()]
    gains = {str(t["gain"]) for t in tied if isinstance(t, Mapping) and "gain" in t}
    for k, stage in enumerate(tables):
        where = source.where(f"stages.{k}")
        try:
            # names are inherited from stages that are not fitted, with the values of their decks; not from one that would be refused
            all_below = all(name in below for inherit in stage.inherit.values() for name in inherit.stages)
            bare: dict[str, Any] = {"courses": {}} if all_below else {"courses": {}, "inherit": {}, "freeze": []}
            request = request_of(source, stage.model_copy(update=bare), k, below)
        except ThermidError as error:
            findings.append(_finding(error, where))
            continue
        requests[stage.name] = request
        questions += [Finding("warning", where, question, code_of(question)) for question in open_questions(request.records)]
        rows, wrong, unknowns = _bound(request, where)
        findings += wrong
        if all_below and not any(f.severity == "error" for f in wrong):
            below[stage.name] = fit(replace(request, hand=request.hand or _unfitted(stage.name, unknowns)))
        inputs[stage.name] = InputTable.in_order(rows)
    findings[:0] = [f for file, where in files.items() for f in source.model(file, where).check(gains)]
    for k, verdict in enumerate(source.content.verdicts):
        stage = next(s for s in tables if s.name == verdict.model)
        later = [s.name for s in tables[tables.index(stage) + 1 :] if s.model == stage.model]
        if later:
            said = f"the verdict judges the values of stage '{stage.name}'; '{later[-1]}' fits the same deck after it. Is that one meant?"
            findings.append(Finding("note", source.where(f"verdicts.{k}.model"), said, "campaign.verdict-before-refit"))
        findings += _judged_on(source, verdict, stage, requests.get(stage.name), source.where(f"verdicts.{k}"))
    for name, prediction in source.content.predictions.items():
        stage = next(s for s in tables if s.name == (prediction.stage or tables[-1].name))
        findings += _predicted(source, name, prediction, stage.model)
    return tuple(dict.fromkeys([*questions, *findings])), inputs


def _predicted(source: CampaignSource, name: str, prediction: PredictionTable, deck: str) -> list[Finding]:
    """Return what keeps a prediction of the campaign from being run."""
    where = source.where(f"predictions.{name}")
    try:
        network = compile_network(source.model(deck, where))
        scenario = scenario_asked(source, name, prediction)
        loads = {load.path for load in network.flat.loads}
        refuse_unknown(scenario.loads, loads, where, "the scenario gives the load '{}', which the model does not have.", NameNotFoundError)
        for node in (*(limit.node for limit in limits_of(prediction)), *scenario.boundaries):
            network.find(node, where)
    except ThermidError as error:
        return [_finding(error, where)]
    return []


def _unfitted(stage: str, unknowns: Sequence[Unknown]) -> Store:
    """Return the values that a fit of these unknowns would hand on, where it would start, each with an error of its own."""
    origin = ValueOrigin("fit", stage)
    states = {
        u.name: State(u.name, u.start, u.log, u.unit, (u.low, u.high), origin, paths=(u.name, *u.also), start=u.start) for u in unknowns
    }
    sources = tuple(Source(f"{stage}: {name}", "data", Normal()) for name in states)
    return Store(states, sources, np.eye(len(states)))


def _bound(request: Request, where: str) -> tuple[list[Input], list[Finding], list[Unknown]]:
    """Return the inputs of the records of a request, what stops or questions a run, and the values that the fit finds."""
    rows: list[Input] = []
    unknowns: dict[str, Unknown] = {}
    wrong: list[Finding] = []
    for record in request.records:
        try:
            problem = build_problem(replace(request, records=(record,)))
            problem.benches()
            rows += InputTable.of_request(request, problem.experiments, problem.unknowns).rows
            wrong += [
                Finding("warning", where, words.removeprefix(FIRST), "record.power-far-from-deck") for words in strange_powers(problem)
            ]
            unknowns |= {u.name: u for u in problem.unknowns if u.kind == "parameter"}
        except ThermidError as error:
            wrong.append(_finding(error, where))
    return rows, wrong, list(unknowns.values())


def _judged_on(source: CampaignSource, verdict: VerdictTable, stage: StageTable, request: Request | None, where: str) -> list[Finding]:
    """Return what keeps the record of a verdict from being run with its stage's model, and warnings of readings that stray."""
    try:
        records = tuple(source.bound(name, stage) for name in source.pick([verdict.record], where))
        if request is None:
            return []
        request_of_verdict = replace(
            request,
            records=records,
            free=(),
            priors={},
            weights={},
            scenarios={"*": scenario_of(verdict.scenario or stage.scenario, verdict.name or verdict.record)},
            local={n: LocalSpec.read(t, f"{where}.local.{n}") for n, t in plain_tables(verdict.local).items()},
            record_local={},
            readings=readings_of(verdict.readings if verdict.readings is not None else stage.readings),
            fit_start=False,
        )
    except ThermidError as error:
        return [_finding(error, where)]
    codes = [Finding("warning", where, remark, code_of(remark)) for remark in stray_readings(records)]
    return [*codes, *_bound(request_of_verdict, where)[1]]


def _finding(error: ThermidError, where: str) -> Finding:
    """Return an error as a finding, with its place in the campaign."""
    full = error.within(where, ": ")
    return Finding("error", full.where, full.message, full.code)


def fleet_in(
    campaign: str | os.PathLike[str],
    *,
    data: str | os.PathLike[str] | None = None,
    cache: str | os.PathLike[str] | None = None,
    notice: Notice | None = None,
    executor: Workers = None,
) -> Fleet:
    """Return the population of the units in the table ``[fleet]`` of a campaign.

    Parameters
    ----------
    campaign : path         The file; stages from which that of the fleet inherits are fitted first, for all units together.
    data, cache, notice     As in `run_stages`.
    executor                As in `ensemble`: who simulates the units.

    Raises
    ------
    DeckError               Without such a table.
    NameNotFoundError       When its stage is not in the campaign.
    IdentificationError     As `thermid.inference.fleet`.
    """
    source = CampaignSource.read(campaign, data)
    source = replace(source, results=Path(cache)) if cache is not None else source
    table = source.content.fleet
    if table is None:
        raise DeckError("there is no table [fleet]. Write one with the units and their records.", source.path.name, code="fleet.no-table")
    stages = source.content.stages
    names = [s.name for s in stages]
    wanted = table.stage or names[-1]
    refuse_unknown([wanted], names, source.where("fleet.stage"), "no stage '{}'.", NameNotFoundError)
    k = names.index(wanted)
    below = replace(source, content=source.unjudged.content.model_copy(update={"stages": stages[:k] if stages[k].inherit else []}))
    request = request_of(source, stages[k], k, run_stages(below, cache=cache, notice=notice, executor=executor).stages)
    records = {name: unit.records for name, unit in table.units.items()} or {r.name: [r.name] for r in request.records}
    requests = {name: _of_unit(source, request, name, patterns) for name, patterns in records.items()}
    _refuse_shared(source, requests)
    return fleet_of(requests, {name: unit.covariates for name, unit in table.units.items()}, source.content.title, executor)


def _of_unit(source: CampaignSource, request: Request, name: str, patterns: list[str]) -> Request:
    """Return the request of a stage with the records of one unit."""
    where = source.where(f"fleet.units.{name}")
    points = {r.name: r for r in request.records}
    wanted = [n for p in patterns for n in ([p] if p in points else source.pick([p], where))]
    refuse_unknown(wanted, points, where, f"record '{{}}' is not one of stage '{request.name}'.", DeckError)
    names = {"*", *wanted}
    return replace(
        request,
        name=name,
        records=tuple(points[n] for n in dict.fromkeys(wanted)),
        scenarios={n: s for n, s in request.scenarios.items() if n in names},
        record_local={n: s for n, s in request.record_local.items() if n in names},
    )


def _refuse_shared(source: CampaignSource, requests: dict[str, Request]) -> None:
    """Refuse a record that two units have.

    Raises
    ------
    DeckError   Names both.
    """
    of: dict[str, str] = {}
    for unit, request in requests.items():
        for record in request.records:
            if record.name in of:
                words = f"record '{record.name}' is given to '{of[record.name]}' and to '{unit}'."
                raise DeckError(words, source.where("fleet.units"), code="fleet.record-twice")
            of[record.name] = unit


def campaign_predictions(campaign: Campaign, executor: Workers = None) -> tuple[tuple[CampaignPrediction, ...], dict[str, ThermidError]]:
    """Predictions that the file of a campaign names, by its fitted stages, in the order of the file; none of a campaign made in Python.

    Beside them stand name and error of each whose scenario is missing or does not fit the model: it does not lose the others. `executor`
    is as in `predict`.
    """
    source, out, failed = campaign.source, list[CampaignPrediction](), dict[str, ThermidError]()
    if source is None:
        return (), failed
    for name, table in source.content.predictions.items():
        stage = table.stage or source.content.stages[-1].name
        try:
            with errors_at(source.where(f"predictions.{name}"), ": "):
                predicted = predict(campaign[stage], scenario_asked(source, name, table), executor=executor)
                limits = {predicted[limit.node].path: limit.operating for limit in limits_of(table)}
                out.append(CampaignPrediction(name, stage, predicted, limits))
        except ThermidError as error:
            failed[name] = error
    return tuple(out), failed


def scenario_asked(source: CampaignSource, name: str, table: PredictionTable) -> Scenario:
    """Return the scenario of a prediction, in vacuum where its table states this."""
    where = source.where(f"predictions.{name}.scenario")
    with errors_at(where):
        scenario = load_scenario(resolve_inside(source.path.parent, table.scenario, where))
    return scenario.vacuum() if table.vacuum else scenario


def limits_of(table: PredictionTable) -> list[Limits]:
    """Return the limits of a prediction.

    Raises
    ------
    ScenarioError   When both ends of one are empty, or in the wrong order.
    """
    return [
        Limits(node, node, (kelvin(low) if low else -np.inf, kelvin(high) if high else np.inf))
        for node, (low, high) in table.limits.items()
    ]
