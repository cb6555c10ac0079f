"""An effective coefficient taken apart into radiation and convection, with what is known of each, or the refusal where they do not fit.

Unknown are the logarithms of the emissivities. Known are a prior by finish, and per surface what a correlation says of convection, which
with the radiation makes the coefficient that was fitted; gas at rest conducts a least amount. The fitted parameters are considered, not
changed: their errors and correlations go into those of the emissivities.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thermid.base.errors import IdentificationError, quoted, refuse_unknown
from thermid.base.results import Named
from thermid.base.units import Array, value_of
from thermid.fit.calibration import Calibration
from thermid.fit.error_model import discrepancy_kept
from thermid.model.tree import FINISH_CORRELATION, FlatConductor, Model, Standing, StatedRange, exposed_area
from thermid.physics.air import dry_air
from thermid.physics.plates import body_htc, conduction_floor
from thermid.physics.radiation import linearised_htc
from thermid.simulation.runs import Network, Scenario, compile_network, steady
from thermid.values.store import FittedValue, FittedValues, read_spread

MIN_RISE = 0.2
"""Difference below which a test says nothing of a coefficient. [K]"""
CORRELATION_SD = 0.25
"""What a correlation of natural convection promises at equipment, relative, one sigma. [-]"""
MAX_DISAGREEMENT = 2.0
"""Standard deviations beyond which a correlation and what is left of the coefficient disagree. [-]"""
MIN_POSSIBLE_PROBABILITY = 0.025
"""Probability below which no emissivity of the finish leaves room for the conduction of gas at rest. [-]"""


@dataclass(frozen=True)
class SplitSurface:
    """One effective coefficient split into radiation and convection. Errors are one sigma.

    Parameters
    ----------
    path : str                          Of the surface.
    effective, effective_error : float  The coefficient in air. [W/(m^2 K)]
    radiative, convective : float       Its parts at the temperatures of the fit. [W/(m^2 K)]
    error : float                       Of the radiative part; that of the convective one with `effective_error`. [W/(m^2 K)]
    emissivity, emissivity_error : float    [-]
    prior : str                         Where the emissivity was first taken from.
    expected : float                    Convection by the correlation for the body. [W/(m^2 K)]
    floor : float                       Conduction of gas at rest, the least. [W/(m^2 K)]
    surface, gas : float                Temperatures of the fit. [K]
    used : bool                         Whether the correlation had a say.
    remark : str                        What a reader must know.
    """

    path: str
    effective: float
    effective_error: float
    radiative: float
    convective: float
    error: float
    emissivity: float
    emissivity_error: float
    prior: str
    expected: float
    floor: float
    surface: float
    gas: float
    used: bool
    remark: str = ""

    @property
    def correlation(self) -> float:
        """Correlation of the errors of both parts: what is not radiation is convection. [-]"""
        return -self.error / math.hypot(self.error, self.effective_error) if self.error else 0.0

    def __str__(self) -> str:
        """The parts in one line, the remark in a second."""
        parts_text = (
            f"{self.effective:.3g} = {self.radiative:.2g} radiation + {self.convective:.2g} convection, +- {self.error:.2g} between them"
        )
        line = f"{self.path}: {parts_text} [W/(m^2 K)]   emissivity {self.emissivity:.3g} +- {self.emissivity_error:.1g} ({self.prior})"
        return f"{line}\n  remark: {self.remark}" if self.remark else line


@dataclass(frozen=True, eq=False)
class Split(Named[SplitSurface]):
    """Effective coefficients taken apart.

    Parameters
    ----------
    surfaces : tuple        One entry per surface.
    values : FittedValues   The fitted parameters and the emissivities, with their joint covariance: what a prediction without gas rests on.
    model : Model           The model with all of them laid over it.
    caution : str           What no error here covers; empty where there is nothing.
    """

    surfaces: tuple[SplitSurface, ...]
    values: FittedValues
    model: Model
    caution: str = ""

    _refusal = "no surface '{}' was split."

    def _entries(self) -> Mapping[str, SplitSurface]:
        """Return surface -> its entry."""
        return {s.path: s for s in self.surfaces}

    def __str__(self) -> str:
        """One entry per surface, and what no error covers."""
        return "\n".join([*map(str, self.surfaces), *([f"caution: {self.caution}"] if self.caution else [])])


@dataclass(frozen=True)
class EmissivityPrior:
    """Prior of an emissivity, normal in its logarithm.

    Parameters
    ----------
    mean, log_sd : float    Median of the emissivity, and standard deviation of its logarithm. [-]
    text : str              Where it comes from.
    finish : str            The finish, where it is one.
    """

    mean: float
    log_sd: float
    text: str
    finish: str = ""


@dataclass(frozen=True)
class Part:
    """A surface with an effective coefficient, and the inputs of its split into radiation and convection.

    Parameters
    ----------
    path, where : str               The surface, and its place in the deck.
    emissivity, fitted : str        Paths of the values behind its emissivity and its coefficient.
    prior : EmissivityPrior                   Of the emissivity.
    effective, effective_error : float      The coefficient and its standard error. [W/(m^2 K)]
    area : float                    What convects and radiates. [m^2]
    surface, gas : float            Temperatures of the fit. [K]
    black : float                   Coefficient of black radiation there. [W/(m^2 K)]
    expected, floor : float         Convection by correlation, and conduction of gas at rest. [W/(m^2 K)]
    """

    path: str
    where: str
    emissivity: str
    fitted: str
    prior: EmissivityPrior
    effective: float
    effective_error: float
    area: float
    surface: float
    gas: float
    black: float
    expected: float
    floor: float

    @property
    def rise(self) -> float:
        """Surface temperature less gas temperature. [K]"""
        return self.surface - self.gas

    def refusal(self) -> str:
        """Return why the coefficient cannot be split, with the area, power or sensor position that would explain it."""
        radiation = self.black * self.prior.mean * math.exp(-1.959964 * self.prior.log_sd)
        need = radiation + self.floor
        share = self.effective / need
        power = self.effective * self.area * abs(self.rise)
        return (
            f"the coefficient of '{self.path}' cannot be separated into convection and radiation: {self.effective:.3g} W/(m^2 K) in "
            f"air, but {self.prior.text} radiates at"
            f" least {radiation:.2g} and gas at rest conducts at least {self.floor:.2g} W/(m^2 K). One of these is wrong: the area (at most"
            f" {self.area * share:.3g} m^2 instead of {self.area:.3g}; check for faces counted twice or inside), the power (at least"
            f" {power / share:.3g} W through this surface instead of {power:.3g} W), the position of the sensor (the mean surface is at"
            f" most {abs(self.rise) * share:.2g} K above the gas instead of {abs(self.rise):.3g} K: a hot spot?), or the finish."
        )

    def conflict(self, remainder: float, spread: float) -> str:
        """Return the possible causes, in words, of a convective `remainder` +- `spread` [W/(m^2 K)] that disagrees with the correlation."""
        head = (
            f"beside the radiation {remainder:.2g} +- {spread:.2g} W/(m^2 K) remain for convection, but the correlation for a body of this "
            f"area gives {self.expected:.2g}. The correlation was not used. Possible causes:"
        )
        if remainder < self.expected:
            return f"{head} the area (faces counted twice or inside), the power, the position of the sensor, confined air"
        return f"{head} moving air, heat through mounts and leads (which remains in vacuum), the area, the power"


def parts_of(
    model: Model,
    values: FittedValues,
    wanted: Sequence[str],
    conditions: Scenario | Mapping[str, tuple[float, float]],
    priors: Mapping[str, Any],
) -> list[Part]:
    """Return the inputs of the split of each wanted surface; arguments as in `split_values`.

    Raises
    ------
    IdentificationError   When a surface has no effective coefficient, or nothing says what its emissivity may be.
    """
    network = compile_network(model)
    effective = {c.path: c for c in network.flat.conductors if c.kind == "effective"}
    chosen = [model.canonical(w) for w in wanted] or list(effective)
    refuse_unknown(chosen, effective, model.title, "'{}' is not a surface with an effective coefficient.", IdentificationError)
    if not chosen:
        raise IdentificationError(
            "no surface has an effective coefficient, so there is nothing to separate.", model.title, code="fit.not-determined"
        )
    if isinstance(conditions, Mapping):
        at = conditions
    else:
        rest = steady(model, conditions)
        at = {p: (rest[effective[p].ends[0]], rest[effective[p].ends[1]]) for p in chosen}
    if not at:
        raise IdentificationError(
            "the temperatures at which the coefficients were fitted are missing. Give a scenario that settles there, or a fit with "
            "its records.",
            network.title,
            code="value.incomplete",
        )
    return [_part(network, effective[p], at.get(p, (math.nan, math.nan)), values, priors) for p in chosen]


def _part(network: Network, c: FlatConductor, at: tuple[float, float], fitted: FittedValues, priors: Mapping[str, Any]) -> Part:
    """Return the inputs of the split of one surface: fitted coefficient, emissivity prior, black radiation, correlation and floor.

    Parameters
    ----------
    at : (float, float)   Temperatures of surface and gas where the coefficient was fitted. [K]

    Raises
    ------
    IdentificationError   When surface and gas differ by no more than `MIN_RISE`.
    """
    values = network.numbers().values
    hot, cold = at
    if not abs(hot - cold) > MIN_RISE:
        raise IdentificationError(
            f"'{c.path}' was never more than {MIN_RISE:g} K from the gas temperature, so its coefficient is not determined.",
            c.where,
            code="fit.not-determined",
        )
    total = value_of(values[c.fields["area"]])
    area = value_of(exposed_area(c.path, values[c.fields["area"]], c.takes, values, c.where))
    effective = value_of(values[c.fields["effective_htc"]])
    root = network.flat.parameters.literal_behind(c.fields["effective_htc"])
    entry = fitted.assignments.get(root)
    air = dry_air(0.5 * (hot + cold))
    return Part(
        c.path,
        c.where,
        _emissivity_path(network, c, fitted),
        entry.path if entry else "",
        _prior(network, c, priors),
        effective,
        entry.error if entry else 0.0,
        area,
        hot,
        cold,
        float(linearised_htc(1.0, hot, cold)),
        float(body_htc(hot, cold, total, air)),
        float(conduction_floor(total, air.conductivity)),
    )


def _emissivity_path(network: Network, c: FlatConductor, fitted: FittedValues) -> str:
    """Return the path of the value behind an emissivity; where instances share a fitted one, the path it was fitted under."""
    if not c.emissivity:
        raise IdentificationError(
            f"the emissivity of '{c.path}' is not stated. Give its finish, such as finish = \"aluminium, machined\", or its"
            " emissivity with min and max.",
            c.where,
            code="value.incomplete",
        )
    root = network.flat.parameters.freeable(c.emissivity, network.flat.names.model.canonical)
    entry = fitted.assignments.get(root)
    return entry.path if entry else root


def _prior(network: Network, c: FlatConductor, priors: Mapping[str, Any]) -> EmissivityPrior:
    """Return the prior of an emissivity: from the caller, else from the finish, else from the bounds in the deck."""
    parameters = network.flat.parameters
    root = parameters.literal_behind(c.emissivity)
    parameter = parameters.table[root].parameter
    value = float(value_of(network.numbers().values[root]))
    chosen = next((v for k, v in priors.items() if network.flat.names.model.canonical(k) in (root, c.emissivity)), None)
    if chosen is not None:
        # mean and standard deviation of an emissivity [-] from a pair, or from what `read_spread` takes
        if not isinstance(chosen, Mapping) and not (isinstance(chosen, list | tuple) and len(chosen) == 2):
            raise IdentificationError(
                f"a prior of an emissivity is a pair such as (0.06, 0.005), not {chosen!r}.", c.path, code="value.wrong-kind"
            )
        law = read_spread(chosen if isinstance(chosen, Mapping) else dict(zip(("mean", "sd"), chosen, strict=True)), "1", value, c.path)
        mean, sd = law.mean, math.sqrt(law.variance)
        if not (0.0 < mean <= 1.0 and sd >= 0.0):
            raise IdentificationError(
                f"an emissivity of {mean:g} +- {sd:g} is not a valid prior. Give a mean from 0 to 1.", c.path, code="value.outside-range"
            )
        return EmissivityPrior(mean, sd / mean, f"an emissivity of {mean:.3g} +- {sd:.2g}")
    if not 0.0 < value <= 1.0:
        raise IdentificationError(f"an emissivity of {value:g} is not possible. Give 0 to 1.", c.where, code="value.outside-range")
    low, high, stated = parameter.minimum, parameter.maximum, parameter.stated_range
    if stated is None and low is not None and high is not None and 0.0 < low < high:
        stated = StatedRange(low, high)
    if stated is not None:
        what = f"finish '{stated.name}'," if stated.name else "an emissivity of"
        return EmissivityPrior(value, stated.log_sd(value), f"{what} {stated.low:.3g} to {stated.high:.3g}", stated.name)
    return EmissivityPrior(value, 0.0, f"an emissivity of {value:.3g}, taken as exact")


def split(
    of: Model | Calibration,
    paths: str | Sequence[str] = (),
    conditions: Scenario | None = None,
    *,
    priors: Mapping[str, Any] | None = None,
) -> Split:
    """Separation of effective coefficients into radiation and convection, with what is known of each.

    Parameters
    ----------
    of : Calibration or Model   A fit, whose records say at which temperatures the coefficients hold; or a model with `conditions`.
    paths : str or sequence     Surfaces; every one with an effective coefficient by default.
    conditions : Scenario       What was done when the coefficients were fitted, settled; for a model.
    priors : dict               Path of an emissivity -> (mean, standard deviation), such as ``(0.06, 0.003)`` or ``("0.06", "5 [%]")``,
                                instead of the finish. [-]

    Raises
    ------
    IdentificationError   When a coefficient leaves no room for the radiation of its finish beside the conduction of gas at rest; the
                          message names the refusal. When nothing says what the emissivity may be.

    References
    ----------
    Schmidt's filter for parameters that are considered and not estimated: Jazwinski, Stochastic Processes and Filtering Theory, 1970,
    section 8.4.
    """
    wanted = (paths,) if isinstance(paths, str) else tuple(paths)
    base = of.values.bare() if isinstance(of, Calibration) else FittedValues(of.title, {}, np.zeros((0, 0)))
    model = of.model if isinstance(of, Calibration) else of
    discrepancy = discrepancy_kept(of.values) if isinstance(of, Calibration) else None
    surfaces = conditions if conditions is not None else discrepancy.surfaces if discrepancy is not None else {}
    return split_values(model, base, wanted, surfaces, priors or {})


def split_values(
    model: Model,
    base: FittedValues,
    wanted: Sequence[str],
    at: Scenario | Mapping[str, tuple[float, float]],
    priors: Mapping[str, Any] | None = None,
) -> Split:
    """Return effective coefficients taken apart, from fitted values and where these were found.

    Parameters
    ----------
    model : Model               With the values laid over it.
    base : FittedValues         The fitted parameters.
    wanted : sequence of str    Surfaces; every one with an effective coefficient where none is named.
    at : Scenario or dict       What was done then, settled; or surface -> its temperature and its gas's. [K]
    priors : dict               As in `split`.
    """
    parts = parts_of(model, base, wanted, at, priors or {})
    joint = _Joint(base, parts)
    done = [joint.condition(part) for part in parts]
    values = joint.values(Standing.worst([model.standing, *([base.standing] if base else [])]))
    fresh = {p: v for p, v in values.assignments.items() if v.origin.startswith("split")}
    split_model = model.with_values(fresh, f"split of '{values.stage}'")
    entries = tuple(joint.entry(p, used, remark) for p, (used, remark) in zip(parts, done, strict=True))
    return Split(entries, values, split_model, _caution(model, base, parts))


def _caution(model: Model, base: FittedValues, parts: Sequence[Part]) -> str:
    """Return the caution that masses fitted with constant coefficients have absorbed their error; empty where none was."""
    flat = compile_network(model).flat
    roots = dict.fromkeys(flat.parameters.literal_behind(path) for node in flat.nodes for path in node.fields.values())
    masses = [path for path in roots if path in base]
    if not masses or not any(part.fitted in base and part.emissivity not in base for part in parts):
        return ""
    was = "was" if len(masses) == 1 else "were"
    return (
        f"{quoted(masses)} {was} fitted together with constant coefficients, although those of air grow with the difference. The "
        "masses absorb several per cent of a warm-up in this way, so a transient without gas is wrong by that share (0.3 K of a rise "
        "of 15 K on a painted box, 2 K on an assembly). Steady states are not affected. `thermid predict` includes this error; the "
        "errors here, and members drawn from `values`, do not. To avoid it, fit a law of natural convection and the emissivity."
    )


class _Joint:
    """Fitted parameters and emissivities as one normal distribution of fitted forms; emissivities by their logarithms.

    `at` is path -> position, fitted parameters first; `mean` (positions,), `cov` (positions, positions); `fresh`: path -> surface of
    each emissivity that was not fitted.
    The means of fitted parameters stay at zero: they are considered and not estimated.
    """

    def __init__(self, base: FittedValues, parts: Sequence[Part]) -> None:
        """Begin with the fit and the priors of the emissivities that it did not find; those of one finish go together."""
        self.base, n = base, len(base)
        self.at = {path: k for k, path in enumerate(base)}
        fresh = {p.emissivity: p for p in parts if p.emissivity not in self.at}
        self.at |= {path: n + k for k, path in enumerate(fresh)}
        self.mean = np.array([0.0] * n + [math.log(p.prior.mean) for p in fresh.values()])
        self.cov = np.zeros((len(self.at), len(self.at)))
        self.cov[:n, :n] = base.covariance
        self.fresh = fresh
        first = list(fresh.values())
        for i, a in enumerate(first):
            for j, b in enumerate(first):
                share = 1.0 if i == j else FINISH_CORRELATION if a.prior.finish and a.prior.finish == b.prior.finish else 0.0
                self.cov[n + i, n + j] = share * a.prior.log_sd * b.prior.log_sd

    def emissivity(self, part: Part) -> float:
        """Return the best emissivity of a surface so far. [-]"""
        k = self.at[part.emissivity]
        return float(np.exp(self.mean[k])) if part.emissivity in self.fresh else self.base[part.emissivity].value

    def deviation(self, part: Part) -> float:
        """Return the standard deviation of an emissivity. [-]"""
        k = self.at[part.emissivity]
        log = part.emissivity in self.fresh or self.base[part.emissivity].log
        return math.sqrt(max(float(self.cov[k, k]), 0.0)) * (self.emissivity(part) if log else 1.0)

    def _slope(self, part: Part) -> Array:
        """Return the derivative (positions,) of h - e h_black, what is left for convection, by the fitted forms. [W/(m^2 K)]"""
        out = np.zeros(self.mean.size)
        out[self.at[part.emissivity]] = -part.black * self.emissivity(part)
        if part.fitted in self.at:
            out[self.at[part.fitted]] = part.effective if self.base[part.fitted].log else 1.0
        return out

    def condition(self, part: Part) -> tuple[bool, str]:
        """Condition the emissivity of a surface on its coefficient; return whether the correlation was used, and a remark where it was not.

        It is used where it agrees with what radiation leaves, within `MAX_DISAGREEMENT` standard deviations. A fitted emissivity stays.
        """
        if part.emissivity not in self.fresh:
            return False, ""  # fitted itself: two pressures, powers or orientations
        remainder = part.effective - part.black * self.emissivity(part)
        slope = self._slope(part)
        spread = math.sqrt(max(float(slope @ self.cov @ slope), 0.0))
        k, (top, loose) = self.at[part.emissivity], self._ceiling(part)
        # refuse a coefficient that its finish at any likely emissivity exceeds
        if _normal((top - self.mean[k]) / max(math.hypot(math.sqrt(self.cov[k, k]), loose), 1e-12)) < MIN_POSSIBLE_PROBABILITY:
            raise IdentificationError(part.refusal(), part.where)
        doubt = CORRELATION_SD * part.expected
        agrees = abs(remainder - part.expected) <= MAX_DISAGREEMENT * math.hypot(spread, doubt)
        if agrees:
            self._apply_correlation(part, doubt)
        self._cut_at_ceiling(part)
        return agrees, "" if agrees else part.conflict(remainder, spread)

    def _apply_correlation(self, part: Part, doubt: float) -> None:
        """Condition the emissivities on convection by the correlation, whose standard deviation is `doubt`. [W/(m^2 K)]

        Gauss-Newton to the maximum, since radiation bends with the logarithm, then the covariance there.
        """
        k, prior = self.at[part.emissivity], self.mean
        for _ in range(30):
            before, slope = self.mean, self._slope(part)
            remainder = part.effective - part.black * self.emissivity(part) + slope[k] * (prior[k] - before[k])
            self.mean = prior + self._gain(slope, doubt) * (part.expected - remainder)
            if abs(self.mean[k] - before[k]) < 1e-10:
                break
        gain, slope = self._gain(self._slope(part), doubt), self._slope(part)
        keep = np.eye(self.mean.size) - np.outer(gain, slope)  # Joseph's form, which holds for any gain
        self.cov = keep @ self.cov @ keep.T + doubt**2 * np.outer(gain, gain)

    def _gain(self, slope: Array, doubt: float) -> Array:
        """Return the gain (positions,) C s / (s'C s + d^2) of a known convection, in ln of the emissivities per unit of it.

        s is the `slope` (positions,) of the convective coefficient h - e h_black by each position, `doubt` d its standard deviation, both
        in W/(m^2 K), and C the covariance. The gain is zero for fitted parameters, which are only considered (Schmidt).
        """
        gain = self.cov @ slope / float(slope @ self.cov @ slope + doubt**2)
        gain[: len(self.base)] = 0.0
        return np.asarray(gain)

    def _ceiling(self, part: Part) -> tuple[float, float]:
        """Return ln((h - h_gas) / h_black), the largest emissivity beside the conduction of gas at rest, and its standard deviation. [-]"""
        room = max(part.effective - part.floor, 1e-3 * part.effective)
        return math.log(room / part.black), part.effective_error / room

    def _cut_at_ceiling(self, part: Part) -> None:
        """Cut off emissivities that leave less than the conduction of gas at rest: moments of a normal that is cut softly.

        ln e with mean m and variance v is cut at a top of standard deviation l: with w^2 = v + l^2, z = (top - m) / w and g = phi(z) /
        Phi(z) the mean falls by g v / w, the variance by (v^2 / w^2) g (g + z); the others follow along their covariance, but for fitted
        parameters. [-]
        """
        k = self.at[part.emissivity]
        top, loose = self._ceiling(part)
        v = float(self.cov[k, k])
        w = math.hypot(math.sqrt(v), loose)
        if v == 0.0:
            return
        z = (top - self.mean[k]) / w
        ratio = math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi) / max(_normal(z), 1e-300)
        column = self.cov[:, k] / v
        column[: len(self.base)] = 0.0
        self.mean = self.mean - column * (v / w * ratio)
        self.cov = self.cov - np.outer(column, column) * (v * v / (w * w) * ratio * (ratio + z))

    def values(self, standing: Standing) -> FittedValues:
        """Return the fitted parameters and the emissivities with their joint covariance; the latter have a standing of what was split."""
        items: dict[str, Any] = dict(self.base.items())
        for path, part in self.fresh.items():
            value, error = self.emissivity(part), self.deviation(part)
            origin = f"split: {part.prior.text}"
            items[path] = FittedValue(path, value, error, error, True, "1", part.prior.mean, (0.0, 1.0), origin, standing=standing)
        return replace(self.base, items_=items, covariance=self.cov)  # one covariance, drawn from priors as well

    def entry(self, part: Part, used: bool, remark: str) -> SplitSurface:
        """Return what was found for a surface."""
        value, error = self.emissivity(part), self.deviation(part)
        radiative = part.black * value
        return SplitSurface(
            part.path,
            part.effective,
            part.effective_error,
            radiative,
            part.effective - radiative,
            part.black * error,
            value,
            error,
            part.prior.text if part.emissivity in self.fresh else "fitted",
            part.expected,
            part.floor,
            part.surface,
            part.gas,
            used,
            remark,
        )


def _normal(z: float) -> float:
    """Return the standard normal distribution function at z. [-]"""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))
