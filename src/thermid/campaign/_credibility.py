"""What every value of a model rests on: source, date, test, state, range and origin, for people and for machines."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from thermid.base.files import FileKinds
from thermid.base.results import Named
from thermid.base.units import counted, from_si, short, si_unit, unit
from thermid.campaign._stages import Campaign
from thermid.fit.calibration import Calibration
from thermid.model.tree import CREDIBLE, ParameterSet, Standing


@dataclass(frozen=True)
class ValueRecord:
    """What one value rests on.

    Parameters
    ----------
    path : str              In the model of the last stage.
    value, error : float    In the unit; the error is zero where nobody stated one.
    unit : str
    state : str             'assumed', 'published', 'datasheet', 'derived', 'measured' or 'not stated' by its deck; 'computed' from others;
                            'calibrated' at this level; 'frozen' as a level below found it.
    level : str             The stage that calibrated it; empty otherwise.
    tests : tuple of str    Records that it was calibrated with.
    date : str              Day of the calibration.
    minimum, maximum : float or None    Its bounds, or its range. In the unit.
    origin : str            Who set the value that holds.
    basis : str             What the deck says that it rests on, or the expression that computes it.
    spread : str            Its standard deviation as the deck states it, or 'range'; empty where it states none.
    """

    path: str
    value: float
    error: float
    unit: str
    state: str
    level: str = ""
    tests: tuple[str, ...] = ()
    date: str = ""
    minimum: float | None = None
    maximum: float | None = None
    origin: str = ""
    basis: str = ""
    spread: str = ""


@dataclass(frozen=True)
class CredibilityRecord(Named[ValueRecord], Mapping[str, ValueRecord]):
    """What every value of a campaign's uppermost model rests on.

    Parameters
    ----------
    title : str         The campaign's.
    model : str         Hash of the model with its fitted values.
    version : str       Of thermid.
    synthetic : bool    Whether any record was made and not measured.
    values_ : dict      Path -> ValueRecord.
    verdicts : tuple    What was judged: model, record, passed, unseen.
    standing : Standing     Of the uppermost stage, and of what it rests on.
    """

    title: str
    model: str
    version: str
    synthetic: bool
    values_: Mapping[str, ValueRecord]
    verdicts: tuple[Mapping[str, Any], ...] = ()
    standing: Standing = CREDIBLE

    _refusal = "no value '{}'."

    def _entries(self) -> Mapping[str, ValueRecord]:
        """Return path -> what its value rests on."""
        return self.values_

    @property
    def states(self) -> dict[str, int]:
        """State -> how many values are in it."""
        out: dict[str, int] = {}
        for v in self.values_.values():
            out[v.state] = out.get(v.state, 0) + 1
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return it as tables, without what is empty."""
        values = {p: {k: x for k, x in asdict(v).items() if k != "path" and x not in ("", (), None)} for p, v in self.values_.items()}
        plain = {p: {k: list(x) if isinstance(x, tuple) else x for k, x in v.items()} for p, v in values.items()}
        head = {"schema": 1, "title": self.title, "model": self.model, "version": self.version, "synthetic": self.synthetic}
        return head | {"states": self.states, "verdicts": [dict(v) for v in self.verdicts], "values": plain}

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it as JSON, and return the path."""
        return FileKinds.CREDIBILITY.save_text(Path(path), json.dumps(self.to_dict(), indent=1))

    def __str__(self) -> str:
        """Return it as text, a line a value, below the standing of the values."""
        counts = ", ".join(f"{n} {state}" for state, n in self.states.items())
        lines = [f"{self.title}: {counted(len(self), 'value')}, {counts}{' (synthetic data)' if self.synthetic else ''}"]
        width = max(map(len, self), default=0)
        for p, v in self.values_.items():
            error = f" +- {short(v.error)}" if v.error else ""
            at = f" at {v.level} ({', '.join(v.tests)}; {v.date})" if v.level else ""
            lines.append(f"  {p:<{width}}  {v.value:.6g}{error} {v.unit}  {v.state}{at}")
        return self.standing.over("\n".join(lines))


def credibility(campaign: Campaign) -> CredibilityRecord:
    """Credibility record: what every value of a campaign's uppermost model rests on; with a joint fit, as that left it.

    Parameters
    ----------
    campaign : Campaign     As `run_stages` returned it.
    """
    last = campaign.joint or tuple(campaign.stages.values())[-1]
    model = last.model
    values = ParameterSet(model)
    numbers = values.evaluate({})
    fits = dict(campaign.stages) | ({"joint": campaign.joint} if campaign.joint is not None else {})
    # of an FMU, its parameters alone: what else its deck has stands for nothing
    paths = [p for p in values.table if model.runner is None or p in model.parameters]
    rows = {path: _row(values, path, float(numbers[path]), last, fits) for path in paths}
    verdicts = tuple({"model": v.model, "record": v.record, "passed": v.passed, "unseen": v.unseen} for v in campaign.verdicts)
    synthetic = any(c.synthetic for c in fits.values())
    version = str(last.values.provenance.get("version", ""))
    return CredibilityRecord(campaign.title, model.identity(), version, synthetic, rows, verdicts, last.standing)


def _row(values: ParameterSet, path: str, number: float, last: Calibration, fits: Mapping[str, Calibration]) -> ValueRecord:
    """Return what one value rests on."""
    entry = values.table[path]
    parameter = entry.parameter
    text = parameter.unit or si_unit(values.dimension(path))
    of = unit(text)

    def shown(x: float | None) -> float | None:
        """Return a number in its unit; None stays."""
        return None if x is None else from_si(x, of)

    stage = next((name for name in reversed(list(fits)) if entry.origin == f"stage '{fits[name].stage}'"), "")
    error, date = 0.0, ""
    tests: tuple[str, ...] = ()
    if stage:
        fit = fits[stage]
        date = str(fit.values.provenance.get("date", ""))
        held = [v for p, v in fit.estimates.assignments.items() if path == p or path.endswith(f".{p}")]
        number, error = (held[0].value, held[0].error / float(of.factor)) if held else (number, 0.0)
        tests = tuple(fit.records)
    state = "computed" if not parameter.is_literal else parameter.source or "not stated"
    if stage:
        state = "calibrated" if fits[stage] is last else "frozen"
    basis = parameter.basis if parameter.is_literal else parameter.text
    low, high = shown(parameter.minimum), shown(parameter.maximum)
    return ValueRecord(path, shown(number) or 0.0, error, text, state, stage, tests, date, low, high, entry.origin, basis, parameter.spread)
