"""A last fit over the records of all levels at once, each with the model of its own level, and which parameters of these are one value."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thermid.base.errors import IdentificationError, look_up, nearest, refuse_unknown
from thermid.campaign._cache import KeptStage
from thermid.fit.calibration import (
    Calibration,
    Influence,
    Moves,
    Prior,
    Problem,
    Request,
    Unknown,
    build_problem,
    fit_problem,
    is_glob,
    matching,
    moves_from,
    part_of,
    prior_of,
)
from thermid.model.tree import Model, ParameterSet, definition_of, local_identities
from thermid.values.store import FittedValue, FittedValues, LeftOut, Store, graft

if TYPE_CHECKING:
    from thermid.campaign._file import CampaignSource
    from thermid.campaign._schema import JointFitTable

Key = tuple[str, str]
"""Where the part stands whose deck or [set] gives a value, and the value's path there."""
NAME = "joint"


@dataclass(frozen=True, eq=False)
class Level:
    """One level: a stage, what it asks, and where its model stands in the uppermost one."""

    name: str
    request: Request
    positions: tuple[str, ...] = ()

    @cached_property
    def values(self) -> ParameterSet:
        """The values of its model."""
        return ParameterSet(self.request.model)

    @cached_property
    def _numbers(self) -> dict[str, float]:
        """Parameter path -> its number at the store's values. [SI]"""
        return {p: float(v) for p, v in self.values.evaluate({}).items()}

    def start_of(self, raw: str) -> float:
        """Return the value that a parameter has before any fit of this level. [SI]"""
        return self._numbers[self.values.freeable(raw, self.request.model.canonical)]

    def literals(self) -> Iterator[str]:
        """Yield every path that can be free."""
        return (p for p, entry in self.values.table.items() if entry.parameter.is_literal)

    def keys(self, path: str) -> list[Key]:
        """Return what a path is called by where its value comes from, once for each place of this level in the uppermost model."""
        owner = _owner(self.request.model, path)
        rest = path.removeprefix(owner)
        return [(place + owner, rest) for place in self.positions]


def _owner(model: Model, path: str) -> str:
    """Return the prefix of the part that gives a value: the uppermost whose [set] names it, or the one whose deck has it."""
    if path in {model.canonical(p) for p in model.settings}:
        return ""
    head, _, rest = path.partition(".")
    return f"{head}.{_owner(model.submodels[head].model, rest)}" if rest and head in model.submodels else ""


@dataclass(frozen=True)
class Value:
    """One value: its keys, and its paths in the uppermost model."""

    keys: frozenset[Key]
    above: tuple[str, ...]
    fitted: tuple[str, ...]
    start: float | None

    @property
    def also(self) -> tuple[str, ...]:
        """Paths of the uppermost model beside its name."""
        return self.above[1:]


@dataclass(frozen=True, eq=False)
class Shared:
    """All values of a joint fit by name: the path in the uppermost model, or ``stage: path`` where that has none."""

    classes: Mapping[str, Value]
    levels: Sequence[Level] = field(default=(), repr=False)

    @cached_property
    def _names(self) -> dict[Key, str]:
        """(stage, path) -> name of the shared value that acts there."""
        return {key: name for name, one in self.classes.items() for key in one.keys}

    def names_in(self, level: Level) -> dict[str, str]:
        """Return path in a level -> name, of every value that acts there."""
        out = {}
        for path in level.literals():
            name = next((self._names[k] for k in level.keys(path) if k in self._names), None)
            if name is not None:
                out[path] = name
        return out

    def name_of(self, level: Level, path: str) -> str:
        """Return the name of a path; the path itself where it is not free."""
        return next((self._names[k] for k in level.keys(path) if k in self._names), path)

    def start_of(self, name: str, default: float) -> float:
        """Return where a value starts. [SI]"""
        start = self.classes[name].start
        return default if start is None else start

    def without(self, names: Iterable[str]) -> Shared:
        """Return it without some values."""
        gone = set(names)
        return replace(self, classes={n: c for n, c in self.classes.items() if n not in gone}) if gone else self

    def staged(self, done: Mapping[str, Calibration]) -> list[tuple[str, dict[str, str]]]:
        """Return stage and path there -> name, each value at the last stage that fitted it."""
        out: dict[str, dict[str, str]] = {}
        for level in self.levels:
            if level.name in done:
                for path in done[level.name].values.parameters:
                    name = self.name_of(level, path)
                    if name in self.classes and self.classes[name].fitted[-1] == level.name:
                        out.setdefault(level.name, {})[path] = name
        return list(out.items())


