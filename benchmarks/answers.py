"""What `same.py` keeps, by group: random networks, runs of FMUs, predictions, the shipped studies, the other examples.

Each group makes pairs of a name and an answer: numbers as an array, a document or what was printed as text. Only public names and the
command line are used, so that what one state of the code kept can be compared with another. Where something is refused, that it was
is kept and not the words.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import thermid as td

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests"))

from fuzz.contestants import CONTESTANTS
from fuzz.networks import draw
from torture.elements import network

Array = NDArray[np.float64]
Answers = Iterator[tuple[str, Array | str]]

FUZZED, DECKS = 110, 90
"""Random networks, row by row and as decks: ten of each family of tests/fuzz, and 90 of every kind of element."""
MEMBERS = 9
"""Of an ensemble: more than the widest lanes hold."""


def rows() -> Answers:
    """Networks of scripts/fuzz.py: by the kernel, with sensitivities, in lanes, by `simulate`, by the integrator of large networks."""
    for seed in range(FUZZED):
        case = draw(seed)
        for who in ("kernel", "sensitive", "lanes", "public", "large"):
            found = CONTESTANTS[who](case)
            name = f"{seed} {case.family}, {who}"
            yield f"{name}, status", found.status
            if found.traces is not None:
                yield f"{name}, temperatures", found.traces
            if found.slopes is not None:
                yield f"{name}, sensitivities", found.slopes


def _deck(seed: int) -> tuple[td.Model, td.Scenario, list[str], Array]:
    """Return a random deck with events, controls, streams and stores, its scenario, its nodes and 41 times [s]."""
    drawn = network(seed)
    given = {name: value for name, value in drawn.scenario.items() if value != {}}
    times = np.linspace(0.0, drawn.scenario["duration"], 41)
    return td.model_from_dict(drawn.deck), td.Scenario("random", start=td.quantity(drawn.start, unit="K"), **given), drawn.nodes, times


def decks() -> Answers:
    """Decks of every kind of element: temperatures, extremes, heat, switchings, sensitivities, and members in lanes."""
    for seed in range(DECKS):
        model, scenario, nodes, times = _deck(seed)
        simulator = td.prepare(model, scenario, ("n0.capacitance", "q0.power", "initial.n0"), times=times)
        run = simulator.run(sensitivities=True)
        yield f"{seed}, temperatures", run.temperatures
        extremes = [x for n in nodes for x in (run[n].maximum, run[n].minimum)]
        yield f"{seed}, extremes", np.array([(x.kelvin, x.time) for x in extremes])
        heat = run.heat_balance()
        yield f"{seed}, heat", np.array([heat.loads, heat.boundaries, heat.stored, heat.residual])
        yield f"{seed}, switchings", np.array([t for t, _ in run.statistics.get("switchings", ())])
        yield f"{seed}, sensitivities", np.stack([run.sensitivity(n, p) for n in nodes for p in simulator.free])
        rng = np.random.default_rng(seed)
        drawn = {p: simulator.nominal[p] * np.exp(0.05 * rng.standard_normal(MEMBERS)) for p in simulator.free}
        draws = drawn | {"initial.n0": td.quantity(drawn["initial.n0"], unit="K")}
        members = simulator.ensemble(draws)
        yield f"{seed}, members", np.stack([members.temperatures(n) for n in nodes])
        yield f"{seed}, members, highest", np.stack([members.highest(n) for n in nodes])


FMUS = (0, 2, 3, 5, 11, 19, 22)
"""Random decks that FMPy runs: a stream, controls, a melt that supercools, pulses, a duct, thermostats."""


def fmus() -> Answers:
    """FMUs of random decks by FMPy, as model exchange and as co-simulation."""
    import fmpy

    for seed in FMUS:
        model, scenario, nodes, times = _deck(seed)
        with TemporaryDirectory() as folder:
            file = Path(folder) / "network.fmu"
            td.interop.to_fmu(model, scenario, file)
            for form in ("ModelExchange", "CoSimulation"):
                found = fmpy.simulate_fmu(
                    str(file),
                    fmi_type=form,
                    stop_time=float(times[-1]),
                    output_interval=float(times[1]),
                    relative_tolerance=1e-8,
                    output=[f"T.{n}" for n in nodes],
                )
                yield f"{seed}, {form}", np.stack([found[name] for name in ("time", *(f"T.{n}" for n in nodes))])


@dataclass(frozen=True)
class Bench:
    """What is fitted on a bench, and asked about elsewhere.

    Parameters
    ----------
    truth, model : Model    What makes the log, and what is fitted to it.
    free : tuple of str     Values of the model that the log decides.
    sensors : tuple of str  Nodes with a sensor.
    limit : str             Limit of the first of them, in a hot place. [degC]
    """

    truth: td.Model
    model: td.Model
    free: tuple[str, ...]
    sensors: tuple[str, ...]
    limit: str

    def fitted(self, seed: int) -> td.Calibration:
        """Return the fit to two hours of readings with noise of 0.05 K."""
        times, rng = np.arange(0.0, BENCH.seconds + 1.0, 60.0), np.random.default_rng(seed)
        run = td.simulate(self.truth, BENCH, times=times)
        channels = {
            f"T_{n}": td.Channel.from_array(
                f"T_{n}", run[n].kelvin + 0.05 * rng.standard_normal(times.size), unit="K", role="node", target=n, noise=0.05, accuracy=0.2
            )
            for n in self.sensors
        }
        return td.calibrate(self.model, td.Record.from_arrays("log", times, channels), list(self.free), scenario=BENCH)


BENCH = td.Scenario("bench", {"air": "24 [degC]"}, {"heat": "2.5 [W]"}, start="24 [degC]", duration="2 [h]")
HOT = BENCH.with_(title="hot", boundaries={"air": "40 [degC]"}, loads={"heat": "6 [W]"}, start="40 [degC]", duration="1 [h]")
SWINGS = BENCH.with_(
    title="swings",
    boundaries={"air": {"mean": "24 [degC]", "amplitude": "4 [K]", "period": "40 [min]"}},
    loads={"heat": {"times": ["0 [s]", "30 [min]", "1 [h]"], "values": ["5 [W]", "0 [W]", "3 [W]"], "hold": True, "after": "hold"}},
)
SPREAD = {"air": "1 [K]", "scale.heat": "3 [%]"}


def _free(value: float, unit: str) -> dict[str, Any]:
    """Return a value that a fit may move within a decade or so."""
    return {"value": f"{value} [{unit}]", "min": 0.2 * value, "max": 6.0 * value}


def _plate(surface: dict[str, Any], **more: Any) -> td.Model:
    """Return a heated plate with a surface in air; `more` adds groups of the deck."""
    deck = {
        "title": "plate",
        "needs": ["air"],
        "nodes": {"plate": {"capacitance": _free(600.0, "J/K")}, **more.pop("nodes", {})},
        "surfaces": {"skin": {"of": "plate", "to": "air", "area": "0.05 [m^2]", **surface}},
        "loads": {"heat": {"into": "plate", "power": "2.5 [W]"}, **more.pop("loads", {})},
    }
    return td.model_from_dict(deck | more)


def benches() -> dict[str, Bench]:
    """Return a model that is wrong, one that is right, a gap with gas in it, two nodes, and a thermostat."""
    natural = {"coefficient": _free(2.8, "W/(m^2 K)"), "exponent": 0.25}
    constant, grey = {"htc": _free(5.0, "W/(m^2 K)")}, {"htc": natural, "emissivity": {"value": "0.5", "min": 0, "max": 1}}
    gap = {"kind": "contact", "between": ["plate", "foot"], "contact_conductance": _free(300.0, "W/(m^2 K)"), "area": "2 [cm^2]"}
    spots = gap | {"contact_conductance": "260 [W/(m^2 K)]", "gap": "100 [um]"}
    foot = {"nodes": {"foot": {"capacitance": "150 [J/K]"}}}
    leak = {"kind": "conduction", "between": ["foot", "air"], "conductance": _free(0.1, "W/K")}
    strap = {"kind": "conduction", "between": ["plate", "foot"], "conductance": _free(0.5, "W/K")}
    limits = {"sensor": "plate", "on_below": "30 [degC]", "off_above": "31 [degC]"}
    heater = {"heater": {"into": "plate", "power": "8 [W]", "thermostat": limits}}
    pair = _plate(constant, **foot, conductors={"strap": strap, "leak": leak})
    return {
        "constant": Bench(_plate({"htc": natural}), _plate(constant), ("skin.htc", "plate.capacitance"), ("plate",), "54 [degC]"),
        "natural": Bench(_plate(grey), _plate(grey), ("skin.htc.coefficient", "plate.capacitance"), ("plate",), "54 [degC]"),
        "gap": Bench(
            _plate(constant, **foot, conductors={"gap": spots, "leak": leak}),
            _plate(constant, **foot, conductors={"gap": gap, "leak": leak}),
            ("gap.contact_conductance", "plate.capacitance"),
            ("plate", "foot"),
            "52 [degC]",
        ),
        "pair": Bench(
            pair.with_values({"strap.conductance": "0.7 [W/K]", "leak.conductance": "0.14 [W/K]"}),
            pair,
            ("strap.conductance", "leak.conductance", "skin.htc"),
            ("plate", "foot"),
            "50 [degC]",
        ),
        "thermostat": Bench(
            _plate(constant, loads=heater).with_values({"skin.htc": "6.5 [W/(m^2 K)]"}),
            _plate(constant, loads=heater),
            ("skin.htc", "plate.capacitance"),
            ("plate",),
            "52 [degC]",
        ),
    }


def _bands(told: td.Prediction) -> Array:
    """Return centre, standard error and both ends of the 95 % band (nodes, 4, times)."""
    return np.stack([np.stack([b.kelvin, b.error, *b.interval()]) for b in told.bands.values()])


def predictions() -> Answers:
    """Ten predictions with each of five fits: by derivatives, drawn, without what a fit could not follow, foreseen, held."""
    for seed, (name, bench) in enumerate(benches().items()):
        fit = bench.fitted(seed)
        asked: dict[str, Callable[[], td.Prediction]] = {
            "bench": lambda fit=fit: td.predict(fit, BENCH),
            "hot": lambda fit=fit: td.predict(fit, HOT),
            "hot, spread": lambda fit=fit: td.predict(fit, HOT, spread=SPREAD),
            "hot, drawn": lambda fit=fit: td.predict(fit, HOT, spread=SPREAD, draws=120, seed=3),
            "hot, the fit alone": lambda fit=fit: td.predict(fit, HOT, without=("structural", "misfit")),
            "swings": lambda fit=fit: td.predict(fit, SWINGS, times=np.arange(0.0, SWINGS.seconds + 1.0, 300.0)),
            "swings, drawn": lambda fit=fit: td.predict(fit, SWINGS, spread=SPREAD, draws=60, seed=4),
            "bench, cool": lambda fit=fit: td.predict(fit, BENCH.with_(loads={"heat": "0 [W]"}, start="40 [degC]")),
        }
        for question, answer in asked.items():
            yield f"{name}: {question}", _bands(answer())
        seen = td.design.foresee(td.design.Knowledge.of_source(fit), HOT, spread=SPREAD)
        yield f"{name}: foreseen", _bands(seen.prediction)
        runs = td.qualify.uncertain_runs(fit.model, HOT, fit, spread=SPREAD, n=150, seed=5, nodes=["plate"])
        yield f"{name}: members", runs.node_temperatures("plate")
        point = td.qualify.hold(runs, {"plate": bench.limit}).points[0]
        yield f"{name}: held", np.array([point.hold, *point.between, point.never, *point.never_between, *point.exceedance])


STUDIES = {
    "04_campaign": (
        "python make_logs.py",
        "thermid check campaign.toml --json",
        "thermid calibrate campaign.toml --json",
        "thermid identify campaign.toml --after --json",
        "thermid credibility campaign.toml --json",
        "thermid predict campaign.toml --record 'stack_*' --json",
        "thermid predict campaign.toml --stage EleGFO --record ele_bench --json",
    ),
    "sisnav": (
        "python laboratory.py",
        "thermid check campaign.toml --json",
        "thermid calibrate campaign.toml --json",
        "thermid identify campaign.toml --after --json",
        "thermid credibility campaign.toml --json",
        "thermid predict campaign.toml --record sd_held_out --json",
        "thermid predict campaign.toml --stage m_IMU --record imu_held_out --json",
        "thermid swap campaign.toml pre.ele EleGFO_v2.toml --json",
        "python structures.py natural",
        "thermid calibrate natural/campaign.toml --data . --json",
        "thermid predict natural/campaign.toml --data . --record sd_held_out --json",
        "thermid plan qualification/plan.toml --json",
        "thermid qualify qualification/plan.toml --json",
        "thermid hold macro/hold.toml --members 1000 --json",
        "python macro/macro.py",
        "python two_pressures.py",
    ),
}
"""Folder -> its commands, in the order of work. Left out are tclab and motor, whose measured logs are not in the tree, and bench, whose
logs come from a simulator that has to be built."""

EXAMPLES = {
    "01_accelerometer": (
        "thermid check accelerometer.toml --json",
        "thermid simulate accelerometer.toml --boundary 'air=24 [degC]' --for '5 [h]' --start air --json",
        "python run.py",
    ),
    "02_stack": (
        "thermid check m_PrE.toml --json",
        "thermid simulate m_PrE.toml --boundary 'cv=24 [degC]' --for '5 [h]' --start cv --at '1 [h]' --json",
        "thermid steady m_PrE.toml --boundary 'cv=24 [degC]' --flows --json",
        "python run.py",
    ),
    "03_calibrate": ("python run.py",),
    "05_vacuum": (
        "thermid check accelerometer.toml --json",
        "thermid simulate accelerometer.toml --boundary 'air=24 [degC]' --for '5 [h]' --start air --vacuum --json",
        "python run.py",
    ),
    "06_swap": ("thermid check EleGFO_v2.toml --json", "python run.py"),
    "07_pad": ("thermid check cabinet.toml --json", "thermid simulate cabinet.toml --scenario pad.toml --json", "python run.py"),
    "bench": (
        "thermid check plate.toml --json",
        "thermid simulate plate.toml --boundary 'room=21 [degC]' --for '5 [h]' --start room --json",
    ),
    "box": (
        "thermid check box.toml --json",
        "thermid simulate box.toml --boundary 'room=24 [degC]' --boundary 'mount=30 [degC]' --for '2 [h]' --start mount --json",
        "thermid steady box.toml --boundary 'room=24 [degC]' --boundary 'mount=30 [degC]' --flows --json",
    ),
    "motor": (
        "thermid check motor.toml --json",
        "thermid simulate motor.toml --boundary 'room=22 [degC]' --for '3 [min]' --start room --json",
    ),
    "sisnav": (
        "thermid simulate macro/macro.toml --scenario macro/transport.toml --json",
        "thermid simulate macro/macro.toml --scenario macro/pad.toml --json",
        "thermid simulate m_Sd.toml --boundary 'cv=24 [degC]' --for '5 [h]' --start cv --json",
    ),
    "tclab": ("thermid check board.toml --json",),
    "unknown_power": (
        "thermid check gyro.toml --json",
        "thermid simulate gyro.toml --boundary 'cv=22 [degC]' --for '5 [h]' --start cv --json",
        "python run.py",
    ),
}

REMOVED = (
    ("the day of the run, which values files and documents name", r'(?<=\bdate)("?\s*[:=]\s*)"[^"]*"', r'\1"DATE"'),
    (
        "digests of code, requests and files: some change with any line of code, and what the others stand for is compared itself",
        r"(?<![\w.])(?:[0-9a-f]{64}|[0-9a-f]{32}|[0-9a-f]{16})(?![\w.])",
        "DIGEST",
    ),
    ("the version of thermid", r'(?<=\bversion)("?\s*[:=]\s*)"[^"]*"', r'\1"VERSION"'),
)
"""What is taken out of texts before they are compared: why, the pattern, what stands in its place. The
folder of the copy, which is a new one each time, goes as well. No time that a command took is in any of its documents."""
MADE = ("logs", "hidden", "natural", "results", "out", "__pycache__")
"""What earlier runs may have left beside the examples."""
DONE = (0, 1, 4, 5)
"""Exit codes of commands that have answered: all right, a verdict that failed, data or values that cannot decide."""


def stripped(text: str, folder: Path) -> str:
    """Return a text without what two runs of the same code need not share."""
    text = text.replace(str(folder), "FOLDER")
    for _, pattern, instead in REMOVED:
        text = re.sub(pattern, instead, text)
    return text


def _answered(line: str, folder: Path) -> str:
    """Return what a command prints and its exit code.

    Raises
    ------
    RuntimeError   When it is refused, or ends by an error.
    """
    program, *words = shlex.split(line)
    command = [sys.executable, *(("-m", "thermid") if program == "thermid" else ()), *words]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in DONE or "Traceback" in done.stderr:
        raise RuntimeError(f"{line} in {folder}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return f"{done.stdout}exit code {done.returncode}\n"


def _commands(table: dict[str, tuple[str, ...]]) -> Answers:
    """Run commands in a fresh copy of the examples: what they print, and the values files that they leave."""
    with TemporaryDirectory() as made:
        copy = Path(made).resolve() / "examples"
        shutil.copytree(ROOT / "examples", copy, ignore=shutil.ignore_patterns(*MADE))
        shipped = set(copy.rglob("*.values.toml"))
        for folder, lines in table.items():
            for line in lines:
                yield f"{folder}: {line}", stripped(_answered(line, copy / folder), copy)
        for file in sorted(set(copy.rglob("*.values.toml")) - shipped):
            yield str(file.relative_to(copy)), stripped(file.read_text(encoding="utf-8"), copy)


def studies() -> Answers:
    """The shipped studies, fitted to their synthetic logs: documents and values files."""
    yield from _commands(STUDIES)


def examples() -> Answers:
    """The other examples: what is said of their decks, and runs."""
    yield from _commands(EXAMPLES)


GROUPS: dict[str, Callable[[], Answers]] = {f.__name__: f for f in (rows, decks, fmus, predictions, studies, examples)}
