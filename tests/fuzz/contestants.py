"""Who computes a case, each by one function; to add one, write it and name it in CONTESTANTS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import thermid as td
from fuzz.networks import SIGMA, Case
from thermid import _kernel as k
from thermid.model.tree import Constant, Curve, Sine, TableSignal
from unit.kernel.reference import PROPORTIONAL, THERMOSTAT, Net

STATUS = (
    "OK",
    "MAX_STEPS",
    "STEP_UNDERFLOW",
    "NEWTON_FAILED",
    "NON_FINITE",
    "RUN_AWAY",
    "SINGULAR_NODE",
    "BAD_INPUT",
    "CHATTER",
    "TOO_HOT",
)
TIGHT = {"atol": 1e-9, "rtol": 1e-10, "input_atol": 1e-7}
NOT_ASKED = "not asked"
NAMES = {getattr(k, name): name for name in STATUS}


@dataclass(frozen=True)
class Outcome:
    """What a contestant says.

    Parameters
    ----------
    status : str            OK, a status of the kernel, or 'refused' with words.
    traces : array or None  Temperatures (times, nodes), or (members, times, nodes) of an ensemble, when OK. [K]
    why : str               What was said; of a run that is OK, how it was done.
    slopes : array or None  Sensitivities (times, nodes, values), where they were asked for and the run is OK. [K per unit of the value]
    """

    status: str
    traces: np.ndarray | None = None
    why: str = ""
    slopes: np.ndarray | None = None


def _run(case: Case, **options: Any) -> Outcome:
    try:
        found = case.net.run(case.times, **options)
    except (ValueError, TypeError, OverflowError) as error:
        return Outcome("refused", None, str(error))
    status = NAMES[found.status]
    if status == "OK":
        assert found.filled == len(case.times)
        return Outcome(status, found.traces, slopes=found.sensitivities)
    assert -1 <= found.node < len(case.net.capacity) + len(case.net.boundaries)
    assert np.isfinite(found.time)
    return Outcome(status, None, f"at {found.time:g} s, node {found.node}")


def kernel(case: Case) -> Outcome:
    """The kernel as it is called by default."""
    return _run(case, **case.options)


def tight(case: Case) -> Outcome:
    """The kernel at tight tolerances, which take a few times the steps."""
    return _run(case, **(TIGHT | case.options | {"max_steps": 10 * case.options["max_steps"]}))


def sensitive(case: Case) -> Outcome:
    """The kernel with sensitivities to every second coefficient and initial temperature, which must not change the answer."""
    return _run(case, **(_slopes(case) | case.options))


def _slopes(case: Case) -> dict[str, Any]:
    net = case.net
    number = len(net.values)
    indptr = np.array([(j + 1) // 2 for j in range(number + 1)], np.int32)
    size = int(indptr[-1]) + len(net.start)
    csr = (indptr, np.arange(indptr[-1], dtype=np.int32), np.ones(indptr[-1]), size)
    start = np.zeros((len(net.start), size))
    start[:, int(indptr[-1]) :] = np.eye(len(net.start))
    return {"dcoef": csr, "dT0": start}


def squares(case: Case) -> Outcome:
    """Least squares collected in the run, against those of all sensitivities stored: triangle, right-hand side and cost."""
    net, n = case.net, len(case.net.capacity)
    if {"t0", "t_end"} & set(case.options):
        return Outcome("refused", None, NOT_ASKED)
    options = _slopes(case) | case.options
    size = options["dcoef"][3]
    try:
        problem, count = net.problem(), len(case.times)
        every = np.tile(np.arange(count, dtype=np.int32), n)
        ends = np.arange(n + 1, dtype=np.int32)
        readings = k.Readings(problem, case.times, ends[:-1], ends, every, count * ends, np.full(every.size, 300.0))
        given = {"sigma": np.ones(n), "bias": np.zeros(n), "bias_column": np.full(n, -1, np.int32), "weight": np.ones(n)}
        span = float(case.times[0]), float(case.times[-1])
        found = k.least_squares(
            problem, readings, net.values, np.asarray(net.start, float), *span, **given, slope=np.zeros((n, size)), **options
        )
        stored = net.run(case.times, **options)
    except (ValueError, TypeError, OverflowError) as error:
        return Outcome("refused", None, str(error))
    if found.status != k.OK or stored.status != k.OK:
        return Outcome(NAMES[found.status or stored.status], None, f"at {found.time:g} s, node {found.node}")
    left, slopes = 300.0 - stored.traces, -stored.sensitivities.reshape(-1, size)
    scale = np.linalg.norm(slopes, axis=0)
    sure = np.isfinite(scale) & (scale < SENSIBLE)
    scale += 1e-9 * scale[sure].max(initial=1e-20)  # what is smaller than that beside the others is rounding
    pairs = {
        "J'J": (found.triangle.T @ found.triangle / np.outer(scale, scale), slopes.T @ slopes / np.outer(scale, scale)),
        "J'r": (found.triangle.T @ found.rotated / scale, left.ravel() @ slopes / scale),
        "cost": (np.array([found.cost]), np.array([np.sum(left**2)])),
    }
    for name, (one, other) in pairs.items():
        apart = np.abs(one - other)
        kept = apart if name == "cost" else apart[sure][..., sure] if name == "J'J" else apart[sure]
        if kept.size and not kept.max() <= NEAR * (1.0 + np.abs(other).max()):
            return Outcome("DIFFERS", None, f"{name} by {kept.max():.2g}")
    return Outcome("OK", stored.traces)


NEAR, SENSIBLE = 1e-2, 1e6
"""Collected and stored sums of squares take steps of their own: relative difference allowed [-], for columns of a length below the second
number [K]; what runs away has sensitivities beyond any use, and no digits of theirs are right."""


def public(case: Case) -> Outcome:
    """The public API: a deck from Python, a scenario, `simulate`; it chooses how."""
    return _public(case, "auto")


def modal(case: Case) -> Outcome:
    """The modal solution, which a curved network is refused."""
    return _public(case, "modal")


def large(case: Case) -> Outcome:
    """The integrator of large networks, which chooses its method."""
    return _public(case, "large")


def explicit(case: Case) -> Outcome:
    """RKC2, which a network with massless nodes is refused."""
    return _public(case, "RKC2")


def implicit(case: Case) -> Outcome:
    """TR-BDF2 with conjugate gradients."""
    return _public(case, "TR-BDF2")


def lanes(case: Case) -> Outcome:
    """An ensemble in the widest lanes of this machine, by one thread and by two, which must not differ in a bit."""
    one, two = (_ensemble(case, "auto", threads) for threads in (1, 2))
    same = one.status == two.status and (one.traces is None or np.array_equal(one.traces, two.traces))
    return one if same else Outcome("DIFFERS", None, "with two threads")


def scalar(case: Case) -> Outcome:
    """The same ensemble in the portable lanes, within 1e-5 K of the widest."""
    wide, found = lanes(case), _ensemble(case, "baseline", 1)
    if wide.traces is None or found.traces is None:
        return found
    apart = float(np.abs(wide.traces - found.traces).max())
    return found if apart <= 1e-5 else Outcome("DIFFERS", None, f"{apart:.2g} K from the widest lanes")


MEMBERS = 9
"""Of an ensemble: the case itself among seven that are like it, and once more in a group of its own."""


def _ensemble(case: Case, simd: str, threads: int) -> Outcome:
    net, options = case.net, dict(case.options)
    rng = np.random.default_rng([21, case.seed])
    scaled = {j for j in net.capacity if j >= 0} | {row[3][0] for row in net.conductors} | {row[2][0] for row in net.loads}
    coef = np.repeat(net.values[:, None], MEMBERS, axis=1)
    start = np.repeat(np.asarray(net.start, float)[:, None], MEMBERS, axis=1)
    with np.errstate(over="ignore"):  # of absurd numbers, infinity is meant
        for j in scaled:
            coef[j, 1:-1] *= np.exp(rng.normal(0.0, 0.3, MEMBERS - 2))
    start[:, 1:-1] += rng.normal(0.0, 5.0, (len(net.start), MEMBERS - 2))
    if rng.random() < 0.2 and len(net.values):  # a sick neighbour must not harm the others
        coef[rng.integers(len(net.values)), rng.integers(1, MEMBERS - 1)] = rng.choice([np.nan, np.inf, -1.0, 0.0, 1e30])
    t0, t_end = (float(options.pop(name, t)) for name, t in (("t0", case.times[0]), ("t_end", case.times[-1])))
    nodes = np.arange(len(net.capacity), dtype=np.int32)
    try:
        run = k.Ensemble(net.problem(), coef, start, t0, t_end, case.times, nodes, simd=simd, **options)
        stored = np.concatenate([run.advance(rows, threads) for rows in _parts(len(case.times))], axis=1)
    except (ValueError, TypeError, OverflowError) as error:
        return Outcome("refused", None, str(error))
    traces = np.moveaxis(stored, 3, 1).reshape(-1, *stored.shape[1:3])[[0, MEMBERS - 1]]
    status = [NAMES[run.status[m]] for m in (0, MEMBERS - 1)]
    bad = next((m for m in (0, 1) if status[m] != "OK"), None)
    if bad is not None:
        m = bad * (MEMBERS - 1)
        return Outcome(status[bad], None, f"at {run.time[m]:g} s, node {run.node[m]}")
    return Outcome("OK", traces, "alone" if run.alone[[0, MEMBERS - 1]].all() else "in lanes")


def _parts(count: int) -> list[int]:
    """Outputs come in two parts, as they do where quantiles are taken."""
    return [count] if count < 2 else [count // 2, count - count // 2]


def _public(case: Case, method: str) -> Outcome:
    # a deck has no word for tables of gases, nor for a conductance that follows a signal
    gases = any(row[0] in (k.GAS, k.NATURAL, k.POTENTIAL) or case.net.coefs[row[3][0]][1] >= 0 for row in case.net.conductors)
    if gases or {"t0", "t_end", "breaks"} & set(case.options) or case.times[0] != 0.0:
        return Outcome("refused", None, NOT_ASKED)
    try:
        options = td.Options(method=method, **{name: case.options[name] for name in ("max_step", "max_steps") if name in case.options})
        found = td.simulate(td.model_from_dict(deck(case.net)), scenario(case), times=case.times, options=options)
        how = str(found.statistics["method"]) if method == "large" else ""
        return Outcome("OK", np.column_stack([found[f"n{i}"].kelvin for i in range(len(case.net.capacity))]), how)
    except (td.ThermidError, ValueError, TypeError, OverflowError) as error:
        return Outcome("refused", None, str(error))


CONTESTANTS: dict[str, Callable[[Case], Outcome]] = {
    f.__name__: f for f in (kernel, tight, sensitive, squares, public, modal, large, explicit, implicit, lanes, scalar)
}


def scenario(case: Case) -> td.Scenario:
    """Return the scenario of a case."""
    net = case.net
    start = {f"n{i}": td.quantity(value, unit="K") for i, value in enumerate(net.start)}
    boundaries = {f"e{j}": _signal(net, *pair) for j, pair in enumerate(net.boundaries)}
    driven = {
        f"q{r}": _signal(net, row[2][0], -1) for r, row in enumerate(net.loads) if row[0] == k.SIGNAL and net.coefs[row[2][0]][1] >= 0
    }
    return td.Scenario("fuzz", boundaries=boundaries, loads=driven, start="300 [K]", initial=start, duration=float(case.times[-1]))


def _signal(net: Net, gain: int, offset: int) -> Any:
    constant = net.coefs[offset][0] if offset >= 0 else 0.0
    if gain < 0:
        return Constant(constant)
    factor, u, _ = net.coefs[gain]
    kind, a, b = net.inputs[u]
    if kind == k.SINE:
        return Sine(factor * a[0] + constant, factor * a[1], a[2], a[3])
    with np.errstate(over="ignore"):  # an absurd number times another
        return TableSignal(a, factor * b + constant, kind == k.SAMPLED_HOLD, before="hold", after="hold")


def deck(net: Net) -> dict[str, Any]:
    """Return the deck of a network."""

    def name(i: int) -> str:
        return f"n{i}" if i >= 0 else f"e{-i - 1}"

    def value(j: int, unit: str) -> str:
        return f"{net.coefs[j][0]!r} [{unit}]"

    nodes: dict[str, Any] = {name(i): {} if j < 0 else {"capacitance": value(j, "J/K")} for i, j in enumerate(net.capacity)}
    links: dict[str, Any] = {}
    for r, (kind, a, b, c, table) in enumerate(net.conductors):
        links[f"c{r}"] = {"between": [name(a), name(b)], **_law(net, kind, c, table, value)}
    loads: dict[str, Any] = {}
    for r, (kind, node, c, sensor, table) in enumerate(net.loads):
        loads[f"q{r}"] = {"into": name(node), **_load(net, kind, c, name(sensor), table, value)}
    needs = [f"e{j}" for j in range(len(net.boundaries))]
    return {"title": "fuzz", "needs": needs, "nodes": nodes, "conductors": links, "loads": loads}


def _curve(net: Net, over: str, table: int) -> Curve:
    return Curve(over, *net.tables[table])


def _law(net: Net, kind: int, c: list[int], table: int, value: Callable[[int, str], str]) -> dict[str, Any]:
    number = net.coefs[c[0]][0]
    if kind == k.POWER:
        htc = {"coefficient": value(c[0], "W/(m^2 K)"), "exponent": net.coefs[c[1]][0]}
        return {"kind": "convection", "htc": htc, "area": "1 [m^2]"}
    if kind == k.RADIATION:
        return {"kind": "radiation", "exchange_factor": number / SIGMA, "area": "1 [m^2]"}
    if kind == k.FLOW:
        return {"kind": "flow", "mass_flow": value(c[0], "kg/s"), "specific_heat": "1 [J/(kg K)]"}
    if kind in (k.TABLE_MEAN, k.TABLE_DIFF):
        return {"kind": "table", "scale": number, "table": _curve(net, "temperature" if kind == k.TABLE_MEAN else "difference", table)}
    return {"kind": "conduction", "conductance": value(c[0], "W/K")}


def _load(net: Net, kind: int, c: list[int], sensor: str, table: int, value: Callable[[int, str], str]) -> dict[str, Any]:
    if kind == k.TABLE:
        return {"table": _curve(net, "temperature", table), "scale": net.coefs[c[0]][0]}
    if kind == THERMOSTAT:
        limits = {"on_below": value(c[1], "K"), "off_above": value(c[2], "K")}
        return {"power": value(c[0], "W"), "thermostat": limits | {"sensor": sensor}}
    if kind == PROPORTIONAL:
        return {"power": value(c[2], "W"), "proportional": {"gain": value(c[0], "W/K"), "setpoint": value(c[1], "K"), "sensor": sensor}}
    out = {"power": value(c[0], "W")}
    if kind == k.EXP:
        out |= {"exponential_coefficient": value(c[1], "1/K"), "reference_temperature": value(c[2], "K")}
    if kind == k.POLY:
        out |= {"temperature_coefficient": value(c[1], "1/K"), "quadratic_coefficient": value(c[2], "1/K^2")}
        out |= {"reference_temperature": value(c[3], "K")}
    return out
