"""`Draft`: a deck, the campaign that fits it and the places of its nodes, edited together with one undo; a journal keeps the edits."""

from __future__ import annotations

import difflib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from thermid.base.errors import DeckError, ThermidError
from thermid.base.files import FileKinds, command, line_numbers, read_bytes, read_text, read_toml
from thermid.campaign.stages import CampaignSource
from thermid.model.tree import DeckDocument, Edit, Model, model_beside

DECK, CAMPAIGN, VIEW = "deck", "campaign", "view"
PLACES: Final = "places"
"""Table of a view file: node -> [x, y] of its card's middle. [px]"""


def _campaign(path: Path, content: Mapping[str, Any]) -> None:
    """Refuse what is no campaign; one that has no record yet waits for its first."""
    if content.get("records"):
        CampaignSource.of_content(path, content)


def _view(path: Path, content: Mapping[str, Any]) -> None:
    """Refuse what is no table of places.

    Raises
    ------
    DeckError   When a place is not two numbers.
    """
    for name, place in content.get(PLACES, {}).items():
        if not (isinstance(place, list) and len(place) == 2 and all(isinstance(v, int | float) for v in place)):
            raise DeckError("a place is two numbers, [x, y].", f"{path.name}, {PLACES}.{name}", code="value.wrong-kind")


