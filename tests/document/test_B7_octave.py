"""B7: the exported m_PrE in Octave against the reference traces of Fig. 20 in Octave; row 2.2, drift and step, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thermid as td
from unit.interop.programs import octave

pytestmark = pytest.mark.document
ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "seed" / "data"
BENCH = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
STEP = BENCH.with_(
    title="ambient 0.7 K up over 5 h, second power off at 3 h",
    boundaries={"cv": {"times": ["0 [s]", "5 [h]"], "values": ["24 [degC]", "24.7 [degC]"]}},
    loads={"ele.electronics": {"times": ["0 [s]", "3 [h]"], "values": ["2.168 [W]", "0 [W]"], "hold": True}},
)


@pytest.fixture
def pair() -> td.Model:
    """The deck with the reference case's L/k of 4.06e-3 m2 K/W, which the deck rounds at its sixth digit."""
    return td.load_model(ROOT / "examples" / "sisnav" / "m_PrE.toml")


@pytest.mark.parametrize(
    ("file", "scenario"),
    [("pre_octave_ode15s_tight.csv", BENCH), ("pre_octave_ode15s_drift_step.csv", STEP)],
    ids=["tight", "drift and step"],
)
def test_b7_the_exported_function_gives_the_reference(pair: td.Model, file: str, scenario: td.Scenario, tmp_path: Path) -> None:
    if not (DATA / file).exists():
        pytest.skip(f"{file}, a reference trace, is not here")
    reference = np.loadtxt(DATA / file, delimiter=",", skiprows=1)
    td.interop.to_octave(pair, scenario, tmp_path / "m_PrE.m")
    found = octave(tmp_path / "m_PrE.m", reference[:, 0])
    assert np.abs(found - reference[:, 1:]).max() < 1e-6


def test_b7_the_exported_function_gives_the_printed_rows(pair: td.Model, tmp_path: Path) -> None:
    """Section 2.2 of the acceptance sheet: T1 and T2 by Eq. 6."""
    td.interop.to_octave(pair, BENCH, tmp_path / "m_PrE.m")
    found = octave(tmp_path / "m_PrE.m", np.array([0.5, 1.0, 2.0, 5.0]) * 3600.0)
    rows = [[28.183726, 28.308554], [30.971352, 30.999444], [33.998710, 33.863691], [36.077771, 35.821535]]
    assert np.abs(found - rows).max() < 1e-6


def test_b7_vacuum_gives_numbers(pair: td.Model, tmp_path: Path) -> None:
    """Where the printed form of Fig. 20 gives NaN: every coefficient zero."""
    td.interop.to_octave(pair, BENCH.vacuum(as_printed=True), tmp_path / "m_PrE.m")
    found = octave(tmp_path / "m_PrE.m", np.array([18000.0]))
    assert np.abs(found - [75.809512, 76.162750]).max() < 1e-6
