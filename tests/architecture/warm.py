"""What a warm call walks through, counted: files, functions, lines, and how often it goes from one room to another.

The calls are the simplest fit, of one coefficient to a log of two columns, and a prediction from it. A warm call is the second of its kind
in a process: what the first one loaded or kept is there.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import thermid as td

PACKAGE = f"{Path(td.__file__).parent}/"
DECK = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "convection", "between": ["plate", "air"], "htc": "8 [W/(m^2 K)]", "area": "0.05 [m^2]"}},
    "loads": {"heater": {"into": "plate", "power": "5 [W]"}},
}


@dataclass(frozen=True)
class Walk:
    """What one call ran.

    Parameters
    ----------
    files : int        Files of the package of which a function ran.
    functions : int    Different functions that have a name: no lambdas or comprehensions.
    lines : int        Different lines of the source.
    crossings : int    Calls of a function from another room than its own; what lies between them outside the package is passed over.
    """

    files: int
    functions: int
    lines: int
    crossings: int


def walk(call: Callable[[], object]) -> Walk:
    """What a second call runs."""
    functions: set[tuple[str, str, int]] = set()
    lines: set[tuple[str, int]] = set()
    crossings = 0

    def line(frame: FrameType, event: str, argument: object) -> Any:
        if event == "line":
            lines.add((frame.f_code.co_filename, frame.f_lineno))
        return line

    def note(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal crossings
        code = frame.f_code
        if not code.co_filename.startswith(PACKAGE) or code.co_name == "<module>":
            return None
        functions.add((code.co_filename, code.co_qualname, code.co_firstlineno))
        caller = frame.f_back
        while caller and not caller.f_code.co_filename.startswith(PACKAGE):
            caller = caller.f_back
        crossings += bool(caller and room(caller.f_code.co_filename) != room(code.co_filename))
        return line

    call()
    before = sys.gettrace()
    sys.settrace(note)
    try:
        call()
    finally:
        sys.settrace(before)
    named = [name for _, name, _ in functions if not name.rpartition(".")[2].startswith("<")]
    return Walk(len({file for file, _, _ in functions}), len(named), len(lines), crossings)


def room(file: str) -> str:
    """The room of a file of the package."""
    return file.removeprefix(PACKAGE).partition("/")[0].removesuffix(".py")


def calls() -> dict[str, Callable[[], object]]:
    """The simplest fit, and a prediction from it."""
    model = td.model_from_dict(DECK)
    bench = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="30 [min]")
    run = td.simulate(model, bench)
    plate = td.Channel.from_array("T", run["plate"].kelvin, unit="K", role="node", target="plate", noise=0.05)
    record = td.Record.from_arrays("log", run.times, {"T": plate, "air": td.Channel.from_array("air", run["air"].kelvin, unit="K")})
    start = model.with_values({"film.htc": "5 [W/(m^2 K)]"})
    fit = td.calibrate(start, record, free=["film.htc"])
    hot = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="40 [degC]", duration="30 [min]")
    return {"calibrate": lambda: td.calibrate(start, record, free=["film.htc"]), "predict": lambda: td.predict(fit, hot)}


def walks() -> dict[str, int]:
    """Files, named functions, lines and crossings of each call."""
    return {f"{what} of {name}": n for name, call in calls().items() for what, n in vars(walk(call)).items()}