def shared_parameters(source: CampaignSource, levels: list[Level], top: str, done: Mapping[str, Calibration]) -> Shared:
    """Return the values that are free in any level, and set the places of the levels.

    A value of a level is the same as one of the level above where the part stands there unchanged: nothing above it sets the value anew.
    A level stands where the stages above inherit from it, or where its very deck is used. Places of one deck's value are
    one in all levels, free there or in another one, and whatever stages found of each.
    """
    places = places_of(source, levels, top)
    levels[:] = [replace(level, positions=places[level.name]) for level in levels]
    groups: dict[Key, set[Key]] = {}

    def unite(keys: Iterable[Key]) -> None:
        """Put keys, and all that they were grouped with before, into one group."""
        whole = set().union(*(groups.get(k, {k}) for k in keys))
        groups.update(dict.fromkeys(whole, whole))

    for keys in _by_deck(levels):
        unite(keys)
    fitted: dict[Key, list[str]] = {}
    starts: dict[Key, float] = {}
    for level in levels:
        shared = level.request.shared
        for path in _free(level):
            keys = [k for p in shared.get(path, (path,)) for k in level.keys(p)]
            unite(keys)
            for k in keys:
                fitted.setdefault(k, []).append(level.name)
                stage_value = done[level.name].values.assignments.get(path) if level.name in done else None
                if stage_value is not None:
                    starts[k] = stage_value.value
    by_top = {k: p for level in levels if level.name == top for p in level.literals() for k in level.keys(p)}
    classes: dict[str, Value] = {}
    for members in {id(groups[k]): groups[k] for k in fitted}.values():
        above = tuple(p for k, p in by_top.items() if k in members)
        order = [level.name for level in levels if any(level.name in fitted.get(k, ()) for k in members)]
        if above:
            name = above[0]
        else:  # the uppermost model does not have it: the last stage that fitted it, and its path there
            level = next(one for one in levels if one.name == order[-1])
            name = f"{level.name}: " + next(p for p in level.literals() if members & set(level.keys(p)))
        start = next((starts[k] for level in reversed(levels) for k in members if k in starts and level.name in fitted[k][-1:]), None)
        classes[name] = Value(frozenset(members), above, tuple(order), start)
    return Shared(classes, levels)


def _by_deck(levels: Sequence[Level]) -> Iterable[list[Key]]:
    """Return the keys of each value that a deck writes, in all levels together; without levels that untie all instances."""
    out: dict[tuple[str, str], list[Key]] = {}
    for level in (one for one in levels if not one.request.untie):
        model = level.request.model.without_layers()
        for path, one in local_identities(model, definition_of(model)).items():
            out.setdefault((one.owner, one.local), []).extend(level.keys(path))
    return out.values()


def _free(level: Level) -> Iterator[str]:
    """Yield the paths that a stage frees, those that it was handed as priors among them."""
    request = level.request
    for raw in (*request.free, *(q for p in request.prior for q in request.store.states[p].acts)):
        yield level.values.freeable(raw, request.model.canonical)


def places_of(source: CampaignSource, levels: Sequence[Level], top: str) -> dict[str, tuple[str, ...]]:
    """Return stage -> prefixes at which its model stands in the uppermost one; a place of its own where it stands nowhere."""
    tables = {s.name: s for s in source.content.stages}
    models = {level.name: level.request.model for level in levels}
    out: dict[str, list[str]] = {top: [""]}
    for above in reversed(list(tables)):
        for part, inherit in tables[above].inherit.items():
            for place in out.get(above, ()):
                canonical = models[above].canonical(part) if above in models else part
                here = place if part == "." else f"{place}{canonical}."
                for below in inherit.stages:
                    if here not in out.setdefault(below, []):
                        out[below].append(here)
    for level in levels:
        if level.name not in out:
            deck = tables[level.name].model
            own_definition = definition_of(source.model(deck, deck))
            same = [prefix for prefix, definition in models[top].instances() if definition == own_definition]
            out[level.name] = same or [f"{level.name}: "]
    return {level.name: tuple(out[level.name]) for level in levels}


