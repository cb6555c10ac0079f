"""A good file of every kind in one folder, and what reads it: in Python and on the command line."""

# ruff: noqa: E501  # lines of files and tables

from __future__ import annotations

import gzip
import json
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

import thermid as td
from thermid.bench.bench_files import load_programme, load_sensors
from thermid.campaign._judge.verdict import _read as read_looks, look
from thermid.campaign.stages import CampaignSource, KeptStage, load_limits
from thermid.interop.initfcn import read_initfcn
from thermid.measure.readers import read_plain
from thermid.values.store import FittedValue, FittedValues
from torture.elements import network
from torture.mutants import _toml
from unit.measure.samples import excel, labview_with_x, tdms
from unit.qualify.project import PLAN, project

DECK = """title = "unit"
needs = ["air", "plate"]
offers = ["case"]
aliases = { T1 = "case" }

[parameters]
side = "8 [cm]"
share = { value = 0.4, min = 0.1, max = 0.9, source = "assumed", note = "a guess" }

[nodes]
case = { mass = "120 [g]", specific_heat = "900 [J/(kg K)]", reference_point = true }
chip = { capacitance = "5 [J/K]" }
foot = {}

[surfaces.skin]
of = "case"
to = "air"
area = "2*side**2"
htc = { coefficient = "1.5 [W/(m^2 K)]", exponent = 0.25 }
emissivity = 0.8

[conductors]
pad = { kind = "contact", between = ["chip", "case"], contact_conductance = "900 [W/(m^2 K)]", area = "3 [cm^2]" }
strap = { kind = "conduction", between = ["case", "foot"], conductivity = "200 [W/(m K)]", area = "40 [mm^2]", thickness = "60 [mm]" }
bolt = { kind = "conduction", between = ["foot", "plate"], conductance = { value = "0.3 [W/K]", min = 0.1, max = 1 } }
window = { kind = "radiation", between = ["case", "air"], emissivity = 0.9, area = "50 [cm^2]" }
vapour = { kind = "table", between = ["case", "plate"], table = { over = "temperature", points = [["0 [degC]", "0.01 [W/K]"], ["40 [degC]", "0.08 [W/K]"]] } }
blower = { kind = "conduction", between = ["case", "air"], conductance = "0.2 [W/K]", control = "valve" }

[controls.valve]
follows = "case"
table = { points = [["20 [degC]", "0.1"], ["40 [degC]", "1"]] }

[loads]
cpu = { into = "chip", power = "2 [W]" }
warm_up = { into = "case", power = "2 [W]", thermostat = { on_below = "10 [degC]", off_above = "14 [degC]" } }
radio = { into = "case", power = "6 [W]", periodic = { period = "10 [min]", duty = 0.2 } }
"""
SCENARIO = """title = "day"
start = "20 [degC]"
duration = "1 [h]"
initial = { chip = "25 [degC]" }

[boundaries]
air = { mean = "20 [degC]", amplitude = "3 [K]", period = "24 [h]" }
plate = { times = ["0 [s]", "1 [h]"], values = ["20 [degC]", "25 [degC]"], after = "hold" }

[loads]
cpu = { file = "rig.csv", column = "POWER", time = "time_s", hold = true, after = "hold" }

[schedule]
"bolt.conductance" = { times = ["0 [s]", "30 [min]"], values = ["0.3 [W/K]", "0.2 [W/K]"], hold = true, after = "repeat", period = "40 [min]" }

[environment.air]
pressure = "0.9 [bar]"
humidity = 0.4
gas = "air"
wind = "1 [m/s]"
gravity = "9.81 [m/s^2]"
"""
PAD = """title = "pad"
duration = "1 [h]"

[site]
latitude = -2.3
longitude = -44.4
altitude = "40 [m]"
timezone = -3.0

[weather]
file = "weather.csv"
max_gap = "1 [h]"
air = "air"

[sun]
shines = false
sky = false

[boundaries]
plate = "20 [degC]"
"""
CAMPAIGN = """title = "One level"
note = "made for the fuzzer"

[records.bench]
file = "rig.csv"
time = "time_s"
channels = { T_CASE = { node = "case", noise = "0.05 [K]", accuracy = "0.3 [K]" }, ROOM = { boundary = "air" }, POWER = { load = "cpu" } }
prepare = [{ trim = ["0 [s]", "50 [min]"] }]

[[stages]]
name = "unit"
model = "unit.toml"
records = ["bench"]
free = ["bolt.conductance"]
scenario = { boundaries = { plate = "20 [degC]" }, start = "20 [degC]" }
priors = { "bolt.conductance" = { mean = "0.3 [W/K]", sd = "0.1 [W/K]" } }

[[verdicts]]
model = "unit"
record = "bench"
criteria = { rmse = "0.5 [K]" }
"""
STUDY = """title = "Study"

[knowledge]
subject = "a unit"
use = "to fuzz"
model = "unit.toml"

[components.box]
at = "case"
lowest = "-20 [degC]"
highest = "60 [degC]"

[components.chip]
at = "chip"

[sensors.T]
accuracy = "0.3 [K]"
channels = ["T_CASE", "ROOM", "POWER"]

[procedure]
campaign = "campaign.toml"
metrics = ["rmse"]

[[actions]]
name = "1"
state = "done"
stages = ["unit"]
"""
HOLD = """model = "unit.toml"
scenario = "day.toml"
members = 40
seed = 3
[limits]
case = { highest = "60 [degC]" }
[spread]
"bolt.conductance" = "5 [%]"
"""
PROFILE = """[profile]
title = "ours"
like = "SMC-S-016 unit thermal cycle"
level = "acceptance"
cycles = 2
hot = { value = "60 [degC]", mark = "project", clause = "4.2" }
cold = "-20 [degC]"
steps = [{ name = "up", to = "hot", ramp = "3 [K/min]" }, { dwell = "1 [h]", wait = true, power = "on" }, { to = "cold", over = "20 [min]" }]
"""
LIMITS = (
    '[case]\nnode = "case"\noperating = ["-20 [degC]", "70 [degC]"]\nnon_operating = ["", "90 [degC]"]\nloads = ["cpu"]\nsource = "sheet"\n'
)
SENSORS = '[sensors.T1]\nrom = "2800003C0B1A0FCF"\nnote = "lid"\n[sensors.T1.certificate]\noffset = "0.1 [K]"\nuncertainty = "0.05 [K]"\ndate = "2026-01-01"\n'
PROGRAMME = 'title = "step"\nend = "2 [h]"\nsteps = [{ at = "10 [min]", heater1 = "40 [%]" }, { at = "1 [h]", heater2 = 0.25 }]\n'
ELEMENTS = 1167
"""Seed of a network with coolers, streams, a duct, melts, controls and thermostats."""
CUBE = """title = "cube"
needs = ["space"]
[nodes]
cube = { mass = "0.3 [kg]", specific_heat = { value = "900 [J/(kg K)]", min = 800, max = 1000 } }
[surfaces]
nadir = { of = "cube", to = "space", area = "0.01 [m^2]", htc = 0, emissivity = 0.8, absorptance = 0.5 }
zenith = { of = "cube", to = "space", area = "0.01 [m^2]", htc = 0, emissivity = 0.8, absorptance = 0.5 }
"""
ORBIT = """title = "low"
start = "20 [degC]"
duration = "30 [min]"
environment = { "*" = { pressure = "0 [Pa]" } }
boundaries = { space = "2.7 [K]" }
[orbit]
perigee = "300 [km]"
planet = { radius = "6370 [km]", attraction = "3.982e14 [m^3/s^2]", solar = "1370 [W/m^2]" }
albedo = 0.3
infrared = "234 [W/m^2]"
beta = 10
begin = 20
faces = { nadir = "nadir", zenith = "zenith" }
"""
SINDA = """HEADER CONTROL DATA, GLOBAL
ABSZRO = -273.15
HEADER NODE DATA, MAIN
10, 20.0, 100.0
20, 25.0, 50.0
-99, 20.0, 1.0
HEADER CONDUCTOR DATA, MAIN
1, 10, 20, 0.5
-2, 20, 99, 1.2E-9
HEADER SOURCE DATA, MAIN
10, 5.0
HEADER CONTROL DATA, GLOBAL
SIGMA = 5.67E-8
END OF DATA
"""
SCRIPT = "m = 1.25; % mass [kg]\nc = 900; % specific heat [J/(kg K)]\nC1 = m*c;\nR = 1/(0.3 + 2e-3);\n"
TRAJECTORY = "time,altitude [km],speed [m/s]\n0,0,0\n60,12,500\n120,60,1800\n180,110,2500\n"


