"""Decks: TOML in, `Model` out, and back. The Python twin takes the same fields as a dictionary."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.errors import DeckError, ThermidError, nearest
from thermid.expression import NAME
from thermid.model.build import elements_from
from thermid.model.lines import line_numbers
from thermid.model.model import Model, Submodel
from thermid.model.parameter import Parameter, parameter

if TYPE_CHECKING:
    from pydantic import ValidationError

__all__ = ["load_model", "model_from_dict", "project_root", "resolve_inside", "save_model", "to_dict"]

MARKER = "thermid.toml"
LARGEST_FILE = 4_000_000


def project_root(start: Path) -> Path:
    """Return the nearest folder upward that holds ``thermid.toml``, or the start folder itself."""
    start = start.resolve()
    return next((folder for folder in (start, *start.parents) if (folder / MARKER).is_file()), start)


def resolve_inside(folder: Path, name: str, where: str, roots: tuple[Path, ...] = ()) -> Path:
    """Return the path of a file named in a deck; it must lie in the project or in one of `roots`.

    Raises
    ------
    DeckError   When it leaves them, symbolic links resolved.
    """
    root = project_root(folder)
    path = (folder / name).resolve()
    if not any(path.is_relative_to(r) for r in (root, *(r.resolve() for r in roots))):
        raise DeckError(f"'{name}' leaves the project ({MARKER} marks its root). Copy the file into the project.", where)
    return path


def read_toml(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the content of a TOML file and the line of each key.

    Raises
    ------
    DeckError   When the file is missing, too large, not text, or no TOML.
    """
    if not path.is_file():
        near = nearest(path.name, [p.name for p in path.parent.glob("*.toml")]) if path.parent.is_dir() else ""
        raise DeckError(f"there is no file '{path.name}' in {path.parent.name or '.'}/.{near}")
    if path.stat().st_size > LARGEST_FILE:
        raise DeckError(f"the file has {path.stat().st_size / 1e6:.1f} MB; a deck is a text of a few kilobytes. Put tables of data into a log.", path.name)
    try:
        text = path.read_text(encoding="utf-8-sig")
        return tomllib.loads(text), line_numbers(text)
    except UnicodeDecodeError:
        raise DeckError("the file is not UTF-8 text.", path.name) from None
    except tomllib.TOMLDecodeError as error:
        raise DeckError(f"this is no TOML: {error}", path.name) from None


def load_model(path: str | os.PathLike[str]) -> Model:
    """Return the model that a deck describes, with the decks it uses.

    Parameters
    ----------
    path : path     A TOML file; `use` paths are relative to it and stay inside the project.

    Raises
    ------
    DeckError       When the file is missing, is no TOML, or does not follow the grammar; the message has file, line and key path.
    """
    return _load(Path(path), ())


def _load(path: Path, trail: tuple[Path, ...]) -> Model:
    if path.resolve() in trail:
        raise DeckError(f"the deck uses itself: {' -> '.join(p.name for p in (*trail, path))}.", path.name)
    data, lines = read_toml(path)
    deeper = (*trail, path.resolve())

    def use(name: str, where: str) -> tuple[Model, str]:
        target = resolve_inside(path.parent, name, where)
        model = _load(target, deeper)
        return model, f"{target.stem}:{model.identity()}"

    return model_from_dict(data, file=path.name, lines=lines, use=use)


def model_from_dict(data: Mapping[str, Any], *, file: str = "", lines: Mapping[str, int] | None = None, use: Any = None) -> Model:
    """Return the model that a dictionary describes: the Python twin of a deck, with the same fields.

    Parameters
    ----------
    data : dict     As the TOML of a deck; in ``submodels.<name>.use`` a `Model` may stand in place of a file name.
    file : str      For messages.
    lines : dict    Key path -> line, for messages.

    Raises
    ------
    DeckError       When it does not follow the grammar; every fault is listed.
    """
    places = lines or {}
    inner = {name: table["use"] for name, table in _tables(data.get("submodels")) if isinstance(table.get("use"), Model)}
    plain = dict(data)
    if inner:
        plain["submodels"] = {n: {**t, "use": n} if n in inner else t for n, t in data["submodels"].items()}
    deck = _validated(plain, file, places)

    def where(key: str) -> str:
        place = f"{file}:{places[key]}" if file and key in places else file or str(data.get("title", ""))
        return f"{place}, {key}" if place else key

    submodels = {}
    for name, table in deck["submodels"].items():
        if name in inner:
            part, definition = inner[name], inner[name].identity()
        elif use is None:
            raise DeckError("a file can be used from a deck only; give a Model here.", where(f"submodels.{name}.use"))
        else:
            part, definition = use(table["use"], where(f"submodels.{name}.use"))
        submodels[name] = Submodel(part, table["bind"], definition)
    model = Model(
        title=deck["title"],
        box=deck["box"],
        use=deck["use"],
        needs=tuple(deck["needs"]),
        offers=tuple(deck["offers"]),
        parameters={n: parameter(v, where(f"parameters.{n}")) for n, v in deck["parameters"].items()},
        submodels=submodels,
        settings={n: parameter(v, where(f"set.{n}")) for n, v in deck["set"].items()},
        aliases=deck["aliases"],
        file=file,
        lines=dict(places),
        **elements_from(deck, where),
    )
    _check_names(model)
    return model