@dataclass(frozen=True, eq=False)
class JointFit(Calibration):
    """The fit of all levels at once; a `Calibration` of the uppermost model.

    Parameters
    ----------
    levels : dict       Stage -> its model as the stage had it, and path there -> name of the value here.
    """

    levels: Mapping[str, tuple[Model, Mapping[str, str]]] = field(default_factory=dict, repr=False)

    def at(self, stage: str) -> Calibration:
        """Return what the joint fit says of one level: its model with the joint values, as `validate` takes it.

        Raises
        ------
        IdentificationError   When the joint fit has no such level.
        """
        model, names = look_up(stage, self.levels, "the joint fit has no level '{}'.", self.stage, IdentificationError)
        order = list(self.values)
        chosen = {q: p for p, q in reversed(list(names.items()))}
        positions = [k for k, q in enumerate(order) if q in chosen or self.values[q].kind not in ("parameter", "level")]
        items = {}
        for k in positions:
            v = self.values[order[k]]
            path = chosen.get(v.path, v.path)
            also = tuple(p for p, q in names.items() if q == v.path and p != path)
            items[path] = replace(v, path=path, kind="parameter", also=also) if v.path in chosen else v
        values = FittedValues(f"{self.stage}, {stage}", items, self.values.covariance[np.ix_(positions, positions)], self.values.provenance)
        plain = {f.name: getattr(self, f.name) for f in fields(Calibration)}
        store = self._store_at(items, chosen)
        named = (  # other levels' values are none of this one's
            replace(u, name=chosen.get(u.name, u.name), kind="elsewhere" if u.kind == "parameter" and u.name not in chosen else u.kind)
            for u in (self.problem.unknowns if self.problem else ())
        )
        plain["problem"] = self.problem and replace(self.problem, unknowns=tuple(named))
        return Calibration(**plain | {"stage": f"{self.stage}, {stage}", "given_model": model, "values": values, "store": store})

    def _store_at(self, items: Mapping[str, FittedValue], chosen: Mapping[str, str]) -> Store:
        """Return what the joint fit found of one level, a submodel or the whole, its values named by their paths in that level's deck."""
        rows, states = [], {}
        for path, v in items.items():
            name = next((q for q, p in chosen.items() if p == path), path)
            paths = (path, *v.also) if v.kind == "parameter" else ()
            states[path] = replace(self.store.states[name], path=path, paths=paths, kind=v.kind)
            rows.append(self.store.rows([name])[0])
        return replace(self.store, states=states, root=np.array(rows).reshape(len(rows), len(self.store.sources)))


def fit_jointly(
    source: CampaignSource,
    requests: Mapping[str, Request],
    done: Mapping[str, Calibration],
    key: str = "",
    progress: Callable[[int, float], None] | None = None,
    cache: Path | None = None,
    staged: bool = True,
) -> JointFit:
    """Return the joint fit of a campaign.

    Parameters
    ----------
    source : CampaignSource     The campaign, with its ``[joint]`` table where it has one.
    requests : dict             Stage -> what it asked.
    done : dict                 Stage -> what it found; the joint fit starts there.
    key : str                   Hash of everything that the result depends on.
    progress : callable         As in `calibrate`.
    cache : Path                Results folder.
    staged : bool               Whether to start where the stages ended; else where the decks stand, as a fit without stages would.

    Raises
    ------
    IdentificationError   When a stage of `[joint]` is none, or two stages state different priors of one value.
    """
    table, where = source.content.joint_table, source.where(NAME)
    chosen = _chosen(table, list(requests), where)
    top = chosen[-1]
    levels, remarks = _once({name: requests[name] for name in chosen})
    shared = shared_parameters(source, levels, top, {n: done[n] for n in chosen} if staged else {})
    shared = _unfrozen(shared, table.freeze, where)
    running = [level for level in levels if level.request.records]
    # every shared path free by itself, and nothing of what stages were told by others
    problems = [
        build_problem(replace(one.request, free=tuple(shared.names_in(one)), untie=True, store=Store(), prior=(), priors={}))
        for one in running
    ]
    unknowns = _merged(running, problems, shared, done if staged else {})
    unknowns = _with_priors(unknowns, levels, shared, table, where)
    experiments = tuple(e for p in problems for e in p.experiments)
    noise = {s: 1.0 for p in problems for s in p.noise}
    problem = Problem(experiments, tuple(unknowns), noise, problems[-1].options)
    above = requests[top]
    uncounted = _uncounted(running, shared)
    whole = Request(
        above.model,
        tuple(e.record for e in experiments),
        tuple(u.name for u in unknowns if u.kind == "parameter"),
        loss=table.loss or above.loss,
        loss_scale=table.knee or above.loss_scale,
        name=NAME,
        remarks=(*remarks, *uncounted),
        seen={sha: who for c in done.values() for sha, who in c.used_records.items()},
    )
    recalled = (memory := KeptStage(cache, NAME)).recall(key)
    calibration = fit_problem(whole, problem, progress, recalled)
    if recalled is None and calibration.converged and key:
        memory.remember(key, calibration.end.place if calibration.end is not None else None)
    store = replace(calibration.store, left_out=(*calibration.store.left_out, *map(LeftOut, uncounted)))
    return _judged(replace(calibration, store=store), levels, shared, done if staged else {})


