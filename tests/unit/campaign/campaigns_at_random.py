"""Random campaigns over linear trees, and their values by a separate least-squares fit: nothing of the package but the decks' grammar.

A tree has two to four levels; twins stand at different heights. The temperatures are those of the matrix exponential of each network, the
fits are scipy's, and errors follow the responses of every value to independent causes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
AIR, NOISE = 22.0, 0.05
"""Temperature of the air [degC] and noise of every reading. [K]"""
TIMES = np.linspace(0.0, 4000.0, 41)
LOOSE = 0.3
"""Standard error of a logarithm from which derivatives at the optimum are no error any more; such campaigns are drawn again."""
POWER = 2.0
"""Of every part. [W]"""
UNITS = {"capacitance": "J/K", "conductance": "W/K"}
Key = tuple[str, str]
"""Deck and path there: one value, wherever it acts."""


@dataclass(frozen=True)
class Deck:
    """A part: its own values as they are and as the deck has them, its parts, and what its [set] says of places below."""

    name: str
    truth: Mapping[str, float]
    written: Mapping[str, float]
    parts: Mapping[str, Deck] = field(default_factory=dict)
    sets: Mapping[str, float] = field(default_factory=dict)

    @property
    def top(self) -> str:
        """The node that it offers."""
        return "body" if self.parts else "n"

    def every(self, prefix: str = "") -> Iterator[tuple[str, Deck]]:
        """Yield prefix and deck of it and of all below."""
        yield prefix, self
        for name, part in self.parts.items():
            yield from part.every(f"{prefix}{name}.")

    def owner(self, path: str) -> tuple[str, Deck, str]:
        """Place, deck and path there of the deck that gives a value: the uppermost with a row of [set] for it, or the part's own."""
        head, _, rest = path.partition(".")
        if path in self.sets or head not in self.parts:
            return "", self, path
        place, deck, local = self.parts[head].owner(rest)
        return f"{head}.{place}" if place else head, deck, local

    def key(self, path: str) -> Key:
        """What a value is."""
        _, deck, local = self.owner(path)
        return deck.name, local

    def paths(self) -> list[str]:
        """Every value."""
        return [prefix + p for prefix, deck in self.every() for p in deck.truth]

    def value(self, path: str, true: bool) -> float:
        """A value as it is, or as the decks have it. [SI]"""
        _, deck, local = self.owner(path)
        return deck.sets[local] if local in deck.sets else (deck.truth if true else deck.written)[local]

    def temperatures(self, values: Mapping[str, float]) -> Array:
        """Temperatures (nodes, times) above the air from the start on, all nodes at its temperature then. [K]"""
        nodes = [prefix + deck.top for prefix, deck in self.every()]
        at = {n: k for k, n in enumerate(nodes)}
        heat = np.array([values[f"{n}.capacitance"] for n in nodes])
        matrix = np.zeros((len(nodes), len(nodes)))
        for prefix, deck in self.every():
            here = at[prefix + deck.top]
            matrix[here, here] += values[f"{prefix}{'e' if deck.parts else 'g'}.conductance"]
            for name, part in deck.parts.items():
                there, g = at[f"{prefix}{name}.{part.top}"], values[f"{prefix}to_{name}.conductance"]
                matrix[[here, there], [here, there]] += g
                matrix[[here, there], [there, here]] -= g
        root = 1.0 / np.sqrt(heat)
        rates, modes = np.linalg.eigh(root[:, None] * matrix * root)
        grown = -np.expm1(-np.outer(rates, TIMES)) / rates[:, None]
        return np.asarray(root[:, None] * (modes @ (grown * (modes.T @ (root * POWER))[:, None])))

    def text(self) -> str:
        """The deck as its file has it."""
        lines = [f'title = "{self.name}"', 'needs = ["air"]', f'offers = ["{self.top}"]']
        lines += [f'[submodels.{n}]\nuse = "{d.name}.toml"\nbind = {{ air = "air" }}' for n, d in self.parts.items()]
        lines.append(f'[nodes.{self.top}]\ncapacitance = "{self.written[f"{self.top}.capacitance"]!r} [J/K]"')
        for name in (p.partition(".")[0] for p in self.written if p.endswith("conductance")):
            other = name.removeprefix("to_")
            ends = "air" if name in ("e", "g") else f"{other}.{self.parts[other].top}"
            lines.append(f'[conductors.{name}]\nkind = "conduction"\nbetween = ["{self.top}", "{ends}"]')
            value = self.written[f"{name}.conductance"]
            lines.append(f'conductance = {{ value = "{value!r} [W/K]", min = 0.001, max = 50 }}')
        lines.append(f'[loads.heat]\ninto = "{self.top}"\npower = "{POWER} [W]"')
        lines += ["[set]", *(f'"{p}" = "{v!r} [{UNITS[p.rpartition(".")[2]]}]"' for p, v in self.sets.items())] if self.sets else []
        return "\n".join(lines)