def weather() -> str:
    rows = [f"2026-03-21T{6 + k:02d}:00,{20 + k},60,{k}" for k in range(5)]
    return "\n".join(["time,dry_bulb [degC],humidity [%],wind [m/s]", *rows, ""])


def rig() -> str:
    times = np.arange(0.0, 3601.0, 30.0)
    warm = 20.0 + 6.0 * (1.0 - np.exp(-times / 900.0))
    rows = [f"{t:g},{w:.3f},{20.0 + 0.1 * np.sin(t / 200.0):.3f},{2.0 if t > 120 else 0.0}" for t, w in zip(times, warm, strict=True)]
    return "\n".join(["time_s,T_CASE,ROOM,POWER [W]", *rows, ""])


def bench_log() -> bytes:
    head = {"format": 1, "sensors": [{"rom": "2800003C0B1A0FCF", "name": "T1"}]}
    return f"# thermid log {json.dumps(head)}\ntime [s],T1 [degC]\n0,20.0\n1,20.1\n2,20.2\n".encode()


def binary(folder: Path) -> None:
    """Write the same readings in binary files."""
    import h5py
    from scipy.io import netcdf_file, savemat

    times = np.arange(0.0, 600.0, 30.0)
    columns = {"time": times, "T_CASE": 20.0 + times / 100.0, "POWER": np.full(times.size, 2.0)}
    with h5py.File(folder / "rig.h5", "w") as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values, compression="gzip").attrs["units"] = {"time": "s", "POWER": "W"}.get(name, "degC")
    savemat(folder / "rig.mat", columns, do_compression=True)
    savemat(folder / "table.mat", {"log": {"time": times, "signals": {"values": columns["T_CASE"], "label": "T_CASE"}}})
    for name, made in (("rig.xlsx", excel), ("rig.tdms", tdms), ("rig.lvm", labview_with_x)):
        (folder / name).write_bytes(made().data)
    with netcdf_file(folder / "rig.nc", "w") as held:
        held.createDimension("time", times.size)
        for name, values in columns.items():
            held.createVariable(name, "d", ("time",))[:] = values


