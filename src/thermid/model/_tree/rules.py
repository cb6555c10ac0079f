"""Checks of a model: one small function per rule.

Rules see the tree laid flat. They say what to do, and change nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from thermid.base.errors import CodedText, ThermidError, code_of, quoted
from thermid.base.units import AMBIENT_DEFAULT, HOUR, value_of
from thermid.model._parts.controls import named_control
from thermid.model._parts.elements import CARRIED_BY, exposed_area
from thermid.model._tree.flat import Flat, FlatConductor, FlatLoad, FlatNode
from thermid.model._tree.identity import APART, cuts_of, local_identities
from thermid.model._tree.tree import Tree

Severity = Literal["error", "warning", "note"]
SEVERITIES: Final = ("error", "warning", "note")
SINGLY: Final = 2
"""Up to so many values of one kind are remarked upon one by one."""
OUTLIER_FACTOR: Final = 20.0
"""Factor by which a value is far from the median of its peers. [-]"""
PEERS: Final = 5
"""So many values of one field show what is usual."""
READINGS: Final = ("psi_JT", "psi_JB")
"""Values that only tables of results use: what a reading of a package's top or board adds to its temperature per watt."""


@dataclass(frozen=True)
class Finding:
    """One remark.

    Parameters
    ----------
    severity : str      error: the model cannot be simulated; warning: it probably is not what was meant; note: good to know.
    where : str         File, line and key path.
    message : str       What was found and what to do.
    code : str          Code of the cause, see `thermid.base.errors`.
    """

    severity: Severity
    where: str
    message: str
    code: str

    def __str__(self) -> str:
        """`severity: where: message`."""
        return f"{self.severity}: {self.where}: {self.message}"


@dataclass(frozen=True, eq=False)
class _View:
    """A model with its values and conductances computed once, for all rules.

    Parameters
    ----------
    model : Tree           The tree.
    flat : Flat             The tree laid flat.
    values : dict           Path -> value. [SI]
    conductances : dict     Conductor -> the leading coefficient of its law, zero for no heat, not a number where a value of it is
                            impossible; without those that have no law.
    refused : tuple         What their laws say of the others.
    impossible : dict       Path of a value that physics forbids -> what is said of it.
    named : frozenset       Parameters that something outside the tree uses.
    """

    model: Tree
    flat: Flat
    values: Mapping[str, Any]
    conductances: Mapping[str, float]
    refused: tuple[Finding, ...]
    impossible: Mapping[str, Finding]
    named: frozenset[str] = frozenset()

    def grounded(self) -> set[str]:
        """Return the nodes from which heat can reach a boundary; a flow reaches only downstream."""
        reached = set(self.flat.names.boundaries)
        todo = list(reached)
        while todo:
            here = todo.pop()
            for c in self._conducting():
                new = [b for a, b in (c.ends, c.ends[::-1]) if a == here and b not in reached and (c.kind != "flow" or a == c.ends[0])]
                reached.update(new)
                todo += new
        return reached

    def islands(self) -> list[list[FlatNode]]:
        """Return the groups of joined nodes from which heat can reach no boundary."""
        grounded = self.grounded()
        waiting = {n.path: n for n in self.flat.nodes if n.path not in grounded}
        out = []
        while waiting:
            group = [waiting.pop(next(iter(waiting)))]
            for node in group:
                near = {e for c in self._conducting() if node.path in c.ends for e in c.ends}
                group += [waiting.pop(path) for path in list(waiting) if path in near]
            out.append(group)
        return out

    def capacitance(self, node: FlatNode) -> float:
        """Return m c or C, zero for a massless node. [J/K]"""
        return float(node.capacitance(self.values) or 0.0)

    def power(self, load: FlatLoad) -> float:
        """Return the heat that a load gives, averaged over its cycle; a controlled heater at full power. [W]"""
        f = {name: self.values[path] for name, path in load.fields.items()}
        if load.curve is not None:
            return float(f.get("scale", 1.0) * load.curve.evaluate(np.array([AMBIENT_DEFAULT]))[0])
        cycle = load.cycle.mean_over(0.0, load.cycle.cycle or 1.0) if load.cycle is not None else 1.0
        return float(f["power"] * f.get("periodic.duty", 1.0) * cycle)

    def _conducting(self) -> list[FlatConductor]:
        """Return the conductors whose conductance is not zero."""
        return [c for c in self.flat.conductors if self.conductances.get(c.path, 0.0) != 0.0]


