"""One of every public result, made cheaply, and what is in it as one number; the tests of pickling use both, in two processes."""

from __future__ import annotations

import hashlib
import pickle
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

import thermid as td
from unit.fit.bench import HTC, MASS, box, log, metered, pair
from unit.fit.test_sensor_matrix import FINISH, Cell
from unit.qualify.project import project
from unit.qualify.things import soak, unit

HOT = td.Scenario("hot", boundaries={"air": "40 [degC]"}, start="air", duration="2 [h]")
FALL = {"times": ["0 [s]", "50 [s]", "60 [s]"], "values": ["101 [kPa]", "1 [kPa]", "0 [kPa]"]}


def of_a_fit(folder: Path) -> dict[str, Any]:
    """Return fits, predictions and what is said of them."""
    cell = Cell(("lag",), folder)
    campaign, model = cell.campaign, box(FINISH)
    record = metered(log(model, {HTC: "6 [W/(m^2 K)]"}, {"T": "case"}, samples=31, accuracy=0.2), "heat", 4.0, 0.05)
    fit = td.calibrate(model, record, [HTC, MASS])
    known = td.design.Knowledge.of_source(fit)
    foreseen, limits = td.design.foresee(known, HOT), td.qualify.Limits("case", "case", td.quantity((250.0, 350.0), unit="K"))
    history = td.inference.power_history(
        model, log(model, {}, {"T": "case"}, samples=31), "heat", known=[("0 [h]", "1 [h]", "4 [W]")], every="30 [min]"
    )
    runs = td.qualify.uncertain_runs(model, HOT, fit, n=400, nodes=["case"], every="1 [h]")
    return {
        "record": record,
        "channel": record["T"],
        "calibration": fit,
        "identity": next(iter(td.model.identities(model).values())),
        "kept tasks": td.simulation.KeptTasks(folder / "job"),
        "campaign": campaign,
        "joint": campaign.joint,
        "verdict": campaign.verdicts[0],
        "credibility": td.inference.credibility(campaign),
        "plan of a retune": td.design.plan_retune(campaign, "box", cell.folder / "cool.toml"),
        "prediction": td.predict(fit, HOT),
        "spread": td.design.Spread.of_fit(fit.values),
        "discrepancy": td.inference.discrepancy(fit),
        "identifiability": td.identifiability(fit),
        "profile": td.inference.profile(fit, HTC),
        "criticism": td.inference.criticise(fit, elements=False),
        "plausibility": td.inference.plausibility(fit),
        "balance": td.inference.energy_balance(fit, record, "3 [h]", limit="100 [K/h]"),
        "split": td.inference.split(fit),
        "known": known,
        "foresight": foreseen,
        "limits": limits,
        "margin": td.qualify.margins({"hot": foreseen}, [limits])[0],
        "aim": td.design.Aim(HOT, "case"),
        "action": td.design.Action("hot", HOT),
        "advice": td.design.next_test(fit, HTC, [td.design.Action("hot", HOT)]),
        "history": history,
        "law of a power": history.laws()[0],
        "changes": td.inference.compare_models(model, box(), [HOT]),
        "sizing": td.design.size(model, HTC, [td.qualify.Limits("case", "case", (-np.inf, "90 [degC]"))], [HOT], between=(2.0, 19.0)),
        "worst cases": td.design.worst_case(
            box(), [td.qualify.Limits("case", "case", (-np.inf, "90 [degC]"))], HOT, {"air": ("20 [degC]", "40 [degC]")}
        ),
        "fleet": _fleet(),
        "uncertain runs": runs,
        "hold": td.qualify.hold(runs, {"case": "60 [degC]"}),
        "criteria": td.Criteria(rmse="1 [K]"),
        "forecast": td.bench.forecast(log(model, {}, {"T": "case"}, samples=121), within="5 [K]"),
        "stability": td.bench.stability(record, "3 C/h"),
        "diagnosis": td.inference.diagnose(_compared()),
        "correlation": td.qualify.correlate(_compared(), ["ECSS"], steady={"bench": [(14400.0, 18000.0)]}),
    }


def that_take_longer() -> dict[str, Any]:
    """Return results that take a second each."""
    model = box(FINISH)
    return {
        "posterior": td.inference.posterior(td.calibrate(model, log(model, {}, {"T": "case"}, samples=31), [HTC]), steps=20, walkers=16),
        "equations": td.interop.equations(unit()),
    }


def _written(path: Path) -> Path:
    """Return a log of three rows."""
    path.write_text("time_s,T [degC]\n0,20.0\n10,20.5\n20,21.0\n", encoding="utf-8")
    return path


def _fleet() -> td.inference.Fleet:
    """Return four alike units but for one value."""
    values = {f"u{k}": f"{4.0 + 0.4 * k} [W/(m^2 K)]" for k in range(4)}
    logs = {n: log(box(), {HTC: v}, {"T": "case"}, samples=31, name=n) for n, v in values.items()}
    return td.inference.fleet(box(), logs, [HTC])


def _compared() -> td.Calibration:
    """Return two sensors on a pair beside what its deck says."""
    return td.compare(pair(), log(pair(), {}, {"T": "a.case", "T2": "b.case"}, samples=31, boundary="room", accuracy=0.2))


