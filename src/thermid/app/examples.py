"""Shipped examples: where they lie, copies of them with their data, and published originals, fetched and checked by their sums."""

from __future__ import annotations

import csv
import gzip
import hashlib
import io
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from runpy import run_path
from typing import Final
from urllib.error import URLError
from urllib.parse import quote
from urllib.request import urlopen

import numpy as np

from thermid.base.errors import MissingDataError, OutputError, RecordError, look_up
from thermid.base.files import FileKinds, folder_replacing
from thermid.campaign.stages import CampaignSource
from thermid.campaign.start import head_copies

ADDRESS = "https://raw.githubusercontent.com/{repository}/{commit}/{path}"
PUBLIC = "THERMID_PUBLIC"
"""Environment variable: a folder with copies of published repositories."""
DOWNLOAD_TIMEOUT = 30.0
"""Time for one file. [s]"""


@dataclass(frozen=True)
class Original:
    """One file of a published data set.

    Parameters
    ----------
    path : str          Where it lies in its repository.
    to : str            The log that is made of it, in the example's folder of data.
    convert : callable  (bytes, name) -> text of the log.
    sha256 : str        Of the parsed samples of the log, as `samples_sum` makes it; at least its beginning.
    """

    path: str
    to: str
    convert: Callable[[bytes, str], str]
    sha256: str = ""


@dataclass(frozen=True)
class DataSet:
    """A published data set.

    Parameters
    ----------
    repository, commit : str    On GitHub.
    licence, author : str       What its licence file says.
    files : tuple of Original
    """

    repository: str
    commit: str
    licence: str
    author: str
    files: tuple[Original, ...]

    @property
    def words(self) -> str:
        """Source and licence in a line."""
        return f"data: {self.author}, https://github.com/{self.repository}, commit {self.commit[:7]}, {self.licence} licence"


def samples_sum(text: str) -> str:
    """Return the SHA-256 of the numbers of a log in comma-separated form: each column as float64, in order, whatever their digits."""
    rows = [row for row in csv.reader(io.StringIO(text)) if row][1:]
    return hashlib.sha256(np.array(rows, dtype=np.float64).T.tobytes()).hexdigest()


def copies() -> Path | None:
    """Return the folder with copies of published repositories that the environment names; None for the public addresses."""
    return Path(os.environ[PUBLIC]) if os.environ.get(PUBLIC) else None


def taken(source: DataSet, file: Original, folder: Path | None) -> bytes:
    """Return the bytes of an original, from a folder of copies or from its public address.

    Raises
    ------
    MissingDataError    When the folder has no copy, or the address cannot be reached.
    """
    if folder is not None:
        for place in (folder / source.repository / file.path, folder / source.repository.partition("/")[2] / file.path, folder / file.path):
            if place.is_file():
                return place.read_bytes()
        raise MissingDataError(
            f"no '{source.repository}/{file.path}' below '{folder}'. Get the repository (git clone https://github.com/"
            f"{source.repository}), or unset {PUBLIC} to take the files from their public address.",
            str(folder),
        )
    address = ADDRESS.format(repository=source.repository, commit=source.commit, path=quote(file.path))
    try:
        with urlopen(address, timeout=DOWNLOAD_TIMEOUT) as answer:
            return bytes(answer.read())
    except (URLError, TimeoutError, OSError) as error:
        raise MissingDataError(
            f"{address} cannot be reached ({getattr(error, 'reason', error)}). Offline, set THERMID_PUBLIC to a folder with "
            "copies of repositories, OWNER/REPOSITORY/path.",
            source.repository,
        ) from None


