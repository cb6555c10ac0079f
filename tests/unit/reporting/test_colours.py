"""Series of one picture differ for eyes that see two colours, and stand out from their paper; what shares a colour has other dashes."""

from __future__ import annotations

import re
from importlib.resources import files
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from thermid.reporting._pictures.chart import DASHES, SERIES
from thermid.reporting._pictures.figures import STYLES

# Machado, Oliveira, Fernandes, A physiologically-based model for simulation of color vision deficiency, IEEE TVCG 15 (2009), severity 1
SIGHT = {
    "normal": np.eye(3),
    "deuteranopia": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]),
    "protanopia": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
}
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
LEAST = 15.0
"""Smallest CIEDE2000 difference between two series."""

Colour = NDArray[np.float64]


def linear(text: str) -> Colour:
    c = np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb: Colour) -> Colour:
    x = XYZ @ np.clip(rgb, 0.0, 1.0) / np.array([0.95047, 1.0, 1.08883])
    f = np.where(x > (6 / 29) ** 3, np.cbrt(x), x / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def difference(one: Colour, two: Colour) -> float:
    """CIEDE2000 of two colours in CIELAB (Sharma, Wu, Dalal, Color Research and Application 30 (2005) 21)."""
    (l1, a1, b1), (l2, a2, b2) = one, two
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    g = 1 + 0.5 * (1 - np.sqrt(mean**7 / (mean**7 + 25.0**7)))
    c1, c2 = np.hypot(g * a1, b1), np.hypot(g * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, g * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    dh = 0.0 if c1 * c2 == 0 else (h2 - h1 + 180) % 360 - 180
    hue = h1 + h2 if c1 * c2 == 0 else (h1 + dh / 2) % 360
    turn = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(dh / 2))
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    t = 1 - 0.17 * np.cos(np.radians(hue - 30)) + 0.24 * np.cos(np.radians(2 * hue)) + 0.32 * np.cos(np.radians(3 * hue + 6))
    t -= 0.20 * np.cos(np.radians(4 * hue - 63))
    sl, sc, sh = 1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2), 1 + 0.045 * chroma, 1 + 0.015 * chroma * t
    rt = -np.sin(np.radians(60 * np.exp(-(((hue - 275) / 25) ** 2)))) * 2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7))
    dl, dc = (l2 - l1) / sl, (c2 - c1) / sc
    return float(np.sqrt(dl**2 + dc**2 + (turn / sh) ** 2 + rt * dc * turn / sh))


def palette(theme: str) -> dict[str, str]:
    style = files("thermid.reporting._blocks").joinpath("page.css.jinja").read_text(encoding="utf-8")
    text = re.search(rf"set {theme} -%}}(.*?){{%- endset", style, re.DOTALL)
    assert text is not None
    return dict(re.findall(r"(--[\w-]+):(#[0-9a-f]{3,6})", text[1]))


@pytest.mark.parametrize(
    ("one", "two", "known"),
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0009), 7.1792),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ],
)
def test_the_difference_is_that_of_the_published_pairs(one: tuple[float, ...], two: tuple[float, ...], known: float) -> None:
    assert difference(np.array(one), np.array(two)) == pytest.approx(known, abs=1e-4)


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("sight", list(SIGHT))
def test_series_of_one_picture_differ(theme: str, sight: str) -> None:
    found = palette(theme)
    groups = (
        [f"--s{k}" for k in range(len(SERIES))],
        ["--f-measured", "--f-simulated", "--f-residual", "--s2", "--f-ink"],  # measured and simulated with limits, ambient, truth
        sorted({look[0][0] for look in STYLES.values()}),
    )
    seen = {name: lab(SIGHT[sight] @ linear(colour)) for name, colour in found.items() if len(colour) == 7}
    for group in groups:
        close = {(a, b): round(difference(seen[a], seen[b]), 1) for a, b in combinations(group, 2)}
        assert {pair: far for pair, far in close.items() if far < LEAST} == {}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_series_stand_out_from_their_paper(theme: str) -> None:
    found = palette(theme)
    paper = "#ffffff" if theme == "light" else found["--paper"]
    for k in range(len(SERIES)):
        y, of = (float(XYZ[1] @ linear(c)) + 0.05 for c in (found[f"--s{k}"], paper))
        assert max(y, of) / min(y, of) >= 3.0


def test_files_and_pages_have_the_same_colours() -> None:
    assert [palette("light")[f"--s{k}"] for k in range(len(SERIES))] == list(SERIES)


def test_what_shares_a_colour_has_other_dashes_or_another_width() -> None:
    looks = [(colour, dash, width) for (colour, _), width, dash in STYLES.values()]
    assert len(set(looks)) == len(looks)
    assert len(set(DASHES)) == len(DASHES) >= len(SERIES)
