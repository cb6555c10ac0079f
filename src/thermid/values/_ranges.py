"""Values that are known within a stated range only: one source of error each, wherever in a model and at whatever level it is met."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from thermid.base.errors import quoted
from thermid.base.units import counted
from thermid.model.tree import Entry, Parameter, ParameterSet, StatedRange, Tree, local_identities
from thermid.values._store import Distribution, LogNormal, Normal, Source, Store

RANGE_OF = "range of "
"""What the name of a source begins with that is a stated range."""
MAX_VARIANCE_LEFT = 0.8
"""Part of the variance of an assumed value that readings leave at most, where they count; its stated law stays as it is beyond. [-]"""


@dataclass(frozen=True)
class RangedValue:
    """A value of a deck whose range a catalogue, a data sheet or its author states, and nobody fitted.

    Parameters
    ----------
    path : str                  In the model.
    also : tuple of str         Other paths with the same value: twins, and parts of one material.
    stated : StatedRange
    columns : tuple             Standard normal sources of its error, with the part of its standard deviation that each has: a finish has
                                one for all surfaces and one for each. [-]
    """

    path: str
    also: tuple[str, ...]
    stated: StatedRange
    columns: tuple[tuple[Source, float], ...]

    @property
    def words(self) -> str:
        """What its source of error is called: ``the range of 'paint, black' in lid.emissivity``."""
        return f"the range of '{self.stated.name}' in {self.path}" if self.stated.name else f"the range of {self.path}"

    def law(self, nominal: float) -> Distribution:
        """Return its distribution about a model's value: log-normal where value and range are above zero, else normal. [SI]"""
        has_log = self.stated.low > 0.0 and nominal > 0.0
        return LogNormal(nominal, self.stated.log_sd(nominal)) if has_log else Normal(nominal, self.stated.sd)

    def sd_left(self, nominal: float, of_assumed: Mapping[str, tuple[float, float]]) -> float:
        """Return its standard deviation once readings are counted, see `narrowed`. [SI]

        `of_assumed`: path -> variance of the readings' estimate and its shift; of several of its paths the smallest variance counts.
        """
        best = min((of_assumed[p] for p in (self.path, *self.also) if p in of_assumed), default=None)
        return float(narrowed(self.law(nominal), nominal, best).variance ** 0.5)

    @staticmethod
    def of_fit(model: Tree, parameters: ParameterSet, without: Collection[str] = ()) -> list[RangedValue]:
        """Return the values of a model that have a stated range, but for the paths in `without`.

        Twins, and parts of one material, are one `RangedValue`. Two finishes of one name share a source with sqrt(alike) of their standard
        deviation and have one each for the rest.
        """
        twins, groups = local_identities(model), dict[str, list[str]]()
        stated = {p: r for p, r in parameters.stated_ranges.items() if p not in without}
        for path, r in stated.items():
            first = twins[path].paths[0] if path in twins else path
            groups.setdefault(r.name if r.alike == 1.0 else first, []).append(path)
        places = [_place(model, parameters.table[paths[0]]) for paths in groups.values()]
        out = []
        for (path, *also), where in zip(groups.values(), places, strict=True):
            r = stated[path]
            place = where if places.count(where) == 1 else f"{where} at {path}"  # twins that a cut parted
            words = f"the range of '{r.name}'" if r.name else f"the range of {path}"
            shares = {r.name: math.sqrt(r.alike), place: math.sqrt(1.0 - r.alike)}
            columns = tuple(
                (Source(f"{RANGE_OF}{what}", "stated", Normal(), words), share) for what, share in shares.items() if share > 0.0
            )
            out.append(RangedValue(path, tuple(also), r, columns))
        return out


def _place(model: Tree, entry: Entry) -> str:
    """Return where a value is written, by the title of its deck: a file may be renamed, and its lines move."""
    owner = model.submodel(entry.scope.removesuffix(".")) if entry.scope else model
    return f"{owner.title}, {entry.where.rpartition(', ')[2]}"


def without_spread(paths: Sequence[str], source: str = "assumed") -> str:
    """Return the sentence part that names values of a source without a stated spread, of more than three the first three."""
    return f"{counted(len(paths), f'{source} value'.strip())} without a stated spread ({quoted(paths, 3)})"


def bracketed(parameters: Mapping[str, Parameter], sources: Collection[str]) -> list[str]:
    """Return the paths of numbers of some `sources` whose minimum and maximum bound a search alone: neither a range nor a spread."""
    bare = {p: x for p, x in parameters.items() if x.is_literal and x.stated_range is None and x.source in sources}
    return [p for p, x in bare.items() if None not in x.walls]


def range_shares(store: Store, path: str) -> dict[str, float]:
    """Return name of a stated range -> its share of the variance of a value, the largest first. [-]"""
    row = store.rows([path])[0]
    whole = float(row @ row)
    parts: dict[str, float] = {}
    for source, x in zip(store.sources, row.tolist(), strict=True):
        if source.name.startswith(RANGE_OF) and x:
            what = source.words.removeprefix(f"the {RANGE_OF}")
            parts[what] = parts.get(what, 0.0) + x**2 / whole
    return dict(sorted(parts.items(), key=lambda item: -item[1]))


def narrowed(law: Distribution, nominal: float, variance_and_shift: tuple[float, float] | None) -> Distribution:
    """Return the distribution of an assumed value once the readings of a fit are counted; `nominal` is the value that the fit assumed.

    With the variances v of `law` and V of the readings, and the shift d that they ask for, the variance left is s V + (s d)^2 with
    s = v / (v + V): the value of the fit stays nominal, so the shift s d counts as error. The law itself is returned where no readings are
    given, or where less than a fifth of its variance would go.
    """
    if variance_and_shift is None or not law.variance:
        return law
    variance, shift = variance_and_shift
    share = law.variance / (law.variance + variance)
    variance_left = share * variance + (share * shift) ** 2
    return Normal(nominal, variance_left**0.5) if variance_left < MAX_VARIANCE_LEFT * law.variance else law
