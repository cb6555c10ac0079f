"""What a page says of levels: whether values handed on from below had to move."""

from __future__ import annotations

import math

from thermid.identify.calibration import Calibration
from thermid.identify.moves import Group, Move
from thermid.reporting.cells import DASH, Cell, Column, Line, Table, number, plain, pretty, significant
from thermid.units import unit

__all__ = ["moved"]

LOOKS = {"had to move": "bad", "may have moved": "warn", "held": "good", "not tested": "soft"}


def moved(calibration: Calibration) -> Table:
    """Return what stages below handed on against what this level's data say: per parameter, per part, and all together."""
    columns = [
        Column("handed on"),
        Column("by stage"),
        Column("below", True),
        Column("here", True),
        Column("unit"),
        Column("change, %", True),
        Column(
            "deviations", True, "the shift over the root of the variance that this level's data took off; for several values chi-square"
        ),
        Column("chance", True, "of so large a shift when nothing but noise moves it"),
        Column("result"),
    ]
    rows: list[Line] = [_line(m, calibration) for m in calibration.moved.values] + [_group(g) for g in calibration.moved.groups]
    how = "A value that had to move: the part does not behave in the assembly as it did alone, or the stage below missed something."
    return Table.of(columns, rows, how)


def _result(verdict: str) -> Cell:
    return Cell(verdict, "", LOOKS[verdict])


def _line(m: Move, calibration: Calibration) -> Line:
    of = unit(m.unit)
    below, here = ((v - float(of.offset)) / float(of.factor) for v in (m.below, m.here))
    share = number(100 * (here / below - 1), 2) if below else DASH
    far = f"{m.deviations:+.1f}" if math.isfinite(m.deviations) else DASH
    found = calibration.values.get(m.path)
    sizes = [e / float(of.factor) for e in (m.below_error, found.error if found is not None else math.nan)]
    shown = [
        f"{significant(v, e)} ± {number(e, 2)}" if math.isfinite(e) else plain(v, 5) for v, e in zip((below, here), sizes, strict=True)
    ]
    return [Cell(m.path, "", "main"), m.stage, *shown, pretty(m.unit), share, far, number(m.chance, 2), _result(m.verdict)]


def _group(g: Group) -> Line:
    what = Cell(g.name, ", ".join(g.paths), "main")
    square = f"χ² {number(g.chi_square, 3)} of {g.directions}" if g.directions else DASH
    return [what, "", "", "", "", "", square, number(g.chance, 2), _result(g.verdict)]
