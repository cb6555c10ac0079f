"""Names: which node every end of a tree is bound to, which surface a joint takes from, and what a model offers."""

from __future__ import annotations

from thermid.errors import DeckError, NameNotFoundError, nearest
from thermid.model.tree.model import Model, Submodel

FEW = 12
"""Up to so many names are listed where none is near."""


def used_offers(model: Model, part: str) -> set[str]:
    """Return the nodes and surfaces of a submodel that its user attaches to, names as the part offers them."""
    ends = [end for conductor in model.conductors.values() for end in (*conductor.between, *conductor.takes)]
    ends += [end for joint in model.joints.values() for end in joint.between]
    for enclosure in model.enclosures.values():
        ends += [*enclosure.faces.values(), enclosure.rest]
    for load in model.loads.values():
        ends += [load.into, load.sensor]
    for surface in model.surfaces.values():
        ends += [surface.of, surface.to, surface.sees]
    ends += [j.gap_to for j in model.joints.values()] + [c.words["to"] for c in model.conductors.values() if "to" in c.words]
    for inner in model.submodels.values():
        ends += [*inner.bind.values(), *inner.sees.values()]
    ends += model.offers
    prefix = f"{part}."
    return {model.canonical(e).removeprefix(prefix) for e in ends if model.canonical(e).startswith(prefix)}


def local_names(model: Model, prefix: str = "") -> set[str]:
    """Return every canonical path that a name inside a model may stand for: submodels, elements, nodes, needs and parameters."""
    out = {*model.needs, *model.submodels, *(name for _, name, _ in model.elements()), *(name for name, _, _ in model.own_parameters())}
    out |= {joint.mid or f"{name}.mid" for name, joint in model.joints.items()}
    paths = {prefix + name for name in out}
    for name, part in model.submodels.items():
        paths |= local_names(part.model, f"{prefix}{name}.")
    return paths


class Names:
    """The nodes of a tree by canonical path, with every need bound to the node that supplies it.

    Parameters
    ----------
    model : Model   The tree; its own needs become boundaries.

    Raises
    ------
    DeckError           When a need is bound to nothing.
    NameNotFoundError   When an end names no node.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.boundaries: tuple[str, ...] = tuple(model.needs)
        self.nodes: dict[str, tuple[Model, str]] = {}
        self._alias: dict[str, str] = {need: need for need in model.needs}
        self._seen: dict[str, str] = {}
        self._collect(model, "")
        self._bind(model, "")

    def _check_ports(self, model: Model) -> None:
        """Refuse aliases and offers that name nothing."""
        known = local_names(model)
        for alias, target in model.aliases.items():
            if model.canonical(target) not in known:
                raise NameNotFoundError(
                    f"the alias '{alias}' stands for '{target}', which does not exist.{nearest(target, known)}",
                    model.where(f"aliases.{alias}"),
                )
        for offer in model.offers:
            if model.canonical(offer) not in known:
                raise NameNotFoundError(
                    f"it offers '{offer}', but has no such node or surface.{nearest(offer, known)}", model.where("offers")
                )

    def _collect(self, model: Model, prefix: str) -> None:
        self._check_ports(model)
        for name in model.nodes:
            self.nodes[prefix + name] = (model, name)
        for name, joint in model.joints.items():
            self.nodes[prefix + (joint.mid or f"{name}.mid")] = (model, "")
        for name, part in model.submodels.items():
            self._collect(part.model, f"{prefix}{name}.")

    def _bind(self, model: Model, prefix: str) -> None:
        for name, part in model.submodels.items():
            self._bind_part(model, prefix, name, part)
            self._bind(part.model, f"{prefix}{name}.")

    def _bind_part(self, model: Model, prefix: str, name: str, part: Submodel) -> None:
        for need in part.bind:
            if need not in part.model.needs:
                known = ", ".join(part.model.needs) or "nothing"
                raise NameNotFoundError(
                    f"'{name}' needs {known}, not '{need}'.{nearest(need, part.model.needs)}", model.where(f"submodels.{name}.bind")
                )
        for need in part.model.needs:
            if need not in part.bind:
                raise DeckError(
                    f"port '{need}' of '{name}' is bound to nothing. Give it a node: bind = {{ {need} = \"...\" }}.",
                    model.where(f"submodels.{name}"),
                )
            target = part.bind[need]
            key = f"submodels.{name}.bind.{need}"
            self._alias[f"{prefix}{name}.{need}"] = self.end(model, prefix, target, key)
            self._seen[f"{prefix}{name}.{need}"] = self.seen(model, prefix, part.sees.get(need, target), key)

    def end(self, model: Model, prefix: str, raw: str, key: str) -> str:
        """Return the canonical node that a name inside a model stands for; offered ports only, where it lies in a submodel."""
        path = model.canonical(raw)
        head, _, rest = path.partition(".")
        if (
            rest
            and head in model.submodels
            and not any(model.submodels[head].model.canonical(o) == rest for o in model.submodels[head].model.offers)
        ):
            known = model.submodels[head].model.offers
            exists = prefix + path in self.nodes
            say = (
                f"'{head}' does not offer '{rest}'. It offers {', '.join(known) or 'nothing'}."
                if exists
                else f"no node '{raw}'.{self._near(prefix, path)}"
            )
            raise NameNotFoundError(say, model.where(key))
        full = prefix + path
        full = self._alias.get(full, full)
        if full not in self.nodes and full not in self.boundaries:
            hint = self._near(prefix, path) or f' Write it under nodes, or, where it is supplied from outside, into needs = ["{raw}"].'
            raise NameNotFoundError(f"no node '{raw}'.{hint}", model.where(key))
        return full

    def seen(self, model: Model, prefix: str, raw: str, key: str) -> str:
        """Return the canonical node that a surface sees under a name: of a need that is bound apart, the one it sees."""
        node = self.end(model, prefix, raw, key)
        return self._seen.get(prefix + model.canonical(raw), node)

    def _near(self, prefix: str, path: str) -> str:
        known = [n.removeprefix(prefix) for n in (*self.nodes, *self._alias) if n.startswith(prefix)]
        return nearest(path, known)

    def surface(self, model: Model, prefix: str, raw: str, key: str) -> tuple[str, Model, str]:
        """Return the canonical path of a surface, the model that owns it and that model's prefix."""
        path = model.canonical(raw)
        owner, own_prefix, rest = model, prefix, path
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
            known = [s for s in owner.surfaces]
            raise NameNotFoundError(f"no surface '{raw}'.{nearest(rest, known)} Declare it under surfaces.", model.where(key))
        return own_prefix + rest, owner, own_prefix

    def find(self, raw: str, where: str = "") -> str:
        """Return the canonical path of a node or boundary named by a scenario, a record or a caller."""
        path = self.model.canonical(raw)
        path = self._alias.get(path, path)
        if path not in self.nodes and path not in self.boundaries:
            known = [*self.nodes, *self.boundaries]
            hint = nearest(path, [*known, *self.model.aliases]) or (f" There are {', '.join(known)}." if len(known) <= FEW else "")
            raise NameNotFoundError(f"no node '{raw}'.{hint}", where or self.model.title)
        return path
