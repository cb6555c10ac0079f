"""`find_mistakes`: which mistake in a log, a deck or on the bench would explain that a model misses its readings, or its own deck.

Every mistake is a hypothesis of its own: the request, or the readings, as they would be without it. Each is fitted to the same thinned
readings with the same weak priors about the deck, and compared with the request as it is by the height of its posterior.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product
from typing import Any

import numpy as np

from thermid.base.errors import RecordError, ThermidError, code_of, quoted
from thermid.base.units import HOUR, ICE_POINT, MINUTE, Array, duration_text, short, unit
from thermid.fit.calibration import Calibration, Prior, Request, Unknown, clock_suffix
from thermid.inference._explain.candidates import Fitted, plain_lacks
from thermid.inference._explain.heats import Heat, heats_of, stores_of
from thermid.inference._explain.rough_fit import MAX_DESCENT_STEPS, MAX_RANKING_STEPS, Extra, RoughEnd, RoughFit
from thermid.inference._explain.thresholds import (
    ANY_VALUE,
    CHOSEN,
    CLOCK_SHIFTS,
    DECK_VALUE,
    FULLY_FITTED_HYPOTHESES,
    MAX_HEATED_NODES,
    MAX_PER_CENT,
    MIN_NAMED_GAIN,
    MOST_RECORDS_SEARCHED,
    SIZES,
    TIE,
    USUAL_AMBIENT,
)
from thermid.measure.records import COLUMN_UNITS, UNSEEN_PULSES, Channel, Record, open_questions, single_pulses, stray_readings
from thermid.simulation.runs import Environment, Network


@dataclass(frozen=True)
class Mistake:
    """One mistake, tried by itself.

    Parameters
    ----------
    kind : str              "per cent", "unit", "exchanged", "node", "clock", "gas", "load", "sensor", "fan", or `DECK_VALUE`.
    name : str              The channel, channels, load, node or boundary that it is about.
    words : str             It in words, with its size.
    gain : float            Logarithm of how much likelier the readings and the deck are with it, its rarity taken off. [-]
    rms : (float, float)    Root mean square of the thinned residuals without and with it. [K]
    remedy : str            What to change.
    """

    kind: str
    name: str
    words: str
    gain: float
    rms: tuple[float, float]
    remedy: str

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return {**{k: getattr(self, k) for k in ("kind", "name", "words", "gain", "remedy")}, "rms_K": list(self.rms)}

    def __str__(self) -> str:
        """Return it with its evidence."""
        before, after = self.rms
        fall = (
            f"residuals {short(before)} K -> {short(after)} K (RMS)"
            if after < 0.7 * before
            else "the fitted values would then agree with the deck"
        )
        return f"{self.words} ({fall}; log-odds {short(self.gain)})"


@dataclass(frozen=True)
class Mistakes:
    """The mistakes that would explain a bad fit.

    Parameters
    ----------
    stage : str                     The fit.
    named : tuple of Mistake        Those with strong evidence, the likeliest first; empty where nothing needs one, or none explains it.
    bad : bool                      Whether readings or deck are missed by more than honest models do.
    tried : int                     How many hypotheses were fitted.
    records : tuple of str          The records that were looked at: the worst ones of many.
    failed : str            Why none were looked for; empty where they were.
    """

    stage: str
    named: tuple[Mistake, ...] = ()
    bad: bool = False
    tried: int = 0
    records: tuple[str, ...] = ()
    failed: str = ""

    @property
    def first(self) -> Mistake | None:
        """The likeliest mistake; None where none is named."""
        return self.named[0] if self.named else None

    def lines(self) -> list[str]:
        """Return what stands in the first lines of a fit."""
        if self.failed:
            return [f"the search for mistakes in log or deck failed: {self.failed}"]
        if self.first is None:
            return []
        out = [f"likely mistake: {self.first}. {self.first.remedy}"]
        rivals = [m for m in self.named[1:] if self.first.gain - m.gain < TIE]
        return out + [f"  or: {m}. {m.remedy}" for m in rivals[:2]]

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        out = {"named": [m.to_dict() for m in self.named], "tried": self.tried, "records": list(self.records)}
        return out | ({"failed": self.failed} if self.failed else {})


def find_mistakes(request: Request, stage: str = "") -> Mistakes:
    """Return which mistakes in a log, a deck or on the bench would explain a bad fit; a search that fails returns its error as text.

    Parameters
    ----------
    request : Request   What the fit was asked.
    stage : str         Its name.

    Notes
    -----
    The height of the posterior is compared, with an Occam factor for every kind: MacKay, Information Theory, Inference, and Learning
    Algorithms, Cambridge 2003, chapter 28. Errors of thinned readings are their noise, and a part that wanders over a fifth of the log by
    1.5 % of what the sensor ranged over; it stands for what honest models miss.
    """
    name = stage or request.name or request.model.title
    try:
        return _mistakes_of(replace(request, loss="linear"), name)
    except ThermidError as error:  # a fit stands without its advice
        return Mistakes(name, failed=str(error))


def mistakes_of(fit: Calibration) -> Mistakes:
    """Return the mistakes in logs, decks or on the bench that would explain what a fit misses; none where nothing is missed.

    None is looked for where nothing was fitted to logs, the model is an FMU, or single readings are so far off that they are said first.
    """
    if fit.given_model.runner is not None:  # the heat inside somebody's FMU is not known
        return Mistakes(fit.stage)
    if fit.request is None or not fit.request.records or not fit.values.parameters:
        return Mistakes(fit.stage)
    if stray_readings(fit.request.records):  # said first: what looks like another mistake may be their doing
        return Mistakes(fit.stage)
    try:
        return find_mistakes(_with_found_clocks(fit.request, fit), fit.stage)
    except RecordError:  # temperatures on a clock that is not known
        return Mistakes(fit.stage)


def _with_found_clocks(request: Request, fit: Calibration) -> Request:
    """Return a request in which joined logs stand where a fit found their clocks.

    Raises
    ------
    RecordError   When one of them has temperatures that are compared.
    """
    offsets = {(v.record, v.name): v.value for v in fit.local}
    records = []
    for record in request.records:
        fixed = replace(record, clocks=())
        for clock in record.clocks:
            offset = offsets.get((record.name, f"{clock.offset_is}{clock_suffix(record, clock)}"), clock.at[0])
            fixed = fixed.delayed(offset - clock.at[0], clock.channels)
        records.append(fixed)
    return replace(request, records=tuple(records))


def _mistakes_of(request: Request, name: str) -> Mistakes:
    """Return the mistakes of a request, by a rough fit per hypothesis, those that gain most named; none if the fit is not bad.

    A request with more nodes than `MAX_HEATED_NODES` is not searched. Of many records only the worst are searched.
    """
    fit = RoughFit.of_request(request)
    base = fit.solve(fit.start())
    bad = _misses(fit, base)
    if not bad:
        return Mistakes(name)
    if any(code_of(question) == UNSEEN_PULSES for question in open_questions(request.records)):
        return Mistakes(name, bad=bad, failed="pulses of a power that its readings may miss would explain any misfit")
    if (sampled := _as_sampled(request, fit, base)) is not None:
        return Mistakes(name, (sampled,), bad, 1, tuple(r.name for r in request.records))
    stores = len(stores_of(fit.problem.experiments[0]))
    if stores > MAX_HEATED_NODES:
        return Mistakes(name, bad=bad, failed=f"{stores} nodes store heat, and it takes networks of up to {MAX_HEATED_NODES}")
    if len(request.records) > MOST_RECORDS_SEARCHED:
        request = _worst_records(request, fit, base)
        fit, before = RoughFit.of_request(request), fit.named(base)
        base = fit.best(before, None)  # of fewer records an unknown of one may have another name
    # every sensor as detached, and as off by a constant, each from its best instant on
    sensors = [
        Extra(n, fit.best_since(base, n, loose, SIZES["loose" if loose else "sensor"].spread), loose)
        for n in range(len(fit.traces))
        for loose in (True, False)
    ]
    logged = {request.model.canonical(c.target or n) for n, c in _channels(request, "power", "command").items()}
    candidates = [
        *_of_deck(request, fit, base),
        *_of_requests(request, fit, base),
        *(of_reading(extra, fit) for extra in sensors),
        *(
            Hypothesis(heat.kind, heat.name, heat.words, heat.remedy, request, heat=heat, against=0.0 if heat.load else 2.0 * CHOSEN)
            for heat in heats_of(request, fit, base, logged)
        ),
    ]
    quick = [(h, _end_of(h, fit, base)) for h in candidates]
    ranked = sorted((f for f in quick if f[1] is not None), key=lambda f: -_gain(f[0], f[1], base))
    placed = sorted(
        (f for h, _ in ranked[:FULLY_FITTED_HYPOTHESES] for f in _place_in_time(h, fit, base)), key=lambda f: -_gain(f[0], f[1], base)
    )
    placed = [f for f in placed if _gain(f[0], f[1], base) >= MIN_NAMED_GAIN]
    least = TIE + base.cost - _cost_with_element(request, fit, base) if placed else MIN_NAMED_GAIN
    of_deck = max((_gain(h, end, base) for h, end in placed if h.kind == DECK_VALUE), default=-np.inf)
    named: dict[tuple[str, str], Mistake] = {}
    for h, end in placed:
        if _gain(h, end, base) >= max(least, -np.inf if h.kind == DECK_VALUE else TIE + of_deck):
            amount = float(end.x[-1]) if h.heat is not None or h.extra is not None else 0.0
            mistake = Mistake(h.kind, h.name, h.words(amount), _gain(h, end, base), (base.rms, end.rms), h.remedy(amount))
            named.setdefault((h.kind, h.name), mistake)
    return Mistakes(name, tuple(named.values()), bad, len(candidates), tuple(r.name for r in request.records))


def _misses(fit: RoughFit, end: RoughEnd) -> bool:
    """Whether readings, or the deck, are missed by more than honest models do; each instant of a change is as far off as it may be."""
    return end.square > fit.size or end.prior > sum(u.kind == "parameter" or u.is_instant for u in fit.problem.unknowns)


def _as_sampled(request: Request, fit: RoughFit, base: RoughEnd) -> Mistake | None:
    """Return that on/off powers changed between their samples, where nobody stated `prompt` and nothing is missed then; else None.

    No other mistake competes: such a log has instants that nobody knows, and a load beside it fits as well in thinned readings.
    """
    unsaid = ((r, n, c) for r in request.records for n, c in r.channels.items() if c.role in ("load", "command") and c.prompt is None)
    pulsed = {n for r, n, c in unsaid if c.held and not np.isnan(single_pulses(r.times, c.values))}
    if not pulsed:
        return None
    other = _with_records(request, lambda r: r.with_channels(*(replace(c, prompt=False) for n, c in r.channels.items() if n in pulsed)))
    rough = RoughFit.of_request(other, fit)
    end = rough.best(None, fit.named(base))
    words = f"{quoted(sorted(pulsed))} changed between samples, not at them"
    mistake = Mistake("clock", ", ".join(sorted(pulsed)), words, base.cost - end.cost, (base.rms, end.rms), "State prompt = false for it.")
    return None if _misses(rough, end) else mistake


def _cost_with_element(request: Request, fit: RoughFit, base: RoughEnd) -> float:
    """Return the least cost of the fit with one element that the model may lack: a lag, a mass, a link, another law of heat."""
    values_before, structure = fit.named(base), Fitted.of_problem(request, fit.problem, base.x)
    ends: list[tuple[RoughFit, RoughEnd]] = []
    for element in plain_lacks(structure):
        with suppress(ThermidError, np.linalg.LinAlgError):
            rough = _with_open_values(RoughFit.of_request(element.request, fit), values_before)
            unknown_of_name = {u.name: u for u in rough.problem.unknowns}
            starts = [
                values_before | {p: unknown_of_name[p].to_fitted(v) for p, v in start.items() if p in unknown_of_name}
                for start in element.starts or ({},)
            ]
            ends.append((rough, rough.best(*starts, rounds=MAX_RANKING_STEPS)))
    ends.sort(key=lambda attempt: attempt[1].cost)
    return min([base.cost, *(rough.solve(end.x).cost for rough, end in ends[:FULLY_FITTED_HYPOTHESES])])


def _with_open_values(fit: RoughFit, values_before: Container[str]) -> RoughFit:
    """Return a rough fit in which values that are not known by name may be any: nobody has stated what a missing element has."""

    def opened(u: Unknown) -> Unknown:
        """Return an unknown whose new value may be anything."""
        new = u.kind == "parameter" and u.log and u.prior is not None and u.name not in values_before
        return replace(u, prior=Prior(u.to_fitted(u.start), ANY_VALUE)) if new else u

    return replace(fit, problem=replace(fit.problem, unknowns=tuple(map(opened, fit.problem.unknowns))))


def _worst_records(request: Request, fit: RoughFit, base: RoughEnd) -> Request:
    """Return a request of the `MOST_RECORDS_SEARCHED` records with the largest whitened mean square residual of any sensor."""
    missed: dict[str, float] = {}
    for t, residuals in zip(fit.traces, base.left, strict=True):
        missed[t.record] = max(missed.get(t.record, 0.0), float(np.mean((t.whiten @ residuals) ** 2)))
    worst_records = sorted(missed, key=lambda r: -missed[r])[:MOST_RECORDS_SEARCHED]
    scenarios = {n: s for n, s in request.scenarios.items() if n in ("*", *worst_records)}
    return replace(request, records=tuple(r for r in request.records if r.name in worst_records), scenarios=scenarios)


def _gain(h: Hypothesis, end: RoughEnd | None, base: RoughEnd) -> float:
    """Return the gain of a hypothesis in the logarithm of the posterior's height, its rarity taken off. [-]"""
    return -np.inf if end is None else base.cost - end.cost - (0.0 if h.kind == DECK_VALUE else TIE) - h.against


