"""The tree of a model: its elements and parts, the node that each name stands for, and the value that holds for each path."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, Self, TypeVar

from thermid.base.errors import DeckError, ExpressionError, NameNotFoundError, errors_at, nearest, quoted, refuse_unknown
from thermid.base.files import Places
from thermid.base.units import Dimension, Memo
from thermid.model._laws.stores import Curve
from thermid.model._parts.controls import Control, named_control
from thermid.model._parts.elements import KINDS, Conductor, Enclosure, HeatLoad, Joint, MadeIn, Node, Surface
from thermid.model._parts.parameter import LEAST_EMISSIVITY, SHARES, UNJUDGED, Parameter, Standing, StatedRange, check_bounds

Element = Node | Conductor | Surface | Joint | Enclosure | HeatLoad | Control
TABLES = ("nodes", "surfaces", "conductors", "joints", "enclosures", "loads", "controls")
SET = "[set] of "
MAX_LISTED_NAMES = 12
"""Up to so many names are listed where none is near."""
M = TypeVar("M", bound="Tree")
Part = TypeVar("Part", bound="Tree", covariant=True)


@dataclass(frozen=True)
class Submodel(Generic[Part]):
    """A model used inside another, with the nodes that its needs are bound to.

    Parameters
    ----------
    model : Model       The part.
    bind : dict         Need of the part -> path of a node of the user.
    definition : str    Hash of its deck as it was read, see `identity.definition_of`; instances of one definition share their values.
    sees : dict         Need -> path of the node that the part's surfaces see there, where that is not the one it is bound to.
    made : str          Group of the deck whose element this part is, such as `packages`; empty for a deck of its own.
    """

    model: Part
    bind: Mapping[str, str] = field(default_factory=dict)
    definition: str = ""
    sees: Mapping[str, str] = field(default_factory=dict)
    made: str = field(default="", compare=False)

    def with_model(self, model: M) -> Submodel[M]:
        """Return the same part in another state."""
        return Submodel(model, self.bind, self.definition, self.sees, self.made)

    def bound(self) -> dict[str, str | dict[str, str]]:
        """Return the bindings as a deck writes them."""
        return {need: {"to": to, "sees": self.sees[need]} if need in self.sees else to for need, to in self.bind.items()}


@dataclass(frozen=True)
class Layer:
    """Values laid over a model: what a stage fitted, or what a caller set.

    Parameters
    ----------
    origin : str        Who set them: a stage, the command line, a caller.
    values : dict       Path -> Parameter.
    ties : tuple        Groups of its paths that one fitted value stands for.
    """

    origin: str
    values: Mapping[str, Parameter]
    ties: tuple[tuple[str, ...], ...] = ()

    def keeping(self, stays: Callable[[str, Parameter], bool]) -> Layer:
        """Return the layer with only the values for which `stays` holds, and ties among them; groups of one go."""
        values = {p: v for p, v in self.values.items() if stays(p, v)}
        ties = (tuple(p for p in group if p in values) for group in self.ties)
        return replace(self, values=values, ties=tuple(group for group in ties if len(group) > 1))


@dataclass(frozen=True)
class Tree:
    """What a lumped thermal model consists of, at any depth. Frozen.

    Parameters
    ----------
    title : str                 What it models.
    needs : tuple of str        Nodes that whoever uses it must supply.
    offers : tuple of str       Own nodes and surfaces that a user may attach to.
    parameters : dict           Name -> Parameter.
    nodes, conductors, surfaces, joints, enclosures, loads, controls : dict    Name -> element.
    submodels : dict            Name -> Submodel.
    settings : dict             Path -> Parameter: the deck's own [set], over the decks of its submodels.
    layers : tuple of Layer     Values laid over it, the last one winning; a user's [set] wins over them.
    cuts : tuple of str         Instances and values that share with no other, although one deck writes them.
    aliases : dict              Other name -> canonical path.
    made_in : dict              Gas node, or ``*`` -> `MadeIn`: of a reduced model, whose conductances hold the gas of that state alone.
    box : str                   white, light grey, dark grey or black.
    use : str                   The intended use, in words.
    incomplete : str            What of the hardware it lacks, in words: what an import could not take over.
    file : str                  The deck's file name, for messages.
    lines : dict                Key path -> line of the deck, for messages.
    memo : Memo                 The tree laid flat, once it was asked for.
    runner : object or None     What runs it in place of the kernel, as an FMU does; see `thermid.simulation._solver.engine.Runner`.

    `Model` adds what changes or judges a whole tree.
    """

    title: str
    needs: tuple[str, ...] = ()
    offers: tuple[str, ...] = ()
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    nodes: Mapping[str, Node] = field(default_factory=dict)
    conductors: Mapping[str, Conductor] = field(default_factory=dict)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    joints: Mapping[str, Joint] = field(default_factory=dict)
    enclosures: Mapping[str, Enclosure] = field(default_factory=dict)
    loads: Mapping[str, HeatLoad] = field(default_factory=dict)
    controls: Mapping[str, Control] = field(default_factory=dict)
    submodels: Mapping[str, Submodel[Self]] = field(default_factory=dict)
    settings: Mapping[str, Parameter] = field(default_factory=dict)
    layers: tuple[Layer, ...] = ()
    cuts: tuple[str, ...] = ()
    aliases: Mapping[str, str] = field(default_factory=dict)
    made_in: Mapping[str, MadeIn] = field(default_factory=dict)
    box: str = "light grey"
    use: str = ""
    incomplete: str = ""
    file: str = field(default="", compare=False)
    lines: Mapping[str, int | str] = field(default_factory=dict, compare=False, repr=False)
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)
    runner: Any = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        """One line: what it is made of and what it needs."""
        counts = ((getattr(self, name), name) for name in ("submodels", "nodes", "conductors", "surfaces", "joints", "loads", "controls"))
        contents = ", ".join(f"{len(table)} {name if len(table) != 1 else name[:-1]}" for table, name in counts if table)
        return f"{self.title}: {contents or 'empty'}; needs {', '.join(self.needs) or 'nothing'}"

    def where(self, key: str) -> str:
        """Return file, line and key path, for messages."""
        if self.file and self.lines:
            return Places(self.file, self.lines)(key)
        return f"{self.file or self.title}, {key}" if key else self.file or self.title

    def elements(self) -> Iterator[tuple[str, str, Element]]:
        """Yield table, name and element of every own element."""
        for table in TABLES:
            for name, element in getattr(self, table).items():
                yield table, name, element

    def walk(self, prefix: str = "") -> Iterator[tuple[Self, str]]:
        """Yield the tree and every part at any depth, each with the prefix of its paths; empty, or ending with a dot."""
        yield self, prefix
        for name, part in self.submodels.items():
            yield from part.model.walk(f"{prefix}{name}.")

    def own_parameters(self) -> Iterator[tuple[str, str, Parameter]]:
        """Yield name, key path and parameter of every own value; a value inside an element is ``element.field``."""
        for name, parameter in self.parameters.items():
            yield name, f"parameters.{name}", parameter
        for table, name, element in self.elements():
            for entry, parameter in element.fields.items():
                yield f"{name}.{entry}", f"{table}.{name}.{entry}", parameter

    def submodel(self, path: str) -> Self:
        """Return the submodel at a path.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        head, _, rest = self.canonical(path).partition(".")
        if head not in self.submodels:
            raise NameNotFoundError(f"no submodel '{head}'.{nearest(head, self.submodels) or self._parts()}", self.title)
        inner = self.submodels[head].model
        return inner.submodel(rest) if rest else inner

    def _parts(self) -> str:
        """Return the end of a message that names the submodels there are."""
        return f" There are {', '.join(self.submodels)}." if self.submodels else " It has none."

    def canonical(self, path: str) -> str:
        """Return the canonical path of a name: aliases resolved, here and in every submodel it passes.

        An alias that one submodel alone has, and nothing here, stands for the same here.

        Raises
        ------
        NameNotFoundError   When it is no text.
        """
        if not isinstance(path, str):
            raise NameNotFoundError(f"a name is a text such as 'case.mass', not {path!r:.60}.", self.title, code="value.wrong-kind")
        while path in self.aliases:
            path = self.aliases[path]
        head, _, rest = path.partition(".")
        if rest and head in self.aliases:
            return self.canonical(f"{self.aliases[head]}.{rest}")
        if rest and head in self.submodels:
            return f"{head}.{self.submodels[head].model.canonical(rest)}"
        if self.submodels and (inner := self._below.get(head)):
            return f"{inner}.{rest}" if rest else inner
        return path

    @property
    def _below(self) -> dict[str, str]:
        """Aliases of submodels that are names here too -> canonical path; computed once."""
        return self.memo.value("inner aliases", self._inner_aliases)

    def every_alias(self) -> dict[str, str]:
        """Return every alias that is a name here -> its canonical path, those of submodels too."""
        return self._below | {alias: self.canonical(alias) for alias in self.aliases}

    def _inner_aliases(self) -> dict[str, str]:
        """Return alias of a submodel -> canonical path, of those that no other submodel has and that are no names here."""
        paths: dict[str, set[str]] = {}
        for name, part in self.submodels.items():
            for alias, path in part.model.every_alias().items():
                paths.setdefault(alias, set()).add(f"{name}.{path}")
        mine = {*self.needs, *self.submodels, *self.aliases, *self.parameters, *(name for _, name, _ in self.elements())}
        return {alias: next(iter(several)) for alias, several in paths.items() if len(several) == 1 and alias not in mine}

    def at(self, path: str) -> Self | Element | Parameter:
        """Return the submodel, element or parameter at a path; aliases are accepted.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        path = self.canonical(path)
        head, _, rest = path.partition(".")
        if head in self.submodels and not rest:
            return self.submodels[head].model
        for _, name, element in self.elements():
            if path == name:
                return element
        table = self.parameter_table()
        if path in table:
            return table[path].parameter
        if head in self.submodels:
            return self.submodels[head].model.at(rest)
        names = [*self.submodels, *(n for _, n, _ in self.elements()), *table]
        raise NameNotFoundError(f"nothing at '{path}'.{nearest(path, names)}", self.title)

    def interfaces(self) -> tuple[str, ...]:
        """Return the paths of the parameters that belong to no part alone: what a submodel stage tunes."""
        own_values = [name for name, _, parameter in self.own_parameters() if parameter.is_literal]
        return (*own_values, *(path for path, parameter in self.settings.items() if parameter.is_literal))

    @property
    def standing(self) -> Standing:
        """The worst standing of the values that act in the model and of its decks; unjudged where all values are those of the decks.

        A deck from which parts are missing makes it incomplete. A value that was laid over the model carries its standing; one that a [set]
        hides does not act.
        """
        standings = [s for e in self.parameter_table().values() if (s := e.parameter.standing) is not None]
        standings += [Standing("incomplete", what) for what in self.missing_parts()]
        return Standing.worst(standings) if standings else UNJUDGED

    def missing_parts(self) -> Iterator[str]:
        """Yield what the model and its parts lack, each with its place."""
        for part, path in self.walk():
            if part.incomplete:
                yield f"{path.removesuffix('.')}: {part.incomplete}" if path else part.incomplete

    def without_test_only(self) -> Self:
        """Return the flight model: every element tagged `test_only` is dropped, at every depth."""
        tables: dict[str, Any] = {t: {n: e for n, e in getattr(self, t).items() if not e.test_only} for t in TABLES}
        inner = {n: s.with_model(s.model.without_test_only()) for n, s in self.submodels.items()}
        bare = replace(self, **tables, submodels=inner, settings={}, layers=(), cuts=())
        values, names = bare.parameter_table(), local_names(bare)
        return replace(
            bare,
            offers=tuple(o for o in self.offers if bare.canonical(o) in names),
            aliases={a: p for a, p in self.aliases.items() if bare.canonical(p) in names},
            settings={p: v for p, v in self.settings.items() if bare.canonical(p) in values},
            layers=tuple(x.keeping(lambda p, _: bare.canonical(p) in values) for x in self.layers),
            cuts=tuple(c for c in self.cuts if c in values or c in names),
        )

    def parameter_table(self, prefix: str = "") -> dict[str, Entry]:
        """Return path -> `Entry` for every value of a tree.

        Precedence, weakest first: a part's deck, values laid over the part, the user's [set], values laid over the user.

        Raises
        ------
        NameNotFoundError   When a [set] names no parameter.
        """
        table: dict[str, Entry] = {}
        for name, key, parameter in self.own_parameters():
            table[prefix + name] = Entry(parameter, prefix, self.title, self.where(key))
        for name, part in self.submodels.items():
            table |= part.model.parameter_table(f"{prefix}{name}.")
        for raw, parameter in self.settings.items():
            _lay(table, self, prefix, raw, parameter, f"{SET}{self.title}", self.where(f"set.{raw}"))
        for layer in self.layers:
            for raw, parameter in layer.values.items():
                _lay(table, self, prefix, raw, parameter, layer.origin, f"{layer.origin}, {raw}")
        return table

    def own_tables(self, prefix: str = "") -> dict[str, tuple[Curve, str]]:
        """Return path -> table of points and its place in a deck, for every table over a temperature; no value is laid over these."""
        curves = [(f"nodes.{n}.{e.table[0]}", f"{n}.{e.table[0]}", e.table[1]) for n, e in self.nodes.items() if e.table]
        for group, elements in (("conductors", self.conductors), ("loads", self.loads)):
            for n, element in elements.items():
                if element.curve is not None:
                    field = (KINDS[element.kind].tabulated if isinstance(element, Conductor) else "") or "table"
                    curves.append((f"{group}.{n}.{field}", f"{n}.{field}", element.curve))
        out = {prefix + path: (curve, self.where(key)) for key, path, curve in curves}
        for name, part in self.submodels.items():
            out |= part.model.own_tables(f"{prefix}{name}.")
        return out

    def instances(self, prefix: str = "") -> Iterator[tuple[str, str]]:
        """Yield prefix and definition of every submodel, at every depth."""
        for name, part in self.submodels.items():
            yield f"{prefix}{name}.", part.definition
            yield from part.model.instances(f"{prefix}{name}.")

    def without_layers(self) -> Tree:
        """Return a model without the values that were laid over it and its parts; what is cut from its twins stays so."""
        return replace(self, layers=(), submodels={n: s.with_model(s.model.without_layers()) for n, s in self.submodels.items()})


def used_offers(model: Tree, part: str) -> set[str]:
    """Return the nodes and surfaces of a submodel that its user attaches to, names as the part offers them."""
    by = [*(load.controls for load in model.loads.values()), *(c.controls for c in model.conductors.values())]
    by += [names for s in model.surfaces.values() for names in s.controls.values()]
    ends = [
        *(end for c in model.conductors.values() for end in (*c.between, *c.takes, c.words.get("to", ""))),
        *(end for joint in model.joints.values() for end in (*joint.between, joint.gap_to)),
        *(end for enclosure in model.enclosures.values() for end in (*enclosure.faces.values(), enclosure.rest)),
        *(end for load in model.loads.values() for end in (load.into, load.sensor)),
        *(end for c in model.controls.values() for nodes in (c.follows, *(t.follows for t in c.transitions.values())) for end in nodes),
        *(end for surface in model.surfaces.values() for end in (surface.of, surface.to, surface.sees)),
        *(end for inner in model.submodels.values() for end in (*inner.bind.values(), *inner.sees.values())),
        *(named_control(c)[0] for several in by for c in several),
        *model.offers,
    ]
    prefix, paths = f"{part}.", map(model.canonical, ends)
    return {path.removeprefix(prefix) for path in paths if path.startswith(prefix)}


def local_names(model: Tree) -> set[str]:
    """Return every canonical path that a name inside a model may stand for: submodels, elements, nodes, needs and parameters."""
    return {
        prefix + name
        for part, prefix in model.walk()
        for name in (
            *part.needs,
            *part.submodels,
            *(name for _, name, _ in part.elements()),
            *(name for name, _, _ in part.own_parameters()),
            *(joint.mid or f"{name}.mid" for name, joint in part.joints.items()),
        )
    }


class Names:
    """The nodes of a tree by canonical path, with every need bound to the node that supplies it.

    Parameters
    ----------
    model : Tree   The tree; its own needs become boundaries.

    Raises
    ------
    DeckError           When a need is bound to nothing.
    NameNotFoundError   When an end names no node.
    """

    def __init__(self, model: Tree) -> None:
        self.model = model
        self.boundaries: tuple[str, ...] = tuple(model.needs)
        self.nodes: dict[str, tuple[Tree, str]] = {}
        self._alias: dict[str, str] = {need: need for need in model.needs}
        self._seen: dict[str, str] = {}
        self._offered: dict[str, frozenset[str]] = {}
        for owner, prefix in model.walk():
            self._check_ports(owner)
            self.nodes |= {prefix + name: (owner, name) for name in owner.nodes}
            self.nodes |= {prefix + (joint.mid or f"{name}.mid"): (owner, "") for name, joint in owner.joints.items()}
        for owner, prefix in model.walk():  # from the outside in
            for name, part in owner.submodels.items():
                self._bind_part(owner, prefix, name, part)

    def _check_ports(self, model: Tree) -> None:
        """Refuse aliases and offers that name nothing."""
        names = local_names(model)
        for alias, target in model.aliases.items():
            missing = f"the alias '{alias}' stands for '{target}', which does not exist."
            refuse_unknown([model.canonical(target)], names, model.where(f"aliases.{alias}"), missing, NameNotFoundError)
        for offer in model.offers:
            missing = f"offers names '{offer}', but the model has no such node or surface."
            refuse_unknown([model.canonical(offer)], names, model.where("offers"), missing, NameNotFoundError)

    def _bind_part(self, model: Tree, prefix: str, name: str, part: Submodel[Tree]) -> None:
        """Record which node each need of a part stands for and which one its surfaces see; refuse a need without one."""
        wrong = f"'{name}' needs {', '.join(part.model.needs) or 'nothing'}, not '{{}}'."
        refuse_unknown(part.bind, part.model.needs, model.where(f"submodels.{name}.bind"), wrong, NameNotFoundError)
        for need in part.model.needs:
            if need not in part.bind:
                raise DeckError(
                    f"port '{need}' of '{name}' is not bound. Give it a node: bind = {{ {need} = \"...\" }}.",
                    model.where(f"submodels.{name}"),
                    code="model.refused",
                )
            target = part.bind[need]
            key = f"submodels.{name}.bind.{need}"
            self._alias[f"{prefix}{name}.{need}"] = self.end(model, prefix, target, key)
            self._seen[f"{prefix}{name}.{need}"] = self.node_seen(model, prefix, part.sees.get(need, target), key)

    def end(self, model: Tree, prefix: str, raw: str, key: str) -> str:
        """Return the canonical node that a name inside a model stands for; offered ports only, where it lies in a submodel."""
        path = model.canonical(raw)
        head, _, rest = path.partition(".")
        if rest and head in model.submodels:
            if prefix + head not in self._offered:
                self._offered[prefix + head] = frozenset(map(model.submodels[head].model.canonical, model.submodels[head].model.offers))
            if rest not in self._offered[prefix + head]:
                say = (
                    f"'{head}' does not offer '{rest}'. It offers {', '.join(model.submodels[head].model.offers) or 'nothing'}."
                    if prefix + path in self.nodes
                    else f"no node '{raw}'.{self._nearest(prefix, path)}"
                )
                raise NameNotFoundError(say, model.where(key))
        full = prefix + path
        full = self._alias.get(full, full)
        if full not in self.nodes and full not in self.boundaries:
            hint = self._nearest(prefix, path) or f' Define it under nodes; if it is supplied from outside, add it to needs = ["{raw}"].'
            raise NameNotFoundError(f"no node '{raw}'.{hint}", model.where(key))
        return full

    def node_seen(self, model: Tree, prefix: str, raw: str, key: str) -> str:
        """Return the canonical node that a surface sees under a name: of a need that is bound apart, the one it sees."""
        return self._seen.get(prefix + model.canonical(raw), self.end(model, prefix, raw, key))

    def _nearest(self, prefix: str, path: str) -> str:
        """Return the end of a message that names the nearest node below a prefix."""
        names = [n.removeprefix(prefix) for n in (*self.nodes, *self._alias) if n.startswith(prefix)]
        return nearest(path, names)

    def surface(self, model: Tree, prefix: str, raw: str, key: str) -> tuple[str, Tree, str]:
        """Return the canonical path of a surface, the model that owns it and that model's prefix."""
        owner, own_prefix, rest = model, prefix, model.canonical(raw)
        while "." in rest and rest.partition(".")[0] in owner.submodels:
            head, _, tail = rest.partition(".")
            part = owner.submodels[head].model
            if tail not in {part.canonical(o) for o in part.offers}:
                raise NameNotFoundError(
                    f"'{head}' does not offer '{tail}'.{nearest(tail, part.offers)} It offers {', '.join(part.offers) or 'nothing'}.",
                    model.where(key),
                )
            owner, own_prefix, rest = part, f"{own_prefix}{head}.", tail
        if rest not in owner.surfaces:
            raise NameNotFoundError(f"no surface '{raw}'.{nearest(rest, owner.surfaces)} Declare it under surfaces.", model.where(key))
        return own_prefix + rest, owner, own_prefix

    def knows(self, raw: str) -> bool:
        """Return whether a node or boundary has a name; aliases are accepted."""
        path = self.model.canonical(raw)
        return self._alias.get(path, path) in {*self.nodes, *self.boundaries}

    def find(self, raw: str, where: str = "") -> str:
        """Return the canonical path of a node or boundary named by a scenario, a record or a caller."""
        path = self.model.canonical(raw)
        path = self._alias.get(path, path)
        if path not in self.nodes and path not in self.boundaries:
            names = [*self.nodes, *self.boundaries]
            inside = [n for n in self.nodes if n.startswith(f"{path}.")]
            if inside:
                raise NameNotFoundError(f"'{raw}' is a submodel and no node. Its nodes: {quoted(inside)}.", where or self.model.title)
            hint = nearest(path, [*names, *self.model.aliases]) or (
                f" There are {', '.join(names)}." if len(names) <= MAX_LISTED_NAMES else ""
            )
            raise NameNotFoundError(f"no node '{raw}'.{hint}", where or self.model.title)
        return path


