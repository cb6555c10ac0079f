"""Peaks that no fit saw, under defects that nobody stated: a hidden mass, a leak, a sensor's lag, a clock; and the same without. Synthetic.

`python tests/recovery/test_hidden_defects.py 200 520` prints the table of docs/coverage.md, of 200 draws from seed 520; single draws are a
test. Seeds up to 515 were seen while the method was made. Peaks are of the same hardware in further runs, whose values differ as those
of public test sets do; beside them of hardware that repeats exactly, which no single run can show: its bands are wider than its errors.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import thermid as td
from thermid.base.units import ICE_POINT
from thermid.inference._explain import defects
from thermid.prediction.bands import predict, predict_record

TIMES = np.linspace(0.0, 18000.0, 151)
AIR, NOISE, WATTS = 22.0, 0.1, 8.0
DEFECTS = ("none", "hidden mass", "leak", "lag", "clock")
FREE = ("skin.effective_htc", "board.capacitance", "seat.conductance")


def deck(**values: float) -> dict[str, Any]:
    """A board in a case in blown air."""
    skin = {"of": "case", "to": "air", "area": "0.05 [m^2]", "carried_by": "fan"}
    skin |= {"effective_htc": {"value": f"{values.get('htc', 8.0)!r} [W/(m^2 K)]", "min": 0.5, "max": 60}}
    board = {"capacitance": {"value": f"{values.get('board', 400.0)!r} [J/K]", "min": 50, "max": 5000}}
    seat = {"kind": "conduction", "between": ["board", "case"]}
    seat |= {"conductance": {"value": f"{values.get('seat', 1.0)!r} [W/K]", "min": 0.05, "max": 20}}
    return {
        "title": "Unit",
        "needs": ["air"],
        "nodes": {"board": board, "case": {"capacitance": "900 [J/K]"}},
        "surfaces": {"skin": skin},
        "conductors": {"seat": seat},
        "loads": {"heat": {"into": "board", "power": f"{WATTS} [W]"}},
    }


BY_RUN = 0.027
"""Standard deviation of the logarithms by which coefficients, conductances, masses and (by half of it) powers of one unit differ from run
to run, as nine public sets show it (docs/statistics.md). One run, to which a deck is fitted, cannot show that."""


def truth_of(rng: np.random.Generator, defect: str) -> td.Model:
    """Return hidden hardware; a mass or a leak that the deck does not have, where that is the defect."""
    return td.model_from_dict(hardware(rng, defect))


def hardware(rng: np.random.Generator, defect: str) -> dict[str, Any]:
    """Return the same as a deck."""
    found = deck(htc=float(rng.uniform(5, 14)), board=float(rng.uniform(250, 600)), seat=float(rng.uniform(0.5, 2.0)))
    if defect == "hidden mass":
        found["nodes"]["inside"] = {"capacitance": f"{rng.uniform(200, 1200)!r} [J/K]"}
        joint = {"kind": "conduction", "between": ["board", "inside"], "conductance": f"{rng.uniform(0.02, 0.3)!r} [W/K]"}
        found["conductors"]["joint"] = joint
    if defect == "leak":
        found["conductors"]["leak"] = {
            "kind": "conduction",
            "between": ["board", "air"],
            "conductance": f"{rng.uniform(0.02, 0.2)!r} [W/K]",
        }
    return found


def in_another_run(found: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Return hardware in another run: both runs differ from what the unit is in the mean, but for the power, which a scenario states."""

    def moved(x: Any, size: float) -> Any:
        if isinstance(x, dict):
            return {**x, "value": moved(x["value"], size)}
        value, unit = x.split(" ", 1)
        return f"{float(value) * float(np.exp(size * rng.standard_normal()))!r} {unit}"

    both = BY_RUN * 2.0**0.5
    tables = {"nodes": ("capacitance", both), "conductors": ("conductance", both), "surfaces": ("effective_htc", both)}
    tables["loads"] = ("power", 0.5 * BY_RUN)
    return found | {t: {n: {**x, k: moved(x[k], size)} for n, x in found[t].items()} for t, (k, size) in tables.items()}


def run_of(watts: tuple[float, float]) -> td.Scenario:
    """A pulse for an hour and a half, then something else."""
    power = (np.array([0.0, 5400.0, 5460.0, 18000.0]), np.array([watts[0], watts[0], watts[1], watts[1]]))
    return td.Scenario("run", boundaries={"air": f"{AIR} [degC]"}, loads={"heat": power}, start=f"{AIR} [degC]", duration=18000.0)


