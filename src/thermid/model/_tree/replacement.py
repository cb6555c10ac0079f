"""Replacing a part: what belonged to the old one goes, what belongs to the place starts anew; and what a part touches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from thermid.base.errors import DeckError, NameNotFoundError, nearest
from thermid.base.units import unit
from thermid.model._parts.elements import Conductor, HeatLoad, Joint, Surface
from thermid.model._parts.parameter import Parameter
from thermid.model._tree.identity import cut, definition_of, inside, lay_values, local_identities
from thermid.model._tree.tree import Element, Entry, M, ParameterSet, Submodel, Tree, used_offers

PLACE, SCATTER = 0.30, 0.25
"""Standard deviation of the logarithm: of a coefficient that the old part had at its place, and between joints of parts of one kind."""
INTERFACE = {"contact_conductance": "W/(m^2 K)", "conductance": "W/K", "conductivity": "W/(m K)", "gap.htc": "W/(m^2 K)"}
"""Fields by which joints and conductors differ from one another; areas and thicknesses are as drawn."""
COEFFICIENTS = ("effective_htc", "htc", "htc.coefficient")


@dataclass(frozen=True)
class Dropped:
    """A value of the old part that went with it.

    Parameters
    ----------
    path, text : str    Where it stood, and what it was.
    origin : str        Who set it: a stage, a [set], a caller.
    why : str           'of the old part', or 'of its place' for one from which the new part starts.
    """

    path: str
    text: str
    origin: str
    why: str


@dataclass(frozen=True)
class PlaceStart:
    """A value of the place: where it starts with the new part, and how far it may be from there.

    Parameters
    ----------
    path : str          A coefficient of the new part, or a field of a joint that gets a number of its own.
    text : str          Where it starts.
    log_sd : float      Standard deviation of its logarithm about the start. [-]
    origin : str        'twin': from joints of the same kind; 'place': its value with the old part.
    twins : tuple       What shared it before.
    of_part : bool      Whether it is a coefficient of the part's surfaces, and not of a joint.
    """

    path: str
    text: str
    log_sd: float
    origin: str
    twins: tuple[str, ...] = ()
    of_part: bool = False

    def __str__(self) -> str:
        """Return the start as an assumption in words."""
        whose = f"that of {', '.join(self.twins)}" if self.twins else "its value with the old part"
        return f"{self.path} is {whose}, {short_text(self.text)} within {100 * self.log_sd:.0f} %"


@dataclass(frozen=True)
class Replacement:
    """What became of the values of a place when its part was replaced.

    Parameters
    ----------
    path : str          The place.
    old, new : str      Titles of the parts.
    dropped : tuple     What belonged to the old part.
    kept : tuple        Rows on paths of the part that stay: what the deck above derives from its own values, and what the caller kept.
    starts : tuple      Values of the place, each with the spread that counts until it is fitted again.
    assumes : tuple     What is taken for granted of the new part, in words.
    untied : tuple      Paths of the part that had one value with a twin, and have their own now.
    """

    path: str
    old: str
    new: str
    dropped: tuple[Dropped, ...] = ()
    kept: tuple[str, ...] = ()
    starts: tuple[PlaceStart, ...] = ()
    assumes: tuple[str, ...] = ()
    untied: tuple[str, ...] = ()

    def starting(self, model: M) -> M:
        """Return the model with every value of the place at its start, those of joints apart from their twins."""
        return lay_values(model, {s.path: s.text for s in self.starts}, f"start after {self.new} replaced {self.old}")


def replaced(model: M, raw: str, new: M, keep: Sequence[str] = ()) -> tuple[M, Replacement]:
    """Return a model with another part at a path, and what became of the values there; see `Model.replaced`."""
    path = model.canonical(raw)
    old = model.submodel(path)
    new_values = new.parameter_table()
    stays = frozenset(model.canonical(k) for k in keep)
    before = model.parameter_table()
    for k in (k for k in keep if model.canonical(k) not in before):
        raise NameNotFoundError(f"'{k}' cannot be kept: the model has no such value.{nearest(model.canonical(k), before)}", model.title)
    after = _at(model, path, new, path, stays, new_values)
    now = after.parameter_table()
    lost = [k for k in keep if (p := model.canonical(k)) in now and now[p].origin != before[p].origin]  # laid over the old part itself
    for k in lost:
        after = lay_values(after, {k: before[model.canonical(k)].parameter}, before[model.canonical(k)].origin)
    now = after.parameter_table()
    own_values = {f"{path}.{p}": e for p, e in without_layers(old).parameter_table().items()}
    # what somebody above the part's own deck gave, or a stage of the part
    as_in_deck = {p: (e.parameter.text, e.origin) for p, e in own_values.items()}
    laid_values = {p: e for p, e in before.items() if inside(p, path) and as_in_deck.get(p) != (e.parameter.text, e.origin)}
    still_laid = tuple(p for p in laid_values if p in now and now[p].origin == laid_values[p].origin)
    gone = {p: e for p, e in laid_values.items() if p not in still_laid}
    values = ParameterSet(model)
    # values that the model around the part had set, and no layer of the part itself
    own_layers = {layer.origin for layer in old.layers}
    above = {p for p, e in gone.items() if e.origin not in own_layers or any(origin.startswith("[set]") for origin, _ in e.shadowed)}
    place = above.intersection(coefficients(model, values, path))
    dropped = tuple(
        Dropped(p, e.parameter.text, e.origin, "of its place" if p in place and p in now else "of the old part") for p, e in gone.items()
    )
    of_surfaces = [PlaceStart(p, before[p].parameter.text, PLACE, "place", of_part=True) for p in sorted(place) if p in now]
    starts = (*of_surfaces, *_joints(model, after, path, values, stays))
    assumes = (f"{new.title} has the values of its deck", *map(str, starts), *(f"{p} is unchanged" for p in still_laid))
    # no twin shares what the old part had of it: the twin keeps its value, the new part has its deck's
    after = cut(after, [p for p in _with_twins(after, path) if p in gone and p in now])
    untied = tuple(p for p in _with_twins(model, path) if p not in _with_twins(after, path))
    return after, Replacement(path, old.title, new.title, dropped, still_laid, starts, assumes, untied)


def short_text(text: str) -> str:
    """Return a value as people read it: fitted numbers have all their digits in a model."""
    number, _, rest = text.partition(" [")
    try:
        return f"{float(number):.4g}" + (f" [{rest}" if rest else "")
    except ValueError:
        return text


def coefficients(model: Tree, values: ParameterSet, part: str) -> set[str]:
    """Return the numbers inside a part that set a coefficient of heat transfer of its surfaces."""
    numbers: set[str] = set()
    for owner, prefix in model.submodel(part).walk(f"{part}."):
        paths = [f"{prefix}{name}.{coefficient}" for name in owner.surfaces for coefficient in COEFFICIENTS]
        numbers |= {values.literal_behind(path) for path in paths if path in values.table}
    return numbers


def without_layers(model: Tree) -> Tree:
    """Return a model without the values that were laid over it and its parts; what is cut from its twins stays so."""
    return replace(model, layers=(), submodels={n: s.with_model(without_layers(s.model)) for n, s in model.submodels.items()})


def _at(model: M, path: str, new: M, full: str, keep: frozenset[str], new_values: Mapping[str, Entry]) -> M:
    """Return a model with the new part, and without rows on paths of the old one, here and at every level below."""
    head, _, rest = path.partition(".")
    old = model.submodels[head]
    if rest:
        deeper = frozenset(k.partition(".")[2] for k in keep if k.partition(".")[0] == head)
        part = old.with_model(_at(old.model, rest, new, full, deeper, new_values))
    else:
        bind = _ports(model, head, new, full)
        sees = {need: node for need, node in old.sees.items() if need in bind}
        part = Submodel(new, bind, old.definition if new == old.model else definition_of(new), sees)
    _check_read(model, path, new_values, full)

    def stays(raw: str, parameter: Parameter) -> bool:
        """Whether a value is kept: of another part, named in `keep`, or a formula that reads what the new part has."""
        p = model.canonical(raw)
        return not inside(p, path) or p in keep or (not parameter.is_literal and p.removeprefix(f"{path}.") in new_values)

    return replace(
        model,
        submodels={**model.submodels, head: part},
        settings={p: v for p, v in model.settings.items() if stays(p, v)},
        layers=tuple(trimmed for layer in model.layers if (trimmed := layer.keeping(stays)).values),
        cuts=tuple(c for c in model.cuts if not inside(c, path)),
    )


def _ports(model: Tree, head: str, new: Tree, path: str) -> dict[str, str]:
    """Return need -> node for the new part, as the old one was bound.

    Raises
    ------
    DeckError   When it needs or offers other ports than are used; the message names them.
    """
    old = model.submodels[head]
    gone = sorted(used_offers(model, head) - {new.canonical(offer) for offer in new.offers})
    unbound = sorted(set(new.needs) - set(old.bind))
    if gone or unbound:
        has, new_has = (", ".join(sorted({*m.needs, *m.offers})) for m in (old.model, new))
        lack = "; ".join(
            [f"it does not offer {g}, which is used here" for g in gone] + [f"its need {u} is bound to nothing" for u in unbound]
        )
        raise DeckError(
            f"'{path}' has ports {has}; its replacement has {new_has}: {lack}. Add the port to the new part, or keep the old part.",
            model.title,
            code="model.refused",
        )
    return {need: node for need, node in old.bind.items() if need in new.needs}


def _check_read(model: Tree, path: str, new_values: Mapping[str, Entry], full: str) -> None:
    """Refuse a part that lacks a value which a deck above reads.

    Raises
    ------
    DeckError   With what to do.
    """
    rows = [(key, parameter) for _, key, parameter in model.own_parameters()] + [(f"set.{p}", v) for p, v in model.settings.items()]
    for key, parameter in rows:
        for name in parameter.expression.names:
            local = model.canonical(name)
            if inside(local, path) and local.removeprefix(f"{path}.") not in new_values:
                raise DeckError(
                    f"'{parameter.text}' reads '{name}', which the replacement of '{full}' does not have. Give the new part a parameter of "
                    "that name, or write a number here.",
                    model.where(key),
                    code="model.refused",
                )


def _joints(model: Tree, after: Tree, path: str, values: ParameterSet, keep: frozenset[str]) -> Iterator[PlaceStart]:
    """Yield what the joints at the part start from: a number of their own, where other joints shared it."""
    beside = touching(model, path)
    new_parameters = ParameterSet(after)
    ties = local_identities(model)
    numbers = values.evaluate({})
    done = set(keep)
    for element, fields in beside.elements.items():
        for row in fields:
            kind = row.removeprefix(f"{element}.")
            if kind not in INTERFACE or row not in new_parameters.table or inside(row, path):
                continue
            # the number behind a field if it acts on nothing elsewhere; empty where the field needs a number of its own
            own_roots = [p for p in _roots(values, row) if not any(q in beside.shared for q in values.downstream([p]))]
            root = own_roots[0] if len(own_roots) == 1 else ""
            at = root or row
            if at in done or row in done:
                continue
            done.add(at)
            also = (
                {
                    beside.shared[q]
                    for p in _roots(values, row)
                    for q in values.downstream([p])
                    if q in beside.shared and q == f"{beside.shared[q]}.{kind}"
                }
                if not root
                else {p.removesuffix(f".{kind}") for p in ties[at].paths if p != at}
            )
            literal = values.table[at].parameter.expression.literal
            text = values.table[at].parameter.text if literal is not None else f"{float(numbers[row]):.9g} [{INTERFACE[kind]}]"
            yield PlaceStart(at, text, SCATTER, "twin" if also else "place", tuple(sorted(also)))


def _roots(values: ParameterSet, field: str) -> list[str]:
    """Return the numbers behind a field that are conductances or conductivities; lengths and areas are as drawn."""
    conducting = {unit(text).dimension for text in INTERFACE.values()}
    literals = (p for p in values.order if values.table[p].parameter.is_literal and values.dimension(p) in conducting)
    return [p for p in literals if field in values.downstream([p])]


def _with_twins(model: Tree, path: str) -> list[str]:
    """Return the values inside a part that it shares with something outside."""
    identities = local_identities(model)
    return [p for p, one in identities.items() if inside(p, path) and any(not inside(q, path) for q in one.paths)]


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
        """Return (elements and settings through which the value at `path` acts on the part, elements elsewhere that it acts on)."""
        acts = set(values.downstream([path]))
        touched = [name for name, fields in self.elements.items() if acts & set(fields)]
        touched += sorted(p for p in self.settings if p in acts)
        return touched, sorted({self.shared[p] for p in acts if p in self.shared})


def touching(model: Tree, part: str) -> Touching:
    """Return the elements, settings and neighbours that attach to the submodel at a path, at every level above it."""
    out = Touching()
    _visit(model, "", part, part, out)
    out.neighbours = {n for n in out.neighbours if not inside(n, part)}
    return out


def _visit(model: Tree, prefix: str, rest: str, part: str, out: Touching) -> None:
    """Add to `out` what a model, which holds the part at `rest` below it, attaches to the part, sets in it, or has elsewhere."""
    fields: dict[str, list[str]] = {}
    for name, key, _ in model.own_parameters():
        if not key.startswith("parameters."):
            fields.setdefault(name.partition(".")[0], []).append(prefix + name)
    for _, name, element in model.elements():
        ends = {prefix + model.canonical(e) for e in _ends(element)}
        if any(inside(e, part) for e in ends):
            out.elements[prefix + name] = fields.get(name, [])
            out.neighbours |= ends
        else:
            out.shared |= dict.fromkeys(fields.get(name, []), prefix + name)
    out.settings |= {p for p in (prefix + model.canonical(raw) for raw in model.settings) if inside(p, part)}
    head, _, deeper = rest.partition(".")
    for name, inner in model.submodels.items():
        for other, at in inner.model.walk(f"{prefix}{name}.") if name != head else ():
            values = [value for value, key, _ in other.own_parameters() if not key.startswith("parameters.")]
            out.shared |= {at + value: at + value.partition(".")[0] for value in values}
    if deeper:
        _visit(model.submodels[head].model, f"{prefix}{head}.", deeper, part, out)


def _ends(element: Element) -> Iterable[str]:
    """Return the nodes and surfaces that heat passes to through an element; areas that it only takes are no path."""
    if isinstance(element, Joint | Conductor):
        return element.between
    if isinstance(element, Surface):
        return [e for e in (element.of, element.sees) if e]
    if isinstance(element, HeatLoad):
        return [element.into]
    return ()
