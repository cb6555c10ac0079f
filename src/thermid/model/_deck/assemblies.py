"""Elements of several nodes and conductors: packages, ladders, coolers. Each is written out as a small deck of existing kinds, used once.

The names of what is made are stable: `u1.junction`, `u1.case`, `u1.heat` of a package `u1`; a value has the path of its field,
`u1.theta_JC`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from math import isfinite
from typing import Annotated, Any, Final

from pydantic import Field

from thermid.base.errors import DeckError, errors_at, refuse_first
from thermid.base.grammar import StrictTable
from thermid.base.units import Expression, unit
from thermid.model._deck.fields import Raw, plain, value_table
from thermid.model._deck.rows import Reader, rows_of_file
from thermid.model._laws.signal import literal
from thermid.model._laws.stores import Where
from thermid.model._parts.elements import KINDS

MAX_TWO_RESISTOR_ERROR: Final = 0.3
"""Largest error of a junction's rise by a two-resistor model, as a share, in comparisons with detailed models (DELPHI project;
Lasance); JESD15-3 (2008) defines the model and states no bound. From memory: check before quoting. [-]"""
WHY_WORST: Final = "in published worst cases two-resistor models are wrong by up to 30 % of the junction's temperature rise"


@dataclass(frozen=True)
class Assembly:
    """A small deck that an element stands for.

    Parameters
    ----------
    deck : dict     The deck, in the grammar of decks.
    bind : dict     Need of it -> node of the deck that uses it.
    values : dict   Path of a value in it -> what the user wrote with names of its own deck, or for this instance alone.
    """

    deck: Mapping[str, Any]
    bind: Mapping[str, str]
    values: Mapping[str, Any] = field(default_factory=dict)


class _Values:
    """Values of an element: what is a number stands in its deck, what has names is set by the deck that uses it."""

    def __init__(self, units: Mapping[str, str], where: Where) -> None:
        self.units, self.where = units, where
        self.parameters: dict[str, Any] = {}
        self.set: dict[str, Any] = {}

    def take(self, name: str, raw: Any, **details: Any) -> None:
        """Add a value to `parameters`, with `details` (source, basis, min, max) that it has not itself; one with names goes to `set`."""
        table = value_table(raw)
        if isinstance(table["value"], str) and self._names(table["value"], name):
            self.set[name] = table
            table = {"value": f"1 [{self.units[name]}]"}
        self.parameters[name] = table | {k: v for k, v in details.items() if k not in table}

    def inner(self, element: str, fields: Mapping[str, Any], *kinds: str, group: str = "") -> dict[str, Any]:
        """Return the fields of an element of the small deck; a field with names of the user's deck becomes 1 here and goes to `set`."""
        slots = {slot: of for kind in kinds for slot, of in KINDS[kind].slots.items()}
        out: dict[str, Any] = {}
        for key, raw in fields.items():
            path = f"{group}{key}"
            if isinstance(raw, dict) and "value" not in raw:
                out[key] = self.inner(element, raw, *kinds, group=f"{path}.")
                continue
            text = raw.get("value") if isinstance(raw, dict) else raw
            named = path in slots and isinstance(text, str) and self._names(text, element)
            out[key] = f"1 [{slots[path]}]" if named else raw
            if named:
                self.set[f"{element}.{path}"] = raw
        return out

    def _names(self, text: str, key: str) -> tuple[str, ...]:
        """Return the names in an expression."""
        with errors_at(self.where(key)):
            return Expression.parse(text).names


PACKAGE_UNITS: Final = {"theta_JC": "K/W", "theta_JB": "K/W", "psi_JT": "K/W", "psi_JB": "K/W", "capacitance": "J/K"} | {
    "case_capacitance": "J/K"
}
READINGS: Final = {"psi_JT": ("theta_JC", "T_J = T_top + psi_JT P"), "psi_JB": ("theta_JB", "T_J = T_board + psi_JB P")}
"""Characterisation parameters, what is asked of them by mistake, and what they are for (JESD51-12)."""


