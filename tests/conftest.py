"""Options of the tests as a whole."""

from __future__ import annotations

import gc

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-references", action="store_true", help="write the stored traces of tests/regression anew")


def pytest_configure() -> None:
    """Thousands of tests and syntax trees of the whole package are kept: the garbage collector need not look at them again and again."""
    gc.set_threshold(20_000, 20, 50)
