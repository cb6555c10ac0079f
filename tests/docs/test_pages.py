"""Every page is worked through: what it says of itself, its blocks, its links, its numbers."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import thermid as td

from .hooks import MADE as PICTURES, fold_decisions, virtual_pages
from .pages import DESIGN, PAGES, ROOT, Block, anchor, blocks, differences, headings, links, near, prose, tables
from .workshop import Shown, Workshop, missing

ELSEWHERE = {
    "docs/recipes.md": {
        f"{k}{part}"
        for k in ("", "metric-", "reader-", "role-", "prior-", "command-")
        for part in ("function", "line", "row", "test", "nomenclature", "guide")
    }
    | {
        "line-style",
        "example",
        "metric-size",
        "law-function",
        "law-row",
        "law-reference",
        "law-kind",
        "quick-check",
        "range",
        "prior-class",
        "prior-name",
    }
}
"""Second words of blocks that test_contributing.py runs."""
FOREIGN = {"pandas.read_csv", "repeat", "element.field"}
"""Words of the design that are no names here: of Python and other libraries; and what was not chosen, or stands for any name."""
PARTS = ["What it is", "Why so", "Tried and dropped", "What would change our mind"]
WORDS, ALL_WORDS, LINES = 700, 12_000, 60
"""Of a page of the design at most, of all of them together, and lines of the change log."""


@cache
def made() -> set[str]:
    """What the site makes beside the pages that are written."""
    return {*PICTURES, *virtual_pages()}


@pytest.mark.parametrize("page", PAGES)
def test_what_a_page_shows_happens(page: str, tmp_path: Path) -> None:
    Workshop.of(page, tmp_path).work(ELSEWHERE.get(page, set()))


@pytest.mark.parametrize("page", [*PAGES, *DESIGN])
def test_links_lead_somewhere(page: str) -> None:
    path = ROOT / page
    for target in links(path.read_text(encoding="utf-8")):
        assert "://" not in target, f"{page}: {target}"
        file, _, place = target.partition("#")
        found = (path.parent / file).resolve() if file else path
        if str(found).removeprefix(f"{ROOT / 'docs'}/") in made():  # by the site; test_site.py finds it there
            continue
        assert found.exists(), f"{page}: {target}"
        assert found.is_relative_to(ROOT), f"{page}: {target}"
        if place:
            assert place in {anchor(words) for _, words in headings(found.read_text(encoding="utf-8"))}, f"{page}: {target}"


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_one_screen(page: str) -> None:
    assert len((ROOT / page).read_text(encoding="utf-8").splitlines()) <= 80


def test_the_readme_says_what_it_must() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert {"demo", "test"} <= {word for word in re.findall(r"make ([a-z-]+)", text) if word in targets}
    assert set(re.findall(r"make ([a-z-]+)", text)) <= set(targets)
    python = next(b for b in blocks(text) if b.words == ("python",))
    code = [line for line in python.text.splitlines() if line.strip() and not line.strip().startswith("#")]
    assert len(code) <= 20
    commands = re.findall(r"^    (.*)$", prose(text), re.MULTILINE)
    assert commands == ["pip install '.[all]'", "thermid example sisnav && thermid report"]
    assert len(links(text)) <= 12
    assert "docs/your-box.md" in links(text)
    assert not re.search(r"examples/", python.text), "its Python runs in an empty folder"
    extras = set(re.findall(r"pip install '\.\[(\w+)\]'", text))
    assert all(f"\n{extra} = [" in (ROOT / "pyproject.toml").read_text(encoding="utf-8") for extra in extras)


def test_the_readme_is_right_about_the_refusal(tmp_path: Path) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shop = Workshop.of("README.md", tmp_path)
    shop.python(next(b for b in blocks(text) if b.words == ("python",)), "README.md")
    asked = re.search(r"`free=(\[.*?\])`, it refuses", text)
    assert asked
    record = td.read_record(tmp_path / "bench.csv", {"case": "CASE", "air": "AIR"}, **shop.names["errors"])
    with pytest.raises(td.ThermidError, match=r"only as a product \(known: .*area.* = 0\.02"):
        td.calibrate(shop.names["part"], record, free=ast.literal_eval(asked[1]))


def test_the_index_leads_to_every_page() -> None:
    """By task; recipes are for contributors."""
    text = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = {page.removeprefix("docs/") for page in PAGES if page.startswith("docs/")} - {"index.md", "recipes.md"}
    assert pages - set(links(text)) == set()


def test_every_number_of_the_readme_is_computed_or_a_name() -> None:
    """Numbers stand in blocks, which are run; in its prose there are only versions and names."""
    text = re.sub(r"Python 3\.11|BSD 3-Clause|`[^`]*`|make demo.*|make test.*", "", prose((ROOT / "README.md").read_text(encoding="utf-8")))
    assert re.findall(r"\d[\d.]*", text) == []


def test_the_change_log_is_one_entry_of_what_the_product_does() -> None:
    """A visible change is a line of it, or joins one."""
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert [words for depth, words in headings(text) if depth == 2] == [td.__version__]
    assert len(text.splitlines()) <= LINES
    entry = text.partition(f"\n## {td.__version__}\n")[2].split("\n")
    assert all(line.startswith(("- ", "### ")) for line in entry if line)


def test_every_room_has_a_page_of_its_design() -> None:
    rooms = {path.name for path in (ROOT / "src/thermid").iterdir() if path.is_dir() and path.name[0] != "_"}
    assert {Path(page).stem for page in DESIGN} == {*rooms, "kernel"}


def test_pages_of_the_design_are_short() -> None:
    words = {page: len((ROOT / page).read_text(encoding="utf-8").split()) for page in DESIGN}
    assert {page: count for page, count in words.items() if count > WORDS} == {}
    assert sum(words.values()) <= ALL_WORDS


@pytest.mark.parametrize("page", DESIGN)
def test_a_page_of_the_design_has_its_four_parts(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    (depth, title), *parts = headings(text)
    assert (depth, parts) == (1, [(2, part) for part in PARTS])
    assert title.startswith("Design of ")
    whole, *lists = re.split(r"^#+ .*$", text, flags=re.MULTILINE)[2:]
    assert len(whole.split()) >= 10
    for body in lists:
        points = [line for line in body.splitlines() if line]
        assert len(points) >= 3
        assert [line for line in points if not line.startswith("- ")] == []


def test_every_note_is_on_the_page_that_took_it() -> None:
    """Numbers are without gaps, and no note lies beside the pages: `python scripts/fold_decisions.py`."""
    table, pages = fold_decisions.rows(), fold_decisions.pages_by_number()
    assert {number: row["page"] for number, row in table.items()} == pages
    assert [*table] == [f"{k:03d}" for k in range(1, len(table) + 1)]
    assert all(row["name"].startswith(f"{number}-") and re.fullmatch(r"[0-9a-f]{12}", row["commit"]) for number, row in table.items())
    assert [*(ROOT / "docs/decisions").glob("*.md")] == []


def test_the_number_of_a_note_leads_to_its_page() -> None:
    table, apart = fold_decisions.rows(), []
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        for number, page in re.findall(r"\[(?:[Dd]ecision )?(\d{3})\]\([^)\s]*?([\w-]+)\.md", path.read_text(encoding="utf-8")):
            if table[number]["page"] != page:
                apart.append(f"{path.name}: {number} leads to {page}")
    assert apart == []


def test_every_decision_that_a_text_names_is_in_the_table() -> None:
    table = fold_decisions.rows()
    folders = ("src", "tests", "scripts", "benchmarks", "docs")
    texts = [p for folder in folders for p in (ROOT / folder).rglob("*.*") if p.suffix in (".py", ".md")]
    named = {number for path in texts for number in re.findall(r"\b[Dd]ecisions? (\d{3})\b", path.read_text(encoding="utf-8"))}
    assert len(named) > 5
    assert named - {*table} == set()


@pytest.mark.parametrize("page", [*PAGES, *DESIGN])
def test_numbers_of_decisions_are_links(page: str) -> None:
    broken = re.findall(r"\[\d{3}\](?!\(|:).{0,20}", prose((ROOT / page).read_text(encoding="utf-8")))
    assert not broken, f"{page}: a decision's number that links nowhere"


def test_links_follow_a_folded_note() -> None:
    table, folder = {"007": {"page": "model"}}, "decisions"  # apart, since the script reads this file too
    text = f"[007](docs/{folder}/007-a-b.md#why) [8](../{folder}/008-c.md) docs/{folder}/007-a-b.md, [d](docs/{folder})"
    wanted = f"[007](docs/design/model.md) [8](../{folder}/008-c.md) docs/design/model.md, [d](docs/design)"
    assert fold_decisions.relinked(text, table, among_notes=False) == wanted
    assert fold_decisions.relinked(wanted, table, among_notes=False) == wanted
    note, moved = "[7](007-a-b.md), [8](008-c.md)", "[7](../design/model.md), [8](008-c.md)"
    assert fold_decisions.relinked(note, table, among_notes=True) == moved


def test_code_named_in_the_design_exists() -> None:
    """Every word between backticks that looks like a name or a file of this project is one."""
    from .vocabulary import words_of_the_code

    source = ROOT / "src" / "thermid"
    known = words_of_the_code() | FOREIGN | {p.stem for p in source.rglob("*") if p.is_dir() or p.suffix == ".py"}
    strange = []
    for page in DESIGN:
        for word in re.findall(r"`([A-Za-z_][\w./-]*)`", (ROOT / page).read_text(encoding="utf-8")):
            parts = [p for p in word.split(".") if p not in ("td", "thermid")]
            if "/" in word:
                assert (ROOT / word).exists(), f"{page}: {word}"
            elif word not in known and not all(p in known for p in parts):
                strange.append(f"{page}: {word}")
    assert strange == [], "\n".join(strange)


def test_a_wrong_page_is_seen(tmp_path: Path) -> None:
    """The tests above can fail."""

    def worked(text: str) -> None:
        page = tmp_path / "page.md"
        page.write_text(text, encoding="utf-8")
        Workshop(str(page), tmp_path).work(set())

    worked("```python\nprint(1 / 3)\n```\n\n```text\n0.333\n```\n")
    worked("```sh\nthermid schema nonsense  # exit code 2\n```\n")
    for text, word in {
        "```python\nprint(1 / 3)\n```\n\n```text\n0.335\n```\n": "shown: 0.335",
        "```python\nprint(1)\nprint(2)\n```\n\n```text\n1\n```\n": "not shown: 2",
        "```toml\ntitle = 'x'\n```\n": "say what it is",
        "```toml deck\ntitle = 'x'\nneeeds = []\n```\n": "needs",
        "```toml deck\ntitle = 'x'\n[nodes]\na = {}\n```\n": "massless",
        "```sh\nthermid schema nonsense\n```\n": "exit code 2",
        "```sh\nmake supper\n```\n": "no \\['supper'\\]",
        "```sh\nrm x\n```\n": "nobody runs",
        "```formula lumped.steady_rise power=Q conductance=G\ndT = Q * G\n```\n": "steady_rise gives",
        "```perl\n1\n```\n": "nobody knows",
        '```python\nprint(\'{"a": {"b": 1.5}}\')\n```\n\n```json\n{"a": {"b": 1.7}}\n```\n': "shown as 1.7",
        '```python\nprint(\'{"a": {}}\')\n```\n\n```json\n{"a": {"b": 1}}\n```\n': "no .a.b",
    }.items():
        with pytest.raises(AssertionError, match=word):
            worked(text)


def test_numbers_are_compared_in_their_last_place() -> None:
    assert near("8.917", 8.91719)
    assert near("1.2e-05", 1.24e-05)
    assert not near("8.917", 8.9195)
    assert not list(differences("a\n...\nc 1.0", "a\nb\nb\nc 1.04\n"))
    assert list(differences("a\n...\nc 1.0", "a\nb\nc 1.2\n"))
    assert list(differences("a", "a\nb"))
    assert not list(missing({"a": [Shown("1.0")]}, {"a": [1.04, 2], "b": 1}))


def test_blocks_and_tables_are_found() -> None:
    text = "# A\n\n```toml deck x.toml\na = 1\n```\n\n## B c\n\n| k | m |\n|---|---|\n| `a` | one |\n"
    assert blocks(text) == [Block(("toml", "deck", "x.toml"), "a = 1\n", 4)]
    assert headings(text) == [(1, "A"), (2, "B c")]
    assert anchor("B c") == "b-c"
    assert tables(text) == {"B c": [["`a`", "one"]]}


def test_the_list_of_the_design_has_every_page_and_note() -> None:
    shown = virtual_pages()["design/index.md"]
    assert re.findall(r"^- \[Design of .*\]\((\w+)\.md\)", shown, re.MULTILINE) == [Path(page).stem for page in DESIGN]
    assert re.findall(r"^\| (\d{3}) ", shown, re.MULTILINE) == [*fold_decisions.rows()]
