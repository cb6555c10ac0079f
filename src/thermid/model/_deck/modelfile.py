"""Decks: TOML in, `Model` out, and back. The Python twin takes the same fields as a dictionary.

Writing decks, with the comments of an existing one kept where it serves as a pattern.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass
from keyword import iskeyword
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.base.errors import DeckError, ThermidError, cap, errors_at, look_up, nearest, raising, refuse_first
from thermid.base.files import (
    FileKinds,
    Places,
    by_grammar,
    grammar_of,
    read_text,
    read_toml,
    refuse_another_kind,
    resolve_inside,
    toml_key,
    toml_value,
    unsealed,
)
from thermid.base.units import RESERVED, Expression
from thermid.model._deck.rows import written_out
from thermid.model._parts.parameter import Parameter
from thermid.model._tree.arrays import Instances, made_instances, merged
from thermid.model._tree.flat import Flat
from thermid.model._tree.identity import definition_of, to_dict, written
from thermid.model._tree.model import Model
from thermid.model._tree.tree import TABLES, Submodel

if TYPE_CHECKING:
    from thermid.model._deck.assemblies import Assembly

STANDARD = "std:"
"""What the name of a standard part begins with where a deck uses it."""
_PARTS = Path(__file__).with_name("parts")


SCHEMA = "thermid.model._deck.schema"
ASSEMBLIES = ("packages", "ladders", "coolers", "fans")
"""Groups of a deck whose elements are small decks."""


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


def model_beside(path: Path, data: Mapping[str, Any]) -> Model:
    """Return the model of a deck's content, as it would be read from a file; the decks that it uses lie beside that file.

    Raises
    ------
    DeckError       When it does not follow the grammar.
    """
    return _model_of_content(path, data, {}, (path.resolve(),), {})


Loaded = tuple[Model, str]
"""A model with its identity, which is the definition that its instances share."""


def _load(path: Path, trail: tuple[Path, ...], loaded: dict[Path, Loaded]) -> Loaded:
    """Return a deck's model; each file is read once, however often it is used."""
    here = path.resolve()
    refuse_first(
        lambda _: path.name,
        (here in trail, f"the deck uses itself: {' -> '.join(p.name for p in (*trail, path))}.", "", "model.self-reference"),
        (
            len(trail) >= cap("decks"),
            f"decks are nested deeper than {cap('decks'):.0f} levels. Merge some levels.{raising('decks')}",
            "",
            "cap.exceeded",
        ),
    )
    if here not in loaded:
        data, lines = read_toml(path)
        refuse_another_kind(f"{SCHEMA}.Deck", data, Places(path.name, lines))
        model = _model_of_content(path, data, lines, (*trail, here), loaded)
        loaded[here] = model, definition_of(model)
    return loaded[here]


def _model_of_content(
    path: Path, data: Mapping[str, Any], lines: Mapping[str, int | str], trail: tuple[Path, ...], loaded: dict[Path, Loaded]
) -> Model:
    """Return the model of a deck's content; `trail` has the decks that use it, and itself."""

    def use(name: str, where: str) -> Loaded:
        """Load a deck that this one uses, from within its folder."""
        with errors_at(where):  # a file that is not there has no place of its own
            return _load(resolve_inside(path.parent, name, where), trail, loaded)

    def read(name: str, where: str) -> str:
        """Read a text file from within the deck's folder."""
        return _text_of(resolve_inside(path.parent, name, where), where)

    return _built(data, path.name, lines, use, read)


def _text_of(path: Path, where: str) -> str:
    """Return the text of a UTF-8 file, or raise a DeckError at `where`."""
    if not path.is_file():
        near = nearest(path.name, {p.name for p in path.parent.glob(f"*{path.suffix}")})
        raise DeckError(f"there is no file '{path.name}'.{near}", where, code="file.not-found")
    try:
        return read_text(path, "utf-8-sig")
    except UnicodeDecodeError:
        raise DeckError(f"'{path.name}' is not UTF-8 text.", where, code="file.not-text") from None


