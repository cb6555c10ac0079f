"""`Room`: what a studio has open, its start page, and what a page may ask for and order, by name, answered in plain objects for JSON.

Only files below the folder that it was started in are opened. Numbers are in usual units.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.app.examples import EXAMPLES, copies, copy_example
from thermid.app.objects import campaign_standing, swap_object
from thermid.app.studio.building import Building
from thermid.app.studio.courses import Shelf, outcome_object, profile_for, profile_object
from thermid.app.studio.desk import MAX_SENT_POINTS, Desk, curves_object, number_of, text_of, texts_of, window_of
from thermid.app.studio.draft import decks_in, kind_of, waiting
from thermid.app.studio.follow import Follower, LiveWatch
from thermid.app.studio.project import Project
from thermid.app.studio.work import Work
from thermid.base.errors import DeckError, ThermidError, refuse_unknown
from thermid.base.files import FileKinds, command, read_text, state_folder
from thermid.base.results import clean
from thermid.base.units import ICE_POINT, Array
from thermid.campaign.start import word

Body = Mapping[str, Any]


def questions(project: Project, work: Work, follower: Follower) -> dict[str, Callable[[Mapping[str, str]], Any]]:
    """Return name -> answer to what is only read, from the query of an address."""

    def stage(query: Mapping[str, str]) -> str:
        """Return the stage of a query, the first where it names none."""
        return query.get("stage", project.stages[0])

    return {
        # the job before the stages: one that has ended has set all of them
        "project": lambda q: project_object(project, work.state()),
        "desk": lambda q: desk_object(project.desk(stage(q))),
        "shelf": lambda q: shelf_object(work.shelf, project.desk(stage(q))),
        "job": lambda q: work.state(),
        "fresh": lambda q: work.fresh(),
        "logs": lambda q: follower.offered(),
    }


def orders(project: Project, work: Work) -> dict[str, Callable[[Body], Any]]:
    """Return name -> answer to what comes with a body of JSON."""

    def curves(body: Body) -> Any:
        """Return curves at values of the sliders."""
        desk, measured = project.desk(text_of(body, "stage")), bool(body.get("measured", True))
        runs = None if body.get("run") is None else (_run_of(desk, body),)
        points = int(number_of(body, "points")) if "points" in body else MAX_SENT_POINTS
        return curves_object(desk, _values(body), measured, window_of(body), runs, points)

    def desk_of(body: Body) -> Desk:
        """Return the desk of the stage that a page names."""
        return project.desk(text_of(body, "stage"))

    def moves(body: Body) -> Any:
        """Return how far each sensor moves for one per cent of a slider."""
        desk = desk_of(body)
        return desk.moves(text_of(body, "path"), _values(body), _run_of(desk, body))

    def profile(body: Body) -> Any:
        """Return the numbers of a profile with what was changed of them."""
        course = work.shelf.course(project.desk(text_of(body, "stage")), text_of(body, "course"))
        if course.kind != "profile":
            raise DeckError(f"'{course.title}' is not a profile, so it has no numbers to change.", "studio", code="value.without-effect")
        return profile_object(profile_for(course, body))

    def outcome(body: Body) -> Any:
        """Return what the last run came to."""
        if work.outcome is None:
            raise DeckError("no run exists yet. Run one first.", "studio", code="studio.not-now")
        return outcome_object(work.outcome, window_of(body))

    return {
        "curves": curves,
        "given": lambda b: {"curves": [c.as_object(True) for c in desk_of(b).inputs_of(_run_of(desk_of(b), b))]},
        "moves": moves,
        "kept": lambda b: project.kept_values(text_of(b, "stage"), text_of(b, "file")),
        "picture": lambda b: picture(desk_of(b), _values(b), b),
        "run": lambda b: work.run(text_of(b, "stage"), bool(b.get("below"))),
        "fit": lambda b: work.fit(text_of(b, "stage"), _values(b), texts_of(b, "free")),
        "save": lambda b: {"file": project.save(text_of(b, "stage"), _values(b), text_of(b, "name")).name},
        "difference": lambda b: {"diff": project.written_back(text_of(b, "stage"), _values(b))[1]},
        "write": lambda b: {"file": project.write_back(text_of(b, "stage"), _values(b), text_of(b, "diff")).name},
        "profile": profile,
        "scenario": lambda b: work.scenario(text_of(b, "stage"), text_of(b, "course"), _values(b), b),
        "stop": lambda b: work.stop(),
        "outcome": outcome,
        "swap": lambda b: swap_object(project.swap(text_of(b, "part"), text_of(b, "deck"))),
    }


def _values(body: Mapping[str, Any]) -> dict[str, float]:
    """Return slider -> value in its unit, as a page gives them."""
    sliders = body.get("values", {})
    if not isinstance(sliders, dict) or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in sliders.values()
    ):
        raise DeckError("give values as numbers by path.", "studio", code="value.wrong-kind")
    return {str(k): float(v) for k, v in sliders.items()}


SINGLE = 1e6
"""Up to here four bytes tell times to a tenth of a second and temperatures to a millikelvin."""


def project_object(project: Project, job: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is open, where its stages stand, and the state of the job that runs or ran last."""
    table = project.table()
    return {
        "title": project.title,
        "file": project.path.name,
        "kind": "deck" if project.source is None else "campaign",
        "note": "" if project.source is None else project.source.content.note,
        "stages": [asdict(project.states[name]) for name in project.stages],
        **standing_object(project),
        "decks": decks_in(project.path.parent) if project.source is not None else (),
        "kept": project.kept_files(),
        "table": {"heads": [c.title for c in table.columns], "rows": [[[c.text, c.look] for c in row] for row in table.rows]},
        "job": job,
    }


