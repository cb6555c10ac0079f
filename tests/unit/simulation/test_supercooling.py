"""Melts that cool below their melting point: hysteresis and recalescence, by formulas and beside an enthalpy integrated by scipy."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import thermid as td
from by_code import raises_code
from oracle import si

Array = NDArray[np.float64]
SALT = {
    "mass": "0.2 [kg]",
    "specific_heat": "2 [kJ/(kg K)]",
    "liquid_specific_heat": "2.5 [kJ/(kg K)]",
    "latent_heat": "190 [kJ/kg]",
    "melts_from": "27 [degC]",
    "melts_to": "29 [degC]",
    "supercooling": "8 [K]",
}
TIGHT = td.Options(error=4e-7)


def deck(**more: Any) -> dict[str, Any]:
    """A salt in a lid: nodes `salt` and `lid`, conductances of 1.5 and 1 W/K to the air."""
    links = {"inner": ("salt", "lid", 1.5), "outer": ("lid", "air", 1.0)}
    conductors = {n: {"kind": "conduction", "between": [a, b], "conductance": f"{g} [W/K]"} for n, (a, b, g) in links.items()}
    return {
        "title": "salt",
        "needs": ["air"],
        "nodes": {"salt": {k: v for k, v in (SALT | more).items() if v is not None}, "lid": {"capacitance": "50 [J/K]"}},
        "conductors": conductors,
    }


def cycle(high: float = 45.0, low: float = 12.0, **more: Any) -> td.Scenario:
    """Hours of warm air, then of cold air."""
    air = {"times": ["0 [h]", "11 [h]", "11.1 [h]", "30 [h]"], "values": [f"{t} [degC]" for t in (high, high, low, low)]}
    return td.Scenario(**({"boundaries": {"air": air}, "start": "20 [degC]", "duration": "30 [h]"} | more))


def test_a_melt_froze_at_its_melting_point_at_once() -> None:
    """It cools to 21 degC, then its temperature rises to where the table has its heat, and freezes on."""
    run = td.simulate(td.model_from_dict(deck()), cycle(), options=TIGHT)
    (melts, first), (freezes, second) = run.statistics["switchings"]
    assert first == second == "salt phase"
    assert float(run["salt"].at(melts)) == pytest.approx(29.0, abs=1e-4)
    before, after = run["salt"].at([freezes - 1e-5, freezes + 1e-5])
    assert before == pytest.approx(21.0, abs=1e-4)
    # 8 K of the liquid's heat out of 190 kJ/kg and the mean of both heats over 2 K
    assert after == pytest.approx(29.0 - 2.0 * 8.0 * 2500.0 / (190e3 + 2.0 * 2250.0), abs=1e-4)
    assert run.heat_balance().relative < 1e-9
    modes = dict(zip(run.times.tolist(), run.modes["salt phase"], strict=True))
    assert (modes[0.0], modes[float(run.times[-1])]) == ("crystals", "crystals")
    assert {m for t, m in modes.items() if melts < t < freezes} == {"liquid"}
    plain = td.simulate(td.model_from_dict(deck(supercooling=None)), cycle(), options=TIGHT)
    cold = (run.times > freezes - 600.0) & (run.times < freezes)
    assert (plain["salt"].celsius[cold] > 28.0).all()  # without supercooling it freezes by then


def test_the_lowest_of_a_melt_is_where_it_freezes() -> None:
    """Between two samples, on a jump."""
    run = td.simulate(td.model_from_dict(deck()), cycle(start="30 [degC]", duration="12 [h]"), every="1 [h]")
    assert run["salt"].lowest == pytest.approx(21.0, abs=1e-3)
    assert run["salt"].minimum.time == pytest.approx(run.statistics["switchings"][-1][0], abs=1e-3)
    assert run["salt"].celsius.min() > 22.0


def test_what_still_has_crystals_does_not_supercool() -> None:
    """Warm air for a while only: half of it has melted, and freezes again without a delay."""
    air = {"times": ["0 [h]", "1 [h]", "1.1 [h]", "6 [h]"], "values": ["45 [degC]", "45 [degC]", "12 [degC]", "12 [degC]"]}
    runs = [
        td.simulate(td.model_from_dict(deck(supercooling=s)), cycle(boundaries={"air": air}, duration="6 [h]")) for s in ("8 [K]", None)
    ]
    assert runs[0]["salt"].highest < 29.0
    assert runs[0].statistics["switchings"] == []
    assert np.abs(runs[0]["salt"].kelvin - runs[1]["salt"].kelvin).max() < 1e-4


def test_a_start_between_the_two_temperatures_is_solid_unless_it_says_liquid() -> None:
    room = td.Scenario(boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="2 [h]")
    for starts, heat in ((None, 2000.0), ("liquid", 2500.0)):
        model = td.model_from_dict(deck(starts=starts))
        run = td.simulate(model, room.with_(boundaries={"air": "23 [degC]"}))
        assert run.modes["salt phase"][-1] == (starts or "crystals")
        stored = 0.2 * heat * (run["salt"].kelvin[-1] - run["salt"].kelvin[0]) + 50.0 * (run["lid"].kelvin[-1] - run["lid"].kelvin[0])
        assert run.heat_balance().stored == pytest.approx(stored, rel=1e-6)
        for start in ("steady", "24 [degC]"):
            rests = td.simulate(model, room.with_(start=start))
            assert np.abs(rests["salt"].celsius - 24.0).max() < 1e-9
            assert set(rests.modes["salt phase"]) == {starts or "crystals"}
        assert td.steady(model, room)["salt"] == pytest.approx(297.15, abs=1e-9)
    cold = td.simulate(td.model_from_dict(deck(starts="liquid")), room.with_(start="20 [degC]", boundaries={"air": "20 [degC]"}))
    assert cold["salt"].highest == pytest.approx(20.0, abs=1e-9)  # below 21 degC no melt can be


@pytest.mark.parametrize("at", [25.0, 28.0, 60.0])
def test_steady_states_do_not_know_the_history(at: float) -> None:
    heated = deck() | {"loads": {"q": {"into": "salt", "power": "3 [W]"}}}
    found = td.steady(td.model_from_dict(heated), td.Scenario(boundaries={"air": f"{at} [degC]"}))
    assert found["salt"] == pytest.approx(at + 273.15 + 3.0 * (1.0 / 1.5 + 1.0), abs=1e-8)


class Enthalpy:
    """Nodes whose heat is the state: temperatures by branch, branches by events; scipy alone, from the dictionary of a deck."""

    def __init__(self, deck: dict[str, Any], air: tuple[Array, Array], start: float) -> None:
        self.deck, self.air, self.nodes = deck, air, list(deck["nodes"])
        self.melts = [n for n, t in deck["nodes"].items() if "supercooling" in t]
        self.liquid = dict.fromkeys(self.nodes, False)
        self.heat = np.array([self.begin(n, start) for n in self.nodes])
        self.events: list[float] = []
        self.paces: list[float] = []  # of the melt at each event [K/s]

    def field(self, node: str, name: str) -> float:
        table = self.deck["nodes"][node]
        if name == "melts_to" and name not in table:
            return self.field(node, "melts_from")
        return si(table[name])

    def begin(self, node: str, kelvin: float) -> float:
        if node not in self.melts:
            return si(self.deck["nodes"][node]["capacitance"]) * kelvin
        assert kelvin < self.field(node, "melts_from")
        return self.field(node, "mass") * self.field(node, "specific_heat") * kelvin

    def knees(self, node: str) -> tuple[float, float]:
        """Return the heat at which melting begins and ends. [J]"""
        m, c, cl = (self.field(node, f) for f in ("mass", "specific_heat", "liquid_specific_heat"))
        low, high = self.field(node, "melts_from"), self.field(node, "melts_to")
        return m * c * low, m * (c * low + self.field(node, "latent_heat") + 0.5 * (c + cl) * (high - low))

    def temperature(self, k: int, heat: float) -> float:
        node = self.nodes[k]
        if node not in self.melts:
            return heat / si(self.deck["nodes"][node]["capacitance"])
        m, c, cl = (self.field(node, f) for f in ("mass", "specific_heat", "liquid_specific_heat"))
        low, high = self.field(node, "melts_from"), self.field(node, "melts_to")
        solid, molten = self.knees(node)
        if self.liquid[node] or heat >= molten:
            return high + (heat - molten) / (m * cl)
        return heat / (m * c) if heat <= solid else low + (high - low) * (heat - solid) / (molten - solid)

    def rates(self, t: float, heat: Array) -> Array:
        at = {n: self.temperature(k, heat[k]) for k, n in enumerate(self.nodes)} | {"air": float(np.interp(t, *self.air))}
        out = dict.fromkeys(at, 0.0)
        for c in self.deck["conductors"].values():
            a, b = c["between"]
            flow = si(c["conductance"]) * (at[a] - at[b])
            out[a] -= flow
            out[b] += flow
        for q in self.deck.get("loads", {}).values():
            out[q["into"]] += si(q["power"])
        return np.array([out[n] for n in self.nodes])

    def run(self, times: Array) -> Array:
        """Return temperatures (times, nodes), restarted at every knot of the air and at every knee. [K]"""
        now, rows = 0.0, []
        knots = [*self.air[0][(self.air[0] > 0.0) & (self.air[0] < times[-1])], times[-1]]
        while now < times[-1]:
            # stretches end at knots, and where a node begins to melt, has melted, or freezes
            marks = [(self.nodes.index(n), level, what) for n in self.melts for what, level in self.levels(n)]
            events = [lambda _, h, k=k, level=level: h[k] - level for k, level, _ in marks]
            for e in events:
                e.terminal = True
            end = next(k for k in knots if k > now)
            # events are looked for on the dense output, of a lower order than the steps
            fine = {"rtol": 1e-11, "atol": 1e-6, "max_step": 60.0}
            found = solve_ivp(self.rates, (now, end), self.heat, "DOP853", events=events, dense_output=True, **fine)
            inside = times[(times >= now) & ((times < found.t[-1]) | (found.t[-1] == times[-1]))]
            rows += [[self.temperature(k, h) for k, h in enumerate(found.sol(t))] for t in inside]
            now, self.heat = float(found.t[-1]), found.y[:, -1].copy()
            for (k, level, what), hit in zip(marks, found.t_events, strict=True):
                if hit.size:
                    rate = self.rates(now, self.heat)[k]
                    self.pass_by(k, level, what, rate)
                    if what in ("molten", "freezes"):
                        self.events.append(now)
                        node = self.nodes[k]
                        heat = self.field(node, "mass") * self.field(node, "liquid_specific_heat")
                        self.paces.append(abs(rate) / heat)
        return np.array(rows)

    def pass_by(self, k: int, level: float, what: str, rate: float) -> None:
        node = self.nodes[k]
        self.heat[k] = level * (1.0 + np.sign(rate) * 1e-14)
        if what in ("molten", "freezes"):
            self.liquid[node] = what == "molten"

    def levels(self, node: str) -> list[tuple[str, float]]:
        solid, molten = self.knees(node)
        freezes = molten - self.field(node, "mass") * self.field(node, "liquid_specific_heat") * si(
            self.deck["nodes"][node]["supercooling"]
        )
        return [("freezes", freezes)] if self.liquid[node] else [("solid", solid), ("molten", molten)]


def random_deck(seed: int) -> dict[str, Any]:
    """One to three melts among plain nodes, in a chain with a branch; melts of one temperature and over ranges."""
    rng = np.random.default_rng(seed)
    names = [f"n{k}" for k in range(rng.integers(2, 5))]
    nodes: dict[str, Any] = {n: {"capacitance": f"{rng.uniform(30.0, 200.0)!r} [J/K]"} for n in names}
    for n in names[: rng.integers(1, 4)]:
        low, span = rng.uniform(302.0, 306.0), float(rng.choice([0.0, rng.uniform(0.3, 4.0)]))
        nodes[n] = {
            "mass": f"{rng.uniform(10.0, 60.0)!r} [g]",
            "specific_heat": f"{rng.uniform(1.5, 2.5)!r} [kJ/(kg K)]",
            "liquid_specific_heat": f"{rng.uniform(1.5, 3.0)!r} [kJ/(kg K)]",
            "latent_heat": f"{rng.uniform(80.0, 250.0)!r} [kJ/kg]",
            "melts_from": f"{low!r} [K]",
            "supercooling": f"{rng.uniform(0.5, 9.0)!r} [K]",
        } | ({"melts_to": f"{low + span!r} [K]"} if span else {})
    pairs = [*pairwise(names), (names[-1], "air"), (names[0], "air")]
    conductors = {
        f"c{k}": {"kind": "conduction", "between": list(p), "conductance": f"{rng.uniform(0.3, 2.0)!r} [W/K]"} for k, p in enumerate(pairs)
    }
    loads = {"q": {"into": names[0], "power": f"{rng.uniform(0.0, 1.0)!r} [W]"}}
    return {"title": f"melts {seed}", "needs": ["air"], "nodes": nodes, "conductors": conductors, "loads": loads}


def check_random(seed: int) -> int:
    """Compare a random deck with the oracle; return how many phases changed.

    A node is late by ten microseconds on its heat, which over 100 s moves an instant by 0.1 ms, and recalescence by that times its rate.
    """
    written = random_deck(seed)
    hours = np.array([0.0, 4.0, 4.2, 9.0, 9.1, 13.0]) * 3600.0
    kelvin = np.array([320.0, 320.0, 286.0, 286.0, 325.0, 325.0])
    times = np.linspace(0.0, hours[-1], 197)
    oracle = Enthalpy(written, (hours, kelvin), 290.0)
    expected = oracle.run(times)
    air = {"times": [f"{t} [s]" for t in hours], "values": [f"{k} [K]" for k in kelvin]}
    scenario = td.Scenario(boundaries={"air": air}, start="290 [K]", duration=f"{times[-1]} [s]")
    run = td.simulate(td.model_from_dict(written), scenario, times=times, options=TIGHT)
    found = np.column_stack([run[n].kelvin for n in oracle.nodes])
    assert np.abs(found - expected).max() < 1e-3, seed
    switched = [t for t, _ in run.statistics["switchings"]]
    assert len(switched) == len(oracle.events), seed
    late = np.abs(np.array(switched) - oracle.events)
    assert (late < 1e-3 + 1e-5 / np.array(oracle.paces)).all(), seed  # 1 ms, and what 10 uK make of an instant that comes slowly
    assert run.heat_balance().relative < 1e-9, seed
    return len(switched)


@pytest.mark.parametrize("seed", range(3))
def test_random_melts(seed: int) -> None:
    check_random(seed)


@pytest.mark.campaign
def test_many_random_melts() -> None:
    assert sum(check_random(seed) for seed in range(100, 300)) > 400


def test_derivatives_are_differences() -> None:
    """Across melting, nucleation and the jump; away from the instants themselves."""
    free = ("salt.mass", "inner.conductance", "lid.capacitance", "air")
    times = np.arange(0.0, 30.0 * 3600.0, 1801.0)
    simulator = td.prepare(td.model_from_dict(deck()), cycle(), free, times=times, options=TIGHT)
    run, nominal = simulator.run(sensitivities=True), simulator.nominal
    for name in free:
        step = 1e-4 * max(abs(nominal[name]), 0.1)
        up, down = (simulator.run({name: nominal[name] + sign * step}) for sign in (1.0, -1.0))
        for node in ("salt", "lid"):
            want = (up[node].kelvin - down[node].kelvin) / (2.0 * step)
            own = run.sensitivity(node, name)
            assert np.abs(own - want).max() < 2e-3 * max(np.abs(want).max(), 1e-3), (name, node)


def test_a_melt_is_saved_and_read_again(tmp_path: Path) -> None:
    """As an enthalpy with the temperature from which supercooling counts."""
    model = td.model_from_dict(deck(starts="liquid"))
    td.save_model(model, tmp_path / "salt.toml")
    again = td.load_model(tmp_path / "salt.toml")
    assert again == model
    runs = [td.simulate(m, cycle(start="25 [degC]"))["salt"].kelvin for m in (model, again)]
    assert np.array_equal(*runs)


def test_members_go_their_own_ways() -> None:
    part = td.model_from_dict(deck())
    one = td.simulate(part, cycle(), every="15 [min]")
    low = td.simulate(part.with_values({"salt.mass": "0.1 [kg]"}), cycle(), every="15 [min]")
    members = td.ensemble(part, cycle(), {"salt.mass": np.array([0.2, 0.1])}, every="15 [min]")
    for k, run in enumerate((one, low)):
        assert np.abs(members.trace(k, "salt").kelvin - run["salt"].kelvin).max() < 1e-6


def test_two_instances_freeze_when_each_is_cold(tmp_path: Path) -> None:
    td.save_model(td.model_from_dict(deck()), tmp_path / "pack.toml")
    uses = {n: {"use": "pack.toml", "bind": {"air": n}} for n in ("yard", "shed")}
    (tmp_path / "two.toml").write_text(
        'title = "two"\nneeds = ["yard", "shed"]\n[submodels]\n'
        + "".join(f'{n}_pack = {{ use = "{u["use"]}", bind = {{ air = "{n}" }} }}\n' for n, u in uses.items())
    )
    cold, mild = (cycle(low=t).boundaries["air"] for t in (12.0, 20.0))
    run = td.simulate(td.load_model(tmp_path / "two.toml"), cycle(boundaries={"yard": cold, "shed": mild}))
    single = td.simulate(td.model_from_dict(deck()), cycle())
    freezing = {name: t for t, name in run.statistics["switchings"]}
    assert set(freezing) == {"yard_pack.salt phase", "shed_pack.salt phase"}
    assert freezing["yard_pack.salt phase"] == pytest.approx(single.statistics["switchings"][-1][0], abs=0.05)
    assert freezing["shed_pack.salt phase"] > freezing["yard_pack.salt phase"] + 600.0


def test_what_knows_no_phase_says_so() -> None:
    model = td.model_from_dict(deck())
    for method, match in (("large", "'salt phase'"), ("modal", "'salt phase'")):
        with raises_code("model.element-not-supported", td.ThermidError, match=match):
            td.simulate(model, cycle(), options=td.Options(method=method))


WRONG = {
    "no melting": (
        {"latent_heat": None, "melts_from": None, "melts_to": None, "liquid_specific_heat": None},
        "model.law-refused",
        "latent_heat .*melts_from",
    ),
    "not below zero": ({"supercooling": "-3 [K]"}, "value.outside-range", "'supercooling' is -3 K"),
    "more than its latent heat": (
        {"specific_heat": "1 [kJ/(kg K)]", "liquid_specific_heat": "40 [kJ/(kg K)]", "latent_heat": "20 [kJ/kg]"},
        "value.outside-range",
        r" 8 K .* 41\.15 K, .* 294\.15 K",
    ),
    "a temperature": ({"supercooling": "8 [degC]"}, "unit.scale-for-difference", "supercooling"),
    "a start of its own": ({"supercooling": None, "starts": "liquid"}, "value.without-effect", "'liquid'"),
    "a start that is none": ({"starts": "molten"}, "value.wrong-kind", "'molten'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_supercool_is_refused(case: str) -> None:
    change, code, match = WRONG[case]
    with raises_code(code, match=match):
        td.simulate(td.model_from_dict(deck(**change)), cycle())


def test_an_enthalpy_needs_the_point_that_supercooling_counts_from() -> None:
    table = {"points": [["0 [degC]", "0 [kJ/kg]"], ["27 [degC]", "54 [kJ/kg]"], ["27 [degC]", "240 [kJ/kg]"], ["60 [degC]", "300 [kJ/kg]"]]}
    node = {"mass": "0.2 [kg]", "enthalpy": table, "supercooling": "5 [K]"}
    whole = deck()
    for more, code, match in (({}, "value.contradicts", "melts_to"), ({"melts_to": "28 [degC]"}, "model.law-refused", "")):
        whole["nodes"]["salt"] = node | more
        with raises_code(code, td.ThermidError, match=match):
            td.simulate(td.model_from_dict(whole), cycle())
    whole["nodes"]["salt"] = node | {"melts_to": "27 [degC]"}
    run = td.simulate(td.model_from_dict(whole), cycle())
    freezes = run.statistics["switchings"][-1][0]
    assert run["salt"].at([freezes - 1e-5, freezes + 1e-5]) == pytest.approx([22.0, 27.0], abs=1e-3)
