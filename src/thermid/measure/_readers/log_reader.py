"""A log as a record, and as a plain table whose columns are read in the units that its header or its reader names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.base.errors import NameNotFoundError, RecordError, UnitError, errors_at, refuse_unknown
from thermid.base.units import amount, from_si, in_si, require, unit
from thermid.measure._readers.bindings import Binding, bindings, full_scale, unit_and_quantity
from thermid.measure._readers.columns import NumberColumn, decimal_sign, find_column, kelvin_sized, numbers
from thermid.measure._readers.formats import log_cells
from thermid.measure._readers.guess import Column, columns_of
from thermid.measure._readers.headers import LETTERED, NO_NUMBER, name_and_unit
from thermid.measure._readers.power_of_columns import RESTARTED, power_readings
from thermid.measure._readers.questions import begins_again, board_restarts, hidden_switches, lost_hour, repeated_stamps, unit_question
from thermid.measure._readers.stamps import Clock, Times, clock_column, read_times
from thermid.measure._readers.textfile import Cells, decoded, read_bytes
from thermid.measure._record.channel import BoolArray, Channel, FloatArray, Origin, digest, unseen_pulses, with_sensor
from thermid.measure._record.record import Record

STATED_SIZES: Final = ("noise", "accuracy", "resolution")
"""What a table of a channel says of the size of its errors and its step."""
SCPI_OVERLOAD: Final = 9.9e36
"""What instruments with SCPI write for an overload or an open sensor is 9.9e37, of either sign; it is masked as infinite."""


def read_record(
    path: str | Path,
    channels: Mapping[str, str | Mapping[str, object]],
    *,
    time: str | None = None,
    noise: Mapping[str, str | float] | None = None,
    accuracy: Mapping[str, str | float] | None = None,
    units: Mapping[str, str] | None = None,
    name: str | None = None,
    separator: str | None = None,
    decimal: str | None = None,
    clock: str | None = None,
) -> Record:
    """Return the channels of a log, in any format of docs/logs.md; the format is told by what stands in the file.

    Parameters
    ----------
    path : str or Path       A log with a header line: commas, semicolons or tabs, plain or gzip; lines that start with '#' are comments.
                             Or one of a logger, a workbook, a binary file, or of the bench as ``thermid log`` writes it.
    channels : mapping       Target to column, ``{"case": "ACC_X"}``, or column to table,
                             ``{"T1": {"node": "h1.sensor", "noise": "0.3 [K]"}}``. A table has one of node,
                             boundary, load, command (a path in the model), and gain, noise, accuracy, resolution, unit; of a
                             temperature sensor also what `SensorPart` and `SensorCertificate` hold. `full_scale`, a power, is what
                             a load in per cent has at 100 %; `power` of a load is a formula of columns or a table, see docs/logs.md.
    time : str or None       The time column; by default the only one called time, time_s, t, t_s, timestamp, datetime or seconds, else the
                             only one with another usual name or with stamps. Date and time in two columns are one time.
    noise, accuracy : mapping   Standard deviation of one sample, and of the constant error, by channel name.
    units : mapping          Unit by channel name, or of the time column. Without it, and without one in the header (``T1 [degC]``,
                             ``T1 (°F)``, ``P, mW``): seconds or time since 1970, degC for temperatures, W for loads, % for commands and
                             for loads with a gain or full scale.
    name : str or None       Name of the record; by default the file's.
    separator, decimal : str or None   Separator of the columns and decimal sign, where the file leaves them open.
    clock : str or None      Form of the stamps for `datetime.strptime`, where it is not known or leaves the day and the month open.

    Raises
    ------
    MissingDataError    When there is no such file.
    NameNotFoundError   When a column or channel does not exist.
    RecordError         When the log cannot be read for certain; the message gives the line.
    UnitError           When a unit does not fit.

    Notes
    -----
    Samples of one stamp are averaged; of a power or command the last one holds. Empty cells, NaN, NA, N/A, #N/A, null and the words of
    instruments for an overload (OL, OVLD, OPEN, 1.#QNAN) are masked as 'not a number'.
    """
    _check_tables(path, channels=channels, noise=noise or {}, accuracy=accuracy or {}, units=units or {})
    cells = log_cells(Path(path), separator)
    clock_at = clock_column(cells, time)
    stated = dict(units or {})
    asked_unit = next((stated.pop(key) for key in (clock_at.header, clock_at.name) if key in stated and key not in channels), None)
    wanted = bindings(channels, {"noise": noise or {}, "accuracy": accuracy or {}, "unit": stated}, cells.file)
    sign = decimal_sign(cells, decimal)
    read_at = read_times(cells, clock_at, sign, clock, asked_unit or clock_at.unit, asked_unit is not None)
    parsed = [numbers(column, sign) if at not in clock_at.places else read_at.values for at, column in enumerate(cells.columns)]
    texts = [c if isinstance(x, int) else () for c, x in zip(cells.columns, parsed, strict=True)]  # the others are long
    cells = replace(cells, columns=texts, notes=cells.notes + (("read with decimal ','",) if sign == "," and decimal is None else ()))
    clock_at = replace(clock_at, texts=() if isinstance(clock_at.texts, NumberColumn) else clock_at.texts)
    return _record_of_columns(name or Path(Path(path).name.removesuffix(".gz")).stem, cells, clock_at, read_at, parsed, wanted)


def _record_of_columns(
    name: str, cells: Cells, clock_at: Clock, read_at: Times, parsed: list[FloatArray | int], wanted: Sequence[Binding]
) -> Record:
    """Return the record of a log whose columns are numbers, or the row of their first text.

    Raises
    ------
    RecordError   When it has fewer than two times, or a channel cannot be read for certain.
    """
    times = read_at.values
    if times[0] == times[-1]:
        samples_text = "one sample" if times.size == 1 else f"{times.size} samples with one time stamp"
        raise RecordError(
            f"the log has {samples_text}; a record needs at least two times. For a steady point that was written by hand, write its row "
            "again with a later time, and start = 'steady' in the scenario of the record.",
            cells.file,
            code="record.too-short",
        )
    read = [(_channel(cells, binding, parsed, times), binding) for binding in wanted]
    sensors = [
        with_sensor(one, binding.part, binding.certificate or cells.certificates.get(one.column), f"{cells.file}, channels.{binding.name}")
        for one, binding in read
    ]
    series = [one for one, _ in sensors]
    origin = replace(
        _origin(cells, clock_at, read_at, parsed),
        questions=_questions(times, clock_at, read_at, series, _bare_numbers(cells, clock_at, parsed)),
    )
    times, series, repeated = _one_per_stamp(times, series)
    notes = [*cells.notes, *read_at.notes, *(note for _, remarks in sensors for note in remarks), *([repeated] if repeated else [])]
    for one in series:
        try:
            one.checked()
        except RecordError as error:
            raise RecordError(error.message, cells.where(None, one.column)) from None
    return Record(name, times, {one.name: one for one in series}, origin, tuple(notes))


def _check_tables(path: str | Path, **tables: Mapping[str, object]) -> None:
    """Refuse arguments of `read_record` that are no dictionaries, and units that are no texts.

    Raises
    ------
    RecordError   With the argument.
    """
    for word, argument in tables.items():
        if not isinstance(argument, Mapping):
            raise RecordError(f"`{word}` takes a dictionary, not {argument!r}.", str(path), code="value.wrong-kind")
    for channel, unit_text in tables["units"].items():
        if not isinstance(unit_text, str):
            raise RecordError(f"its unit is a text, not {unit_text!r}.", f"{path}, {channel}", code="value.wrong-kind")


def parts_between_restarts(path: str | Path) -> list[str]:
    """Return the texts of a log cut where the counter that is its clock begins again; each part keeps the lines above the samples.

    Raises
    ------
    MissingDataError   When there is no such file.
    RecordError        When its clock does not begin again, or it is no text.
    """
    place = Path(path)
    cells = log_cells(place)
    counted = numbers(clock_column(cells, None).texts, decimal_sign(cells, None))
    again = np.flatnonzero(begins_again(counted)).tolist() if isinstance(counted, np.ndarray) else []
    if not again or not cells.layout.separator:
        raise RecordError(
            "its clock is not a counter of a text log that begins again. There is nothing to cut.", place.name, code="record.does-not-apply"
        )
    lines = decoded(read_bytes(place), place.name)[0].split("\n")
    head = lines[: cells.lines[0] - 1]
    edges = zip([0, *again], [*again, len(cells.lines)], strict=True)
    return ["\n".join([*head, *(lines[n - 1] for n in cells.lines[a:b]), ""]) for a, b in edges]


def log_columns(path: str | Path, time: str | None = None, separator: str | None = None) -> list[Column]:
    """Return the columns of a log, each with a guess of what it is.

    `time` and `separator` are those of `read_record`.

    Raises
    ------
    MissingDataError   As `log_cells`.
    RecordError        As `log_cells`, and when no column is the time's.
    """
    cells = log_cells(Path(path), separator)
    return columns_of(cells, decimal_sign(cells, None), clock_column(cells, time).places)


def temperature_columns(path: str | Path, time: str | None = None, separator: str | None = None) -> list[str]:
    """Return the names of the columns of `log_columns` that seem to be temperatures, of surroundings too."""
    return [c.name for c in log_columns(path, time, separator) if c.guess in ("temperature", "boundary")]


def _channel(cells: Cells, binding: Binding, parsed: list[FloatArray | int], times: FloatArray) -> Channel:
    """Return one channel in SI.

    Parameters
    ----------
    cells, binding : Cells, Binding     The log, and what is asked of the column.
    parsed : list                       Each column as numbers (samples,), or as the row of its first text.
    times : array (samples,)            [s]

    Raises
    ------
    RecordError   When its column holds text, or its unit is unclear.
    """
    if binding.power is not None or binding.temperature is not None:
        return _computed(cells, binding, parsed, times)
    at = find_column(cells.header, binding.column, f"{cells.file}, channels.{binding.name}")
    column, header_unit = name_and_unit(cells.header[at])
    where = cells.where(None, column)
    unit_text, quantity = unit_and_quantity(binding, header_unit, where)
    watts = full_scale(binding, where)
    samples = _samples(cells, parsed, at)
    stated = binding.unit is not None or header_unit is not None
    if not stated and watts is None:
        _refuse_by_size(samples, quantity, binding.name, where)
    scale = 1.0 if watts is None else watts
    difference = "K" if quantity == "temperature" else unit_text

    # errors and the step of the column; one in per cent is a share of the full scale
    with_step = replace(binding, resolution=binding.resolution or cells.resolution.get(column))
    sizes = {word: size * scale for word, size in _stated_sizes(with_step, difference, where).items()}
    is_si = (scale, in_si(0.0, unit_text), in_si(1.0, unit_text)) == (1.0, 0.0, 1.0)
    values = samples if is_si else in_si(samples, unit_text) * scale
    channel = Channel(
        binding.name,
        values,
        np.isfinite(values),
        quantity=quantity if watts is None else "power",
        role=binding.role,
        target=binding.target,
        gain=binding.gain,
        **sizes,
        column=column,
        unit=unit_text if watts is None else "W",
        assumed=not stated and not ((ending := LETTERED.match(column)) and ending["letter"] in "CW"),
        prompt=True if column in cells.prompt else binding.prompt,
        samples=binding.samples,
        interpolation=binding.interpolation,
    )
    return _masked(channel, cells.reasons.get(column, {}))


def _stated_sizes(binding: Binding, of: str, where: str) -> dict[str, Any]:
    """Return noise, accuracy and resolution of a channel as far as its table states them, in SI, each by its name.

    Raises
    ------
    UnitError   When one has not the unit `of` the readings.
    """
    out = {}
    for word in STATED_SIZES:
        if (written := getattr(binding, word)) is None:
            continue
        try:
            out[word] = amount(written, of, f"{where}, {word}")
        except UnitError as error:
            if word != "accuracy" or "%" not in str(written):
                raise
            raise error.reworded(f"{error.message} An error in per cent of the reading is gain_accuracy = '{written}'.") from None
    return out


def _samples(cells: Cells, parsed: list[FloatArray | int], at: int) -> FloatArray:
    """Return the readings (samples,) of the column `at` in its own unit, infinite where an instrument states an overload.

    `parsed` has numbers, or of a column with a text that text's row.

    Raises
    ------
    RecordError   When a cell is text.
    """
    samples = parsed[at]
    if isinstance(samples, int):
        text = cells.columns[at][samples]
        raise RecordError(
            f"'{text}' is not a number. {NO_NUMBER}; for decimal commas give decimal=','.",
            cells.where(samples, name_and_unit(cells.header[at])[0]),
            code="record.not-a-number",
        )
    return np.where(over, np.inf, samples) if (over := np.abs(samples) >= SCPI_OVERLOAD).any() else samples


def _computed(cells: Cells, binding: Binding, parsed: list[FloatArray | int], times: FloatArray) -> Channel:
    """Return a channel whose power [W] or temperature [K] is computed from columns."""
    where = f"{cells.file}, channels.{binding.name}"

    def column(name: str) -> tuple[FloatArray, str | None]:
        """Return samples (times,) and unit of a column."""
        at = find_column(cells.header, name, where)
        return _samples(cells, parsed, at), name_and_unit(cells.header[at])[1]

    quantity, of = ("power", "W") if binding.temperature is None else ("temperature", "K")
    read = power_readings(binding.temperature or binding.power, column, times, where, quantity)
    return Channel(
        binding.name,
        read.values,
        np.isfinite(read.values),
        quantity=quantity,
        role=binding.role,
        target=binding.target,
        gain=binding.gain,
        unit=of,
        prompt=binding.prompt,
        samples=binding.samples or read.samples,
        interpolation=binding.interpolation,
        masks={RESTARTED: read.restarted} if read.restarted.any() else {},
        **_stated_sizes(binding, of, where),
    )


def _refuse_by_size(samples: FloatArray, quantity: str, name: str, where: str) -> None:
    """Refuse readings without a unit that look like kelvin, and powers without one that run from 0 to exactly 100, as per cent do.

    Raises
    ------
    RecordError   With the range of the readings.
    """
    finite = samples[np.isfinite(samples)]
    if quantity == "temperature" and kelvin_sized(finite):
        raise RecordError(
            f"its readings, {finite.min():.1f} .. {finite.max():.1f}, look like kelvin, but without a unit they are read in degC. "
            f"Give units={{'{name}': 'K'}} or 'degC'; in a campaign, unit = \"K\" of the channel.",
            where,
            code="record.unit-unclear",
        )
    if quantity == "power" and finite.size and finite.min() >= 0.0 and finite.max() == 100.0 and np.all(finite == np.round(finite)):
        raise RecordError(
            f"its readings, {finite.min():g} .. 100, look like per cent of a heater, but without a unit they are read in W. Give "
            f"units={{'{name}': 'W'}} if they are watts; else full_scale = '... [W]' of the channel, or gain.",
            where,
            code="record.unit-unclear",
        )


def _masked(channel: Channel, reasons: Mapping[str, list[int]]) -> Channel:
    """Return a channel with rows masked that the log itself calls faults; `reasons` is reason -> rows."""
    valid, masks = channel.valid.copy(), {}
    for reason, rows in reasons.items():
        masks[reason] = np.zeros_like(valid)
        masks[reason][rows] = True
        valid[rows] = False
    return replace(channel, valid=valid, masks=masks) if masks else channel


def _questions(
    times: FloatArray, clock: Clock, read: Times, channels_read: Sequence[Channel], bare: Mapping[str, FloatArray]
) -> tuple[str, ...]:
    """Return the questions that the log leaves open: restarts, units, repeated stamps, a lost hour, hidden switches, unseen pulses.

    `bare` are the columns without a unit.
    """
    warm = [c for c in channels_read if c.quantity == "temperature"]
    return (
        *board_restarts(times, bare),
        *unit_question(_Readings([c for c in warm if c.assumed and c.unit == "degC"])),
        *repeated_stamps(times, _Readings(channels_read)),
        *(() if read.zone or not clock.texts else lost_hour(times, clock.texts, _Readings(warm))),
        *hidden_switches(times, _Readings([c for c in channels_read if c.held])),
        *unseen_pulses(times, _Readings([c for c in channels_read if c.held and c.prompt is None and c.samples != "average"])),
    )


class _Readings(Mapping[str, FloatArray]):
    """Readings by the name of their channel (samples,), in the unit of the log, NaN where there is none; computed on access."""

    def __init__(self, channels: Sequence[Channel]) -> None:
        self._channels = {c.name: c for c in channels}

    def __getitem__(self, name: str) -> FloatArray:
        """Return the readings of a channel."""
        c = self._channels[name]
        return np.where(c.valid, from_si(c.values, c.unit), np.nan)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._channels)

    def __len__(self) -> int:
        """How many channels there are."""
        return len(self._channels)


def _bare_numbers(cells: Cells, clock: Clock, parsed: list[FloatArray | int]) -> dict[str, FloatArray]:
    """Return name -> numbers (samples,) of the columns without a unit, but for the times."""
    heads = [name_and_unit(header) for header in cells.header]
    rest = (k for k in range(len(heads)) if k not in clock.places and heads[k][1] is None)
    return {heads[k][0]: column for k in rest if not isinstance(column := parsed[k], int)}


def _origin(cells: Cells, clock: Clock, times: Times, parsed: list[FloatArray | int]) -> Origin:
    """Return the origin, with the hash of the times and of every column that has numbers and no text."""
    names = [name_and_unit(header)[0] for header in cells.header]
    hashed = [
        (names[place], column)
        for place, column in enumerate(parsed)
        if place not in clock.places and not isinstance(column, int) and not np.all(np.isnan(column))
    ]
    sha = digest([(clock.name, times.values), *hashed])
    return Origin(cells.file, sha, times.start or cells.start, tuple(names), len(cells.lines), clock.name, cells.synthetic)


def _one_per_stamp(times: FloatArray, channels: list[Channel]) -> tuple[FloatArray, list[Channel], str]:
    """Return times (stamps,) [s] and channels with one sample for each stamp, and a note where some of `times` (samples,) repeat.

    A sample is the mean of those of its stamp, of a held channel the last.
    """
    new = np.diff(times, prepend=-np.inf) > 0
    if new.all():
        return times, channels, ""
    first = np.flatnonzero(new)
    last = np.append(first[1:], times.size) - 1
    group = np.cumsum(new) - 1
    out = []
    for channel in channels:
        values, valid = _last_valid(channel, group, last) if channel.held else _mean_valid(channel, group, first)
        out.append(replace(channel, values=values, valid=valid, masks={}))
    note = (
        f"{times.size - first.size} of {times.size} rows repeat a time stamp: temperatures are averaged, of powers and commands the "
        "last one is used"
    )
    return times[first], out, note


def _mean_valid(channel: Channel, group: np.ndarray, first: np.ndarray) -> tuple[FloatArray, BoolArray]:
    """Return the mean of the valid samples of each group (groups,), and where there is one; `group` (samples,) numbers the groups."""
    count = np.bincount(group, channel.valid, minlength=first.size)
    total = np.bincount(group, np.where(channel.valid, channel.values, 0.0), minlength=first.size)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan), count > 0


def _last_valid(channel: Channel, group: np.ndarray, last: np.ndarray) -> tuple[FloatArray, BoolArray]:
    """Return the last valid sample of each group (groups,), and where there is one; `last` is each group's last sample."""
    place = np.maximum.accumulate(np.where(channel.valid, np.arange(group.size), -1))[last]
    valid = (place >= 0) & (group[place] == group[last])
    return np.where(valid, channel.values[place], np.nan), valid


@dataclass(frozen=True, eq=False)
class PlainTable:
    """A table of text whose columns are read in units, such as a weather file.

    Parameters
    ----------
    cells : Cells   Its cells.
    time : str      The time column; by default the only one with a usual name.
    """

    cells: Cells
    time: str | None = None

    @property
    def file(self) -> str:
        """Name of the file."""
        return self.cells.file

    @cached_property
    def heads(self) -> list[tuple[str, str | None]]:
        """Name and unit of every column."""
        return [name_and_unit(h) for h in self.cells.header]

    @property
    def names(self) -> list[str]:
        """Names of the columns."""
        return [name for name, _ in self.heads]

    @cached_property
    def _decimal(self) -> str:
        """Decimal sign of the file."""
        return decimal_sign(self.cells, None)

    @cached_property
    def _clock(self) -> tuple[FloatArray, str | None]:
        """Times (samples,) [s] and the first stamp, None for numbers.

        Raises
        ------
        RecordError   When the time column is not clear, has fewer than two times, or these do not increase.
        """
        try:
            clock = clock_column(self.cells, self.time)
        except NameNotFoundError:
            if self.time is not None:
                raise
            raise RecordError(
                f"the time column is not clear. Give time = '...', one of {', '.join(self.names)}.", self.file, code="record.time-unclear"
            ) from None
        read = read_times(self.cells, clock, self._decimal, None, clock.unit)
        times, stamp = read.values, read.start
        if times.size < 2:
            raise RecordError("a table over time needs at least two times.", self.file, code="record.too-short")
        back = np.flatnonzero(np.diff(times) <= 0)
        if back.size:
            k = int(back[0])
            raise RecordError(
                f"times must increase: {times[k]:g} s is followed by {times[k + 1]:g} s.",
                self.cells.where(k + 1, clock.name),
                code="record.time-order",
            )
        return times, stamp

    @property
    def times(self) -> FloatArray:
        """Times (samples,); from the first stamp where the table has stamps. [s]"""
        return self._clock[0]

    @property
    def stamp(self) -> str | None:
        """The first stamp, or None where the table has seconds."""
        return self._clock[1]

    def column(self, name: str, slot: str, usual: str = "") -> FloatArray:
        """Return the values (samples,) of a column, NaN where one is missing. [SI]

        Parameters
        ----------
        name : str    The column.
        slot : str    What it must be: a unit or `temperature`.
        usual : str   Unit where the header names none; that of the slot by default.

        Raises
        ------
        NameNotFoundError   When there is no such column.
        RecordError         When a cell is no number.
        UnitError           When the header's unit is of another dimension.
        """
        refuse_unknown([name], self.names, self.file, "no column '{}'.", NameNotFoundError)
        at = self.names.index(name)
        parsed = numbers(self.cells.columns[at], self._decimal)
        if isinstance(parsed, int):
            raise RecordError(
                f"'{self.cells.columns[at][parsed]}' is not a number.", self.cells.where(parsed, name), code="record.not-a-number"
            )
        text = usual if usual and self.heads[at][1] is None else self.heads[at][1] or ("K" if slot == "temperature" else slot)
        if slot == "1" and text in ("deg", "°"):
            text = "1"
        with errors_at(self.cells.where(None, name)):
            of = unit(text)
            require(of.dimension, slot, text, of.absolute)
        return in_si(parsed, of)

    def whole(self, name: str, slot: str, usual: str = "") -> FloatArray:
        """Return the values (samples,) of a column without holes. [SI]

        Raises
        ------
        RecordError   At the first hole; and as `column`.
        """
        values = self.column(name, slot, usual)
        gone = np.flatnonzero(~np.isfinite(values))
        if gone.size:
            raise RecordError(
                "the value is missing. Add it, or remove the line.", self.cells.where(int(gone[0]), name), code="record.not-a-number"
            )
        return values


def read_plain(path: str | Path, time: str | None = None) -> PlainTable:
    """Read a file as a plain table, in any format that `log_cells` knows; lines that start with '#' are comments."""
    return PlainTable(log_cells(Path(path)), time)
