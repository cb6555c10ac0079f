"""``thermid import, export, equations, htc``: exchange with other tools, and coefficients side by side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.cli.pages import Force
from thermid.cli.standing import Accept, KeepValues, leave, with_fitted
from thermid.files import DECK, EQUATIONS, EXPORT, Kind, may_write, write_text

Deck = Annotated[Path, typer.Argument(help="A deck (TOML).")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
To = Annotated[Path | None, typer.Option("--to", help="The file to write; standard output without it.")]
Pairs = list[str]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command("import")(import_script)
    app.command("export")(export)
    app.command("equations")(write_equations)
    app.command("htc")(htc)


def _say(text: str, to: Path | None, as_json: bool, kind: Kind, comment: str, **more: Any) -> None:
    """Write a text to its file or to standard output."""
    if to is not None:
        write_text(to, text, kind, comment)
    if as_json:
        shown = {"file": to.name} if to is not None else {"text": text}
        typer.echo(json.dumps({"schema": 1, "status": "ok", **shown, **more}))
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
    from thermid.cli.output import clean
    from thermid.errors import OutputError
    from thermid.interop.initfcn import read_initfcn
    from thermid.model.deck.modelfile import load_model, model_from_dict, save_model

    found = read_initfcn(script)
    title = (to or script).stem
    if to is not None:
        may_write(to, DECK.of(title))
    deck = found.block(title) if block else found.deck(title)
    made = model_from_dict(deck)
    if to is not None and not force and to.is_file():
        if load_model(to) != made:
            raise OutputError("another deck is there already. Give another name or move it away; --force replaces it.", str(to))
    elif to is not None:
        save_model(made, to)
    if as_json:
        shown = {"file": to.name} if to is not None else {}
        parameters = {n: {"text": p.text, "number": found.numbers[n], "note": p.note} for n, p in found.parameters.items()}
        typer.echo(json.dumps(clean({"schema": 1, "status": "ok", **shown, "parameters": parameters, "remarks": list(found.remarks)})))
        return
    typer.echo(str(found))
    if to is not None:
        typer.echo(f"written: {to}" + ("" if block else "; its nodes, surfaces and loads are still to be written"))


def export(
    deck: Deck,
    form: Annotated[str, typer.Option("--as", help="octave (a function file for Octave and MATLAB) or spice (a netlist).")] = "octave",
    to: To = None,
    scenario: Annotated[Path | None, typer.Option("--scenario", help="A scenario (TOML).")] = None,
    boundary: Annotated[Pairs, typer.Option("--boundary", help="BOUNDARY=TEMPERATURE, such as air='24 [degC]'.")] = [],  # noqa: B006
    param: Annotated[Pairs, typer.Option("--param", help="PARAMETER=VALUE; wins over the deck.")] = [],  # noqa: B006
    load: Annotated[Pairs, typer.Option("--load", help="LOAD=POWER, in place of the deck's.")] = [],  # noqa: B006
    start: Annotated[str | None, typer.Option("--start", help="A temperature, a boundary, or 'steady'.")] = None,
    duration: Annotated[str | None, typer.Option("--for", help="Duration, such as '5 [h]'.")] = None,
    vacuum: Annotated[bool, typer.Option("--vacuum", help="No gas: convection goes, radiation stays.")] = False,
    as_printed: Annotated[
        bool, typer.Option("--as-printed", help="No gas, every coefficient zero, radiation too: an upper bound.")
    ] = False,
    values: Annotated[Path | None, typer.Option("--values", help="A file of fitted values to lay over the deck.")] = None,
    keep_values: KeepValues = False,
    accept: Accept = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write a model in a scenario for another tool: an Octave or MATLAB function, or a SPICE netlist."""
    from thermid.cli.app import _pairs, _scenario
    from thermid.errors import DeckError, nearest
    from thermid.interop.octave import to_octave
    from thermid.interop.spice import to_spice
    from thermid.knowledge.store import model_standing
    from thermid.model.deck.modelfile import load_model

    forms = ("octave", "spice")
    if form not in forms:
        raise DeckError(f"a model is not written as '{form}'.{nearest(form, forms)} There are {' and '.join(forms)}.", "--as")
    model = with_fitted(load_model(deck), values, keep_values)
    if param:
        model = model.with_values(_pairs(param, "--param"), "command line")
    given = _scenario(model, scenario, boundary, load, start, duration)
    if vacuum and as_printed:
        raise DeckError("--vacuum keeps radiation and --as-printed drops it; give one of them.")
    if vacuum or as_printed:
        given = given.vacuum(as_printed=as_printed)
    text = to_octave(model, given, name=to.stem if to is not None else "") if form == "octave" else to_spice(model, given)
    standing = model_standing(model).accept(accept or ())
    if not standing.fair and not as_json:
        typer.echo(standing.line(), err=True)  # what is written is for another tool to read
    _say(text, to, as_json, EXPORT, "%" if form == "octave" else "*", standing=standing.to_dict())
    leave(standing)