def _end_of(h: Hypothesis, fit: RoughFit, base: RoughEnd, rounds: int = MAX_RANKING_STEPS) -> RoughEnd | None:
    """Return the end of a hypothesis after some rounds; None where it cannot be fitted."""
    try:
        if h.heat is not None:
            return h.heat.fitted(fit, fit.named(base), rounds)
        rough = replace(fit, extra=h.extra) if h.extra is not None else RoughFit.of_request(h.request, fit, read=h.read)
        return rough.best(None, fit.named(base), rounds=rounds)
    except (ThermidError, np.linalg.LinAlgError):
        return None


def _place_in_time(h: Hypothesis, fit: RoughFit, base: RoughEnd) -> list[tuple[Hypothesis, RoughEnd]]:
    """Return a hypothesis with its instants where they fit best, and its end; nothing where it cannot be fitted."""
    if h.heat is not None:
        try:
            heat, end = h.heat.placed(fit, base)
        except (ThermidError, np.linalg.LinAlgError):
            return []
        return [(replace(h, heat=heat, words=heat.words, remedy=heat.remedy), end)]
    best = _end_of(h, fit, base, MAX_DESCENT_STEPS)
    if best is None or h.extra is None:
        return [] if best is None else [(h, best)]
    extra = h.extra
    for since in (-2, -1, 1, 2):
        moved = replace(extra, since=max(0, extra.since + since))
        end_of = _end_of(of_reading(moved, fit), fit, base, MAX_DESCENT_STEPS)
        if end_of is not None and end_of.cost < best.cost:
            extra, best = moved, end_of
    return [(of_reading(extra, fit), best)]


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A request, or readings, as they would be without a mistake.

    Parameters
    ----------
    kind, name : str
    words, remedy : callable    From the amount that was found (0 where there is none), in words.
    request : Request           The request without the mistake; that of the fit where heat or an extra is what differs.
    against : float             What it must gain beside: `CHOSEN` for each instant that was chosen before its fit. [-]
    heat : Heat or None         Heat that acts, with an amount to be found.
    extra : Extra or None       What acts on one sensor, with an amount to be found.
    read : dict                 Sensor -> whose readings it has, and by what factor, where these are others; see `RoughFit.of_request`.
    """

    kind: str
    name: str
    words: Callable[[float], str]
    remedy: Callable[[float], str]
    request: Request
    against: float = 0.0
    heat: Heat | None = None
    extra: Extra | None = None
    read: Mapping[str, tuple[str, float]] = field(default_factory=dict)


# ---- values of the deck that the fit holds


def _of_deck(request: Request, fit: RoughFit, base: RoughEnd) -> Iterator[Hypothesis]:
    """Yield a hypothesis for each value that is fixed and of elements without a free one: the `FULLY_FITTED_HYPOTHESES` largest gains.

    The gain of one step is (c'r)^2 / (c'c) [-], r the weighted residuals and c their derivatives by the value, both less what the unknowns
    of the fit can compensate.
    """
    flat = fit.problem.experiments[0].network.flat
    free = [p for u in fit.problem.unknowns if u.kind == "parameter" for p in (u.name, *u.also)]
    moving_paths = {*free, *flat.parameters.downstream(free)}
    fields = [{*n.fields.values()} for n in flat.nodes] + [{*c.fields.values()} for c in flat.conductors]
    unmoved = set[str]().union(*fields).difference(moving_paths, *(f for f in fields if f & moving_paths))
    paths = tuple(p for p, entry in flat.parameters.table.items() if p in unmoved and entry.parameter.is_literal)
    if not paths:
        return
    rough = RoughFit.of_request(replace(request, free=(*request.free, *paths)), fit)
    end, is_known = rough.at(rough.start(fit.named(base))), [u.name not in paths for u in rough.problem.unknowns]
    basis = np.linalg.qr(end.slopes[:, is_known])[0]
    residuals, columns = (a - basis @ (basis.T @ a) for a in (end.rows, end.slopes))
    gains = (columns.T @ residuals) ** 2 / np.maximum(np.sum(columns**2, axis=0), np.finfo(float).tiny)  # of one step
    for k in [k for k in np.argsort(-gains) if not is_known[k]][:FULLY_FITTED_HYPOTHESES]:
        path = rough.problem.unknowns[k].name
        words = f"'{path}' is not {flat.parameters.table[path].parameter.text}, at which the fit holds it"
        other = replace(request, free=(*request.free, path))
        yield _hypothesis(DECK_VALUE, path, words, f"Measure it, or add '{path}' to free.", other)


# ---- other requests: units, columns, nodes, clocks


def _of_requests(request: Request, fit: RoughFit, base: RoughEnd) -> Iterator[Hypothesis]:
    """Yield mistakes of units, columns, sensors' places and clocks, each as the request without it."""
    network = fit.problem.experiments[0].network
    yield from _per_cents(request, network)
    yield from _units(request)
    yield from _exchanges(request, fit)
    yield from _nodes(request, fit)
    yield from _clocks(request, fit, base)
    yield from _gases(request, fit)


