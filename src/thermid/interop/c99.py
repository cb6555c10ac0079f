"""Models as one C99 header: parameters and inputs as structs, coefficients as formulas, rows as tables, steps of fixed length.

The steps themselves are `fixed_step.h`; here they stand beside a run with a small error, so that the header can state its error.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from thermid.base.errors import DeckError, SolverError
from thermid.base.units import Array
from thermid.interop._constants import COUPLED, DRIFT, GAMMA, STAGES, TIMES
from thermid.interop._wired import Text, Wired, Writer, distinct, exported, file_and_name, form_of, identifiers, one_line, resting, wired
from thermid.model.tree import Curve, Drawn, Model, Sine, TableSignal
from thermid.simulation.runs import Engine, Options, Scenario, Wiring, curve_arrays, tables_behind

MAX_DENSE_NODES = 200
"""The matrix of a step is dense and part of the caller's memory."""
ERROR = 1e-3
"""Of a step that is looked for. [K]"""
KEYWORDS = frozenset(
    "auto break case char const continue default do double else enum extern float for goto if inline int long register restrict return "
    "short signed sizeof static struct switch typedef union unsigned void volatile while main time exp log sqrt pow fmin fmax fabs".split()
)
LAWS = {
    "linear": "LINEAR",
    "flow": "STREAM",
    "power": "POWER",
    "radiation": "RADIATION",
    "potential": "POTENTIAL",
    "gas": "GAS",
    "natural": "NATURAL",
    "hinge": "HINGE_OF_MEAN",
    "hinge of difference": "HINGE_OF_DIFFERENCE",
    "table": "TABLE_OF_MEAN",
    "table of difference": "TABLE_OF_DIFFERENCE",
}
C = Writer("C", forms=tuple(LAWS), gas=True, open_tables=True, smooth=True, loads=True, schedules=True)
OF_LOADS = {"signal": "SIGNAL", "polynomial": "POLYNOMIAL", "exponential": "EXPONENTIAL", "table": "TABLE_OF_TEMPERATURE"}
OF_CONTROLS = {"": "ALWAYS", "thermostat": "THERMOSTAT", "proportional": "PROPORTIONAL"}
CODES = ("DONE", "SINGULAR", "NOT_FINITE", "NOT_SETTLED", "OUTSIDE_A_TABLE", "CHATTER")
_ITEMS_A_LINE = 6
MIN_STEPS, MAX_STEPS = 50, 20_000
"""Steps of a run between which a length is looked for."""
TIGHT = 1e-8
"""Error of the run beside which the steps are judged. [K]"""
ERROR_MARGIN = 2.0
"""What is stated is the measured error times this: other readings fall between the measured ones."""
DRIFT_INTERVAL = 1e-3
MOST_CUTS = 16
SWITCHING_TOLERANCE = 1e-9
"""Switching temperatures are met to this. [K]"""