def write_equations(
    deck: Deck,
    form: Annotated[str, typer.Option("--as", help="text, latex, python or octave.")] = "text",
    name: Annotated[Pairs, typer.Option("--name", help="PATH=SYMBOL of a conductor, node or load, such as stack.gap=R_cn3.")] = [],  # noqa: B006
    to: To = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Derive the state equations of a linear model as symbols (needs sympy)."""
    from thermid.cli.app import _pairs
    from thermid.errors import DeckError, nearest
    from thermid.interop.equations import equations
    from thermid.model.deck.modelfile import load_model

    forms = ("text", "latex", "python", "octave")
    if form not in forms:
        raise DeckError(f"equations are not written as '{form}'.{nearest(form, forms)} There are {', '.join(forms)}.", "--as")
    found = equations(load_model(deck), _pairs(name, "--name"))
    text = f"{found}\n" if form == "text" else str(getattr(found, form)())
    _say(text, to, as_json, EQUATIONS, "%" if form in ("latex", "octave") else "#", symbols=dict(found.symbols))


def htc(
    power: Annotated[str, typer.Option("--power", help="Heat through the surface, W.")],
    area: Annotated[str, typer.Option("--area", help="Area of the surface, m^2.")],
    surface: Annotated[str, typer.Option("--surface", help="Settled temperature of the surface, degC.")],
    ambient: Annotated[str, typer.Option("--ambient", help="Temperature of the ambient, degC.")],
    height: Annotated[str, typer.Option("--height", help="Height of the vertical faces, m.")],
    box: Annotated[tuple[str, str] | None, typer.Option("--box", help="Length and width of a box of that height, m.")] = None,
    air: Annotated[
        tuple[float, float, float] | None, typer.Option("--air", help="Conductivity, kinematic viscosity and Prandtl number, SI.")
    ] = None,
    sensor: Annotated[str, typer.Option("--sensor", help="Standard error of each temperature, K.")] = "0.5",
    drift: Annotated[str, typer.Option("--drift", help="Variation of the room, K.")] = "0",
    emissivity: Annotated[float | None, typer.Option("--emissivity", help="Of the surface.")] = None,
    part: Annotated[Pairs, typer.Option("--part", help="NAME=LENGTH,CONDUCTIVITY for a Biot number, m and W/(m K).")] = [],  # noqa: B006
    capacitance: Annotated[str | None, typer.Option("--capacitance", help="Mass times specific heat, J/K.")] = None,
    settled_after: Annotated[str | None, typer.Option("--settled-after", help="When the test looked settled, s or '4 [h]'.")] = None,
    as_json: Json = False,
) -> None:
    """Compare the coefficient that a settled test shows with the one of correlations, and say what their difference can mean."""
    import warnings

    from thermid.cli.app import _with_unit
    from thermid.errors import ThermidWarning
    from thermid.physics.htc import compare_htc

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ThermidWarning)  # they stand among the remarks
        found = compare_htc(
            _with_unit(power, "W"),
            _with_unit(area, "m^2"),
            _with_unit(surface, "degC"),
            _with_unit(ambient, "degC"),
            _with_unit(height, "m"),
            box=(_with_unit(box[0], "m"), _with_unit(box[1], "m")) if box else None,
            air=air,
            sensor=_with_unit(sensor, "K"),
            drift=_with_unit(drift, "K"),
            emissivity=emissivity,
            parts=_parts(part),
            capacitance=_with_unit(capacitance, "J/K") if capacitance else None,
            settled_after=_with_unit(settled_after, "s") if settled_after else None,
        )
    typer.echo(json.dumps(_comparison(found)) if as_json else str(found))


def _parts(given: Pairs) -> dict[str, tuple[str | float, str | float]]:
    """Return ``NAME=LENGTH,CONDUCTIVITY`` options as a dictionary."""
    from thermid.cli.app import _pairs, _with_unit
    from thermid.errors import ThermidError

    out: dict[str, tuple[str | float, str | float]] = {}
    for name, text in _pairs(given, "--part").items():
        length, comma, conductivity = text.partition(",")
        if not comma:
            raise ThermidError(f"'{text}' must be LENGTH,CONDUCTIVITY, such as '20 [mm], 0.25'.", f"--part {name}")
        out[name] = (_with_unit(length.strip(), "m"), _with_unit(conductivity.strip(), "W/(m K)"))
    return out


def _comparison(found: Any) -> dict[str, Any]:
    """Return the object of ``thermid htc --json``."""
    from thermid.cli.output import clean

    settling = found.settling
    out: dict[str, Any] = clean(
        {
            "schema": 1,
            "status": "ok",
            "effective": found.effective,
            "error": found.error,
            "error_drift": found.error_drift,
            "theoretical": found.theoretical,
            "correlations": [{"name": c.name, "htc": c.htc, "rayleigh": c.rayleigh} for c in found.correlations],
            "radiation": found.radiation,
            "biot": {n: list(b) for n, b in found.biot.items()},
            "settling": None
            if settling is None
            else {"from_mass_s": settling.from_mass, "from_data_s": list(settling.from_data), "differs": settling.differs},
            "remarks": list(found.remarks),
        }
    )
    return out
