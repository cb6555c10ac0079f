"""What is written is read back: values files with every key of their grammar, and those of fits of every kind of deck."""

from __future__ import annotations

import dataclasses
import json
import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

from thermid.base.files import grammar_of
from thermid.bench.bench_files import MappedSensor, load_sensors, save_sensor
from thermid.campaign._judge.verdict import _read, look
from thermid.campaign.stages import KeptStage
from thermid.fit._error_model.elements import JointLaw, SurfaceLaw
from thermid.fit._error_model.kept import ErrorModel, KeptWay, SeenValue
from thermid.fit._error_model.own_values import Beside
from thermid.fit._error_model.runs import Departures, Smooth, UnknownColumn
from thermid.fit.calibration import KeptFit, calibrate
from thermid.fit.error_model import Discrepancy, OperatingPoint, OwnValue
from thermid.measure.records import Channel, Record, SensorCertificate
from thermid.model.tree import KINDS, Dropped, Model, Standing, load_model, model_from_dict, save_model
from thermid.prediction._known import known_of
from thermid.simulation.runs import Scenario, simulate
from thermid.values.store import (
    DISTRIBUTIONS,
    Cut,
    Distribution,
    Filed,
    LaterTable,
    LeftOut,
    Logarithm,
    Normal,
    Shifted,
    Source,
    State,
    Store,
    ValueOrigin,
    hand_values,
    load_store,
    load_values,
    save_store,
)
from unit.model.every_kind import firsts

ORIGIN = ValueOrigin("fit", "s", ("r",), "k", "2026-01-01")
STANDING = Standing("failed", "why", "s", True, (Standing("not adequate", "x", "t"),))
STATE = State(
    "a.x", 2.0, True, "W", (0.5, math.inf), ORIGIN, "parameter", ("a.x", "b.x"), ("b.x",), "a", "2 [W]",
    (ValueOrigin("hand", "h"),), STANDING, 1.5, 0.1, (0.7, 0.2), False, True,
)  # fmt: skip
DISCREPANCY = Discrepancy(
    {"a.skin": OperatingPoint(10.0, 300.0)}, ("a.x",), {"a.skin": (310.0, 300.0)}, ("a.joint",), {"a.share": np.array([0.5])},
    {"a.share": (0.01, 0.02)},
)  # fmt: skip
OWN = OwnValue("air", "AIR", 0.1, 0.2, 3, (Beside("T", 0.3, 0.4, 0.5),))
AT = OperatingPoint(10.0, 300.0)
WAY = KeptWay(
    "free air", 1.0, {"a.skin": SurfaceLaw(AT, 0.25, 0.2, 1.5, None), "a.joint": JointLaw(AT, 0.01, None)}, {"a.x": 0.1},
    Departures({"a.skin": Smooth(AT, "surface", np.zeros((1, 2)), np.array([0.5]), (True,), 0.02)}, (60.0,), ("a.n",), 1),
    (UnknownColumn("exponent of a.skin", "", 0.1, "a.skin"),), np.array([0.05, 0.1]), np.array([[0.2, 0.0], [0.1, 0.3]]), {"run": 0.02},
    ((1.0, 0.1, 0.3),),
)  # fmt: skip
ERRORS = ErrorModel("s", {"a.x": SeenValue("parameter", True, (("air", 1.0, 0.5),), 0.1, 0.2, -1.0, 1.0)}, (WAY,), 1.1, "why", spot="a.x")


def test_laws_of_a_model_of_error_keep_their_form_in_files() -> None:
    """Files that users keep were refused once for a key that nobody read any more."""
    skin = {"at": [10.0, 300.0], "surface": True, "exponent": 0.25, "share": 0.2, "fitted": 1.5}
    joint = {"at": [10.0, 300.0], "surface": False, "trend": 0.01}
    assert WAY.to_dict()["laws"] == {"a.skin": skin, "a.joint": joint}
    assert ErrorModel.from_dict(ERRORS.to_dict()).to_dict() == ERRORS.to_dict()


def test_a_file_whose_derivatives_were_taken_where_values_are_expected_says_what_it_said() -> None:
    """As the files of commits before a values' mean was kept beside the place of its derivatives."""
    way = WAY.to_dict()
    before = ErrorModel.from_dict({**ERRORS.to_dict(), "ways": [{**way, "values": {"a.x": 0.15}, "mean": way["mean"][1:]}]})
    assert ERRORS.mean == pytest.approx([0.15])
    assert before.mean == pytest.approx([0.15])