def _channels(request: Request, *quantities: str) -> dict[str, Channel]:
    """Return name -> channel of some quantities, the first of several records."""
    out: dict[str, Channel] = {}
    for r in request.records:
        out |= {n: c for n, c in r.channels.items() if c.quantity in quantities and n not in out}
    return out


def _with_records(request: Request, change: Callable[[Record], Record]) -> Request:
    """Return a request with every record changed."""
    return replace(request, records=tuple(change(r) for r in request.records))


def _map_channels(request: Request, names: Iterable[str], law: Callable[[Array], Array]) -> Request:
    """Return a request in which `law` maps the values (samples,) of some channels, by name, to new ones."""
    wanted = set(names)

    def change(r: Record) -> Record:
        """Return a record with the readings of some channels changed."""
        mine = [replace(c, values=law(c.values), masks={}) for n, c in r.channels.items() if n in wanted]
        return r.with_channels(*mine)

    return _with_records(request, change)


def _per_cents(request: Request, network: Network) -> Iterator[Hypothesis]:
    """Yield a hypothesis for each logged power that may be a duty cycle in per cent: read as that share of the load's power in the deck.

    Its largest value lies above 1 W and above the deck's power, and at or below `MAX_PER_CENT`.
    """
    values = network.flat.parameters.evaluate({})
    decks = {row.path: float(values[row.fields["power"]]) for row in network.flat.loads if "power" in row.fields}
    for name, c in _channels(request, "power").items():
        load = request.model.canonical(c.target or name)
        largest, watts = float(np.abs(c.values[c.valid]).max()), decks.get(load, 0.0)
        if not (1.0 < largest <= MAX_PER_CENT and watts > 0.0 and largest > watts):
            continue
        words = f"'{name}' is a duty cycle in per cent but was read in watts, up to {short(largest, 3)} W for a load of {short(watts, 3)} W"
        remedy = f'Give {name} full_scale = "{short(watts, 3)} [W]", its power at 100 %.'
        other = _map_channels(request, [name], partial(np.multiply, watts / 100.0))
        yield _hypothesis("per cent", name, words, remedy, other)


