"""Write src/thermid/base/_units_table.py from pint: exact factors to SI of the units that decks use, so that start-up needs no pint.

Run it as ``python scripts/generate_units.py``; tests/unit/test_units.py fails when the table and pint disagree.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pint

PLAIN = """
1 % m mm cm um km in ft m^2 cm^2 mm^2 m^3 cm^3 L kg g mg s ms min h day Hz A mA V ohm
K mK degC degF J kJ Wh W mW kW N Pa hPa kPa bar mbar atm
W/(m K) W/(m^2 K) W/K mW/K K/W J/K kJ/K J/(kg K) kJ/(kg K) kg/m^3 g/cm^3 kg/s g/s W/m^2
K/s K/min K/h 1/K %/K W/% mW/% 1/s 1/h m/s m^2/s Pa s m^2 K/W s/K W/K^2 1/K^2 m/s^2 kPa/s mm^3 g/min K/% 1/% V/K V/A
"""
DIMENSIONS = ("[length]", "[mass]", "[time]", "[current]", "[temperature]")


def units() -> list[str]:
    """Return the normalised unit texts of PLAIN."""
    import re

    text = PLAIN.replace("\n", " ")
    found = re.findall(r"\S+/\([^)]*\)|m\^2 K/W|Pa s|\S+", text)
    return list(dict.fromkeys(u.replace(" ", "*") for u in found))


def row(registry: pint.UnitRegistry, text: str) -> tuple[Fraction, Fraction, tuple[int, ...]]:
    """Return factor, offset and dimension exponents of one unit."""
    source = text.replace("%", "percent").replace("^", "**").replace("degC", "kelvin").replace("degF", "(kelvin)")
    quantity = registry.Quantity(Fraction(1), source).to_base_units()
    # pint keeps gram in its base system only when told so; mks is its default, hence kilogram, metre, second
    dims = tuple(int(quantity.dimensionality.get(d, 0)) for d in DIMENSIONS)
    factor, offset = Fraction(quantity.magnitude), Fraction(0)
    if text == "degC":
        offset = Fraction("273.15")
    if text == "degF":
        factor, offset = Fraction(5, 9), Fraction("459.67") * Fraction(5, 9)
    return factor, offset, dims


def main() -> None:
    """Write the table."""
    registry = pint.UnitRegistry(non_int_type=Fraction)
    lines = [
        '"""Exact factors of common units to SI. Written by scripts/generate_units.py from pint; do not edit."""',
        "",
        "from __future__ import annotations",
        "",
        "# text: (numerator, denominator, offset numerator, offset denominator, exponents of m kg s A K)",
        "TABLE: dict[str, tuple[int, int, int, int, tuple[int, int, int, int, int]]] = {",
    ]
    for text in units():
        factor, offset, dims = row(registry, text)
        parts = (factor.numerator, factor.denominator, offset.numerator, offset.denominator)
        lines.append(f'    "{text}": ({", ".join(map(str, parts))}, ({", ".join(map(str, dims))})),')
    lines.append("}\n")
    Path(__file__).parent.parent.joinpath("src/thermid/base/_units_table.py").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
