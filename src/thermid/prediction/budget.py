"""`Budget`: everything uncertain that bears on one scenario, by source, how the model's inputs respond to it, and what is left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from thermid.arguments import takes_objects
from thermid.errors import IdentificationError
from thermid.fit.calibration import Calibration
from thermid.fit.discrepancy import OperatingPoint, misfit_kept
from thermid.knowledge.sources import LeftOut, Normal, Shifted, Source, uniforms
from thermid.knowledge.standing import UNJUDGED, Standing
from thermid.knowledge.values import FittedValues
from thermid.model.tree.model import Model
from thermid.network.network import compile_network
from thermid.prediction.known import Known, Rows, known_of, normal_sources, rows_of
from thermid.prediction.omitted import left_out_of
from thermid.prediction.spread import Spread
from thermid.prediction.stated import check_moves, expanded
from thermid.prediction.structural import (
    CONSTANT,
    GAS_IN_JOINTS,
    MISFIT,
    Mode,
    misfit_of,
    modes_of,
    open_contacts,
    responses,
    split_rows,
)
from thermid.simulation.scenarios.scenario import Scenario
from thermid.simulation.simulator import Simulator, prepare

Array = NDArray[np.float64]
Stated = Mapping[str, Any] | Spread
Groups = Sequence[tuple[Sequence[str], Any]]
"""Names that share one value, and how it is spread."""
Form = Literal["add", "log", "factor", "mode", "node"]


@dataclass(frozen=True)
class Target:
    """What sources act on.

    Parameters
    ----------
    name : str              Parameter, boundary, ``initial.<node>``, ``scale.<load>``, coefficient mode, or node.
    form : str              add (to the value [SI]), log (to its logarithm), factor (a relative change), mode (of a coefficient), or
                            node (to its temperature after the run [K]).
    also : tuple of str     Other names that share the value.
    """

    name: str
    form: Form
    also: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Budget:
    """The uncertainty of one question.

    Parameters
    ----------
    model : Model                   With the values laid over it, coefficients separated where the scenario thins their gas.
    scenario : Scenario
    sources : tuple of Source
    causes : tuple of str           Of each source: what a reader is told that it belongs to.
    alike : array                   Correlations of the sources, of their normal scores.
    targets : tuple of Target
    gain : array                    (targets, sources): by how much a target moves for a unit of a source.
    modes : tuple of Mode           Coefficient modes among the targets.
    conditions : dict               Conductor -> where its coefficient was found.
    omitted : tuple of LeftOut      What is known to be left out before anything is run.
    remarks : tuple of str          What a reader must know.
    standing : Standing             Of the values that it rests on.
    """

    model: Model
    scenario: Scenario
    sources: tuple[Source, ...]
    causes: tuple[str, ...]
    alike: Array
    targets: tuple[Target, ...]
    gain: Array
    modes: tuple[Mode, ...] = ()
    conditions: Mapping[str, OperatingPoint] = field(default_factory=dict)
    omitted: tuple[LeftOut, ...] = ()
    remarks: tuple[str, ...] = ()
    standing: Standing = UNJUDGED

    @classmethod
    def of_rows(cls, rows: Rows, model: Model, scenario: Scenario | None = None) -> Budget:
        """Return the uncertainty of values alone, of no structure; without a scenario that of no run."""
        make = _Making.of(rows)
        return cls(model, scenario or Scenario(), make.sources, make.causes, make.alike, make.targets, make.gain)

    @property
    def names(self) -> tuple[str, ...]:
        """Names that differ from member to member, those that share a value among them, in the simulator's words."""
        own = (n for t in self.targets if t.form in ("add", "log", "factor") for n in (t.name, *t.also))
        return tuple(dict.fromkeys(own))

    @property
    def means(self) -> Array:
        """Means (sources,) of the sources."""
        return np.array([s.law.mean for s in self.sources])

    @property
    def sizes(self) -> Array:
        """Standard deviations (sources,) of the sources."""
        return np.sqrt([s.law.variance for s in self.sources])

    def numbers(self, seed: int, first: int, members: int) -> Array:
        """Return the numbers (sources, members) between 0 and 1 of some members, independent of each other; see `uniforms`. [-]"""
        return np.array([uniforms(seed, s.name, first, members) for s in self.sources]).reshape(len(self.sources), members)

    def drawn(self, numbers: Array) -> Array:
        """Return the values (sources, members) of the sources at numbers between 0 and 1."""
        from scipy.special import ndtr, ndtri

        if (self.alike != np.eye(len(self.sources))).any():
            joined = np.flatnonzero((self.alike != np.eye(len(self.sources))).any(axis=0))
            root: Array = np.linalg.cholesky(self.alike[np.ix_(joined, joined)]).astype(float)
            numbers = numbers.copy()
            numbers[joined] = ndtr(combined(root, ndtri(numbers[joined])))
        return np.array([s.law.at(row) for s, row in zip(self.sources, numbers, strict=True)]).reshape(numbers.shape)

    def members(self, seed: int, first: int, count: int) -> dict[Target, Array]:
        """Return target -> deviation of every member (members,), in the target's form."""
        moved = combined(self.gain, self.drawn(self.numbers(seed, first, count)))
        return dict(zip(self.targets, moved, strict=True))

    def parts(self, columns: Array) -> dict[str, Array]:
        """Return cause -> variance (times,) of what a unit of each source does (times, sources). [K^2]"""
        sized = columns * self.sizes
        out = {}
        for cause in dict.fromkeys(self.causes):
            own = [k for k, c in enumerate(self.causes) if c == cause]
            out[cause] = np.einsum("ti,ij,tj->t", sized[:, own], self.alike[np.ix_(own, own)], sized[:, own])
        return out

    def beside(self, source: Source, cause: str) -> Budget:
        """Return the budget with a source that moves none of its targets: one that chooses between scenarios."""
        n = len(self.sources)
        alike = np.eye(n + 1)
        alike[:n, :n] = self.alike
        gain = np.hstack([self.gain, np.zeros((len(self.targets), 1))])
        return replace(self, sources=(*self.sources, source), causes=(*self.causes, cause), alike=alike, gain=gain)

    def without(self, names: Sequence[str]) -> Budget:
        """Return the budget without some sources, named by kind, cause or name."""
        kept = [k for k, s in enumerate(self.sources) if not {s.kind, self.causes[k], s.name} & {*names}]
        gain = self.gain[:, kept]
        acting = [k for k, row in enumerate(gain) if row.any()]
        return replace(
            self,
            sources=tuple(self.sources[k] for k in kept),
            causes=tuple(self.causes[k] for k in kept),
            alike=self.alike[np.ix_(kept, kept)],
            targets=tuple(self.targets[k] for k in acting),
            gain=gain[acting],
            modes=tuple(m for m in self.modes if any(self.targets[k].name == m.name for k in acting)),
        )


