"""Old names, of attributes and at the top of thermid, served with a warning until `REMOVED`: the one table of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

REMOVED: Final = "0.3.0"
"""Version that serves none of them any more."""

RENAMED: Final[Mapping[str, Mapping[str, str]]] = {
    "Calibration": {"wander": "autocorrelation", "effective": "effective_samples"},
    "Autocorrelation": {"level": "variance_factor", "excess": "score_excess", "effective": "effective_samples"},
    "TraceNoise": {
        "own": "white_variance",
        "slow": "correlated_variance",
        "time": "correlation_time",
        "effective": "effective_samples",
    },
    "Check": {"name": "criterion", "worst": "sensor"},
    "Deviation": {key: f"[{key}]" for key in ("mean", "spread", "largest", "rmse")},
    "LogEntry": {key: f"[{key}]" for key in ("rmse", "max_error", "final_error")},
}
"""Class -> old attribute -> new one; a name in brackets is a key of the object."""

TOP_LEVEL: Final[Mapping[str, str]] = {
    "Identity": "model.Identity",
    "Replacement": "model.Replacement",
    "identities": "model.identities",
    "law": "model.law",
    "ledger": "model.ledger",
    "Standing": "model.Standing",
    "compile_network": "network.compile_network",
    "state_space": "network.state_space",
    "modes": "network.modes",
    "Environment": "network.Environment",
    "Irradiation": "network.Irradiation",
    "Simulator": "simulation.Simulator",
    "draw": "simulation.draw",
    "steady_levels": "simulation.steady_levels",
    "Steady": "simulation.Steady",
    "Ensemble": "simulation.Ensemble",
    "BlockSolution": "simulation.BlockSolution",
    "Identifiability": "inference.Identifiability",
    "profile": "inference.profile",
    "Profile": "inference.Profile",
    "valley": "inference.valley",
    "Valley": "inference.Valley",
    "posterior": "inference.posterior",
    "Posterior": "inference.Posterior",
    "evidence": "inference.evidence",
    "Evidence": "inference.Evidence",
    "estimate": "inference.estimate",
    "Estimation": "inference.Estimation",
    "joint": "inference.joint",
    "align": "inference.align",
    "Alignment": "inference.Alignment",
    "power_history": "inference.power_history",
    "PowerHistory": "inference.PowerHistory",
    "PowerLaw": "inference.PowerLaw",
    "energy_balance": "explain.energy_balance",
    "EnergyBalance": "explain.EnergyBalance",
    "criticise": "explain.criticise",
    "Criticism": "explain.Criticism",
    "plausibility": "explain.plausibility",
    "Plausibility": "explain.Plausibility",
    "diagnose": "explain.diagnose",
    "Diagnosis": "explain.Diagnosis",
    "discrepancy": "explain.discrepancy",
    "Discrepancy": "explain.Discrepancy",
    "difference": "explain.difference",
    "Difference": "explain.Difference",
    "split": "explain.split",
    "Split": "explain.Split",
    "credibility": "explain.credibility",
    "CredibilityRecord": "explain.CredibilityRecord",
    "compare_htc": "explain.compare_htc",
    "HtcComparison": "explain.HtcComparison",
    "next_test": "design.next_test",
    "Action": "design.Action",
    "Aim": "design.Aim",
    "Advice": "design.Advice",
    "Known": "design.Known",
    "foresee": "design.foresee",
    "Foresight": "design.Foresight",
    "Spread": "design.Spread",
    "plan_retune": "design.plan_retune",
    "RetunePlan": "design.RetunePlan",
    "load_study": "design.load_study",
    "Study": "design.Study",
    "SensorPart": "bench.SensorPart",
    "SensorCertificate": "bench.SensorCertificate",
    "stability": "bench.stability",
    "Stability": "bench.Stability",
    "forecast": "bench.forecast",
    "Forecast": "bench.Forecast",
    "Look": "bench.Look",
    "profile_of": "qualify.profile_of",
    "load_profile": "qualify.load_profile",
    "profile_names": "qualify.profile_names",
    "ThermalProfile": "qualify.ThermalProfile",
    "run_profile": "qualify.run_profile",
    "ProfileRun": "qualify.ProfileRun",
    "equivalent_cycles": "qualify.equivalent_cycles",
    "uncertain_runs": "qualify.uncertain_runs",
    "UncertainRuns": "qualify.UncertainRuns",
    "sobol_of": "qualify.sobol_of",
    "hold": "qualify.hold",
    "Hold": "qualify.Hold",
    "load_hold": "qualify.load_hold",
    "HoldQuestion": "qualify.HoldQuestion",
    "Limits": "qualify.Limits",
    "load_limits": "qualify.load_limits",
    "check_limits": "qualify.check_limits",
    "margins": "qualify.margins",
    "Margin": "qualify.Margin",
    "heater_duty": "qualify.heater_duty",
    "CriteriaSet": "qualify.CriteriaSet",
    "correlate": "qualify.correlate",
    "Correlation": "qualify.Correlation",
    "load_plan": "qualify.load_plan",
    "Plan": "qualify.Plan",
    "lock_plan": "qualify.lock_plan",
    "run_plan": "qualify.run_plan",
    "Qualification": "qualify.Qualification",
    "macro_model": "qualify.macro_model",
    "assumed": "qualify.assumed",
    "reduce": "qualify.reduce",
    "Reduction": "qualify.Reduction",
    "deliver": "qualify.deliver",
    "check_delivery": "qualify.check_delivery",
    "page_to_pdf": "reporting.page_to_pdf",
    "study_report": "reporting.study_report",
    "structures_report": "reporting.structures_report",
    "Structure": "reporting.Structure",
    "qualification_report": "reporting.qualification_report",
    "correlation_report": "reporting.correlation_report",
    "picture": "reporting.picture",
    "OpenSky": "site.OpenSky",
    "Site": "site.Site",
    "Weather": "site.Weather",
    "read_weather": "site.read_weather",
    "pad_scenario": "site.pad_scenario",
    "Trajectory": "site.Trajectory",
    "read_trajectory": "site.read_trajectory",
    "ascent_scenario": "site.ascent_scenario",
    "orbit_fluxes": "site.orbit_fluxes",
    "orbit_irradiation": "site.orbit_irradiation",
    "eclipse_signal": "site.eclipse_signal",
    "AscentCheck": "site.AscentCheck",
    "ascent_checks": "site.ascent_checks",
    "moisture": "site.moisture",
    "Volume": "site.Volume",
    "WaterBalance": "site.WaterBalance",
    "Moisture": "site.Moisture",
    "read_initfcn": "interop.read_initfcn",
    "InitFcn": "interop.InitFcn",
    "to_octave": "interop.to_octave",
    "to_spice": "interop.to_spice",
    "equations": "interop.equations",
    "Equations": "interop.Equations",
}
"""Name at the top of thermid before 0.2.0 -> where it is now."""


def moved(name: str) -> str:
    """Return where a name of the top is now, with a warning that says it; empty where it never was there."""
    new = TOP_LEVEL.get(name, "")
    if new:
        text = f"'thermid.{name}' is called 'thermid.{new}' now; the old name goes with thermid {REMOVED}."
        warnings.warn(text, DeprecationWarning, stacklevel=3)
    return new


class Renamed:
    """Base of a class of which attributes have new names; see `RENAMED`."""

    if not TYPE_CHECKING:  # a type checker knows the new names only

        def __getattr__(self, name: str) -> Any:
            """Return what stands under the new name, with a warning that says it.

            Raises
            ------
            AttributeError   When it is no old name.
            """
            tables = (RENAMED.get(each.__name__, {}) for each in type(self).__mro__)  # a joint fit is a calibration too
            new = next((table[name] for table in tables if name in table), None)
            if new is None:
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
            shown = f'["{new[1:-1]}"]' if new.startswith("[") else f".{new}"
            text = f"'.{name}' was renamed to '{shown}'; the old name will be removed in thermid {REMOVED}."
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return self[new[1:-1]] if new.startswith("[") else getattr(self, new)