def log_of(truth: td.Model, rng: np.random.Generator, defect: str) -> td.Record:
    run = td.simulate(truth, run_of((WATTS, 0.4 * WATTS)), times=TIMES)
    lag = float(rng.uniform(60, 600)) if defect == "lag" else 0.0
    late = float(rng.uniform(60, 600)) if defect == "clock" else 0.0
    channels = {}
    for n in ("board", "case"):
        kelvin = np.interp(TIMES - late, TIMES, run[n].kelvin)
        if lag:
            step = float(TIMES[1] - TIMES[0])
            for k in range(1, kelvin.size):
                kelvin[k] = kelvin[k - 1] + (kelvin[k] - kelvin[k - 1]) * (1.0 - np.exp(-step / lag))
        channels[n] = td.Channel.from_array(
            n, kelvin + NOISE * rng.standard_normal(TIMES.size), unit="K", role="node", target=n, noise=NOISE
        )
    channels["air"] = td.Channel.from_array("air", np.full(TIMES.size, ICE_POINT + AIR), unit="K", role="boundary", target="air")
    power = np.interp(TIMES, [0.0, 5400.0, 5460.0, 18000.0], [WATTS, WATTS, 0.4 * WATTS, 0.4 * WATTS])
    channels["P"] = td.Channel.from_array("P", power, quantity="power", role="load", target="heat")
    return td.Record.from_arrays("bench", TIMES, channels)


@dataclass(frozen=True)
class Row:
    """What became of the fits under one defect: declined or not, truth less prediction at the peak of the board, half-width. [K]

    `off` (draws, runs) is of hardware in other runs, `exact` (draws,) of hardware that is in every run what it was in the fitted one.
    """

    defect: str
    declined: np.ndarray
    off: np.ndarray
    half: np.ndarray
    exact: np.ndarray

    @property
    def inside(self) -> float:
        """Share of the peaks inside, of those that were not declined; 1 where all were."""
        kept = ~self.declined
        return float(np.mean(np.abs(self.off[kept]).T <= self.half[kept])) if kept.any() else 1.0

    @property
    def ratio(self) -> float:
        """Half-width over the root mean square error, of those that were not declined."""
        kept = ~self.declined
        return float(self.half[kept].mean() / np.sqrt(np.mean(self.off[kept] ** 2))) if kept.any() else 0.0

    def __str__(self) -> str:
        """Return the row of the page."""
        half = f"{self.half[~self.declined].mean():.2f} K" if (~self.declined).any() else "-"
        shares = f"{100 * self.declined.mean():.0f} % | {100 * self.inside:.0f} %"
        exact = replace(self, off=self.exact)
        return (
            f"| {self.defect} | {self.half.size} | {shares} | {half} | {self.ratio:.1f} | {100 * exact.inside:.0f} % | {exact.ratio:.1f} |"
        )


ASKED, OTHER_RUNS = (1.6 * WATTS, 0.4 * WATTS), 10
"""Powers of the pulse that is asked, and how many further runs of each hardware have it."""
FRESH = 520
"""First seed that nobody saw while the method was made."""


def board_in(hidden: dict[str, Any]) -> np.ndarray:
    """Return the temperature of the board of hardware in the pulse that is asked. [K]"""
    part = float(hidden["loads"]["heat"]["power"].split()[0]) / WATTS
    return td.simulate(td.model_from_dict(hidden), run_of((part * ASKED[0], part * ASKED[1])), times=TIMES)["board"].kelvin


def row(defect: str, draws: int, seed: int = FRESH) -> Row:
    """Fit logs with one defect, and predict a pulse of 1.6 times the power."""
    found = []
    asked = run_of(ASKED)
    for k in range(draws):
        rng = np.random.default_rng(seed + k)
        hidden = hardware(rng, defect)
        fit = td.calibrate(td.model_from_dict(deck()), log_of(td.model_from_dict(hidden), rng, defect), FREE)
        whole, kelvin = predict(fit, asked, times=TIMES), board_in(hidden)
        at, told = int(kelvin.argmax()), whole["board"]
        other = np.random.default_rng([seed + k, 1])
        peaks = [board_in(in_another_run(hidden, other))[at] for _ in range(OTHER_RUNS)]
        found.append((not whole.standing.fair, kelvin[at] - told.kelvin[at], told.half_width[at], *(peaks - told.kelvin[at])))
    declined, exact, half, *off = np.array(found).T
    return Row(defect, declined.astype(bool), np.array(off).T, half, exact)


