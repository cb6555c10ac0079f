"""`Scenario`: what is done to the hardware - boundary temperatures, loads, schedules, the state of each gas, the start."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from thermid.base.errors import CodedText, ScenarioError, errors_at, refuse_unknown
from thermid.base.results import Shown
from thermid.base.units import TEMPERATURE, Stamp, amount, kelvin
from thermid.model.tree import Constant, Flat, Signal, TableSignal, check_span, in_run, literal, own_signal, signal
from thermid.simulation._network.environment import Environment
from thermid.simulation._network.irradiation import Irradiation, Sky
from thermid.simulation._network.medium import Media

SLOTS = {"boundaries": TEMPERATURE, "loads": "W", "commands": "1", "prescribed": TEMPERATURE, "schedule": ""}
"""Tables of signals, and what each holds; only the model knows the unit of a scheduled parameter."""
STEADY = "steady"
"""`start = "steady"`: the run starts where the inputs at its beginning would have settled; an instant or `MEAN` may follow a comma."""
MEAN = "mean"
"""`start = "steady, mean"`: where the means of the inputs would have settled."""
PERIODIC = "periodic"
"""`start = "periodic"`: the run starts where it comes back to after every period of its inputs."""


@dataclass(frozen=True)
class Start:
    """A start that must be solved for: steady under the inputs of one time, steady under their means, or periodic.

    Parameters
    ----------
    kind : str      ``steady``, ``mean`` or ``periodic``.
    time : float    Whose inputs are held, of a steady one. [s]
    """

    kind: str
    time: float = 0.0

    @classmethod
    def from_text(cls, written: str | float, where: str) -> Start | None:
        """Return the steady or periodic start that a text asks for; None where it is a temperature or the name of a boundary.

        Raises
        ------
        ScenarioError   When a time is none, or lies before the run.
        """
        if not isinstance(written, str):
            return None
        head, _, rest = (part.strip() for part in written.partition(","))
        if written.strip() == PERIODIC:
            return cls(PERIODIC)
        if head != STEADY:
            return None
        if rest in ("", MEAN):
            return cls(rest or STEADY)
        time = literal(rest, "s", where)
        if time < 0.0:
            raise ScenarioError("the time of a steady start must be zero or later.", where, code="value.outside-range")
        return cls(STEADY, time)


@dataclass(frozen=True)
class Scenario(Shown):
    """The conditions of a run: what is done to a model.

    Values may be written as texts with units, with `thermid.celsius` or `thermid.quantity`, as pairs of times and values, tables or signals
    (see `thermid.model._laws.signal.signal`); they are kept as signals. A temperature always states its unit; times without one are
    seconds.

    Parameters
    ----------
    title : str             What it is.
    boundaries : dict       Boundary -> temperature. [K]
    loads : dict            Load -> power, in place of the deck's. [W]
    commands : dict         Load -> command, which multiplies the deck's power; 1 is full power. [-]
    gains : dict            Load -> parameter that takes the place of the deck's power where a command drives the load.
    schedule : dict         Parameter path -> signal in the parameter's unit.
    prescribed : dict       Node -> temperature that drives it. [K]
    environment : dict      Gas node -> `Environment`; ``*`` for every gas not named.
    irradiation : dict      Surface -> `Irradiation` on it; ``*`` -> the `Sky` over every surface outdoors.
    start : str or Quantity A temperature, the name of a boundary (its temperature at the beginning), ``steady`` (settled under the inputs
                            of time zero), ``steady, 2 [h]`` (of another time), ``steady, mean`` (under their means) or ``periodic`` (the
                            state that comes back after every period of the inputs).
    initial : dict          Node -> temperature or boundary name, where it differs from `start`.
    duration : float        [s]
    begins : str            Stamp of the run's beginning, ``2026-02-01 08:00``; without it the earliest of all signals that have stamps.
    as_printed : bool       Vacuum as the source document prints it: every coefficient zero, radiation inside it included.
    metered : tuple of str  Loads whose power was measured where it heats: no law over temperature, cycle or control of the deck acts on it.
    """

    title: str = "scenario"
    boundaries: Mapping[str, Any] = field(default_factory=dict)
    loads: Mapping[str, Any] = field(default_factory=dict)
    commands: Mapping[str, Any] = field(default_factory=dict)
    gains: Mapping[str, str] = field(default_factory=dict)
    schedule: Mapping[str, Any] = field(default_factory=dict)
    prescribed: Mapping[str, Any] = field(default_factory=dict)
    environment: Mapping[str, Environment] = field(default_factory=dict)
    irradiation: Mapping[str, Irradiation | Sky] = field(default_factory=dict)
    start: Any = ""
    initial: Mapping[str, Any] = field(default_factory=dict)
    duration: str | float = 0.0
    begins: Any = field(default=None, repr=False)
    as_printed: bool = False
    metered: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Turn texts into signals, so that a mistake shows here and not in a run."""
        for name in (*SLOTS, "gains", "environment", "irradiation", "initial"):
            if not isinstance(getattr(self, name), Mapping):
                raise ScenarioError(
                    f"it takes a dictionary from names to values, not {getattr(self, name)!r}.",
                    f"{self.title}, {name}",
                    code="value.wrong-kind",
                )
        object.__setattr__(self, "start", _start(self.start, f"{self.title}, start"))
        object.__setattr__(self, "initial", {k: _start(v, f"{self.title}, initial.{k}") for k, v in self.initial.items()})
        for name, slot in SLOTS.items():
            written = ((k, v, f"{self.title}, {name}.{k}") for k, v in getattr(self, name).items())
            held = slot != TEMPERATURE  # as in a record
            table = {k: signal(v, slot, where, held) if slot else own_signal(v, where) for k, v, where in written}
            object.__setattr__(self, name, table)
            for key, course in table.items() if slot == TEMPERATURE else ():
                above_zero(course.bounds[0], f"{self.title}, {name}.{key}")
        for name, kinds in (("environment", (Environment,)), ("irradiation", (Irradiation, Sky))):
            for key, value in getattr(self, name).items():
                if not isinstance(value, kinds):
                    raise ScenarioError(
                        f"it takes an {name}, not {value!r:.60}. Make one: td.simulation.{kinds[0].__name__}(...).",
                        f"{self.title}, {name}.{key}",
                        code="value.wrong-kind",
                    )
        seconds = amount(self.duration, "s", f"{self.title}, duration")
        if seconds < 0:
            raise ScenarioError("the duration is below zero. Give a positive one.", f"{self.title}, duration", code="value.outside-range")
        object.__setattr__(self, "duration", seconds)
        self._lay_on_one_clock()

    def _lay_on_one_clock(self) -> None:
        """Shift signals whose times are stamps so that their time zero is the beginning of the run, by default the earliest stamp.

        Raises
        ------
        ScenarioError   When some stamps have a time zone and some have none.
        """
        stamps = {place: s.stamp for place, s in self.signals() if isinstance(s, TableSignal) and s.stamp is not None}
        if self.begins is None and not stamps:
            return
        begins = min(stamps.values()) if self.begins is None else Stamp.read(self.begins, f"{self.title}, begins")
        other = next((place for place, stamp in stamps.items() if stamp.zoned != begins.zoned), "")
        if other:
            one = "begins" if self.begins is not None else next(iter(stamps))
            raise ScenarioError(
                f"the stamps of {one} and {other} differ: only one of them has a time zone. Give all of them one, or none.",
                self.title,
                code="record.time-unclear",
            )

        object.__setattr__(self, "begins", begins)
        tables = self._mapped_tables(
            lambda s: replace(s.shifted(begins.seconds - s.stamp.seconds), stamp=None) if isinstance(s, TableSignal) and s.stamp else s
        )
        for name, table in tables.items() if stamps else ():
            object.__setattr__(self, name, table)

    @property
    def seconds(self) -> float:
        """The duration. [s]"""
        return float(self.duration)

    def media(self) -> Media:
        """Return the environments of all gases, with their signals as the run sees them, and the irradiation of surfaces."""
        gases = {gas: e.mapped(lambda s: in_run(s, self.seconds)) for gas, e in self.environment.items()}
        return Media(gases, self.as_printed, self.irradiation, self.seconds)

    def signals(self) -> Iterator[tuple[str, Signal]]:
        """Yield every signal with the place where the scenario has it; those of a schedule that are still text are left out."""
        for table in SLOTS:
            yield from ((f"{table}.{k}", v) for k, v in getattr(self, table).items() if isinstance(v, Signal))
        for gas, e in self.environment.items():
            yield f"environment.{gas}.pressure", e.pressure
            yield f"environment.{gas}.wind", e.wind
        for surface, falling in self.irradiation.items():
            yield from ((f"irradiation.{surface}.{k}", v) for k, v in falling.signals().items())

    def names(self) -> set[str]:
        """Return the names that `but` of `mapped` and `begun` accepts: of whole tables, and of single signals."""
        return {name for place, _ in self.signals() for name in (place.partition(".")[2], place.split(".")[1])} | {*SLOTS}

    def mapped(self, law: Callable[[Signal], Signal], but: Collection[str] = ()) -> Scenario:
        """Return the scenario with every signal s replaced by law(s), but for the tables (``commands``) or single names in `but`."""
        return replace(self, **self._mapped_tables(law, but))

    def _mapped_tables(self, law: Callable[[Signal], Signal], but: Collection[str] = ()) -> dict[str, Any]:
        """Return field -> table with its signals replaced, of all tables of signals; see `mapped`."""
        tables: dict[str, Any] = {
            name: {k: law(v) if isinstance(v, Signal) and not {name, k} & set(but) else v for k, v in getattr(self, name).items()}
            for name in SLOTS
        }
        tables["environment"] = {gas: e if gas in but else e.mapped(law) for gas, e in self.environment.items()}
        tables["irradiation"] = {face: falling if face in but else falling.mapped(law) for face, falling in self.irradiation.items()}
        return tables

    def begun(self, seconds: float, but: Collection[str] = ()) -> Scenario:
        """Return the scenario of a run that begins `seconds` later [s]: every signal is shifted, but for those in `but`, see `mapped`.

        Sun and sky are worked out anew where their path is known. Tables are shifted and not cut, so nothing of them is lost.
        """
        if seconds == 0.0:
            return self
        moved = self.mapped(lambda s: s.shifted(seconds), but)
        skies = {k: v.shifted(seconds) for k, v in self.irradiation.items() if isinstance(v, Sky) and k not in but}
        begins = None if moved.begins is None else moved.begins._replace(seconds=moved.begins.seconds + seconds)
        return replace(moved, irradiation={**moved.irradiation, **skies}, begins=begins)

    def driven(self, flat: Flat) -> set[str]:
        """Return the paths of parameters that a schedule or a gain drives, and of the numbers behind them: a fit may not change these."""
        paths = {flat.names.model.canonical(p) for p in (*self.schedule, *self.gains.values())}
        return {p for n in paths if n in flat.parameters.table for p in (n, flat.parameters.literal_behind(n))}

    def check_spans(self) -> None:
        """Refuse signals that end before the run, or begin after it: nothing says what holds there.

        Raises
        ------
        ScenarioError   With what can be said of the time beyond.
        """
        for place, course in self.signals():
            check_span(course, self.seconds, f"{self.title}, {place}")

    def vacuum(self, as_printed: bool = False) -> Scenario:
        """Return the same scenario without gas; sealed volumes keep theirs, vented ones lose it with their time constant.

        Parameters
        ----------
        as_printed : bool   Set effective coefficients to zero as the source document does; an upper bound, since radiation goes too.
        """
        gone = {gas: e if e.sealed or e.vented else replace(e, pressure=Constant(0.0)) for gas, e in self.environment.items()}
        gone.setdefault("*", Environment(Constant(0.0)))
        label = "vacuum as printed (upper bound)" if as_printed else "vacuum"
        title = self.title if label in self.title else f"{self.title}, {label}"
        return replace(self, title=title, environment=gone, as_printed=as_printed)

    def with_(self, **changes: Any) -> Scenario:
        """Return the scenario with fields changed; tables are merged, other fields replaced.

        Raises
        ------
        ScenarioError   When there is no such field.
        """
        refuse_unknown(changes, self.__dataclass_fields__, self.title, "a scenario has no '{}'.", ScenarioError)
        merged: dict[str, Any] = {
            k: {**getattr(self, k), **v} if isinstance(v, Mapping) and isinstance(getattr(self, k), Mapping) else v
            for k, v in changes.items()
        }
        return replace(self, **merged)


