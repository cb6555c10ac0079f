"""A part that was replaced and tested alone: what is predicted of the unit stands on the new part, by every way of asking."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import thermid as td
from thermid.campaign._retune import _at_rest
from thermid.fit.error_model import ERRORS_KEY, ErrorModel, errors_without
from thermid.values.store import LaterTable
from unit.fit.bench import log
from unit.fit.project import write_log

HEAD = """
title  = "{title}"
needs  = ["place"]
offers = ["element", "housing"]
nodes  = {{ element = {{ capacitance = "20 [J/K]" }}, housing = {{ capacitance = "80 [J/K]" }} }}

[conductors]
pot  = {{ kind = "conduction", between = ["element", "housing"], conductance = {{ value = "{pot} [W/K]", min = 0.01, max = 2 }} }}
foot = {{ kind = "conduction", between = ["housing", "place"], conductance = {{ value = "0.5 [W/K]", min = 0.01, max = 5 }} }}

[loads]
heat = {{ into = "element", power = "1.5 [W]" }}
"""
UNIT = """
title = "Unit"
needs = ["air"]
parameters = { coefficient = { value = "2 [W/(m^2 K)]", min = 0.2, max = 20 } }
nodes = { base = { capacitance = "300 [J/K]" } }
submodels = { head = { use = "head.toml", bind = { place = "base" } } }

[surfaces]
skin = { of = "base", to = "air", area = "300 [cm^2]", htc = { coefficient = "coefficient", exponent = 0.25 }, emissivity = 0.8 }
"""
CAMPAIGN = """
title = "A unit with a head"

[records.head]
file     = "logs/head.csv"
time     = "time_s"

[records.head.channels]
T_E  = { node = "element", noise = "0.03 [K]", accuracy = "0.1 [K]" }
T_H  = { node = "housing", noise = "0.03 [K]", accuracy = "0.1 [K]" }
ROOM = { boundary = "place" }

[records.unit]
file     = "logs/unit.csv"
time     = "time_s"

[records.unit.channels]
T_E  = { node = "head.element", noise = "0.03 [K]", accuracy = "0.1 [K]" }
T_B  = { node = "base", noise = "0.03 [K]", accuracy = "0.1 [K]" }
ROOM = { boundary = "air" }

[[stages]]
name    = "head"
model   = "head.toml"
records = ["head"]
free    = ["pot.conductance", "foot.conductance"]

[[stages]]
name    = "unit"
model   = "unit.toml"
records = ["unit"]
free    = ["coefficient", "base.capacitance"]
inherit = { head = { stage = "head", as = "prior" } }
"""
HOT = td.Scenario("hot", boundaries={"air": "50 [degC]"}, start="air", duration="8 [h]")


TWINS = """
title = "Unit of two heads of one kind"
needs = ["air"]
parameters = { coefficient = { value = "2 [W/(m^2 K)]", min = 0.2, max = 20 } }
nodes = { base = { capacitance = "300 [J/K]" } }
submodels = { hx = { use = "head.toml", bind = { place = "base" } }, hy = { use = "head.toml", bind = { place = "base" } } }

