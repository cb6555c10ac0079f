"""The one place where files are written: whole or not at all, and never over what thermid did not write or what a command reads.

A file that thermid writes carries a seal: a comment with the kind of the file and a checksum of what stands before it (tables carry
theirs in the header, netCDF files in an attribute). A file may be replaced by one of its own kind while its seal is unbroken.
Decision 109 says why.

TOML and JSON files of every kind are read here too: where they lie, what they hold, and on which line each key stands.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import platform
import re
import select
import shutil
import stat
import struct
import time
import tomllib
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from thermid.base.errors import DeckError, OutputError, ThermidError, announced, cap, nearest, raising, refuse_unknown

NETCDF_SOURCE: Final = "thermid"
"""Attribute `source` of a netCDF file."""
_DAY: Final = 86400.0
SILENCE: Final = 10.0
"""Time after which a pipe out of which nothing comes is given up. [s]"""
_STARTED: Final = time.time()
_HOST: Final = hashlib.sha256(platform.node().encode()).hexdigest()[:6]
_HALF: Final = re.compile(r"^\.(?P<host>[0-9a-f]{6})-(?P<pid>\d+)-[0-9a-f]{8}\.half\.")


@dataclass(frozen=True)
class FileKind:
    """A kind of file, and how thermid knows one that it wrote.

    Parameters
    ----------
    name : str          In words, for messages and seals.
    own : callable      Whether a file is one that thermid wrote; None for the seal.
    endings : tuple     How the names of such files end; empty where any will do.
    named : bool        Whether a name must have one of these endings, because it chooses the format or other programs go by it.
    """

    name: str
    own: Callable[[Path], bool] | None = None
    endings: tuple[str, ...] = ()
    named: bool = False

    def titled(self, title: str) -> FileKind:
        """Return the kind of one thing: a file of it is not replaced by one of another."""
        return replace(self, name=f"{self.name} {re.sub(r'[^0-9A-Za-z]+', '_', title)[:60]}")

    def wrote(self, path: Path) -> bool:
        """Whether thermid wrote a file as this kind, and nobody changed it since."""
        return sealed(path, self.name) if self.own is None else self.own(path)

    def save_text(self, path: str | os.PathLike[str], text: str, comment: str = "#") -> Path:
        """Write a text as UTF-8 with its seal and return its path; the rest as `save_bytes`."""
        return self.save_bytes(path, text.encode(), comment)

    def save_bytes(self, path: str | os.PathLike[str], data: bytes, comment: str = "#") -> Path:
        """Write a file with its seal and return its path.

        Parameters
        ----------
        comment : str   How a line begins that is a comment; without effect in JSON, HTML, SVG, PNG and PDF.

        Raises
        ------
        OutputError, OSError   As `replacing`.
        """
        whole = data if self.own is not None else seal(data, self.name, comment.encode())
        with self.replacing(path) as half, half.open("wb") as file:
            file.write(whole)
        return Path(path)

    @contextmanager
    def replacing(self, path: str | os.PathLike[str]) -> Iterator[Path]:
        """Yield where to write; what is there at the end takes the place of `path` in one step.

        After any error the old file is still there. The file of the kind must carry its mark; `save_text` and `save_bytes` put it in.

        Raises
        ------
        OutputError   As `may_write`.
        OSError       When nothing can be written there; it names `path`.
        """
        target = self.may_write(path)
        if target.exists() and not target.is_file():  # a pipe or a device
            yield target
            return
        sweep(target.parent)
        half = target.with_name(_half_name(target.name))
        try:
            os.close(os.open(half, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
            yield half
            _settle(half, target)
        except OSError as error:
            if error.filename not in (None, str(half)):
                raise
            raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error
        finally:
            half.unlink(missing_ok=True)

    def may_write(self, path: str | os.PathLike[str]) -> Path:
        """Return the file that a path leads to, links followed, when it may be written; ask before long work.

        Raises
        ------
        OutputError   When it is an input of this command or a file that thermid did not write as this kind, or has an ending of
                      another format.
        OSError       When it is a folder or read-only, or its folder is missing; it names `path`.
        """
        target = Path(os.path.realpath(self.check_ending(path)))
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not target.parent.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        if not target.is_file():  # new, or a pipe or a device
            return target
        if not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        running = _COMMAND.get() or _Command()
        if running.force:
            return target
        about = target.stat()
        if (about.st_dev, about.st_ino) in running.inputs:
            raise OutputError(
                f"this file is an input of the command; writing the {self.name} would overwrite it. Give another name.",
                str(path),
                code="output.over-input",
            )
        if not self.wrote(target):
            raise OutputError(
                f"this file exists already. It was not written by thermid as {self.name}, or was changed since. Give another name or move "
                "it away; on the command line --force replaces it.",
                str(path),
                code="output.over-another-file",
            )
        return target

    def check_ending(self, path: str | os.PathLike[str]) -> Path:
        """Return a path whose ending does not promise another format than the one that is written; the one place that decides so.

        Parameters
        ----------
        path : path   File to write.

        Raises
        ------
        OutputError   When the ending is that of another format, as `.pdf` for a table, or none at all where the kind needs one.
        """
        target = Path(path)
        ending = target.suffix.lower()
        if not self.endings or ending in self.endings or (ending not in FORMATS and not self.named):
            return target
        endings = " or ".join(self.endings)
        promise = f"the ending '{ending}' promises {FORMATS[ending]}, but" if ending in FORMATS else "the name does not say a format, and"
        raise OutputError(
            f"{promise} the {self.name} is written as {endings}. Give a name that ends so.", str(path), code="output.wrong-ending"
        )


def first_quoted(line: bytes, of: bytes) -> bool:
    """Whether a header has its first name in quotes and no other, as no other program writes it: `"time_s",case [degC]`."""
    cells = re.fullmatch(rb'"([^"]*)",[^"]*', line.strip())
    return cells is not None and re.fullmatch(of, cells[1]) is not None


def _header(path: Path, of: bytes) -> bool:
    """Whether the first line of a table begins with a name that a pattern fits."""
    with path.open("rb") as file:
        return first_quoted(file.readline(1 << 20), of)


def _from_netcdf(path: Path) -> bool:
    """Whether a netCDF file names thermid as its source."""
    try:
        import h5netcdf

        with h5netcdf.File(path, "r") as file:
            return str(file.attrs.get("source", "")) == NETCDF_SOURCE
    except (ImportError, OSError, ValueError, KeyError):
        return False


FORMATS: Final = {
    **dict.fromkeys((".html", ".htm"), "a page"),
    ".pdf": "a PDF",
    ".svg": "an SVG picture",
    **{f".{word}": f"a picture in {word.upper()}" for word in ("png", "jpg", "jpeg", "gif", "bmp", "tif", "tiff", "webp", "eps")},
    ".csv": "a table in text",
    **dict.fromkeys((".xls", ".xlsx", ".ods"), "a workbook"),
    **dict.fromkeys((".doc", ".docx", ".odt"), "a word processor's document"),
    **dict.fromkeys((".nc", ".h5", ".hdf5"), "a netCDF or HDF5 file"),
    **dict.fromkeys((".gz", ".zip", ".bz2", ".xz"), "a compressed file"),
    ".toml": "a TOML file",
    ".json": "a JSON file",
}
"""Ending of a name -> what every program takes such a file for; other endings promise nothing."""
_TEXTS: Final = (".csv", ".toml", ".json")


class FileKinds:
    """The kinds of files that thermid writes."""

    DECK: Final = FileKind("deck", endings=(".toml",))
    VALUES: Final = FileKind("values file", endings=(".toml",))
    SCENARIO: Final = FileKind("scenario", endings=(".toml",))
    PROFILE: Final = FileKind("profile", endings=(".toml",))
    STUDY: Final = FileKind("study", endings=(".toml",))
    CREDIBILITY: Final = FileKind("credibility record", endings=(".json",))
    PAGE: Final = FileKind("page", endings=(".html", ".htm"))
    PAPER: Final = FileKind("printed page", endings=(".pdf",), named=True)
    PICTURE: Final = FileKind("picture", endings=(".png", ".svg", ".pdf"), named=True)
    DRAWING: Final = FileKind("picture", endings=(".svg",), named=True)
    """A picture that is drawn as SVG alone."""
    EXPORT: Final = FileKind("export", endings=_TEXTS)
    EQUATIONS: Final = FileKind("equations file", endings=_TEXTS)
    DELIVERY: Final = FileKind("delivery", endings=(".json",))
    TABLE: Final = FileKind("table of temperatures", lambda path: _header(path, rb"time_s"), (".csv",))
    LOG: Final = FileKind("log", lambda path: _header(path, rb".*\[s\]"), (".csv",))
    NETCDF: Final = FileKind("netCDF file", _from_netcdf, (".nc", ".h5", ".hdf5"))
    SHEET: Final = FileKind("table of a report", lambda path: path.parent.name.endswith(".tables"), (".csv",))
    """In the folder of a report's tables, which nobody else names so."""
    COPY: Final = FileKind("copy", lambda path: False)
    """Bytes as they are; what is there is never replaced."""
    RESULTS_FILE: Final = FileKind("file of results", lambda path: True)
    """What only thermid writes, by names of its own, and what carries on the content of the file that it replaces."""


