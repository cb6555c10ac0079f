from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Ints: TypeAlias = NDArray[np.int32]
_Reals: TypeAlias = NDArray[np.float64]
_Csr: TypeAlias = tuple[_Ints, _Ints, _Reals, int]

# Kinds of inputs
SAMPLED_LINEAR: Final[int]
SAMPLED_HOLD: Final[int]
SINE: Final[int]
CONSTANT: Final[int]
# Losses
SQUARE: Final[int]
SOFT_L1: Final[int]
HUBER: Final[int]
CAUCHY: Final[int]
# Status of a run
OK: Final[int]
MAX_STEPS: Final[int]
STEP_UNDERFLOW: Final[int]
NEWTON_FAILED: Final[int]
NON_FINITE: Final[int]
RUN_AWAY: Final[int]
SINGULAR_NODE: Final[int]
BAD_INPUT: Final[int]
CHATTER: Final[int]
TOO_HOT: Final[int]

# The tables of laws: form -> (kind, coefficients, tables, linear in temperatures, one way). Each kind is also a constant by the name
# in its row of laws.hpp, which only tests use.
CONDUCTOR_LAWS: Final[dict[str, tuple[int, int, int, bool, bool]]]
LOAD_LAWS: Final[dict[str, tuple[int, int, int, bool, bool]]]
CONTROL_LAWS: Final[dict[str, tuple[int, int, int, bool, bool]]]
GAS_ANCHOR: Final[float]
SMOOTHING: Final[float]

def conductor_heat(
    kind: int, hot: _Reals, cold: _Reals, coefficients: _Reals, tables: Sequence[tuple[_Reals, _Reals, _Reals]], by: int = -1
) -> _Reals: ...
def conductor_lanes(
    kind: int, hot: _Reals, cold: _Reals, coefficients: _Reals, tables: Sequence[tuple[_Reals, _Reals, _Reals]], simd: str = ...
) -> _Reals: ...
def modal(
    problem: Problem,
    coef: _Reals,
    T0: _Reals,
    t0: float,
    t_end: float,
    output_times: _Reals,
    output_nodes: _Ints,
    turnings: bool = False,
    sums: tuple[_Ints, _Ints, _Reals] | None = None,
) -> tuple[int, int, float, int, _Reals, _Reals, _Reals, _Reals, tuple[_Ints, _Reals, _Reals]]: ...
def tableau() -> tuple[_Reals, _Reals, _Reals, _Reals]: ...

