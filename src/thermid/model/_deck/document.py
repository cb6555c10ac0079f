"""`DeckDocument`: a deck as text, edited by commands that keep its comments; every step is a valid deck and can be undone, byte by byte."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import tomlkit
from tomlkit.exceptions import TOMLKitError

from thermid.base.errors import DeckError, ThermidError
from thermid.base.files import OWN, command, parse_toml, read_bytes, write_bytes
from thermid.model._deck.modelfile import model_beside
from thermid.model._deck.save import place_of
from thermid.model._tree.flat import flatten

BOM: Final = "\ufeff"
GONE: Final = object()
"""What stands for no value."""


@dataclass(frozen=True)
class Edit:
    """One command.

    Parameters
    ----------
    keys : tuple of str     Where: ``("nodes", "case", "capacitance")``.
    value : object          What stands there then: text, number, list or table; `GONE`, the default, takes it away.
    """

    keys: tuple[str, ...]
    value: Any = GONE


@dataclass(frozen=True)
class _Splice:
    """A piece of text in the place of another; the other way round it is its own inverse."""

    at: int
    old: str
    new: str

    def done(self, text: str) -> str:
        """Return a text with the new piece."""
        return text[: self.at] + self.new + text[self.at + len(self.old) :]

    @property
    def inverse(self) -> _Splice:
        """What takes it back."""
        return _Splice(self.at, self.new, self.old)


@dataclass(frozen=True)
class DeckDocument:
    """A deck that is being edited; an edit returns another document.

    Parameters
    ----------
    path : Path         The deck; what it uses lies beside it.
    text : str          As it is now: a byte order mark and line ends as they are in the file.
    past : tuple        Edits that were done, the last one last.
    future : tuple      Edits that were undone, the next one last.
    """

    path: Path
    text: str
    past: tuple[_Splice, ...] = ()
    future: tuple[_Splice, ...] = ()

    @classmethod
    def opened(cls, path: str | os.PathLike[str]) -> DeckDocument:
        """Return the document of a deck.

        Raises
        ------
        DeckError   When it is no valid deck.
        """
        made = cls(Path(path), read_bytes(path).decode("utf-8"))
        _valid(made.path, made.content)
        return made

    @property
    def content(self) -> dict[str, Any]:
        """What it says."""
        return parse_toml(self.text.removeprefix(BOM).replace("\r\n", "\n"))

    def edited(self, *edits: Edit) -> DeckDocument:
        """Return it after some edits, which are undone together; what follows from edits that were undone before is forgotten.

        Comments stay, and so do all lines that do not hold what is edited.

        Raises
        ------
        DeckError   When there is nothing to take away, or the deck would not be valid; nothing is changed then.
        """
        wanted, text = self.content, self.text
        for edit in edits:
            wanted = _with(wanted, edit, self.path.name)
            text = _rewritten(text, edit, self.path.name)
        made = replace(self, text=text, future=())
        if made.content != wanted:
            raise _refused("this edit cannot be written without touching other lines. Edit the text.", self.path.name)
        _valid(self.path, wanted)
        return replace(made, past=(*self.past, _splice(self.text, text))) if text != self.text else made

    def undo(self) -> DeckDocument:
        """Return it before the last edit; itself where there is none."""
        if not self.past:
            return self
        last = self.past[-1]
        return replace(self, text=last.inverse.done(self.text), past=self.past[:-1], future=(*self.future, last))

    def redo(self) -> DeckDocument:
        """Return it with the last edit that was undone; itself where there is none."""
        if not self.future:
            return self
        last = self.future[-1]
        return replace(self, text=last.done(self.text), past=(*self.past, last), future=self.future[:-1])

    def with_values(self, values: Mapping[str, Any], basis: str = "") -> DeckDocument:
        """Return it with values of parameters, by their paths in the model; submodels' go to [set].

        Parameters
        ----------
        values : dict   Path -> text with its unit.
        basis : str     What they stand on; written beside a value that has a table of its own, whose source is then 'derived'.

        Raises
        ------
        DeckError   When the deck would not be valid.
        """
        edits: list[Edit] = []
        for path, value in values.items():
            keys = place_of(self.content, path)
            old = _at(self.content, keys)
            if isinstance(old, Mapping):
                more = {"source": "derived", "basis": basis} if basis else {}
                edits += [Edit((*keys, key), text) for key, text in {"value": value, **more}.items()]
            else:
                edits.append(Edit(keys, value))
        return self.edited(*edits)

    def diff(self, before: DeckDocument) -> str:
        """Return what differs from another state, as a unified diff."""
        old, new = (t.removeprefix(BOM).splitlines() for t in (before.text, self.text))
        return "\n".join(difflib.unified_diff(old, new, self.path.name, self.path.name, lineterm="", n=2))

    def save(self) -> None:
        """Write it to its file.

        Raises
        ------
        DeckError   When somebody else changed the file since it was read or last saved.
        """
        there, known = read_bytes(self.path).decode("utf-8"), {self.text}
        for step in (DeckDocument.undo, DeckDocument.redo):
            here = self
            while (after := step(here)) is not here:
                known.add(after.text)
                here = after
        if there not in known:
            why = "the file was changed by somebody else since it was opened. Open it again."
            raise DeckError(why, self.path.name, code="output.changed-meanwhile")
        if there != self.text:
            with command(force=True):  # an input, but one that this document carries on
                write_bytes(self.path, self.text.encode("utf-8"), OWN)


def _splice(before: str, after: str) -> _Splice:
    """Return the piece in which two texts differ."""
    first = _alike(before, after)
    last = _alike(before[first:][::-1], after[first:][::-1])
    return _Splice(first, before[first : len(before) - last], after[first : len(after) - last])


def _alike(one: str, other: str) -> int:
    """Return how many letters two texts have in common at their beginning."""
    return next((k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))


def _valid(path: Path, content: Mapping[str, Any]) -> None:
    """Refuse what is no deck, or a deck whose elements or values do not hold together.

    Raises
    ------
    ThermidError   With what is wrong, and where.
    """
    flatten(model_beside(path, content))


def _refused(why: str, where: str) -> DeckError:
    """Return the error of an edit that is not made."""
    return DeckError(why, where, code="output.edit-refused")


def _at(content: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """Return what stands under some keys; `GONE` for nothing."""
    here: Any = content
    for key in keys:
        if not isinstance(here, Mapping) or key not in here:
            return GONE
        here = here[key]
    return here


def _with(content: dict[str, Any], edit: Edit, name: str) -> dict[str, Any]:
    """Return content after an edit."""
    head, *rest = edit.keys
    out = dict(content)
    if rest:
        inner = out.get(head, {} if edit.value is not GONE else GONE)
        if not isinstance(inner, dict):
            raise _refused("there is no such table.", f"{name}, {head}")
        out[head] = _with(inner, Edit(tuple(rest), edit.value), f"{name}, {head}")
    elif edit.value is not GONE:
        out[head] = edit.value
    elif head in out:
        del out[head]
    else:
        raise _refused("there is nothing to take away.", f"{name}, {head}")
    return out


def _rewritten(text: str, edit: Edit, name: str) -> str:
    """Return a text after an edit, in its own line ends."""
    mark, plain = text[: text.startswith(BOM)], text.removeprefix(BOM)
    try:
        document = tomlkit.parse(plain)
        home: Any = document
        for key in edit.keys[:-1]:
            if key not in home:
                home[key] = tomlkit.table() if home is document else tomlkit.inline_table()
            home = home[key]
        if edit.value is GONE:
            del home[edit.keys[-1]]
        else:
            home[edit.keys[-1]] = _item(edit.value, home is document)
        written = tomlkit.dumps(document)
    except (TOMLKitError, ThermidError, KeyError, TypeError, ValueError) as error:
        raise _refused(f"this edit cannot be written: {error}.", f"{name}, {'.'.join(edit.keys)}") from None
    if "\r\n" in plain and "\n" not in plain.replace("\r\n", ""):  # new lines end as the others do
        written = re.sub(r"(?<!\r)\n", "\r\n", written)
    return mark + written


def _item(value: Any, top: bool) -> Any:
    """Return a value as TOML holds it: a table at the top of a deck, an inline one elsewhere."""
    if not isinstance(value, Mapping):
        return value
    out = tomlkit.table() if top else tomlkit.inline_table()
    for key, inner in value.items():
        out.append(key, _item(inner, False))
    return out
