"""A part is replaced: what that touches, which stages and tests are due again, and what every sensor is predicted to show."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from thermid.errors import DeckError, IdentificationError, SolverError
from thermid.identify.calibration import Calibration
from thermid.identify.sharing import Level, places_of
from thermid.identify.touching import touching
from thermid.model.areas import ledger
from thermid.model.model import Model
from thermid.model.modelfile import load_model
from thermid.model.resolve import ParameterSet
from thermid.model.signal import Table
from thermid.simulation.scenario import Scenario

if TYPE_CHECKING:
    from thermid.identify.campaignfile import CampaignSource
    from thermid.identify.stages import Campaign

__all__ = ["RetunePlan", "StagePlan", "Touch", "plan_retune"]

FELT = 0.05
"""A value is worth retuning when a change of 10 % moves some sensor by this much. [K]"""
ICE = 273.15


@dataclass(frozen=True)
class Touch:
    """A value at the interface of the new part.

    Parameters
    ----------
    stage, path : str       The stage that fits it, and its path there.
    through : tuple         Elements or settings by which it acts on the part.
    kelvin : float          How far it moves the most sensitive sensor for a change of 10 %, at rest. [K]
    held : str              Why it is not freed; empty where it is.
    """

    stage: str
    path: str
    through: tuple[str, ...]
    kelvin: float
    held: str = ""


@dataclass(frozen=True, eq=False)
class StagePlan:
    """What becomes of one stage.

    Parameters
    ----------
    name : str          The stage; a new one where one instance of several gets the new part.
    of : str            The stage of the campaign that it follows.
    action : str        'kept': nothing that it depends on changed; 'run': fitted again; 'carried': its model changes, its values hold.
    why : str           In words.
    free : tuple        What is fitted.
    records : tuple     Tests to repeat.
    identity : tuple    Hash of its model before and after.
    model : Model       Its model after the swap.
    part : str          Where the part stands in it; empty where it is the part itself, or does not hold it.
    alone : bool        Whether it is the part alone.
    """

    name: str
    of: str
    action: str
    why: str
    free: tuple[str, ...]
    records: tuple[str, ...]
    identity: tuple[str, str]
    model: Model = field(repr=False)
    part: str = ""
    alone: bool = False


@dataclass(frozen=True, eq=False)
class RetunePlan:
    """What replacing a part costs, before any test.

    Parameters
    ----------
    part : str              Its path in the uppermost model.
    old, new : str          Titles of the old and the new part.
    stages : tuple          StagePlan of every stage.
    touched : tuple         Touch of every value of the campaign at the part's interfaces.
    neighbours : dict       Surface beside the part -> exposed area before and after [m^2], and change at rest [K]; none is freed.
    before, after : dict    Sensor -> temperature at rest, each part with the powers of its own deck, all else as in the last record. [K]
    watts : (float, float)  Power of the part by its deck, old and new. [W]
    campaign : Campaign     What was done before.
    model : Model           The new part.
    """

    part: str
    old: str
    new: str
    stages: tuple[StagePlan, ...]
    touched: tuple[Touch, ...]
    neighbours: Mapping[str, tuple[float, float, float]]
    before: Mapping[str, float]
    after: Mapping[str, float]
    watts: tuple[float, float]
    campaign: Campaign = field(repr=False)
    model: Model = field(repr=False)

    @property
    def freed(self) -> tuple[str, ...]:
        """Interface values that are retuned, ``stage: path``."""
        return tuple(f"{t.stage}: {t.path}" for t in self.touched if not t.held)

    @property
    def tests(self) -> tuple[str, ...]:
        """Records that must be taken again."""
        return tuple(dict.fromkeys(r for s in self.stages if s.action == "run" for r in s.records))

    @property
    def kept_tests(self) -> tuple[str, ...]:
        """Records that still hold."""
        known = (r.name for request in self.campaign.requests.values() for r in request.records)
        return tuple(dict.fromkeys(r for r in known if r not in self.tests))

    def run(self, data: str | os.PathLike[str] | CampaignSource, *, everything: bool = False, notice: Any = None) -> Campaign:
        """Return the campaign after the retune: the stages that are due are fitted to the repeated tests, all others are as they were.

        Parameters
        ----------
        data : path         Folder with the logs of the repeated tests, named as in the campaign; or the campaign as read with it.
        everything : bool   Fit every stage anew with all that it frees, which needs all tests: what a retune is measured against.
        notice : callable   As in `run_stages`.

        Raises
        ------
        ThermidError   From reading or fitting.
        """
        from thermid.identify.retune import retuned

        return retuned(self, data, notice, everything)

    def __str__(self) -> str:
        """Return the plan as text."""
        total = len(self.tests) + len(self.kept_tests)
        lines = [f"{self.part}: {self.old} -> {self.new}"]
        lines.append(f"  retuned: {len(self.freed)} interface values, {', '.join(self.freed) or 'none'}")
        for t in self.touched:
            what = "freed" if not t.held else f"held: {t.held}"
            lines.append(f"    {t.stage}: {t.path}  {t.kelvin:.2f} K for 10 %, through {', '.join(t.through)}; {what}")
        lines.append("  stages:")
        for s in self.stages:
            changed = "" if s.identity[0] == s.identity[1] else f" ({s.identity[0][:8]} -> {s.identity[1][:8]})"
            lines.append(f"    {s.name}: {s.action}{changed}, {s.why}")
        lines.append(f"  tests to repeat: {len(self.tests)} of {total}: {', '.join(self.tests)}")
        lines.append("  neighbours, exposed area before -> after; what they convect with is not freed:")
        for name, (a, b, dt) in self.neighbours.items():
            lines.append(f"    {name}: {1e4 * a:.4g} -> {1e4 * b:.4g} cm^2, {dt:+.2f} K at rest")
        old, new = self.watts
        powers = f"{old:.4g} W before and {new:.4g} W after" if abs(old - new) > 1e-9 else f"{old:.4g} W both times"
        lines.append(f"  at rest before -> after; the part has the power of its deck, {powers}, all else is as in the last record:")
        lines += [f"    {s}: {self.before[s] - ICE:.2f} -> {t - ICE:.2f} degC" for s, t in self.after.items()]
        return "\n".join(lines)


def plan_retune(campaign: Campaign, part: str, new: Model | str | os.PathLike[str]) -> RetunePlan:
    """Return what replacing a part costs: values that it touches, stages and tests that are due, predictions before and after.

    Parameters
    ----------
    campaign : Campaign     As `run_stages` returned it.
    part : str              Path of the part in the model of the last stage.
    new : Model or path     The new part, or its deck.

    Raises
    ------
    ThermidError   When there is no such part, the new one does not fit its place, or the campaign was made in Python.
    """
    source = campaign.source
    if source is None:
        raise DeckError("a plan needs the campaign's file; this campaign was made in Python. Call run_stages on a file.", campaign.title)
    model = new if isinstance(new, Model) else load_model(new)
    levels = [Level(name, request) for name, request in campaign.requests.items()]
    top = levels[-1].name
    above = campaign[top].fitted_model
    part = above.canonical(part)
    old = above.submodel(part)
    places = places_of(source, levels, top)
    swapped = above.replace(part, model)
    plans: list[StagePlan] = []
    touched: list[Touch] = []
    for level in levels:
        plan, touches = _staged(campaign, level, places[level.name], part, model)
        plans += plan
        touched += touches
    rest = _at_rest(campaign[top], part)  # the same conditions for both: the part's own powers are those of its decks
    cold, warm = _steady(above, rest), _steady(swapped, rest)
    watts = _watts(above, rest, part), _watts(swapped, rest, part)
    before, after = _observed(cold, campaign[top]), _observed(warm, campaign[top])
    neighbours = _neighbours(above, swapped, part, cold, warm)
    return RetunePlan(part, old.title, model.title, tuple(plans), tuple(touched), neighbours, before, after, watts, campaign, model)


def _staged(campaign: Campaign, level: Level, places: tuple[str, ...], part: str, new: Model) -> tuple[list[StagePlan], list[Touch]]:
    """Return what becomes of a stage, and what of its values the part touches."""
    done, request = campaign[level.name], level.request
    records = tuple(r.name for r in request.records)
    same = done.model.identity()
    kept = StagePlan(level.name, level.name, "kept", "nothing that it depends on changes", (), (), (same, same), done.model)
    if f"{part}." in places:
        free = tuple(p for p in request.free if request.model.canonical(p) in ParameterSet(new).table)
        lost = [p for p in request.free if p not in free]
        why = "the new part, tested alone" + (f"; it has no {', '.join(lost)}" if lost else "")
        alone = StagePlan(level.name, level.name, "run", why, free, records, (same, new.identity()), new, "", True)
        if len(places) == 1:
            return [alone], []
        name = f"{level.name} at {part}"
        return [kept, StagePlan(name, level.name, "run", why, free, records, (same, new.identity()), new, "", True)], []
    holds = [place for place in places if part.startswith(place) and place != f"{part}."]
    if not holds:
        return [kept], []
    if len(places) > 1:
        raise IdentificationError(
            f"stage '{level.name}' stands at {len(places)} places of '{campaign.title}', and the part in one of them. Give the unit that "
            "is rebuilt a stage of its own.",
            part,
        )
    inner = part.removeprefix(holds[0])
    model = request.model.replace(inner, new)
    touches = _touches(done, level, inner, new)
    free = tuple(t.path for t in touches if not t.held)
    identity = (request.model.identity(), model.identity())
    if not free:
        why = "its model changes, but of what it fits nothing is to be retuned"
        return [StagePlan(level.name, level.name, "carried", why, (), (), identity, model, inner)], touches
    return [StagePlan(level.name, level.name, "run", f"{', '.join(free)} anew", free, records, identity, model, inner)], touches


def _touches(done: Calibration, level: Level, inner: str, new: Model) -> list[Touch]:
    """Return the values of a stage that act at the part's interfaces, with the old part or the new one."""
    model = done.fitted_model
    values, found = ParameterSet(model), touching(model, inner)
    states = [(model, _at_rest(done, "")), (model.replace(inner, new), _at_rest(done, inner))]
    known = ParameterSet(states[1][0]).table
    rest = [_observed(_steady(m, s), done) for m, s in states]
    out = []
    for path, v in done.values.parameters.items():
        through, elsewhere = found.why(values, path)
        inside = path.startswith(f"{inner}.") and path not in found.settings
        if path not in known or not (through or inside):
            continue
        share = 1.1 if 1.1 * v.value <= v.bounds[1] else 0.9
        kelvin = 0.0
        for (m, s), still in zip(states, rest, strict=True):
            changed = m.with_values({path: replace(v, value=share * v.value)}, "a change of 10 %")
            kelvin = max(kelvin, *(abs(t - still[o]) for o, t in _observed(_steady(changed, s), done).items()))
        held = ""
        if elsewhere:
            held = f"shared with {', '.join(elsewhere)}, which the swap leaves alone; give the part's joint a value of its own to free it"
        elif kelvin < FELT and not inside:
            held = f"10 % move no sensor by {FELT} K"
        out.append(Touch(level.name, path, tuple(through) or ("the part itself",), kelvin, held))
    return out


