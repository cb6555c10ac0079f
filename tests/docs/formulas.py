"""A formula of a page beside the function of the code that it names."""

from __future__ import annotations

import inspect
import math
from importlib import import_module
from importlib.util import find_spec

import numpy as np

from thermid.base.units import STEFAN_BOLTZMANN
from thermid.physics.air import AIR_300K
from thermid.physics.gas import GASES

ROOMS = ("thermid.physics", "thermid.site", "oracles")
"""Where the functions are that pages name; closed forms that only tests use are among the tests."""
RANGES = {
    "temperature": (250.0, 400.0), "other_temperature": (250.0, 400.0), "mean": (280.0, 350.0), "ambient": (250.0, 300.0),
    "start": (30.0, 400.0), "surroundings": (250.0, 300.0), "pressure": (1.0, 2e5), "rayleigh": (2e5, 5e6), "reynolds": (1e3, 4e5),
    "emissivity": (0.05, 0.95), "other_emissivity": (0.05, 0.95), "inner_emissivity": (0.05, 0.95), "outer_emissivity": (0.05, 0.95),
    "accommodation": (0.3, 1.0), "inner_radius": (0.1, 0.5), "outer_radius": (0.6, 2.0), "exponent": (0.1, 0.4), "prandtl": (0.6, 7.0),
    "coefficient": (1e-9, 1e-7), "htc": (0.001, 0.01),
}  # fmt: skip
"""Where arguments of a name are drawn from; all others between 0.3 and 2."""
FUNCTIONS = {"sqrt": math.sqrt, "exp": math.exp, "ln": math.log, "tanh": math.tanh, "pi": math.pi, "sigma": STEFAN_BOLTZMANN}


def disagreement(text: str, words: tuple[str, ...]) -> str:
    """What a formula gives and its function does not; empty where they agree, or where no function is named."""
    if not words:
        return ""
    module, _, name = words[0].partition(".")
    function = getattr(
        import_module(next(found.name for room in ROOMS for inner in ("", "_") if (found := find_spec(f"{room}.{inner}{module}")))), name
    )
    symbols = dict(word.split("=") for word in words[1:])
    rng = np.random.default_rng(1)
    for _ in range(5):
        drawn = {argument: float(rng.uniform(*RANGES.get(argument, (0.3, 2.0)))) for argument in symbols}
        known = FUNCTIONS | {symbol: drawn[argument] for argument, symbol in symbols.items()}
        given = dict(drawn)
        taken = inspect.signature(function).parameters
        if "gas" in taken:
            gas = given["gas"] = GASES["N2"]  # type: ignore[assignment]
            at = drawn["temperature"]
            known |= {"k": gas.k(at), "mu": gas.mu(at), "R": gas.constant, "gamma": gas.ratio(at)}  # type: ignore[attr-defined]
        elif "air" in taken:
            known |= {"nu": AIR_300K.kinematic_viscosity, "Pr": AIR_300K.prandtl}
        shown, *where = text.strip().splitlines()
        for line in reversed(where):
            symbol, _, expression = line.partition(" = ")
            known[symbol] = eval(expression, {"__builtins__": {}}, known)
        value = eval(shown.partition(" = ")[2], {"__builtins__": {}}, known)
        found = float(function(**given))
        if abs(value - found) > 1e-9 * abs(found):
            return f"{name} gives {found:.12g} where the page's formula gives {value:.12g}"
    return ""
