"""What the report needs beyond thermid itself, and what is said where it is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from thermid.errors import ThermidError

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = ["MissingExtraError", "extra", "page_template"]


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


def page_template(name: str) -> Template:
    """Return a template of this folder; every text that goes in is escaped.

    Raises
    ------
    MissingExtraError   When jinja2 or matplotlib is not installed; a page without figures is no report, so it is said first.
    """
    from importlib.resources import files

    with extra():
        import matplotlib  # noqa: F401
        from jinja2 import Environment, FunctionLoader, StrictUndefined

    folder = files("thermid.reporting")
    loader = FunctionLoader(lambda wanted: folder.joinpath(wanted).read_text(encoding="utf-8"))
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.get_template(name)
