"""What the documentation site has beside the pages of docs/: mkdocs calls the functions `on_...` of this file (see mkdocs.yml).

Pages of the reference, of the command line and the list of the design are written from the code; changes and contributing come
from the root; pictures are made by the product's commands; fences say their file's name; formulas become MathML; links to
files of the repository lead there.
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import re
import sys
import tempfile
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import thermid as td
from thermid import errors

sys.path.append(str(Path(__file__).parent))

import fold_decisions
import gallery
import notebooks
import studio_pictures
from formulas import mathml

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parent.parent
ROOT_PAGES = {"changelog.md": "CHANGELOG.md", "contributing.md": "CONTRIBUTING.md"}
"""Page of the site -> file at the root of the repository."""

ROOMS = {
    "base": "Values with their unit, as they enter from Python.",
    "model": "The hardware: parts, decks, areas, laws.",
    "simulation": "The equations of a model, conditions of a run, and its results.",
    "site": "Sites on the ground, ascents, orbits, weather, moisture; an optional part.",
    "measure": "Logs, their channels and sensors.",
    "values": "Knowledge of values: their standing, and their uncertainty by source.",
    "fit": "Fits, clocks, unmeasured powers, states with process noise.",
    "inference": "Identifiability, profile likelihood, parameter trade-offs, posterior samples; causes of a misfit, physical values.",
    "prediction": "Uncertainty of a prediction by source; predictions before a test; many runs; hold times; the next test; reduced models.",
    "campaign": "Fits in stages, replaced parts, methodologies; verdicts, correlation, limits, margins, comparisons.",
    "qualify": "Test profiles, running tests, plans, their verdicts, deliveries.",
    "reporting": "Reports and pictures.",
    "physics": "The comparison of a measured coefficient with correlations.",
    "interop": "Import of parameters from other tools, export of models.",
}
"""Room -> what is in it; the package's folders, in reading order."""

PICTURES = {
    "pictures/stack.svg": ("", "diagram", "examples/02_stack/m_PrE.toml"),
    "pictures/cabinet.svg": ("docs/streams.md", "diagram", "cabinet.toml"),
    "pictures/box.svg": ("docs/tutorial.md", "diagram", "box.toml"),
    "pictures/map.svg": ("", "diagram", "examples/box/box.toml"),
    "pictures/board.svg": ("docs/elements.md", "diagram", "board.toml"),
    "pictures/cooler.svg": ("docs/elements.md", "diagram", "cooler.toml"),
    "pictures/mount.svg": ("docs/elements.md", "diagram", "mount.toml"),
}
"""Picture -> the page whose files are at hand, if any, and the arguments of `thermid` that make it, before `--to`."""

MADE = {*PICTURES, *(f"pictures/gallery/{name}.svg" for name in gallery.GALLERY), *studio_pictures.names()}
"""Every picture of the site that no file of the repository holds, but those of the notebooks."""