HEAD = """\
/* {called}.h: temperatures of the thermal model '{title}' in the scenario '{scenario}'. C99, no allocation.

   #include it in one place and link with -lm. Temperatures in K, heat in W, time in s, parameters in SI.
       @_model m; @_parameters p; @_inputs u;
       @_defaults(&p); @_scenario(0.0, 0, &u); @_start(&m, &p, &u);
       @_step(&m, &p, &u, &u, @_STEP);    one step; inputs run straight from the first to the second
       @_run(&m, &p, 3600.0);                    or the scenario of the export, up to a time
       m.T[@_NODE_...]                           what follows from it
   Each returns 0, or one of @_SINGULAR ... @_CHATTER. -D @_WITHOUT_SCENARIO leaves the scenario out.

   Step {step:g} s. Error of nodes with mass at most {error:g} K: twice the largest difference to a run at a
   error of 1e-8 K over this scenario at these values, measured at export. With other values or inputs it may differ;
   m.error is the sum of what each step estimates of its own error.
   Where a thermostat switches a step is cut, at most {cuts} times, each cut found within 40 trial steps.{massless}
   Written by thermid {version}. */
#ifndef {guard}
#define {guard}
#include <math.h>
"""
STRUCTS = """/* Values that may be changed. What follows from them is computed in every step. */
typedef struct {{
{parameters}
}} @_parameters;

typedef struct {{
{inputs}
}} @_inputs;

static inline void @_defaults(@_parameters *p) {{
{defaults}
}}

/* Nodes, as they are in m.T. */
{nodes}
enum {{
    @_NODES = {n}, @_MASSLESS = {massless}, @_BOUNDARIES = {boundaries},
    @_CONDUCTORS = {conductors}, @_LOADS = {loads}, @_SWITCHES = {switches},
    @_MOST_ITERATIONS = 40, @_MOST_CUTS = {cuts}
}};
{words}
#define @_STEP {step} /* [s] */
#define @_ERROR {error} /* [K] */
typedef struct {{ int law, a, b, first, table; }} @_conductor;
typedef struct {{ int law, node, follows, first, table, control, settings, watches, state; }} @_load;
typedef struct {{ int watches, settings, state; }} @_switch;"""
STATE = """
/* State and working memory of a run. */
typedef struct {{
    double T[@_NODES], time, error;
    unsigned char on[@_SWITCHES + 1];
    double all[@_NODES + @_BOUNDARIES], coefficient[{coefficients}], begin[@_NODES];
    double matrix[@_NODES * @_NODES], stage[6][@_NODES], drift[@_NODES], work[@_NODES], mass[@_NODES];
    int pivot[@_NODES];
}} @_model;"""
FUNCTIONS_OF_INPUTS = """
static inline void @_boundaries(const @_inputs *u, double *T) {{
{boundaries}    (void)u; (void)T;
}}

/* Inputs at a share of a step. */
static inline void @_between(const @_inputs *u0, const @_inputs *u1, double share, @_inputs *u) {{
{between}}}

/* All coefficients, from parameters and inputs. [SI] */
static inline void @_coefficients(const @_parameters *p, const @_inputs *u, double *c) {{
{derived}{coefficients}    (void)p; (void)u; (void)c;
}}
"""
SCENARIO = """enum {{ @_BREAKS = {count} }};
{breaks}
/* Value of a table in time; of held values the one before a jump, or the one after. */
static inline double @_course(const double *x, const double *y, int size, int hold, double t, int before) {{
    const double at = before ? t - {moment} : t + {moment};
    int low = 0, high = size - 1;
    if (at <= x[0]) return y[0];
    if (at >= x[size - 1]) return y[size - 1];
    while (high - low > 1) {{
        const int middle = (low + high) / 2;
        if (x[middle] <= at) low = middle; else high = middle;
    }}
    return hold ? y[low] : y[low] + (t - x[low]) / (x[high] - x[low]) * (y[high] - y[low]);
}}

/* Inputs of the scenario of the export at a time, before a jump there or after it. */
static inline void @_scenario(double t, int before, @_inputs *u) {{
{inputs}    (void)t; (void)before;
}}
"""


def to_c(
    model: Model,
    scenario: Scenario,
    path: str | os.PathLike[str] | None = None,
    *,
    name: str = "",
    step: float | None = None,
    error: float = ERROR,
) -> str:
    """Return a model in a scenario as the text of one C99 header.

    No allocation, no iteration but where a thermostat switches or a node has no mass, steps of fixed length by RODAS (E. Hairer, G. Wanner,
    Solving Ordinary Differential Equations II, section IV.7). Parameters and inputs are structs; what follows from parameters is a formula.
    The header states the error of its step, measured over the scenario against a run with an error of 1e-8 K, times two.

    Parameters
    ----------
    model, scenario     As in `simulate`.
    path : path         Where to write it too; the names in it then begin with the file's.
    name : str          What its names begin with; by default the file's name, or the model's title.
    step : float        Length of a step; by default the longest of 1, 2 or 5 times a power of ten within the error. [s]
    error : float       Error that a step which is looked for may have. [K]

    Raises
    ------
    DeckError       When a law cannot be written, there are more than 200 nodes, or the name is none for C.
    ScenarioError   When the scenario does not fit the model.
    """
    target, called = file_and_name(path, name, model.title, "what a C header holds", KEYWORDS, 41)
    if step is not None and not (0.0 < step < math.inf):
        raise DeckError("a step has a length above zero.", model.title, code="value.outside-range")
    w = wired(model, scenario, C)
    if len(w.network.nodes) > MAX_DENSE_NODES:
        raise DeckError(
            f"a C header holds {MAX_DENSE_NODES} nodes, and the model has {len(w.network.nodes)}. Reduce it first by `td.qualify.reduce`.",
            model.title,
            code="output.not-expressible",
        )
    length, stated = (step, stated_error(w, step)) if step is not None else chosen_step(w, error)
    if stated == math.inf:
        raise SolverError(
            f"fixed steps of {length:g} s have no finite answer. Give a shorter one: step = ...", w.network.title, code="run.did-not-finish"
        )
    return exported(w, _Header(w, called, length, stated).text().splitlines(), target, "//")


