"""Values with their errors: the store of a model, fitted values and their files, stated ranges and spreads."""

from thermid.values._fitted import (
    Draws as Draws,
    FittedValue as FittedValue,
    FittedValues as FittedValues,
    load_store as load_store,
    load_values as load_values,
    rooted as rooted,
    save_store as save_store,
)
from thermid.values._ranges import (
    RANGE_OF as RANGE_OF,
    RangedValue as RangedValue,
    bracketed as bracketed,
    narrowed as narrowed,
    range_shares as range_shares,
    without_spread as without_spread,
)
from thermid.values._spreads import cut as cut, deviation as deviation, read_spread as read_spread
from thermid.values._store import (
    AS_FITTED as AS_FITTED,
    DISTRIBUTIONS as DISTRIBUTIONS,
    EXPECTED as EXPECTED,
    INPUT as INPUT,
    Choice as Choice,
    Cut as Cut,
    Distribution as Distribution,
    Kind as Kind,
    LaterTable as LaterTable,
    LeftOut as LeftOut,
    Logarithm as Logarithm,
    LogNormal as LogNormal,
    Normal as Normal,
    Shifted as Shifted,
    Source as Source,
    State as State,
    Store as Store,
    Uniform as Uniform,
    ValueOrigin as ValueOrigin,
    deviated as deviated,
    domain as domain,
    error_table_of as error_table_of,
    graft as graft,
    structural_under as structural_under,
    uniforms as uniforms,
)
from thermid.values._value_files import Filed as Filed, hand_values as hand_values
