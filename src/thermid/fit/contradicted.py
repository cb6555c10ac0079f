"""What a fit could meet its readings by only against what was stated: sensors, meters and priors that would have to be grossly wrong."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thermid.measure.amounts import short
from thermid.model.tree.resolve import parameter_table
from thermid.units import unit

if TYPE_CHECKING:
    from thermid.knowledge.values import FittedValue, FittedValues
    from thermid.model.tree.model import Model

LOUD = "NOT CREDIBLE: "
BLAME = "A column, a unit, a node or the accuracy is wrong, or the model is. Do not use these values."
"""What to look for where a fit contradicts what was stated."""

FIRST = "check: "
"""Begins what stands in the first lines of a fit: a question that its user can answer and the fit cannot."""
TIMES = 5.0
"""Factor from the deck's value from which a fitted value with a source is questioned. [-]"""
UNSOURCED = tuple(unit(u).dimension for u in ("kg", "J/K", "J/(kg K)"))
"""Quantities that are questioned also where the deck gives no source: nobody is wrong about a mass by so much."""

FAR = 10.0
"""Standard deviations from what was stated beyond which a fit is not believed; chance and a careless accuracy do not reach so far. [-]"""


def contradicted(values: FittedValues) -> dict[str, str]:
    """Return name -> what would have to be wrong, of fitted values that lie more than ten deviations from what was stated of them."""
    far = {name: _deviations(v) for name, v in values.items()}
    return {name: _words(values[name], d) for name, d in sorted(far.items(), key=lambda item: -item[1]) if d > FAR}


def loudly(values: FittedValues) -> tuple[str, ...]:
    """Return the one sentence that says so at the head of a fit; nothing where nothing is contradicted."""
    far = contradicted(values)
    return (f"{LOUD}{'; '.join(far.values())}. {BLAME}",) if far else ()


def far_from_sheet(model: Model, values: FittedValues) -> tuple[str, ...]:
    """Return a question about each fitted value that is five times the deck's, or a fifth of it.

    Asked of values whose source is a data sheet, a publication, a measurement or a derivation, and of masses and heat capacities unless
    they are assumed.
    """
    table, out = parameter_table(model), []
    for path, v in values.parameters.items():
        if path not in table or not (v.log and v.start > 0.0 and v.value > 0.0):
            continue
        ratio, source = v.value / v.start, table[path].parameter.source
        asked = source != "assumed" if source else unit(v.unit).dimension in UNSOURCED
        if asked and not 1.0 / TIMES < ratio < TIMES:
            of = f"{short(v.converted(v.start), 3)} {v.unit} ({source})" if source else f"{short(v.converted(v.start), 3)} {v.unit}"
            times = f"{short(ratio, 3)} times" if ratio > 1.0 else f"{short(1.0 / ratio, 3)} times less than"
            out.append(
                f"{FIRST}{path} is {short(v.in_unit, 3)} {v.unit}, {times} the deck's {of}. A unit of time, power or temperature in the "
                "log, or the deck's value, may be wrong."
            )
    return tuple(out)


def _deviations(v: FittedValue) -> float:
    """Return how many standard deviations a value lies from its prior; zero where it has none. [-]"""
    if v.prior is None or (v.log and not v.value > 0.0):
        return 0.0
    mean, sd = v.prior
    return abs((math.log(v.value) if v.log else v.value) - mean) / sd


def _words(v: FittedValue, deviations: float) -> str:
    times = short(deviations)
    if v.kind == "sensor" or (v.kind == "shared" and v.unit == "K"):
        sd = v.prior[1] if v.prior is not None else 0.0
        name = v.path.removeprefix("sensor ").removesuffix(" error")
        return f"{name} would have to be wrong by {v.value:+.3g} K, {times} times its accuracy of {short(sd)} K"
    if v.kind == "shared":
        sd = v.prior[1] if v.prior is not None else 0.0
        error = f"{100 * (v.value - 1):+.3g} %, {times} times its accuracy of {short(100 * sd)} %"
        return f"{v.path.removesuffix(' error')} would have to be wrong by {error}"
    if v.kind == "instrument":
        return f"{v.path} would have to be {short(v.in_unit, 3)} {v.unit}, {times} deviations from what is stated"
    return f"{v.path} would have to be {short(v.in_unit, 3)} {v.unit}, {times} deviations from its prior"