@dataclass
class Inherit:
    """How a stage takes another."""

    stage: str
    prior: bool
    only: list[str] = field(default_factory=list)
    without: list[str] = field(default_factory=list)
    move: list[str] = field(default_factory=list)

    def text(self) -> str:
        """Its row in a campaign."""
        rows = [f'stage = "{self.stage}"', f'as = "{"prior" if self.prior else "fixed"}"']
        rows += [f"{n} = {listed(getattr(self, n))}" for n in ("only", "without", "move") if getattr(self, n)]
        return ", ".join(rows)


@dataclass
class Stage:
    """One level: its deck, what it takes from below, frees, freezes and unties; `hand` is a value tuned by hand in place of a log."""

    deck: Deck
    inherit: dict[str, Inherit] = field(default_factory=dict)
    free: list[str] = field(default_factory=list)
    freeze: list[str] = field(default_factory=list)
    priors: dict[str, tuple[float, float]] = field(default_factory=dict)
    untie: bool | list[str] = False
    hand: dict[str, tuple[float, float]] = field(default_factory=dict)
    readings: Array | None = None

    @property
    def name(self) -> str:
        """The stage's."""
        return f"stage {self.deck.name}"

    def text(self) -> str:
        """Its table in a campaign."""
        rows = ["[[stages]]", f'name = "{self.name}"', f'model = "{self.deck.name}.toml"']
        if self.hand:
            return "\n".join([*rows, f'values = "{self.deck.name}.hand.toml"'])
        rows += [f'records = ["{self.deck.name}"]', f"free = {listed(self.free)}"]
        rows += [f"freeze = {listed(self.freeze)}"] if self.freeze else []
        rows += [f"untie = {str(self.untie).lower() if isinstance(self.untie, bool) else listed(self.untie)}"] if self.untie else []
        rows += ["inherit = { " + ", ".join(f'"{p}" = {{ {i.text()} }}' for p, i in self.inherit.items()) + " }"] if self.inherit else []
        stated = (f'"{p}" = {{ mean = "{m!r} [{UNITS[p.rpartition(".")[2]]}]", sd = "{s!r} [%]" }}' for p, (m, s) in self.priors.items())
        rows += ["priors = { " + ", ".join(stated) + " }"] if self.priors else []
        return "\n".join([*rows, f'scenario = {{ boundaries = {{ air = "{AIR} [degC]" }}, start = "{AIR} [degC]" }}'])

    def record_text(self) -> str:
        """The table of its log."""
        nodes = [prefix + deck.top for prefix, deck in self.deck.every()]
        channels = ", ".join(f'T{k} = {{ node = "{n}", noise = "{NOISE} [K]" }}' for k, n in enumerate(nodes))
        name = self.deck.name
        return f'[records.{name}]\nfile = "logs/{name}.csv"\ntime = "time_s"\nchannels = {{ {channels} }}'


def listed(names: list[str]) -> str:
    """Return names as TOML has them."""
    return "[" + ", ".join(f'"{n}"' for n in names) + "]"