[surfaces]
skin = { of = "base", to = "air", area = "300 [cm^2]", htc = { coefficient = "coefficient", exponent = 0.25 }, emissivity = 0.8 }
"""
OF_TWINS = CAMPAIGN.replace("inherit = { head =", "inherit = { hx =").replace(
    'T_E  = { node = "head.element",',
    'T_F  = { node = "hy.element", noise = "0.03 [K]", accuracy = "0.1 [K]" }\nT_E  = { node = "hx.element",',
)


def campaign_of(
    folder: Path, head: str, unit: str, campaign: str, truth: dict[str, str], nodes: dict[str, str]
) -> tuple[td.Campaign, td.Model, Path]:
    """A campaign on made-up logs, another head, and the folder with a log of that head alone."""
    decks = {"thermid": "", "head": head.format(title="Head", pot=0.1), "new": head.format(title="New head", pot=0.06)}
    for name, text in (decks | {"unit": unit, "campaign": campaign}).items():
        (folder / f"{name}.toml").write_text(text)
    old, new, whole = (td.load_model(folder / f"{n}.toml") for n in ("head", "new", "unit"))
    part = {"T_E": "element", "T_H": "housing"}
    write_log(log(old, {"pot.conductance": "0.12 [W/K]"}, part, noise=0.03, samples=61, boundary="place"), folder / "logs" / "head.csv")
    write_log(log(whole, truth, nodes, noise=0.03, samples=61, seed=2, hours=8.0), folder / "logs" / "unit.csv")
    (folder / "after" / "logs").mkdir(parents=True)
    alone = log(new, {"pot.conductance": "0.05 [W/K]"}, part, noise=0.03, samples=61, boundary="place", seed=3)
    write_log(alone, folder / "after" / "logs" / "head.csv")
    return td.run_stages(folder / "campaign.toml"), new, folder / "after"


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> tuple[td.Campaign, td.Model, Path]:
    """The campaign of a unit of twins, another head, and the folder with a log of that head alone."""
    truth = {"hx.pot.conductance": "0.12 [W/K]", "coefficient": "1.7 [W/(m^2 K)]"}
    nodes = {"T_E": "hx.element", "T_F": "hy.element", "T_B": "base"}
    return campaign_of(tmp_path_factory.mktemp("twins"), HEAD, TWINS, OF_TWINS, truth, nodes)


@pytest.mark.parametrize(("gone", "stayed"), [("hx", "hy"), ("hy", "hx")])
def test_a_twin_that_stays_is_predicted_as_before(
    twins: tuple[td.Campaign, td.Model, Path], gone: str, stayed: str, tmp_path: Path
) -> None:
    """A value that twins share has the name of the first; a swap of that one took it from the model of error of the other, 0.9 K off."""
    before, new, data = twins
    node, fit = f"{stayed}.element", td.design.plan_retune(before, gone, new).run(data, part_only=True)["unit"]
    old, now = td.predict(before["unit"], HOT)[node], td.predict(fit, HOT)[node]
    # a path to the air that the deck of the part that went may have lacked goes with it: 0.13 K of 1.2 K
    assert now.kelvin[-1] == pytest.approx(old.kelvin[-1], abs=0.12 * old.error[-1])
    assert now.error[-1] == pytest.approx(old.error[-1], rel=0.02)
    assert td.predict(fit, HOT)[f"{gone}.element"].kelvin[-1] > old.kelvin[-1] + 10.0
    assert not any(n.startswith(f"{gone}.") for n in fit.store.provenance["unit"]["structural"]["names"])
    errors = td.design.Knowledge.of_source(fit).errors[0]
    assert errors.seen[f"{stayed}.pot.conductance"].acts == ((f"{stayed}.pot.conductance", 1.0, 0.0),)
    fit.save(tmp_path / "unit.values.toml")
    again = td.predict(td.design.Knowledge(fit.model, (td.load_values(tmp_path / "unit.values.toml"),)), HOT)[node]
    assert again.kelvin[-1] == pytest.approx(now.kelvin[-1], abs=0.02)
    assert again.error[-1] == pytest.approx(now.error[-1], rel=0.02)


@pytest.fixture(scope="module")
def retuned(tmp_path_factory: pytest.TempPathFactory) -> tuple[td.Campaign, td.Campaign]:
    """The campaign, and the one after a swap to a head of half the inner conductance, with a log of the new head alone."""
    truth = {"head.pot.conductance": "0.12 [W/K]", "coefficient": "1.7 [W/(m^2 K)]"}
    folder, nodes = tmp_path_factory.mktemp("swap"), {"T_E": "head.element", "T_B": "base"}
    before, new, data = campaign_of(folder, HEAD, UNIT, CAMPAIGN, truth, nodes)
    return before, td.design.plan_retune(before, "head", new).run(data, part_only=True)


def test_a_prediction_stands_on_the_new_part(retuned: tuple[td.Campaign, td.Campaign]) -> None:
    """The unit's model of error, made with the old part, stood for the new one: the band was the old unit's, 17.7 K off."""
    before, after = retuned
    fit, node = after["unit"], "head.element"
    run, old = (td.simulate(c["unit"].model, HOT)[node].final for c in (after, before))
    assert run - old > 10.0
    assert td.predict(fit, HOT)[node].kelvin[-1] - 273.15 == pytest.approx(run, abs=0.5)
    assert td.predict(fit, HOT, draws=200)[node].kelvin[-1] - 273.15 == pytest.approx(run, abs=0.5)
    drawn = td.qualify.uncertain_runs(fit.model, HOT, fit, n=200, nodes=[node], seed=1)
    assert np.mean(drawn.node_temperatures(node)[:, -1]) - 273.15 == pytest.approx(run, abs=0.5)


def test_what_the_unit_showed_of_its_own_elements_is_kept(retuned: tuple[td.Campaign, td.Campaign], tmp_path: Path) -> None:
    """Its model of error loses the part alone: the base is as uncertain as before, and from a file the band is the same."""
    before, after = (td.predict(c["unit"], HOT) for c in retuned)
    assert after["base"].error[-1] == pytest.approx(before["base"].error[-1], rel=0.1)
    fit = retuned[1]["unit"]
    fit.save(tmp_path / "unit.values.toml")
    again = td.predict(td.design.Knowledge(fit.model, (td.load_values(tmp_path / "unit.values.toml"),)), HOT)
    for node in ("base", "head.element"):
        assert again[node].kelvin == pytest.approx(after[node].kelvin, abs=0.02)
        assert again[node].error == pytest.approx(after[node].error, rel=0.02, abs=1e-3)


def test_values_of_a_given_model_that_those_of_the_fit_replace_are_named(retuned: tuple[td.Campaign, td.Campaign]) -> None:
    fit, path = retuned[0]["unit"], "coefficient"
    other = fit.model.with_values({path: "3 [W/(m^2 K)]"})
    assert f"'{path}' is 1." in td.predict(fit, HOT, model=other).warnings[0]
    for same in (fit.given_model, fit.model):
        assert not any(f"'{path}' is " in w for w in td.predict(fit, HOT, model=same).warnings)


def test_a_joint_that_is_made_anew_is_as_uncertain_as_the_store_says(tmp_path: Path) -> None:
    """The joint of a replaced part starts at its old value within 25 %, but the band had it as sure as before: 0.86 K in place of 1.5."""
    skin = 'surfaces = {{ skin = {{ of = "housing", to = "place", area = "60 [cm^2]", htc = "8 [W/(m^2 K)]" }} }}\n'
    foot = next(line for line in HEAD.splitlines() if line.startswith("foot"))
    seat = """[conductors.seat]
