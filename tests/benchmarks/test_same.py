"""The comparison with what was kept: it sees one bit, one word and one answer too few, and takes nothing else out of texts."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import same
from answers import Answers, stripped

TEXT = '{"date": "2026-11-23", "key": "0123456789abcdef", "version": "0.1.0", "C": 0.1234567890123456, "words": "to date"}'


def one_bit_more(array: np.ndarray) -> np.ndarray:
    """Return a copy whose last number is the next one that a double can hold."""
    out = array.copy()
    out.flat[-1] = np.nextafter(out.flat[-1], np.inf)
    return out


def test_one_bit_of_a_number() -> None:
    kept = np.array([[300.0, np.nan], [np.inf, 310.0]])
    assert same.difference(kept.copy(), kept) is None
    found = same.difference(one_bit_more(kept), kept)
    assert found is not None
    assert found.size == np.spacing(310.0)
    assert "(1, 1)" in found.where


@pytest.mark.parametrize("now", [np.array([0.0, -0.0]), np.zeros(3), np.array([0.0, np.nan]), np.zeros(2, np.float32), "0 0"])
def test_what_is_not_the_same_array(now: np.ndarray | str) -> None:
    """A sign of zero, another length, no number, another precision, a text."""
    assert same.difference(now, np.zeros(2)) is not None


@pytest.mark.parametrize(("now", "size"), [("a 1.0e-3 K", 0.0), ("the 1.5e-3 K", 5e-4), ("the 1.0e-3 K at 2 s", np.inf)])
def test_texts_differ_in_words_or_numbers(now: str, size: float) -> None:
    found = same.difference(now, "the 1.0e-3 K")
    assert found is not None
    assert found.size == pytest.approx(size)


def test_what_is_taken_out_of_texts() -> None:
    """The day, digests, the version and the folder; no number, whatever its digits."""
    folder = Path("/somewhere/made")
    left = stripped(f"{TEXT} {folder}/logs", folder)
    assert left == '{"date": "DATE", "key": "DIGEST", "version": "VERSION", "C": 0.1234567890123456, "words": "to date"} FOLDER/logs'
    for number in ("-1.724852388121145e-20", "5.145164934774703e-05", "1234567890123456.0", "1.1111111111111111"):
        assert stripped(f'"K": {number}', folder) == f'"K": {number}'


def ask(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["same.py", *map(str, words)])
    return same.main()


def test_kept_and_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 1 and its name where one bit of one answer differs, or an answer is missing; 0 where none does."""
    numbers = np.linspace(290.0, 300.0, 7)

    def group(*more: tuple[str, np.ndarray | str]) -> Callable[[], Answers]:
        return lambda: iter([("a/b: 'c'", numbers), ("said", TEXT), *more])

    file = tmp_path / "kept.npz"
    monkeypatch.setattr(same, "GROUPS", {"group": group(), "other": group()})
    assert ask(monkeypatch, "--keep", file) == 0
    assert ask(monkeypatch, "--against", file) == 0
    assert "2 of 2 equal" in capsys.readouterr().out
    monkeypatch.setattr(same, "GROUPS", {"group": group(("a/b: 'c'", one_bit_more(numbers))), "other": group(("new", numbers))})
    assert ask(monkeypatch, "--against", file, "group") == 1
    assert "a/b: 'c': 5.7e-14" in capsys.readouterr().out
    assert ask(monkeypatch, "--against", file, "other") == 1
    assert "new: inf" in capsys.readouterr().out
