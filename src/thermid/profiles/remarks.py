"""What a careful reader remarks about a profile before anybody runs it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from thermid.errors import ScenarioError
from thermid.profiles.cycles import Equivalence, equivalent_cycles

if TYPE_CHECKING:
    from thermid.profiles.profile import ThermalProfile

__all__ = ["remarks"]


def remarks(profile: ThermalProfile, beside: float = 0.0) -> tuple[str, ...]:
    """Return the remarks about a profile; `beside` is how many cycles over its range other tests of the same unit run.

    Raises
    ------
    ScenarioError   When its levels stand in the wrong order.
    """
    if "hot" in profile.used or "cold" in profile.used:
        ordered(profile)
    return (*_condensation(profile), *_count(profile, beside), *_trust(profile))


def ordered(profile: ThermalProfile) -> None:
    """Check that cold lies below hot.

    Raises
    ------
    ScenarioError   When it does not.
    """
    cold, hot = profile["cold"], profile["hot"]
    if float(cold.value) >= float(hot.value):
        raise ScenarioError(f"its cold level, {cold.text}, does not lie below its hot level, {hot.text}. Exchange them.", profile.title)


def _condensation(profile: ThermalProfile) -> Iterator[str]:
    """Compare the first and the last half cycle with the rule against condensation: both hot."""
    if profile.kind != "thermal cycling" or profile.plan:
        return
    low = [s for s in profile.steps if s.target is not None and s.target < profile.value("ambient")]
    if not low:
        return
    turns = [s.name.split(",")[0].removeprefix("to ") for s in profile.steps if s.target is not None and s.name.startswith("to ")]
    for at, side in (("first", turns[0]), ("last", turns[-1])):
        if side != "hot":
            yield (
                f"the {at} half cycle is cold: the unit is colder than humid air can be when the door opens. SMC-S-016, 6.3.8.3 asks for "
                "a first and a last half cycle that are hot, or for dry gas"
            )


def _count(profile: ThermalProfile, beside: float) -> Iterator[str]:
    """Compare the count of cycles with the one that the range asks for, in this and in other tests together."""
    if not profile.has("base_cycles"):
        return
    law = Equivalence(
        profile.value("base_cycles"), profile.value("base_range"), profile.value("range_exponent"), profile["base_cycles"].clause
    )
    low, high = profile.value("cold"), profile.value("hot")
    need = equivalent_cycles(low, high, law)
    own = profile.value("cycles")
    if need != law.cycles or own < need:
        missing = need - own - beside
        yield (
            f"over {high - low:.4g} K the clause asks for {need} cycles in all ({law.cycles:g} ("
            + f"{law.range:g}/{high - low:.4g})^{law.exponent:g} = "
            f"{law.exact(high - low):.2f}), in vacuum and in air together; the profile runs {own:g}"
            + (f" and other tests of the plan {beside:g}" if beside else "")
            + (f": {missing:g} are missing" if missing > 0 else "")
        )


def _trust(profile: ThermalProfile) -> Iterator[str]:
    if not profile.decides:
        yield profile.trust