def converted(source: DataSet, file: Original, folder: Path | None) -> bytes:
    """Return the log that is made of an original, packed where its name states this.

    Raises
    ------
    RecordError     When its samples are not those that the example knows.
    """
    text = file.convert(taken(source, file, folder), file.path.rpartition("/")[2])
    if file.sha256 and not samples_sum(text).startswith(file.sha256):
        raise RecordError(
            f"the samples of '{file.path}' have the checksum {samples_sum(text)[:16]}, not {file.sha256[:16]}: this is not the file "
            "of commit "
            f"{source.commit[:7]}.",
            source.repository,
            code="record.another-log",
        )
    return gzip.compress(text.encode(), mtime=0) if file.to.endswith(".gz") else text.encode()


ROOT_FILE: Final = "thermid.toml"
_NOT_COPIED: Final = ("__pycache__", "results")
_PLACES: Final = (Path(__file__).parents[1] / "_examples", Path(__file__).parents[3] / "examples")
"""In a wheel, and in the source tree."""


@dataclass(frozen=True)
class ShippedExample:
    """One shipped example.

    Parameters
    ----------
    name : str          Its folder.
    shows : str         What it shows, in words.
    first : str         The command to begin with, in the copy.
    needs : tuple       Other examples whose files it uses, copied beside it.
    campaign : str      Its campaign, where it has one; it has the sums of the samples.
    makes : str         The script that makes its synthetic logs, where a copy needs them before its first command.
    """

    name: str
    shows: str
    first: str
    needs: tuple[str, ...] = ()
    campaign: str = ""
    makes: str = ""

    @property
    def data(self) -> DataSet | None:
        """Published measurements that it needs, `DATA` of its file originals.py; None where it brings or makes its own."""
        script = shipped() / self.name / "originals.py"
        return run_path(str(script))["DATA"] if script.is_file() else None


EXAMPLES: Final = {
    one.name: one
    for one in (
        ShippedExample("01_accelerometer", "one mass in a room: heating, steady state, time constant", "python run.py"),
        ShippedExample("02_stack", "parts joined to a stack", "python run.py"),
        ShippedExample("03_calibrate", "a fit to a synthetic log", "python 03_calibrate/run.py", ("01_accelerometer",)),
        ShippedExample("04_campaign", "parts fitted level by level", "python 04_campaign/run.py", ("02_stack",)),
        ShippedExample("05_vacuum", "from air to vacuum", "python 05_vacuum/run.py", ("01_accelerometer",)),
        ShippedExample("06_swap", "a part replaced", "python 06_swap/run.py", ("02_stack",)),
        ShippedExample("07_pad", "a cabinet on a launch pad, with weather", "python run.py"),
        ShippedExample(
            "sisnav",
            "an avionics unit from parts to the whole, synthetic logs; one verdict fails on purpose, exit code 1",
            "thermid report campaign.toml --to report.html",
            campaign="campaign.toml",
            makes="laboratory.py",
        ),
        ShippedExample("unknown_power", "a power course recovered from temperatures", "python run.py"),
        ShippedExample(
            "tclab",
            "two heaters on a board, real measurements: parts, the whole, then hold-out runs",
            "thermid report campaign.toml --to report.html",
            campaign="campaign.toml",
        ),
        ShippedExample("motor", "a motor that heats itself, two logs on two clocks, real measurements", "python run.py ."),
    )
}
"""Name -> example, in the order of the help."""


@dataclass(frozen=True)
class Copied:
    """A copy of an example.

    Parameters
    ----------
    example : ShippedExample
    folder : Path               Where it lies.
    logs : int                  Logs that were made of published originals.
    checked : int               Records whose samples have the sums that the example knows.
    """

    example: ShippedExample
    folder: Path
    logs: int
    checked: int

    def __str__(self) -> str:
        """Return what was copied, from where, and the next command."""
        lines = [f"example '{self.example.name}' in {self.folder}: {self.example.shows}"]
        if (data := self.example.data) is not None:
            lines.append(f"  {data.words}: LICENSE.data in the folder")
            lines.append(
                f"  {self.logs} logs converted from the originals; the samples of {self.checked} are identical to those of the example"
            )
        if self.example.makes:
            lines.append(f"  its logs are synthetic, made by {self.example.makes}")
        return "\n".join([*lines, f"next: cd {self.folder} && {self.example.first}"])


