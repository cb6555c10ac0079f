"""Sizes of model error: the table that ships is what the kept likelihoods of the public sets say."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thermid.fit._error_model.sizes import SIZE_SETS
from thermid.fit.error_model import SIZES

SCRIPTS = Path(__file__).parents[3] / "scripts"
KEPT = SCRIPTS / "sizing" / "likelihoods.json"
"""Written by ``python scripts/error_sizes.py --write`` from files that are known by their checksums."""


@pytest.fixture(scope="module")
def population() -> Iterator[Any]:
    sys.path.insert(0, str(SCRIPTS))
    try:
        from sizing import population as made

        yield made
    finally:
        sys.path.remove(str(SCRIPTS))


def test_the_table_is_what_the_sets_say(population: Any) -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    told = population.scales(kept["likelihoods"])

    assert told.pop("hidden").value > 5.0 * SIZES["hidden"].value  # with what the sets ask for, logs that were left out are predicted worse
    shipped = {g: (s.value, s.sets) for g, s in SIZES.items() if g != "hidden"}
    assert shipped == {g: (population.rounded(of.value), of.sets) for g, of in told.items()}
    assert list(SIZE_SETS) == list(kept["likelihoods"]) == list(kept["files"])
    assert all(len(digest) == 64 for files in kept["files"].values() for digest in files.values())


def test_scales_come_back(population: Any) -> None:
    # sixty sets whose sizes come from a half-t of four first priors, each seen to a factor of 1.5
    rng = np.random.default_rng(3)
    seen = np.abs(4.0 * rng.standard_t(4.0, 60)) * np.exp(rng.normal(0.0, 0.4, 60))
    logs = -0.5 * (np.log(population.GRID / seen[:, None]) / 0.4) ** 2
    told = population.scales({str(k): {"run": row} for k, row in enumerate(logs)})["run"]
    assert told.low < 4.0 * population.FIRST["run"] < told.high
    assert told.high / told.low < 2.0


def test_a_class_without_sets_has_it_from_the_others(population: Any) -> None:
    sharp = -0.5 * (np.log(population.GRID / 5.0) / 0.2) ** 2
    told = population.scales({str(k): {"surface": sharp, "joint": sharp} for k in range(8)})
    assert told["law"].sets == 0
    assert told["law"].value > 2.0 * population.FIRST["law"]
    assert told["law"].high / told["law"].low > 2.0 * told["joint"].high / told["joint"].low
    assert told["hidden"].value == pytest.approx(population.FIRST["hidden"], rel=0.05)


def test_one_odd_set_does_not_decide(population: Any) -> None:
    usual, odd = (-0.5 * (np.log(population.GRID / at) / 0.3) ** 2 for at in (1.0, 30.0))
    told = population.scales({str(k): {"left": odd if k == 0 else usual} for k in range(9)})["left"]
    assert told.value < 3.0 * population.FIRST["left"]


def test_text_says_how_many_sets() -> None:
    lines = str(SIZES).splitlines()
    assert len(lines) == 1 + len(SIZES)
    assert all(f"{of.sets} sets" in line for of, line in zip(SIZES.values(), lines[1:], strict=True) if of.sets)
