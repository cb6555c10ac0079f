"""What a part touches in a model that holds it: the elements at its surfaces, the values behind them, and its neighbours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from thermid.model.parts.elements import Conductor, HeatLoad, Joint, Surface
from thermid.model.tree.model import Element, Model
from thermid.model.tree.resolve import ParameterSet


@dataclass
class Touching:
    """What a part touches.

    Parameters
    ----------
    elements : dict         Element -> fields of the elements that attach to the part.
    settings : set          Paths inside the part that a model above sets.
    shared : dict           Field -> element, of all elements elsewhere that do not attach to it.
    neighbours : set        Other ends of what attaches to it.
    """

    elements: dict[str, list[str]] = field(default_factory=dict)
    settings: set[str] = field(default_factory=set)
    shared: dict[str, str] = field(default_factory=dict)
    neighbours: set[str] = field(default_factory=set)

    def why(self, values: ParameterSet, path: str) -> tuple[list[str], list[str]]:
        """Return through what a value acts on the part: elements or settings; and the elements elsewhere that it acts on too."""
        acts = set(values.downstream([path]))
        touched = [name for name, fields in self.elements.items() if acts & set(fields)]
        touched += sorted(p for p in self.settings if p in acts)
        return touched, sorted({self.shared[p] for p in acts if p in self.shared})


def touching(model: Model, part: str) -> Touching:
    """Return what the submodel at a path touches in a model, at every level between them."""
    out = Touching()
    _visit(model, "", part, part, out)
    out.neighbours = {n for n in out.neighbours if not _inside(n, part)}
    return out


def _inside(path: str, part: str) -> bool:
    return path == part or path.startswith(f"{part}.")


def _visit(model: Model, prefix: str, rest: str, part: str, out: Touching) -> None:
    """Collect from a model that holds the part below its submodel ``rest``."""
    fields: dict[str, list[str]] = {}
    for name, key, _ in model.own_parameters():
        if not key.startswith("parameters."):
            fields.setdefault(name.partition(".")[0], []).append(prefix + name)
    for _, name, element in model.elements():
        ends = {prefix + model.canonical(e) for e in _ends(element)}
        if any(_inside(e, part) for e in ends):
            out.elements[prefix + name] = fields.get(name, [])
            out.neighbours |= ends
        else:
            out.shared |= dict.fromkeys(fields.get(name, []), prefix + name)
    out.settings |= {p for p in (prefix + model.canonical(raw) for raw in model.settings) if _inside(p, part)}
    head, _, deeper = rest.partition(".")
    for name, inner in model.submodels.items():
        if name != head:
            _all(inner.model, f"{prefix}{name}.", out)
    if deeper:
        _visit(model.submodels[head].model, f"{prefix}{head}.", deeper, part, out)


def _all(model: Model, prefix: str, out: Touching) -> None:
    for name, key, _ in model.own_parameters():
        if not key.startswith("parameters."):
            out.shared[prefix + name] = prefix + name.partition(".")[0]
    for name, inner in model.submodels.items():
        _all(inner.model, f"{prefix}{name}.", out)


def _ends(element: Element) -> Iterable[str]:
    """Return the nodes and surfaces that heat passes to through an element; areas that it only takes are no path."""
    if isinstance(element, Joint):
        return element.between
    if isinstance(element, Conductor):
        return element.between
    if isinstance(element, Surface):
        return [e for e in (element.of, element.sees) if e]
    if isinstance(element, HeatLoad):
        return [element.into]
    return ()
