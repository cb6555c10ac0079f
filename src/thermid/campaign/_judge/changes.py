"""Two versions of a model: parts, connections, values and totals that differ, each with what it does to steady temperatures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from math import inf, isclose
from typing import Any, Final

import numpy as np

from thermid.base.errors import SolverError
from thermid.base.results import Result
from thermid.base.units import si_unit, value_of
from thermid.model.tree import Model, ParameterSet, identities
from thermid.simulation.runs import Numbers, Scenario, compile_network, steady

MAX_DIFFERENCE_OF_EQUALS: Final = 1e-9
"""Relative difference below which two numbers are one number written twice."""
_WORDS: Final = frozenset({"source", "note", "basis", "where", "title", "text", "standing", "fields"})
"""Fields of an element that say where it comes from, or whose values are compared by path."""


@dataclass(frozen=True)
class Change:
    """One difference.

    Parameters
    ----------
    path : str          Element or value.
    what : str          In words: the old and the new.
    effect : float      Largest change of a steady temperature by this difference alone; nan where it cannot be made alone. [K]
    node : str          Where.
    """

    path: str
    what: str
    effect: float = float("nan")
    node: str = ""

    def __str__(self) -> str:
        """Return it in one line."""
        alone = "" if np.isnan(self.effect) else f": {self.effect:.3g} K at {self.node}" if self.node else ": no effect"
        return f"{self.path}: {self.what}{alone}"


@dataclass(frozen=True)
class Changes(Result):
    """What differs between two versions of a model.

    Parameters
    ----------
    old, new : str          Titles.
    changes : tuple         Those that cannot be made alone first, then the largest effect first.
    totals : dict           Capacitance [J/K], area [m^2] and power [W] -> of the old and of the new.
    temperatures : dict     Scenario -> node -> new less old, at steady state, by all together. [K]
    assumed : str           What stands for scenarios where none was given.
    """

    old: str
    new: str
    changes: tuple[Change, ...]
    totals: Mapping[str, tuple[float, float]]
    temperatures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    assumed: str = ""

    def __str__(self) -> str:
        """Return it as text, a line a difference."""
        count = f"{len(self.changes)} difference{'' if len(self.changes) == 1 else 's'}"
        lines = [f"{self.old} -> {self.new}: {count if self.changes else 'no difference'}"]
        lines += [f"  {self.assumed}"] if self.assumed else []
        lines += [f"  {change}" for change in self.changes]
        units = {"capacitance": "J/K", "area": "m^2", "power": "W"}
        lines += [
            f"  total {what}: {a:.6g} -> {b:.6g} {units[what]}"
            for what, (a, b) in self.totals.items()
            if not isclose(a, b, rel_tol=MAX_DIFFERENCE_OF_EQUALS)
        ]
        for title, apart in self.temperatures.items():
            node = max(apart, key=lambda n: abs(apart[n]), default="")
            steady_state = f"{apart[node]:+.3f} K at {node}" if node else "not compared, because one version has no steady state"
            lines += [f"  {title}, steady: {steady_state}"] if self.changes or not node else []
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Return it for a file."""
        rows = [asdict(change) | {"effect": change.effect if np.isfinite(change.effect) else None} for change in self.changes]
        totals = {what: list(pair) for what, pair in self.totals.items()}
        return {"changes": rows, "totals": totals, "steady_K": {s: dict(apart) for s, apart in self.temperatures.items()}}

    def _as_rows(self) -> list[Mapping[str, object]]:
        """Return every change with its path and its effect on the node that it moves most. [K]"""
        return [{"path": change.path, "what": change.what, "effect [K]": change.effect, "node": change.node} for change in self.changes]


def compare_models(old: Model, new: Model, scenarios: Scenario | Sequence[Scenario] = ()) -> Changes:
    """Return what differs between two versions of a model, whatever units, order or arithmetic their decks are written in.

    Parameters
    ----------
    old, new : Model        The versions.
    scenarios : sequence    What their steady states are compared in; every boundary at 20 degC and the loads of the deck without any.

    Raises
    ------
    ScenarioError   When a scenario does not fit a version.
    """
    common = "every boundary at 20 degC, loads as in the deck: no scenario was given"
    at_twenty = Scenario("20 degC", boundaries=dict.fromkeys(sorted({*old.needs, *new.needs}), "20 [degC]"))
    conditions = (scenarios,) if isinstance(scenarios, Scenario) else tuple(scenarios) or (at_twenty,)
    before, after = ([_temperatures(model, scenario) for scenario in conditions] for model in (old, new))
    moved, changes = _values(old, new, conditions, before)
    changes = [*_elements_that_differ(moved, new), *changes]
    apart = {s.title: {n: b[n] - a[n] for n in a if n in b} for s, a, b in zip(conditions, before, after, strict=True)}
    ranked = sorted(changes, key=lambda c: -inf if np.isnan(c.effect) else -c.effect)
    totals = {what: (a, b) for (what, a), b in zip(_totals(old).items(), _totals(new).values(), strict=True)}
    return Changes(old.title, new.title, tuple(ranked), totals, apart, "" if scenarios else common)


def _temperatures(model: Model, scenario: Scenario) -> dict[str, float]:
    """Return the steady temperatures of a model under the inputs of a scenario that it has; none where it has no steady state. [K]"""
    needed = {name: value for name, value in scenario.boundaries.items() if name in model.needs}
    try:
        return dict(steady(model, replace(scenario, boundaries=needed)))
    except SolverError:
        return {}


def _elements(model: Model) -> dict[tuple[str, str], Any]:
    """Return (group, path) -> element, of every part; boundaries, without an element, as well."""
    elements = {(group, prefix + name): element for part, prefix in model.walk() for group, name, element in part.elements()}
    return {("boundary", name): None for name in model.needs} | elements


