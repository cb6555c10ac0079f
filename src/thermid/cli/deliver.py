"""``thermid deliver``: a folder that others can use and check."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.cli.output import SCHEMA, clean
from thermid.cli.standing import Accept, KeepValues, leave, say_first


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(deliver)


def deliver(
    deck: Annotated[Path, typer.Argument(help="A deck (TOML), or with --check a delivery folder.")],
    scenario: Annotated[list[Path], typer.Option("--scenario", help="A scenario (TOML) that must be met; may be repeated.")] = [],  # noqa: B006
    to: Annotated[Path | None, typer.Option("--to", help="The folder to write.")] = None,
    values: Annotated[list[Path], typer.Option("--values", help="A file of fitted values to lay over; may be repeated.")] = [],  # noqa: B006
    at: Annotated[str, typer.Option("--at", help="The submodel to reduce, which fitted values belong to; the whole by default.")] = "",
    nodes: Annotated[int, typer.Option("--nodes", help="Masses that the reduced deck has.", min=0)] = 0,
    within: Annotated[str, typer.Option("--within", help="As few masses as keep reference points within this, such as '0.2 [K]'.")] = "",
    check: Annotated[bool, typer.Option("--check", help="Check a delivery in place of writing one.")] = False,
    keep_values: KeepValues = False,
    accept: Accept = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Write decks, values, a reduced deck and what must come out into a folder, and check it from there."""
    from thermid.campaign.hand import filed
    from thermid.errors import DeckError
    from thermid.knowledge.store import model_standing
    from thermid.model.deck.modelfile import load_model
    from thermid.qualify.deliver import check_delivery
    from thermid.qualify.deliver import deliver as write

    if check:
        met = check_delivery(deck)
        content: dict[str, Any] = {"schema": SCHEMA, "status": "ok", "met_K": met}
        typer.echo(json.dumps(clean(content)) if as_json else f"{deck.name}: as delivered, {_met(met)}")
        return
    if to is None:
        raise DeckError("a delivery needs a folder: --to FOLDER.", "command line")
    if at and not (nodes or within or values):
        raise DeckError(f"'{at}' is the part that is reduced or has values; give --nodes, --within or --values with it.", "--at")
    model, found = load_model(deck), []
    for file in values:
        one = filed(file, model, at=at, keep=keep_values)
        say_first(one, file)
        model = one.model
        found.append(one.values)
    standing = model_standing(model).accept(accept or ())
    target = write(model, scenario, to, values=found, nodes=nodes or None, within=within or None, at=at)
    record = json.loads(target.read_text(encoding="utf-8"))
    if as_json:
        typer.echo(
            json.dumps(
                {"schema": SCHEMA, "status": "ok", "checks": str(target), **{k: record[k] for k in record if k != "schema"}}
                | {"standing": standing.to_dict()}
            )
        )
        leave(standing)
    typer.echo(standing.over(f"{to}: {record['title']} {record['model']['identity']}, {_met(record['runs'])}" + _mark(record)))
    if "reduced" in record:
        small = record["reduced"]
        (masses, left), (before, after) = small["masses"], small["nodes"]
        typer.echo(f"  {small['part']}: {left} masses of {masses}, {after} nodes of {before}")
        for node, off in small["largest_K"].items():
            typer.echo(f"  {node}: {off:+.3f} K at most")
        for remark in small["remarks"]:
            typer.echo(f"  remark: {remark}")
    leave(standing)


def _mark(record: dict[str, Any]) -> str:
    return f" ({record['watermark']})" if record["watermark"] else ""


def _met(runs: dict[str, Any]) -> str:
    from thermid.units import counted

    return f"{counted(len(runs), 'scenario')} met"
