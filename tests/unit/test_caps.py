"""Every cap stands in one table: a refusal names it, and the environment variable that it names raises it."""

from __future__ import annotations

import gzip
import os
import threading
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base import files
from thermid.base.errors import CAPS, CAPS_VARIABLE, RecordError, ScenarioError, ThermidError, cap
from thermid.base.units import Expression, unit
from thermid.interop.decks import read_sinda
from thermid.interop.initfcn import read_initfcn
from thermid.measure.readers import read_plain

MODEL: dict[str, Any] = {
    "title": "plate",
    "needs": ["air"],
    "nodes": {"plate": {"capacitance": "100 [J/K]"}},
    "conductors": {"film": {"kind": "conduction", "between": ["plate", "air"], "conductance": "1 [W/K]"}},
}
LOG = "time_s,T [degC]\n" + "".join(f"{k},{20 + k / 7:.3f}\n" for k in range(40))
DECK = 'title = "a"\n[nodes]\nbody = { capacitance = "1 [J/K]" }\n'


def scenario(**more: Any) -> td.Scenario:
    return td.Scenario("day", **({"boundaries": {"air": "20 [degC]"}, "start": "20 [degC]", "duration": "1 [h]"} | more))


def run(every: str = "1 [min]", **more: Any) -> Any:
    return td.simulate(td.model_from_dict(MODEL), scenario(**more), every=every)


