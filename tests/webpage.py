"""What every page must be: its own script and no other, nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from html.parser import HTMLParser
from importlib.resources import files
from typing import Any

POLICY = re.compile(r'http-equiv="Content-Security-Policy" content="([^"]*)"')


def without_script(source: str) -> str:
    """Return a page without its script, after its policy was found to permit that one text and nothing from anywhere."""
    script = files("thermid.reporting").joinpath("page.js").read_text(encoding="utf-8")
    assert source.count(f"<script>{script}</script>") == 1
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = POLICY.search(source)
    assert policy is not None
    assert html.unescape(policy[1]) == f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'"
    bare = source.replace(f"<script>{script}</script>", "")
    assert "<script" not in bare
    assert not re.search(r"https?://(?!www\.w3\.org)", source)
    return bare


UNIT = re.compile(r"(?:^|[ (,])(K/h|K|°C|nK|W/\(m² K\)|W/\(m K\)|W/K|W|kg|cm²|m²|mm|kJ|J|s|min|h|%|% of rise)\)?$")
OWN_UNIT = re.compile(r"\d (?:°C|K|W|W/K|g|kg|s|min|h|%|cm²)(?:\b|$)|\d+ of \d+|^≥|^≤")
COUNTS = {
    *("samples", "records", "readings", "nodes", "conductors", "evaluations", "free", "outside", "cycle", "no.", "at bounds"),
    *("white", "lag-1", "correlation", "dQAIC", "dAIC", "deviations", "chance", "shift / ±", "weight", "Biot number", "times"),
}
"""Heads of columns that count or compare: their numbers have no unit."""
FITTED = {"after", "found", "below", "here", "constant error", "found ± total error"}
"""Heads of columns whose values were fitted, in tables with a unit for every line."""


class Tables(HTMLParser):
    """Every table of a page: its caption, its heads with their scopes, its rows of (tag, classes, text)."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tables: list[dict[str, Any]] = []
        self._cell: list[str] | None = None
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {k: v or "" for k, v in attrs}
        if tag == "table":
            self.tables.append({"caption": "", "heads": [], "rows": []})
        elif tag == "tr":
            self.tables[-1]["rows"].append([])
        elif tag in ("th", "td", "caption"):
            self._cell, self._as = [], (tag, given)

    def handle_endtag(self, tag: str) -> None:
        if tag not in ("th", "td", "caption") or self._cell is None:
            return
        text, (_, given), table = "".join(self._cell).strip(), self._as, self.tables[-1]
        self._cell = None
        if tag == "caption":
            table["caption"] = text
        elif given.get("scope") == "col":
            table["heads"].append((text, given))
        else:
            table["rows"][-1].append((tag, given, text))

    def handle_data(self, data: str) -> None:
        if self._cell is not None:
            self._cell.append(data)


def faults(source: str) -> list[str]:
    """Return what is wrong with the tables of a page: no name or scope, numbers without a unit, fitted values without their error."""
    out = []
    for table in Tables(source).tables:
        name, heads = table["caption"].split(".")[0], [h for h, _ in table["heads"]]
        numeric = ["n" in g.get("class", "").split() for _, g in table["heads"]]
        if not name or not heads:
            out.append(f"a table without a name or heads: {heads}")
        units = heads.index("unit") if "unit" in heads else None
        errors = any(h.startswith("±") or "interval" in h or "standard error" in h for h in heads)
        whole = any(UNIT.fullmatch(h) for h in heads)
        for row in (r for r in table["rows"] if r):
            out += [f"{name}: a row's head has no scope" for tag, g, _ in row if tag == "th" and g.get("scope") != "row"]
            for head, is_number, (_, _, text) in zip(heads, numeric, row, strict=True):
                if not is_number or not re.search(r"\d", text):
                    continue
                bare = head in COUNTS or head.split(",")[0] in COUNTS
                if not (bare or whole or UNIT.search(head) or OWN_UNIT.search(text) or (units is not None and row[units][2])):
                    out.append(f"{name}: '{text}' under '{head}' has no unit")
                if units is not None and head in FITTED and "±" not in text and not errors:
                    out.append(f"{name}: '{text}' under '{head}' has no ±")
                if len(re.sub(r"\D", "", re.split(r"±|\.\.| of |e[+-]", text)[0].lstrip("0.-+\u2212"))) > 8:
                    out.append(f"{name}: '{text}' under '{head}' has too many digits")
    return out