kind = "contact"
between = ["head.housing", "base"]
area = "2 [cm^2]"
contact_conductance = { value = "2000 [W/(m^2 K)]", min = 50, max = 50000 }
"""
    head = HEAD.replace(foot, "").replace("\n[conductors]", f"{skin}\n[conductors]")
    unit = UNIT.replace("[surfaces]", f"{seat}\n[surfaces]").replace('place = "base"', 'place = "air"')
    campaign = CAMPAIGN.replace(', "foot.conductance"', "").replace(
        '"base.capacitance"]', '"base.capacitance", "seat.contact_conductance"]'
    )
    truth = {"head.pot.conductance": "0.12 [W/K]", "coefficient": "1.7 [W/(m^2 K)]", "seat.contact_conductance": "600 [W/(m^2 K)]"}
    before, new, data = campaign_of(tmp_path, head, unit, campaign, truth, {"T_E": "head.element", "T_B": "base"})
    fit = td.design.plan_retune(before, "head", new).run(data, part_only=True)["unit"]
    assert fit.store.error("seat.contact_conductance") > 10.0 * before["unit"].store.error("seat.contact_conductance")
    old, now = (td.predict(one, HOT)["head.element"].error[-1] for one in (before["unit"], fit))
    assert now > 2.0 * old


def test_a_second_swap_keeps_the_first_in_mind(twins: tuple[td.Campaign, td.Model, Path]) -> None:
    table = twins[0]["unit"].store.provenance["unit"][ERRORS_KEY]
    both = errors_without(errors_without(table, ["hx"]), ["hy"])
    assert both.without == ("hx", "hy")
    assert not any(n.startswith("h") for n in ErrorModel.from_dict(both.table).seen)
    assert LaterTable.of_table(both.table).without == both.without


def test_no_mistake_is_looked_for_in_logs_that_a_kept_stage_does_not_have(retuned: tuple[td.Campaign, td.Campaign]) -> None:
    assert not any("failed" in line for mistakes in retuned[1].mistakes.values() for line in mistakes.lines())
    assert "failed" not in str(retuned[1]).splitlines()[1]


@pytest.mark.parametrize("kind", ["fit", "file"])
def test_python_inherits_as_a_campaign_does(retuned: tuple[td.Campaign, td.Campaign], tmp_path: Path, kind: str) -> None:
    """The stage `unit` by `calibrate` alone, from the fit of the head or its file: the same values, with the same errors."""
    head, unit = (retuned[0][n] for n in ("head", "unit"))
    head.save(tmp_path / "head.values.toml")
    inherit = {"head": head if kind == "fit" else tmp_path / "head.values.toml"}
    moving = ["head.pot.conductance", "head.foot.conductance"]
    assert unit.request is not None
    bare = unit.model.replace("head", head.model)
    own = ["coefficient", "base.capacitance"]
    again = td.calibrate(bare, unit.request.records, [*own, *moving], inherit=inherit, name="unit")
    for path in (*own, *moving):
        assert again[path].value == pytest.approx(unit[path].value, rel=1e-6), path
        assert again[path].error == pytest.approx(unit[path].error, rel=1e-3), path
    fixed = td.calibrate(bare, unit.request.records, own, inherit=inherit, name="unit")
    assert fixed.store["head.pot.conductance"].value == pytest.approx(head["pot.conductance"].value)
    assert fixed["coefficient"].error < td.calibrate(bare, unit.request.records, own)["coefficient"].error * 10.0
    with pytest.raises(td.errors.NameNotFoundError, match="'head'"):
        td.calibrate(bare, unit.request.records, own, inherit={"haed": head})


BAY = """
title = "Bay"
needs = ["air"]
offers = ["base"]
parameters = { coefficient = { value = "2 [W/(m^2 K)]", min = 0.2, max = 20 } }
nodes = { base = { capacitance = "300 [J/K]" } }
loads = { heater = { into = "base", power = "4 [W]" } }