def of_a_run(folder: Path) -> dict[str, Any]:
    """Return models, scenarios, runs, and what is made for a qualification."""
    model = box(FINISH)
    chamber = td.model_from_dict(
        {
            "title": "room",
            "needs": ["air"],
            "nodes": {"a": {"capacitance": "300 [J/K]"}, "b": {"capacitance": "500 [J/K]"}},
            "surfaces": {
                f"face_{name}": {"of": name, "to": "air", "area": "0.1 [m^2]", "htc": "4 [W/(m^2 K)]", "emissivity": 0.8}
                for name in ("a", "b")
            },
            "enclosures": {"inside": {"faces": {"a": "face_a", "b": "face_b"}, "view_factors": [[0.0, 0.5], [0.5, 0.0]], "rest": "air"}},
        }
    )
    block = td.Block(("10 [mm]",) * 3, (2, 2, 2), "15 [W/(m K)]", "4000 [kg/m^3]", "500 [J/(kg K)]").exchanging(
        "all", "air", htc="20 [W/(m^2 K)]"
    )
    warm = td.Scenario("warm", boundaries={"air": "40 [degC]"}, start="20 [degC]", duration="10 [min]")
    profile = td.qualify.profile_of("SMC-S-016", "unit thermal cycle", predicted=("-10 [degC]", "40 [degC]"), cycles=1)
    plan = td.qualify.load_plan(project(folder))
    simulator = td.prepare(model, HOT, [HTC])
    return {
        "model": model,
        "network": td.simulation.compile_network(chamber),
        "enclosure": td.simulate(chamber, warm),
        "scenario": HOT,
        "block": block,
        "block's run": td.simulate(block, warm),
        "simulator": simulator,
        "solution": simulator.run(sensitivities=True),
        "steady": td.steady(model, HOT),
        "look": td.look(_written(folder / "seen.csv")),
        "ensemble": td.ensemble(model, HOT, {HTC: np.array([4.0, 6.0])}),
        "environment": td.simulation.Environment(),
        "radiation": td.simulation.Irradiation(total="300 [W/m^2]"),
        "sky": td.site.OpenSky(*[np.array([0.0, 60.0])] * 7, air="air"),
        "ascent": td.site.ascent_checks(td.site.ascent_scenario(pressure=FALL, air_temperature="20 [degC]", duration="1 [min]"))[0],
        "trajectory": td.site.Trajectory(np.array([0.0, 60.0]), np.array([0.0, 5e3])),
        "volume": td.site.Volume("2 [l]", humidity=0.5),
        "moisture": td.site.moisture(box({"surfaces/skin/effective_htc": "6 [W/(m^2 K)]"}), HOT, {"air": 0.3}),
        "profile": profile,
        "run of a profile": td.qualify.run_profile(unit(), profile),
        "reduction": td.qualify.reduce(unit(), soak(), nodes=2, keep=["proc"]),
        "plan": plan,
        "qualification": td.qualify.run_plan(plan),
        "htc": td.inference.compare_htc(2.0, 0.1, "36 [degC]", "24 [degC]", 0.025),
        "script": td.interop.read_initfcn("L = 25; % [mm]\n"),
        "options": td.Options(),
        "site": td.site.Site(10.0, 20.0),
        "certificate": td.bench.SensorCertificate(0.1, 0.02),
        "part": td.bench.SensorPart(lag=20.0),
        "weather": td.site.Weather("w", None, {}, {}),
        "criteria": td.Criteria("ours", each=1.0, kinds=("steady",)),
    }


def numbers(result: object) -> str:
    """Return a hash of all numbers and names in a result, and of what it works out when asked."""
    total, seen = hashlib.sha256(), dict[int, object]()  # kept, lest another takes the place of one that is gone

    def take(value: object) -> None:
        if isinstance(value, np.ndarray):
            total.update(np.ascontiguousarray(value).tobytes() if value.dtype != object else str(value).encode())
        elif isinstance(value, str | int | float | bool | bytes | None):
            total.update(repr(value).encode())
        elif id(value) in seen:
            return
        elif isinstance(value, Mapping):
            seen[id(value)] = value
            for key, inner in value.items():
                take(key if isinstance(key, str) else str(key))
                take(inner)
        elif isinstance(value, list | tuple):
            seen[id(value)] = value
            for inner in value:
                take(inner)
        elif is_dataclass(value) and not isinstance(value, type):
            seen[id(value)] = value
            for f in fields(value):
                if f.init:
                    take(getattr(value, f.name))

    take(result)
    for name in ("temperatures", "heat_flows", "load_powers", "time_constants", "warnings", "final_field"):
        if isinstance(result, td.simulation.Ensemble | td.qualify.UncertainRuns | td.simulation.BlockSolution) and name != "temperatures":
            continue
        if not callable(getattr(type(result), name, None)):
            take(getattr(result, name, None))
    if isinstance(result, td.Calibration):
        take(result.problem.residuals(np.array(list(result.fitted.values()))) if result.problem else None)
        take([b.predicted for b in result.blocks])
        take(td.predict(result, HOT).final["case"].error if result.model.needs == ("air",) else None)
    if isinstance(result, td.simulation.Simulator):
        take(result.run({HTC: 4.5})["case"].kelvin)
    if isinstance(result, td.Solution):
        take([result.slopes(n) for n in result.nodes] if result.free else None)
        take(result.heat_balance().residual)
    return total.hexdigest()


if __name__ == "__main__":
    with Path(sys.argv[1]).open("rb") as file:
        for name, one in pickle.load(file).items():
            print(name, numbers(one), sep="\t")
