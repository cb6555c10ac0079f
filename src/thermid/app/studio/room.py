"""`Room`: what a studio has open, and its start page: new, open, examples, recent; files below the folder it was started in only."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from thermid.app.studio.building import Building
from thermid.app.studio.curves import text_of
from thermid.app.studio.draft import kind_of, waiting
from thermid.app.studio.follow import Follower
from thermid.app.studio.live import LiveWatch
from thermid.app.studio.orders import orders, questions
from thermid.app.studio.project import Project
from thermid.app.studio.work import Work
from thermid.base.errors import DeckError, ThermidError, refuse_unknown
from thermid.base.files import RESULTS_FILE, command, read_text, state_folder, write_bytes
from thermid.campaign.start import EXAMPLES, copies, copy_example, word

Query = Mapping[str, str]
Body = Mapping[str, Any]
FILES_SHOWN: Final = 300
"""Files that the start page shows."""
RECENT_FILES: Final = 12
"""Files that it remembers."""
FOLDERS_DEEP: Final = 3
"""How many folders deep it looks."""


class Room:
    """What is open: nothing at first, where a studio begins at its start page.

    Parameters
    ----------
    folder : Path       Files below it may be opened and written.
    project : Project   What is open from the beginning.
    log : Path or None  A log that grows, to be followed.
    """

    def __init__(self, folder: Path, project: Project | None = None, log: Path | None = None) -> None:
        self.folder = folder.resolve()
        self.project: Project | None = None
        self.follower: Follower | None = None
        self.building: Building | None = None
        self.answers: dict[str, Callable[[Query], Any]] = {}
        self.orders: dict[str, Callable[[Body], Any]] = {}
        if project is not None:
            self._enter(project, log)

    @property
    def answering(self) -> dict[str, Callable[[Query], Any]]:
        """Name -> answer to what is only read."""
        return {
            **self.answers,
            "start": lambda q: self.front(),
            "draft": lambda q: self.built().state(),
            "built": lambda q: self.built().jobs.state(),
            "conditions": lambda q: self.built().conditions(),
            "draft/changed": lambda q: {"changed": list(self.built().draft.moved_on())},
        }

    @property
    def ordering(self) -> dict[str, Callable[[Body], Any]]:
        """Name -> answer to what comes with a body of JSON."""
        return {
            **self.orders,
            "new": lambda b: self.new(text_of(b, "name")),
            "open": lambda b: self.open(text_of(b, "file")),
            "example": lambda b: self.example(text_of(b, "name")),
            "forget": lambda b: self.forget(),
            "edit": lambda b: self.built().commanded(b),
            "draft/run": lambda b: self.built().run(),
            "draft/fit": lambda b: self.built().fit(),
            "draft/compare": lambda b: self.built().compared(b),
            "draft/stop": lambda b: self.built().jobs.stop(),
            "draft/difference": lambda b: self.built().difference(),
            "draft/save": lambda b: self._saved(text_of(b, "diff")),
        }

    def _enter(self, project: Project, log: Path | None = None) -> None:
        """Show a project: no draft, its log followed, questions and orders about it, its path remembered."""
        self.project, self.building = project, None
        work = Work(project)
        self.follower = Follower(project.path.parent, log, LiveWatch(project.subject))
        self.answers, self.orders = questions(project, work, self.follower), orders(project, work)
        self._remember(project.path)

    def look(self, body: Body) -> Any:
        """Return how the log that is followed stands."""
        if self.follower is None:
            raise DeckError("no project is open. Open one on the start page.", "studio", code="file.not-found")
        return self.follower.look(body)

    def built(self) -> Building:
        """Return the draft that is open, that of the project where none was begun.

        Raises
        ------
        DeckError   When nothing is open.
        """
        if self.building is None:
            if self.project is None:
                raise DeckError("no model is open. Begin or open one on the start page.", "build", code="file.not-found")
            self.building = Building(self.project.path, lambda: {} if self.project is None else self.project.done)
        return self.building

    def _saved(self, diff: str) -> dict[str, Any]:
        """Save the draft; what was new is a project from then on."""
        building = self.built()
        out = building.save(diff)
        if self.project is None:
            campaign = building.draft.documents["campaign"]
            self._enter(Project(building.draft.deck.path if campaign.new else campaign.path))
            self.building = building
        return out

    # ---- the start page -----------------------------------------------------------------------------------------------------------

    def front(self) -> dict[str, Any]:
        """Return what the start page shows."""
        return {
            "folder": self.folder.name or str(self.folder),
            "files": self._files(),
            "waiting": waiting(self.folder),
            "examples": [{"name": e.name, "shows": e.shows, "fetched": e.data is not None} for e in EXAMPLES.values()],
            "recent": [f.relative_to(self.folder).as_posix() for f in self._recent() if f.is_relative_to(self.folder) and f.is_file()],
            "open": None if self.project is None else self.project.path.name,
        }

    def _files(self) -> list[dict[str, str]]:
        """Return the decks and campaigns below the folder."""
        out: list[dict[str, str]] = []
        for pattern in ("*.toml", *("*/" * k + "*.toml" for k in range(1, FOLDERS_DEEP + 1))):
            for file in sorted(self.folder.glob(pattern)):
                inside = len(out) < FILES_SHOWN and file.resolve().is_relative_to(self.folder)
                kind, title = kind_of(file, file.lstat().st_mtime_ns) if inside else ("", "")
                if kind:
                    out.append({"file": file.relative_to(self.folder).as_posix(), "kind": kind, "title": title})
        return out

    def inside(self, name: str) -> Path:
        """Return a file below the folder.

        Raises
        ------
        DeckError   When it lies elsewhere, symbolic links resolved.
        """
        path = None if "\0" in name else (self.folder / name).resolve()
        if path is None or not path.is_relative_to(self.folder):
            raise DeckError(f"'{name[:80]}' lies outside the folder of this studio.", "studio", code="file.outside-project")
        return path

    def new(self, name: str) -> dict[str, Any]:
        """Begin a model; nothing is written before it is saved."""
        if not name.strip():
            raise DeckError("give the model a name.", "new", code="value.incomplete")
        path = self.inside(f"{word(name)}.toml")
        if path.exists():
            raise DeckError(f"there is a file '{path.name}'. Open it, or give another name.", "new", code="output.over-another-file")
        self.project, self.follower, self.answers, self.orders = None, None, {}, {}
        self.building = Building(path)
        return {"page": "/build"}

    def open(self, name: str) -> dict[str, Any]:
        """Open a deck or campaign."""
        self._enter(Project(self.inside(name)))
        return {"page": "/"}

    def example(self, name: str) -> dict[str, Any]:
        """Copy an example into a new folder and open it."""
        refuse_unknown([name], EXAMPLES, "examples", "no example '{}'.")
        copied = copy_example(name, self.inside(name), copies(None))
        file = copied.folder / copied.example.campaign if copied.example.campaign else next(iter(sorted(copied.folder.glob("*.toml"))))
        return self.open(file.relative_to(self.folder).as_posix())

    def forget(self) -> dict[str, Any]:
        """Forget the recent files."""
        _recents().unlink(missing_ok=True)
        return self.front()

    def _recent(self) -> list[Path]:
        try:
            return [Path(str(f)) for f in json.loads(read_text(_recents()))][:RECENT_FILES]
        except (OSError, ValueError, TypeError):
            return []

    def _remember(self, path: Path) -> None:
        """Keep a file in the list of recent ones; where it cannot be written there is none."""
        files = list(dict.fromkeys([path, *self._recent()]))[:RECENT_FILES]
        try:
            _recents().parent.mkdir(parents=True, exist_ok=True)
            with command(force=True):
                write_bytes(_recents(), json.dumps([str(f) for f in files]).encode(), RESULTS_FILE)
        except (OSError, ThermidError):
            return


def _recents() -> Path:
    """Return the file with the recent files of this user."""
    return state_folder() / "recent.json"
