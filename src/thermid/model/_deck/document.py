"""`DeckDocument`: a deck as text, edited by commands that keep its comments; every step is a valid deck and can be undone, byte by byte."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from thermid.base.errors import DeckError, ThermidError
from thermid.base.files import FileKinds, command, parse_toml, read_bytes
from thermid.model._deck.modelfile import model_beside, place_of, toml_item
from thermid.model._parts.parameter import Parameter
from thermid.model._tree.flat import Flat

BOM: Final = "\ufeff"
GONE: Final = object()
"""What stands for no value."""


@dataclass(frozen=True)
class Renamed:
    """Value of an `Edit` that renames: the entry at the edit's keys gets the key `name` and keeps its text, comments and place."""

    name: str


@dataclass(frozen=True)
class Edit:
    """One change of a deck: put a value under some keys, rename what stands there, or take it away.

    Parameters
    ----------
    keys : tuple of str     Where: ``("nodes", "case", "capacitance")``; a number is a place in a list,
                            ``("stages", 0, "free")``; the first one that is free adds to it.
    value : object          What stands there then: text, number, list or table; `Renamed`; `GONE`, the default, takes it away.
    """

    keys: tuple[str | int, ...]
    value: Any = GONE


@dataclass(frozen=True)
class _Splice:
    """A step of an edit: at position `at` of a text, `old` is replaced by `new`."""

    at: int
    old: str
    new: str

    def done(self, text: str) -> str:
        """Return a text in which `old` at `at` is replaced by `new`."""
        return text[: self.at] + self.new + text[self.at + len(self.old) :]

    @property
    def inverse(self) -> _Splice:
        """The step that puts `old` back."""
        return _Splice(self.at, self.new, self.old)


def _valid(path: Path, content: Mapping[str, Any]) -> None:
    """Refuse content that is no deck, or a deck with names or units that do not fit.

    Raises
    ------
    ThermidError   With what is wrong, and where.
    """
    Flat.of_model(model_beside(path, content))


