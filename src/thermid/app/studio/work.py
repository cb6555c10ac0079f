"""What takes longer than a moment: stages, fits and scenarios in one thread, with progress that a page can ask for, and an end to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from thermid.app.studio.courses import Outcome, Shelf, run_course
from thermid.app.studio.project import Project
from thermid.base.errors import DeckError, ThermidError
from thermid.reporting.objects import fit_object


@dataclass
class _Job:
    """What is running, or ran last."""

    what: str
    stage: str
    begun: float = field(default_factory=time.monotonic)
    evaluations: int = 0
    rms: float = 0.0
    share: float = 0.0
    reached: float = 0.0
    stopped: bool = False
    ended: bool = False
    error: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)


class _StoppedError(Exception):
    """Raised inside a job that was ended from the page."""


class Work:
    """One job at a time.

    Parameters
    ----------
    project : Project   What it works on.
    """

    def __init__(self, project: Project) -> None:
        self._project = project
        self.shelf = Shelf(project.path)
        self.outcome: Outcome | None = None
        self._job: _Job | None = None
        self._thread: threading.Thread | None = None
        self._start("look", "", self._look)

    def state(self) -> dict[str, Any]:
        """Return what is running or ran last, for a page."""
        if self._job is None:
            return {}
        out = asdict(self._job)
        out["seconds"] = time.monotonic() - out.pop("begun")
        return out

    def fresh(self) -> dict[str, Any]:
        """Look at all stages anew where a file was changed on disk, unless something runs; return the state and edition of each."""
        if self._thread is None or not self._thread.is_alive():
            self._look_again(_Job("look", ""))
        states = self._project.states
        return {name: [states[name].state, states[name].edition] for name in self._project.stages}

    def run(self, stage: str, below: bool) -> dict[str, Any]:
        """Begin to run a stage, with the ones below that are not done where `below`."""
        project = self._project
        project.known(stage)

        def job(j: _Job) -> None:
            self._look_again(j)
            for name in [n for n in (*(project.below(stage) if below else ()), stage) if n == stage or n not in project.done]:
                j.stage = name
                project.run(name, lambda count, rms: _tell(j, count, rms))
            for name in project.stages:
                project.look(name)
            project.judge(lambda record: _begin(j, record), write=True)

        return self._start("run", stage, job)

    def fit(self, stage: str, values: Mapping[str, float], free: tuple[str, ...]) -> dict[str, Any]:
        """Begin to fit chosen parameters from values of the sliders."""

        def job(j: _Job) -> None:
            j.result = fit_object(self._project.fit(stage, values, free, lambda count, rms: _tell(j, count, rms)))

        return self._start("fit", self._project.known(stage), job)

    def scenario(self, stage: str, key: str, values: Mapping[str, float], asked: Mapping[str, Any]) -> dict[str, Any]:
        """Begin to run a profile, scenario or test on a stage at values of the sliders; `outcome` has it in the end."""
        desk = self._project.desk(stage)
        course = self.shelf.course(desk, key)

        def job(j: _Job) -> None:
            def told(step: int, steps: int, reached: float) -> None:
                _going(j)
                j.share, j.reached = step / steps, reached

            outcome = run_course(self.shelf, desk, course, values, asked, told)
            _going(j)
            fit = self._project.fits.get(stage)
            self.outcome = outcome if course.kind == "test" or fit is None else replace(outcome, standing=fit.standing)

        return self._start("scenario", stage, job)

    def stop(self) -> dict[str, Any]:
        """End what is running; its result is dropped, and its thread leaves at its next report."""
        if self._job is not None and not self._job.ended and self._job.what != "look":
            self._job.stopped = self._job.ended = True
            self._job.error = f"'{self._job.stage}' was stopped."
            self._thread = None
        return self.state()

    def _look_again(self, job: _Job) -> None:
        """Take the files as they are now, and look at every stage; where none was changed, nothing is done."""
        changed = self._project.watch.changed()
        if not changed:
            return
        self._project.read_again(changed)
        self.shelf = Shelf(self._project.path)
        self._look(job)

    def _look(self, job: _Job) -> None:
        for name in self._project.stages:
            job.stage = name
            self._project.look(name)
        self._project.judge(lambda record: _begin(job, record))

    def _start(self, what: str, stage: str, make: Callable[[_Job], None]) -> dict[str, Any]:
        if self._thread is not None and self._thread.is_alive():
            raise DeckError(f"'{self._job.stage if self._job else ''}' is still running. Wait until it ends, or stop it.", "studio")
        job = self._job = _Job(what, stage)

        def work() -> None:
            try:
                make(job)
            except _StoppedError:
                pass
            except ThermidError as error:
                job.error = job.error or str(error)
            except Exception as error:  # a page that waits for ever would hide it
                job.error = f"{type(error).__name__}: {error}"
                raise
            finally:
                job.ended = True

        self._thread = threading.Thread(target=work, name=f"studio {what}", daemon=True)
        self._thread.start()
        return self.state()


def _going(job: _Job) -> None:
    if job.stopped:
        raise _StoppedError


def _begin(job: _Job, what: str) -> None:
    _going(job)
    job.stage = what


def _tell(job: _Job, count: int, rms: float) -> None:
    _going(job)
    job.evaluations, job.rms = count, rms
