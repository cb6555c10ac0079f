"""`page_to_pdf`: a page on paper, through the print of a browser that is installed. Nothing is asked of any network."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from thermid.arguments import takes_objects
from thermid.errors import ThermidError
from thermid.files import PAPER, may_write, scratch, write_bytes

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge", "msedge")
PLACES = ("/Applications/Google Chrome.app/Contents/MacOS/Google Chrome", "/Applications/Chromium.app/Contents/MacOS/Chromium")
QUIET = (
    "--headless",
    "--disable-gpu",
    "--disable-quic",
    "--disable-extensions",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--no-default-browser-check",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--no-pdf-header-footer",
    "--generate-pdf-document-outline",
)


class NoBrowserError(ThermidError):
    """There is no browser that can print a page, or it could not; the message says what to do."""


def browser() -> str:
    """Return the path of an installed Chromium, Chrome or Edge.

    Raises
    ------
    NoBrowserError   When there is none.
    """
    found = next((path for name in NAMES if (path := shutil.which(name))), None) or next((p for p in PLACES if Path(p).exists()), None)
    if found is None:
        raise NoBrowserError(
            "a PDF is printed by a browser, and neither Chromium nor Chrome nor Edge is installed. "
            "Install one of them, or open the page in the browser that you have and print it to a file."
        )
    return found


@takes_objects
def page_to_pdf(page: str | os.PathLike[str], to: str | os.PathLike[str], *, seconds: float = 120.0) -> Path:
    """Print a page into a PDF and return its path. The browser sees no network and leaves no profile behind.

    Parameters
    ----------
    page : path         A page as `report` and its kin write it.
    to : path           The file to write; its folder is made where it is missing.
    seconds : float     How long the browser may take. [s]

    Raises
    ------
    NoBrowserError   When no browser is installed, or when it made no PDF.
    """
    program, source, target = browser(), Path(page).resolve(strict=True), Path(to)
    target.parent.mkdir(parents=True, exist_ok=True)
    may_write(target, PAPER)
    with scratch() as folder:
        made = folder / "page.pdf"
        # the browser's sandbox does not run for root; the page's policy permits no script but its own
        root = ("--no-sandbox",) if getattr(os, "geteuid", lambda: 1)() == 0 else ()
        command = [program, *QUIET, *root, f"--user-data-dir={folder}/profile", f"--print-to-pdf={made}", source.as_uri()]
        home = {name: f"{folder}/{name}" for name in ("XDG_CONFIG_HOME", "XDG_CACHE_HOME")}
        try:
            run = subprocess.run(command, capture_output=True, timeout=seconds, env={**os.environ, **home}, check=False)
        except subprocess.TimeoutExpired:
            raise NoBrowserError(f"'{Path(program).name}' did not print '{source.name}' within {seconds:g} s.") from None
        printed = made.read_bytes() if made.exists() else b""
        if not printed.startswith(b"%PDF-"):
            said = run.stderr.decode(errors="replace").strip().splitlines()
            why = f" It said: {said[-1][:200]}" if said else ""
            raise NoBrowserError(f"'{Path(program).name}' made no PDF of '{source.name}'.{why}")
    return write_bytes(target, printed, PAPER)
