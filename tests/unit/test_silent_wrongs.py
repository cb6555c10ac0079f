"""Wrong results and wrong messages that users met: one test for each, named after what was seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import thermid as td
from thermid.model.kinds import KINDS
from thermid.model.modelfile import save_model
from thermid.reporting.diagram import STYLES, diagram
from thermid.studio.project import Project

# every kind of element is drawn ------------------------------------------------------------------------------------------------------

RISING = {"points": [["0 [degC]", "0.1 [W/K]"], ["60 [degC]", "0.3 [W/K]"]]}
EXAMPLES: dict[str, dict[str, Any]] = {
    "conduction": {"between": ["a", "b"], "conductance": "0.5 [W/K]"},
    "contact": {"between": ["a", "b"], "contact_conductance": "250 [W/(m^2 K)]", "area": "1 [cm^2]", "gap": "0.1 [mm]"},
    "convection": {"between": ["b", "air"], "htc": {"length": "3 [cm]", "orientation": "up"}, "area": "9 [cm^2]"},
    "gas": {"between": ["a", "b"], "area": "2 [cm^2]", "gap": "0.5 [mm]"},
    "effective": {"between": ["b", "air"], "effective_htc": "5 [W/(m^2 K)]", "area": "1 [cm^2]"},
    "radiation": {"between": ["a", "walls"], "emissivity": 0.1, "area": "5 [cm^2]"},
    "flow": {"between": ["air", "b"], "mass_flow": "0.01 [g/s]", "specific_heat": "1006 [J/(kg K)]"},
    "lead": {"between": ["a", "walls"], "conductivity": "390 [W/(m K)]", "diameter": "1 [mm]", "length": "40 [cm]"}
    | {"htc": "5 [W/(m^2 K)]", "to": "air"},
    "heat_pipe": {"between": ["a", "b"], "on_conductance": "5 [W/K]", "off_conductance": "0.1 [W/K]"}
    | {"start_temperature": "40 [degC]", "transition": "4 [K]"},
    "table": {"between": ["a", "b"], "table": RISING},
}
"""One conductor of every kind."""


def deck(conductors: dict[str, Any], **more: Any) -> td.Model:
    nodes = {"a": {"capacitance": "100 [J/K]", "reference_point": True}, "b": {"capacitance": "50 [J/K]"}}
    return td.model_from_dict({"title": "Box", "needs": ["air", "walls"], "nodes": nodes, "conductors": conductors} | more)


def one_of_each() -> td.Model:
    load = {"into": "a", "power": "1 [W]"}
    loads = {
        "plain": load,
        "pulse": load | {"periodic": {"period": "10 [min]", "duty": "30 [%]"}},
        "wave": load | {"sine": {"amplitude": "0.5 [W]", "period": "1 [h]"}},
        "stat": load | {"thermostat": {"sensor": "b", "on_below": "20 [degC]", "off_above": "25 [degC]"}},
        "prop": load | {"proportional": {"gain": "0.5 [W/K]", "setpoint": "20 [degC]"}},
        "curve": {"into": "b", "table": {"points": [["0 [degC]", "1 [W]"], ["60 [degC]", "0.5 [W]"]]}},
    }
    skin = {"of": "a", "to": "air", "area": "0.02 [m^2]", "htc": "4 [W/(m^2 K)]", "emissivity": 0.8, "radiates_to": "walls"}
    named = {f"k_{kind}": {"kind": kind, **fields} for kind, fields in EXAMPLES.items()}
    return deck(named, loads=loads, surfaces={"skin": skin})


def test_a_lead_and_every_other_kind_is_drawn(tmp_path: Path) -> None:
    """A deck with a lead, or a heat pipe, ended `diagram`, `report` and the studio with a KeyError."""
    assert set(EXAMPLES) == set(KINDS) == set(STYLES)
    model = one_of_each()
    plain = diagram(model)
    for kind in KINDS:
        assert f"k_{kind} ({kind})" in plain
    assert {"lead", "heat loss of a lead", "heat pipe"} <= {text.split("<")[0] for text in plain.split(">")}
    file = tmp_path / "box.toml"
    save_model(model, file)
    project = Project(file)
    assert "k_lead" in project.desk(project.title).drawn({}, 0, 60.0, ())
