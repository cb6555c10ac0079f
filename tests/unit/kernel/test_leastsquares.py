"""The triangle that the kernel collects holds what all stored temperatures and sensitivities hold."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from thermid import _kernel as k
from unit.kernel.reference import Net
from unit.kernel.test_noisy_input import START, ambient, bench
from unit.kernel.test_thermostat import heated

LOOSE = {"rtol": 1e-6, "atol": 4e-4, "input_atol": 1e-3}
"""With `atol` above what part of `input_atol` a step may err by, so that stored and collected outputs come from the same steps."""
LOSSES = {"linear": k.SQUARE, "soft_l1": k.SOFT_L1, "huber": k.HUBER, "cauchy": k.CAUCHY}


@dataclass
class Compared:
    """Channels against a network: each a sum of nodes, read at some of the times; all arrays in full, and what the kernel collects."""

    net: Net
    times: np.ndarray
    parts: list[dict[int, float]]
    index: list[np.ndarray]
    sigma: np.ndarray
    biased: tuple[int, ...] = ()
    slope: np.ndarray | None = None
    loss: str = "linear"
    knee: float = 1.0
    seed: int = 3
    options: dict[str, Any] = field(default_factory=lambda: dict(LOOSE))
    derivatives: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        self.derivatives = self.derivatives or self.net.derivatives
        self.nodes = [self.net.at(n) for p in self.parts for n in p]
        self.weight = np.array([w for p in self.parts for w in p.values()])
        self.slope = np.zeros((len(self.nodes), self.derivatives[3])) if self.slope is None else self.slope
        self.column = np.full(len(self.parts), -1, np.int32)
        for at, channel in enumerate(self.biased):
            self.column[channel] = at
        self.bias = np.where(self.column >= 0, 0.3, 0.0)
        kept = sorted(set(self.nodes))
        dcoef = self.derivatives if self.derivatives[3] else None
        last = len(self.net.capacity) - 1
        full = self.net.run(self.times, [n if n <= last else last - n for n in kept], dcoef=dcoef, **self.options)
        self.steps = full.steps
        slopes = full.sensitivities if dcoef else np.zeros((self.times.size, len(kept), 0))
        rng = np.random.default_rng(self.seed)
        self.values, self.left, rows = [], [], []
        at = 0
        for c, p in enumerate(self.parts):
            take = [kept.index(self.net.at(n)) for n in p]
            w, dw = self.weight[at : at + len(p)], self.slope[at : at + len(p)]
            at += len(p)
            predicted = (full.traces[:, take] @ w)[self.index[c]]
            derivative = (np.einsum("n,tnp->tp", w, slopes[:, take]) + full.traces[:, take] @ dw)[self.index[c]]
            self.values.append(predicted + self.sigma[c] * rng.standard_t(2, predicted.size) + self.bias[c])
            self.left.append(self.values[c] - (predicted + self.bias[c]))
            own = np.zeros((predicted.size, len(self.biased)))
            if self.column[c] >= 0:
                own[:, self.column[c]] = 1.0
            rows.append(-np.column_stack([derivative, own]) / self.sigma[c])
        self.r, self.jacobian = np.concatenate([e / s for e, s in zip(self.left, self.sigma, strict=True)]), np.concatenate(rows)

    def collected(self, coef: np.ndarray | None = None, **more: Any) -> k.Squares:
        def ints(values: Any) -> np.ndarray:
            return np.array(values, np.int32)

        problem = self.net.problem()
        ends = ints(np.cumsum([0, *map(len, self.parts)])), ints(np.cumsum([0, *map(len, self.index)]))
        flat = np.concatenate(self.index)
        readings = k.Readings(problem, self.times, ints(self.nodes), ends[0], ints(flat), ends[1], np.concatenate(self.values))
        dcoef = self.derivatives if self.derivatives[3] else None
        return k.least_squares(
            *(problem, readings, self.net.values if coef is None else coef, np.array(self.net.start)),
            *(float(self.times[0]), float(self.times[-1])),
            sigma=self.sigma, bias=self.bias, bias_column=self.column, weight=self.weight, slope=self.slope,
            loss=LOSSES[self.loss], knee=self.knee, dcoef=dcoef, **self.options, **more,
        )  # fmt: skip

    def check(self, inert: tuple[int, ...] = (), tolerance: float = 1e-10) -> k.Squares:
        found = self.collected()
        assert found.status == k.OK
        assert found.steps == self.steps
        z = (self.r / self.knee) ** 2
        rho, weight = {
            "linear": (z, np.ones_like(z)),
            "soft_l1": (2 * (np.sqrt(1 + z) - 1), (1 + z) ** -0.5),
            "huber": (np.where(z <= 1, z, 2 * np.sqrt(np.maximum(z, 1)) - 1), np.maximum(z, 1) ** -0.5),
            "cauchy": (np.log1p(z), 1 / (1 + z)),
        }[self.loss]
        j, r = np.sqrt(weight)[:, None] * self.jacobian, np.sqrt(weight) * self.r
        triangle, size = found.triangle, np.linalg.norm(j, axis=0)
        assert tuple(np.flatnonzero(size == 0)) == inert, "every other column is tried"
        size[list(inert)] = 1.0
        assert not np.tril(triangle, -1).any()
        assert triangle.T @ triangle / np.outer(size, size) == pytest.approx(j.T @ j / np.outer(size, size), abs=tolerance)
        assert triangle.T @ found.rotated / size == pytest.approx(j.T @ r / size, abs=tolerance * np.linalg.norm(r))
        assert found.cost == pytest.approx(self.knee**2 * rho.sum(), rel=tolerance)
        assert found.chi_square == pytest.approx(r @ r, rel=tolerance)
        for e, (count, first, last, total, squares, lagged, largest) in zip(self.left, found.sums, strict=True):
            more = e - e[0]
            assert (count, first, last, largest) == pytest.approx((e.size, e[0], e[-1], e[np.abs(e).argmax()]), rel=1e-9, abs=1e-11)
            assert (total, squares, lagged) == pytest.approx((more.sum(), more @ more, more[1:] @ more[:-1]), rel=1e-9)
        return found


def noisy(every: int = 5, nonlinear: bool = True, hours: int = 5400) -> tuple[Net, np.ndarray]:
    return bench(nonlinear, ambient()), np.arange(0.0, hours + 1, every)


def of_nodes(nodes: range | list[int], times: np.ndarray) -> dict[str, Any]:
    return {
        "parts": [{n: 1.0} for n in nodes],
        "index": [np.arange(times.size) for _ in nodes],
        "sigma": 0.03 + 0.01 * np.arange(len(nodes)),
    }


@pytest.mark.parametrize("every", [1, 60, 600])
@pytest.mark.parametrize("loss", LOSSES)
def test_ordinary_nodes(loss: str, every: int) -> None:
    net, times = noisy(every)
    Compared(net, times, **of_nodes(range(12), times), loss=loss, knee=1.3).check()


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_channels_lack_samples_and_have_constant_errors(loss: str) -> None:
    net, times = noisy()
    given = of_nodes([0, 1, 6, 6, 9], times)
    rng = np.random.default_rng(1)
    given["index"][1] = np.flatnonzero(rng.random(times.size) < 0.6)
    given["index"][2] = given["index"][1]
    given["index"][3] = np.flatnonzero(times > 2000.0)
    given["index"][4] = np.array([7])
    Compared(net, times, **given, biased=(2, 0, 4), loss=loss).check()


@pytest.mark.parametrize("loss", ["linear", "cauchy"])
def test_a_massless_node_and_a_boundary(loss: str) -> None:
    net, times = noisy(20)
    Compared(net, times, **of_nodes([12, 3], times), biased=(0,), loss=loss).check()


def test_sums_of_nodes_with_weights_that_depend_on_parameters() -> None:
    net, times = noisy(20)
    given = of_nodes([0, 1, 2], times)
    given["parts"][1] = {0: 0.3, 1: 0.5, -1: 0.2}
    slope = np.random.default_rng(2).standard_normal((5, net.parameters)) * 1e-3
    slope[[0, 4]] = 0.0
    Compared(net, times, **given, slope=slope, biased=(1,)).check()


def test_a_node_that_follows_at_once_in_some_steps() -> None:
    net, times = noisy(20)
    light = net.node(0.002, START)
    net.link(k.LINEAR, light, 0, net.coef(3.0, p20=3.0))
    net.link(k.LINEAR, light, -1, net.coef(1.0))
    found = Compared(net, times, **of_nodes([0, light, 5], times), biased=(1,)).check()
    assert found.steps < 5400 / 5, "some steps are longer than 10 000 times its time constant of 0.5 ms"


@pytest.mark.parametrize("massless_sensor", [False, True])
def test_thermostats(massless_sensor: bool) -> None:
    net = heated(massless_sensor)
    times = np.linspace(0.0, 1000.0, 501)
    inert = () if massless_sensor else (2,)  # never off for so long that it switches on again
    Compared(net, times, **of_nodes(range(len(net.capacity)), times), biased=(0,)).check(inert)


def test_no_parameters() -> None:
    net, times = noisy(20)
    none = (np.zeros(len(net.coefs) + 1, np.int32), np.zeros(0, np.int32), np.zeros(0), 0)
    bare = Compared(net, times, **of_nodes(range(12), times), derivatives=none).collected()
    assert bare.triangle.shape == (0, 0)
    Compared(net, times, **of_nodes(range(12), times), derivatives=none, biased=(3, 4)).check()


def test_a_pair_that_acts_as_a_product_shows_as_one_direction() -> None:
    """J'J would leave 1e-8 of the largest singular value; the triangle leaves rounding."""
    net, times = noisy(20)
    for c, (value, u, d) in enumerate(net.coefs):
        if 3 in d:  # a coefficient that is the product of two parameters
            net.coefs[c] = (value, u, {3: 2.0 * d[3], net.parameters: 0.7 * d[3]})
    net.parameters += 1
    found = Compared(net, times, **of_nodes(range(12), times)).check()
    scaled = found.triangle / np.linalg.norm(found.triangle, axis=0)
    s = np.linalg.svd(scaled, compute_uv=False)
    assert s[-1] < 1e-13 * s[0]
    assert s[-2] > 1e-6 * s[0]
    squared = np.linalg.svd(scaled.T @ scaled, compute_uv=False)
    assert np.sqrt(squared[-1]) > 1e-10