def example_named(name: str) -> ShippedExample:
    """Return an example.

    Raises
    ------
    NameNotFoundError   When there is none of that name.
    """
    return look_up(name, EXAMPLES, "no example '{}'; there are {known}.", "example")


LICENCE: Final = """The logs of this folder were made of the files of https://github.com/{0.repository}, commit {0.commit}.
{0.author}. {0.licence} licence; its text is the file LICENSE of that repository.
Converted to comma-separated text; nothing was filtered.
"""


def shipped() -> Path:
    """Return the folder of the examples.

    Raises
    ------
    MissingDataError    When this installation has none.
    """
    for place in _PLACES:
        if (place / ROOT_FILE).is_file():
            return place
    raise MissingDataError("this installation has no examples. Install a wheel, or run from the source tree.", "example")


def copy_example(
    name: str,
    to: Path | None = None,
    originals: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    logs: bool = True,
) -> Copied:
    """Copy an example with its data into a new folder, with the schemas by which an editor checks its files.

    Parameters
    ----------
    name : str          One of `EXAMPLES`.
    to : Path           A folder that is new or empty; its name by default.
    originals : Path    Folder with copies of published repositories, `OWNER/REPOSITORY/path`; the public address by default.
    progress : callable Called with how many logs are made, and how many there will be.
    logs : bool         Whether the synthetic logs of an example are made, by its own script.

    Raises
    ------
    OutputError         When something is in the folder already.
    MissingDataError    When an original cannot be had, or the script of the synthetic logs fails.
    RecordError         When its samples are not those that the example knows.
    """
    example, source = example_named(name), shipped()
    folder = to or Path(name)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(
            "the folder is not empty, and a copy would mix with its files. Give a new folder.", str(folder), code="output.over-another-file"
        )
    data = example.data
    with folder_replacing(folder) as half:
        FileKinds.COPY.save_bytes(half / ROOT_FILE, (source / ROOT_FILE).read_bytes())
        for source_name in (example.name, *example.needs):
            for file, path in _files(source / source_name):
                target = half / source_name / path if example.needs else half / path
                target.parent.mkdir(parents=True, exist_ok=True)
                FileKinds.COPY.save_bytes(target, file.read_bytes())
        if data is not None:
            for k, original in enumerate(data.files, 1):
                target = half / original.to
                target.parent.mkdir(parents=True, exist_ok=True)
                FileKinds.COPY.save_bytes(target, converted(data, original, originals))
                if progress is not None:
                    progress(k, len(data.files))
            FileKinds.COPY.save_bytes(half / "LICENSE.data", LICENCE.format(data).encode())
        if example.makes and logs:
            done = subprocess.run([sys.executable, "-B", example.makes, "."], cwd=half, capture_output=True, text=True, check=False)
            if done.returncode:
                last_line = (done.stderr.strip().splitlines() or ["without a word"])[-1]
                raise MissingDataError(
                    f"the synthetic logs of this example were not made: {last_line}. Run python {example.makes} in its source.",
                    example.makes,
                )
        head_copies(half, [file for file in half.rglob("*") if file.is_file()])
        checked = _checked(example, half)
    return Copied(example, folder, len(data.files) if data else 0, checked)


def _files(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield every file of an example with its path there."""
    for file in sorted(folder.rglob("*")):
        inside = file.relative_to(folder)
        if file.is_file() and not set(inside.parts) & set(_NOT_COPIED):
            yield file, inside


def _checked(example: ShippedExample, folder: Path) -> int:
    """Return how many records have the sums that the campaign of an example knows.

    Raises
    ------
    RecordError     When a record has another.
    """
    if not example.campaign:
        return sum(bool(f.sha256) for f in data.files) if (data := example.data) else 0
    source = CampaignSource.read(folder / example.campaign, folder)
    for name in source.content.checksums:
        source.record(name)
    return len(source.content.checksums)