def pulsed() -> Any:
    """A load of a millisecond and a millisecond, which becomes a table of a run's length."""
    load = {"into": "plate", "power": "1 [W]", "periodic": {"period": "2 [ms]", "duty": 0.5}}
    return td.simulate(td.model_from_dict(MODEL | {"loads": {"q": load}}), scenario(duration="1 [s]"), every="0.5 [s]")


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def hdf5(folder: Path) -> Path:
    """A kilobyte that says it holds a million numbers."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "log.h5", "w") as file:
        for name in ("time", "T"):
            file.create_dataset(name, shape=(1_000_000,), dtype="f8", chunks=(10_000,), compression="gzip", fillvalue=1.0)
    assert (folder / "log.h5").stat().st_size < 5000
    return folder / "log.h5"


def matlab(folder: Path, packed: bool = True) -> Path:
    from scipy.io import savemat

    savemat(folder / "log.mat", {"time": np.arange(1e5), "T": np.zeros(100_000)}, do_compression=packed)
    return folder / "log.mat"


def book(folder: Path, last: str = "B2", empty: int = 0) -> Path:
    """A workbook of one sheet whose last cell may stand far out."""
    pytest.importorskip("python_calamine")
    space = "http://schemas.openxmlformats.org"
    main, documents = f"{space}/spreadsheetml/2006/main", f"{space}/officeDocument/2006/relationships"
    head = '<?xml version="1.0"?>'
    kinds = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    row = int("".join(c for c in last if c.isdigit()))
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{space}/package/2006/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        f'<Override PartName="/xl/workbook.xml" ContentType="{kinds}.sheet.main+xml"/>'
        f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{kinds}.worksheet+xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{space}/package/2006/relationships">'
        f'<Relationship Id="r1" Type="{documents}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{documents}">'
        f'<sheets><sheet name="S" sheetId="1" r:id="r1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{space}/package/2006/relationships">'
        f'<Relationship Id="r1" Type="{documents}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>',
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{main}"><sheetData><row r="1"><c r="A1" t="str"><v>time_s</v></c>'
        f'<c r="B1" t="str"><v>T [degC]</v></c></row>{"<row/>" * empty}'
        f'<row r="2"><c r="A2"><v>0</v></c><c r="B2"><v>20</v></c></row><row r="3"><c r="A3"><v>1</v></c><c r="B3"><v>21</v></c></row>'
        f'<row r="{row}"><c r="{last}"><v>2</v></c></row></sheetData></worksheet>',
    }
    with zipfile.ZipFile(folder / "log.xlsx", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, head + text)
    return folder / "log.xlsx"


def sheet(folder: Path, rows: int = 2, columns: int = 1, empty: int = 0) -> Path:
    """An OpenDocument workbook whose second row, and the cells in it, stand there so many times; then so many empty rows."""
    pytest.importorskip("python_calamine")
    space = "urn:oasis:names:tc:opendocument:xmlns"
    names = " ".join(f'xmlns:{word}="{space}:{word}:1.0"' for word in ("office", "table", "text"))
    words = [f'<table:table-cell office:value-type="string"><text:p>{w}</text:p></table:table-cell>' for w in ("time_s", "T [degC]")]
    value = 'office:value-type="float" office:value="{0}"><text:p>{0}</text:p></table:table-cell>'
    row = f'<table:table-cell {value.format(0)}<table:table-cell table:number-columns-repeated="{columns}" {value.format(20)}'
    body = (
        f'<table:table-row>{"".join(words)}</table:table-row><table:table-row table:number-rows-repeated="{rows}">{row}</table:table-row>'
    )
    if empty:
        body += f'<table:table-row table:number-rows-repeated="{empty}"><table:table-cell/></table:table-row>'
    kind, manifest = "application/vnd.oasis.opendocument.spreadsheet", f"{space}:manifest:1.0"
    parts = {
        "mimetype": kind,
        "META-INF/manifest.xml": f'<manifest:manifest xmlns:manifest="{manifest}"><manifest:file-entry manifest:full-path="/" '
        f'manifest:media-type="{kind}"/></manifest:manifest>',
        "content.xml": f'<office:document-content {names} office:version="1.2"><office:body><office:spreadsheet>'
        f'<table:table table:name="S">{body}</table:table></office:spreadsheet></office:body></office:document-content>',
    }
    with zipfile.ZipFile(folder / "log.ods", "w") as archive:
        for name, text in parts.items():
            archive.writestr(name, text, None if name == "mimetype" else zipfile.ZIP_DEFLATED)
    return folder / "log.ods"


def packed(folder: Path) -> Path:
    (folder / "log.csv.gz").write_bytes(gzip.compress(LOG.encode(), mtime=0))
    return folder / "log.csv.gz"


def uses(folder: Path) -> Path:
    """A deck that uses another, which uses a third."""
    written(folder, "third.toml", DECK)
    for name, used in (("second", "third"), ("first", "second")):
        written(folder, f"{name}.toml", f'title = "{name}"\n[submodels]\nx = {{ use = "{used}.toml" }}\n')
    return folder / "first.toml"


def sinda(folder: Path, more: str = "") -> Path:
    text = "HEADER NODE DATA, MAIN\n10, 20.0, 100.0\n-99, 20.0, 1.0\nHEADER CONDUCTOR DATA, MAIN\n1, 10, 99, 0.5\nEND OF DATA\n"
    written(folder, "inner.inc", "10, 20.0, 100.0\n")
    return written(folder, "net.cc", text.replace("10, 20.0, 100.0\n", more or "10, 20.0, 100.0\n"))


def imported(path: Path) -> Any:
    return read_sinda(path, "W m C")


def profile(folder: Path) -> Path:
    return written(folder, "p.toml", '[profile]\ntitle = "p"\nlike = "SMC-S-016 unit thermal cycle"\nlevel = "acceptance"\ncycles = 9\n')


def cells() -> Any:
    size = ("3 [cm]", "2 [cm]", "1 [cm]")
    return td.Block(size, (3, 2, 1), "1 [W/(m K)]", "2000 [kg/m^3]", "900 [J/(kg K)]").model()


def array() -> Any:
    parts = {"p": {"use": td.model_from_dict(MODEL), "count": [2, 2], "bind": {"air": "q"}}}
    return td.model_from_dict({"title": "x", "submodels": parts, "nodes": {"q": {"capacitance": "1 [J/K]"}}})


ASKED: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "text": ("20", lambda f: td.load_model(written(f, "a.toml", DECK))),
    "deck": ("20", lambda f: imported(sinda(f))),
    "script": ("5", lambda f: read_initfcn("m = 1.25; % mass [kg]\n")),
    "unpacked": ("100", lambda f: read_plain(packed(f))),
    "unpacked in HDF5": ("1e6", lambda f: read_plain(hdf5(f))),
    "unpacked in MATLAB": ("1e6", lambda f: read_plain(matlab(f))),
    "unpacked in a workbook": ("1e3", lambda f: read_plain(book(f))),
    "unpacked in a workbook of OpenDocument": ("1e3", lambda f: read_plain(sheet(f, 40))),
    "outputs": ("50", lambda f: run()),
    "stored": ("50", lambda f: run()),
    "samples": ("100", lambda f: pulsed()),
    "members": ("7", lambda f: td.qualify.uncertain_runs(td.model_from_dict(MODEL), scenario(), spread={"air": "1 [K]"}, n=8, seed=1)),
    "cycles": ("2", lambda f: td.qualify.profile_of("SMC-S-016", "unit thermal cycle", cycles=9, hot="60 [degC]", cold="-20 [degC]").steps),
    "instances": ("3", lambda f: array()),
    "cells": ("5", lambda f: cells()),
    "exponent": ("2", lambda f: unit("m^5")),
    "unit": ("5", lambda f: unit("W/(m^2 K)")),
    "expression": ("10", lambda f: Expression.parse("1 + 1 + 1 + 1 [W]")),
    "power": ("3", lambda f: Expression.parse("2**5 [W]")),
    "key": ("2", lambda f: files.parse_toml("a.b.c = 1\n")),
    "nesting": ("2", lambda f: td.load_model(written(f, "a.toml", DECK))),
    "decks": ("2", lambda f: td.load_model(uses(f))),
    "includes": ("1", lambda f: imported(sinda(f, "INSERT inner.inc\n"))),
}  # fmt: skip


@pytest.mark.parametrize("what", ASKED)
def test_a_refusal_names_the_cap_and_what_raises_it(what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = what.partition(" ")[0]
    low, asks = ASKED[what]
    Expression.parse.cache_clear()
    unit.cache_clear()
    monkeypatch.setenv(CAPS_VARIABLE, f"{name}={low}")
    with pytest.raises((ThermidError, ValueError), match=f"'{name}' is .* {CAPS_VARIABLE}={name}=NUMBER"):
        asks(tmp_path)
    monkeypatch.setenv(CAPS_VARIABLE, f"body=5 {name}={2.0 * CAPS[name][0]:g}")
    asks(tmp_path)
    monkeypatch.delenv(CAPS_VARIABLE)
    asks(tmp_path)


def test_a_wrong_cap_is_refused_with_the_nearest_name(monkeypatch: pytest.MonkeyPatch) -> None:
    for given, code, match in (
        ("unpackt=5", "name.unknown", "cap 'unpackt'.*'unpacked'"),
        ("unpacked=much", "cap.no-number", "'unpacked=much'"),
        ("samples=-1", "cap.no-number", "'samples=-1'"),
        ("samples=nan", "cap.no-number", ""),
    ):
        monkeypatch.setenv(CAPS_VARIABLE, given)
        with raises_code(code, match=match):
            cap("unpacked")


def test_the_caps_stand_on_the_page() -> None:
    page = (Path(__file__).parents[2] / "docs/torture.md").read_text(encoding="utf-8")
    for name, (most, what) in CAPS.items():
        assert f"| `{name}` | {most:g} | {what} |" in page


def test_a_number_that_no_float_holds_is_refused_with_its_place(tmp_path: Path) -> None:
    text = 'title = "x"\nduration = "1 [h]"\n[environment.air]\nhumidity = ' + "1" * 400 + "\n"
    with raises_code("file.wrong-value", ScenarioError, match=r"x\.toml:4.*environment\.air\.humidity.*399"):
        td.load_scenario(written(tmp_path, "x.toml", text))
    with raises_code("expression.no-finite-value"):
        td.Scenario("x", commands={"q": 10**400})


@pytest.mark.parametrize("before", ["", "'", "lower", "space", "folder"])
def test_a_workbook_whose_last_cell_is_far_out_does_not_end_the_process(tmp_path: Path, before: str) -> None:
    """1.4 kB; the library would hold 1.7e10 cells and abort, however the place of the cell is written and wherever the sheet lies."""
    file = book(tmp_path, "XFD1048576")
    with zipfile.ZipFile(file) as archive:
        parts = {name: archive.read(name).decode() for name in archive.namelist()}
    last, sheet_ = 'r="XFD1048576"', "xl/worksheets/sheet1.xml"
    written_ = {"'": last.replace('"', "'"), "lower": last.lower(), "space": last.replace("=", " = ")}.get(before, last)
    parts[sheet_] = parts[sheet_].replace(last, written_)
    with zipfile.ZipFile(file, "w") as archive:
        for name, text in parts.items():
            moved = "pages/" if before == "folder" else "worksheets/"
            archive.writestr(name.replace("worksheets/", moved), text.replace("worksheets/", moved))
    with raises_code("record.damaged", RecordError, match="1000.*MB.*THERMID_CAPS"):
        read_plain(file)
    assert read_plain(book(tmp_path)).cells.header == ("time_s", "T [degC]")


def test_a_cell_that_stands_in_a_million_rows_does_not_end_the_process(tmp_path: Path) -> None:
    """700 bytes; rows that are empty to the last one of the sheet, as LibreOffice writes them, count nothing."""
    with raises_code("record.damaged", RecordError):
        read_plain(sheet(tmp_path, 1_048_570, 16_000))
    assert len(read_plain(sheet(tmp_path, 40, 3, empty=1_048_500)).cells.lines) == 40


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names")
def test_a_silent_pipe_is_given_up_and_a_full_one_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    monkeypatch.setattr(files, "SILENCE", 0.05)
    with raises_code("file.silent-pipe", ThermidError):
        read_plain(pipe)
    with raises_code("file.not-a-file", ThermidError):
        td.load_model(pipe)
    monkeypatch.setattr(files, "SILENCE", 20.0)
    thread = threading.Thread(target=lambda: pipe.write_text(LOG, encoding="utf-8"))
    thread.start()
    assert len(files.read_bytes(pipe)) == len(LOG)
    thread.join()
    monkeypatch.setenv(CAPS_VARIABLE, "unpacked=1000")
    with raises_code("cap.exceeded", ThermidError):
        files.read_bytes("/dev/zero")


def test_a_sinda_node_option_without_cells_is_refused_with_its_line(tmp_path: Path) -> None:
    with raises_code("import.not-understood", match=r"net\.cc:2.*'SIV 10'"):
        imported(sinda(tmp_path, "SIV 10\n"))
