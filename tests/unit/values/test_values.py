"""Fitted values and their file: every bit comes back."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.campaign.stages import CredibilityRecord
from thermid.fit.calibration import Calibration, calibrate
from thermid.model.tree import load_model, save_model
from thermid.values.store import FittedValue, FittedValues, load_values
from unit.fit.bench import HTC, MASS, box, log, metered, pair


@pytest.fixture(scope="module")
def found() -> Calibration:
    data = metered(log(box(), {HTC: "5 [W/(m^2 K)]"}, {"T": "case"}, accuracy=0.5, samples=61), "heat", 4.0, accuracy=0.04)
    return calibrate(box(), data, [HTC, MASS], name="bench")


def test_the_file_holds_every_bit(found: Calibration, tmp_path: Path) -> None:
    found.save(tmp_path / "v.toml")
    back = load_values(tmp_path / "v.toml")
    assert back.stage == "bench"
    assert dict(back) == dict(found.values)
    assert [v.kind for v in back.values()] == ["parameter", "parameter", "sensor", "input"]
    np.testing.assert_array_equal(back.covariance, found.values.covariance)
    assert back.provenance == found.values.provenance
    assert back.provenance["records"] == dict(found.records)
    assert back.provenance["synthetic"] is True


def test_a_mapping_returns_its_default(found: Calibration) -> None:
    """Every mapping of the package names the nearest key, and is still a mapping: `get` has a default."""
    rows = CredibilityRecord("t", "", "", False, {})
    for mapping in (found.values, rows):
        assert mapping.get("no_such") is None
        assert mapping.get("no_such", 3) == 3
        with pytest.raises(NameNotFoundError, match="no_such"):
            mapping["no_such"]


def test_values_that_no_fit_of_this_session_made_are_saved_too(tmp_path: Path) -> None:
    """Numbers near the ends of what a float holds, a unit with an offset, no finite error."""
    items = {
        "x": FittedValue("x", 0.1 + 0.2, math.inf, 5e-324, True, "W", 1 / 3, (-math.inf, math.inf), "ä stage: r", prior=(1e-300, 2.0)),
        "y.z": FittedValue("y.z", 300.15, 0.5, 0.0, False, "degC", 0.0, (273.15, 400.0), "ä stage: r", also=("q.z",)),
    }
    values = FittedValues("ä stage", items, np.array([[math.inf, 0.0], [0.0, 0.25]]), {"version": "0", "records": {"r": "ab"}})
    values.save(tmp_path / "v.toml")
    back = load_values(tmp_path / "v.toml")
    assert dict(back) == items
    np.testing.assert_array_equal(back.covariance, values.covariance)


def test_a_values_file_laid_over_a_deck_gives_the_fitted_model(found: Calibration, tmp_path: Path) -> None:
    found.save(tmp_path / "v.toml")
    save_model(box(), tmp_path / "box.toml")
    laid = load_model(tmp_path / "box.toml").with_values(load_values(tmp_path / "v.toml").assignments, "v.toml")
    for path in (HTC, MASS):
        assert laid.at(path).expression.literal.value == found[path].value
        assert laid.at(path).minimum == box().at(path).minimum


@pytest.mark.parametrize(("text", "value"), [("0.3 [mm]", 1 / 3), ("20 [degC]", 301.23456789), ("0.5 [cm^2]", 1e-5 / 3)])
def test_as_a_parameter_it_keeps_its_value_to_the_bit(text: str, value: float) -> None:
    unit = text.split("[")[1].rstrip("]")
    given = FittedValue("x", value, 0.1, 0.1, False, unit, value, (-math.inf, math.inf)).as_parameter()
    assert given.expression.literal.value == value
    assert given.unit == unit


def test_tied_instances_are_all_assigned() -> None:
    stack = pair()
    data = log(stack, {"a.case.mass": "1.2 [kg]", "b.case.mass": "1.2 [kg]"}, {"A": "a.case"}, boundary="room", samples=61)
    found = calibrate(stack, data, ["a.case.mass"])
    assert list(found.values.assignments) == ["a.case.mass", "b.case.mass"]
    fitted = found.model
    assert (
        fitted.at("b.case.mass").expression.literal.value == fitted.at("a.case.mass").expression.literal.value == found["a.case.mass"].value
    )


def test_names(found: Calibration) -> None:
    with raises_code("name.unknown", NameNotFoundError, match=r"'case\.mas'.*'case\.mass'"):
        found["case.mas"]
    assert found.values.origin(MASS) == "bench: bench"
    assert list(found.values.parameters) == [HTC, MASS]
    assert list(found.values.sensors) == ["T"]
    assert MASS in found.values
    assert len(found.values) == 4


@pytest.mark.parametrize(
    ("damage", "code"),
    [
        (lambda t: t.replace("transform", "transformation"), "file.key-missing"),
        (lambda t: t.replace("value = ", "wert = ", 1), "file.key-missing"),
        (lambda t: t[: len(t) // 2], "file.another-kind"),
        (lambda t: "not = a values file", "file.another-kind"),
        (lambda t: "", "file.another-kind"),
        (lambda t: t.replace("sources = [0", "sources = [99"), "file.wrong-value"),
        (lambda t: t.replace("sources = [0, ", "sources = ["), "file.wrong-value"),
        (lambda t: t.replace("bounds = [", 'bounds = "wide" # [', 1), "file.wrong-kind"),
        (lambda t: "\x00\x01", "file.another-kind"),
    ],
)
def test_a_damaged_file_is_refused_by_name(found: Calibration, tmp_path: Path, damage, code: str) -> None:  # type: ignore[no-untyped-def]
    found.save(tmp_path / "v.toml")
    text = (tmp_path / "v.toml").read_text(encoding="utf-8")
    (tmp_path / "v.toml").write_text(damage(text), encoding="utf-8")
    with raises_code(code, DeckError, match=r"^v\.toml: "):
        load_values(tmp_path / "v.toml")


def test_a_missing_file(tmp_path: Path) -> None:
    with raises_code("file.not-found", DeckError, match=r"'v\.toml'"):
        load_values(tmp_path / "v.toml")
