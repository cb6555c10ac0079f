"""The names of the code by the headings of docs/nomenclature.md, with the unit of each where it has one."""

from __future__ import annotations

import ast
import dataclasses
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from pydantic import BaseModel

import thermid as td
from thermid import errors
from thermid.base.units import TEMPERATURE
from thermid.campaign import _schema as campaign_schema
from thermid.campaign._judge.schema import LimitTable
from thermid.campaign._judge.verdict import METRICS, PLAIN
from thermid.campaign._study_items import Component, ProcedureAction, SensorSpec
from thermid.measure._readers.bindings import _KEYS as CHANNEL_KEYS
from thermid.measure._record.record import STEPS
from thermid.measure._record.sensor import _NUMBERS as PART_NUMBERS
from thermid.model._deck import assemblies, fields, schema
from thermid.model._parts.controls import CONTROL_SLOTS, TEMPERATURE_SLOT
from thermid.model._parts.elements import NODE_SLOTS
from thermid.model.tree import KINDS, LOAD_SLOTS, Sine, TableSignal
from thermid.qualify import _plan_schema as plan_schema
from thermid.qualify._profiles.numbers import SLOTS
from thermid.qualify._profiles.schema import ProfileTable, StepTable
from thermid.simulation._scenarios import schema as scenario_schema
from thermid.site import pad
from thermid.values.store import FittedValue, FittedValues

from .pages import ROOT, codes, tables

PAGE = ROOT / "docs" / "nomenclature.md"
ANY = "*"
"""The unit of the thing it stands for."""

Names = Mapping[str, str | None]
"""Name -> unit; None where there is no number, `ANY` where the unit is that of something else."""

SURFACE_SLOTS = {k: v for kind in ("convection", "effective", "radiation") for k, v in KINDS[kind].slots.items()}
JOINT_SLOTS = {k: v for kind in ("contact", "conduction") for k, v in KINDS[kind].slots.items() if k != "gap"}
SCENARIO_UNITS = {"boundaries": TEMPERATURE, "loads": "W", "commands": "1", "prescribed": TEMPERATURE, "schedule": ANY}
SCENARIO_UNITS |= {"start": TEMPERATURE, "initial": TEMPERATURE, "duration": "s"}
MADE_IN_UNITS = {"pressure": "Pa", "gravity": "m/s^2", "wind": "m/s"}
GAS_UNITS = {"pressure": "Pa", "humidity": "1", "gravity": "m/s^2", "wind": "m/s", "time_constant": "s"}
IRRADIATION_UNITS = dict.fromkeys(("direct", "diffuse", "albedo", "total", "infrared", "stream"), "W/m^2")
IRRADIATION_UNITS |= {"sky": TEMPERATURE, "sky_view": "1"}
ASCENT_UNITS = {
    "pressure": "Pa",
    "separation": "s",
    "accommodation": "1",
    "flow": "1",
    "air_temperature": TEMPERATURE,
    "walls": TEMPERATURE,
}
CAMPAIGN_UNITS = {"window": "s", "sd": ANY, "mean": ANY, "weights": "1", "knee": "1"}
ORBIT_UNITS = {
    "perigee": "m",
    "apogee": "m",
    "infrared": "W/m^2",
    "solar": "W/m^2",
    "beta": "deg",
    "argument": "deg",
    "begin": "deg",
    "albedo": "1",
}
STEP_UNITS = {"to": TEMPERATURE, "over": "s", "ramp": "K/s", "pressure": "Pa", "humidity": "1", "dwell": "s"}
STUDY_UNITS = {"lowest": TEMPERATURE, "highest": TEMPERATURE, "error": "K", "accuracy": "K", "resolution": "K"}
STUDY_UNITS |= {"range": TEMPERATURE, "conversion": "s"}
STUDY = ("Knowledge", "Box", "Theory", "Experiment", "Procedure")
PLAN = {"Document": "Document", "Configuration": "Configuration", "Difference": "Difference", "Model": "Source", "Host": "Host"}
PLAN |= {"Margins": "Margin", "Sensor": "PlanSensor", "Exclusions": "Exclusion", "Validity": "Validity"}
PLAN_UNITS = {"accuracy": "K", "noise": "K", "cap": "1", "temperature": TEMPERATURE, "pressure": "Pa", "power": "W", "gravity": "m/s^2"}
TEST_UNITS = {"every": "s", "weights": "1", "steady": "s", "spread": ANY, "heaters": "W", "gravity": "m/s^2"}
LIMIT_UNITS = dict.fromkeys(("operating", "non_operating", "start_up"), TEMPERATURE)
LOCAL_UNITS = {"start": TEMPERATURE, "sd": "K"}
ERROR_UNITS = {"noise": ANY, "accuracy": ANY, "resolution": ANY}
SENSOR_UNITS = {k: "K" if v == "temperature" else v for k, v in PART_NUMBERS.items()} | {"mass": "kg", "specific_heat": "J/(kg K)"}


