"""Names, globs, freezing, priors from ranges, and measured neighbours that drive their nodes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import IdentificationError, NameNotFoundError, RecordError
from thermid.fit._calibrate import fit
from thermid.fit._problem.gather import prior_of
from thermid.fit._problem.request import Request, freed, priors_of
from thermid.model.tree import Model
from thermid.prediction.advice import unknown_of
from unit.fit.bench import HTC, MASS, box, log, pair

SHEET = {"nodes/case/mass": {"value": "1.5 [kg]", "min": 1.2, "max": 2.0, "source": "datasheet"}}


@pytest.fixture(scope="module")
def stack() -> Model:
    return pair()


class TestGlobs:
    def test_a_star_passes_dots(self, stack: Model) -> None:
        assert freed(stack, ["*.effective_htc"], [], "here")[0] == ["a.skin.effective_htc", "b.skin.effective_htc"]

    def test_names_and_globs_in_order_once_each(self, stack: Model) -> None:
        free, frozen = freed(stack, ["b.power", "?.power"], [], "here")
        assert (free, frozen) == (["b.power", "a.power"], set())

    def test_one_name_need_not_stand_in_a_list(self, stack: Model) -> None:
        assert freed(stack, "b.power", [], "here")[0] == ["b.power"]

    def test_an_alias_before_the_star(self, stack: Model) -> None:
        assert freed(stack, ["first.*.mass"], [], "here")[0] == ["a.case.mass"]

    def test_what_is_derived_is_passed_over(self) -> None:
        part = box({"loads/heat/power": "power"})
        assert "heat.power" not in freed(part, ["*power*"], [], "here")[0]

    def test_one_that_matches_nothing_is_an_error(self, stack: Model) -> None:
        with raises_code("name.unknown", NameNotFoundError, match=r"'\*\.masss'"):
            freed(stack, ["*.masss"], [], "here")

    def test_frozen_is_taken_off(self, stack: Model) -> None:
        free, frozen = freed(stack, ["*.effective_htc", "a.power"], ["a.*"], "here")
        assert free == ["b.skin.effective_htc"]
        assert "a.power" in frozen

    def test_freezing_what_is_not_free_is_an_error(self, stack: Model) -> None:
        with raises_code("value.without-effect", IdentificationError, match=r"'a\.case\.mass'"):
            freed(stack, ["a.power"], ["a.case.mass"], "here")
        with raises_code("name.unknown", NameNotFoundError, match=r"'a\.case\.mas'"):
            freed(stack, ["a.power"], ["a.case.mas"], "here")

    def test_what_stages_below_free_can_be_frozen(self, stack: Model) -> None:
        assert freed(stack, [], ["a.power"], "here", ["a.power"]) == ([], {"a.power"})

    def test_calibrate_takes_them(self) -> None:
        part = box()
        found = td.calibrate(part, log(part, {HTC: "5 [W/(m^2 K)]"}, {"A": "case"}, samples=61), ["skin.*_htc"])
        assert list(found.values.parameters) == [HTC]


LOG_SD = math.log(2.0 / 1.2) / (2 * 1.96)
"""The range of the sheet holds 95 % of parts."""


class TestRanges:
    @pytest.mark.parametrize(
        ("path", "stated", "sd"),
        [
            (MASS, {"value": "1.5 [kg]", "min": 1.2, "max": 2.0}, LOG_SD),
            ("power", {"value": "4 [W]", "min": 0, "max": 6}, 6.0 / (2 * 1.96)),
            ("rise", {"value": "4 [K]", "min": 3, "max": 6}, 3.0 / (2 * 1.96)),
            ("factor", {"value": 1.0, "min": 0.5, "max": 2.0}, 1.5 / (2 * 1.96)),
        ],
    )
    def test_a_range_is_the_prior_that_the_value_has_without_it(self, path: str, stated: dict[str, object], sd: float) -> None:
        """For a difference of temperatures it was refused, and of a factor it was narrower than that of the value itself."""
        at = "nodes/case/mass" if path == MASS else f"parameters/{path}"
        part = box({at: stated | {"source": "datasheet"}})
        stated_prior = priors_of(part, {path: "range"}, "here")[path]
        assert prior_of(unknown_of(part, path), stated_prior).sd == pytest.approx(sd, rel=1e-4)

    def test_by_glob_beside_others(self) -> None:
        found = priors_of(box(SHEET), {"*.mass": "range", HTC: ("5 [W/(m^2 K)]", "10 [%]")}, "here")
        assert set(found) == {MASS, HTC}

    def test_the_fit_starts_from_it(self) -> None:
        part = box(SHEET)
        data = log(part, {MASS: "1.6 [kg]"}, {"A": "case"}, samples=61)
        told = td.calibrate(part, data, [MASS, HTC], priors={MASS: "range"})
        assert told[MASS].prior == pytest.approx((math.log(1.5), LOG_SD), rel=1e-4)
        silent = td.calibrate(part, data, [MASS, HTC])
        assert silent[MASS].prior == told[MASS].prior

    def test_bounds_that_the_author_assumed_are_no_prior(self) -> None:
        with raises_code("value.without-effect", IdentificationError, match=r"'skin\.effective_htc'"):
            td.calibrate(box(), log(box(), {}, {"A": "case"}, samples=31), [HTC], priors={HTC: "range"})

    def test_half_a_range_is_none(self) -> None:
        part = box({"nodes/case/mass": {"value": "1.5 [kg]", "min": 1, "source": "datasheet"}})
        with raises_code("value.without-effect", IdentificationError, match=r"'case\.mass'"):
            priors_of(part, {MASS: "range"}, "here")


class TestMeasuredNeighbours:
    def test_a_part_is_fitted_beside_its_measured_neighbour(self, stack: Model) -> None:
        """The neighbour's own coefficient is wrong in the model; its measured temperature stands there instead."""
        truth = {"a.skin.effective_htc": "8 [W/(m^2 K)]", "b.skin.effective_htc": "5 [W/(m^2 K)]"}
        data = log(stack, truth, {"A": "a.case", "B": "b.case"}, boundary="room", noise=0.02, accuracy=0.1, bias={"A": 0.1}, samples=301)
        driven = data.with_channels(replace(data["A"], role="prescribed"))
        free = ("b.skin.effective_htc",)
        found = fit(Request(stack, (driven,), free, untie=True))
        assert abs(found[free[0]].value - 5.0) < 4 * found[free[0]].error < 0.6
        assert "A error" in found.values, "the neighbour's sensor may be off too"
        assert list(found.sensors) == ["B"]
        careless = fit(Request(stack, (data.with_channels(*(data[c] for c in ("B",))),), free, untie=True))
        assert careless.chi_square > 1.5 * found.chi_square

    def test_nothing_of_the_neighbour_acts(self, stack: Model) -> None:
        data = log(stack, {}, {"A": "a.case", "B": "b.case"}, boundary="room", samples=61)
        driven = data.with_channels(replace(data["A"], role="prescribed"))
        with pytest.raises(IdentificationError, match=r"'a\.case\.mass'"):
            fit(Request(stack, (driven,), ("a.case.mass",), untie=True))

    def test_a_boundary_is_not_prescribed(self, stack: Model) -> None:
        data = log(stack, {}, {"A": "a.case"}, boundary="room", samples=31)
        with raises_code("record.does-not-apply", RecordError, match="'room'"):
            fit(Request(stack, (data.with_channels(replace(data["ROOM"], role="prescribed")),), ("a.power",)))

    def test_from_a_file(self, tmp_path) -> None:  # type: ignore[no-untyped-def]
        np.savetxt(tmp_path / "x.csv", np.column_stack([np.arange(5.0), np.full(5, 20.0)]), delimiter=",", header="time_s,A", comments="")
        record = td.read_record(tmp_path / "x.csv", {"A": {"prescribed": "a.case"}})
        assert (record["A"].role, record["A"].target, record["A"].values[0]) == ("prescribed", "a.case", pytest.approx(293.15))