@dataclass
class _Command:
    """What one command has read, by device and inode, whether it may replace any file, and run programs of others."""

    force: bool = False
    trust: bool = False
    inputs: set[tuple[int, int]] = field(default_factory=set)


_COMMAND: Final[ContextVar[_Command | None]] = ContextVar("thermid command", default=None)


@contextmanager
def command(force: bool = False, trust: bool = False) -> Iterator[None]:
    """Remember what is read from here on, so that nothing of it is written over; with `force`, any file may be replaced.

    With `trust`, programs may run that others wrote and an input names. Both hold in commands inside of this one.
    """
    outer = _COMMAND.get() or _Command()
    token = _COMMAND.set(_Command(force or outer.force, trust or outer.trust))
    try:
        yield
    finally:
        _COMMAND.reset(token)


def trusting() -> bool:
    """Return whether this command may run programs that others wrote."""
    running = _COMMAND.get()
    return running is not None and running.trust


def state_folder() -> Path:
    """Return the folder of what thermid remembers of this user."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "thermid"


def was_read(path: str | os.PathLike[str]) -> None:
    """Remember that a file is an input of this command."""
    running = _COMMAND.get()
    if running is not None:
        about = os.stat(path)
        running.inputs.add((about.st_dev, about.st_ino))


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of an input; from a pipe or a device only while something comes, and up to the cap `unpacked`.

    Raises
    ------
    OSError        When it cannot be read; it names `path`.
    ThermidError   When a pipe stays silent, or more comes than the cap.
    """
    mode = os.stat(path).st_mode
    data = Path(path).read_bytes() if stat.S_ISREG(mode) or stat.S_ISDIR(mode) else _piped(path)
    was_read(path)
    return data


