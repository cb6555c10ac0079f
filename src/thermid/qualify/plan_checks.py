"""What a plan must hold together before anything is run: tests, settled stretches, exclusions, validity, sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from thermid.errors import DeckError, NameNotFoundError, nearest
from thermid.fit.uncertainty.grouping import listed
from thermid.judge.criteria import CriteriaSet
from thermid.measure.stability import rule_of
from thermid.model.laws.signal import literal
from thermid.qualify.plan_schema import PlanFile, TestTable
from thermid.units import TEMPERATURE

__all__ = ["check_parts", "check_test"]

Where = Callable[[str], str]
RANGES = {"temperature": TEMPERATURE, "pressure": "Pa", "power": "W", "gravity": "m/s^2"}
"""Key of the validity -> the unit of its two ends."""


def check_parts(content: PlanFile, where: Where) -> None:
    """Refuse what no test could be judged by: sensors without a reason, exclusions of none, ranges that are none.

    Raises
    ------
    DeckError           When a reason is missing, or a range is no pair in order.
    NameNotFoundError   When an exclusion names no sensor.
    """
    for name, sensor in content.sensors.items():
        if not sensor.reason.strip():
            raise DeckError(f"sensor '{name}' sits there without a reason. Say why.", where(f"sensors.{name}.reason"))
    for name in content.exclusions.reasons:
        if name not in content.sensors:
            raise NameNotFoundError(
                f"'{name}' is excluded, but is no sensor.{nearest(name, content.sensors)}", where(f"exclusions.reasons.{name}")
            )
    for key, unit in RANGES.items():
        given = getattr(content.validity, key)
        ends = [literal(t, unit, where(f"validity.{key}")) for t in given]
        if given and (len(ends) not in ((1, 2) if key == "gravity" else (2,)) or ends != sorted(ends)):
            raise DeckError(f"where the model was calibrated is a pair, lowest first, not {given}.", where(f"validity.{key}"))


def check_test(content: PlanFile, test: TestTable, criteria: Mapping[str, CriteriaSet], where: Where) -> None:
    """Refuse a test without a name or course of its own, and names and stretches that do not fit.

    Raises
    ------
    DeckError           When it is no test.
    NameNotFoundError   When it names a host, a sensor or criteria that the plan does not have.
    RecordError         When its rule of stability is none.
    """
    names = [t.name for t in content.tests]
    if not test.name.strip() or names.count(test.name) > 1:
        raise DeckError(f"a test needs a name of its own, not '{test.name}'.", where("name"))
    if test.profile is None and test.scenario is None:
        raise DeckError(f"test '{test.name}' needs its course: a profile or a scenario.", where("name"))
    if test.host and test.host not in content.hosts:
        raise NameNotFoundError(f"there is no host '{test.host}'.{nearest(test.host, content.hosts)}", where("host"))
    for key in ("sensors", "weights"):
        for sensor in getattr(test, key):
            if sensor not in content.sensors:
                raise NameNotFoundError(f"there is no sensor '{sensor}'.{nearest(sensor, content.sensors)}", where(key))
    for name in test.criteria:
        if name not in criteria:
            raise NameNotFoundError(
                f"there are no criteria '{name}'; there are {listed(list(criteria))}.{nearest(name, criteria)}", where("criteria")
            )
    rule_of(test.stable)
    steady = [n for n in test.criteria if "steady" in criteria[n].kinds]
    if test.log is not None and steady and not test.steady and test.profile is None:
        raise DeckError(
            f"'{steady[0]}' judges settled cases, and test '{test.name}' names no settled stretch: steady = [[\"4 [h]\", \"5 [h]\"]].",
            where("criteria"),
        )
    for window in test.steady:
        ends = [literal(t, "s", where("steady")) for t in window]
        if len(ends) != 2 or not ends[0] < ends[1]:
            raise DeckError('a settled stretch is a pair of times, the earlier first: ["4 [h]", "5 [h]"].', where("steady"))
    if test.state == "waived" and not test.note.strip():
        raise DeckError(f"test '{test.name}' is waived without a reason. Say why, and by whom, in its note.", where("state"))
