"""How often `calibrate` blames the log where the model is what misfits: real logs under plain decks, and synthetic plants.

Run it as ``python scripts/accused_logs.py --count 100``. A real log is fitted with the two or three masses that a plain engineer would
draw (``--data``: the folder of the public sets). A synthetic plant has a mass, a link, a lag or a law that its deck lacks. None of these
logs has a mistake, so every name is a false accusation; one plant in thirty-three may be accused. Beside them stand the planted mistakes
of tests/recovery/mistaken.py, each of which must be named first, by the result or by the refusal of a fit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.fit.calibration import LocalSpec, Request
from thermid.inference.criticism import Mistakes, find_mistakes

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))
DATA = ROOT.parent / "shared" / "data"
SEED = 20261124
LACKS = ("mass", "link", "lag", "law")
"""What the deck of a synthetic plant does not have."""
PLANTED = 24
"""Planted mistakes: three of each kind."""
WATT = 0.01
"""Power of a heater of the board at one per cent of its command. [W]"""


def _board(heaters: int) -> td.Model:
    """Return a body per heater, each with a skin to the room, two of them joined."""
    nodes = [f"h{k + 1}" for k in range(heaters)]
    skin = {n: {"kind": "convection", "between": [n, "room"], "area": "10 [cm^2]", "htc": "10 [W/(m^2 K)]"} for n in nodes}
    tie = {"tie": {"kind": "conduction", "between": nodes, "conductance": "0.01 [W/K]"}} if heaters == 2 else {}
    return td.model_from_dict(
        {
            "title": "board",
            "needs": ["room"],
            "nodes": {n: {"capacitance": "4 [J/K]"} for n in nodes},
            "conductors": {f"skin_{n}": row for n, row in skin.items()} | tie,
            "loads": {f"q{n}": {"into": n, "power": "0.8 [W]"} for n in nodes},
        }
    )


def _tclab(file: Path, noise: float) -> Request:
    """Return a fit of a log of the two-heater board."""
    table = np.genfromtxt(file, delimiter=",", names=True)
    if file.name.endswith(".gz"):  # the first two samples of these are no readings
        table = table[2:]
    table = table[np.isfinite(table["T1_C"])][:: max(1, table.size // 2000)]
    columns = table.dtype.names or ()
    heaters = [k for k in (1, 2) if f"T{k}_C" in columns]
    model = _board(len(heaters))
    channels: dict[str, Any] = {}
    for k in heaters:
        channels[f"T{k}"] = td.Channel.from_array(f"T{k}", table[f"T{k}_C"] + 273.15, unit="K", role="node", target=f"h{k}", noise=noise)
        command = next((c for c in (f"Q{k}_pct", f"Q{k}_pwm255") if c in columns), "")
        scale = WATT / (2.55 if command.endswith("255") else 1.0)
        if command:
            channels[f"Q{k}"] = td.Channel.from_array(f"Q{k}", scale * table[command], quantity="power", role="load", target=f"qh{k}")
    warm = float(np.median(table["T1_C"][:3])) > 30.0
    room = {"room": LocalSpec("23 [degC]" if warm else "T1", 0.5)}
    times = table["time_s"] - table["time_s"][0]
    record = td.Record.from_arrays(file.stem, times, channels, synthetic=False)
    idle = {f"qh{k}": "0 [W]" for k in heaters if f"Q{k}" not in channels}
    scenario = td.Scenario(file.stem, loads=idle)
    free = [f"h{k}.capacitance" for k in heaters] + [f"skin_h{k}.htc" for k in heaters] + (["tie.conductance"] if len(heaters) == 2 else [])
    return Request(model, (record,), tuple(free), {"*": scenario}, room, name=file.stem)


def _warm(name: str, times: np.ndarray, celsius: np.ndarray, room: float, watts: float) -> Request:
    """Return a fit of a log that begins warm: one mass with a skin, and a constant power of the deck."""
    skin = {"kind": "convection", "between": ["body", "room"], "area": "0.05 [m^2]", "htc": "8 [W/(m^2 K)]"}
    deck = {"title": name, "needs": ["room"], "nodes": {"body": {"capacitance": "100 [J/K]"}}, "conductors": {"skin": skin}}
    model = td.model_from_dict(deck | {"loads": {"q": {"into": "body", "power": f"{watts} [W]"}}})
    channel = td.Channel.from_array("T", celsius + 273.15, unit="K", role="node", target="body", noise=0.3)
    record = td.Record.from_arrays(name, times - times[0], {"T": channel}, synthetic=False)
    free, local = ("body.capacitance", "skin.htc"), {"room": LocalSpec(f"{room!r} [degC]", 2.0)}
    return Request(model, (record,), free, {"*": td.Scenario(name)}, local, name=name)


def real(data: Path) -> Iterator[tuple[str, Request]]:
    """Yield fits of real logs."""
    for file in sorted((data / "uconsole_cm5_enclosure").glob("*.csv")):
        table = np.genfromtxt(file, delimiter=",", names=True, usecols=(0, 2))
        yield file.stem, _warm(file.stem, table["t_s"], table["temp_c"], 26.0, 3.0)
    for file in sorted((data / "lhs1_vacuum_cooling" / "processed").glob("*.csv")):
        table = np.genfromtxt(file, delimiter=",", names=True, usecols=range(5))
        for column in ("T_bmp_C", "T_mcp_C"):
            warm = table[int(np.argmax(table[column])) :]
            yield f"{file.stem[:5]} {column}", _warm("cube", warm["t_s"], warm[column], float(warm[column].min()), 0.0)
    yield "step down", _tclab(data / "tclabsp" / "step" / "ensH1_050_000_en1.csv.gz", 0.3)
    small = data / "tclab_apmonitor_arduino"
    files = [*(sorted(small.glob("*.csv"))), data / "tclab_apmonitor_pds" / "tclab_data.csv"]
    files += [min(folder.glob("*.csv*")) for folder in sorted((data / "tclabsp").iterdir()) if folder.is_dir()]
    for file in files:
        yield file.stem, _tclab(file, 0.3)


def synthetic(k: int, folder: Path) -> Path:
    """Write the k-th plant whose deck lacks something, and return its campaign."""
    from recovery.mistaken import plant, write

    rng = np.random.default_rng([SEED, k])
    p = plant(rng, hidden=k % 3 == 1)
    lack, whole = LACKS[k % 4], p.text

    def text(values: dict[str, float]) -> str:
        """Return the hardware, which has more than the deck."""
        said = whole(values)
        if values is p.deck:
            return said
        mass, link = p.truth[p.nodes[0]], p.truth[f"{p.nodes[0]}_{p.nodes[1]}"]
        ends, size = (p.nodes[-1], "ballast") if lack == "mass" else (p.nodes[0], "air"), link * (1.0 if lack == "mass" else 0.3 * more)
        if lack == "mass":
            said = said.replace("[conductors]", f'ballast = {{ capacitance = "{more * mass:.5g} [J/K]" }}\n[conductors]')
        return f'{said}[conductors.hidden]\nkind = "conduction"\nbetween = ["{ends[0]}", "{ends[1]}"]\nconductance = "{size:.5g} [W/K]"\n'

    more = float(rng.uniform(1.0, 4.0))
    if lack in ("mass", "link"):
        p.text = text  # type: ignore[method-assign]
    if lack == "lag":
        p.lag = float(rng.uniform(6.0, 20.0)) * float(p.times[1])
    if lack == "law":
        p.exponent = float(rng.uniform(0.25, 0.33))
    return write(p, folder)


def planted_mistakes(folder: Path) -> None:
    """Print what is named first of each planted mistake."""
    from recovery.mistaken import planted
    from recovery.test_mistakes_named import SEED, judged, named

    said = []
    for k in range(PLANTED):
        case = planted(k, SEED, folder / f"planted {k}")
        said.append(judged(case, named(case.path)))
        print(f"{k} {case.kind} {case.name}: {'' if said[-1] == 'named' else 'MISSED '}{said[-1]}", flush=True)
    print(f"planted: {said.count('named')} named first of {PLANTED}")


def asked(campaign: Path) -> Mistakes:
    """Return what a campaign says of mistakes."""
    return td.run_stages(campaign).mistakes["plant"]


def main() -> None:
    """Print every accusation, and how many there are."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=100, help="synthetic plants")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the public sets")
    options = parser.parse_args()
    began, accused, bad, seen = time.process_time(), 0, 0, 0

    def tell(name: str, found: Mistakes | ThermidError) -> None:
        nonlocal accused, bad, seen
        seen += 1
        if isinstance(found, ThermidError):
            accused += "ikely mistake" in str(found)
            print(f"{name}: no fit: {found}")
            return
        bad += found.bad
        accused += bool(found.named)
        said = "; ".join(str(m) for m in found.named[:2]) or found.failed or ("misfits" if found.bad else "fits")
        print(f"{name}: {'ACCUSED ' if found.named else ''}{said}", flush=True)

    for name, request in real(options.data) if options.data.is_dir() else ():
        tell(name, find_mistakes(request))
    print(f"real: {accused} accused of {seen}, {bad} misfit")
    before = accused, bad, seen
    with tempfile.TemporaryDirectory() as folder:
        for k in range(options.first, options.first + options.count):
            try:
                tell(f"{k} {LACKS[k % 4]}", asked(synthetic(k, Path(folder) / str(k))))
            except ThermidError as error:
                tell(f"{k} {LACKS[k % 4]}", error)
        print(f"synthetic: {accused - before[0]} accused of {seen - before[2]}, {bad - before[1]} misfit")
        planted_mistakes(Path(folder))
    print(f"{time.process_time() - began:.0f} s")


if __name__ == "__main__":
    main()