class PackageTable(StrictTable):
    """A packaged component by two resistances: from its junction to the top of its case and to the board."""

    board: str
    theta_JB: Raw | None = None  # noqa: N815
    theta_JC: Raw | None = None  # noqa: N815
    psi_JT: Raw | None = None  # noqa: N815
    psi_JB: Raw | None = None  # noqa: N815
    power: Raw | None = None
    capacitance: Raw | None = None
    case_capacitance: Raw | None = None
    lid: str = ""
    top: dict[str, Any] = Field(default_factory=dict)
    package: str = ""
    reference_point: bool = True

    def assembly(self, name: str, where: Where, read: Reader | None) -> Assembly:
        """Return its deck: junction, case, the two resistances with their deviations, its heat, the surface of its top."""
        self._check(where)
        values = _Values(PACKAGE_UNITS, where)
        conductors: dict[str, Any] = {}
        for theta, (here, there) in {"theta_JC": ("junction", "case"), "theta_JB": ("junction", "board")}.items():
            raw = getattr(self, theta)
            if raw is None:
                continue
            way = theta.removeprefix("theta_")
            values.take(theta, raw)
            values.parameters[f"deviation_{way}"] = {
                "value": 0,
                "min": -MAX_TWO_RESISTOR_ERROR,
                "max": MAX_TWO_RESISTOR_ERROR,
                "source": "published",
                "basis": WHY_WORST,
            }
            conductors[way] = {"kind": "conduction", "between": [here, there], "resistance": f"{theta}*(1 + deviation_{way})"}
        for psi in READINGS:
            if getattr(self, psi) is not None:
                values.take(psi, getattr(self, psi))
        nodes: dict[str, Any] = {"junction": {"reference_point": True} if self.reference_point else {}}
        if self.theta_JC is not None:
            nodes["case"] = {}
        for node, heat in {"junction": "capacitance", "case": "case_capacitance"}.items():
            if getattr(self, heat) is not None:
                values.take(heat, getattr(self, heat))
                nodes[node] = nodes[node] | {"capacitance": heat}
        bind = {"board": self.board}
        deck: dict[str, Any] = {"title": f"package {self.package or name}", "nodes": nodes, "conductors": conductors}
        if self.lid:
            bind["lid"] = self.lid
            conductors["to_lid"] = {"kind": "conduction", "between": ["case", "lid"]} | values.inner("to_lid", self.top, "conduction")
        elif self.top:
            bind |= {need: self.top[need] for need in ("to", "sees") if need in self.top}
            ports = {need: need for need in ("to", "sees") if need in self.top}
            deck["surfaces"] = {"top": values.inner("top", self.top, "convection", "effective", "radiation") | {"of": "case"} | ports}
        deck["loads"] = {"heat": {"into": "junction", "power": "0 [W]"}}
        power = {"heat.power": value_table(self.power)} if self.power is not None else {}
        offers = [*nodes, *deck.get("surfaces", {})]
        deck |= {"needs": list(bind), "offers": offers, "parameters": values.parameters}
        return Assembly(deck, bind, {**values.set, **power})

    def _check(self, where: Where) -> None:
        """Refuse a package without a resistance, with a psi in place of one, or whose top leads nowhere."""
        away = bool(self.lid or self.top)
        for psi, (theta, reading) in READINGS.items():
            if getattr(self, psi) is not None and getattr(self, theta) is None and (theta == "theta_JB" or away):
                raise DeckError(
                    f"{psi} is not a thermal resistance. It is a characterisation parameter, {reading} with the power of the whole "
                    f"package; in its test most heat takes another path (JESD51-12). Give {theta} instead.",
                    where(psi),
                    code="value.contradicts",
                )
        refuse_first(
            where,
            (
                self.theta_JB is None and self.theta_JC is None,
                "give theta_JB, theta_JC, or both, for a package.",
                "",
                "value.incomplete",
            ),
            (
                self.theta_JC is not None and not away,
                'theta_JC leads to the top of the case, but nothing removes heat there. Give top = { to = "air", area = ..., htc = ..., '
                "emissivity = ... }; or lid = a node, with top = { resistance = ... } for the interface; or leave theta_JC out.",
                "theta_JC",
                "value.incomplete",
            ),
            (
                self.theta_JC is None and away,
                "top and lid need theta_JC, the resistance from the junction to the top of the case.",
                "",
                "value.incomplete",
            ),
            (
                self.lid and not self.top,
                "give the thermal resistance between lid and case: top = { resistance = ... }, { conductance = ... } or { "
                "conductivity, area, thickness }.",
                "lid",
                "value.incomplete",
            ),
        )