def _hypothesis(kind: str, name: str, words: str, remedy: str, request: Request, against: float = 0.0) -> Hypothesis:
    """Return a hypothesis whose words and remedy do not depend on a size."""
    return Hypothesis(kind, name, lambda _: words, lambda _: remedy, request, against)


def _units(request: Request) -> Iterator[Hypothesis]:
    """Yield columns in another unit than was declared: powers, temperatures, and times in minutes, hours or milliseconds."""
    for quantity, unit_texts in COLUMN_UNITS.items():
        channels = _channels(request, quantity)
        for declared in dict.fromkeys(c.unit for c in channels.values()):
            alike = {n: c for n, c in channels.items() if c.unit == declared}
            for names, text in product(_alone_and_all(alike), (u for u in unit_texts if u != declared)):
                mine = [alike[n] for n in names]
                against = _unusual_starts(mine, text) if quantity == "temperature" else 0.0
                if "K" in (declared, text) and against > 0.0:
                    continue  # 273 K off: the start of the log decides, without a fit
                words = f"{quoted(names)} {'is' if len(names) == 1 else 'are'} in {text} but was read in {declared}"
                other = _with_records(request, partial(_in_unit, names, text))
                remedy = " ".join(c.unit_remedy(text) for c in mine)
                factor = float(unit(text).factor / unit(declared).factor)
                read = {n: (n, factor) for n in names if quantity == "temperature"}
                yield replace(_hypothesis("unit", ", ".join(names), words, remedy, other, against), read=read)
    for factor, text, short_text in ((MINUTE, "minutes", "min"), (HOUR, "hours", "h"), (1e-3, "milliseconds", "ms")):
        if any(r.clocks or r.origin.start for r in request.records):
            break
        other = replace(request, records=tuple(replace(r, times=factor * r.times) for r in request.records))
        time = request.records[0].origin.time
        words = f"the times '{time}' are {factor:g} times what was read, as {text} read in seconds are"
        remedy = f'Write units = {{ "{time}" = "{short_text}" }} for the record; where it states a unit, one {factor:g} times as large.'
        yield _hypothesis("unit", time, words, remedy, other)