@dataclass(frozen=True)
class Draft:
    """What is being built; an edit returns another draft.

    Parameters
    ----------
    documents : dict    'deck', 'campaign' and 'view' -> document. A campaign without records is not written.
    past : tuple        For each step the documents that it changed, the last one last.
    future : tuple      For each step that was undone, the next one last.
    base : dict         Name -> text of its file when it was read or last saved; empty for none.
    stage : int         Place of the stage in the campaign; -1 is the last one.
    typed : str         Text of the deck that somebody typed and that is no deck yet; empty where there is none. An edit would lose it.
    """

    documents: Mapping[str, DeckDocument]
    past: tuple[tuple[str, ...], ...] = field(default=())
    future: tuple[tuple[str, ...], ...] = field(default=())
    base: Mapping[str, str] = field(default_factory=dict)
    stage: int = -1
    typed: str = ""

    @classmethod
    def opened(cls, path: Path, stage: int = -1) -> Draft:
        """Return the draft of a deck, or of a campaign with the deck of a stage; a deck that is not there yet is empty.

        Raises
        ------
        ThermidError   When a file is there that cannot be read.
        """
        content = read_toml(path)[0] if path.exists() else {}
        if "stages" in content:
            campaign, deck = path, path.parent / str(content["stages"][stage]["model"])
        else:
            campaign, deck = path.with_name(f"{path.stem}_campaign.toml"), path
        title = deck.stem.replace("_", " ")
        first = f'[[stages]]\nname = {json.dumps(title)}\nmodel = "{deck.name}"\nrecords = []\nfree = []\n'
        documents = {
            DECK: _document(deck, f"title = {json.dumps(title)}\n"),
            CAMPAIGN: _document(campaign, f"title = {json.dumps(title)}\n\n[records]\n\n{first}", _campaign),
            VIEW: _document(deck.with_suffix(".view.toml"), f"# Where the studio draws the nodes of {deck.name}.\n", _view),
        }
        return cls(documents, base={name: _text_of(d) for name, d in documents.items()}, stage=stage)

    @property
    def deck(self) -> DeckDocument:
        """The deck."""
        return self.documents[DECK]

    @property
    def model(self) -> Model:
        """The model that it is."""
        return model_beside(self.deck.path, self.deck.content)

    @property
    def source(self) -> CampaignSource:
        """The campaign that it is."""
        document = self.documents[CAMPAIGN]
        return CampaignSource.of_content(document.path, document.content, line_numbers(document.text))

    def edited(self, edits: Mapping[str, Sequence[Edit]]) -> Draft:
        """Return it after edits of its documents, which are undone together.

        Raises
        ------
        DeckError   When one of them would not be valid; nothing is changed then.
        """
        return self._then({name: self.documents[name].edited(*several) for name, several in edits.items() if several})

    def rewritten(self, text: str, name: str = DECK) -> Draft:
        """Return it with another text of one document.

        Raises
        ------
        DeckError   When the text is not valid; nothing is changed then.
        """
        return self._then({name: self.documents[name].rewritten(text)})

    def with_values(self, values: Mapping[str, str], basis: str) -> Draft:
        """Return it with values of parameters in the deck; see `DeckDocument.with_values`."""
        return self._then({DECK: self.deck.with_values(values, basis)})

    def _then(self, documents: Mapping[str, DeckDocument]) -> Draft:
        """Return the draft with changed documents, as one step; itself where nothing changed."""
        changed = tuple(name for name, d in documents.items() if d.text != self.documents[name].text)
        if not changed:
            return self
        return Draft({**self.documents, **{name: documents[name] for name in changed}}, (*self.past, changed), (), self.base, self.stage)

    def undo(self) -> Draft:
        """Return it before the last step; itself where there is none."""
        return self._stepped(self.past, DeckDocument.undo, lambda past, other: (past[:-1], (*self.future, other)))

    def redo(self) -> Draft:
        """Return it with the last step that was undone; itself where there is none."""
        return self._stepped(self.future, DeckDocument.redo, lambda future, other: ((*self.past, other), future[:-1]))

    def _stepped(self, steps: tuple[tuple[str, ...], ...], how: Callable[[DeckDocument], DeckDocument], then: Callable[..., Any]) -> Draft:
        """Return the draft one step back or forth; itself where there is no such step."""
        if not steps:
            return self
        past, future = then(steps, steps[-1])
        return Draft({n: how(d) if n in steps[-1] else d for n, d in self.documents.items()}, past, future, self.base, self.stage)

    def to_save(self) -> dict[str, DeckDocument]:
        """Return the documents that differ from their files; a campaign or a view that says nothing yet needs none."""
        empty = {CAMPAIGN: "records", VIEW: PLACES}
        return {
            name: d
            for name, d in self.documents.items()
            if _text_of(d) != d.text and not (d.new and name in empty and not d.content.get(empty[name]))
        }

    def diff(self) -> str:
        """Return what saving would change, as unified diffs."""
        parts = [d.diff(replace(d, text=_text_of(d))) for d in self.to_save().values()]
        return "\n".join(part for part in parts if part)

    def save(self) -> Draft:
        """Write what differs and return the draft that is on disk.

        Raises
        ------
        DeckError   When somebody else changed one of the files; nothing is written then.
        """
        changed = self.to_save()
        for document in changed.values():
            document.check_file()
        for document in changed.values():
            document.save()
        documents = {n: replace(d, new=d.new and n not in changed) for n, d in self.documents.items()}
        return replace(self, documents=documents, base={n: _text_of(d) for n, d in documents.items()})

    def merged(self) -> Draft:
        """Return it with what somebody else changed in its files since they were read, as one step on the files as they are.

        Raises
        ------
        DeckError   When both changed the same lines, or what comes out is not valid; nothing is changed then.
        """
        if not self.moved_on():
            return self
        texts = {n: _text_of(d) for n, d in self.documents.items()}
        there = {n: replace(d, text=texts[n] or d.text, past=(), future=(), new=not texts[n]) for n, d in self.documents.items()}
        mine = {n: merged_text(self.base.get(n, ""), d.text, texts[n] or d.text, d.path.name) for n, d in self.documents.items()}
        return Draft(there, base=texts, stage=self.stage)._then({n: there[n].rewritten(text) for n, text in mine.items()})

    def moved_on(self) -> tuple[str, ...]:
        """Return the names of files that somebody else changed."""
        out = []
        for document in self.documents.values():
            try:
                document.check_file()
            except DeckError:
                out.append(document.path.name)
        return tuple(out)


def merged_text(base: str, mine: str, theirs: str, name: str) -> str:
    """Return a text with the lines that either of two changed in a common one.

    Raises
    ------
    DeckError   When both changed the same lines, each in its own way.
    """
    old = base.splitlines(keepends=True)
    pieces = set()
    for new in (text.splitlines(keepends=True) for text in (mine, theirs)):
        ways = difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
        pieces |= {(i, j, tuple(new[a:b])) for way, i, j, a, b in ways if way != "equal"}
    out, at = [], 0
    for i, j, lines in sorted(pieces):
        if i < at or (i == at and any(p[:2] == (i, j) and p[2] != lines for p in pieces)):
            why = (
                f"line {i + 1} was changed here and by somebody else: {''.join(lines).strip()!r}. Take the file, or undo your change of it."
            )
            raise DeckError(why, name, code="output.changed-meanwhile")
        out += [*old[at:i], *lines]
        at = j
    return "".join([*out, *old[at:]])


