"""diffrax: compiled by XLA in double precision; Kvaerno5 by tolerance, the explicit Bosh3 where it is held to the samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version as version_of
from typing import Any

import numpy as np
from contest import Answer, Attempt
from network import DURATION, T0
from numpy.typing import NDArray
from plain import FREE, Task, plain

from . import forced, installed

Array = NDArray[Any]
NAME = "diffrax"


def missing() -> str:
    """Return why it cannot run, or nothing."""
    return installed("diffrax")


def version() -> str:
    """Return its version and that of jax."""
    return f"{version_of('diffrax')} (jax {version_of('jax')})"


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield its settings from cheap to tight."""
    import diffrax

    if not task.sensitivities:
        for tol, solve in _ladder(task, diffrax.Kvaerno5(), [(t, t, np.inf) for t in (1e-6, 1e-7, 1e-8, 1e-9)]):
            yield Attempt("diffrax Kvaerno5", "tolerance", f"rtol = atol = {tol[0]:g}", solve)
    limits = dict(forced(4, 2, 1))
    for (_, _, limit), solve in _ladder(task, diffrax.Bosh3(), [(1e-6, 1e-6, float(limit)) for limit in limits]):
        yield Attempt("diffrax Bosh3", "forced", f"rtol 1e-6, {limits[limit]}", solve)


def fits(task: Task) -> Iterator[tuple[str, str, Callable[[Array], tuple[Array, Array]]]]:
    """Yield name, setting and a function from log-parameters to temperatures and their derivatives."""
    import diffrax

    run = compiled(task, diffrax.Bosh3())

    def evaluate(log: Array) -> tuple[Array, Array]:
        masses, slopes = run(log, 1e-6, 1e-6, 2.0)
        return np.asarray(masses), np.asarray(slopes)

    yield "diffrax Bosh3, forward mode", "step at most 2 s", evaluate


def members(task: Task) -> Iterator[tuple[str, str, int, Callable[[Array], Array]]]:
    """Yield name, setting, how many members, and a function from their log-parameters to temperatures (times, members, 12)."""
    import diffrax
    import jax

    run = march(task, diffrax.Bosh3())
    many = jax.jit(jax.vmap(lambda log: run(log, 1e-6, 1e-6, 2.0), out_axes=1))
    yield "diffrax Bosh3, vmap", "step at most 2 s", 256, lambda logs: np.asarray(many(logs))


Setting = tuple[float, float, float]


def _ladder(task: Task, solver: Any, settings: list[Setting]) -> Iterator[tuple[Setting, Callable[[], Answer]]]:
    """Yield a solve for each (rtol, atol, longest step); all of them share one compilation."""
    import jax.numpy as jnp

    run = compiled(task, solver)
    log = jnp.zeros(FREE)
    for setting in settings:
        if task.sensitivities:
            yield setting, lambda s=setting: Answer(*(np.asarray(part) for part in run(log, *s)))
        else:
            yield setting, lambda s=setting: Answer(np.asarray(run(log, *s)))


def march(task: Task, solver: Any) -> Callable[..., Any]:
    """Return a function of log-parameters, rtol, atol and longest step [s]: temperatures (times, 12), not yet compiled."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    unit, u, times = task.unit, jnp.asarray(task.samples), jnp.asarray(task.outputs)
    base = plain(task.nonlinear)
    links, through = link_matrices(task.nonlinear)

    def rate(t: Any, T: Any, args: Any) -> Any:  # noqa: N803
        conduction, gain, convection = args
        k = jnp.clip(jnp.floor(t).astype(int), 0, u.size - 2)
        a = u[k] + (t - k) * (u[k + 1] - u[k])
        d = T - a
        out = unit.power + gain * a - conduction @ T
        if not unit.exponent:
            return (out - convection * d) / unit.capacity
        out = out - convection * d * (d * d + 1e-4) ** (unit.exponent / 2) - unit.radiation * (T**4 - a**4)
        return out.at[1].add(unit.power[1] * (jnp.exp(unit.growth * (T[1] - T0)) - 1)) / unit.capacity

    def run(log: Any, rtol: Any, atol: Any, longest: Any) -> Any:
        conduction, gain = links(log), through(log)
        args = (conduction, gain, base.convection * jnp.exp(log[:12]))
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            solver,
            0.0,
            DURATION,
            None,
            jnp.full(12, T0),
            args,
            saveat=diffrax.SaveAt(ts=times),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=atol, dtmax=longest),
            max_steps=10_000_000,
            adjoint=diffrax.ForwardMode(),
        )
        return found.ys

    return run


def compiled(task: Task, solver: Any) -> Callable[..., Any]:
    """Return `march` compiled; with the derivatives (times, 12, 20) by forward mode where the task asks for sensitivities."""
    import jax

    run = march(task, solver)
    if task.sensitivities:
        slopes = jax.jacfwd(lambda log, *s: (run(log, *s),) * 2, has_aux=True)
        return jax.jit(lambda *a: slopes(*a)[::-1])
    return jax.jit(run)


def link_matrices(nonlinear: bool) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """Return conduction (12, 12) and conductance through the interface (12,) as jax functions of the log-parameters."""
    import jax.numpy as jnp
    from network import GAP, LINKS, NODES

    fixed = plain(nonlinear, np.concatenate((np.zeros(12), np.full(8, -80.0)))).conduction
    g0 = np.array([g for _, _, g in LINKS])
    stamps = np.zeros((7, 12, 12))
    ends = [("Proc", "Ele"), *((a, b) for a, b, _ in LINKS[2:])]
    for n, (a, b) in enumerate(ends):
        i, j = NODES.index(a), NODES.index(b)
        stamps[n, [i, j, i, j], [i, j, j, i]] = 1, 1, -1, -1

    def through(log: Any) -> Any:
        g = g0[:2] * jnp.exp(log[12:14])
        return jnp.zeros(12).at[:2].set(g * GAP / (g.sum() + GAP))

    def conduction(log: Any) -> Any:
        g = g0 * jnp.exp(log[12:])
        series = g[0] * g[1] / (g[0] + g[1] + GAP)
        return fixed + jnp.tensordot(jnp.concatenate((series[None], g[2:])), stamps, 1) + jnp.diag(through(log))

    return conduction, through
