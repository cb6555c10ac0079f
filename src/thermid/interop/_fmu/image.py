"""The model of an FMU as bytes: what the library of the kernel reads (src/kernel/fmu/image.cpp)."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from thermid import _kernel

MARK = b"THERMID1"
TIME, VALUE, TEMPERATURE_OF, RATE, HEAT, POWER, MODE, INDICATOR = range(8)
"""Kinds of variables in the order of VariableKind of the library."""
OPERATIONS = ("number", "name", "+", "-", "*", "/", "neg", "**", "min", "max", "sqrt", "exp", "log")
"""In the order of Program::Operation of the library."""


class ImageWriter:
    """Collects lists of numbers and texts, each behind its length, little-endian."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []

    def count(self, number: int) -> None:
        """Write a length."""
        self.parts.append(struct.pack("<Q", number))

    def ints(self, values: Any) -> None:
        """Write integers, flattened."""
        flat = np.ascontiguousarray(np.ravel(np.asarray(values, dtype=np.int64)), dtype="<i4")
        self.count(flat.size)
        self.parts.append(flat.tobytes())

    def reals(self, values: Any) -> None:
        """Write floats, flattened."""
        flat = np.ascontiguousarray(np.ravel(np.asarray(values, dtype=float)), dtype="<f8")
        self.count(flat.size)
        self.parts.append(flat.tobytes())

    def text(self, text: str) -> None:
        """Write a text."""
        raw = text.encode()
        self.count(len(raw))
        self.parts.append(raw)

    def bytes(self) -> bytes:
        """Return all of it."""
        return b"".join(self.parts)


ROWS: Final = (
    "capacity",
    "coef_input",
    "boundary_gain",
    "boundary_offset",
    "conductor_kind",
    "conductor_a",
    "conductor_b",
    "conductor_coef",
    "conductor_table",
    "load_kind",
    "load_node",
    "load_coef",
    "load_sensor",
    "load_table",
    "load_control",
    "control_kind",
    "control_sensor",
    "control_coef",
)
"""Arrays of the kernel's problem in the order of the file."""


def still(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arrays without inputs that are constant; what they multiply must be multiplied by them."""
    inputs, follow = arrays["inputs"], arrays["follow"]
    moving = [k for k, source in enumerate(inputs) if source[0] != _kernel.CONSTANT]
    place = {-1: -1, **{k: -1 for k in range(len(inputs))}, **{k: m for m, k in enumerate(moving)}}
    followers = follow["followers"] if follow is not None else []
    place |= {len(inputs) + k: len(moving) + k for k in range(len(followers))}
    out = {**arrays, "inputs": [inputs[k] for k in moving], "coef_input": np.array([place[int(k)] for k in arrays["coef_input"]])}
    if follow is not None:
        out["follow"] = {**follow, "followers": [(place[base], factors) for base, factors in followers]}
    return out


def write_problem(to: ImageWriter, arrays: Mapping[str, Any]) -> None:
    """Write the arrays of a problem of the kernel, as `KernelProblem.arrays` gives them."""
    for name in ROWS:
        to.ints(arrays[name])
    to.count(len(arrays["tables"]))
    for table in arrays["tables"]:
        for column in table:
            to.reals(column)
    to.ints([source[0] for source in arrays["inputs"]])
    for _, a, b in arrays["inputs"]:
        to.reals(a)
        to.reals(b)
    _write_controls(to, arrays["follow"] or {"states": 0, "machines": [], "factors": [], "guards": [], "samplers": [], "followers": []})


def _write_controls(to: ImageWriter, follow: Mapping[str, Any]) -> None:
    """Write thermostats, controlled factors and their guards to the image that the FMU reads."""
    to.ints([follow["states"]])
    to.ints(follow["machines"])
    to.count(len(follow["factors"]))
    for kind, probe, low, high, table, machine, values in follow["factors"]:
        to.ints([kind, *probe, low, high, table, machine, *values])
    to.count(len(follow["guards"]))
    for machine, before, after, probe, level, sign, delay in follow["guards"]:
        to.ints([machine, before, after, *probe, level, delay])
        to.reals([sign])
    to.count(len(follow["samplers"]))
    for period, node, factor in follow["samplers"]:
        to.reals([period])
        to.ints([node, factor])
    to.count(len(follow["followers"]))
    for base, factors in follow["followers"]:
        to.ints([base, *factors])


def image(
    token: str,
    nodes: Sequence[str],
    arrays: Mapping[str, Any],
    program: tuple[Sequence[tuple[int, int, int]], Sequence[float], Sequence[int]],
    values: tuple[Any, Any],
    variables: Sequence[tuple[int, int]],
    powers: Sequence[Sequence[int]],
) -> bytes:
    """Return the file.

    Parameters
    ----------
    token : str             What the model description holds too.
    nodes : sequence        Names of nodes and boundaries.
    arrays : dict           Of the problem, as `still` returns them.
    program                 Steps, numbers and the step of each coefficient.
    values                  Start of the symbols [SI]; of the unknown nodes [K].
    variables : sequence    Kind and place of each value reference.
    powers : sequence       Rows of each load.
    """
    to = ImageWriter()
    to.text(token)
    to.count(len(nodes))
    for node in nodes:
        to.text(node)
    write_problem(to, arrays)
    steps, numbers, results = program
    to.ints(steps)
    to.reals(numbers)
    to.ints(results)
    for some_values in values:
        to.reals(some_values)
    to.ints(variables)
    to.ints(np.cumsum([0, *(len(rows) for rows in powers)]))
    to.ints([row for rows in powers for row in rows])
    return MARK + to.bytes()
