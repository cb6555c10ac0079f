"""A private copy of the tree that imports its own `thermid`, for tests that change or remove source files."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import thermid._kernel as kernel

ROOT = Path(__file__).parent.parent
FOLDERS = ("src", "tests", "benchmarks", "examples", "scripts", "docs")
FILES = ("pyproject.toml", "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "Makefile")
# An editable installation finds the original before any path is searched.
STARTUP = """import sys
sys.meta_path = [f for f in sys.meta_path if not type(f).__module__.startswith("_editable_")]
"""


class PrivateTree:
    """A copy of the tree in a directory, with the compiled kernel of the running installation."""

    def __init__(self, directory: Path, folders: Sequence[str] = FOLDERS) -> None:
        self.root = directory
        junk = shutil.ignore_patterns("__pycache__", "*.pyc", ".hypothesis")
        for name in folders:
            # what is compiled goes with the package: Python takes it only for a source of the same time and size, which copies keep
            shutil.copytree(ROOT / name, directory / name, ignore=None if name == "src" else junk)
        for name in FILES:
            shutil.copy2(ROOT / name, directory / name)
        shutil.copy2(str(kernel.__file__), directory / "src" / "thermid")
        shutil.copytree(Path(str(kernel.__file__)).with_name("_fmu"), directory / "src" / "thermid" / "_fmu")
        (directory / "startup").mkdir()
        (directory / "startup" / "sitecustomize.py").write_text(STARTUP, encoding="utf-8")

    @property
    def package(self) -> Path:
        """Folder of the package."""
        return self.root / "src" / "thermid"

    def python(self, *arguments: str, seconds: float = 900.0) -> subprocess.CompletedProcess[str]:
        """Run Python in the copy; its imports and those of its child processes come from there."""
        paths = os.pathsep.join(str(self.root / p) for p in ("startup", "src"))
        own = {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, *arguments]
        return subprocess.run(
            command, cwd=self.root, env={**os.environ, **own}, capture_output=True, text=True, timeout=seconds, check=False
        )

    def pytest(self, tests: Sequence[str], *options: str, seconds: float = 900.0) -> subprocess.CompletedProcess[str]:
        """Run tests of the copy, without the long campaigns."""
        return self.python("-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not campaign", *options, *tests, seconds=seconds)
