"""The same nine models with another law of convection: natural convection and radiation apart, in place of one constant coefficient.

The document's blocks hold one constant effective coefficient a surface. Air that a warm box moves by itself takes heat as dT^1.25 (laminar
flow; Incropera et al., Section 9.6), and a surface radiates beside it. Run it as ``python structures.py FOLDER``: it writes the nine decks
and the campaign in that form. It reads the decks and the document's numbers only; what is hidden in the laboratory it does not know.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

import thermid as td
from thermid.physics.finishes import finish
from thermid.physics.radiation import radiation_coefficient, radiation_conductance

HERE = Path(__file__).parent
PARTS = ("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV", "m_PrE", "m_AccS", "m_IMU", "m_Sd")
AMBIENT = 297.15
EXPONENT = 0.25
"""Of laminar natural convection from plates. [-]"""
ALUMINIUM, FINISHES = "aluminium, machined", {"Acc": "stainless steel, machined"}
"""What the document says of housings; handbooks give the emissivity and its range, which is the prior of what the fits find."""
UNPRINTED = {"sd": "60 [%]"}
"""Of the loss through the gap of the pair, which no sensor sees by itself: 1 to 8 W/(m^2 K) is what its deck allows."""
AS_PRINTED = {"sd": "20 [%]"}
"""Of coefficients that several sensors see only together: about Table 2's."""

COMPONENT = {"free": ["skin.htc.coefficient", "mass", "skin.emissivity"]}
STAGES: dict[str, dict[str, Any]] = {
    **dict.fromkeys(("Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV"), COMPONENT),
    "m_PrE": {
        "free": ["stack_conductivity", "stack.gap.htc", "proc.skin.htc.coefficient", "ele.skin.htc.coefficient"],
        "priors": {"stack.gap.htc": UNPRINTED},
        "inherit": {"proc": ("ProcSISNAV", "mass", "skin.emissivity"), "ele": ("EleGFO", "mass", "skin.emissivity")},
    },
    "m_AccS": {
        "free": ["flange_conductivity", "support_skin.htc.coefficient", "support_skin.emissivity"],
        "priors": {"flange_conductivity": {"sd": "40 [%]"}},
        "inherit": {f"acc_{axis}": ("Acc",) for axis in "xyz"},
    },
    "m_IMU": {
        "free": [
            *("fog_foot_conductivity", "acc_foot_conductivity", "support_mass"),
            *("support_skin.htc.coefficient", "support_skin.emissivity", "acc.support_skin.htc.coefficient"),
        ],
        "priors": {
            **{p: {"sd": "40 [%]"} for p in ("fog_foot_conductivity", "acc_foot_conductivity")},
            "acc.support_skin.htc.coefficient": AS_PRINTED,
        },
        "inherit": {"acc": ("m_AccS",), "fog_x": ("FOG_h",), "fog_y": ("FOG_l",), "fog_z": ("FOG_l",)},
    },
    "m_Sd": {
        "free": [
            *("imu_foot_conductivity", "cd_conductivity", "disk_skin.htc.coefficient", "disk_skin.emissivity"),
            *("pre.proc.skin.htc.coefficient", "pre.ele.skin.htc.coefficient", "imu.support_skin.htc.coefficient"),
            *("imu.fog_x.skin.htc.coefficient", "imu.fog_y.skin.htc.coefficient", "imu.acc.support_skin.htc.coefficient"),
            *("imu.fog_z.skin.htc.coefficient", *(f"imu.acc.acc_{axis}.skin.htc.coefficient" for axis in "xyz")),
        ],
        "priors": {
            **{p: {"sd": "40 [%]"} for p in ("imu_foot_conductivity", "cd_conductivity")},
            **{f"imu.{p}.htc.coefficient": AS_PRINTED for p in ("support_skin", "fog_x.skin", "fog_y.skin", "fog_z.skin")},
            **{f"imu.acc.{p}.htc.coefficient": AS_PRINTED for p in ("support_skin", "acc_x.skin", "acc_y.skin", "acc_z.skin")},
        },
        "inherit": {"pre": ("m_PrE",), "imu": ("m_IMU",)},
        "untie": True,  # three instances of one part, each in an air of its own
    },
}
"""What each stage frees, and what it takes from which stage below, with its covariance; no names mean everything."""