def make(folder: Path) -> None:
    """Write the project."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        "unit.toml": DECK, "day.toml": SCENARIO, "pad.toml": PAD, "campaign.toml": CAMPAIGN, "study.toml": STUDY, "hold.toml": HOLD,
        "profile.toml": PROFILE, "limits.toml": LIMITS, "sensors.toml": SENSORS, "programme.toml": PROGRAMME, "net.cc": SINDA,
        "tune.m": SCRIPT, "flight.csv": TRAJECTORY, "weather.csv": weather(), "rig.csv": rig(), "thermid.toml": "",
        "by_hand.toml": '[values]\n"bolt.conductance" = { value = "0.2 [W/K]", sd = "0.02 [W/K]" }\n',
    }  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "elements.toml").write_text(_toml(network(ELEMENTS).deck), encoding="utf-8")
    (folder / "cube.toml").write_text(CUBE, encoding="utf-8")
    (folder / "orbit.toml").write_text(ORBIT, encoding="utf-8")
    binary(folder)
    (folder / "rig.csv.gz").write_bytes(gzip.compress(rig().encode(), mtime=0))
    (folder / "bench.csv").write_bytes(bench_log())
    item = FittedValue("bolt.conductance", 0.25, 0.01, 0.005, True, "W/K", 0.3, (0.1, 1.0), "unit: bench")
    made = {"records": {"bench": "a" * 64}, "version": "0.2", "date": "2026-01-01", "conditions": {}, "misfit": {"case": 0.1}}
    FittedValues("unit", {item.path: item}, np.array([[0.0016]]), made).save(folder / "unit.values.toml")
    look(folder, "bench", "a" * 64, "unit", "k", False)
    kept = {"key": "k", "code": "c", "ingredients": {}, "fitted": {"x": 1.0}, "evaluations": 8, "search": "", "remarks": ["one"]}
    (folder / "unit.fit.json").write_text(json.dumps(kept), encoding="utf-8")
    (folder / "qualify").mkdir(exist_ok=True)
    plan = project(folder / "qualify", PLAN)
    td.qualify.load_plan(plan).lock()


def _run_deck(file: Path) -> None:
    model = td.load_model(file)
    bounds = dict.fromkeys(model.needs, "20 [degC]")
    td.simulate(model, td.Scenario("x", boundaries=bounds, start="20 [degC]", duration="10 [min]"), every="1 [min]")


def _run_elements(file: Path) -> None:
    model = td.load_model(file)
    bounds = {n: "3 [K]" if n == "space" else "20 [degC]" for n in model.needs}
    td.simulate(model, td.Scenario("x", boundaries=bounds, start="18 [degC]", duration="20 [min]"), every="2 [min]")


def _run_orbit(file: Path) -> None:
    td.simulate(td.load_model(file.parent / "cube.toml"), td.load_scenario(file), every="5 [min]")


def _run_scenario(file: Path) -> None:
    td.simulate(td.load_model(file.parent / "unit.toml"), td.load_scenario(file), every="5 [min]")


def _values(file: Path) -> None:
    str(dict(td.load_values(file)))


def _profile(file: Path) -> None:
    profile = td.qualify.load_profile(file)
    _ = profile.steps
    str(profile)


def _plan(file: Path) -> None:
    td.qualify.load_plan(file).lock_status()


def _lock(file: Path) -> None:
    td.qualify.load_plan(file.with_name("plan.toml")).lock_status()


def _record(file: Path) -> None:
    td.read_record(file, {"T_CASE": {"node": "case"}, "POWER": {"load": "cpu"}}, time="time_s")


def _weather(file: Path) -> None:
    str(td.site.read_weather(file, max_gap="2 [h]"))


def _study(file: Path) -> None:
    td.design.load_study(file)


@dataclass(frozen=True)
class Kind:
    """A kind of file: a good one, what reads it in Python, and commands; `{}` stands for the file."""

    file: str
    read: Callable[[Path], Any]
    commands: tuple[tuple[str, ...], ...] = ()


KINDS: Final[dict[str, Kind]] = {
    "deck": Kind(
        "unit.toml",
        _run_deck,
        (
            ("check", "{}"),
            ("simulate", "{}", "--boundary", "air=20", "--boundary", "plate=20", "--start", "20", "--for", "10 [min]", "--json"),
            ("steady", "{}", "--boundary", "air=20", "--boundary", "plate=20"),
            ("diagram", "{}", "--to", "out.svg", "--force"),
        ),
    ),
    "deck of elements": Kind(
        "elements.toml",
        _run_elements,
        (
            ("check", "{}"),
            ("simulate", "{}", "--boundary", "air=20", "--boundary", "space=3 [K]", "--start", "18", "--for", "10 [min]"),
            ("diagram", "{}", "--to", "out.svg", "--force"),
        ),
    ),
    "orbit": Kind("orbit.toml", _run_orbit, (("simulate", "cube.toml", "--scenario", "{}"),)),
    "scenario": Kind(
        "day.toml", _run_scenario, (("simulate", "unit.toml", "--scenario", "{}"), ("steady", "unit.toml", "--scenario", "{}"))
    ),
    "surroundings": Kind("pad.toml", _run_scenario, (("simulate", "unit.toml", "--scenario", "{}"),)),
    "campaign": Kind("campaign.toml", CampaignSource.read, (("check", "{}"), ("check", "{}", "--json"))),
    "study": Kind("study.toml", _study),
    "plan": Kind("qualify/plan.toml", _plan, (("plan", "{}"),)),
    "lock": Kind("qualify/plan.lock.json", _lock, (("plan", "qualify/plan.toml"),)),
    "limits": Kind("limits.toml", load_limits),
    "hold": Kind("hold.toml", td.qualify.load_hold, (("hold", "{}"),)),
    "profile": Kind("profile.toml", _profile, (("profile", "{}"),)),
    "values": Kind("unit.values.toml", _values, (("simulate", "unit.toml", "--scenario", "day.toml", "--values", "{}"),)),
    "values by hand": Kind("by_hand.toml", lambda f: None, (("steady", "unit.toml", "--scenario", "day.toml", "--values", "{}"),)),
    "looks": Kind("looks.json", lambda f: read_looks(f.parent)),
    "kept fit": Kind("unit.fit.json", lambda f: KeptStage(f.parent, "unit").recall("k")),
    "sensor map": Kind("sensors.toml", load_sensors),
    "programme": Kind("programme.toml", load_programme),
    "log": Kind("rig.csv", _record, (("look", "{}"), ("look", "{}", "--json"), ("settle", "{}"))),
    "packed log": Kind("rig.csv.gz", _record, (("look", "{}"),)),
    "log of a bench": Kind("bench.csv", lambda f: read_plain(os.fspath(f)), (("look", "{}"),)),
    "log in HDF5": Kind("rig.h5", lambda f: read_plain(os.fspath(f)), (("look", "{}"),)),
    "structure of MATLAB": Kind("table.mat", lambda f: read_plain(os.fspath(f))),
    "log in a workbook": Kind("rig.xlsx", lambda f: read_plain(os.fspath(f)), (("look", "{}"),)),
    "log in TDMS": Kind("rig.tdms", lambda f: read_plain(os.fspath(f))),
    "log of LabVIEW": Kind("rig.lvm", lambda f: read_plain(os.fspath(f)), (("look", "{}"),)),
    "log in MATLAB": Kind("rig.mat", lambda f: read_plain(os.fspath(f)), (("look", "{}"),)),
    "log in netCDF": Kind("rig.nc", lambda f: read_plain(os.fspath(f)), (("look", "{}"),)),
    "weather": Kind("weather.csv", _weather, (("simulate", "unit.toml", "--scenario", "pad.toml"),)),
    "trajectory": Kind("flight.csv", td.site.read_trajectory),
    "deck of SINDA": Kind("net.cc", lambda f: None, (("import", "{}", "--to", "imported", "--force"),)),
    "script": Kind("tune.m", lambda f: read_initfcn(f), (("import", "{}"),)),
}
LOGS: Final = tuple(name for name in KINDS if re.search(r"\blog\b|^structure", name))
"""The kinds that are logs: text, packed, of a bench, and every binary format."""
