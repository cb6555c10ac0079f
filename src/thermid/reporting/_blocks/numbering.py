"""Numbers of figures and tables, references to them, and the files beside a page that hold its long tables."""

from __future__ import annotations

import csv
import io
import os
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from thermid.base.errors import ScenarioError
from thermid.base.files import SHEET, write_text
from thermid.reporting._blocks.content import FoldOut, PageBlock, Section, Table, typeset

AUDIENCES: Final = ("summary", "agency", "all")
"""For whom a report is: two pages with the answer; what an agency reads; everything."""
LONG: Final = {"summary": 6, "agency": 25, "all": 25}
"""Rows from which a table is a file beside the page too."""
SHOWN: Final = {"summary": 5, "agency": 12, "all": 10**9}
"""Rows of a long table on the page itself."""

_COUNTED: Final = re.compile(r'<figure(?: id="([^"]*)")?[^>]*>|<table(?: id="([^"]*)")?[^>]*>|(<i class="no"></i>)')
_REFERENCE: Final = re.compile(r'<a class="ref" href="#([^"]*)"></a>')


def numbered(page: str) -> str:
    """Return a page whose figures and tables are numbered in the order of reading, and whose references say these numbers.

    A figure or table is an element whose caption begins with an empty ``<i class="no"></i>``; one that is referred to has an id. A
    reference to what the page does not hold is left out.
    """
    counts = {"Fig.": 0, "Table": 0}
    places: dict[str, str] = {}
    kind, place = "", ""

    def count(element: re.Match[str]) -> str:
        """Number a table or figure, and its caption."""
        nonlocal kind, place
        if element[3] is None:
            kind, place = ("Table", element[2] or "") if element[0].startswith("<table") else ("Fig.", element[1] or "")
            return element[0]
        counts[kind] += 1
        text = f"{kind}\u00a0{counts[kind]}"
        if place:
            places[place] = text
        return f'<b class="no">{text}</b> '

    page = _COUNTED.sub(count, page)
    return _REFERENCE.sub(lambda m: f'<a href="#{m[1]}">{places[m[1]]}</a>' if m[1] in places else "", page)


def check_audience(audience: str) -> str:
    """Return for whom a report is.

    Raises
    ------
    ScenarioError   When there is no such audience.
    """
    if audience not in AUDIENCES:
        raise ScenarioError(
            f"a report is for {', '.join(AUDIENCES[:-1])} or {AUDIENCES[-1]}, not for '{audience}'.", "audience", code="value.wrong-kind"
        )
    return audience


def tables_folder(page: str | os.PathLike[str]) -> Path:
    """Return the folder beside a page that holds its long tables."""
    return Path(page).with_suffix(".tables")


@dataclass
class Sheets:
    """Long tables of a page, each a file of comma-separated values in one folder.

    Parameters
    ----------
    folder : Path       Where they go; made when the first is written.
    audience : str      For whom the page is; decides how much of a long table stands on it.
    """

    folder: Path
    audience: str = "all"
    files: dict[str, str] = field(default_factory=dict)

    @classmethod
    def beside(cls, page: str | os.PathLike[str], folder: str | os.PathLike[str] | None = None, audience: str = "all") -> Sheets:
        """Return the tables of a page for an audience, in a folder beside the page where no other is named.

        Raises
        ------
        ScenarioError   When there is no such audience.
        """
        return cls(Path(folder) if folder is not None else tables_folder(page), check_audience(audience))

    def place_of(self, table: Table, title: str) -> tuple[int, str]:
        """Return how many rows of a table stand on the page, and the file that holds all of them; empty for a short one."""
        rows = len(table.rows)
        if rows < LONG[self.audience]:
            return rows, ""
        return min(rows, SHOWN[self.audience]), self.keep(table, title)

    def keep(self, table: Table, title: str = "") -> str:
        """Return the name of the file that holds a table."""
        base = re.sub(r"[^a-z0-9]+", "_", (table.title or title or "table").lower()).strip("_")[:48] or "table"
        text = csv_of(table)
        name = base
        for k in range(2, 10_000):
            if self.files.get(f"{name}.csv", text) == text:
                break
            name = f"{base}_{k}"
        self.files[f"{name}.csv"] = text
        return f"{self.folder.name}/{name}.csv"

    def shortened(self, sections: list[Section]) -> list[Section]:
        """Return the sections for the audience: what opens on demand is kept in files alone, unless everything is asked for."""
        if self.audience == "all":
            return sections
        return [replace(s, blocks=tuple(b for b in s.blocks if not self._put_away(b))) for s in sections]

    def _put_away(self, block: PageBlock) -> bool:
        """Whether a block folds out; its tables are then kept, under its title, for the page of numbers."""
        if not isinstance(block, FoldOut):
            return False
        for inner in block.blocks:
            if isinstance(inner, Table):
                self.keep(inner, block.title)
            else:
                self._put_away(inner)
        return True

    def write(self) -> None:
        """Write the files."""
        if self.files:
            self.folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files.items():
            write_text(self.folder / name, text, SHEET)


def csv_of(table: Table) -> str:
    """Return a table as comma-separated values, its heads first."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([typeset(c.title) for c in table.columns])
    last: list[str] = []
    for row in table.rows:
        cells = [typeset(c.text) for c in row]
        same = [k for k, c in enumerate(row) if c.look == "same"]  # blank because it is that of the line above
        last = [last[k] if k in same and last else text for k, text in enumerate(cells)]
        writer.writerow(last)
    return out.getvalue()