@dataclass(frozen=True)
class DeckDocument:
    """A deck that is being edited; an edit returns another document.

    Parameters
    ----------
    path : Path         The deck; what it uses lies beside it.
    text : str          As it is now: a byte order mark and line ends as they are in the file.
    past : tuple        Edits that were done, the last one last.
    future : tuple      Edits that were undone, the next one last.
    check : callable    Refuses a content that is none of its kind: a campaign is edited in the same way.
    new : bool          Whether there is no file of it yet.
    """

    path: Path
    text: str
    past: tuple[_Splice, ...] = ()
    future: tuple[_Splice, ...] = ()
    check: Callable[[Path, Mapping[str, Any]], object] = _valid
    new: bool = False

    @classmethod
    def opened(cls, path: str | os.PathLike[str], check: Callable[[Path, Mapping[str, Any]], object] = _valid) -> DeckDocument:
        """Return the document of a deck.

        Raises
        ------
        DeckError   When it is no valid deck.
        """
        document = cls(Path(path), read_bytes(path).decode("utf-8"), check=check)
        check(document.path, document.content)
        return document

    @property
    def content(self) -> dict[str, Any]:
        """The tables that its text parses to."""
        return parse_toml(self.text.removeprefix(BOM).replace("\r\n", "\n"))

    def edited(self, *edits: Edit) -> DeckDocument:
        """Return the document after some edits, which `undo` takes back together; edits undone before can no longer be redone.

        Comments stay, and so do all lines that do not hold what is edited.

        Raises
        ------
        DeckError   When there is nothing to take away, or the deck would not be valid; nothing is changed then.
        """
        wanted, text = self.content, self.text
        for edit in edits:
            wanted = _with(wanted, edit, self.path.name)
            text = _rewritten(text, edit, self.path.name)
        edited_document = replace(self, text=text, future=())
        if edited_document.content != wanted:
            raise _refused("this edit cannot be written without touching other lines. Edit the text.", self.path.name)
        return self._then(text, wanted)

    def rewritten(self, text: str) -> DeckDocument:
        """Return the document with another text as one edit; line ends become those of the old text.

        Raises
        ------
        DeckError   When the text is no valid deck; nothing is changed then.
        """
        text = _ended(self.text[: self.text.startswith(BOM)] + text.removeprefix(BOM), self.text)
        try:
            wanted = replace(self, text=text).content
        except ValueError as error:
            raise DeckError(f"this is not valid TOML: {error}.", self.path.name, code="file.not-valid") from None
        return self._then(text, wanted)

    def _then(self, text: str, content: Mapping[str, Any]) -> DeckDocument:
        """Return the document with a new text as its next step, after `check` has taken its content."""
        self.check(self.path, content)
        if text == self.text:
            return replace(self, future=())
        # one step: what lies between the common beginning and end of both texts
        first = _alike(self.text, text)
        last = _alike(self.text[first:][::-1], text[first:][::-1])
        step = _Splice(first, self.text[first : len(self.text) - last], text[first : len(text) - last])
        return replace(self, text=text, past=(*self.past, step), future=())

    def undo(self) -> DeckDocument:
        """Return the document before its last edit; itself where there is none."""
        if not self.past:
            return self
        last = self.past[-1]
        return replace(self, text=last.inverse.done(self.text), past=self.past[:-1], future=(*self.future, last))

    def redo(self) -> DeckDocument:
        """Return the document with the last undone edit made again; itself where there is none."""
        if not self.future:
            return self
        last = self.future[-1]
        return replace(self, text=last.done(self.text), past=(*self.past, last), future=self.future[:-1])

    def with_values(self, values: Mapping[str, Any], basis: str = "") -> DeckDocument:
        """Return the document with new values of parameters; those of submodels go to [set]. Spreads and ranges of old values go.

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
                outdated = ("spread", "min", "max") if Parameter.read(old).is_range else ("spread",)
                edits += [Edit((*keys, key)) for key in outdated if key in old]
                edits += [Edit((*keys, key), text) for key, text in {"value": value, **more}.items()]
            else:
                edits.append(Edit(keys, value))
        return self.edited(*edits)

    def diff(self, before: DeckDocument) -> str:
        """Return the changes from the document `before` to this one as a unified diff."""
        old, new = (t.removeprefix(BOM).splitlines() for t in (before.text, self.text))
        return "\n".join(difflib.unified_diff(old, new, self.path.name, self.path.name, lineterm="", n=2))

    def save(self) -> None:
        """Write its text to its file, unless it stands there already.

        Raises
        ------
        DeckError   When somebody else changed the file since it was read or last saved.
        """
        if self.check_file() != self.text:
            with command(force=True):  # an input, but one that this document carries on
                FileKinds.RESULTS_FILE.save_bytes(self.path, self.text.encode("utf-8"))

    def check_file(self) -> str | None:
        """Return the text of its file, which is a state of this document; None where there is none yet.

        Raises
        ------
        DeckError   When somebody else changed the file since it was read or last saved.
        """
        there: str | None = read_bytes(self.path).decode("utf-8") if self.path.exists() else None
        own_texts: set[str | None] = set() if self.new else {self.text}
        for step in (DeckDocument.undo, DeckDocument.redo):
            here = self
            while not self.new and (after := step(here)) is not here:
                own_texts.add(after.text)
                here = after
        if there not in (own_texts or {None}):
            why = "the file was changed by somebody else since it was opened. Open it again."
            raise DeckError(why, self.path.name, code="output.changed-meanwhile")
        return there

    def with_history(self, text: str, past: Sequence[Mapping[str, Any]], future: Sequence[Mapping[str, Any]], new: bool) -> DeckDocument:
        """Return the document with a text and steps as `history` has them, read from a journal."""
        steps = (tuple(_Splice(**s) for s in several) for several in (past, future))
        return replace(self, text=text, past=next(steps), future=next(steps), new=new)

    @property
    def history(self) -> dict[str, Any]:
        """Its text, its steps done and undone, and whether it is new, as plain values for JSON."""
        return {"text": self.text, "past": [asdict(s) for s in self.past], "future": [asdict(s) for s in self.future], "new": self.new}


def _alike(one: str, other: str) -> int:
    """Return the length of the common beginning of two texts."""
    return next((k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))


def _refused(why: str, where: str) -> DeckError:
    """Return the DeckError of an edit that is refused."""
    return DeckError(why, where, code="output.edit-refused")


def _at(content: Mapping[str, Any], keys: Sequence[str | int]) -> Any:
    """Return the entry of nested tables under a path of keys; `GONE` where there is none."""
    here: Any = content
    for key in keys:
        if not isinstance(here, Mapping) or key not in here:
            return GONE
        here = here[key]
    return here


def _with(content: Any, edit: Edit, name: str) -> Any:
    """Return a copy of parsed tables or lists with an edit made; `name` is the place for messages.

    Copied are the tables on the way, the rest is shared. Tables that are lacking on the way to a new value are made; the first place past
    the end of a list adds to it.

    Raises
    ------
    DeckError   When it meets a place that a list lacks, a text or number on the way, nothing to take away, or a new name that is taken.
    """
    head, *rest = edit.keys
    out: Any = list(content) if isinstance(content, list) else dict(content)
    if isinstance(out, list):
        if not isinstance(head, int) or not 0 <= head < len(out) + (not rest and edit.value is not GONE):
            raise _refused("there is no such entry.", f"{name}, {head}")
        new = [_with(out[head], Edit(tuple(rest), edit.value), f"{name}, {head}")] if rest else [] if edit.value is GONE else [edit.value]
        out[head : head + 1] = new
    elif rest:
        inner = out.get(head, {} if edit.value is not GONE else GONE)
        if not isinstance(inner, dict | list):
            raise _refused("there is no such table.", f"{name}, {head}")
        out[head] = _with(inner, Edit(tuple(rest), edit.value), f"{name}, {head}")
    elif isinstance(edit.value, Renamed):
        if head not in out or edit.value.name in out:
            raise _refused("there is nothing of the old name, or something of the new one.", f"{name}, {head}")
        out[edit.value.name] = out.pop(head)
    elif edit.value is not GONE:
        out[head] = edit.value
    elif head in out:
        del out[head]
    else:
        raise _refused("there is nothing to take away.", f"{name}, {head}")
    return out


def _rewritten(text: str, edit: Edit, name: str) -> str:
    """Return TOML text with an edit made, its comments and line ends kept."""
    from tomlkit import dumps, inline_table, parse, table
    from tomlkit.exceptions import TOMLKitError
    from tomlkit.items import AoT, Table

    mark, plain = text[: text.startswith(BOM)], text.removeprefix(BOM)
    try:
        document = parse(plain)
        home: Any = document
        last: Any = edit.keys[-1]
        for key in edit.keys[:-1]:
            if not isinstance(key, int) and key not in home:
                home[key] = table() if home is document else inline_table()
            home = home[key]
        if edit.value is GONE:
            del home[last]
        elif isinstance(edit.value, Renamed):
            if isinstance(home[last], Table):
                home[last].display_name = None  # a header is written by its key
            getattr(home, "value", home)._replace(last, edit.value.name, home[last])
        elif isinstance(home, list):
            if last < len(home):
                del home[last]
            home.insert(last, toml_item([edit.value], isinstance(home, AoT))[0])
        else:
            home[last] = toml_item(edit.value, home is document)
        written = dumps(document)
    except (TOMLKitError, ThermidError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise _refused(f"this edit cannot be written: {error}.", f"{name}, {'.'.join(map(str, edit.keys))}") from None
    return mark + _ended(written, plain)


def _ended(text: str, like: str) -> str:
    """Return `text` with CRLF line ends if all of those in `like` are, else as it is."""
    crlf = "\r\n" in like and "\n" not in like.replace("\r\n", "")
    return re.sub(r"(?<!\r)\n", "\r\n", text) if crlf else text