def test_on_the_steps_of_another_run_the_cost_is_smooth() -> None:
    """Its slope over a change that a stray step would swamp is the one that the triangle tells."""
    net, times = noisy(20)
    case = Compared(net, times, **of_nodes(range(12), times))
    found = case.collected()
    assert found.mesh.size == found.steps
    assert found.mesh[-1] == times[-1]
    again = case.collected(mesh=found.mesh)
    assert (again.steps, again.rejected) == (found.steps, 0)
    np.testing.assert_array_equal(again.mesh, found.mesh)
    assert again.triangle == pytest.approx(found.triangle, rel=1e-6, abs=1e-6 * np.abs(found.triangle).max())
    direction = np.random.default_rng(4).uniform(-1, 1, net.parameters)
    costs = [case.collected(net.shifted(side * 1e-5 * direction), mesh=found.mesh).cost for side in (-1, 1)]
    told = 2.0 * direction @ again.triangle.T @ again.rotated
    assert (costs[1] - costs[0]) / 2e-5 == pytest.approx(told, rel=2e-3)


def test_a_mesh_that_is_far_too_coarse_is_divided() -> None:
    net, times = noisy(20)
    case = Compared(net, times, **of_nodes(range(12), times))
    found, fine = case.collected(mesh=times[-1:]), case.collected()
    assert 1 < found.steps < fine.steps
    assert found.cost == pytest.approx(fine.cost, rel=0.05)