def joint_key(keys: Mapping[str, str], table: JointFitTable) -> str:
    """Return the hash of everything that a joint fit depends on."""
    content = {"version": version("thermid"), "stages": dict(keys), "table": table.model_dump()}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _chosen(table: JointFitTable, names: list[str], where: str) -> list[str]:
    """Return the stages that take part in the joint fit, in order; all where the table names none."""
    refuse_unknown(table.stages, names, f"{where}.stages", "no stage '{}'.", IdentificationError)
    return [n for n in names if not table.stages or n in table.stages]


def _once(requests: Mapping[str, Request]) -> tuple[list[Level], list[str]]:
    """Return the levels with every record in one of them, the uppermost that uses it, and a remark where one was in several."""
    taken: dict[str, str] = {}
    remarks: list[str] = []
    out: list[Level] = []
    for name, request in reversed(list(requests.items())):
        new_records = tuple(r for r in request.records if r.origin.sha256 not in taken)
        for r in request.records:
            if r not in new_records:
                remarks.append(f"record '{r.name}' is used by '{name}' and '{taken[r.origin.sha256]}'. It is counted once, in the latter.")
        taken |= {r.origin.sha256: name for r in new_records}
        out.insert(0, Level(name, replace(request, records=new_records)))
    return out, remarks


def _uncounted(running: Sequence[Level], shared: Shared) -> tuple[str, ...]:
    """Return in words what stages know of values with an error that the joint fit does not count.

    It has the data of its own levels and no store: what it fixes it takes as exact, and what a stage without records in it found of a
    value that it frees is no prior.
    """
    fixed: dict[tuple[str, float], tuple[str, str]] = {}
    lost: dict[tuple[str, float], tuple[str, str]] = {}
    stages = {level.name for level in running}
    for level in reversed(running):
        free, store = set(shared.names_in(level)), level.request.store
        for s in store.parameters.values():
            if not (s.known and s.acts and store.rows([s.path]).any()):
                continue
            if not free.issuperset(s.acts):
                fixed.setdefault((s.origin.stage, s.value), (str(s.origin), s.path))
            elif s.origin.stage not in stages:
                lost.setdefault((s.origin.stage, s.value), (str(s.origin), shared.name_of(level, s.acts[0])))
    exact = [
        f"the joint fit keeps {names} of {who} fixed, so its standard errors do not include theirs and are too small. Free them "
        "in the joint fit if that matters."
        for who, names in _listed(fixed.values())
    ]
    none = "is not a prior of the joint fit, because none of its records is part of it."
    return (*exact, *(f"the result of {who} for {names} {none}" for who, names in _listed(lost.values())))


