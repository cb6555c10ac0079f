"""thermid: thermal identification. Lumped thermal models built part by part, fitted to logs level by level, and asked about the rest.

The five types to know are `Model`, `Scenario`, `Solution`, `Record` and `Calibration`; what is not used in every project stands in a
namespace by activity: `td.design`, `td.qualify`, `td.site` and so on.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType

from thermid.renamed import moved

_TOP = {
    "celsius": "expression",
    "quantity": "expression",
    "Model": "model.tree.model",
    "load_model": "model.deck.modelfile",
    "model_from_dict": "model.deck.modelfile",
    "save_model": "model.deck.save",
    "Block": "model.blocks.block",
    "Scenario": "simulation.scenarios.scenario",
    "load_scenario": "simulation.scenario_file",
    "Options": "simulation.solver.problem",
    "simulate": "simulation.transient",
    "prepare": "simulation.simulator",
    "steady": "simulation.steady",
    "ensemble": "simulation.simulator",
    "Solution": "simulation.solution",
    "Channel": "measure",
    "Record": "measure",
    "look": "reporting.pictures.look",
    "read_record": "measure",
    "compare": "judge.verdict",
    "calibrate": "fit.calibrate",
    "Calibration": "fit.calibration",
    "identifiability": "inference.identifiability",
    "load_values": "knowledge.values",
    "Campaign": "campaign.stages",
    "run_stages": "campaign.stages",
    "predict": "prediction.predict",
    "Prediction": "prediction.predict",
    "Criteria": "judge.criteria",
    "validate": "judge.verdict",
    "Verdict": "judge.verdict",
    "report": "reporting.pages.campaign",
    "ThermidError": "errors",
    "ThermidWarning": "errors",
}
"""Public name -> its module, in reading order."""

_NAMESPACES = {
    "model": {
        "Identity": "model.tree.identity",
        "Replacement": "model.tree.replacement",
        "identities": "model.tree.model",
        "law": "model.laws.law",
        "ledger": "model.tree.areas",
        "Standing": "model.parts.parameter",
    },
    "network": {
        "compile_network": "network.network",
        "state_space": "network.linear",
        "modes": "network.linear",
        "Environment": "network.environment",
        "Irradiation": "network.irradiation",
    },
    "simulation": {
        "Simulator": "simulation.simulator",
        "draw": "simulation.draws",
        "steady_levels": "simulation.steady",
        "Steady": "simulation.steady",
        "Ensemble": "simulation.ensemble",
        "BlockSolution": "simulation.block",
    },
    "inference": {
        "Identifiability": "inference.identifiability",
        "profile": "inference.profile",
        "Profile": "inference.profile",
        "valley": "inference.profile",
        "Valley": "inference.profile",
        "posterior": "inference.posterior",
        "Posterior": "inference.posterior",
        "evidence": "inference.posterior",
        "Evidence": "inference.posterior",
        "estimate": "estimation.estimate",
        "Estimation": "estimation.estimation",
        "joint": "campaign.stages",
        "align": "fit.second_clocks",
        "Alignment": "fit.second_clocks",
        "power_history": "power.history",
        "PowerHistory": "power.history",
        "PowerLaw": "power.history",
    },
    "explain": {
        "energy_balance": "explain.balance",
        "EnergyBalance": "explain.balance",
        "criticise": "explain.criticism",
        "Criticism": "explain.criticism",
        "plausibility": "explain.plausibility",
        "Plausibility": "explain.plausibility",
        "diagnose": "explain.diagnosis",
        "Diagnosis": "explain.diagnosis",
        "discrepancy": "fit.discrepancy",
        "Discrepancy": "fit.discrepancy",
        "difference": "judge.difference",
        "Difference": "judge.difference",
        "split": "prediction.split",
        "Split": "prediction.split",
        "credibility": "campaign.credibility",
        "CredibilityRecord": "campaign.credibility",
        "compare_htc": "physics.htc",
        "HtcComparison": "physics.htc",
    },
    "design": {
        "next_test": "design.next_test",
        "Action": "design.next_test",
        "Aim": "design.next_test",
        "Advice": "design.next_test",
        "Known": "prediction.known",
        "foresee": "prediction.predict",
        "Foresight": "prediction.predict",
        "Spread": "prediction.budget",
        "plan_retune": "campaign.retune",
        "RetunePlan": "campaign.retune",
        "load_study": "campaign.methodology",
        "Study": "campaign.methodology",
    },
    "bench": {
        "SensorPart": "measure",
        "SensorCertificate": "measure",
        "stability": "steadiness.stabilisation",
        "Stability": "steadiness.stabilisation",
        "forecast": "steadiness.forecast",
        "Forecast": "steadiness.forecast",
        "Look": "reporting.pictures.look",
    },
    "qualify": {
        "profile_of": "profiles.standards",
        "load_profile": "profiles.standards",
        "profile_names": "profiles.standards",
        "ThermalProfile": "profiles.profile",
        "run_profile": "profile_runs.conduct",
        "ProfileRun": "profile_runs.profile_run",
        "equivalent_cycles": "profiles.profile",
        "uncertain_runs": "monte_carlo.uncertain",
        "UncertainRuns": "monte_carlo.uncertain",
        "sobol_of": "monte_carlo.drivers",
        "hold": "monte_carlo.hold",
        "Hold": "monte_carlo.hold",
        "load_hold": "monte_carlo.hold",
        "HoldQuestion": "monte_carlo.hold",
        "Limits": "judge.limits",
        "load_limits": "judge.limits",
        "check_limits": "judge.limits",
        "margins": "judge.margins",
        "Margin": "judge.margins",
        "heater_duty": "judge.margins",
        "CriteriaSet": "judge.criteria",
        "correlate": "judge.correlation",
        "Correlation": "judge.correlation",
        "load_plan": "qualify.plan",
        "Plan": "qualify.plan",
        "lock_plan": "qualify.plan",
        "run_plan": "qualify.programme",
        "Qualification": "qualify.programme",
        "macro_model": "reduction.macro",
        "assumed": "reduction.macro",
        "reduce": "reduction.reduce",
        "Reduction": "reduction.reduce",
        "deliver": "qualify.deliver",
        "check_delivery": "qualify.deliver",
    },
    "reporting": {
        "page_to_pdf": "reporting.blocks.extras",
        "study_report": "reporting.pages.study",
        "structures_report": "reporting.pages.study",
        "Structure": "reporting.pages.study",
        "qualification_report": "reporting.qualification.page",
        "correlation_report": "reporting.qualification.page",
        "picture": "reporting.pictures.trust",
    },
    "site": {
        "OpenSky": "site.sky",
        "Site": "site.site",
        "Weather": "site.weather",
        "read_weather": "site.weather",
        "pad_scenario": "site.pad",
        "Trajectory": "site.ascent",
        "read_trajectory": "site.ascent",
        "ascent_scenario": "site.ascent",
        "orbit_fluxes": "site.orbit",
        "orbit_irradiation": "site.exposure",
        "eclipse_signal": "site.exposure",
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
        "to_sinda": "interop.decks.written",
        "to_esatan": "interop.decks.written",
        "to_fmu": "interop.fmu.export",
        "fmu_model": "interop.fmu.as_model",
        "calibrate_fmu": "interop.fmu.fitted",
        "equations": "interop.equations",
        "Equations": "interop.equations",
    },
}
"""Namespace -> its names -> their modules, in the order of work."""

_PUBLIC = _TOP | {name: module for names in _NAMESPACES.values() for name, module in names.items()}

__all__ = [*_TOP, "errors", *_NAMESPACES]


class _Namespace(ModuleType):
    """A package that serves public names when they are first asked for, so that ``import thermid`` stays quick.

    The import system binds a module to its package when it is loaded. Where a public function has the name of its module, the function
    stays: `td.design.next_test` is callable whatever was imported before.
    """

    def __getattr__(self, name: str) -> object:
        """Import a public name; serve an old one with a warning."""
        if name == "__version__" and self.__name__ == "thermid":
            return import_module("importlib.metadata").version("thermid")
        names = _names_of(self)
        if name in names:
            value = getattr(import_module(f"thermid.{names[name]}"), name)
            self.__dict__[name] = value
            return value
        if self.__name__ == "thermid" and (name in _NAMESPACES or name == "errors"):
            return import_module(f"thermid.{name}")
        if self.__name__ == "thermid" and not name.startswith("_") and (new := moved(name)):
            space, _, last = new.partition(".")
            return getattr(getattr(self, space), last)
        raise AttributeError(f"module '{self.__name__}' has no attribute '{name}'")

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


sys.modules[__name__].__class__ = _Namespace