def combined(weights: Array, rows: Array) -> Array:
    """Return sums (targets, members) of rows (sources, members) by weights (targets, sources).

    Written out: a matrix product rounds differently for another number of members, and a member shall not depend on how many there are.
    """
    out = np.zeros((weights.shape[0], rows.shape[1]))
    for k, s in zip(*np.nonzero(weights), strict=True):
        out[k] += weights[k, s] * rows[s]
    return out


@takes_objects
def budget_of(
    known: Model | Calibration | Known | FittedValues | Sequence[Any],
    scenario: Scenario,
    stated: Stated | Sequence[Stated] = (),
    *,
    model: Model | None = None,
    at: str = "",
    without: Sequence[str] = (),
) -> Budget:
    """Return everything uncertain that bears on a scenario.

    Parameters
    ----------
    known : Model, Calibration, Known, or fitted values     What is known.
    scenario : Scenario     What is done to the model.
    stated : dict, Spread, or several   What else is not known exactly: name or pattern of parameters -> spread as text; see `read_spread`.
    model : Model           What fitted values are laid over; a fit's own by default.
    at : str                The submodel that the values belong to.
    without : sequence      Sources that are not counted: kinds (``structural``, ``misfit``), causes or names; the result says so.

    Raises
    ------
    IdentificationError   When a value is spread twice, or has no finite error; when a coefficient that must be separated cannot be.
    """
    source = known_of(known, model, at)
    given = [stated] if isinstance(stated, Mapping | Spread) else list(stated)
    plain: list[Spread | Groups] = [expanded(s, source.model) if isinstance(s, Mapping) else s for s in given]
    rows = rows_of(source)
    own, rows = split_rows(source, rows, scenario, [n for s in plain for n in _names(s)])
    make = _Making.of(rows)
    contacts, remark = open_contacts(source, rows, scenario)
    for path, gas in contacts.items():
        also = next((t.also for t in make.targets if t.name == path), ())
        make = make.with_one(gas, GAS_IN_JOINTS, Target(path, "factor", also))
    modes, alike = modes_of(source.kept)
    make = make.with_modes(modes, alike, responses(source.kept, rows, modes))
    network = compile_network(own, media=scenario.media(), prescribed=tuple(scenario.prescribed))
    misfit = misfit_of([misfit_kept(p) for p in source.provenances], network)
    if misfit:
        words = "what the model could not follow in the records that it was fitted to"
        make = make.with_nodes(Source(MISFIT, "misfit", Normal(), words), misfit)
    make = make.with_stated(plain, own, scenario, rows)
    conditions = {p: c for k in source.kept for p, c in k.conditions.items()}
    remarks = (remark,) if remark else ()
    whole = Budget(own, scenario, make.sources, make.causes, make.alike, make.targets, make.gain, tuple(modes), conditions, remarks=remarks)
    return replace(whole.without(without), omitted=left_out_of(source, whole, without), standing=source.standing)


