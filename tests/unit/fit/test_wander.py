"""Residuals that wander: found where they do, and the errors that follow are those that repeats show."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.linear_algebra import one_thread
from thermid.fit._calibrate import calibrate, fit
from thermid.fit._calibration import Calibration
from thermid.fit._estimation.filtering import whiteness
from thermid.fit._minimisation import Fit, covariances
from thermid.fit._problem.experiment import ERROR_OF_SEEN_NOISE
from thermid.fit._problem.request import Request, known_before
from thermid.fit._problem.residuals import Sums, Unknown
from thermid.fit._uncertainty.noise import Binned, _beside, _Calm, _leaning, _parts, _trace_noise, binned_trace, correlation
from thermid.measure.records import Channel, Record
from thermid.model.tree import load_model
from thermid.simulation.runs import Scenario, simulate
from unit.fit.bench import HTC, MASS, box, log, room

pytestmark = pytest.mark.usefixtures("errors_in_turn")

NOISE, SLOW, TIME = 0.05, 0.15, 900.0
TRUTH = {HTC: 5.0, MASS: 1.7}


def wandering(seed: int, slow: float = SLOW, samples: int = 301, gap: bool = False) -> Record:
    """A log whose sensor errs by white noise and by a slow part with correlations exp(-dt / TIME)."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 18000.0, samples)
    if gap:
        times = times[(times < 6000.0) | (times > 10000.0)]
    hidden = box().with_values({HTC: "5 [W/(m^2 K)]", MASS: "1.7 [kg]"})
    given = Scenario("bench", boundaries={"air": (times, td.quantity(room(times), unit="K"))}, start="24 [degC]", duration=float(times[-1]))
    truth = simulate(hidden, given, times=times)["case"].kelvin
    root = np.linalg.cholesky(np.exp(-np.abs(times[:, None] - times) / TIME) + 1e-12 * np.eye(times.size))
    readings = truth + NOISE * rng.standard_normal(times.size) + slow * root @ rng.standard_normal(times.size)
    case = Channel.from_array("T", readings, unit="K", role="node", target="case", noise=NOISE)
    return Record.from_arrays(
        f"r{seed}", times, {"T": case, "ROOM": Channel.from_array("ROOM", room(times), unit="K", role="boundary", target="air")}
    )


def scores(draws: int = 24, **more: object) -> np.ndarray:
    """Deviations from the truth in errors by noise (draws, parameters): the structure is right, which its readings cannot tell."""
    out = []
    for seed in range(draws):
        found = calibrate(box(), wandering(seed, **more), [HTC, MASS])  # type: ignore[arg-type]
        out.append([np.log(found[p].value / v) * found[p].value / found[p].error_random for p, v in TRUTH.items()])
    return np.array(out)


def widening(found: Calibration) -> np.ndarray:
    """Errors beside those that residuals of this size would give if they did not wander (unknowns,)."""
    assert found.problem is not None
    assert found.autocorrelation is not None
    plain = covariances(Fit.ended(found.problem, np.array(list(found.fitted.values())), found.loss), found.autocorrelation.variance_factor)[
        2
    ]
    kept = [k for k, n in enumerate(found.fitted) if n in found.values]
    return np.asarray(np.sqrt(np.diag(found.values.covariance) / np.diag(plain)[kept]))


@pytest.mark.parametrize(
    ("gap", "draws"), [(True, 8), pytest.param(False, 24, marks=pytest.mark.campaign), pytest.param(True, 24, marks=pytest.mark.campaign)]
)
def test_errors_are_the_scatter_of_repeats_where_residuals_wander(gap: bool, draws: int) -> None:
    squares = np.mean(scores(draws, gap=gap) ** 2, axis=0)
    # 24 draws of a chi-square: 1 +- 0.29; the width of the wandering is itself estimated from each log
    assert np.all(squares < 1.8), squares
    assert np.all(squares > 0.4), squares


def test_as_they_were_the_errors_would_be_three_times_too_small() -> None:
    found = fit(Request(box(), (wandering(1),), (HTC, MASS)))
    ratio = widening(found)
    assert np.all(ratio > 2.5)
    told = found.sensors["T"]
    assert told.samples == 301
    # 18000 s hold n_eff = n / (1 + 2 sum rho) of the mean: about 10 of the slow part
    assert 3 < told.effective_samples < 40
    assert any(re.search(rf" {told.effective_samples:.2g}\d* of 301,", w) for w in found.warnings)
    assert "(lag-1 0.82)" in str(found)


