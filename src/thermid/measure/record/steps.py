"""The `prepare` list of a campaign file, as method calls on a record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from thermid.errors import RecordError, ThermidError, nearest

if TYPE_CHECKING:
    from thermid.measure.record.record import Record


class Step(NamedTuple):
    """A method of `Record` and its options: the first `required` must be given."""

    method: str
    required: int
    options: tuple[str, ...]


STEPS: Final = {
    "trim": Step("trim", 1, ("start", "end")),
    "median": Step("median", 1, ("window", "powers")),
    "filter": Step("filter", 1, ("window", "powers")),
    "resample": Step("resample", 1, ("step", "max_gap", "switches")),
    "spikes": Step("flag_spikes", 2, ("threshold", "window", "channels")),
    "faults": Step("flag_faults", 0, ("codes", "low", "high", "jump", "channels")),
    "mask": Step("mask", 1, ("channel", "start", "end", "reason")),
    "shift_start": Step("shift_start", 0, ()),
}


def run_steps(record: Record, steps: Iterable[Mapping[str, object]]) -> Record:
    """Return the record after a list of steps, each a table with one key.

    A step takes a table of options, a list of them in order, or the first one alone: ``{spikes = {threshold = 5, window = "10 [s]"}}``,
    ``{trim = ["2 [s]", "end"]}``, ``{median = "4 [s]"}``. A step without options takes true.

    Raises
    ------
    RecordError   When a step or an option is unknown or one is missing; with the place in the list, as every error of a step has.
    """
    for number, table in enumerate(steps, 1):
        where = f"record '{record.name}', prepare[{number}]"
        if not isinstance(table, Mapping) or len(table) != 1:
            raise RecordError(f"{table!r} is no step. Write one step in each table, such as {{median = '4 [s]'}}.", where)
        ((name, given),) = table.items()
        if name not in STEPS:
            raise RecordError(f"no step '{name}'; there are {', '.join(STEPS)}.{nearest(str(name), STEPS)}", where)
        step = STEPS[name]
        options = _options(name, step, given, where)
        try:
            record = getattr(record, step.method)(**options)
        except ThermidError as error:
            place = error.where or name
            raise type(error)(error.message, f"{where}, {place}") from None
    return record


def _options(name: str, step: Step, given: object, where: str) -> dict[str, object]:
    """Return the options of one step by name."""
    where = f"{where}, {name}"
    if isinstance(given, Mapping):
        for key in given:
            if key not in step.options:
                raise RecordError(
                    f"no option '{key}'; there are {', '.join(step.options) or 'none'}.{nearest(str(key), step.options)}", where
                )
        options = dict(given)
    elif given is True and step.required == 0:
        options = {}
    else:
        values = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else [given]
        if len(values) > len(step.options):
            raise RecordError(f"{len(values)} values are given; it takes {', '.join(step.options) or 'none: write true'}.", where)
        options = dict(zip(step.options, values, strict=False))
    missing = [option for option in step.options[: step.required] if option not in options]
    if missing:
        raise RecordError(f"it needs {' and '.join(missing)}.", where)
    return options
