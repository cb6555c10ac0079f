"""A weak fleet beside NUTS: means and spreads of the population are those of the whole posterior, nothing made linear (numpyro)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.measure.records import Channel, Record

UNITS, WEAK, NOISE, POWER, ROOM = 30, 0.6, 0.3, 5.0, 293.0
FREE = ("skin", "case")
MEANS, SPREADS = {"skin": 0.5, "case": 100.0}, {"skin": 0.15, "case": 0.08}
POSTERIOR: dict[tuple[str, str], tuple[float, float, float]] = {
    ("skin", "mean"): (-0.7890, -0.7087, -0.6365),
    ("skin", "spread"): (0.1159, 0.1604, 0.2393),
    ("case", "mean"): (4.6066, 4.6329, 4.6588),
    ("case", "spread"): (0.0424, 0.0611, 0.0870),
}
"""Value and what of it -> its 2.5, 50 and 97.5 % points: 4 chains of 2,000 draws (numpyro 0.22), flat priors, LKJ(1)."""
CENTRE, WIDTH = 0.25, 1.25
"""How far centres may lie apart, in half an interval, and widths from one another, a factor; stated before NUTS was first run."""


def fleet_logs() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Unit -> times [s] and readings [K] of a mass that a heater warms; six in ten have a log of one minute in place of an hour."""
    rng, out = np.random.default_rng(36), {}
    for k in range(UNITS):
        skin, case = (MEANS[n] * np.exp(SPREADS[n] * rng.standard_normal()) for n in FREE)
        times = np.arange(0.0, 60.1, 2.0) if rng.random() < WEAK else np.arange(0.0, 3600.1, 60.0)
        rise = POWER / skin * (1.0 - np.exp(-skin / case * times))
        out[f"unit {k + 1}"] = times, ROOM + rise + NOISE * rng.standard_normal(times.size)
    return out


def population() -> td.inference.Fleet:
    model = td.model_from_dict(
        {
            "title": "unit",
            "needs": ["air"],
            "parameters": {"skin": "0.6 [W/K]", "case": "80 [J/K]"},
            "nodes": {"body": {"capacitance": "case"}},
            "conductors": {"out": {"kind": "conduction", "between": ["body", "air"], "conductance": "skin"}},
            "loads": {"heat": {"into": "body", "power": f"{POWER} [W]"}},
        }
    )
    records = {}
    for name, (times, readings) in fleet_logs().items():
        channels = {"T": Channel.from_array("T", readings, unit="K", role="node", target="body", noise=NOISE)}
        channels["R"] = Channel.from_array("R", np.full(times.size, ROOM), unit="K", role="boundary", target="air")
        records[name] = Record.from_arrays(name, times, channels)
    start = td.Scenario("from the room", start=f"{ROOM} [K]")
    return td.inference.fleet(model, records, FREE, scenario=start)


def compared(posterior: dict[tuple[str, str], tuple[float, float, float]]) -> dict[tuple[str, str], tuple[float, float]]:
    """Value and what of it -> distance of centres in half an interval, and ratio of widths."""
    found, out = population(), {}
    for name, v in found.values.items():
        for what, ends in (("mean", np.log([v.low, v.mean, v.high])), ("spread", np.array([v.spread_low, v.spread, v.spread_high]))):
            low, _, high = posterior[name, what]
            out[name, what] = abs(ends[0] + ends[2] - low - high) / (high - low), (ends[2] - ends[0]) / (high - low)
    return out


def sampled() -> dict[tuple[str, str], tuple[float, float, float]]:
    """The same points by NUTS."""
    jax = pytest.importorskip("jax")
    numpyro = pytest.importorskip("numpyro")
    import jax.numpy as jnp
    import numpyro.distributions as dist
    from numpyro.infer import MCMC, NUTS

    numpyro.enable_x64()
    logs = [*fleet_logs().values()]
    unit = np.repeat(np.arange(UNITS), [t.size for t, _ in logs])
    times, readings = (np.concatenate(parts) for parts in zip(*logs, strict=True))

    def density() -> Any:
        mean = numpyro.sample("mean", dist.ImproperUniform(dist.constraints.real_vector, (), (2,)))
        spread = numpyro.sample("spread", dist.ImproperUniform(dist.constraints.positive, (), (2,)))
        root = numpyro.sample("root", dist.LKJCholesky(2, 1.0))
        number = numpyro.sample("number", dist.Normal(0.0, 1.0).expand([UNITS, 2]).to_event(2))
        skin, case = jnp.exp(mean + number @ (spread[:, None] * root).T).T
        rise = POWER / skin[unit] * (1.0 - jnp.exp(-(skin / case)[unit] * times))
        numpyro.sample("reading", dist.Normal(ROOM + rise, NOISE), obs=readings)

    begin = {"mean": np.log([0.5, 100.0]), "spread": np.array([0.15, 0.1])}
    way = NUTS(density, init_strategy=numpyro.infer.init_to_value(values=begin))
    chains = MCMC(way, num_warmup=1000, num_samples=2000, num_chains=4, chain_method="sequential", progress_bar=False)
    chains.run(jax.random.PRNGKey(36))
    draws = chains.get_samples()
    return {
        (name, what): tuple(np.quantile(np.asarray(draws[what])[:, k], [0.025, 0.5, 0.975]).tolist())
        for k, name in enumerate(FREE)
        for what in ("mean", "spread")
    }


def close(pairs: dict[tuple[str, str], tuple[float, float]]) -> bool:
    return all(apart < CENTRE and 1.0 / WIDTH < ratio < WIDTH for apart, ratio in pairs.values())


def test_a_weak_fleet_has_the_means_and_spreads_of_nuts() -> None:
    assert close(compared(POSTERIOR))


@pytest.mark.campaign
def test_nuts_says_the_same_again() -> None:
    again = sampled()
    for name, points in POSTERIOR.items():
        half = 0.5 * (points[2] - points[0])
        assert again[name] == pytest.approx(points, abs=0.15 * half)
