"""How far coefficients may depart from their values: within the structure, and from one kind of run to another."""

from thermid.fit._discrepancy.discrepancy import (
    EXPECTED as EXPECTED,
    FREE_AIR as FREE_AIR,
    KEY as KEY,
    MOST as MOST,
    STREAM as STREAM,
    CoefficientMode as CoefficientMode,
    Discrepancy as Discrepancy,
    ExpectedHeat as ExpectedHeat,
    FlowHistory as FlowHistory,
    OperatingPoint as OperatingPoint,
    alike as alike,
    coefficient_path as coefficient_path,
    conditions_of as conditions_of,
    constant_coefficients as constant_coefficients,
    courses as courses,
    discrepancy as discrepancy,
    discrepancy_kept as discrepancy_kept,
    ending_settled as ending_settled,
    expected_heats as expected_heats,
    kept_in as kept_in,
    losing_gas as losing_gas,
    misfit_kept as misfit_kept,
    patterns_of as patterns_of,
    steady_paths as steady_paths,
    unsaid_paths as unsaid_paths,
    with_patterns as with_patterns,
)
from thermid.fit._discrepancy.doubts import SETTLING_PACES as SETTLING_PACES
from thermid.fit._discrepancy.own_values import (
    BALANCE as BALANCE,
    OwnValue as OwnValue,
    own_value as own_value,
    own_values_kept as own_values_kept,
)
