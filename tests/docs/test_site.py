"""The documentation site: its pages as they are written; in the campaign built strictly, complete, whole without any other host."""

from __future__ import annotations

import json
import os
import pkgutil
import re
import shlex
import subprocess
import sys
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
import typer

import thermid as td
from thermid.app.cli import app as cli

from .hooks import commands, gallery, mathml, notebooks, rooms, turned, virtual_pages
from .pages import DESIGN, PAGES, ROOT, headings, tables

ASKED = {
    "link": "href",
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
    "object": "data",
    "form": "action",
}
"""Element -> attribute by which a browser asks for something without being told to."""


class Found(HTMLParser):
    """What a page asks for, its anchors, its links and its headings."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.asked: list[str] = []
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.headings: list[int] = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if (target := given.get(ASKED.get(tag, ""))) and given.get("rel") != "canonical":
            self.asked.append(target)
        if tag == "a" and given.get("href"):
            self.links.append(str(given["href"]))
        if given.get("id"):
            self.anchors.add(str(given["id"]))
        if re.fullmatch(r"h[1-6]", tag):
            self.headings.append(int(tag[1]))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for module in ("mkdocs", "material", "mkdocstrings"):
        pytest.importorskip(module, reason=f"{module} is not installed (extra docs)")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(
        command,
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "THERMID_DOCS_PICTURES": "0"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "WARNING" not in done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[str, Found]:
    return {str(path.relative_to(site)): Found(path) for path in sorted(site.rglob("*.html"))}


@pytest.mark.campaign
def test_the_site_shows_the_product(site: Path, pages: dict[str, Found]) -> None:
    def pictures(page: str) -> list[str]:
        return [a for a in pages[page].asked if a.rpartition(".")[2] in ("svg", "png") and "pictures/" in a]

    assert len(pictures("index.html")) >= 3
    assert len(pictures("gallery.html")) >= 12
    assert len(pictures("studio.html")) >= 6
    assert len(notebooks.notebooks()) >= 6


def test_pages_begin_with_one_title_and_no_heading_is_skipped() -> None:
    """As they are written and as the hooks write them; those of the built site in the campaign."""
    written = {page: (ROOT / page).read_text(encoding="utf-8") for page in [*PAGES, *DESIGN] if page.startswith("docs/")}
    for name, text in {**written, **virtual_pages()}.items():
        depths = [depth for depth, _ in headings(text)]
        assert (depths[0], depths.count(1)) == (1, 1), name
        assert all(b <= a + 1 for a, b in pairwise(depths)), f"{name}: {depths}"


def test_public_names_of_the_reference_are_there_by_the_path_that_it_asks() -> None:
    """Every one is on a page; the strict build of the site in the campaign shows that each is rendered."""
    text = "\n".join(text for page, text in virtual_pages().items() if page.startswith("reference/"))
    asked = re.findall(r"^::: thermid\.(\S+)$", text, re.MULTILINE)
    assert {path.rpartition(".")[2] for path in asked} >= set(td._PUBLIC)
    for path in asked:
        pkgutil.resolve_name(f"thermid.{path}")


def test_commands_of_the_gallery_are_understood() -> None:
    """Their pictures are drawn in the campaign, with the whole site in a browser."""
    group = typer.main.get_command(cli.app)
    for card in gallery.GALLERY.values():
        word, *given = shlex.split(card.command)
        group.commands[word].make_context(word, [*given, "--to" if card.figure else card.option, "picture.svg"])  # type: ignore[attr-defined]
        assert all((ROOT / path).is_file() for path in given if "/" in path and "/logs/" not in path), card.title


@pytest.mark.campaign
def test_a_howto_is_found_before_everything_else(site: Path) -> None:
    """The index weighs how-tos, and pages of the design less than others; the site in a browser answers to words (test_site_browser)."""
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))["docs"]
    assert {d["boost"] for d in index if d["location"].startswith("design/")} == {0.5}
    assert {d["boost"] for d in index if d["location"].startswith("howto/")} == {4}
    assert {d.get("boost", 1) for d in index if d["location"].startswith("tutorial")} == {1}


@pytest.mark.campaign
def test_every_public_name_is_in_the_reference(site: Path, pages: dict[str, Found]) -> None:
    by_room = rooms()
    assert sorted(name for names in by_room.values() for name in names) == sorted(td._PUBLIC)
    for room, names in by_room.items():
        anchors = pages[f"reference/{room}.html"].anchors
        assert [
            name for name in names if not anchors & {f"thermid.{name}", f"thermid.{td._PUBLIC[name]}.{name}", f"thermid.base.errors.{name}"}
        ] == []


@pytest.mark.campaign
def test_no_page_asks_another_host(site: Path, pages: dict[str, Found]) -> None:
    for name, page in pages.items():
        assert [target for target in page.asked if re.match(r"(?:\w+:)?//", target)] == [], name
    for style in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import)\s*[\"']?(?:\w+:)?//[^)\"']*", style.read_text(encoding="utf-8")) == [], style


@pytest.mark.campaign
def test_links_of_the_site_lead_somewhere(site: Path, pages: dict[str, Found]) -> None:
    for name, page in pages.items():
        if name == "404.html":  # its links are those of a server's root
            continue
        for target in page.links + page.asked:
            path, _, anchor = target.partition("#")
            if re.match(r"\w+:|//", path):
                continue
            found = (site / name).parent.joinpath(path).resolve() if path and path != "." else site / name
            found = found / "index.html" if found.is_dir() else found
            assert found.is_file(), f"{name}: {target}"
            if anchor and found.suffix == ".html" and not anchor.startswith("__"):
                assert anchor in pages[str(found.relative_to(site))].anchors, f"{name}: {target}"


@pytest.mark.campaign
def test_headings_are_in_order(pages: dict[str, Found]) -> None:
    for name, page in pages.items():
        if name == "404.html":
            continue
        assert page.headings.count(1) == 1, name
        assert page.headings[0] == 1, name
        assert all(b <= a + 1 for a, b in zip(page.headings, page.headings[1:], strict=False)), f"{name}: {page.headings}"


def test_the_command_page_says_what_help_says() -> None:
    group = typer.main.get_command(cli.app)
    shown = tables(commands())
    for name, command in group.commands.items():  # type: ignore[attr-defined]
        context = command.make_context(name, [], resilient_parsing=True)
        helped = context.command.get_help(context)
        options = set(re.findall(r"^ +(--[\w-]+)", helped, re.MULTILINE)) - {"--help"}
        rows = {word.rstrip(",") for row in shown[name] for word in row[0].strip("`").split(" ")}  # an option may have two names
        assert options <= rows, name


def test_a_page_is_turned_for_the_site() -> None:
    text = "[a](docs/files.md#deck), [b](examples), [c](#here)\n\n```toml deck a.toml\n[x](examples)\n```\n"
    wanted = '[a](files.md#deck), b, [c](#here)\n\n```toml title="a.toml"\n[x](examples)\n```\n'
    assert turned(text, "contributing.md") == wanted
    assert turned("![p](../benchmarks/results/B3.png)", "benchmarks.md") == "![p](project/benchmarks/results/B3.png)"


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("q = h*A", "<mi>q</mi><mo>=</mo>"),
        ("a/b", "<mfrac>"),
        ("(a + b)**2", "<mo>(</mo>"),
        ("Nu_L", "<msub><mi>Nu</mi><mi>L</mi></msub>"),
        ("5.67e-8", "<mn>10</mn><mn>-8</mn>"),
        ("T**(1/4)", "<mn>1</mn><mo>/</mo><mn>4</mn>"),
        ("a - (b - c)", "<mo>(</mo>"),
    ],
)
def test_a_formula_is_mathml(written: str, shown: str) -> None:
    assert shown in mathml(written)


def test_what_is_no_formula_is_refused() -> None:
    with pytest.raises(ValueError, match="arithmetic on names"):
        mathml("a[0]")