@dataclass(frozen=True)
class _Site:
    """Where a deck stands, for messages, and how to read the decks and files that it names.

    Parameters
    ----------
    where : Places      Key path -> place, for messages.
    use : callable      File name and place -> model and its definition; None where a deck has no folder.
    read : callable     File name and place -> text; None likewise.
    """

    where: Places
    use: Any
    read: Any

    def below(self, key: str) -> Callable[[str], str]:
        """Return a function from a key below `key` to its place, for messages."""
        return lambda inner: self.where(f"{key}.{inner}" if inner else key)


def model_from_dict(data: Mapping[str, Any]) -> Model:
    """Return the model that a dictionary describes: the Python twin of a deck, with the same fields.

    Parameters
    ----------
    data : dict     As the TOML of a deck; in ``submodels.<name>.use`` a `Model` may stand in place of a file name, and as `table` of a
                    conductor or a load what `law` returns.

    Raises
    ------
    DeckError       When it does not follow the grammar, or physics forbids a value; every fault is listed.
    """
    model = _built(data, "", {}, None, None)
    try:
        flat = Flat.of_model(model)
        faults = [f"{where}: {message}" for _, where, message in flat.impossible(flat.parameters.evaluate({}), flat.ranges)]
    except ThermidError:  # what does not fit together is said by `check` and by the first use, with all else that they find
        return model
    if faults:
        raise DeckError("\n  ".join(faults), code="value.outside-range")
    return model


def _built(data: Mapping[str, Any], file: str, lines: Mapping[str, int | str], use: Any, read: Any) -> Model:
    """Return the model of a deck's content without a look at its values, since those of a part may be set by the deck that uses it."""
    where = Places(file or str(data.get("title", "deck")), lines)
    if data.get("tables"):
        tables = grammar_of(f"{SCHEMA}.tables_of")(data["tables"], where)
        data, lines = written_out(data, tables, where, read, grammar_of(f"{SCHEMA}.fields_of_groups")())
        where = Places(where.file, lines)
    deck = by_grammar(f"{SCHEMA}.Deck", data, where)
    site = _Site(where, use, read)
    elements: dict[str, Any] = {
        group: {name: table.element(site.below(f"{group}.{name}")) for name, table in getattr(deck, group).items()} for group in TABLES
    }
    submodels: dict[str, Submodel[Model]] = {}
    settings: dict[str, Parameter] = dict(deck.set)
    places = dict(where.lines)
    for key, instances_made in _parts(deck, site):
        for table, more in (
            (submodels, instances_made.submodels),
            (settings, instances_made.settings),
            (elements["conductors"], instances_made.conductors),
        ):
            merged(table, more, where(key))
        line = _line(where, key)
        if line:
            paths = [f"set.{path}" for path in instances_made.settings]
            paths += [f"{table}.{name}" for table in ("submodels", "conductors") for name in getattr(instances_made, table)]
            places |= dict.fromkeys(paths, line)
    plain: dict[str, Any] = {name: getattr(deck, name) for name in ("title", "box", "use", "incomplete", "parameters", "aliases")}
    made_in = {gas: table.element(site.below(f"made_in.{gas}")) for gas, table in deck.made_in.items()}
    model = Model(
        **plain,
        **elements,
        needs=tuple(deck.needs),
        offers=tuple(deck.offers),
        submodels=submodels,
        settings=settings,
        made_in=made_in,
        file=file,
        lines=places,
    )
    _check_names(model)
    return model.cut(*deck.cuts)


def _line(where: Places, key: str) -> int | str | None:
    """Return the line of a key of a deck, or that of its group; None where neither is known."""
    return where.lines.get(key) or where.lines.get(key.partition(".")[0])


