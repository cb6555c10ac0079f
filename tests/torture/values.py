"""Every number of decks of every kind of element at hostile values, by every way that a number comes in.

A deck is checked, its steady state and a short run are asked for. Allowed are errors of the library, and answers for values that the tables
of ranges allow: that of the product, and that of `torture.physical`, which was written without it. ``python -m torture.values NUMBER SEED`` in the folder tests prints one JSON object.
"""

# ruff: noqa: E501  # lines of decks

from __future__ import annotations

import copy
import json
import random
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

import thermid as td
from thermid.app.texts import pairs
from thermid.base.errors import ThermidError
from thermid.base.units import Expression
from thermid.model._tree.flat import allows
from thermid.model._tree.rules import findings
from thermid.model.tree import Flat
from torture.files import _limit, _over, judged
from torture.physical import forbidden

AREA: Final = {"area": "20 [cm^2]"}
FLOW: Final = {"volume_flow": "20 [m^3/h]"}
GAS: Final = {
    "in": {"kind": "flow", "between": ["air", "gas"], "fluid": "air", **FLOW},
    "out": {"kind": "flow", "between": ["gas", "air"], "fluid": "air", **FLOW},
}


def _deck(**groups: Any) -> dict[str, Any]:
    deck: dict[str, Any] = {
        "title": "leaves",
        "needs": ["air"],
        "nodes": {"a": {"capacitance": "50 [J/K]"}, "b": {"mass": "80 [g]", "specific_heat": "900 [J/(kg K)]"}},
    }
    deck["conductors"] = {
        "film": {"kind": "conduction", "between": ["a", "air"], "conductance": "0.4 [W/K]"},
        "strap": {"kind": "conduction", "between": ["a", "b"], "resistance": "2 [K/W]"},
    }
    deck["loads"] = {"heat": {"into": "a", "power": "3 [W]"}}
    for name, group in groups.items():
        deck[name] = {**deck.get(name, {}), **group}
    return deck


def _conductor(**fields: Any) -> dict[str, Any]:
    return _deck(conductors={"x": {"between": ["b", "air"], **fields}})


