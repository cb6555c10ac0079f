"""Radiation conductors of a deck follow the emissivities that its comments state; insulations are groups of their own."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.interop._decks.network_file import NetworkFile
from thermid.interop._decks.sinda import read_sinda
from thermid.model.tree import ParameterSet

AREAS = np.array([0.02, 0.03, 0.01, 0.04, 0.05])
COATING = np.array([0, 0, 1, 1, 0])
EMISSIVITY = (0.86, 0.30)
NAMES = ("emissivity_anodised_6061_t6", "emissivity_gold")


def enclosure() -> np.ndarray:
    """Return A F of five surfaces and space, as symmetric numbers with the right sums. [m^2]"""
    rng = np.random.default_rng(3)
    pairs = rng.uniform(0.1, 1.0, (6, 6))
    pairs = pairs + pairs.T
    np.fill_diagonal(pairs, 0.0)
    sums = np.append(AREAS, 0.03)
    for _ in range(200):  # scaled until each row sums to its area
        scale = np.sqrt(sums / pairs.sum(axis=1))
        pairs *= scale[:, None] * scale
    return pairs


def exchanged(emissivity: np.ndarray) -> np.ndarray:
    """Return Gebhart's conductors between all surfaces: B = (I - F rho)^-1 F e, G = A e B. [m^2]"""
    e = np.append(emissivity, 1.0)
    sums = np.append(AREAS, 0.03)
    view = enclosure() / sums[:, None]
    absorbed = np.linalg.solve(np.eye(6) - view * (1.0 - e), view * e)
    return np.asarray(sums[:, None] * e[:, None] * absorbed)


def _deck(folder: Path, g: np.ndarray, e: np.ndarray) -> Path:
    rows: list[str] = []
    nodes = "".join(f"  {k + 1}, 300., 5.\n" for k in range(5))
    for i in range(5):
        for j in range(i + 1, 6):
            b = f"{g[i, j] / (AREAS[i] * e[i]):.6f}" + (f",  {g[j, i] / (AREAS[j] * e[j]):.6f}" if j < 5 else "")
            end = f"BOX.{j + 1}" if j < 5 else "SPACE.1"
            rows.append(f"  -{len(rows) + 1},  BOX.{i + 1}, {end}, {g[i, j]:.6e}   $    {b}\n")
    optics = "C Optical Properties Used:\nC PROPERTY NAME      EMISS ALPHA IR TRANS SOL TRANS\n"
    optics += "C Anodised 6061-T6   0.86  0.9\nC Gold               0.3   0.2\nC\n"
    (folder / "rad.k").write_text(f"HEADER CONDUCTOR DATA, RAD\n{optics}C\nPSTOP\n{''.join(rows)}PSTART\n")
    (folder / "rad.ar").write_text("Units: m^2\n" + "".join(f"       BOX.{k + 1} {a}\n" for k, a in enumerate(AREAS)))
    case = folder / "case.inp"
    case.write_text(
        f"HEADER CONTROL DATA, GLOBAL\n  abszro = 0.\n  UID = SI\n  sigma = 5.67e-8\nHEADER NODE DATA, BOX\n{nodes}"
        "HEADER NODE DATA, SPACE\n  -1, 3., 0.\nINSERT rad.k\n"
    )
    return case


@pytest.fixture
def network(tmp_path: Path) -> NetworkFile:
    e = np.array(EMISSIVITY)[COATING]
    return read_sinda(_deck(tmp_path, exchanged(e), e))


def areas(network: NetworkFile, values: dict[str, float]) -> np.ndarray:
    known = ParameterSet(network.model()).evaluate(values)
    return np.array([known[f"{each.name}.area"] for each in network.conductors])


def test_the_properties_and_their_nodes_are_those_of_the_comments(network: NetworkFile) -> None:
    assert network.emissivities == {NAMES[0]: (0.86, 3), NAMES[1]: (0.3, 2)}
    assert [str(each) for each in network.remarks] == []
    assert areas(network, {}) == pytest.approx([float(re.search(r"[\d.e+-]+", str(c.table["area"]))[0]) for c in network.conductors])  # type: ignore[index]


@pytest.mark.parametrize(("moved", "within"), [((0.817, 0.285), 0.0015), ((0.774, 0.33), 0.005), ((0.9, 0.24), 0.006)])
def test_conductors_follow_emissivities_as_the_enclosure_does(network: NetworkFile, moved: tuple[float, float], within: float) -> None:
    """Against Gebhart's equations, in a mean over the conductors that is weighted with them: a tenth of what changes at most."""
    was, truth = (exchanged(np.array(each)[COATING])[np.triu_indices(6, 1)] for each in (EMISSIVITY, moved))
    seen = areas(network, dict(zip(NAMES, moved, strict=True)))
    assert np.average(np.abs(seen / truth - 1.0), weights=truth) < within
    assert np.average(np.abs(was / truth - 1.0), weights=truth) > 10.0 * within


