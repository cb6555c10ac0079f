"""Write the outputs of a page of docs anew, from what its commands print today.

Run it as ``python scripts/renew_page.py docs/your-box.md`` after a change of the model of error. The page is worked through as its test
does. In each block of figures a line keeps its words and takes today's numbers; a line whose words are gone is reported, and stays.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from docs.pages import NUMBER, ROOT, Block, same_line
from docs.workshop import Workshop


class Renewal(Workshop):
    """A workshop that takes down today's lines of each block of figures."""

    def figures(self, block: Block, place: str) -> None:
        """Take down the lines of a block with the numbers that are printed now."""
        left, out = [line for line in self.said.splitlines() if line.strip()], []
        for line in block.text.splitlines():
            plain = NUMBER.sub("#", line)
            now = next((k for k, each in enumerate(left) if same_line(plain, NUMBER.sub("#", each))), None)
            if line.strip() not in ("", "...") and now is None:
                print(f"{place}: no longer printed: {line.strip()}", file=sys.stderr)
            numbers = iter(NUMBER.findall(left[now]) if now is not None else NUMBER.findall(line))
            out.append(NUMBER.sub(lambda _, numbers=numbers: next(numbers), line))
            left = left if now is None else left[now + 1 :]
        self.names.setdefault("renewed", []).append((block.line, out))


def main() -> int:
    """Renew one page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("page", help="page below docs")
    given = parser.parse_args()
    page = ROOT / given.page
    with tempfile.TemporaryDirectory() as folder:
        shop = Renewal.of(given.page, Path(folder) / "work")
        shop.work(set())
    lines = page.read_text(encoding="utf-8").splitlines()
    for first, block in shop.names.get("renewed", []):
        lines[first - 1 : first - 1 + len(block)] = block
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
