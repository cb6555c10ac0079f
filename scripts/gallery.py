"""Pictures of the site's gallery and of the README, made by the commands that stand beside them.

``python scripts/gallery.py docs/readme.svg`` writes the picture of the README.
"""

from __future__ import annotations

import contextlib
import io
import re
import runpy
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REPORT = "report examples/04_campaign/campaign.toml --for summary"


@dataclass(frozen=True)
class Card:
    """One picture: its title, a line about it, the arguments of `thermid`, the option that names the picture, and its place in a page.

    `figure` is the key of a figure of the page that the command writes; empty where the command writes the picture itself.
    """

    title: str
    line: str
    command: str
    option: str = "--to"
    figure: str = ""


GALLERY = {
    "accelerometer": Card("One part", "A mass, its heater, one path to the room.", "diagram examples/01_accelerometer/accelerometer.toml"),
    "stack": Card(
        "Two parts stacked", "The contact takes area from both; the gap beside it loses heat.", "diagram examples/02_stack/m_PrE.toml"
    ),
    "unit": Card("A unit of units", "Submodels folded to one mass each.", "diagram examples/sisnav/m_Sd.toml --fold imu --fold pre"),
    "box": Card("A box on one page", "Every node once, parts as cards.", "diagram examples/box/box.toml"),
    "pad": Card("On the launch pad", "Sun, sky, wind and a stream of air.", "diagram examples/07_pad/cabinet.toml"),
    "motor": Card("A motor", "Public measurements: windings, stator, case.", "diagram examples/motor/motor.toml"),
    "tclab": Card("Two heaters on a board", "Public measurements: the board with both heaters.", "diagram examples/tclab/board.toml"),
    "gyro": Card(
        "A power that nobody logged", "The gyro whose power is found from its temperatures.", "diagram examples/unknown_power/gyro.toml"
    ),
    "log": Card(
        "A log, looked at", "Columns, units, clock and faults before any fit.", "look examples/04_campaign/logs/stack_bench.csv", "--svg"
    ),
    "cycle": Card(
        "A standard's cycles",
        "Each dwell waits for the unit; the levels are those of the standard.",
        "profile SMC-S-016 'unit thermal cycle' --level acceptance --on examples/sisnav/m_Sd.toml --chamber cv",
        "--picture",
    ),
    "decides": Card("The figure that decides", "The held-out sensor that takes most of its limit.", REPORT, figure="fig-decides"),
    "network": Card("The coloured network", "Temperatures by colour, heat flows by width.", REPORT, figure="fig-network"),
    "matrix": Card("Error over limit", "Tests by sensors, at one look.", REPORT, figure="fig-matrix"),
    "scatter": Card("Predicted against measured", "Lines at 2, 3 and 5 K.", REPORT, figure="fig-scatter"),
    "histogram": Card("What is left over", "All residuals of the held-out records.", REPORT, figure="fig-histogram"),
}
"""Name of a picture -> its card."""
BLANK = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'
"""What stands in place of a picture where none is drawn."""


@contextlib.contextmanager
def bench() -> Iterator[Path]:
    """Yield a folder with the examples and their logs, as a reader has them after the first lines of the README."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        shutil.copytree(ROOT / "examples", folder / "examples", ignore=shutil.ignore_patterns("results", "__pycache__"))
        with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
            arguments, sys.argv = sys.argv, ["make_logs.py"]
            try:
                runpy.run_path("examples/04_campaign/make_logs.py", run_name="__main__")
            finally:
                sys.argv = arguments
        yield folder


def ran(arguments: list[str], folder: Path) -> None:
    """Run a command in a folder, quietly.

    Raises
    ------
    RuntimeError   When it does not end well.
    """
    from thermid.app.cli.app import main

    kept, sys.argv = sys.argv, ["thermid", *arguments]
    told = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        try:
            main()
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"thermid {' '.join(arguments)} ended with {end.code}: {told.getvalue()[-400:]}") from end
        finally:
            sys.argv = kept


def drawn() -> dict[str, str]:
    """Return every picture of the gallery by its name."""
    import shlex

    out: dict[str, str] = {}
    with bench() as folder:
        pages: dict[str, str] = {}
        for name, card in GALLERY.items():
            if not card.figure:
                ran([*shlex.split(card.command), card.option, f"{name}.svg"], folder)
                out[name] = (folder / f"{name}.svg").read_text(encoding="utf-8")
                continue
            if card.command not in pages:
                ran([*shlex.split(card.command), "--to", "page.html"], folder)
                pages[card.command] = (folder / "page.html").read_text(encoding="utf-8")
            out[name] = standing(pages[card.command], card.figure)
    return out


def standing(page: str, figure: str) -> str:
    """Return a figure of a page as a picture that stands by itself, on white."""
    whole = re.search(rf'<figure id="{figure}".*?(<svg class="plot.*?</svg>)', page, re.DOTALL)
    if whole is None:
        raise RuntimeError(f"the page has no figure '{figure}'")
    head = '<svg xmlns="http://www.w3.org/2000/svg" font-family="system-ui,sans-serif" '
    markup = whole[1].replace("<svg ", head, 1)
    wide, high = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', markup).groups()  # type: ignore[union-attr]
    markup = markup.replace("viewBox=", f'width="{wide}" height="{high}" viewBox=', 1)
    return markup.replace(">", '><rect width="100%" height="100%" style="fill:#fff"/>', 1)


def page() -> str:
    """Return the page of the gallery."""
    parts = [
        "# Gallery",
        "Each picture is made by the command below it when these pages are built, from the files in `examples`. The "
        "commands of reports need the logs of `python examples/04_campaign/make_logs.py` first.",
        '<div class="cards" markdown>',
    ]
    for name, card in GALLERY.items():
        to = "page.html" if card.figure else f"{name}.svg"
        option = "--to" if card.figure else card.option
        parts.append(
            f'<div class="card" markdown>\n\n![{card.title}: {card.line}](pictures/gallery/{name}.svg)\n\n**{card.title}.** {card.line}\n\n'
            f"```sh\nthermid {card.command} {option} {to}\n```\n\n</div>"
        )
    return "\n\n".join([*parts, "</div>"]) + "\n"


def readme() -> str:
    """Return the picture of the README: the figure that decides above the coloured network."""
    with bench() as folder:
        ran([*REPORT.split(), "--to", "page.html"], folder)
        text = (folder / "page.html").read_text(encoding="utf-8")
    top, y = [], 0.0
    for figure in ("fig-decides", "fig-network"):
        markup = standing(text, figure)
        high = float(re.search(r'height="([\d.]+)"', markup)[1])  # type: ignore[index]
        top.append(markup.replace("<svg ", f'<svg y="{y:g}" ', 1))
        y += high + 8.0
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 620 {y:g}" width="620" height="{y:g}">{"".join(top)}</svg>\n'


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(readme(), encoding="utf-8")
