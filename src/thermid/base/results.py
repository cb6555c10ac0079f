"""What every result can do: a short text, a table in a notebook, a plot, a frame, names to complete. One home for all rooms.

In: a result that says its rows and its traces. Out: `repr`, HTML, axes of matplotlib, frames of pandas, data sets of xarray.

Verdicts stand here too: on several verdicts, and on a number of a standard (`Figure`) by the mark of how it is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import dataclass, fields, is_dataclass
from html import escape
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

import numpy as np

from thermid.base._numbers import Array
from thermid.base._units import HOUR
from thermid.base.arguments import guard_methods
from thermid.base.errors import ScenarioError, ThermidError, look_up, optional, refuse_unknown

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

MAX_REPR_CHARACTERS: Final = 400
"""Characters of a `repr` at most."""
ROWS: Final = 20
"""Rows of a table in a notebook; what is left out is counted below it."""
NAMES: Final = 4
"""Names of a mapping that one line gives; of more, their count."""
CYCLE_COLOURS: Final = 10
"""Colours of a plot, those of matplotlib; more channels repeat them in other styles of line and other marks."""
LINE_STYLES: Final = ("-", "--", ":", "-.")
MARKERS: Final = (".", "x", "+", "^")

Row = Mapping[str, object]


def clean(value: Any, arrays: Callable[[Array], Any] | None = None) -> Any:
    """Return a value that JSON can hold: numbers that are not finite become null, arrays lists or what `arrays` makes of them."""
    if isinstance(value, Mapping):
        return {str(k): clean(v, arrays) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [clean(v, arrays) for v in value]
    if isinstance(value, np.ndarray):
        return arrays(value) if arrays is not None else clean(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool | int | str) or value is None:
        return value
    number = float(value)
    return number if math.isfinite(number) else None


@dataclass(frozen=True)
class PlottedTrace:
    """One line of a plot.

    Parameters
    ----------
    name : str                  For the legend.
    x, y : array (points,)      As `Result._axes_titles` says; times in s.
    low, high : array or None   Its band.
    measured : bool             Whether it is drawn as points.
    channel : str               What it shares its colour with, such as readings with their simulation; its name without one.
    """

    name: str
    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None
    measured: bool = False
    channel: str = ""


class Shown:
    """Base of what a console and a notebook show: a short `repr` and `_repr_html_`, of `_summary` (one line) and `_as_rows`."""

    def __init_subclass__(cls, **more: Any) -> None:
        """Give a class the short `repr` in place of the one that a dataclass would write; its methods refuse arguments of a wrong kind."""
        super().__init_subclass__(**more)
        guard_methods(cls)
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Shown.__repr__  # type: ignore[method-assign]

    def _summary(self) -> str:
        """Return the result in one line; the first one of its text, or its fields."""
        if type(self).__str__ is not object.__str__:
            return str(self).partition("\n")[0]
        if not is_dataclass(self):
            return ""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.repr}
        return ", ".join(f"{n}={_brief(v)}" for n, v in values.items() if not isinstance(v, Sized) or len(v))

    def _as_rows(self) -> list[Row]:
        """Return the result as a table; by default what it holds by name, or its first list of things, or its own numbers."""
        named = names_of(self)
        if named:
            return [{"name": n, **_scalars(self[n])} for n in named]  # type: ignore[index]
        names: list[str] = [f.name for f in fields(self)] if is_dataclass(self) else []
        for name in names:
            value = getattr(self, name)
            if isinstance(value, Mapping) and value and all(is_dataclass(v) or isinstance(v, int | float | str) for v in value.values()):
                return [{name: str(k), **_scalars(v)} for k, v in value.items()]
            if isinstance(value, Sequence) and value and all(is_dataclass(v) for v in value):
                return [_scalars(v) for v in value]
        return [_scalars(self)]

    def __repr__(self) -> str:
        """Return the kind of result and its first line, at most `MAX_REPR_CHARACTERS` characters."""
        text = f"<{type(self).__name__}: {self._summary()}>" if self._summary() else f"<{type(self).__name__}>"
        return text if len(text) <= MAX_REPR_CHARACTERS else f"{text[: MAX_REPR_CHARACTERS - 4]}...>"

    def _repr_html_(self) -> str:
        """Return the first line and the table, as notebooks show them."""
        rows = self._as_rows()
        columns = list(dict.fromkeys(key for row in rows for key in row))
        head = "".join(f"<th>{escape(c)}</th>" for c in columns)
        body = "".join(f"<tr>{''.join(f'<td>{escape(_cell(row.get(c)))}</td>' for c in columns)}</tr>" for row in rows[:ROWS])
        more = f"<p>{len(rows) - ROWS} more rows</p>" if len(rows) > ROWS else ""
        table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>" if columns else ""
        return f"<div><p>{escape(repr(self)[1:-1])}</p>{table}{more}</div>"


class Result(Shown):
    """Base of results: they have a short `repr`, `_repr_html_`, `plot`, `to_frame`, `to_xarray` and completion of their names.

    A class says what it is by three methods, of which each has a default: `_summary` (one line), `_as_rows` (a table), `_as_traces` (lines
    over time).
    """

    _frame_of_rows = False
    """Whether `to_frame` gives its rows though it has traces."""
    _axes_titles: tuple[str, str] = ("time [s]", "temperature [degC]")

    def _as_traces(self) -> Sequence[PlottedTrace]:
        """Return the lines of its plot; none by default."""
        return ()

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that it is indexed by."""
        return names_of(self)

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the result and return the axes: its traces with their bands, or the first numbers of its table as bars.

        Parameters
        ----------
        axes : matplotlib axes   Where to draw; a new figure without them.

        Raises
        ------
        MissingExtraError   When matplotlib is not installed.
        ThermidError        When there is nothing to draw.
        """
        traces = self._as_traces()
        rows = self._as_rows() if not traces else []
        label, number = _drawable(rows) if not traces else ("", "")
        if not traces and not number:
            raise ThermidError("there is nothing to draw: it holds no numbers.", type(self).__name__, code="result.nothing-to-draw")
        if axes is None:
            axes = new_axes()
        if not traces:
            shown = rows[:ROWS]
            axes.barh(
                [_cell(row.get(label)) if label else str(k) for k, row in enumerate(shown)], [_number(row.get(number)) for row in shown]
            )
            axes.invert_yaxis()
            axes.set_xlabel(number)
            return axes
        hours = self._axes_titles[0] == "time [s]" and max(float(t.x[-1]) for t in traces if len(t.x)) > 2.0 * HOUR
        channels = list(dict.fromkeys(t.channel or t.name for t in traces))
        lines = {t.channel or t.name for t in traces if not t.measured}
        for t in traces:
            x, channel = t.x / HOUR if hours else t.x, t.channel or t.name
            turn, k = divmod(channels.index(channel), CYCLE_COLOURS)
            look: dict[str, Any] = {"marker": MARKERS[turn % len(MARKERS)], "linestyle": "none"}
            if not t.measured:
                look = {"linestyle": LINE_STYLES[turn % len(LINE_STYLES)]}
            (line,) = axes.plot(x, t.y, color=f"C{k}", markersize=2, **look)
            line.set_label("_readings" if t.measured and channel in lines else channel)
            if t.low is not None and t.high is not None:
                axes.fill_between(x, t.low, t.high, alpha=0.25, color=line.get_color(), linewidth=0)
        axes.set_xlabel("time [h]" if hours else self._axes_titles[0])
        axes.set_ylabel(self._axes_titles[1])
        if len(channels) <= ROWS:
            pairs = len(channels) < len(traces)
            place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)} if len(channels) > NAMES else {"loc": "best"}
            axes.legend(fontsize="small", title="dots: readings, lines: model" if pairs else None, **place)
        return axes

    def to_frame(self) -> pandas.DataFrame:
        """Return the result as a frame of pandas: traces over time where all have the same times, else its table.

        Raises
        ------
        MissingExtraError   When pandas is not installed.
        """
        library = optional("pandas", "to_frame")
        traces = self._as_traces()
        if self._frame_of_rows or not traces or any(t.x is not traces[0].x and list(t.x) != list(traces[0].x) for t in traces):
            frame: pandas.DataFrame = library.DataFrame([dict(row) for row in self._as_rows()])
            return frame
        columns: dict[str, Any] = {}
        for t in traces:
            columns[t.name] = t.y
            if t.low is not None and t.high is not None:
                columns |= {f"{t.name} low": t.low, f"{t.name} high": t.high}
        wide: pandas.DataFrame = library.DataFrame(columns, index=library.Index(traces[0].x, name=self._axes_titles[0]))
        return wide

    def to_xarray(self) -> xarray.Dataset:
        """Return the frame as a data set of xarray.

        Raises
        ------
        MissingExtraError   When pandas or xarray is not installed.
        """
        dataset: xarray.Dataset = optional("xarray", "to_xarray").Dataset.from_dataframe(self.to_frame())
        return dataset


V = TypeVar("V")


class Named(Result, Generic[V]):
    """Base of results that are indexed by names: `result[name]`, `name in result` and iteration over the names.

    A class says what it holds by `_entries`, and by `_refusal` what a name is not that is missing there.
    """

    _refusal = "no '{}'."

    def _entries(self) -> Mapping[str, V]:
        """Return name -> what the result holds under it."""
        raise NotImplementedError

    def __getitem__(self, name: str) -> V:
        """Return what the result holds under a name.

        Raises
        ------
        NameNotFoundError   With the nearest name.
        """
        return look_up(name, self._entries(), self._refusal, getattr(self, "title", ""))

    def __contains__(self, name: object) -> bool:
        """Whether the result holds something under a name."""
        return name in self._entries()

    def __iter__(self) -> Iterator[str]:
        """Yield the names."""
        return iter(self._entries())

    def __len__(self) -> int:
        """How many there are."""
        return len(self._entries())


def names_of(result: object) -> list[str]:
    """Return the names that a result is indexed by; none where it is indexed by numbers or not at all."""
    if not hasattr(type(result), "__getitem__"):
        return []
    if hasattr(type(result), "__iter__"):
        return [n for n in result if isinstance(n, str)]  # type: ignore[attr-defined]
    return []


def new_axes() -> Axes:
    """Return the axes of a new figure, as matplotlib's own interface makes it.

    Raises
    ------
    MissingExtraError   When matplotlib is not installed.
    """
    axes: Axes = optional("matplotlib.pyplot", "a plot").subplots(layout="constrained")[1]
    return axes


def _scalars(value: object) -> dict[str, object]:
    """Return the numbers, and texts of up to 80 characters, of a dataclass by its public fields; of a plain value itself as ``value``."""
    if isinstance(value, bool | int | float | str):
        return {"value": value}
    if not is_dataclass(value) or isinstance(value, type):
        return {}
    by_field = {f.name: getattr(value, f.name) for f in fields(value) if not f.name.startswith("_")}
    return {n: v for n, v in by_field.items() if isinstance(v, bool | int | float) or (isinstance(v, str) and len(v) <= 80)}


def _brief(value: object) -> str:
    """Return a field in a few characters."""
    if isinstance(value, str):
        return repr(value if len(value) <= 40 else f"{value[:37]}...")
    if value is None or isinstance(value, bool | int | float):
        return f"{value:.6g}" if isinstance(value, float) else str(value)
    if isinstance(value, Mapping) and len(value) <= NAMES and all(isinstance(n, str) for n in value):
        return f"{{{', '.join(value)}}}"
    if isinstance(value, Sized):
        return f"[{len(value)}]"
    return type(value).__name__


def _cell(value: object) -> str:
    """Return the text of a cell: numbers in five digits, nothing for None."""
    return "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value)


def _number(value: object) -> float:
    """Return a value as the length of a bar; NaN where it is no number."""
    return float(value) if isinstance(value, int | float) else float("nan")


def _drawable(rows: Sequence[Row]) -> tuple[str, str]:
    """Return the columns of a table that label its bars and say their lengths; empty where there is none."""
    for key in dict.fromkeys(key for row in rows for key in row):
        values = [row.get(key) for row in rows]
        if any(isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < float("inf") for v in values):
            return next((k for k, v in rows[0].items() if isinstance(v, str)), ""), key
    return "", ""


MARKS = {
    "read": "read in the text of its source",
    "project": "the project's own",
    "secondary": "quoted from a secondary document",
    "memory": "from memory; shown for information, not used for a verdict",
}
"""Mark -> what it says, the surest first."""
VERDICTS = {True: "met", False: "NOT met", None: "not decided"}
"""Verdict -> its words."""


@dataclass(frozen=True)
class Figure:
    """One number of a rule.

    Parameters
    ----------
    value : float   The number. [SI; a margin in K]
    mark : str      A key of `MARKS`.
    source : str    Document and clause.
    """

    value: float
    mark: str
    source: str

    def __post_init__(self) -> None:
        """Refuse a mark that is none."""
        self.check_mark(self.mark, self.source or "figure")

    @staticmethod
    def check_mark(mark: str, where: str) -> str:
        """Return a mark that is known.

        Raises
        ------
        ScenarioError   With the nearest mark.
        """
        refuse_unknown([mark], MARKS, where, "'{}' is not a mark; use one of {known}.", ScenarioError)
        return mark

    @staticmethod
    def weakest(marks: Iterable[str]) -> str:
        """The least sure of some marks; ``read`` of none.

        >>> Figure.weakest(["read", "memory", "project"])
        'memory'
        """
        return max(marks, key=list(MARKS).index, default="read")

    @property
    def decides(self) -> bool:
        """Whether a verdict may rest on it: not on a number quoted from memory."""
        return self.mark != "memory"


def weigh(verdicts: Iterable[bool | None]) -> bool | None:
    """Return the verdict on several: False where one is, else None where one is not decided, or where there is none at all.

    >>> weigh([True, None, True]), weigh([None, False]), weigh([])
    (None, False, None)
    """
    decisions = list(verdicts)
    return False if False in decisions else None if None in decisions or not decisions else True