@dataclass(frozen=True)
class Known:
    """A value that a stage gave: where it acts, its logarithm, and what that responds to.

    Parameters
    ----------
    paths : tuple   Where it acts.
    at : str        Place of the model of the stage that gave it; empty for the model itself.
    row : dict      Cause -> response of the logarithm to one standard deviation of it.
    """

    paths: tuple[str, ...]
    value: float
    row: Mapping[str, float]
    stage: str
    at: str = ""

    def under(self, part: str) -> Known:
        """Return it as it is in a model that has this one as a part."""
        at = f"{part}.{self.at}" if self.at else part
        return Known(tuple(f"{part}.{p}" for p in self.paths), self.value, self.row, self.stage, at)

    def same(self, other: Known) -> bool:
        """Whether both are one result."""
        return (self.stage, self.value) == (other.stage, other.value)

    @property
    def error(self) -> float:
        """Standard error of the logarithm."""
        return float(np.sqrt(sum(x * x for x in self.row.values())))


def inside(path: str, place: str) -> bool:
    """Whether a path is a place or lies in it; all lies in the empty one."""
    return not place or path == place or path.startswith(f"{place}.")


@dataclass
class Held:
    """What a model holds once a stage took what it inherits.

    Parameters
    ----------
    acting : dict       Path -> what acts there of the stages below.
    moving : list       What of it may move.
    silent : set        Places that could have read a result and do not.
    """

    acting: dict[str, Known]
    moving: list[Known]
    silent: set[str]
    every: list[Known]


def held(stage: Stage, done: Mapping[str, list[Known]]) -> Held:
    """Return what acts where in the model of a stage before it fits."""
    deck, every, moving = stage.deck, [], []
    own: dict[int, Key] = {}
    high: dict[int, tuple[int, str]] = {}
    for part, i in stage.inherit.items():
        for k in done[i.stage]:
            mine = k.stage == i.stage
            name = k.paths[0]
            if (mine and i.only and name not in i.only) or name in i.without:
                continue
            moved = k.under(part)
            every.append(moved)
            high[id(moved)] = (part.count("."), part)
            first = moved.paths[0]
            own[id(moved)] = below(deck, moved.at).key(first[len(moved.at) + 1 :]) if inside(first, moved.at) else deck.key(first)
            if i.prior and (not i.move or name in i.move):
                moving.append(moved)
    acting = {p: k for k in every for p in k.paths if acts(deck, p, k, own[id(k)])}
    given, silent = {p for k in every for p in k.paths}, set()
    for key in dict.fromkeys(own.values()):
        results = [k for k in every if own[id(k)] == key]
        rest = [p for p in deck.paths() if deck.key(p) == key and p not in given]
        if not all(k.same(results[0]) for k in results) or any(inside(p, k.at) for p in rest for k in results):
            silent |= set(rest)
        else:
            # the result of a twin with which a place stays one value, or the uppermost
            results.sort(key=lambda k: high[id(k)])
            for p in rest:
                side = apart_by(stage, p)
                acting[p] = next((k for k in results for q in k.paths if apart_by(stage, q) == side), results[0])
    rows: dict[Key, list[str]] = {}
    for prefix, part in deck.every():
        for p in part.truth:
            rows.setdefault((part.name, p), []).append(prefix + p)
    of = {p: several for several in rows.values() for p in several}
    silent |= {q for k in every for p in k.paths for q in of[p] if q not in acting and q not in given and not inside(q, k.at)}
    return Held(acting, moving, silent, every)


def acts(deck: Deck, path: str, known: Known, key: Key) -> bool:
    """Whether no [set] above the model of the stage that gave a value hides it; at a twin elsewhere, above the deck that writes it."""
    return inside(deck.owner(path)[0], known.at) if inside(path, known.at) else deck.key(path) == key


def below(deck: Deck, place: str) -> Deck:
    """Return the part at a place."""
    head, _, rest = place.partition(".")
    return below(deck.parts[head], rest) if head else deck