def _refused(error: ThermidError, where: str) -> Finding:
    """Return the finding that the model cannot be run for this error."""
    return Finding("error", where, error.message, error.code or "model.refused")


def _view(model: Tree, assigned: Mapping[str, float] | None = None) -> _View:
    """Return the view of a model with its own values, or with `assigned` (path -> SI) in their place."""
    flat = Flat.of_model(model)
    values = flat.parameters.evaluate(assigned or {})
    impossible = {
        path: Finding("error", where, message, "value.outside-range") for path, where, message in flat.impossible(values, flat.ranges)
    }
    conductances: dict[str, float] = {}
    refused = []
    for c in flat.conductors:
        fields = {name: values[path] for name, path in c.fields.items()}
        if set(impossible) & set(c.fields.values()):
            conductances[c.path] = np.nan
            continue
        try:
            fields |= {"area": exposed_area(c.path, fields["area"], c.takes, values)} if c.takes else {}
            conductances[c.path] = min((value_of(law.coefficients[0]) for law in c.laws(fields)), key=lambda g: (g >= 0.0, -g))
        except ThermidError as error:
            refused.append(_refused(error, c.where))
    return _View(model, flat, values, conductances, tuple(refused), impossible)


def _laws(view: _View) -> Iterator[Finding]:
    """Yield an error for each conductor whose law refuses its values, joints that take too much area among them, or is negative."""
    yield from view.refused
    yield from (
        Finding(
            "error",
            c.where,
            f"'{c.path}' has a negative conductance; heat would flow from cold to hot. Check signs and areas.",
            "model.negative-conductance",
        )
        for c in view.flat.conductors
        if view.conductances.get(c.path, 0.0) < 0.0
    )


def _impossible(view: _View) -> Iterator[Finding]:
    """Yield an error for each value that physics forbids; of several fields with one number behind them, the first."""
    places: dict[str, Finding] = {}
    for finding in view.impossible.values():
        places.setdefault(finding.where, finding)
    yield from places.values()


def _capacitances(view: _View) -> Iterator[Finding]:
    """Yield an error for each node whose mass or capacitance gives no capacitance above zero and finite."""
    yield from (
        Finding(
            "error",
            node.where,
            f"the capacitance of '{node.path}' must be above zero and finite. For a massless node leave mass and capacitance out.",
            "model.capacitance-not-positive",
        )
        for node in view.flat.nodes
        if node.fields and not set(view.impossible) & set(node.fields.values()) and not 0.0 < view.capacitance(node) < float("inf")
    )


def _attached(view: _View) -> Iterator[Finding]:
    """Yield a warning for each node with a mass, and each need, that nothing is attached to."""
    used = {end for c in view.flat.conductors for end in c.ends} | {end for x in view.flat.loads for end in (x.node, x.sensor)}
    yield from (
        Finding(
            "warning",
            node.where,
            f"node '{node.path}' has no connections, so its temperature never changes. Connect it or remove it.",
            "model.unconnected",
        )
        for node in view.flat.nodes
        if node.path not in used and node.fields
    )
    yield from (
        Finding(
            "warning",
            view.model.where("needs"),
            f"the need '{need}' has no connections. Connect it or remove it.",
            "model.unconnected",
        )
        for need in view.flat.names.boundaries
        if need not in used
    )


def _missing(view: _View) -> Iterator[Finding]:
    """Yield a warning for each thing of the hardware that the model or a part lacks."""
    yield from (
        Finding(
            "warning",
            view.model.where("incomplete"),
            f"incomplete: {what}. Results state this, with exit code 5. Add what is missing and remove 'incomplete'.",
            "model.incomplete",
        )
        for what in view.model.missing_parts()
    )


def _massless(view: _View) -> Iterator[Finding]:
    """Yield an error for each group of massless nodes that reaches no temperature."""
    yield from (
        Finding(
            "error",
            group[0].where,
            f"the massless node{'' if len(group) == 1 else 's'} {quoted([n.path for n in group])} {_has(group)} no conductance to a node "
            "with a temperature. Add a conductor, or a mass.",
            "model.massless-undefined",
        )
        for group in view.islands()
        if all(not node.fields for node in group)
    )


