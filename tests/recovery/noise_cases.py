"""Consumers of a likelihood under kinds of noise: synthetic logs of a heated plate under a cover, and how 95 % intervals meet the truth.

Each consumer of `CONSUMERS` takes a kind of noise and a generator of random numbers and returns what it stated, as `Claim`: an error and
the deviation from the truth, or a refusal. `campaign` repeats it. The truth, the phases of the sensors' steps and the noise are drawn anew
in each log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

import thermid as td
from thermid.base.errors import ThermidError
from thermid.model.tree import TableSignal

Z95 = 1.959964
ICE = 273.15
DECK = {
    "title": "Plate under a cover",
    "needs": ["room"],
    "nodes": {
        "plate": {"capacitance": {"value": "100 [J/K]", "min": 20, "max": 500}},
        "cover": {"capacitance": "60 [J/K]"},
    },
    "conductors": {
        "pads": {"kind": "conduction", "between": ["plate", "cover"], "resistance": {"value": "2 [K/W]", "min": 0.3, "max": 12}},
    },
    "surfaces": {
        "skin": {"of": "cover", "to": "room", "area": "0.02 [m^2]", "effective_htc": {"value": "10 [W/(m^2 K)]", "min": 2, "max": 40}}
    },
    "loads": {"heater": {"into": "plate", "power": "4 [W]"}},
}
MODEL = td.model_from_dict(DECK)
RANGES = {"pads.resistance": (1.5, 3.0, "K/W"), "skin.effective_htc": (8.0, 14.0, "W/(m^2 K)"), "plate.capacitance": (80.0, 150.0, "J/K")}
FREE = tuple(RANGES)
SAME = "the same test again"
SENSORS = ("plate", "cover")
STEP, HOURS = 30.0, 3.0
TIMES = np.arange(0.0, 3600.0 * HOURS + 1.0, STEP)


@dataclass(frozen=True)
class Kind:
    """A kind of noise.

    Parameters
    ----------
    name : str
    white, slow, time : float       Standard deviations of the white and of the autocorrelated noise of thermometers [K], its time. [s]
    step : (float, float)           Range of the steps of the thermometers; zeros for none. [K]
    stated : bool                   Whether the log says noise and step of its thermometers.
    room, power : float             Standard deviations of a sample of the logged room [K] and power [W]; never stated.
    """

    name: str
    white: float = 0.05
    slow: float = 0.0
    time: float = 300.0
    step: tuple[float, float] = (0.0, 0.0)
    stated: bool = True
    room: float = 0.0
    power: float = 0.0

    def readings(self, truth: np.ndarray, rng: np.random.Generator, step: float) -> np.ndarray:
        """Return readings of temperatures at even times. [K]"""
        noise = self.white * rng.standard_normal(truth.size)
        if self.slow:
            keep = np.exp(-STEP / self.time)
            drive = self.slow * rng.standard_normal(truth.size) * np.sqrt(1.0 - keep**2)
            drive[0] /= np.sqrt(1.0 - keep**2)
            for k in range(1, drive.size):
                drive[k] += keep * drive[k - 1]
            noise += drive
        read = truth + noise
        # steps count from the ice point
        return ICE + step * np.round((read - ICE) / step) if step else read

    def drawn_step(self, rng: np.random.Generator) -> float:
        """Return the step of an instrument; zero for none. [K]"""
        low, high = self.step
        return float(np.exp(rng.uniform(np.log(low), np.log(high)))) if high else 0.0

    def channel(self, name: str, node: str, truth: np.ndarray, rng: np.random.Generator, step: float | None = None) -> td.Channel:
        """Return a thermometer on a node, with a step [K] of its own where none is given."""
        step = self.drawn_step(rng) if step is None else step
        said = {"noise": self.white} if self.stated else {}
        said |= {"resolution": step} if self.stated and step else {}
        return td.Channel.from_array(name, self.readings(truth, rng, step), unit="K", role="node", target=node, **said)


KINDS = {
    k.name: k
    for k in (
        Kind("white"),
        Kind("autocorrelated, 300 s", slow=0.1),
        Kind("steps of 0.1 to 1 K, stated", white=0.02, step=(0.1, 1.0)),
        Kind("steps of 0.1 to 1 K, found", white=0.02, step=(0.1, 1.0), stated=False),
        Kind("noisy ambient", room=0.5),
        Kind("noisy power", power=0.6),
    )
}


@dataclass(frozen=True)
class Claim:
    """A stated 95 % interval beside the truth: in standard errors where there is one, or only whether it holds it."""

    held: bool
    score: float = float("nan")


Claims = Mapping[str, Claim]


def scored(deviation: float, error: float) -> Claim:
    """Return the claim of a standard error."""
    score = deviation / error if error > 0 else float("inf")
    return Claim(bool(abs(score) <= Z95), float(score))


@dataclass(frozen=True, eq=False)
class Bench:
    """A hidden truth, and what is done to it."""

    truth: dict[str, float]
    hidden: td.Model
    room: np.ndarray
    heater: np.ndarray
    times: np.ndarray
    held: bool = True

    @classmethod
    def drawn(cls, rng: np.random.Generator, heater: np.ndarray | None = None, times: np.ndarray = TIMES) -> Bench:
        """Return one with the heater on for 25 min from 10 min on, and again, weaker, from the middle to the end."""
        truth = {p: float(rng.uniform(low, high)) for p, (low, high, _) in RANGES.items()}
        hidden = MODEL.with_values({p: f"{v!r} [{RANGES[p][2]}]" for p, v in truth.items()})
        room = ICE + 22.0 + rng.uniform(-1.0, 1.0) + 0.5 * np.sin(times / 2500.0 + rng.uniform(0.0, 6.0))
        if heater is None:
            heater = np.where((times >= 600.0) & (times < 2100.0), 6.0, 0.0) + np.where(times >= 5400.0, 3.5, 0.0)
        return cls(truth, hidden, room, heater, times)

    def record(
        self, kind: Kind, rng: np.random.Generator, name: str = "bench", powers: bool = True, steps: Mapping[str, float] | None = None
    ) -> td.Record:
        """Return a log of both temperatures, the room and, if asked, the power; instruments with these steps [K], or with new ones."""
        given = td.Scenario(
            "truth",
            boundaries={"room": (self.times, td.quantity(self.room, unit="K"))},
            loads={"heater": TableSignal(self.times, self.heater, self.held)},
            start=f"{float(self.room[0])!r} [K]",
            duration=float(self.times[-1]),
        )
        run = td.simulate(self.hidden, given, times=self.times)
        channels = {n: kind.channel(n, n, run[n].kelvin, rng, (steps or {}).get(n)) for n in SENSORS}
        room = self.room + kind.room * rng.standard_normal(self.times.size)
        channels["room"] = td.Channel.from_array("room", room, unit="K", role="boundary", target="room")
        if powers:
            watts = self.heater + kind.power * rng.standard_normal(self.times.size)
            channels["heat"] = td.Channel.from_array("heat", watts, quantity="power", role="load", target="heater", prompt=True)
        return td.Record.from_arrays(name, self.times, channels)


def _fitted(kind: Kind, rng: np.random.Generator) -> tuple[Bench, td.Calibration]:
    bench = Bench.drawn(rng)
    return bench, td.calibrate(MODEL, bench.record(kind, rng), FREE)


def _of_fit(bench: Bench, fit: td.Calibration, path: str) -> Claim:
    """Return the claim of a fit of a value, in logarithms as it is fitted."""
    return scored(float(np.log(fit[path].in_unit / bench.truth[path])), fit[path].error / fit[path].value)


def by_fit(kind: Kind, rng: np.random.Generator) -> Claims:
    """Intervals of a fit."""
    bench, fit = _fitted(kind, rng)
    return {p: _of_fit(bench, fit, p) for p in FREE}


def by_profile(kind: Kind, rng: np.random.Generator) -> Claims:
    """Profile likelihood of one value."""
    bench, fit = _fitted(kind, rng)
    found = td.inference.profile(fit, FREE[0])
    return {FREE[0]: Claim(bool(found.low <= bench.truth[FREE[0]] <= found.high))}


def by_posterior(kind: Kind, rng: np.random.Generator) -> Claims:
    """Quantiles of posterior samples."""
    bench, fit = _fitted(kind, rng)
    found = td.inference.posterior(fit, steps=40, seed=int(rng.integers(1 << 30)))
    ends = {p: found.interval(p) for p in FREE}
    return {p: Claim(bool(low <= bench.truth[p] <= high)) for p, (low, high) in ends.items()}


def by_next_test(kind: Kind, rng: np.random.Generator, warmer: float = 1.0) -> Claims:
    """The error that `next_test` promises of the same test again, beside that of a refit of both logs.

    The instruments are the same, the room another by up to `warmer` [K]: steps in a room that repeats to a fraction of a step round alike,
    and average nothing.
    """
    bench = Bench.drawn(rng)
    steps = {n: kind.drawn_step(rng) for n in SENSORS}
    first = bench.record(kind, rng, steps=steps)
    fit = td.calibrate(MODEL, first, FREE)
    again = fit.experiments[0].scenario
    planned = [td.design.Action(SAME, again)]
    promised = {p: td.design.next_test(fit, p, actions=planned, every=STEP).best for p in FREE}
    later = replace(bench, room=bench.room + rng.uniform(-warmer, warmer))
    both = td.calibrate(MODEL, [first, later.record(kind, rng, "again", steps=steps)], FREE)
    units = {p: fit[p].value / fit[p].in_unit for p in FREE}
    errors = {p: o.error if warmer or np.isnan(o.alike) else o.alike for p, o in promised.items()}
    return {p: scored((both[p].in_unit - bench.truth[p]) * units[p], errors[p]) for p in FREE}


def by_next_test_in_the_same_room(kind: Kind, rng: np.random.Generator) -> Claims:
    """The same where the room repeats exactly; then what is promised of readings that are rounded alike counts."""
    return by_next_test(kind, rng, 0.0)


def by_power_history(kind: Kind, rng: np.random.Generator) -> Claims:
    """Means over a quarter of an hour of a recovered power."""
    smooth = 2.0 + 3.0 / (1.0 + np.exp(-(TIMES - rng.uniform(1500.0, 3000.0)) / 400.0)) + np.sin(TIMES / rng.uniform(900.0, 1500.0))
    bench = replace(Bench.drawn(rng, smooth), held=False)
    found = td.inference.power_history(bench.hidden, bench.record(kind, rng, powers=False), "heater")
    middle, mean, sd = found.averaged("15 [min]")
    fine = np.linspace(0.0, TIMES[-1], 40 * 360 + 1)
    true = np.interp(fine, TIMES, smooth)
    return {f"{t:g} s": scored(m - true[np.abs(fine - t) <= 450.0].mean(), s) for t, m, s in zip(middle.tolist(), mean, sd, strict=True)}


def _settled(kind: Kind, rng: np.random.Generator) -> tuple[Bench, td.Record]:
    """Return four hours of constant power in a still room."""
    times = np.arange(0.0, 4.0 * 3600.0 + 1.0, STEP)
    drawn = Bench.drawn(rng, np.full(times.size, 4.0), times)
    bench = Bench(drawn.truth, drawn.hidden, np.full(times.size, drawn.room[0]), drawn.heater, times)
    return bench, bench.record(kind, rng)


def by_steady_point(kind: Kind, rng: np.random.Generator) -> Claims:
    """A coefficient and a resistance from one settled stretch."""
    bench, record = _settled(kind, rng)
    point = record.steady("3 [h]", "end", tau="1200 [s]", limit="3 [K/h]").record
    fit = td.calibrate(MODEL, point, FREE[:2], scenario=td.Scenario("s", start="steady"))
    return {p: _of_fit(bench, fit, p) for p in FREE[:2]}


def by_energy_balance(kind: Kind, rng: np.random.Generator) -> Claims:
    """Whether a fitted model of the right structure closes on a settled stretch of another log."""
    bench, record = _settled(kind, rng)
    learnt = Bench(bench.truth, bench.hidden, *(getattr(Bench.drawn(rng), n) for n in ("room", "heater")), TIMES)
    fit = td.calibrate(MODEL, learnt.record(kind, rng, "learnt"), FREE)
    found = td.inference.energy_balance(fit, record, "3 [h]", "end", limit="3 [K/h]")
    return {"closes": Claim(found.closes, found.total / found.error if found.error else float("inf"))}


def by_clock(kind: Kind, rng: np.random.Generator) -> Claims:
    """The offset of a meter's clock that samples every minute, found with the fit."""
    bench = Bench.drawn(rng)
    offset, every = float(rng.uniform(100.0, 200.0)), 60.0
    ends = rng.uniform(0.0, 60.0, 3) + np.array([600.0, 2100.0, 5400.0])
    fine = np.sort(np.concatenate([TIMES, ends]))
    heater = np.where((fine >= ends[0]) & (fine < ends[1]), 6.0, 0.0) + np.where(fine >= ends[2], 3.5, 0.0)
    given = td.Scenario(
        "truth",
        boundaries={"room": (TIMES, td.quantity(bench.room, unit="K"))},
        loads={"heater": TableSignal(fine, heater, True)},
        start=f"{float(bench.room[0])!r} [K]",
        duration=float(TIMES[-1]),
    )
    run = td.simulate(bench.hidden, given, times=TIMES)
    channels = {n: kind.channel(n, n, run[n].kelvin, rng) for n in ("plate", "cover")}
    channels["room"] = td.Channel.from_array(
        "room", bench.room + kind.room * rng.standard_normal(TIMES.size), unit="K", role="boundary", target="room"
    )
    first = td.Record.from_arrays("bench", TIMES, channels)
    there = np.arange(-offset - 60.0, TIMES[-1] - offset + 61.0, every)  # on the meter's own clock
    watts = heater[np.clip(np.searchsorted(fine, there + offset, side="right") - 1, 0, fine.size - 1)] * (there + offset >= 0)
    watts = watts + kind.power * rng.standard_normal(there.size)
    second = td.Record.from_arrays(
        "meter", there, {"heat": td.Channel.from_array("heat", watts, quantity="power", role="load", target="heater")}
    )
    fit = td.calibrate(MODEL, first.joined(second, offset=(0.0, 300.0)), FREE)
    found = next(v for v in fit.local if v.name == "clock offset")
    return {"offset": scored(found.value - offset, found.error), **{p: _of_fit(bench, fit, p) for p in FREE}}


