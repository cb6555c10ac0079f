"""thermid: thermal identification. Lumped thermal models built part by part, fitted to logs level by level, and asked about the rest.

The five types to know are `Model`, `Scenario`, `Solution`, `Record` and `Calibration`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thermid.campaign.credibility import CredibilityRecord as CredibilityRecord
    from thermid.campaign.credibility import credibility as credibility
    from thermid.campaign.methodology import Study as Study
    from thermid.campaign.methodology import load_study as load_study
    from thermid.campaign.retune import RetunePlan as RetunePlan
    from thermid.campaign.retune import plan_retune as plan_retune
    from thermid.campaign.stages import Campaign as Campaign
    from thermid.campaign.stages import joint as joint
    from thermid.campaign.stages import run_stages as run_stages
    from thermid.design.next_test import Action as Action
    from thermid.design.next_test import Advice as Advice
    from thermid.design.next_test import Aim as Aim
    from thermid.design.next_test import next_test as next_test
    from thermid.errors import ThermidError as ThermidError
    from thermid.errors import ThermidWarning as ThermidWarning
    from thermid.explain.balance import EnergyBalance as EnergyBalance
    from thermid.explain.balance import energy_balance as energy_balance
    from thermid.explain.criticism import Criticism as Criticism
    from thermid.explain.criticism import criticise as criticise
    from thermid.explain.diagnosis import Diagnosis as Diagnosis
    from thermid.explain.diagnosis import diagnose as diagnose
    from thermid.explain.plausibility import Plausibility as Plausibility
    from thermid.explain.plausibility import plausibility as plausibility
    from thermid.fit.calibrate import calibrate as calibrate
    from thermid.fit.calibration import Calibration as Calibration
    from thermid.fit.discrepancy import Discrepancy as Discrepancy
    from thermid.fit.discrepancy import discrepancy as discrepancy
    from thermid.fit.second_clocks import Alignment as Alignment
    from thermid.fit.second_clocks import align as align
    from thermid.inference.identifiability import Identifiability as Identifiability
    from thermid.inference.identifiability import identifiability as identifiability
    from thermid.inference.posterior import Evidence as Evidence
    from thermid.inference.posterior import Posterior as Posterior
    from thermid.inference.posterior import evidence as evidence
    from thermid.inference.posterior import posterior as posterior
    from thermid.inference.profile import Profile as Profile
    from thermid.inference.profile import profile as profile
    from thermid.inference.valley import Valley as Valley
    from thermid.inference.valley import valley as valley
    from thermid.interop.equations import Equations as Equations
    from thermid.interop.equations import equations as equations
    from thermid.interop.initfcn import InitFcn as InitFcn
    from thermid.interop.initfcn import read_initfcn as read_initfcn
    from thermid.interop.octave import to_octave as to_octave
    from thermid.interop.spice import to_spice as to_spice
    from thermid.judge.correlation import Correlation as Correlation
    from thermid.judge.correlation import correlate as correlate
    from thermid.judge.criteria import Criteria as Criteria
    from thermid.judge.criteria import CriteriaSet as CriteriaSet
    from thermid.judge.difference import Difference as Difference
    from thermid.judge.difference import difference as difference
    from thermid.judge.limits import Limits as Limits
    from thermid.judge.limits import check_limits as check_limits
    from thermid.judge.limits import load_limits as load_limits
    from thermid.judge.margins import Margin as Margin
    from thermid.judge.margins import heater_duty as heater_duty
    from thermid.judge.margins import margins as margins
    from thermid.judge.verdict import Verdict as Verdict
    from thermid.judge.verdict import compare as compare
    from thermid.judge.verdict import validate as validate
    from thermid.knowledge.values import load_values as load_values
    from thermid.measure import Channel as Channel
    from thermid.measure import Record as Record
    from thermid.measure import SensorCertificate as SensorCertificate
    from thermid.measure import SensorPart as SensorPart
    from thermid.measure import read_record as read_record
    from thermid.model.blocks.block import Block as Block
    from thermid.model.deck.modelfile import load_model as load_model
    from thermid.model.deck.modelfile import model_from_dict as model_from_dict
    from thermid.model.deck.save import save_model as save_model
    from thermid.model.laws.law import law as law
    from thermid.model.parts.standing import Standing as Standing
    from thermid.model.tree.areas import ledger as ledger
    from thermid.model.tree.identity import Identity as Identity
    from thermid.model.tree.model import Model as Model
    from thermid.model.tree.model import identities as identities
    from thermid.model.tree.replacement import Replacement as Replacement
    from thermid.monte_carlo.drivers import sobol_of as sobol_of
    from thermid.monte_carlo.hold import Hold as Hold
    from thermid.monte_carlo.hold import HoldQuestion as HoldQuestion
    from thermid.monte_carlo.hold import hold as hold
    from thermid.monte_carlo.hold import load_hold as load_hold
    from thermid.monte_carlo.uncertain import UncertainRuns as UncertainRuns
    from thermid.monte_carlo.uncertain import uncertain_runs as uncertain_runs
    from thermid.network.environment import Environment as Environment
    from thermid.network.irradiation import Irradiation as Irradiation
    from thermid.network.linear import modes as modes
    from thermid.network.linear import state_space as state_space
    from thermid.network.network import compile_network as compile_network
    from thermid.physics.htc import HtcComparison as HtcComparison
    from thermid.physics.htc import compare_htc as compare_htc
    from thermid.power.history import PowerHistory as PowerHistory
    from thermid.power.history import PowerLaw as PowerLaw
    from thermid.power.inverse import power_history as power_history
    from thermid.prediction.budget import Spread as Spread
    from thermid.prediction.foresight import Foresight as Foresight
    from thermid.prediction.foresight import foresee as foresee
    from thermid.prediction.known import Known as Known
    from thermid.prediction.predict import Prediction as Prediction
    from thermid.prediction.predict import predict as predict
    from thermid.prediction.split import Split as Split
    from thermid.prediction.split import split as split
    from thermid.profile_runs.conduct import run_profile as run_profile
    from thermid.profile_runs.profile_run import ProfileRun as ProfileRun
    from thermid.profiles.profile import ThermalProfile as ThermalProfile
    from thermid.profiles.profile import equivalent_cycles as equivalent_cycles
    from thermid.profiles.standards import load_profile as load_profile
    from thermid.profiles.standards import profile_names as profile_names
    from thermid.profiles.standards import profile_of as profile_of
    from thermid.qualify.deliver import check_delivery as check_delivery
    from thermid.qualify.deliver import deliver as deliver
    from thermid.qualify.lock import lock_plan as lock_plan
    from thermid.qualify.plan import Plan as Plan
    from thermid.qualify.plan import load_plan as load_plan
    from thermid.qualify.programme import Qualification as Qualification
    from thermid.qualify.programme import run_plan as run_plan
    from thermid.reduction.macro import assumed as assumed
    from thermid.reduction.macro import macro_model as macro_model
    from thermid.reduction.reduce import Reduction as Reduction
    from thermid.reduction.reduce import reduce as reduce
    from thermid.reporting.blocks.pdf import page_to_pdf as page_to_pdf
    from thermid.reporting.pages.campaign import report as report
    from thermid.reporting.pages.structures import Structure as Structure
    from thermid.reporting.pages.structures import structures_report as structures_report
    from thermid.reporting.pages.study import study_report as study_report
    from thermid.reporting.pictures.look import Look as Look
    from thermid.reporting.pictures.look import look as look
    from thermid.reporting.pictures.trust import picture as picture
    from thermid.reporting.qualification.page import correlation_report as correlation_report
    from thermid.reporting.qualification.page import qualification_report as qualification_report
    from thermid.simulation.block import BlockSolution as BlockSolution
    from thermid.simulation.draws import draw as draw
    from thermid.simulation.ensemble import Ensemble as Ensemble
    from thermid.simulation.scenario_file import load_scenario as load_scenario
    from thermid.simulation.scenarios.scenario import Scenario as Scenario
    from thermid.simulation.simulator import Simulator as Simulator
    from thermid.simulation.simulator import ensemble as ensemble
    from thermid.simulation.simulator import prepare as prepare
    from thermid.simulation.solution import Solution as Solution
    from thermid.simulation.solver.problem import Options as Options
    from thermid.simulation.steady import Steady as Steady
    from thermid.simulation.steady import steady as steady
    from thermid.simulation.steady import steady_levels as steady_levels
    from thermid.simulation.transient import simulate as simulate
    from thermid.site.ascent import Trajectory as Trajectory
    from thermid.site.ascent import ascent_scenario as ascent_scenario
    from thermid.site.ascent import read_trajectory as read_trajectory
    from thermid.site.ascent_checks import AscentCheck as AscentCheck
    from thermid.site.ascent_checks import ascent_checks as ascent_checks
    from thermid.site.moisture import Moisture as Moisture
    from thermid.site.moisture import moisture as moisture
    from thermid.site.orbit import eclipse_signal as eclipse_signal
    from thermid.site.orbit import orbit_irradiation as orbit_irradiation
    from thermid.site.pad import pad_scenario as pad_scenario
    from thermid.site.site import Site as Site
    from thermid.site.sky import OpenSky as OpenSky
    from thermid.site.vapour import Volume as Volume
    from thermid.site.vapour import WaterBalance as WaterBalance
    from thermid.site.weather import Weather as Weather
    from thermid.site.weather import read_weather as read_weather
    from thermid.steadiness.forecast import Forecast as Forecast
    from thermid.steadiness.forecast import forecast as forecast
    from thermid.steadiness.stabilisation import Stability as Stability
    from thermid.steadiness.stabilisation import stability as stability

# in reading order: what the hardware is, what is done to it, what was measured, what a fit says, what is shown
_PUBLIC = {
    "Model": "model.tree.model",
    "Identity": "model.tree.identity",
    "Replacement": "model.tree.replacement",
    "identities": "model.tree.model",
    "load_model": "model.deck.modelfile",
    "model_from_dict": "model.deck.modelfile",
    "save_model": "model.deck.save",
    "law": "model.laws.law",
    "ledger": "model.tree.areas",
    "Block": "model.blocks.block",
    "compile_network": "network.network",
    "state_space": "network.linear",
    "modes": "network.linear",
    "Environment": "network.environment",
    "Irradiation": "network.irradiation",
    "OpenSky": "site.sky",
    "Scenario": "simulation.scenarios.scenario",
    "load_scenario": "simulation.scenario_file",
    "Site": "site.site",
    "Weather": "site.weather",
    "read_weather": "site.weather",
    "pad_scenario": "site.pad",
    "Trajectory": "site.ascent",
    "read_trajectory": "site.ascent",
    "ascent_scenario": "site.ascent",
    "orbit_irradiation": "site.orbit",
    "eclipse_signal": "site.orbit",
    "AscentCheck": "site.ascent_checks",
    "ascent_checks": "site.ascent_checks",
    "Options": "simulation.solver.problem",
    "simulate": "simulation.transient",
    "prepare": "simulation.simulator",
    "Simulator": "simulation.simulator",
    "steady": "simulation.steady",
    "steady_levels": "simulation.steady",
    "Steady": "simulation.steady",
    "draw": "simulation.draws",
    "ensemble": "simulation.simulator",
    "Ensemble": "simulation.ensemble",
    "Solution": "simulation.solution",
    "BlockSolution": "simulation.block",
    "moisture": "site.moisture",
    "Volume": "site.vapour",
    "WaterBalance": "site.vapour",
    "Moisture": "site.moisture",
    "Channel": "measure",
    "SensorPart": "measure",
    "SensorCertificate": "measure",
    "Record": "measure",
    "look": "reporting.pictures.look",
    "Look": "reporting.pictures.look",
    "read_record": "measure",
    "compare": "judge.verdict",
    "align": "fit.second_clocks",
    "Alignment": "fit.second_clocks",
    "calibrate": "fit.calibrate",
    "Calibration": "fit.calibration",
    "split": "prediction.split",
    "Split": "prediction.split",
    "energy_balance": "explain.balance",
    "EnergyBalance": "explain.balance",
    "identifiability": "inference.identifiability",
    "Identifiability": "inference.identifiability",
    "profile": "inference.profile",
    "Profile": "inference.profile",
    "valley": "inference.valley",
    "Valley": "inference.valley",
    "criticise": "explain.criticism",
    "Criticism": "explain.criticism",
    "plausibility": "explain.plausibility",
    "Plausibility": "explain.plausibility",
    "next_test": "design.next_test",
    "Action": "design.next_test",
    "Aim": "design.next_test",
    "Advice": "design.next_test",
    "load_values": "knowledge.values",
    "power_history": "power.inverse",
    "PowerHistory": "power.history",
    "PowerLaw": "power.history",
    "posterior": "inference.posterior",
    "Posterior": "inference.posterior",
    "evidence": "inference.posterior",
    "Evidence": "inference.posterior",
    "Campaign": "campaign.stages",
    "run_stages": "campaign.stages",
    "joint": "campaign.stages",
    "predict": "prediction.predict",
    "discrepancy": "fit.discrepancy",
    "Discrepancy": "fit.discrepancy",
    "Prediction": "prediction.predict",
    "Spread": "prediction.budget",
    "plan_retune": "campaign.retune",
    "RetunePlan": "campaign.retune",
    "credibility": "campaign.credibility",
    "CredibilityRecord": "campaign.credibility",
    "difference": "judge.difference",
    "Difference": "judge.difference",
    "Criteria": "judge.criteria",
    "Standing": "model.parts.standing",
    "validate": "judge.verdict",
    "Verdict": "judge.verdict",
    "load_study": "campaign.methodology",
    "Study": "campaign.methodology",
    "macro_model": "reduction.macro",
    "assumed": "reduction.macro",
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
    "reduce": "reduction.reduce",
    "Reduction": "reduction.reduce",
    "deliver": "qualify.deliver",
    "check_delivery": "qualify.deliver",
    "stability": "steadiness.stabilisation",
    "Stability": "steadiness.stabilisation",
    "forecast": "steadiness.forecast",
    "Forecast": "steadiness.forecast",
    "Limits": "judge.limits",
    "load_limits": "judge.limits",
    "check_limits": "judge.limits",
    "Known": "prediction.known",
    "Foresight": "prediction.foresight",
    "foresee": "prediction.foresight",
    "margins": "judge.margins",
    "Margin": "judge.margins",
    "heater_duty": "judge.margins",
    "CriteriaSet": "judge.criteria",
    "correlate": "judge.correlation",
    "Correlation": "judge.correlation",
    "diagnose": "explain.diagnosis",
    "Diagnosis": "explain.diagnosis",
    "load_plan": "qualify.plan",
    "Plan": "qualify.plan",
    "lock_plan": "qualify.lock",
    "run_plan": "qualify.programme",
    "Qualification": "qualify.programme",
    "report": "reporting.pages.campaign",
    "page_to_pdf": "reporting.blocks.pdf",
    "study_report": "reporting.pages.study",
    "structures_report": "reporting.pages.structures",
    "Structure": "reporting.pages.structures",
    "qualification_report": "reporting.qualification.page",
    "correlation_report": "reporting.qualification.page",
    "picture": "reporting.pictures.trust",
    "compare_htc": "physics.htc",
    "HtcComparison": "physics.htc",
    "read_initfcn": "interop.initfcn",
    "InitFcn": "interop.initfcn",
    "to_octave": "interop.octave",
    "to_spice": "interop.spice",
    "equations": "interop.equations",
    "Equations": "interop.equations",
    "ThermidError": "errors",
    "ThermidWarning": "errors",
}

__all__ = list(_PUBLIC)


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for, so that ``import thermid`` stays quick."""
    if name == "__version__":
        from importlib.metadata import version

        return version("thermid")
    if name not in _PUBLIC:
        raise AttributeError(f"module 'thermid' has no attribute '{name}'")
    value = getattr(import_module(f"thermid.{_PUBLIC[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__, "__version__"]