def _names(stated: Spread | Groups) -> list[str]:
    """Return every name that a stated spread moves, instances that share a value among them."""
    if isinstance(stated, Spread):
        return [n for name in stated.names for n in (name, *stated.also.get(name, ()))]
    return [n for names, _ in stated for n in names]


@dataclass(frozen=True, eq=False)
class _Making:
    """A budget as it grows."""

    sources: tuple[Source, ...]
    causes: tuple[str, ...]
    alike: Array
    targets: tuple[Target, ...]
    gain: Array

    @classmethod
    def of(cls, rows: Rows) -> _Making:
        targets = tuple(Target(n, "log" if log else "add", rows.also.get(n, ())) for n, log in zip(rows.names, rows.log, strict=True))
        return cls(rows.sources, rows.causes, np.eye(len(rows.sources)), targets, rows.matrix)

    def beside(self, sources: Sequence[Source], cause: str, targets: Sequence[Target], gain: Array, alike: Array | None = None) -> _Making:
        """Return it with sources of one cause that act on targets of their own."""
        n, m, k = len(self.sources), len(self.targets), len(sources)
        taken = {s.name for s in self.sources}  # a member's numbers come by a source's name
        sources = [replace(s, name=f"{s.name} ({n + i})") if s.name in taken else s for i, s in enumerate(sources)]
        whole = np.zeros((m + len(targets), n + k))
        whole[:m, :n], whole[m:, n:] = self.gain, gain
        joined = np.eye(n + k)
        joined[:n, :n] = self.alike
        if alike is not None:
            joined[n:, n:] = alike
        return _Making((*self.sources, *sources), (*self.causes, *(cause,) * k), joined, (*self.targets, *targets), whole)

    def with_one(self, source: Source, cause: str, target: Target) -> _Making:
        """Return it with a source that moves one target by itself."""
        return self.beside([source], cause, [target], np.ones((1, 1)))

    def with_modes(self, modes: Sequence[Mode], alike: Array, response: Array) -> _Making:
        """Return it with coefficient modes, which move their own loads and what was fitted."""
        sources = [Source(m.name, "structural", m.law, f"{m.name}, held constant by the model") for m in modes]
        out = self.beside(sources, CONSTANT, [Target(m.name, "mode") for m in modes], np.eye(len(modes)), alike)
        out.gain[: response.shape[0], len(self.sources) :] += response
        return out

    def with_nodes(self, source: Source, sizes: Mapping[str, float]) -> _Making:
        """Return it with a source that moves all nodes after the run."""
        return self.beside([source], source.name, [Target(n, "node") for n in sizes], np.array(list(sizes.values()))[:, None])

    def with_stated(self, given: Sequence[Spread | Groups], model: Model, scenario: Scenario, rows: Rows) -> _Making:
        """Return it with what is stated."""
        names = [n for s in given for n in _names(s)]
        if not names:
            return self
        duration = scenario if scenario.seconds > 0 else scenario.with_(duration=1.0)
        ready = prepare(model, duration, tuple(dict.fromkeys(names)))
        check_moves(names, model, scenario)
        owners = {ready.canonical(n): cause for t, cause in self._owners().items() for n in (t.name, *t.also)}
        out = self
        for s in given:
            cause = s.cause if isinstance(s, Spread) else "stated"
            for name in map(ready.canonical, _names(s)):
                if name in owners:
                    raise IdentificationError(f"'{name}' is spread twice, by {owners[name]} and by {cause}. Leave one out.", ready.title)
                owners[name] = cause
            out = out._joint(s, ready) if isinstance(s, Spread) else out._single(s, ready)
        return out

    def _owners(self) -> dict[Target, str]:
        """Return parameter -> the cause that spreads it first."""
        own = [(t, row) for t, row in zip(self.targets, self.gain, strict=True) if t.form in ("add", "log", "factor") and row.any()]
        return {t: self.causes[int(np.flatnonzero(row)[0])] for t, row in own}

    def _single(self, groups: Groups, ready: Simulator) -> _Making:
        out = self
        for names, how in groups:
            first, *also = map(ready.canonical, names)
            law = Shifted(ready.law(first, how), -ready.nominal[first])
            out = out.with_one(Source(first, "stated", law, f"the stated spread of {first}"), "stated", Target(first, "add", tuple(also)))
        return out

    def _joint(self, spread: Spread, ready: Simulator) -> _Making:
        sources, matrix = normal_sources(spread.cause, spread.covariance, "stated")
        targets = [
            Target(ready.canonical(n), "log" if log else "add", tuple(map(ready.canonical, spread.also.get(n, ()))))
            for n, log in zip(spread.names, spread.log, strict=True)
        ]
        return self.beside(sources, spread.cause, targets, matrix)
