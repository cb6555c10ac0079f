"""`estimate`: values with process noise beside those of output error, what it says, and what it refuses."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError
from thermid.fit._estimation.estimation import Estimation
from thermid.fit._estimation.likelihood import Likelihood
from thermid.fit._problem.residuals import Prior, Unknown
from thermid.measure.records import Channel, Record
from thermid.model.tree import model_from_dict
from unit.fit.bench import box, log

from .house import TRUTH, VALUES, Case, Truth, drawn, estimate


def test_values_are_found_within_their_errors(found: Estimation) -> None:
    truth = {**TRUTH.values, "noise of wall": TRUTH.sigma_w, "reading noise of indoor": TRUTH.sigma_v}
    for name, value in truth.items():
        one = found.process.found[name]
        assert abs(one.value - value) < 3.5 * one.error, name
        assert one.error < 0.3 * value, name
    assert all(w.white for w in found.process.white)


def test_output_error_is_told_beside_it(found: Estimation) -> None:
    """Without process noise the readings are not white, and the ratio says that something drives the wall."""
    assert not any(w.white for w in found.output.white)
    assert found.ratio > 100
    assert found.p_value < 1e-9
    assert found.output.found["reading noise of indoor"].value > 3 * TRUTH.sigma_v
    text = str(found)
    assert re.match(rf"house: {found.chosen.name}: .* 12 h ", text)
    for word in ("process noise: open loop", "output error: open loop", "one-step log-likelihood"):
        assert word in text


def test_the_choice_is_what_foresees_left_out_readings(found: Estimation) -> None:
    assert found.process.left_out is not None
    assert found.output.left_out is not None
    better = min((found.process, found.output), key=lambda e: e.left_out.rmse if e.left_out else np.inf)
    assert found.chosen is better
    assert set(found.values) == set(VALUES)
    assert td.simulation.compile_network(found.model).numbers().values["Ro"] == pytest.approx(found.values["Ro"].value)


def test_bands_carry_the_noise(found: Estimation) -> None:
    """What drives the wall makes the band of what is foreseen wide; without it, it is far too narrow."""
    assert found.process.left_out is not None
    assert found.output.left_out is not None
    assert found.process.left_out.inside > 0.85


def test_hidden_wall_is_inside_its_smoothed_band(case: Case, found: Estimation) -> None:
    states = found.states()
    mean, sd = states["wall"]
    assert np.mean(np.abs(mean - case.states[:, 0]) < 1.96 * sd) > 0.85
    later = found.states(smooth=False)["wall"]
    assert sd[:-1].mean() < later[1][:-1].mean()
    assert later[0][-1] == pytest.approx(mean[-1], abs=1e-9)


def test_it_is_json(found: Estimation) -> None:
    there = json.loads(json.dumps(found.as_object()))
    assert there["chosen"] == found.chosen.name
    assert there["estimators"]["process noise"]["values"]["Ro"]["unit"] == "K/W"
    assert there["likelihood_ratio"] == pytest.approx(found.ratio)


def test_noise_that_is_not_there_goes_to_zero() -> None:
    """A log without process noise: its size is said to go to zero, values stay, and the ratio is nothing."""
    quiet = drawn(Truth(TRUTH.values, 1e-9, 0.035), 3, 200)
    done = estimate(quiet)
    assert done.ratio < 4.0
    assert done.p_value > 0.02
    assert done.moved == ()
    for name, value in TRUTH.values.items():
        assert abs(done.process.found[name].value - value) < 4 * done.output.found[name].error


def test_a_value_that_hangs_on_the_noise_is_named(found: Estimation) -> None:
    errors = {n: f.error for n, f in found.process.found.items()}
    for name in VALUES:
        apart = abs(np.log(found.process.found[name].value / found.output.found[name].value)) * found.process.found[name].value
        assert (name in found.moved) == bool(apart > 2.0 * errors[name])
    assert all(f"'{name}'" in str(found) for name in found.moved)


def test_unlogged_ambient_as_a_random_walk() -> None:
    """Three levels down, two instances, the room never logged: the walk follows it, and the mass is right."""
    r = np.random.default_rng(8)
    t = 60.0 * np.arange(240)
    unit = {
        "title": "unit",
        "needs": ["air"],
        "submodels": {"a": {"use": box(), "bind": {"air": "air"}}, "b": {"use": box(), "bind": {"air": "air"}}},
    }
    rig = model_from_dict({"title": "rig", "needs": ["room"], "submodels": {"u": {"use": model_from_dict(unit), "bind": {"air": "room"}}}})
    room = 293.15 + np.cumsum(r.normal(0.0, 0.05, t.size))
    scenario = td.Scenario(
        "rig",
        boundaries={"room": {"times": [f"{s} [s]" for s in t], "values": [f"{v!r} [K]" for v in map(float, room)]}},
        start="20 [degC]",
        duration=float(t[-1]),
    )
    truth = td.simulate(rig.with_values({"u.a.case.mass": "1.2 [kg]", "u.b.case.mass": "1.2 [kg]"}), scenario, times=t)
    channels = {
        n: Channel.from_array(n, truth[f"u.{n}.case"].kelvin + r.normal(0.0, 0.03, t.size), unit="K", column=n, noise=0.03)
        for n in ("a", "b")
    }
    record = Record.from_arrays("rig", t, channels).with_channels(
        *(c.__class__(**{**c.__dict__, "target": f"u.{n}.case", "role": "node"}) for n, c in channels.items())
    )
    done = td.inference.estimate(
        rig, record, ["u.a.case.mass"], process_noise={"room": "free"}, scenario=td.Scenario("rig", boundaries={"room": "20 [degC]"})
    )
    one = done.process.found["u.a.case.mass"]
    assert abs(one.value - 1.2) < 3.5 * one.error
    added, sd = done.states()["added to room"]
    assert np.mean(np.abs(293.15 + added - room) < 2.5 * sd) > 0.9
    assert done.process.found["noise of room"].value == pytest.approx(0.05 / np.sqrt(60.0), rel=0.35)


def small() -> tuple[td.Model, Record]:
    return box(), log(box(), {"skin.effective_htc": "5 [W/(m^2 K)]"}, {"T": "case"}, samples=21)


@pytest.mark.parametrize(
    ("noise", "code", "match"),
    [
        ({}, "fit.nothing-free", ""),
        ({"cass": "free"}, "name.unknown", "'case'"),
        ({"case": {"sigma": "1 [K]"}}, "name.unknown", ""),
        ({"case": {"kind": "pink"}}, "name.unknown", "'pink'"),
        ({"case": {"kind": "wiener", "time": "1 [h]"}}, "value.without-effect", ""),
        ({"case": "1 [W]"}, "unit.wrong-dimension", ""),
        ({"case": "-1e-3 [K/s^0.5]"}, "value.outside-range", ""),
        ({"case": {"size": "1e-3 [K/s^0.5]", "start": "1e-3 [K/s^0.5]"}}, "value.without-effect", ""),
    ],
)
def test_what_is_refused(noise: dict[str, Any], code: str, match: str) -> None:
    model, record = small()
    with raises_code(code, match=match):
        td.inference.estimate(model, record, ["skin.effective_htc"], process_noise=noise)


def test_a_horizon_that_leaves_nothing_to_fit() -> None:
    model, record = small()
    with raises_code("value.outside-range", IdentificationError):
        td.inference.estimate(model, record, ["skin.effective_htc"], process_noise={"case": "free"}, horizon="1000 [h]")


def test_a_start_of_a_boundary_is_no_state() -> None:
    model, record = small()
    with raises_code("name.unknown", IdentificationError):
        td.inference.estimate(model, record, ["skin.effective_htc"], process_noise={"case": "free"}, start_sd={"air": "1 [K]"})


def test_an_instrument_that_stages_below_found_counts_once() -> None:
    """What they found of its error holds its accuracy: the two would be one piece of knowledge, twice."""
    prior = Prior(0.0, 0.5)
    unknowns = (Unknown("plate.mass", "parameter", (), 1.0, prior=prior), Unknown("sensor T", "sensor", (), 0.0, prior=prior))
    coupled = ((np.array([1]), np.array([0.3]), np.array([[4.0]])),)
    likelihood = SimpleNamespace(unknowns=unknowns, problem=SimpleNamespace(coupled=coupled))
    rows, slopes = Likelihood.priors(likelihood, np.array([1.0, 0.2]))  # type: ignore[arg-type]
    assert rows == pytest.approx([2.0, 4.0 * (0.2 - 0.3)])
    assert slopes == pytest.approx(np.array([[2.0, 0.0], [0.0, 4.0]]))
