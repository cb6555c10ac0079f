"""thermid: thermal identification. Lumped thermal models built part by part, fitted to logs level by level, and asked about the rest.

The five types to know are `Model`, `Scenario`, `Solution`, `Record` and `Calibration`; what is not used in every project stands in a
namespace by activity: `td.design`, `td.qualify`, `td.site` and so on.
"""

from __future__ import annotations

import sys
from difflib import get_close_matches
from importlib import import_module
from types import FunctionType, ModuleType

_TOP = {
    "celsius": "base.units",
    "quantity": "base.units",
    "Model": "model.tree",
    "load_model": "model.tree",
    "model_from_dict": "model.tree",
    "save_model": "model.tree",
    "Block": "model.tree",
    "Scenario": "simulation.runs",
    "load_scenario": "simulation.runs",
    "Options": "simulation.runs",
    "simulate": "simulation.runs",
    "prepare": "simulation.runs",
    "steady": "simulation.runs",
    "ensemble": "simulation.runs",
    "Solution": "simulation.runs",
    "Channel": "measure.records",
    "Record": "measure.records",
    "look": "measure.looks",
    "read_record": "measure.readers",
    "compare": "campaign.stages",
    "calibrate": "fit.calibration",
    "Calibration": "fit.calibration",
    "identifiability": "inference.intervals",
    "load_values": "values.store",
    "Campaign": "campaign.stages",
    "run_stages": "campaign.stages",
    "predict": "prediction.bands",
    "Prediction": "prediction.bands",
    "Criteria": "campaign.stages",
    "validate": "campaign.stages",
    "Verdict": "campaign.stages",
    "report": "reporting.pages",
    "ThermidError": "base.errors",
    "ThermidWarning": "base.errors",
}
"""Public name -> its module, in reading order."""

_NAMESPACES = {
    "model": {
        "Identity": "model.tree",
        "Replacement": "model.tree",
        "identities": "model.tree",
        "law": "model.tree",
        "ledger": "model.tree",
        "Standing": "model.tree",
    },
    "simulation": {
        "compile_network": "simulation.runs",
        "state_space": "simulation.runs",
        "modes": "simulation.runs",
        "Environment": "simulation.runs",
        "Irradiation": "simulation.runs",
        "Simulator": "simulation.runs",
        "draw": "simulation.runs",
        "steady_levels": "simulation.runs",
        "Steady": "simulation.runs",
        "Ensemble": "simulation.runs",
        "KeptTasks": "simulation.runs",
        "BlockSolution": "simulation.runs",
    },
    "inference": {
        "Identifiability": "inference.intervals",
        "profile": "inference.intervals",
        "Profile": "inference.intervals",
        "posterior": "inference.intervals",
        "Posterior": "inference.intervals",
        "fleet": "inference.fleets",
        "Fleet": "inference.fleets",
        "ErrorModel": "fit.error_model",
        "estimate": "fit.estimation",
        "Estimation": "fit.estimation",
        "joint": "campaign.stages",
        "power_history": "fit.power",
        "PowerHistory": "fit.power",
        "PowerLaw": "fit.power",
        "energy_balance": "inference.criticism",
        "EnergyBalance": "inference.criticism",
        "mistakes_of": "inference.criticism",
        "criticise": "inference.criticism",
        "Criticism": "inference.criticism",
        "plausibility": "inference.criticism",
        "Plausibility": "inference.criticism",
        "diagnose": "inference.criticism",
        "Diagnosis": "inference.criticism",
        "discrepancy": "fit.error_model",
        "Discrepancy": "fit.error_model",
        "compare_models": "campaign.stages",
        "Changes": "campaign.stages",
        "predict_record": "prediction.bands",
        "split": "prediction.bands",
        "Split": "prediction.bands",
        "credibility": "campaign.stages",
        "CredibilityRecord": "campaign.stages",
        "compare_htc": "physics.htc",
        "HtcComparison": "physics.htc",
    },
    "design": {
        "next_test": "prediction.advice",
        "Action": "prediction.advice",
        "Aim": "prediction.advice",
        "Advice": "prediction.advice",
        "Knowledge": "prediction.bands",
        "foresee": "prediction.bands",
        "Foresight": "prediction.bands",
        "Spread": "prediction.bands",
        "plan_retune": "campaign.stages",
        "RetunePlan": "campaign.stages",
        "size": "campaign.stages",
        "Sizing": "campaign.stages",
        "worst_case": "campaign.stages",
        "WorstCases": "campaign.stages",
        "load_study": "campaign.stages",
        "Study": "campaign.stages",
    },
    "bench": {
        "SensorPart": "measure.records",
        "SensorCertificate": "measure.records",
        "stability": "qualify.steadiness",
        "Stability": "qualify.steadiness",
        "forecast": "qualify.steadiness",
        "Forecast": "qualify.steadiness",
        "Look": "measure.looks",
    },
    "qualify": {
        "profile_of": "qualify.profiles",
        "load_profile": "qualify.profiles",
        "profile_names": "qualify.profiles",
        "ThermalProfile": "qualify.profiles",
        "run_profile": "qualify.profiles",
        "ProfileRun": "qualify.profiles",
        "equivalent_cycles": "qualify.profiles",
        "uncertain_runs": "prediction.members",
        "UncertainRuns": "prediction.members",
        "sobol_of": "prediction.members",
        "hold": "prediction.members",
        "Hold": "prediction.members",
        "load_hold": "prediction.members",
        "HoldQuestion": "prediction.members",
        "Limits": "campaign.stages",
        "load_limits": "campaign.stages",
        "check_limits": "campaign.stages",
        "margins": "campaign.stages",
        "Margin": "campaign.stages",
        "heater_duty": "campaign.stages",
        "CriteriaSet": "campaign.stages",
        "correlate": "campaign.stages",
        "Correlation": "campaign.stages",
        "load_plan": "qualify.plans",
        "Plan": "qualify.plans",
        "run_plan": "qualify.plans",
        "Qualification": "qualify.plans",
        "macro_model": "prediction.reduction",
        "assumed": "prediction.reduction",
        "reduce": "prediction.reduction",
        "Reduction": "prediction.reduction",
        "deliver": "qualify.plans",
        "check_delivery": "qualify.plans",
    },
    "reporting": {
        "page_to_pdf": "reporting.pages",
        "study_report": "reporting.pages",
        "qualification_report": "reporting.pages",
        "correlation_report": "reporting.pages",
        "picture": "reporting.pictures",
    },
    "site": {
        "OpenSky": "site.pad",
        "Site": "site.site",
        "Weather": "site.site",
        "read_weather": "site.site",
        "pad_scenario": "site.pad",
        "Trajectory": "site.ascent",
        "read_trajectory": "site.ascent",
        "ascent_scenario": "site.ascent",
        "orbit_fluxes": "site.orbit",
        "AscentCheck": "site.ascent",
        "ascent_checks": "site.ascent",
        "moisture": "site.moisture",
        "Volume": "site.vapour",
        "WaterBalance": "site.vapour",
        "Moisture": "site.moisture",
    },
    "interop": {
        "read_initfcn": "interop.initfcn",
        "InitFcn": "interop.initfcn",
        "to_octave": "interop.octave",
        "to_spice": "interop.spice",
        "to_c": "interop.c99",
        "to_modelica": "interop.modelica",
        "to_sinda": "interop.decks",
        "to_esatan": "interop.decks",
        "to_fmu": "interop.fmu",
        "fmu_model": "interop.fmu",
        "equations": "interop.equations",
        "Equations": "interop.equations",
    },
}
"""Namespace -> its names -> their modules, in the order of work."""

