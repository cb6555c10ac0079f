"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.campaign.stages import (
    Correlation as Correlation,
    CriteriaSet as CriteriaSet,
    Limits as Limits,
    Margin as Margin,
    check_limits as check_limits,
    correlate as correlate,
    heater_duty as heater_duty,
    load_limits as load_limits,
    margins as margins,
)
from thermid.prediction.members import (
    Hold as Hold,
    HoldQuestion as HoldQuestion,
    UncertainRuns as UncertainRuns,
    hold as hold,
    load_hold as load_hold,
    sobol_of as sobol_of,
    uncertain_runs as uncertain_runs,
)
from thermid.prediction.reduction import Reduction as Reduction, assumed as assumed, macro_model as macro_model, reduce as reduce
from thermid.qualify.plans import (
    Plan as Plan,
    Qualification as Qualification,
    check_delivery as check_delivery,
    deliver as deliver,
    load_plan as load_plan,
    run_plan as run_plan,
)
from thermid.qualify.profiles import (
    ProfileRun as ProfileRun,
    ThermalProfile as ThermalProfile,
    equivalent_cycles as equivalent_cycles,
    load_profile as load_profile,
    profile_names as profile_names,
    profile_of as profile_of,
    run_profile as run_profile,
)