FENCE = re.compile(r"^```(\w+)((?: +\S+)*) *$", re.MULTILINE)
DECK = re.compile(r"^```(?:toml deck|csv file) (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"^```formula *(\S*).*?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
SHOWN = (".md", ".png", ".svg", ".toml", ".csv")


def virtual_pages() -> dict[str, str]:
    """Return the pages that no file holds: path in the site -> Markdown."""
    pages = {f"reference/{room}.md": reference(room) for room in ROOMS}
    pages["reference/errors.md"] = _errors()
    pages["commands.md"] = commands()
    pages["design/index.md"] = design()
    pages["gallery.md"] = gallery.page()
    pages["notebooks/index.md"] = notebooks.contents()
    pages |= {f"notebooks/{name}.md": notebooks.plain(path) for name, path in notebooks.notebooks().items()}
    return pages | {name: (ROOT / file).read_text(encoding="utf-8") for name, file in ROOT_PAGES.items()}


def rooms() -> dict[str, list[str]]:
    """Return the public names by room, in the order of the package."""
    found: dict[str, list[str]] = {room: [] for room in [*ROOMS, "errors"]}
    for name, module in td._PUBLIC.items():
        found["errors" if module == "base.errors" else module.partition(".")[0]].append(name)
    return found


def reference(room: str) -> str:
    """Return the page of a room: every public name of it."""
    names = "\n\n".join(f"::: thermid.{name if name in td._TOP else f'{td._PUBLIC[name]}.{name}'}" for name in rooms()[room])
    return f"# {room.replace('_', ' ').title()}\n\n{ROOMS[room]} `import thermid as td`, then `td.<name>`.\n\n{names}\n"


def _errors() -> str:
    head = "Every error is a `ThermidError`. It states what is wrong, where, and what to do. A command exits with the code of its class."
    made = [name for name, thing in vars(errors).items() if isinstance(thing, type) and thing.__module__ == errors.__name__]
    return "\n\n".join(["# Errors", head, *(f"::: thermid.base.errors.{name}" for name in made)]) + "\n"


def commands() -> str:
    """Return the page of the command line, from the commands themselves."""
    import typer

    from thermid.app.cli import app as cli

    group: Any = typer.main.get_command(cli.app)
    parts = [
        "# Command line",
        "Arguments and options of each command, as in `thermid COMMAND --help`. [Files and commands](files.md) has examples.",
    ]
    of = ""
    for name, command in group.commands.items():
        place = cli.COMMANDS[name]
        parts += [f"## {place.group}"] if place.group != of else []
        of = place.group
        context = command.make_context(name, [], resilient_parsing=True)
        command = context.command  # the summary of the table gives way to the command itself
        usage = context.get_usage().removeprefix("Usage: ")
        rows = [record for record in (one.get_help_record(context) for one in command.params) if record]
        lines = "\n".join(f"| `{words}` | {_clean(meaning)} |" for words, meaning in rows)
        table = f"| argument or option | meaning |\n|---|---|\n{lines}"
        shown = "\n".join(place.examples)
        parts += [f"### {name}", _clean(command.help or ""), f"```sh\nthermid {usage}\n```", f"```sh\n{shown}\n```", table]
    codes = "\n".join(f"| {code} | {meaning} |" for code, meaning in cli.EXITS.items())
    parts += ["## Exit codes", f"| exit code | meaning |\n|---|---|\n{codes}"]
    return "\n\n".join(parts) + "\n"


def _clean(text: str) -> str:
    """Return help text as one paragraph of Markdown."""
    return re.sub(r"([|<>*_\[\]])", r"\\\1", " ".join(text.split()))


def design() -> str:
    """Return the list of the pages of the design, each with its first sentence, and of the notes that they took up."""
    parts = ["# Design", "One page for each room and the kernel: what it is, why so, what was tried and dropped, and what would change it."]
    lines = []
    for path in sorted((ROOT / "docs/design").glob("*.md")):
        title, _, sentence = path.read_text(encoding="utf-8").split("\n\n")[:3]
        lines.append(f"- [{title.removeprefix('# ')}]({path.name}): {sentence.partition('. ')[0].removesuffix('.')}.")
    meaning = "Numbers in brackets are those of earlier notes. `git show COMMIT:docs/decisions/NAME.md` prints one."
    rows = fold_decisions.rows().items()
    notes = [f"| {number} | [{r['page']}]({r['page']}.md) | `{r['name']}` | `{r['commit']}` |" for number, r in rows]
    table = "\n".join(["| note | page | name | commit |", "|---|---|---|---|", *notes])
    return "\n\n".join([*parts, "\n".join(lines), "## Notes", meaning, table]) + "\n"


def draw(name: str, folder: Path) -> str:
    """Return a picture of the site, drawn by the command line."""
    from thermid.app.cli.app import main

    page, *command = PICTURES[name]
    for file, text in DECK.findall((ROOT / page).read_text(encoding="utf-8")) if page else ():
        (folder / file).write_text(text, encoding="utf-8")
    target = folder / Path(name).name
    with contextlib.chdir(folder if page else ROOT), contextlib.redirect_stdout(io.StringIO()):
        arguments, sys.argv = sys.argv, ["thermid", *command, "--to", str(target)]
        try:
            main()
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"{name}: thermid {' '.join(command)} ended with exit code {end.code}") from end
        finally:
            sys.argv = arguments
    return target.read_text(encoding="utf-8")


def file_of(page: str) -> PurePosixPath:
    """Return where a page of the site lies in the repository."""
    return PurePosixPath(ROOT_PAGES.get(page, f"docs/{page}"))


def place_of(file: PurePosixPath) -> str | None:
    """Return where a file of the repository lies in the site; None where it is not shown."""
    text = str(file)
    for page, root in ROOT_PAGES.items():
        if text == root:
            return page
    if text == "docs/design":
        return "design/index.md"
    if text == "README.md":
        return "index.md"
    if file.parts[0] == "docs" and "schema" not in file.parts:
        return str(file.relative_to("docs"))
    return f"project/{text}" if file.suffix in SHOWN else None


def _leads(page: str, target: str) -> str | None:
    """Return a link of a page as it must read in the site; None where what it leads to is not shown."""
    path, mark, anchor = target.partition("#")
    if "://" in target or not path:
        return target
    here = file_of(page) if not page.startswith("project/") else PurePosixPath(page.removeprefix("project/"))
    place = place_of(PurePosixPath(os.path.normpath(here.parent / path)))
    return None if place is None else os.path.relpath(place, PurePosixPath(page).parent) + mark + anchor


def outside(pages: dict[str, str]) -> set[str]:
    """Return the files of the repository beside docs/ to which pages lead."""
    found = set()
    for page, text in pages.items():
        here = file_of(page).parent
        for part in CODE.split(text)[::2]:
            for _, _, target in LINK.findall(part):
                file = PurePosixPath(os.path.normpath(here / target.partition("#")[0]))
                if "://" not in target and (place_of(file) or "").startswith("project/"):
                    found.add(str(file))
    return found


def on_startup(command: str, dirty: bool) -> None:
    """Let the garbage collector look at the syntax trees of the whole package, which all are kept, less often."""
    gc.set_threshold(100_000, 50, 100)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what docs/ does not hold."""
    from mkdocs.structure.files import File

    pages, shown = virtual_pages(), studio_pictures.wanted()
    for name, path in notebooks.notebooks().items() if shown else ():
        text, figures = notebooks.page(name, notebooks.executed(path))
        pages[f"notebooks/{name}.md"] = text
        for place, picture in figures.items():
            files.append(File.generated(config, f"notebooks/{place}", content=picture))
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for name, picture in (gallery.drawn() if shown else dict.fromkeys(gallery.GALLERY, gallery.BLANK)).items():
        files.append(File.generated(config, f"pictures/gallery/{name}.svg", content=picture))
    for name, data in studio_pictures.taken().items():
        files.append(File.generated(config, f"pictures/studio/{name}.png", content=data))
    with tempfile.TemporaryDirectory() as folder:
        for name in PICTURES:
            files.append(File.generated(config, name, content=draw(name, Path(folder))))
    written = {file.src_uri: file.content_string for file in files.documentation_pages() if file.src_uri not in pages}
    for name in sorted(outside(written | pages)):
        files.append(File.generated(config, f"project/{name}", abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn a page as the repository has it into one as the site has it; how-tos come first in its search."""
    place = page.file.src_uri
    if place.startswith("howto/"):
        page.meta["search"] = {"boost": 4}
    elif place.startswith(("design/", "changelog", "reference/")):
        page.meta["search"] = {"boost": 0.5}
    return turned(markdown, page.file.src_uri)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Leave blocks of code out of the search: one looks for words, and finds pages that explain them."""
    return re.sub(r'<div class="([^"]*\bhighlight\b[^"]*)">', r'<div class="\1" data-search-exclude>', html)


def turned(markdown: str, page: str) -> str:
    """Return a page with links, fences and formulas as the site needs them."""

    def link(found: re.Match[str]) -> str:
        leads = _leads(page, found[3])
        if leads is None:
            return found[2]
        return f"{found[1]}[{found[2]}]({leads})"

    text = "".join(part if k % 2 else LINK.sub(link, part) for k, part in enumerate(CODE.split(markdown)))
    text = FORMULA.sub(_formula, text)
    return FENCE.sub(_fence, text)


def _formula(found: re.Match[str]) -> str:
    """Return a formula, one line each, with the function that it documents."""
    shown = "".join(mathml(line) for line in found[2].splitlines() if line.strip())
    name = f"<code>thermid.physics.{found[1]}</code>" if found[1] else ""
    return f'<div class="formula"><div>{shown}</div>{name}</div>'


def _fence(found: re.Match[str]) -> str:
    """Say the name of the file that a block is, in the manner of the site."""
    language, words = found[1], found[2].split()
    file = next((word for word in words if "." in word or "/" in word), None)
    return f"```{language}" + (f' title="{file}"' if file else "")