def test_slow_directions_widen_more_than_fast_ones() -> None:
    """A coefficient is read from the level of hours; the start from the first minutes."""
    found = calibrate(box(), wandering(2, slow=0.05, samples=1801), [HTC, MASS])
    plain = calibrate(box(), wandering(2, slow=0.0, samples=1801), [HTC, MASS])
    assert widening(found).max() > 2.0
    start = (found.local[0].error / plain.local[0].error, found[HTC].error / plain[HTC].error)
    assert start[0] != pytest.approx(start[1], rel=0.05)


def test_white_residuals_change_nothing() -> None:
    same = 0
    for seed in range(10):
        found = calibrate(box(), log(box(), {}, {"T": "case"}, seed=seed), [HTC, MASS])
        same += widening(found) == pytest.approx(1.0) and found.sensors["T"].effective_samples == 301
    assert same >= 8  # one white trace in thirty is taken for one that wanders


def test_readings_that_were_filtered_count_as_fewer() -> None:
    data = log(box(), {}, {"T": "case"}, noise=0.05, samples=3001, seed=5)
    plain = calibrate(box(), data, [HTC])
    smooth = np.convolve(np.pad(data["T"].values, 10, mode="edge"), np.ones(21) / 21, mode="valid")
    filtered = data.with_channels(replace(data["T"], values=smooth, noise=0.05 / np.sqrt(21)))
    found = calibrate(box(), filtered, [HTC])
    assert found[HTC].error_random == pytest.approx(plain[HTC].error, rel=0.35)
    assert found.sensors["T"].effective_samples == pytest.approx(3001 / 21, rel=0.6)


def test_a_short_record_says_nothing_about_wandering() -> None:
    found = calibrate(box(), wandering(3, samples=9), [HTC])
    assert found.sensors["T"].effective_samples == 9


@pytest.fixture(scope="module")
def biased(errors_in_turn: str) -> Calibration:
    data = wandering(4)
    return fit(Request(box(), (data.with_channels(replace(data["T"], accuracy=0.5)),), (HTC, MASS), name="below"))


def test_the_prior_of_the_stage_above_is_the_whole_error_of_the_stage_below(biased: Calibration) -> None:
    above = Request(box(), (wandering(5),), store=biased.store, prior=(HTC, MASS))
    unknowns = [Unknown(p, v.kind, (), v.value, v.log) for p, v in biased.values.items()]
    before = known_before(above, unknowns)
    assert before.at.tolist() == [0, 1, 2]
    assert before.root.T @ before.root == pytest.approx(np.linalg.inv(biased.values.covariance), rel=1e-6)
    assert before.mean.tolist() == [u.to_fitted(v.value) for u, v in zip(unknowns, biased.values.values(), strict=True)]


def test_a_massless_node_and_a_robust_loss_work_too() -> None:
    from recovery.cases import STACK

    model = load_model(STACK)
    times = np.linspace(0.0, 18000.0, 201)
    given = Scenario("s", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration=18000.0)
    run = simulate(model, given, times=times)
    rng = np.random.default_rng(3)
    slow = 0.1 * np.cumsum(rng.standard_normal(201)) / 5.0
    channels = {
        s: Channel.from_array(s, run[n].kelvin + 0.05 * rng.standard_normal(201) + slow, unit="K", role="node", target=n, noise=0.05)
        for s, n in (("T1", "proc.case"), ("MID", "cd"))
    }
    data = Record.from_arrays("bench", times, channels)
    found = fit(Request(model, (data,), ("stack.contact_conductance",), {"*": Scenario("s", boundaries={"cv": "24 [degC]"})}, loss="huber"))
    assert found.sensors["T1"].effective_samples < 60
    assert widening(found).min() > 1.5


def test_the_level_of_white_residuals_counts_what_the_fit_has_taken() -> None:
    """With as few readings as 21 of 3 unknowns, samples in place of freedom would make the variance a seventh too small."""
    found = fit(Request(box(), (wandering(2, slow=0.1, samples=21),), (HTC, MASS)))
    assert found.autocorrelation is not None
    assert not any(t.correlated_variance for t in found.autocorrelation.traces)
    assert found.autocorrelation.variance_factor == pytest.approx(found.chi_square / (21 - len(found.fitted)), rel=1e-6)
    assert found.autocorrelation.variance_factor > 1.5


def test_the_score_of_white_residuals_is_standard_normal_beside_what_a_trace_decides() -> None:
    rng = np.random.default_rng(0)
    times = np.arange(60.0)
    decided, free = _beside(rng.standard_normal((60, 3)) * 10.0)
    assert decided.shape == (60, 3)
    like = correlation(times, 8.0)
    found = []
    for _ in range(300):
        y = free.T @ rng.standard_normal(60)
        found.append(_leaning([like], decided, free @ y, float(y @ y) / free.shape[1])[0])
    assert abs(np.mean(found)) < 4.0 / 300**0.5  # four standard errors
    assert 0.7 < np.std(found) < 1.2  # the variance is estimated from the same residuals, which takes some of the scatter


