"""Archives of FMUs that are meant to do harm are refused before anything of them is unpacked."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from by_code import raises_code
from thermid.base.errors import ThermidError
from thermid.interop._fmu.archive import check_archive

DESCRIPTION = '<?xml version="1.0"?>\n<fmiModelDescription fmiVersion="3.0" modelName="m"/>\n'


def packed(path: Path, files: dict[str, bytes | str] | None = None, description: str | bytes = DESCRIPTION) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        for name, text in (files or {}).items():
            archive.writestr(name, text)
    return path


def link(path: Path, target: str) -> Path:
    packed(path)
    with zipfile.ZipFile(path, "a") as archive:
        entry = zipfile.ZipInfo("resources/link")
        entry.external_attr = 0o120777 << 16
        archive.writestr(entry, target)
    return path


def changed(path: Path, old: bytes, new: bytes) -> Path:
    packed(path, {"resources/a.bin": b"a" * 50, "resources/b.bin": b"b" * 50})
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))
    return path


def overlapping(path: Path) -> Path:
    """Two entries of the directory that lead to the bytes of one, as bombs without nesting do."""
    packed(path, {"resources/a.bin": b"a" * 50, "resources/b.bin": b"b" * 50})
    data = bytearray(path.read_bytes())
    entries = [k for k in range(len(data)) if data[k : k + 4] == b"PK\x01\x02"]
    first = data[entries[1] + 42 : entries[1] + 46]
    data[entries[2] + 42 : entries[2] + 46] = struct.pack("<I", struct.unpack("<I", first)[0] + 1)
    path.write_bytes(bytes(data))
    return path


def encrypted(path: Path) -> Path:
    packed(path, {"resources/a.bin": b"a" * 50})
    data = bytearray(path.read_bytes())
    for mark, place in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        for k in [k for k in range(len(data)) if data[k : k + 4] == mark]:
            data[k + place] |= 1
    path.write_bytes(bytes(data))
    return path


LAUGHS = '<?xml version="1.0"?>\n<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>\n<fmiModelDescription modelName="&b;"/>\n'
HOSTILE: dict[str, Callable[[Path], Path]] = {
    "no zip": lambda path: (path.write_bytes(b"MZ nothing"), path)[1],
    "empty": lambda path: (path.write_bytes(b""), path)[1],
    "cut": lambda path: (packed(path), path.write_bytes(path.read_bytes()[:-30]), path)[2],
    "without description": lambda path: (path.write_bytes(b"PK\x05\x06" + bytes(18)), path)[1],
    "climbing": lambda path: packed(path, {"../evil.txt": "x"}),
    "climbing inside": lambda path: packed(path, {"resources/../../evil.txt": "x"}),
    "absolute": lambda path: packed(path, {"/etc/evil": "x"}),
    "drive": lambda path: packed(path, {"C:/evil": "x"}),
    "backslashes": lambda path: packed(path, {"resources\\..\\..\\evil": "x"}),
    "link up": lambda path: link(path, "../../.."),
    "link to a file": lambda path: link(path, "/etc/passwd"),
    "bomb": lambda path: packed(path, {"resources/zeros.bin": b"\0" * 3_000_000}),
    "bomb in pieces": lambda path: packed(path, {f"resources/{k}.bin": b"\0" * 300_000 for k in range(10)}),
    "twice": lambda path: packed(path, {"resources/a": "x", "Resources/A": "y"}),
    "overlapping": overlapping,
    "encrypted": encrypted,
    "entities": lambda path: packed(path, description=LAUGHS),
    "entity of a file": lambda path: packed(path, description=LAUGHS.replace('"ha"', 'SYSTEM "file:///etc/passwd"')),
    "entities in two bytes": lambda path: packed(path, description=LAUGHS.encode("utf-16")),
    "entities beside": lambda path: packed(path, {"sources/buildDescription.xml": LAUGHS}),
    "damaged description": lambda path: changed(path, b"PK\x03\x04", b"PK\x03\x05"),
}  # fmt: skip


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_archives_are_refused_with_their_name(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("THERMID_CAPS", "unpacked=2e6")
    file = HOSTILE[kind](tmp_path / "theirs.fmu")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(ThermidError) as refused:
        check_archive(file)
    assert "theirs.fmu" in str(refused.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_plain_archive_passes(tmp_path: Path) -> None:
    check_archive(packed(tmp_path / "plain.fmu", {"resources/model.bin": b"\1" * 100, "binaries/x86_64-linux/m.so": b"\0" * 9}))


def test_an_fmu_is_checked_before_it_is_read(tmp_path: Path) -> None:
    pytest.importorskip("fmpy", reason="FMPy is not installed (pip install 'thermid[fmu]')")
    from thermid.interop.fmu import fmu_model

    with raises_code("value.wrong-kind", match=r"evil\.txt"):
        fmu_model(packed(tmp_path / "theirs.fmu", {"../evil.txt": "x"}))
