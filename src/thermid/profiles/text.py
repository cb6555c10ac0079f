"""A profile as a table for people, and as TOML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thermid.errors import ThermidError
from thermid.physics.constants import ICE_POINT
from thermid.sourced.number import Number

if TYPE_CHECKING:
    from thermid.profiles.profile import ThermalProfile
    from thermid.profiles.steps import Step

__all__ = ["as_text", "as_toml"]

SHOWN = 16
"""Steps that a table shows before it stops."""


def as_text(profile: ThermalProfile) -> str:
    """Return a profile as a table: numbers with clause and mark, then the steps of the first cycle, then what there is to remark."""
    head = [profile.title, f"  {profile.kind}, {profile.standard} {profile.edition}, {profile.clause}".rstrip(" ,")]
    head += [f"  {profile.note}"] if profile.note else []
    numbers = _numbers(profile)
    width = max(len(k) for k in numbers)
    wide = max(len(n.text) for n in numbers.values())
    rows = [
        f"  {k:<{width}}  {n.text:<{wide}}  {n.mark:<9}  {n.clause}{'; ' if n.clause and n.note else ''}{n.note}".rstrip()
        for k, n in numbers.items()
    ]
    lines = [*head, *rows]
    try:
        steps = profile.steps
        lines += ["  steps:", *(f"    {_step(s)}" for s in steps[:SHOWN])]
        lines += [f"    ... {len(steps) - SHOWN} more"] if len(steps) > SHOWN else []
        lines += [f"  remark: {r}" for r in profile.check()]
    except ThermidError as error:
        lines += [f"  steps: {error.message}"]
    return "\n".join([*lines, f"  trust: {profile.trust}"])


def _numbers(profile: ThermalProfile) -> Mapping[str, Number]:
    """Return the numbers to show; hot and cold worked out where that is possible."""
    try:
        return profile.used
    except ThermidError:
        return profile.numbers


def _step(step: Step) -> str:
    """Return a step in words."""
    parts = []
    if step.target is not None:
        how = f" in {step.over / 60.0:.4g} min" if step.over is not None else f" at {60.0 * (step.ramp or 0.0):.3g} K/min"
        parts.append(f"to {step.target - ICE_POINT:.4g} degC{how}")
    if step.pressure is not None:
        parts.append(f"to {step.pressure:.4g} Pa in {(step.over or 0.0) / 60.0:.4g} min")
    if step.humidity is not None:
        parts.append(
            f"to {100.0 * step.humidity:.3g} % humidity" + (f" in {step.over / 60.0:.4g} min" if step.target is None and step.over else "")
        )
    parts += ["until stable"] if step.wait else []
    parts += [f"stay {step.dwell / 3600.0:.4g} h"] if step.dwell else []
    cycle = f"{step.cycle:2d}" if step.cycle else "  "
    power = {None: "", True: "  on", False: "  off"}[step.power]
    return f"{cycle} {step.name}: {', '.join(parts) or 'at once'}{power}"


def as_toml(profile: ThermalProfile) -> str:
    """Return a profile as a file, every number with its mark."""
    words = ("title", "kind", "standard", "edition", "clause", "level", "note")
    lines = ["[profile]", *(f"{w} = {_quoted(getattr(profile, w))}" for w in words if getattr(profile, w))]
    if profile.plan:
        lines.append(f"mark = {_quoted(profile.step_mark)}")
    if profile.predicted is not None:
        low, high = (f"{round(v - ICE_POINT, 9):.9g} [degC]" for v in profile.predicted)
        lines.append(f"predicted = [{_quoted(low)}, {_quoted(high)}]")
    if profile.plan:
        lines += ["steps = [", *(f"  {_table(row)}," for row in profile.plan), "]"]
    lines += ["", "[profile.numbers]"]
    for name, n in profile.numbers.items():
        fields: dict[str, Any] = {"value": n.value if n.slot == "1" else n.text, "mark": n.mark}
        fields |= {k: v for k, v in (("clause", n.clause), ("note", n.note)) if v}
        lines.append(f"{name} = {_table(fields)}")
    return "\n".join([*lines, ""])


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _table(row: Mapping[str, Any]) -> str:
    def one(value: Any) -> str:
        return _quoted(value) if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else f"{value:g}"

    return "{ " + ", ".join(f"{k} = {one(v)}" for k, v in row.items()) + " }"
