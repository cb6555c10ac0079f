"""Random draws of what may change from member to member of an ensemble, reproducible from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from thermid.base.arguments import takes_objects
from thermid.base.errors import ScenarioError
from thermid.model.tree import Model
from thermid.simulation._scenarios.scenario import Scenario
from thermid.simulation._simulator import prepare
from thermid.values.store import uniforms


@takes_objects
def draw(model: Model, scenario: Scenario, spreads: Mapping[str, Any], members: int, *, seed: int) -> dict[str, Any]:
    """Draw random values of every member of an ensemble: name -> values (members,), independent of each other, as `ensemble` takes them.

    Numbers are SI; temperatures are a `thermid.base.expression.Quantity`, an array of kelvin by ``np.asarray``.

    Parameters
    ----------
    model, scenario     As in `simulate`; they give the values that are spread, and their units.
    spreads : dict      Name as in `ensemble` -> spread: ``"0.5 [W]"``, ``"10 [%]"``, ``{"log_sd": 0.2}``, ``"range"`` or
                        ``{"low": "4 [W]", "high": "6 [W]"}``. "Spreads" in docs/files.md says what each means.
    members : int       How many to draw.
    seed : int          The same seed gives the same values; a name's values do not depend on what else is drawn.

    Raises
    ------
    NameNotFoundError   When a name does not exist.
    ScenarioError       When a spread is none of these forms.
    UnitError           When a number has another dimension than what it spreads.
    """
    if members < 1:
        raise ScenarioError("an ensemble needs at least one member.", model.title, code="value.outside-range")
    ready = prepare(model, scenario if scenario.seconds > 0 else scenario.with_(duration=1.0), tuple(spreads))
    laws = {name: ready.law(name, spread) for name, spread in zip(ready.free, spreads.values(), strict=True)}
    return ready.with_units({name: law.at(uniforms(seed, name, 0, members)) for name, law in laws.items()})
