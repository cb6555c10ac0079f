"""A log that grows, read in pieces, and a record of it whose size does not grow with it.

Readings of the last twenty minutes stay as they are. Readings of the last 80 minutes are averaged over at most two seconds; older ones over
stretches of 1/250 of the time since the beginning, or since a power or command last changed. Rows then grow with the logarithm of the time
only. Where powers change so often that this leaves more than `MAX_ROWS` rows, powers are averaged with the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from thermid.base.errors import MissingDataError, NameNotFoundError, RecordError
from thermid.base.files import FileKinds, scratch
from thermid.base.units import Array, Bools
from thermid.measure.readers import UNFINISHED, is_bench_log
from thermid.measure.records import Channel, Record, usual_step
from thermid.model.tree import TableSignal
from thermid.simulation.runs import Scenario

Places = NDArray[np.intp]

RAW_TIME: Final = 1200.0
"""What stays as it was read, for what readings alone show. [s]"""
MIN_READINGS: Final = 240
"""Readings that stay at least, however far apart."""
RECENT_TIME: Final = 4800.0
"""What is averaged over `MAX_BLOCK` at most: twice the window of the filter. [s]"""
MEAN_WINDOW: Final = 60.0
"""What is averaged where a longer stretch is not complete. [s]"""
MAX_BLOCK: Final = 2.0
"""Readings closer than this are averaged for fit and filter; a node that is ten times as slow moves by 0.04 % less than its mean. [s]"""
AVERAGES_PER_LOG: Final = 1000.0
"""Part of a short log over which its readings are averaged at most."""
ROWS_PER_E_FOLD: Final = 250.0
"""Rows in which the time since the beginning grows by e."""
MAX_ROWS: Final = 6000
"""Rows of averages at most, beyond which powers are averaged too."""
MIN_SPIKE_CHANGES: Final = 8
"""Usual changes, or noises, by which a reading lies off those around it to count as a spike."""
MAX_SPIKE_READINGS: Final = 3
"""Readings in a row that may be a spike."""
MAX_SPIKE_SHARE: Final = 0.05
"""Part of the readings up to which those far from their neighbours are spikes."""
MIN_GAP: Final = 300.0
"""Without readings from which on the state of the unit is open, and ten times their interval. [s]"""
TIME_BETWEEN_MOMENTS: Final = 60.0
"""Between the moments at which a log is judged. [s]"""
FIRST_READINGS: Final = 10
"""Readings from which a log is judged."""
MIN_NOISE: Final = 0.05
"""Noise of a reading at least, where nobody stated it. [K]"""
MIN_TIME_BETWEEN_PLATEAUS: Final = 600.0
"""Without a switch of a power before one that begins another plateau; powers that cycle faster do not. [s]"""
CHUNK_BYTES: Final = 1 << 18
"""Bytes that are read at once."""
MAX_UNREAD_LINES: Final = 20
"""Lines that a log is read from, or its refusal is said."""
MAX_FAILED_LOOKS: Final = 3
"""Looks at a log that cannot be read any more before that is an error; the last line may be half written."""
MAX_HEAD_LINES: Final = 200
"""Lines at the beginning within which header and first samples stand."""


def switches(record: Record) -> Bools:
    """Return the samples at which any logged power or command was switched (samples,)."""
    out = np.zeros(record.times.size, dtype=bool)
    for c in record.channels.values():
        if c.held:
            out |= c.switched
    return out


def plateau_starts(record: Record, plan: Scenario | None) -> Array:
    """Return when known powers were switched, at least `MIN_TIME_BETWEEN_PLATEAUS` after the switch before. [s]

    They are those of the log, and those of a plan on the log's clock.
    """
    signals = [] if plan is None else [s for _, s in plan.signals() if isinstance(s, TableSignal) and s.held]
    planned = [record.times[0] + s.corners() for s in signals]
    times = np.unique(np.concatenate([record.times[switches(record)], *planned]))
    times = times[(times > record.times[0]) & (times < record.times[-1])]  # what changes at the last reading has not acted yet
    return np.asarray(times[np.diff(times, prepend=record.times[0]) >= MIN_TIME_BETWEEN_PLATEAUS])


def with_block_means(record: Record, raw: float = RAW_TIME, block: float = 0.0) -> Record:
    """Return a record with old readings averaged over blocks; the record itself where none are.

    Readings of the last `raw` seconds stay. Up to `RECENT_TIME` ago they are averaged over `MAX_BLOCK` at most, before that over 1/250 of
    the
    time since a power last changed, so that rows grow with the logarithm of the duration.

    Parameters
    ----------
    record : Record
    raw : float         How far back readings stay as they are [s]; at least `MIN_READINGS` of them do, unless it is zero.
    block : float       Least length of the blocks of recent readings. [s]
    """
    since = record.times - record.times[0]
    step = _raw_step(record)
    switched = switches(record)
    last = np.maximum.accumulate(np.where(switched, np.arange(since.size), 0))
    alone = switched | np.concatenate([[True], switched[:-1]])
    alone[: min(2, since.size)] = True  # a record begins where it began
    begins = _block_starts(since, since - since[last], alone, step, raw, block)
    if begins.size > MAX_ROWS + max(raw / max(step, 1e-9), MIN_READINGS if raw else 0.0):
        begins = _block_starts(since, since, np.arange(since.size) < 2, step, raw, block)
    if begins.size == since.size:
        return record
    count = np.diff(begins, append=since.size)
    channels = {c.name: _averaged(_with_step(c), begins, count) for c in record.channels.values()}
    return replace(record, times=np.add.reduceat(record.times, begins) / count, channels=channels)


def _raw_step(record: Record) -> float:
    """Return the median interval of the latest readings. [s]"""
    return usual_step(record.times[-MIN_READINGS:])


def _block_starts(since: Array, changed: Array, alone: Bools, step: float, raw: float, block: float) -> Places:
    """Return the indices of samples (blocks,) at which a block of averaged readings begins; a reading that stays alone is a block.

    Parameters
    ----------
    since, changed : array (samples,)   Time since the beginning, and since a power last changed. [s]
    alone : array (samples,)            Whether a sample must not be averaged with others.
    step : float                        Interval of the readings. [s]
    raw, block : float                  As of `with_block_means`. [s]
    """
    age, every = since[-1] - since, np.arange(since.size)
    wide = np.floor(ROWS_PER_E_FOLD * np.log1p(changed / (ROWS_PER_E_FOLD * max(step, MAX_BLOCK))))
    middle, short = (  # the number of the block that each sample lies in; its own where readings come no faster than blocks
        np.floor(since / size + 1e-9) if step < size else np.arange(since.size, dtype=float)
        for size in (MEAN_WINDOW, max(block, _block_length(float(since[-1]))))
    )
    out, done = [], 0
    for place, far in ((wide, RECENT_TIME), (middle, RECENT_TIME), (short, max(raw, MIN_READINGS * step) if raw else -1.0)):
        firsts = np.flatnonzero((np.diff(place, prepend=-1.0) != 0.0) | alone)
        end = int(firsts[np.searchsorted(firsts, int(np.searchsorted(-age, -far)), side="right") - 1]) if far >= 0.0 else since.size
        if end > done:
            out.append(np.union1d(done, firsts[(firsts > done) & (firsts < end)]))
            done = end
    return np.concatenate([*out, every[done:]])


def _block_length(duration: float) -> float:
    """Return the block length for a log of a duration: `MAX_BLOCK` halved until the log has 1000 of them. [s]"""
    return float(MAX_BLOCK * 2.0 ** min(0.0, np.floor(np.log2(max(duration, 1e-9) / (AVERAGES_PER_LOG * MAX_BLOCK)))))


def block_means(record: Record, least: float = 0.0) -> Record:
    """Return a record of means over complete blocks of at least `least` [s], each channel's noise that of such a mean. [K]

    A last block that lacks more than one and a half steps of the log is left out.
    """
    step, ends = _raw_step(record), record.times - record.times[0]
    block = max(_block_length(float(ends[-1])), least)
    complete = step >= block or ends[-1] % block >= block - 1.5 * step
    blocks = with_block_means(
        record if complete else part(record, 0, int(np.searchsorted(ends, block * (ends[-1] // block) - 1e-9))), 0.0, block
    )
    read = {
        n: reading_noise(record, n)
        for n, c in record.channels.items()
        if c.role == "node" or (c.role == "auto" and c.quantity == "temperature")
    }
    many = max(block / max(step, 1e-9), 1.0)
    return blocks.with_channels(
        *(replace(blocks.channel(n), noise=_noise_of_mean(record.channel(n), noise, many)) for n, noise in read.items())
    )


def without_spikes(record: Record) -> Record:
    """Return a record with spikes masked: up to three readings in a row that lie far from the median about them.

    Far is `MIN_SPIKE_CHANGES` times the noise s, the larger of median |x_k+1 - x_k| / 0.6745 and the noise of a reading [K]; the median is
    that of 2 h + 1 readings, h up to `MAX_SPIKE_READINGS`. Readings after a jump at the very end are masked too, until more of them show
    whether it stays. Where more than `MAX_SPIKE_SHARE` of the readings are far, the quantity moves like that, and all stay.
    """
    cleaned = []
    for c in record.channels.values():
        valid_samples = np.flatnonzero(c.valid)
        if c.role not in ("node", "auto") or c.quantity != "temperature" or valid_samples.size < 2 * MIN_SPIKE_CHANGES:
            continue
        values = c.values[valid_samples]
        steps = np.abs(np.diff(values))
        least = MIN_SPIKE_CHANGES * max(float(np.median(steps)) / 0.6745, reading_noise(record, c.name))
        # readings (samples,) less the median of twice `MAX_SPIKE_READINGS` others about each, of fewer at the ends
        beside = np.zeros(values.size)
        for half in range(1, MAX_SPIKE_READINGS + 1):
            about = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1)
            beside[half : values.size - half] = values[half : values.size - half] - np.median(about, axis=1)
        far = np.abs(beside) > least
        if far.mean() > MAX_SPIKE_SHARE:
            continue
        late = np.flatnonzero(steps[-MAX_SPIKE_READINGS:] > least)  # whether what jumped last comes back is not known yet
        if late.size:
            far[steps.size - min(MAX_SPIKE_READINGS, steps.size) + int(late[0]) + 1 :] = True
        if far.any():
            cleaned.append(c.masked(np.isin(np.arange(c.values.size), valid_samples[far]), "spike"))
    return record.with_channels(*cleaned) if cleaned else record


def with_smooth_powers(record: Record) -> Record:
    """Return a record whose logged powers [W] are means over `MEAN_WINDOW` [s] between their switches: a meter's noise heats nothing."""
    since, smooth_powers = record.times - record.times[0], []
    for c in record.channels.values():
        if c.quantity == "power" and c.held and c.valid.all() and c.white_noise > 0.0:
            jumps = np.cumsum(c.switched)
            begins = np.flatnonzero((np.diff(jumps, prepend=-1) != 0) | (np.diff(np.floor(since / MEAN_WINDOW), prepend=-1.0) != 0.0))
            count = np.diff(begins, append=since.size)
            smooth_powers.append(replace(c, values=np.repeat(np.add.reduceat(c.values, begins) / count, count)))
    return record.with_channels(*smooth_powers) if smooth_powers else record


