"""`Model`: one recursive type for component, submodel, full model and macro model. It is what the hardware is, and nothing else."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from thermid.base.errors import NameNotFoundError, refuse_unknown
from thermid.base.results import Row, Shown
from thermid.base.units import Quantity, si_unit, unit
from thermid.model._tree.identity import Identity, Replacement, cut, definition_of, identity_of, lay_values, local_identities, replaced
from thermid.model._tree.rules import Finding, findings
from thermid.model._tree.tree import ParameterSet, Tree


@dataclass(frozen=True)
class Model(Tree, Shown):
    """A lumped thermal model at any depth. Frozen; every change returns a new one. Its fields are those of `Tree`."""

    def __repr__(self) -> str:
        """Return its kind and its first line."""
        return Shown.__repr__(self)

    def _summary(self) -> str:
        """Return its title with the number of elements of each kind."""
        parts = [f"{row['number']} {row['what']}" for row in self._as_rows() if row["number"]]
        return f"{self.title}: {', '.join(parts)}"

    def _as_rows(self) -> list[Row]:
        """Return how many elements of each kind it has."""
        kinds = ("nodes", "surfaces", "conductors", "loads", "submodels", "needs")
        return [{"what": name, "number": len(getattr(self, name))} for name in kinds]

    def value(self, path: str) -> Quantity:
        """Return the number of a parameter with its unit; of one that an expression gives, such as a cooler's, in SI units.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        values, name = ParameterSet(self), self.canonical(path)
        refuse_unknown([name], values.table, self.title, "no value '{}'.", NameNotFoundError)
        of = values.table[name].parameter.unit or si_unit(values.dimension(name))
        return Quantity(float(values.evaluate({})[name]), unit(of))

    def with_values(self, values: Mapping[str, Any], origin: str = "caller", at: str = "") -> Model:
        """Return the model with values laid over it.

        Given to one of several instances of a deck, a value cuts it from the others, which `check` lists. A fitted value given to several
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
        if at:
            return self.with_part(at, self.submodel(at).with_values(values, origin))
        return lay_values(self, values, origin)

    def cut(self, *places: str) -> Model:
        """Return the model in which some instances or values share with no other; numbers stay as they are.

        Parameters
        ----------
        places : str    Paths of submodels or of values.

        Raises
        ------
        NameNotFoundError   When a path is neither.
        """
        return cut(self, places)

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

    def replace(self, path: str, new: Model, keep: Sequence[str] = ()) -> Model:
        """Return the model with the submodel at `path` replaced; see `replaced`, which says what became of the old one's values too."""
        return self.replaced(path, new, keep)[0]

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
        return replaced(self, path, new, keep)

    def check(self, named: Collection[str] = ()) -> tuple[Finding, ...]:
        """Check the model: errors, warnings and notes, one per finding.

        Parameters
        ----------
        named : collection of str   Parameters that something else uses, such as the gain of a channel.
        """
        return findings(self, named) if self.runner is None else ()  # of what runs elsewhere, a deck has names alone

    def identity(self) -> str:
        """Return a hash of what the model means: not of its file, comments, layout or the order of its tables."""
        return identity_of(self)

    @property
    def node_boxes(self) -> dict[str, str]:
        """Return node -> the colour of the part that it belongs to; the node of a joint belongs to whoever joins."""
        return {
            start + name: part.box
            for part, start in self.walk()
            for name in (*part.nodes, *(joint.mid or f"{key}.mid" for key, joint in part.joints.items()))
        }

    @property
    def part_boxes(self) -> dict[str, str]:
        """Return submodel -> its tag with that of everything in it; the empty path is the whole."""
        nodes = self.node_boxes
        parts = {prefix.removesuffix("."): part for part, prefix in self.walk()}
        return {
            path: mixed({part.box, *(colour for node, colour in nodes.items() if not path or node.startswith(f"{path}."))})
            for path, part in parts.items()
        }


def identities(model: Model) -> Mapping[str, Identity]:
    """Return path -> `Identity` of every value of a tree.

    A value in the deck of a part is one value for all its instances. A row of a [set] belongs to the deck that has it; rows of one [set]
    with equal number, dimension and bounds, on one field of instances of one definition, are one value. A cut separates them.
    """
    return local_identities(model, definition_of(model))


COLOURS = ("white", "light grey", "dark grey", "black")
"""From pure theory to pure experiment (Isermann and Münchhof, Identification of Dynamic Systems, 2011, DOI 10.1007/978-3-540-78879-9)."""


def mixed(colours: set[str]) -> str:
    """Return one tag for several colours: the colour they share, or all of them from light to dark.

    >>> mixed({"light grey"}), mixed({"black", "light grey"})
    ('light grey', 'light grey + black')
    """
    return " + ".join(sorted(colours, key=COLOURS.index))
