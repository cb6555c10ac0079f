"""Box colours: how much of each part is physics and how much is data, kept when parts become a whole."""

from __future__ import annotations

from thermid.model._tree.model import Model

COLOURS = ("white", "light grey", "dark grey", "black")
"""From pure theory to pure experiment (Isermann and Münchhof, Identification of Dynamic Systems, 2011, DOI 10.1007/978-3-540-78879-9)."""


def node_boxes(model: Model) -> dict[str, str]:
    """Return node -> the colour of the part that it belongs to; the node of a joint belongs to whoever joins."""
    return {
        start + name: part.box
        for part, start in model.walk()
        for name in (*part.nodes, *(joint.mid or f"{key}.mid" for key, joint in part.joints.items()))
    }


def mixed(colours: set[str]) -> str:
    """Return one tag for several colours: the colour they share, or all of them from light to dark.

    >>> mixed({"light grey"}), mixed({"black", "light grey"})
    ('light grey', 'light grey + black')
    """
    return " + ".join(sorted(colours, key=COLOURS.index))


def part_boxes(model: Model) -> dict[str, str]:
    """Return submodel -> its tag with that of everything in it; the empty path is the whole."""
    nodes = node_boxes(model)
    parts = {prefix.removesuffix("."): part for part, prefix in model.walk()}
    return {
        path: mixed({part.box, *(colour for node, colour in nodes.items() if not path or node.startswith(f"{path}."))})
        for path, part in parts.items()
    }
