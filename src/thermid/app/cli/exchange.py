"""Commands of other tools' files: import, write-back, export, equations."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import typer

from thermid.app.cli.options import (
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
    answer,
    judged_model,
    leave,
    pairs,
    say,
    scenario_of,
)
from thermid.app.cli.screen import show
from thermid.base.errors import DeckError, OutputError, refuse_unknown, require
from thermid.base.files import FileKind, FileKinds, read_bytes
from thermid.base.units import counted
from thermid.interop.c99 import to_c
from thermid.interop.decks import NetworkFile, agreement, balance, printed_temperatures, read_esatan, read_sinda, to_esatan, to_sinda
from thermid.interop.equations import equations as derived
from thermid.interop.fmu import to_fmu
from thermid.interop.initfcn import read_initfcn
from thermid.interop.modelica import to_modelica
from thermid.interop.octave import to_octave
from thermid.interop.spice import to_spice
from thermid.model.tree import literal, load_model, model_from_dict, save_model, toml_text

COMMENTS = {"octave": "%", "c": "//", "modelica": "//", "spice": "*", "sinda": "C", "esatan": "#"}
"""Form of an export -> what begins a comment in it."""
To = Annotated[Path | None, typer.Option("--to", help="The file to write; standard output without it.")]


def _say(text: str, to: Path | None, as_json: bool, kind: FileKind, comment: str, **more: Any) -> None:
    """Write a text to its file or to standard output."""
    if to is not None:
        kind.save_text(to, text, comment)
    if as_json:
        shown = {"file": to.name} if to is not None else {"text": text}
        say(True, {**shown, **more}, "")
    elif to is not None:
        show(f"written: {to}")
    else:
        typer.echo(text, nl=False)


def import_file(
    file: Annotated[
        Path,
        typer.Argument(help="A SINDA case (.inp, .cc, .sin), ESATAN deck (.d) or InitFcn script: name = expression; % comment [unit]"),
    ],
    to: Annotated[Path | None, typer.Option("--to", help="The deck to write; what was read is only shown without it.")] = None,
    case: Annotated[
        Path | None, typer.Option("--scenario", help="The scenario to write: boundaries, starts, courses of SINDA or ESATAN.")
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(
            "--results", help="SINDA's print (.out) or ESATAN's TMD: its runs computed anew, each node's balance at its steady state."
        ),
    ] = None,
    units: Annotated[
        str, typer.Option("--units", help="Units that a SINDA deck leaves open: energy, time, length, temperature, as in 'BTU h ft F'.")
    ] = "",
    block: Annotated[
        bool,
        typer.Option("--block", help="Of a script: write one mass that convects and is heated around the values, each found by its unit."),
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Read a SINDA or ESATAN deck, or an InitFcn script.

    A deck becomes a model and a scenario; of a script the values are read. What cannot be said is listed.
    """
    network = _network(file, units)
    if network is None:
        _import_script(file, to, block, as_json)
        return
    model, judged, more = network.model(), list[str](), dict[str, object]()
    if results is not None:
        prints = printed_temperatures(results)
        compared = agreement(network, prints)
        judged, more["off_rms_K"] = [str(compared)], float(compared.rms.max())
        for settled in [item for item in prints if item.settled][-1:]:
            closing = balance(network, settled)
            judged, more["not_closed_W"] = [*judged, str(closing)], closing.open()
    if to is not None:
        save_model(model, to)
    if case is not None:
        FileKinds.SCENARIO.save_text(case, toml_text(network.case()))
    shown = {
        "nodes": len(network.nodes),
        "conductors": len(network.conductors),
        "loads": len(network.loads),
        "groups": network.groups(),
        "incomplete": network.incomplete,
        "dropped": [str(item) for item in network.remarks if item.dropped],
        "remarks": [str(item) for item in network.remarks if not item.dropped],
    } | more
    files = [f"written: {item}" for item in (to, case) if item is not None]
    say(as_json, shown, "\n".join([str(network), *judged, *files]))
    leave(model.standing)