def _listed(several: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return who and the values of each, in words."""
    out: dict[str, list[str]] = {}
    for who, path in several:
        out.setdefault(who, []).append(f"'{path}'")
    return [(who, ", ".join(paths)) for who, paths in out.items()]


def _merged(levels: Sequence[Level], problems: Sequence[Problem], shared: Shared, done: Mapping[str, Calibration]) -> list[Unknown]:
    """Return one unknown per shared value, local value and instrument, acting in the experiments of all levels."""
    out: dict[str, Unknown] = {}
    first = 0
    for level, problem in zip(levels, problems, strict=True):
        for u in problem.unknowns:
            name = shared.name_of(level, u.name) if u.kind == "parameter" else u.name
            targets = tuple(replace(t, experiment=t.experiment + first) for t in u.targets)
            if name in out:
                out[name] = _joined(out[name], u, targets)
            else:
                start = shared.start_of(name, u.start) if u.kind == "parameter" else u.start
                out[name] = replace(u, name=name, targets=targets, start=start)
        first += len(problem.experiments)
    nearer = {name: c for c in done.values() for name in c.fitted}
    order = list(shared.classes)
    ranked = sorted(out.values(), key=lambda u: order.index(u.name) if u.kind == "parameter" else len(order))
    return [
        u if u.kind == "parameter" or u.name not in nearer else replace(u, start=u.to_value(nearer[u.name].fitted[u.name])) for u in ranked
    ]


def _joined(one: Unknown, other: Unknown, targets: tuple[Influence, ...]) -> Unknown:
    """Return an unknown that acts at another level too; of an instrument the tighter accuracy holds."""
    prior = one.prior
    if other.prior is not None and (prior is None or other.prior.sd < prior.sd):
        prior = other.prior
    return replace(one, targets=(*one.targets, *targets), prior=prior)


def _unfrozen(shared: Shared, freeze: Sequence[str], where: str) -> Shared:
    """Return the shared values without those that the campaign freezes, by name or pattern."""
    names = list(shared.classes)
    gone: set[str] = set()
    for name in freeze:
        hits = matching(name, names, f"{where}.freeze") if is_glob(name) else [n for n in names if n == name]
        if not hits:
            raise IdentificationError(
                f"'{name}' is listed as frozen, but it is not free.{nearest(name, names)}", f"{where}.freeze", code="name.unknown"
            )
        gone |= set(hits)
    return shared.without(gone)


def _with_priors(unknowns: Sequence[Unknown], levels: Sequence[Level], shared: Shared, table: JointFitTable, where: str) -> list[Unknown]:
    """Return the unknowns with the priors of ``[joint]``, or those that the stages stated.

    A stage's prior without a mean stands about what was known before it. Where a stage below fitted the value, its data are here, and the
    prior would count them twice; it is left out then.
    """
    stated: dict[str, Prior] = {}
    stated_by: dict[str, str] = {}
    by_name = {u.name: u for u in unknowns}
    order = [level.name for level in shared.levels]
    for level in levels:
        canonical, below = level.request.model.canonical, {*order[: order.index(level.name)]}
        for raw, texts in level.request.priors.items():
            name = shared.name_of(level, level.values.freeable(raw, canonical))
            if name not in by_name or (not texts[0] and not below.isdisjoint(shared.classes[name].fitted)):
                continue
            unknown = replace(by_name[name], start=level.start_of(raw))
            prior = prior_of(unknown, texts)
            if name in stated and stated[name] != prior and name not in table.priors:
                raise IdentificationError(
                    f"stages '{stated_by[name]}' and '{level.name}' state different priors of '{name}'. State one under [joint] priors.",
                    where,
                    code="campaign.refused",
                )
            stated[name], stated_by[name] = prior, level.name
    for name, one in table.priors.items():
        refuse_unknown([name], by_name, f"{where}.priors", "a prior is given for '{}', which is not free.", IdentificationError)
        stated[name] = prior_of(by_name[name], (one.mean, one.sd))
    return [replace(u, prior=stated[u.name]) if u.name in stated else u for u in unknowns]


def _judged(calibration: Calibration, levels: Sequence[Level], shared: Shared, done: Mapping[str, Calibration]) -> JointFit:
    """Return the joint calibration with what it says against the stages, and values that the uppermost model does not have marked."""
    above = {n for n, c in shared.classes.items() if c.above}
    items = {
        p: v if v.kind != "parameter" else replace(v, also=shared.classes[p].also) if p in above else replace(v, kind="level")
        for p, v in calibration.values.items()
    }
    values = FittedValues(calibration.values.stage, items, calibration.values.covariance, calibration.values.provenance)
    names = {level.name: shared.names_in(level) for level in levels}
    store = _store(calibration.store, items, levels[-1].request)
    plain = {f.name: getattr(calibration, f.name) for f in fields(Calibration)} | {"values": values, "store": store}
    held = {level.name: (level.request.model, names[level.name]) for level in levels}
    return JointFit(**plain | {"moved": _moves(calibration.given_model, values, shared, done)}, levels=held)


def _store(store: Store, items: Mapping[str, FittedValue], top: Request) -> Store:
    """Return what is known of the uppermost model: what the joint fit found, and of the stages what it left as it was."""
    states = {}
    for p, s in store.states.items():
        above = (p, *items[p].also) if items[p].kind == "parameter" else ()
        states[p] = replace(s, kind=items[p].kind, paths=above)
    here = {q for s in states.values() for q in (s.path, *s.paths)}
    others = top.store.only(lambda s: not here & {s.path, *s.paths})
    return graft(top.model, [(".", replace(store, states=states)), (".", others)])[0]


def _moves(model: Model, values: FittedValues, shared: Shared, done: Mapping[str, Calibration]) -> Moves:
    """Moves of each value from where its last stage left it."""
    staged = [(done[stage].values, names) for stage, names in shared.staged(done)]

    def place(name: str) -> str:
        """Return the part of the model, or the stage for a value of its own, that a name belongs to."""
        stage, colon, _ = name.partition(": ")
        return f"{stage}, alone" if colon else part_of(model, name)

    return moves_from(staged, values, place) if staged else Moves()