def _of(names: Iterable[str], units: Mapping[str, str] | None = None) -> dict[str, str | None]:
    """Names with their units, those of a group by their own name within it."""
    return {name: (units or {}).get(name) for name in names}


def _model(table: type[BaseModel], units: Mapping[str, str] | None = None) -> Names:
    """Keys of a table of a file, as its author writes them."""
    return _of([field.alias or name for name, field in table.model_fields.items()], units)


def _group(name: str, slots: Mapping[str, str]) -> dict[str, str]:
    return {inner: slot for path, slot in slots.items() for group, _, inner in [path.partition(".")] if group == name and inner}


def _control(kind: str) -> dict[str, str]:
    return {name: TEMPERATURE if slot == TEMPERATURE_SLOT else slot for name, slot in _group(kind, CONTROL_SLOTS).items()}


def _plain(fields: Iterable[dataclasses.Field[object]]) -> list[str]:
    return [f.name for f in fields if not f.name.startswith("_")]


def _values_file() -> Names:
    """Keys of a values file as it is written."""
    value = FittedValue("a", 1.0, 0.1, 0.1, True, "W", 1.0, (0.0, 2.0), prior=(0.0, 1.0))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.toml"
        FittedValues("s", {"a": value}, np.eye(1)).save(path)
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    units = {"value": "SI", "error": "SI", "error_random": "SI", "start": "SI", "bounds": "SI"}
    rows = [k for table in ("sources", "root") for k in data[table][0] if k not in ("name", "kind", "a")]
    return _of(dict.fromkeys([*data, *data["values"]["a"], *rows]), units)


def _exceptions() -> Names:
    return _of(n for n, thing in vars(errors).items() if isinstance(thing, type) and thing.__module__ == errors.__name__)