def groups_of(stage: Stage, now: Held) -> list[tuple[str, ...]]:
    """Return the paths of a model by value: each group is one number."""
    out: dict[Any, list[str]] = {}
    for p in stage.deck.paths():
        k = now.acting.get(p)
        out.setdefault((stage.deck.key(p), (k.stage, k.value) if k else None, apart_by(stage, p)), []).append(p)
    return [tuple(g) for g in out.values()]


def apart_by(stage: Stage, path: str) -> str:
    """Return the place at which a stage unties a path from its twins; empty for none."""
    return path if stage.untie is True else next((c for c in (stage.untie or []) if inside(path, c)), "")


@dataclass
class Fitted:
    """A stage as the reference has it."""

    known: list[Known]
    unknowns: list[tuple[str, ...]]
    silent: set[str]
    residuals: Any = None
    at: Array = field(default_factory=lambda: np.zeros(0))


def reference(stage: Stage, done: Mapping[str, list[Known]], tried: Mapping[str, float] | None = None) -> Fitted:
    """Return the least-squares fit of a stage, from the truth and from `tried`, values by path."""
    if stage.hand:
        known = [Known((p,), float(np.log(v)), {f"{stage.name}: {p}": sd / v}, stage.name) for p, (v, sd) in stage.hand.items()]
        return Fitted(known, [], set())
    deck, now = stage.deck, held(stage, done)
    groups = groups_of(stage, now)
    wanted = {*stage.free, *(p for k in now.moving for p in now.acting if now.acting[p] is k)}
    groups_free = [g for g in groups if wanted & {*g} and not {*stage.freeze} & {*g}]
    base = {p: deck.value(p, False) for p in deck.paths()} | {p: float(np.exp(k.value)) for p, k in now.acting.items()}
    free = {p for g in groups_free for p in g}
    fixed: list[tuple[Known, tuple[str, ...]]] = []
    for k in now.every:
        left = tuple(p for p, x in now.acting.items() if x is k and p not in free)
        fixed += [(k, left)] if left else []
    means, rows = priors(stage, groups_free, now)
    assert stage.readings is not None
    measured = stage.readings

    def data(x: Array) -> Array:
        """Weighted residuals of the readings at logarithms of unknowns, then of fixed values."""
        values = dict(base)
        for g, v in zip([*groups_free, *(paths for _, paths in fixed)], x, strict=True):
            values |= dict.fromkeys(g, float(np.exp(v)))
        return np.asarray((deck.temperatures(values) - measured).ravel() / NOISE)

    n, held_at = len(groups_free), np.array([k.value for k, _ in fixed])
    names = sorted({s for r in rows.values() for s in r})
    prior_rows = np.array([[r.get(s, 0.0) for s in names] for r in rows.values()]).reshape(len(rows), len(names))
    information = np.linalg.inv(prior_rows @ prior_rows.T) if rows else np.zeros((0, 0))
    half = np.linalg.cholesky(information).T if rows else np.zeros((0, 0))
    at, middle = list(rows), np.array(list(means.values()))

    def whole(x: Array) -> Array:
        return np.concatenate([data(np.concatenate([x, held_at])), half @ (x[at] - middle)])

    starts = [np.log([deck.value(g[0], True) for g in groups_free])]
    starts += [np.log([tried[g[0]] for g in groups_free])] if tried is not None else []
    found = min(
        (least_squares(whole, s, jac="3-point", x_scale=0.01, xtol=1e-14, ftol=1e-14, gtol=1e-12) for s in starts), key=lambda f: f.cost
    )
    jacobian = slopes(data, np.concatenate([found.x, held_at]))
    own, other = jacobian[:, :n], jacobian[:, n:]
    inverse = np.zeros((n, n))
    inverse[np.ix_(at, at)] = information
    covariance = np.linalg.inv(own.T @ own + inverse)
    columns: list[dict[str, float]] = [{} for _ in range(n)]
    spread = covariance[:, at] @ information @ prior_rows
    moved = -covariance @ own.T @ other
    noise = np.linalg.cholesky(covariance @ own.T @ own @ covariance + 1e-18 * np.eye(n))
    for i in range(n):
        for j, s in enumerate(names):
            columns[i][s] = float(spread[i, j])
        for j, (k, _) in enumerate(fixed):
            for s, x in k.row.items():
                columns[i][s] = columns[i].get(s, 0.0) + float(moved[i, j]) * x
        columns[i] |= {f"{stage.name}: noise {j}": float(noise[i, j]) for j in range(n)}
    known = [Known(g, float(v), r, stage.name) for g, v, r in zip(groups_free, found.x, columns, strict=True)]
    for k in now.every:
        left = [p for p in k.paths if p not in free and now.acting.get(p, k) is k]
        left += [p for p, x in now.acting.items() if x is k and p not in free and p not in left]
        known += [Known(tuple(left), k.value, k.row, k.stage, k.at)] if left else []
    return Fitted(known, groups_free, now.silent, data, found.x)


