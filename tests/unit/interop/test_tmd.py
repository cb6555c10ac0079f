"""Temperatures that ESATAN leaves in a TMD: files written here after the layout of ESATAN-TMS 2018, its own under THERMID_PUBLIC."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from public_files import public_file
from thermid.base.errors import DeckError
from thermid.interop._decks.esatan import read_esatan
from thermid.interop._decks.results import agreement, balance, printed_temperatures

h5py = pytest.importorskip("h5py")
ZERO = 273.15
DECK = """$MODEL PLATE
  $MODEL BOX
  $NODES
  D1 = 'board', T = 15.0, C = 90.0, QI = 4.0;
  D2 = 'spare', T = 0.0, C = 9.0;
  $CONDUCTORS
  GL(1,2) = 0.3;
  $ENDMODEL
$NODES
D1 = 'plate', T = 15.0, C = 270.0;
X7 = 'gone', T = 0.0;
B99 = 'room', T = 22.0;
$CONDUCTORS
GL(1,BOX:1) = 0.5;
GR(1,99) = 0.034;
GL(1,99) = 0.2;
$EXECUTION
  TIMEND = 7200.0
$ENDMODEL
"""
NODES = (("BOX", 1), ("BOX", 2), ("PLATE", 1), ("PLATE", 7), ("PLATE", 99))


def _write_tmd(path: Path, solutions: list[tuple[list[float], np.ndarray]]) -> Path:
    """Write a TMD after the layout of those of ESATAN-TMS 2018, temperatures of times by nodes [degC]."""
    names = [b"Area", b"Temperature"]
    with h5py.File(path, "w") as file:
        analysis = file.create_group("AnalysisSet1")
        analysis.attrs["TAbs"] = ZERO
        kinds = np.dtype([("modelName", "S24"), ("parentId", "<i4"), ("modelPath", "S2474")])
        analysis["models"] = np.array([(b"PLATE", 0, b"PLATE"), (b"BOX", 1, b"PLATE:BOX")], kinds)
        analysis["thermalNodes"] = np.array([[number, 1 + (model == "BOX")] for model, number in NODES], np.int32)
        analysis["thermalNodesRealAttributes"] = np.array(names, "S32")
        analysis["thermalNodesStringAttributes"] = np.array([b"Label", b"Type"], "S32")
        for k, (times, celsius) in enumerate(solutions, 1):
            group = analysis.create_group(f"DataGroup{k}")
            group["times"] = np.array(times)
            group["thermalNodesRealData"] = np.stack([np.zeros_like(celsius), celsius], axis=2)
            group["thermalNodesStringData"] = np.array([[[b"", kind] for kind in (b"D", b"D", b"D", b"X", b"B")]] * len(times), "S24")
    return path


@pytest.fixture
def solved(tmp_path: Path) -> Callable[[float], tuple[Path, Path]]:
    """A deck, and its own steady state and transient as a TMD, in which one node can be so many kelvin off at the end."""

    def write(shift: float) -> tuple[Path, Path]:
        (tmp_path / "plate.d").write_text(DECK, encoding="latin-1")
        network = read_esatan(tmp_path / "plate.d")
        model, scenario = network.model(), network.scenario()
        times = [0.0, 37.0, 7200.0]  # not those at which a run stores temperatures by itself
        calm, run = td.steady(model, scenario), td.simulate(model, scenario, times=times)
        columns = ["PLATE_BOX.T1", "PLATE_BOX.T2", "PLATE.T1", "", "PLATE_T99"]
        kelvin = np.column_stack([run[path].kelvin if path else np.zeros(3) for path in columns])
        kelvin[2, 1] += shift
        settled = np.array([[calm[path] if path else 0.0 for path in columns]])
        return tmp_path / "plate.d", _write_tmd(tmp_path / "plate.TMD", [([0.0], settled - ZERO), (times, kelvin - ZERO)])

    return write


def test_a_steady_state_and_a_transient_are_judged_as_such(solved: Callable[[float], tuple[Path, Path]]) -> None:
    deck, results = solved(0.5)
    network, prints = read_esatan(deck), printed_temperatures(results)
    assert [(output.settled, output.time) for output in prints] == [(True, 0.0), (False, 0.0), (False, 37.0), (False, 7200.0)]
    assert "PLATE.T7" not in prints[0].numbers  # inactive
    agreed = agreement(network, prints)
    assert agreed.absent == ()
    assert np.isnan(agreed.times).tolist() == [True, False, False, False]
    worst = np.unravel_index(np.argmax(np.abs(agreed.off)), agreed.off.shape)
    assert (agreed.nodes[worst[1]], worst[0]) == ("PLATE_BOX.T2", 3)
    assert agreed.off[worst] == pytest.approx(-0.5, abs=1e-6)
    agreed.off[worst] = 0.0
    assert np.abs(agreed.off).max() < 1e-6
    assert balance(network, prints[0]).open() == {}


def _damage(change: str) -> Callable[[Any], None]:
    def damage(file: Any) -> None:
        group = file["AnalysisSet1"]
        if change == "no times":
            del group["DataGroup1/times"]
        elif change == "another length":
            del group["thermalNodes"]
            group["thermalNodes"] = np.array([[1, 1]], np.int32)
        elif change == "no temperatures":
            del group["thermalNodesRealAttributes"]
            group["thermalNodesRealAttributes"] = np.array([b"Area", b"Alpha"], "S32")
        elif change == "models in a circle":
            models = group["models"][()]
            models["parentId"] = [2, 1]
            group["models"][...] = models
        else:
            del file["AnalysisSet1"]

    return damage


@pytest.mark.parametrize("change", ["no times", "another length", "no temperatures", "models in a circle", "nothing"])
def test_a_file_of_another_layout_is_refused(tmp_path: Path, change: str) -> None:
    file = _write_tmd(tmp_path / "odd.TMD", [([0.0], np.zeros((1, 5)))])
    with h5py.File(file, "r+") as opened:
        _damage(change)(opened)
    with pytest.raises(DeckError, match="no TMD of ESATAN"):
        printed_temperatures(file)


def test_other_binary_results_are_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "old.TMD").write_bytes(b"TMD\0\0\1" * 20)
    with raises_code("file.another-kind", DeckError, match="TMD"):
        printed_temperatures(tmp_path / "old.TMD")
    (tmp_path / "cut.TMD").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 40)
    with raises_code("file.another-kind", DeckError):
        printed_temperatures(tmp_path / "cut.TMD")
    monkeypatch.setenv("THERMID_CAPS", "unpacked=100")
    with raises_code("cap.exceeded", DeckError, match="40"):
        printed_temperatures(_write_tmd(tmp_path / "large.TMD", [([0.0, 1.0, 2.0, 3.0], np.zeros((4, 5)))]))
    with raises_code("file.another-kind", DeckError, match="3.*5.*4.*5"):
        printed_temperatures(_write_tmd(tmp_path / "longer.TMD", [([0.0, 1.0, 2.0], np.zeros((4, 5)))]))


def test_a_print_whose_time_is_rounded_beyond_the_end_is_judged_at_the_end(tmp_path: Path) -> None:
    (tmp_path / "plate.d").write_text(DECK, encoding="latin-1")
    network = read_esatan(tmp_path / "plate.d")
    end = td.simulate(network.model(), network.scenario(), times=[7200.0])
    columns = ["PLATE_BOX.T1", "PLATE_BOX.T2", "PLATE.T1", "", "PLATE_T99"]
    kelvin = np.array([[end[path].kelvin[-1] if path else ZERO for path in columns]] * 2)
    agreed = agreement(network, printed_temperatures(_write_tmd(tmp_path / "late.TMD", [([7199.0, 7200.0002], kelvin - ZERO)])))
    assert np.abs(agreed.off[-1]).max() < 1e-6
    with raises_code("value.outside-range", DeckError, match="7300.*0.*7200"):
        agreement(network, printed_temperatures(_write_tmd(tmp_path / "other.TMD", [([7199.0, 7300.0], kelvin - ZERO)])))


DISC, SATELLITE = "pycanha-project/pycanha-core/test/data/esatan/DISCTR_TRANSIENT.TMD", "harper25/ESATAN_PostProcessing/GSG_SAT_POLAR.TMD"
SHA = {
    DISC: "9ca61502d675d9de25860547dcaf7861d6fd0153d4d7f1ff23ac1162a588de17",
    SATELLITE: "8cc85da7d28e5c227f2682d384ef592b71b28fbb952ae5a51263a94624f48edb",
}


def _public(name: str) -> Path:
    return public_file(name, SHA[name])


def _deck_of(tmd: Path) -> str:
    """Return the network that a TMD holds beside its temperatures as a deck: nodes, conductors, heat over its times."""
    with h5py.File(tmd, "r") as file:
        analysis = file["AnalysisSet1"]
        data = analysis["DataGroup1"]
        name, stefan = analysis["models"][0]["modelName"].decode(), analysis.attrs["StefanBoltzmann"]
        numbers, kinds, times = analysis["thermalNodes"][:, 0].tolist(), data["thermalNodesStringData"][0, :, 0], data["times"][()]
        real, of = data["thermalNodesRealData"][()], [word.decode() for word in analysis["thermalNodesRealAttributes"]]
        conductors = {kind: (analysis[f"conductors{kind}"][:, :2] - 1, data[f"conductorData{kind}"][0, :, 0]) for kind in ("GL", "GR")}
    heat = real[:, :, [k for k, word in enumerate(of) if word.startswith("Total_")]].sum(axis=2)
    t, c = real[0, :, of.index("Temperature")], real[0, :, of.index("Capacitance")]
    rows = [f"$MODEL {name}", "$CONSTANTS", "$CONTROL", f"STEFAN = {stefan!r};", "$NODES"]
    rows += [f"{kind.decode()}{n} = '', T = {t[k]!r}, C = {c[k]!r};" for k, (n, kind) in enumerate(zip(numbers, kinds, strict=True))]
    rows += ["$CONDUCTORS"]
    for kind, (ends, values) in conductors.items():
        rows += [f"{kind}({numbers[a]},{numbers[b]}) = {g!r};" for (a, b), g in zip(ends.tolist(), values.tolist(), strict=True)]
    heated = [k for k in range(len(numbers)) if heat[:, k].any()]
    rows += ["$ARRAYS", "$REAL"]
    for k in heated:
        pairs = ", ".join(f"{a!r}, {b!r}" for a, b in zip(times.tolist(), heat[:, k].tolist(), strict=True))
        rows.append(f"H{numbers[k]}(2,{times.size}) = {pairs};")
    rows += ["$VARIABLES1", *(f"QI{numbers[k]} = INTRP1(TIMEM, H{numbers[k]}, 1)" for k in heated)]
    return "\n".join([*rows, "$EXECUTION", f"TIMEND = {times[-1]!r}", "$ENDMODEL", ""]).replace("np.float64", "")


def test_a_run_of_esatan_against_its_own_results(tmp_path: Path) -> None:
    """The deck is made of the network that the file holds beside its results, so this shows runs and reading, not the reading of a deck."""
    file = _public(DISC)
    (tmp_path / "own.d").write_text(_deck_of(file), encoding="latin-1")
    network = read_esatan(tmp_path / "own.d")
    assert network.incomplete == ""
    agreed = agreement(network, printed_temperatures(file))
    assert agreed.off.shape == (101, 102)
    assert np.abs(agreed.off).max() < 5e-5


def test_a_satellites_orbit_is_read_whole() -> None:
    """Its streams and the turning of its panels are not in the file, so that its runs cannot be repeated from it."""
    prints = printed_temperatures(_public(SATELLITE))
    assert (len(prints), len(prints[0].numbers), prints[-1].time) == (310, 224, pytest.approx(6176.725553))
    assert prints[0].numbers["GSG_SAT_POLAR.T2002"] == pytest.approx(71.49, abs=1e-4)
