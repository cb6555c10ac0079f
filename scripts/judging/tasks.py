"""What a band is judged on: a task (records to fit, a deck with stated spreads), a question about another run, and its answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import thermid as td
from thermid.measure.records import Channel, Record
from thermid.model.tree import TableSignal
from thermid.simulation.runs import Scenario

from . import benches as b

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Answer:
    """Node or sensor -> centre and half-width (times,) of the 95 % band, and how far its middle lies above the centre, if it does. [K]"""

    centre: Mapping[str, Array]
    half: Mapping[str, Array]
    aside: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Refusal:
    """A question that is declined, and why."""

    why: str


@dataclass(frozen=True, eq=False)
class Question:
    """One run that is asked.

    Parameters
    ----------
    name : str
    times : array (times,)          When the truth is looked at. [s]
    scenario : Scenario             What is done: room and power as logged, both from the beginning to the end.
    spread : dict                   What is stated of the scenario beyond instruments: name -> standard deviation as text.
    nodes : tuple of str
    """

    name: str
    times: Array
    scenario: Scenario
    spread: Mapping[str, str]
    nodes: tuple[str, ...] = b.NODES


@dataclass(frozen=True, eq=False)
class Task:
    """What is known before a question.

    Parameters
    ----------
    model : Model           The deck as an engineer writes it.
    records : tuple         Logs of the fitted runs.
    free : tuple of str     What is fitted.
    priors : dict           Path -> (mean, standard deviation), as texts.
    made : Benches          Where the truth is; only the oracle may look.
    index : int             Which of the benches.
    memo : dict             What a rule keeps between questions, such as its fit.
    """

    model: Any
    records: tuple[Record, ...]
    free: tuple[str, ...]
    priors: Mapping[str, tuple[str, str]]
    made: b.Benches
    index: int
    memo: dict[Any, Any] = field(default_factory=dict)

    def once(self, what: object, make: Callable[[], Any]) -> Any:
        """Return something that is made once for a task."""
        if what not in self.memo:
            self.memo[what] = make()
        return self.memo[what]


Predictor = Callable[[Task, Question], "Answer | Refusal"]
"""What is judged."""


def _value(value: float, unit: str, low: float, high: float) -> dict[str, Any]:
    return {"value": f"{value} [{unit}]", "min": low, "max": high}


def deck(structure: str, emissivity: float = 0.0) -> tuple[dict[str, Any], dict[str, tuple[str, str]]]:
    """Return the deck of a structure and the stated spreads of its free values.

    right : the law of the truth, the growth of the contact stated; half : the same with a constant contact; constant : constant contact
    and one constant coefficient of the shell, no lead; finish : the same with a stated emissivity, which acts without gas.
    """
    skin: dict[str, Any] = {"of": "shell", "to": "room", "area": f"{b.AREA} [m^2]"}
    priors = {"core.capacitance": ("250 [J/K]", "30 [%]"), "shell.capacitance": ("300 [J/K]", "30 [%]")}
    conductors: dict[str, Any] = {}
    if structure == "right":
        points = [["-20 [degC]", "0.5 [W/K]"], ["130 [degC]", "2.0 [W/K]"]]  # 1 W/K at 30 degC, 1 % of it per kelvin
        table = {"over": "temperature", "points": points, "outside": "linear"}
        scale = {"value": 0.5, "min": 0.02, "max": 10}
        conductors["contact"] = {"kind": "table", "between": list(b.NODES), "scale": scale, "table": table}
        priors["contact.scale"] = ("0.5", "30 [%]")
    else:
        conductors["contact"] = {"kind": "conduction", "between": list(b.NODES), "conductance": _value(0.5, "W/K", 0.02, 10)}
        priors["contact.conductance"] = ("0.5 [W/K]", "30 [%]")
    if structure in ("right", "half"):
        skin |= {"htc": {"coefficient": _value(1.5, "W/(m^2 K)", 0.2, 15), "exponent": 0.25}}
        skin |= {"emissivity": {"value": 0.8, "min": 0.05, "max": 1.0}}
        conductors["lead"] = {"kind": "conduction", "between": ["core", "room"], "conductance": _value(0.03, "W/K", 0.001, 1)}
        priors["skin.htc.coefficient"] = ("1.5 [W/(m^2 K)]", "20 [%]")
        priors["skin.emissivity"] = ("0.8", str(b.EMISSIVITY_SPREAD))
        priors["lead.conductance"] = ("0.03 [W/K]", "20 [%]")
    else:
        skin |= {"effective_htc": _value(6, "W/(m^2 K)", 0.5, 60)}
        skin |= {"emissivity": emissivity} if structure == "finish" else {}
    nodes = {"core": {"capacitance": _value(250, "J/K", 20, 3000)}, "shell": {"capacitance": _value(300, "J/K", 20, 3000)}}
    loads = {"heat": {"into": "core", "power": "1 [W]"}}
    whole = {"title": "Box", "needs": ["room"], "nodes": nodes, "surfaces": {"skin": skin}, "conductors": conductors, "loads": loads}
    return whole, priors


def _record(logs: b.Logs, name: str, k: int, synthetic: bool) -> Record:
    """Return a run of one bench as its log, with what an engineer states of the instruments."""
    times = logs.times[:: b.THIN]
    channels = {
        n: Channel.from_array(n, logs.readings[:, k, i], unit="K", role="node", target=n, noise=b.NOISE, accuracy=b.OFFSET)
        for i, n in enumerate(b.NODES)
    }
    room, power = logs.room[:: b.THIN, k], logs.power[:: b.THIN, k]
    channels["room"] = Channel.from_array("room", room, unit="K", role="boundary", target="room", accuracy=b.ROOM_OFFSET)
    meter = b.FACTOR * float(power.max())
    channels["P"] = Channel.from_array("P", power, quantity="power", role="load", target="heat", accuracy=meter)
    return Record.from_arrays(name, times, channels, synthetic=synthetic)


def task(made: b.Benches, index: int, synthetic: bool = False) -> Task:
    """Return the task of one bench."""
    whole, priors = deck(made.family.structure, made.family.stated_emissivity)
    records = tuple(_record(made.runs[n], n, index, synthetic) for n in b.FITTED)
    free = list(priors)
    free += ["skin.effective_htc"] if "effective_htc" in whole["surfaces"]["skin"] else []
    return Task(td.model_from_dict(whole), records, tuple(free), priors, made, index)


def question(made: b.Benches, index: int, name: str) -> Question:
    """Return the question about a run of a bench."""
    logs, course = made.runs[name], b.COURSES[name]
    room, heat = TableSignal(logs.times, logs.room[:, index]), TableSignal(logs.times, logs.power[:, index], hold=True)
    gas = {"*": td.simulation.Environment("0 [Pa]")} if course.vacuum else {}
    asked = Scenario(name, boundaries={"room": room}, loads={"heat": heat}, environment=gas, start="room", duration=float(logs.times[-1]))
    spread = {"room": f"{made.family.drift} [K]"} if made.family.drift else {}
    spread |= {"skin.emissivity": str(b.EMISSIVITY_SPREAD)} if course.vacuum and made.family.stated_emissivity else {}
    return Question(name, logs.times[:: b.THIN], asked, spread)


def truth(made: b.Benches, index: int, name: str) -> dict[str, Array]:
    """Return node -> true temperatures at the times of the question. [K]"""
    whole = made.runs[name].truth[:: b.THIN, index]
    return {n: whole[:, i] for i, n in enumerate(b.NODES)}


def distance(family: b.Family, name: str) -> str:
    """Return the stratum of a question, from what was logged alone: power, room and gas beside those of the fitted runs."""
    times = np.arange(0.0, 14401.0, b.STEP)
    peaks = [float(np.max(b.COURSES[n].power(times))) for n in b.FITTED]
    asked = float(np.max(b.COURSES[name].power(times)))
    ratio = max(asked / max(peaks), min(peaks) / asked, 1.0)
    rooms = [b.COURSES[n].room for n in b.FITTED]
    away = max(b.COURSES[name].room - max(rooms), min(rooms) - b.COURSES[name].room, 0.0)
    return stratum(ratio, away, b.COURSES[name].vacuum)


def stratum(ratio: float, kelvin: float, gas: bool = False, swapped: bool = False) -> str:
    """Return the name of a stratum.

    Parameters
    ----------
    ratio : float       Peak power over the nearest of the fitted peaks' range, or its inverse where that is above 1. [-]
    kelvin : float      How far the room is outside of the fitted rooms' range. [K]
    gas, swapped : bool Whether the gas or its flow is another, or the unit.
    """
    if swapped:
        return "unit swapped"
    if gas:
        return "gas changed"
    power = "power 1" if ratio < 1.1 else "power to 1.6" if ratio < 1.6 else "power above 1.6"
    return power + (", room" if kelvin > 3.0 else "")