def test_a_trace_decides_a_direction_by_more_than_half_of_what_is_known() -> None:
    """A singular value of 0.6 is a share of 0.36, one of 0.8 a share of 0.64."""
    slopes = np.zeros((20, 2))
    slopes[0, 0], slopes[1, 1] = 0.6, 0.8
    decided, free = _beside(slopes)
    assert decided.shape == (20, 1)
    assert abs(decided[1, 0]) == pytest.approx(1.0)
    assert free.shape == (20, 19)


def test_stretches_of_a_robust_loss_hold_weighed_residuals() -> None:
    record = wandering(3)
    channel = record.channels["T"]
    struck = np.array(channel.values)
    struck[100] += 3.0
    made = record.with_channels(replace(channel, values=struck))
    found = fit(Request(box(), (made,), (HTC, MASS), loss="cauchy"))
    assert found.problem is not None
    at = np.array(list(found.fitted.values()))
    (block,) = found.problem.blocks(at)
    (piece,) = Binned.of_problem(found.problem, at, "cauchy", 1.0).values()
    z = block.residuals / block.noise
    assert float(piece.mean @ piece.count) == pytest.approx(float(np.sum(z / (1.0 + z**2))))


def bar() -> td.Model:
    return td.model_from_dict(
        {
            "title": "Bar",
            "needs": ["room"],
            "nodes": {"bar": {"capacitance": "600 [J/K]"}},
            "conductors": {
                "skin": {"kind": "conduction", "between": ["bar", "room"], "conductance": {"value": "0.4 [W/K]", "min": 0.01, "max": 5}}
            },
            "loads": {"heat": {"into": "bar", "power": "4 [W]"}},
        }
    )


def drifting(name: str, size: float, seed: int) -> td.Record:
    """Return a log in a room of 20 C whose power drifts slowly by a part of itself, which the deck does not know."""
    rng, times = np.random.default_rng(seed), np.linspace(0.0, 14400.0, 481)
    watts = 4.0 * (1.0 + size * np.sin(2 * np.pi * (times / 9000.0 + rng.uniform())))
    given = td.Scenario(name, boundaries={"room": "20 [degC]"}, start="20 [degC]", duration="4 [h]", loads={"heat": (times, watts)})
    run = td.simulate(bar(), given, times=times)
    noisy = run["bar"].kelvin + 0.05 * rng.standard_normal(times.size)
    return td.Record.from_arrays(
        name, times, {"T": td.Channel.from_array("T", noisy, unit="K", role="node", target="bar", noise=0.05)}, synthetic=True
    )


def test_weights_by_sensor_are_what_they_were() -> None:
    record = drifting("run", 0.1, 1)
    given = td.Scenario("run", boundaries={"room": "20 [degC]"}, start="20 [degC]", loads={"heat": "4 [W]"})
    one, half = (td.calibrate(bar(), record, ["skin.conductance"], scenario=given, weights=w) for w in (None, {"T": 0.5}))
    assert half.chi_square == pytest.approx(0.25 * one.chi_square, rel=1e-3)


@pytest.mark.parametrize(("weights", "code", "match"), [({"T9": 0.5}, "name.unknown", ""), ({"T": 0.0}, "value.outside-range", "")])
def test_weights_that_are_none_are_refused(weights: object, code: str, match: str) -> None:
    given = td.Scenario("run", boundaries={"room": "20 [degC]"}, start="20 [degC]", loads={"heat": "4 [W]"})
    with raises_code(code, td.errors.IdentificationError, match=match):
        td.calibrate(bar(), drifting("run", 0.0, 1), ["skin.conductance"], scenario=given, weights=weights)  # type: ignore[arg-type]


def lagging_box(noise: float | None) -> Record:
    """A log of a box with a mass in it that its deck lacks, read with 0.05 K of noise; what is stated of it differs."""
    times = np.linspace(0.0, 18000.0, 301)
    inner = {"conductance": "0.5 [W/K]", "kind": "conduction", "between": ["inner", "case"]}
    deck = td.model_from_dict(
        {"title": "x", "nodes": {"inner": {"capacitance": "900 [J/K]"}, "case": {"capacitance": "1 [J/K]"}}, "conductors": {"tie": inner}}
    )
    hidden = replace(
        box(), nodes={**box().nodes, "inner": deck.nodes["inner"]}, conductors={**box().conductors, "tie": deck.conductors["tie"]}
    )
    given = Scenario("bench", boundaries={"air": (times, td.quantity(room(times), unit="K"))}, start="24 [degC]", duration=18000.0)
    truth = simulate(hidden, given, times=times)["case"].kelvin
    case = Channel.from_array(
        "T", truth + 0.05 * np.random.default_rng(7).standard_normal(301), unit="K", role="node", target="case", noise=noise
    )
    air = Channel.from_array("ROOM", room(times), unit="K", role="boundary", target="air")
    return Record.from_arrays("bench", times, {"T": case, "ROOM": air})


