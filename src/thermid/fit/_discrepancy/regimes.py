"""What one kind of run differs by from the next: relative deviations of coefficients, powers and masses, and each run's room and start.

A kind of run is told by what acts in it (`regime_runs.kind_of_run`), not by a label. In a kind of its own every coefficient, power and mass
of the model lies a factor away from where a fit to several kinds puts it; the sizes of these factors are estimated over the kinds. A
prediction of a kind that no fit has seen carries such a deviation of its own; of one that was fitted, what the fit has not followed of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np

from thermid.base.linear_algebra import Array

KEY: Final = "regimes"
"""Where the provenance of fitted values keeps it."""
GROUPS: Final = ("coefficient", "power", "mass")
"""What deviates: conductors, loads, nodes."""
LEFT: Final = "left"
"""What of the misfit stays on the output."""
PRIOR: Final = 0.1
"""Scale of the half-normal prior of the standard deviation of a coefficient, power or mass from kind to kind. [-]"""
ROOM: Final = 2.0
"""Scale of the half-normal prior of the standard deviation of a room or start from run to run. [K]"""
FEW: Final = 5
"""Kinds below which the prior decides."""
DEVIATIONS: Final = np.geomspace(1e-3, 0.4, 20)
"""Standard deviations that are tried. [-]"""
SHARES: Final = np.geomspace(0.05, 3.0, 15)
"""Factors on the misfit that are tried. [-]"""
ROOMS: Final = np.geomspace(0.03, 30.0, 31)
"""Standard deviations of a room or start that are tried. [K]"""


def grid_of(group: str) -> Array:
    """Return the sizes that are tried of a group."""
    return SHARES if group == LEFT else DEVIATIONS


def log_prior(group: str) -> Array:
    """Return the logarithm of the prior density of the sizes that are tried, each standing for an equal step of its logarithm."""
    sizes = grid_of(group)
    return np.log(sizes) - (0.0 if group == LEFT else 0.5 * (sizes / PRIOR) ** 2)


def root_mean_square(sizes: Array, logs: Array) -> float:
    """Return the root of the posterior mean of the squares of sizes that are tried, by the logarithms of their weights.

    The variance of a prediction is linear in the squares, so this is the size that has its expected variance.
    """
    weight = np.exp(logs - logs.max())
    return float(np.sqrt(weight @ sizes**2 / weight.sum()))


BALANCE: Final = "balance of its neighbours"
"""What a start is assumed to be that nobody gave, of a node without a sensor in a run that does not begin at rest."""


@dataclass(frozen=True)
class Beside:
    """Another sensor's first reading, which says more of a temperature that stands on the first reading of one.

    Parameters
    ----------
    channel : str       The other sensor.
    mean : float        Its first reading less the one that the temperature stands on, over the runs. [K]
    slope, error : float    What the temperature differs by for one more kelvin of that difference, and its standard error. [-]
    """

    channel: str
    mean: float
    slope: float
    error: float


@dataclass(frozen=True)
class OwnValue:
    """A temperature that each run has for itself, a room or a start: how far it stands from where it is assumed.

    Parameters
    ----------
    name : str          Boundary or ``initial.<node>``.
    start : str         What it is assumed to be: the name of a channel, whose first reading stands there, a temperature, or `BALANCE`.
    mean, sd : float    Over the runs. [K]
    runs : int          How many.
    beside : tuple of Beside    What the first readings of other sensors say of it; the mean is that at their means.
    """

    name: str
    start: str
    mean: float
    sd: float
    runs: int
    beside: tuple[Beside, ...] = ()

    def given(self, first: Mapping[str, float]) -> tuple[float, float]:
        """Return mean and standard deviation of a further run's value about its start, by that run's first readings. [K]

        A sensor that the further run does not have stands where it stood beside the other on the fitted runs.
        """
        mean, variance = self.mean, self.sd**2 * (1.0 + 1.0 / self.runs)
        if self.start not in first:
            return mean, float(np.sqrt(variance))
        for b in (b for b in self.beside if b.channel in first):
            apart = first[b.channel] - first[self.start] - b.mean
            mean += b.slope * apart
            variance += (b.error * apart) ** 2
        return mean, float(np.sqrt(variance))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        plain = {"name": self.name, "start": self.start, "mean": self.mean, "sd": self.sd, "runs": self.runs}
        return plain | ({"beside": [asdict(b) for b in self.beside]} if self.beside else {})

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> OwnValue:
        """Return what `to_dict` gave."""
        return cls(**{**data, "beside": tuple(Beside(**b) for b in data.get("beside", ()))})


@dataclass(frozen=True, eq=False)
class Regimes:
    """What the kinds of run of a fit say of a further one; kept with its values.

    Parameters
    ----------
    kinds : dict                        Kind -> its records.
    names, groups : tuple of str        What deviates (parameters, ``scale.<load>``), and its group.
    free : tuple of str                 Fitted values.
    responses : dict                    Kind -> (free, names): what the fit moved by for a unit of that kind's deviations; fitted form.
    evidence : dict                     Group, or ``left`` -> logarithm of the likelihood of each size that is tried.
    own : tuple of OwnValue             Rooms and starts.
    noise : dict                        Node -> what neighbouring readings differ by. [K]
    checksums : tuple of str            Of the records.
    """

    kinds: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...]
    groups: tuple[str, ...]
    free: tuple[str, ...]
    responses: Mapping[str, Array]
    evidence: Mapping[str, Array]
    own: tuple[OwnValue, ...] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    checksums: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and texts for a file."""
        return {
            "kinds": {k: list(v) for k, v in self.kinds.items()},
            "names": list(self.names),
            "groups": list(self.groups),
            "free": list(self.free),
            "responses": {k: _short(v) for k, v in self.responses.items()},
            "evidence": {k: _short(v) for k, v in self.evidence.items()},
            "own": [o.to_dict() for o in self.own],
            "noise": dict(self.noise),
            "checksums": list(self.checksums),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Regimes:
        """Return what `to_dict` gave."""
        names, free = tuple(data["names"]), tuple(data["free"])
        return cls(
            {k: tuple(v) for k, v in data["kinds"].items()},
            names,
            tuple(data["groups"]),
            free,
            {k: np.array(v, dtype=float).reshape(len(free), len(names)) for k, v in data["responses"].items()},
            {k: np.array(v, dtype=float) for k, v in data["evidence"].items()},
            tuple(OwnValue.from_dict(o) for o in data["own"]),
            {n: float(x) for n, x in data["noise"].items()},
            tuple(data["checksums"]),
        )


def _short(values: Array) -> Any:
    """Return numbers with as many digits as they are worth."""
    return [_short(row) for row in values] if values.ndim > 1 else [float(f"{x:.6g}") for x in values]


def regimes_kept(provenance: Mapping[str, Any]) -> Regimes | None:
    """Return what the provenance of a stage keeps; None where it keeps nothing."""
    kept = provenance.get(KEY)
    return Regimes.from_dict(kept) if kept is not None else None


@dataclass(frozen=True, eq=False)
class KindsSeen:
    """The kinds of run of all stages behind some values, and the sizes that they give together.

    Parameters
    ----------
    stages : tuple of Regimes   The first one first.
    """

    stages: tuple[Regimes, ...]

    @classmethod
    def of(cls, provenances: Sequence[Mapping[str, Any]]) -> KindsSeen:
        """Return what the provenances of stages keep; a stage whose records a later one holds all is left out."""
        kept = [k for p in provenances if (k := regimes_kept(p)) is not None]
        alone = [k for i, k in enumerate(kept) if not any(set(k.checksums) <= set(later.checksums) for later in kept[i + 1 :])]
        return cls(tuple(alone))

    def __bool__(self) -> bool:
        """Whether any stage says anything."""
        return bool(self.stages)

    @property
    def kinds(self) -> dict[str, tuple[str, ...]]:
        """Kind -> its records, of all stages."""
        out: dict[str, tuple[str, ...]] = {}
        for stage in self.stages:
            for kind, records in stage.kinds.items():
                out[kind] = tuple(dict.fromkeys((*out.get(kind, ()), *records)))
        return out

    def size(self, group: str) -> float:
        """Return the standard deviation of a group from kind to kind [-], or the factor on the misfit, by the evidence of all stages."""
        logs = log_prior(group)
        for stage in self.stages:
            if group in stage.evidence:
                logs = logs + stage.evidence[group]
        return root_mean_square(grid_of(group), logs)

    @property
    def directions(self) -> dict[str, str]:
        """What deviates -> its group."""
        return {n: g for stage in self.stages for n, g in zip(stage.names, stage.groups, strict=True)}

    @property
    def noise(self) -> dict[str, float]:
        """Node -> what neighbouring readings differ by, of the last stage that read it. [K]"""
        return {n: size for stage in self.stages for n, size in stage.noise.items()}

    def response(self) -> tuple[tuple[str, ...], dict[str, Array]]:
        """Return the fitted values, and kind -> (values, directions): what they moved by for a unit of that kind's deviations.

        A value that several stages fitted is that of the last.
        """
        names = tuple(self.directions)
        free = tuple(dict.fromkeys(n for stage in self.stages for n in stage.free))
        out = {kind: np.zeros((len(free), len(names))) for kind in self.kinds}
        for stage in self.stages:
            rows, columns = [free.index(n) for n in stage.free], [names.index(n) for n in stage.names]
            for kind in out:
                out[kind][rows] = 0.0
                if kind in stage.responses:
                    out[kind][np.ix_(rows, columns)] = stage.responses[kind]
        return free, out

    def own_value(self, name: str, start: str = "") -> OwnValue | None:
        """Return how far a room or start stands from where it is assumed, of the stage with most runs; None where none says it.

        With the same text of `start` the mean counts; else only how far runs differ, and their mean as an error. What runs say of a
        start that somebody gave says nothing of one at the balance of its neighbours.
        """
        every = [o for stage in self.stages for o in stage.own if o.name == name]
        alike = [o for o in every if o.start == start]
        if alike:
            return max(alike, key=lambda o: o.runs)
        if not every or start == BALANCE:
            return None
        most = max(every, key=lambda o: o.runs)
        return OwnValue(name, start, 0.0, float(np.hypot(most.sd, most.mean)), most.runs)

    @property
    def words(self) -> str:
        """How the sizes were found, in words."""
        kinds, runs = len(self.kinds), sum(map(len, self.kinds.values()))
        sizes = ", ".join(f"{_plural(g)} {100 * self.size(g):.2g} %" for g in GROUPS if g in self.directions.values())
        found = f"estimated over {kinds} kinds of run ({runs} records)"
        if kinds < FEW:
            one = "one kind" if kinds == 1 else f"{kinds} kinds"
            found = f"{one} of run ({runs} records), too few for an estimate: the prior of {100 * PRIOR:.0f} % is used"
        return f"differences between kinds of run: {sizes}; {found}"


def _plural(group: str) -> str:
    return {"coefficient": "coefficients", "power": "powers", "mass": "masses"}[group]
