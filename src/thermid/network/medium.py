"""What each gas does to a conductor, from one atmosphere to vacuum, constant or changing in time.

Pressure, gravity, wind and kind belong to a named gas node: the ambient, a volume that is vented with a time constant, a sealed one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from thermid.dual import Number
from thermid.errors import ScenarioError
from thermid.memo import Memo
from thermid.model.laws.signal import Constant, Signal, Table
from thermid.model.parts.elements import MadeIn
from thermid.model.parts.kinds import Law
from thermid.model.tree.flat import FlatConductor
from thermid.network.environment import GROUND, Environment
from thermid.network.irradiation import Irradiation, Sky
from thermid.network.pressure import levels_of, sampled, shares, stream, vented
from thermid.network.rarefied import GasState, correlated, gap, thinned
from thermid.network.rows import ConductorRow
from thermid.physics.constants import ATMOSPHERE, STANDARD_GRAVITY
from thermid.physics.gas import gas_named
from thermid.physics.radiation import radiation_coefficient

Array = NDArray[np.float64]

VACUUM_LIMIT = 1e-2
"""Pressure below which gas carries no heat worth counting between walls of equipment. [Pa]"""
AIR_RANGE = (0.85 * ATMOSPHERE, 1.1 * ATMOSPHERE)
"""Pressures at which a coefficient fitted on the ground is used as it is. [Pa]"""


@dataclass(frozen=True)
class Media:
    """What surrounds a model: the state of every gas node, and what falls on outer surfaces.

    Parameters
    ----------
    environments : dict     Gas node -> Environment; ``*`` stands for every gas not named; one atmosphere where none is given.
    as_printed : bool       Whether convection is set to zero as the source document does, radiation inside it included: a bound.
    irradiation : dict      Surface -> what falls on it; ``*`` for every surface outdoors.
    seconds : float         How long the run lasts that the signals of gases are drawn for. [s]
    memo : Memo             States of gases, and winds in time.
    """

    environments: Mapping[str, Environment] = field(default_factory=dict)
    as_printed: bool = False
    irradiation: Mapping[str, Irradiation | Sky] = field(default_factory=dict)
    seconds: float = 0.0
    memo: Memo = field(init=False, default_factory=Memo, compare=False, repr=False)

    def signals(self) -> dict[str, Signal]:
        """Return what rows of gases that change in time are multiplied by."""
        out: dict[str, Signal] = {}
        for gas, environment in self.environments.items():
            p = self._pressure(gas, environment)
            if environment.windy and not (isinstance(p, Constant) and isinstance(environment.wind, Constant)):
                out |= {f"wind {gas} {k}": w for k, w in enumerate(shares(*self._stream(gas, p, environment)))}
            if isinstance(p, Constant):
                continue
            if isinstance(p, Table) and self._jumps(p):
                out[f"gas {gas}"] = p.mapped(_present)
                out[f"no gas {gas}"] = p.mapped(lambda level: 1.0 - _present(level))
            natural = sampled(p, self.seconds).mapped(environment.natural)
            out[f"pressure {gas}"] = p
            out[f"natural {gas}"] = natural
            out[f"rest {gas}"] = natural.mapped(lambda share: 1.0 - share)
        return out

    def _pressure(self, gas: str, environment: Environment) -> Signal:
        """Return the pressure of a gas node, that of a vented volume worked out."""
        own: Signal = environment.pressure.drawn(self.seconds)
        if not environment.vented:
            return own
        if environment.vented == gas or self._environment(environment.vented).vented:
            raise ScenarioError(f"'{gas}' is vented to '{environment.vented}', which has no pressure of its own.", "environment")
        outside = self._environment(environment.vented).pressure.drawn(self.seconds)
        return vented(own, outside, environment.time_constant, f"environment.{gas}")

    def pressure(self, gas: str) -> Signal:
        """Return the pressure of a gas node in time; gases that share one share the signal. [Pa]"""
        key = self._key(gas)
        return self.memo.made(("pressure", key), lambda: self._pressure(key, self._environment(key)))

    def gas(self, gas: str) -> str:
        """Return which gas a gas node is."""
        return self._environment(gas).gas

    def _key(self, gas: str) -> str:
        return gas if gas in self.environments else "*"

    def _environment(self, gas: str) -> Environment:
        return self.environments.get(self._key(gas), GROUND)

    def _jumps(self, p: Signal) -> bool:
        """Return whether a pressure only jumps between that of the ground and vacuum."""
        if not (isinstance(p, Table) and p.held):
            return False
        levels = p.levels
        air = (levels >= AIR_RANGE[0]) & (levels <= AIR_RANGE[1])
        return bool((air | (levels <= VACUUM_LIMIT)).all())

    def _state(self, gas: str) -> str:
        """Return air, vacuum, jumping or thin for a gas node; asked for every conductor of every evaluation, worked out once."""
        key = self._key(gas)
        return self.memo.made(("state", key), lambda: self._state_of(key))

    def _state_of(self, gas: str) -> str:
        environment = self._environment(gas)
        p = self._pressure(gas, environment)
        lowest, highest = p.bounds
        if highest <= VACUUM_LIMIT:
            return "vacuum"
        if abs(environment.gravity - STANDARD_GRAVITY) > 0.01 * STANDARD_GRAVITY:
            return "thin"
        if lowest >= AIR_RANGE[0] and highest <= AIR_RANGE[1]:
            return "air"
        return "jumping" if self._jumps(p) else "thin"

    def _gas(self, gas: str, where: str) -> GasState:
        """Return a gas as rows see it."""
        key, environment = self._key(gas), self._environment(gas)
        p = self._pressure(key, environment)
        kind = gas_named(environment.gas, where)
        steady, wind = isinstance(p, Constant), environment.wind
        base = (
            GasState(kind, p.value, float(environment.natural(p.value))) if isinstance(p, Constant) else GasState(kind, 1.0, 1.0, key=key)
        )
        if not environment.windy:
            return base
        if steady and isinstance(wind, Constant):
            return replace(base, wind=wind.value)
        return replace(base, levels=tuple(self._stream(key, p, environment)[1].tolist()), gust=f"wind {key}")

    def _stream(self, key: str, pressure: Signal, environment: Environment) -> tuple[Table, Array]:
        """Return the wind of a gas in time, thinned as its gas is, and the levels between which it is interpolated. [m/s]"""

        def made() -> tuple[Table, Array]:
            given = stream(environment.wind, pressure, self.seconds)
            return given, levels_of(given)

        return self.memo.made(("stream", key), made)

    def empty(self, gas: str) -> bool:
        """Return whether there is no gas at a gas node at any time."""
        return self._state(gas) == "vacuum"

    def made_in(self, gas: str) -> MadeIn:
        """Return the state of a gas that stays, for a model that is reduced in it."""
        environment = self._environment(gas)
        wind = environment.wind.bounds[1]
        return MadeIn(self.lowest(gas), environment.gravity, environment.gas, wind)

    def as_made(self, gas: str, made: MadeIn) -> bool:
        """Return whether a gas, ``*`` for every one, is at all times in the state in which a model was reduced."""
        if gas == "*":
            return all(self.as_made(each, made) for each in self.environments if each != "*") and self._as_made("*", made)
        return self._as_made(self._key(gas), made)

    def _as_made(self, key: str, made: MadeIn) -> bool:
        environment = self._environment(key)
        lowest, highest = self._pressure(key, environment).bounds
        if made.pressure <= VACUUM_LIMIT:
            return highest <= VACUUM_LIMIT
        low, high = AIR_RANGE if AIR_RANGE[0] <= made.pressure <= AIR_RANGE[1] else (0.99 * made.pressure, 1.01 * made.pressure)
        alike = abs(environment.gravity - made.gravity) <= 0.01 * STANDARD_GRAVITY and environment.gas == made.gas
        winds = np.array(environment.wind.bounds)
        return alike and bool(lowest >= low and highest <= high and (np.abs(winds - made.wind) <= 0.01 * made.wind).all())

    def lowest(self, gas: str) -> float:
        """Return the lowest pressure that a gas node has. [Pa]"""
        key = self._key(gas)
        return self._pressure(key, self._environment(key)).bounds[0]

    def changed(self, gas: str) -> bool:
        """Return whether a gas is at any time another than air on the ground."""
        return self._state(gas) != "air" or self._environment(gas).gas != "air"

    def buoyancy(self, c: FlatConductor, temperature: Array, times: Array) -> Array:
        """Return g beta / (nu alpha) (times,) of what fills a gap; times difference and cube of length, Ra. [1/(K m^3)]"""
        environment = self._environment(c.gas)
        gas = gas_named(c.words.get("gas", environment.gas), c.where)
        pressure = self._pressure(self._key(c.gas), environment).at(times)
        at = gas.at(temperature, np.maximum(pressure, 1e-30))
        return np.asarray(environment.gravity * at.expansion_at(temperature) / (at.kinematic_viscosity * at.thermal_diffusivity()))

    def remarks(self, conductors: Iterable[FlatConductor]) -> tuple[str, ...]:
        """Return a sentence for each wind that does not reach a fixed coefficient."""
        every, out = list(conductors), []  # type: list[FlatConductor], list[str]
        for gas in dict.fromkeys(c.gas for c in every):
            if self._environment(gas).windy:
                fixed = [c.path for c in every if c.gas == gas and c.kind in ("convection", "effective") and "htc.length" not in c.fields]
                out += [
                    f"the wind in '{gas}' does not change {', '.join(repr(p) for p in fixed)}: a coefficient that is given stays as it is;"
                    " htc = { length = ... } takes it from a correlation, with wind"
                ] * bool(fixed)
        return tuple(out)

    def rows(self, c: FlatConductor, law: Law, fields: Mapping[str, Number], emissivity: Number | None) -> tuple[ConductorRow, ...]:
        """Return the rows that a conductor is, in the state of its gas.

        Raises
        ------
        ScenarioError   When an effective coefficient meets another pressure without an emissivity to keep, or another gas.
        """

        def row(form: str, coefficients: tuple[Number, ...], signal: str = "") -> ConductorRow:
            return ConductorRow(c.path, form, c.ends, coefficients, c.curve, signal)

        if law.medium in ("solid", "radiation"):
            return (row(law.form, law.coefficients),)
        state = self._state(c.gas)
        if law.medium == "left":
            return self._left(c, law, state)
        if law.medium == "fin":
            return self._fin(c, law, state)
        if law.medium in ("rest", "correlation"):
            at = self._gas(c.gas, c.where)
            if at.pressure == 0.0:
                return (row("linear", (0.0 * law.coefficients[0],)),)
            return (gap(c, law, at),) if law.medium == "rest" else correlated(c, law, at)
        if state == "air" and self._environment(c.gas).gas == "air":
            return (row(law.form, law.coefficients),)
        gone = (row(law.form, (0.0 * law.coefficients[0], *law.coefficients[1:])),)
        if state == "vacuum" and (law.medium == "gas" or self.as_printed):
            return gone
        if self.as_printed and state == "jumping":
            return (row(law.form, law.coefficients, f"gas {self._key(c.gas)}"),)
        if state == "vacuum":
            return gone if c.sees else (row("radiation", self._kept(c, fields, emissivity)),)
        return self._changed(c, law, fields, emissivity, state)

    def _changed(
        self, c: FlatConductor, law: Law, fields: Mapping[str, Number], emissivity: Number | None, state: str
    ) -> tuple[ConductorRow, ...]:
        """Return the rows of a coefficient that was fitted in air on the ground, where the gas is another or changes."""
        own = self._environment(c.gas)
        if own.gas != "air":
            raise ScenarioError(
                f"the coefficient of '{c.path}' was found in air and does not hold in {own.gas}; give a correlation, or a gap.", c.where
            )
        radiation: tuple[ConductorRow, ...] = ()
        kept = self._kept(c, fields, emissivity) if law.medium == "mixed" and not (self.as_printed or c.sees) else ()
        if state == "jumping":
            key = self._key(c.gas)
            present = ConductorRow(c.path, law.form, c.ends, law.coefficients, c.curve, f"gas {key}")
            return (present, ConductorRow(c.path, "radiation", c.ends, kept, None, f"no gas {key}")) if kept else (present,)
        at = self._gas(c.gas, c.where)
        if kept:
            share = 1.0 if at.key else 1.0 - at.natural
            radiation = (ConductorRow(c.path, "radiation", c.ends, (share * kept[0],), None, at.named("rest")),)
        return *thinned(c, law, fields["area"], at), *radiation

    def _left(self, c: FlatConductor, law: Law, state: str) -> tuple[ConductorRow, ...]:
        """Return the row of the radiation that an effective coefficient leaves to what its surface sees, for the gas that is gone."""
        share, signal = {"air": (0.0, ""), "vacuum": (1.0, ""), "jumping": (1.0, f"no gas {self._key(c.gas)}")}.get(state, (0.0, "thin"))
        if signal == "thin":
            at = self._gas(c.gas, c.where)
            share, signal = (1.0 if at.key else 1.0 - at.natural), at.named("rest")
        return (ConductorRow(c.path, law.form, c.ends, ((0.0 if self.as_printed else share) * law.coefficients[0],), None, signal),)

    def _fin(self, c: FlatConductor, law: Law, state: str) -> tuple[ConductorRow, ...]:
        """Return the rows of a lead's conductance: that in air, and that without, each for its share of the gas."""
        air, bare, *radiating = law.coefficients

        def row(conductance: Number, signal: str = "") -> ConductorRow:
            return ConductorRow(c.path, "linear", c.ends, (conductance,), None, signal)

        if "to" not in c.words:
            return (row(bare),)
        if state == "air" and self._environment(c.gas).gas == "air":
            return (row(air),)
        if not (radiating or self.as_printed):
            raise self._unknown_share(c)
        left = bare if self.as_printed else radiating[0]
        if state == "vacuum":
            return (row(left),)
        if self._environment(c.gas).gas != "air":
            raise ScenarioError(
                f"the coefficient of '{c.path}' was found in air and does not hold in {self._environment(c.gas).gas}.", c.where
            )
        if state == "jumping":
            key = self._key(c.gas)
            return row(air, f"gas {key}"), row(left, f"no gas {key}")
        at = self._gas(c.gas, c.where)
        share = (1.0, 1.0) if at.key else (at.natural, 1.0 - at.natural)
        return row(share[0] * air, at.named("natural")), row(share[1] * left, at.named("rest"))

    @staticmethod
    def _unknown_share(c: FlatConductor) -> ScenarioError:
        return ScenarioError(
            f"the coefficient of '{c.path}' is effective: it contains radiation, which vacuum does not take away. "
            "Give the surface's emissivity or its finish, "
            "or ask for vacuum as printed (--as-printed), which sets it to zero and is an upper bound.",
            c.where,
        )

    def _kept(self, c: FlatConductor, fields: Mapping[str, Number], emissivity: Number | None) -> tuple[Number, ...]:
        """Return the radiation that an effective coefficient leaves without gas."""
        if emissivity is None:
            raise self._unknown_share(c)
        return (radiation_coefficient(emissivity, fields["area"]),)


def _present(pressure: Array) -> Array:
    """Return 1 where there is gas at a pressure [Pa] and 0 where there is none (times,). [-]"""
    return np.asarray(pressure > VACUUM_LIMIT, dtype=float)
