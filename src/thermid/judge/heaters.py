"""How busy a controlled heater is, and whether its power margin is left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from thermid.arguments import takes_objects
from thermid.errors import NameNotFoundError, ScenarioError, nearest
from thermid.prediction.foresight import Foresight
from thermid.sourced.marks import Figure
from thermid.sourced.policies import POLICIES, SMC, Policy


@dataclass(frozen=True)
class HeaterDuty:
    """How busy a controlled heater is, and whether its power margin is left.

    Parameters
    ----------
    load, run : str
    duty : float        Mean power over full power in the window. [-]
    full : float        Full power. [W]
    window : (begin, end)   [s]
    rule : Figure       The power margin. [-]
    """

    load: str
    run: str
    duty: float
    full: float
    window: tuple[float, float]
    rule: Figure

    @property
    def most(self) -> float:
        """The largest duty that leaves the margin: 80 % for a margin of 25 %. [-]"""
        return 1.0 / (1.0 + self.rule.value)

    @property
    def margin(self) -> float:
        """Power at full duty over the power needed, less one. [-]"""
        return np.inf if self.duty <= 0 else 1.0 / self.duty - 1.0

    @property
    def passed(self) -> bool | None:
        """Whether the margin is left; None where the rule is from memory."""
        return self.duty <= self.most + 1e-12 if self.rule.decides else None


@takes_objects
def heater_duty(
    run: Foresight, load: str, full: float, *, window: tuple[float, float] | None = None, name: str = "", policy: Policy | str = SMC
) -> HeaterDuty:
    """Return the duty of a heater: its mean power over its full power, at the lowest bus voltage of the coldest case.

    Parameters
    ----------
    run : Foresight     The coldest run.
    load : str          The heater.
    full : float        Its power when it is on, at that voltage. [W]
    window : (begin, end)   Over which it is averaged, several of its cycles; the second half of the run by default. [s]
    name : str          Of the run.
    policy : Policy, str    Holds the power margin.

    Raises
    ------
    NameNotFoundError   When there is no such load.
    ScenarioError       When the full power is not above zero, or the window lies outside the run.
    """
    rule = (POLICIES[policy] if isinstance(policy, str) else policy).heater
    powers, times = run.solution.load_powers, run.solution.times
    if load not in powers:
        raise NameNotFoundError(f"no load '{load}'.{nearest(load, powers)}", run.solution.title)
    if full <= 0:
        raise ScenarioError(f"the full power of heater '{load}' must be above zero.", run.solution.title)
    begin, end = window or (0.5 * float(times[-1]), float(times[-1]))
    inside = (times >= begin) & (times <= end)
    if np.count_nonzero(inside) < 2:
        raise ScenarioError(
            f"the window of heater '{load}', {begin:g} s to {end:g} s, holds fewer than two stored times.", run.solution.title
        )
    watts = np.broadcast_to(powers[load], times.shape)[inside]
    mean = float(np.trapezoid(watts, times[inside]) / (times[inside][-1] - times[inside][0]))
    return HeaterDuty(load, name or run.scenario.title, mean / full, full, (begin, end), rule)