def _unusual_starts(channels: list[Channel], text: str) -> float:
    """Return what readings in the unit `text` must gain: much, unless more of them start at the temperature of a room; then less than 0.

    The start of a log at 73 degC is seldom, at 23 degC it is a room.
    """
    declared, other = ([c.values[c.valid][0] - ICE_POINT for c in of] for of in (channels, [c.in_unit(text) for c in channels]))
    usual = [sum(USUAL_AMBIENT[0] <= t <= USUAL_AMBIENT[1] for t in starts) for starts in (declared, other)]
    return TIE if usual[0] >= usual[1] else -TIE


def _in_unit(names: Container[str], text: str, record: Record) -> Record:
    """Return a record whose channels `names` are read as if their numbers were in the unit `text`."""
    return record.with_channels(*(c.in_unit(text) for n, c in record.channels.items() if n in names))


def _alone_and_all(channels: Iterable[str]) -> list[tuple[str, ...]]:
    """Return each name by itself, and where there are several, all of them together."""
    names = tuple(channels)
    return [*((n,) for n in names), *([names] if len(names) > 1 else [])]


def _exchanges(request: Request, fit: RoughFit) -> Iterator[Hypothesis]:
    """Yield every two temperatures, and every two powers, with their readings exchanged."""
    sensors = {t.sensor for t in fit.traces}
    for quantity in ("temperature", "power"):
        for a, b in combinations(_channels(request, quantity), 2):
            other = _with_records(request, partial(_exchanged, a, b))
            words = f"'{a}' and '{b}' are exchanged"
            against = (
                0.0
                if len({a, b} & sensors) != 1
                else _of_other_readings(fit, RoughFit.of_request(other, fit, read={a: (b, 1.0), b: (a, 1.0)}))
            )
            remedy = "Exchange their names in the campaign, or their cables on the bench."
            hypothesis = _hypothesis("exchanged", f"{a}, {b}", words, remedy, other, against)
            yield replace(hypothesis, read={a: (b, 1.0), b: (a, 1.0)})


