"""Made-up campaigns that are large: twelve sensors of ten thousand readings each, and an assembly of fifty parts with its levels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import thermid as td

__all__ = ["dense_campaign", "values_campaign", "wide_campaign"]

TRUE_HTC = 9.0
"""Of every part, where its deck says 8. [W/(m^2 K)]"""
PART = """
title = "{name}"
needs = ["air", "plate"]

[nodes]
case = {{ mass = "{mass} [kg]", specific_heat = "900 [J/(kg K)]" }}

[surfaces]
skin = {{ of = "case", to = "air", area = "0.02 [m^2]", effective_htc = "8 [W/(m^2 K)]" }}

[conductors]
foot = {{ kind = "conduction", between = ["case", "plate"], conductance = "{foot} [W/K]" }}

[loads]
chips = {{ into = "case", power = "{power} [W]" }}
"""


def _log(file: Path, columns: dict[str, np.ndarray], step: float) -> None:
    rows = next(iter(columns.values())).size
    table = np.column_stack([np.arange(rows) * step, *columns.values()])
    np.savetxt(file, table, delimiter=",", header="# SYNTHETIC\ntime_s," + ",".join(columns), comments="", fmt="%.3f")


def dense_campaign(folder: Path, sensors: int = 12, rows: int = 10_000) -> Path:
    """Write a plate with twelve blocks on it, each with a sensor, and one log; return its campaign."""
    blocks = range(sensors)
    nodes = "\n".join(f'b{k} = {{ capacitance = "{300 + 40 * k} [J/K]" }}' for k in blocks)
    feet = "\n".join(
        f'f{k} = {{ kind = "conduction", between = ["b{k}", "plate"], conductance = "{0.3 + 0.02 * k:.2f} [W/K]" }}' for k in blocks
    )
    loads = "\n".join(f'p{k} = {{ into = "b{k}", power = "{1 + 0.3 * k:.1f} [W]" }}' for k in blocks)
    deck = f'title = "rack"\nneeds = ["air"]\n[nodes]\nplate = {{ capacitance = "4000 [J/K]" }}\n{nodes}\n'
    deck += '[surfaces]\nskin = { of = "plate", to = "air", area = "0.4 [m^2]", effective_htc = "9 [W/(m^2 K)]" }\n'
    deck += f"[conductors]\n{feet}\n[loads]\n{loads}\n"
    (folder / "rack.toml").write_text(deck, encoding="utf-8")
    rng, times = np.random.default_rng(3), np.arange(rows) * 4.0
    readings = {
        f"T{k}": 24.0 + (6.0 + 2.0 * k) * (1.0 - np.exp(-times / (2500.0 + 100.0 * k))) + 0.1 * rng.standard_normal(rows) for k in blocks
    }
    readings["T3"][rows // 2] = 60.0  # one reading that a thinned curve must not lose
    _log(folder / "rack.csv", {**readings, "T_AIR": np.full(rows, 24.0)}, 4.0)
    channels = ", ".join(f'T{k} = {{ node = "b{k}", noise = "0.1 [K]", accuracy = "0.3 [K]" }}' for k in blocks)
    text = f'title = "rack"\n[records.warm]\nfile = "rack.csv"\nchannels = {{ {channels}, T_AIR = {{ boundary = "air" }} }}\n'
    (folder / "campaign.toml").write_text(
        text + '[[stages]]\nname = "rack"\nmodel = "rack.toml"\nrecords = ["warm"]\nfree = ["skin.effective_htc"]\n'
    )
    return folder / "campaign.toml"


def values_campaign(folder: Path, nodes: int = 60, rows: int = 2000) -> Path:
    """Write a ring of 60 nodes with 465 values, of which ten have a sensor, and one log; return its campaign."""
    every = range(nodes)
    parts = [f'n{k} = {{ mass = "{0.2 + 0.01 * k:.2f} [kg]", specific_heat = "900 [J/(kg K)]" }}' for k in every]
    skins = [f's{k} = {{ of = "n{k}", to = "air", area = "0.02 [m^2]", effective_htc = "8 [W/(m^2 K)]" }}' for k in every]
    pairs = [(k, (k + step) % nodes) for step in (1, 7, 11) for k in every][:135]
    values = ('conductance = "0.8 [W/K]"', 'area = "4 [cm^2]", contact_conductance = "900 [W/(m^2 K)]"')
    kinds = [("conduction", values[0])] * 105 + [("contact", values[1])] * 30
    links = [
        f'g{j} = {{ kind = "{kind}", between = ["n{a}", "n{b}"], {v} }}'
        for j, ((a, b), (kind, v)) in enumerate(zip(pairs, kinds, strict=True))
    ]
    loads = [f'p{k} = {{ into = "n{k}", power = "1.5 [W]" }}' for k in every]
    tables = {"nodes": parts, "surfaces": skins, "conductors": links, "loads": loads}
    deck = 'title = "ring"\nneeds = ["air"]\n' + "".join(f"[{name}]\n" + "\n".join(lines) + "\n" for name, lines in tables.items())
    (folder / "ring.toml").write_text(deck, encoding="utf-8")
    rng, times = np.random.default_rng(5), np.arange(rows) * 20.0
    seen = {f"T{k}": 24.0 + 9.0 * (1.0 - np.exp(-times / 2500.0)) + 0.1 * rng.standard_normal(rows) for k in range(0, nodes, 6)}
    _log(folder / "ring.csv", {**seen, "T_AIR": np.full(rows, 24.0)}, 20.0)
    channels = ", ".join(f'T{k} = {{ node = "n{k}", noise = "0.1 [K]", accuracy = "0.3 [K]" }}' for k in range(0, nodes, 6))
    text = f'title = "ring"\n[records.warm]\nfile = "ring.csv"\nchannels = {{ {channels}, T_AIR = {{ boundary = "air" }} }}\n'
    text += '[[stages]]\nname = "ring"\nmodel = "ring.toml"\nrecords = ["warm"]\nfree = ["s0.effective_htc"]\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder / "campaign.toml"


def wide_campaign(folder: Path, parts: int = 50) -> Path:
    """Write fifty parts, each with a stage and a log, and an assembly of all of them on a tray; return its campaign."""
    rng, times = np.random.default_rng(4), np.arange(200) * 60.0
    text = 'title = "Equipment bay"\n'
    stages, uses = "", []
    kinds = ("Receiver", "Converter", "Gyro", "Transmitter", "Computer")
    names = [f"{kinds[k % 5]}_{k // 5 + 1}" for k in range(parts)]
    for k, name in enumerate(names):
        mass, foot, power = 0.3 + 0.02 * k, 0.2 + 0.01 * k, 2.0 + 0.1 * k
        part = PART.format(name=name, mass=f"{mass:.2f}", foot=f"{foot:.2f}", power=f"{power:.1f}")
        (folder / f"{name}.toml").write_text(part, encoding="utf-8")
        out = foot + TRUE_HTC * 0.02
        rise = power / out * (1.0 - np.exp(-times * out / (900.0 * mass))) + 0.1 * rng.standard_normal(times.size)
        _log(folder / f"{name}.csv", {"T": 24.0 + rise, "T_AIR": np.full(times.size, 24.0), "T_PLATE": np.full(times.size, 24.0)}, 60.0)
        bound = 'T_AIR = { boundary = "air" }, T_PLATE = { boundary = "plate" }'
        case = 'T = { node = "case", noise = "0.1 [K]", accuracy = "0.3 [K]" }'
        text += f'[records.{name}]\nfile = "{name}.csv"\nchannels = {{ {case}, {bound} }}\n'
        stages += f'[[stages]]\nname = "{name}"\nmodel = "{name}.toml"\nrecords = ["{name}"]\nfree = ["skin.effective_htc"]\n'
        uses.append(f'[submodels.u{k:02d}]\nuse = "{name}.toml"\nbind = {{ air = "air", plate = "tray" }}\n')
    deck = 'title = "bay"\nneeds = ["air"]\n[nodes]\ntray = { capacitance = "9000 [J/K]" }\n'
    deck += '[surfaces]\nback = { of = "tray", to = "air", area = "0.6 [m^2]", effective_htc = "9 [W/(m^2 K)]" }\n' + "".join(uses)
    (folder / "bay.toml").write_text(deck, encoding="utf-8")
    truth = td.load_model(folder / "bay.toml").with_values(
        {f"u{k:02d}.skin.effective_htc": f"{TRUE_HTC} [W/(m^2 K)]" for k in range(parts)}
    )
    course = td.Scenario("bay", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration=float(times[-1]))
    run = td.simulate(truth, course, times=times)
    sensors = {f"T{k}": run[f"u{k:02d}.case"].celsius + 0.1 * rng.standard_normal(times.size) for k in range(0, parts, 2)}
    _log(folder / "bay.csv", {**sensors, "T_AIR": np.full(times.size, 24.0)}, 60.0)
    channels = ", ".join(f'T{k} = {{ node = "u{k:02d}.case", noise = "0.1 [K]", accuracy = "0.3 [K]" }}' for k in range(0, parts, 2))
    text += f'[records.bay]\nfile = "bay.csv"\nchannels = {{ {channels}, T_AIR = {{ boundary = "air" }} }}\n'
    inherit = ", ".join(f'u{k:02d} = {{ stage = "{name}" }}' for k, name in enumerate(names))
    text += (
        stages
        + f'[[stages]]\nname = "bay"\nmodel = "bay.toml"\nrecords = ["bay"]\nfree = ["back.effective_htc"]\ninherit = {{ {inherit} }}\n'
    )
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder / "campaign.toml"