def joint_reference(stages: Mapping[str, Stage], found: Mapping[str, Fitted]) -> list[Known]:
    """Return the least-squares fit of all logs at once: whatever any stage frees is free, and one value wherever it acts."""
    levels = [s for s in stages.values() if s.readings is not None]
    free = sorted({s.deck.key(g[0]) for s in levels for g in found[s.name].unknowns})
    at: dict[str, dict[str, Key]] = {s.name: {p: k for p in s.deck.paths() if (k := s.deck.key(p)) in free} for s in levels}
    bases = {s.name: {p: s.deck.value(p, False) for p in s.deck.paths()} for s in levels}
    for s in levels:
        now = held(s, {n: f.known for n, f in found.items()})
        bases[s.name] |= {p: float(np.exp(k.value)) for p, k in now.acting.items()}
    true = {k: s.deck.value(p, True) for s in levels for p, k in at[s.name].items()}

    def data(x: Array) -> Array:
        values = dict(zip(free, np.exp(x).tolist(), strict=True))
        runs = (s.deck.temperatures(bases[s.name] | {p: values[k] for p, k in at[s.name].items()}) - s.readings for s in levels)
        return np.concatenate([r.ravel() for r in runs]) / NOISE

    start = np.log([true[k] for k in free])
    best = least_squares(data, start, jac="3-point", x_scale=0.01, xtol=1e-14, ftol=1e-14, gtol=1e-12).x
    rows = slopes(data, best)
    errors = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    top = levels[-1]
    places = {k: tuple(p for p, key in at[top.name].items() if key == k) for k in free}
    return [Known(places[k], float(v), {"noise": float(e)}, "joint") for k, v, e in zip(free, best, errors, strict=True) if places[k]]


def priors(stage: Stage, groups: list[tuple[str, ...]], now: Held) -> tuple[dict[int, float], dict[int, dict[str, float]]]:
    """Return unknown -> mean, and its response to causes, of what is known before the fit; instances that are untied err by themselves."""
    means: dict[int, float] = {}
    rows: dict[int, dict[str, float]] = {}
    moving = {p: k for p, k in now.acting.items() if any(k is m for m in now.moving)}
    taken = {j: next(moving[p] for p in g if p in moving) for j, g in enumerate(groups) if {*g} & {*moving}}
    for j, k in taken.items():
        several = sorted(groups[i][0] for i, other in taken.items() if k.same(other))
        copy = several.index(groups[j][0])
        # twins that are untied at one level: the values of each keep their correlation, named by its place there
        place = apart(groups[j][0], several)
        means[j], rows[j] = k.value, {f"{s} at {place}" if copy else s: x for s, x in k.row.items()}
    for j, g in enumerate(groups):
        for p in g:
            if p in stage.priors:
                mean, sd = stage.priors[p]
                means[j], rows[j] = float(np.log(mean)), {f"{stage.name}: prior of {p}": sd / 100.0}
    return means, rows


