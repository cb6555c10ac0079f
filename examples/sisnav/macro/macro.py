"""The macro model in its host's scenarios: transport, pad, hold, ascent, coast.

`python examples/sisnav/macro/macro.py` runs all of them and prints where the unit goes. In air the unit is as the document has it, one
effective coefficient a surface. Ascent and coast need radiation by itself: there the unit is the study's second structure, whose decks
lie in `../qualification/decks`. Values of the host are assumed and state this.
"""

from __future__ import annotations

from pathlib import Path

import thermid as td

HERE = Path(__file__).parent
IN_AIR = ("transport", "pad", "pad_hold")
THIN = ("ascent", "coast")
POINTS = ("FOG_x", "FOG_y", "PrS", "EleG", "Acc_x", "disk", "base")


def macro() -> td.Model:
    """Return the macro model with the unit as the document has it; every value of the host has a source."""
    return td.qualify.macro_model(HERE / "macro.toml")


def flight() -> td.Model:
    """Return the macro model with a unit whose convection and radiation are apart."""
    return td.qualify.macro_model(macro(), unit=td.load_model(HERE.parent / "qualification" / "decks" / "m_Sd.toml"))


def runs() -> dict[str, td.Solution]:
    """Return scenario -> what the macro model does in it."""
    models = {**dict.fromkeys(IN_AIR, macro()), **dict.fromkeys(THIN, flight())}
    return {name: td.simulate(model, td.load_scenario(HERE / f"{name}.toml")) for name, model in models.items()}


if __name__ == "__main__":
    print(f"demonstration, {len(td.qualify.assumed(macro()))} assumed parameters")
    for run in runs().values():
        print(f"{run.scenario}: " + ", ".join(f"{p} {run[p].kelvin.min() - 273.15:.1f} to {run[p].highest:.1f}" for p in POINTS) + " degC")
