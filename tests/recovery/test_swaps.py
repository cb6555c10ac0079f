"""Seeded swaps in units of 2 to 11 masses, with offsets of their sensors: what a retune fits again is right within its errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import IdentificationError
from thermid.model.tree import Model, load_model

PART = """
title  = "{title}"
needs  = ["air"]
offers = ["case", "skin"]

[nodes]
case = {{ capacitance = {{ value = "{cap} [J/K]", min = {low}, max = {high} }} }}
{board}
[surfaces.skin]
of         = "case"
to         = "air"
area       = "{area} [m^2]"
htc        = {{ coefficient = {{ value = "1.6 [W/(m^2 K)]", min = 0.2, max = 8 }}, exponent = 0.25 }}
emissivity = 0.8

{link}
[loads]
heat = {{ into = "{hot}", power = "{power} [W]" }}
"""
BOARD = 'board = {{ capacitance = {{ value = "{} [J/K]", min = 5, max = 5000 }} }}\n'
LINK = '[conductors.link]\nkind = "conduction"\nbetween = ["board", "case"]\nconductance = {{ value = "{} [W/K]", min = 0.02, max = 50 }}\n'
FOOT = '{{ value = "1 [W/K]", min = 0.02, max = 200 }}'
UNITS = {"capacitance": "J/K", "coefficient": "W/(m^2 K)", "conductance": "W/K", "foot": "W/K"}
HOURS, ON, HALF = 10.0, 600.0, 0.7


def texts(values: dict[str, float]) -> dict[str, str]:
    return {p: f"{v!r} [{UNITS[p.rpartition('.')[2]]}]" for p, v in values.items()}


def part(title: str, p: dict[str, float]) -> str:
    inner = p["inner"]
    board, link = (BOARD.format(0.3 * p["cap"]), LINK.format(inner)) if inner else ("", "")
    ends = {"low": p["cap"] / 4, "high": 4 * p["cap"], "hot": "board" if inner else "case"}
    return PART.format(title=title, board=board, link=link, **ends, **{k: p[k] for k in ("cap", "area", "power")})


def log(
    path: Path,
    model: Model,
    values: dict[str, float],
    sensors: dict[str, str],
    powers: dict[str, float],
    air: str,
    seed: int,
    offsets: dict[str, float],
) -> None:
    """Write what sensors with offsets read of a model at its true values while its powers go on, and down to a half."""
    rng, times = np.random.default_rng(seed), np.linspace(0.0, 3600.0 * HOURS, 181)
    room = 296.15 + 0.4 * np.sin(times / 2800.0 + rng.uniform(0.0, 6.0))
    off = HALF * times[-1]
    steps = {"times": ["0 [s]", f"{ON} [s]", f"{off} [s]"], "hold": True, "after": "hold"}
    loads = {k: {**steps, "values": ["0 [W]", f"{v} [W]", f"{v / 2} [W]"]} for k, v in powers.items()}
    start = f"{room[0] - 273.15} [degC]"
    scenario = td.Scenario(
        "log", boundaries={air: (times, td.quantity(room, unit="K"))}, loads=loads, start=start, duration=float(times[-1])
    )
    run = td.simulate(model.with_values(texts(values)), scenario, times=times)
    columns = {s: run[n].celsius + offsets[s] + 0.05 * rng.standard_normal(times.size) for s, n in sensors.items()}
    columns |= {"ROOM": room - 273.15}
    columns |= {f"P_{k.replace('.', '_')}": np.where(times < ON, 0.0, np.where(times < off, v, v / 2)) for k, v in powers.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, np.column_stack([times, *columns.values()]), "%.4f", ",", header=",".join(["time_s", *columns]), comments="")


def record(name: str, sensors: dict[str, str], powers: dict[str, float], air: str) -> str:
    rows = [f'{s} = {{ node = "{n}", noise = "0.05 [K]", accuracy = "0.3 [K]" }}' for s, n in sensors.items()]
    rows += [f'P_{k.replace(".", "_")} = {{ load = "{k}", accuracy = "0.01 [W]" }}' for k in powers]
    head = f'[records.{name}]\nfile = "logs/{name}.csv"\ntime = "time_s"\n[records.{name}.channels]\nROOM = {{ boundary = "{air}" }}'
    return "\n".join([head, *rows])


def swapped(folder: Path, seed: int) -> tuple[list[float], str, list[str]]:
    """Return (value - truth) / error of all that a retune fitted again, its standing, and what it calls moved."""
    rng = np.random.default_rng([54, seed])
    (folder / "thermid.toml").touch()
    near = lambda spread: float(np.exp(spread * rng.standard_normal()))  # noqa: E731
    wide = lambda low, high: float(np.exp(rng.uniform(np.log(low), np.log(high))))  # noqa: E731
    kinds = [
        {"cap": wide(80, 1500), "inner": wide(0.2, 3.0) * (rng.random() < 0.5), "power": rng.uniform(1, 6), "area": rng.uniform(0.01, 0.05)}
        for _ in range(int(rng.integers(1, 4)))
    ]
    places = {f"u{k}{'abc'[j]}": k for k in range(len(kinds)) for j in range(int(rng.integers(1, 3 if len(kinds) > 1 else 4)))}
    shared, base = bool(rng.random() < 0.4), float(rng.uniform(800, 3000))

    def truth_of(p: dict[str, float]) -> dict[str, float]:
        inner = {"board.capacitance": 0.3 * p["cap"] * near(0.12), "link.conductance": p["inner"] * near(0.2)} if p["inner"] else {}
        return {"case.capacitance": p["cap"] * near(0.12), "skin.htc.coefficient": 1.6 * near(0.15), **inner}

    number = '"foot"' if shared else FOOT.format()
    joint = 'foot_{} = {{ kind = "conduction", between = ["{}.case", "base"], conductance = {} }}'
    feet = "\n".join(joint.format(n, n, number) for n in places)
    unit = [
        'title = "Unit"\nneeds = ["room"]',
        f"parameters = {{ foot = {FOOT.format()} }}" * shared,
        f'[nodes]\nbase = {{ capacitance = {{ value = "{base} [J/K]", min = 200, max = 20000 }} }}\n[submodels]',
        *(f'{n} = {{ use = "p{k}.toml", bind = {{ air = "room" }} }}' for n, k in places.items()),
        f'[conductors]\n{feet}\n[surfaces.skin]\nof = "base"\nto = "room"\narea = "0.09 [m^2]"\nemissivity = 0.3',
        'htc = { coefficient = { value = "1.6 [W/(m^2 K)]", min = 0.2, max = 8 }, exponent = 0.25 }',
    ]
    (folder / "unit.toml").write_text("\n".join(unit))
    truths = [truth_of(p) for p in kinds]
    common, own = wide(0.3, 15), {f"foot_{n}.conductance": wide(0.3, 15) for n in places}
    true_unit = {"base.capacitance": base * near(0.1), "skin.htc.coefficient": 1.6 * near(0.15), **({"foot": common} if shared else own)}
    bench = [{f"T_p{k}": "case", **({f"T_p{k}b": "board"} if p["inner"] else {})} for k, p in enumerate(kinds)]
    nodes = {f"T_{n}": f"{n}.case" for n in places} | {"T_base": "base"}
    nodes |= {f"T_{n}b": f"{n}.board" for n, k in places.items() if kinds[k]["inner"]}
    offsets = {s: 0.25 * float(rng.standard_normal()) for s in [*nodes, *(s for several in bench for s in several)]}
    heats = {f"{n}.heat": kinds[k]["power"] for n, k in places.items()}
    of_parts = {f"{n}.{p}": v for n, k in places.items() for p, v in truths[k].items()}
    campaign = ['title = "Swaps"', record("unit", nodes, heats, "room")]
    for k, p in enumerate(kinds):
        (folder / f"p{k}.toml").write_text(part(f"p{k}", p))
        deck, heat = load_model(folder / f"p{k}.toml"), {"heat": p["power"]}
        log(folder / "logs" / f"p{k}.csv", deck, truths[k], bench[k], heat, "air", 100 * seed + k, offsets)
        campaign.append(record(f"p{k}", bench[k], {"heat": p["power"]}, "air"))
    model = load_model(folder / "unit.toml")
    log(folder / "logs" / "unit.csv", model, true_unit | of_parts, nodes, heats, "room", 100 * seed + 11, offsets)
    inherit = ", ".join(f'{n} = {{ stage = "p{k}", as = "prior" }}' for n, k in places.items())
    stages = [(f"p{k}", list(truths[k]), "") for k in range(len(kinds))] + [("unit", list(true_unit), f"inherit = {{ {inherit} }}")]
    head = '[[stages]]\nname = "{0}"\nmodel = "{0}.toml"\nrecords = ["{0}"]\nfree = {1}\n{2}'
    campaign += [head.format(n, json.dumps(free), more) for n, free, more in stages]
    (folder / "campaign.toml").write_text("\n".join(campaign))

    place = str(rng.choice(list(places)))
    k = places[place]
    new = kinds[k] | {"power": kinds[k]["power"] * rng.uniform(0.4, 1.8), "cap": kinds[k]["cap"] * rng.uniform(0.6, 1.6)}
    (folder / "new.toml").write_text(part("new", new))
    deck, true_new, again = load_model(folder / "new.toml"), truth_of(new), folder / "again" / "logs"
    log(again / f"p{k}.csv", deck, true_new, bench[k], {"heat": new["power"]}, "air", 100 * seed + 21, offsets)
    foot = {f"foot_{place}.conductance": (common if shared else own[f"foot_{place}.conductance"]) * near(0.15)}
    after = true_unit | of_parts | {f"{place}.{p}": v for p, v in true_new.items()} | foot
    after |= {"foot": foot[f"foot_{place}.conductance"]} if shared and len(places) == 1 else {}
    heats[f"{place}.heat"] = new["power"]
    log(again / "unit.csv", model.replace(place, deck), after, nodes, heats, "room", 100 * seed + 31, offsets)

    fit = td.design.plan_retune(td.run_stages(folder / "campaign.toml"), place, deck).run(folder / "again")["unit"]
    assert {f"{place}.{p}" for p in true_new} <= set(fit.values.parameters)
    assert {*foot, "foot"} & set(fit.values.parameters)
    off = [(v.value - after[p]) / v.error for p, v in fit.estimates.items() if p in after]
    return off, fit.standing.state, [m.path for m in fit.moved.values if m.verdict == "moved"]


@pytest.mark.campaign
def test_twenty_swaps(tmp_path: Path) -> None:
    found = []
    for seed in range(20):
        (tmp_path / str(seed)).mkdir()
        try:
            found.append(swapped(tmp_path / str(seed), seed))
        except IdentificationError:  # a log that does not determine a value of the campaign; no swap
            continue
    off = np.concatenate([o for o, _, _ in found])
    assert len(found) >= 17
    assert np.mean(np.abs(off) <= 2.0) >= 0.9
    assert {state for _, state, _ in found} == {"credible"}
    assert [m for _, _, m in found if m] == []
