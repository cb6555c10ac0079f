"""Structures that the two-heater board could have, as decks in Python: what each one is, what is free in it, what is plausible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import thermid as td


@dataclass(frozen=True, eq=False)
class Candidate:
    """One structure.

    Parameters
    ----------
    title : str             What it is.
    model : Model           Its deck.
    free : tuple of str     What is fitted, one value for all runs.
    sensor : str            The node of a heater that its sensor reads.
    slow : tuple of str     Nodes whose temperature at the start each run has for itself.
    delay : float           How late commands reach the heaters. [s]
    """

    title: str
    model: td.Model
    free: tuple[str, ...]
    sensor: str = "sensor"
    slow: tuple[str, ...] = ()
    delay: float = 0.0


@dataclass(frozen=True)
class Heater:
    """What a heater is made of; numbers that stand here are held.

    Parameters
    ----------
    to_air : str        The node of the air or board that it gives heat to, beside the room; empty for none.
    power_law : float   Exponent of that path over its temperature difference. [-]
    loses : bool        Whether a linear path leads from it to the room.
    emissivity : float  Of its 10 cm2; 0 for no radiation. [-]
    walls : str         What it radiates to.
    beta : float        Rise of power with temperature. [1/K]
    lag : bool          Whether its sensor lags behind.
    curve : bool        Whether power may bend over the command.
    """

    to_air: str = "pcb"
    power_law: float = 0.0
    loses: bool = False
    emissivity: float = 0.9
    walls: str = "room"
    beta: float = 0.001
    lag: bool = True
    curve: bool = False

    def deck(self) -> dict[str, Any]:
        """Return the deck of one heater; 4 g of 500 J/(kg K), 10 cm2 and emissivity 0.9 are published."""
        parameters: dict[str, Any] = {
            "alpha": {"value": "1.2 [W]", "min": 0.05, "max": 10.0},
            "beta": {"value": f"{self.beta} [1/K]", "min": -0.01, "max": 0.01},
        }
        nodes: dict[str, Any] = {"body": {"mass": "4 [g]", "specific_heat": {"value": "500 [J/(kg K)]", "min": 100, "max": 5000}}}
        load: dict[str, Any] = {
            "into": "body",
            "power": "alpha",
            "temperature_coefficient": "beta",
            "reference_temperature": "25 [degC]",
        }
        deck: dict[str, Any] = {"title": "Heater", "parameters": parameters, "nodes": nodes, "loads": {"heater": load}, "conductors": {}}
        if self.curve:
            load["command_curve"] = {"value": 0.0, "min": -0.9, "max": 0.9}
        if self.lag:
            parameters |= {"tau": {"value": "20.3 [s]", "min": 1, "max": 80}, "probe": "0.02 [J/K]"}
            nodes["sensor"] = {"capacitance": "probe"}
            deck["conductors"]["lag"] = {"kind": "conduction", "between": ["body", "sensor"], "conductance": "probe/tau"}
        if self.loses:
            deck["conductors"]["loss"] = _path("body", "room", "to_room", "0.008 [W/K]", parameters)
        if self.to_air and self.power_law:
            # the coefficient is per 10 cm2, the published area
            parameters["film"] = {"value": "1.5 [W/(m^2 K)]", "min": 0.01, "max": 100}
            htc = {"coefficient": "film", "exponent": self.power_law}
            deck["conductors"]["foot"] = {"kind": "convection", "between": ["body", self.to_air], "htc": htc, "area": "10 [cm^2]"}
        elif self.to_air:
            deck["conductors"]["foot"] = _path("body", self.to_air, "to_board", "0.003 [W/K]", parameters)
        if self.emissivity:
            emissivity = {"value": self.emissivity, "min": 0.05, "max": 1.0}
            skin = {"kind": "radiation", "between": ["body", self.walls], "area": "10 [cm^2]", "emissivity": emissivity}
            deck["conductors"]["skin"] = skin
        deck["needs"] = list(
            dict.fromkeys(n for n in (self.to_air, self.walls if self.emissivity else "", "room" if self.loses else "") if n)
        )
        deck["offers"] = list(nodes)
        return deck

    def free(self) -> tuple[str, ...]:
        """Return what is fitted of it; the capacitance of heater 1 is the anchor."""
        names = ["alpha"]
        names += ["tau"] if self.lag else []
        names += ["to_room"] if self.loses else []
        names += ["film" if self.power_law else "to_board"] if self.to_air else []
        return tuple(names)


def _path(a: str, b: str, name: str, start: str, parameters: dict[str, Any], most: float = 20.0) -> dict[str, Any]:
    """Return a linear path whose conductance is a parameter of its own."""
    parameters[name] = {"value": start, "min": 1e-5, "max": most}
    return {"kind": "conduction", "between": [a, b], "conductance": name}


def candidate(
    title: str,
    heater: Heater,
    slow: Mapping[str, str] | None = None,
    links: Mapping[str, tuple[str, str, str]] | None = None,
    *,
    more: tuple[str, ...] = (),
    delay: float = 0.0,
    boards: tuple[str, str] | None = None,
) -> Candidate:
    """Return a structure.

    Parameters
    ----------
    title : str         What it is.
    heater : Heater     Both heaters.
    slow : dict         Slow node -> its capacitance at the start, as text.
    links : dict        Parameter -> (node, node, conductance at the start).
    more : tuple        What is free beyond the usual.
    delay : float       [s]
    boards : (str, str) The board of each heater, where they have one each.
    """
    parameters: dict[str, Any] = {}
    conductors = {"facing": _path("h1.body", "h2.body", "between", "0.0031 [W/K]", parameters)}
    for name, (a, b, start) in (links or {}).items():
        conductors[f"{name}_link"] = _path(a, b, name, start, parameters)
    nodes = {n: {"capacitance": {"value": c, "min": 0.5, "max": 5000}} for n, c in (slow or {}).items()}
    free_here = tuple(parameters)
    parameters["first_reading"] = "0 [K]"  # how far the room stands above a run's first reading; found afterwards
    part = td.model_from_dict(heater.deck())
    ports = part.needs
    uses = [{p: (boards[k] if boards and p == heater.to_air else p) for p in ports} for k in range(2)]
    start = {"h2.alpha": "0.6 [W]"} | ({"h2.to_board": "0.002 [W/K]"} if heater.to_air and not heater.power_law else {})
    deck = {
        "title": title,
        "needs": ["room"],
        "parameters": parameters,
        "nodes": nodes,
        "conductors": conductors,
        "submodels": {"h1": {"use": part, "bind": uses[0]}, "h2": {"use": part, "bind": uses[1]}},
        "set": start,
    }
    both = [f"{h}.{n}" for h in ("h1", "h2") for n in heater.free()]
    free = (*both, "h2.body.specific_heat", *free_here, *(f"{n}.capacitance" for n in nodes), *more)
    return Candidate(title, td.model_from_dict(deck), free, "sensor" if heater.lag else "body", tuple(nodes), delay)


BOARD = {"pcb": "15 [J/K]"}
TO_ROOM = {"to_room": ("pcb", "room", "0.02 [W/K]")}
ALONE = Heater(to_air="", loses=True, emissivity=0.0, beta=0.0, lag=False)
BETAS = ("h1.beta", "h2.beta")


def candidates() -> dict[str, Candidate]:
    """Return short name -> structure, from the plainest up; `board` is the one of the campaign."""
    lagging = Heater(to_air="", loses=True, emissivity=0.0, beta=0.0)
    radiating = Heater(to_air="", loses=True, beta=0.0)
    inside = Heater(to_air="box", walls="box")
    emissivities = ("h1.skin.emissivity", "h2.skin.emissivity")
    return {
        "plain": candidate("two heaters, linear losses", ALONE),
        "lag": candidate("... and lagging sensors", lagging),
        "radiation": candidate("... and radiation", radiating),
        "beta": candidate("... and power that rises with temperature", radiating, more=BETAS),
        "linear board": candidate("board, lag, linear losses, no radiation", Heater(loses=True, emissivity=0.0, beta=0.0), BOARD, TO_ROOM),
        "board": candidate("board, lag, radiation, beta fixed at 0.001/K", Heater(), BOARD, TO_ROOM),
        "board, beta": candidate("... with beta of each heater free", Heater(), BOARD, TO_ROOM, more=BETAS),
        "board, emissivity": candidate("... with the emissivity of each heater free", Heater(), BOARD, TO_ROOM, more=emissivities),
        "board, curve": candidate(
            "... with power bent over the command",
            Heater(curve=True),
            BOARD,
            TO_ROOM,
            more=("h1.heater.command_curve", "h2.heater.command_curve"),
        ),
        "board, 1/4": candidate("... with dT^1.25 convection to the board's air", Heater(power_law=0.25), BOARD, TO_ROOM),
        "box": candidate(
            "box air and walls instead of the board", inside, {"box": "100 [J/K]"}, {"to_room": ("box", "room", "0.15 [W/K]")}
        ),
        "board in a box": candidate(
            "board, and walls that take its heat and all radiation",
            Heater(walls="box"),
            BOARD | {"box": "800 [J/K]"},
            {"to_box": ("pcb", "box", "0.02 [W/K]"), "to_room": ("box", "room", "1 [W/K]")},
        ),
        "two boards": candidate(
            "a board half under each heater",
            Heater(),
            {"pcb": "10 [J/K]", "pcb2": "10 [J/K]"},
            {"to_room": ("pcb", "room", "0.01 [W/K]"), "to_room2": ("pcb2", "room", "0.01 [W/K]"), "halves": ("pcb", "pcb2", "0.01 [W/K]")},
            boards=("pcb", "pcb2"),
        ),
        "board, 2 s": candidate("... with commands 2 s late", Heater(), BOARD, TO_ROOM, delay=2.0),
    }