@dataclass(frozen=True)
class _Field:
    """A member of the struct of inputs: its name, course, unit and meaning."""

    name: str
    signal: Drawn
    unit: str
    what: str


class _Header:
    """Writes one header; ``@`` stands for its name in what it collects."""

    def __init__(self, w: Wired, called: str, step: float, error: float) -> None:
        self.w, self.called, self.step, self.error = w, called, step, error
        self.order = (*w.massive, *w.massless)
        self.places = {n: k for k, n in enumerate((*self.order, *w.network.boundaries))}
        self.inputs = self._inputs()
        fields = identifiers([parameter.path for parameter in w.parameters])
        self.fields = {path: f"{word}_" if word in KEYWORDS else word for path, word in fields.items()}
        self.derived = {parameter.path for parameter in w.parameters if parameter.formula is not None}
        self.courses = dict(zip(w.courses, (f.name for f in self.inputs[-len(w.courses) :] if w.courses), strict=True))
        self.formulas = Text(self._name, power="pow", number=_number, functions={"min": "fmin", "max": "fmax"})
        self.curves: dict[tuple[Curve, ...], int] = {}
        self.tables: list[Curve] = []
        self.coefficients: list[tuple[str, str]] = []

    def _name(self, path: str) -> str:
        """Return the variable of C that holds a parameter: an input, a derived value or a stored one."""
        if path in self.courses:
            return f"u->{self.courses[path]}"
        return f"v_{self.fields[path]}" if path in self.derived else f"p->{self.fields[path]}"

    def _inputs(self) -> list[_Field]:
        """Return the inputs: boundaries, loads, gases, scheduled parameters."""
        w = self.w
        gases = list(dict.fromkeys(row.signal for _, row in w.conductors if row.signal))
        rows = [(f"T_{b}", signal, "K", f"temperature of {b}") for b, signal in w.boundaries.items()]
        for source, word in zip(w.sources, distinct((source.load for source in w.sources), "_"), strict=True):
            kind, unit, what = ("Q", "W", "power") if source.power == 1.0 else ("command", "-", "command")
            rows.append((f"{kind}_{word}", source.signal, unit, f"{what} of the load {source.load}"))
        rows += [(f"gas_{g.replace('*', 'any')}", w.gas[g], "-", f"course of {g}") for g in gases]
        rows += [(f"at_{path}", signal, "SI", f"{path}, which follows a schedule") for path, signal in w.courses.items()]
        names = list(identifiers(word for word, *_ in rows).values())
        first, last = len(w.boundaries), len(w.boundaries) + len(w.sources)
        self.of_boundary, self.of_source, self.of_gas = names[:first], names[first:last], dict(zip(gases, names[last:], strict=False))
        return [_Field(name, signal, unit, what) for name, (_, signal, unit, what) in zip(names, rows, strict=True)]

    # ---- what stands in the file

    def text(self) -> str:
        """Return the header."""
        rows = list(self._rows())  # these collect the coefficients
        library = (Path(__file__).parent / "fixed_step.h").read_text(encoding="ascii")
        plain, _, run = library.partition("#ifndef @_WITHOUT_SCENARIO\n")
        lines = [self._head(), self._structs(), *rows, self._functions(), plain.rstrip()]
        text = "\n".join([*lines, "", "#ifndef @_WITHOUT_SCENARIO", self._scenario(), run.rstrip(), "#endif"])
        return re.sub(r"@(?=_)", self.called, text) + "\n"

    def _head(self) -> str:
        """Return the comment and constants at the head of the file."""
        massless = _comment(", ".join(self.w.massless))
        return HEAD.format(
            called=self.called,
            title=_comment(self.w.network.title),
            scenario=_comment(self.w.scenario.title),
            step=self.step,
            error=self.error,
            cuts=MOST_CUTS,
            massless=f"\n   Without mass, solved in each step: {massless}." if massless else "",
            version=version("thermid"),
            guard=f"THERMID_{self.called.upper()}_H",
        )

    def _structs(self) -> str:
        """Return the types: parameters with their values, inputs, numbers of rows, names of laws."""
        w = self.w
        free = [(self.fields[p.path], p) for p in w.parameters if p.formula is None]
        members = [f"    double {word}; /* [{p.unit}] {_comment(f'{p.path} {p.note}')} */" for word, p in free]
        words = (LAWS.values(), OF_LOADS.values(), OF_CONTROLS.values(), CODES)
        return STRUCTS.format(
            parameters="\n".join(members or ["    char none;"]),
            inputs="\n".join(f"    double {i.name}; /* [{i.unit}] {_comment(i.what)} */" for i in self.inputs),
            defaults="\n".join([f"    p->{word} = {_number(p.value)};" for word, p in free] or ["    p->none = 0;"]),
            nodes="\n".join(
                f"#define @_NODE_{word} {k} /* {_comment(node)} */" for k, (node, word) in enumerate(identifiers(self.order).items())
            ),
            n=len(self.order),
            massless=len(w.massless),
            boundaries=len(w.network.boundaries),
            conductors=len(w.conductors),
            loads=len(w.sources),
            switches=len(self._switches()),
            cuts=MOST_CUTS,
            words="\n".join(f"enum {{ {', '.join(f'@_{word}' for word in several)} }};" for several in words),
            step=_number(self.step),
            error=_number(self.error),
        )

    def _rows(self) -> Iterator[str]:
        """Yield capacities, rows of conductors and loads, and what they look up; their coefficients are collected."""
        w = self.w
        capacity = [self._add(w.capacitances[n], f"C of {n}") if w.capacitances[n] is not None else -1 for n in self.order]
        conductors = []
        for label, row in w.conductors:
            by = f"u->{self.of_gas[row.signal]}" if row.signal else ""
            first = self._add_all([(c, by if k == 0 else "") for k, c in enumerate(row.coefficients)], label)
            a, b = (self.places[end] for end in row.ends)
            conductors.append(f"{{@_{LAWS[form_of(row)]}, {a}, {b}, {first}, {self._table(row.form, row.curve)}}} /* {_comment(label)} */")
        states = self._switches()
        loads, switches = [], {}  # type: list[str], dict[int, str]
        for name, source in zip(self.of_source, w.sources, strict=True):
            first = self._add_all([(source.power, f"u->{name}"), *((c, "") for c in source.rest)], source.load)
            settings = self._add_all([(c, "") for c in source.settings], f"control of {source.load}")
            if source.control == "proportional" and len(source.settings) == 2:
                self._add_all([(source.power, f"u->{name}")], f"full power of {source.load}")
            node, follows = self.places[source.node], self.places[source.sensor or source.node]
            watches = self.places[source.watched] if source.control else 0
            state = states.index(source.load) if source.control == "thermostat" else 0
            table = self._table(source.form, source.curve)
            law, control = OF_LOADS[source.form], OF_CONTROLS[source.control]
            numbers = f"{node}, {follows}, {first}, {table}, @_{control}, {settings}, {watches}, {state}"
            loads.append(f"{{@_{law}, {numbers}}} /* {_comment(source.load)} */")
            if source.control == "thermostat":
                switches.setdefault(state, f"{{{watches}, {settings}, {state}}}")
        yield ""
        yield "/* Places of capacitances among the coefficients, -1 of a node without mass; temperatures at the start. */"
        yield from _array("static const int @_capacity[]", [str(c) for c in capacity])
        start = {**w.initial, **dict.fromkeys(w.massless, sum(w.initial.values()) / max(len(w.initial), 1) or 293.15)}
        yield from _array("static const double @_begin[]", [_number(start[n]) for n in self.order])
        yield from _array("static const @_conductor @_conductor_rows[]", conductors or ["{0, 0, 0, 0, 0}"], 1)
        yield from _array("static const @_load @_load_rows[]", loads or ["{0, 0, 0, 0, 0, 0, 0, 0, 0}"], 1)
        yield from _array("static const @_switch @_switch_rows[]", [switches[k] for k in sorted(switches)] or ["{0, 0, 0}"], 1)
        yield from self._table_arrays()
        yield STATE.format(coefficients=len(self.coefficients))

    def _switches(self) -> list[str]:
        """Return the loads that a thermostat switches."""
        return list(dict.fromkeys(s.load for s in self.w.sources if s.control == "thermostat"))

    def _add(self, formula: object, what: str, by: str = "") -> int:
        """Add a coefficient, a formula times what drives it, and return its place."""
        text = self.formulas.text_of(formula, 2) if by else self.formulas.text_of(formula)  # type: ignore[arg-type]
        self.coefficients.append((f"{text}*{by}" if by and text != "1.0" else by or text, what))
        return len(self.coefficients) - 1

    def _add_all(self, several: Sequence[tuple[object, str]], what: str) -> int:
        """Add several coefficients and return the place of the first."""
        first = len(self.coefficients)
        for formula, by in several:
            self._add(formula, what, by)
        return first

    def _table(self, form: str, curve: Curve | None) -> int:
        """Return the first table of a law, kept for the file."""
        if curve is None:
            return 0
        behind = tables_behind(form, curve)
        if behind not in self.curves:
            self.curves[behind] = len(self.tables)
            self.tables += behind
        return self.curves[behind]

    def _table_arrays(self) -> Iterator[str]:
        """Yield the arrays of C that hold the points, slopes and limits of all tables."""
        arrays = [curve_arrays(curve) for curve in self.tables]
        begin = np.cumsum([0, *(x.size for x, _, _ in arrays)]).tolist()
        limits = [curve.limits or (-math.inf, math.inf) for curve in self.tables]
        places = {"begin": [*begin, *([] if arrays else [0])], "smooth": [int(slopes.size > 0) for _, _, slopes in arrays]}
        numbers = {
            "x": [v for x, _, _ in arrays for v in x.tolist()],
            "y": [v for _, y, _ in arrays for v in y.tolist()],
            "d": [v for x, _, slopes in arrays for v in slopes.tolist() or [0.0] * x.size],
            "low": [max(low, -1e30) for low, _ in limits],
            "high": [min(high, 1e30) for _, high in limits],
        }
        yield from ("", "/* Tables, one behind the other. */")
        for word, whole in places.items():
            yield from _array(f"static const int @_table_{word}[]", [str(k) for k in whole] or ["0"])
        for word, values in numbers.items():
            yield from _array(f"static const double @_table_{word}[]", [_number(v) for v in values] or ["0.0"])

    def _functions(self) -> str:
        """Return the functions of inputs and parameters: temperatures of boundaries, inputs within a step, coefficients."""
        derived = ((self.fields[p.path], p.formula, p.unit) for p in self.w.parameters if p.formula is not None)
        return FUNCTIONS_OF_INPUTS.format(
            boundaries="".join(f"    T[{k}] = u->{name};\n" for k, name in enumerate(self.of_boundary)),
            between="".join(f"    u->{i.name} = u0->{i.name} + share * (u1->{i.name} - u0->{i.name});\n" for i in self.inputs),
            derived="".join(
                f"    const double v_{word} = {self.formulas.text_of(formula)}; /* [{unit}] */\n" for word, formula, unit in derived
            ),
            coefficients="".join(f"    c[{k}] = {text}; /* {_comment(what)} */\n" for k, (text, what) in enumerate(self.coefficients)),
        )

    def _scenario(self) -> str:
        """Return the inputs of the scenario as functions of time."""
        breaks = [t for t in self.w.breaks() if t < self.w.scenario.seconds]
        return SCENARIO.format(
            count=len(breaks),
            breaks="\n".join(_array("static const double @_break[]", [_number(t) for t in breaks] or ["0.0"])),
            moment=_number(1e-9 * self.step),
            inputs="".join(f"    {line}\n" for i in self.inputs for line in _signal(i)),
        )


