"""FMUs that do harm, made of hostile_fmu.c and of descriptions that are wrong: ten kinds, four of each."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

import pytest

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="theirs" guid="{guid}" numberOfEventIndicators="{indicators}">
  {form}
  <UnitDefinitions><Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit></UnitDefinitions>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="{x}" causality="output" variability="continuous" initial="exact">
      <Real unit="degC" start="{start}"/></ScalarVariable>
    <ScalarVariable name="rate" valueReference="1" causality="local" variability="continuous"><Real {derivative}/></ScalarVariable>
    <ScalarVariable name="k" valueReference="{k}" causality="parameter" variability="fixed"><Real start="{own}"/></ScalarVariable>
    <ScalarVariable name="{heat}" valueReference="3" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="1"/></Outputs>{derivatives}</ModelStructure>
</fmiModelDescription>
"""
STEPS = '<CoSimulation modelIdentifier="theirs" canHandleVariableCommunicationStepSize="{variable}"/>'
EXCHANGE = '<ModelExchange modelIdentifier="theirs"/>'
SELF = '<Derivatives><Unknown index="2"/></Derivatives>'


class Hostile(NamedTuple):
    """One hostile FMU.

    Parameters
    ----------
    kind, name : str
    words : tuple of str    Of the error: the call, or what else is wrong.
    guid : str              What the library does: FAULT:FUNCTION:TIME.
    exchange : bool         Model exchange, else co-simulation.
    flags : str             For the compiler.
    given : dict            Places of the description.
    changed : str           What is done to the archive.
    """

    kind: str
    name: str
    words: tuple[str, ...]
    guid: str = "none"
    exchange: bool = False
    flags: tuple[str, ...] = ()
    given: tuple[tuple[str, str], ...] = ()
    changed: str = ""


def _call(kind: str, fault: str, function: str, *words: str, at: float = 0.0, exchange: bool = False) -> Hostile:
    when = (f"{function} at t = {at:g} s",) if words else (function,)
    return Hostile(kind, f"{fault} in {function}", (*words, *when), f"{fault}:{function}:{at}", exchange)


def _form(*words: str, kind: str, name: str, exchange: bool = False, guid: str = "none", **given: str) -> Hostile:
    return Hostile(kind, name, words, guid, exchange, (), tuple(given.items()))


CRASH, GONE, LATE, WHERE = "crashed (SIG", "ended its process (exit code", "did not return within 4 s", "could not be loaded"
EVERY = [
    _call("crash", "segfault", "fmi2Instantiate", CRASH),
    _call("crash", "wild", "fmi2DoStep", CRASH, at=3.0),
    _call("crash", "overflow", "fmi2GetReal", CRASH),
    _call("crash", "segfault", "fmi2FreeInstance", CRASH, at=9.0),
    _call("signal", "abort", "fmi2EnterInitializationMode", CRASH),
    _call("signal", "free", "fmi2DoStep", CRASH, at=5.0),
    _call("signal", "kill", "fmi2GetDerivatives", CRASH, exchange=True),
    _call("signal", "stop", "fmi2DoStep", LATE, at=1.0),
    _call("hang", "hang", "fmi2DoStep", LATE, at=3.0),
    _call("hang", "spin", "fmi2Instantiate", LATE),
    _call("hang", "deaf", "fmi2GetReal", LATE),
    _call("hang", "hang", "fmi2NewDiscreteStates", LATE, exchange=True),
    _call("exit", "exit0", "fmi2DoStep", f"{GONE} 0)", at=2.0),
    _call("exit", "_exit", "fmi2ExitInitializationMode", f"{GONE} 7)"),
    _call("exit", "exit3", "fmi2Instantiate", f"{GONE} 3)"),
    _call("exit", "exit0", "fmi2FreeInstance", f"{GONE} 0)", at=9.0),
    _call("memory", "eat", "fmi2DoStep", CRASH, at=4.0),
    _call("memory", "eat", "fmi2Instantiate", CRASH),
    _call("memory", "eat", "fmi2SetReal", CRASH),
    _form("could not be run", kind="memory", name="indicators", exchange=True, indicators="2000000000"),
    Hostile("numbers", "nan in fmi2DoStep", ("'x'", "is not a number at t = 4 s"), "nan:fmi2DoStep:3"),
    Hostile("numbers", "inf in fmi2GetReal", ("'x'", "is not a number at t = 2 s"), "inf:fmi2GetReal:0.5"),
    _call("numbers", "nan", "fmi2GetDerivatives", exchange=True),
    _form("'k' is not a finite number", kind="numbers", name="huge start", own="1e400"),
    _form("library", kind="library", name="another platform"),
    Hostile("library", "lacks a function", ("fmi2GetStringStatus",), flags=("-DLACKING",)),
    Hostile("library", "no library", ("library",), changed="text"),
    Hostile("library", "crashes as it is loaded", (CRASH, "dlopen"), flags=("-DCONSTRUCTED=raise(SIGSEGV)",)),
    _form("fmi2SetReal", kind="description", name="reference of a state", x="77"),
    _form("fmi2SetReal", kind="description", name="reference of a parameter", k="4000000000"),
    _form("derivative", kind="description", name="a derivative of nothing", exchange=True, derivative=""),
    _form(CRASH, kind="description", name="more states than it says", exchange=True, guid="wide:none:0"),
    Hostile("answers", "writes to every pipe", ("no answer",), "babble:fmi2DoStep:2"),
    Hostile("answers", "closes every pipe", ("no answer",), "close:fmi2DoStep:2"),
    Hostile("answers", "moves the cursor", ("could not be run",), "escape:fmi2DoStep:2"),
    _form("events", kind="answers", name="events without end", exchange=True, guid="storm:none:0"),
    Hostile("archive", "climbs", ("evil.txt",), changed="climb"),
    Hostile("archive", "bomb", ("unpacks",), changed="bomb"),
    Hostile("archive", "entities", ("DOCTYPE",), changed="entities"),
    Hostile("archive", "link", ("link",), changed="link"),
]


@lru_cache(maxsize=8)
def library(flags: tuple[str, ...]) -> bytes:
    """The library of hostile_fmu.c."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler for hostile_fmu.c")
    made = Path(mkdtemp()) / "theirs.so"
    source = Path(__file__).with_name("hostile_fmu.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O0", "-w", *flags, "-o", made, source, "-lm"], check=True)
    return made.read_bytes()


def hostile_fmu(of: Hostile, path: Path) -> Path:
    """Write one."""
    given = {
        "guid": of.guid,
        "indicators": "0",
        "form": EXCHANGE if of.exchange else STEPS.format(variable="true"),
        "x": "0",
        "start": "30",
        "derivative": 'derivative="1"',
        "k": "2",
        "own": "0.1",
        "heat": "heat",
        "derivatives": SELF if of.exchange else "",
    } | dict(of.given)
    text = DESCRIPTION.format(**given)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        if of.changed == "entities":
            text = text.replace("<fmi", '<!DOCTYPE x [<!ENTITY a "ha">]>\n<fmi', 1)
        packed.writestr("modelDescription.xml", text)
        place = "win64/theirs.dll" if of.name == "another platform" else "linux64/theirs.so"
        packed.writestr(f"binaries/{place}", b"nothing" if of.changed == "text" else library(of.flags))
        if of.changed == "climb":
            packed.writestr("../evil.txt", "x")
        if of.changed == "bomb":
            packed.writestr("resources/zeros", bytes(250_000_000))
        if of.changed == "link":
            entry = zipfile.ZipInfo("resources/link")
            entry.external_attr = 0o120777 << 16
            packed.writestr(entry, "/etc")
    return path
