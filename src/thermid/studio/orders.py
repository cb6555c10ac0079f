"""What the page may ask for and order, by name, and what is done for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from thermid.errors import DeckError
from thermid.reporting.pages.views import swap_object
from thermid.studio.answers import curves_object, desk_object, picture, project_object, shelf_object, window_of
from thermid.studio.courses import profile_for, profile_object
from thermid.studio.follow import Follower
from thermid.studio.outcomes import outcome_object
from thermid.studio.project import Project
from thermid.studio.work import Work

Body = Mapping[str, Any]


def questions(project: Project, work: Work, follower: Follower) -> dict[str, Callable[[Mapping[str, str]], Any]]:
    """Return name -> answer to what is only read, from the query of an address."""

    def stage(query: Mapping[str, str]) -> str:
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
        desk, measured = project.desk(_text(body, "stage")), bool(body.get("measured", True))
        return curves_object(desk, _values(body), _text(body, "gas"), measured, window_of(body))

    def profile(body: Body) -> Any:
        course = work.shelf.course(project.desk(_text(body, "stage")), _text(body, "course"))
        if course.kind != "profile":
            raise DeckError(f"'{course.title}' is no profile, so it has no numbers to change.", "studio")
        return profile_object(profile_for(course, body))

    def outcome(body: Body) -> Any:
        if work.outcome is None:
            raise DeckError("nothing was run yet.", "studio")
        return outcome_object(work.outcome, window_of(body))

    return {
        "curves": curves,
        "picture": lambda b: picture(project.desk(_text(b, "stage")), _values(b), b),
        "run": lambda b: work.run(_text(b, "stage"), bool(b.get("below"))),
        "fit": lambda b: work.fit(_text(b, "stage"), _values(b), tuple(map(str, b.get("free", ())))),
        "save": lambda b: {"file": project.save(_text(b, "stage"), _values(b), _text(b, "name")).name},
        "profile": profile,
        "scenario": lambda b: work.scenario(_text(b, "stage"), _text(b, "course"), _values(b), b),
        "stop": lambda b: work.stop(),
        "outcome": outcome,
        "swap": lambda b: swap_object(project.swap(_text(b, "part"), _text(b, "deck"))),
    }


def _text(body: Mapping[str, Any], key: str) -> str:
    found = body.get(key, "")
    if not isinstance(found, str):
        raise DeckError(f"'{key}' is no text.", "studio")
    return found


def _values(body: Mapping[str, Any]) -> dict[str, float]:
    found = body.get("values", {})
    if not isinstance(found, dict) or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in found.values()):
        raise DeckError("values are numbers by path.", "studio")
    return {str(k): float(v) for k, v in found.items()}
