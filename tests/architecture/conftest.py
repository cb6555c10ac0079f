"""The package, as the architecture tests see it."""

from __future__ import annotations

import pytest

from .house import amounts
from .source import Module, read_modules, read_tests


@pytest.fixture(scope="session")
def modules() -> dict[str, Module]:
    return read_modules()


@pytest.fixture(scope="session")
def there_is(modules: dict[str, Module]) -> dict[str, dict[str, int]]:
    return amounts(modules, read_tests())