def min_gap(record: Record) -> float:
    """Return the interval without readings from which the state of the unit is unknown: ten median intervals, at least 300 s. [s]"""
    return max(MIN_GAP, 10.0 * record.step)


def after_gaps_left_out(record: Record) -> Record:
    """Return a record with temperatures masked after each gap for as long as it lasted, where inputs are logged too.

    During the gap the inputs are not known, so the model's temperatures after it are not either.
    """
    if not any(c.drives for c in record.channels.values()):
        return record
    lengths, wide = np.diff(record.times), np.zeros(record.times.size, dtype=bool)
    for k in np.flatnonzero(lengths > min_gap(record)):
        if lengths[k] > 0.01 * (record.times[k] - record.times[0]):  # else it is a stretch of means
            wide |= (record.times >= record.times[k + 1]) & (record.times < record.times[k + 1] + lengths[k])
    if not wide.any():
        return record
    nodes = [c for c in record.channels.values() if c.role in ("node", "auto") and c.quantity == "temperature"]
    return record.with_channels(*(c.masked(wide, "after a gap") for c in nodes))


def reading_noise(record: Record, name: str) -> float:
    """Return the noise of a reading: as stated, or what the latest readings show, at least `MIN_NOISE`. [K]"""
    channel = record.channel(name)
    if channel.noise:
        return channel.noise
    return max(channel_slice(channel, max(channel.values.size - MIN_READINGS, 0), channel.values.size).white_noise, MIN_NOISE)


