"""Files appear whole or not at all, and never in the place of what somebody else wrote or what the command reads."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base import files
from thermid.base.errors import OutputError
from thermid.base.files import FileKind, FileKinds, command, folder_replacing, parse_toml, read_bytes, read_text, scratch, sweep, unsealed

PNG = (
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0:~\x9bU\0\0\0\nIDATx\x9cc`\0\0\0\x02\0\x01H\xaf\xa4q"
    b"\0\0\0\0IEND\xaeB`\x82"
)
TEXTS: list[tuple[FileKind, str, str]] = [
    (FileKinds.DECK, 'title = "plate"\n', "#"),
    (FileKinds.DECK, 'title = "plate"', "#"),
    (FileKinds.EXPORT, "function f\nend\n", "%"),
    (FileKinds.EXPORT, "title\n.end\n", "*"),
    (FileKinds.PAGE, "<!DOCTYPE html>\n<html></html>\n", "#"),
    (FileKinds.PICTURE, '<svg xmlns="http://www.w3.org/2000/svg"></svg>\n', "#"),
    (FileKinds.CREDIBILITY, '{\n "schema": 1\n}', "#"),
]


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def cut_short(path: Path) -> None:
    with FileKinds.RESULTS_FILE.replacing(path) as half:
        half.write_text("one line of ma")
        raise KeyboardInterrupt


def full_disk(path: Path) -> None:
    with FileKinds.RESULTS_FILE.replacing(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))  # as `write` has it: without a name


def test_a_file_that_is_interrupted_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    for before in (None, "old"):
        if before:
            path.write_text(before)
        with pytest.raises(KeyboardInterrupt):
            cut_short(path)
        with pytest.raises(OSError, match=r"run\.csv") as caught:
            full_disk(path)
        assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(path))
        assert names(tmp_path) == (["run.csv"] if before else [])
        assert not before or path.read_text() == before
    path.chmod(0o640)
    with FileKinds.RESULTS_FILE.replacing(path) as half:
        assert half.name.endswith("run.csv")
        half.write_text("new")
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert names(tmp_path) == ["run.csv"]


def test_a_new_file_has_the_rights_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "any").write_text("")
    with FileKinds.RESULTS_FILE.replacing(tmp_path / "run.csv") as half:
        half.write_text("new")
    assert (tmp_path / "run.csv").stat().st_mode == (tmp_path / "any").stat().st_mode


def test_an_error_names_the_file_that_was_requested(tmp_path: Path) -> None:
    for path in (tmp_path / "no folder" / "run.csv", tmp_path):
        with pytest.raises(OSError, match=path.name) as caught, FileKinds.RESULTS_FILE.replacing(path):
            pass
        assert caught.value.filename == str(path)


@pytest.mark.skipif(os.name != "posix", reason="links and devices as POSIX has them")
def test_links_are_followed_and_devices_written_to(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "real.csv")
    with FileKinds.RESULTS_FILE.replacing(tmp_path / "link") as half:
        half.write_text("x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "x"
    with FileKinds.TABLE.replacing(os.devnull) as place:
        assert place == Path(os.devnull)


@pytest.mark.parametrize(("kind", "text", "comment"), TEXTS)
def test_a_sealed_text_is_replaced_until_somebody_changes_it(tmp_path: Path, kind: FileKind, text: str, comment: str) -> None:
    path = tmp_path / f"file{kind.endings[0]}"
    for again in (text, text):
        kind.save_text(path, again, comment)
    whole = path.read_bytes()
    assert text.strip().removesuffix("}").strip() in whole.decode()
    path.write_bytes(whole.replace(b"\n", b"\r\n"))  # as a version control may write it
    kind.save_text(path, text, comment)
    for changed in (b" " + whole, whole + b"x = 1\n", whole.replace(b"t", b"T", 1), text.encode(), b"somebody's"):
        path.write_bytes(changed)
        with raises_code("output.over-another-file", OutputError):
            kind.save_text(path, text, comment)
        assert path.read_bytes() == changed
    path.write_bytes(whole)
    with raises_code("output.over-another-file", OutputError):
        FileKind("profile").save_text(path, text)
    assert names(tmp_path) == [path.name]


def test_pictures_and_printed_pages_carry_their_seal_where_readers_allow_it(tmp_path: Path) -> None:
    for data, kind in ((PNG, FileKinds.PICTURE), (b"%PDF-1.4\n%%EOF\n", FileKinds.PAPER)):
        path = tmp_path / f"{kind.name}{kind.endings[0]}"
        for _ in range(2):
            kind.save_bytes(path, data)
        assert path.read_bytes()[:8] == data[:8]
        path.write_bytes(path.read_bytes().replace(b"\0" if data is PNG else b"1", b"2", 1))
        with pytest.raises(OutputError):
            kind.may_write(path)
    image = pytest.importorskip("matplotlib.image")
    FileKinds.PICTURE.save_bytes(tmp_path / "x.png", PNG)
    assert image.imread(tmp_path / "x.png").shape[:2] == (1, 1)


def test_tables_are_known_by_their_header_and_read_as_before(tmp_path: Path) -> None:
    deck = {"title": "p", "needs": ["air"], "nodes": {"b": {"capacitance": "50 [J/K]"}}}
    deck["conductors"] = {"k": {"kind": "contact", "between": ["b", "air"], "contact_conductance": "1 [W/(m^2 K)]", "area": "1 [m^2]"}}
    run = td.simulate(td.model_from_dict(deck), td.Scenario(boundaries={"air": "20 [degC]"}, start="30 [degC]", duration="1 [min]"))
    path = tmp_path / "run.csv"
    for _ in range(2):
        run.to_csv(path)
    assert path.read_text().splitlines()[0] == '"time_s",b [degC],air [degC]'
    columns = np.genfromtxt(path, delimiter=",", names=True)
    assert columns.dtype.names == ("time_s", "b_degC", "air_degC")
    record = td.read_record(path, {"b": {"node": "b"}})
    for _ in range(2):
        record.to_csv(tmp_path / "log.csv")
    assert (tmp_path / "log.csv").read_text().splitlines()[0] == '"time_s [s]",b [degC]'
    assert td.read_record(tmp_path / "log.csv", {"b": {"node": "b"}}).channels["b"].values == pytest.approx(run["b"].kelvin)
    with pytest.raises(OutputError):
        run.to_csv(tmp_path / "log.csv")
    with pytest.raises(OutputError):
        record.to_csv(path)
    for line in ("time_s,b [degC]", '"time_s","b [degC]"', 'time_s,"b [degC]"', '"t","b"', ""):
        path.write_text(f"{line}\n0,20\n")
        for kind in (FileKinds.TABLE, FileKinds.LOG):
            with pytest.raises(OutputError):
                kind.may_write(path)


KINDS = {name: kind for name, kind in vars(files).items() if isinstance(kind, FileKind)}


@pytest.mark.parametrize("name", sorted(KINDS))
def test_no_file_has_the_ending_of_another_format(tmp_path: Path, name: str) -> None:
    kind = KINDS[name]
    for ending in kind.endings:
        assert kind.may_write(tmp_path / f"x{ending.upper()}") == tmp_path / f"x{ending.upper()}"
    for ending in set(files.FORMATS) - set(kind.endings) if kind.endings else ():
        with pytest.raises(OutputError, match=rf"the ending '{re.escape(ending)}' promises .*, but the {kind.name} is written as"):
            kind.may_write(tmp_path / f"x{ending}")
    for ending in ("", ".out"):
        if kind.named:
            with raises_code("output.wrong-ending", OutputError):
                kind.may_write(tmp_path / f"x{ending}")
        else:
            kind.may_write(tmp_path / f"x{ending}")
    assert kind.own is not None or kind.titled("two words").endings == kind.endings


def test_what_is_written_in_python_has_the_format_of_its_name(tmp_path: Path) -> None:
    """Solutions, records, models, decks and exports: an ending that promises another format is refused, and nothing is written."""
    deck = {"title": "p", "needs": ["air"], "nodes": {"b": {"capacitance": "50 [J/K]"}}}
    deck["conductors"] = {"k": {"kind": "contact", "between": ["b", "air"], "contact_conductance": "1 [W/(m^2 K)]", "area": "1 [m^2]"}}
    model = td.model_from_dict(deck)
    scenario = td.Scenario(boundaries={"air": "20 [degC]"}, start="30 [degC]", duration="1 [min]")
    run = td.simulate(model, scenario)
    run.to_csv(tmp_path / "run.csv")
    record = td.read_record(tmp_path / "run.csv", {"b": {"node": "b"}})
    (tmp_path / "run.csv").unlink()
    for write, name in (
        (run.to_csv, "run.xlsx"),
        (record.to_csv, "log.pdf"),
        (run.to_csv, "run.csv.gz"),
        (lambda path: td.save_model(model, path), "deck.json"),
    ):
        with raises_code("output.wrong-ending", OutputError):
            write(tmp_path / name)
    assert names(tmp_path) == []


def test_netcdf_is_known_by_its_source(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = tmp_path / "run.nc"
    for source, own in (("thermid", True), ("a colleague", False), (None, False)):
        xarray.Dataset(attrs={} if source is None else {"source": source}).to_netcdf(path, engine="h5netcdf")
        assert FileKinds.NETCDF.wrote(path) is own
    path.write_text("no netCDF at all")
    assert not FileKinds.NETCDF.wrote(path)


def test_what_a_command_read_is_not_written_over(tmp_path: Path) -> None:
    path, link, twin = (tmp_path / name for name in ("deck.toml", "link.toml", "twin.toml"))
    FileKinds.DECK.save_text(path, "a = 1\n")
    link.symlink_to(path)
    os.link(path, twin)
    for read in (read_text, read_bytes):
        for one in (path, link, twin):
            with command():
                for target in (path, link, twin):
                    FileKinds.DECK.may_write(target)
                read(one)
                for target in (path, link, twin):
                    with raises_code("output.over-input", OutputError):
                        FileKinds.DECK.save_text(target, "b = 2\n")
    with command(force=True):
        read_text(path)
        FileKinds.DECK.save_text(path, "b = 2\n")
    read_text(path)
    FileKinds.DECK.save_text(path, "c = 3\n")  # outside of a command nothing is remembered
    assert unsealed(path.read_text()) == "c = 3\n"
    assert "a = 1" in twin.read_text()
    with pytest.raises(OutputError):
        FileKinds.COPY.save_bytes(path, b"x")


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 5000 + "]" * 5000,
        "a = " + "{a=" * 3000 + "1" + "}" * 3000,
        "[" + ".".join(["a"] * 20000) + "]",
        " . ".join(["a"] * 20000) + " = 1",
        "a = " + "9" * 5000,
        "a" * 1_000_000,
        "a = '" + "a." * 200_000,
    ],
)
def test_a_toml_text_without_measure_is_refused_at_once(text: str) -> None:
    begun = time.process_time()
    with pytest.raises(tomllib.TOMLDecodeError):
        parse_toml(text)
    assert time.process_time() - begun < 1.0


def test_a_read_only_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = FileKinds.DECK.save_text(tmp_path / "deck.toml", "a = 1\n")
    monkeypatch.setattr(os, "access", lambda *_: False)  # who runs the tests as root may write anything
    with pytest.raises(PermissionError, match=r"deck\.toml"), command(force=True):
        FileKinds.DECK.save_text(path, "b = 2\n")


def test_leftovers_of_dead_processes_are_swept_and_no_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = (
        "import os, sys, thermid.base.files as f\n"
        "with f.FileKinds.RESULTS_FILE.replacing(sys.argv[1]) as h:\n    h.write_text('x')\n    os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.csv")], check=False)
    (left,) = names(tmp_path)
    assert ".half.a.csv" in left
    pid = left.split("-")[1]
    strange = [f".{'0' * 6}-{pid}-00000000.half.b", left.replace(pid, str(os.getpid())), left.replace(pid, "1"), ".half.c"]
    for name in strange:
        (tmp_path / name).write_text("x")
    FileKinds.DECK.save_text(tmp_path / "b.toml", "x = 1\n")
    assert names(tmp_path) == sorted([*strange, "b.toml"])
    old = time.time() - 2 * 86400.0
    for name in strange:
        os.utime(tmp_path / name, (old, old))
    sweep(tmp_path)
    assert names(tmp_path) == [".half.c", "b.toml"]
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / left).mkdir()
    (tmp_path / left / "x").write_text("x")
    with scratch() as folder:
        (folder / "y").write_text("y")
    assert names(tmp_path) == [".half.c", "b.toml"]


def half_a_folder(path: Path) -> None:
    with folder_replacing(path) as half:
        (half / "x").write_text("x")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="delivery"):
        half_a_folder(tmp_path / "delivery")
    assert names(tmp_path) == []
    (tmp_path / "delivery").mkdir()
    with folder_replacing(tmp_path / "delivery") as half:
        (half / "x").write_text("x")
    assert names(tmp_path / "delivery") == ["x"]
