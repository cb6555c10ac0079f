"""Numbers of pages and pictures, by what a reader must tell apart."""

from itertools import pairwise

from thermid.reporting._blocks.content import _power
from thermid.reporting._diagrams.map import _way
from thermid.reporting._pages.tables import _some
from thermid.reporting._pictures.chart import DASHES, SERIES


def test_lines_are_told_apart_by_their_dashes_without_colour() -> None:
    """Of two patterns with equal gaps the longer dash has at least 1.4 times the length: a third is seen, a fifth is not."""
    assert len(DASHES) == len(SERIES)
    assert DASHES[0] == ()
    lengths = sorted(dash for dash, gap in DASHES[1:] if gap == 2.0)
    assert len(lengths) == len(SERIES) - 1
    assert all(long >= 1.4 * short for short, long in pairwise(lengths))


def test_powers_of_ten_stand_from_a_million_and_to_a_millionth() -> None:
    assert [_power("1.25", exponent) for exponent in (6, 5, -5, -6)] == ["1.25·10⁶", "125000", "0.0000125", "1.25·10⁻⁶"]


def test_a_bend_of_a_line_is_rounded_over_eight_pixels_or_half_of_its_shorter_leg() -> None:
    path = _way([(0.0, 0.0), (100.0, 0.0), (100.0, 10.0)])
    assert "L92.0 0.0Q100.0 0.0 100." in path
    assert path.endswith(" 100.0 5.0L100.0 10.0")


def test_a_remark_names_three_and_counts_the_rest() -> None:
    """Three names of 39 characters fit on two printed lines of eighty beside the 26 characters before them; four do not."""
    name = 39 * "n"
    assert _some([name] * 3) == ", ".join([name] * 3)
    assert _some([name] * 5) == f"{', '.join([name] * 3)} and 2 more"
    assert 26 + len(_some([name] * 9)) <= 160 < 26 + len(", ".join([name] * 4))