def _paths(view: _View) -> Iterator[Finding]:
    """Yield a warning for each group of nodes with no path to a boundary, and how fast it warms: sum of loads / capacitance."""
    used = {end for c in view.flat.conductors for end in c.ends} | {x.node for x in view.flat.loads}
    for group in view.islands():
        capacitance = sum(view.capacitance(n) for n in group)
        if not capacitance > 0.0 or not any(n.path in used for n in group):
            continue
        paths = [n.path for n in group]
        loads = [x for x in view.flat.loads if x.node in paths]
        rate = HOUR * sum(view.power(x) for x in loads) / capacitance
        constant = all(x.curve is None and x.cycle is None and set(x.fields) == {"power"} for x in loads)
        word, about = ("warms" if rate > 0 else "cools", "" if constant else "about ")
        still = ", so heat is never removed. Connect a boundary if that is not intended."
        course = f": {word} at {about}{abs(rate):.6g} K/h without limit. Connect it to a boundary." if rate else still
        message = f"{quoted(paths)} {_has(group)} no path to a boundary{course}"
        yield Finding("warning", group[0].where, message, "model.no-path-to-boundary")


def _loads(view: _View) -> Iterator[Finding]:
    """Yield a warning for each load whose heat cannot leave, or that heats a boundary."""
    outside = {n.path for group in view.islands() for n in group}
    yield from (
        Finding(
            "warning",
            load.where,
            f"'{load.path}' heats '{load.node}', from which no heat can leave. Add a conductor.",
            "model.heat-cannot-leave",
        )
        for load in view.flat.loads
        if load.node in outside
    )
    yield from (
        Finding(
            "warning",
            load.where,
            f"'{load.path}' heats '{load.node}', whose temperature is given, so the load has no "
            "effect. Remove it, or give the node a mass.",
            "model.load-without-effect",
        )
        for load in view.flat.loads
        if load.node in view.flat.names.boundaries
    )


def _shadowed(view: _View) -> Iterator[Finding]:
    """Yield a note for each value that hides another of a deck; an element that is written where it is used hides nothing."""
    made_parts = tuple(f"{prefix}{name}." for owner, prefix in view.model.walk() for name, part in owner.submodels.items() if part.made)
    groups: dict[tuple[str, str, str], list[str]] = {}
    table = view.flat.parameters.table
    for path, entry in table.items():
        if entry.shadowed and not (path.startswith(made_parts) and len(entry.shadowed) == 1):
            hidden = ", ".join(f"{text} of {origin}" for origin, text in reversed(entry.shadowed))
            groups.setdefault((entry.origin, hidden, path.rpartition(".")[2]), []).append(path)
    for (origin, hidden, _), paths in groups.items():
        several = (f"{quoted(paths)} are set by {origin}; they override {hidden}.", paths[0])
        singly = [(f"'{p}' is {table[p].parameter.text}, set by {origin}; it overrides {hidden}.", p) for p in paths]
        messages = singly if len(paths) <= SINGLY else [several]
        yield from (Finding("note", table[path].where, message, "model.value-overridden") for message, path in messages)


def _ties(view: _View) -> Iterator[Finding]:
    """Yield a note for values that several instances share, that differ in one of them, or that are cut."""
    literals = {path for path, entry in view.flat.parameters.table.items() if entry.parameter.is_literal}
    identities = {one.paths: one for path, one in local_identities(view.model).items() if path in literals}
    shared: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    where = view.model.where("")
    apart: dict[str, list[str]] = {}
    for paths, one in identities.items():
        if one.why == APART:
            apart.setdefault(_ending(tuple(p.partition(".")[2] for p in paths)), []).extend(paths)
        elif len(paths) > 1:
            field = _ending(paths)
            places = tuple(p.removesuffix(field).rstrip(".") for p in paths)
            shared.setdefault((one.why, places), []).append(field.lstrip("."))
    several = [f"{quoted(p)} are set for each of these instances; the other instances have other values." for p in apart.values()]
    singly = [[f"'{p}' is set for this instance; the other instances have another value." for p in paths] for paths in apart.values()]
    differing = [
        m
        for one_by_one, all_in_one in zip(singly, several, strict=True)
        for m in (one_by_one if len(one_by_one) <= SINGLY else [all_in_one])
    ]
    yield from (Finding("note", where, message, "model.instance-differs") for message in differing)
    for (why, places), fields in shared.items():
        values = "one value" if len(fields) == 1 else f"each of {len(fields)} values"
        yield Finding(
            "note",
            where,
            f"{quoted(list(places))} share {values}, {why}: {quoted(fields)}. A fit changes all instances together.",
            "model.values-shared",
        )
    yield from (
        Finding(
            "note",
            where,
            f"'{place}' is cut from the other instances of its deck: a fit estimates its values separately.",
            "model.instance-differs",
        )
        for place in cuts_of(view.model)
    )


