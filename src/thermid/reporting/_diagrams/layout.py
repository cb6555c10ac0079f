"""Where everything of a diagram stands: nodes in one column, submodels as boxes around them, boundaries as rails at the right edge.

A column keeps every label readable at any depth: conductors between neighbours run straight down, all others through lanes at the right,
and those to a boundary straight to its rail. Within a box the order is the one that makes the conductors short.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from thermid.model.tree import Flat, FlatConductor, Tree

PAD, HEADER, GAP, WIDE_GAP, MARGIN = 12.0, 26.0, 16.0, 40.0, 14.0
PORT, LOAD_PORT, LOAD_WIDTH = 19.0, 34.0, 104.0
NARROW = "iljtfrI.,:;'|()[] "


def width_of(text: str, size: float = 11.0) -> float:
    """Return about how wide a text is in a sans-serif font. [px]"""
    return size * sum(0.33 if c in NARROW else 0.72 if c.isupper() or c in "mwMW" else 1.0 if ord(c) > 0x2E80 else 0.58 for c in text)


def clipped(text: str, width: float, size: float = 11.0) -> str:
    """Return a text that fits in a width, with an ellipsis where it was cut."""
    if width_of(text, size) <= width:
        return text
    while text and width_of(text + "…", size) > width:
        text = text[:-1]
    return text + "…"


@dataclass
class Row:
    """One node in the column."""

    path: str
    massless: bool
    loads: int
    box: str
    y: float = 0.0
    height: float = 0.0
    ports: list[int] = field(default_factory=list)

    @property
    def middle(self) -> float:
        """Its middle. [px]"""
        return self.y + self.height / 2

    def port(self, wire: int) -> float:
        """Height at which a conductor leaves at the right. [px]"""
        return self.middle + PORT * (self.ports.index(wire) - (len(self.ports) - 1) / 2)


@dataclass
class Box:
    """A model or submodel: its nodes and parts, top down."""

    prefix: str
    title: str
    depth: int
    items: list[str | Box]
    y: float = 0.0
    bottom: float = 0.0

    def leaves(self) -> Iterator[str]:
        """Yield the paths of its nodes, top down."""
        for item in self.items:
            if isinstance(item, Box):
                yield from item.leaves()
            else:
                yield item

    def boxes(self) -> Iterator[Box]:
        """Yield itself and every box inside, outer ones first."""
        yield self
        for item in self.items:
            if isinstance(item, Box):
                yield from item.boxes()


@dataclass
class Wire:
    """One conductor: straight between neighbours, through a lane, to a rail, or between rails; `span` holds the places of its two rows."""

    conductor: FlatConductor
    name: str
    value: str
    way: str
    rows: tuple[Row, ...]
    rails: tuple[str, ...]
    span: tuple[int, int] = (0, 0)
    lane: int = 0
    label_y: float = 0.0


@dataclass
class DiagramLayout:
    """A diagram before it is drawn; all lengths in px."""

    root: Box
    rows: dict[str, Row]
    wires: list[Wire]
    left: float
    right: float
    lanes: list[float]
    labels: float
    rails: dict[str, float]
    frame: float
    bottom: float
    width: float

    def box_edges(self, box: Box) -> tuple[float, float]:
        """Left and right edge of a box. [px]"""
        inset = PAD * box.depth
        return MARGIN + inset, self.frame if box.depth == 0 else self.right + PAD * (1 + self.depth - box.depth)

    @property
    def depth(self) -> int:
        """How deep boxes are nested."""
        return max(b.depth for b in self.root.boxes())


def _tree(model: Tree, prefix: str = "", depth: int = 0, folded: Sequence[str] = ()) -> Box:
    name = prefix.rstrip(".").rpartition(".")[2]
    title = f"{name} · {model.title}" if name and name != model.title else name or model.title
    leaves = [prefix + n for n in (*model.nodes, *(j.mid or f"{k}.mid" for k, j in model.joints.items()))]
    parts: list[str | Box] = [
        f"{prefix}{k}" if f"{prefix}{k}." in folded else _tree(s.model, f"{prefix}{k}.", depth + 1, folded)
        for k, s in model.submodels.items()
    ]
    return Box(prefix, title, depth, [*leaves, *parts])


def _order(root: Box, pairs: Sequence[tuple[str, str]]) -> None:
    """Move items within their boxes as long as that makes conductors shorter."""

    def length() -> int:
        at = {path: k for k, path in enumerate(root.leaves())}
        return sum(abs(at[a] - at[b]) for a, b in pairs)

    best = length()
    for _ in range(6):
        before = best
        for box in root.boxes():
            reach = len(box.items) if len(box.items) <= 20 else 3
            for k in range(len(box.items)):
                for to in range(max(0, k - reach), min(len(box.items), k + reach + 1)):
                    box.items.insert(to, box.items.pop(k))
                    now = length()
                    if now < best:
                        best = now
                    else:
                        box.items.insert(k, box.items.pop(to))
        if best == before:
            return


def _wires(flat: Flat, rows: Mapping[str, Row], values: Mapping[str, str]) -> list[Wire]:
    """Return the conductors with the way that each takes."""
    at = {path: k for k, path in enumerate(rows)}
    taken: set[tuple[int, int]] = set()
    out = []
    for c in flat.conductors:
        inner = tuple(rows[e] for e in c.ends if e in rows)
        rails = tuple(e for e in c.ends if e not in rows)
        prefix = _common([row.box for row in inner])
        wire = Wire(c, c.path.removeprefix(prefix), values.get(c.path, ""), "rail" if inner else "rails", inner, rails)
        if len(inner) == 2:
            low, high = sorted(at[e] for e in c.ends)
            wire.span = (low, high)
            wire.way = "straight" if high - low == 1 and (low, high) not in taken else "lane"
            taken.add((low, high))
        out.append(wire)
    lanes: list[list[tuple[int, int]]] = []
    for wire in sorted((w for w in out if w.way == "lane"), key=lambda w: w.span[1] - w.span[0]):
        low, high = wire.span
        free = (k for k, used in enumerate(lanes) if all(high <= a or low >= b for a, b in used))
        wire.lane = next(free, len(lanes))
        if wire.lane == len(lanes):
            lanes.append([])
        lanes[wire.lane].append((low, high))
    return out


def _common(boxes: Sequence[str]) -> str:
    """Return the prefix of the innermost box that holds all of some boxes."""
    first, *others = [b.split(".")[:-1] for b in boxes] or [[]]
    common = [steps for steps in (first[:n] for n in range(len(first), 0, -1)) if all(o[: len(steps)] == steps for o in others)]
    return ".".join(common[0]) + "." if common else ""


def _ports(wires: Sequence[Wire], rows: Mapping[str, Row]) -> None:
    """Give every row its ports, in the order in which the fewest lines cross: up the near lanes, to the rails, down the far lanes."""
    at = {path: k for k, path in enumerate(rows)}
    for path, row in rows.items():
        keyed = []
        for k, w in enumerate(wires):
            if all(r is not row for r in w.rows):
                continue
            if w.way == "rail":
                keyed.append(((1, 0), k))
            elif w.way == "lane":
                up = w.span[0] < at[path]
                keyed.append(((0, w.lane) if up else (2, -w.lane), k))
        row.ports = [k for _, k in sorted(keyed)]
        least = 22.0 if row.massless else 50.0
        row.height = max(least, PORT * len(row.ports) + (4 if row.massless else 10), LOAD_PORT * row.loads + 8)


def _stack(box: Box, rows: Mapping[str, Row], y: float, straight: Mapping[tuple[str, str], list[Wire]]) -> float:
    """Give every box and row its place from y down; return the end of the box."""
    box.y = y
    y += HEADER
    for k, item in enumerate(box.items):
        if k:
            joined = straight.get((_ends(box.items[k - 1])[1], _ends(item)[0]), [])
            gap = WIDE_GAP if joined else GAP
            for wire in joined:
                wire.label_y = y + gap / 2
            y += gap
        if isinstance(item, Box):
            y = _stack(item, rows, y, straight)
        else:
            rows[item].y = y
            y += rows[item].height
    box.bottom = y + PAD
    return box.bottom


def _ends(item: str | Box) -> tuple[str, str]:
    """Return the uppermost and the lowest node of an item; nothing of a box without any."""
    leaves = [item] if isinstance(item, str) else [*item.leaves()] or [""]
    return leaves[0], leaves[-1]


def _label_lanes(wires: Sequence[Wire], rows: Mapping[str, Row]) -> None:
    """Put the label of each lane between two rows, as near to the middle of the lane as there is room."""
    order = list(rows.values())
    for wire in (w for w in wires if w.way == "lane"):
        low, high = wire.span
        gaps = [((b.y + a.y + a.height) / 2, b.y - a.y - a.height) for a, b in zip(order[low:high], order[low + 1 : high + 1], strict=True)]
        middle = (order[low].middle + order[high].middle) / 2
        wire.label_y = min(gaps, key=lambda g: abs(g[0] - middle) - 2 * min(g[1], WIDE_GAP))[0]


def arrange(flat: Flat, values: Mapping[str, str], notes: Mapping[str, str], folded: Sequence[str] = ()) -> DiagramLayout:
    """Return the layout of a model.

    Parameters
    ----------
    flat : Flat     The model laid flat.
    values : dict   Conductor -> text of its conductance.
    notes : dict    Node or boundary -> what stands under its name; the column and the rails are made wide enough.
    folded : sequence of str    Prefixes of submodels that `flat` holds as one node.
    """
    root = _tree(flat.names.model, folded=folded)
    node_of_path = {n.path: n for n in flat.nodes}
    pairs = [c.ends for c in flat.conductors if all(e in node_of_path for e in c.ends)]
    _order(root, pairs)
    owner = {p: b.prefix for b in root.boxes() for p in b.items if isinstance(p, str)}
    loads = [load.node for load in flat.loads]
    rows = {p: Row(p, not node_of_path[p].fields, loads.count(p), owner[p]) for p in root.leaves()}
    wires = _wires(flat, rows, values)
    _ports(wires, rows)
    straight: dict[tuple[str, str], list[Wire]] = {}
    order = list(rows)
    for w in wires:
        if w.way == "straight":
            straight.setdefault((order[w.span[0]], order[w.span[1]]), []).append(w)
    top = MARGIN + (34.0 if flat.names.boundaries else 0.0)
    bottom = _stack(root, rows, top, straight)
    _label_lanes(wires, rows)
    depth = max(b.depth for b in root.boxes())
    x_left = MARGIN + PAD * (depth + 1) + LOAD_WIDTH
    texts = [(p.rpartition(".")[2], notes.get(p, "")) for p in rows]
    column = min(210.0, max(118.0, *(24 + max(width_of(a, 13), width_of(b)) for a, b in texts)))
    right = x_left + column
    x = right + PAD * (depth + 1) + 10
    lanes = []
    for lane in range(1 + max((w.lane for w in wires if w.way == "lane"), default=-1)):
        lanes.append(x)
        x += 16 + min(110.0, max(max(width_of(w.name), width_of(w.value)) for w in wires if w.way == "lane" and w.lane == lane))
    to_rails = [width_of(f"{w.name}  {w.value}") for w in wires if w.way in ("rail", "rails")]
    frame = x + 8 + min(240.0, max([*to_rails, 20.0])) + PAD
    rails, at = {}, frame + 22
    used = {b: sum(b in w.rails for w in wires) for b in flat.names.boundaries}
    for name in sorted(used, key=lambda b: -used[b]):
        half = max(18.0, min(60.0, max(width_of(name, 13), width_of(notes.get(name, ""))) / 2 + 6))
        rails[name] = at + half - 10
        at += 2 * half
    bottom += PORT * sum(w.way == "rails" for w in wires)
    return DiagramLayout(root, rows, wires, x_left, right, lanes, x + 8, rails, frame, bottom, max(at + MARGIN, 430.0))
