"""Temperatures of a deck's own runs against those that its tool left, and what is left of each node's balance at them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermid.base.errors import DeckError, quoted
from thermid.base.units import ICE_POINT, counted
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.printed import Printed
from thermid.simulation.runs import Scenario, network_for, simulate, steady
from thermid.simulation.solver import Engine, Wiring


@dataclass(frozen=True, eq=False)
class Balance:
    """What is left of each node's balance at printed temperatures: heat in less heat out. [W]

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
    """Return the temperatures of a deck's own runs, computed anew, against their prints.

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
