"""The macro model in its host's scenarios: transport, pad, hold, ascent, coast.

`python examples/sisnav/macro/macro.py FOLDER` runs all of them and prints where the unit goes. In air the unit is as the document has it,
one effective coefficient a surface. Ascent and coast need radiation by itself: there the unit is the study's second structure, written
into FOLDER by `structures.py`. Values of the host are assumed and say so.
"""

from __future__ import annotations

import sys
from pathlib import Path

import thermid as td

HERE = Path(__file__).parent
if str(HERE.parent) not in sys.path:
    sys.path.insert(0, str(HERE.parent))
IN_AIR = ("transport", "pad", "pad_hold")
THIN = ("ascent", "coast")
POINTS = ("FOG_x", "FOG_y", "PrS", "EleG", "Acc_x", "disk", "base")


def macro() -> td.Model:
    """Return the macro model with the unit as the document has it; every value of the host has a source."""
    return td.macro_model(HERE / "macro.toml")


def flight(folder: Path) -> td.Model:
    """Return the macro model with a unit whose convection and radiation are apart; its decks are written into a folder."""
    import structures

    structures.main(folder)
    return td.macro_model(macro(), unit=td.load_model(folder / "m_Sd.toml"))


def runs(folder: Path) -> dict[str, td.Solution]:
    """Return scenario -> what the macro model does in it."""
    models = {**dict.fromkeys(IN_AIR, macro()), **dict.fromkeys(THIN, flight(folder))}
    return {name: td.simulate(model, td.load_scenario(HERE / f"{name}.toml")) for name, model in models.items()}


if __name__ == "__main__":
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/sisnav/natural")
    print(f"demonstration, {len(td.assumed(macro()))} assumed parameters")
    for run in runs(out).values():
        print(f"{run.scenario}: " + ", ".join(f"{p} {run[p].kelvin.min() - 273.15:.1f} to {run[p].highest:.1f}" for p in POINTS) + " degC")
