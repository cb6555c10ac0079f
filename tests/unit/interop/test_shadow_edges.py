"""What is left of public orbits against SINDA's prints: one edge of the shadow after another falls into one of SINDA's own steps."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from public_files import public_file
from thermid.interop._decks.network_file import FileCourse
from thermid.interop._decks.results import agreement, printed_temperatures
from thermid.interop._decks.sinda import read_sinda

DAVIS = "Space-and-Satellite-Systems-UC-Davis/Structure-Thermal-Desktop/OLD_Working CubseSAT Model/case1"
MLI = "nodoka716/MLI_test"
SHA = {
    DAVIS: "6abbb366905b9dd5cdfd2beb368fb5d1afb1ed04a81233fde0d91950b705415e",
    f"{MLI}/Opticalprop/case1": "268b3fd3da3c163b058e5f54787edda4e8086724f582da5c3bda77d2fce585a6",
    f"{MLI}/Panel/case1": "78f5254e52e15c551ae4e2a53ce6c4af5cf5c4390cf56417f8dfc706bc5ea663",
}
"""SHA-256 of the print."""
TRIAL = 8.0  # s


def _steps(text: str) -> dict[float, float]:
    """Return the longer of mean and last step that SINDA prints for the time since its output before. [s]"""
    number = r"=\s*([\d.E+]+)"
    found = re.findall(rf"TIMEN\s*{number}.*\n.*TIMEM\s*{number}.*\n.*SINCE LAST OUTPUT\s*{number}", text)
    return {float(now): max(float(mean), 2.0 * (float(now) - float(middle))) for now, middle, mean in found}


def _unrolled(course: FileCourse, end: float) -> FileCourse:
    """Return a cyclic course over the whole run."""
    begins = course.period * np.arange(end // course.period + 2)
    seconds = (begins[:, None] + course.seconds[:-1]).ravel()
    return replace(course, seconds=seconds, numbers=np.tile(course.numbers[:-1], begins.size), period=0.0)


def _moved(course: FileCourse, edges: list[tuple[float, float, float]]) -> FileCourse:
    """Return a course in which the rise of each edge, from a time to a time, comes so much later. [s]"""
    seconds, numbers = course.seconds, course.numbers
    for begin, end, later in edges:
        height = float(np.diff(np.interp([begin, end], course.seconds, course.numbers))[0])
        every = np.unique([*seconds, begin, end, begin + later, end + later])
        risen = [np.interp(every - by, [begin, end], [0.0, height]) for by in (later, 0.0)]
        seconds, numbers = every, np.interp(every, seconds, numbers) + risen[0] - risen[1]
    return replace(course, seconds=seconds, numbers=numbers)


@pytest.mark.campaign
@pytest.mark.parametrize("name", SHA)
def test_each_edge_moved_within_a_step_of_sinda_leaves_a_tenth_of_the_difference(name: str) -> None:
    """SINDA takes the heat of a step from its middle: all nodes then miss, or have in excess, the same seconds of sun."""
    printed = public_file(f"{name}.out", SHA[name])
    network, prints = read_sinda(printed.with_suffix(".inp")), printed_temperatures(printed)
    calm = td.steady(network.model(), network.scenario(), "mean")
    nodes = tuple(node if node.held else replace(node, celsius=calm[node.path] - 273.15) for node in network.nodes)
    orbit = next(load.course for load in network.loads if load.course is not None)
    end = network.duration
    steep = sum(np.abs(np.diff(load.course.numbers)) for load in network.loads if load.course is not None) / np.diff(orbit.seconds)
    turns = orbit.period * np.arange(end // orbit.period + 1)
    edges = sorted((float(at + orbit.seconds[k]), float(at + orbit.seconds[k + 1])) for k in np.argsort(-steep)[:2] for at in turns)
    edges = [edge for edge in edges if edge[0] < end]

    def off(later: np.ndarray) -> np.ndarray:
        moves = [(*edge, float(by)) for edge, by in zip(edges, later, strict=True) if by]
        loads = tuple(
            load if load.course is None else replace(load, course=_moved(_unrolled(load.course, end), moves)) for load in network.loads
        )
        agreed = agreement(replace(network, nodes=nodes, loads=loads, start=""), prints)
        return agreed.off[~np.isnan(agreed.times)]

    own = off(np.zeros(len(edges)))
    change = [(off(TRIAL * one) - own).ravel() / TRIAL for one in np.eye(len(edges))]
    later = np.linalg.lstsq(np.column_stack(change), -own.ravel(), rcond=None)[0]
    left = off(later)
    steps = _steps(printed.read_text("latin-1"))
    before = np.array([steps[max(now for now in steps if now <= begin)] for begin, _ in edges])
    assert np.quantile(np.abs(left), 0.95) < 0.1 * np.quantile(np.abs(own), 0.95)
    assert np.quantile(np.abs(left), 0.95) < 0.05
    assert np.all(np.abs(later) < before)
