"""Files are written in one place, `thermid.base.files`, and what a command reads passes through it too."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from .source import Module

WRITES = {
    "write_text",
    "write_bytes",
    "savefig",
    "savetxt",
    "savez",
    "to_netcdf",
    "mkstemp",
    "mkdtemp",
    "NamedTemporaryFile",
    "TemporaryDirectory",
    "copyfile",
    "copy2",
    "symlink_to",
    "hardlink_to",
    "rename",
}
PLACES = {
    ("thermid.base.files", "writing is its work"),
    ("thermid.bench.benchlog", "the logger appends, line by line, each on disk before the next is read"),
    ("thermid.interop._fmu.process", "a page of memory that two processes share, in a folder of its own"),
    ("thermid.interop._fmu.child", "the same page, and the null device"),
}
INSIDE_REPLACING = {"savetxt", "savez", "to_netcdf", "savefig"}
"""What a library writes to a path that `replacing` gave, or into memory."""
OURS = {"replacing", "save_bytes"}
"""Methods of `FileKind` that give a place to write to, or take what was written into memory."""
READS = {"read_text", "read_bytes"}
NO_INPUT = {
    "thermid.base.files": "reading is its work; locks and verdicts are carried on",
    "thermid.bench.bench_files": "the map is changed in its place",
    "thermid.bench.benchlog": "the log is continued",
    "thermid.campaign._cache": "results of its own, and the code",
    "thermid.measure._readers.confined": "the system's word on the memory of the process",
    "thermid.interop.c99": "a text of the package",
    "thermid.model._deck.modelfile": "a deck may be changed in its place",
    "thermid.app.cli.qualify": "the delivery of this command",
    "thermid.qualify._deliver": "the delivery of this command, or one that is checked",
    "thermid.reporting._blocks.content": "templates of the package, and what the browser printed",
    "thermid.app.examples": "examples of the package; originals that were fetched, checked by their sums",
    "thermid.app.studio.server": "scripts of the package",
}


def called(node: ast.Call) -> str:
    """Name of what is called: of a function, or of a method of anything that is no name of a module's own writer."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def opens_to_write(node: ast.Call) -> bool:
    """Whether `open` is called with a mode that writes, or flags."""
    if called(node) != "open":
        return False
    texts = [a.value for a in [*node.args, *(k.value for k in node.keywords)] if isinstance(a, ast.Constant) and isinstance(a.value, str)]
    system = isinstance(node.func, ast.Attribute) and getattr(node.func.value, "id", "") == "os"
    return system or any(set(text) <= set("rwaxbt+") and set(text) & set("wax+") for text in texts)


def own_writers(module: Module) -> set[str]:
    """Methods of a kind of file by which the module writes."""
    return {node.func.attr for node in module.nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)} & OURS


def writes(module: Module) -> Iterator[str]:
    """Places that write a file past the writer."""
    ours = own_writers(module)
    for node in module.nodes:
        if not isinstance(node, ast.Call):
            continue
        name = called(node)
        if name == "to_netcdf" and module.room == "app":
            continue  # the method of a solution, which goes through the writer
        if name in WRITES and not (name in INSIDE_REPLACING and ours):
            yield f"{module.name}:{node.lineno} {name}"
        elif opens_to_write(node) and not ("replacing" in ours and ast.unparse(node).startswith("half.")):
            yield f"{module.name}:{node.lineno} {ast.unparse(node)}"


def reads(module: Module) -> Iterator[str]:
    """Places that read a file which then is not known as an input."""
    for node in module.nodes:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in READS:
            if getattr(node.func.value, "id", "") != "files":
                yield f"{module.name}:{node.lineno} {called(node)}"


def test_files_are_written_in_one_place(modules: dict[str, Module]) -> None:
    free = {name for name, _ in PLACES}
    assert free <= set(modules)
    assert [line for m in modules.values() if m.name not in free for line in writes(m)] == []


def test_what_is_read_is_known_as_an_input(modules: dict[str, Module]) -> None:
    assert set(NO_INPUT) <= set(modules)
    assert [line for m in modules.values() if m.name not in NO_INPUT for line in reads(m)] == []
    assert [name for name in NO_INPUT if name != "thermid.base.files" and not list(reads(modules[name]))] == []


@pytest.mark.parametrize(
    "text",
    [
        "path.write_text('x')",
        "Path(p).write_bytes(b'x')",
        "from thermid.base.files import FileKinds\nFileKinds.DECK.save_text(p, 'x')\npath.write_text('x')",
        "open(p, 'w')",
        "path.open('wb')",
        "path.open(mode='a')",
        "os.open(p, flags)",
        "figure.savefig(p)",
        "np.savez(p, a=a)",
        "data.to_netcdf(p)",
        "shutil.copyfile(a, b)",
        "tempfile.mkdtemp()",
    ],
)
def test_a_writer_of_its_own_is_seen(text: str) -> None:
    assert len(list(writes(Module("thermid.model.x", text)))) == 1


@pytest.mark.parametrize(
    "text",
    [
        "from thermid.base.files import FileKinds\nwith FileKinds.TABLE.replacing(p) as half:\n    np.savetxt(half, a)",
        "from thermid.base.files import FileKinds\nwith FileKinds.TABLE.replacing(p) as half, half.open('w') as file:\n    file.write('x')",
        "from thermid.base.files import FileKinds\nFileKinds.DECK.save_text(p, 'x')",
        "open(p)",
        "path.open('rb')",
        "webbrowser.open(address)",
    ],
)
def test_the_writer_is_let_pass(text: str) -> None:
    assert list(writes(Module("thermid.model.x", text))) == []


def test_a_reader_of_its_own_is_seen() -> None:
    for text in ("path.read_text()", "Path(p).read_bytes()", "from thermid.base.files import read_text\npath.read_text()"):
        assert len(list(reads(Module("thermid.model.x", text)))) == 1
    for text in ("from thermid.base.files import read_text\nread_text(p)", "from thermid import files\nfiles.read_bytes(p)"):
        assert list(reads(Module("thermid.model.x", text))) == []
