"""Maps as a browser draws them: no text over another, none cut off, letters of nine pixels or more."""

from __future__ import annotations

from pathlib import Path

import pytest

from boards import boards, warmed
from thermid.reporting.diagrams import network_map

from .browser import Page, needed

pytestmark = pytest.mark.campaign
TEXTS = """
const page = document.querySelector('svg').getBoundingClientRect();
const all = [...document.querySelectorAll('svg text')].map((t) => [t, t.getBoundingClientRect()]);
const found = [];
for (const [t, r] of all) {
  if (r.left < page.left - 0.5 || r.right > page.right + 0.5 || r.bottom > page.bottom + 0.5 || r.top < page.top - 0.5) found.push(['cut', t.textContent]);
  if (parseFloat(getComputedStyle(t).fontSize) < 9) found.push(['small', t.textContent]);
}
const ink = (r) => [r.left, r.top + 0.2 * r.height, r.right, r.bottom - 0.2 * r.height];  // of a box of letters, what is never empty
for (let i = 0; i < all.length; i += 1) for (let j = 0; j < i; j += 1) {
  const a = ink(all[i][1]), b = ink(all[j][1]);
  if (Math.min(a[2], b[2]) - Math.max(a[0], b[0]) > 0.5 && Math.min(a[3], b[3]) - Math.max(a[1], b[1]) > 0.5) found.push([all[j][0].textContent, all[i][0].textContent]);
}
for (const card of document.querySelectorAll('svg rect.card')) {
  const c = card.getBoundingClientRect();
  for (const [t, r] of all) if (r.top >= c.top && r.bottom <= c.bottom && r.left >= c.left && r.left < c.right && r.right > c.right) found.push(['out of its card', t.textContent]);
}
return [all.length, found];"""  # noqa: E501


def test_no_text_lies_over_another(tmp_path: Path) -> None:
    """Plain, and with temperatures and heat: five sizes and thirty random boards."""
    needed()
    shown = Page("about:blank")
    try:
        for k, model in enumerate(boards(30)):
            for told in ({}, warmed(model)):
                file = tmp_path / f"{k}.svg"
                file.write_text(network_map(model, **told), encoding="utf-8")
                shown.driver.get(file.as_uri())
                count, found = shown.run(TEXTS)
                assert count > 4
                assert found == [], model.title
    finally:
        shown.close()
