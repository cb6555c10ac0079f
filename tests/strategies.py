"""Random models as dictionaries of SI texts, random scenarios for them, and the decorator that runs a property on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings, strategies as st

import thermid as td

Deck = dict[str, Any]

LINEAR = ("conductivity", "conductance", "resistance", "contact", "convection", "effective")
CROOKED = ("natural", "radiation", "exchange", "over_temperature", "over_difference")
EVERY = (*LINEAR, *CROOKED, "flow")
GASES = (
    *LINEAR,
    *CROOKED,
    "gap",
    "flow",
    "film",
)  # with gas at rest in gaps, and convection by correlation, of which tests/oracle.py knows nothing
WITHOUT_KNEES = tuple(kind for kind in EVERY if kind != "natural")  # natural convection has one where the difference changes sign
STEADY_LOADS = ("constant",)
LOADS = ("constant", "polynomial", "exponential", "table", "periodic", "sine", "proportional", "combined")
SMOOTH = tuple(
    kind for kind in LOADS if kind not in ("proportional", "combined")
)  # a proportional heater has a knee at either end of its band
SWITCHED = (*LOADS, "thermostat", "combined thermostat")
DURATION = 3600.0
CAMPAIGN_FACTOR = 15
TIGHT = td.Options(error=8e-8)
TIGHTER = td.Options(error=8e-10)


def random_models(examples: int, **strategies: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator: a property on half of `examples` fixed random cases, on 15 times as many fresh ones where marked `campaign`."""

    def decorate(check: Callable[..., None]) -> Callable[..., None]:
        def run(effort: str) -> None:
            many = effort == "campaign"
            chosen = settings(
                max_examples=examples * CAMPAIGN_FACTOR if many else (examples + 1) // 2,
                derandomize=not many,
                database=None,
                deadline=None,
                print_blob=True,
                suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much],
                phases=(Phase.explicit, Phase.generate, Phase.shrink),
            )
            chosen(given(**strategies)(check))()

        run.__name__, run.__doc__, run.__module__ = check.__name__, check.__doc__, check.__module__
        marks = [pytest.param("quick", id="quick"), pytest.param("campaign", id="campaign", marks=pytest.mark.campaign)]
        return pytest.mark.properties(pytest.mark.parametrize("effort", marks)(run))

    return decorate


