"""`Project`: a deck or campaign opened in the studio; which stages are done or stale, and the desks of those that can be tuned."""

from __future__ import annotations

import fnmatch
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from thermid.app.studio.desk import Desk, in_force
from thermid.base.errors import DeckError, IdentificationError, NameNotFoundError, ThermidError, refuse_unknown
from thermid.base.files import project_root, read_toml, resolve_inside
from thermid.base.units import from_si
from thermid.campaign.stages import (
    Campaign,
    CampaignSource,
    KeptStage,
    RetunePlan,
    Verdict,
    file_name,
    joint,
    keyed,
    plan_retune,
    request_of,
)
from thermid.fit.calibration import Calibration, Request, build_problem, fit, fit_problem
from thermid.model.tree import DeckDocument, Model, ParameterSet, load_model
from thermid.reporting.pages import Table, levels
from thermid.simulation.runs import Scenario, compile_network, load_scenario
from thermid.values.store import Store, load_store, save_store

Told = Callable[[int, float], None]


class Project:
    """A deck or campaign with its results folder; of the files that its author wrote only a deck is changed, where a diff was confirmed.

    Parameters
    ----------
    path : path     The deck or campaign.
    data : path     A folder of logs outside the project.
    results : path  Where stages and tuned values are kept; ``results`` beside the file by default.
    """

    def __init__(self, path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None, results: Path | None = None) -> None:
        self.path = Path(path).resolve()
        if self.path.is_dir():
            inside = ", ".join(sorted(f.name for f in self.path.glob("*.toml"))[:9]) or "none"
            raise DeckError(f"a folder is not a deck or campaign. Give a file in it: {inside}.", self.path.name, code="file.not-a-file")
        self.results = results if results is not None else self.path.parent / "results"
        self._data = data
        self.source, self.title = self._read()
        roots = [self.source.data] if self.source is not None and self.source.data is not None else []
        self.watch = Watch(self.path, roots, self.results)
        self.edition = 0
        self.broken = ""
        self.done: dict[str, Calibration] = {}
        self.campaign: Campaign | None = None
        self.not_judged = ""
        self.states: dict[str, StageState] = {name: StageState(name, "waiting", "not run yet") for name in self.stages}
        self._requests: dict[str, Request] = {}
        self._keys: dict[str, str] = {}
        self._made_of: dict[str, dict[str, str]] = {}
        self._desks: dict[str, Desk] = {}
        self._model: tuple[int, Model] | None = None
        self._levels: tuple[dict[str, Calibration], Table] | None = None

    def _read(self) -> tuple[CampaignSource | None, str]:
        """Return the campaign, None for a deck, and the title."""
        source = CampaignSource.read(self.path, self._data) if "stages" in read_toml(self.path)[0] else None
        return source, source.content.title if source is not None else load_model(self.path).title

    def read_again(self, changed: Collection[Path]) -> None:
        """Take the files as they are on disk now; every stage must be looked at again.

        Logs are read again only where one of them, or the campaign, is among those that changed. A fit whose model, logs and request are
        what they were stays done. A file that cannot be read leaves the project as it was, and `broken` says why.
        """
        self.edition += 1
        decks = self.source is not None and self.path not in changed and all(f.suffix == ".toml" for f in changed)
        try:
            if self.broken or not decks:
                self.source, self.title = self._read()
            self.broken = ""
        except ThermidError as error:
            self.broken = str(error)
        for cached in (self._requests, self._desks):
            cached.clear()
        names = self.stages
        self.done = {n: c for n, c in self.done.items() if n in names}
        self.campaign = None
        self.states = {n: self.states.get(n, StageState(n, "waiting", "not run yet")) for n in names}

    def subject(self) -> Model | Campaign | None:
        """Return the model of a deck; of a campaign its stages once all of them are done, None before.

        Raises
        ------
        ThermidError   When the deck cannot be read.
        """
        if self.source is not None:
            return self.campaign if self.campaign is not None and len(self.campaign.stages) == len(self.stages) else None
        if self._model is None or self._model[0] != self.edition:
            self._model = self.edition, load_model(self.path)
        return self._model[1]

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages of a campaign in order; a deck has one, under its title."""
        return tuple(s.name for s in self.source.content.stages) if self.source is not None else (self.title,)

    def below(self, name: str) -> tuple[str, ...]:
        """Return the stages that hand values to a stage, at any depth, in the order in which they run."""
        if self.source is None:
            return ()
        direct = {s.name: {n for i in s.inherit.values() for n in i.stages} for s in self.source.content.stages}
        stages: set[str] = set()
        waiting = set(direct[self.checked_stage(name)])
        while waiting:
            stages |= waiting
            waiting = {n for w in waiting for n in direct[w]} - stages
        return tuple(s for s in self.stages if s in stages)

    def checked_stage(self, name: str) -> str:
        """Return the name of a stage.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        refuse_unknown([name], self.stages, self.title, "no stage '{}'.", NameNotFoundError)
        return name

    def look(self, name: str) -> StageState:
        """Return where a stage stands, taking its fit from the results folder when nothing that it depends on has changed."""
        if self.broken:
            return self._set(StageState(name, "failed", self.broken, self.states[name].below))
        if self.source is None:
            return self._set(StageState(name, "deck", "a deck alone, without logs"))
        if name in self.done and name in self._requests:
            return self.states[name]
        memory = KeptStage(self.results, name)
        direct, before, fitted = self.below(name), self._keys.get(name), self.done.pop(name, None)
        self.campaign = None
        missing = [n for n in direct if self.states[n].state != "done"]
        if missing:
            why = f"needs values of '{missing[0]}', which is {self.states[missing[0]].state}"
            return self._set(StageState(name, "waiting", why, direct))
        try:
            request = self._request(name)
            if fitted is not None and before == self._keys[name]:
                return self._finish(name, fitted, unchanged=self.states[name].state == "done")
            if request.hand is not None:
                return self._finish(name, fit(request))  # values tuned by hand: there is nothing to run
            recalled = memory.recall(self._keys[name])
            if recalled is None:
                compile_network(request.model)  # what it would end in when it is run: a wrong unit, a node that nothing holds
        except ThermidError as error:
            return self._set(StageState(name, "failed", str(error), direct))
        if recalled is None:
            ran = fitted is not None or memory.has_fit
            changed = ", ".join(memory.changed_since(self._made_of[name]))
            why = f"changed since it was run: {changed}" if changed else "run it again" if ran else "never run"
            return self._set(StageState(name, "stale" if ran else "new", why, direct))
        return self._finish(name, fit(request, None, recalled, keeping=memory.errors(self._keys[name])))

    def run(self, name: str, progress: Told | None = None) -> StageState:
        """Run a stage again from what its files say; the ones below must be done.

        Raises
        ------
        ThermidError   When it cannot be run; the message says why.
        """
        if self.source is None:
            raise DeckError("a deck has no stages to run. Open a campaign.", self.path.name, code="studio.not-now")
        request, memory = self._request(name), KeptStage(self.results, name)
        calibration = fit(request, progress, keeping=memory.errors(self._keys[name]))
        if calibration.converged:
            end = calibration.end.place if calibration.end is not None else None
            memory.remember(self._keys[name], end, self._made_of[name])
            calibration.save(self.results / f"{file_name(name)}.values.toml")
        for above in self.stages:
            if name in self.below(above):
                self._forget(above)
        return self._finish(name, calibration)

    def judge(self, progress: Callable[[str], None] | None = None, write: bool = False) -> None:
        """Judge the stages that are done on the campaign's hold-out records, as `thermid calibrate` does.

        A joint fit is made where `write`, or where the results folder has one; verdicts by it are open until then.

        Parameters
        ----------
        progress : callable  Called with the name of each record before it is judged.
        write : bool        Whether to write the values files with what the verdicts make of them.
        """
        if self.source is None or self.broken or self.campaign is not None:
            return
        campaign, self.not_judged = self._unjudged_campaign(), ""
        notice = None if progress is None else lambda name, count, rms: progress(name)
        whole = self.source.content.joint is not None and len(campaign.stages) == len(self.stages)
        try:
            if whole and (write or KeptStage(self.results, "joint").has_fit):
                campaign = replace(campaign, joint=joint(campaign, notice=notice, cache=self.results))
            campaign = campaign.judged(self.results, notice)
        except ThermidError as error:
            self.not_judged = str(error)
        self.campaign = campaign
        if write:
            campaign.save(self.results)
        self._desks.clear()
        for name, fitted in campaign.stages.items():
            self._set(self._state(name, fitted), self.states[name].edition)

    def _unjudged_campaign(self) -> Campaign:
        """Return the stages that are done as a campaign that nobody has judged."""
        done = {n: self.done[n] for n in self.stages if n in self.done and self.states[n].state == "done"}
        return Campaign(self.title, done, (), dict(self._keys), "", None, self.source, dict(self._requests))

    @property
    def fits(self) -> Mapping[str, Calibration]:
        """The stages that are done, with what verdicts made of them."""
        return self.done if self.campaign is None else self.campaign.stages

    def fit(self, name: str, values: Mapping[str, float], free: tuple[str, ...], progress: Told | None = None) -> Calibration:
        """Return a fit of chosen parameters that starts at values of the sliders; nothing is kept of it.

        Parameters
        ----------
        name : str      The stage.
        values : dict   Slider -> value in its unit.
        free : tuple    Sliders to fit.

        Raises
        ------
        IdentificationError   When nothing is free, or the logs cannot tell.
        """
        if self.source is None:
            raise IdentificationError(
                "a deck has no log, so a fit is not possible. Open a campaign.", self.path.name, code="studio.not-now"
            )
        if not free:
            raise IdentificationError("no parameter is selected. Tick the parameters to fit.", name, code="fit.nothing-free")
        desk, request = self.desk(name), self._request(name)
        priors = {k: v for k, v in request.priors.items() if ParameterSet(request.model).freeable(k, request.model.canonical) in free}
        # what is fitted keeps the deck's value as the mean of its prior, wherever its slider stands; the search starts at the slider
        model = desk.fixed_at(values, free)
        changed = replace(request, model=model, free=free, prior=tuple(p for p in request.prior if p in free), priors=priors)
        starts = desk.si({s.path: values.get(s.path, s.value) for s in desk.sliders if s.path in free})
        problem = build_problem(changed)
        begun = tuple(replace(u, start=starts.get(u.name, u.start)) for u in problem.unknowns)
        return fit_problem(changed, replace(problem, unknowns=begun), progress, stoppable=True)

    def desk(self, name: str) -> Desk:
        """Return a stage, ready for tuning.

        Raises
        ------
        ThermidError   When a stage below is not done, or a log is missing.
        """
        self.checked_stage(name)
        if name not in self._desks:
            self._desks[name] = self._desk(name)
        return self._desks[name]

    def _desk(self, name: str) -> Desk:
        """Return a stage, or the deck, ready for tuning."""
        if self.source is None:
            model = load_model(self.path)
            return Desk(name, model, None, self.scenarios(model))
        if name in self.fits:
            calibration = self.fits[name]
            return Desk(
                name,
                calibration.given_model,
                calibration.problem,
                () if calibration.problem is not None else self.scenarios(calibration.given_model),
                calibration,
            )
        request = self._request(name)
        return Desk(name, request.model, build_problem(request))

    def scenarios(self, model: Model) -> tuple[Scenario, ...]:
        """Return the scenarios that lie beside the file and fit a model of it, the plainest one where there is none."""
        loaded = []
        boundaries = compile_network(model).boundaries
        for file in sorted(self.path.parent.glob("*.toml")):
            try:
                if {"boundaries", "duration"} <= set(read_toml(file)[0]):
                    loaded.append(load_scenario(file))
            except ThermidError:
                continue  # no scenario, or one that does not read: `thermid simulate` says why
        fitting = tuple(s for s in loaded if set(s.boundaries) <= set(boundaries))
        plain = Scenario("24 °C, five hours", boundaries=dict.fromkeys(boundaries, "24 [degC]"), start="24 [degC]", duration="5 [h]")
        return fitting or (plain,)

    def save(self, name: str, values: Mapping[str, float], title: str) -> Path:
        """Write all values in force as a values file into the results folder and return its path; an older one of that name is kept.

        These are the stage's own and those that it inherits, constant errors of instruments among them, under what was moved since.

        Parameters
        ----------
        name : str      The stage.
        values : dict   As in `Desk.curves`: what was moved, or found by a fit that is not the stage's.
        title : str     The file's name.

        Raises
        ------
        DeckError   When the title is no name for a file, or the deck's values are all that there is.
        """
        stem = file_name(title.strip())
        if not stem.strip("_"):
            raise DeckError("give the values a name of letters and digits.", "save", code="name.not-valid")
        desk = self.desk(name)
        # a stage that was not run has what it inherits
        fitted, bare = desk.calibration, self.source is None
        base = fitted.store if fitted is not None else Store() if bare else self._request(name).store
        store = in_force(desk, values, base)
        if not store.states:
            raise DeckError("no value was changed, so there is nothing to save.", "save", code="studio.not-now")
        self.results.mkdir(parents=True, exist_ok=True)
        target, k = self.results / f"{stem}.values.toml", 2
        while target.exists():
            target, k = self.results / f"{stem}_{k}.values.toml", k + 1
        save_store(store, target, f"{name}, by hand")
        return target

    def kept_files(self) -> tuple[str, ...]:
        """Return the values files of the results folder."""
        return tuple(sorted(f.name for f in self.results.glob("*.values.toml")))

    def kept_values(self, name: str, file: str) -> dict[str, float]:
        """Return slider -> value in its unit, of those that a values file of the results folder has.

        Raises
        ------
        NameNotFoundError   When there is no such file.
        """
        refuse_unknown([file], self.kept_files(), self.results.name, "no values file '{}'.", NameNotFoundError)
        states = load_store(self.results / file)[0].states
        return {s.path: from_si(states[s.path].value, s.unit) for s in self.desk(name).sliders if s.path in states}

    def written_back(self, name: str, values: Mapping[str, float]) -> tuple[DeckDocument, str]:
        """Return a stage's deck with all values in force in it, and what is changed, as a unified diff; nothing is written.

        Values of submodels go to the deck's [set]; constant errors of instruments have no place in a deck.

        Parameters
        ----------
        name : str      The stage.
        values : dict   As in `save`.

        Raises
        ------
        DeckError   When the deck says these values already, or cannot hold them.
        """
        desk, file = self.desk(name), self.path
        if self.source is not None:
            file = resolve_inside(file.parent, next(s for s in self.source.content.stages if s.name == name).model, name)
        before = DeckDocument.opened(file)
        there = load_model(file).parameter_table()
        texts = {}
        for s in desk.sliders:
            for path in (s.path, *s.also):
                literal = there[path].parameter.expression.literal if path in there else None
                value = values.get(s.path, s.value)
                if literal is not None and from_si(literal.value, s.unit) != value:
                    texts[path] = f"{value!r} [{s.unit}]"
        if not texts:
            raise DeckError("the deck has these values already.", file.name, code="output.edit-refused")
        after = before.with_values(texts, f"studio, {name}")
        return after, after.diff(before)

    def write_back(self, name: str, values: Mapping[str, float], confirmed: str) -> Path:
        """Write a stage's deck with all values in force, as a diff that was shown says it; return its path.

        Raises
        ------
        DeckError   When the diff is another by now.
        """
        document, diff = self.written_back(name, values)
        if diff != confirmed:
            why = "the deck or the values changed since the difference was shown. Look at it again."
            raise DeckError(why, document.path.name, code="output.changed-meanwhile")
        document.save()
        return document.path

    def swap(self, part: str, deck: str) -> RetunePlan:
        """Return what replacing a part by another deck of the project costs; the stages that turn stale are marked.

        Raises
        ------
        ThermidError   When the campaign is not done, the deck is none of the project's, or it does not fit.
        """
        if self.source is None:
            raise DeckError("a swap needs a campaign whose stages have been run.", self.path.name, code="campaign.not-run")
        if undone := [n for n in self.stages if n not in self.done]:
            raise DeckError(f"stage '{undone[0]}' has not been run. Run the stages first.", self.title, code="campaign.not-run")
        file = resolve_inside(self.path.parent, deck, "swap", ())
        return plan_retune(self.campaign or self._unjudged_campaign(), part, load_model(file))

    def table(self) -> Table:
        """Return heat transfer coefficients, parts down, stages that are done across, as reports have them."""
        if self._levels is None or self._levels[0] != self.fits:
            self._levels = dict(self.fits), levels(Campaign(self.title, dict(self.fits), (), {}))[0]
        return self._levels[1]

    def _request(self, name: str) -> Request:
        """Return the fit request of a stage, with the values of the stages that it inherits from; kept until the files change.

        Raises
        ------
        DeckError   When one of these stages has not been run, or failed.
        """
        assert self.source is not None
        if name not in self._requests:
            k = self.stages.index(self.checked_stage(name))
            stage = self.source.content.stages[k]
            if missing := [self.states[n] for n in self.below(name) if n not in self.done]:
                why = f"failed: {missing[0].why}" if missing[0].state == "failed" else "has not been run. Run that first."
                raise DeckError(f"needs values of '{missing[0].name}', which {why}", name, code="campaign.not-run")
            request, self._made_of[name] = keyed(request_of(self.source, stage, k, self.done), stage, self._keys)
            self._keys[name], self._requests[name] = request.key, request
        return self._requests[name]

    def _finish(self, name: str, fitted: Calibration, unchanged: bool = False) -> StageState:
        """Take a fit as that of a stage, and return where the stage stands."""
        self.done[name] = fitted
        self.campaign = None
        self._desks.pop(name, None)
        return self._set(self._state(name, fitted), self.states[name].edition if unchanged else self.edition)

    def _state(self, name: str, fitted: Calibration) -> StageState:
        """Return where a stage that is done stands, with the verdicts on it."""
        standing, sensors = fitted.standing, {n: s.rmse for n, s in fitted.sensors.items()}
        state = StageState(
            name, "done", "", self.below(name), sensors, "" if standing.fair else standing.state, standing.line(name), standing.usable
        )
        verdicts = [] if self.campaign is None else [v for v in self.campaign.verdicts if v.model == name]
        verdict_rows = tuple({k: v for k, v in v.to_dict().items() if k != "bands"} | {"text": str(v)} for v in verdicts)
        return replace(state, told=standing.to_dict(name), verdicts=verdict_rows, open=self._open(name, verdicts))

    def _open(self, name: str, verdicts: Sequence[Verdict]) -> str:
        """Return why a stage is not judged though its campaign asks for it; empty where nothing is open."""
        assert self.source is not None
        tables = [t for t in self.source.content.verdicts if t.model == name]
        if self.campaign is None or self.not_judged:
            return (self.not_judged or "its hold-out records are not judged yet") if tables else ""
        if any(t.values == "joint" for t in tables) and self.campaign.joint is None:
            return "the joint fit, which a verdict on it needs, has not been run"
        return "; ".join(v.head for v in verdicts if v.passed is None)

    def _forget(self, name: str) -> None:
        """Drop what is known of a stage whose basis changed."""
        for cached in (self.done, self._requests, self._keys, self._desks):
            cached.pop(name, None)
        self.campaign = None
        self.states[name] = StageState(name, "stale", "a stage below was run again", self.below(name))

    def _set(self, state: StageState, edition: int | None = None) -> StageState:
        """Take where a stage stands, as of an edition of the files."""
        state = self.states[state.name] = replace(state, edition=self.edition if edition is None else edition)
        return state


