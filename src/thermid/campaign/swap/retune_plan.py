"""What replacing a part costs: values it touches, stages and tests that are due."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from thermid.arguments import takes_objects
from thermid.knowledge.standing import Standing
from thermid.model.tree.model import Model
from thermid.model.tree.replacement import PlaceStart, Replacement, short_text

if TYPE_CHECKING:
    from thermid.campaign.file import CampaignSource
    from thermid.campaign.stages import Campaign

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
    starts : tuple      Starts of its replacement that the stage decides: values of the place that it fitted before.
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
    starts: tuple[PlaceStart, ...] = ()


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
    before, after : dict    Sensor -> temperature at rest, the old part at the power of its model and the new one at that of its deck, all
                            else as in the last record. [K]
    as_logged : dict        Sensor -> the same with the old part at the power that the last record has. [K]
    watts : (float, float)  Power of the part by its old model and by the new deck. [W]
    logged : float          Power of the old part in the last record. [W]
    replacement : Replacement   What became of the values at the place, in the uppermost model.
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
    as_logged: Mapping[str, float]
    watts: tuple[float, float]
    logged: float
    replacement: Replacement
    campaign: Campaign = field(repr=False)
    model: Model = field(repr=False)

    @property
    def standing(self) -> Standing:
        """Of the values that the plan rests on: those of the last stage before."""
        return list(self.campaign.stages.values())[-1].standing

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

    @takes_objects
    def run(
        self, data: str | os.PathLike[str] | CampaignSource, *, everything: bool = False, part_only: bool = False, notice: Any = None
    ) -> Campaign:
        """Return the campaign after the retune: the stages that are due are fitted to the repeated tests, all others are as they were.

        Parameters
        ----------
        data : path         Folder with the logs of the repeated tests, named as in the campaign; or the campaign as read with it.
        everything : bool   Fit every stage anew with all that it frees, which needs all tests: what a retune is measured against.
        part_only : bool    Fit the new part to its own tests alone; the stages above know it then, and count what is assumed of its place.
        notice : callable   As in `run_stages`.

        Raises
        ------
        ThermidError   From reading or fitting.
        """
        from thermid.campaign.swap.retune import retuned

        return retuned(self, data, notice, everything, part_only)

    @property
    def assumes(self) -> tuple[str, ...]:
        """What the plan takes for granted of the new part and its place, in words."""
        tested = any(s.alone for s in self.stages)
        own = "its own test is due" if tested else "no stage tests it alone"
        return (f"{self.new} has the {self.watts[1]:.4g} W and all other values of its deck; {own}", *self.replacement.assumes[1:])

    def __str__(self) -> str:
        """Return the plan as text."""
        lines = [f"{self.part}: {self.old} -> {self.new}", "  assumed:", *(f"    {a}" for a in self.assumes)]
        lines += ["  dropped with the old part:"] * bool(self.replacement.dropped)
        lines += [f"    {d.path} {short_text(d.text)}, {d.origin}, {d.why}" for d in self.replacement.dropped]
        if self.replacement.untied:
            lines.append(f"  no longer one value with a twin's: {', '.join(self.replacement.untied)}")
        lines.append(f"  retuned: {len(self.freed)} interface values, {', '.join(self.freed) or 'none'}")
        for t in self.touched:
            what = "freed" if not t.held else f"fixed: {t.held}"
            lines.append(f"    {t.stage}: {t.path}  {t.kelvin:.2f} K for 10 %, through {', '.join(t.through)}; {what}")
        lines.append("  stages:")
        for s in self.stages:
            changed = "" if s.identity[0] == s.identity[1] else f" ({s.identity[0][:8]} -> {s.identity[1][:8]})"
            lines.append(f"    {s.name}: {s.action}{changed}, {s.why}")
        total = len(self.tests) + len(self.kept_tests)
        lines.append(f"  tests to repeat: {len(self.tests)} of {total}: {', '.join(self.tests)}")
        lines.append("  neighbours, exposed area before -> after; what they convect with is not freed:")
        for name, (a, b, dt) in self.neighbours.items():
            lines.append(f"    {name}: {1e4 * a:.4g} -> {1e4 * b:.4g} cm^2, {dt:+.2f} K at rest")
        return self.standing.over("\n".join([*lines, *self._at_rest()]))

    def _at_rest(self) -> list[str]:
        """Return the temperatures before and after, and those of the last record where the old part had another power in it."""
        old, new = self.watts
        lines = [f"  at rest before -> after: the old part at the {old:.4g} W of its model, the new one at the {new:.4g} W of its deck:"]
        lines += [f"    {s}: {self.before[s] - ICE:.2f} -> {t - ICE:.2f} degC" for s, t in self.after.items()]
        if abs(self.logged - old) > 1e-9:
            shown = ", ".join(f"{s} {self.as_logged[s] - ICE:.2f} degC" for s in self.after)
            lines.append(f"  the old part at the {self.logged:.4g} W of the last record: {shown}")
        return lines
