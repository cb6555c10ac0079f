"""Commands of other tools' files: import, export, equations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.cli.options import (
    Accept,
    AsPrinted,
    Boundaries,
    Deck,
    Duration,
    Force,
    Json,
    KeepValues,
    Loads,
    Parameters,
    ScenarioPath,
    Start,
    Vacuum,
    ValuesPath,
    fitted_model,
    leave,
    pairs,
    say,
    scenario_of,
)
from thermid.errors import DeckError, OutputError, refuse_unknown
from thermid.files import DECK, EQUATIONS, EXPORT, FileKind, may_write, write_text
from thermid.interop import equations as derive
from thermid.interop.initfcn import read_initfcn
from thermid.interop.octave import to_octave
from thermid.interop.spice import to_spice
from thermid.knowledge.store import model_standing
from thermid.model.deck.modelfile import load_model, model_from_dict
from thermid.model.deck.save import save_model

To = Annotated[Path | None, typer.Option("--to", help="The file to write; standard output without it.")]


def _say(text: str, to: Path | None, as_json: bool, kind: FileKind, comment: str, **more: Any) -> None:
    """Write a text to its file or to standard output."""
    if to is not None:
        write_text(to, text, kind, comment)
    if as_json:
        shown = {"file": to.name} if to is not None else {"text": text}
        say(True, {**shown, **more}, "")
    elif to is not None:
        typer.echo(f"written: {to}")
    else:
        typer.echo(text, nl=False)


def import_script(
    script: Annotated[Path, typer.Argument(help="An InitFcn script (.m): name = expression; % comment [unit]")],
    to: Annotated[Path | None, typer.Option("--to", help="The deck to write; the values are only shown without it.")] = None,
    block: Annotated[
        bool, typer.Option("--block", help="Write one mass that convects and is heated around the values, each found by its unit.")
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Read the parameters of an InitFcn script and write them as a deck."""
    script_values = read_initfcn(script)
    title = (to or script).stem
    if to is not None:
        may_write(to, DECK.of(title))
    deck = script_values.block(title) if block else script_values.deck(title)
    made = model_from_dict(deck)
    if to is not None and not force and to.is_file():
        if load_model(to) != made:
            raise OutputError("another deck is there already. Give another name or move it away; --force replaces it.", str(to))
    elif to is not None:
        save_model(made, to)
    shown = {"file": to.name} if to is not None else {}
    parameters = {n: {"text": p.text, "number": script_values.numbers[n], "note": p.note} for n, p in script_values.parameters.items()}
    rest = "" if block else "; its nodes, surfaces and loads are still to be written"
    text = f"{script_values}\nwritten: {to}{rest}" if to is not None else script_values
    say(as_json, {**shown, "parameters": parameters, "remarks": list(script_values.remarks)}, text)


def export(
    deck: Deck,
    form: Annotated[str, typer.Option("--as", help="octave (a function file for Octave and MATLAB) or spice (a netlist).")] = "octave",
    to: To = None,
    scenario: ScenarioPath = None,
    boundary: Boundaries = [],  # noqa: B006
    param: Parameters = [],  # noqa: B006
    load: Loads = [],  # noqa: B006
    start: Start = None,
    duration: Duration = None,
    vacuum: Vacuum = False,
    as_printed: AsPrinted = False,
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write a model in a scenario for another tool: an Octave or MATLAB function, or a SPICE netlist."""
    forms = ("octave", "spice")
    refuse_unknown([form], forms, "--as", f"a model is not written as '{{}}'.{{near}} There are {' and '.join(forms)}.", DeckError)
    model = fitted_model(deck, values, keep_values, param)
    conditions = scenario_of(scenario, boundary, load, start, duration, vacuum, as_printed)
    text = to_octave(model, conditions, name=to.stem if to is not None else "") if form == "octave" else to_spice(model, conditions)
    standing = model_standing(model).accept(accept or ())
    if not standing.fair and not as_json:
        typer.echo(standing.line(), err=True)  # what is written is for another tool to read
    _say(text, to, as_json, EXPORT, "%" if form == "octave" else "*", standing=standing.to_dict())
    leave(standing)


def equations(
    deck: Deck,
    form: Annotated[str, typer.Option("--as", help="text, latex, python or octave.")] = "text",
    name: Annotated[list[str], typer.Option("--name", help="PATH=SYMBOL of a conductor, node or load, such as stack.gap=R_cn3.")] = [],  # noqa: B006
    to: To = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Derive the state equations of a linear model as symbols (needs sympy)."""
    forms = ("text", "latex", "python", "octave")
    refuse_unknown([form], forms, "--as", "equations are not written as '{}'.{near} There are {known}.", DeckError)
    system = derive.equations(load_model(deck), pairs(name, "--name"))
    text = f"{system}\n" if form == "text" else str(getattr(system, form)())
    _say(text, to, as_json, EQUATIONS, "%" if form in ("latex", "octave") else "#", symbols=dict(system.symbols))
