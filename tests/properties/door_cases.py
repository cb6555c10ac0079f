"""Twelve models, one for each kind of thing that a door could treat differently, as decks and scenarios that are written to files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomlkit

import thermid as td

Table = dict[str, Any]
BOLT: Table = {"kind": "conduction", "between": ["plate", "lid"], "conductance": "0.5 [W/K]"}
SKIN: Table = {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "0.05 [m^2]"}
GLOW: Table = {"kind": "radiation", "between": ["lid", "air"], "emissivity": 0.8, "area": "0.1 [m^2]"}
HEATER: Table = {"into": "lid", "power": "6 [W]"}
MASSES: Table = {"plate": {"capacitance": "200 [J/K]"}, "lid": {"capacitance": "60 [J/K]"}}
STILL: Table = {"title": "still", "start": "20 [degC]", "duration": "1 [h]", "boundaries": {"air": "20 [degC]"}}
MOVING: Table = STILL | {
    "boundaries": {"air": {"mean": "20 [degC]", "amplitude": "5 [K]", "period": "2 [h]"}},
    "commands": {"heater": {"times": ["0 [s]", "10 [min]", "40 [min]"], "values": [1.0, 0.2, 0.7], "hold": True}},
}


@dataclass(frozen=True)
class Case:
    """A deck, the decks of its parts by file, and a scenario."""

    deck: Table
    scenario: Table = field(default_factory=lambda: STILL)
    parts: dict[str, Table] = field(default_factory=dict)

    def written(self, folder: Path) -> tuple[td.Model, td.Scenario]:
        """Write all files, and return the model and the scenario that are read from them."""
        for name, table in {**self.parts, "unit": self.deck}.items():
            (folder / f"{name}.toml").write_text(tomlkit.dumps(table), encoding="utf-8")
        (folder / "run.toml").write_text(tomlkit.dumps(self.scenario), encoding="utf-8")
        return td.load_model(folder / "unit.toml"), td.load_scenario(folder / "run.toml")


def plate(**changed: Any) -> Table:
    """A plate in air and a heated lid on it."""
    return {
        "title": "plate",
        "needs": ["air"],
        "nodes": MASSES,
        "conductors": {"bolt": BOLT, "skin": SKIN},
        "loads": {"heater": HEATER},
    } | changed


def linked(**rows: Table) -> Table:
    return plate(conductors={"bolt": BOLT, "skin": SKIN, **rows})


BOX: Table = {
    "title": "box",
    "needs": ["air"],
    "offers": ["case"],
    "nodes": {"case": {"capacitance": "150 [J/K]"}},
    "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.02 [m^2]", "effective_htc": "9 [W/(m^2 K)]"}},
    "loads": {"heat": {"into": "case", "power": "1.5 [W]"}},
}
PAIR: Table = {
    "title": "pair",
    "needs": ["air"],
    "offers": ["first.case", "second.case"],
    "submodels": {n: {"use": "box.toml", "bind": {"air": "air"}} for n in ("first", "second")},
    "conductors": {"strap": {"kind": "conduction", "between": ["first.case", "second.case"], "conductance": "0.3 [W/K]"}},
}
RACK: Table = {
    "title": "rack",
    "needs": ["air"],
    "nodes": {"base": {"capacitance": "400 [J/K]"}},
    "submodels": {
        "pack": {"use": "pair.toml", "bind": {"air": "air"}},
        "lone": {"use": "box.toml", "bind": {"air": "air"}},
    },
    "conductors": {
        "low": {"kind": "conduction", "between": ["base", "pack.first.case"], "conductance": "0.4 [W/K]"},
        "high": {"kind": "conduction", "between": ["base", "lone.case"], "conductance": "0.2 [W/K]"},
    },
}
CURVE = {"points": [["0 [degC]", "20 [W/(m K)]"], ["35 [degC]", "60 [W/(m K)]"], ["90 [degC]", "30 [W/(m K)]"]]}
STREAM: Table = {
    "in": {"kind": "flow", "between": ["air", "gas"], "fluid": "air", "volume_flow": "fan.flow"},
    "out": {"kind": "flow", "between": ["gas", "air"], "fluid": "air", "volume_flow": "fan.flow"},
    "film": {"kind": "convection", "between": ["plate", "gas"], "htc": "20 [W/(m^2 K)]", "area": "0.05 [m^2]"},
}
FAN: Table = {
    "curve": [["0 [m^3/h]", "38 [Pa]"], ["40 [m^3/h]", "26 [Pa]"], ["95 [m^3/h]", "0 [Pa]"]],
    "passes": ["60 [m^3/h]", "12 [Pa]"],
    "speed": 0.8,
}
WAX: Table = {
    "mass": "0.1 [kg]",
    "specific_heat": "2000 [J/(kg K)]",
    "latent_heat": "150 [kJ/kg]",
    "melts_from": "27 [degC]",
    "melts_to": "29 [degC]",
    "liquid_specific_heat": "2200 [J/(kg K)]",
}
THERMOSTAT = {"on_below": "30 [degC]", "off_above": "33 [degC]", "sensor": "plate"}
PID = {"setpoint": "34 [degC]", "band": "8 [K]", "integral_time": "90 [s]"}
OUTER: Table = {"of": "plate", "to": "air", "area": "0.05 [m^2]", "htc": "6 [W/(m^2 K)]", "emissivity": 0.8, "carried_by": "free air"}

CASES = {
    "massless nodes": Case(
        plate(
            nodes={**MASSES, "glue": {}, "seam": {}},
            conductors={
                "skin": SKIN,
                "first": {**BOLT, "between": ["plate", "glue"]},
                "second": {**BOLT, "between": ["glue", "seam"]},
                "third": {**BOLT, "between": ["seam", "lid"], "conductance": "2 [W/K]"},
                "glow": GLOW | {"between": ["seam", "air"], "area": "0.02 [m^2]"},
            },
        ),
        MOVING,
    ),
    "thermostat": Case(plate(loads={"heater": {"into": "lid", "power": "25 [W]", "thermostat": THERMOSTAT}})),
    "PI": Case(
        plate(
            controls={"loop": {"follows": "plate", "pid": PID}},
            loads={"heater": {"into": "plate", "power": "20 [W]", "control": "loop"}},
        )
    ),
    "streams": Case(
        linked(
            blow={"kind": "flow", "between": ["air", "lid"], "mass_flow": "1e-4 [kg/s]", "specific_heat": "1006 [J/(kg K)]"},
        ),
        MOVING,
    ),
    "schedule": Case(
        plate(),
        MOVING | {"schedule": {"skin.htc": {"times": ["0 [s]", "30 [min]"], "values": ["8 [W/(m^2 K)]", "2 [W/(m^2 K)]"], "hold": True}}},
    ),
    "radiation": Case(linked(glow=GLOW), MOVING),
    "tables": Case(
        linked(
            bar={"kind": "conduction", "between": ["plate", "lid"], "conductivity": CURVE, "area": "1 [cm^2]", "thickness": "5 [mm]"},
        ),
        MOVING,
    ),
    "melting": Case(plate(nodes={**MASSES, "plate": WAX})),
    "carried_by": Case(plate(conductors={"bolt": BOLT}, surfaces={"skin": OUTER}), MOVING),
    "two heights": Case(RACK, parts={"box": BOX, "pair": PAIR}),
    "fan": Case(
        plate(
            nodes={**MASSES, "gas": {"capacitance": "5 [J/K]", "stands_for": "air"}},
            conductors={"bolt": BOLT, **STREAM},
            fans={"fan": FAN},
        ),
        MOVING,
    ),
    "hidden node": Case(
        plate(
            nodes={**MASSES, "core": {"capacitance": "90 [J/K]"}},
            conductors={"bolt": BOLT, "skin": SKIN, "inner": {**BOLT, "between": ["lid", "core"], "conductance": "0.15 [W/K]"}},
            loads={"heater": {"into": "core", "power": "3 [W]"}},
        ),
        MOVING,
    ),
}
