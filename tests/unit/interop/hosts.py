"""Hosts of FMUs: a small one in C, compiled here, and FMPy where it is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import thermid as td
from thermid.interop._fmu.export import ExportedFmu, to_fmu
from thermid.interop._fmu.image import INDICATOR

Array = NDArray[np.float64]


@lru_cache(maxsize=1)
def c_host() -> str:
    """The program of fmu_host.c."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler for the host in fmu_host.c")
    program = Path(mkdtemp()) / "fmu_host"
    source = Path(__file__).with_name("fmu_host.c")
    subprocess.run([compiler, "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-cast-function-type", "-o", program, source, "-ldl"], check=True)
    return str(program)


@dataclass(frozen=True)
class Unpacked:
    """An FMU on disk, with the places of its variables."""

    written: ExportedFmu
    file: Path
    folder: Path

    @property
    def references(self) -> dict[str, int]:
        """Value reference of each variable."""
        return {v.name: k for k, v in enumerate(self.written.variables)}

    @property
    def guards(self) -> int:
        """How many event indicators it has."""
        return sum(v.kind == INDICATOR for v in self.written.variables)

    def run(self, outputs: list[str], end: float, step: float, form: str = "cs", **given: Any) -> Array:
        """Times [s] and outputs (times, 1 + outputs) by the host in C.

        `given`: values to set, by name in `values`; an input that swings; a tolerance; a token.
        """
        refs = self.references
        library = next(p for p in (self.folder / "binaries").rglob("*") if p.is_file())
        resources = self.folder / "resources"
        where = resources.as_uri() if self.written.version == "2.0" else f"{resources}/"
        token = re.search(r'(?:guid|instantiationToken)="(\w+)"', (self.folder / "modelDescription.xml").read_text())
        assert token is not None
        more = [f"{refs[name]}={value!r}" for name, value in given.get("values", {}).items()]
        more += [f"{refs[name]}~{level!r}:{by!r}" for name, (level, by) in given.get("swing", {}).items()]
        chosen = ",".join(str(refs[o]) for o in outputs)
        done = subprocess.run(
            [c_host(), library, self.written.version, form, given.get("token", token[1]), where, repr(end), repr(step), chosen, *more],
            capture_output=True,
            text=True,
            check=False,
            env={
                **os.environ,
                "FMU_STATES": str(len(self.written.states)),
                "FMU_INDICATORS": str(self.guards),
                "FMU_TOLERANCE": str(given.get("tolerance", 0)),
            },
        )
        if done.returncode < 0:
            raise OSError(f"signal {-done.returncode} ended the host")
        if done.returncode:
            raise RuntimeError(f"{done.returncode}: {done.stderr}")
        self.spent.append(float(done.stderr.split()[-1]))
        return np.loadtxt(done.stdout.splitlines(), ndmin=2)

    @property
    def spent(self) -> list[float]:
        """Mean time of a step of each run. [ns]"""
        return SPENT.setdefault(str(self.file), [])


SPENT: dict[str, list[float]] = {}


def unpacked(model: td.Model, scenario: td.Scenario, folder: Path, version: str = "3.0") -> Unpacked:
    """Write an FMU and unpack it."""
    file = folder / f"m{version[0]}.fmu"
    written = to_fmu(model, scenario, file, version)
    with zipfile.ZipFile(file) as packed:
        packed.extractall(folder / f"unpacked{version[0]}")
    return Unpacked(written, file, folder / f"unpacked{version[0]}")