def _signal(target: _Field) -> Iterator[str]:
    """Yield the statements that set one input."""
    course = target.signal
    if isinstance(course, Sine):
        angle = f"{_number(2.0 * math.pi / course.period)} * t + {_number(course.phase)}"
        yield f"u->{target.name} = {_number(course.mean)} + {_number(course.amplitude)} * sin({angle});"
    elif (value := resting(course)) is not None:
        yield f"u->{target.name} = {_number(value)};"
    elif isinstance(course, TableSignal):
        yield "{"
        yield from (f"    {line}" for line in _array("static const double x[]", [_number(t) for t in course.times.tolist()]))
        yield from (f"    {line}" for line in _array("static const double y[]", [_number(v) for v in course.values.tolist()]))
        yield f"    u->{target.name} = @_course(x, y, {course.times.size}, {int(course.hold)}, t, before);"
        yield "}"


def _array(head: str, items: Iterable[str], wide: int = _ITEMS_A_LINE) -> Iterator[str]:
    """Yield an array over as many lines as it needs."""
    words = list(items)
    if len(words) <= wide:
        yield f"{head} = {{{', '.join(words)}}};"
        return
    yield f"{head} = {{"
    for k in range(0, len(words), wide):
        row = words[k : k + wide]
        if wide == 1:  # the comma stands before a comment
            yield "    " + re.sub(r"( /\*|$)", r",\1", row[0], count=1)
        else:
            yield "    " + ", ".join(row) + ","
    yield "};"


