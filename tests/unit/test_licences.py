"""What a wheel needs is free of the GPL: licences of all that the requirements bring along, as their packages state them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

import pytest

packaging = pytest.importorskip("packaging.requirements")

ROOT = Path(__file__).parents[2]
PERMISSIVE = r"\b(MIT|BSD|0BSD|Apache|ISC|PSF|Python Software Foundation|Zlib|Unlicense|MPL|Mozilla Public License|HPND|CC0)\b"
FORBIDDEN = r"\b[AL]?GPL|General Public License|Affero"
LESSER = r"\bLGPL[\w.-]*|Lesser General Public License"
"""Allowed of what an extra brings and a user may replace; of what every wheel needs it is not."""


def stated(package: Distribution) -> str:
    """Return what a package says of its licence, the shortest statement that there is."""
    about = package.metadata
    kinds = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or () if c.startswith("License ::")]
    free = (about.get("License") or "").strip().partition("\n")[0][:80]
    return about.get("License-Expression") or "; ".join(kinds) or free


def needed(name: str, extras: frozenset[str] = frozenset(), known: set[tuple[str, frozenset[str]]] | None = None) -> Iterator[Distribution]:
    """Yield the packages that a requirement brings along on this machine."""
    known = set() if known is None else known
    if (name.lower(), extras) in known:
        return
    known.add((name.lower(), extras))
    package = distribution(name)
    yield package
    for text in package.requires or ():
        wanted = packaging.Requirement(text)
        if wanted.marker is None or any(wanted.marker.evaluate({"extra": extra}) for extra in extras or {""}):
            yield from needed(wanted.name, frozenset(wanted.extras), known)


def licences(requirements: list[str]) -> dict[str, str]:
    """Return package -> licence of all that some requirements bring along."""
    out: dict[str, str] = {}
    for text in requirements:
        wanted = packaging.Requirement(text)
        if wanted.marker is None or wanted.marker.evaluate():
            out |= {p.metadata["Name"]: stated(p) for p in needed(wanted.name, frozenset(wanted.extras))}
    return out


def test_a_wheel_needs_nothing_under_the_gpl() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found = licences(project["dependencies"])
    assert len(found) >= len(project["dependencies"]) >= 3
    wrong = {name: said for name, said in found.items() if re.search(FORBIDDEN, said) or not re.search(PERMISSIVE, said)}
    assert not wrong, f"licences of what a wheel needs: {found}"
    for extra, several in project["optional-dependencies"].items():
        for text in several:
            try:
                held = licences([text])
            except PackageNotFoundError:  # this extra is not installed here
                continue
            assert not {n: s for n, s in held.items() if re.search(FORBIDDEN, re.sub(LESSER, "", s))}, extra


@pytest.mark.parametrize("said", ["GPL-3.0-or-later", "GNU General Public License v3 (GPLv3)", "AGPL-3.0", "LGPL-2.1-only", "GNU Affero"])
def test_the_gpl_is_recognised(said: str) -> None:
    assert re.search(FORBIDDEN, said)
