"""Octave: ode15s (SUNDIALS IDA, analytic Jacobian), lsode where held to the samples; in a process that takes its times itself."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from shutil import which

from contest import Answer, Attempt
from network import T0
from plain import Task

from . import forced

NAME = "Octave"
PROGRAM = """
load(fullfile(folder, "case.mat"));
1;
function a = room(t, u)
  k = min(floor(t), numel(u) - 2);
  a = u(k + 1) + (t - k) * (u(k + 2) - u(k + 1));
end
function f = rate(t, T, p)
  a = room(t, p.u); d = T - a;
  f = p.Q + p.g * a - p.K * T - p.c .* d .* (d .* d + 1e-4) .^ (p.n / 2) - p.s .* (T .^ 4 - a ^ 4);
  f(2) += p.Q(2) * (exp(p.b * (T(2) - p.T0)) - 1);
  f = f ./ p.C;
end
function J = jacobian(t, T, p)
  a = room(t, p.u); d = T - a; e = d .* d + 1e-4;
  own = p.c .* e .^ (p.n / 2) .* (1 + p.n * d .* d ./ e) + 4 * p.s .* T .^ 3;
  own(2) -= p.b * p.Q(2) * exp(p.b * (T(2) - p.T0));
  J = (-p.K - diag(own)) ./ p.C;
end
c = cputime(); w = tic();
if p.longest > 0
  lsode_options("integration method", "non-stiff");
  lsode_options("relative tolerance", p.tol); lsode_options("absolute tolerance", p.tol);
  lsode_options("maximum step size", p.longest); lsode_options("step limit", 1000000);
  T = lsode(@(T, t) rate(t, T, p), p.T0 * ones(12, 1), p.times);
else
  o = odeset("RelTol", p.tol, "AbsTol", p.tol, "Jacobian", @(t, T) jacobian(t, T, p));
  [t, T] = ode15s(@(t, T) rate(t, T, p), p.times, p.T0 * ones(12, 1), o);
end
seconds = [toc(w), cputime() - c];
save("-v7", fullfile(folder, "found.mat"), "T", "seconds");
"""


def missing() -> str:
    """Return why it cannot run, or nothing."""
    if not which("octave-cli"):
        return "not installed"
    has = "printf('%d', __octave_config_info__('build_features').SUNDIALS)"
    said = subprocess.run(["octave-cli", "-q", "--norc", "--eval", has], capture_output=True, text=True, check=False)
    return "" if said.stdout == "1" else "this build has no ode15s"


def version() -> str:
    """Return its version."""
    said = subprocess.run(["octave-cli", "--version"], capture_output=True, text=True, check=True)
    return said.stdout.split("version ")[1].split()[0]


def attempts(task: Task) -> Iterator[Attempt]:
    """Yield its settings from cheap to tight; it has no sensitivities."""
    if task.sensitivities:
        return
    for tol in (1e-6, 1e-7):
        yield Attempt("Octave ode15s", "tolerance", f"RelTol = AbsTol = {tol:g}", _masses(task, tol, 0.0))
    for tol, limits in ((1e-6, (2, 1)), (1e-8, (1,))):  # at 1 s the tolerance is what is left of its error
        for limit, words in forced(*limits):
            yield Attempt("Octave lsode", "forced", f"non-stiff, RelTol {tol:g}, {words}", _masses(task, tol, limit))


def _masses(task: Task, tol: float, longest: float) -> Callable[[], Answer]:
    from scipy.io import loadmat, savemat

    unit = task.unit
    columns = {"C": unit.capacity, "Q": unit.power, "g": unit.through, "c": unit.convection, "s": unit.radiation, "u": task.samples}
    numbers = {"K": unit.conduction, "n": unit.exponent, "b": unit.growth, "T0": T0, "tol": tol, "longest": longest, "times": task.outputs}

    def solve() -> Answer:
        with tempfile.TemporaryDirectory() as folder:
            savemat(Path(folder) / "case.mat", {"p": {k: v[:, None] for k, v in columns.items()} | numbers})
            script = Path(folder) / "script.m"
            script.write_text(f'folder = "{folder}";\n{PROGRAM}', encoding="utf-8")
            subprocess.run(["octave-cli", "-q", "--norc", str(script)], check=True, capture_output=True)
            found = loadmat(Path(folder) / "found.mat")
        wall, cpu = (float(v) for v in found["seconds"].ravel())
        return Answer(found["T"], seconds=(wall, cpu))

    return solve
