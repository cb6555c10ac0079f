"""Small linear hierarchies on disk: leaves with one conductance to the air, units that join parts, logs of each, and their campaigns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from thermid.base.units import quantity
from thermid.measure.records import Channel, Record
from thermid.model.tree import Model, load_model
from thermid.simulation.runs import Scenario, simulate
from unit.fit.project import write_log

DECK = "0.30 [W/K]"


@dataclass(frozen=True)
class Part:
    """A deck: a leaf without parts, or a unit of parts; `definition` is its file's stem, the same for twins.

    Parameters
    ----------
    truth : dict    Its own conductances -> true value. [W/K]
    parts : dict    Name -> Part.
    sets : dict     Path below -> value that its [set] gives.
    """

    definition: str
    truth: Mapping[str, float]
    parts: Mapping[str, Part] = field(default_factory=dict)
    sets: Mapping[str, str] = field(default_factory=dict)

    @property
    def top(self) -> str:
        """The node that it offers."""
        return "body" if self.parts else "n"

    def text(self) -> str:
        """The deck."""
        lines = [f'title = "{self.definition}"', 'needs = ["air"]', f'offers = ["{self.top}"]', ""]
        for name, part in self.parts.items():
            lines.append(f'[submodels.{name}]\nuse = "{part.definition}.toml"\nbind = {{ air = "air" }}\n')
        lines.append(f'[nodes.{self.top}]\ncapacitance = "100 [J/K]"\n')
        for name in self.truth:
            ends = f"{name.removeprefix('to_')}.{self.parts[name.removeprefix('to_')].top}" if name.startswith("to_") else "air"
            lines.append(f'[conductors.{name}]\nkind = "conduction"\nbetween = ["{self.top}", "{ends}"]')
            lines.append(f'conductance = {{ value = "{DECK}", min = 0.001, max = 50 }}\n')
        lines.append(f'[loads.heat]\ninto = "{self.top}"\npower = "1 [W]"\n')
        if self.sets:
            lines += ["[set]", *(f'"{p}" = "{v}"' for p, v in self.sets.items())]
        return "\n".join(lines)

    def every(self, prefix: str = "") -> Iterator[tuple[str, Part]]:
        """Yield prefix and part of it and of all below."""
        yield prefix, self
        for name, part in self.parts.items():
            yield from part.every(f"{prefix}{name}.")

    def values(self) -> dict[str, float]:
        """Path -> true conductance. [W/K]"""
        return {f"{prefix}{name}.conductance": g for prefix, part in self.every() for name, g in part.truth.items()}

    def nodes(self) -> list[str]:
        """Every node."""
        return [prefix + part.top for prefix, part in self.every()]


def leaf(definition: str, g: float) -> Part:
    """A node with one conductance to the air."""
    return Part(definition, {"g": g})


def joined(definition: str, parts: Mapping[str, Part], truth: Sequence[float], sets: Mapping[str, str] | None = None) -> Part:
    """A unit: a body with a conductance to each part, and one to the air."""
    names = [*(f"to_{n}" for n in parts), "e"]
    return Part(definition, dict(zip(names, truth, strict=True)), parts, sets or {})


def write_decks(folder: Path, *roots: Part) -> None:
    """Write the deck of every part."""
    (folder / "thermid.toml").write_text("")
    for root in roots:
        for _, part in root.every():
            (folder / f"{part.definition}.toml").write_text(part.text())


def record_of(
    model: Model, truth: Mapping[str, float], nodes: Sequence[str], name: str, seed: int, noise: float, bias: Mapping[str, float]
) -> Record:
    """A warm-up in still air, 41 samples of every node; sensors err by `bias`. [K]"""
    times = np.linspace(0.0, 6000.0, 41)
    hidden = model.with_values({p: f"{g!r} [W/K]" for p, g in truth.items()})
    air = np.full(times.size, 295.0)
    run = simulate(
        hidden, Scenario(name, boundaries={"air": (times, quantity(air, unit="K"))}, start="295 [K]", duration=6000.0), times=times
    )
    rng = np.random.default_rng(seed)
    seen = {f"T_{n.replace('.', '_')}": run[n].kelvin + noise * rng.standard_normal(times.size) for n in nodes} | {"AIR": air}
    return Record.from_arrays(name, times, {c: Channel.from_array(c, values + bias.get(c, 0.0), unit="K") for c, values in seen.items()})


def write_logs(folder: Path, tested: Sequence[Part], noise: float = 0.02, seed: int = 1, bias: Mapping[str, float] | None = None) -> None:
    """Write a log of each part, at its truth."""
    for k, part in enumerate(tested):
        name = part.definition
        record = record_of(load_model(folder / f"{name}.toml"), part.values(), part.nodes(), name, seed + k, noise, bias or {})
        write_log(record, folder / "logs" / f"{name}.csv")


def record_table(part: Part, noise: float = 0.02, accuracy: str = "") -> str:
    """The table of a log in a campaign; `accuracy` is that of every channel."""
    more, name = f', accuracy = "{accuracy}"' if accuracy else "", part.definition
    channels = [f'T_{n.replace(".", "_")} = {{ node = "{n}", noise = "{noise} [K]"{more} }}' for n in part.nodes()]
    lines = [f"[records.{name}]", f'file = "logs/{name}.csv"', 'time = "time_s"', f"[records.{name}.channels]"]
    return "\n".join([*lines, *channels, f'AIR = {{ boundary = "air"{more} }}', ""])


def stage_table(name: str, part: Part, free: Sequence[str], inherit: str = "", more: str = "") -> str:
    """The table of a stage in a campaign."""
    rows = [f'name = "{name}"', f'model = "{part.definition}.toml"', f'records = ["{part.definition}"]']
    listed = ", ".join(f'"{p}"' for p in free)
    rows.append(f"free = [{listed}]")
    rows += [f"inherit = {{ {inherit} }}"] if inherit else []
    return "\n".join(["[[stages]]", *rows, *([more] if more else []), ""])
