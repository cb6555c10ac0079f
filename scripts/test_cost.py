"""Processor time of tests by folder, with that of what they start.

``env -u PYTHONDONTWRITEBYTECODE PYTHONPATH=scripts .venv/bin/python -m pytest -p test_cost -n 2 --dist loadfile -m "not campaign"``.
Without compiled files, which `make test` lets Python write, each of the hundred starts of Python compiles the package. With ``-n`` every
worker counts what it runs. A fixture that several tests share counts for the first of them; collecting counts apart.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

seconds: Counter[str] = Counter()


def _now() -> float:
    """Processor time of this process and of those that it started and waited for. [s]"""
    return sum(os.times()[:4])


def pytest_collection_finish() -> None:
    """Count what collecting took."""
    seconds["collecting"] += _now()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[Any]:
    """Count a test, with the fixtures that are made and ended for it."""
    begun = _now()
    done = yield
    seconds["/".join(item.nodeid.partition("::")[0].split("/")[:-1][:3])] += _now() - begun
    return done


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand on what a worker has counted."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["seconds"] = dict(seconds)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Add what a worker has counted."""
    seconds.update(getattr(node, "workeroutput", {}).get("seconds", {}))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table."""
    terminalreporter.section("processor time [s]")
    for name, spent in seconds.most_common():
        terminalreporter.write_line(f"{spent:8.1f}  {name}")
    terminalreporter.write_line(f"{sum(seconds.values()):8.1f}  in all")
