"""The package, as the architecture tests see it."""

from __future__ import annotations

import pytest

from .source import Module, read_modules


@pytest.fixture(scope="session")
def modules() -> dict[str, Module]:
    return read_modules()