def _noise_of_mean(channel: Channel, noise: float, many: float) -> float:
    """Return the noise of a mean of `many` readings: noise / sqrt(many) if it is white, plus the rounding that equal readings share. [K]"""
    white = noise if channel.part is not None and channel.part.correlation_time else noise / many**0.5
    recent = channel_slice(channel, max(channel.values.size - MIN_READINGS, 0), channel.values.size)
    rounding = (recent if channel.resolution is None else channel).step / 12.0**0.5
    equal = recent.values.size / (1.0 + np.count_nonzero(np.diff(recent.values[recent.valid])))
    return float(np.hypot(white, rounding * max(equal / many, 1.0) ** 0.5))


def channel_slice(channel: Channel, begin: int, end: int) -> Channel:
    """Return a channel from sample `begin` to before `end`."""
    return replace(channel, values=channel.values[begin:end], valid=channel.valid[begin:end], masks={})


def part(record: Record, begin: int, end: int) -> Record:
    """Return a record from sample `begin` to before `end`, with two samples at least."""
    begin, end = min(begin, max(end - 2, 0)), max(end, min(2, record.times.size))
    if begin == 0 and end == record.times.size:
        return record
    return replace(record, times=record.times[begin:end], channels={n: channel_slice(c, begin, end) for n, c in record.channels.items()})