@dataclass(frozen=True)
class StageState:
    """Where a stage stands.

    Parameters
    ----------
    name : str          The stage.
    state : str         'done', 'stale' (something it depends on changed since), 'new' (never run), 'waiting' (for a stage below),
                        'failed' (it cannot be read) or 'deck' (there is nothing to run).
    why : str           In words.
    below : tuple       Stages whose values it takes.
    sensors : dict      Sensor -> RMSE, of a stage that is done. [K]
    standing : str      How far the values of a stage that is done may be trusted, where a reader must be told; empty else.
    because : str       The reason, with the stage that is the cause.
    usable : bool       Whether an answer may rest on them.
    told : dict         The standing of a stage that is done, as `thermid calibrate --json` prints it.
    verdicts : tuple    The verdicts on it, likewise, without their bands; and as ``text``.
    open : str          Why a stage that is done is not judged, though its campaign asks for it.
    edition : int       Counts how often what the stage says was changed on disk.
    """

    name: str
    state: str
    why: str = ""
    below: tuple[str, ...] = ()
    sensors: Mapping[str, float] = field(default_factory=dict)
    standing: str = ""
    because: str = ""
    usable: bool = True
    told: Mapping[str, Any] = field(default_factory=dict)
    verdicts: tuple[Mapping[str, Any], ...] = ()
    open: str = ""
    edition: int = 0


