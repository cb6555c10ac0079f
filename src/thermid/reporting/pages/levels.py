"""What a page says of levels: what the logs of a stage say of the values that it inherited."""

from __future__ import annotations

import math

from thermid.fit.calibration import Calibration
from thermid.fit.uncertainty.moved import MOVED, NOT_REJECTED, UNDECIDED, Move, MovedGroup
from thermid.reporting.blocks.cells import DASH, Cell, Column, Line, Table, number, plain, pretty, significant
from thermid.units import unit

LOOKS = {MOVED: "bad", NOT_REJECTED: "good", UNDECIDED: "soft"}


def moved(calibration: Calibration) -> Table:
    """Return inherited values against what this stage's logs say of them alone: per parameter, per part, and all together."""
    columns = [
        Column("inherited"),
        Column("from stage"),
        Column("there", True),
        Column("logs alone", True, "the value by this stage's logs alone, without what was known of it; of a joint fit its value there"),
        Column("unit"),
        Column("change, %", True),
        Column("deviations", True, "the change over its standard error; for several values chi-square"),
        Column("chance", True, "of so large a change when nothing moved, corrected for the number of values tested"),
        Column("found, %", True, "the change that would be found with 90 % power, in parts of the value"),
        Column("result"),
    ]
    rows: list[Line] = [_line(m) for m in calibration.moved.values] + [_group(g) for g in calibration.moved.groups]
    how = (
        "A value that moved: the part does not behave in the assembly as it did alone, or the stage below missed something. A value is "
        "called not rejected only where a change of 10 % would be found."
    )
    return Table.of(columns, rows, how)


def _result(verdict: str) -> Cell:
    return Cell(verdict, "", LOOKS[verdict])


def _line(m: Move) -> Line:
    of = unit(m.unit)
    below, alone = ((v - float(of.offset)) / float(of.factor) for v in (m.below, m.alone))
    share = number(100 * (alone / below - 1), 2) if below and m.told else DASH
    far = f"{m.deviations:+.1f}" if math.isfinite(m.deviations) else DASH
    error = m.below_error / float(of.factor)
    there = f"{significant(below, error)} ± {number(error, 2)}" if math.isfinite(error) else plain(below, 5)
    seen = number(100 * m.detectable_share, 2) if m.told else DASH
    here = plain(alone, 4) if m.told else DASH
    return [
        Cell(m.path, "", "main"), m.stage, there, here, pretty(m.unit), share, far, number(m.chance, 2), seen, _result(m.verdict),
    ]  # fmt: skip


def _group(g: MovedGroup) -> Line:
    what = Cell(g.name, ", ".join(g.paths), "main")
    square = f"χ² {number(g.chi_square, 3)} of {g.directions}" if g.directions else DASH
    return [what, "", "", "", "", "", square, number(g.chance, 2), "", _result(g.verdict)]