def _ending(paths: tuple[str, ...]) -> str:
    """Return the steps at the end that all paths have in common."""
    steps = [p.split(".")[::-1] for p in paths]
    count = next((n for n, row in enumerate(zip(*steps, strict=False)) if len(set(row)) > 1), min(map(len, steps)))
    return ".".join(steps[0][:count][::-1])


def _unused(view: _View) -> Iterator[Finding]:
    """Yield a warning for each declared parameter and each control that nothing uses.

    A parameter is used where an element reaches it through any chain of expressions, as the deck has them or with values laid over.
    Pressures of fans and the `READINGS` are used without being needed.
    """
    table = view.flat.parameters.table
    needs = {path: {entry.scope + name for name in entry.parameter.expression.names} for path, entry in table.items()}
    declared: dict[str, str] = {}
    for owner, prefix in view.model.walk():
        for name, _, parameter in owner.own_parameters():
            needs[prefix + name] |= {prefix + other for other in parameter.expression.names}
        declared |= {prefix + name: owner.where(f"parameters.{name}") for name in owner.parameters}
    used: set[str] = set()
    todo = [path for path in table if path not in declared or path in view.named]
    while todo:
        new = needs[todo.pop()] - used
        used |= new
        todo += new
    read = {f"{prefix}{name}.pressure" for owner, prefix in view.model.walk() for name, s in owner.submodels.items() if s.made == "fans"}
    used |= view.named | read
    yield from (
        Finding("warning", where, f"the parameter '{path}' is declared but nothing uses it.", "model.unused")
        for path, where in declared.items()
        if path not in used and path.rpartition(".")[2] not in READINGS
    )
    elements = [*(c.controls for c in view.flat.conductors), *(load.controls for load in view.flat.loads)]
    named = {named_control(name)[0] for several in elements for name in several}
    yield from (
        Finding("warning", control.where, f"the control '{path}' is declared but nothing names it.", "model.unused")
        for path, control in view.flat.controls.items()
        if path not in named
    )


def _exponents(view: _View) -> Iterator[Finding]:
    """Yield a warning for each exponent of natural convection above 1."""
    yield from (
        Finding(
            "warning",
            view.flat.parameters.table[path].where,
            f"an exponent of {view.values[path]:g} is unusual: natural convection has 1/4 or 1/3. Check it.",
            "model.value-unusual",
        )
        for c in view.flat.conductors
        if (path := c.fields.get("htc.exponent", "")) and view.values[path] > 1.0
    )


LUMPED: Final = 0.1
"""Biot number from which the inside of a body is not at one temperature (Incropera, 6th ed., section 5.1). [-]"""


def _lumping(view: _View) -> dict[str, float]:
    """Return node -> Biot number: its films over the conduction inside it, of which the deck gives conductivity, area and thickness. [-]

    For one path of thickness L under a film h on the same area it is h L/k; for a bar with a film along its side, (m L)^2 of a fin.
    A film with a power of the temperature difference counts at 10 K.
    """
    films: dict[str, float] = {}
    inside: dict[str, float] = {}
    for c in view.flat.conductors:
        size = view.conductances.get(c.path, 0.0)
        if not 0.0 < size < math.inf:
            continue
        solid = c.kind == "conduction" and {"conductivity", "area", "thickness"} <= set(c.fields)
        film = c.kind in ("convection", "effective")
        if film and "htc.exponent" in c.fields:
            size *= RISE ** float(view.values[c.fields["htc.exponent"]])
        for end in c.ends if solid or film else ():
            into = inside if solid else films
            into[end] = into.get(end, 0.0) + size
    bodies = {n.path for n in view.flat.nodes if view.capacitance(n) > 0.0}
    return {n: films[n] / g for n, g in inside.items() if n in films and n in bodies}


RISE: Final = 10.0
"""Difference at which a film with a power of it counts. [K]"""


def _unlumped(view: _View) -> Iterator[Finding]:
    """Yield a note for each node whose inside is not at one temperature, by its Biot number, and into how many it should be split.

    Of n pieces of a body each has 1/n^2 of its Biot number.
    """
    yield from (
        Finding(
            "note",
            next(n.where for n in view.flat.nodes if n.path == node),
            f"the Biot number of '{node}' is {biot:.2g}, above {LUMPED:g}: films carry {biot:.2g} times as much heat per kelvin as the "
            "conduction inside it, so it is not at one temperature. Split it along that conduction into "
            f"{max(2, math.ceil(math.sqrt(biot / LUMPED)))} nodes or more.",
            "physics.not-one-temperature",
        )
        for node, biot in _lumping(view).items()
        if biot > LUMPED
    )