CONSUMERS: Mapping[str, Callable[[Kind, np.random.Generator], Claims]] = {
    "fit": by_fit,
    "profile": by_profile,
    "posterior": by_posterior,
    "next_test": by_next_test,
    "next_test, room repeated": by_next_test_in_the_same_room,
    "power_history": by_power_history,
    "steady point": by_steady_point,
    "energy_balance": by_energy_balance,
    "clock": by_clock,
}


@dataclass(frozen=True)
class Cell:
    """One consumer under one kind of noise.

    Parameters
    ----------
    held, claims : dict         What was stated -> in how many logs its interval held the truth, and in how many it was stated.
    squares : dict              What was stated -> mean square of deviation over standard error; nan where none was stated.
    declined : dict             Reason, in its first words -> logs.
    logs : int
    """

    held: Mapping[str, int]
    claims: Mapping[str, int]
    squares: Mapping[str, float]
    declined: Mapping[str, int]
    logs: int

    @property
    def shares(self) -> dict[str, float]:
        """What was stated -> share of the intervals that held the truth."""
        return {n: self.held[n] / self.claims[n] for n in self.claims}


def campaign(consumer: str, kind: str, logs: int, seed: int) -> Cell:
    """Return what so many logs say of a consumer under a kind of noise."""
    found: dict[str, list[Claim]] = {}
    declined: dict[str, int] = {}
    for k in range(logs):
        rng = np.random.default_rng([seed, k, *kind.encode(), *consumer.encode()])
        try:
            for name, claim in CONSUMERS[consumer](KINDS[kind], rng).items():
                found.setdefault(name, []).append(claim)
        except ThermidError as refusal:
            words = refusal.message[:60]
            declined[words] = declined.get(words, 0) + 1
    scores = {n: np.array([c.score for c in several]) for n, several in found.items()}
    return Cell(
        {n: sum(c.held for c in several) for n, several in found.items()},
        {n: len(several) for n, several in found.items()},
        {n: float(np.mean(s**2)) for n, s in scores.items()},
        declined,
        logs,
    )