Rungs = Annotated[list[Annotated[list[str], Field(min_length=2, max_length=2)]], Field(min_length=1)]


class LadderTable(StrictTable):
    """A measured or published step response as a ladder of resistances and capacitances: Foster or Cauer."""

    to: str
    foster: Rungs | str | None = None
    cauer: Rungs | str | None = None
    power: Raw | None = None

    def assembly(self, name: str, where: Where, read: Reader | None) -> Assembly:
        """Return its deck: nodes `junction`, `n2`, `n3` ... with capacitances, resistances between them and to the node `to`."""
        if (self.foster is None) == (self.cauer is None):
            raise DeckError(
                "give a ladder as foster or cauer: rows of [resistance, capacitance]; for foster also [resistance, time].",
                where(""),
                code="value.incomplete",
            )
        kind = "foster" if self.foster is not None else "cauer"
        ladder = self.foster or self.cauer or []
        rows = _rows(ladder, where(kind), read) if isinstance(ladder, str) else [(row, where(kind)) for row in ladder]
        rungs = [_rung(row, kind, place) for row, place in rows]
        if kind == "foster":
            rungs = cauer_of_foster(rungs, where("foster"))
        parameters, nodes, conductors = {}, {}, {}  # type: dict[str, Any], dict[str, Any], dict[str, Any]
        names = ["junction", *(f"n{k}" for k in range(2, len(rungs) + 1)), "to"]
        details = {"source": "derived", "basis": "continued fraction of a Foster ladder"} if kind == "foster" else {}
        for k, (resistance, capacitance) in enumerate(rungs, start=1):
            parameters |= {f"R{k}": {"value": f"{resistance!r} [K/W]"} | details, f"C{k}": {"value": f"{capacitance!r} [J/K]"} | details}
            nodes[names[k - 1]] = {"capacitance": f"C{k}"}
            conductors[f"to_{names[k]}" if k < len(rungs) else "out"] = {
                "kind": "conduction",
                "between": names[k - 1 : k + 1],
                "resistance": f"R{k}",
            }
        deck = {"title": f"ladder {name}", "needs": ["to"], "offers": list(nodes), "parameters": parameters, "nodes": nodes}
        deck |= {"conductors": conductors, "loads": {"heat": {"into": "junction", "power": "0 [W]"}}}
        return Assembly(deck, {"to": self.to}, {"heat.power": value_table(self.power)} if self.power is not None else {})


def _rows(file: str, where: str, read: Reader | None) -> list[tuple[list[str], str]]:
    """Return ([R, C or tau] as texts, place) of each row of a CSV file."""
    out = []
    for row, place in rows_of_file(file, where, read, ("R",)):
        second = row.get("C", row.get("tau"))
        if set(row) not in ({"R", "C"}, {"R", "tau"}):
            raise DeckError("the columns of a ladder are R [K/W], and C [J/K] or tau [s]; no others.", place, code="value.wrong-kind")
        out.append(([str(row["R"]), str(second)], place))
    return out


def _rung(row: list[str], kind: str, where: str) -> tuple[float, float]:
    """Return resistance R [K/W] and capacitance C [J/K] of a row of texts; of a Foster row with a time tau, C = tau / R."""
    resistance = plain(row[0], "ladders.R", "K/W", where)
    with errors_at(where):
        literal = Expression.parse(row[1]).literal
    timed = kind == "foster" and literal is not None and literal.unit.dimension == unit("s").dimension
    second = plain(row[1], "ladders.tau" if timed else "capacitance", "s" if timed else "J/K", where)
    return resistance, second / resistance if timed else second


