"""Logs in layouts that nobody made for the readers: read rightly or refused in words, never read wrongly without a word."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thermid.base.errors import ThermidError
from thermid.measure._readers.log_reader import read_record

from .layouts import STEP, Drawn, drawn

ICE = 273.15
ROLES = {"T1": {"node": "case"}, "Tair": {"boundary": "air"}, "P": {"load": "q"}}


def wrongly_read(log: Callable[..., Path], one: Drawn) -> str | None:
    """Return what was read wrongly, empty for nothing; None where the log was refused. Codes that are named count as masked."""
    try:
        record, _ = read_record(log(one.data), {one.heads.get(name, name): role for name, role in ROLES.items()}).drop_strays()
    except ThermidError:
        return None
    if record.times.size < one.times.size and any(re.match(r"\d+ .* \(line [\d,. ]+\)$", step) for step in record.steps):
        return None
    if record.times.shape != one.times.shape or np.abs(record.times - one.times).max() > 0.02 * STEP:
        return f"{one.words}: times {record.times[:3]} .. {record.times[-1]}, {record.times.size} of {one.times.size}"
    for name, truth in one.columns.items():
        channel = record[one.heads.get(name, name)]
        found, valid = channel.values - (0.0 if name == "P" else ICE), channel.valid.copy()
        if name == "T1":
            for k in one.coded:
                if valid[k]:
                    return f"{one.words}: the code of row {k} was read as {found[k]:g}"
        if valid.sum() < truth.size - 3:
            return f"{one.words}: {truth.size - valid.sum()} readings of {name} lost"
        if np.abs(found - truth)[valid].max() > 2e-3:
            return f"{one.words}: {name} is {found[np.argmax(np.where(valid, np.abs(found - truth), 0.0))]:g}"
    return ""


@pytest.mark.parametrize("count", [300, pytest.param(5000, marks=pytest.mark.campaign)])
def test_no_layout_is_read_wrongly_without_a_word(log: Callable[..., Path], count: int) -> None:
    said = [wrongly_read(log, drawn(seed)) for seed in range(count)]
    assert [words for words in said if words] == []
    assert sum(words == "" for words in said) > 0.4 * count