def _document(path: Path, empty: str, check: Callable[[Path, Mapping[str, Any]], object] | None = None) -> DeckDocument:
    """Return the document of a file; where there is none, a new one with a first text."""
    kind: dict[str, Any] = {} if check is None else {"check": check}
    return DeckDocument.opened(path, **kind) if path.exists() else DeckDocument(path, empty, **kind, new=True)


def _text_of(document: DeckDocument) -> str:
    """Return the text of a document's file; empty where there is none."""
    return read_bytes(document.path).decode("utf-8") if document.path.exists() else ""


def journal_of(path: Path) -> Path:
    """Return where the edits of a deck are kept until they are saved, and the undo of those that were."""
    return path.with_name(f".{path.stem}.studio.json")


def keep(draft: Draft) -> None:
    """Write the journal of a draft, so that a killed studio loses nothing."""
    documents = {name: d.history for name, d in draft.documents.items()}
    steps = {"past": draft.past, "future": draft.future, "base": draft.base}
    text = json.dumps({"documents": documents, **steps, "typed": draft.typed, "waiting": bool(draft.to_save() or draft.typed)})
    with command(force=True):
        FileKinds.RESULTS_FILE.save_bytes(journal_of(draft.deck.path), text.encode())


def recalled(path: Path, stage: int = -1) -> tuple[Draft, str]:
    """Return the draft of a deck with the edits of its journal, and what is to be said of them; without a journal that of its files.

    A journal that does not read is dropped, and so is one without an edit that waits when somebody else changed a file since.
    """
    plain = Draft.opened(path, stage)
    try:
        journal = json.loads(read_text(journal_of(plain.deck.path)))
        documents = {name: plain.documents[name].with_history(**of) for name, of in journal["documents"].items()}
        past, future = (tuple(map(tuple, journal[key])) for key in ("past", "future"))
        draft = Draft(documents, past, future, dict(journal["base"]), stage, str(journal.get("typed", "")))
        for document in documents.values():
            document.check(document.path, document.content)
    except (OSError, ValueError, KeyError, TypeError, ThermidError):
        return plain, ""
    if draft.moved_on() and not journal["waiting"]:
        return plain, ""
    return draft, "Edits that were not saved are back." if draft.to_save() or draft.typed else ""


def parsed_line(text: str, where: str) -> int | None:
    """Return the line of a text that a place, ``file, key.path``, is about; None where it tells none."""
    lines, (_, _, key) = line_numbers(text), where.partition(", ")
    steps = key.split(".") if key else []
    return next((lines[k] for n in range(len(steps), 0, -1) if (k := ".".join(steps[:n])) in lines), None)


def waiting(folder: Path) -> list[str]:
    """Return the names of decks of a folder that were begun and never saved: their journal is there, and no file."""
    out = []
    for journal in sorted(folder.glob(".*.studio.json")):
        name = journal.name.removeprefix(".").removesuffix(".studio.json")
        try:
            unsaved = bool(json.loads(read_text(journal))["waiting"])
        except (OSError, ValueError, KeyError, TypeError, ThermidError):
            continue
        if unsaved and not (folder / f"{name}.toml").exists():
            out.append(name)
    return out


@lru_cache(maxsize=1024)
def kind_of(file: Path, written: int) -> tuple[str, str]:
    """Return whether a file is a deck or a campaign, and its title; nothing for any other. `written` is its time of change. [ns]"""
    try:
        content, _ = read_toml(file)
    except (ThermidError, OSError):
        return "", ""
    kind = "campaign" if "stages" in content else "deck" if {"nodes", "submodels", "needs"} & set(content) and "title" in content else ""
    return kind, str(content.get("title", "")) if kind else ""


def decks_in(folder: Path) -> list[str]:
    """Return the names of the decks of a folder."""
    return [f.name for f in sorted(folder.glob("*.toml")) if kind_of(f, f.lstat().st_mtime_ns)[0] == "deck"]