def _number(value: float) -> str:
    """Return a number as a constant of type double."""
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _comment(text: str) -> str:
    """Return an author's words so that they stay in their comment."""
    return one_line(text).replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").strip()


def step_grid(breaks: list[float], end: float, step: float) -> Array:
    """Return the times (steps + 1,) at which fixed steps end, cut at `breaks` [s], where an input jumps or bends, and at `end` [s]. [s]

    From each cut on steps of `step` [s]; the last is what is left. One that would leave less than 1e-6 of a step goes up to the cut.
    """
    times = [0.0]
    for until in (*breaks, end):
        while times[-1] < until - 1e-9 * step:
            times.append(times[-1] + step if (until - times[-1]) > step * (1.0 + 1e-6) else until)
    return np.array(times)


def nice_steps(end: float) -> Iterator[float]:
    """Yield lengths of steps of 1, 2 and 5 times a power of ten, falling, each at most a fiftieth of the run. [s]"""
    power = math.floor(math.log10(end / MIN_STEPS)) + 1
    while True:
        for digit in (5, 2, 1):
            step = float(f"{digit}e{power}")
            if step <= end / MIN_STEPS:
                if end / step > MAX_STEPS:
                    return
                yield step
        power -= 1


def chosen_step(w: Wired, allowed: float) -> tuple[float, float]:
    """Return the longest step [s] whose error is at most `allowed` [K], and that error [K]; the shortest of `nice_steps` where none is."""
    step = error = math.nan
    for step in nice_steps(w.scenario.seconds):
        error = stated_error(w, step)
        if error <= allowed:
            break
    return step, error