Polynomial = list[Fraction]
"""Coefficients, of the lowest power first."""


def cauer_of_foster(rungs: list[tuple[float, float]], where: str = "") -> list[tuple[float, float]]:
    """Return the Cauer ladder with the step response of a Foster one, from the driven node on: R [K/W] and C [J/K] of each rung.

    Z(s) = sum R_k / (1 + s R_k C_k) is written as one fraction and expanded, C_1 s + 1 / (R_1 + 1 / (C_2 s + ...)), in exact fractions.
    A Foster ladder has the temperature of its first node alone; the nodes of a Cauer ladder store heat against the surroundings, so it can
    stand in a network. Equal times are one rung.

    References
    ----------
    Guillemin, Synthesis of Passive Networks, Wiley 1957, chapter 4; JESD51-14 (2010), Annex C.

    Examples
    --------
    >>> cauer_of_foster([(1.0, 2.0)])
    [(1.0, 2.0)]
    """
    by_time: dict[Fraction, Fraction] = {}
    for resistance, capacitance in rungs:
        time = Fraction(resistance) * Fraction(capacitance)
        by_time[time] = by_time.get(time, Fraction(0)) + Fraction(resistance)
    denominator: Polynomial = [Fraction(1)]
    for time in by_time:
        denominator = _times(denominator, [Fraction(1), time])
    numerator: Polynomial = [Fraction(0)]
    for time, share in by_time.items():
        term: Polynomial = [share]
        for other in by_time:
            term = _times(term, [Fraction(1), other]) if other != time else term
        numerator = _plus(numerator, term)
    out = []
    for _ in by_time:
        storing = denominator[-1] / numerator[-1]
        denominator = _plus(denominator, [Fraction(0), *(-storing * n for n in numerator)])[:-1]
        resisting = numerator[-1] / denominator[-1]
        numerator = _plus(numerator, [-resisting * d for d in denominator])[:-1]
        out.append((float(resisting), float(storing)))
    if not all(0.0 < r < float("inf") and 0.0 < c < float("inf") for r, c in out):
        raise DeckError(
            "two time constants of the Foster ladder are too close for the conversion to a Cauer ladder. Merge them into one.",
            where,
            code="model.law-refused",
        )
    return out


def _times(a: Polynomial, b: Polynomial) -> Polynomial:
    """Return the product of two polynomials."""
    out = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            out[i + j] += x * y
    return out


def _plus(a: Polynomial, b: Polynomial) -> Polynomial:
    """Return the sum of two polynomials."""
    size = max(len(a), len(b))
    padded = ([*polynomial, *[Fraction(0)] * (size - len(polynomial))] for polynomial in (a, b))
    return [x + y for x, y in zip(*padded, strict=True)]


COOLER_UNITS: Final = {"V_max": "V", "I_max": "A", "dT_max": "K", "T_hot": "K", "Q_max": "W", "current": "A"}