def by_heading() -> dict[str, Names]:
    """Heading of the page -> the names that its tables must hold, no more and no fewer."""
    conductor = [n for n in schema.ConductorTable.model_fields if n not in {s.partition(".")[0] for k in KINDS.values() for s in k.slots}]
    return {
        "Public names": _of(td._PUBLIC),
        "Deck": _model(schema.Deck),
        "Value": _model(fields.ValueTable, {"value": ANY, "min": ANY, "max": ANY}),
        "Node": _model(schema.NodeTable, dict(NODE_SLOTS)),
        "Surface": _model(schema.SurfaceTable, SURFACE_SLOTS),
        "Facing": _model(schema.FacingTable, {"tilt": "deg", "azimuth": "deg"}),
        "Natural convection": _model(fields.PowerLawTable, _group("htc", KINDS["convection"].slots)),
        "Convection by correlation": _model(fields.Correlated, _group("htc", KINDS["convection"].slots)),
        "Conductor": _of(conductor),
        "Table of points": _model(fields.Points),
        "Property over temperature": _model(fields.Property),
        "Joint": _model(schema.JointTable, JOINT_SLOTS),
        "Enclosure": _model(schema.EnclosureTable, {"dimensions": "m", "view_factors": "1", "exchange_factors": "1"}),
        "Place of a face": _model(schema.PlaceTable, dict.fromkeys(("corner", "sides", "centre", "axis", "radius"), "m") | {"normal": "1"}),
        "Gap of a joint": _model(schema.Gap, SURFACE_SLOTS),
        "Heat load": _model(schema.LoadTable, dict(LOAD_SLOTS)),
        "Periodic load": _model(schema.Periodic, _group("periodic", LOAD_SLOTS)),
        "Sine of a load": _model(schema.SinePower, _group("sine", LOAD_SLOTS)),
        "Thermostat": _model(schema.Thermostat, _group("thermostat", LOAD_SLOTS)),
        "Proportional heater": _model(schema.Proportional, _group("proportional", LOAD_SLOTS)),
        "Control": _model(schema.ControlTable, {"sample": "s"}),
        "Thermostat of a control": _model(schema.ThermostatControl, _control("thermostat")),
        "Proportional control": _model(schema.ProportionalControl, _control("proportional")),
        "PID control": _model(schema.PidControl, _control("pid")),
        "Transition": _model(schema.TransitionTable, {"above": TEMPERATURE, "below": TEMPERATURE, "after": "s"}),
        "Cycle of a load": _model(schema.CycleTable, {"times": "s", "values": "1", "period": "s"}),
        "Submodel": _model(schema.SubmodelTable),
        "Package": _model(assemblies.PackageTable, assemblies.PACKAGE_UNITS | {"power": "W"}),
        "Ladder": _model(assemblies.LadderTable, {"power": "W"}),
        "Fan": _model(assemblies.FanTable, assemblies.FAN_UNITS),
        "Thermoelectric cooler": _model(assemblies.CoolerTable, assemblies.COOLER_UNITS | {"T_hot": TEMPERATURE}),
        "Table of elements": _model(schema.RowsTable),
        "Air and walls apart": _model(fields.AirAndSees),
        "State of a gas that a reduced deck was made in": _model(schema.MadeInTable, MADE_IN_UNITS),
        "Scenario": _of(_plain(dataclasses.fields(td.Scenario)), SCENARIO_UNITS),
        "Gas": _of(_plain(dataclasses.fields(td.simulation.Environment)), GAS_UNITS),
        "Irradiation": _of(_plain(dataclasses.fields(td.simulation.Irradiation)), IRRADIATION_UNITS),
        "Site": _of(_plain(dataclasses.fields(td.site.Site)), {"latitude": "deg", "longitude": "deg", "altitude": "m", "timezone": "h"}),
        "Weather of a scenario": _model(scenario_schema.WeatherTable, {"max_gap": "s", "air_temperature": TEMPERATURE}),
        "Sun of a scenario": _model(scenario_schema.SunTable, {"albedo": "1", "turbidity": "1", "sky": "deg"}),
        "Ascent of a scenario": _model(scenario_schema.AscentTable, ASCENT_UNITS),
        "Orbit of a scenario": _model(scenario_schema.OrbitTable, ORBIT_UNITS),
        "Planet of an orbit": _model(scenario_schema.PlanetTable, {"radius": "m", "attraction": "m^3/s^2", "solar": "W/m^2"}),
        "Wind on a coefficient": _of(pad.WIND, {"length": "m", "calm": "W/(m^2 K)"}),
        "Signal": _of(
            dict.fromkeys(
                n
                for n in (*_plain(dataclasses.fields(TableSignal)), *_plain(dataclasses.fields(Sine)), "file", "column", "unit", "time")
                if n != "log"  # where a column came from, which nobody writes
            ),
            {"times": "s", "period": "s", "phase": "rad", "values": ANY, "mean": ANY, "amplitude": ANY},
        ),
        "Campaign": _model(campaign_schema.CampaignFile),
        "Log": _model(campaign_schema.RecordTable),
        "Joined log": _model(campaign_schema.JoinedTable, {"offset": "s", "rate": "1"}),
        "Channel of a log": _of(CHANNEL_KEYS, ERROR_UNITS | SENSOR_UNITS),
        "Preparation": _of(STEPS),
        "Stage": _model(campaign_schema.StageTable, CAMPAIGN_UNITS),
        "Steady point": _model(campaign_schema.SteadyTable, {"start": "s", "end": "s", "tau": "s", "limit": "K/s"}),
        "Inheritance": _model(campaign_schema.InheritTable),
        "Reading": _model(campaign_schema.ReadingTable),
        "Course of a power": _model(campaign_schema.CourseTable, {"power": "W", "begin": "s"}),
        "Local value": _model(campaign_schema.LocalTable, LOCAL_UNITS),
        "Prior": _model(campaign_schema.PriorTable, CAMPAIGN_UNITS),
        "Scenario of a stage": _model(campaign_schema.ScenarioTable, SCENARIO_UNITS),
        "Joint fit of a campaign": _model(campaign_schema.JointFitTable, CAMPAIGN_UNITS),
        "Verdict of a campaign": _model(campaign_schema.VerdictTable),
        "Prediction of a campaign": _model(campaign_schema.PredictionTable),
        "Fleet of a campaign": _model(campaign_schema.FleetTable),
        "Unit of a fleet": _model(campaign_schema.FleetUnitTable),
        "Metrics": _of(METRICS, dict.fromkeys(METRICS, "K")),
        "Criteria": _of(("sensors",)),
        "Profile": _model(ProfileTable, SLOTS | {"predicted": TEMPERATURE}),
        "Number of a profile": _of(("value", "mark", "clause", "note"), {"value": ANY}),
        "Step of a profile": _model(StepTable, STEP_UNITS),
        "Study": _model(campaign_schema.StudyFile),
        **{name: _model(getattr(campaign_schema, f"{name}Table"), STUDY_UNITS) for name in STUDY},
        "Component": _of([f.name for f in dataclasses.fields(Component)], STUDY_UNITS),
        "Sensor": _of([f.name for f in dataclasses.fields(SensorSpec)], STUDY_UNITS),
        "Action": _of([f.name for f in dataclasses.fields(ProcedureAction)], STUDY_UNITS),
        "Plan": _model(plan_schema.PlanFile),
        **{f"{name} of a plan": _model(getattr(plan_schema, f"{table}Table"), PLAN_UNITS) for name, table in PLAN.items()},
        "Limits of a plan": _model(LimitTable, LIMIT_UNITS),
        "Criteria of a plan": _of(("each", *PLAIN), {"each": "K", "share": "1"}),
        "Test of a plan": _model(plan_schema.TestTable, TEST_UNITS),
        "Log of a test": _model(plan_schema.LogTable),
        "Lock of a plan": _model(plan_schema.LockTable),
        "Look at a test": _model(plan_schema.LookedTable),
        "File of locks": _model(plan_schema.LockFile),
        "Delivery": _model(plan_schema.ChecksFile),
        "Run of a delivery": _model(plan_schema.MetTable, {"times_s": "s", "temperatures_C": "degC"}),
        "Options of the integrator": _of(_plain(dataclasses.fields(td.Options)), {"error": "K", "max_step": "s"}),
        "Values file": _values_file(),
        "Errors": _exceptions(),
    }


