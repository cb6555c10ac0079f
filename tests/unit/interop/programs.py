"""Octave and ngspice, where they are installed: a written model goes in, the temperatures that they find come out."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]


def octave(file: Path, times: Array, p: str = "") -> Array:
    """Temperatures (times, nodes) [degC] that a written function returns; `p` are statements that change its values."""
    program = shutil.which("octave-cli") or shutil.which("octave")
    if program is None:
        pytest.skip("Octave is not installed (Debian package octave)")
    np.savetxt(file.parent / "times.txt", times, fmt="%.17g")
    name = file.stem
    code = f"p = {name}('parameters'); {p} [t, T] = {name}(load('times.txt'), p); save('-ascii', '-double', 'found.txt', 'T');"
    done = subprocess.run(
        [program, "--quiet", "--no-init-file", "--no-history", "--eval", code], cwd=file.parent, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return np.loadtxt(file.parent / "found.txt", ndmin=2)


def ngspice(file: Path) -> tuple[Array, dict[str, Array]]:
    """Times [s] and node -> temperatures [degC] at the program's own steps."""
    program = shutil.which("ngspice")
    if program is None:
        pytest.skip("ngspice is not installed (Debian package ngspice)")
    raw = file.with_suffix(".raw")
    done = subprocess.run([program, "-b", "-r", raw.name, file.name], cwd=file.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    head, _, body = raw.read_bytes().partition(b"Binary:\n")
    text = head.decode()
    names = [line.split()[1] for line in text.partition("Variables:\n")[2].splitlines() if line.strip()]
    table = np.frombuffer(body, dtype=np.float64).reshape(-1, len(names))
    fresh = np.append(True, np.diff(table[:, 0]) > 0)
    columns = {name[2:-1]: table[fresh, k] for k, name in enumerate(names) if name.startswith("v(")}
    return table[fresh, 0], columns


STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""As it is written: nothing is optimised away before the sanitizers see it, and gcc takes a third of the time."""
FAST = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2")
"""As a user compiles it; gcc finds more to warn of where it follows values."""


def c99(header: Path, times: Array, p: str = "", options: tuple[str, ...] = STRICT, step: str = "") -> Array:
    """Temperatures (times, nodes) [K] that a written header computes for its scenario; `p` are statements that change its values."""
    program = shutil.which("gcc") or shutil.which("cc")
    if program is None:
        pytest.skip("there is no C compiler (Debian package gcc)")
    name = header.stem
    listed = ", ".join(repr(float(t)) for t in times)
    main = f"""
#include <stdio.h>
#include "{header.name}"
int main(void) {{
    static {name}_model m;
    {name}_parameters p;
    {name}_inputs u;
    const double times[] = {{{listed}}};
    int i, k, state;
    {name}_defaults(&p);
    {p}
    {name}_scenario(0.0, 0, &u);
    if ((state = {name}_start(&m, &p, &u))) return state;
    for (k = 0; k < {len(times)}; ++k) {{
        if ((state = {name}_run(&m, &p, times[k]))) return state;
        for (i = 0; i < {name}_NODES; ++i) printf("%.17g ", m.T[i]);
        printf("\\n");
    }}
    return 0;
}}
"""
    source = header.with_suffix(".c")
    source.write_text(main, encoding="ascii")
    built = header.with_suffix("")
    done = subprocess.run([program, *options, source.name, "-o", built.name, "-lm"], cwd=header.parent, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    ran = subprocess.run([str(built)], cwd=header.parent, capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, ""), (ran.returncode, ran.stderr)
    return np.array([[float(x) for x in line.split()] for line in ran.stdout.splitlines()])
