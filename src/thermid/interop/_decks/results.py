"""Temperatures of a deck's own runs against those that its tool left, and what is left of each node's balance at them.

Temperatures that SINDA printed, or that ESATAN left in a file of results (TMD).

A TMD of ESATAN-TMS 2018 is an HDF5 file: `AnalysisSet1` holds the nodes (number, model) and the models, each `DataGroup` one solution
with its times and a number for each time, node and attribute. Older TMDs are binary files of a layout that no public text describes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.errors import DeckError, ThermidError, cap, optional, quoted, raising
from thermid.base.files import read_bytes
from thermid.base.units import ICE_POINT, counted
from thermid.interop._decks.cards import SUBMODEL
from thermid.interop._decks.network_file import DeckReading, NetworkFile
from thermid.simulation.runs import Engine, Scenario, Wiring, network_for, simulate, steady

_SUBMODEL = re.compile(r"\s*SUBMODEL NAME = (\w+)")
_TIME = re.compile(r"^\s*(?:PROBLEM TIME\s+TIMEN|TIME)\s*=\s*([-+.\dE]+)")
_PRINT = re.compile(r"\bT\s+(\d+)\s*=\s*([-+.\dE]+)")
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_ROUNDING: Final = float(np.finfo(np.float32).epsneg)
"""Share of a number that single precision rounds to; a TMD has doubles, but no solution is exact to their last digit."""
_KIND: Final = "file.another-kind"


@dataclass(frozen=True)
class Printed:
    """Temperatures of one print, in the file's own unit.

    Parameters
    ----------
    routine : str          What the tool ran: STEADY, TRANSIENT or the name of an older routine; empty where it is not printed.
    time : float           Its problem time, in the file's unit of time.
    numbers : dict         Node path -> temperature.
    digits : dict          Node path -> half a unit of its last digit.
    time_digit : float     Half a unit of the last digit of the time.
    """

    routine: str
    time: float
    numbers: Mapping[str, float]
    digits: Mapping[str, float]
    time_digit: float = 0.0

    @property
    def settled(self) -> bool:
        """Whether it is of a steady state."""
        return not self.routine.startswith(("TRANS", "FWD", "FORW", "ATS"))


def printed_temperatures(path: str | Path) -> list[Printed]:
    """Return the temperatures that a deck's own tool left, in their order: SINDA's printed output, or a TMD of ESATAN.

    Raises
    ------
    DeckError           When the file has no temperatures, or is of another kind.
    MissingExtraError   When a TMD needs h5py, and it is not installed.
    """
    data, file = read_bytes(path), str(path)
    if not data.startswith(_HDF5):
        if b"\0" not in data:
            return sinda_print(path)
        read = "Of SINDA the printed output (.out) is read, of ESATAN a TMD that is an HDF5 file (ESATAN-TMS 2018 writes them)"
        raise DeckError(f"this is a binary file of results. {read}; an older binary TMD, a CSR or a .sav is not.", file, code=_KIND)
    library = optional("h5py", "a TMD", file)
    try:
        with library.File(io.BytesIO(data), "r") as opened:
            return [output for _, analysis in _in_order(opened, "AnalysisSet") for output in _solutions(analysis, file)]
    except ThermidError:
        raise
    except (KeyError, ValueError, IndexError, TypeError, OSError, RecursionError) as error:
        raise DeckError(
            f"this HDF5 file is damaged or no TMD of ESATAN (version 01.00 of the file is known): {error}.", file, code=_KIND
        ) from None


def _in_order(group: Any, kind: str) -> list[tuple[int, Any]]:
    """Return the numbered members of a group, AnalysisSet1 or DataGroup1, in the order of their numbers."""
    members = [(int(name.removeprefix(kind)), member) for name, member in group.items() if name.startswith(kind)]
    if not members:
        raise KeyError(f"it has no {kind}1")
    return sorted(members, key=lambda member: member[0])


def _solutions(analysis: Any, file: str) -> Iterator[Printed]:
    """Yield the temperatures at each time of each solution [degC]; a single time is a steady state. Inactive nodes are left out."""
    models = analysis["models"][()]
    nodes = [f"{_owner(models, model)}.T{number}" for number, model in analysis["thermalNodes"][()].tolist()]
    attribute = list(analysis["thermalNodesRealAttributes"]).index(b"Temperature")
    kind = list(analysis["thermalNodesStringAttributes"]).index(b"Type")
    for _, solution in _in_order(analysis, "DataGroup"):
        times, real = solution["times"][()], solution["thermalNodesRealData"]
        if real.shape[:2] != (times.size, len(nodes)):
            raise ValueError(f"it has {times.size} times and {len(nodes)} nodes, but values of {real.shape[0]} and {real.shape[1]}")
        if real.dtype.itemsize * real.size > cap("unpacked"):
            raise DeckError(f"it has {real.size} values.{raising('unpacked')}", file, code="cap.exceeded")
        celsius = real[:, :, attribute] + (float(analysis.attrs["TAbs"]) - ICE_POINT)
        inactive = solution["thermalNodesStringData"][0, :, kind] == b"X"
        for time, row in zip(times.tolist(), celsius, strict=True):
            numbers = {name: float(t) for name, t, out in zip(nodes, row, inactive, strict=True) if not out}
            digits = {name: _ROUNDING * abs(t) for name, t in numbers.items()}
            yield Printed("TRANSIENT" if times.size > 1 else "STEADY", time, numbers, digits, _ROUNDING * abs(time))


def _owner(models: Any, k: int) -> str:
    """Return the name of the k-th model (from 1): those of the models around it, outermost first, and its own, joined by underscores."""
    _, parent, _ = models[k - 1].tolist()
    name = models[k - 1]["modelName"].decode("latin-1").strip().upper()
    return f"{_owner(models, parent)}_{name}" if parent else name


def sinda_print(path: str | Path) -> list[Printed]:
    """Return the prints of a SINDA output in their order.

    Raises
    ------
    DeckError   When the file prints no temperatures.
    """
    prints: list[Printed] = []
    numbers: dict[str, float] = {}
    digits: dict[str, float] = {}
    submodel, routine, time, time_digit, headed = "", "", 0.0, 0.0, False
    for row in DeckReading().open(Path(path)).split("\n"):
        if row.startswith(" MODEL ="):
            headed = True
        elif headed and row.strip():
            routine, headed = row.strip(), False
        elif match := _SUBMODEL.match(row):
            submodel = match[1]
        elif match := _TIME.search(row):
            time, time_digit, routine = float(match[1]), _half_digit(match[1]), "TRANSIENT" if "DTIMEU" in row else routine
        elif "OUTPUT TEMPERATURES" in row:  # SINDA/G has one submodel
            submodel = SUBMODEL
        for number, word in _PRINT.findall(row) if submodel else ():
            key = f"{submodel}.T{int(number)}"
            if not numbers or key in numbers or (prints[-1].routine, prints[-1].time) != (routine, time):
                numbers, digits = {}, {}
                prints.append(Printed(routine, time, numbers, digits, time_digit))
            numbers[key], digits[key] = float(word), _half_digit(word)
    if not prints:
        raise DeckError("the file has no printed temperatures (T 1= ... under SUBMODEL NAME).", str(path), code="file.another-kind")
    return prints


def _half_digit(word: str) -> float:
    """Return half a unit of the last digit of a printed number."""
    mantissa, _, exponent = word.partition("E")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


@dataclass(frozen=True, eq=False)
class Balance:
    """What is left of each node's balance at printed temperatures: heat out less heat in. [W]

    Parameters
    ----------
    left : dict        Node -> watts that the network lacks at this node; of one in balance about 0.
    rounding : dict    Node -> what half the last digit of the print makes of it. [W]
    """

    left: Mapping[str, float]
    rounding: Mapping[str, float]

    def open(self) -> dict[str, float]:
        """Return the nodes whose balance does not close within the rounding of the print, the largest first."""
        missed = {node: watts for node, watts in self.left.items() if abs(watts) > 2.0 * self.rounding[node]}
        return dict(sorted(missed.items(), key=lambda row: -abs(row[1])))

    def __str__(self) -> str:
        """Return how many nodes close, then those that do not."""
        missed = self.open()
        if not missed:
            return (
                f"at the printed temperatures the balance of all {counted(len(self.left), 'node')} closes within the rounding of the print"
            )
        nodes = f"{len(missed)} of {counted(len(self.left), 'node')}"
        head = f"NOT CLOSED: at the printed temperatures {nodes} miss {sum(missed.values()):.4g} W in all"
        return "\n".join([head, *(f"  {node}: {watts:+.4g} W" for node, watts in missed.items())])


@dataclass(frozen=True, eq=False)
class Agreement:
    """Temperatures of an imported deck against those that its own tool printed.

    Parameters
    ----------
    times : array          Problem time of each print; the one of a steady state is nan. [s]
    nodes : tuple of str   Nodes that both have.
    off : array            Computed less printed: a row for each print, a column for each node. [K]
    rounding : float       Half of the last printed digit. [K]
    absent : tuple of str  Nodes of the deck that the print lacks.
    """

    times: np.ndarray
    nodes: tuple[str, ...]
    off: np.ndarray
    rounding: float
    absent: tuple[str, ...] = ()

    @property
    def rms(self) -> np.ndarray:
        """Root mean square of the differences of each node over the prints. [K]"""
        squares: np.ndarray = np.mean(self.off**2, axis=0)
        return squares**0.5

    def __str__(self) -> str:
        """Return the largest difference of the steady state and of the transient, with its node and time."""
        rows = [f"NOT COMPARED: the print lacks {counted(len(self.absent), 'node')}: {quoted(self.absent)}"] if self.absent else []
        steady = np.isnan(self.times)
        for name, chosen in (("steady state", steady), ("transient", ~steady)):
            if not chosen.any():
                continue
            off = self.off[chosen]
            k, n = np.unravel_index(np.argmax(np.abs(off)), off.shape)
            at = "" if name == "steady state" else f" at {self.times[chosen][k]:g} s"
            rms = float(np.sqrt(np.mean(off**2)))
            rows.append(
                f"{name} against the print: {counted(len(self.nodes), 'node')}, {counted(len(off), 'print')}, rms {rms:.3g} K, largest "
                f"{off[k, n]:+.3g} K ({self.nodes[n]}{at}); the print rounds to {self.rounding:.1g} K"
            )
        return "\n".join(rows)


def agreement(network: NetworkFile, prints: Sequence[Printed]) -> Agreement:
    """Return the temperatures of a deck's own runs, computed anew, less their prints (prints, nodes). [K]

    Of a steady state the last print counts, of a transient every one, and the run ends at the last. Nodes that the print lacks are named.

    Raises
    ------
    DeckError       When the prints have no node of the deck.
    SolverError     When a run does not come out.
    """
    paths = {f"{node.submodel}.{node.name}": node.path for node in network.nodes}
    settled = [output for output in prints if output.settled][-1:]
    moving = [output for output in prints if not output.settled]
    nodes = tuple(name for name in paths if all(name in output.numbers for output in (*settled, *moving)))
    if not nodes:
        raise DeckError("the print has none of the deck's nodes, so it is of another case.", network.title, code="file.another-kind")
    model, scenario = network.model(), network.scenario()
    times = [_within(output, network, scenario.seconds) for output in moving]
    rows = []
    if settled:
        calm = steady(model, scenario, "mean" if network.start == "steady, mean" else 0.0)
        rows.append([calm[paths[name]] for name in nodes])
    if moving:
        stored, which = np.unique(times, return_inverse=True)
        cyclic = all(load.course is None or load.course.period for load in network.loads) and not network.courses
        if stored[-1] and (cyclic or network.start != "steady, mean"):  # else its start is under the means of the whole run
            scenario = replace(scenario, duration=float(stored[-1]))
        run = simulate(model, scenario, times=stored)
        rows.extend(np.column_stack([run[paths[name]].kelvin for name in nodes])[which])
    printed = [network.celsius(output.numbers) for output in (*settled, *moving)]
    off = np.array(rows) - ICE_POINT - np.array([[output[name] for name in nodes] for output in printed])
    rounding = max(output.digits[name] for output in (*settled, *moving) for name in nodes) * network.zero_and_degree[1]
    return Agreement(np.array([*[np.nan] * len(settled), *times]), nodes, off, rounding, tuple(paths.keys() - set(nodes)))


def _within(output: Printed, network: NetworkFile, end: float) -> float:
    """Return the time of a print in the deck's run [s], which the rounding of its last digit may put beyond an end of that."""
    time = output.time * network.seconds - network.begin
    inside = min(max(time, 0.0), end)
    if abs(time - inside) > output.time_digit * network.seconds + 1e-9 * end:
        raise DeckError(
            f"the print of {output.time:g} is not within the deck's run: it begins at {network.begin / network.seconds:g} and ends at "
            f"{(network.begin + end) / network.seconds:g}, in the deck's unit of time. Give the print of this case, or correct its times.",
            network.title,
            code="value.outside-range",
        )
    return inside


