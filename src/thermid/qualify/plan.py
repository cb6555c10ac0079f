"""`load_plan`: a qualification plan - what is to be shown, on what, with which sensors and by which criteria - before any log is read."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thermid.arguments import takes_objects
from thermid.errors import DeckError, NameNotFoundError, ThermidError, nearest
from thermid.judge.criteria import CRITERIA, CriteriaSet, read_criteria
from thermid.judge.limits import Limits, load_limits, read_limits
from thermid.model.deck.modelfile import load_model, read_toml, refuse_another_kind, resolve_inside
from thermid.prediction.known import Known
from thermid.qualify.basis import basis
from thermid.reduction.macro import macro_model
from thermid.sourced.policies import POLICIES

if TYPE_CHECKING:
    from thermid.qualify.plan_schema import PlanFile, TestTable

__all__ = ["Plan", "load_plan"]

AS_RUN = ("log", "state", "deviations", "date", "heat_leaks", "note")
"""What a test's table may gain once it was made; the rest is the plan."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A qualification plan.

    Parameters
    ----------
    path : Path                 Its file.
    content : PlanFile          As it is written, checked.
    limits : tuple of Limits    Of the reference points.
    criteria : dict             Name -> set of criteria, published ones and the project's own.
    files : dict                File that the plan rests on -> hash: decks, limits, scenarios, and the files that these name in turn.
    """

    path: Path
    content: PlanFile
    limits: tuple[Limits, ...]
    criteria: Mapping[str, CriteriaSet]
    files: Mapping[str, str] = field(repr=False)
    data: Path | None = None

    @property
    def title(self) -> str:
        """Its title."""
        return self.content.title

    @property
    def tests(self) -> tuple[TestTable, ...]:
        """The tests, in order."""
        return tuple(self.content.tests)

    @cached_property
    def planned(self) -> dict[str, str]:
        """Key path -> what is planned there, as text: all that may not change once a log was looked at."""
        whole = self.content.model_dump(mode="json")
        whole.pop("document"), whole.pop("discrepancies")
        for test in whole["tests"]:
            for key in AS_RUN:
                test.pop(key, None)
        whole["tests"] = {t["name"]: t for t in whole["tests"]}
        return dict(_flat(whole)) | {f"file {name}": sha for name, sha in self.files.items()}

    @cached_property
    def sha256(self) -> str:
        """Hash of what is planned, the decks and files that it rests on among it; what is added as tests are made does not enter."""
        return hashlib.sha256(json.dumps(self.planned, sort_keys=True).encode()).hexdigest()

    @cached_property
    def known(self) -> Known:
        """The model with what is known of its values; a campaign is run when this is first asked for."""
        try:
            return self._known()
        except ThermidError as error:
            raise error.within(self.path.name) from None

    def _known(self) -> Known:
        source, folder = self.content.model, self.path.parent
        if source.campaign:
            from thermid.campaign.stages import run_stages

            file = resolve_inside(folder, source.campaign, "model.campaign")
            data = self.data or (resolve_inside(folder, source.data, "model.data") if source.data else None)
            campaign = run_stages(file, data=data, cache=file.parent / "results")
            if source.stage not in campaign.stages:
                raise NameNotFoundError(
                    f"the campaign has no stage '{source.stage}'.{nearest(source.stage, campaign.stages)}", "model.stage"
                )
            return Known.of(campaign[source.stage])
        model = load_model(resolve_inside(folder, source.deck, "model.deck"))
        if not source.values:
            return Known(model)
        from thermid.campaign.filed import filed

        found = filed(resolve_inside(folder, source.values, "model.values"), model)
        made = bool(found.values.provenance.get("synthetic", False))
        return Known(found.model, (found.values,), synthetic=made, remarks=found.lines)

    def hosted(self, host: str) -> Known:
        """Return the model on a host of the plan, values under their paths there; the model itself where no host is named."""
        if not host:
            return self.known
        table = self.content.hosts[host]
        whole = macro_model(resolve_inside(self.path.parent, table.deck, f"hosts.{host}.deck"), unit=self.known.model)
        return Known(whole, self.known.values, None, self.known.synthetic, at=table.unit)

    def limits_on(self, host: str) -> tuple[Limits, ...]:
        """Return the limits under their paths on a host."""
        from dataclasses import replace

        if not host:
            return self.limits
        at = self.content.hosts[host].unit
        return tuple(replace(one, node=f"{at}.{one.node}", loads=tuple(f"{at}.{n}" for n in one.loads)) for one in self.limits)


def _flat(value: Any, path: str = "") -> list[tuple[str, str]]:
    if isinstance(value, dict):
        return [pair for key, inner in value.items() for pair in _flat(inner, f"{path}.{key}" if path else str(key))]
    return [(path, json.dumps(value, sort_keys=True))] if value not in (None, "", []) else []


@takes_objects
def load_plan(path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None) -> Plan:
    """Return a qualification plan, checked as far as that goes without running anything.

    Parameters
    ----------
    path : path     The TOML file.
    data : path     A folder of logs outside the project.

    Raises
    ------
    DeckError           When it does not follow the grammar, says no objective, test or limit, or a test has no course.
    NameNotFoundError   When a test names a sensor, a set of criteria or a host that the plan does not have.
    """
    from pydantic import ValidationError

    from thermid.model.deck.faults import deck_error
    from thermid.qualify.plan_checks import check_parts, check_test
    from thermid.qualify.plan_schema import PlanFile

    target = Path(path)
    raw, lines = read_toml(target)
    refuse_another_kind(raw, "a qualification plan, which names it under [model] beside objectives, limits and tests", target.name)
    _not_empty(raw, target.name)

    def where(key: str) -> str:
        steps = key.split(".")
        line = next((lines[k] for n in range(len(steps), 0, -1) if (k := ".".join(steps[:n])) in lines), None)
        return f"{target.name}:{line}, {key}" if line else f"{target.name}, {key}"

    try:
        content = PlanFile.model_validate(raw)
    except ValidationError as error:
        raise deck_error(error, raw, where, PlanFile) from None
    source = content.model
    if bool(source.deck) == bool(source.campaign) or bool(source.campaign) != bool(source.stage):
        raise DeckError(
            "the model is a deck, with a values file if there is one, or a stage of a campaign: campaign and stage.", where("model")
        )
    limits = _limits(content.limits, target.parent, where("limits"))
    own = {name: read_criteria(name, table, where(f"criteria.{name}")) for name, table in content.criteria.items()}
    criteria = CRITERIA | own
    check_parts(content, where)
    for k, test in enumerate(content.tests):
        check_test(content, test, criteria, lambda key, k=k: where(f"tests.{k}.{key}"))  # type: ignore[misc]
    if content.margins.policy not in POLICIES:
        known = "; ".join(POLICIES)
        raise NameNotFoundError(
            f"no margin policy '{content.margins.policy}'; there are {known}.{nearest(content.margins.policy, POLICIES)}",
            where("margins.policy"),
        )
    logs = Path(data) if data is not None else None
    return Plan(target, content, limits, criteria, basis(target, content, logs, where), logs)


def _limits(given: str | Mapping[str, Any], folder: Path, where: str) -> tuple[Limits, ...]:
    """Return the limits of a plan; errors of a file of their own name the plan too."""
    if not isinstance(given, str):
        return read_limits(given, where)
    try:
        return load_limits(resolve_inside(folder, given, where))
    except ThermidError as error:
        raise error.within(where) from None


def _not_empty(raw: Mapping[str, Any], name: str) -> None:
    """Refuse a plan that plans nothing, before its grammar is looked at."""
    lacking = [k for k in ("title", "objectives", "model", "limits", "sensors", "tests") if not raw.get(k)]
    if len(lacking) == 6:
        raise DeckError(
            "the plan is empty. It says what is to be shown before any log is read: title, objectives, [model], [limits], [sensors] and "
            "[[tests]].",
            name,
        )
    if lacking:
        raise DeckError(
            f"the plan has no {', no '.join(lacking)}. Say so before any log is read; what is decided afterwards proves little.", name
        )