class CoolerTable(StrictTable):
    """A thermoelectric cooler by the values of its data sheet, driven by a current."""

    cold: str
    hot: str
    V_max: Raw
    I_max: Raw
    dT_max: Raw  # noqa: N815
    T_hot: str
    Q_max: str | None = None
    current: Raw

    def assembly(self, name: str, where: Where, read: Reader | None) -> Assembly:
        """Return its deck: conduction K, pumped heat +-S T I at the cold and the hot node, and half the loss R I^2 / 2 into each.

        From the data sheet at T_hot: S = V_max / T_hot, R = V_max (T_hot - dT_max) / (I_max T_hot),
        K = V_max I_max (T_hot - dT_max) / (2 T_hot dT_max), all times `size`.
        """
        t = plain(self.T_hot, "coolers.T_hot", "temperature", where("T_hot"))
        values, written = _Values(COOLER_UNITS, where), {key: getattr(self, key) for key in ("V_max", "I_max", "dT_max")}
        for key, raw in written.items():
            values.take(key, raw, source="datasheet")
        numbers = {key: value_table(raw)["value"] for key, raw in written.items() if key not in values.set}
        sheet = {key: plain(number, f"coolers.{key}", COOLER_UNITS[key], where(key)) for key, number in numbers.items()}
        if not sheet.get("dT_max", 0.0) < t:
            raise DeckError(
                "dT_max must be below T_hot in kelvin: its cold side would be colder than absolute zero.",
                where(""),
                code="value.outside-range",
            )
        parameters: dict[str, Any] = {"T_hot": {"value": self.T_hot, "source": "datasheet"}}
        parameters["size"] = self._size(sheet, t, where)
        parameters |= {
            "seebeck": "size*V_max/T_hot",
            "resistance": "size*V_max*(T_hot - dT_max)/(I_max*T_hot)",
            "conductance": "size*V_max*I_max*(T_hot - dT_max)/(2*T_hot*dT_max)",
        }
        values.take("current", self.current)
        parameters |= values.parameters
        pumped = {"temperature_coefficient": "1/T_hot", "reference_temperature": "T_hot"}
        loads = {
            "pumped": {"into": "cold", "power": "-seebeck*current*T_hot"} | pumped,
            "released": {"into": "hot", "power": "seebeck*current*T_hot"} | pumped,
            "loss_cold": {"into": "cold", "power": "0.5*resistance*current**2"},
            "loss_hot": {"into": "hot", "power": "0.5*resistance*current**2"},
        }
        through = {"kind": "conduction", "between": ["hot", "cold"], "conductance": "conductance"}
        deck = {"title": f"cooler {name}", "needs": ["cold", "hot"], "parameters": parameters}
        deck |= {"conductors": {"through": through}, "loads": loads}
        return Assembly(deck, {"cold": self.cold, "hot": self.hot}, values.set)

    def _size(self, sheet: Mapping[str, float], hot: float, where: Where) -> dict[str, Any]:
        """Return the parameter `size`: one, with Q_max over the one that the numbers of the sheet give at `hot` [K] as its range's end."""
        if self.Q_max is None or sheet.keys() < {"V_max", "I_max", "dT_max"}:
            return {"value": 1, "source": "datasheet", "basis": "V_max, I_max and dT_max at T_hot"}
        expected = sheet["V_max"] * sheet["I_max"] * (hot + sheet["dT_max"]) / (2.0 * hot)
        share = literal(self.Q_max, "W", where("Q_max")) / expected
        if not 0.5 < share < 2.0:
            raise DeckError(
                f"the other values give a Q_max of {expected:.4g} W at the same T_hot, and {self.Q_max} is {share:.2f} of it. A data sheet "
                "misses by a few per cent: look for another T_hot, or a unit.",
                where("Q_max"),
                code="value.contradicts",
            )
        basis = f"Q_max {self.Q_max} where V_max, I_max and dT_max give {expected:.4g} W"
        return {"value": 1, "min": min(1.0, share), "max": max(1.0, share), "source": "datasheet", "basis": basis}


FAN_UNITS: Final = {"resistance": "Pa s^2/m^6", "linear_resistance": "Pa s/m^3", "speed": "1", "count": "1"}