_GUARD = "base.arguments"
"""Module of the checks that every public function passes its arguments through; loaded with the first of them."""

_WITHOUT_ROOM = ("design",)
"""Namespaces that are activities; the others have the name of the room whose package serves them."""

_PUBLIC = _TOP | {name: module for names in _NAMESPACES.values() for name, module in names.items()}

__all__ = [*_TOP, "errors", *_NAMESPACES]


class _Namespace(ModuleType):
    """A package that serves public names when they are first asked for, so that ``import thermid`` stays quick.

    Public functions refuse arguments of a wrong kind here, at the door: what the package calls itself passes no check.

    The import system binds a module to its package when it is loaded. Where a public function has the name of its module, the function
    stays: `td.site.moisture` is callable whatever was imported before.
    """

    def __getattr__(self, name: str) -> object:
        """Import a public name.

        Raises
        ------
        AttributeError   For another name, with the nearest one.
        """
        top = self.__name__ == "thermid"
        if name in (names := _names_of(self)):
            value = getattr(import_module(f"thermid.{names[name]}"), name)
            if isinstance(value, FunctionType):
                value = import_module(f"thermid.{_GUARD}").takes_objects(value)
                setattr(import_module(value.__module__), value.__name__, value)  # so that it is pickled by its name
            self.__dict__[name] = value
            return value
        if top and name == "__version__":
            return import_module("importlib.metadata").version("thermid")
        if top and (name == "errors" or name in _NAMESPACES):
            return import_module("thermid." + ("base.errors" if name == "errors" else name))
        raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'" + ("" if name.startswith("_") else _nearest(name)))

    def __setattr__(self, name: str, value: object) -> None:
        """Keep a public name; make a package that is a namespace one."""
        if isinstance(value, ModuleType) and name in _names_of(self):
            return
        if isinstance(value, ModuleType) and self.__name__ == "thermid" and name in _NAMESPACES:
            value.__class__ = _Namespace
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        """Return the public names."""
        return [*__all__, "__version__"] if self.__name__ == "thermid" else list(_names_of(self))


def _names_of(module: ModuleType) -> dict[str, str]:
    """Return the public names that a module serves, with their modules."""
    return _TOP if module.__name__ == "thermid" else _NAMESPACES[module.__name__.removeprefix("thermid.")]


def _nearest(name: str) -> str:
    """Return the place of a public name that has this name, or the one nearest to it."""
    places = {n: f"{space}.{n}" for space, names in _NAMESPACES.items() for n in names} | {n: n for n in [*_TOP, *_NAMESPACES]}
    near = get_close_matches(name, places, n=1, cutoff=0.6)
    return f". Did you mean 'thermid.{places[near[0]]}'?" if near else ""


sys.modules[__name__].__class__ = _Namespace
for _space in _WITHOUT_ROOM:
    sys.modules[f"thermid.{_space}"] = _Namespace(f"thermid.{_space}", "Public names by activity; they come from several rooms.")
