"""Options of the tests as a whole."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import nullcontext
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


@pytest.fixture(scope="module", params=["values alone", pytest.param("in full", marks=pytest.mark.campaign)])
def errors_in_turn(request: pytest.FixtureRequest) -> Iterator[str]:
    """As `values_alone` in `make test`; the same tests run with the product's own models of error where `make test-all` runs them."""
    from plain_errors import errors_of_values_alone

    with errors_of_values_alone() if request.param == "values alone" else nullcontext():
        yield request.param


@pytest.fixture
def errors_in_full_here() -> Iterator[None]:
    """For a test of such a module that is about models of error: it has the product's in `make test` too."""
    from plain_errors import errors_in_full

    with errors_in_full():
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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What runs in the campaign only has the product's models of error there, and runs once."""
    of_values = [i for i in items if "errors_in_turn" in getattr(i, "fixturenames", ()) and "values alone" in i.name]
    twice = {i for i in of_values if i.get_closest_marker("campaign")}
    items[:] = [i for i in items if i not in twice]


def pytest_collection_finish() -> None:
    """What was collected stays to the end. Hypothesis looks for what holds a generator, and does not find what is frozen."""
    if "hypothesis" in sys.modules:
        gc.freeze()