def unlumped(model: Tree, values: Mapping[str, float]) -> tuple[CodedText, ...]:
    """Return a message for each node whose inside is not at one temperature at given values, and what to split.

    Parameters
    ----------
    model : Tree
    values : dict   Path -> value, of a fit for instance. [SI]
    """
    return tuple(CodedText(f.message, f.code) for f in _unlumped(_view(model, values)))


def _outliers(view: _View) -> Iterator[Finding]:
    """Yield a warning for a value more than `OUTLIER_FACTOR` from the median of at least `PEERS` others of its field."""
    table = view.flat.parameters.table
    kinds = {c.path: c.kind for c in view.flat.conductors}
    peers: dict[tuple[str, str], list[str]] = {}
    for path, entry in table.items():
        owner, _, field = path.rpartition(".")
        if entry.parameter.is_literal and 0.0 < view.values[path] < float("inf"):
            of = path.partition(".")[2] if path.partition(".")[0] in view.model.submodels else kinds.get(owner, "")
            peers.setdefault((of, field), []).append(path)
    for (of, _), paths in peers.items():
        if not of or len(paths) < PEERS:
            continue
        logs = np.log([view.values[p] for p in paths])
        off = np.abs(logs - np.median(logs))
        k = int(np.argmax(off))
        others = sorted((value, path) for n, (value, path) in enumerate(zip(logs.tolist(), paths, strict=True)) if n != k)
        spread = max(abs(value - float(np.median(logs))) for value, _ in others)
        if off[k] > np.log(OUTLIER_FACTOR) and off[k] > 2.0 * spread:
            entry, (low, high) = table[paths[k]], (table[others[n][1]].parameter.text for n in (0, -1))
            observation = f"'{paths[k]}' is {entry.parameter.text}, and {len(others)} others of its field are {low} to {high}"
            yield Finding("warning", entry.where, f"{observation}. Check its unit and digits.", "model.value-far-from-others")


def _ranges(view: _View) -> Iterator[Finding]:
    """Yield a warning for each spreading resistance outside the range of its formula.

    That is where a source is above a quarter of its plate [m^2], or the plate thinner than 0.1 sqrt(a / pi), a its area.
    """
    for c in view.flat.conductors:
        if c.kind == "spreading":
            source, plate, thickness = (view.values[c.fields[f]] for f in ("source_area", "plate_area", "thickness"))
            if source > 0.25 * plate or thickness < 0.1 * (plate / np.pi) ** 0.5:
                what = "the source is above a quarter of its plate, or the plate thinner than a tenth of its radius"
                yield Finding(
                    "warning",
                    c.where,
                    f"'{c.path}': {what}. There the formula is wrong by up to 30 %. Model the plate with several nodes.",
                    "physics.outside-range",
                )


def _test_only(view: _View) -> Iterator[Finding]:
    """Yield a note of the elements marked test_only, and a warning where the model fails without them."""
    marked = [prefix + name for owner, prefix in view.model.walk() for _, name, element in owner.elements() if element.test_only]
    if marked:
        count = "one element is" if len(marked) == 1 else f"{len(marked)} elements are"
        yield Finding(
            "note", view.model.where(""), f"{count} marked test_only: {quoted(marked)}. Flight models leave them out.", "model.test-only"
        )
        try:
            Flat.of_model(view.model.without_test_only())
        except ThermidError as error:
            yield Finding(
                "warning",
                error.where,
                f"without the elements marked test_only the model fails: {error.message} Mark the elements "
                "that depend on them test_only too.",
                "model.test-only-needed",
            )


def _radiating(view: _View) -> Iterator[Finding]:
    """Yield an error for each gas node that something radiates into."""
    yield from (Finding("error", where, message, code_of(message)) for where, message in view.flat.radiation_into_gas(view.values))


def _streams(view: _View) -> Iterator[Finding]:
    """Yield an error for each node whose streams do not balance, a warning for each stream that leaves a node nothing enters."""
    yield from (Finding("error", where, message, code_of(message)) for where, message in view.flat.unbalanced_streams(view.values))
    places = {c.path: c.where for c in view.flat.conductors}
    yield from (Finding("warning", places[path], message, code_of(message)) for path, message in view.flat.unfed_streams.items())