@pytest.mark.parametrize("massless_sensor", [False, True])
def test_a_mesh_with_switchings(massless_sensor: bool) -> None:
    times = np.linspace(0.0, 1000.0, 501)
    net = heated(massless_sensor)
    case = Compared(net, times, **of_nodes(range(len(net.capacity)), times))
    found = case.collected()
    moved = case.collected(net.shifted(np.array([0.01, 0, 0, 0, 0, 0.1, 0.01])), mesh=found.mesh)
    assert moved.status == k.OK
    assert set(np.setdiff1d(moved.mesh, found.mesh)), "switchings have moved"
    assert case.collected(mesh=found.mesh).cost == pytest.approx(found.cost, rel=1e-6)


def test_shapes_are_checked() -> None:
    net, times = noisy(600)
    case = Compared(net, times, **of_nodes([0], times))
    case.sigma = np.array([0.1, 0.2])
    with pytest.raises(ValueError, match="one for each channel"):
        case.collected()
    case = Compared(net, times, **of_nodes([0], times))
    case.index = [np.array([3, 2, 1])]
    case.values = [np.zeros(3)]
    with pytest.raises(ValueError, match="must increase"):
        case.collected()


def test_a_run_that_fails_says_so() -> None:
    net, times = noisy(600)
    case = Compared(net, times, **of_nodes([0], times))
    case.options["max_steps"] = 2
    assert case.collected().status == k.MAX_STEPS
