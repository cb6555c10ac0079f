"""Which parameters a stage frees, freezes or gives a prior: names and globs become paths, ranges of data sheets become priors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

import numpy as np

from thermid.errors import IdentificationError, NameNotFoundError, nearest
from thermid.knowledge.sources import read_spread
from thermid.model.tree.model import Model
from thermid.model.tree.resolve import ParameterSet
from thermid.units import unit

RANGE = "range"
"""In place of a prior: what the range of the data sheet says."""
MIDPOINTS = 2000
"""Of the shares that moments of a logarithm are taken over."""


def is_glob(name: str) -> bool:
    """Return whether a name stands for all that match it."""
    return any(mark in name for mark in "*?[")


def matching(pattern: str, paths: Iterable[str], where: str) -> list[str]:
    """Return the paths that a glob matches; ``*`` passes dots, so ``pre.*.htc`` reaches ``pre.ele.skin.htc``.

    Raises
    ------
    NameNotFoundError   When it matches nothing, with the nearest path.
    """
    known = list(paths)
    hits = [p for p in known if fnmatchcase(p, pattern)]
    if not hits:
        bare = pattern.translate(str.maketrans("", "", "*?[]"))
        raise NameNotFoundError(f"no parameter that can be freed matches '{pattern}'.{nearest(bare, known)}", where)
    return hits


def freed(model: Model, free: Sequence[str], freeze: Sequence[str], where: str, handed: Iterable[str] = ()) -> tuple[list[str], set[str]]:
    """Return what is free once names and globs are read and `freeze` is taken off, and every path that is frozen.

    Parameters
    ----------
    model : Model           The stage's.
    free, freeze : list     Names and globs. A name that is no parameter is left to the fit, which says what is near.
    where : str             For messages.
    handed : iterable       Paths that stages below free as priors.

    Raises
    ------
    NameNotFoundError       When a glob matches no parameter that can be freed.
    IdentificationError     When `freeze` takes nothing off.
    """
    free = [free] if isinstance(free, str) else free  # one name, and not its letters
    if not freeze and not any(map(is_glob, free)):
        return list(free), set()
    values = ParameterSet(model)
    literals = [p for p, entry in values.table.items() if entry.parameter.is_literal]
    out: dict[str, None] = {}
    for name in free:
        out |= dict.fromkeys(matching(model.canonical(name), literals, where) if is_glob(name) else [name])
    here = {_path(model, values, name): name for name in out}
    frozen: set[str] = set()
    candidates = {*here, *handed}
    for name in freeze:
        hits = set(matching(model.canonical(name), literals, where)) if is_glob(name) else {values.freeable(name, model.canonical)}
        if not hits & candidates:
            raise IdentificationError(
                f"'{name}' is frozen, but nothing of that name is free here; what is not free stays as it is anyway. Take it out.", where
            )
        frozen |= hits
    return [name for path, name in here.items() if path not in frozen], frozen


def _path(model: Model, values: ParameterSet, name: str) -> str:
    """Return the path that a fit frees for a name; a name that cannot be freed stays, the fit will say why."""
    path = model.canonical(name)
    return values.literal_behind(path) if path in values.table else name


def priors_of(model: Model, given: Mapping[str, tuple[str, str] | str], where: str) -> dict[str, tuple[str, str]]:
    """Return path -> (mean, standard deviation) as texts, globs read and ranges turned into numbers.

    A range min..max of a data sheet is a rectangular distribution: its standard deviation is its half width over the square root of 3
    (JCGM 100:2008, 4.3.7). Quantities that are fitted by their logarithm have mean and standard deviation of its logarithm.

    Raises
    ------
    NameNotFoundError       When a glob matches nothing.
    IdentificationError     When a parameter has no range, or its range is not one of a data sheet.
    """
    if not any(is_glob(name) or one == RANGE for name, one in given.items()):
        return {name: one for name, one in given.items() if not isinstance(one, str)}
    values = ParameterSet(model)
    literals = [p for p, entry in values.table.items() if entry.parameter.is_literal]
    out: dict[str, tuple[str, str]] = {}
    for name, one in given.items():
        if not is_glob(name):
            paths = [values.freeable(name, model.canonical)]
        else:
            paths = matching(model.canonical(name), literals, where)
        for path in paths:
            out[path] = one if not isinstance(one, str) else _range(values, path, f"{where}.priors.{name}")
    return out


def _range(values: ParameterSet, path: str, where: str) -> tuple[str, str]:
    """Return mean and standard deviation of a parameter's range as texts."""
    given = values.table[path].parameter
    low, high = given.minimum, given.maximum
    if given.source != "datasheet":
        raise IdentificationError(
            f"the range of '{path}' is no prior: its source is {given.source or 'not stated'}, so min and max only bound the search. State "
            'source = "datasheet" where they are the tolerance of a data sheet, or give the prior a mean and sd.',
            where,
        )
    if low is None or high is None or not low < high:
        raise IdentificationError(f"'{path}' has no range: it needs both min and max. Give them, or a prior with mean and sd.", where)
    of = unit(given.unit or "1")
    law = read_spread(RANGE, of.text, float("nan"), where, bounds=(low, high))
    mean, sd = law.mean, math.sqrt(law.variance)
    if low > 0:  # as it will be fitted, by its logarithm: see `parameter_unknown`
        logs = np.log(law.at((np.arange(MIDPOINTS) + 0.5) / MIDPOINTS))
        mean = float(np.exp(logs.mean()))
        sd = mean * float(logs.std())
    shown = (mean - float(of.offset)) / float(of.factor)
    return f"{shown!r} [{of.text}]", f"{sd / float(of.factor)!r} [{'K' if float(of.offset) else of.text}]"