[surfaces]
skin = { of = "base", to = "air", area = "300 [cm^2]", htc = { coefficient = "coefficient", exponent = 0.25 }, emissivity = 0.8 }
"""
ON_BENCH = """
title = "Bay on a bench"
needs = ["air"]
submodels = { bay = { use = "bay.toml", bind = { air = "air" } } }
"""
WITH_BAY = """
title = "Unit"
needs = ["air"]

[submodels]
bay  = { use = "bay.toml", bind = { air = "air" } }
head = { use = "head.toml", bind = { place = "bay.base" } }
"""
OF_BAY = CAMPAIGN.replace('"base", noise', '"bay.base", noise').replace(
    '[[stages]]\nname    = "unit"',
    '[[stages]]\nname = "bay"\nmodel = "bay_bench.toml"\nrecords = ["bay"]\nfree = ["bay.coefficient", "bay.base.capacitance"]\n\n'
    '[[stages]]\nname    = "unit"',
)
OF_BAY = OF_BAY.replace('"coefficient", "base.capacitance"', '"bay.base.capacitance"').replace(
    '{ head = { stage = "head", as = "prior" } }', '{ head = { stage = "head", as = "prior" }, "." = { stage = "bay", as = "prior" } }'
)
OF_BAY += """
[records.bay]
file     = "logs/bay.csv"
time     = "time_s"

[records.bay.channels]
T_B  = { node = "bay.base", noise = "0.03 [K]", accuracy = "0.1 [K]" }
ROOM = { boundary = "air" }
"""


def test_a_part_is_replaced_beside_one_that_was_tested_in_a_bench_deck(tmp_path: Path) -> None:
    """The bench deck stands at the place of the whole unit, which has parts that the bench had not: its test is kept."""
    for name, text in {"bay": BAY, "bay_bench": ON_BENCH}.items():
        (tmp_path / f"{name}.toml").write_text(text)
    bench = log(td.load_model(tmp_path / "bay_bench.toml"), {}, {"T_B": "bay.base"}, noise=0.03, samples=61, seed=5, hours=8.0)
    write_log(bench, tmp_path / "logs" / "bay.csv")
    nodes = {"T_E": "head.element", "T_B": "bay.base"}
    before, new, data = campaign_of(tmp_path, HEAD, WITH_BAY, OF_BAY, {"head.pot.conductance": "0.12 [W/K]"}, nodes)
    plan = td.design.plan_retune(before, "head", new)
    assert {s.name: s.action for s in plan.stages} == {"head": "run", "bay": "kept", "unit": "run"}
    assert plan.run(data, part_only=True)["unit"].model.submodel("head").title == "New head"
    of_bay = td.design.plan_retune(before, "bay", td.load_model(tmp_path / "bay.toml"))
    assert {s.name: s.action for s in of_bay.stages} == {"head": "kept", "bay": "run", "unit": "run"}
    assert of_bay.tests == ("bay", "unit")


def test_a_share_of_a_logged_power_goes_with_the_load_of_the_part_that_is_replaced() -> None:
    """A part whose logged power had a fitted share could not be replaced: the share stayed, without its power."""
    power = {"head.heat": (np.array([0.0, 60.0]), td.quantity(np.array([1.0, 3.0]), unit="W"))}
    shared = {"head.heat": "head.share"}
    bare = td.Scenario("log", boundaries={"air": "20 [degC]"}, loads=power, gains=shared, start="air", duration="60 [s]")
    done = SimpleNamespace(bare=bare)
    assert not _at_rest(done, "head").loads
    assert not _at_rest(done, "head").gains
    kept = _at_rest(done, "bay")
    assert kept.gains == shared
    assert [*kept.loads] == ["head.heat"]