def _start(written: Any, where: str) -> Any:
    """Return a start: a text as it is, since names of boundaries are resolved later, any other value as a temperature. [K]"""
    if isinstance(written, str):
        return written
    with errors_at(where):
        return above_zero(kelvin(written), where)


def above_zero(temperature: float, where: str) -> float:
    """Return a temperature. [K]

    Raises
    ------
    ScenarioError   When it lies below 0 K.
    """
    if temperature < 0.0:
        raise ScenarioError(f"{temperature - 273.15:g} degC lies below 0 K.", where, code="value.outside-range")
    return temperature


def sampled_logs(scenario: Scenario) -> tuple[str, ...]:
    """Return a remark that names the columns of logs for which nobody stated whether samples are averages or instants; else nothing."""
    assumed = {place: s for place, s in scenario.signals() if isinstance(s, TableSignal) and s.log is not None and not s.samples}
    if not assumed:
        return ()
    of_series = [place for place, s in assumed.items() if s.held and s.log is not None and not s.log[0]]
    held = f". Each one of {', '.join(of_series)} holds until the next, as in a record" if of_series else ""
    return (
        CodedText(
            f"samples of logs are taken as instants ({', '.join(assumed)}). State samples = 'instant', or samples = 'average' if the "
            f"logger gives means over the interval up to the stamp{held}",
            "record.samples-assumed",
        ),
    )