def laws() -> Iterator[Distribution]:
    """One distribution of each kind that a file may hold."""
    for kind in DISTRIBUTIONS.values():
        if kind in (Cut, Logarithm):
            yield kind(Normal(1.0, 0.1), 0.5) if kind is Logarithm else kind(Normal(1.0, 0.1), 0.5, 2.0)
        else:
            yield Shifted(Normal(), 1.0) if kind is Shifted else kind(*(k + 2 for k in range(len(dataclasses.fields(kind)))))


def whole_store() -> Store:
    """A store in which nothing stands at its default."""
    sources = tuple(Source(f"k:{n}", "data", law, "words") for n, law in enumerate(laws()))
    provenance = {
        "version": "1", "date": "d", "model": "m", "records": {"r": "ab"}, "synthetic": True, "conditions": {"a.skin": [1.0, 2.0]},
        "misfit": {"a.n": 0.1}, "structural": DISCREPANCY.to_dict(), "own": [OWN.to_dict()],
        "errors": LaterTable(ERRORS.to_dict, without=("gone",)),
    }  # fmt: skip
    return Store(
        {STATE.path: STATE}, sources, np.full((1, len(sources)), 0.1), {"ab": "s"}, {"s": provenance}, ("c",),
        (Dropped("y", "1 [W]", "o", "w"),), (LeftOut("what", 0.5, True),),
    )  # fmt: skip