def text(value: float, unit: str) -> str:
    """Return a value as a deck writes it."""
    return f"{value!r} [{unit}]"


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Return values of three digits, evenly spread over the logarithm; they shrink towards the low end."""
    return st.integers(0, 60).map(lambda k: float(f"{low * (high / low) ** (k / 60):.3g}"))


def even(low: float, high: float) -> st.SearchStrategy[float]:
    """Return values of a grid of sixty steps."""
    return st.integers(0, 60).map(lambda k: round(low + (high - low) * k / 60, 3))


def temperature() -> st.SearchStrategy[str]:
    return even(255.0, 345.0).map(lambda t: text(t, "K"))


@dataclass
class _Level:
    """What is drawn for one model of a tree."""

    deck: Deck
    massive: list[str] = field(default_factory=list)
    inner: list[str] = field(default_factory=list)  # nodes of submodels, by path
    faces: dict[str, float] = field(default_factory=dict)  # surface -> area that no joint has taken yet
    offers: list[str] = field(default_factory=list)

    @property
    def nodes(self) -> list[str]:
        return list(self.deck["nodes"])

    @property
    def ends(self) -> list[str]:
        return [*self.deck["needs"], *self.nodes, *self.inner]


@st.composite
def decks(
    draw: Any,
    nodes: int = 8,
    kinds: tuple[str, ...] = EVERY,
    loads: tuple[str, ...] = LOADS,
    depth: int = 2,
    massless: bool = True,
    flat: bool = False,
    title: str = "Top",
) -> Deck:
    """Draw a model: at most `nodes` nodes of its own and of its submodels, every one with a path to a boundary."""
    needs = [f"e{k}" for k in range(draw(st.integers(1, 2)))]
    level = _Level(
        {
            "title": title,
            "needs": needs,
            "nodes": {},
            "surfaces": {},
            "conductors": {},
            "joints": {},
            "loads": {},
            "submodels": {},
            "set": {},
        }
    )
    own = draw(st.integers(1, nodes if flat or depth == 0 else max(1, nodes // 2)))
    tree = tuple(k for k in kinds if k not in ("flow", "film"))
    for k in range(own):
        name = f"n{k}"
        start = draw(st.sampled_from(level.ends))
        level.deck["nodes"][name] = _node(draw, massless and k > 0)
        if level.deck["nodes"][name]:
            level.massive.append(name)
        _conductor(draw, level, start, name, tree)
    if depth > 0 and not flat and own < nodes:
        _submodels(draw, level, nodes - own, kinds, loads, depth, massless)
    for node in level.massive:
        if draw(st.integers(0, 2)) == 0:
            _surface(draw, level, node, kinds)
    for _ in range(draw(st.integers(0, 2))):
        _extra_conductor(draw, level, kinds)
    if draw(st.booleans()):
        _joint(draw, level)
    for _ in range(draw(st.integers(0, 2)) if loads else 0):
        _load(draw, level, loads)
    level.deck["offers"] = [*level.nodes, *level.deck["surfaces"], *level.offers]
    return {k: v for k, v in level.deck.items() if v not in ({}, [])}


def _node(draw: Any, massless: bool) -> Deck:
    solid: Deck = {"stands_for": "walls"}  # whatever convects to it: a part may be bound to any node
    choice = draw(st.integers(0, 3 if massless else 2))
    if choice == 3:
        return solid
    if choice == 2:
        return solid | {"mass": text(draw(spread(0.05, 2.0)), "kg"), "specific_heat": text(draw(even(400.0, 1000.0)), "J/(kg K)")}
    return solid | {"capacitance": text(draw(spread(20.0, 2000.0)), "J/K")}


def _conductor(draw: Any, level: _Level, a: str, b: str, kinds: tuple[str, ...]) -> None:
    level.deck["conductors"][f"c{len(level.deck['conductors'])}"] = _law(draw, draw(st.sampled_from(kinds))) | {"between": [a, b]}


def _law(draw: Any, kind: str) -> Deck:
    """Draw the fields of a conductor; its conductance is between some hundredths and some watts per kelvin."""
    area = lambda: text(draw(spread(0.005, 0.2)), "m^2")  # noqa: E731
    if kind == "conductivity":
        return {
            "kind": "conduction",
            "conductivity": text(draw(spread(1, 200)), "W/(m K)"),
            "area": text(draw(spread(1e-4, 1e-3)), "m^2"),
            "thickness": text(draw(spread(0.002, 0.05)), "m"),
        }
    if kind == "conductance":
        return {"kind": "conduction", "conductance": text(draw(spread(0.05, 5)), "W/K")}
    if kind == "resistance":
        return {"kind": "conduction", "resistance": text(draw(spread(0.2, 20)), "K/W")}
    if kind == "contact":
        return {
            "kind": "contact",
            "contact_conductance": text(draw(spread(50, 1000)), "W/(m^2 K)"),
            "area": text(draw(spread(0.001, 0.005)), "m^2"),
        }
    if kind == "convection":
        return {"kind": "convection", "htc": text(draw(spread(2, 20)), "W/(m^2 K)"), "area": area()}
    if kind == "effective":
        return {"kind": "effective", "effective_htc": text(draw(spread(2, 20)), "W/(m^2 K)"), "area": area()}
    if kind == "natural":
        law = {"coefficient": text(draw(spread(1, 4)), "W/(m^2 K)"), "exponent": draw(st.sampled_from([0.25, 0.333, 0.5]))}
        return {"kind": "convection", "htc": law, "area": area()}
    if kind == "radiation":
        return {"kind": "radiation", "emissivity": draw(even(0.1, 0.95)), "area": area()}
    if kind == "exchange":
        return {"kind": "radiation", "exchange_factor": draw(even(0.1, 0.95)), "area": area()}
    if kind == "gap":
        width, share = text(draw(spread(2e-4, 2e-3)), "m"), draw(even(0.3, 1.0))
        return {"kind": "gas", "gas": "He", "gap": width, "area": text(draw(spread(0.002, 0.02)), "m^2"), "accommodation": share}
    if kind == "flow":
        return {"kind": "flow", "mass_flow": text(draw(spread(1e-5, 1e-3)), "kg/s"), "specific_heat": text(1007.0, "J/(kg K)")}
    base = draw(spread(0.1, 2))
    if kind == "over_temperature":
        points = [[text(x, "K"), text(round(base * draw(even(0.8, 1.2)), 6), "W/K")] for x in (260.0, 295.0, 340.0)]
        return {"kind": "table", "table": {"over": "temperature", "points": points}, "scale": draw(even(0.5, 1.5))}
    # growing with the difference on both sides, so that more difference never means less heat
    points = [[text(x, "K"), text(round(base * (1 + (0.0 if x == 0 else draw(even(0.0, 1.0)))), 6), "W/K")] for x in (-30.0, 0.0, 40.0)]
    return {"kind": "table", "table": {"over": "difference", "points": points}}


def _submodels(draw: Any, level: _Level, left: int, kinds: tuple[str, ...], loads: tuple[str, ...], depth: int, massless: bool) -> None:
    for k in range(draw(st.integers(0, min(2, left)))):
        name = f"m{k}"
        part = draw(
            decks(
                nodes=max(1, left // 2), kinds=kinds, loads=loads, depth=depth - 1, massless=massless, title=f"{level.deck['title']}_{name}"
            )
        )
        bind = {need: draw(st.sampled_from([*level.deck["needs"], *level.nodes])) for need in part["needs"]}
        level.deck["submodels"][name] = {"use": part, "bind": bind}
        owners = {n: owner for n, owner in _owners(part)}
        for offer in part["offers"]:
            level.offers.append(f"{name}.{offer}")
            kind, element = owners[offer]
            if kind == "node":
                level.inner.append(f"{name}.{offer}")
            else:
                level.faces[f"{name}.{offer}"] = element
        if draw(st.booleans()) and "capacitance" in part["nodes"]["n0"]:
            level.deck["set"][f"{name}.n0.capacitance"] = text(draw(spread(20.0, 2000.0)), "J/K")


def _owners(part: Deck, prefix: str = "") -> list[tuple[str, tuple[str, float]]]:
    """Return path -> what it is, with the free area of a surface, for everything that a part offers."""
    out = [(prefix + n, ("node", 0.0)) for n in part["nodes"]]
    for name, s in part.get("surfaces", {}).items():
        taken = sum(j["area_"] for j in _joints_on(part, name))
        out.append((prefix + name, ("surface", number(s["area"]) - taken)))
    for name, sub in part.get("submodels", {}).items():
        taken = {path: sum(j["area_"] for j in _joints_on(part, path)) for path in [f"{name}.{o}" for o in sub["use"]["offers"]]}
        out += [(prefix + p, (kind, free - taken.get(p, 0.0))) for p, (kind, free) in _owners(sub["use"], f"{name}.")]
    return out


def _joints_on(part: Deck, surface: str) -> list[Deck]:
    found = [j for j in part.get("joints", {}).values() if surface in j["between"]]
    return [{"area_": number(j["area"]) + (number(j["gap"]["area"]) if "gap" in j else 0.0)} for j in found]


def number(value: Any) -> float:
    """Return the number of a text in SI, or the number itself."""
    return float(value.partition(" [")[0]) if isinstance(value, str) else float(value)


def _surface(draw: Any, level: _Level, node: str, kinds: tuple[str, ...]) -> None:
    to = draw(st.sampled_from(level.deck["needs"]))
    area = draw(spread(0.01, 0.2))
    out: Deck = {"of": node, "to": to, "area": text(area, "m^2")}
    crooked = [*(["natural"] if "natural" in kinds else []), *(["both", "emissivity"] if "radiation" in kinds else [])]
    law = draw(st.sampled_from(["htc", "effective", *crooked, *(["film"] if "film" in kinds else [])]))
    if law in ("htc", "both"):
        out["htc"] = text(draw(spread(2, 20)), "W/(m^2 K)")
    if law == "effective":
        out["effective_htc"] = text(draw(spread(2, 20)), "W/(m^2 K)")
    if law == "natural":
        out["htc"] = {"coefficient": text(draw(spread(1, 4)), "W/(m^2 K)"), "exponent": 0.25}
    if law == "film":
        out["htc"] = {"length": text(draw(spread(0.01, 0.3)), "m"), "orientation": draw(st.sampled_from(["vertical", "up", "down"]))}
    if law == "emissivity":
        out["htc"] = text(0.0, "W/(m^2 K)")
    if law in ("both", "emissivity"):
        out["emissivity"] = draw(even(0.1, 0.95))
        out["sees"] = draw(st.sampled_from(level.deck["needs"]))
    name = f"s{len(level.deck['surfaces'])}"
    level.deck["surfaces"][name] = out
    level.faces[name] = area


def _extra_conductor(draw: Any, level: _Level, kinds: tuple[str, ...]) -> None:
    a, b = draw(st.sampled_from(level.ends)), draw(st.sampled_from(level.ends))
    if a != b:
        _conductor(draw, level, a, b, tuple(k for k in kinds if k != "film"))


def _joint(draw: Any, level: _Level) -> None:
    free = [face for face, area in level.faces.items() if area > 1e-3]
    if len(free) < 2:
        return
    a = draw(st.sampled_from(free))
    b = draw(st.sampled_from([f for f in free if f != a]))
    area = float(f"{0.3 * min(level.faces[a], level.faces[b]):.3g}")
    joint: Deck = {"between": [a, b], "area": text(area, "m^2")}
    if draw(st.booleans()):
        joint["contact_conductance"] = text(draw(spread(50, 1000)), "W/(m^2 K)")
    else:
        joint |= {"conductivity": text(draw(spread(0.5, 5)), "W/(m K)"), "thickness": text(draw(spread(0.002, 0.02)), "m")}
    if draw(st.booleans()):
        joint["gap"] = {
            "area": text(area, "m^2"),
            "htc": text(draw(spread(1, 8)), "W/(m^2 K)"),
            "to": draw(st.sampled_from(level.deck["needs"])),
        }
    if draw(st.booleans()):
        joint["mid"] = "middle"
    level.deck["joints"]["j0"] = joint


def _load(draw: Any, level: _Level, kinds: tuple[str, ...]) -> None:
    kind = draw(st.sampled_from(kinds))
    # a controlled heater on a massless node that only radiates is a case of its own: tests/properties/test_oracle.py
    into = draw(st.sampled_from(level.nodes if kind in SMOOTH else level.massive))
    power, k = text(draw(spread(0.2, 5)), "W"), len(level.deck["loads"])
    out: Deck = {"into": into, "power": power}
    several = kind.startswith("combined")
    law = draw(st.sampled_from(("constant", "polynomial", "exponential", "table"))) if several else kind
    course = draw(st.sampled_from(("constant", "periodic", "sine"))) if several else kind
    control = draw(st.sampled_from(("proportional", "band"))) if kind == "combined" else kind.removeprefix("combined ")
    if law == "table" and control == "proportional":
        control = "band"  # a gain refers to a power, which a table has not
    reference = {"reference_temperature": text(300.0, "K")}
    if law == "polynomial":
        out |= {
            "temperature_coefficient": text(draw(even(-0.01, 0.002)), "1/K"),
            "quadratic_coefficient": text(draw(even(-2e-2, 0)) * 1e-3, "1/K^2"),
        } | reference
    if law == "exponential":
        out |= {"exponential_coefficient": text(draw(even(-0.01, 0.002)), "1/K")} | reference
    if law == "table":
        powers = sorted((draw(spread(0.1, 5)) for _ in range(3)), reverse=True)
        out = {
            "into": into,
            "table": {"points": [[text(x, "K"), text(p, "W")] for x, p in zip((250.0, 300.0, 350.0), powers, strict=True)]},
        }
    if course == "periodic":
        out["periodic"] = {
            "period": text(draw(st.sampled_from([300.0, 700.0, 1800.0])), "s"),
            "duty": draw(st.sampled_from([0.25, 0.5, 0.7])),
        }
    if course == "sine":
        out["sine"] = {"amplitude": text(draw(spread(0.1, 2)), "W"), "period": text(draw(st.sampled_from([600.0, 3000.0, 7200.0])), "s")}
    if control in ("proportional", "band"):
        sensor = draw(st.sampled_from(level.nodes))
        width = (
            {"gain": text(draw(spread(0.02, 0.5)), "W/K")} if control == "proportional" else {"band": text(draw(spread(2.0, 50.0)), "K")}
        )
        out["proportional"] = {**width, "setpoint": temperature_of(draw(even(290.0, 330.0)))}
        if sensor != into:
            out["proportional"]["sensor"] = sensor
    if control == "thermostat":
        low = draw(even(280.0, 320.0))
        out["thermostat"] = {"on_below": text(low, "K"), "off_above": text(low + draw(even(1.0, 6.0)), "K")}
    level.deck["loads"][f"q{k}"] = out


def temperature_of(kelvin: float) -> str:
    return text(kelvin, "K")


@st.composite
def signals(draw: Any, duration: float = DURATION, constant: bool = False) -> Any:
    """Draw the temperature of a boundary: constant, a table joined or held, or a sine."""
    kind = "constant" if constant else draw(st.sampled_from(["constant", "linear", "hold", "sine"]))
    if kind == "constant":
        return draw(temperature())
    if kind == "sine":
        return {
            "mean": draw(temperature()),
            "amplitude": text(draw(even(1, 20)), "K"),
            "period": text(draw(st.sampled_from([900.0, 3600.0, 86400.0])), "s"),
            "phase": draw(even(0, 6)),
        }
    count = draw(st.integers(2, 5))
    times = [text(round(duration * k / count, 1), "s") for k in range(count)]
    return {"times": times, "values": [draw(temperature()) for _ in times], "hold": kind == "hold", "after": "hold"}


@dataclass(frozen=True)
class Case:
    """A random model with what is done to it, both as dictionaries.

    `scenario` holds boundaries, start, initial and commands as `thermid.Scenario` takes them.
    """

    deck: Deck
    scenario: dict[str, Any]

    @property
    def model(self) -> td.Model:
        return build(self.deck)

    def run(self, **more: Any) -> td.Scenario:
        return td.Scenario("random", **{**self.scenario, **more})


@st.composite
def cases(draw: Any, constant: bool = False, **of_deck: Any) -> Case:
    """Draw a model and a scenario for it."""
    deck = draw(decks(**of_deck))
    boundaries = {need: draw(signals(constant=constant)) for need in deck["needs"]}
    scenario: dict[str, Any] = {"boundaries": boundaries, "start": draw(temperature()), "duration": DURATION}
    scenario["initial"] = {n: draw(temperature()) for n in deck["nodes"] if deck["nodes"][n] and draw(st.integers(0, 3)) == 0}
    plain = [n for n, q in deck.get("loads", {}).items() if set(q) == {"into", "power"}]
    if not constant and plain and draw(st.booleans()):
        scenario["commands"] = {draw(st.sampled_from(plain)): draw(st.sampled_from(COMMANDS))}
    return Case(deck, scenario)


COMMANDS: tuple[Mapping[str, Any], ...] = (
    {"times": ["0.0 [s]", "900.0 [s]", "1500.0 [s]"], "values": [1.0, 0.0, 0.5], "hold": True},
    {"times": ["0.0 [s]", "2000.0 [s]", "3000.0 [s]"], "values": [0.0, 1.0, 0.25], "hold": False, "after": "hold"},
)


def build(deck: Deck) -> td.Model:
    """Return the model of a nested dictionary."""
    out = dict(deck)
    if "submodels" in deck:
        out["submodels"] = {n: {**s, "use": build(s["use"])} for n, s in deck["submodels"].items()}
    return td.model_from_dict(out)
