"""Writing decks, with the comments of an existing one kept where it serves as a pattern."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Any

from thermid.base.errors import DeckError, ThermidError
from thermid.base.expression import parse
from thermid.base.files import FileKinds, may_write, toml_key, toml_value, unsealed, write_text
from thermid.model._deck.modelfile import load_model
from thermid.model._tree.identity import to_dict, written
from thermid.model._tree.model import Model


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
        may_write(file, kind)
    for file, text in texts.items():
        write_text(file, text, kinds[file])


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
        for name, parameter in layer.values.items():
            _lay(data, name, written(parameter))
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
        one, other = parse(a).literal, parse(b).literal
    except (ThermidError, TypeError):
        return False
    return one is not None and other is not None and (one.value, one.unit.dimension) == (other.value, other.unit.dimension)