@dataclass(frozen=True)
class Entry:
    """The value that holds for a path.

    Parameters
    ----------
    parameter : Parameter           The winning value.
    scope : str                     Prefix in which its names resolve; empty or ending with a dot.
    origin : str                    Who set it.
    where : str                     File, line and key path, for messages.
    shadowed : tuple of (str, str)  Origin and text of every value it hides, the innermost first.
    """

    parameter: Parameter
    scope: str
    origin: str
    where: str
    shadowed: tuple[tuple[str, str], ...] = ()

    @property
    def deck_text(self) -> str:
        """Return the text that the decks have of a value: that of the outermost [set], or of the deck of the part; layers are left out."""
        every = [*self.shadowed, (self.origin, self.parameter.text)]
        return next((text for origin, text in reversed(every[1:]) if origin.startswith(SET)), every[0][1])


def _lay(table: dict[str, Entry], model: Tree, prefix: str, raw: str, parameter: Parameter, origin: str, where: str) -> None:
    """Put one value in the place of the one at its path, which becomes one of its `shadowed`."""
    path = prefix + model.canonical(raw)
    old = table.get(path)
    if old is None:
        paths = [p.removeprefix(prefix) for p in table]
        raise NameNotFoundError(f"no parameter '{raw}'.{nearest(raw, paths)}", where)
    table[path] = Entry(parameter.laid_over(old.parameter), prefix, origin, where, (*old.shadowed, (old.origin, old.parameter.text)))