def standing_object(project: Project) -> dict[str, Any]:
    """Return the standing of a campaign and whether it passed, as ``thermid calibrate --json`` does; nothing before all stages are done."""
    campaign = project.campaign
    if campaign is None or len(campaign.stages) < len(project.stages) or project.not_judged:
        return {"standing": None, "passed": None}
    return {"standing": campaign_standing(campaign), "passed": campaign.passed}


def desk_object(desk: Desk) -> dict[str, Any]:
    """Return the sliders of a stage, its curves as they are, and its parts."""
    return {
        "title": desk.title,
        "sliders": [asdict(s) for s in desk.sliders],
        "others": list(desk.others),
        "parts": desk.parts,
        "fitted": desk.calibration is not None,
        "measured": desk.problem is not None,
        "warnings": list(desk.calibration.warnings) if desk.calibration is not None else [],
        "clocks": desk.calibration.clocks if desk.calibration is not None else {},
        "standing": (desk.calibration.standing if desk.calibration is not None else desk.model.standing).to_dict(desk.title),
        "synthetic": desk.problem is not None and any(e.record.origin.synthetic for e in desk.problem.experiments),
        "scheduled": desk.scheduled,
        **curves_object(desk, {}),
    }


def _run_of(desk: Desk, body: Mapping[str, Any]) -> int:
    """Return the run that a page asks for, the first where it names none.

    Raises
    ------
    DeckError   When there is none of that number.
    """
    run = body.get("run", 0)
    if not isinstance(run, int) or isinstance(run, bool) or not 0 <= run < len(desk.runs):
        raise DeckError("give a run as a whole number and a time as a number.", "studio", code="value.wrong-kind")
    return run


def picture(desk: Desk, values: Mapping[str, float], query: Mapping[str, Any]) -> dict[str, Any]:
    """Return the model as SVG and as a table, at a time of one of its runs, submodels folded as asked."""
    folded = texts_of(query, "folded")
    refuse_unknown(folded, desk.parts, desk.title, "unknown part '{}'.", DeckError)
    now = desk.moment(values, _run_of(desk, query), number_of({"time": 0.0, **query}, "time"))
    table = {"temperatures": {n: v - ICE_POINT for n, v in now.temperatures.items()}, "flows": now.flows, "powers": now.powers}
    return {"svg": now.drawn(folded), "table": table}


def shelf_object(shelf: Shelf, desk: Desk) -> dict[str, Any]:
    """Return what can be run, and what the form of a profile asks for."""
    limits, source = shelf.limits(desk)
    return {
        "courses": [{"key": c.key, "title": c.title, "group": c.group, "kind": c.kind} for c in shelf.courses(desk).values()],
        "boundaries": desk.boundaries,
        "nodes": desk.nodes,
        "limits": [one.point for one in limits],
        "source": source,
        "fitted": desk.calibration is not None,
    }


def as_json(value: object) -> str:
    """Return a value as JSON that a script element cannot break out of; arrays as bytes, numbers that JSON lacks as null."""
    return json.dumps(clean(value, _packed), allow_nan=False).replace("<", "\\u003c")


def _packed(values: Array) -> dict[str, str]:
    """Return numbers as bytes: text of many takes longer to write and read than a simulation does."""
    # text of many numbers takes longer to write and read than a simulation does
    single = values.size == 0 or not np.nanmax(np.abs(values), initial=0.0) > SINGLE
    return {"f4" if single else "f8": base64.b64encode(values.astype("<f4" if single else "<f8").tobytes()).decode()}


Query = Mapping[str, str]
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
        copied = copy_example(name, self.inside(name), copies())
        file = copied.folder / copied.example.campaign if copied.example.campaign else next(iter(sorted(copied.folder.glob("*.toml"))))
        return self.open(file.relative_to(self.folder).as_posix())

    def forget(self) -> dict[str, Any]:
        """Forget the recent files."""
        _recents().unlink(missing_ok=True)
        return self.front()

    def _recent(self) -> list[Path]:
        """Return the recent files, the last one first."""
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
                FileKinds.RESULTS_FILE.save_bytes(_recents(), json.dumps([str(f) for f in files]).encode())
        except (OSError, ThermidError):
            return


def _recents() -> Path:
    """Return the file with the recent files of this user."""
    return state_folder() / "recent.json"
