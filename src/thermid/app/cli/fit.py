"""Commands of a campaign: calibrate, report, identify, credibility, swap; and those that ask a fitted model: predict, hold."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from thermid.app.cli.options import (
    Accept,
    Audience,
    CampaignPath,
    Cluster,
    Data,
    Force,
    Json,
    Moments,
    Page,
    Processes,
    Results,
    ScenarioPath,
    Vacuum,
    ValuesPath,
    Verbose,
    Whole,
    add_worker_options,
    executor_of,
    filled_model,
    leave,
    moments,
    pairs,
    say,
    with_unit,
    writable,
)
from thermid.app.cli.screen import Progress, show, working
from thermid.app.cli.summary import campaign_progress, check_target, named_page, show_campaign, staged
from thermid.app.objects import calibration_object, campaign_object, campaign_standing, retune_object
from thermid.base.errors import ScenarioError, SolverError, ThermidError
from thermid.base.files import FileKinds, kind_of_text, read_bytes
from thermid.campaign import stages as origins
from thermid.campaign.stages import (
    Campaign,
    CampaignPrediction,
    CampaignSource,
    campaign_predictions,
    check_replacement,
    file_name,
    fleet_in,
    new_logs,
    plain_tables,
    plan_retune,
    scenario_of,
    survey,
)
from thermid.fit.calibration import Calibration
from thermid.fit.error_model import SIZES
from thermid.fit.estimation import estimated
from thermid.model.tree import UNJUDGED, Standing, literal, load_model, save_model
from thermid.prediction import bands as prediction
from thermid.prediction.bands import Knowledge, predict_record
from thermid.prediction.members import load_hold
from thermid.reporting import pages as page
from thermid.reporting.pages import check_audience, tables_folder
from thermid.reporting.pictures import picture
from thermid.simulation.runs import KeptTasks, Workers, load_scenario

Kept = Annotated[Path | None, typer.Option("--to", help="Folder for the values files; 'results' beside the campaign by default.")]
Fresh = Annotated[bool, typer.Option("--fresh", help="Run every stage, also those whose model, logs and request are unchanged.")]


def _run(
    path: Path, data: Path | None, to: Path | None, fresh: bool, accept: list[str] | None, executor: Workers = None
) -> tuple[Campaign, list[Path]]:
    """Run a campaign with progress, taking finished stages from the results folder."""
    folder = to if to is not None else path.parent / "results"
    for stage in CampaignSource.read(path).content.stages if folder.is_dir() else ():
        FileKinds.VALUES.titled(stage.name).may_write(folder / f"{file_name(stage.name)}.values.toml")
    campaign = staged(path, data, folder, accept, fresh=fresh, executor=executor)
    return campaign, campaign.save(folder)


@add_worker_options
def calibrate(
    campaign: CampaignPath,
    data: Data = None,
    to: Kept = None,
    fresh: Fresh = False,
    accept: Accept = None,
    executor: Workers = None,
    force: Force = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Fit the stages of a campaign to logs and judge hold-out records.

    Stages that do not rest on one another are fitted at the same time with --workers or --cluster.

    Exit code 1 if a verdict failed or a fit is not credible, 4 if the data cannot decide.
    """
    result, files = _run(campaign, data, to, fresh, accept, executor)
    names = [f.name for f in files]
    if as_json:
        say(True, campaign_object(result, names), "")
    elif verbose:
        again = [
            f"fitted again: {stage}; changed since the results were kept: {', '.join(changed)}"
            for stage, changed in result.changed.items()
            if changed
        ]
        inputs = [f"{stage}: inputs\n{fit.inputs.indented}" for stage, fit in result.stages.items() if fit.inputs.rows]
        show("\n\n".join([str(result), *inputs, *again, f"values: {', '.join(names)}"]))
    else:
        show_campaign(result, names)
    leave(result.standing, result.exit_code)