class ParameterSet:
    """The values of a tree, by path: which one holds, who set it, what it shadows.

    Parameters
    ----------
    model : Tree   The tree.

    Raises
    ------
    ExpressionError   When an expression needs itself.
    ThermidError      When a name is unknown or a value lies outside its bounds.
    """

    def __init__(self, model: Tree) -> None:
        self.title = model.title
        self.table: Mapping[str, Entry] = model.parameter_table()
        self._needs: dict[str, tuple[str, ...]] = {
            path: tuple(self._lookup(name, entry) for name in entry.parameter.expression.names) for path, entry in self.table.items()
        }
        self.order: tuple[str, ...] = self._sorted()
        literals = {path: entry.parameter.expression.literal for path, entry in self.table.items()}
        self._numbers: dict[str, float] = {path: literal.value for path, literal in literals.items() if literal is not None}
        self._dimensions: dict[str, Dimension] = {}
        values = self.evaluate({})
        for path, entry in self.table.items():
            if not entry.parameter.is_range:
                check_bounds(values[path], entry.parameter, entry.where)

    def _lookup(self, name: str, entry: Entry) -> str:
        """Return the path of a name in the expression of an entry, or raise with the nearest one."""
        full = entry.scope + name
        if full not in self.table:
            local = [p.removeprefix(entry.scope) for p in self.table if p.startswith(entry.scope)]
            raise NameNotFoundError(f"no parameter '{name}'.{nearest(name, local)}", entry.where)
        return full

    def _sorted(self) -> tuple[str, ...]:
        """Return the paths so that each comes after what it needs."""
        done: dict[str, None] = {}
        trail: list[str] = []

        def visit(path: str) -> None:
            """Put a parameter behind all those that its formula needs; refuse one that needs itself."""
            if path in done:
                return
            if path in trail:
                loop = [*trail[trail.index(path) :], path]
                raise ExpressionError(f"'{path}' needs itself: {' -> '.join(loop)}.", self.table[path].where, code="model.self-reference")
            trail.append(path)
            for other in self._needs[path]:
                visit(other)
            trail.pop()
            done[path] = None

        for path in self.table:
            visit(path)
        return tuple(done)

    def evaluate(
        self, overrides: Mapping[str, Any], only: Iterable[str] | None = None, values_before: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Return path -> value, SI, of all paths or of `only` some, with `overrides` in place of literals.

        Overrides may be floats, `Dual` numbers or arrays over time; `values_before` holds values already computed.
        """
        values: dict[str, Any] = dict(values_before or {})
        for path in self.order if only is None else only:
            if (number := overrides.get(path, self._numbers.get(path))) is not None:
                values[path] = number
                continue
            entry = self.table[path]
            scope = entry.scope
            try:
                values[path] = entry.parameter.expression.evaluate(lambda name, scope=scope: values[scope + name])  # type: ignore[misc]
            except ArithmeticError as error:
                raise ExpressionError(
                    f"'{entry.parameter.text}' has no finite value: {error}.", entry.where, code="expression.no-finite-value"
                ) from None
        return values

    def downstream(self, changed: Iterable[str]) -> tuple[str, ...]:
        """Return the paths whose value depends on any of `changed`, in order of evaluation, `changed` among them."""
        touched = set(changed)
        out = []
        for path in self.order:
            if path in touched or any(n in touched for n in self._needs[path]):
                touched.add(path)
                out.append(path)
        return tuple(out)

    def dimension(self, path: str) -> Dimension:
        """Return the dimension of a value, by algebra over its names."""
        if path not in self._dimensions:
            entry = self.table[path]
            find: Callable[[str], Dimension] = lambda name: self.dimension(self._lookup(name, entry))  # noqa: E731
            with errors_at(entry.where):
                self._dimensions[path] = entry.parameter.expression.dimension(find)
        return self._dimensions[path]

    def literal_behind(self, path: str) -> str:
        """Return the path at the end of a chain of values that are written as one bare name each; `path` itself where it is none."""
        while True:  # a name that leads back to itself is refused before
            names, parameter = self._needs[path], self.table[path].parameter
            if parameter.is_literal or len(names) != 1 or parameter.text.strip() != parameter.expression.names[0]:
                return path
            path = names[0]

    @cached_property
    def _shares(self) -> frozenset[str]:
        """Paths of the values behind fields that physics keeps from 0 to 1."""
        return frozenset(self.literal_behind(p) for p in self.table if p.rpartition(".")[2] in SHARES)

    def bounded(self, path: str) -> Parameter:
        """Return the parameter at a path with its hard bounds as minimum and maximum; those of a share lie within 0 and 1. [SI]"""
        parameter = self.table[path].parameter
        low, high = parameter.walls
        if path in self._shares:
            least = min(LEAST_EMISSIVITY, parameter.minimum or 0.0) if parameter.is_range else 0.0
            low, high = max(low or 0.0, least), min(1.0 if high is None else high, 1.0)
        return replace(parameter, minimum=low, maximum=high)

    @property
    def stated_ranges(self) -> dict[str, StatedRange]:
        """Number -> the range that a catalogue, a data sheet or its author states for it, of those that have one."""
        ranges = ((p, e.parameter.stated_range) for p, e in self.table.items())
        return {p: r for p, r in ranges if r is not None}

    def freeable(self, raw: str, canonical: Callable[[str], str]) -> str:
        """Return the path of a parameter that a fit may free.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        DeckError           When the value is derived; the message says what to free instead.
        """
        path = canonical(raw)
        refuse_unknown([path], self.table, self.title, f"no parameter '{raw}'.", NameNotFoundError)
        path = self.literal_behind(path)
        entry = self.table[path]
        if not entry.parameter.is_literal:
            roots = [p for p in self.order if self.table[p].parameter.is_literal and path in self.downstream([p])]
            raise DeckError(
                f"'{raw}' is derived from other values: {entry.parameter.text}. Free one of {', '.join(roots)} instead.",
                entry.where,
                code="model.refused",
            )
        return path
