"""`Model`: one recursive type for component, submodel, full model and macro model. It is what the hardware is, and nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from thermid.arguments import takes_objects
from thermid.errors import NameNotFoundError, nearest
from thermid.model.parts.elements import Conductor, Enclosure, HeatLoad, Joint, MadeIn, Node, Surface
from thermid.model.parts.parameter import Parameter, parameter
from thermid.model.parts.standing import UNJUDGED
from thermid.toml_files import Places

if TYPE_CHECKING:
    from thermid.model.tree.replacement import Replacement
    from thermid.model.tree.rules import Finding

Element = Node | Conductor | Surface | Joint | Enclosure | HeatLoad
TABLES = ("nodes", "surfaces", "conductors", "joints", "enclosures", "loads")


@dataclass(frozen=True)
class Submodel:
    """A model used inside another, with the nodes that its needs are bound to.

    Parameters
    ----------
    model : Model       The part.
    bind : dict         Need of the part -> path of a node of the user.
    definition : str    Hash of its deck as it was read, see `definition_of`; instances of one definition share their values.
    sees : dict         Need -> path of the node that the part's surfaces see there, where that is not the one it is bound to.
    """

    model: Model
    bind: Mapping[str, str] = field(default_factory=dict)
    definition: str = ""
    sees: Mapping[str, str] = field(default_factory=dict)

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


@dataclass(frozen=True)
class Model:
    """A lumped thermal model at any depth. Frozen; every change returns a new one.

    Parameters
    ----------
    title : str                 What it models.
    needs : tuple of str        Nodes that whoever uses it must supply.
    offers : tuple of str       Own nodes and surfaces that a user may attach to.
    parameters : dict           Name -> Parameter.
    nodes, conductors, surfaces, joints, enclosures, loads : dict    Name -> element.
    submodels : dict            Name -> Submodel.
    settings : dict             Path -> Parameter: the deck's own [set], over the decks of its submodels.
    layers : tuple of Layer     Values laid over it, the last one winning; a user's [set] wins over them.
    cuts : tuple of str         Instances and values that share with no other, although one deck writes them.
    aliases : dict              Other name -> canonical path.
    made_in : dict              Gas node, or ``*`` -> `MadeIn`: of a reduced model, whose conductances hold the gas of that state alone.
    box : str                   white, light grey, dark grey or black.
    use : str                   The intended use, in words.
    file : str                  The deck's file name, for messages.
    lines : dict                Key path -> line of the deck, for messages.
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
    submodels: Mapping[str, Submodel] = field(default_factory=dict)
    settings: Mapping[str, Parameter] = field(default_factory=dict)
    layers: tuple[Layer, ...] = ()
    cuts: tuple[str, ...] = ()
    aliases: Mapping[str, str] = field(default_factory=dict)
    made_in: Mapping[str, MadeIn] = field(default_factory=dict)
    box: str = "light grey"
    use: str = ""
    file: str = field(default="", compare=False)
    lines: Mapping[str, int] = field(default_factory=dict, compare=False, repr=False)

    def __str__(self) -> str:
        """One line: what it is made of and what it needs."""
        counts = ((getattr(self, name), name) for name in ("submodels", "nodes", "conductors", "surfaces", "joints", "loads"))
        made = ", ".join(f"{len(table)} {name if len(table) != 1 else name[:-1]}" for table, name in counts if table)
        return f"{self.title}: {made or 'empty'}; needs {', '.join(self.needs) or 'nothing'}"

    def where(self, key: str) -> str:
        """Return file, line and key path, for messages."""
        return Places(self.file or self.title, self.lines if self.file else {})(key)

    def elements(self) -> Iterator[tuple[str, str, Element]]:
        """Yield table, name and element of every own element."""
        for table in TABLES:
            for name, element in getattr(self, table).items():
                yield table, name, element

    def own_parameters(self) -> Iterator[tuple[str, str, Parameter]]:
        """Yield name, key path and parameter of every own value; a value inside an element is ``element.field``."""
        for name, given in self.parameters.items():
            yield name, f"parameters.{name}", given
        for table, name, element in self.elements():
            for entry, given in element.fields.items():
                yield f"{name}.{entry}", f"{table}.{name}.{entry}", given

    def submodel(self, path: str) -> Model:
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
        return f" There are {', '.join(self.submodels)}." if self.submodels else " It has none."

    def canonical(self, path: str) -> str:
        """Return the canonical path of a name: aliases resolved, here and in every submodel it passes."""
        while path in self.aliases:
            path = self.aliases[path]
        head, _, rest = path.partition(".")
        if rest and head in self.aliases:
            return self.canonical(f"{self.aliases[head]}.{rest}")
        if rest and head in self.submodels:
            return f"{head}.{self.submodels[head].model.canonical(rest)}"
        return path

    def at(self, path: str) -> Model | Element | Parameter:
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
        from thermid.model.tree.resolve import parameter_table

        table = parameter_table(self)
        if path in table:
            return table[path].parameter
        if head in self.submodels:
            return self.submodels[head].model.at(rest)
        known = [*self.submodels, *(n for _, n, _ in self.elements()), *table]
        raise NameNotFoundError(f"nothing at '{path}'.{nearest(path, known)}", self.title)

    @takes_objects
    def with_values(self, values: Mapping[str, Any], origin: str = "caller", at: str = "") -> Model:
        """Return the model with values laid over it.

        Given to one of several instances of a deck, a value cuts it from the others: `check` says so. A fitted value given to several
        instances stays one value of them all.

        Parameters
        ----------
        values : dict   Path -> text with unit, `Parameter`, or anything with ``as_parameter()`` such as a fitted value.
        origin : str    Who sets them.
        at : str        Path of a submodel whose own values these are, by their paths there: what a [set] above says still wins over them.

        Raises
        ------
        NameNotFoundError   When a path is no parameter of the model.
        """
        from thermid.model.tree.identity import laid_ties
        from thermid.model.tree.resolve import parameter_table

        if at:
            return self.with_part(at, self.submodel(at).with_values(values, origin))
        known = parameter_table(self)
        layer: dict[str, Parameter] = {}
        shared: dict[int, list[str]] = {}
        for raw, value in values.items():
            path = self.canonical(raw)
            if path not in known:
                raise NameNotFoundError(f"no parameter '{raw}'.{nearest(path, known)}", self.title)
            given = value.as_parameter() if hasattr(value, "as_parameter") else parameter(value, path)
            old = known[path].parameter
            keep = {k: getattr(old, k) for k in ("minimum", "maximum") if getattr(given, k) is None}
            standing = getattr(value, "standing", None) or UNJUDGED
            layer[path] = replace(given, **keep, note=given.note or old.note, standing=standing)
            if hasattr(value, "as_parameter"):
                shared.setdefault(id(value), []).append(path)
        if not layer:
            return self
        cuts, ties = laid_ties(self, layer, list(shared.values()))
        cut = self.cut(*cuts)
        return replace(cut, layers=(*cut.layers, Layer(origin, layer, ties)))

    @takes_objects
    def cut(self, *places: str) -> Model:
        """Return the model in which some instances or values share with no other; numbers stay as they are.

        Parameters
        ----------
        places : str    Paths of submodels or of values.

        Raises
        ------
        NameNotFoundError   When a path is neither.
        """
        from thermid.model.tree.identity import cut_layers, instances
        from thermid.model.tree.resolve import parameter_table

        if not places:
            return self
        known = {*(prefix.removesuffix(".") for prefix, _ in instances(self)), *parameter_table(self)}
        cuts, layers = dict.fromkeys(self.cuts), self.layers
        for raw in places:
            place = self.canonical(raw)
            if place not in known:
                raise NameNotFoundError(f"no submodel or parameter '{raw}' to be cut.{nearest(place, known)}", self.title)
            cuts[place], layers = None, cut_layers(layers, place)
        return replace(self, cuts=tuple(cuts), layers=layers)

    @takes_objects
    def with_part(self, path: str, changed: Model) -> Model:
        """Return the model with a submodel in another state; it stays the same part, and what lies over it stays too.

        Raises
        ------
        NameNotFoundError   When there is no such submodel.
        """
        head, _, rest = self.canonical(path).partition(".")
        self.submodel(head)
        old = self.submodels[head]
        inner = old.model.with_part(rest, changed) if rest else changed
        return replace(self, submodels={**self.submodels, head: replace(old, model=inner)})

    @takes_objects
    def replace(self, path: str, new: Model, keep: Sequence[str] = ()) -> Model:
        """Return the model with the submodel at `path` replaced; see `replaced`, which says what became of the old one's values too."""
        return self.replaced(path, new, keep)[0]

    @takes_objects
    def replaced(self, path: str, new: Model, keep: Sequence[str] = ()) -> tuple[Model, Replacement]:
        """Return the model with the submodel at `path` replaced, and what became of the values there.

        The new part has the values of its own deck. What a [set], a stage or a caller gave the old one is dropped at every level, with
        its ties; twins keep theirs. What a deck above derives from its own values stays. `with_part` changes the state of one part.

        Parameters
        ----------
        path : str      The submodel.
        new : Model     The new part.
        keep : list     Paths inside the part whose rows stay as they are, and fields of joints that stay shared.

        Raises
        ------
        DeckError   When the new part needs or offers other ports than are used, or lacks a value that a deck above reads.
        """
        from thermid.model.tree.replacement import replaced

        return replaced(self, path, new, keep)

    def interfaces(self) -> tuple[str, ...]:
        """Return the paths of the parameters that belong to no part alone: what a submodel stage tunes."""
        own = [name for name, _, given in self.own_parameters() if given.is_literal]
        return (*own, *(path for path, given in self.settings.items() if given.is_literal))

    def check(self) -> tuple[Finding, ...]:
        """Return what a careful reader would remark: errors, warnings and notes, one per finding."""
        from thermid.model.tree.rules import findings

        return findings(self)

    def identity(self) -> str:
        """Return a hash of what the model means: not of its file, comments, layout or the order of its tables."""
        from thermid.model.tree.written import to_dict

        return hashlib.sha256(json.dumps(to_dict(self), sort_keys=True).encode()).hexdigest()[:16]

    def without_test_only(self) -> Model:
        """Return the flight model: every element tagged `test_only` is dropped, at every depth."""
        from thermid.model.tree.names import local_names
        from thermid.model.tree.resolve import parameter_table

        tables: dict[str, Any] = {t: {n: e for n, e in getattr(self, t).items() if not e.test_only} for t in TABLES}
        inner = {n: replace(s, model=s.model.without_test_only()) for n, s in self.submodels.items()}
        bare = replace(self, **tables, submodels=inner, settings={}, layers=(), cuts=())
        values, names = parameter_table(bare), local_names(bare)
        return replace(
            bare,
            offers=tuple(o for o in self.offers if bare.canonical(o) in names),
            aliases={a: p for a, p in self.aliases.items() if bare.canonical(p) in names},
            settings={p: v for p, v in self.settings.items() if bare.canonical(p) in values},
            layers=tuple(
                Layer(x.origin, {p: v for p, v in x.values.items() if bare.canonical(p) in values}, _among(x.ties, values))
                for x in self.layers
            ),
            cuts=tuple(c for c in self.cuts if c in values or c in names),
        )


def _among(ties: tuple[tuple[str, ...], ...], known: Container[str]) -> tuple[tuple[str, ...], ...]:
    """Return the groups of what is still there."""
    kept = (tuple(p for p in group if p in known) for group in ties)
    return tuple(group for group in kept if len(group) > 1)