def keys_of(grammar: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield every table of a grammar once."""
    seen, todo = set(), [grammar]
    while todo:
        table = todo.pop()
        if table in seen:
            continue
        seen.add(table)
        yield table
        todo += [t for f in table.model_fields.values() for t in tables_in(f.annotation)]


def tables_in(form: Any) -> list[type[BaseModel]]:
    """Tables that stand somewhere in a type."""
    if isinstance(form, type) and get_origin(form) is None:
        return [form] if issubclass(form, BaseModel) else []
    return [t for inner in get_args(form) for t in tables_in(inner)]


def given(table: type[BaseModel], name: str, content: BaseModel) -> bool:
    """Whether a key of a table of the grammar is written anywhere in a file."""
    here = isinstance(content, table) and name in content.model_fields_set
    return here or any(given(table, name, inner) for value in vars(content).values() for inner in models_in(value))


def models_in(value: Any) -> list[BaseModel]:
    """Tables of a grammar that stand somewhere in what was read."""
    if isinstance(value, BaseModel):
        return [value]
    several = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [m for one in several for m in models_in(one)]


def test_a_values_file_with_every_key_of_its_grammar_is_read_back(tmp_path: Path) -> None:
    """What the classes hold, each at something else than its default, is written under keys of the grammar; every key is one of them."""
    store = whole_store()
    for thing in (store, STATE, STANDING, ORIGIN, *store.left_out, *store.dropped, DISCREPANCY, ERRORS, OWN):
        plain = [f.name for f in dataclasses.fields(thing) if f.default is not dataclasses.MISSING and f.name not in ("kind", "gain")]
        assert [n for n in plain if getattr(thing, n) == type(thing).__dataclass_fields__[n].default] == []
    save_store(store, tmp_path / "v.toml", "s")
    back, stage = load_store(tmp_path / "v.toml")
    assert (back, stage) == (store, "s")
    kept = back.provenance["s"]
    assert Discrepancy.from_dict(kept["structural"]).to_dict() == DISCREPANCY.to_dict()
    assert OwnValue.from_dict(kept["own"][0]) == OWN
    assert ErrorModel.from_dict(kept["errors"].table).to_dict() == ERRORS.to_dict()
    content = grammar_of("values").model_validate(tomllib.loads((tmp_path / "v.toml").read_text()))
    unwritten = [(t.__name__, n) for t in keys_of(type(content)) for n in t.model_fields if not given(t, n, content)]
    assert unwritten == []


def words_of(table: Any, key: str) -> tuple[str, ...]:
    """The words that a key of a grammar may have."""
    return next(get_args(a) for a in get_args(table.model_fields[key].annotation) if get_origin(a) is Literal)


DECK = grammar_of("deck")
CARRIED_BY = words_of(next(t for t in keys_of(DECK) if t.__name__ == "SurfaceTable"), "carried_by")


def box(surfaces: dict[str, Any], conductors: dict[str, Any] | None = None) -> dict[str, Any]:
    """A case in air with some surfaces, heated by 5 W; conductors join it to a foot."""
    skins = {n: {"of": "case", "to": "air", "area": "0.05 [m^2]", **fields} for n, fields in surfaces.items()}
    links = {n: {"between": ["case", "foot"], **fields} for n, fields in (conductors or {}).items()}
    base = {"value": "0.2 [W/K]", "min": 0.01, "max": 5}
    links["strap"] = {"kind": "conduction", "between": ["case", "air"], "conductance": base}
    nodes = {"case": {"capacitance": "400 [J/K]"}} | (
        {"foot": {"capacitance": "100 [J/K]", "stands_for": "air and walls"}} if conductors else {}
    )
    heat = {"into": "case", "power": "5 [W]"}
    return {"title": "Box", "needs": ["air"], "nodes": nodes, "surfaces": skins, "conductors": links, "loads": {"heat": heat}}


DECKS = {
    **{f"carried by {w}": box({"skin": {"htc": "5 [W/(m^2 K)]", "carried_by": w}}) for w in CARRIED_BY},
    **{f"with radiation, by {w}": box({"skin": {"effective_htc": "6 [W/(m^2 K)]", "carried_by": w}}) for w in CARRIED_BY},
    "carried by nobody says": box({"skin": {"effective_htc": "6 [W/(m^2 K)]"}, "rest": {"htc": "3 [W/(m^2 K)]", "emissivity": 0.5}}),
    "every kind of conductor": box({}, {kind: fields for kind, fields in firsts().items()}),
}


def test_every_kind_of_conductor_is_among_the_decks() -> None:
    assert set(firsts()) == set(KINDS)


@pytest.mark.parametrize("name", DECKS)
def test_the_values_of_a_fit_are_read_back_by_every_reader(tmp_path: Path, name: str) -> None:
    model = model_from_dict(DECKS[name])
    assert isinstance(model, Model)
    save_model(model, tmp_path / "deck.toml")
    times = np.linspace(0.0, 7200.0, 41)
    scenario = Scenario("s", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration=7200.0)
    seen = simulate(model.with_values({"strap.conductance": "0.25 [W/K]"}), scenario, times=times)["case"].kelvin
    readings = Channel.from_array(
        "T", seen + 0.05 * np.random.default_rng(1).standard_normal(times.size), role="node", target="case", unit="K", noise=0.05
    )
    log = Record.from_arrays("log", times, {"T": readings})
    fit = calibrate(load_model(tmp_path / "deck.toml"), log, ["strap.conductance"], scenario=scenario)
    file = tmp_path / "v.toml"
    fit.save(file)
    assert load_store(file)[0] == fit.store
    value = fit["strap.conductance"].value
    assert load_values(file)["strap.conductance"].value == value
    laid = Filed.read(file, model)
    assert laid.gone == ()
    assert laid.model.at("strap.conductance").expression.literal.value == value
    assert hand_values(file, model, "s", "here")["strap.conductance"].value == value
    known = known_of(load_values(file), model)
    assert json.dumps([k.to_dict() for k in known.discrepancies]) == json.dumps([k.to_dict() for k in known_of(fit).discrepancies])


def test_sensors_looks_and_kept_fits_with_every_key_are_read_back(tmp_path: Path) -> None:
    sensor = MappedSensor("T1", "28AABBCCDDEE0039", SensorCertificate(0.25, 0.1, "293.15 [K]", "2026-01-01"), "a note")
    save_sensor(tmp_path / "sensors.toml", sensor)
    assert load_sensors(tmp_path / "sensors.toml") == {sensor.rom: sensor}
    written = grammar_of("sensors").model_validate(tomllib.loads((tmp_path / "sensors.toml").read_text()))
    assert [(t.__name__, n) for t in keys_of(type(written)) for n in t.model_fields if not given(t, n, written)] == []
    assert look(tmp_path, "r", "ab", "s", "k", False) == ()
    (seen,) = _read(tmp_path)
    assert (seen.record, seen.stage, seen.key, seen.passed) == ("r", "s", "k", False)
    end = KeptFit({"x": 0.1 + 0.2}, 7, "searched", ("a remark",))
    KeptStage(tmp_path, "s").remember("k", end, {"deck": "h"})
    assert KeptStage(tmp_path, "s").recall("k") == end