def raw_readings(record: Record) -> Record:
    """Return the last readings of a record, which stay as they were read."""
    size = record.times.size
    begin = int(np.searchsorted(record.times, record.times[-1] - RAW_TIME))
    return part(record, max(min(begin, size - MIN_READINGS), 0), size)


def replayed(record: Record, every: float) -> Iterator[Record]:
    """Yield a finished log as if it grew: the record up to each of moments `every` seconds apart."""
    times, taken = record.times, 0
    at = float(times[0])
    while taken < times.size:
        at = min(at + every, float(times[-1]))
        end = int(np.searchsorted(times, at, side="right"))
        if end >= 2 and end > taken:
            taken = end
            yield part(record, 0, end)


class LogClock:
    """The moments at which a log is judged: its tenth reading, then each doubling in its first minute, then every minute.

    Each is the first reading at or after such a time of the log, so that advice does not depend on when somebody looks.
    """

    def __init__(self) -> None:
        self.begin = 0.0
        self._kept: Record | None = None

    def moments(self, record: Record) -> Iterator[Record]:
        """Yield the record at every moment since the last call, older readings averaged as in `with_block_means`.

        Parameters
        ----------
        record : Record     The log so far; what came since the last moment is as it was read.
        """
        taken = 0
        if self._kept is None:
            self.begin = float(record.times[0])
        else:
            taken = int(np.searchsorted(record.times, self._kept.times[-1], side="right"))
        minute = np.maximum((record.times - self.begin) / TIME_BETWEEN_MOMENTS + 1e-9, np.finfo(float).tiny)
        number = np.floor(np.where(minute < 1.0, np.log2(minute), minute))
        ends = 1 + np.flatnonzero(np.diff(number, prepend=number[0]) > 0.0)
        if self._kept is None:
            ends = np.union1d(ends[ends > FIRST_READINGS], FIRST_READINGS) if record.times.size >= FIRST_READINGS else ends[:0]
        for end in ends[ends > taken]:
            self._kept = with_block_means(part(record, 0, end) if self._kept is None else _extended(self._kept, record, taken, end))
            taken = int(end)
            yield self._kept


def _with_step(channel: Channel) -> Channel:
    """Return a temperature channel with the step that its latest readings show, which means of them no longer do."""
    if channel.resolution is not None or channel.role not in ("node", "auto") or channel.quantity != "temperature":
        return channel
    recent = channel_slice(channel, max(channel.values.size - MIN_READINGS, 0), channel.values.size)
    step = recent.step if np.unique(recent.values[recent.valid]).size > 1 else 0.0
    return replace(channel, resolution=step) if step > 0.0 else channel


def _averaged(channel: Channel, first: Places, count: Places) -> Channel:
    """Return a channel with the mean of the valid samples of each block; `first` and `count` (blocks,) [samples] are where it is."""
    valid: Bools = channel.valid
    many = np.add.reduceat(valid.astype(float), first)
    total = np.add.reduceat(np.where(valid, channel.values, 0.0), first)
    alone = count == 1
    values = np.where(alone, channel.values[first], np.where(many > 0.0, total / np.maximum(many, 1.0), np.nan))
    return replace(channel, values=values, valid=many > 0.0, masks={})


def _extended(record: Record, other: Record, begin: int, end: int) -> Record:
    """Return a record with the samples `begin` to before `end` of another record behind its own."""
    channels = {}
    for name, c in record.channels.items():
        more = other.channel(name)
        values, valid = np.concatenate([c.values, more.values[begin:end]]), np.concatenate([c.valid, more.valid[begin:end]])
        channels[name] = replace(c, values=values, valid=valid, masks={})
    return replace(record, times=np.concatenate([record.times, other.times[begin:end]]), channels=channels)


def read_whole_lines(path: Path, read: Callable[[Path], Record]) -> Record:
    """Return a log without a last line that may be half written; half of a number would be a spike.

    Parameters
    ----------
    path : Path         The log.
    read : callable     File -> its record.

    Raises
    ------
    RecordError   When it cannot be read.
    """
    before = _ends_with_whole_line(path)
    record = read(path)
    dropped = any(UNFINISHED in note for note in record.steps)
    if (before and _ends_with_whole_line(path)) or dropped or record.times.size < 3:
        return record
    return replace(record.trim(float(record.times[0]), float(record.times[-2])), steps=(*record.steps, f"the last line {UNFINISHED}"))


