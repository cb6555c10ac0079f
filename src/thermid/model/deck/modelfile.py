"""Decks: TOML in, `Model` out, and back. The Python twin takes the same fields as a dictionary."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from keyword import iskeyword
from pathlib import Path
from typing import Any

from thermid.arguments import takes_objects
from thermid.errors import DeckError
from thermid.expression import NAME, RESERVED
from thermid.model.tree.identity import definition_of
from thermid.model.tree.model import Model
from thermid.model.tree.tree import TABLES, Submodel
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
    from thermid.model.deck.schema import Deck

    where = Places(file or str(data.get("title", "deck")), lines or {})
    deck = Deck.from_file(data, where)

    def below(key: str) -> Callable[[str], str]:
        return lambda inner: where(f"{key}.{inner}" if inner else key)

    submodels = {}
    for name, table in deck.submodels.items():
        if isinstance(table.use, Model):
            part, definition = table.use, definition_of(table.use)
        elif use is None:
            raise DeckError("a file can be used from a deck only; give a Model here.", where(f"submodels.{name}.use"))
        else:
            part, definition = use(table.use, where(f"submodels.{name}.use"))
        bind = {need: node if isinstance(node, str) else node.to for need, node in table.bind.items()}
        sees = {need: node.sees for need, node in table.bind.items() if not isinstance(node, str)}
        submodels[name] = Submodel(part, bind, definition, sees)
    elements: dict[str, Any] = {
        group: {name: table.element(below(f"{group}.{name}")) for name, table in getattr(deck, group).items()} for group in TABLES
    }
    model = Model(
        title=deck.title,
        box=deck.box,
        use=deck.use,
        needs=tuple(deck.needs),
        offers=tuple(deck.offers),
        parameters=deck.parameters,
        submodels=submodels,
        settings=deck.set,
        aliases=deck.aliases,
        made_in={gas: table.element(below(f"made_in.{gas}")) for gas, table in deck.made_in.items()},
        file=file,
        lines=dict(lines or {}),
        **elements,
    )
    _check_names(model)
    return model.cut(*deck.cuts)


def _check_names(model: Model) -> None:
    """Refuse names that are no names, one name for two things, and aliases that lead in a circle."""
    seen: dict[str, str] = {}
    tables = ("parameters", *TABLES, "submodels")
    given = [(name, f"{table}.{name}", f"one of {table}") for table in tables for name in getattr(model, table)]
    given += [(need, "needs", "a need") for need in model.needs]
    given += [(joint.mid, f"joints.{name}.mid", "the mid of a joint") for name, joint in model.joints.items() if joint.mid]
    for name, key, what in given:
        if not NAME.match(name) or "." in name:
            raise DeckError(f"'{name}' is no name: letters, digits and _ only, not starting with a digit.", model.where(key))
        if name in model.parameters and (iskeyword(name) or name in RESERVED):
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
