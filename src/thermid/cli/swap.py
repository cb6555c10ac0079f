"""``thermid swap``: plan the replacement of a part, and retune locally once its tests are there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thermid.cli.pages import Force
from thermid.cli.standing import Accept, leave

if TYPE_CHECKING:
    from thermid.campaign.retune import RetunePlan


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("swap")(swap)


def swap(
    campaign: Annotated[Path, typer.Argument(help="A campaign (TOML).")],
    part: Annotated[str, typer.Argument(help="Path of the part in the model of the last stage, such as pre.ele.")],
    deck: Annotated[Path, typer.Argument(help="Deck of the part that replaces it.")],
    data: Annotated[Path | None, typer.Option("--data", help="Folder of the logs before the swap; THERMID_DATA does the same.")] = None,
    results: Annotated[Path | None, typer.Option("--results", help="Folder of finished stages; 'results' beside the campaign.")] = None,
    new_data: Annotated[Path | None, typer.Option("--new-data", help="Folder of the repeated tests: retune with them.")] = None,
    part_only: Annotated[bool, typer.Option("--part-only", help="Fit the new part to its own tests alone, before the others.")] = False,
    to: Annotated[Path | None, typer.Option("--to", help="Folder for the values files of the retune.")] = None,
    accept: Accept = None,
    force: Force = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Plan the replacement of a part: what is assumed, which tests and fits are due; with the new logs, fit only these."""
    from thermid.campaign.retune import plan_retune
    from thermid.campaign.stages import run_stages
    from thermid.cli.output import calibration_object, clean

    folder = results if results is not None else campaign.parent / "results"
    plan = plan_retune(run_stages(campaign, data=data, cache=folder, accept=accept or ()), part, deck)
    found: dict[str, Any] = {"schema": 1, "status": "ok", "plan": _object(plan)}
    texts, standing, code = [str(plan)], plan.standing, 0
    if new_data is not None:
        made = plan.run(new_data, part_only=part_only)
        standing, code = made.standing, made.exit_code
        run = [s.name for s in plan.stages if s.action == "run" and (s.alone or not part_only)]
        found["stages"] = [calibration_object(made[name]) for name in run]
        texts += [str(made[name]) for name in run]
        if to is not None:
            files = made.save(to)
            found["values_files"] = [f.name for f in files]
            texts.append(f"values: {', '.join(f.name for f in files)}")
    found["standing"] = standing.to_dict()
    typer.echo(json.dumps(clean(found)) if as_json else "\n\n".join(texts))
    leave(standing, code)


def _object(plan: RetunePlan) -> dict[str, Any]:
    """Return a plan as JSON holds it."""
    return {
        "part": plan.part,
        "old": plan.old,
        "new": plan.new,
        "assumes": list(plan.assumes),
        "dropped": [{"path": d.path, "text": d.text, "origin": d.origin, "why": d.why} for d in plan.replacement.dropped],
        "kept": list(plan.replacement.kept),
        "untied": list(plan.replacement.untied),
        "starts": [
            {"path": x.path, "text": x.text, "log_sd": x.log_sd, "origin": x.origin, "twins": list(x.twins)}
            for x in plan.replacement.starts
        ],
        "freed": list(plan.freed),
        "touched": [
            {"stage": t.stage, "path": t.path, "through": list(t.through), "kelvin": t.kelvin, "held": t.held} for t in plan.touched
        ],
        "stages": [
            {
                "name": s.name,
                "of": s.of,
                "action": s.action,
                "why": s.why,
                "free": list(s.free),
                "records": list(s.records),
                "before": s.identity[0],
                "after": s.identity[1],
            }
            for s in plan.stages
        ],
        "tests": list(plan.tests),
        "kept_tests": list(plan.kept_tests),
        "neighbours": {n: {"exposed_before": a, "exposed_after": b, "change": dt} for n, (a, b, dt) in plan.neighbours.items()},
        "watts": list(plan.watts),
        "logged": plan.logged,
        "before": dict(plan.before),
        "as_logged": dict(plan.as_logged),
        "after": dict(plan.after),
    }