DECKS: Final[tuple[dict[str, Any], ...]] = (
    _conductor(kind="conduction", conductivity="200 [W/(m K)]", thickness="60 [mm]", **AREA),
    _conductor(kind="conduction", conductivity={"points": [["-20 [degC]", "18 [W/(m K)]"], ["80 [degC]", "20 [W/(m K)]"]]}, thickness="60 [mm]", **AREA),
    _conductor(kind="contact", contact_conductance="900 [W/(m^2 K)]", gap="0.1 [mm]", accommodation=0.9, exchange_factor=0.5, **AREA),
    _conductor(kind="contact", contact_pressure="1 [MPa]", hardness="1.1 [GPa]", roughness="2 [um]", slope=0.1, conductivity="150 [W/(m K)]", **AREA),
    _conductor(kind="convection", htc={"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}, **AREA),
    _conductor(kind="convection", htc={"length": "25 [mm]", "orientation": "up"}, **AREA),
    _conductor(kind="gas", gap="5 [mm]", accommodation=0.8, tilt="90 [deg]", aspect="6", convection_factor=1.02, **AREA),
    _conductor(kind="effective", effective_htc="9 [W/(m^2 K)]", **AREA),
    _conductor(kind="radiation", emissivity=0.8, **AREA),
    _conductor(kind="radiation", exchange_factor=0.7, **AREA),
    _deck(nodes={"gas": {"capacitance": "2 [J/K]", "stands_for": "air"}}, conductors={**GAS, "x": {"kind": "duct", "between": ["b", "gas"], "diameter": "20 [mm]", "length": "30 [cm]", "count": 3, **FLOW}}),
    _deck(nodes={"gas": {"capacitance": "2 [J/K]", "stands_for": "air"}}, conductors={**GAS, "x": {"kind": "duct", "between": ["b", "gas"], "width": "12 [mm]", "height": "60 [mm]", "length": "20 [cm]", "mass_flow": "2 [g/s]"}}),
    _deck(nodes={"gas": {"capacitance": "2 [J/K]", "stands_for": "air"}}, conductors={**GAS, "x": {"kind": "heat_sink", "between": ["b", "gas"], "width": "3 [mm]", "height": "30 [mm]", "length": "12 [cm]", "count": 22, "fin_thickness": "1 [mm]", "fin_conductivity": "180 [W/(m K)]", **FLOW}}),
    _conductor(kind="flow", mass_flow="1 [g/s]", specific_heat="1006 [J/(kg K)]"),
    _conductor(kind="flow", fluid="liquid", volume_flow="1 [l/min]", density="998 [kg/m^3]", specific_heat="4180 [J/(kg K)]", reversible=True),
    _conductor(kind="lead", conductivity="390 [W/(m K)]", diameter="0.5 [mm]", length="80 [cm]", count=6, htc="20 [W/(m^2 K)]", emissivity=0.6, to="air"),
    _conductor(kind="lead", conductivity="390 [W/(m K)]", cross_section="0.2 [mm^2]", perimeter="2 [mm]", length="80 [cm]", effective_htc="20 [W/(m^2 K)]", to="air"),
    _conductor(kind="heat_pipe", on_conductance="5 [W/K]", off_conductance="0.1 [W/K]", start_temperature="30 [degC]", transition="4 [K]"),
    _conductor(kind="bolted", count=4, torque="1.2 [N m]", diameter="4 [mm]", washer="8 [mm]", thickness="5 [mm]", conductivity="150 [W/(m K)]", hardness="1.1 [GPa]", roughness="2 [um]", slope=0.1, nut_factor=0.2, area="25 [cm^2]", filler_conductivity="1.5 [W/(m K)]", filler_thickness="0.2 [mm]"),
    _conductor(kind="bolted", count=4, conductance_each="0.5 [W/K]"),
    _conductor(kind="wedge_lock", count=2, length="15 [cm]", resistance_length="0.01 [m K/W]", vacuum_resistance_length="0.02 [m K/W]"),
    _conductor(kind="spreading", source_area="1 [cm^2]", plate_area="25 [cm^2]", thickness="5 [mm]", conductivity="180 [W/(m K)]", htc="1000 [W/(m^2 K)]"),
    _conductor(kind="table", scale=1.2, table={"over": "temperature", "points": [["0 [degC]", "0.01 [W/K]"], ["40 [degC]", "0.08 [W/K]"]]}),
    _conductor(kind="table", table={"over": "difference", "points": [["0 [K]", "0.01 [W/K]"], ["40 [K]", "0.08 [W/K]"]], "outside": "linear"}),
    _deck(nodes={"b": {"mass": "0.2 [kg]", "specific_heat": "2 [kJ/(kg K)]", "latent_heat": "190 [kJ/kg]", "melts_from": "27 [degC]", "melts_to": "29 [degC]", "liquid_specific_heat": "2.2 [kJ/(kg K)]", "supercooling": "4 [K]"}}),
    _deck(nodes={"b": {"mass": "0.2 [kg]", "enthalpy": {"points": [["0 [degC]", "0 [kJ/kg]"], ["27 [degC]", "54 [kJ/kg]"], ["29 [degC]", "244 [kJ/kg]"], ["80 [degC]", "346 [kJ/kg]"]]}}}),
    _deck(nodes={"b": {"mass": "0.2 [kg]", "specific_heat": {"points": [["0 [degC]", "800 [J/(kg K)]"], ["80 [degC]", "900 [J/(kg K)]"]]}}}),
    _deck(surfaces={"skin": {"of": "b", "to": "air", "area": "40 [cm^2]", "htc": "8 [W/(m^2 K)]", "emissivity": 0.8, "absorptance": 0.3, "facing": {"tilt": "90 [deg]", "azimuth": "180 [deg]"}}}),
    _deck(
        surfaces={"one": {"of": "a", "to": "air", "area": "40 [cm^2]", "effective_htc": "8 [W/(m^2 K)]"}, "two": {"of": "b", "to": "air", "area": "40 [cm^2]", "htc": {"coefficient": "1.5 [W/(m^2 K)]", "exponent": 0.25}}},
        joints={"seam": {"between": ["one", "two"], "area": "4 [cm^2]", "contact_conductance": "600 [W/(m^2 K)]", "gap": {"area": "10 [cm^2]", "htc": "3 [W/(m^2 K)]", "to": "air"}}},
    ),
    _deck(
        surfaces={"one": {"of": "a", "to": "air", "area": "40 [cm^2]", "htc": 0, "emissivity": 0.3}, "two": {"of": "b", "to": "air", "area": "40 [cm^2]", "htc": 0, "emissivity": 0.5}},
        joints={"seam": {"between": ["one", "two"], "area": "4 [cm^2]", "conductivity": "2 [W/(m K)]", "thickness": "1 [mm]"}},
    ),
    _deck(
        surfaces={"one": {"of": "a", "to": "air", "area": "400 [cm^2]", "htc": 0, "emissivity": 0.3}, "two": {"of": "b", "to": "air", "area": "400 [cm^2]", "htc": 0, "emissivity": 0.5}},
        enclosures={"box": {"shape": "facing plates", "dimensions": {"length": "20 [cm]", "width": "20 [cm]", "distance": "2 [cm]"}, "faces": {"first": "one", "second": "two"}, "rest": "air"}},
    ),
    _deck(
        surfaces={"one": {"of": "a", "to": "air", "area": "400 [cm^2]", "htc": 0, "emissivity": 0.3}, "two": {"of": "b", "to": "air", "area": "400 [cm^2]", "htc": 0, "emissivity": 0.5}},
        enclosures={"box": {"view_factors": [[0.0, 0.8], [0.8, 0.0]], "faces": {"first": "one", "second": "two"}, "rest": "air"}},
    ),
    _deck(loads={"x": {"into": "b", "power": "1 [W]", "temperature_coefficient": "0.004 [1/K]", "quadratic_coefficient": "1e-5 [1/K^2]", "reference_temperature": "25 [degC]"}}),
    _deck(loads={"x": {"into": "b", "power": "1 [W]", "exponential_coefficient": "0.01 [1/K]", "reference_temperature": "25 [degC]"}}),
    _deck(loads={"x": {"into": "b", "power": "1 [W]", "command_curve": 0.2, "periodic": {"period": "10 [min]", "duty": 0.2}, "sine": {"amplitude": "0.2 [W]", "period": "1 [h]"}}}),
    _deck(loads={"x": {"into": "b", "power": "1 [W]", "cycle": {"times": ["0 [s]", "1 [min]", "4 [min]"], "values": [1.0, 0.1, 0.4], "period": "10 [min]"}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "thermostat": {"on_below": "30 [degC]", "off_above": "34 [degC]"}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "proportional": {"gain": "1 [W/K]", "setpoint": "34 [degC]"}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "proportional": {"band": "2 [K]", "setpoint": "34 [degC]"}}}),
    _deck(loads={"x": {"into": "b", "scale": 1.1, "table": {"over": "temperature", "points": [["0 [degC]", "1 [W]"], ["60 [degC]", "2 [W]"]]}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "control": "c"}}, controls={"c": {"follows": "b", "thermostat": {"on_below": "30 [degC]", "off_above": "34 [degC]"}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "control": "c"}}, controls={"c": {"follows": {"a": 1, "b": -1}, "thermostat": {"on_above": "2 [K]", "off_below": "1 [K]"}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "control": "c"}}, controls={"c": {"follows": "b", "proportional": {"setpoint": "34 [degC]", "band": "2 [K]", "lowest": 0.1, "highest": 0.9}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "control": "c"}}, controls={"c": {"follows": "b", "sample": "5 [s]", "pid": {"setpoint": "34 [degC]", "band": "6 [K]", "integral_time": "4 [min]", "derivative_time": "10 [s]", "filter_time": "2 [s]", "lowest": 0.0, "highest": 1.0, "begins": 0.2}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "control": "c"}}, controls={"c": {"follows": "b", "sample": "10 [s]", "table": {"points": [["5 [degC]", "0.16"], ["50 [degC]", "1"]]}}}),
    _deck(loads={"x": {"into": "b", "power": "2 [W]", "control": "c"}}, controls={"c": {"follows": "b", "modes": {"open": 0.05, "closed": 1}, "starts": "open", "transitions": {"warm": {"from": "open", "to": "closed", "above": "24 [degC]"}, "cold": {"from": "closed", "to": "open", "after": "30 [s]"}}}}),
    _deck(packages={"u": {"board": "b", "theta_JC": "14 [K/W]", "theta_JB": "9 [K/W]", "psi_JT": "1 [K/W]", "power": "0.9 [W]", "capacitance": "0.1 [J/K]", "case_capacitance": "0.2 [J/K]", "top": {"to": "air", "area": "0.5 [cm^2]", "htc": "12 [W/(m^2 K)]", "emissivity": 0.9}}}),
    _deck(packages={"u": {"board": "b", "theta_JC": "14 [K/W]", "theta_JB": "9 [K/W]", "lid": "a", "top": {"conductivity": "3 [W/(m K)]", "area": "1 [cm^2]", "thickness": "0.2 [mm]"}}}),
    _deck(ladders={"f": {"to": "b", "power": "1.5 [W]", "foster": [["0.2 [K/W]", "1 [ms]"], ["1.1 [K/W]", "60 [ms]"], ["0.7 [K/W]", "1.5 [s]"]]}}),
    _deck(ladders={"f": {"to": "b", "power": "1.5 [W]", "cauer": [["0.2 [K/W]", "1 [J/K]"], ["1.1 [K/W]", "0.5 [J/K]"]]}}),
    _deck(coolers={"t": {"cold": "b", "hot": "a", "V_max": "14.4 [V]", "I_max": "6.4 [A]", "dT_max": "66 [K]", "Q_max": "50 [W]", "T_hot": "25 [degC]", "current": "1.5 [A]"}}),
    _deck(
        nodes={"gas": {"capacitance": "2 [J/K]", "stands_for": "air"}},
        fans={"fan": {"curve": [["0 [m^3/h]", "38 [Pa]"], ["40 [m^3/h]", "26 [Pa]"], ["95 [m^3/h]", "0 [Pa]"]], "passes": ["60 [m^3/h]", "12 [Pa]"], "linear_resistance": "10 [Pa s/m^3]", "speed": 0.8, "count": 2}},
        conductors={k: {**v, "volume_flow": "fan.flow"} for k, v in GAS.items()},
    ),
    _deck(
        nodes={"gas": {"capacitance": "2 [J/K]", "stands_for": "air"}},
        fans={"fan": {"curve": [["0 [m^3/h]", "38 [Pa]"], ["95 [m^3/h]", "0 [Pa]"]], "resistance": "5e4 [Pa s^2/m^6]"}},
        conductors={k: {**v, "volume_flow": "fan.flow"} for k, v in GAS.items()},
    ),
    {**_deck(), "made_in": {"*": {"pressure": "1 [atm]", "gravity": "9.8 [m/s^2]", "gas": "air", "wind": "1 [m/s]"}}},
)  # fmt: skip
"""Decks that have every group, every kind of conductor and every alternative of its fields."""
ROUTES: Final = ("literal", "parameter", "expression", "--param", "python", "schedule")
VALUES: Final = (
    "0",
    "-1",
    "1e-300",
    "5e-12",
    "1e-4",
    "1.5",
    "400",
    "1e9",
    "1e300",
    "inf",
    "-inf",
    "nan",
    "1e999",
    "-0.0",
    "*-1",
    "*0.01",
    "*100",
    "*1e6",
)
"""Numbers in the unit of a leaf, or factors on what stands there."""
SCENARIO: Final = td.Scenario("leaves", boundaries={"air": "20 [degC]"}, start="25 [degC]", duration="2 [min]")
Place = tuple[str | int, ...]


def leaves(deck: Any, place: Place = ()) -> Iterator[Place]:
    """Yield the place of every number of a deck."""
    if isinstance(deck, dict | list):
        for key, inner in deck.items() if isinstance(deck, dict) else enumerate(deck):
            yield from leaves(inner, (*place, key))
    elif not isinstance(deck, bool) and (not isinstance(deck, str) or _number(deck)):
        yield place


def _number(text: str) -> bool:
    try:
        return Expression.parse(text).literal is not None
    except ThermidError:
        return False


def _hostile(rng: random.Random, now: Any) -> tuple[str, float | str]:
    """Return a hostile value as a text with the unit of what stands there, and as Python has it."""
    text = str(now)
    number, _, unit = text.partition("[")
    how = rng.choice(VALUES)
    value = repr(float(how[1:]) * float(number)) if how.startswith("*") else how
    written = f"{value} [{unit}" if unit else value
    return written, float(value) if isinstance(now, int | float) else written


def _put(deck: Any, place: Place, value: Any) -> None:
    for step in place[:-1]:
        deck = deck[step]
    deck[place[-1]] = value


@dataclass(frozen=True)
class Case:
    """A model with one hostile value.

    Parameters
    ----------
    said : str          What was written, and how.
    route : str         One of `ROUTES`.
    model : Model       The model.
    scenario : Scenario What is done to it.
    course : dict       Path -> value that the scenario gives it for a while. [SI]
    forbids : str       Why physics forbids the value, or nothing.
    """

    said: str
    route: str
    model: td.Model
    scenario: td.Scenario
    course: dict[str, float]
    forbids: str = ""


EXPRESSIONS: Final = {"p + p - p": 1.0, "2*p": 2.0, "p/1": 1.0, "1*p**1": 1.0, "max(p, p)": 1.0}
"""Expressions of a parameter -> what it is multiplied by."""


def read(given: Any) -> float | None:
    """Return what stands in a deck as a number in SI, if it is one."""
    if isinstance(given, int | float):
        return float(given)
    literal = Expression.parse(given).literal if isinstance(given, str) else None
    return literal.value if literal else None


def made(rng: random.Random) -> Case:
    """Return a deck with one hostile value, by one of the ways that a number comes in."""
    good = rng.choice(DECKS)
    deck, route = copy.deepcopy(good), rng.choice(ROUTES)
    if route in ("literal", "parameter", "expression"):
        place = rng.choice([*leaves(deck)])
        now: Any = deck
        for step in place:
            now = now[step]
        text, plain = _hostile(rng, now)
        way = rng.choice([*EXPRESSIONS]) if route == "expression" else "p"
        if route == "literal":
            _put(deck, place, plain)
        else:
            deck["parameters"] = {"p": plain}
            _put(deck, place, way)
        value = read(plain)
        why = "" if value is None else forbidden(good, place, EXPRESSIONS.get(way, 1.0) * value, read)
        return Case(f"{'.'.join(map(str, place))} = {text}, {route}", route, td.model_from_dict(deck), SCENARIO, {}, why)
    model = td.model_from_dict(deck)
    table = model.parameter_table()
    path = rng.choice([p for p in table if table[p].parameter.is_literal])
    text, plain = _hostile(rng, table[path].parameter.text)
    said, value = f"{path} = {text}, {route}", read(text)
    why = "" if value is None else forbidden(good, path.split("."), value, read)
    if route == "schedule":
        course = {"times": ["0 [s]", "1 [min]"], "values": [table[path].parameter.text, text], "hold": True, "after": "hold"}
        scenario = SCENARIO.with_(schedule={path: course})
        return Case(said, route, model, scenario, {} if value is None else {path: value}, why)
    values = pairs([f"{path}={text}"], "--param") if route == "--param" else {path: plain}
    return Case(said, route, model.with_values(values), SCENARIO, {}, why)


def faults(case: Case) -> list[str]:
    """Check and run a case; return what was accepted that must not be.

    Raises
    ------
    ThermidError   When the run is refused, as it may be.
    """
    errors = [f for f in findings(case.model) if f.severity == "error"]
    try:
        settled = td.steady(case.model, case.scenario)
        ends = {n: [settled[n]] for n in settled}
    except ThermidError:
        ends = {}
    run = td.simulate(case.model, case.scenario, every="1 [min]")
    flat = Flat.of_model(case.model)
    values = flat.parameters.evaluate({}) | case.course
    out = [f"{path} = {values[path]:g} is accepted" for path, (given, _) in flat.ranges.items() if not allows(given, values[path])]
    out += ["check finds an error, and it runs"] if errors else []
    out += [f"physics forbids it: {case.forbids}"] if case.forbids else []
    every = [*ends.values(), *(run[n].kelvin for n in run.nodes)]
    return out + (["a temperature is no number"] if not all(np.isfinite(t).all() for t in every) else [])


def campaign(number: int, first: int) -> dict[str, Any]:
    """Judge so many cases from a seed on; return how many ended how, by route, and the findings."""
    signal.signal(signal.SIGPROF, _over)
    counts: Counter[str] = Counter()
    found: dict[str, list[Any]] = {}
    for seed in range(first, first + number):
        accepted: list[str] = []
        case: list[Case] = []

        def run(seed: int = seed, case: list[Case] = case, accepted: list[str] = accepted) -> None:
            case.append(made(random.Random(f"values {seed}")))
            accepted.extend(faults(case[0]) or ["runs"])

        wrong = judged(run, "")
        counts[f"{case[0].route if case else 'deck'}, {'ran' if accepted else 'refused'}"] += 1
        for each in ([wrong] if wrong else []) + [each for each in accepted if each != "runs"]:
            found.setdefault(each, [0, f"{seed}: {case[0].said if case else 'refused when read'}"])[0] += 1
    return {"counts": counts, "findings": found}


if __name__ == "__main__":
    _limit()
    sys.stdout.write(json.dumps(campaign(int(sys.argv[1]), int(sys.argv[2])), indent=1) + "\n")