def write_back(
    file: Annotated[Path, typer.Argument(help="The SINDA case (.inp, .cc) or ESATAN deck (.d) that `thermid import` read.")],
    deck: Annotated[Path, typer.Argument(help="The deck that the import wrote.")],
    to: Annotated[Path, typer.Option("--to", help="The folder for the changed files; the read ones stay as they are.")],
    values: ValuesPath = None,
    keep_values: KeepValues = False,
    param: Parameters = [],  # noqa: B006
    accept: Accept = None,
    units: Annotated[str, typer.Option("--units", help="The units that `thermid import` was given.")] = "",
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write fitted values into copies of a SINDA or ESATAN deck.

    The copies are equal but for the numbers that changed, each with a comment.
    """
    network = _network(file, units)
    if network is None:
        raise DeckError("it has neither $MODEL (ESATAN) nor HEADER or BCD 3 (SINDA).", str(file), code="file.another-kind")
    model, standing = judged_model(deck, values, keep_values, param, accept)
    texts, rest = network.written_back(model), network.not_written_back(model)
    targets = {to / Path(name).name: text for name, text in texts.items()}
    if targets:
        to.mkdir(parents=True, exist_ok=True)
    for target, text in targets.items():
        FileKinds.COPY.save_bytes(target, text.encode("latin-1"))
    lines = [f"written: {target}" for target in targets]
    if not targets:
        lines = ["no file was written" if rest else "nothing differs from the deck: no file was written"]
    if rest:
        what = f"INCOMPLETE: {counted(len(rest), 'changed value')} without a number of its own in the deck, not written: {', '.join(rest)}"
        lines.insert(0, what)
    answer(standing, as_json, {"files": [target.name for target in targets], "not_written": list(rest)}, "\n".join(lines))


def _network(file: Path, units: str = "") -> NetworkFile | None:
    """Return the network of a deck, None of a script; its content tells which tool wrote it."""
    head = read_bytes(file)[:1_000_000].decode("latin-1") if file.is_file() else ""
    if head.startswith("PK"):
        raise DeckError(
            "it is a workbook or another archive, which has no deck in it. Make a deck of the rows: docs/from/spreadsheet.md.",
            str(file),
            code="file.another-kind",
        )
    if re.search(r"^\s*\$MODEL\b", head, re.MULTILINE | re.IGNORECASE):
        return read_esatan(file)
    if not head or re.search(r"^\s*(?:HEADER\s+\w+|BCD\s+3)", head, re.MULTILINE | re.IGNORECASE):
        return read_sinda(file, units)
    return None


def _import_script(script: Path, to: Path | None, block: bool, as_json: bool) -> None:
    """Read the parameters of an InitFcn script and write them as a deck."""
    script_values = read_initfcn(script)
    title = (to or script).stem
    model = model_from_dict(script_values.block(title) if block else script_values.deck(title))
    if to is not None:
        save_model(model, to)
    shown = {"file": to.name} if to is not None else {}
    parameters = {n: {"text": p.text, "number": script_values.numbers[n], "note": p.note} for n, p in script_values.parameters.items()}
    rest = "" if block else "; its nodes, surfaces and loads are still to be written"
    text = f"{script_values}\nwritten: {to}{rest}" if to is not None else script_values
    say(as_json, {**shown, "parameters": parameters, "remarks": list(script_values.remarks)}, text)


def export(
    deck: Deck,
    form: Annotated[
        str,
        typer.Option(
            "--as",
            help="octave (also for MATLAB), c (C99 header), modelica (package), spice (netlist), sinda, esatan (deck), fmu (with --to).",
        ),
    ] = "octave",
    to: To = None,
    fmi: Annotated[str, typer.Option("--fmi", help="Version of the FMU: 3.0 or 2.0.")] = "3.0",
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
    step: Annotated[
        str | None, typer.Option("--step", help="Length of a step of the C header: 5 [s]; the longest with an error of 1 mK without it.")
    ] = None,
    library: Annotated[
        str | None, typer.Option("--library", help="Of a Modelica package: modelica, its Standard Library, or none: parts of its own.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a model as C, Modelica, FMI, Octave, SPICE, SINDA, ESATAN.

    The scenario is written with it. What the format cannot say is refused.
    """
    refuse_unknown([form], (*COMMENTS, "fmu"), "--as", "a model is not written as '{}'.{near} There are {known}.", DeckError)
    model, standing = judged_model(deck, values, keep_values, param, accept)
    conditions = scenario_of(scenario, boundary, load, start, duration, vacuum, as_printed)
    if step is not None and form != "c":
        raise DeckError(f"a step is of a C header; '{form}' has no steps of its own.", "--step", code="value.without-effect")
    if library is not None and form != "modelica":
        raise DeckError(f"a library is of a Modelica package; '{form}' has none.", "--library", code="value.without-effect")
    if form == "fmu":
        if to is None:
            raise OutputError("an FMU is a file of bytes: give it a name, --to model.fmu.", "--as fmu", code="output.wrong-ending")
        written = to_fmu(model, conditions, to, fmi)
        answer(standing, as_json, {"file": to.name, **written.to_dict()}, f"{written}\nwritten: {to}")
    name = to.stem if to is not None else ""
    text = {
        "octave": lambda: to_octave(model, conditions, name=name),
        "c": lambda: to_c(model, conditions, name=name, step=literal(step, "s", "--step") if step is not None else None),
        "modelica": lambda: to_modelica(model, conditions, name=name, library=library or "modelica"),
        "spice": lambda: to_spice(model, conditions),
        "sinda": lambda: to_sinda(model, conditions),
        "esatan": lambda: to_esatan(model, conditions),
    }[form]()
    if not standing.fair and not as_json:
        show(standing.line(), err=True)  # what is written is for another tool to read
    _say(text, to, as_json, FileKinds.EXPORT, COMMENTS[form], standing=standing.to_dict())
    leave(standing)


def equations(
    deck: Deck,
    form: Annotated[str, typer.Option("--as", help="text, latex, python or octave.")] = "text",
    name: Annotated[list[str], typer.Option("--name", help="PATH=SYMBOL of a conductor, node or load, such as stack.gap=R_cn3.")] = [],  # noqa: B006
    to: To = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Derive the state equations of a linear model as symbols.

    Needs sympy.
    """
    require("symbolic", "thermid equations")
    forms = ("text", "latex", "python", "octave")
    refuse_unknown([form], forms, "--as", "equations are not written as '{}'.{near} There are {known}.", DeckError)
    system = derived(load_model(deck), pairs(name, "--name"))
    text = f"{system}\n" if form == "text" else str(getattr(system, form)())
    _say(text, to, as_json, FileKinds.EQUATIONS, "%" if form in ("latex", "octave") else "#", symbols=dict(system.symbols))
