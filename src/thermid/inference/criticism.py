"""What is missing in a model, and checks of a fit: candidates, mistakes in a log, structures, energy balance, plausible values."""

from thermid.inference._explain.balance import EnergyBalance as EnergyBalance, energy_balance as energy_balance
from thermid.inference._explain.candidates import Fitted as Fitted, MissingElement as MissingElement
from thermid.inference._explain.criticism import (
    Criticism as Criticism,
    criticise as criticise,
)
from thermid.inference._explain.defects import ExplainedFit as ExplainedFit, asks as asks, explained as explained, summary as summary
from thermid.inference._explain.diagnosis import Diagnosis as Diagnosis, diagnose as diagnose
from thermid.inference._explain.mistakes import Mistakes as Mistakes, find_mistakes as find_mistakes, mistakes_of as mistakes_of
from thermid.inference._explain.plausibility import (
    Plausibility as Plausibility,
    RangeCheck as RangeCheck,
    plausibility as plausibility,
)
from thermid.inference._explain.structures import (
    EvaluationBudget as EvaluationBudget,
    FittedStructure as FittedStructure,
    StructureSearch as StructureSearch,
    fitted_structure as fitted_structure,
    search_structure as search_structure,
)
from thermid.inference._explain.thresholds import (
    CHALLENGES as CHALLENGES,
    EVALUATIONS as EVALUATIONS,
    SPECIFIC_HEAT as SPECIFIC_HEAT,
    WATCHED as WATCHED,
)
