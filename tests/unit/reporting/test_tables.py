"""Tables: the numbers are those of the calibration, whole records counted; parts keep their line from level to level."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from thermid.campaign.stages import Campaign
from thermid.reporting._blocks.content import DASH, Cell, Head, Table, number, pretty, signed, significant
from thermid.reporting._pages import tables


def column(table: Table, title: str) -> list[str]:
    at = [c.title for c in table.columns].index(title)
    return [row[at].text for row in table.rows]


def row(table: Table, first: str) -> dict[str, Cell]:
    found = next(r for r in table.rows if r[0].text == first)
    return {c.title: cell for c, cell in zip(table.columns, found, strict=True)}


def test_every_fitted_parameter_has_before_after_errors_unit_bounds_and_source(campaign: Campaign) -> None:
    for stage in campaign:
        fit = campaign[stage]
        table = tables.parameters(fit)
        assert column(table, "parameter") == list(fit.values.parameters)
        for path, v in fit.values.parameters.items():
            line = row(table, path)
            assert float(line["after"].text) == pytest.approx(v.in_unit, abs=v.shown(v.error_random))
            assert float(line["before"].text) == pytest.approx(v.shown(v.start), rel=1e-4)
            assert float(line["± random"].text) == pytest.approx(v.shown(v.error_random), rel=0.06)
            assert float(line["± total"].text) == pytest.approx(v.shown(v.error), rel=0.06)
            assert line["unit"].text == "W/(m² K)"
            assert float(line["shift / ±"].text) == pytest.approx((v.value - v.start) / v.error, abs=0.06)
            assert line["state"].text == "free"
    below = row(tables.parameters(campaign["component"]), "skin.effective_htc")
    assert below["bounds"].text == "1 .. 15"
    assert below["source before"].text == "published"
    above = row(tables.parameters(campaign["submodel"]), "a.skin.effective_htc")
    assert above["source before"].text == "stage 'component'"


def test_a_value_at_its_bound_or_without_an_error_is_marked(campaign: Campaign) -> None:
    fit = campaign["component"]
    v = fit.values["skin.effective_htc"]

    def state(changed: object) -> Cell:
        values = replace(fit.values, items_={**fit.values.items_, "skin.effective_htc": changed})
        return row(tables.parameters(replace(fit, values=values)), "skin.effective_htc")["state"]

    bound = state(replace(v, value=15.0))
    assert (bound.text, bound.look) == ("at its upper bound", "bad")
    assert bound.tip
    assert state(replace(v, error=math.inf)).text == "not determined"
    assert state(replace(v, also=("other.htc",))).text == "free, shared by 2 instances"


def test_coefficients_keep_their_line_from_component_to_submodel(campaign: Campaign) -> None:
    htc, others = tables.levels(campaign)
    lines = {line[1].text: [c.text for c in line[3:]] for line in htc.rows}
    component = campaign["component"]["skin.effective_htc"]
    submodel = campaign["submodel"]["a.skin.effective_htc"]
    assert lines["a.skin.effective_htc"] == [f"{significant(v.value, v.error)} ± {number(v.error, 2)}" for v in (component, submodel)]
    # the second instance of the same part: the component's value, and what [set] holds above
    assert lines["b.skin.effective_htc"][1] == "3.00"
    assert {line[0].text for line in htc.rows} == {"Box"}
    # a stage may be called 'unit'
    assert [c.title for c in htc.columns] == ["part", "parameter", "unit", "stage component", "stage submodel"]
    table = campaign.table("effective_htc")
    for part in ("a.skin", "b.skin"):
        shown = float(lines[f"{part}.effective_htc"][1].split()[0])
        assert shown == pytest.approx(table[part]["submodel"], abs=0.05)
    contact = next(line for line in others.rows if line[1].text == "stack.contact_conductance")
    assert contact[3].text == DASH
    assert contact[4].text.startswith(
        significant(campaign["submodel"]["stack.contact_conductance"].value, campaign["submodel"]["stack.contact_conductance"].error)
    )


def test_sensor_statistics_count_every_sample(campaign: Campaign) -> None:
    fit = campaign["submodel"]
    table = tables.sensors(fit)
    for name in ("T a", "T b"):
        residuals = np.concatenate([b.residuals for b in fit.blocks if b.sensor == name])
        line = row(table, name)
        assert line["samples"].text == str(residuals.size) == "121"
        assert float(line["RMSE, K"].text) == pytest.approx(np.sqrt(np.mean(residuals**2)), rel=5e-3)
        assert float(line["largest, K"].text) == pytest.approx(residuals[np.abs(residuals).argmax()], abs=6e-4)
        assert line["stated ±, K"].text == "0.2"
        assert line["noise, K"].text == "0.05"
        assert "±" in line["bias, K"].text
    assert len(tables.records(fit).rows) == 2


def test_medians_are_over_records(campaign: Campaign) -> None:
    fit = campaign["component"]
    first = fit.blocks[0]
    blocks = [replace(first, record=f"r{k}", measured=first.predicted + size) for k, size in enumerate((0.1, 0.2, 5.0))]
    line = row(tables.sensors(replace(fit, blocks=tuple(blocks))), "T box")
    assert line["records"].text == "3"
    assert float(line["median RMSE, K"].text) == pytest.approx(0.2)
    assert float(line["RMSE, K"].text) == pytest.approx(np.sqrt((0.01 + 0.04 + 25.0) / 3), rel=1e-2)


def test_verdicts_name_found_limit_and_result(campaign: Campaign) -> None:
    table = tables.verdicts(campaign)
    assert column(table, "criterion") == ["RMSE", "largest error"] * 2
    results = column(table, "result")
    assert results == ["✓ met", "✗ not met"] * 2
    assert column(table, "limit, K") == ["0.3", "0.0001"] * 2
    residuals = next(b.residuals for b in campaign.verdicts[0].prediction.blocks if b.sensor == "T a")
    assert column(table, "outside")[1] == f"{int((abs(residuals) > 1e-4).sum())} of {residuals.size}"
    assert column(table, "conditional on") == ["nothing"] * 4
    conditional = replace(campaign, verdicts=(replace(campaign.verdicts[0], fitted_locally=("room", "start"), deciding=("room",)),))
    assert column(tables.verdicts(conditional), "conditional on") == ["room"] * 4


def test_the_area_ledger_adds_up(campaign: Campaign) -> None:
    table = tables.areas(campaign["submodel"].model)
    assert [r[0].text for r in table.rows] == ["a.skin", "b.skin"]
    for line in table.rows:
        total, exposed, contact, gap = (float(c.text) for c in line[1:5])
        assert total == pytest.approx(exposed + contact + gap)
        assert contact == 20.0
        assert line[5].text.startswith("stack ")


def test_local_values_and_correlations_are_listed(campaign: Campaign) -> None:
    fit = campaign["submodel"]
    local = tables.locals_(fit)
    assert column(local, "value") == [i.name for i in fit.local]
    assert float(column(local, "found")[0]) == pytest.approx(fit.local[0].value - 273.15, abs=0.01)
    found = [abs(float(c)) for c in column(tables.correlations(fit), "correlation")]
    assert found == sorted(found, reverse=True)
    assert len(tables.correlations(fit, 1).rows) == 1
    assert f"not shown: {len(found) - 1} weaker one" in tables.correlations(fit, 1).caption


def test_data_have_checksums_uses_and_kind(campaign: Campaign, measured: Campaign) -> None:
    (table,) = tables.data(campaign)
    assert column(table, "record") == ["alone", "together", "held out"]
    *fits, judged = column(table, "used for")
    assert fits == ["fit component", "fit submodel"]
    assert judged.endswith(" on submodel")
    assert set(column(table, "kind")) == {"SYNTHETIC"}
    cell = row(table, "alone")["SHA-256"]
    assert cell.tip == campaign["component"].records["alone"]
    assert len(cell.tip) == 64
    assert cell.tip.startswith(cell.text)
    assert tables.made_records(campaign) == (("alone", "together", "held out"), 3)
    assert set(column(tables.data(measured)[0], "kind")) == {"measured"}
    assert tables.made_records(measured) == ((), 3)


def test_what_was_done_to_samples_stands_in_a_table_of_its_own(campaign: Campaign) -> None:
    """Seen by a reader: eight steps in a narrow last column made one line of the table half a screen high."""

    def prepared(fit: td.Calibration) -> td.Calibration:
        experiments = (replace(e, record=replace(e.record, steps=("read as UTF-16", "joined with b.csv"))) for e in fit.experiments)
        return replace(fit, experiments=tuple(experiments))

    _, table = tables.data(replace(campaign, stages={k: prepared(c) for k, c in campaign.stages.items()}))
    assert column(table, "record") == ["alone, together", ""]
    assert column(table, "prepared by") == ["read as UTF-16", "joined with b.csv"]


def test_every_value_of_the_uppermost_fit_stands_at_the_top(campaign: Campaign) -> None:
    """Twelve of all values were shown: seven of a unit's nineteen were not among them."""
    values = column(tables.glance(campaign, {}).fitted, "value")
    top = list(campaign.stages.values())[-1].values.parameters
    assert values[:-1] == list(top)
    assert len(top) == 2
    assert values[-1].startswith("and 1 value of")