@pytest.mark.parametrize(
    ("defect", "named"),
    [
        ("hidden mass", "a second mass behind a resistance at 'board'"),
        pytest.param("clock", "later than logged", marks=pytest.mark.campaign),
    ],
)
def test_a_proved_defect_carries_the_prediction(defect: str, named: str) -> None:
    """Its band is the truth's, and the first line says what the deck does not have; that of the deck alone holds it too, and is wide."""
    rng = np.random.default_rng(500)
    truth = truth_of(rng, defect)
    fit = td.calibrate(td.model_from_dict(deck()), log_of(truth, rng, defect), FREE)
    asked = run_of((1.6 * WATTS, 0.4 * WATTS))
    told, plain = predict(fit, asked, times=TIMES), predict(fit, asked, times=TIMES, without=("hidden defects",))
    kelvin = td.simulate(truth, asked, times=TIMES)["board"].kelvin
    at = int(kelvin.argmax())
    assert named in str(told).splitlines()[0]
    assert told.to_dict()["explanation"] == told.explanation
    assert told.standing.fair
    assert told.standing.exit_code == 0
    assert abs(kelvin[at] - told["board"].kelvin[at]) <= told["board"].half_width[at]
    # what surfaces and a run may differ by at another power is open with the defect too: of the width only what it explains goes
    assert told["board"].half_width[at] < plain["board"].half_width[at]
    assert abs(kelvin[at] - told["board"].kelvin[at]) < 0.2 * abs(kelvin[at] - plain["board"].kelvin[at])
    assert abs(kelvin[at] - plain["board"].kelvin[at]) <= plain["board"].half_width[at]
    assert plain.explanation == ""
    drawn = predict(fit, asked, times=TIMES[::30], draws=20)
    for unsought in (plain, drawn, predict_record(fit, fit.request.records[0])):
        assert any("were not looked for" in w for w in unsought.warnings)
    assert not any("were not looked for" in w for w in told.warnings)


def test_what_no_defect_explains_costs_no_refit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A room that wanders beside its log leaves large residuals; one step with each defect takes little off, and a refit is forty.

    The clock alone is refitted: it is far from linear where it is off by more than a reading.
    """
    refit, made = defects._refit, []

    def counted(*given: Any) -> td.Calibration:
        made.append(given)
        return refit(*given)

    monkeypatch.setattr(defects, "_refit", counted)
    rng = np.random.default_rng(3)
    steps = rng.standard_normal(TIMES.size)
    wander = 0.5 * np.array([sum(0.96 ** (k - j) * steps[j] for j in range(k + 1)) for k in range(TIMES.size)]) * (1 - 0.96**2) ** 0.5
    asked = run_of((WATTS, 0.4 * WATTS))
    room = asked.with_(boundaries={"air": (TIMES, [f"{AIR + w} [degC]" for w in wander])})
    run = td.simulate(td.model_from_dict(deck()), room, times=TIMES)
    log = log_of(td.model_from_dict(deck()), rng, "none")
    seen = {n: replace(log[n], values=run[n].kelvin + NOISE * rng.standard_normal(TIMES.size)) for n in ("board", "case")}
    fit = td.calibrate(td.model_from_dict(deck()), replace(log, channels={**log.channels, **seen}), FREE)
    assert defects.asks(fit)
    assert predict(fit, asked, times=TIMES[::30]).explanation == ""
    assert len(made) <= 1


@cache
def of_two_hundred(defect: str) -> Row:
    """Return the row of 200 draws, made once."""
    found = row(defect, 200)
    print(found)
    return found


@pytest.mark.campaign
@pytest.mark.parametrize("defect", DEFECTS)
def test_two_hundred_draws(defect: str) -> None:
    found = of_two_hundred(defect)
    assert found.declined.mean() <= (0.05 if defect == "none" else 0.3)
    assert found.inside >= 0.9


@pytest.mark.campaign
@pytest.mark.parametrize("defect", DEFECTS[1:])
def test_width_of_two_hundred_draws(defect: str) -> None:
    assert of_two_hundred(defect).ratio <= 3.0


MISSED = {
    "hidden mass": "5.9 in 12 draws",
    "lag": "4.5 in 12 draws",
    "clock": "4.6 in 6 draws",
}
"""Half-width over the RMS error where hardware repeats exactly, of which at most 3.9 is asked; a leak was not measured since departures
of elements count."""


@pytest.mark.campaign
@pytest.mark.parametrize("defect", [pytest.param(d, marks=pytest.mark.xfail(strict=True, reason=reason)) for d, reason in MISSED.items()])
def test_width_where_hardware_repeats_exactly(defect: str) -> None:
    found = of_two_hundred(defect)
    assert replace(found, off=found.exact).ratio <= 3.9


if __name__ == "__main__":
    titles = ("defect", "draws", "declined", "peaks inside", "half-width", "over RMS error", "exact hardware: inside", "over RMS error")
    print(f"| {' | '.join(titles)} |\n|{'---|' * len(titles)}")
    for each in DEFECTS:
        print(row(each, *map(int, sys.argv[1:3] or ["200"])), flush=True)
