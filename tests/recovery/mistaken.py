"""Synthetic campaigns of small plants with one mistake planted in the log, the campaign file or the laboratory; or with none.

A plant has two to four parts in a chain, surfaces to the air, one or two heaters. The hidden hardware differs from its deck by some thirty
per cent in every value. Mistakes are made where people make them: in a column, in a binding, on the bench.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

import thermid as td
from thermid.model.tree import TableSignal

Array = np.ndarray
ICE = 273.15


@dataclass
class Plant:
    """A plant, its hidden values, and what was done to it; a mistake changes what of it is written."""

    rng: np.random.Generator
    nodes: list[str]
    loads: dict[str, str]
    deck: dict[str, float]
    truth: dict[str, float]
    times: Array
    power: dict[str, Array]
    air: Array
    sensors: dict[str, str]
    noise: float
    exponent: float = 0.0
    lag: float = 0.0
    wander: float = 0.0
    bindings: dict[str, str] = field(default_factory=dict)
    blown: Array | None = None
    extra: dict[str, Array] = field(default_factory=dict)
    columns: dict[str, Array] = field(default_factory=dict)
    heads: dict[str, str] = field(default_factory=dict)
    silent: tuple[str, ...] = ()
    late: float = 0.0
    apart: bool = False

    def text(self, values: dict[str, float]) -> str:
        """Return the deck with some values."""
        lines = ['title = "plant"', 'needs = ["air"]', "[nodes]"]
        lines += [f'{n} = {{ capacitance = {{ value = "{values[n]:.5g} [J/K]", source = "derived" }} }}' for n in self.nodes]
        lines.append("[conductors]")
        for a, b in zip(self.nodes, self.nodes[1:], strict=False):
            lines.append(f'{a}_{b} = {{ kind = "conduction", between = ["{a}", "{b}"], conductance = "{values[f"{a}_{b}"]:.5g} [W/K]" }}')
        for n in self.nodes:
            if f"{n}_skin" in values:
                h = f'"{values[f"{n}_skin"]:.5g} [W/(m^2 K)]"'
                lines.append(f'{n}_skin = {{ kind = "convection", between = ["{n}", "air"], area = "0.02 [m^2]", htc = {h} }}')
        lines.append("[loads]")
        lines += [f'{q} = {{ into = "{n}", power = "{values[q]:.5g} [W]" }}' for q, n in self.loads.items()]
        return "\n".join(lines) + "\n"


def plant(rng: np.random.Generator, parts: int = 0, hidden: bool = False, heaters: int = 0) -> Plant:
    """Return a random plant whose log shows its heater on, off and on again at another power."""
    count = parts or int(rng.integers(2, 5))
    nodes = ["core", "frame", "lid", "foot", "rail", "cover"][:count]
    truth = {n: float(np.exp(rng.uniform(np.log(80.0), np.log(900.0)))) for n in nodes}
    truth |= {f"{a}_{b}": float(np.exp(rng.uniform(np.log(0.15), np.log(1.5)))) for a, b in pairwise(nodes)}
    truth |= {f"{n}_skin": float(rng.uniform(5.0, 14.0)) for n in nodes if n != "core" or count == 2}
    loads = {"heater": "core"} | ({"drive": nodes[-1]} if (heaters or int(rng.integers(1, 3))) == 2 else {})
    truth |= {q: float(rng.uniform(2.0, 7.0)) for q in loads}
    deck = {k: v * float(np.exp(0.3 * rng.standard_normal())) for k, v in truth.items()} | {q: round(truth[q], 1) for q in loads}
    skins = sum(0.02 * v for k, v in truth.items() if k.endswith("_skin"))
    slowest = sum(truth[n] for n in nodes) / skins
    step = float(max(5.0, round(slowest / 60.0 / 5.0) * 5.0))
    times = np.arange(0.0, rng.uniform(3.0, 4.5) * slowest, step)
    power = {}
    for k, q in enumerate(loads):
        a, b, c = (times[-1] * (x + 0.07 * k) for x in (0.06, 0.5, 0.72))
        watts = truth[q] * np.where((times >= a) & (times < b), 1.0, np.where(times >= c, rng.uniform(0.4, 0.7), 0.0))
        power[q] = watts
    air = 21.0 + rng.uniform(-2.0, 4.0) + 0.4 * np.sin(2 * np.pi * times / times[-1] * rng.uniform(0.7, 1.6)) + ICE
    seen = [n for n in nodes if not (hidden and n == nodes[1])]
    return Plant(rng, nodes, loads, deck, truth, times, power, air, {f"T_{n}": n for n in seen}, float(rng.uniform(0.03, 0.08)))


def run(p: Plant) -> dict[str, Array]:
    """Return the hidden temperatures of every node. [K]"""
    blown = np.zeros(p.times.size, dtype=bool) if p.blown is None else p.blown
    cuts = [0, *(1 + np.flatnonzero(np.diff(blown.astype(int)))).tolist(), p.times.size - 1]
    out = {n: np.zeros(p.times.size) for n in p.nodes}
    start = dict.fromkeys(p.nodes, td.quantity(p.air[0], unit="K"))
    for first, last in pairwise(cuts):
        factor = 2.4 if blown[first] else 1.0
        values = p.truth | {k: factor * v for k, v in p.truth.items() if k.endswith("_skin")}
        text = p.text(values)
        if p.exponent:  # natural convection of the same strength at a rise of 10 K
            for k in (k for k in values if k.endswith("_skin")):
                law = f'htc = {{ coefficient = "{values[k] / 10.0**p.exponent:.5g} [W/(m^2 K)]", exponent = "{p.exponent:.3g}" }}'
                text = text.replace(f'htc = "{values[k]:.5g} [W/(m^2 K)]"', law)
        for n in p.extra:
            text += f'unlogged_{n} = {{ into = "{n}", power = "1 [W]" }}\n'
        model = _model(text)
        at = p.times[first : last + 1] - p.times[first]
        here = slice(first, last + 1)
        loads = {q: TableSignal(at, w[here], hold=True) for q, w in p.power.items()}
        loads |= {f"unlogged_{n}": TableSignal(at, w[here], hold=True) for n, w in p.extra.items()}
        scenario = td.Scenario(
            "hidden", boundaries={"air": (at, td.quantity(p.air[here], unit="K"))}, loads=loads, initial=start, duration=float(at[-1])
        )
        done = td.simulate(model, scenario, times=at)
        for n in p.nodes:
            out[n][here] = done[n].kelvin
        start = {n: td.quantity(out[n][last], unit="K") for n in p.nodes}
    return out


def _model(text: str) -> td.Model:
    return td.model_from_dict(tomllib.loads(text))


def write(p: Plant, folder: Path, mistake: Callable[[Plant], None] | None = None) -> Path:
    """Write deck, log and campaign, and return the path of the campaign; a mistake acts on the readings."""
    folder.mkdir(parents=True, exist_ok=True)
    found, size = run(p), p.times.size
    for s, n in p.sensors.items():
        seen = found[n].copy()
        if p.lag:
            for k in range(1, size):
                seen[k] = seen[k - 1] + (1.0 - np.exp(-(p.times[1] - p.times[0]) / p.lag)) * (found[n][k] - seen[k - 1])
        slow = np.zeros(size)
        for k in range(1, size):
            slow[k] = 0.98 * slow[k - 1] + p.wander * 0.2 * p.rng.standard_normal()
        p.columns[s] = seen - ICE + p.noise * p.rng.standard_normal(size) + slow + 0.1 * p.rng.standard_normal()
    p.columns["T_AIR"] = p.air - ICE + 0.02 * p.rng.standard_normal(size)
    p.columns |= {f"P_{q}": w.copy() for q, w in p.power.items() if q not in p.silent}
    p.columns = {"time_s": p.times.copy(), **p.columns}
    p.heads |= {c: "degC" for c in p.columns if c.startswith("T_")} | {c: "W" for c in p.columns if c.startswith("P_")}
    p.bindings = {s: f'{{ node = "{n}", noise = "{p.noise:.3g} [K]", accuracy = "0.2 [K]" }}' for s, n in p.sensors.items()}
    p.bindings |= {"T_AIR": '{ boundary = "air" }'} | {f"P_{q}": f'{{ load = "{q}" }}' for q in p.power if q not in p.silent}
    if mistake is not None:
        mistake(p)
    (folder / "thermid.toml").write_text("")
    (folder / "plant.toml").write_text(p.text(p.deck))
    _logs(p, folder)
    free = [f"{n}.capacitance" for n in p.nodes]
    free += [f"{a}_{b}.conductance" for a, b in pairwise(p.nodes)]
    free += [f"{k}.htc" for k in p.truth if k.endswith("_skin")]
    own = {c: b for c, b in p.bindings.items() if not (p.apart and c.startswith("P_"))}
    lines = ['title = "plant"', 'note = "Synthetic."', "[records.bench]", 'file = "bench.csv"', 'time = "time_s"']
    lines += ['joined = { record = "supply", offset = "0 [s]" }'] if p.apart else []
    lines += ["[records.bench.channels]", *(f"{c} = {b}" for c, b in own.items())]
    if p.apart:
        other = {c: b for c, b in p.bindings.items() if c.startswith("P_")}
        lines += ["[records.supply]", 'file = "supply.csv"', 'time = "time_s"', "[records.supply.channels]"]
        lines += [f"{c} = {b}" for c, b in other.items()]
    lines += ["[[stages]]", 'name = "plant"', 'model = "plant.toml"', 'records = ["bench"]', f"free = {free}".replace("'", '"')]
    path = folder / "campaign.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def _logs(p: Plant, folder: Path) -> None:
    names = {"bench.csv": [c for c in p.columns if not (p.apart and c.startswith("P_"))]}
    if p.apart:
        names["supply.csv"] = ["time_s", *(c for c in p.columns if c.startswith("P_"))]
    for file, columns in names.items():
        heads = [f"{c} [{p.heads[c]}]" if c in p.heads else c for c in columns]
        rows = np.column_stack([p.columns[c] for c in columns])
        body = "\n".join(",".join(f"{v:.4f}" for v in row) for row in rows)
        (folder / file).write_text("# SYNTHETIC\n" + ",".join(heads) + "\n" + body + "\n")


# ---- mistakes of the bench and of the file: (what happens before the run, what happens to the readings), and the answer


def _per_cent(load: str, unit: bool) -> Callable[[Plant], None]:
    def mistake(p: Plant) -> None:
        column = f"P_{load}"
        p.columns[column] = 87.0 * p.columns[column] / p.columns[column].max()
        p.deck[load] = p.truth[load] / 0.87
        if not unit:
            del p.heads[column]

    return mistake


def _exchanged(a: str, b: str) -> Callable[[Plant], None]:
    def mistake(p: Plant) -> None:
        p.columns[a], p.columns[b] = p.columns[b], p.columns[a]

    return mistake


def _fahrenheit(*names: str) -> Callable[[Plant], None]:
    def mistake(p: Plant) -> None:
        for c in names or [c for c in p.columns if c.startswith("T_")]:
            p.columns[c] = 1.8 * p.columns[c] + 32.0

    return mistake


def _scaled(column: str, factor: float) -> Callable[[Plant], None]:
    def mistake(p: Plant) -> None:
        p.columns[column] = factor * p.columns[column]

    return mistake


def _late(p: Plant) -> None:
    shift = p.late * p.times[-1]
    for c in (c for c in p.columns if c.startswith("P_")):
        at = np.searchsorted(p.times, p.times - shift, side="right") - 1
        p.columns[c] = p.columns[c][np.clip(at, 0, p.times.size - 1)]


def _fallen(sensor: str, since: float, share: float) -> Callable[[Plant], None]:
    def mistake(p: Plant) -> None:
        first = int(since * p.times.size)
        seen, room = p.columns[sensor], p.columns["T_AIR"]
        loose = share * (1.0 - np.exp(-(p.times - p.times[first]) / 40.0))
        p.columns[sensor] = np.where(p.times >= p.times[first], seen + loose * (room - seen), seen)

    return mistake


def _spans(p: Plant, first: float, last: float) -> Array:
    return np.asarray((p.times >= first * p.times[-1]) & (p.times < last * p.times[-1]))


@dataclass(frozen=True)
class Planted:
    """A campaign with a mistake: the kind and the name that its first suspect must have."""

    kind: str
    name: str
    path: Path


def planted(k: int, seed: int, folder: Path) -> Planted:
    """Write the k-th of 24 campaigns with a mistake."""
    rng = np.random.default_rng([seed, k])
    kind, variant = divmod(k, 3)
    return (_cents, _columns, _units, _places, _powers, _clocks, _sensors, _fans)[kind](variant, rng, folder)


def _cents(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, hidden=v == 1, parts=(0, 3, 2)[v], heaters=(1, 1, 2)[v])
    load = ("heater", "heater", "drive")[v]
    return Planted("per cent", f"P_{load}", write(p, folder, _per_cent(load, unit=v == 1)))


def _columns(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, parts=(3, 2, 3)[v], heaters=(1, 1, 2)[v])
    a, b = (("T_frame", "T_core"), ("T_frame", "T_AIR"), ("P_drive", "P_heater"))[v]
    return Planted("exchanged", f"{a}, {b}", write(p, folder, _exchanged(a, b)))


def swapped(k: int, seed: int, folder: Path, exchange: bool = True) -> Planted:
    """Write the k-th bench of three to six masses with two temperatures exchanged, or none; its powers stand on another clock."""
    rng = np.random.default_rng([seed, 77, k])
    p = plant(rng, parts=3 + k % 4, heaters=2)
    p.apart = True
    a, b = (f"T_{n}" for n in rng.choice(p.nodes, 2, replace=False))
    path = write(p, folder, _exchanged(a, b) if exchange else None)
    path.write_text(path.read_text().replace('offset = "0 [s]"', 'offset = ["-60 [s]", "60 [s]"]'))
    return Planted("exchanged", f"{a}, {b}", path)


def _units(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, heaters=1)
    if v == 0:
        return Planted("unit", "T_frame", write(p, folder, _fahrenheit("T_frame")))
    if v == 1:
        return Planted("unit", "P_heater", write(p, folder, _scaled("P_heater", 1000.0)))
    return Planted("unit", "time_s", write(p, folder, _scaled("time_s", 1.0 / 60.0)))


def _places(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, parts=(3, 4, 4)[v], heaters=1)
    at, said = (("core", "lid"), ("foot", "core"), ("foot", "lid"))[v]
    p.sensors = {s: n for s, n in p.sensors.items() if n != said}

    def mistake(p: Plant) -> None:
        p.bindings[f"T_{at}"] = p.bindings[f"T_{at}"].replace(f'"{at}"', f'"{said}"')

    return Planted("node", f"T_{at}", write(p, folder, mistake))


def _powers(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, parts=(3, 0, 2)[v], heaters=(1, 2, 1)[v])
    if v == 1:  # a load of the deck that was off
        p.power["drive"] = np.zeros(p.times.size)
        p.silent = ("drive",)
        return Planted("load", "drive", write(p, folder))
    node, first, last = (("frame", 0.3, 2.0), ("core", 0.5, 0.7))[v // 2]
    p.extra[node] = float(0.5 * p.truth["heater"]) * _spans(p, first, last)
    return Planted("load", node, write(p, folder))


def _clocks(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, parts=(2, 3, 0)[v], heaters=(1, 2, 1)[v])
    p.apart, p.late = v != 1, (0.04, -0.05, 0.08)[v]
    return Planted("clock", ", ".join(f"P_{q}" for q in p.loads), write(p, folder, _late))


def _sensors(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, parts=(2, 3, 4)[v], heaters=(1, 1, 2)[v])
    sensor, since, share = (("T_core", 0.3, 0.95), ("T_frame", 0.8, 0.6), ("T_lid", 0.42, 1.0))[v]
    return Planted("sensor", sensor, write(p, folder, _fallen(sensor, since, share)))


def _fans(v: int, rng: np.random.Generator, folder: Path) -> Planted:
    p = plant(rng, parts=(2, 3, 4)[v], heaters=1)
    p.blown = _spans(p, *((0.3, 2.0), (0.25, 0.5), (0.8, 2.0))[v])
    return Planted("fan", "air", write(p, folder))


def clean(k: int, seed: int, folder: Path) -> Path:
    """Write a campaign without a mistake; in two of five the model, the sensor or its noise is not quite what the deck says."""
    rng = np.random.default_rng([seed, 1000 + k])
    p = plant(rng, hidden=k % 3 == 1)
    p.exponent = float(rng.uniform(0.1, 0.25)) if k % 5 == 0 else 0.0
    p.lag = 2.0 * p.times[1] if k % 5 == 1 else 0.0
    p.wander = p.noise if k % 5 == 2 else 0.0
    return write(p, folder)