def _parts(deck: Any, site: _Site) -> Iterator[tuple[str, Instances]]:
    """Yield (key in the deck, `Instances`) for each submodel and each package, ladder, cooler and fan."""
    for name, used in deck.submodels.items():
        key = f"submodels.{name}"
        if isinstance(used.use, Model):
            part, definition = used.use, definition_of(used.use)
        elif used.use.startswith(STANDARD):
            refusal = "no standard part '{}'.{near} 'thermid example --parts' lists all."
            file = look_up(used.use, standard_parts(), refusal, site.where(f"{key}.use"), DeckError)
            part, definition = _load(file, (), {})
        elif site.use is None:
            raise DeckError(
                "a file name works in a deck file only. Here pass a Model: td.load_model(file).",
                site.where(f"{key}.use"),
                code="value.wrong-kind",
            )
        else:
            part, definition = site.use(used.use, site.where(f"{key}.use"))
        below = site.below(key)
        yield key, made_instances(name, used.use_of(), part, definition, used.joined(below), below)
    for group in ASSEMBLIES:
        for name, table in getattr(deck, group).items():
            key = f"{group}.{name}"
            yield key, _assembled(name, table.assembly(name, site.below(key), site.read), site, key)


def _assembled(name: str, assembly: Assembly, site: _Site, key: str) -> Instances:
    """Return the small deck of an element of several nodes as a part, its places those of the element."""
    where, home = site.where, _line(site.where, key)
    lines: dict[str, int | str] = {}
    if home:
        lines = dict.fromkeys((*TABLES, "title", "needs", "parameters"), home)
        lines |= {f"parameters.{inner.removeprefix(key)[1:]}": line for inner, line in where.lines.items() if inner.startswith(f"{key}.")}
    part = _built(assembly.deck, where.file, lines, None, None)
    settings = {f"{name}.{path}": Parameter.read(raw, where(f"{key}.{path}")) for path, raw in assembly.values.items()}
    return Instances({name: Submodel(part, assembly.bind, definition_of(part), made=key.partition(".")[0])}, settings, {})