def balance(network: NetworkFile, printed: Printed) -> Balance:
    """Return what is left of each node's balance at the temperatures of a print, by the rows of the network itself; loads at their means.

    Left is -q, the net heat q into a node. [W] Its rounding is |J| h [W], J = dq/dT [W/K] with the boundaries and h half the last printed
    digit of a node, of boundaries the largest. [K]

    Raises
    ------
    DeckError   When the print lacks a node of the deck.
    """
    names = {node.path: f"{node.submodel}.{node.name}" for node in network.nodes}
    missing = [name for name in names.values() if name not in printed.numbers]
    if missing:
        raise DeckError(f"the print has no temperature of {quoted(missing)}.", network.title, code="file.another-kind")
    celsius = network.celsius(printed.numbers)
    # a balance needs no heat capacity but whether there is one
    nodes = tuple(replace(node, capacitance=None if node.capacitance is None else 1.0) for node in network.nodes)
    held = {node.path: f"{celsius[names[node.path]]!r} [degC]" for node in nodes if node.held}
    scenario = Scenario(network.title, boundaries=held, start="20 [degC]")
    wiring = Wiring(network_for(replace(network, nodes=nodes).model(), scenario), scenario)
    wiring.gone = ()
    engine = Engine(wiring)
    at = np.array([celsius[names[path]] for path in engine.nodes]) + ICE_POINT
    heat, jacobian, _ = engine.rhs(engine.started(wiring.assemble(gradients=False)), at, 0.0)
    half = {path: printed.digits[name] * network.zero_and_degree[1] for path, name in names.items()}
    # both ends of a conductor were rounded; what a row of the Jacobian is short of zero goes to the boundaries
    rounding = np.abs(jacobian) @ [half[path] for path in engine.nodes]
    rounding += np.abs(jacobian.sum(axis=1)) * max((half[path] for path in held), default=0.0)
    inner = [names[path] for path in engine.nodes]
    return Balance(dict(zip(inner, (-heat).tolist(), strict=True)), dict(zip(inner, rounding.tolist(), strict=True)))
