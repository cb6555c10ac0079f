"""The package and the repository, as the architecture tests see them."""

from __future__ import annotations

from pathlib import Path

import pytest

from .source import ROOT, Module, read_modules


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def modules() -> dict[str, Module]:
    return read_modules()
