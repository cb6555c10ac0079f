"""Draw messages of the code and sentences of the guides at random, for a test with readers: `draw_messages.py --seed 7`.

A message is a text of at least seven words outside docstrings and help texts; places that the code fills in are shown as {expression}.
The same seed draws the same texts from the same state of the sources.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "docs"))

from messages import WORDS, messages

GUIDES = ("docs/*.md", "docs/howto/*.md", "docs/from/*.md", "docs/studies/*.md")
NOT_GUIDES = {"benchmarks.md", "coverage.md", "mutants.md", "nomenclature.md", "recipes.md", "schema.md"}


def all_messages() -> list[dict[str, object]]:
    """Every message of the sources, by file and line."""
    files = sorted((ROOT / "src" / "thermid").rglob("*.py"))
    return [{"file": str(p.relative_to(ROOT)), "line": line, "text": text} for p in files for line, text in sorted(messages(p))]


def sentences(path: Path) -> Iterator[str]:
    """Whole sentences of the paragraphs of a page; no headings, tables, lists or code."""
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    for block in re.split(r"\n\s*\n", text):
        if not re.match(r"\s*([#|>!<]|[-*] |\d+\. )", block):
            for sentence in re.split(r"(?<=[.?!])\s+(?=[A-Z`])", " ".join(block.split())):
                if len(sentence.split()) >= WORDS and sentence[-1] in ".?!":
                    yield sentence


def all_sentences() -> list[dict[str, object]]:
    """Every sentence of the guides, by page."""
    pages = sorted({p for pattern in GUIDES for p in ROOT.glob(pattern) if p.name not in NOT_GUIDES})
    return [{"file": str(p.relative_to(ROOT)), "text": s} for p in pages for s in sentences(p)]


def main() -> None:
    """Print what was drawn, as JSON."""
    parser = argparse.ArgumentParser(description="Draw messages of the code and sentences of the guides at random.")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--messages", type=int, default=40)
    parser.add_argument("--sentences", type=int, default=20)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    drawn = chance.sample(all_messages(), arguments.messages), chance.sample(all_sentences(), arguments.sentences)
    print(json.dumps({"seed": arguments.seed, "messages": drawn[0], "sentences": drawn[1]}, indent=1))


if __name__ == "__main__":
    main()