def _at_rest(done: Calibration, without: str) -> Scenario:
    """Return the last record of a fit with every input at its mean; loads of a part are left to its deck."""
    given = done.experiments[-1].bare

    def constant(signals: Mapping[str, Any], unit: str) -> dict[str, Any]:
        kept = {k: v for k, v in signals.items() if not without or not k.startswith(f"{without}.")}
        return {k: f"{float(np.mean(v.values))!r} [{unit}]" if isinstance(v, Table) else v for k, v in kept.items()}

    return replace(
        given,
        title="at rest",
        boundaries=constant(given.boundaries, "K"),
        loads=constant(given.loads, "W"),
        commands=constant(given.commands, "1"),
    )


def _watts(model: Model, scenario: Scenario, part: str) -> float:
    """Return the power of a part by its deck, commands at their means. [W]"""
    from thermid.dual import value_of
    from thermid.network.network import compile_network

    rows = compile_network(model, media=scenario.media()).numbers().loads
    return sum(float(value_of(row.coefficients[0])) for row in rows if row.name.startswith(f"{part}."))


def _steady(model: Model, scenario: Scenario) -> Mapping[str, float]:
    """Return the temperatures at rest. [K]"""
    from thermid.simulation.steady import steady

    try:
        return steady(model, scenario)
    except SolverError as error:
        raise IdentificationError(f"a swap is judged at rest, and there is none: {error.message}", model.title) from None


def _observed(rest: Mapping[str, float], done: Calibration) -> dict[str, float]:
    """Return sensor -> temperature at rest, of the nodes that a model still has. [K]"""
    return {o.sensor: rest[o.seat] for o in done.experiments[-1].observations if o.seat in rest}


def _neighbours(
    before: Model, after: Model, part: str, cold: Mapping[str, float], warm: Mapping[str, float]
) -> dict[str, tuple[float, float, float]]:
    """Return surface beside the part -> exposed area before and after, and the change of its node at rest."""
    beside, old = touching(before, part), {line.surface: line for line in ledger(before)}
    new = {line.surface: line.exposed for line in ledger(after)}
    near = {s for s, line in old.items() if s in beside.neighbours or set(line.joints) & set(beside.elements)}
    near |= {s for s, line in old.items() if abs(new.get(s, line.exposed) - line.exposed) > 1e-12}
    out = {}
    for surface in sorted(s for s in near if not s.startswith(f"{part}.")):
        inner, _, name = surface.rpartition(".")
        owner = before.submodel(inner) if inner else before
        node = f"{inner}.{owner.canonical(owner.surfaces[name].of)}".lstrip(".")
        out[surface] = (old[surface].exposed, new[surface], warm[node] - cold[node])
    return out
