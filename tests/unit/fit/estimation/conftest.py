"""One log of the house and what `estimate` makes of it, for all files of this folder."""

from __future__ import annotations

import pytest

from thermid.fit._estimation.estimation import Estimation

from .house import TRUTH, Case, drawn, estimate


@pytest.fixture(scope="session")
def case() -> Case:
    return drawn(TRUTH, 1, 400)


@pytest.fixture(scope="session")
def found(case: Case) -> Estimation:
    return estimate(case, horizon="12 [h]")