def _piped(path: str | os.PathLike[str]) -> bytes:
    """Return what comes out of a pipe or a device."""
    pipe, data, most = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), bytearray(), int(cap("unpacked"))
    try:
        while len(data) <= most:
            if not select.select([pipe], [], [], SILENCE)[0]:
                raise ThermidError(
                    f"this is a pipe, and nothing came out of it within {SILENCE:g} s. Give the path of a file.",
                    str(path),
                    code="file.silent-pipe",
                )
            part = os.read(pipe, 1 << 20)
            if not part:
                return bytes(data)
            data += part
    finally:
        os.close(pipe)
    raise ThermidError(
        f"more than {most / 1e6:.0f} MB came out of this pipe or device.{raising('unpacked')}", str(path), code="cap.exceeded"
    )


def read_text(path: str | os.PathLike[str], encoding: str = "utf-8") -> str:
    """Return the text of an input, line ends as Python has them."""
    return read_bytes(path).decode(encoding).replace("\r\n", "\n").replace("\r", "\n")


def toml_key(name: str) -> str:
    """Return a key as TOML writes it, in quotes where it must be."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)


def toml_value(value: Any) -> str:
    """Return a value on one line, with every digit. Its library takes time with the square of a table's length: 70 s for 12,000 rows."""
    if type(value) is float:  # most of what is written
        return repr(value)
    value = value.tolist() if hasattr(value, "tolist") else value  # of numpy
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")  # a text of JSON is one of TOML, but for DEL
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_key(str(key))} = {toml_value(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return repr(value).lower() if isinstance(value, bool) else repr(value)


def parse_toml(text: str) -> dict[str, Any]:
    """Return the content of a TOML text.

    Raises
    ------
    tomllib.TOMLDecodeError   Also when it is nested so deeply, or has a number of so many digits, that nobody can have meant it.
    """
    import tomllib

    most = int(cap("key"))
    if re.search(rf"""(?<![\w"'.-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){{{most}}}""", text):
        raise tomllib.TOMLDecodeError(f"a key has {most} parts or more.{raising('key').rstrip('.')}")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise tomllib.TOMLDecodeError("tables or lists are nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:
        raise tomllib.TOMLDecodeError(f"a number has too many digits ({error})") from None


def _settle(half: Path, target: Path) -> None:
    """Force what was written onto the disk, and give it the name and the permissions of the file that it replaces."""
    file = os.open(half, os.O_RDWR)
    try:
        os.fsync(file)
    finally:
        os.close(file)
    if target.exists():
        half.chmod(stat.S_IMODE(target.stat().st_mode))
    os.replace(half, target)


@contextmanager
def folder_replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a folder to fill, which takes the name `path` at the end; after an error nothing is there. `path` must be new or empty."""
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    sweep(target.parent)
    half = target.with_name(_half_name(target.name))
    half.mkdir()
    try:
        yield half
        os.replace(half, target)
    except OSError as error:
        if error.filename is not None and not str(error.filename).startswith(str(half)):
            raise
        raise OSError(error.errno or errno.EIO, error.strerror or str(error), str(path)) from error
    finally:
        shutil.rmtree(half, ignore_errors=True)


@contextmanager
def scratch() -> Iterator[Path]:
    """Yield a folder for work in between, which is removed at the end."""
    import tempfile

    place = Path(tempfile.gettempdir())
    sweep(place)
    folder = place / _half_name("thermid")
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _half_name(name: str) -> str:
    """Return a hidden name beside a file, with its ending, which may ask for compression; it says whose it is."""
    return f".{_HOST}-{os.getpid()}-{os.urandom(4).hex()}.half.{name[-100:]}"


def sweep(folder: Path) -> None:
    """Remove what processes that were killed while they wrote have left in a folder."""
    for entry in os.scandir(folder):
        match = _HALF.match(entry.name)
        if match is not None and _abandoned(entry, match):
            try:
                shutil.rmtree(entry.path) if entry.is_dir(follow_symlinks=False) else os.unlink(entry.path)
            except OSError:  # of another user, or gone already
                continue


def _abandoned(entry: os.DirEntry[str], name: re.Match[str]) -> bool:
    """Whether the process that began a file is gone; of another machine nobody knows, so it must be a day old."""
    try:
        changed = entry.stat(follow_symlinks=False).st_mtime
    except OSError:
        return False
    if name["host"] != _HOST or os.name != "posix":
        return time.time() - changed > _DAY
    pid = int(name["pid"])
    if pid == os.getpid():  # left by an earlier process of the same number, as containers have them
        return changed < _STARTED - 1.0
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return time.time() - changed > _DAY


_END: Final = rb'(?:\s*|\s*-->\s*|"\s*\}\s*|.{4}\0\0\0\0IEND\xaeB`\x82)\Z'
"""What may stand after a seal: the end of a line, of a comment, of a JSON object, of a PNG."""


def seal(data: bytes, name: str, comment: bytes = b"#") -> bytes:
    """Return a file with its seal: a comment of its language that names the `name` of its kind and has a checksum of all before it.

    It stands at the end, of PNG in a text chunk before the last one, of JSON as the last key "seal"; `comment` begins a line of any other
    text.
    """
    if data.startswith(b"\x89PNG"):
        end = data[-12:]
        front = data[:-12] + struct.pack(">I", len(b"Software\0" + _words(name, b""))) + b"tEXtSoftware\0"
        words = _words(name, front)
        return front + words + struct.pack(">I", zlib.crc32(b"tEXtSoftware\0" + words)) + end
    if data.startswith(b"%PDF-"):
        front, back = data.rstrip(b"\n") + b"\n% ", b"\n"
    elif data.lstrip()[:1] == b"<":
        front, back = data.rstrip() + b"\n<!-- ", b" -->\n"
    elif data.lstrip()[:1] == b"{":
        front, back = data.rstrip()[:-1].rstrip() + b',\n "seal": "', b'"\n}\n'
    else:
        front, back = data + (b"" if data.endswith(b"\n") else b"\n") + comment + b" ", b"\n"
    return front + _words(name, front) + back


_SEAL = "written by thermid: "
"""What a seal begins with."""


def _words(name: str, before: bytes) -> bytes:
    """Return the words of a seal: who wrote what, and the checksum of what stands before them, whatever the line ends."""
    digest = hashlib.sha256(before.replace(b"\r\n", b"\n")).hexdigest()[:16]
    return f"{_SEAL}{name}, sha256 {digest}".encode()


def sealed(path: Path, name: str) -> bool:
    """Whether a file carries the seal of a kind, and is what it was when it got it."""
    data = path.read_bytes()
    at = data.rfind(_SEAL.encode())
    words = _words(name, data[: max(at, 0)])
    return at >= 0 and re.match(re.escape(words) + _END, data[at:], re.DOTALL) is not None


def unsealed(text: str) -> str:
    """Return the text of a TOML file without its seal."""
    return re.sub(rf"^# {_SEAL}[\w ]+, sha256 [0-9a-f]{{16}}\s*\Z", "", text, flags=re.MULTILINE)


MARKER = "thermid.toml"
_HEADER = re.compile(r"^\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+))*)\s*=""")


def _plain(raw: str) -> str:
    """Return a key path without quotation marks and blanks around its dots."""
    return ".".join(part.strip().strip("\"'") for part in re.findall(r"\"[^\"]*\"|'[^']*'|[A-Za-z0-9_-]+", raw))


def line_numbers(text: str) -> dict[str, int]:
    """Return key path -> line (from 1) of every header and key that stands on a line of its own.

    Entries of arrays of tables are numbered: ``stages.0.free``.
    """
    out: dict[str, int] = {}
    prefix, counts = "", {}  # type: tuple[str, dict[str, int]]
    for number, line in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(line)
        if header:
            prefix = _plain(header[1])
            if line.lstrip().startswith("[["):
                counts[prefix] = counts.get(prefix, -1) + 1
                prefix = f"{prefix}.{counts[prefix]}"
            out.setdefault(prefix, number)
            continue
        key = _KEY.match(line)
        if key:
            path = _plain(key[1])
            out.setdefault(f"{prefix}.{path}" if prefix else path, number)
    return out


@dataclass(frozen=True)
class Places:
    """File, line and key path of each key, for messages.

    Parameters
    ----------
    file : str      Name of the file, or what stands for it.
    lines : dict    Key path -> line (from 1), or the place itself where another file holds the key.
    """

    file: str
    lines: Mapping[str, int | str] = field(default_factory=dict)

    def __call__(self, key: str = "") -> str:
        """Return the place of a key: with the line of the nearest key above where its own is not known."""
        steps = key.split(".")
        line = next((self.lines[k] for n in range(len(steps), 0, -1) if (k := ".".join(steps[:n])) in self.lines), None)
        place = line if isinstance(line, str) else f"{self.file}:{line}" if line else self.file
        return f"{place}, {key}" if key else place


def read_json(path: Path, kind: str) -> Any:
    """Return the content of a JSON file as its grammar has it; such files are carried on, so that they are no inputs of a command.

    Parameters
    ----------
    path : Path         The file.
    kind : str          As in `by_grammar`.

    Raises
    ------
    ThermidError    When it is not valid JSON, or does not follow the grammar.
    OSError         When it cannot be opened.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        grammar, text = grammar_of(kind), f"this is not valid JSON: {error}."
        raise grammar.fault(f"{grammar.lead}\n  {path}: {text}" if grammar.lead else text, str(path), code="file.not-valid") from None
    return by_grammar(kind, content, Places(str(path)))


def kind_of_text(data: bytes) -> str:
    """Return what a text is called that is a TOML or JSON file of a known kind; nothing where it is none."""
    for read in (tomllib.loads, json.loads):
        with contextlib.suppress(ValueError, RecursionError):
            content = read(data.decode("utf-8"))
            return words_of_kind(content) if isinstance(content, dict) else ""
    return ""


def project_root(start: Path) -> Path:
    """Return the nearest folder upward that holds ``thermid.toml``, or the start folder itself."""
    start = start.resolve()
    return next((folder for folder in (start, *start.parents) if (folder / MARKER).is_file()), start)


def resolve_inside(folder: Path, name: str, where: str, roots: tuple[Path, ...] = ()) -> Path:
    """Return the path of a file named in a deck; it must lie in the project or in one of `roots`.

    Raises
    ------
    DeckError   When it leaves them, symbolic links resolved.
    """
    root = project_root(folder)
    if "\0" in name:
        raise DeckError(f"{name!r} is not a file name.", where, code="file.not-found")
    path = (folder / name).resolve()
    if not any(path.is_relative_to(r) for r in (root, *(r.resolve() for r in roots))):
        raise DeckError(
            f"'{name}' lies outside the project ({MARKER} marks its root). Copy the file into the project, "
            f"or put an empty {MARKER} into the folder that holds both: it is then the root.",
            where,
            code="file.outside-project",
        )
    return path


def read_toml(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the content of a TOML file and the line of each key.

    Raises
    ------
    DeckError   When the file is missing, too large, not text, or no TOML.
    """
    if not path.is_file():
        if path.is_dir():
            raise DeckError(f"there is no file '{path}': it is a folder.", code="file.not-found")
        if path.exists():
            raise DeckError("this is a pipe or a device. Give the path of a file.", path.name, code="file.not-a-file")
        if not path.parent.is_dir():
            raise DeckError(f"there is no file '{path.name}', and no folder '{path.parent}'.", code="file.not-found")
        near = nearest(path.stem, {p.stem for p in path.parent.glob(f"*{path.suffix}")})
        near = near.replace("'?", f"{path.suffix}'?")
        raise DeckError(
            f"there is no file '{path.name}' in {f'{path.parent.name}/' if path.parent.name else 'this folder'}.{near}",
            code="file.not-found",
        )
    if path.stat().st_size > cap("text"):
        raise DeckError(
            f"the file has {path.stat().st_size / 1e6:.1f} MB; a deck is a text file of a few kilobytes. "
            f"Move tables of data into a log.{raising('text')}",
            path.name,
            code="cap.exceeded",
        )
    try:
        text = read_text(path, "utf-8-sig")
        return parse_toml(text), line_numbers(text)
    except UnicodeDecodeError:
        raise DeckError("the file is not UTF-8 text.", path.name, code="file.not-text") from None
    except tomllib.TOMLDecodeError as error:
        raise DeckError(
            f"this is not valid TOML: {error}. Put texts, and numbers with units, in quotes; begin comments with #.",
            path.name,
            code="file.not-valid",
        ) from None


def file_kinds() -> tuple[str, ...]:
    """Return the kinds of file that have a grammar."""
    return tuple(announced("thermid.files"))


def grammar_of(kind: str) -> Any:
    """Return the grammar of a kind of file, or of a table by its module and class; what reads grammars is loaded now and not before.

    A room names its own grammars by module and class, which needs no search of the installed packages.

    Raises
    ------
    ThermidError   When nothing announces that kind.
    """
    if "." not in kind:
        refuse_unknown([kind], file_kinds(), "", "there is no kind of file '{}'.{near} There are {known}.", ThermidError)
        kind = announced("thermid.files")[kind].replace(":", ".")
    module, _, name = kind.rpartition(".")
    return getattr(import_module(module), name)


def by_grammar(kind: str, content: Any, where: Callable[[str], str]) -> Any:
    """Return the content of a file as its grammar has it.

    Parameters
    ----------
    kind : str          As in `grammar_of`.
    content : dict      The file as read.
    where : callable    Key path -> its place, such as `files.Places`.

    Raises
    ------
    ThermidError    When it is a file of another kind, or does not follow the grammar: every fault with its place.
    """
    try:
        return grammar_of(kind).from_file(content, where)
    except ThermidError:
        refuse_another_kind(kind, content, where)
        raise


_WORDS: Final = {
    "plan": "a qualification plan",
    "hold": "a hold question",
    "sensors": "a sensor map",
    "values": "a file of values",
    "limits": "a file of limits",
    "looks": "a file of looks",
}
"""Kind -> what it is called, where that is not its name."""


_SIGNS: Final = (
    ("credibility record", {"synthetic", "values"}),
    ("campaign", {"records"}),
    ("campaign", {"stages"}),
    ("deck", {"nodes"}),
    ("deck", {"submodels"}),
    ("plan", {"tests", "limits"}),
    ("scenario", {"duration"}),
    ("scenario", {"boundaries"}),
)
"""Keys by which a kind is known that its grammar would refuse."""


_ADVICE: Final = {
    ("plan", "deck"): " Run `thermid plan` on it.",
    ("scenario", "deck"): " Give the deck, and this file with --scenario.",
    ("campaign", "deck"): " Give a deck named under 'model' of its stages.",
    ("deck", "campaign"): " A campaign has records and stages, and names the deck of each stage under 'model'. "
    "`thermid predict DECK --values FILE --scenario FILE` predicts with a deck alone.",
    ("deck", "scenario"): " A scenario has boundaries, loads, start and duration.",
    ("deck", "plan"): " A plan names its deck under [model], beside objectives, limits and tests.",
    ("deck", "hold"): " A hold question names its deck under 'model'.",
}
"""Kind of a file, kind that is needed -> what to do."""


def refuse_another_kind(kind: str, content: Any, where: Callable[[str], str]) -> None:
    """Refuse a file whose keys are those of another kind, in one sentence; one that misses a kind by a key or two is left to its grammar.

    Parameters
    ----------
    kind, content, where    As in `by_grammar`.

    Raises
    ------
    ThermidError    Says what it is and what it is not.
    """
    if not isinstance(content, Mapping) or _has_keys_of(grammar_of(kind), content):
        return
    kinds = announced("thermid.files")
    needed = next((name for name, at in kinds.items() if kind in (name, at.replace(":", "."))), "")
    of = _kind_of(content, needed, len({*content} & _fields(grammar_of(kind)))) if needed else ""
    if of not in ("", needed) and (of in content or not {*content} <= _fields(grammar_of(kind))):
        text = f"this is {_name_of_kind(of)}, not {_name_of_kind(needed)}.{_ADVICE.get((of, needed), '')}"
        raise grammar_of(kind).fault(text, where(""), code="file.another-kind") from None


def words_of_kind(content: Mapping[str, Any]) -> str:
    """Return what a file is called by its keys, such as 'a deck'; nothing where they are those of no kind."""
    return _name_of_kind(_kind_of(content, "", 0)) if content else ""


def _name_of_kind(kind: str) -> str:
    """Return what a kind of file is called, with its article; empty for none."""
    return kind and _WORDS.get(kind, f"a {kind}")


def _fields(grammar: Any) -> set[str]:
    """Return the keys that a grammar has; none where its keys are names."""
    fields = {f.alias or name for name, f in grammar.model_fields.items()}
    return fields if grammar.model_config.get("extra") == "forbid" else set()


def _has_keys_of(grammar: Any, content: Mapping[str, Any]) -> bool:
    """Whether a file has no key that a grammar does not know, and all that it needs."""
    needs = {f.alias or name for name, f in grammar.model_fields.items() if f.is_required()}
    return bool(fields := _fields(grammar)) and needs <= {*content} <= fields


def _kind_of(content: Mapping[str, Any], needed: str, common: int) -> str:
    """Return the kind of a file by its keys; `common` of them are those of the kind that is needed."""
    grammars: dict[str, Any] = {}
    for name in file_kinds():
        try:
            grammars[name] = grammar_of(name)
        except ModuleNotFoundError:
            continue  # of a room that is not installed
    for name, grammar in grammars.items():
        if _has_keys_of(grammar, content) or (name in content and {*content} <= _fields(grammar)):
            return name
    if 2 * common > len(content):
        return needed
    for name, keys in _SIGNS:
        if keys <= {*content}:
            return name
    for name, grammar in grammars.items():  # a file whose keys are names is known by what stands under them
        if grammar.model_config.get("extra") is None and content:
            try:
                grammar.from_file(content, str)
            except ThermidError:
                continue
            return name
    return ""


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, for editors."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"thermid {kind}"}
    return head | {k: v for k, v in grammar_of(kind).model_json_schema(by_alias=True).items() if k != "title"}
