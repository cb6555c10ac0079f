"""Folding: submodels of a flat model drawn as one mass each, with what they exchange."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from thermid.errors import NameNotFoundError, nearest
from thermid.model.tree.flat import Flat, FlatConductor, FlatNode
from thermid.model.tree.tree import Tree


@dataclass(frozen=True, eq=False)
class FoldedModel:
    """A flat model with some submodels drawn as one mass.

    Parameters
    ----------
    flat : Flat         What is left to draw.
    parts : tuple       Prefixes of the folded submodels, each with its dot.
    members : dict      Conductor drawn -> the conductors it stands for, each with +1, or -1 where it runs the other way.
    nodes : dict        Node drawn -> the nodes it stands for.
    """

    flat: Flat
    parts: tuple[str, ...]
    members: Mapping[str, tuple[tuple[str, int], ...]]
    nodes: Mapping[str, tuple[str, ...]]


def parts_of(model: Tree) -> tuple[str, ...]:
    """Return the paths of all submodels, outer ones first."""
    return tuple(prefix.removesuffix(".") for _, prefix in model.walk() if prefix)


def fold(flat: Flat, paths: Sequence[str]) -> FoldedModel:
    """Return a flat model with submodels folded; conductors inside them vanish, those that leave side by side become one.

    Parameters
    ----------
    flat : Flat         The model laid flat.
    paths : sequence    Paths of submodels; one inside another that is folded too adds nothing.

    Raises
    ------
    NameNotFoundError   When there is no such submodel.
    """
    known = parts_of(flat.names.model)
    for path in paths:
        if path not in known:
            raise NameNotFoundError(f"no submodel '{path}'.{nearest(path, known)}", flat.names.model.title)
    outer = [p for p in paths if not any(p.startswith(f"{q}.") for q in paths)]

    def drawn(node: str) -> str:
        return next((p for p in outer if node.startswith(f"{p}.")), node)

    nodes: dict[str, list[FlatNode]] = {}
    for node in flat.nodes:
        nodes.setdefault(drawn(node.path), []).append(node)
    shown = tuple(found[0] if path not in outer else FlatNode(path, {"capacitance": ""}, False, "") for path, found in nodes.items())
    groups: dict[tuple[str, str, str], list[tuple[FlatConductor, int]]] = {}
    alone: list[FlatConductor] = []
    for c in flat.conductors:
        a, b = drawn(c.ends[0]), drawn(c.ends[1])
        if a == b and a in outer:
            continue
        if a not in outer and b not in outer:
            alone.append(c)
        elif c.kind != "flow" and (b, a, c.kind) in groups:
            groups[b, a, c.kind].append((c, -1))
        else:
            groups.setdefault((a, b, c.kind), []).append((c, 1))
    joined: list[FlatConductor] = []
    members: dict[str, tuple[tuple[str, int], ...]] = {c.path: ((c.path, 1),) for c in alone}
    for (a, b, kind), found in groups.items():
        first = found[0][0]
        name = first.path if len({c.path for c, _ in found}) == 1 else f"{a}: {len(found)} of {kind} to {b}"
        joined.append(replace(first, path=name, ends=(a, b)))
        members[name] = tuple(dict.fromkeys((c.path, sign) for c, sign in found))
    loads = tuple(replace(load, node=drawn(load.node)) for load in flat.loads)
    left = replace(flat, nodes=shown, conductors=tuple([*alone, *joined]), loads=loads)
    return FoldedModel(left, tuple(f"{p}." for p in outer), members, {p: tuple(n.path for n in found) for p, found in nodes.items()})
