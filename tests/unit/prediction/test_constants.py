"""Constants that set the width of a band, each against the figure that it stands for: a tenth more or less is seen here."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import optimize, stats

import thermid as td
from thermid.base.errors import IdentificationError
from thermid.prediction._budget import assumed_values, first_line
from thermid.prediction._predict import Band, _missed_at, predict
from thermid.prediction.advice import doubts_without_gas
from thermid.values.store import LeftOut

TWO = stats.norm.ppf(0.975)


class TestBands:
    def test_two_sided_quantiles_of_the_normal_distribution(self) -> None:
        band = Band("n", np.zeros(1), np.array([300.0]), np.zeros(1), {"fit": np.array([0.04])})
        low, high = band.interval()
        assert (high - low)[0] / 2 == pytest.approx(0.2 * TWO)
        low, high = band.interval(0.5)
        assert (high - low)[0] / 2 == pytest.approx(0.2 * stats.norm.ppf(0.75))
        assert band.half_width[0] == pytest.approx(0.2 * TWO)

    def test_quantiles_of_members(self) -> None:
        members = 300.0 + np.linspace(0.0, 1.0, 2001)[None, :]
        band = Band("n", np.zeros(1), np.array([300.0]), np.zeros(1), {}, members)
        assert np.ravel(band.interval()) == pytest.approx(np.array([26.875, 27.825]))
        assert np.ravel(band.interval(0.5)) == pytest.approx(np.array([27.1, 27.6]))
        assert band.half_width[0] == pytest.approx(0.475)


def plate(**surface: Any) -> td.Model:
    """A plate whose end is a temperature that one number decides."""
    return td.model_from_dict(
        {
            "title": "plate",
            "needs": ["air"],
            "nodes": {"plate": {"capacitance": "100 [J/K]"}},
            "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.05 [m^2]", **surface}},
            "loads": {"heat": {"into": "plate", "power": "2.5 [W]"}},
        }
    )


BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="1 [h]")


class TestBeforeAFit:
    """What is assumed of a value that nothing was fitted to."""

    def test_of_an_assumed_value(self) -> None:
        """By the range of its deck, or a tenth of itself where it has none: the deviation that is taken for engineering guesses."""
        ranged = plate(htc={"value": "5 [W/(m^2 K)]", "min": 2, "max": 9, "source": "assumed"})
        (found,) = assumed_values(ranged, BENCH, ())
        assert found.size == pytest.approx(7.0 / math.sqrt(12.0))
        (found,) = assumed_values(plate(htc={"value": "5 [W/(m^2 K)]", "source": "assumed"}), BENCH, ())
        assert found.size == pytest.approx(0.1 * 5.0)

    def test_what_is_left_out_is_named_from_a_tenth_of_the_band_on(self) -> None:
        for share, named in ((0.097, False), (0.103, True)):
            assert bool(first_line([LeftOut("x", share * TWO)], 1.0)) is named


class TestWithoutGas:
    def test_gas_carries_half_of_a_joint_and_nobody_knows_which(self) -> None:
        """A factor of two either way in the conductance of a joint; an emissivity of a deck is good to the 15 % of its own decision."""
        model = td.model_from_dict(
            {
                "title": "joint",
                "needs": ["base"],
                "nodes": {"block": {"capacitance": "60 [J/K]"}},
                "conductors": {
                    "joint": {
                        "kind": "contact",
                        "between": ["block", "base"],
                        "area": "4 [cm^2]",
                        "contact_conductance": "300 [W/(m^2 K)]",
                    },
                    "shine": {"kind": "radiation", "between": ["block", "base"], "area": "4 [cm^2]", "emissivity": 0.3},
                },
            }
        )
        thin = td.Scenario("thin", boundaries={"base": "20 [degC]"}, duration="1 [h]").vacuum()
        doubts = doubts_without_gas(model, thin)
        assert math.exp(doubts["joint.contact_conductance"]) == pytest.approx(2.0, rel=0.04)
        assert doubts["shine.emissivity"] == pytest.approx(0.15)

    @pytest.mark.parametrize(("pascal", "thin"), [(9.6e3, True), (1.04e4, False)])
    def test_from_a_tenth_of_the_air_on_gas_does_what_it_did(self, pascal: float, thin: bool) -> None:
        model = plate(htc="5 [W/(m^2 K)]", emissivity=0.5)
        scenario = BENCH.with_(environment={"*": td.simulation.Environment(pressure=f"{pascal} [Pa]")})
        assert bool(doubts_without_gas(model, scenario)) is thin


class TestSplit:
    """A coefficient apart: the emissivity by its finish, the correlation for convection at 25 %, gas at rest as the least."""

    AIR = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")

    def part(self, effective: float, prior: tuple[float, float]) -> td.inference.Split:
        model = plate(effective_htc=f"{effective!r} [W/(m^2 K)]", emissivity={"value": prior[0], "min": 0.0, "max": 1.0})
        return td.inference.split(model, conditions=self.AIR, priors={"skin.emissivity": prior})

    def found(self, prior: tuple[float, float], law: Callable[[float, float, float], float]) -> td.inference.Split:
        """The split of the coefficient that a law of (black radiation, correlation, floor) names: these change with it, so by iteration."""
        effective = 8.0
        for _ in range(12):
            effective = law(*self._plain(effective))
        return self.part(effective, prior)

    def _plain(self, effective: float) -> tuple[float, float, float]:
        s = self.part(effective, (0.01, 0.0))["skin"]
        return s.radiative / s.emissivity, s.expected, s.floor

    def test_a_correlation_is_good_to_a_quarter(self) -> None:
        """The likeliest emissivity and the curvature there, by a search over the same two statements."""
        prior = (0.5, 0.2)
        sd = prior[1] / prior[0]
        out = self.found(prior, lambda black, expected, floor: 0.4 * black + 1.05 * expected)["skin"]
        black = out.radiative / out.emissivity
        doubt = 0.25 * out.expected

        def cost(x: float) -> float:
            return ((x - math.log(0.5)) / sd) ** 2 + ((out.effective - black * math.exp(x) - out.expected) / doubt) ** 2

        x = float(optimize.minimize_scalar(cost, (-2.0, 0.0)).x)
        assert out.used
        assert out.emissivity == pytest.approx(math.exp(x), rel=0.01)
        error = (1.0 / sd**2 + (black * math.exp(x) / doubt) ** 2) ** -0.5
        assert out.emissivity_error / out.emissivity == pytest.approx(error, rel=0.03)

    @pytest.mark.parametrize(("deviations", "used"), [(1.93, True), (2.07, False)])
    def test_it_has_no_say_where_it_lies_two_deviations_off(self, deviations: float, used: bool) -> None:
        prior = (0.3, 0.03)

        def law(black: float, expected: float, floor: float) -> float:
            return 0.3 * black + expected + deviations * math.hypot(0.03 * black, 0.25 * expected)

        assert self.found(prior, law)["skin"].used is used

    @pytest.mark.parametrize(("chance", "possible"), [(0.0262, True), (0.0238, False)])
    def test_a_finish_leaves_room_in_one_case_of_forty(self, chance: float, possible: bool) -> None:
        prior = (0.5, 0.15)

        def law(black: float, expected: float, floor: float) -> float:
            return black * 0.5 * math.exp(0.3 * float(stats.norm.ppf(chance))) + floor

        if possible:
            self.found(prior, law)
        else:
            with pytest.raises(IdentificationError, match="the coefficient of 'skin' cannot be"):
                self.found(prior, law)

    def test_surfaces_of_one_finish_are_half_alike(self) -> None:
        """Where wind keeps the correlation out, the prior stays: one standard deviation each, half of the variance in common."""
        skin = {"of": "plate", "to": "air", "area": "0.05 [m^2]", "effective_htc": "40 [W/(m^2 K)]", "finish": "aluminium, machined"}
        model = td.model_from_dict(
            {
                "title": "plate",
                "needs": ["air"],
                "nodes": {"plate": {"capacitance": "100 [J/K]"}},
                "surfaces": {"skin": skin, "back": skin},
                "loads": {"heat": {"into": "plate", "power": "20 [W]"}},
            }
        )
        found = td.inference.split(model, conditions=self.AIR)
        covariance = found.values.covariance
        assert not found["skin"].used
        assert covariance[0, 1] / covariance[0, 0] == pytest.approx(0.5)


def case() -> td.Calibration:
    model = plate(htc={"value": "5 [W/(m^2 K)]", "min": 1, "max": 30}, carried_by="free air")
    run = td.simulate(model, BENCH)
    data = td.Record.from_arrays(
        "log", run.times, {"T": td.Channel.from_array("T", run["plate"].kelvin, unit="K", role="node", target="plate", noise=0.05)}
    )
    return td.calibrate(model, data, ["skin.htc"], scenario=BENCH)


@pytest.mark.parametrize(("sd", "drawn"), [(0.02, False), (0.6, True)])
def test_two_thousand_members_where_derivatives_miss_the_band(sd: float, drawn: bool) -> None:
    fit = case()
    told = predict(fit, BENCH, spread={"skin.area": {"log_sd": sd}})
    assert any("2000" in w for w in told.warnings) is drawn


class TestWhereDerivativesDo:
    """Decision 124: a band by derivatives may miss that of members by a tenth of its half-width, in its mean and in its width."""

    SCORES = stats.norm.ppf((np.arange(1000) + 0.5) / 1000)
    ENDS = np.array([-TWO, TWO])

    @pytest.mark.parametrize(("share", "said"), [(0.097, False), (0.103, True)])
    def test_a_tenth_of_the_half_width(self, share: float, said: bool) -> None:
        mean = _missed_at("n", TWO, self.ENDS, self.SCORES, np.full(1000, share * TWO))
        width = _missed_at("n", TWO, self.ENDS, self.SCORES, share * self.SCORES)
        laws = _missed_at("n", TWO, (1.0 + share) * self.ENDS, self.SCORES, np.zeros(1000))
        assert [mean.words.endswith(" K"), width.bent, bool(laws.words)] == [said] * 3
        assert not width.words.endswith(" K")
        assert not laws.bent