def coefficient(model: td.Model, settled: dict[str, float], path: str, emissivity: float) -> float:
    """Return the coefficient that, with radiation, gives a surface its effective value where the printed test settles. [W/(m^2 K^1.25)]"""
    network = td.simulation.compile_network(model)
    *parts, surface, _ = path.split(".")
    owner = model
    for part in parts:
        owner = owner.submodels[part].model
    node = network.find(".".join([*parts, owner.surfaces[surface].of]))
    rise = settled[node] - AMBIENT
    radiation = float(radiation_conductance(radiation_coefficient(emissivity, 1.0), settled[node], AMBIENT))
    return (float(network.numbers().values[path]) - radiation) / rise**EXPONENT


def owner_of(model: td.Model, path: str) -> str:
    """Return the title of the part whose surface a path names."""
    for part in path.split(".")[:-2]:
        model = model.submodels[part].model
    return model.title


def natural(name: str) -> str:
    """Return a deck of the study in the other form."""
    model = td.load_model(HERE / f"{name}.toml")
    settled = td.steady(model, td.Scenario("bench", boundaries={"cv": f"{AMBIENT} [K]"}))
    deck = tomlkit.parse((HERE / f"{name}.toml").read_text(encoding="utf-8"))

    def value(path: str) -> dict[str, Any]:
        emissivity = finish(FINISHES.get(owner_of(model, path), ALUMINIUM)).typical
        found = coefficient(model, settled, path, emissivity)
        basis = f"the document's effective value of {path} where its test settles, radiation of emissivity {emissivity:g} taken off"
        return {"value": f"{found:.4f} [W/(m^2 K)]", "min": 0.1, "max": 10, "source": "derived", "basis": basis}

    surfaces: Any = deck.get("surfaces", {})
    for key, surface in surfaces.items():
        surface["htc"] = {"coefficient": value(f"{key}.effective_htc"), "exponent": EXPONENT}
        surface["finish"] = FINISHES.get(name, ALUMINIUM)
        del surface["effective_htc"]
    if name.startswith("FOG"):  # the slope of a gyro's power is measured (`gyro_power`); the document knows that there is one
        loads: Any = deck["loads"]
        loads["electronics"] |= {"temperature_coefficient": "0 [1/K]", "reference_temperature": "24 [degC]"}
    settings: Any = deck.get("set", {})
    if name == "m_IMU":  # the document shares the support's mass among the gyros; here it weighs by itself
        nodes: Any = deck["nodes"]
        nodes["support"] = {"mass": "support_mass", "specific_heat": "960 [J/(kg K)]"}
        for path in [p for p in settings if p.endswith("shared_mass")]:
            del settings[path]
    for path in [p for p in settings if p.endswith("effective_htc")]:
        settings[path.replace("effective_htc", "htc.coefficient")] = value(path)
        del settings[path]
    return tomlkit.dumps(deck)


def gyro_power(log: Path, sensor: str) -> tuple[float, float]:
    """Return a gyro's power at 24 degC [W] and its relative change with temperature [1/K]: a line through its log while it is on."""
    rows = np.genfromtxt(log, delimiter=",", names=True, skip_header=1)
    on = rows["P"] > 0.5 * rows["P"].max()
    slope, level = np.polyfit(rows[sensor][on] - 24.0, rows["P"][on], 1)
    return float(level), float(slope / level)


def campaign() -> str:
    """Return the campaign in the other form: what a stage found goes on with its covariance."""
    plan = tomllib.loads((HERE / "campaign.toml").read_text(encoding="utf-8"))
    plan["title"] = f"{plan['title']}: natural convection and radiation apart"
    for stage in plan["stages"]:
        asked = STAGES[stage["name"]]
        stage["free"], stage["priors"] = asked["free"], asked.get("priors", {})
        handed = {
            part: {"stage": below, "as": "prior"} | ({"only": only} if only else {})
            for part, (below, *only) in asked.get("inherit", {}).items()
        }
        stage["inherit"], stage["untie"] = handed, asked.get("untie", False)
    return tomlkit.dumps(plan)


def main(folder: Path) -> Path:
    """Write the decks and the campaign into a folder and return the path of the campaign."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in PARTS:
        (folder / f"{name}.toml").write_text(natural(name), encoding="utf-8")
    (folder / "campaign.toml").write_text(campaign(), encoding="utf-8")
    (folder / "thermid.toml").write_text("# Root of a project of its own.\n", encoding="utf-8")
    return folder / "campaign.toml"


if __name__ == "__main__":
    print(main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "natural"))