Stamp = tuple[int, int, int] | None
GLOB = "*?["


class Watch:
    """The files of one project, each with when it was last written and how large it is.

    Parameters
    ----------
    path : Path             The deck or campaign.
    roots : sequence        Folders of logs outside the project.
    apart : Path            A folder that is not looked into: what the studio itself writes.
    """

    def __init__(self, path: Path, roots: Sequence[Path], apart: Path) -> None:
        self._path, self._roots, self._apart = path, tuple(roots), apart.resolve()
        self._patterns: set[Path] = set()
        self._seen: dict[Path, Stamp] = {}
        self._seen = self._stamps()

    def changed(self) -> frozenset[Path]:
        """Return the files that were written, made or deleted since this was last asked."""
        stamps = {f: _stamp(f) for f in (*self._seen, *self._beside())}
        changed = frozenset(f for f, stamp in stamps.items() if self._seen.get(f) != stamp)
        if changed:
            self._seen = self._stamps()
        return changed

    def _beside(self) -> list[Path]:
        """Return what may belong to the file: decks, scenarios, plans and tables of its folder, those inside and the one above; logs."""
        folder, root = self._path.parent, project_root(self._path.parent)
        files = [*folder.glob("*.toml"), *folder.glob("*/*.toml"), *(folder.parent.glob("*.toml") if folder != root else ())]
        files += [f for pattern in self._patterns for f in _matching(pattern)]
        return [f for f in files if not f.resolve().is_relative_to(self._apart)]

    def _stamps(self) -> dict[Path, Stamp]:
        """Return file -> stamp of all that there is to watch; a broken file keeps those watched that it named before."""
        stamps: dict[Path, Stamp] = {f: _stamp(f) for f in (*self._seen, *self._beside())}
        walked: set[Path] = set()
        waiting, root = [self._path], project_root(self._path.parent)
        while waiting:
            file = waiting.pop()
            walked.add(file)
            stamps[file] = _stamp(file)
            try:
                content = read_toml(file)[0]
            except ThermidError:
                continue
            for text in _texts(content):
                for named in _named(file.parent, text, self._roots):
                    if any(mark in named.name for mark in GLOB):
                        self._patterns.add(named)
                    elif named.suffix == ".toml" and named not in walked and named.resolve().is_relative_to(root):
                        waiting.append(named)
                    else:
                        stamps.setdefault(named, _stamp(named))
        return stamps | {f: _stamp(f) for pattern in self._patterns for f in _matching(pattern)}


def _stamp(file: Path) -> Stamp:
    """Return when a file was last written, its size and place on the disk; None where there is none."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in a file's content."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)


def _named(folder: Path, text: str, roots: Sequence[Path]) -> Iterator[Path]:
    """Yield the files below a folder or roots that a text of a project, such as ``box.toml`` or ``logs/*.csv``, may be the name of.

    Decks are yielded also where they are missing, patterns of logs as they are written.
    """
    if not text or len(text) > 255 or "\0" in text or "\n" in text:
        return
    for root in (folder, *roots):
        target = root / text
        if any(mark in text for mark in GLOB):
            if target.parent.is_dir():
                yield target
        elif target.suffix == ".toml" or (target.suffix and target.is_file()):
            yield target


def _matching(pattern: Path) -> Iterator[Path]:
    """Yield the files of a folder that a pattern matches; any text is one, which pathlib refuses of some."""
    try:
        names = os.listdir(pattern.parent)
    except OSError:
        return
    yield from (pattern.parent / n for n in fnmatch.filter(names, pattern.name))