def _check_names(model: Model) -> None:
    """Refuse names that are no names, one name for two things, and aliases that lead in a circle."""
    first_use: dict[str, str] = {}
    tables = ("parameters", *TABLES, "submodels")
    declared = [(name, f"{table}.{name}", f"one of {table}") for table in tables for name in getattr(model, table)]
    declared += [(need, "needs", "a need") for need in model.needs]
    declared += [(joint.mid, f"joints.{name}.mid", "the mid of a joint") for name, joint in model.joints.items() if joint.mid]
    declared += [(alias, f"aliases.{alias}", "an alias") for alias in model.aliases]
    for name, key, what in declared:
        refuse_first(
            model.where,
            (
                not re.match(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*\Z", name) or ("." in name and name not in model.aliases),
                f"'{name}' is not a valid name: use letters, digits and _, and do not begin with a digit.",
                key,
                "name.not-valid",
            ),
            (
                name in model.parameters and (iskeyword(name) or name in RESERVED),
                f"'{name}' is a reserved word of expressions. Choose another name.",
                key,
                "name.not-valid",
            ),
            (
                name in first_use,
                f"'{name}' is already the name of {first_use.get(name)}. Names in a model must differ; choose another one.",
                key,
                "name.taken",
            ),
        )
        first_use[name] = what
    for alias in model.aliases:
        trail = [alias]
        while (step := path if (path := model.aliases[trail[-1]]) in model.aliases else path.partition(".")[0]) in model.aliases:
            if step in trail:
                text = f"the alias '{alias}' refers to itself: {' -> '.join([*trail, step])}."
                raise DeckError(text, model.where(f"aliases.{alias}"), code="model.self-reference")
            trail.append(step)


def standard_parts() -> dict[str, Path]:
    """Return name of every standard part, as a deck uses it -> its deck."""
    return {f"{STANDARD}{file.stem}": file for file in sorted(_PARTS.glob("*.toml"))}


def _file_name(title: str) -> str:
    """Return the name of a deck's file from a title: other characters than letters, digits, _ and - become _."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", title).strip("_") + ".toml"


def save_model(model: Model, path: str | os.PathLike[str], like: str | os.PathLike[str] | None = None) -> None:
    """Write a model as a deck, and its submodels as decks beside it.

    Parameters
    ----------
    path : path     The deck to write; submodels go to ``<title>.toml`` beside it, or to ``<deck>_<title>.toml`` where another deck has a
                    part of that name there.
    like : path     A deck whose comments and order are kept; values that differ are changed in it.

    Raises
    ------
    DeckError       When two different submodels would be written to one file.
    OutputError     When a deck is there that thermid did not write, or that was changed since; the deck that `like` names may be
                    overwritten.
    """
    target = Path(path)
    pattern = Path(like) if like is not None else None
    files: dict[Path, Model] = {}
    names = _part_names(model, target)
    _collect(model, target, files, names)
    # a part's deck that thermid did not write and that says the same already stays as its author wrote it
    parts = {file: part for file, part in files.items() if file != target and file.is_file()}
    same = {f for f, part in parts.items() if not FileKinds.DECK.titled(part.title).wrote(f) and _equals(f, part)}
    files = {file: part for file, part in files.items() if file not in same}
    texts = {file: model_text(part, pattern if file == target else None, names) for file, part in files.items()}
    # a deck that is changed in its place, comments kept, carries its content on; every other file is looked at before any is written
    changed = target if pattern is not None and target.exists() and pattern.samefile(target) else None
    kinds = {file: FileKinds.RESULTS_FILE if file == changed else FileKinds.DECK.titled(part.title) for file, part in files.items()}
    for file, kind in kinds.items():
        kind.may_write(file)
    for file, text in texts.items():
        kinds[file].save_text(file, text)


def _part_names(model: Model, target: Path) -> dict[str, str]:
    """Return title of a part -> its file beside the deck; parts of other decks there keep theirs."""
    used_files = _used_by(target)
    out: dict[str, str] = {}
    for part in (part for part, prefix in model.walk() if prefix):
        name, alone = _file_name(part.title), _file_name(f"{target.stem} {part.title}")
        there = target.parent / name
        other = name not in used_files and there.is_file() and FileKinds.DECK.titled(part.title).wrote(there) and not _equals(there, part)
        out[part.title] = alone if alone in used_files or other else name
    return out


def _used_by(deck: Path) -> set[str]:
    """Return the files beside a deck that it and its parts use."""
    out: set[str] = set()
    waiting = [deck]
    while waiting:
        file = waiting.pop()
        used = set(re.findall(r'"([^"/]+\.toml)"', file.read_text(encoding="utf-8"))) if file.is_file() else set()
        waiting += [deck.parent / name for name in used - out]
        out |= used
    return out


def _equals(path: Path, model: Model) -> bool:
    """Whether a deck is the same as a model."""
    try:
        return load_model(path) == model
    except ThermidError:
        return False


def _collect(model: Model, path: Path, files: dict[Path, Model], names: Mapping[str, str]) -> None:
    """Add a model and its parts to `files`, by the file that each is to be written to."""
    if path in files and files[path].identity() != model.identity():
        raise DeckError(
            f"two different submodels would be saved in the same file '{path.name}'. Give them different titles.", code="name.taken"
        )
    files[path] = model
    for part in model.submodels.values():
        _collect(part.model, path.parent / names[part.model.title], files, names)


def model_text(model: Model, like: Path | None = None, names: Mapping[str, str] | None = None) -> str:
    """Return the TOML of one deck; layers laid over it become its [set] or its values; `names` has the files of parts by title."""
    data = to_dict(model)
    data["submodels"] = {
        n: {"use": (names or {}).get(s.model.title, _file_name(s.model.title)), "bind": s.bound()} for n, s in model.submodels.items()
    }
    data.pop("layers", None)
    for layer in model.layers:
        for name, value in layer.values.items():
            _lay(data, name, written(value))
    data = {k: v for k, v in data.items() if v != {}}
    if like is None:
        return toml_text(data)
    from tomlkit import dumps, parse as parse_text  # 10 ms that a model which is only read does not need

    document = parse_text(unsealed(like.read_text(encoding="utf-8")))
    if "box" not in document and model.box == Model(title="").box:
        del data["box"]
    _update(document, data, top=True)
    return dumps(document)


def _lay(data: dict[str, Any], path: str, value: Any) -> None:
    """Put a value that was laid over a model into its deck: at its own place, or in [set] for a submodel's."""
    *groups, key = place_of(data, path)
    home = data
    for group in groups:
        home = home.setdefault(group, {})
    home[key] = value


def place_of(data: Mapping[str, Any], path: str) -> tuple[str, ...]:
    """Return the keys under which a deck holds a value: its own place, or that in [set] for a submodel's."""
    head, _, rest = path.partition(".")
    tables = ("nodes", "surfaces", "conductors", "joints", "loads", "controls")
    table = next((t for t in tables if head in data.get(t, {})), None)
    if path in data.get("set", {}):
        return "set", path
    if table is None:
        return "parameters" if path in data.get("parameters", {}) else "set", path
    return table, head, *rest.split(".")


def toml_text(data: dict[str, Any]) -> str:
    """Return the TOML of a deck or scenario: plain keys first, a table for each group, an inline table for each element."""
    plain = [f"{toml_key(key)} = {toml_value(value)}" for key, value in data.items() if not isinstance(value, dict)]
    groups = [(key, value) for key, value in data.items() if isinstance(value, dict)]
    tables = (
        "\n".join([f"[{toml_key(key)}]", *(f"{toml_key(name)} = {toml_value(entry)}" for name, entry in table.items())])
        for key, table in groups
    )
    return "\n\n".join(["\n".join(plain), *tables]) + "\n"


def toml_item(value: Any, top: bool = False) -> Any:
    """Return a value as an item of tomlkit: mappings as a table at the `top` of a deck, as inline tables elsewhere."""
    if not isinstance(value, Mapping):
        return value
    from tomlkit import inline_table, table

    out: Any = table() if top else inline_table()
    for key, inner in value.items():
        out.append(key, toml_item(inner))
    return out


def _update(target: MutableMapping[str, Any], data: dict[str, Any], top: bool = False) -> None:
    """Change what differs in a table of the library of TOML, add what is new, drop what is gone; comments stay."""
    if "points" in target and "over" not in target:
        data = {k: v for k, v in data.items() if (k, v) != ("over", "temperature")}
    if "radiates_to" in target:  # the older name of `sees` stays where a deck has it
        data = {"radiates_to" if k == "sees" else k: v for k, v in data.items()}
    for key in [k for k in target if k not in data]:
        del target[key]
    for key, value in data.items():
        old = target.get(key)
        if isinstance(value, dict) and isinstance(old, MutableMapping):
            _update(old, value)
        elif old is None or not _say_the_same(_plain(old), value):
            target[key] = toml_item(value, top)


def _plain(value: Any) -> Any:
    """Return an item of the library of TOML as a plain Python value."""
    return value.unwrap() if hasattr(value, "unwrap") else value


def _say_the_same(old: Any, new: Any) -> bool:
    """Whether two entries say the same: 0.25 and "0.25"; points in degC and the same in K."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return all(_say_the_same(a, b) or _same_value(a, b) for a, b in zip(old, new, strict=True))
    return bool(old == new) or str(new) == old


def _same_value(a: Any, b: Any) -> bool:
    """Whether two texts of a point are one SI value of one dimension."""
    try:
        one, other = Expression.parse(a).literal, Expression.parse(b).literal
    except (ThermidError, TypeError):
        return False
    return one is not None and other is not None and (one.value, one.unit.dimension) == (other.value, other.unit.dimension)