def _of_other_readings(fit: RoughFit, other: RoughFit) -> float:
    """Return what a fit to other readings must gain, so that both explain the same: all of them, by itself or as what drives the model. [-]

    It is the difference of two logarithms of densities, each sum over sensors of ln|W| + n (ln s + 1/2), W the whitener of its residuals
    and s the root mean square of the steps of its n readings. What drives a model has a density too, that of a walk whose steps are as
    large as those that are seen. Of readings that a fit takes from another's drive the density by the model replaces that of the walk,
    errors and all.
    """

    def density(of: RoughFit) -> float:
        """Return the logarithm of the density of the readings at zero residuals, less that of their walks. [-]"""
        steps = [max(float(np.sqrt(np.mean(np.diff(t.measured) ** 2))), 1e-6) for t in of.traces]
        walks = sum(t.measured.size * (np.log(s) + 0.5) for t, s in zip(of.traces, steps, strict=True))
        return float(sum(np.linalg.slogdet(t.whiten)[1] for t in of.traces) + walks)

    return density(fit) - density(other)


def _exchanged(a: str, b: str, record: Record) -> Record:
    """Return a record in which two channels have each other's readings."""
    if a not in record.channels or b not in record.channels:
        return record
    one, other = record.channels[a], record.channels[b]
    read = replace(one, values=other.values, valid=other.valid, masks=other.masks)
    return record.with_channels(read, replace(other, values=one.values, valid=one.valid, masks=one.masks))