class FanTable(StrictTable):
    """A fan or pump on the resistance of its system: the flow at which both pressures are one."""

    curve: Annotated[list[tuple[str, str]], Field(min_length=2)]
    resistance: Raw | None = None
    passes: tuple[str, str] | None = None
    linear_resistance: Raw | None = None
    speed: Raw | None = None
    count: Raw | None = None

    def assembly(self, name: str, where: Where, read: Reader | None) -> Assembly:
        """Return its deck, of values alone: `flow` and `pressure` at the operating point.

        A fan's line a + b V at speed s, n side by side, is s^2 a + s b V / n (affinity laws); it meets r V + k V^2 at
        V = 2 s^2 a / (r - s b / n + sqrt((r - s b / n)^2 + 4 k s^2 a)). As the fan's curve is the highest of the lowest of its lines,
        and the flow rises with every line, so is the flow of their flows.
        """
        points = self._points(where)
        values = _Values(FAN_UNITS, where)
        values.take("linear_resistance", self.linear_resistance if self.linear_resistance is not None else "0 [Pa s/m^3]")
        values.take("speed", self.speed if self.speed is not None else 1, min=0)
        values.take("count", self.count if self.count is not None else 1, min=0)
        values.take("resistance", self._resistance(where))
        parameters: dict[str, Any] = dict(values.parameters)
        lines = [(p0 - (p1 - p0) / (v1 - v0) * v0, (p1 - p0) / (v1 - v0)) for (v0, p0), (v1, p1) in pairwise(points)]
        for k, (a, b) in enumerate(lines):
            parameters[f"head_{k}"] = {"value": f"{a!r} [Pa]", "source": "datasheet"}
            parameters[f"slope_{k}"] = {"value": f"{b!r} [Pa s/m^3]", "source": "datasheet"}
            branch_resistance = f"(linear_resistance - speed*slope_{k}/count)"
            parameters[f"flow_{k}"] = (
                f"2*speed**2*head_{k}/({branch_resistance} + sqrt({branch_resistance}**2 + 4*resistance*speed**2*head_{k}))"
            )
        lowest = []  # for each line the flows of all that lie at or above it between its own two points
        for (a, b), ends in zip(lines, pairwise(v for v, _ in points), strict=True):
            here = [a + b * v for v in ends]
            above = [j for j, (c, d) in enumerate(lines) if all(c + d * v >= h - 1e-12 * abs(h) for v, h in zip(ends, here, strict=True))]
            lowest.append(_nested("min", [f"flow_{j}" for j in above]))
        parameters["flow"] = _nested("max", list(dict.fromkeys(lowest)))
        parameters["pressure"] = "linear_resistance*flow + resistance*flow**2"
        return Assembly({"title": f"fan {name}", "parameters": parameters}, {}, values.set)

    def _points(self, where: Where) -> list[tuple[float, float]]:
        """Return flow [m^3/s] and pressure [Pa] of the curve's points; flows must increase and pressures fall."""
        points = [(literal(v, "m^3/s", where("curve")), literal(p, "Pa", where("curve"))) for v, p in self.curve]
        for (v0, p0), (v1, p1) in pairwise(points):
            refuse_first(
                where,
                (not v1 > v0 >= 0.0, "the flows of a fan's curve must increase, from zero or above.", "curve", "value.outside-range"),
                (
                    not p1 < p0,
                    f"the pressure of a fan's curve must fall with flow; from {v0:g} to {v1:g} m^3/s it does not. Leave the stall "
                    "region out.",
                    "curve",
                    "value.outside-range",
                ),
            )
        return points

    def _resistance(self, where: Where) -> Any:
        """Return the quadratic resistance as it is given, or as pressure / flow^2 of one point of the system. [Pa s^2/m^6]"""
        if (self.resistance is None) == (self.passes is None):
            raise DeckError(
                "give either the resistance of the fan's system, or passes = [flow, pressure], a point of its curve.",
                where(""),
                code="value.incomplete",
            )
        if self.resistance is not None:
            return self.resistance
        assert self.passes is not None
        flow, pressure = (
            plain(text, f"passes.{name}", slot, where("passes"))
            for text, name, slot in zip(self.passes, ("flow", "pressure"), ("m^3/s", "Pa"), strict=True)
        )
        quadratic = pressure / flow / flow
        if not isfinite(quadratic):
            raise DeckError(
                f"a flow of {flow:g} m^3/s at {pressure:g} Pa makes no finite resistance. Give a point that the system has.",
                where("passes"),
                code="value.outside-range",
            )
        return f"{quadratic!r} [Pa s^2/m^6]"


def _nested(function: str, texts: list[str]) -> str:
    """Return min(a, b, ...) or the one text that there is."""
    return texts[0] if len(texts) == 1 else f"{function}({', '.join(texts)})"