@add_worker_options
def report(
    campaign: Annotated[Path | None, typer.Argument(help="A campaign (TOML); the only one here without it.")] = None,
    to: Page = None,
    data: Data = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder for the values files.")] = None,
    audience: Audience = "all",
    fresh: Fresh = False,
    accept: Accept = None,
    executor: Workers = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a campaign and write its report as a page or a PDF.

    Exit code as for calibrate.
    """
    alone = campaign is None
    campaign = campaign or _only_campaign()
    if to is None and not alone:
        raise ScenarioError("a report needs a file: --to page.html or --to page.pdf.", "command line", code="value.incomplete")
    to = to or Path("report.html")
    check_target(to)
    check_audience(audience)
    result, _ = _run(campaign, data, results, fresh, accept, executor)
    with working("writing the report"):
        files = named_page(page.report(result, to=to, audience=audience, tables_to=tables_folder(to)))
    taken = [f"campaign: {campaign}, the only one here"] if alone else []
    text = result.standing.over("\n".join([*taken, *(f"report: {path}" for path in files.values())]), "stage")
    say(as_json, {**files, "campaign": str(campaign), "passed": result.passed, "standing": campaign_standing(result)}, text)
    leave(result.standing, result.exit_code)


def _only_campaign() -> Path:
    """Return the only campaign of the working folder, or of the folders in it where it has no such file itself.

    Raises
    ------
    ScenarioError   When it has none or several.
    """
    found = [
        path for path in sorted(Path().glob("*.toml")) or sorted(Path().glob("*/*.toml")) if kind_of_text(read_bytes(path)) == "a campaign"
    ]
    if len(found) != 1:
        raise ScenarioError(
            f"campaigns of this folder: {', '.join(map(str, found)) or 'none'}. Name one: thermid report campaign.toml --to report.html.",
            "command line",
            code="value.incomplete",
        )
    return found[0]


@add_worker_options
def identify(
    campaign: CampaignPath,
    stage: Annotated[str, typer.Option("--stage", help="One stage; all of them without it.")] = "",
    after: Annotated[bool, typer.Option("--after", help="Look at the ends of the fits, not at their starts.")] = False,
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Show which parameters the logs can identify, before a fit.

    Parameters that cannot be separated are named, with the measurement that would help.
    """
    with campaign_progress(campaign) as progress:
        stages = survey(
            campaign, stage, after=after, data=data, cache=results or campaign.parent / "results", notice=progress, executor=executor
        )
    text = "\n\n".join(f"{i}\n  inputs:\n{i.inputs.indented}" for i in stages.values())
    say(as_json, {"stages": {name: i.to_dict() for name, i in stages.items()}}, text, verbose)


@add_worker_options
def estimate(
    campaign: CampaignPath,
    noise: Annotated[
        list[str],
        typer.Option(
            "--noise",
            help="What drives a node, load or boundary: wall=free, wall='2e-3 [K/s^0.5]', or heater='free over 20 [min]', which forgets "
            "after that time.",
        ),
    ],
    stage: Annotated[str, typer.Option("--stage", help="The stage; the last one by default.")] = "",
    horizon: Annotated[
        str, typer.Option("--horizon", help="Over which left-out readings are foreseen; a fifth of the log by default.")
    ] = "",
    scenario: ScenarioPath = None,
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Fit a stage with process noise and compare its forecasts.

    Process noise and output error are compared on left-out readings over a horizon; --scenario predicts a run by both, with the noise in
    its bands. Exit code 1 if the search did not converge.
    """
    conditions = load_scenario(scenario) if scenario is not None else None
    drivers = pairs(noise, "--noise")
    result = staged(campaign, data, results, executor=executor, stage=stage, judged=False)
    request = result.requests[result[stage].stage if stage else list(result)[-1]]
    with working(f"process noise of stage '{request.name}'"):
        estimation = estimated(replace(request, fit_start=False), drivers, {}, with_unit(horizon, "s"))
    content, lines = estimation.as_object(), [str(estimation)]
    if conditions is not None:
        runs = {e.name: estimation.predict(conditions, by=e.name) for e in (estimation.chosen, estimation.process, estimation.output)}
        lines += [f"prediction by {n}:\n{run}" for n, run in runs.items()]
        content |= {"predictions": {n: run.as_object() for n, run in runs.items()}}
    say(as_json, content, "\n".join(lines), verbose)
    raise SystemExit(0 if estimation.chosen.maximum.converged else 1)


@add_worker_options
def fleet(
    campaign: CampaignPath,
    scenario: ScenarioPath = None,
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Fit the units of one design: means, spreads, odd units.

    The campaign has a table [fleet] with its units. --scenario adds 95 % bands of
    the temperatures of a unit that is not built yet. Exit code 1 if a unit is odd,
    or what `calibrate` exits with if the fit of a unit is not credible or adequate.
    """
    conditions = load_scenario(scenario) if scenario is not None else None
    with campaign_progress(campaign) as progress:
        population = fleet_in(campaign, data=data, cache=results or campaign.parent / "results", notice=progress, executor=executor)
    answer, lines = population.to_dict(), [str(population)]
    if conditions is not None:
        runs = population.predict(conditions, executor=KeptTasks.of_workers(executor).workers)  # traces, which no folder keeps
        bands = {n: np.quantile(runs.highest(n), (0.5, 0.025, 0.975)).tolist() for n in runs.nodes}
        answer |= {"highest_degC": {n: dict(zip(("median", "low", "high"), b, strict=True)) for n, b in bands.items()}}
        lines.append(f"Highest temperatures of a unit not built yet, {conditions.title}, 95 % of {runs.members:,} drawn units:")
        lines += [f"  {n}  {b[0]:.1f} ({b[1]:.1f} .. {b[2]:.1f}) degC" for n, b in bands.items()]
    say(as_json, answer, "\n".join(lines), verbose)
    raise SystemExit(1 if population.odd else population.standing.exit_code)


@add_worker_options
def credibility(
    campaign: CampaignPath,
    data: Data = None,
    results: Results = None,
    to: Annotated[Path | None, typer.Option("--to", help="The JSON file to write; standard output without it.")] = None,
    executor: Workers = None,
    force: Force = False,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """List source, state, tests, date and range of every value.

    Level and origin of every value are listed too, and the sizes of model error; --to writes the values as JSON.
    """
    writable((to, FileKinds.CREDIBILITY))
    record = origins.credibility(staged(campaign, data, results, executor=executor))
    if to is not None:
        record.save(to)
    sizes = {name: {"value": s.value, "unit": s.unit, "sets": s.sets} for name, s in SIZES.items()}
    say(as_json, record.to_dict() | {"sizes_of_error": sizes}, f"written: {to}" if to is not None else f"{record}\n\n{SIZES}", verbose)


@add_worker_options
def swap(
    campaign: CampaignPath,
    part: Annotated[str, typer.Argument(help="Path of the part in the model of the last stage, such as pre.ele.")],
    deck: Annotated[Path, typer.Argument(help="Deck of the part that replaces it.")],
    data: Annotated[Path | None, typer.Option("--data", help="Folder of the logs before the swap; THERMID_DATA does the same.")] = None,
    results: Results = None,
    new_data: Annotated[Path | None, typer.Option("--new-data", help="Folder of the repeated tests: retune with them.")] = None,
    part_only: Annotated[bool, typer.Option("--part-only", help="Fit the new part to its own tests alone, before the others.")] = False,
    sensor_at: Annotated[
        list[str],
        typer.Option("--sensor-at", help="OLD=NEW: nodes of the part, where a sensor sits elsewhere on the new one."),
    ] = [],  # noqa: B006
    to: Annotated[Path | None, typer.Option("--to", help="Folder for the values files of the retune.")] = None,
    executor: Workers = None,
    accept: Accept = None,
    force: Force = False,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Plan the replacement of a part: which tests and fits are due.

    The plan lists what is assumed. With --new-data, only the stages that are due are fitted.
    """
    if to is not None and new_data is None:
        raise ScenarioError(
            "without a retune there are no values to write. Give the folder of the repeated tests: --new-data.",
            "--to",
            code="value.incomplete",
        )
    if to is not None:
        to.mkdir(parents=True, exist_ok=True)  # a name that is no folder's is refused before minutes of work
    logs = new_logs(campaign, new_data) if new_data is not None else None
    sensors = pairs(sensor_at, "--sensor-at")
    check_replacement(campaign, part, deck, logs, part_only, sensors)
    plan = plan_retune(staged(campaign, data, results, accept, executor=executor), part, deck, sensors=sensors)
    content: dict[str, Any] = {"plan": retune_object(plan)}
    texts, standing, code = [str(plan)], plan.standing, 0
    if logs is not None:
        deck = to / "decks" / f"{file_name(plan.stages[-1].name)}.toml" if to is not None else Path()
        if to is not None:
            deck.parent.mkdir(exist_ok=True)
            save_model(plan.deck, deck)
        retuned = plan.run(logs, part_only=part_only, executor=executor)
        texts, standing, code = [plan.text], retuned.standing, retuned.exit_code
        run = [s.name for s in plan.stages if s.action == "run" and (s.alone or not part_only)]
        content["stages"] = [calibration_object(retuned[name]) for name in run]
        content["note"] = retuned.note
        texts += [retuned.note, *(str(retuned[name]) for name in run)]
        predictions, failed = campaign_predictions(replace(retuned, source=plan.campaign.source))
        texts += ["\n".join(_heads(predictions, failed))] * bool(predictions or failed)
        content["predictions"] = {p.name: p.to_dict() for p in predictions} | _refused(failed)
        code = code or _prediction_code(predictions, failed)
        if to is not None:
            content["values_files"] = [f.name for f in retuned.save(to)]
            texts.append(f"values: {', '.join(content['values_files'])}")
            content["deck"] = str(deck)
            texts.append(f"next: thermid predict {deck} --values {to / content['values_files'][-1]} --scenario FILE")
    text = "\n\n".join(texts)
    say(as_json, {**content, "standing": standing.to_dict()}, standing.over(text, "stage") if logs is not None else text, verbose)
    leave(standing, code)


@add_worker_options
def predict(
    campaign: Annotated[Path, typer.Argument(help="A campaign (TOML), or with --values a deck.")],
    stage: Annotated[str, typer.Option("--stage", help="The stage whose values are used; the last one by default.")] = "",
    scenario: ScenarioPath = None,
    record: Annotated[
        list[str], typer.Option("--record", help="A logged run of the campaign in place of a scenario, or a pattern; may be repeated.")
    ] = [],  # noqa: B006
    spread: Annotated[
        list[str],
        typer.Option("--spread", help="NAME=SPREAD of what is not known exactly, such as air='1 [K]' or scale.heater='2 [%]'."),
    ] = [],  # noqa: B006
    at: Moments = [],  # noqa: B006
    draws: Annotated[int, typer.Option("--draws", min=0, help="Members drawn, for spreads so wide that derivatives do not do.")] = 0,
    vacuum: Vacuum = False,
    values: ValuesPath = None,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write temperatures and bands to a CSV file.")] = None,
    force: Force = False,
    data: Data = None,
    results: Results = None,
    executor: Workers = None,
    accept: Accept = None,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Predict scenarios with a fitted stage, with 95 % bands.

    Without --scenario and --record, the predictions that the campaign names are made, with the margins of their bands to limits: exit code
    1 if one is exceeded. Bands are broken down into their causes. A logged run is compared with its readings. With --values, a scenario is
    predicted with a deck and what a stage found of it, or of a part of it (PART=FILE).
    """
    if scenario is not None and record:
        raise ScenarioError(
            "a prediction is of a scenario or logged runs: --scenario FILE or --record NAME.", "command line", code="value.incomplete"
        )
    conditions = load_scenario(scenario) if scenario is not None else None
    writable((csv, FileKinds.TABLE))
    spreads, times = _spreads(spread), moments(at, conditions.seconds) if conditions is not None else []
    known: Calibration | Knowledge
    if values is not None:
        known, name = _known_of_file(campaign, values, scenario is not None and not (stage or data or results))
    else:
        if conditions is None:
            options = {"--spread": spread, "--at": at, "--draws": draws, "--vacuum": vacuum, "--csv": csv}
            _refuse_options_of_scenario(campaign, bool(record), options, stage)
        stages = staged(campaign, data, results, accept, executor=executor, stage=stage, records=record)
        name = stage or list(stages)[-1]
        if conditions is None:
            _predict_without_scenario(campaign, data, stages, name, record, as_json, verbose, executor)
            return
        known = stages[name]
    assert conditions is not None
    with working(f"prediction of '{conditions.title}'"):
        predicted = prediction.predict(known, conditions.vacuum() if vacuum else conditions, spread=spreads, draws=draws, executor=executor)
    predicted = replace(predicted, standing=predicted.standing.accept(accept or ()))
    if csv is not None:
        predicted.to_csv(csv)
    lines = [str(predicted), *(f"  at {t:g} s: " + ", ".join(f"{n} {b.at(t)}" for n, b in predicted.bands.items()) for t in times)]
    say(as_json, {"stage": name, **predicted.to_dict(times)}, "\n".join(lines), verbose or (None if times else False))
    leave(predicted.standing)


def _known_of_file(deck: Path, values: Path, alone: bool) -> tuple[Knowledge, str]:
    """Return what a values file says of a deck, and its stage; `alone` says that only a scenario is given with it."""
    if not alone:
        raise ScenarioError(
            "values are laid over a deck, which has no stages, records or results. Give it with --values and --scenario FILE.",
            "--values",
            code="value.excludes-another",
        )
    filled = filled_model(load_model(deck), values, None)
    return Knowledge.of_file(filled), filled.values.stage


def _refuse_options_of_scenario(campaign: Path, of_records: bool, options: Mapping[str, Any], stage: str) -> None:
    """Refuse options that need --scenario, for logged runs and for the predictions that a campaign names; and a campaign that names none.

    Nothing is read or fitted for this but the campaign's file.
    """
    given = [word for word, value in (options if of_records else {"--stage": stage, **options}).items() if value]
    if given:
        what = "logged runs" if of_records else "the predictions that a campaign names"
        cure = "Give --scenario FILE instead of --record." if of_records else "Give --scenario FILE or --record NAME too."
        words = f"{', '.join(given)} {'is' if len(given) == 1 else 'are'} not for {what}. {cure}"
        raise ScenarioError(words, "command line", code="command.not-understood")
    content = CampaignSource.read(campaign).content
    if not (of_records or content.predictions):
        words = 'nothing to predict: give --scenario FILE or --record NAME, or write [predictions.hot] with scenario = "hot.toml".'
        raise ScenarioError(words, content.title, code="command.not-understood")


def _predict_named(campaign: Campaign, as_json: bool, verbose: bool, executor: Workers) -> None:
    """Print the predictions that a campaign names, the answers first."""
    with working("predictions of the campaign"):
        predictions, failed = campaign_predictions(campaign, executor)
    if not predictions:
        raise next(iter(failed.values()))
    heads = ["\n".join(_heads(predictions if len(predictions) > 1 else (), failed))] if failed or len(predictions) > 1 else []
    standing = Standing.worst(p.prediction.standing for p in predictions)  # told once, above all of them
    bare = [replace(p, prediction=replace(p.prediction, causes={}, standing=UNJUDGED)) for p in predictions]
    causes: dict[str, str] = {}  # each told once; of its widest band also what would narrow it
    for cause, words in (item for p in predictions for item in p.prediction.causes.items()):
        causes[cause] = max(causes.get(cause, ""), words, key=len)
    meanings = ["\n".join(["What the bands come from:", *(f"  {cause}: {words}" for cause, words in causes.items())])] if causes else []
    text = standing.over("\n\n".join([*heads, *map(str, bare), *meanings]))
    say(as_json, {p.name: p.to_dict() for p in predictions} | _refused(failed), text, verbose)
    leave(standing, _prediction_code(predictions, failed))


def _heads(predictions: Sequence[CampaignPrediction], failed: Mapping[str, ThermidError]) -> list[str]:
    """Return the answers of predictions, a line each; those that could not be made first."""
    return [*(f"NOT PREDICTED: '{name}': {error}" for name, error in failed.items()), *(p.head for p in predictions)]


def _refused(failed: Mapping[str, ThermidError]) -> dict[str, Any]:
    """Return as JSON holds it why predictions could not be made."""
    return {name: {"error": error.message, "where": error.where, "code": error.code} for name, error in failed.items()}


def _prediction_code(predictions: Sequence[CampaignPrediction], failed: Mapping[str, ThermidError]) -> int:
    """Return the exit code of predictions: that of the worst failure, else 1 where a limit is exceeded."""
    code = max((error.exit_code for error in failed.values()), default=0)
    return code or (1 if any(p.within is False for p in predictions) else 0)


def _predict_without_scenario(
    campaign: Path, data: Path | None, stages: Campaign, name: str, patterns: Sequence[str], as_json: bool, verbose: bool, executor: Workers
) -> None:
    """Print what a stage predicts of logged runs, each beside its readings; without patterns of these what the campaign names.

    A run is taken as the verdict on it takes it, else as the stage does.
    """
    if not patterns:
        _predict_named(stages, as_json, verbose, executor)
        return
    source, fit = CampaignSource.read(campaign, data), stages[name]
    stage = next(s for s in source.content.stages if s.name == name)
    scores = []
    for run in source.pick(patterns, "--record"):
        verdict = next((v for v in source.content.verdicts if v.model == name and run in source.pick([v.record], "verdicts")), None)
        local_table = {n: s.to_table() for n, s in source.local_of_record(run).items()}
        scenario = verdict.scenario if verdict is not None and verdict.scenario is not None else stage.scenario
        readings = verdict.readings if verdict is not None and verdict.readings is not None else stage.readings
        local = plain_tables(verdict.local) if verdict is not None else plain_tables(stage.local) | local_table
        with working(f"prediction of '{run}'"):
            score = predict_record(
                fit,
                source.bound(run, stage),
                scenario=scenario_of(scenario, run),
                local=local,
                readings=plain_tables(readings),
                window=literal(stage.window, "s", "window"),
            )
        scores.append(score)
    lines = [str(t) for t in scores]
    if len(scores) > 1:
        lines.append(
            f"{len(scores)} runs: {100 * sum(t.inside() for t in scores) / len(scores):.0f} % of the readings inside their 95 % bands"
        )
    if fitted_records := [t.record for t in scores if t.record in fit.records]:
        lines.append(f"fitted by the stage itself: {', '.join(fitted_records)}")
    say(as_json, {"stage": name, "records": [t.to_dict() for t in scores]}, "\n".join(lines), verbose)
    leave(fit.standing)


def _spreads(texts: list[str]) -> dict[str, Any]:
    """Return ``NAME=SPREAD`` options as a dictionary; a spread in braces is read as an inline table."""
    out: dict[str, Any] = {}
    for name, value in pairs(texts, "--spread").items():
        try:
            out[name] = tomllib.loads(f"x = {value}")["x"] if value.startswith("{") else value
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError(
                f"'{value}' is no table such as {{ low = '-2 [K]', high = '2 [K]' }}: {error}", "--spread", code="value.wrong-kind"
            ) from None
    return out


def hold(
    question: Annotated[Path, typer.Argument(help="A hold question (TOML): model, scenario, limits, spread.")],
    members: Annotated[int, typer.Option("--members", help="How many runs; the file's, or 10000.", min=0)] = 0,
    job: Annotated[Path | None, typer.Option("--job", "--to", help="Folder where runs are kept; 'results' beside the file.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say how many runs, how long and how much memory; run none.")] = False,
    memory: Annotated[float, typer.Option("--memory", help="Refuse what needs more memory. [MB]", min=1.0)] = math.inf,
    workers: Processes = 1,
    cluster: Cluster = "",
    figure: Annotated[Path | None, typer.Option("--figure", help="Write the curve (png, svg, pdf).")] = None,
    accept: Accept = None,
    force: Force = False,
    verbose: Whole = False,
    as_json: Json = False,
) -> None:
    """Compute how long limits are kept, with probabilities.

    The answer is the probability of passing a limit against time, the safe time, and the inputs that decide it.

    Runs are kept in a folder: an interrupted command goes on where it was.
    """
    writable((figure, FileKinds.PICTURE))
    hold_question = load_hold(question)
    folder = job if job is not None else question.parent / "results"
    if dry_run or math.isfinite(memory):
        cost = hold_question.cost(n=members, folder=folder)
        if cost.size > 1e6 * memory:
            raise ScenarioError(
                f"{cost}, more than {memory:g} MB. Ask for fewer reference points, or a longer interval: every = '30 [min]'.", question.name
            )
    if dry_run:
        say(as_json, {"members": cost.members, "kept": cost.kept, "processor_s": cost.seconds, "memory_B": cost.size}, cost, verbose)
        return
    with MemberProgress() as progress:
        try:
            by = KeptTasks(folder, KeptTasks.of_workers(executor_of(workers, cluster)).workers)
            _, answer = hold_question.run(n=members, executor=by, progress=progress)
        except KeyboardInterrupt:
            raise SolverError(
                f"interrupted with {progress.finished} of {progress.members} runs done. The same command goes on from there.",
                code="fit.stopped",
            ) from None
    answer = replace(answer, standing=answer.standing.accept(accept or ()))
    if figure is not None:
        picture(answer, figure)
    say(as_json, answer.to_dict(), answer, verbose)
    leave(answer.standing)


class MemberProgress(Progress):
    """Members done and time left."""

    def __init__(self) -> None:
        super().__init__("members")
        self.finished, self.members, self._at = 0, 0, -1

    def __call__(self, done: int, members: int) -> None:
        """Show how many members are done; what the folder held took no time."""
        self._at = done if self._at < 0 else self._at
        self.finished, self.members = done, members
        self.now(f"{done} of {members} runs", (done - self._at) / (members - self._at) if members > self._at else 1.0)
