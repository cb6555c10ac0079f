"""Commands that ask a fitted model: predict, hold."""

from __future__ import annotations

import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.campaign.stages import run_stages
from thermid.cli.inputs import moments
from thermid.cli.options import Accept, CampaignPath, Data, Force, Json, Moments, Results, ScenarioPath, Vacuum, leave, say, writable
from thermid.errors import ScenarioError, SolverError
from thermid.files import PICTURE, TABLE
from thermid.monte_carlo.hold import load_hold
from thermid.prediction import predict as prediction
from thermid.reporting.pictures.trust import check_ending, picture
from thermid.simulation.scenario_file import load_scenario


def predict(
    campaign: CampaignPath,
    stage: Annotated[str, typer.Option("--stage", help="The stage whose values are used; the last one by default.")] = "",
    scenario: ScenarioPath = None,
    spread: Annotated[
        list[str],
        typer.Option("--spread", help="NAME=SPREAD of what is not known exactly, such as air='1 [K]' or scale.heater='2 [%]'."),
    ] = [],  # noqa: B006
    at: Moments = [],  # noqa: B006
    draws: Annotated[int, typer.Option("--draws", min=0, help="Members drawn, for spreads so wide that derivatives do not do.")] = 0,
    vacuum: Vacuum = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write temperatures and bands to a CSV file.")] = None,
    force: Force = False,
    data: Data = None,
    results: Results = None,
    accept: Accept = None,
    as_json: Json = False,
) -> None:
    """Say what a fitted stage predicts for a scenario, with 95 % bands and what they come from."""
    if scenario is None:
        raise ScenarioError("a prediction needs a scenario: --scenario FILE.", "command line")
    conditions = load_scenario(scenario)
    writable((csv, TABLE))
    stages = run_stages(campaign, data=data, cache=results if results is not None else campaign.parent / "results", accept=accept or ())
    name = stage or list(stages)[-1]
    predicted = prediction.predict(stages[name], conditions.vacuum() if vacuum else conditions, spread=_spreads(spread), draws=draws)
    times = moments(at, conditions.seconds)
    if csv is not None:
        predicted.to_csv(csv)
    lines = [str(predicted), *(f"  at {t:g} s: " + ", ".join(f"{n} {b.at(t)}" for n, b in predicted.bands.items()) for t in times)]
    say(as_json, {"stage": name, **predicted.to_dict(times)}, "\n".join(lines))
    leave(predicted.standing)


def _spreads(texts: list[str]) -> dict[str, Any]:
    """Return ``NAME=SPREAD`` options as a dictionary; a spread in braces is read as an inline table."""
    out: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise ScenarioError(f"'{text}' must be written as NAME=SPREAD, such as air=1 [K].", "--spread")
        try:
            out[name.strip()] = tomllib.loads(f"x = {value}")["x"] if value.lstrip().startswith("{") else value.strip()
        except tomllib.TOMLDecodeError as error:
            raise ScenarioError(f"'{value}' is no table such as {{ low = '-2 [K]', high = '2 [K]' }}: {error}", "--spread") from None
    return out


def hold(
    question: Annotated[Path, typer.Argument(help="A hold question (TOML): model, scenario, limits, spread.")],
    members: Annotated[int, typer.Option("--members", help="How many runs; the file's, or 10000.", min=0)] = 0,
    to: Annotated[Path | None, typer.Option("--to", help="Folder where runs are kept; 'results' beside the file.")] = None,
    workers: Annotated[int, typer.Option("--workers", help="Processes of this machine.", min=1)] = 1,
    cluster: Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler, tcp://host:8786.")] = "",
    figure: Annotated[Path | None, typer.Option("--figure", help="Write the curve (png, svg, pdf).")] = None,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Say how long limits are kept: the probability of passing them against time, the time that is safe, what decides it.

    Runs are kept in a folder: an interrupted command goes on where it was.
    """
    writable((None if figure is None else check_ending(figure), PICTURE))
    asked = load_hold(question)
    folder = to if to is not None else question.parent / "results"
    progress = MemberProgress()
    try:
        _, answer = asked.run(n=members, folder=folder, workers=workers, cluster=cluster, progress=progress)
    except KeyboardInterrupt:
        done = f"interrupted with {progress.done} of {progress.members} members done"
        raise SolverError(f"{done}. The same command goes on from there.") from None
    finally:
        progress.end()
    answer = replace(answer, standing=answer.standing.accept(accept or ()))
    if figure is not None:
        picture(answer, figure)
    say(as_json, answer.to_dict(), answer)
    leave(answer.standing)


class MemberProgress:
    """Members done and time left, on standard error."""

    def __init__(self) -> None:
        self.done, self.members = 0, 0
        self._begun, self._at = time.monotonic(), -1

    def __call__(self, done: int, members: int) -> None:
        """Say how many members are done."""
        if self._at < 0:
            self._at = done  # what the folder held took no time
        spent = time.monotonic() - self._begun
        left = f", {spent * (members - done) / (done - self._at):.0f} s left" if self._at < done < members else ""
        self.done, self.members = done, members
        text = f"{done} of {members} members{left}"
        if sys.stderr.isatty():
            typer.echo(f"\r\x1b[2K{text}", nl=False, err=True)
        else:
            typer.echo(text, err=True)

    def end(self) -> None:
        """Leave the line."""
        if self.members and sys.stderr.isatty():
            typer.echo("", err=True)