def _ends_with_whole_line(path: Path) -> bool:
    """Whether a file ends with a line end; true of bench logs, which have checksums, and of packed, binary, empty or missing files."""
    if not path.is_file():
        return True
    with path.open("rb") as file:
        head = file.read(4096)
        if is_bench_log(head) or head[:2] == b"\x1f\x8b" or b"\0" in head or not head:
            return True
        file.seek(-1, 2)
        return file.read(1) in b"\r\n"


class GrowingLog:
    """A log that is still written to. Each call reads only what is new, below the first lines, which say what the columns are.

    A log that cannot be read in pieces (packed, binary) is read whole each time.

    Parameters
    ----------
    path : Path         The file.
    read : callable     File -> its record; called with pieces of the log.
    """

    def __init__(self, path: Path, read: Callable[[Path], Record]) -> None:
        self.path, self._read = path, read
        self._forget()

    def _forget(self) -> None:
        """Begin again, as with a new file."""
        self._at, self._head, self.whole, self._failed = 0, b"", False, 0
        self._kept: Record | None = None

    def record(self) -> Record | None:
        """Return the log so far; None before two samples.

        Raises
        ------
        NameNotFoundError   When columns that were asked for are none of the log's.
        RecordError         When more than `MAX_UNREAD_LINES` lines cannot be read.
        """
        try:
            size = self.path.stat().st_size
        except OSError:
            return None
        if size < self._at:  # written anew
            self._forget()
        if self._kept is not None:
            self._kept = with_block_means(self._kept)
        while not self.whole and self._more(size):
            pass
        if self.whole:
            try:
                latest = self._read(self.path)
            except (MissingDataError, RecordError) as error:
                self._failed += 1
                if self._kept is None or self._failed < MAX_FAILED_LOOKS:
                    return self._kept
                raise RecordError(
                    f"what was written after {self._kept.times[-1]:.0f} s cannot be read: {error.message} Start the watch again on a new "
                    "file, with the names of its columns in its first line.",
                    self.path.name,
                    code=error.code,
                ) from None
            self._failed = 0
            return latest
        return self._kept

    def _more(self, size: int) -> bool:
        """Read the next piece up to the size [bytes], as far as its last whole line; return whether there was one.

        The first rows are kept as a beginning that later pieces are read behind, so that they are read alike. A file that this does not
        hold for, packed, in another code, or with another first time, is marked to be read as a whole.
        """
        with self.path.open("rb") as file:
            file.seek(self._at)
            piece = file.read(min(CHUNK_BYTES, size - self._at))
        piece = piece[: piece.rfind(b"\n") + 1]
        if not self._at and (b"\0" in piece[:4096] or piece[:2] == b"\x1f\x8b"):
            self.whole = True
        if not piece or self.whole:
            return False
        parsed = self._parsed(self._head + piece)
        if parsed is None:
            self.whole = bool(self._head)  # what comes later reads otherwise than its beginning: no log of rows
            return False
        if self._kept is None:
            self._head = self._beginning(piece, parsed)
            self._kept = parsed
        elif abs(parsed.times[0] - self._kept.times[0]) > 1e-3 * self._kept.step:
            self.whole = True
            return False
        else:
            begin = int(np.searchsorted(parsed.times, self._kept.times[-1], side="right"))
            if begin < parsed.times.size:
                self._kept = _extended(self._kept, parsed, begin, parsed.times.size)
        self._at += len(piece)
        return True

    def _beginning(self, piece: bytes, parsed: Record) -> bytes:
        """Return the fewest first lines of a piece that read as the beginning of its record."""
        lines = piece.splitlines(keepends=True)
        for count in range(1, min(MAX_HEAD_LINES, len(lines)) + 1):
            head = b"".join(lines[:count])
            first = self._parsed(head)
            if first is not None and first.times.size > 1 and abs(first.times[0] - parsed.times[0]) < 1e-3 * parsed.step:
                return head
        return piece

    def _parsed(self, text: bytes) -> Record | None:
        """Return the record of a piece of the log; None where it is too short for one."""
        with scratch() as folder:
            try:
                return self._read(FileKinds.COPY.save_bytes(folder / self.path.name, text))
            except NameNotFoundError:
                raise
            except RecordError:
                if not self._head and text.count(b"\n") > MAX_UNREAD_LINES:
                    raise
                return None
