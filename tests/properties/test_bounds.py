"""Property 2: without loads no temperature leaves the range of starts and boundaries."""

from __future__ import annotations

import numpy as np

import thermid as td
from oracle import si
from strategies import TIGHT, Case, cases, random_models

SLACK = 1e-6  # ten times what the tight tolerance lets a step err, in kelvin


@random_models(60, case=cases(loads=()))
def test_no_load_no_new_extremes(case: Case) -> None:
    solution = td.simulate(case.model, case.run(), options=TIGHT)
    given = [si(case.scenario["start"]), *(si(v) for v in case.scenario["initial"].values())]
    for signal in case.scenario["boundaries"].values():
        if isinstance(signal, dict) and "amplitude" in signal:
            given += [si(signal["mean"]) - si(signal["amplitude"]), si(signal["mean"]) + si(signal["amplitude"])]
        elif isinstance(signal, dict):
            given += [si(v) for v in signal["values"]]
        else:
            given.append(si(signal))
    assert np.all(solution.temperatures > min(given) - SLACK)
    assert np.all(solution.temperatures < max(given) + SLACK)


@random_models(40, case=cases(loads=(), constant=True))
def test_steady_without_loads_lies_between_the_boundaries(case: Case) -> None:
    given = [si(v) for v in case.scenario["boundaries"].values()]
    found = td.steady(case.model, case.run())
    assert min(found.values()) > min(given) - SLACK
    assert max(found.values()) < max(given) + SLACK