def apart(path: str, several: list[str]) -> str:
    """Return the shortest place in which a path lies and none of the others."""
    ends = [k for k, c in enumerate(f"{path}.") if c == "."]
    return next(path[:k] for k in ends if sum(inside(q, path[:k]) for q in several) == 1)


def slopes(function: Any, x: Array) -> Array:
    """Return the derivatives (residuals, unknowns) by central differences."""
    step = 1e-5
    columns = [(function(x + step * e) - function(x - step * e)) / (2.0 * step) for e in np.eye(x.size)]
    return np.array(columns).T.reshape(-1, x.size) if x.size else np.zeros((function(x).size, 0))


class Drawing:
    """A random campaign with the reference's answer to each stage, in order.

    Parameters
    ----------
    seed : int
    """

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        while not self.drawn():
            pass

    def drawn(self) -> bool:
        """Draw decks, stages and logs; return whether the logs tell every value that is free."""
        self.joint = self.chance(0.3)
        self.pool: list[Deck] = []
        self.stages: dict[str, Stage] = {}
        self.found: dict[str, Fitted] = {}
        self.root = self.deck(int(self.rng.integers(2, 5)))
        for deck in self.pool:
            if deck is self.root or self.chance(0.85):
                try:
                    self.stage(deck)
                except np.linalg.LinAlgError:
                    return False
        return max(k.error for f in self.found.values() for k in f.known) < LOOSE

    def chance(self, share: float) -> bool:
        """Draw whether something is so."""
        return bool(self.rng.random() < share)

    def one(self, several: list[Any]) -> Any:
        """Draw one of several."""
        return several[int(self.rng.integers(len(several)))]

    def deck(self, levels: int) -> Deck:
        """Draw a deck whose parts stand in the pool before it; parts of any height may stand in it again."""
        parts: dict[str, Deck] = {}
        if levels > 1:
            parts["a"] = self.deck(levels - 1)
            small = [d for d in self.pool if len(list(d.every())) <= 3]
            if self.chance(0.7):
                parts["b"] = self.one(small) if small and self.chance(0.7) else self.deck(1)
        names = (
            ["body.capacitance", *(f"to_{n}.conductance" for n in parts), "e.conductance"] if parts else ["n.capacitance", "g.conductance"]
        )
        truth = {n: round(float(self.rng.uniform(60, 200) if "capac" in n else self.rng.uniform(0.15, 0.6)), 4) for n in names}
        written = {n: round(v * float(self.rng.uniform(0.8, 1.25)), 4) if self.chance(0.6) else v for n, v in truth.items()}
        made = Deck(f"d{len(self.pool)}", truth, written, parts)
        if parts and self.chance(0.25):
            path = self.one([p for p in made.paths() if p not in truth])
            made = Deck(made.name, truth, written, parts, {path: round(made.value(path, True) * float(self.rng.uniform(0.8, 1.2)), 4)})
        self.pool.append(made)
        return made

    def stage(self, deck: Deck) -> None:
        """Draw the stage of a deck, its log, and fit it by the reference."""
        made, done = Stage(deck), {n: f.known for n, f in self.found.items()}
        if not deck.parts and self.chance(0.2):
            value = deck.truth["g.conductance"]
            made.hand = {"g.conductance": (round(value * 1.001, 6), round(0.03 * value, 6))}
        else:
            for name, part in deck.parts.items():
                made.inherit |= {place: self.inherit(below) for place, below in self.nearest(part, name) if self.chance(0.8)}
            if self.chance(0.2) and not self.joint:
                made.untie = self.one([True, [self.one([*deck.parts])]]) if deck.parts else False
            made.free = [p for p in deck.truth if self.chance(0.5)]
            now = held(made, done)
            made.free += [self.one(sorted(now.acting))] if now.acting and self.chance(0.2) else []
            move = sorted(p for p, k in now.acting.items() if any(k is m for m in now.moving))
            made.freeze = [self.one(move)] if move and self.chance(0.2) else []
            groups = groups_of(made, now)
            # what neither a stage nor the deck has right is free
            wrong = [g[0] for g in groups if g[0] not in now.acting and deck.value(g[0], True) != deck.value(g[0], False)]
            taken = {p for g in groups if {*g} & {*made.free, *made.freeze} for p in g}
            made.free += [p for p in wrong if p not in taken]
            frozen = {p for g in groups if {*g} & {*made.freeze} for p in g}
            made.free = [p for p in made.free if p not in frozen] or [next(p for p in deck.truth)]
            alone = [p for p in made.free if p in deck.truth]
            if alone and self.chance(0.3) and not self.joint:
                path = self.one(alone)
                made.priors[path] = (round(deck.truth[path] * float(self.rng.normal(1.0, 0.02)), 5), 3.0)
            made.readings = np.round(deck.temperatures({p: deck.value(p, True) for p in deck.paths()}) + self.noise(deck), 6)
        self.stages[made.name] = made
        self.found[made.name] = reference(made, done)

    def noise(self, deck: Deck) -> Array:
        """Noise of every reading (nodes, times), a little less than stated, of traces that nobody would say wander. [K]"""
        rows: list[Array] = []
        while len(rows) < len(list(deck.every())):
            row = self.rng.standard_normal(TIMES.size)
            blocks = row[:40].reshape(-1, 5).mean(axis=1)
            if row.var() < 1.2 and 5.0 * blocks.var() < 1.0 and np.corrcoef(row[1:], row[:-1])[0, 1] < 0.1:
                rows.append(0.85 * NOISE * row)
        return np.array(rows)

    def nearest(self, part: Deck, place: str) -> list[tuple[str, Stage]]:
        """Return the uppermost stages in a part, with their places."""
        found = self.stages.get(f"stage {part.name}")
        return [(place, found)] if found is not None else [x for n, p in part.parts.items() for x in self.nearest(p, f"{place}.{n}")]

    def inherit(self, below: Stage) -> Inherit:
        """Draw how a stage takes another; only values that act at one place are named."""
        known = self.found[below.name].known
        own = [k.paths[0] for k in known if k.stage == below.name and len(k.paths) == 1]
        names = [k.paths[0] for k in known if len(k.paths) == 1]
        made = Inherit(below.name, self.chance(0.5))
        if len(own) > 1 and self.chance(0.15):
            made.only = [self.one(own)]
        elif names and self.chance(0.15):
            made.without = [self.one(names)]
        left = [n for n in names if n not in made.without and (not made.only or n in made.only or n not in own)]
        if made.prior and left and self.chance(0.3):
            made.move = [self.one(left)]
        return made

    def write(self, folder: Path) -> Path:
        """Write decks, logs and campaign."""
        (folder / "thermid.toml").write_text("")
        (folder / "logs").mkdir()
        for deck in self.pool:
            (folder / f"{deck.name}.toml").write_text(deck.text())
        texts = ['title = "Random"']
        tested = [s for s in self.stages.values() if s.readings is not None]
        for s in tested:
            assert s.readings is not None
            rows, names = np.column_stack([TIMES, s.readings.T + AIR]), ",".join(["time_s", *(f"T{k}" for k in range(len(s.readings)))])
            np.savetxt(folder / "logs" / f"{s.deck.name}.csv", rows, "%.6f", ",", header=names, comments="")
            texts.append(s.record_text())
        for s in self.stages.values():
            if s.hand:
                rows_ = (f'"{p}" = {{ value = "{v!r} [W/K]", sd = "{sd!r} [W/K]" }}' for p, (v, sd) in s.hand.items())
                (folder / f"{s.deck.name}.hand.toml").write_text("\n".join(rows_))
            texts.append(s.text())
        texts += ["[joint]"] if self.joint else []
        path = folder / "campaign.toml"
        path.write_text("\n\n".join(texts))
        return path
