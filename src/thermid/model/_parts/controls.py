"""Controls: a share that follows temperatures, by which loads, conductors, surfaces, streams and boundaries are multiplied.

A thermostat, a proportional or PID controller, a table, or a machine of modes. docs/controls.md has the grammar with a picture of each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from thermid.base.errors import DeckError, refuse_first, refuse_unknown
from thermid.model._laws.stores import Curve
from thermid.model._parts.parameter import Parameter

KINDS_OF_CONTROL: Final = ("thermostat", "proportional", "pid", "table", "modes")
"""What a control may be, one of them."""
TEMPERATURE_SLOT: Final = "follows"
"""Slot of a value that is a temperature, or a difference where a control follows one."""
CONTROL_SLOTS: Final[Mapping[str, str]] = {
    "thermostat.on_below": TEMPERATURE_SLOT,
    "thermostat.off_above": TEMPERATURE_SLOT,
    "thermostat.on_above": TEMPERATURE_SLOT,
    "thermostat.off_below": TEMPERATURE_SLOT,
    "proportional.setpoint": TEMPERATURE_SLOT,
    "proportional.band": "K",
    "proportional.lowest": "1",
    "proportional.highest": "1",
    "pid.setpoint": TEMPERATURE_SLOT,
    "pid.band": "K",
    "pid.integral_time": "s",
    "pid.derivative_time": "s",
    "pid.filter_time": "s",
    "pid.lowest": "1",
    "pid.highest": "1",
    "pid.begins": "1",
}
"""Values of a control with the units of their slots; shares of modes and levels of transitions stand beside them, see `slot_of`."""
MAX_FOLLOWED_NODES: Final = 3
"""Nodes that one control follows at most."""


@dataclass(frozen=True)
class ModeChange:
    """A way from one mode to another.

    Parameters
    ----------
    before, after : str     Modes.
    sense : str             above, below (a temperature) or after (a time in the mode): which of the three decides; its value is the
                            field ``transitions.<name>.<sense>`` of the control.
    follows : dict          Node -> weight; that of the control where empty.
    """

    before: str
    after: str
    sense: str
    follows: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Control:
    """A share that follows temperatures.

    Parameters
    ----------
    kind : str              One of `KINDS_OF_CONTROL`.
    follows : dict          Node -> weight of its temperature: weights sum to one (a temperature, a mean) or to zero (a difference).
    fields : dict           See `CONTROL_SLOTS`; of modes ``modes.<mode>`` [-] and ``transitions.<name>.above``, ``.below`` or ``.after``.
    curve : Curve or None   Share over what it follows. [-]
    starts : str            Mode at the start.
    transitions : dict      Name -> ModeChange.
    sample : float          Time between two looks at the temperature; zero for a control that never rests. [s]
    """

    kind: str
    follows: Mapping[str, float]
    fields: Mapping[str, Parameter] = field(default_factory=dict)
    curve: Curve | None = None
    starts: str = ""
    transitions: Mapping[str, ModeChange] = field(default_factory=dict)
    sample: float = 0.0
    test_only: bool = False


def of_difference(follows: Mapping[str, float]) -> bool:
    """Return whether the weights of what a control follows sum to zero: a difference of temperatures."""
    return abs(sum(follows.values())) < 1e-9


def followed(written: object, where: str) -> dict[str, float]:
    """Return node -> weight of its temperature from what a deck writes: a node, a list of nodes (their mean), or nodes with weights.

    Raises
    ------
    DeckError   When weights sum to neither one nor zero, or there are too many nodes.
    """
    if isinstance(written, str):
        return {written: 1.0}
    if isinstance(written, Mapping):
        out = {str(node): float(weight) for node, weight in written.items()}
    else:
        nodes = [str(node) for node in written]  # type: ignore[attr-defined]  # checked by the grammar
        out = {node: 1.0 / len(nodes) for node in nodes}
    if not 0 < len(out) <= MAX_FOLLOWED_NODES:
        raise DeckError(
            f"a control follows one to {MAX_FOLLOWED_NODES} nodes; {len(out)} are given. Connect more to a massless node and follow that.",
            where,
            code="model.law-refused",
        )
    total = sum(out.values())
    if not (abs(total) < 1e-9 or abs(total - 1.0) < 1e-9):
        raise DeckError(
            f"the weights of the nodes that a control follows sum to {total:g}; give weights that sum to one (a temperature) or zero "
            "(a difference).",
            where,
            code="model.law-refused",
        )
    return out


def slot_of(name: str, difference: bool) -> str:
    """Return the unit text of the slot of one field of a control.

    Parameters
    ----------
    name : str          As in `Control.fields`.
    difference : bool   Whether the control, or the transition that the field belongs to, follows a difference.
    """
    group, _, rest = name.partition(".")
    if group == "modes":
        return "1"
    slot = CONTROL_SLOTS.get(name, "s" if rest.endswith(".after") else TEMPERATURE_SLOT)
    return ("K" if difference else "temperature") if slot == TEMPERATURE_SLOT else slot


COMPLEMENT: Final = "1 - "
"""What stands before the name of a control whose rest is taken."""


def named_control(raw: str) -> tuple[str, bool]:
    """Return the name of a control, and whether the rest of its share is taken, as ``1 - valve`` writes it."""
    text = raw.strip()
    head, sign, name = text.partition("-")
    return (name.strip(), True) if sign and head.strip() == "1" else (text, False)


def check_modes(control: Control, where: str) -> None:
    """Refuse a control of modes with fewer than two, with a name that is no mode, or with a mode that no transition leads to.

    Raises
    ------
    DeckError
    """
    modes = [name.partition(".")[2] for name in control.fields if name.startswith("modes.")]
    reached = {control.starts, *(t.after for t in control.transitions.values())}
    lost = ", ".join(mode for mode in modes if mode not in reached)
    named = {"starts": control.starts} | {
        f"transitions.{name}.{end}": mode for name, t in control.transitions.items() for end, mode in (("from", t.before), ("to", t.after))
    }
    for key, mode in named.items():
        refuse_unknown([mode], modes, where, f"{key}: there is no mode '{{}}'.{{near}} There are {{known}}.", DeckError)
    refuse_first(
        lambda _: where,
        (len(modes) < 2, "give at least two modes, each with its share.", "", "value.incomplete"),
        *(
            (t.before == t.after, f"the transition '{name}' leads from '{t.before}' to itself.", "", "model.self-reference")
            for name, t in control.transitions.items()
        ),
        (lost, f"no transition leads to the mode '{lost}'. Add a transition to it, or remove the mode.", "", "model.law-refused"),
    )
