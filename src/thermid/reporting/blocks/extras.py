"""What the report needs beyond thermid itself, and what is said where it is missing."""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from thermid.errors import ThermidError
from thermid.files import PAGE, write_text
from thermid.reporting.blocks.cells import typeset

if TYPE_CHECKING:
    from jinja2 import Template


class MissingExtraError(ThermidError):
    """An optional package is not installed; the message says which command installs it."""


@contextmanager
def extra() -> Iterator[None]:
    """Turn a failed import inside the block into words.

    Raises
    ------
    MissingExtraError   When matplotlib or jinja2 cannot be imported.
    """
    try:
        yield
    except ImportError as error:
        what = (error.name or "a package").partition(".")[0]
        raise MissingExtraError(f"a report needs {what}, which is not installed. Install it with: pip install thermid[report]") from error


@dataclass(frozen=True)
class Script:
    """The one script that a page runs: its text, and what the page's policy permits, which is this text and no other."""

    text: str
    permit: str


def page_template(name: str) -> Template:
    """Return a template of this folder; every text that goes in is escaped.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    with extra():
        from jinja2 import Environment, FunctionLoader, StrictUndefined
        from markupsafe import Markup, escape

    def finished(value: object) -> object:
        return typeset(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    loader = FunctionLoader(_asset)
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=finished
    )
    environment.filters["parted"] = lambda text: Markup(
        re.sub(r"([._/])(?=\w)", r"\1<wbr>", str(escape(typeset(text))))
    )  # where a name may break
    environment.filters["css_text"] = lambda text: Markup(css_text(str(text)))
    environment.globals["style"] = Markup(environment.get_template("page.css.jinja").render())
    text = _asset("page.js")
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    environment.globals["script"] = Script(Markup(text), f"'sha256-{digest}'")
    return environment.get_template(name)


def write_page(name: str, to: str | os.PathLike[str], **values: object) -> Path:
    """Fill a template of this folder, write the page, and return its path; its folder is made where it is missing.

    Raises
    ------
    MissingExtraError   When jinja2 is not installed.
    """
    content = page_template(name).render(**values)
    target = Path(to)
    target.parent.mkdir(parents=True, exist_ok=True)
    return write_text(target, content, PAGE)


def css_text(text: str) -> str:
    """Return a text as a string of a style sheet, in which nothing but letters, digits and spaces stands for itself."""
    return '"' + "".join(c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in text) + '"'


def _asset(name: str) -> str:
    from importlib.resources import files

    return files("thermid.reporting.blocks").joinpath(name).read_text(encoding="utf-8")
