"""What every page must be: its own script and no other, nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

POLICY = re.compile(r'http-equiv="Content-Security-Policy" content="([^"]*)"')


def without_script(source: str) -> str:
    """Return a page without its script, after its policy was found to permit that one text and nothing from anywhere."""
    script = files("thermid.reporting._blocks").joinpath("page.js").read_text(encoding="utf-8")
    assert source.count(f"<script>{script}</script>") == 1
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = POLICY.search(source)
    assert policy is not None
    assert (
        html.unescape(policy[1])
        == f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; script-src 'sha256-{digest}'"
    )
    bare = source.replace(f"<script>{script}</script>", "")
    assert "<script" not in bare
    assert not re.search(r"https?://(?!www\.w3\.org)", source)
    return bare


FIGURE = re.compile(r'<svg class="plot".*?</svg>', re.DOTALL)
PANEL = re.compile(r'<g class="panel" [^>]*?data-ends="([^"]*)".*?(?=<g class="panel"|</svg>)', re.DOTALL)
LINE = re.compile(r'<path class="line" data-n="([^"]*)"(?: data-less="[^"]*")? d="([^"]*)"')
CAPTION = re.compile(r"<figcaption>(.*?)</figcaption>", re.DOTALL)
GRID = 10_000


def lines_of(figure: str) -> list[tuple[int, str, list[tuple[float, float]]]]:
    """Return panel, name and points (x, y) of every line of a figure, gaps left in, as the script of a page reads them back."""
    out = []
    for k, panel in enumerate(PANEL.finditer(figure)):
        x0, x1, y0, y1 = map(float, panel[1].split())
        for name, path in LINE.findall(panel[0]):
            px = py = 0
            for command, numbers in re.findall(r"([Mlh])([^Mlh]*)", path):
                n = [int(v) for v in re.findall(r"-?\d+", numbers)]
                if command == "M":
                    points: list[tuple[float, float]] = []
                    out.append((k, html.unescape(name), points))
                for dx, dy in zip(n[::2], n[1::2], strict=False):
                    px, py = (dx, dy) if command == "M" else (px + dx, py + dy)
                    points.append((x0 + (x1 - x0) * px / GRID, y1 - (y1 - y0) * py / GRID))
    return out


def crossings(figure: str) -> list[str]:
    """Return the limits of a figure that a curve of the same axes passes; a step of its grid is no crossing."""
    found = lines_of(figure)
    limits = [(panel, name, points) for panel, name, points in found if name.startswith("limit")]
    ends = [[float(v) for v in p[1].split()] for p in PANEL.finditer(figure)]
    out = []
    for panel, name, ((a, level), *_, (b, _)) in limits:
        others = [points[0][1] for p, n, points in limits if p == panel and n == name and points[0][0] == a and points[0][1] != level]
        side = -1.0 if others and others[0] > level else 1.0
        for curve, points in ((n, np.array(q).T) for p, n, q in found if p == panel and not n.startswith("limit")):
            x, y = points
            at = np.unique(np.concatenate([[a, b], x[(x >= a) & (x <= b)]]))
            at = at[(at >= x[0]) & (at <= x[-1])]
            if at.size and (side * (np.interp(at, x, y) - level)).max() > 1.5 * (ends[panel][3] - ends[panel][2]) / GRID:
                out.append(f"{curve} passes {name} of {level:.4g}")
    return out


def limited(page: str) -> list[tuple[str, str]]:
    """Return caption and figure of every picture with limits in a page."""
    whole = re.findall(r"<figure.*?</figure>", page, re.DOTALL)
    return [
        (html.unescape(CAPTION.search(one)[1]), found[0])  # type: ignore[index]
        for one in whole
        if (found := FIGURE.search(one)) is not None and 'data-n="limit, ' in one
    ]


SMALLEST = """
const out = new Map(), walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
for (let n = walk.nextNode(); n; n = walk.nextNode()) {
  const e = n.parentElement;
  if (!n.textContent.trim() || !e.checkVisibility() || e.closest('script, style, title, .vh, sub, sup, math, .skip')) continue;
  const scale = e.ownerSVGElement ? Math.hypot(e.getScreenCTM().a, e.getScreenCTM().b) : 1;
  out.set(`${e.tagName} ${n.textContent.trim().slice(0, 30)}`, 0.75 * scale * parseFloat(getComputedStyle(e).fontSize));
}
return [...out].sort((a, b) => a[1] - b[1]).slice(0, 5);"""
"""Texts with their size on paper [pt], the smallest first."""


def filled(pdf: Path) -> list[float]:
    """Return of every sheet the part of its height down to its last mark; heads and feet are left out."""
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed (extra test)")
    out = []
    for sheet in pdfium.PdfDocument(pdf):
        grey = np.asarray(sheet.render(scale=0.5, grayscale=True).to_numpy()).squeeze()
        high = grey.shape[0]
        rows = np.flatnonzero((grey[int(0.062 * high) : int(0.945 * high)] < 250).any(axis=1))
        out.append(float(rows.max() / (0.883 * high)) if rows.size else 0.0)
    return out


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