def _values(old: Model, new: Model, scenarios: Sequence[Scenario], before: Sequence[Mapping[str, float]]) -> tuple[Model, list[Change]]:
    """Return the old model with every value of the new that it has, and the changed values with their effects.

    Plain numbers come first; what still differs after them is arithmetic that changed, or a number in its place.
    """
    target = ParameterSet(new)
    wanted = target.evaluate({})
    moved, changes = old, list[Change]()
    one = identities(old)
    for plain in (True, False):
        values = ParameterSet(moved)
        now = values.evaluate({})
        for path in [p for p in now if p in wanted]:
            first = one[path].paths[0] if path in one else path  # a deck that is used twice writes it once, unless a use sets its own
            twin = path != first and _mean_the_same(wanted[path], wanted.get(first, wanted[path]))
            if twin or _mean_the_same(now[path], wanted[path]) or (plain and values.table[path].parameter.expression.names):
                continue
            unit = si_unit(values.dimension(path))
            number = {path: f"{float(wanted[path])!r} [{unit}]"}
            after = [_temperatures(old.with_values(number), scenario) for scenario in scenarios]
            apart = [(abs(b[n] - a[n]), n) for a, b in zip(before, after, strict=True) for n in a if n in b]
            largest, node = max(apart, default=(float("nan"), ""))  # change of a steady temperature by this value alone [K]
            text = f"{now[path]:.6g} -> {wanted[path]:.6g} {unit}".removesuffix(" 1")
            changes.append(Change(path, text, largest, node if largest != 0.0 else ""))
            moved = moved.with_values(number)
    here = ParameterSet(old).table
    for path in sorted(here.keys() & target.table.keys()):
        a, b = here[path].parameter, target.table[path].parameter
        (low, high), (least, most) = ((p.minimum, p.maximum) for p in (a, b))
        if not _mean_the_same((low, high), (least, most)):
            changes.append(Change(path, f"bounds {low} .. {high} -> {least} .. {most}", 0.0))
        if str(a.stated_range) != str(b.stated_range) and (a.spread != b.spread or None in (a.stated_range, b.stated_range)):
            changes.append(Change(path, f"stated range {a.stated_range} -> {b.stated_range}", 0.0))
    return moved, changes


def _elements_that_differ(moved: Model, new: Model) -> Iterator[Change]:
    """Yield a change for each boundary and element of any part that one model alone has, by name, then for those that still differ.

    Still, with the common values of `moved` equal to those of `new`: in ends, laws, tables, courses or controls.
    """
    a, b = _elements(moved), _elements(new)
    for one, other, word in ((a, b, "only in the old"), (b, a, "only in the new")):
        yield from (Change(path, f"{group.removesuffix('s')} {word}") for group, path in sorted(one.keys() - other.keys()))
    rows, others = (_rows(compile_network(model).numbers()) for model in (moved, new))
    for key in sorted(a.keys() & b.keys()):
        group, path = key
        names = {*a[key].fields, *b[key].fields} if hasattr(a[key], "fields") else set()
        shared = names == {*getattr(a[key], "fields", ())} == {*getattr(b[key], "fields", ())}
        where = _apart(a[key], b[key])
        if shared and not where:
            continue
        if group in ("nodes", "conductors") and where in ("", "kind") and _mean_the_same(rows.get(path), others.get(path)):
            continue  # the same capacitance or law by other fields
        yield Change(path, f"{where or 'fields'} differ" if where else f"{sorted({*a[key].fields})} -> {sorted({*b[key].fields})}")
    if _apart(moved.made_in, new.made_in):
        yield Change("made_in", "fill of the volumes differs")


def _rows(numbers: Numbers) -> dict[str, Any]:
    """Return element -> its capacitance, or the rows of its law."""
    rows: dict[str, Any] = dict(numbers.capacitances)
    for row in numbers.conductors:
        rows.setdefault(row.name, []).append((sorted(row.ends), row.law, row.curve))  # a direction is the element's own
    return rows


def _apart(a: Any, b: Any) -> str:
    """Return the first field in which two elements differ; empty for none."""
    if not is_dataclass(a):
        return "" if _mean_the_same(a, b) else "content"
    one_way = getattr(a, "kind", "") in ("flow", "stream")
    for attribute in fields(a):
        x, y = getattr(a, attribute.name), getattr(b, attribute.name, None)
        if attribute.name == "between" and not one_way:
            x, y = sorted(x), sorted(y or ())
        if attribute.name not in _WORDS and not _mean_the_same(x, y):
            return attribute.name
    return ""


def _mean_the_same(a: Any, b: Any) -> bool:
    """Return whether two values mean the same: numbers within `MAX_DIFFERENCE_OF_EQUALS`, and whatever holds them."""
    if isinstance(a, int | float) and isinstance(b, int | float):
        return isclose(a, b, rel_tol=MAX_DIFFERENCE_OF_EQUALS)
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.shape == b.shape and bool(np.allclose(a, b, rtol=MAX_DIFFERENCE_OF_EQUALS, atol=0.0))
    if is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and not _apart(a, b)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_mean_the_same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(_mean_the_same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)


def _totals(model: Model) -> dict[str, float]:
    """Return the capacitance [J/K], area [m^2] and power [W] of a model."""
    values = ParameterSet(model).evaluate({})
    capacitances = compile_network(model).numbers().capacitances.values()
    paths = {what: [p for p in values if p.rpartition(".")[2] == what and "." in p] for what in ("area", "power")}
    stored = sum(float(value_of(c)) for c in capacitances if c is not None)
    return {"capacitance": stored} | {what: sum(float(values[p]) for p in there) for what, there in paths.items()}