def stated_error(w: Wired, step: float) -> float:
    """Return the stated error of fixed steps: twice the largest difference of all states with mass to a run at 1e-9, in two digits. [K]

    Infinite where the header would return a code other than zero: a step without a finite answer, or a thermostat that switches more than
    `MOST_CUTS` times within one.
    """
    grid = step_grid(w.breaks(), w.scenario.seconds, step)
    with np.errstate(all="ignore"):
        temperatures = _Stepper(w, grid).temperatures()
    engine = Engine(Wiring(w.network, w.scenario))
    start = engine.started(engine.wiring.assemble(gradients=False))
    tight = engine.integrate(start, grid, w.massive, float(grid[-1]), Options(error=TIGHT, inputs=1e-7)).temperatures
    error = max(ERROR_MARGIN * float(np.abs(temperatures - tight).max()), 1e-6)
    if not math.isfinite(error):
        return math.inf
    # rounded up to two digits
    unit = 10.0 ** (math.floor(math.log10(error)) - 1)
    return float(f"{math.ceil(error / unit - 1e-9) * unit:.6g}")


class _Stepper:
    """The steps of `fixed_step.h` over the kernel's heat and Jacobian, along a grid of times (steps + 1,) [s].

    With C the capacitances and J the Jacobian, a step of length h solves for six stages k_i,
    (C / (gamma h) - J) k_i = f(T + sum a_ij k_j) + C sum c_ij k_j / h + d_i h df/dt, and ends at T + sum a_6j k_j + k_6:
    `STAGES`, `COUPLED`, `DRIFT`, `GAMMA`.
    """

    def __init__(self, w: Wired, grid: Array) -> None:
        wiring = Wiring(w.network, w.scenario)
        for name, course in wiring.signals.items():
            if isinstance(course, Sine):  # a step joins its inputs by a straight line
                wiring.signals[name] = TableSignal(grid, course.at(grid), after="hold")
        self.engine, self.grid = Engine(wiring), grid
        self.a = self.engine.started(wiring.assemble(gradients=False))
        self.massive = [self.engine.nodes.index(n) for n in w.massive]
        layout = wiring.structure
        self.mass = np.array([0.0 if place < 0 else float(self.a.coefficients[place]) for place in layout.capacity])
        self.massless = self.mass == 0.0
        self.controls = [p for p in layout.controls if p.kind == "thermostat"]
        self.places = [k for k, p in enumerate(layout.controls) if p.kind == "thermostat"]
        self.on = np.full(len(layout.controls), 0, dtype=np.int32)
        self.boundaries = {len(self.engine.nodes) + k: b for k, b in enumerate(w.network.boundaries)}

    def temperatures(self) -> Array:
        """Return temperatures (times, nodes with mass) [K], not a number from the first step on that has no finite answer."""
        state = self.a.initial.copy()
        for k, control in zip(self.places, self.controls, strict=True):
            self.on[k] = self._sensor(control, state, 0.0) <= self.a.coefficients[control.places[0]]
        out = [state[self.massive]]
        for begin, end in zip(self.grid[:-1], self.grid[1:], strict=True):
            state = self._advance(state, float(begin), float(end))
            out.append(state[self.massive])
        return np.array(out)

    def _balance(self, state: Array, time: float) -> tuple[Array, Array]:
        """Return the net heat into every node [W] and its derivative by the temperatures [W/K] at a time [s]."""
        heat, jacobian, _ = self.engine.rhs(self.a, state, time, False, self.on)
        return heat, jacobian

    def _settled(self, state: Array, time: float) -> Array:
        """Return temperatures (nodes,) [K] with nodes without mass in balance at a time [s], by Newton's method to 1e-10 K."""
        if not self.massless.any():
            return state
        for _ in range(40):
            heat, jacobian = self._balance(state, time)
            moved = np.linalg.solve(jacobian[np.ix_(self.massless, self.massless)], heat[self.massless])
            state = state.copy()
            state[self.massless] -= moved
            if np.abs(moved).max() < 1e-10:
                break
        return state

    def _advance(self, state: Array, begin: float, end: float) -> Array:
        """Return temperatures (nodes,) [K] at `end` [s] of a step from `begin` [s], cut where a thermostat's gap [K] passes zero.

        The time of a cut is found by regula falsi in the Illinois form, where the value of an end that stays is halved, to 1e-10 K. Not a
        number where `MOST_CUTS` cuts do not reach the end, for which `fixed_step.h` returns CHATTER.
        """
        last = end - 1e-9 * (end - begin)  # a held input has its value of before a jump at the end of a step
        state = self._switched(state, begin, 0.0)
        for _ in range(MOST_CUTS + 1):
            after = self._step(state, begin, end, last)
            if not self.controls or not self._due(after, last) >= 0.0:  # of what is not a number, too
                return after
            low, high, at_low, at_high, side = 0.0, 1.0, self._due(state, begin), self._due(after, last), 0
            for _ in range(40):
                if abs(at_high) <= 1e-10 or at_low >= 0.0:
                    break
                middle = high - at_high * (high - low) / (at_high - at_low)
                middle = middle if low < middle < high else 0.5 * (low + high)
                there = begin + middle * (end - begin)
                gap = self._due(self._step(state, begin, there, min(there, last)), there)
                if gap >= 0.0:
                    high, at_high, at_low, side = middle, gap, at_low * (0.5 if side == 1 else 1.0), 1
                else:
                    low, at_low, at_high, side = middle, gap, at_high * (0.5 if side == -1 else 1.0), -1
            there = begin + high * (end - begin)
            state = self._switched(self._step(state, begin, there, min(there, last)), min(there, last), SWITCHING_TOLERANCE)
            begin = there
            if end - begin < 1e-12 * self.grid[-1]:
                return state
        return np.full(state.size, np.nan)

    def _step(self, state: Array, begin: float, end: float, last: float) -> Array:
        """Return temperatures (nodes,) [K] after one step from `state` (nodes,) at `begin` to `end` [s], h long, by a Rosenbrock method.

        (C / (g h) - J) k_s = q(T + sum a_sj k_j, t + c_s h) + C sum c_sj k_j / h + d_s h dq/dt for the six stages, J the Jacobian of the
        heat q at the beginning, with the coefficients of `fixed_step.h`; T of the last stage + k_6 is the result. Inputs are those of
        `last` [s] at the latest.
        """
        h = end - begin
        state = self._settled(state, begin)
        early, late = (self._balance(state, begin + s * h)[0] for s in (0.0, DRIFT_INTERVAL))
        drift = (late - early) / (DRIFT_INTERVAL * h)
        heat, jacobian = self._balance(state, begin)
        matrix = np.diag(self.mass / (GAMMA * h)) - jacobian
        k: list[Array] = []
        at = state
        for s in range(6):
            if s:
                at = state + sum(a * x for a, x in zip(STAGES[s], k, strict=True))
                heat = self._balance(at, min(begin + TIMES[s] * h, last))[0]
            coupled = sum((c * x for c, x in zip(COUPLED[s], k, strict=True)), np.zeros(state.size))
            k.append(np.asarray(np.linalg.solve(matrix, heat + self.mass * coupled / h + DRIFT[s] * h * drift), dtype=float))
        return np.asarray(at + k[5])

    def _sensor(self, control: object, state: Array, time: float) -> float:
        """Return the temperature that a control reads, a node's or a boundary's. [K]"""
        place = control.sensor  # type: ignore[attr-defined]
        if place < state.size:
            return float(state[place])
        return float(self.engine.wiring.boundary(self.boundaries[place], np.array([time]), self.a.offsets)[0])

    def _gaps(self, state: Array, time: float) -> list[float]:
        """Return by how much each thermostat is beyond the threshold at which it switches; below zero where it is not there yet. [K]"""
        out = []
        for k, control in zip(self.places, self.controls, strict=True):
            reading = self._sensor(control, state, time)
            low, high = (float(self.a.coefficients[p]) for p in control.places[:2])
            out.append(reading - high if self.on[k] else low - reading)
        return out

    def _due(self, state: Array, time: float) -> float:
        """Return how far the nearest thermostat is past its switching temperature; above zero it switches. [K]"""
        return max(self._gaps(state, time), default=-1e9)

    def _switched(self, state: Array, time: float, near: float) -> Array:
        """Return temperatures (nodes,) [K] in balance, once every thermostat within `near` [K] of its switching temperature is switched.

        Not a number where two switches or more of each do not end it, for which `fixed_step.h` returns CHATTER.
        """
        for _ in range(2 * len(self.controls) + 3):
            state = self._settled(state, time)
            due = next((k for k, gap in zip(self.places, self._gaps(state, time), strict=True) if gap >= -near), None)
            if due is None:
                return state
            self.on[due] = 1 - self.on[due]
            near = 0.0
        return np.full(state.size, np.nan)
