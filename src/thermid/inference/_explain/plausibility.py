"""`plausibility`: are the values of a fit physical? Coefficients against correlations, contacts, capacitances and losses against ranges."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from thermid.base.errors import CodedText, IdentificationError
from thermid.base.results import Named
from thermid.base.units import short, value_of
from thermid.fit.calibration import Calibration
from thermid.inference._explain.thresholds import (
    BARE_CONTACT,
    CORRELATION,
    EMISSIVITY,
    MAX_SLOW_FAN_HTC,
    SPECIFIC_HEAT,
    UNDETERMINED,
)
from thermid.model.tree import FlatConductor, literal
from thermid.physics.air import dry_air
from thermid.physics.materials import Material
from thermid.physics.plates import body_htc, conduction_floor
from thermid.physics.radiation import linearised_htc
from thermid.simulation.runs import Network, simulate
from thermid.values.store import FittedValue

CONTACTS = "Incropera, 6th ed., Tables 3.1 and 3.2; Yovanovich, IEEE Trans. CPT 28 (2005) 182"


@dataclass(frozen=True)
class RangeCheck:
    """One fitted value against what is physical.

    Parameters
    ----------
    path : str              The parameter.
    value, error : float    [SI]
    low, high : float       What is physical. [SI]
    what : str              What the range is of.
    source : str            Where it is from.
    meaning : str           What a value outside it can mean.
    """

    path: str
    value: float
    error: float
    low: float
    high: float
    what: str
    source: str
    meaning: str

    @property
    def verdict(self) -> str:
        """'possible', 'doubtful' (outside, within two standard errors) or 'not physical'."""
        if self.low <= self.value <= self.high:
            return "possible"
        reach = self.value + 2.0 * self.error >= self.low if self.value < self.low else self.value - 2.0 * self.error <= self.high
        return "doubtful" if reach else "not physical"

    def to_dict(self) -> dict[str, Any]:
        """Return its figures, in SI."""
        keys = ("path", "value", "error", "low", "high", "verdict", "what", "source")
        return {**{k: getattr(self, k) for k in keys}, "meaning": self.meaning if self.verdict != "possible" else ""}

    def __str__(self) -> str:
        """The finding in words."""
        text = f"{self.path} = {self.value:.4g} +- {self.error:.2g}: {self.verdict}; {self.what} is {self.low:.3g} to {self.high:.3g}"
        return f"{text} ({self.source})" + (f". {self.meaning}" if self.verdict != "possible" else "")


@dataclass(frozen=True, eq=False)
class Plausibility(Named[RangeCheck]):
    """What is physical of a fit.

    Parameters
    ----------
    title : str                     The fit.
    findings : tuple of RangeCheck     One per value that a range is held for.
    unjudged : tuple of str         Fitted parameters without a range.
    undecided : tuple of str        Values whose own error is so wide that no range can reject them, in words.
    """

    title: str
    findings: tuple[RangeCheck, ...]
    unjudged: tuple[str, ...]
    undecided: tuple[str, ...] = ()

    _refusal = "no finding for '{}'."

    def _entries(self) -> Mapping[str, RangeCheck]:
        """Return parameter -> the finding on it."""
        return {f.path: f for f in self.findings}

    @property
    def physical(self) -> bool:
        """Whether no value is outside what is physical beyond doubt."""
        return all(f.verdict != "not physical" for f in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """Return the findings, in SI."""
        findings = [f.to_dict() for f in self.findings]
        return {"stage": self.title, "physical": self.physical, "findings": findings, "unjudged": list(self.unjudged)}

    def __str__(self) -> str:
        """Return the findings as text, the worst first."""
        order = ("not physical", "doubtful", "possible")
        lines = [f"{self.title}: are the values physical?"]
        lines += [f"  {f}" for f in sorted(self.findings, key=lambda f: order.index(f.verdict))]
        if self.unjudged:
            lines.append(f"  no physical range is known for {', '.join(self.unjudged)}")
        lines += [f"  {words}" for words in self.undecided]
        return "\n".join(lines)


def plausibility(fit: Calibration, *, weights: Mapping[str, str] | None = None) -> Plausibility:
    """Physical plausibility of fitted values: correlations for coefficients, ranges for contacts and capacitances.

    Parameters
    ----------
    fit : Calibration   The fit.
    weights : dict      Node -> weight of its part, as text: its capacitance must be that of some material.

    Raises
    ------
    IdentificationError   When the fit has no records any more.
    """
    if not fit.experiments:
        raise IdentificationError(
            "this calibration has no records, because it was read from a file. Repeat the fit.", fit.stage, code="fit.needs-session"
        )
    network = fit.experiments[0].network
    fitted = fit.values.parameters
    owners = {p: v for v in fitted.values() for p in (v.path, *v.also)}
    findings = {f.path: f for f in _conductors(fit, network, owners)}
    findings |= {f.path: f for f in _ranged(network, owners)}
    findings |= {f.path: f for f in _weights(fit, network, owners, weights or {})}
    ordered = tuple(findings[p] for p in (*fitted, *(p for p in findings if p not in fitted)) if p in findings)
    open_ = []
    for v in (v for v in fitted.values() if v.error > UNDETERMINED * abs(v.value)):
        error = v.error * v.in_unit / v.value if v.value else v.error
        open_.append(
            f"{v.path} = {short(v.in_unit)} +- {short(error)} {v.unit}: not determined, because its 95 % interval includes zero. Fix it, "
            "give it a prior, or plan a better test with td.design.next_test."
        )
    return Plausibility(fit.stage, ordered, tuple(p for p in fitted if p not in findings), tuple(open_))


def _fitted_behind(network: Network, path: str, owners: Mapping[str, FittedValue]) -> FittedValue | None:
    """Return the fitted value that a field equals; None where the field is not fitted or is calculated from other values."""
    root = network.flat.parameters.literal_behind(path)
    return owners.get(root) if root else None


def _conductors(fit: Calibration, network: Network, owners: Mapping[str, FittedValue]) -> Iterator[RangeCheck]:
    """Yield findings on coefficients of surfaces and joints."""
    surfaces = [c for c in network.flat.conductors if c.kind in ("effective", "convection") and "area" in c.fields]
    temperatures = _from_records(fit, surfaces)
    for c in surfaces:
        field = "effective_htc" if c.kind == "effective" else "htc"
        v = _fitted_behind(network, c.fields[field], owners) if field in c.fields else None
        if v is not None:
            yield _coefficient(fit, network, c, v, temperatures[c.path])
    for c in network.flat.conductors:
        v = _fitted_behind(network, c.fields["contact_conductance"], owners) if "contact_conductance" in c.fields else None
        if v is not None:
            gap = 0.026 / v.value
            less = f"A gap of air of {1e3 * gap:.2g} mm conducts as much. The faces hardly touch, or the contact area is smaller"
            more = "No bare joint conducts as well. Solder or foil reaches 1e6, or heat has a second path beside the joint"
            yield RangeCheck(
                v.path, v.value, v.error, *BARE_CONTACT, "contact of metal on metal", CONTACTS, less if v.value < BARE_CONTACT[0] else more
            )


def _coefficient(fit: Calibration, network: Network, c: FlatConductor, v: FittedValue, at: tuple[float, float]) -> RangeCheck:
    """Return the check of a coefficient h against still air [W/(m^2 K)], `at` the temperatures of surface and gas [K].

    Low: max(conduction, h_c / `CORRELATION`) plus radiation at the lowest emissivity; high: h_c `CORRELATION` plus that at the highest, h_c
    by the correlation for a body of this area. Radiation counts for effective coefficients alone.
    """
    values = fit.values
    area = float(value_of(network.numbers({p: x.value for p, x in values.assignments.items()}).values[c.fields["area"]]))
    hot, cold = at
    if not abs(hot - cold) > 0.2:
        hot = cold + 0.2
    air = dry_air(0.5 * (hot + cold))
    still = float(body_htc(max(hot, cold), min(hot, cold), area, air))
    floor = float(conduction_floor(area, air.conductivity))
    shine = [float(linearised_htc(e, hot, cold)) if c.kind == "effective" else 0.0 for e in EMISSIVITY]
    low, high = max(floor, still / CORRELATION) + shine[0], still * CORRELATION + shine[1]
    what = f"still air over {1e4 * area:.3g} cm^2 {hot - cold:+.3g} K from it" + (", with radiation" if c.kind == "effective" else "")
    if v.value < low:
        meaning = CodedText(
            "Too low: the area includes faces that do not convect (inside, or counted twice), the power is too small, or the air is "
            "confined",
            "fit.below-still-air",
        )
    elif v.value <= MAX_SLOW_FAN_HTC + shine[1]:
        meaning = CodedText(
            "Too high for still air: the air moves, heat leaves by a mount or a lead, the area is too small, or the power too large",
            "fit.above-still-air",
        )
    else:
        meaning = CodedText(
            "Higher than with slow fans: heat leaves by a mount or a lead, the area is too small, or the power too large",
            "fit.above-slow-fans",
        )
    return RangeCheck(v.path, v.value, v.error, low, high, what, "Lee, Yovanovich, Jafarpur 1991; emissivity 0.02 to 0.98", meaning)


def _ranged(network: Network, owners: Mapping[str, FittedValue]) -> Iterator[RangeCheck]:
    """Yield checks of fitted fields whose range does not depend on the element: emissivity, exchange factor, material properties."""
    best = Material.table()["copper"].conductivity
    ranges = {
        "emissivity": (
            *EMISSIVITY,
            "an emissivity",
            "Incropera, 6th ed., Tables A.11 and A.12",
            "The area, or another heat path, is wrong",
        ),
        "exchange_factor": (0.0, 1.0, "an exchange factor", "its definition", "The area, or another heat path, is wrong"),
        "specific_heat": (
            *SPECIFIC_HEAT,
            "a specific heat of solids",
            "table of materials",
            "The mass is wrong, or a second mass follows it",
        ),
        "conductivity": (
            0.02,
            best * 1.1,
            "a conductivity",
            "table of materials",
            "The length or the area of the path is wrong",
        ),
        "temperature_coefficient": (
            -0.02,
            0.02,
            "growth of a loss with temperature",
            "copper 0.0039 1/K",
            "Something else grows with temperature",
        ),
    }
    flat = network.flat
    tables = [*(c.fields for c in flat.conductors), *(n.fields for n in flat.nodes), *(x.fields for x in flat.loads)]
    for fields in tables:
        for name, path in fields.items():
            v = _fitted_behind(network, path, owners) if name in ranges else None
            if v is not None:
                low, high, what, source, meaning = ranges[name]
                yield RangeCheck(v.path, v.value, v.error, low, high, what, source, meaning)


def _weights(fit: Calibration, network: Network, owners: Mapping[str, FittedValue], weights: Mapping[str, str]) -> Iterator[RangeCheck]:
    """Yield checks of capacitances: mass times the lowest and the highest specific heat of solids; `weights` is node -> mass as text."""
    numbers = network.numbers({p: v.value for p, v in fit.values.assignments.items()})
    for raw, text in weights.items():
        node = network.find(raw, "weights")
        weight, capacity = literal(text, "kg", f"weights.{raw}"), value_of(numbers.capacitances.get(node) or 0.0)
        element = next(n for n in network.flat.nodes if n.path == node)
        held = [
            v
            for name in ("mass", "capacitance")
            if name in element.fields
            for v in [_fitted_behind(network, element.fields[name], owners)]
            if v
        ]
        for v in held:
            scale = v.value / capacity if capacity else np.nan
            code, cause = (
                ("fit.more-than-its-weight", "a mass that was not weighed follows it, or the power is too large")
                if capacity / weight > SPECIFIC_HEAT[1]
                else ("fit.less-than-its-weight", "part of the mass follows more slowly, or the power is too small")
            )
            meaning = CodedText(f"It needs {capacity / weight:.4g} J/(kg K) of {weight:.3g} kg: {cause}", code)
            low, high = SPECIFIC_HEAT[0] * weight * scale, SPECIFIC_HEAT[1] * weight * scale
            yield RangeCheck(v.path, v.value, v.error, low, high, f"{weight:.3g} kg of metal to plastics", "table of materials", meaning)


def _from_records(of: Calibration, surfaces: Sequence[FlatConductor]) -> dict[str, tuple[float, float]]:
    """Return surface -> mean temperatures of surface and gas over the records with gas, weighted by (T_s - T_g)^2; NaN without any. [K]"""
    sums = {c.path: np.zeros(3) for c in surfaces}
    for e in of.experiments:
        solution = simulate(of.model, e.bare, times=e.times)
        media = e.scenario.media()
        for c in surfaces:
            if media.empty(c.gas):
                continue
            hot, cold = (solution[end].kelvin for end in c.ends)
            weight = (hot - cold) ** 2
            sums[c.path] += np.array([weight.sum(), weight @ hot, weight @ cold])
    return {p: (float(s[1] / s[0]), float(s[2] / s[0])) if s[0] > 0 else (math.nan, math.nan) for p, s in sums.items()}
