"""Materials by name, each with its source: first guesses, not truths. Emissivities are in `finishes`.

A model should take its values from a certificate or a fit; these are where a fit starts. The table is `materials.toml` beside this file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, reduce
from pathlib import Path
from types import MappingProxyType

from thermid.base.errors import NameNotFoundError, nearest
from thermid.base.files import parse_toml, read_text


@dataclass(frozen=True)
class Material:
    """One material near 300 K.

    Parameters
    ----------
    name : str              As in the table.
    density : float         Density. [kg/m^3]
    specific_heat : float   Specific heat. [J/(kg K)]
    conductivity : float    Conductivity. [W/(m K)]
    source : str            Where the values are from, with table or page.
    range : dict            Specific heat and conductivity -> share of the value within which 95 % of parts lie. [-]
    read : str              What was read to check the row.
    diffusivity : float     As its source prints it; None where it does not. [m^2/s]
    over : dict             'temperature' [K] and the properties at these temperatures, where they change much near 300 K.
    """

    name: str
    density: float
    specific_heat: float
    conductivity: float
    source: str
    range: Mapping[str, float]
    read: str
    diffusivity: float | None = None
    over: Mapping[str, Sequence[float]] = field(default_factory=dict)

    @property
    def basis(self) -> str:
        """Text of the source of its values, as a deck quotes it."""
        return f"catalogue: {self.name}; {self.source}; {self.read}"

    @staticmethod
    def named(name: str) -> Material:
        """Properties of the material of that name, or of the only one that has all its words: 'AL6061' is 'aluminium 6061-T6'.

        Raises
        ------
        NameNotFoundError   The table does not have it; the message offers the nearest and those that begin alike.

        Examples
        --------
        >>> Material.named("aluminium 7075-T6").conductivity
        130
        """
        library = Material.table()
        fitting = [name] if name in library else [each for each in library if _words(name) and _words(name) <= _words(each)]
        if len(fitting) > 1:
            listed = ", ".join(f"'{each}'" for each in fitting)
            raise NameNotFoundError(f"several materials are called '{name}': {listed}. Give one of them.")
        if not fitting:
            family = _in_own_spelling(name.replace(",", " ").split(" ")[0])
            alike = [f"'{n}'" for n in library if n.lower().startswith(family)] if family else []
            listed = f" There are {', '.join(alike)}." if alike else nearest(name, library)
            raise NameNotFoundError(
                f"no material '{name}' in the table.{listed} 'thermid example --materials' lists all. Or give its values."
            )
        return library[fitting[0]]

    @staticmethod
    @cache
    def table() -> Mapping[str, Material]:
        """Return all materials by name, in the order of the table."""
        table = parse_toml(read_text(Path(__file__).with_suffix(".toml")))
        return MappingProxyType({name: _material(name, row, table) for name, row in table["materials"].items()})


def _material(name: str, row: Mapping[str, object], table: Mapping[str, Mapping[str, object]]) -> Material:
    """Return the material of one row of materials.toml: its source in full, its class as ranges, diffusivity from mm^2/s to m^2/s."""
    row = dict(row)
    source = ", ".join(str(text) for text in (table["sources"][str(row.pop("source"))], row.pop("page", "")) if text)
    spread = table["classes"][str(row.pop("class"))]
    if "diffusivity" in row:
        row["diffusivity"] = 1e-6 * float(row["diffusivity"])  # type: ignore[arg-type]  # the table has numbers there
    return Material(name=name, source=source, range=spread, **row)  # type: ignore[arg-type]  # the test of the table reads every row


_SPELT = (
    ("aluminum", "aluminium"),
    (r"\b(al|aa|en[ -]aw)[ -]?(?=\d{4})", "aluminium "),
    (r"\b(aisi|ss)[ -]?(?=3\d\d)", "stainless steel "),
)
"""How materials are called by others, and here."""


def _in_own_spelling(name: str) -> str:
    """Return a name in small letters with the table's spelling: 'Aluminum' -> 'aluminium', 'AL6061' -> 'aluminium 6061'."""
    return reduce(lambda text, spelling: re.sub(spelling[0], spelling[1], text), _SPELT, name.lower())


def _words(name: str) -> set[str]:
    """Return the words and numbers of a name in the spelling of the table: 'AL6061' -> {'aluminium', '6061'}."""
    return {*re.findall(r"[a-zäöüß]+\d*|\d+[a-z]*", _in_own_spelling(name))}