def _nodes(request: Request, fit: RoughFit) -> Iterator[Hypothesis]:
    """Yield every sensor on every node that stores heat and has no sensor."""
    network = fit.problem.experiments[0].network
    node_of_sensor = {t.sensor: t.node for t in fit.traces}
    heavy = [n.path for n in network.flat.nodes if n.fields and n.path not in node_of_sensor.values()]
    sensors = [s for s in node_of_sensor if s in _channels(request, "temperature")]
    for s in sensors:
        for node in heavy:
            other = _with_records(request, partial(_moved, s, node))
            words = f"'{s}' is on '{node}', not on '{node_of_sensor[s]}'"
            yield _hypothesis("node", s, words, f'Write node = "{node}" for {s}.', other)


def _moved(sensor: str, node: str, record: Record) -> Record:
    """Return a record whose sensor reads another node; the record itself where it has no such sensor."""
    if sensor not in record.channels:
        return record
    return record.with_channels(replace(record.channels[sensor], target=node, role="node"))


def _clocks(request: Request, fit: RoughFit, base: RoughEnd) -> Iterator[Hypothesis]:
    """Yield shifts of what drives the model: its powers, and its boundaries where they change."""
    powers = [n for n, c in _channels(request, "power", "command").items() if np.ptp(c.values[c.valid]) > 0.0]
    sensors = {t.sensor for t in fit.traces}
    walls = [n for n, c in _channels(request, "temperature").items() if n not in sensors and np.ptp(c.values[c.valid]) > 3.0]
    for names in (powers, walls):
        if names and not any(r.clocks for r in request.records):
            yield from _shift(request, fit, base, names)


def _gases(request: Request, fit: RoughFit) -> Iterator[Hypothesis]:
    """Yield the records of which nobody stated a gas as tests in vacuum, each alone and all together."""
    vacuum = {"*": Environment("0 [Pa]")}
    for names in _alone_and_all(e.record.name for e in fit.problem.experiments if not e.scenario.environment):
        other = replace(request, records=tuple(replace(r, environment=vacuum) if r.name in names else r for r in request.records))
        words = (
            f"{quoted(names)} {'was' if len(names) == 1 else 'were'} measured in vacuum, but no gas is stated, so air at 1 atm was assumed"
        )
        remedy = 'State it with the record: environment = { "*" = { pressure = "0.1 [Pa]" } }, with the pressure of the test.'
        yield _hypothesis("gas", ", ".join(names), words, remedy, other)


