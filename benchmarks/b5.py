"""B5: cold start. New processes from nothing to numpy, to `thermid`, to its help, to a first result; peers likewise; sizes on disk."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import peers
from fresh import as_installed

EXAMPLES = Path(__file__).parents[1] / "examples"
DECK = EXAMPLES / "02_stack" / "m_PrE.toml"
FIRST = f"""
import thermid as td
scenario = td.Scenario("bench", boundaries={{"cv": "24 [degC]"}}, duration=3600.0)
print(td.simulate(td.load_model({str(DECK)!r}), scenario)["cd"].final)
"""
HELP = "import sys; from thermid.app.cli import main; sys.argv = ['thermid', '--help']; main()"
TWO = "[(9.0 - (a - b) * 3.0 - (a - 297.0)) / 900.0, (2.0 + (a - b) * 3.0 - (b - 297.0)) / 700.0]"
PEERS = {
    "scipy": f"""
from scipy.integrate import solve_ivp
def rate(t, T):
    a, b = T
    return {TWO}
print(solve_ivp(rate, (0, 3600), [297.0, 297.0], "LSODA", rtol=1e-6, atol=1e-6).y[0, -1])
""",
    "casadi": f"""
import casadi as ca
x = ca.SX.sym("x", 2); a, b = x[0], x[1]
print(ca.integrator("f", "cvodes", {{"x": x, "ode": ca.vertcat(*{TWO})}}, 0, 3600)(x0=[297.0, 297.0])["xf"][0])
""",
    "diffrax": f"""
import diffrax, jax, jax.numpy as jnp
jax.config.update("jax_enable_x64", True)
def rate(t, T, _):
    a, b = T
    return jnp.array({TWO})
print(diffrax.diffeqsolve(diffrax.ODETerm(rate), diffrax.Kvaerno5(), 0.0, 3600.0, 1.0, jnp.full(2, 297.0),
    stepsize_controller=diffrax.PIDController(rtol=1e-6, atol=1e-6)).ys[-1, 0])
""",
    "pathsim": f"""
import numpy as np
from pathsim import Simulation
from pathsim.blocks import ODE
from pathsim.solvers import ESDIRK43
def rate(T, u, t):
    a, b = T
    return np.array({TWO})
block = ODE(rate, np.full(2, 297.0))
Simulation([block], [], dt=1.0, Solver=ESDIRK43, tolerance_lte_rel=1e-6, log=False).run(3600.0)
print(block.engine.state[0])
""",
}
PACKAGES = {"diffrax": ("diffrax", "jax", "jaxlib", "equinox", "lineax", "optimistix", "ml_dtypes", "scipy")}
RESULT = "first result from a deck"
LIMITS = {"import": 2.0, "--help": 3.0, RESULT: 5.0}
"""Largest ratio to a process that imports numpy."""


def run(options: Namespace) -> list[dict[str, Any]]:
    """Return how long each start takes, best of several in turns, and the size of each package."""
    present, missing = peers.present(options.peers)
    codes = {("numpy", "import"): "import numpy", ("thermid", RESULT): FIRST}
    codes |= {("thermid", "import"): "import thermid", ("thermid", "--help"): HELP}
    codes |= {(name, "first result, two nodes"): PEERS[name] for name in PEERS if name in options.peers and not peers.installed(name)}
    with tempfile.TemporaryDirectory() as cache:
        times = _in_turns(codes, 3 if options.quick else 11, cache)
    base = min(t[0] for t in times["numpy", "import"])
    rows = []
    for (name, setting), taken in times.items():
        wall, cpu = (min(column) for column in zip(*taken, strict=True))
        row: dict[str, Any] = {"name": name, "setting": setting, "seconds": wall, "cpu_seconds": cpu, "runs": len(taken)}
        row |= {"ratio": wall / base, "max_error_K": None}
        if name == "thermid":
            row |= {"target_ratio": LIMITS[setting], "right": wall / base <= LIMITS[setting], "columns": {"most": f"{LIMITS[setting]:g}"}}
        rows.append(row)
    sizes = {name: size for name in ("thermid", "numpy", "pydantic", *PEERS) if (size := installed_size(name)) is not None}
    words = ", ".join(f"{name} {size / 1e6:.1f} MB" for name, size in sizes.items())
    silent = {m.NAME: "its start is that of another program" for m in present if m.NAME == "Octave"}
    section = {"work": "B5, new processes, ratio to `import numpy`", "results": rows, "missing": missing | silent}
    return [section | {"installed_bytes": sizes, "remarks": [f"installed, without what they need: {words}"]}]


def _in_turns(codes: dict[tuple[str, str], str], rounds: int, cache: str) -> dict[tuple[str, str], list[tuple[float, float]]]:
    """Return wall and processor times of every process, compiled files written beforehand where the environment forbids them. [s]"""
    times: dict[tuple[str, str], list[tuple[float, float]]] = {name: [] for name in codes}
    for n in range(rounds + 1):
        for name, code in codes.items():
            before, begun = os.times(), time.perf_counter()
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=as_installed(cache), check=False)
            wall, after = time.perf_counter() - begun, os.times()
            if done.returncode:
                raise RuntimeError(f"{name} ended with {done.returncode}:\n{done.stderr[-2000:]}")
            if n:  # the first writes compiled files
                cpu = after.children_user + after.children_system - before.children_user - before.children_system
                times[name].append((wall, cpu))
    return times


def installed_size(name: str) -> int | None:
    """Return the bytes of a package's files; of thermid also when it is installed from its sources."""
    total = 0
    for package in PACKAGES.get(name, (name,)):
        try:
            files = distribution(package).files or ()
        except PackageNotFoundError:
            return None
        paths = [Path(str(f.locate())) for f in files]
        total += sum(p.stat().st_size for p in paths if p.is_file() and p.suffix != ".pyc")
    if name == "thermid":
        import thermid
        from thermid import _kernel

        root = Path(str(thermid.__file__)).parent
        total = sum(p.stat().st_size for p in root.rglob("*") if p.is_file() and p.suffix != ".pyc")
        extension = Path(str(_kernel.__file__))
        total += 0 if extension.is_relative_to(root) else extension.stat().st_size
    return total
