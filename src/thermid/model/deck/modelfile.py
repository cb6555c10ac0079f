"""Decks: TOML in, `Model` out, and back. The Python twin takes the same fields as a dictionary."""

from __future__ import annotations

import os
from collections.abc import Mapping
from keyword import iskeyword
from pathlib import Path
from typing import Any

from thermid.arguments import takes_objects
from thermid.errors import DeckError
from thermid.expression import NAME
from thermid.model.laws.curves import Curve
from thermid.model.parts.build import elements_from, made_from
from thermid.model.parts.parameter import parameter
from thermid.model.tree.identity import definition_of
from thermid.model.tree.model import Model
from thermid.model.tree.tree import Submodel
from thermid.toml_files import Places, read_toml, resolve_inside

DEEPEST = 20
_OTHERS = (
    ({"tests", "limits"}, "this is a qualification plan, not a deck. `thermid plan` reads it."),
    ({"duration"}, "this is a scenario, not a deck. It is laid over a deck with --scenario."),
    ({"boundaries"}, "this is a scenario, not a deck. It is laid over a deck with --scenario."),
)
"""Keys by which a file of another kind is known."""


@takes_objects
def load_model(path: str | os.PathLike[str]) -> Model:
    """Return the model that a deck describes, with the decks it uses.

    Parameters
    ----------
    path : path     A TOML file; `use` paths are relative to it and stay inside the project.

    Raises
    ------
    DeckError       When the file is missing, is no TOML, or does not follow the grammar; the message has file, line and key path.
    """
    return _load(Path(path), (), {})[0]


Loaded = tuple[Model, str]
"""A model with its identity, which is the definition that its instances share."""


def _load(path: Path, trail: tuple[Path, ...], known: dict[Path, Loaded]) -> Loaded:
    """Return a deck's model; each file is read once, however often it is used."""
    here = path.resolve()
    if here in trail:
        raise DeckError(f"the deck uses itself: {' -> '.join(p.name for p in (*trail, path))}.", path.name)
    if len(trail) >= DEEPEST:
        raise DeckError(f"decks use decks over more than {DEEPEST} levels.", path.name)
    if here not in known:
        data, lines = read_toml(path)
        if "stages" in data and "records" in data:
            raise DeckError("this is a campaign, not a deck; the decks of its stages stand under 'model'.", path.name)
        for keys, said in _OTHERS:
            if keys <= set(data) and not {"nodes", "submodels"} & set(data):
                raise DeckError(said, path.name)

        def use(name: str, where: str) -> Loaded:
            return _load(resolve_inside(path.parent, name, where), (*trail, here), known)

        model = model_from_dict(data, file=path.name, lines=lines, use=use)
        known[here] = model, definition_of(model)
    return known[here]


@takes_objects
def model_from_dict(data: Mapping[str, Any], *, file: str = "", lines: Mapping[str, int] | None = None, use: Any = None) -> Model:
    """Return the model that a dictionary describes: the Python twin of a deck, with the same fields.

    Parameters
    ----------
    data : dict     As the TOML of a deck; in ``submodels.<name>.use`` a `Model` may stand in place of a file name, and as `table` of a
                    conductor or a load what `law` returns.
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
    curves = _curves(plain)
    for group, name in curves:
        plain[group] = plain[group] | {name: plain[group][name] | {"table": {"points": []}}}
    from thermid.model.deck.schema import Deck

    where = Places(file or str(data.get("title", "deck")), places)
    deck = Deck.from_file(plain, where).model_dump(exclude_none=True)
    for (group, name), shape in curves.items():
        deck[group][name]["table"] = shape

    submodels = {}
    for name, table in deck["submodels"].items():
        if name in inner:
            part, definition = inner[name], definition_of(inner[name])
        elif use is None:
            raise DeckError("a file can be used from a deck only; give a Model here.", where(f"submodels.{name}.use"))
        else:
            part, definition = use(table["use"], where(f"submodels.{name}.use"))
        bind = {need: given if isinstance(given, str) else given["to"] for need, given in table["bind"].items()}
        apart = {need: given["sees"] for need, given in table["bind"].items() if not isinstance(given, str)}
        submodels[name] = Submodel(part, bind, definition, apart)
    elements: dict[str, Any] = elements_from(deck, where)
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
        made_in={gas: made_from(t, where(f"made_in.{gas}")) for gas, t in deck["made_in"].items()},
        file=file,
        lines=dict(places),
        **elements,
    )
    _check_names(model)
    return model.cut(*deck["cuts"])


def _tables(value: Any) -> list[tuple[str, Mapping[str, Any]]]:
    return [(n, t) for n, t in value.items() if isinstance(t, Mapping)] if isinstance(value, Mapping) else []


def _curves(data: Mapping[str, Any]) -> dict[tuple[str, str], Curve]:
    """Return (table, element) -> curve of the elements that have one where a deck has points."""
    found = {(group, name): t.get("table") for group in ("conductors", "loads") for name, t in _tables(data.get(group))}
    return {key: shape for key, shape in found.items() if isinstance(shape, Curve)}


def _check_names(model: Model) -> None:
    """Refuse names that are no names, one name for two things, and aliases that lead in a circle."""
    seen: dict[str, str] = {}
    tables = ("parameters", "nodes", "surfaces", "conductors", "joints", "enclosures", "loads", "submodels")
    given = [(name, f"{table}.{name}", f"one of {table}") for table in tables for name in getattr(model, table)]
    given += [(need, "needs", "a need") for need in model.needs]
    given += [(joint.mid, f"joints.{name}.mid", "the mid of a joint") for name, joint in model.joints.items() if joint.mid]
    for name, key, what in given:
        if not NAME.match(name) or "." in name:
            raise DeckError(f"'{name}' is no name: letters, digits and _ only, not starting with a digit.", model.where(key))
        if iskeyword(name) or name == "inf":
            raise DeckError(f"'{name}' is a word that expressions cannot hold as a name. Choose another one.", model.where(key))
        if name in seen:
            raise DeckError(f"'{name}' is already the name of {seen[name]}. A model has one namespace.", model.where(key))
        seen[name] = what
    for alias in model.aliases:
        key = f"aliases.{alias}"
        if not NAME.match(alias):
            raise DeckError(f"'{alias}' is no name: letters, digits and _ only, not starting with a digit.", model.where(key))
        if alias in seen:
            raise DeckError(f"'{alias}' is already the name of {seen[alias]}; an alias would hide it.", model.where(key))
        trail = [alias]
        while (step := _alias_in(model, model.aliases[trail[-1]])) is not None:
            if step in trail:
                raise DeckError(f"the alias '{alias}' leads in a circle: {' -> '.join([*trail, step])}.", model.where(key))
            trail.append(step)


def _alias_in(model: Model, path: str) -> str | None:
    """Return the alias that a path is or starts with, or None."""
    return next((a for a in (path, path.partition(".")[0]) if a in model.aliases), None)