def _tables(value: Any) -> list[tuple[str, Mapping[str, Any]]]:
    return [(n, t) for n, t in value.items() if isinstance(t, Mapping)] if isinstance(value, Mapping) else []


def _validated(data: Mapping[str, Any], file: str, lines: Mapping[str, int]) -> dict[str, Any]:
    """Check a dictionary against the grammar and return it with defaults filled in."""
    from pydantic import ValidationError

    from thermid.model.schema import Deck

    try:
        return Deck.model_validate(dict(data)).model_dump(exclude_none=True)
    except ValidationError as error:
        raise _deck_error(error, file or str(data.get("title", "")), lines) from None


def _deck_error(error: ValidationError, file: str, lines: Mapping[str, int]) -> DeckError:
    """Turn pydantic's list of faults into one message, a line per fault, each with its key path."""
    from thermid.model.schema import Deck

    faults: dict[str, str] = {}
    for fault in error.errors():
        location = [str(p) for p in fault["loc"]]
        key = ".".join(p for p in location if p not in ("str", "float", "ValueTable", "PowerLaw"))
        if fault["type"] == "extra_forbidden":
            table = location[0] if len(location) > 1 else ""
            text = f"'{location[-1]}' is no field here.{nearest(location[-1], _fields(Deck, table))}"
        elif fault["type"] == "missing":
            text = "is missing."
        else:
            text = f"{fault['msg'][0].lower()}{fault['msg'][1:]}."
        faults.setdefault(key, text)
    shown = []
    for key, text in faults.items():
        line = next((lines[k] for k in (key, key.rpartition(".")[0]) if k in lines), None)
        shown.append(f"{f'{file}:{line}' if line else file}, {key}: {text}")
    head, *rest = shown
    where, _, message = head.partition(": ")
    return DeckError("\n  ".join([message, *rest]), where)


def _fields(deck: Any, table: str) -> list[str]:
    if not table:
        return list(deck.model_fields)
    schema = deck.model_json_schema()
    reference = schema["properties"].get(table, {}).get("additionalProperties", {}).get("$ref", "").rpartition("/")[2]
    return list(schema.get("$defs", {}).get(reference, {}).get("properties", {}))


def _check_names(model: Model) -> None:
    """Refuse names that are no names, and one name for two things."""
    seen: dict[str, str] = {}
    tables = ("parameters", "nodes", "surfaces", "conductors", "joints", "loads", "submodels")
    for table in tables:
        for name in getattr(model, table):
            if not NAME.match(name) or "." in name:
                raise DeckError(f"'{name}' is no name: letters, digits and _ only, not starting with a digit.", model.where(f"{table}.{name}"))
            if name in seen:
                raise DeckError(f"'{name}' is already the name of one of {seen[name]}. A model has one namespace.", model.where(f"{table}.{name}"))
            seen[name] = table
    for need in model.needs:
        if need in seen:
            raise DeckError(f"need '{need}' is also the name of one of {seen[need]}.", model.where("needs"))
    for mid in (j.mid for j in model.joints.values() if j.mid):
        if mid in seen or not NAME.match(mid):
            raise DeckError(f"mid '{mid}' is already a name here, or is no name.", model.where("joints"))


def to_dict(model: Model) -> dict[str, Any]:
    """Return the dictionary that describes a model, without its layers; submodels stand as dictionaries under `use`."""
    from thermid.model.build import elements_to

    out: dict[str, Any] = {"title": model.title, "box": model.box}
    for key, value in (("use", model.use), ("needs", list(model.needs)), ("offers", list(model.offers))):
        if value:
            out[key] = value
    out["parameters"] = {n: value_to(p) for n, p in model.parameters.items()}
    out |= elements_to(model)
    out["submodels"] = {n: {"use": to_dict(s.model), "bind": dict(s.bind)} for n, s in model.submodels.items()}
    out["set"] = {n: value_to(p) for n, p in model.settings.items()}
    if model.layers:
        out["layers"] = [{"origin": layer.origin, "values": {n: value_to(p) for n, p in layer.values.items()}} for layer in model.layers]
    out["aliases"] = dict(model.aliases)
    return {k: v for k, v in out.items() if v not in ({}, [])}


def value_to(given: Parameter) -> Any:
    """Return what a deck writes for a parameter."""
    from thermid.model.build import written

    return written(given)


def save_model(model: Model, path: str | os.PathLike[str], like: str | os.PathLike[str] | None = None) -> None:
    """Write a model as a deck, and its submodels as decks beside it.

    Parameters
    ----------
    path : path     The deck to write; submodels go to ``<title>.toml`` beside it.
    like : path     A deck whose comments and order are kept; values that differ are changed in it.

    Raises
    ------
    DeckError       When two different submodels would be written to one file.
    """
    from thermid.model.save import write

    write(model, Path(path), Path(like) if like is not None else None)


