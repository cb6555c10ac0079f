"""Candidate structures as a page: which is taken and why, what is held against each, nothing loaded, nothing run."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import ThermidError
from webpage import without_script

PLAIN = td.reporting.Structure(
    "plain", "two <masses>", 4, 900.0, 40.0, 30.0, {"T": 0.5}, {"T": {"a": 0.9, "b": 1.1}}, {"skin.htc": (5.0, 0.1, "W/(m^2 K)")}
)
LAG = td.reporting.Structure("lag", "a sensor that lags", 5, 820.0, 10.0, 5.0, {"T": 0.3}, {"T": {"a": 0.40, "b": 0.44}})
CURVE = td.reporting.Structure(
    "curve", "a bent law", 7, 815.0, 8.0, 3.0, {"T": 0.3}, {"T": {"a": 0.40, "b": 0.42}}, at_bounds=("x ends at its bound 2",)
)
LIKELY = td.reporting.Structure(
    "likely", "two of all", 9, 800.0, 0.0, 0.0, {"T": 0.2}, {"T": {"a": 0.6, "b": 0.7}}, implausible=("tau = 57 s, outside 5 .. 40",)
)
REFUSED = td.reporting.Structure("walls", "and walls", 9, refused="'wall' and 'room' cannot be separated by these data.")
ALL = (PLAIN, LAG, CURVE, LIKELY, REFUSED)


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def test_the_simplest_physical_one_near_the_best_is_taken(tmp_path: Path) -> None:
    page = text(td.reporting.structures_report("Box", ALL, to=tmp_path / "page.html", reasons=["Because I say so."], notes=["Real logs."]))
    assert "Taken: lag" in page
    for words in (
        "Likeliest on the fitted runs: likely, but implausible: tau = 57 s, outside 5 .. 40.",
        "Nearest to the hold-out runs: curve, 0.41 K.",
        "lag misses them by 0.42 K, 2 % more; of curve: x ends at its bound 2.",
        "Refused, because these runs do not determine its parameters: walls.",
        "Because I say so.",
        "Real logs.",
        "&#39;wall&#39; and &#39;room&#39; cannot be separated by these data.",
        "two &lt;masses&gt;",
    ):
        assert words in page, words
    without_script(page)
    assert 'src="http' not in page


def test_the_author_may_take_another_and_none_may_do(tmp_path: Path) -> None:
    assert "Taken: plain" in text(td.reporting.structures_report("Box", ALL, to=tmp_path / "a.html", chosen="plain"))
    assert "None is acceptable" in text(td.reporting.structures_report("Box", (CURVE, LIKELY, REFUSED), to=tmp_path / "b.html"))
    with raises_code("name.unknown", match="no structure 'boardd'; there are plain, lag"):
        td.reporting.structures_report("Box", ALL, to=tmp_path / "c.html", chosen="boardd")
    with pytest.raises(ThermidError, match="no structures are given to"):
        td.reporting.structures_report("Box", (), to=tmp_path / "d.html")