def _unsaid(view: _View) -> Iterator[Finding]:
    """Yield findings for surfaces and leads without htc or emissivity: a run with gas, or in vacuum, will be refused."""
    place = {path: face.where for path, face in view.flat.faces.items()} | {c.path: c.where for c in view.flat.conductors}
    quiet = list(view.flat.without_convection)
    if quiet:
        yield Finding(
            "warning",
            place[quiet[0]],
            f"{quoted(quiet)} {'has' if len(quiet) == 1 else 'have'} an emissivity but no htc, so every run with gas will be refused. "
            "Give htc, or htc = 0 if no convection is intended.",
            "model.no-convection",
        )
    yield from (
        Finding(
            "note",
            c.where,
            f"the coefficient of '{c.path}' includes radiation, but no emissivity is given, so a vacuum run will be refused. Give "
            "htc and emissivity instead; `td.inference.split` estimates them.",
            "model.radiation-not-split",
        )
        for c in view.flat.conductors
        if c.kind == "effective" and not c.emissivity
    )
    alone = list(view.flat.without_emissivity)
    if alone:
        yield Finding(
            "note",
            place.get(alone[0], place.get(f"{alone[0]}.first", view.model.title)),
            f"{quoted(alone)} {'has' if len(alone) == 1 else 'have'} htc but no emissivity, so a vacuum run will be refused. Give an "
            "emissivity or a finish.",
            "model.no-emissivity",
        )


def _carried(view: _View) -> Iterator[Finding]:
    """Yield a note where constant coefficients without carried_by carry more than half of the heat that leaves the model."""
    around = set(view.flat.names.boundaries)
    leaving = {c.path: c for c in view._conducting() if around & {*c.ends} and not around >= {*c.ends}}
    # radiation is made linear at room temperature, a law with an exponent stands as at 1 K
    size = {p: view.conductances[p] * (4.0 * AMBIENT_DEFAULT**3 if c.kind == "radiation" else 1.0) for p, c in leaving.items()}
    constant = [p for p, c in leaving.items() if c.kind == "effective" or (c.kind == "convection" and "htc" in c.fields)]
    unsaid = [p for p in constant if CARRIED_BY not in leaving[p].words]
    if unsaid and sum(size[p] for p in unsaid) > 0.5 * sum(size.values()):
        yield Finding(
            "note",
            leaving[unsaid[0]].where,
            f"{quoted(unsaid)} {'has' if len(unsaid) == 1 else 'have'} a constant coefficient, and most of the heat leaves there. "
            "State what carries it: carried_by = 'free air', 'fan', 'cold plate' or 'leads'. Otherwise bands hold free air and constant.",
            "model.carrier-unstated",
        )


def _sources(view: _View) -> Iterator[Finding]:
    """Yield a note of the values without a source, where others have one."""
    literals = {path: entry.parameter for path, entry in view.flat.parameters.table.items() if entry.parameter.is_literal}
    bare = [path for path, parameter in literals.items() if not parameter.source]
    if bare and len(bare) < len(literals):
        yield Finding(
            "note",
            view.model.where(""),
            f"{len(bare)} of {len(literals)} values have no source: {quoted(bare)}.",
            "model.values-without-source",
        )


Rule = Callable[[_View], Iterator[Finding]]
RULES: Final[tuple[Rule, ...]] = (
    _missing,
    _impossible,
    _laws,
    _radiating,
    _streams,
    _capacitances,
    _massless,
    _attached,
    _paths,
    _loads,
    _unlumped,
    _outliers,
    _unused,
    _exponents,
    _ranges,
    _shadowed,
    _ties,
    _test_only,
    _unsaid,
    _carried,
    _sources,
)


def findings(model: Tree, named: Collection[str] = ()) -> tuple[Finding, ...]:
    """Return the findings of all checks, errors first; one error alone when the tree cannot be laid flat.

    Parameters
    ----------
    named : collection of str   Parameters that something outside the tree uses.
    """
    try:
        view = replace(_view(model), named=frozenset(named))
    except ThermidError as error:
        return (_refused(error, error.where or model.title),)
    unique = dict.fromkeys(finding for rule in RULES for finding in rule(view))
    return tuple(sorted(unique, key=lambda f: SEVERITIES.index(f.severity)))


def _has(group: list[FlatNode]) -> str:
    """Return the verb for one node or several."""
    return "has" if len(group) == 1 else "have"
