"""What each column of a log is in a model: parts whose temperature is measured, their surroundings, powers that heat them."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from thermid.base.errors import NameNotFoundError, RecordError, ThermidError, refuse_unknown
from thermid.base.units import Array, unit
from thermid.measure.readers import Column, log_cells, log_columns, name_and_unit, read_record
from thermid.measure.records import Channel, Record

ACCURACY = 0.5
"""Constant error that an instrument has unless somebody says better: DS18B20 and thermocouples of class 1, as their makers print. [K]"""
JOIN = "A log that ran beside the first is joined with it before: `thermid look FIRST OTHER --join joined.csv`, then `init` with that."
"""How the log of a second instrument comes to `init`."""
SURROUNDINGS = "surroundings"
"""Boundary of a proposed model."""


@dataclass(frozen=True)
class Power:
    """A column that heats a part.

    Parameters
    ----------
    column : str        Its column.
    node : str          The part; empty where the log decides.
    full_scale : str    Power at 100 % of a duty, as text; empty for a column in watts, and where nobody said.
    duty : bool         Whether it is in per cent.
    told : bool         Whether its part was told, by somebody or by its name; else the log decides.
    seat : str          The load of a deck that it drives; one named after the column by default.
    formula : str       How it follows from columns; empty for a column of its own.
    share : str         Parameter of the model that is the part of the column that heats this part; empty for all of it.
    rest : tuple        Shares of the other parts, where this one has what they leave.
    """

    column: str
    node: str = ""
    full_scale: str = ""
    duty: bool = False
    told: bool = True
    seat: str = ""
    formula: str = ""
    share: str = ""
    rest: tuple[str, ...] = ()

    @property
    def load(self) -> str:
        """Name of its load in the model."""
        return self.seat or f"heat_{self.share or part_name(self.column)}"

    @property
    def channel(self) -> str:
        """Name of its channel: that of its column, or of a share beside that of the rest."""
        return self.share if self.share and not self.rest else self.column

    @property
    def anchored(self) -> bool:
        """Whether its power is unknown, so that one value of the model has to be assumed."""
        return self.duty and not self.full_scale


@dataclass(frozen=True)
class Roles:
    """What the columns of a log are.

    Parameters
    ----------
    parts : dict            Column -> part whose temperature it is.
    surroundings : str      Column of the surroundings, or a temperature as text; empty where nobody knows.
    powers : tuple of Power
    units : dict            Column -> unit, where the log names none and it was assumed.
    time : str or None      The time column, where it was named.
    why : dict              Column -> why it is taken for what it is.
    ignored : dict          Column -> why it is left out.
    boundary : str          Name of the surroundings in the model.
    questions : tuple       What only the owner of the log can answer, in words.
    """

    parts: Mapping[str, str]
    surroundings: str = ""
    powers: tuple[Power, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    time: str | None = None
    why: Mapping[str, str] = field(default_factory=dict)
    ignored: Mapping[str, str] = field(default_factory=dict)
    boundary: str = SURROUNDINGS
    questions: tuple[str, ...] = ()

    def part_named(self, name: str) -> str:
        """Return the part that a name means, as `named_part`."""
        return named_part(name, self.parts)

    @property
    def logged(self) -> bool:
        """Whether the surroundings have a column."""
        return bool(self.surroundings) and "[" not in self.surroundings

    def channels(self, noise: Mapping[str, float] | None = None, accuracy: Mapping[str, float] | None = None) -> dict[str, dict[str, Any]]:
        """Return the table of channels as a campaign has it; noise and accuracy [K] by column."""
        out: dict[str, dict[str, Any]] = {column: {"node": node} for column, node in self.parts.items()}
        if self.logged:
            out[self.surroundings] = {"boundary": self.boundary}
        for power in self.powers:
            table = out[power.channel] = {"command": power.load} if power.anchored else {"load": power.load}
            table |= {"full_scale": power.full_scale} if power.full_scale else {}
            table |= {"power": power.formula} if power.formula else {}
            if power.share:
                formula = power.formula or (power.column if power.column.isidentifier() else f"`{power.column}`")
                units = {power.column: self.units[power.column]} if power.column in self.units else {}
                table |= {"power": {"formula": formula, "units": units} if units else formula, "gain": power.share}
        for column, text in self.units.items():
            if column in out and "gain" not in out[column]:
                out[column]["unit"] = text
        for key, sizes in (("noise", noise or {}), ("accuracy", accuracy or {})):
            for column, size in sizes.items():
                if column in out:
                    out[column][key] = f"{size:.3g} [K]"
        return out

    def read(self, path: Path, noise: Mapping[str, float] | None = None) -> Record:
        """Return a log with these roles, in at most 600 readings."""
        return read_record(path, self.channels(noise), time=self.time).thin()

    def read_further_log(self, log: Path, same: Mapping[str, str], time: str | None = None) -> Record:
        """Return a log with the roles of another one, whose columns it may have under other names.

        Parameters
        ----------
        roles : Roles       Of the first log.
        log : Path          A further log of the unit, or the first.
        same : dict         Column of the first log -> its name in further logs, where that is another one.
        time : str          The time column, where it cannot be told; where the log has none of that name, as it can be told.

        Raises
        ------
        NameNotFoundError   When the log has neither name of a column, with its columns.
        RecordError         When it has no temperature of the first one.
        """
        name, here = word(log.name.partition(".")[0]), [name_and_unit(head)[0] for head in log_cells(log).header]
        refuse_unknown(same, [*self.channels(), *self.ignored], "--same", "no column '{}' in the first log. Columns: {known}.")
        other = {column: there for column, there in same.items() if column not in here}
        refuse_unknown(other.values(), here, f"{log.name}, --same", "no column '{}'. Columns: {known}.")
        if not any(other.get(column, column) in here for column in self.parts):
            raise RecordError(
                f"it has none of the temperatures of the first log. A further log is another test of the unit. {JOIN}",
                log.name,
                code="record.nothing-there",
            )
        bindings: dict[str, Any] = {}
        for column, table in self.channels().items():
            formula = table.get("power")
            for one, there in other.items():
                formula = re.sub(rf"(?<![\w`]){re.escape(one)}(?![\w`])", f"`{there}`", formula) if isinstance(formula, str) else formula
            bindings[other.get(column, column)] = table | ({"power": formula} if formula else {})
        record = read_record(log, bindings, time=time if time in here else None, name=name)
        names = {there: column for column, there in other.items()}
        channels = {names.get(c.name, c.name): replace(c, name=names.get(c.name, c.name), column="") for c in record.channels.values()}
        return replace(record, channels=channels) if other else record


def word(text: str) -> str:
    """Return a text as the name of an element, letters without their accents."""
    letters = unicodedata.normalize("NFKD", text.replace("ß", "ss"))
    bare = "".join(c for c in letters if not unicodedata.combining(c))
    plain = re.sub(r"[^0-9A-Za-z]+", "_", bare).strip("_").lower()
    return plain if plain and not plain[0].isdigit() else f"part_{plain}"


def part_name(column: str) -> str:
    """Return the name of the part that a column is of: without what says that it is a temperature or a power, and without its unit.

    >>> part_name("T_plate_C"), part_name("P_heater_W"), part_name("T1"), part_name("Winding_Temp_C")
    ('plate', 'heater', 't1', 'winding')
    """
    plain = re.sub(r"(?<=[a-z0-9])_(c|f|k|w|mw|pct|degc)\Z", "", word(column))
    bare = re.sub(r"\A(t|temp|temperature|p|power)_(?=[a-z])|_(temp|temperature|power)\Z", "", plain)
    return bare or plain


def roles_of(
    path: Path,
    temperatures: Sequence[str] = (),
    surroundings: str = "",
    powers: Sequence[str] = (),
    full_scale: Mapping[str, str] | None = None,
    time: str | None = None,
    formulas: Mapping[str, str] | None = None,
) -> Roles:
    """Return what the columns of a log are: as told, and as their names and units say for all else.

    Parameters
    ----------
    path : Path                 The log.
    temperatures : sequence     Columns, or ``COLUMN=PART``; all that look like temperatures by default.
    surroundings : str          A column, or a temperature with its unit.
    powers : sequence           Columns, or ``COLUMN=PART``; all that look like powers or duties by default. Of a column with several
                                parts the share of each is fitted.
    full_scale : dict           Column -> power at 100 %.
    time : str                  The time column, where it cannot be told.
    formulas : dict             Power -> how it follows from columns, ``V_IN * I_IN``.

    Raises
    ------
    RecordError             When the log has no temperature.
    NameNotFoundError       When it has no column of a name.
    """
    columns = {c.name: c for c in log_columns(path, time)}
    scales, formulas = full_scale or {}, formulas or {}
    named = [*(t.partition("=")[0] for t in temperatures), *(n for t in powers if (n := t.partition("=")[0]) not in formulas)]
    named += full_scale or {}
    named += [surroundings] if surroundings and "[" not in surroundings else []
    refuse_unknown(named, columns, path.name, "no column '{}'; there are {known}.{near}", NameNotFoundError)
    guessed = {kind: [n for n, c in columns.items() if c.guess == kind] for kind in ("temperature", "boundary", "power", "duty")}
    around = surroundings or next(iter(guessed["boundary"]), "")
    parts = dict(_pair(t) for t in temperatures) or {
        n: part_name(n)
        for n in (*guessed["temperature"], *guessed["boundary"])
        if n != around and n not in [p.partition("=")[0] for p in powers]
    }
    if len(set(parts.values())) < len(parts):
        parts = {n: word(n) for n in parts}
    if not parts:
        raise RecordError(
            f"no column is recognised as the temperature of a part. Name them: --temperature COLUMN=PART. Columns: {', '.join(columns)}.",
            path.name,
            code="record.nothing-there",
        )
    heated = [_pair(p, False) for p in powers] or [(n, "") for n in (*guessed["power"], *guessed["duty"]) if not _idle(columns[n].values)]
    heated = [(n, SURROUNDINGS if node in (around, SURROUNDINGS) else named_part(node, parts)) for n, node in heated]
    logged_powers = _with_shares(_logged(heated, columns, scales, formulas), path)
    taken = {*parts, around, *(p.column for p in logged_powers)}
    units = {n: c.unit for n, c in columns.items() if n in taken and c.assumed and c.unit}
    used = {n for text in formulas.values() for n in columns if re.search(rf"(?<!\w){re.escape(n)}(?!\w)", text)}
    others = {n: c for n, c in columns.items() if n not in taken | used and c.guess != "time"}
    options = {"temperature": "--temperature", "boundary": "--temperature", "power": "--power", "duty": "--power"}
    left = {n: f"not named by {options[c.guess]}" if c.guess in options else c.why for n, c in others.items()}
    rest = {n: "never on" if c.guess in ("power", "duty") and _idle(c.values) else left[n] for n, c in others.items()}
    questions = _questions(others, [columns[p.column].values for p in logged_powers if p.column in columns])
    return Roles(parts, around, logged_powers, units, time, {n: columns[n].why for n in taken if n in columns}, rest, questions=questions)


def _logged(
    heated: Sequence[tuple[str, str]], columns: Mapping[str, Column], scales: Mapping[str, str], formulas: Mapping[str, str]
) -> list[Power]:
    """Return a power for every column and part that it heats, then those by formula."""
    plain = [(n, node, columns[n]) for n, node in heated if n not in formulas]
    powers = [Power(n, node, scales.get(n, ""), n in scales or c.guess == "duty" or c.unit == "%") for n, node, c in plain]
    parts = {name: [node for n, node in heated if n == name] or [""] for name in formulas}
    return powers + [Power(n, node, formula=text, told=bool(node)) for n, text in formulas.items() for node in parts[n]]


def _with_shares(powers: Sequence[Power], path: Path) -> tuple[Power, ...]:
    """Return powers, of which a column that was named with several parts heats each with a share; the first one has what the others leave.

    Raises
    ------
    RecordError   When the column is a duty, whose power is unknown.
    """
    out = []
    for power in powers:
        several = [p for p in powers if p.column == power.column]
        names = [f"{part_name(p.column)}_to_{p.node}" for p in several]
        if len(several) > 1 and power.duty:
            words = (
                f"shares of '{power.column}' can be fitted of a power in watts only. Name one part of a duty: --power {power.column}=PART."
            )
            raise RecordError(words, path.name, code="record.does-not-apply")
        if len(several) > 1 and not (all(p.node for p in several) and len(set(names)) == len(names)):
            words = f"'{power.column}' is named more than once, and not each time with another part: --power {power.column}=PART."
            raise RecordError(words, path.name, code="name.taken")
        k = several.index(power)
        out.append(power if len(several) == 1 else replace(power, share=names[k], rest=() if k else tuple(names[1:])))
    return tuple(out)


def _asked_unit(column: Column) -> tuple[str, str] | None:
    """Return the unit of `_QUESTIONS` that a column that is not idle has the dimension of, and its own; None for any other."""
    text = column.unit or ("1/min" if _SPEED.search(column.name) else "")
    if _idle(column.values) or not text:
        return None
    try:
        of = unit(re.sub(r"(?<=[A-Za-z])(?=\d)", "^", text)).dimension  # loggers write A2 and kW/m2
    except ThermidError:
        return None
    return next(((slot, text) for slot in _QUESTIONS if of == unit(slot).dimension), None)


def _questions(others: Mapping[str, Column], watts: Sequence[Array]) -> tuple[str, ...]:
    """Return what to ask about columns that a power may follow from, such as a current, or whose changes a model would have to know.

    A voltage is named with its current where there is one; neither where a power is their product, to a twentieth in most rows.

    Parameters
    ----------
    others : dict       Columns without a role, by name.
    watts : sequence    Values of the powers.
    """
    kinds = {name: kind for name, column in others.items() if (kind := _asked_unit(column))}
    volts, amperes = ([name for name, (slot, _) in kinds.items() if slot == si] for si in ("V", "A"))
    out = []
    for name, (slot, text) in kinds.items():
        products = [others[name].values * others[v].values for v in volts if slot == "A"]
        apart = [np.nanmedian(np.abs(p - w)) / np.nanmax(np.abs(w)) for p, w in itertools.product(products, watts)]
        if not (slot == "V" and amperes) and min(apart, default=1.0) > 0.05:
            what, ask = _QUESTIONS[slot]
            names = [n if n.isidentifier() else f"`{n}`" for n in (name, *volts[:1])]
            out.append(f"{name} is {what} [{text}]: {ask.format(names[0], names[1] if len(volts) == 1 else 'V')}.")
    return tuple(out)


_SPEED = re.compile(r"rpm|(?<![a-z])fan(?![a-z])|tacho|drehzahl", re.IGNORECASE)
_QUESTIONS = {
    "A": ("a current", "is it a power with its voltage? If so, give --formula P='{1} * {0}'"),
    "A^2": ("the square of a current", "is it a power? If so, give --formula P='{0} * 4.7 [ohm]', with its resistance"),
    "V": ("a voltage", "is it a power? If so, give --formula P='{0} * I', I the column of its current"),
    "W/m^2": ("a power by area", "is it a power? If so, give --formula P='{0} * 20 [cm^2]', with the area that it falls on"),
    "J": ("an energy", "is it a power? If so, give power = {{ energy = ... }} of a channel in the campaign"),
    "1/s": (
        "a speed or a frequency",
        "is it a fan's? No structure tried here has losses that change: give logs of one speed, or write a deck and schedule = ... of its "
        "channel",
    ),
}
"""Unit of a column -> what it is, and what to ask about it."""


def named_part(name: str, parts: Mapping[str, str]) -> str:
    """Return the part that a name means, of a part or of its column, in any case of letters; the name as it is where there is none.

    Parameters
    ----------
    name : str
    parts : dict    Column -> part.
    """
    if name in parts.values():
        return name
    return parts.get(name) or {k.casefold(): p for c, p in parts.items() for k in (c, p)}.get(name.casefold(), name)


def _pair(text: str, named: bool = True) -> tuple[str, str]:
    """Return the column and the part of COLUMN=PART, the part by the name of the column where none is given."""
    column, _, node = text.partition("=")
    return column.strip(), node.strip() or (part_name(column) if named else "")


def _idle(values: Array) -> bool:
    """Whether a column has no value other than zero."""
    finite = values[np.isfinite(values)]
    return not finite.size or not np.any(finite)


def noise_of(channel: Channel) -> float:
    """Return the standard deviation of the noise of one reading, from second differences. [K]

    The median size of ``T[k-1] - 2 T[k] + T[k+1]`` over 0.6745 sqrt(6) is that of white noise on any slow course; a step of quantisation
    counts with at least its width over sqrt(12).
    """
    values = channel.values[channel.valid]
    if values.size < 8:
        return 0.1
    second = np.diff(values, 2)
    size = float(np.median(np.abs(second))) / 0.6745 / 6.0**0.5
    levels = np.unique(np.round(values, 6))
    step = float(np.min(np.diff(levels))) if levels.size > 1 and levels.size < values.size / 4 else 0.0
    return float(max(size, step / 12.0**0.5, 1e-3))


def with_noise(
    record: Record, stated: Mapping[str, float] | None = None, accuracy: float = ACCURACY, reference: bool = False
) -> tuple[Record, dict[str, float]]:
    """Return a record whose temperatures have a noise and the accuracy of their instruments, and the noise of parts by column. [K]

    Where the thermometer of the surroundings is the `reference`, the others have the accuracy of a difference to it.
    """
    noises = {n: (stated or {}).get(n, noise_of(c)) for n, c in record.channels.items() if c.role == "node"}
    around = [] if reference else [n for n, c in record.channels.items() if c.role == "boundary"]
    accuracy = float(np.hypot(accuracy, accuracy)) if reference else accuracy
    channels = (replace(record[n], noise=noises.get(n, record[n].noise), accuracy=accuracy) for n in (*noises, *around))
    return record.with_channels(*channels), noises
