"""Projects to begin with where there is no log yet: a part, a box of boards, a test in a chamber."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from thermid.base.errors import NameNotFoundError, nearest
from thermid.base.files import DECK, FileKind, may_write, write_text
from thermid.campaign._start.schemas import headed, may_write_schemas, write_schemas

TEMPLATE: Final = FileKind("project file")
ROOT: Final = "# This file marks the root of a thermid project: decks and logs are looked for below it.\n"

_PART = """\
# One part in a room. Replace the numbers by yours, and give the source of each.
title  = "part"
needs  = ["room"]
offers = ["case", "skin"]

[nodes.case]
mass          = { value = "0.5 [kg]", source = "assumed", note = "measure with a scale" }
specific_heat = { value = "900 [J/(kg K)]", source = "published", note = "aluminium" }

[surfaces.skin]
of            = "case"
to            = "room"
area          = { value = "300 [cm^2]", source = "assumed", note = "measure with a ruler" }
effective_htc = { value = "8 [W/(m^2 K)]", min = 2, max = 30, source = "assumed", note = "with radiation; fit to a test" }

[loads]
heat = { into = "case", power = { value = "5 [W]", source = "assumed", note = "volts times amperes" } }
"""

_SCENARIO = """\
# Switched on in a room of 23 degC, for four hours.
duration = "4 [h]"
start    = "23 [degC]"

[boundaries]
room = "23 [degC]"
"""

_BOX = """\
# A closed box of two boards: boards give heat to the air in the box and to the walls by their screws; the walls give it to the room.
title = "box"
needs = ["room"]

[nodes]
board_1 = { capacitance = { value = "120 [J/K]", source = "assumed", note = "mass times specific heat" } }
board_2 = { capacitance = { value = "80 [J/K]", source = "assumed" } }
air     = { capacitance = { value = "5 [J/K]", source = "assumed", note = "4 litres of air" } }
walls   = { capacitance = { value = "900 [J/K]", source = "assumed", note = "1 kg of aluminium" } }

# All conductances are assumed; fit them to a test.
[conductors]
board_1_air   = { kind = "conduction", between = ["board_1", "air"], conductance = "0.15 [W/K]" }
board_2_air   = { kind = "conduction", between = ["board_2", "air"], conductance = "0.1 [W/K]" }
board_1_walls = { kind = "conduction", between = ["board_1", "walls"], conductance = "0.3 [W/K]" } # screws and card guides
board_2_walls = { kind = "conduction", between = ["board_2", "walls"], conductance = "0.3 [W/K]" }
air_walls     = { kind = "conduction", between = ["air", "walls"], conductance = "0.6 [W/K]" }

[surfaces.outside]
of            = "walls"
to            = "room"
area          = { value = "0.15 [m^2]", source = "assumed" }
effective_htc = { value = "8 [W/(m^2 K)]", min = 2, max = 30, source = "assumed" }

[loads]
heat_1 = { into = "board_1", power = { value = "8 [W]", source = "assumed" } }
heat_2 = { into = "board_2", power = { value = "4 [W]", source = "assumed" } }
"""

_CHAMBER = """\
# Two cold and hot soaks in a chamber, switched on: the air of the chamber is the room of the part.
duration = "16 [h]"
start    = "23 [degC]"

[boundaries.room]
times  = ["0 [h]", "1 [h]", "5 [h]", "6.5 [h]", "10.5 [h]", "12 [h]", "16 [h]"]
values = ["23 [degC]", "-10 [degC]", "-10 [degC]", "50 [degC]", "50 [degC]", "23 [degC]", "23 [degC]"]
"""

TEMPLATES: Final[Mapping[str, tuple[str, Mapping[str, str]]]] = {
    "part": ("one part in a room", {"part.toml": _PART, "scenario.toml": _SCENARIO}),
    "box": ("a closed box of two boards", {"box.toml": _BOX, "scenario.toml": _SCENARIO}),
    "chamber": ("a part in a chamber test", {"part.toml": _PART, "scenario.toml": _CHAMBER}),
}
"""Name -> what it is, and its files. The fourth, `tclab`, is the shipped example of that name."""


def write_template(name: str, folder: Path) -> tuple[str, list[Path]]:
    """Write a project of a template; return its next command and its files.

    Raises
    ------
    NameNotFoundError   When there is no template of that name.
    OutputError         When a file is there that thermid did not write.
    """
    if name not in TEMPLATES:
        names = [*TEMPLATES, "tclab"]
        raise NameNotFoundError(f"no template '{name}'; there are {', '.join(names)}.{nearest(name, names)}", "--template")
    files = dict(TEMPLATES[name][1])
    folder.mkdir(parents=True, exist_ok=True)
    deck = next(iter(files))
    kinds = {file: DECK.titled(Path(file).stem) if file == deck else TEMPLATE.titled(Path(file).stem) for file in files}
    grammars = {file: "deck" if file == deck else "scenario" for file in files}
    for file, kind in kinds.items():
        may_write(folder / file, kind)
    may_write_schemas(folder, grammars.values())
    written = [write_text(folder / file, headed(text, grammars[file]), kinds[file]) for file, text in files.items()]
    written += write_schemas(folder, grammars.values())
    if not (folder / "thermid.toml").exists():
        written.append(write_text(folder / "thermid.toml", ROOT, TEMPLATE.titled("root")))
    return f"thermid simulate {folder / deck} --scenario {folder / 'scenario.toml'}", written
