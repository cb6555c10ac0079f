"""Options of the tests as a whole."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from typing import Any

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-references", action="store_true", help="write the stored traces of tests/regression anew")


@pytest.fixture(scope="module")
def values_alone() -> Iterator[None]:
    """For a module whose tests read no band, no error and no word of what the structure may lack: see plain_errors.py."""
    from plain_errors import errors_of_values_alone  # not every run of tests imports the package

    with errors_of_values_alone():
        yield


class _Documented:
    """Examples in docstrings are looked for in files that hold some; the others are not imported and searched for them."""

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(self) -> Iterator[Any]:
        found = yield
        return [c for c in found if type(c).__name__ != "DoctestModule" or ">>>" in c.path.read_text(encoding="utf-8")]


def pytest_configure(config: pytest.Config) -> None:
    """Thousands of tests and syntax trees of the whole package are kept: the garbage collector need not look at them again and again."""
    gc.set_threshold(20_000, 20, 50)
    config.pluginmanager.register(_Documented())


def pytest_collection_finish() -> None:
    """What was collected stays to the end. Hypothesis looks for what holds a generator, and does not find what is frozen."""
    if "hypothesis" in sys.modules:
        gc.freeze()