def test_hidden_values_are_told(campaign: Campaign) -> None:
    table = tables.held(campaign["submodel"])
    mine = row(table, "a.skin.effective_htc")
    assert mine["set by"].text == "stage 'submodel'"
    assert "6 [W/(m^2 K)] (Box)" in mine["hides"].text
    assert "'component'" in mine["hides"].text
    assert row(table, "b.skin.effective_htc")["set by"].text == "[set] of Pair"
    assert row(table, "a.skin.area")["value"].text == "500"
    assert row(table, "a.skin.area")["unit"].text == "cm²"


def test_models_and_versions_are_told(campaign: Campaign) -> None:
    line = row(tables.models(campaign), "submodel")
    assert line["identity"].tip == campaign["submodel"].given_model.identity()
    assert (line["nodes"].text, line["conductors"].text) == ("3", "4")
    assert line["result key"].tip == campaign.keys["submodel"]
    assert [r[0].text for r in tables.versions().rows] == ["thermid", "numpy", "scipy", "Python", "page made"]


def test_numbers_read_well() -> None:
    assert pretty("W/(m^2 K)") == "W/(m² K)"
    assert pretty("degC") == "°C"
    assert pretty("1") == DASH
    assert number(math.inf) == DASH
    assert number(0.0) == "0"
    assert significant(5.38988, 0.16) == "5.39"
    assert significant(5.38988, math.inf) == "5.38988"
    assert significant(-1e-9, 0.1) == "0.00"
    assert signed(-0.0001, 2) == "0.00"


def test_a_crooked_table_is_refused() -> None:
    with pytest.raises(ValueError, match="as many cells"):
        Table.of_rows([Head("a"), Head("b")], [["1"]])


def test_an_estimate_outside_its_bounds_is_among_what_is_not_known(campaign: Campaign) -> None:
    name, fit = next(iter(campaign.stages.items()))
    path, v = next(iter(fit.values.parameters.items()))
    bounded = replace(
        fit, values=replace(fit.values, items_={**fit.values.items_, path: replace(v, bounds=(0.5 * v.value, 2.0 * v.value))})
    )
    for factor, count in ((1.5, 0), (3.0, 1)):
        moved = replace(bounded, expected={path: (factor * v.value, v.error)})
        unknown = [r.text for r in tables.glance(replace(campaign, stages={**campaign.stages, name: moved}), {}).unknown]
        bounds = f"({tables.bounds_text(bounded.values[path])})"
        assert sum(t.startswith(f"{path} ") and bounds in t for t in unknown) == count