def _shift(request: Request, fit: RoughFit, base: RoughEnd, names: list[str]) -> Iterator[Hypothesis]:
    """Yield the shift of the clock of some channels with the least cost: the best of `CLOCK_SHIFTS`, then by halved steps.

    Nothing where none of `CLOCK_SHIFTS` costs less than no shift.
    """
    span, near = min(float(np.ptp(r.times)) for r in request.records), fit.named(base)

    def tried(shift: float, values_before: Mapping[str, float]) -> tuple[float, float, Mapping[str, float]]:
        """Return the cost of the rough fit with channels shifted by a time [s], the shift, and where its descent ended."""
        rough = RoughFit.of_request(_shifted(request, names, shift), fit)
        try:
            end = rough.solve(rough.start(values_before), MAX_RANKING_STEPS)
        except ThermidError:
            return np.inf, shift, values_before
        return end.cost, shift, rough.named(end)

    best = min((tried(sign * part * span, near) for part in CLOCK_SHIFTS for sign in (-1.0, 1.0)), key=lambda t: t[:2])
    if best[0] >= base.cost:
        return
    width = 0.5 * max(abs(best[1]) * 0.35, 0.005 * span)
    while width > 0.001 * span:
        best = min(best, *(tried(best[1] + d, best[2]) for d in (-width, width)), key=lambda t: t[:2])
        width *= 0.5
    shift = best[1]
    late = "behind" if shift < 0.0 else "ahead of"
    words = f"the clock of {quoted(names)} is {duration_text(abs(shift))} {late} that of the temperatures"
    remedy = (
        f"Change the offset of that log by {-shift:+.4g} s, or give offset as a range and let the fit find it. 'thermid look' shows the "
        "clocks."
    )
    yield _hypothesis("clock", ", ".join(names), words, remedy, _shifted(request, names, shift), CHOSEN)


def _shifted(request: Request, names: list[str], shift: float) -> Request:
    """Return a request in which some channels show what they showed `shift` [s] later or, below zero, earlier."""

    def change(r: Record) -> Record:
        """Return a record in which some channels have the readings of `shift` [s] later: held ones the last before it, others straight."""
        mine = []
        for c in (c for n, c in r.channels.items() if n in names):
            times, values = r.times[c.valid], c.values[c.valid]
            if c.held:
                values = values[np.clip(np.searchsorted(times, r.times + shift, side="right") - 1, 0, times.size - 1)]
            else:
                values = np.interp(r.times + shift, times, values)
            mine.append(replace(c, values=values, valid=np.ones(r.times.size, dtype=bool), masks={}))
        return r.with_channels(*mine)

    return _with_records(request, change)


# ---- readings: a sensor that came loose, or is off


def of_reading(extra: Extra, fit: RoughFit) -> Hypothesis:
    """Return the hypothesis that one sensor is wrong from an instant on.

    Its amount is an error of the reading [K], or of a loose sensor the share [-] of the reading that comes from its surroundings.
    """
    t = fit.traces[extra.trace]
    begin = t.centres[extra.since] - 0.5 * float(np.median(np.diff(t.centres))) if extra.since else 0.0
    when = (f" from {duration_text(max(float(begin), 0.0))} on" if extra.since else " throughout") + (
        f" in {t.record}" if len(fit.problem.experiments) > 1 else ""
    )
    remedy = f'Mask it: prepare = [{{ mask = "{t.sensor}", from = "{begin:.0f} [s]" }}], or repeat the test.'

    def words(amount: float) -> str:
        """Return what the sensor does, in words, for the size that was fitted."""
        loose = f"is detached: {100 * amount:.0f} % of its reading comes from its surroundings"
        return f"'{t.sensor}' {loose if extra.loose else f'reads {amount:+.2g} K off'}{when}"

    return Hypothesis("sensor", t.sensor, words, lambda _: remedy, fit.request, extra=extra, against=CHOSEN)