def unheaded() -> set[str]:
    """Tables of the files that no heading above stands for."""
    shown = [set(names) for names in by_heading().values()]
    conductor = set(by_heading()["Conductor"])
    out = set()
    for module in (schema, fields, assemblies, campaign_schema, plan_schema):
        for made in vars(module).values():
            if (
                isinstance(made, type)
                and issubclass(made, BaseModel)
                and made.__module__ == module.__name__
                and made.model_fields
                and made not in (fields.ElementTable, fields.UsedTable)
            ):
                keys = set(_model(made))
                out |= {made.__name__} if keys not in shown and not conductor <= keys else set()
    return out


@cache
def words_of_the_code() -> set[str]:
    """Every class, function, field and file key that a row of the page may use."""
    out: set[str] = {name for names in by_heading().values() for name in names} | {s for k in KINDS.values() for s in k.slots} | set(KINDS)
    for path in (ROOT / "src" / "thermid").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                out.add(node.name)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                out.add(node.target.id)
    return out


def disagreements(text: str) -> Iterator[str]:
    """What the page says and the code does not, and the other way round."""
    shown = tables(text)
    for heading, names in by_heading().items():
        rows = {codes(row[0])[0]: row for row in shown.get(heading, []) if codes(row[0])}
        yield from (f"'{heading}' lacks `{name}`" for name in names if name not in rows)
        yield from (f"'{heading}' has `{name}`, which the code does not have" for name in rows if name not in names)
        yield from (f"'{heading}': `{name}` has no meaning" for name, row in rows.items() if len(row[-1]) < 3)
        for name, unit in names.items():
            if unit is not None and name in rows:
                yield from _unit(f"'{heading}': `{name}`", unit, rows[name][1] if len(rows[name]) > 2 else "")
    yield from _kinds(shown.get("Kinds of conductor", []))
    yield from _steps(shown.get("Preparation", []))


def _unit(what: str, unit: str, cell: str) -> Iterator[str]:
    wanted = {ANY: "its own", TEMPERATURE: "degC or K", "1": "-"}.get(unit, unit)
    if cell != wanted:
        yield f"{what} is in {wanted}, the page says '{cell}'"


def _kinds(rows: list[list[str]]) -> Iterator[str]:
    found = {codes(row[0])[0]: row[1] for row in rows}
    yield from (f"'Kinds of conductor' lacks `{kind}`" for kind in KINDS if kind not in found)
    yield from (f"'Kinds of conductor' has `{kind}`, which the code does not have" for kind in found if kind not in KINDS)
    for kind, cell in found.items():
        if kind in KINDS:
            slots = dict(re.findall(r"`([\w.]+)` \[([^\]]+)\]", cell))
            wanted = {name: {"1": "-", TEMPERATURE: "degC or K"}.get(unit, unit) for name, unit in KINDS[kind].slots.items()}
            if slots != wanted:
                yield f"the fields of kind `{kind}` are {wanted}, the page says {slots}"


def _steps(rows: list[list[str]]) -> Iterator[str]:
    for row in rows:
        name, options = codes(row[0])[0], tuple(re.findall(r"\w+", row[1].partition("(")[2]))
        if name in STEPS and options != STEPS[name].options:
            yield f"the options of step `{name}` are {STEPS[name].options}, the page says {options}"
