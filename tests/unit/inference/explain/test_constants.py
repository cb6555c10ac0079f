"""Constants that decide a verdict of explain, each against the figure that it stands for: a tenth more or less is seen here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import code_of
from thermid.base.units import STEFAN_BOLTZMANN, value_of
from thermid.fit.calibration import Calibration, Request, SensorStatistics
from thermid.inference._explain.candidates import _Place, _radiation, faults_of, missing_elements
from thermid.inference._explain.criticism import Candidate, Criticism, TraceCriticism
from thermid.inference._explain.diagnosis import Diagnosis, Suspect
from thermid.inference._explain.plausibility import RangeCheck
from thermid.inference._explain.thresholds import SIZES
from thermid.model.tree import TableSignal
from thermid.physics.materials import Material
from thermid.simulation.runs import compile_network
from unit.fit.bench import HTC, MASS, box, log, pair

RNG = np.random.default_rng(4)


def trace(rmse: float = 0.05, lag_one: float = 0.0, **more: Any) -> TraceCriticism:
    zeros = np.zeros(200)
    plain = {"record": "r", "sensor": "T", "times": zeros, "temperature": zeros, "power": zeros, "residuals": zeros}
    statistics = SensorStatistics(rmse, 0.0, rmse, 200, 0.0, lag_one, 200.0)
    return TraceCriticism(**{**plain, "noise": 0.05, "statistics": statistics, "slopes": {}, **more})


def test_a_path_is_within_a_factor_of_twenty_of_what_the_part_loses() -> None:
    """95 % of a logarithm with this spread lies within its 1.96 fold."""
    assert np.exp(1.96 * SIZES["path"].spread) == pytest.approx(20.0, rel=0.1)


class TestWhatATraceIsCalled:
    def test_loud_is_three_deviations_of_a_mean_square_of_white_noise(self) -> None:
        spread = np.sqrt(2.0 / 200)
        assert not trace(rmse=0.05 * np.sqrt(1.0 + 2.8 * spread)).loud
        assert trace(rmse=0.05 * np.sqrt(1.0 + 3.2 * spread)).loud

    def test_a_slope_of_three_standard_errors_is_said_per_hour(self) -> None:
        assert "+1 K per" in str(trace(lag_one=0.9, slopes={"time": (1.0 / 3600.0, 1.0 / 3600.0 / 3.1)}))
        assert "K per hour" not in str(trace(lag_one=0.9, slopes={"time": (1.0 / 3600.0, 1.0 / 3600.0 / 2.9)}))


class TestEvidence:
    """Twice logarithms of Bayes factors by Kass and Raftery: above 10 very strong, above 6 strong, within 6 no preference."""

    def candidate(self, evidence: float, name: str = "a lag") -> Candidate:
        return Candidate(name, "x", True, evidence, (1.0, 0.5))

    def test_words(self) -> None:
        very, strong, as_strong, weak = (str(self.candidate(e)).replace(f"{e}", "") for e in (10.5, 9.5, 6.1, 5.9))
        assert very != strong == as_strong != weak

    def test_very_strong_evidence_is_needed_for_a_suggestion(self) -> None:
        assert Criticism("f", (), (self.candidate(10.5),)).suggested is not None
        assert Criticism("f", (), (self.candidate(9.5),)).suggested is None

    @pytest.mark.parametrize(("behind", "named"), [(5.7, True), (6.3, False)])
    def test_rivals(self, behind: float, named: bool) -> None:
        both = (self.candidate(30.0), self.candidate(30.0 - behind, "a mass"))
        assert str(Criticism("f", (), both)).count("a mass") == (2 if named else 1)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_two_standard_errors_make_doubtful_of_not_physical(side: float) -> None:
    """Outside by 1: doubtful with an error of 0.51, not physical with 0.48."""
    for error, verdict in ((0.51, "doubtful"), (0.48, "not physical")):
        assert RangeCheck("p", 5.0 + 6.0 * side, error, 0.0, 10.0, "", "", "").verdict == verdict


def plausible(free: list[str], changes: dict[str, Any] | None = None, **more: Any) -> td.inference.Plausibility:
    model = box(changes)
    return td.inference.plausibility(td.calibrate(model, log(model, {}, {"T": "case"}), free), **more)


class TestRanges:
    def test_solids_hold_what_metals_to_plastics_hold(self) -> None:
        """The lightest of the table of materials, and 1500 J/(kg K) of plastics; 1 kg of them beside 900 J/(kg K)."""
        found = plausible([MASS], weights={"case": "1 [kg]"})[MASS]
        assert (found.low, found.high) == pytest.approx((Material.table()["copper"].specific_heat / 900.0, 1500.0 / 900.0))

    def test_a_loss_grows_by_five_times_copper_at_most(self) -> None:
        grows = {"loads/heat/temperature_coefficient": {"value": "0.004 [1/K]", "min": -1}, "loads/heat/reference_temperature": "20 [degC]"}
        found = plausible(["heat.temperature_coefficient"], grows)["heat.temperature_coefficient"]
        assert (found.low, found.high) == pytest.approx((-5.1 * 0.0039, 5.1 * 0.0039), rel=0.02)

    def test_bare_metal_on_metal(self) -> None:
        """Incropera, Table 3.1: from 100 W/(m^2 K), dry and hand-tight, to 5e4, machined under pressure; 0.026 W/(m K) is still air."""
        model = pair()
        data = log(
            model, {"stack.contact_conductance": "50 [W/(m^2 K)]"}, {"A": "a.case", "B": "b.case"}, boundary="room", loads={"a.heat": 6.0}
        )
        found = td.inference.plausibility(td.calibrate(model, data, ["stack.contact_conductance"]))["stack.contact_conductance"]
        assert (found.low, found.high) == pytest.approx((100.0, 5e4))
        assert f"A gap of air of {1e3 * 0.026 / found.value:.2g} mm" in str(found)

    def test_still_air_and_its_doubt(self) -> None:
        """Correlations for bodies are good to a factor of 1.5 either way; radiation of 2 to 98 % of a black body is added."""
        from thermid.physics.air import dry_air
        from thermid.physics.plates import body_htc, conduction_floor
        from thermid.physics.radiation import linearised_htc

        fit = td.calibrate(box(), log(box(), {}, {"T": "case"}), [HTC])
        found = td.inference.plausibility(fit)[HTC]
        run = td.simulate(fit.model, fit.experiments[0].bare, times=fit.experiments[0].times)
        case, air = run["case"].kelvin, run["air"].kelvin
        weight = (case - air) ** 2 / np.sum((case - air) ** 2)
        hot, cold = float(weight @ case), float(weight @ air)
        still = float(body_htc(hot, cold, 0.05, dry_air((hot + cold) / 2)))
        black = float(linearised_htc(1.0, hot, cold))
        assert found.high == pytest.approx(1.5 * still + 0.98 * black, rel=1e-6)
        least = max(float(conduction_floor(0.05, dry_air((hot + cold) / 2).conductivity)), still / 1.5)
        assert found.low == pytest.approx(least + 0.02 * black, rel=1e-6)


@pytest.fixture(scope="module")
def plain() -> Calibration:
    model = box({"surfaces/skin/emissivity": 0.5})
    return td.calibrate(model, log(model, {}, {"T": "case"}), [HTC])


class TestWhatAnElementMayBe:
    """A missing element is suggested only with a value that hardware has; ends of the ranges from outside and inside."""

    def judged(self, fit: Calibration, code: str, **values: float) -> bool:
        assert fit.request is not None
        element = next(m for m in missing_elements(fit, fit.request) if code_of(m.name) == f"element.{code}")
        told = {path: SimpleNamespace(value=v, error=0.1 * v) for path, v in values.items()}
        free = [p for p in element.request.free if p not in fit.request.free]
        return element.judge(dict(zip(free, told.values(), strict=True)))[1]  # type: ignore[arg-type]

    @pytest.mark.parametrize(("tau", "possible"), [(0.48, False), (0.52, True), (590.0, True), (610.0, False)])
    def test_sensors_lag_by_half_a_second_to_ten_minutes(self, plain: Calibration, tau: float, possible: bool) -> None:
        assert self.judged(plain, "lag", link=1e-3 * 1350.0 / tau) is possible

    @pytest.mark.parametrize(("share", "possible"), [(0.0195, False), (0.0205, True), (19.5, True), (20.5, False)])
    def test_a_second_mass_is_a_fiftieth_to_twenty_times_the_first(self, plain: Calibration, share: float, possible: bool) -> None:
        assert self.judged(plain, "second-mass", mass=share * 1350.0, link=1.0) is possible

    @pytest.mark.parametrize(("c", "possible"), [(0.19, False), (0.21, True), (5.9, True), (6.1, False)])
    def test_natural_convection(self, plain: Calibration, c: float, possible: bool) -> None:
        assert self.judged(plain, "natural-convection", c=c) is possible

    @pytest.mark.parametrize(("e", "possible"), [(0.0095, False), (0.0105, True), (1.0, True), (1.05, False)])
    def test_emissivities(self, plain: Calibration, e: float, possible: bool) -> None:
        assert self.judged(plain, "radiation", e=e) is possible

    @pytest.mark.parametrize(("growth", "possible"), [(0.0195, True), (0.0205, False)])
    def test_growth_with_temperature(self, plain: Calibration, growth: float, possible: bool) -> None:
        assert self.judged(plain, "growing-power", watts=growth * 4.0) is possible


class TestDiagnosis:
    def test_one_fault_is_the_explanation_from_seven_tenths_of_the_squares(self) -> None:
        for explained, single in ((0.69, False), (0.71, True)):
            s = Suspect("power", "p", 0.1, 0.01, "1", "power +10 %", 0.9, explained, 0.1)
            assert Diagnosis({"power": 0.9, "link": 0.1}, (s,), 1.0).single is single

    def test_other_groups_are_named_from_one_in_a_hundred(self) -> None:
        s = Suspect("power", "p", 0.1, 0.01, "1", "power +10 %", 0.9, 0.9, 0.1)
        assert "otherwise: link 1 %" in str(Diagnosis({"power": 0.9895, "link": 0.0105}, (s,), 1.0))
        assert "otherwise" not in str(Diagnosis({"power": 0.9905, "link": 0.0095}, (s,), 1.0))

    def test_a_link_may_be_half_of_what_its_ends_have(self) -> None:
        """Of the end with less; both boxes have the same."""
        model = pair()
        faults = faults_of(model, {"A": "a.case", "B": "b.case"})[1]
        link = next(f for f in faults if f.group == "link" and {"a.case", "b.case"} <= set(f.name.split()))
        has = sum(float(value_of(row.coefficients[0])) for row in compile_network(model).numbers().conductors if "a.case" in row.ends)
        assert link.size == pytest.approx(0.5 * has)

    def test_a_link_to_a_mass_that_nothing_holds_may_be_a_tenth_of_a_watt_per_kelvin(self) -> None:
        """No conductance is there that it could be a part of; 0.1 W/K are 10 cm^2 of the least bare joint, 100 W/(m^2 K)."""
        stone = {"title": "two", "needs": ["air"], "nodes": {n: {"capacitance": "100 [J/K]"} for n in ("case", "stone")}}
        skin = {"of": "case", "to": "air", "area": "0.05 [m^2]", "effective_htc": "5 [W/(m^2 K)]"}
        faults = faults_of(td.model_from_dict({**stone, "surfaces": {"skin": skin}}), {"A": "case", "B": "stone"})[1]
        size = {f.name: f.size for f in faults if f.group == "link"}
        assert size["missing link stone - air"] == pytest.approx(100.0 * 10e-4)
        assert size["missing link case - stone"] == pytest.approx(0.5 * 0.05 * 5.0)

    @pytest.mark.parametrize("noise", [0.2, None])
    def test_common_shifts_and_loose_sensors_by_least_squares(self, noise: float | None) -> None:
        """Errors that are expected: noise, 0.05 K where none is stated, 0.3 K of each sensor, 0.1 K that wanders over a fifth of the log.
        Faults that are thought possible: 5 K of a shift, and 30 % of the room in a reading, which has one sign and so twice the density.
        """
        model = pair()
        given = td.Scenario("bench", boundaries={"room": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
        run = td.simulate(model, given, times=np.linspace(0.0, 18000.0, 241))
        shift, nodes = {"A": -1.0, "B": -1.3}, {"A": "a.case", "B": "b.case"}
        made = {
            s: td.Channel.from_array(s, run[n].kelvin + shift[s], unit="K", role="node", target=n, noise=noise) for s, n in nodes.items()
        }
        told = td.inference.diagnose(td.compare(model, td.Record.from_arrays("bench", run.times, made), scenario=given))
        found = {s.name: s for s in told.suspects}
        edges = np.linspace(0.0, 18000.0, 25)
        centres = (edges[1:] + edges[:-1]) / 2
        count = np.histogram(run.times, edges)[0]
        near = np.exp(-np.abs(centres[:, None] - centres) / (0.2 * np.ptp(centres)))
        one = np.diag((noise or 0.05) ** 2 / count) + 0.1**2 * near + 0.3**2
        covariance = np.kron(np.eye(2), one)
        d = np.repeat([-1.0, -1.3], 24)
        cool = np.concatenate([run["room"].kelvin[0] - np.interp(centres, run.times, run["a.case"].kelvin), np.zeros(24)])
        evidence = {}
        for name, response, size in (("all sensors", np.ones(48), 5.0), ("A loose", cool, 0.3)):
            weighed = np.linalg.solve(covariance, response)
            square = response @ weighed + 1.0 / size**2
            amount = weighed @ d / square
            assert found[name].amount == pytest.approx(amount, rel=2e-3)
            assert found[name].error == pytest.approx(square**-0.5, rel=2e-3)
            evidence[name] = 0.5 * (weighed @ d) * amount - 0.5 * np.log(size**2 * square) + (np.log(2.0) if name == "A loose" else 0.0)
        # each group is as likely as the next, and each of its faults as the others: two of the reference, four of sensors
        ratio = np.exp(evidence["A loose"] - evidence["all sensors"]) / 2.0
        assert found["A loose"].probability / found["all sensors"].probability == pytest.approx(ratio, rel=0.04)

    def test_a_power_that_has_gone_is_found_by_half_steps_to_what_is_possible(self) -> None:
        """Nine tenths of a power are the most that is tried: from the whole of it, each of three steps goes half of the way back."""
        model, hidden = pair(), pair(first=box({"parameters/power/min": 0, "parameters/power/value": "0 [W]"}))
        given = td.Scenario("bench", boundaries={"room": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
        run = td.simulate(hidden, given, times=np.linspace(0.0, 18000.0, 241))
        nodes = {"A": "a.case", "B": "b.case"}
        made = {
            s: td.Channel.from_array(s, run[n].kelvin, unit="K", role="node", target=n, noise=0.05, accuracy=0.05) for s, n in nodes.items()
        }
        told = td.inference.diagnose(td.compare(model, td.Record.from_arrays("bench", run.times, made), scenario=given))
        found = next(s for s in told.suspects if s.name == "power of a.heat")
        assert found.amount == pytest.approx(-0.9 - 0.1 / 8.0, abs=0.003)


def test_the_heat_balance_closes_within_twice_its_error() -> None:
    from thermid.inference._explain.balance import EnergyBalance

    plain = EnergyBalance("b", {}, {}, {}, {"case": (0.0, 0.1)}, 1.95, 1.0, {}, ())
    assert plain.closes
    assert not replace(plain, total=2.05).closes


def test_sensors_of_one_node_weigh_by_the_squares_of_their_errors() -> None:
    """1 +- 0.1 and 3 +- 0.2 are 1.4, four to one; they lie eight times as far apart as errors allow (Birge's ratio), chi^2 = 80."""
    from thermid.inference._explain.balance import _mean_of_sensors

    mean, error = _mean_of_sensors([1.0, 3.0], [0.1, 0.2])
    assert mean == pytest.approx(1.4)
    assert error == pytest.approx(np.sqrt(80.0 / 125.0))


class TestMistakes:
    @pytest.mark.parametrize(("kind", "one_in"), [("per cent", 20), ("deck's value", 1)])
    def test_how_seldom_a_kind_is(self, kind: str, one_in: float) -> None:
        """A mistake of a log or a bench outweighs none where readings are 20 times as likely with it; a deck's value at once."""
        from thermid.inference._explain.mistakes import Hypothesis, _gain

        mistake = Hypothesis(kind, "x", str, str, None)  # type: ignore[arg-type]
        base, end = SimpleNamespace(cost=100.0), lambda better: SimpleNamespace(cost=100.0 - np.log(better))
        assert _gain(mistake, end(0.95 * one_in), base) < 0.0 < _gain(mistake, end(1.06 * one_in), base)  # type: ignore[arg-type]

    @pytest.mark.parametrize(("factor", "suspected"), [(0.95, False), (1.05, True)])
    def test_a_duty_passes_the_deck_s_power(self, factor: float, suspected: bool) -> None:
        from thermid.inference._explain.mistakes import _per_cents
        from unit.inference.explain.test_mistakes import PAIR, asked

        assert bool(list(_per_cents(asked(factor), compile_network(PAIR)))) is suspected

    @pytest.mark.parametrize(("span", "moves"), [(2.9, False), (3.1, True)])
    def test_a_boundary_whose_clock_may_be_off_moves_by_three_kelvin(
        self, span: float, moves: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from thermid.inference._explain.mistakes import _clocks

        shifted: list[list[str]] = []
        monkeypatch.setattr("thermid.inference._explain.mistakes._shift", lambda request, fit, base, names: [shifted.append(names)])
        times = np.linspace(0.0, 3600.0, 61)
        wall = td.Channel.from_array("WALL", 295.0 + span * times / 3600.0, unit="K", role="boundary", target="room")
        request = SimpleNamespace(records=(td.Record.from_arrays("log", times, {"WALL": wall}),))
        list(_clocks(request, SimpleNamespace(traces=()), None))  # type: ignore[arg-type]
        assert shifted == ([["WALL"]] if moves else [])

    def test_shifts_of_a_search_lie_close_enough(self) -> None:
        """The descent from a shift that is tried reaches a third of it."""
        from thermid.inference._explain.mistakes import CLOCK_SHIFTS

        asked = np.geomspace(0.03, 0.2, 500)
        assert (np.abs(np.array(CLOCK_SHIFTS)[:, None] - asked).min(axis=0) <= 0.15 * asked).all()
        assert min(CLOCK_SHIFTS) <= 0.005


def test_a_rough_fit_sees_stretches_to_half_a_per_cent_in_32_instants_each() -> None:
    """A search runs it hundreds of times. An honest model may miss 1.5 % of a sensor's range; means over stretches miss a third of that."""
    from thermid.inference._explain.rough_fit import RoughFit
    from unit.inference.explain.test_mistakes import PAIR, PATHS

    times = np.linspace(0.0, 18000.0, 1801)
    scenario = td.Scenario("bench", {"room": "22 [degC]"}, start="22 [degC]")
    power = np.where(times % 1234.0 < 617.0, 8.0, 2.0)
    run = td.simulate(PAIR, scenario.with_(loads={"heat": TableSignal(times, power, hold=True)}, duration="5 [h]"), times=times)
    channels = {n: td.Channel.from_array(n, run[n].kelvin, unit="K", role="node", target=n, noise=0.05) for n in ("amp", "psu")}
    channels["P"] = td.Channel.from_array("P", power, quantity="power", role="load", target="heat")
    fit = RoughFit.of_request(Request(PAIR, (td.Record.from_arrays("bench", times, channels),), PATHS, {"*": scenario}))
    assert [mesh.size for mesh, _ in fit.meshes] == [1280]
    for trace, left in zip(fit.traces, fit.at(fit.start()).left, strict=True):
        assert np.abs(left).max() < 0.005 * np.ptp(run[trace.node].kelvin)


def test_a_round_of_a_search_for_structures_refits_four_changes() -> None:
    """Those that promise most: the seconds of a search go into refits."""
    from thermid.inference._explain.structures import search_structure
    from unit.inference.explain.test_structures import BARE, INNER, asked

    rounds = iter([True])
    request = asked(box(BARE | INNER), samples=101)
    found = search_structure(request, changes=lambda seen: list(seen.changes()) if next(rounds, False) else [], rounds=1)
    assert found.scored > 4
    assert [len(s.changes) for s in found.structures] == [0, 1, 1, 1, 1]


def test_a_part_of_unknown_area_is_taken_to_radiate_as_a_black_one_at_room_temperature() -> None:
    """4 sigma T^3 at 24 degC, of a square metre; one that loses as much has an exchange factor of one, by the prior of any law."""
    black = 4.0 * STEFAN_BOLTZMANN * 297.0**3
    place = _Place("case", (), False, 100.0, black, "ROOM", False, 0.0, 10.0, 1.0, "", 0.0)
    (size,) = _radiation(Request(box(), (log(box(), {}, {"T": "case"}),), ()), place).sizes.values()
    assert size.spread == pytest.approx(SIZES["law"].spread, rel=0.05)