@pytest.mark.usefixtures("errors_in_full_here")
@pytest.mark.parametrize("noise", [0.05, None, 0.15])
def test_a_structure_that_lacks_a_mass_is_not_credible_or_its_interval_holds(noise: float | None) -> None:
    """Errors and limits that stood on a noise three times too large said 'credible' of a mass that was errors off."""
    found = calibrate(box(), lagging_box(noise), [HTC, MASS])
    mass = found.values[MASS]
    off = abs(np.log(mass.value * 900.0 / (1.7 * 900.0 + 900.0))) * mass.value / mass.error
    assert found.own.state != "credible" or off < 1.96, (found.own.state, off)


def noises_to_state(found: Calibration, sensor: str) -> list[str]:
    """What remarks on the stated noise of a sensor propose instead. [K]"""
    return [m[1] for w in found.warnings if (m := re.search(rf"'{sensor}' .* = \"([\d.]+) \[K\]\"", w))]


@pytest.mark.parametrize(("noise", "said"), [(0.05, False), (0.15, True)])
def test_ninety_readings_do_not_contradict_a_right_noise_by_chance(noise: float, said: bool) -> None:
    """By the factor of 1.5 alone these were said to scatter by .033 K; the noise that 90 readings show is known to a factor of 1.18."""
    times = np.linspace(0.0, 9000.0, 90)
    case = td.model_from_dict(
        {
            "title": "case",
            "needs": ["air"],
            "nodes": {"case": {"capacitance": {"value": "900 [J/K]", "min": 100, "max": 9000}}},
            "conductors": {
                "g": {"kind": "conduction", "between": ["case", "air"], "conductance": {"value": "1 [W/K]", "min": 0.1, "max": 10}}
            },
            "loads": {"q": {"into": "case", "power": "20 [W]"}},
        }
    )
    given = Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=9000.0)
    readings = simulate(case, given, times=times)["case"].kelvin + 0.05 * np.random.default_rng(41).standard_normal(90)
    record = Record.from_arrays("bench", times, {"T": Channel.from_array("T", readings, unit="K", role="node", target="case", noise=noise)})
    found = calibrate(case, record, ["g.conductance", "case.capacitance"], scenario=given)
    assert len(noises_to_state(found, "T")) == said


@pytest.mark.parametrize("samples", [40, 90, 500])
def test_the_noise_that_white_readings_show_scatters_as_its_constant_says(samples: int) -> None:
    rng = np.random.default_rng(3)
    readings = 300.0 + 0.05 * rng.standard_normal((400, samples))
    logs = np.log([Channel.from_array("T", each, unit="K").white_noise for each in readings])
    assert np.std(logs) * samples**0.5 == pytest.approx(ERROR_OF_SEEN_NOISE, rel=0.15)  # four errors of the scatter of 400 draws


@pytest.mark.parametrize(("stated", "said"), [(0.05, False), (0.07, False), (0.15, True), (0.02, True)])
def test_a_stated_noise_far_from_what_the_readings_show_is_remarked_on(stated: float, said: bool) -> None:
    record = log(box(), {HTC: "5 [W/(m^2 K)]", MASS: "1.7 [kg]"}, {"T": "case"}, seed=3)
    channel = replace(record.channels["T"], noise=stated)
    found = calibrate(box(), record.with_channels(channel), [HTC, MASS])
    shown = [float(size) for size in noises_to_state(found, "T")]
    assert shown == ([pytest.approx(0.05, rel=0.2)] if said else [])


def test_two_to_three_of_a_hundred_white_traces_are_called_autocorrelated() -> None:
    """Of 2,000 white traces whose mean was fitted; one of a hundred by neighbours alone, by which innovations of `estimate` are judged."""
    rng, times, alike = np.random.default_rng(20261130), 60.0 * np.arange(40), dict[bytes, list[np.ndarray]]()
    plain, whole = [], []
    with one_thread():
        for _ in range(2000):
            z = rng.standard_normal(times.size)
            trace = binned_trace(z, z, np.arange(z.size), times, np.ones((z.size, 1)), 1.0, None)
            noise = _parts(trace, _Calm.of_trace(trace, np.eye(1) / np.sqrt(z.size)), alike)
            effective = _trace_noise(("r", "T"), trace, *noise).effective_samples
            whole.append(not Sums.of_residuals(z - z.mean()).statistics(0.0, effective).white)
            plain.append(not whiteness("T", z).white)
    assert 0.003 < np.mean(plain) < 0.017
    assert 0.012 < np.mean(whole) < 0.03
