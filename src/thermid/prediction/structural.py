"""Structural errors of a model in a scenario: constant coefficients, their separation in thin gas, gas in joints, misfit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thermid.dual import value_of
from thermid.fit.discrepancy import ALIKE, MOST, Discrepancy, losing_gas
from thermid.knowledge.sources import Distribution, Normal, Source, Uniform
from thermid.knowledge.values import FittedValues
from thermid.linear_algebra import Array, symmetric_inverse
from thermid.model.tree.model import Model
from thermid.network.network import Network, compile_network
from thermid.prediction.known import Known, Rows, normal_sources
from thermid.prediction.split import split_values
from thermid.simulation.scenarios.scenario import Scenario

CONSTANT, MISFIT, SPLIT, GAS_IN_JOINTS = "constant coefficients", "misfit", "split of effective coefficients", "gas in joints"
"""Causes, as a reader is told them."""
NAMES = {"difference": "exponent of", "level": "radiative share of"}


@dataclass(frozen=True)
class Mode:
    """One way in which a constant coefficient may differ from a constant, as a source of error.

    Parameters
    ----------
    path, kind : str    Of the conductor; 'difference' or 'level'.
    law : Distribution  Of the exponent or of the radiative share. [-]
    """

    path: str
    kind: str
    law: Distribution

    @property
    def name(self) -> str:
        """What the source and its target are called."""
        return f"{NAMES[self.kind]} {self.path}"


def law_of_mode(kind: str, mean: float, sd: float) -> Distribution:
    """Return the law of a coefficient mode: the only place that chooses its shape. Moments as in `patterns_of`."""
    return Normal(mean, sd)


def modes_of(kept: Sequence[Discrepancy]) -> tuple[list[Mode], Array]:
    """Return the coefficient modes of all fits, of two that know one the later's, and their correlations.

    Half of what two surfaces do not follow is the surroundings', half their own (`ALIKE`).
    """
    found = {key: Mode(*key, law_of_mode(key[1], k.means[key], sd)) for k in kept for key, sd in k.sizes.items()}
    modes = list(found.values())
    alike = [[1.0 if a is b else ALIKE if a.kind == b.kind else 0.0 for b in modes] for a in modes]
    return modes, np.array(alike).reshape(len(modes), len(modes))


def responses(kept: Sequence[Discrepancy], rows: Rows, modes: Sequence[Mode]) -> Array:
    """Return what the fitted values (names, modes) would differ by for a unit of each mode; fitted form."""
    place = {name: k for k, name in enumerate(rows.names)}
    column = {(m.path, m.kind): k for k, m in enumerate(modes)}
    out = np.zeros((len(rows.names), len(modes)))
    for k in kept:
        for i, name in enumerate(k.names):
            if name in place:
                out[place[name]] = 0.0  # what an earlier fit found of it was replaced
                for j, key in enumerate(k.sizes):
                    out[place[name], column[key]] = k.response[i, j]
    return out


def misfit_of(kept: Sequence[Mapping[str, float]], network: Network) -> dict[str, float]:
    """Return node -> standard deviation of what the last fit that says so could not follow; empty where none does. [K]

    Nodes without a reading of their own have the root mean square of those that have one.
    """
    sizes = next((k for k in reversed(kept) if any(k.values())), {})
    if not sizes:
        return {}
    other = float(np.sqrt(np.mean(np.square(list(sizes.values())))))
    return {n: sizes.get(n, other) for n in network.nodes}


def split_needed(model: Model, scenario: Scenario, known: Sequence[str]) -> list[str]:
    """Return the surfaces whose effective coefficient a scenario takes apart, and whose emissivity is not among the known values."""
    network = compile_network(model)
    media = scenario.media()
    roots = network.flat.parameters.literal_behind
    effective = [c for c in network.flat.conductors if c.kind == "effective" and c.emissivity and not media.as_printed]
    return [c.path for c in effective if media.changed(c.gas) and not {roots(c.emissivity), c.emissivity} & {*known}]


def split_rows(known: Known, rows: Rows, scenario: Scenario, named: Sequence[str]) -> tuple[Model, Rows]:
    """Return the model and the rows with effective coefficients separated where the scenario thins their gas.

    Parameters
    ----------
    known, rows         What is known.
    scenario : Scenario What is asked about.
    named : sequence    Names whose spread is stated; an emissivity among them is known already.
    """
    values = known.placed[-1] if known.values else FittedValues(known.model.title, {}, np.zeros((0, 0)))
    thin = split_needed(known.model, scenario, [*known.assigned, *map(known.model.canonical, named)])
    surfaces = known.kept[-1].surfaces if known.kept else {}
    thin = [p for p in thin if p in surfaces]
    if not thin:
        return known.model, rows
    apart = split_values(known.model, values.bare(), thin, surfaces)
    fresh = [p for p in apart.values if p not in values]
    names = [*values.bare(), *fresh]
    joint = apart.values.covariance
    n = len(names) - len(fresh)
    # emissivities given the fitted values: b a^-1 of their covariances; what that leaves is the split's own
    follows = joint[n:, :n] @ symmetric_inverse(joint[:n, :n])
    place = {name: k for k, name in enumerate(rows.names)}
    upper = np.array([rows.matrix[place[p]] if p in place else np.zeros(len(rows.sources)) for p in names[:n]])
    upper = upper.reshape(n, len(rows.sources))
    own = joint[n:, n:] - follows @ joint[:n, n:]
    sources, matrix = normal_sources(f"split of '{values.stage}'", own, "structural")
    whole = np.zeros((len(rows.names) + len(fresh), len(rows.sources) + len(sources)))
    whole[: len(rows.names), : len(rows.sources)] = rows.matrix
    whole[len(rows.names) :, : len(rows.sources)] = follows @ upper
    whole[len(rows.names) :, len(rows.sources) :] = matrix
    also = {p: v.also for p, v in apart.values.items() if v.also}
    causes = (*rows.causes, *(SPLIT,) * len(sources))
    return apart.model, Rows(
        (*rows.names, *fresh), (*rows.log, *(True,) * len(fresh)), {**rows.also, **also}, (*rows.sources, *sources), causes, whole
    )


def open_contacts(known: Known, rows: Rows, scenario: Scenario) -> tuple[dict[str, Source], str]:
    """Return fitted contact conductance -> source of its relative change without gas, and a remark; none where no gas leaves.

    A contact fitted in air is the sum of touching spots and of gas between. Without gas it is anything from what is fitted less what gas
    can carry to all of it, each as likely. A joint with a `gap` in its deck, or a record at low pressure, separates both.
    """
    network = compile_network(known.model)
    seen = [p for k in known.kept for p in k.separated]
    fitted = {p: n for n in rows.names for p in (n, *rows.also.get(n, ()))}
    numbers = network.numbers().values
    out: dict[str, Source] = {}
    for c in losing_gas(network, scenario.media(), seen):
        name = fitted.get(network.flat.parameters.literal_behind(c.fields["contact_conductance"]), "")
        if name and name not in out:
            value = float(value_of(numbers[name]))
            words = f"the part of '{c.path}' that is gas"
            out[name] = Source(f"gas in {c.path}", "structural", Uniform(-min(1.0, MOST / value), 0.0), words)
    if not out:
        return out, ""
    named, was, it = ", ".join(f"'{p}'" for p in out), "was" if len(out) == 1 else "were", "it" if len(out) == 1 else "each"
    return out, (
        f"{named} {was} fitted in air. No log shows how much of {it} is conduction through the gas between the faces, so without gas "
        f"{it} lies anywhere from the fitted value less that to all of it; the bands include this. A record at low pressure, or a gap in "
        "the deck, would separate both"
    )
