"""What takes longer than a moment: stages, fits and scenarios in one thread, with progress that a page can ask for, and an end to it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from thermid.app.objects import fit_object
from thermid.app.studio.courses import Outcome, Shelf, run_course
from thermid.app.studio.project import Project
from thermid.base.errors import DeckError, ThermidError


@dataclass
class JobState:
    """What is running, or ran last; one that `keeps` ends with the best values so far where it is stopped, `path` is what it tried."""

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
    keeps: bool = False
    path: list[tuple[int, float]] = field(default_factory=list)
    result: Mapping[str, Any] = field(default_factory=dict)

    def going(self) -> None:
        """End here where the page stopped it.

        Raises
        ------
        _StoppedError       Then.
        KeyboardInterrupt   Once, of what keeps the best values so far, as the interrupt key does.
        """
        if not self.stopped:
            return
        if self.keeps:
            self.stopped = False
            raise KeyboardInterrupt
        raise _StoppedError

    def begin(self, what: str) -> None:
        """Go on with another thing."""
        self.going()
        self.stage = what

    def tell(self, count: int, rms: float) -> None:
        """Take how far a fit is."""
        self.evaluations, self.rms = count, rms
        self.path.append((count, rms))
        self.going()


class _StoppedError(Exception):
    """Raised inside a job that was ended from the page."""


class Jobs:
    """One job at a time."""

    def __init__(self) -> None:
        self._job: JobState | None = None
        self._thread: threading.Thread | None = None

    def state(self) -> dict[str, Any]:
        """Return what is running or ran last, for a page."""
        if self._job is None:
            return {}
        out = asdict(self._job)
        out["seconds"] = time.monotonic() - out.pop("begun")
        return out

    def stop(self) -> dict[str, Any]:
        """End what is running at its next report: a fit with the best values so far; the result of anything else is dropped."""
        if self._job is not None and not self._job.ended and self._job.what != "look":
            self._job.stopped = True
            if self._job.keeps:
                return self.state()
            self._job.ended = True
            self._job.error = f"'{self._job.stage}' was stopped."
            self._thread = None
        return self.state()

    def start(self, what: str, stage: str, make: Callable[[JobState], None], keeps: bool = False) -> dict[str, Any]:
        """Begin a job and return its state; one that `keeps` has a result though it is stopped.

        Raises
        ------
        DeckError   While another one runs.
        """
        if self.busy:
            raise DeckError(
                f"'{self._job.stage if self._job else ''}' is still running. Wait until it ends, or stop it.",
                "studio",
                code="studio.not-now",
            )
        job = self._job = JobState(what, stage, keeps=keeps)

        def work() -> None:
            """Do the job, and note how it ended."""
            try:
                make(job)
            except _StoppedError:
                pass
            except KeyboardInterrupt:
                job.error = f"'{stage}' was stopped before it had values."
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

    def wait(self) -> None:
        """Return once nothing runs."""
        if self._thread is not None:
            self._thread.join()

    @property
    def busy(self) -> bool:
        """Whether a job runs."""
        return self._thread is not None and self._thread.is_alive()


class Work(Jobs):
    """The jobs of a project.

    Parameters
    ----------
    project : Project   What it works on.
    """

    def __init__(self, project: Project) -> None:
        super().__init__()
        self._project = project
        self.shelf = Shelf(project.path)
        self.outcome: Outcome | None = None
        self.start("look", "", self._look)

    def fresh(self) -> dict[str, Any]:
        """Look at all stages anew where a file was changed on disk, unless something runs; return the state and edition of each."""
        if not self.busy:
            self._look_again(JobState("look", ""))
        states = self._project.states
        return {name: [states[name].state, states[name].edition] for name in self._project.stages}

    def run(self, stage: str, below: bool) -> dict[str, Any]:
        """Begin to run a stage, with the ones below that are not done where `below`."""
        project = self._project
        project.checked_stage(stage)

        def job(j: JobState) -> None:
            """Run the stages that are due, then judge."""
            self._look_again(j)
            for name in [n for n in (*(project.below(stage) if below else ()), stage) if n == stage or n not in project.done]:
                j.stage = name
                project.run(name, j.tell)
            for name in project.stages:
                project.look(name)
            project.judge(j.begin, write=True)

        return self.start("run", stage, job)

    def fit(self, stage: str, values: Mapping[str, float], free: tuple[str, ...]) -> dict[str, Any]:
        """Begin to fit chosen parameters from values of the sliders."""

        def job(j: JobState) -> None:
            """Fit, and keep the result for the page."""
            j.result = fit_object(self._project.fit(stage, values, free, j.tell))

        return self.start("fit", self._project.checked_stage(stage), job, keeps=True)

    def scenario(self, stage: str, key: str, values: Mapping[str, float], query: Mapping[str, Any]) -> dict[str, Any]:
        """Begin to run a profile, scenario or test on a stage at values of the sliders; `outcome` has it in the end."""
        desk = self._project.desk(stage)
        course = self.shelf.course(desk, key)

        def job(j: JobState) -> None:
            """Run the course, and hold it against limits."""

            def report_step(step: int, steps: int, reached: float) -> None:
                """Take how far the run is."""
                j.going()
                j.share, j.reached = step / steps, reached

            outcome = run_course(self.shelf, desk, course, values, query, report_step)
            j.going()
            fit = self._project.fits.get(stage)
            self.outcome = outcome if course.kind == "test" or fit is None else replace(outcome, standing=fit.standing)

        return self.start("scenario", stage, job)

    def _look_again(self, job: JobState) -> None:
        """Take the files as they are now, and look at every stage; where none was changed, nothing is done."""
        changed = self._project.watch.changed()
        if not changed:
            return
        self._project.read_again(changed)
        self.shelf = Shelf(self._project.path)
        self._look(job)

    def _look(self, job: JobState) -> None:
        """Look at every stage, then judge those that are done."""
        for name in self._project.stages:
            job.stage = name
            self._project.look(name)
        self._project.judge(job.begin)