def test_two_surfaces_that_see_each_other_alone_are_exact(tmp_path: Path) -> None:
    file = tmp_path / "case.inp"
    plates = "C PROPERTY NAME EMISS ALPHA\nC Gold 0.2 0.2\nC\n  -1, BOX.1, BOX.2, 0.1111111111  $  0.5555555555, 0.5555555555\n"
    plates += "  -2, BOX.1, BOX.2, 1.e-30\n"
    nodes = "HEADER CONTROL DATA, GLOBAL\n  abszro = 0.\nHEADER NODE DATA, BOX\n 1, 300., 5.\n 2, 300., 5.\n"
    file.write_text(f"{nodes}HEADER CONDUCTOR DATA, RAD\n{plates}")
    (tmp_path / "case.ar").write_text("Units: m^2\n  BOX.1 1.0\n  BOX.2 1.0\n")
    seen = areas(read_sinda(file), {"emissivity_gold": 0.3})
    assert seen[0] == pytest.approx(1.0 / (2.0 / 0.3 - 1.0), rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_what_comes_back_equals_the_fit_in_every_number_also_the_second_time(network: NetworkFile, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(2):
        values = {name: float(e * rng.uniform(0.8, 1.15)) for name, e in zip(NAMES, EMISSIVITY, strict=True)}
        fitted = network.model().with_values(values | {"radiation_rad": 1.1})
        assert network.not_written_back(fitted) == ()
        texts = network.written_back(fitted)
        assert [Path(name).name for name in texts] == ["rad.k"]
        for name, text in texts.items():
            Path(name).write_text(text)
        network = read_sinda(Path(next(iter(texts))).parent / "case.inp")
        assert [str(each) for each in network.remarks] == []
        wanted, found = (ParameterSet(each).evaluate({}) for each in (fitted, network.model()))
        assert found.keys() == wanted.keys()
        for path in wanted.keys() - {"radiation_rad"}:  # in the rows, which start from 1 again
            assert float(found[path]) == pytest.approx(float(wanted[path]), rel=1e-10, abs=1e-11), path  # twelve digits are written


def test_a_deck_that_came_back_follows_its_emissivities_as_before(network: NetworkFile) -> None:
    for name, text in network.written_back(network.model().with_values({NAMES[0]: 0.8})).items():
        Path(name).write_text(text)
    again = read_sinda(Path(next(iter(network.texts))).parent / "case.inp")
    moved = dict(zip(NAMES, (0.9, 0.24), strict=True))
    assert areas(again, moved) == pytest.approx(areas(network, moved), rel=1e-10)


def test_rows_through_an_insulation_have_a_factor_for_each_submodel(tmp_path: Path) -> None:
    file = tmp_path / "case.inp"
    nodes = "".join(f"  {k}, 300., 5.\n" for k in (1, 2, 20001, 20002))
    rows = "  1, 1, 2, 0.5\n  2, 1, 20001, 0.01\n  -3, 1, 20001, 0.002\n  4, 2, 20002, 0.01\n  -5, 2, 20002, 0.003\n"
    file.write_text(f"HEADER CONTROL DATA, GLOBAL\n  abszro = 0.\nHEADER NODE DATA, PANEL\n{nodes}HEADER CONDUCTOR DATA, PANEL\n{rows}")
    assert read_sinda(file).groups() == {"mli_panel_conduction": 2, "mli_panel": 2}


def test_the_efficiency_of_an_insulation_is_correlated_and_goes_back(tmp_path: Path) -> None:
    """Readings of a deck whose blankets pass 1.7 times what the file says, from two panels at two powers; five seeds."""
    nodes = "  1, 300., 400.\n  2, 300., 400.\n  20001, 250., -1.\n  20002, 250., -1.\n  -9, 3., 0.\n"
    rows = "  1, 1, 2, 0.3\n  -3, 1, 20001, 0.004\n  -5, 2, 20002, 0.006\n  -6, 20001, 9, 0.2\n  -7, 20002, 9, 0.3\n  8, 1, 9, 0.002\n"
    head = "HEADER CONTROL DATA, GLOBAL\n  abszro = 0.\n  sigma = 5.670374419e-08\n  UID = SI\nHEADER NODE DATA, PANEL\n"
    file = tmp_path / "case.inp"
    file.write_text(f"{head}{nodes}HEADER SOURCE DATA, PANEL\n  1, 4.\nHEADER CONDUCTOR DATA, PANEL\n{rows}")
    network = read_sinda(file)
    assert network.incomplete == ""
    start, times, missed = network.model(), np.arange(0.0, 20_001.0, 1000.0), []
    truth = start.with_values({"mli_panel": 1.7})
    for seed in range(5):
        rng, records = np.random.default_rng(seed), []
        for watts in (2.0, 6.0):
            case = network.scenario().with_(loads={"PANEL_Q1": f"{watts} [W]"}, duration="20000 [s]")
            run = td.simulate(truth, case, times=times)
            channels = {
                f"s{n}": td.Channel.from_array(
                    f"s{n}",
                    run[f"PANEL.T{n}"].kelvin + 0.1 * rng.standard_normal(times.size),
                    unit="K",
                    role="node",
                    target=f"PANEL.T{n}",
                    noise=0.1,
                )
                for n in (1, 2)
            }
            channels["q"] = td.Channel.from_array("q", np.full(times.size, watts), quantity="power", role="load", target="PANEL_Q1")
            records.append(td.Record.from_arrays(f"{watts:g} W", times, channels))
        fit = td.calibrate(start, records, ["mli_panel"], scenario=network.scenario())
        missed.append((fit.values["mli_panel"].value - 1.7) / fit.values["mli_panel"].error)
        assert fit.values["mli_panel"].error < 0.02
    assert np.abs(missed).max() < 3.0
    ((_, text),) = network.written_back(start.with_values({"mli_panel": 1.7})).items()
    file.write_text(text)
    found, wanted = (ParameterSet(each).evaluate({}) for each in (read_sinda(file).model(), truth))
    assert {path: float(found[path]) for path in ("PANEL_R3.area", "PANEL_R5.area")} == pytest.approx(
        {"PANEL_R3.area": 0.0068, "PANEL_R5.area": 0.0102}
    )
    assert float(wanted["PANEL_R5.area"]) == pytest.approx(0.0102)