class Result:
    @property
    def status(self) -> int: ...
    @property
    def node(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def filled(self) -> int: ...
    @property
    def steps(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def newton_iterations(self) -> int: ...
    @property
    def factorisations(self) -> int: ...
    @property
    def traces(self) -> _Reals: ...
    @property
    def sensitivities(self) -> _Reals | None: ...
    @property
    def final_temperatures(self) -> _Reals: ...
    @property
    def final_sensitivities(self) -> _Reals | None: ...
    @property
    def on(self) -> _Ints: ...
    @property
    def event_times(self) -> _Reals: ...
    @property
    def event_controls(self) -> _Ints: ...
    @property
    def event_states(self) -> _Ints: ...
    @property
    def event_before(self) -> _Ints: ...
    @property
    def load_energy(self) -> _Reals: ...
    @property
    def boundary_energy(self) -> _Reals: ...
    @property
    def conductor_energy(self) -> _Reals: ...
    @property
    def turnings(self) -> tuple[_Ints, _Reals, _Reals]: ...

class Problem:
    def __init__(
        self,
        capacity: _Ints,
        coef_input: _Ints,
        boundary_gain: _Ints,
        boundary_offset: _Ints,
        conductor_kind: _Ints,
        conductor_a: _Ints,
        conductor_b: _Ints,
        conductor_coef: _Ints,
        conductor_table: _Ints,
        load_kind: _Ints,
        load_node: _Ints,
        load_coef: _Ints,
        load_sensor: _Ints,
        load_table: _Ints,
        load_control: _Ints,
        control_kind: _Ints,
        control_sensor: _Ints,
        control_coef: _Ints,
        tables: Sequence[tuple[_Reals, _Reals, _Reals]],
        inputs: Sequence[tuple[int, _Reals, _Reals]],
        follow: Mapping[str, Any] | None = None,
        edges: Sequence[tuple[int, float, float, int]] = (),
    ) -> None: ...
    @property
    def nodes(self) -> int: ...
    @property
    def boundaries(self) -> int: ...
    @property
    def coefficients(self) -> int: ...
    @property
    def products(self) -> float: ...
    def integrate(
        self,
        coef: _Reals,
        T0: _Reals,
        t0: float,
        t_end: float,
        output_times: _Reals,
        output_nodes: _Ints,
        *,
        dcoef: _Csr | None = None,
        dT0: _Reals | None = None,
        rtol: float = ...,
        atol: float = ...,
        input_atol: float = ...,
        max_step: float = ...,
        max_steps: int = ...,
        breaks: _Reals | None = None,
        energy: bool = True,
        on: _Ints | None = None,
        turnings: bool = False,
        sums: tuple[_Ints, _Ints, _Reals] | None = None,
    ) -> Result: ...
    def rhs(
        self, coef: _Reals, T: _Reals, t: float, dcoef: _Csr | None = None, on: _Ints | None = None
    ) -> tuple[_Reals, _Reals, _Reals | None]: ...
    def flows(self, coef: _Reals, T_all: _Reals, t: _Reals) -> _Reals: ...
    def load_powers(self, coef: _Reals, T_all: _Reals, t: _Reals, on: _Ints | None = None) -> _Reals: ...

class Ensemble:
    def __init__(
        self,
        problem: Problem,
        coef: _Reals,
        T0: _Reals,
        t0: float,
        t_end: float,
        output_times: _Reals,
        output_nodes: _Ints,
        *,
        rtol: float = ...,
        atol: float = ...,
        input_atol: float = ...,
        max_step: float = ...,
        max_steps: int = ...,
        breaks: _Reals | None = ...,
        turnings: bool = False,
        simd: str = ...,
    ) -> None: ...
    def advance(self, rows: int, threads: int = ...) -> _Reals: ...
    def switchings(self, member: int) -> tuple[_Reals, _Ints, _Ints, _Ints]: ...
    @property
    def status(self) -> _Ints: ...
    @property
    def node(self) -> _Ints: ...
    @property
    def time(self) -> _Reals: ...
    @property
    def alone(self) -> _Ints: ...
    @property
    def steps(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def simd(self) -> str: ...
    def ended(self, member: int) -> _Reals: ...
    @property
    def turnings(self) -> tuple[_Ints, _Ints, _Reals, _Reals]: ...

def instruction_sets() -> list[str]: ...

# Large networks
LARGE_AUTO: Final[int]
LARGE_RKC2: Final[int]
LARGE_TRBDF2: Final[int]

class LargeResult:
    @property
    def status(self) -> int: ...
    @property
    def node(self) -> int: ...
    @property
    def method(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def rate(self) -> float: ...
    @property
    def longest(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def evaluations(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def traces(self) -> _Reals: ...
    @property
    def fields(self) -> _Reals: ...
    @property
    def final_temperatures(self) -> _Reals: ...
    @property
    def final_states(self) -> _Reals: ...
    @property
    def load_energy(self) -> _Reals: ...
    @property
    def boundary_energy(self) -> _Reals: ...
    @property
    def turnings(self) -> tuple[_Ints, _Reals, _Reals]: ...

class LargeProblem:
    def __init__(
        self,
        capacity: _Reals,
        links: tuple[_Ints, _Reals, _Reals, _Reals] | tuple[_Ints, _Ints, _Reals],
        row_groups: _Ints,
        row_exponents: _Reals,
        row_a: _Ints,
        row_b: _Ints,
        row_coef: _Reals,
        load_groups: _Ints,
        load_node: _Ints,
        load_coef: _Reals,
        load_control: _Reals,
        tags: int,
        boundary_input: _Ints,
        boundary_offset: _Reals,
        tables: Sequence[tuple[_Reals, _Reals, _Reals]],
        inputs: Sequence[tuple[int, _Reals, _Reals]],
        store: _Ints,
    ) -> None: ...
    def integrate(
        self,
        T0: _Reals,
        t0: float,
        t_end: float,
        times: _Reals,
        observed_kind: _Ints,
        observed_indptr: _Ints,
        observed_indices: _Ints,
        observed_weights: _Reals,
        field_times: _Reals,
        *,
        method: int = ...,
        tolerance: float = ...,
        input_atol: float = ...,
        max_step: float = ...,
        max_steps: int = ...,
        breaks: _Reals,
        turnings: bool = False,
    ) -> LargeResult: ...
    def heat(self, T: _Reals, t: float) -> tuple[_Reals, _Reals, _Reals, _Reals, _Reals]: ...

class Readings:
    def __init__(
        self,
        problem: Problem,
        times: _Reals,
        nodes: _Ints,
        node_begin: _Ints,
        index: _Ints,
        index_begin: _Ints,
        values: _Reals,
        scaled: _Ints | None = None,
    ) -> None: ...

class Squares:
    @property
    def status(self) -> int: ...
    @property
    def node(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def steps(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def cost(self) -> float: ...
    @property
    def chi_square(self) -> float: ...
    @property
    def triangle(self) -> _Reals: ...
    @property
    def rotated(self) -> _Reals: ...
    @property
    def sums(self) -> _Reals: ...
    @property
    def mesh(self) -> _Reals: ...

def least_squares(
    problem: Problem,
    readings: Readings,
    coef: _Reals,
    T0: _Reals,
    t0: float,
    t_end: float,
    *,
    sigma: _Reals,
    bias: _Reals,
    bias_column: _Ints,
    weight: _Reals,
    slope: _Reals,
    loss: int = ...,
    knee: float = ...,
    dcoef: _Csr | None = None,
    dT0: _Reals | None = None,
    rtol: float = ...,
    atol: float = ...,
    input_atol: float = ...,
    max_step: float = ...,
    max_steps: int = ...,
    breaks: _Reals | None = None,
    mesh: _Reals | None = None,
    on: _Ints | None = None,
) -> Squares: ...
