"""What a fit leaves open of surfaces, joints and assumed values, and of the room and start of a further run."""

from thermid.fit._error_model.courses import (
    FREE_AIR as FREE_AIR,
    OperatingPoint as OperatingPoint,
    constant_coefficients as constant_coefficients,
)
from thermid.fit._error_model.discrepancy import (
    KEY as KEY,
    MAX_GAS_CONDUCTANCE as MAX_GAS_CONDUCTANCE,
    Discrepancy as Discrepancy,
    contacts_in_other_gas as contacts_in_other_gas,
    discrepancy as discrepancy,
    discrepancy_kept as discrepancy_kept,
    kept_in as kept_in,
    told_first as told_first,
)
from thermid.fit._error_model.own_values import (
    BALANCE as BALANCE,
    OwnValue as OwnValue,
    own_value as own_value,
    own_values_kept as own_values_kept,
)
