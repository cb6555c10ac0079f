"""What the columns of a running log are: by the deck's names, as told, from a campaign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import ThermidError
from thermid.model.tree import load_model
from thermid.qualify._watch.request import BoundColumns
from unit.fit.estimation.rig import rig

ICE = 273.15


def written(path: Path, header: str, *columns: list[float], decimal: str = ".", sign: str = ",") -> Path:
    rows = [sign.join(f"{v:.2f}".replace(".", decimal) for v in row) for row in zip(range(0, 600, 10), *columns, strict=True)]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


CHIP, AIR, WATTS = [30.0 + 0.1 * k for k in range(60)], [22.0 + 0.01 * k for k in range(60)], [12.0] * 60


def test_names_of_the_deck_are_bound_and_others_are_listed(tmp_path: Path) -> None:
    log = written(tmp_path / "a.csv", "time_s,chip [degC],T_lab [degC],air [degC],heater [W]", CHIP, AIR, AIR, WATTS)
    columns = BoundColumns(model=rig())
    record = columns.read(log, "a")
    assert {n: c.role for n, c in record.channels.items()} == {"chip": "node", "air": "boundary", "heater": "load"}
    (remark,) = columns.remarks
    assert "T_lab" in remark


def test_a_german_log_as_told(tmp_path: Path) -> None:
    log = written(tmp_path / "b.csv", "Zeit [s];T1 [°C];Raum [°C];P [W]", CHIP, AIR, WATTS, decimal=",", sign=";")
    targets = {"T1": "chip", "Raum": "air", "P": "heater"}
    record = BoundColumns(targets, model=rig()).read(log, "b")
    assert record["T1"].target == "chip"
    assert record["T1"].values[-1] == pytest.approx(CHIP[-1] + ICE)
    assert record["P"].values[0] == pytest.approx(12.0)


def test_a_duty_has_its_power_at_full_scale(tmp_path: Path) -> None:
    log = written(tmp_path / "c.csv", "time_s,chip [degC],Q1 [%]", CHIP, [50.0] * 60)
    targets = {"chip": "chip", "Q1": "heater"}
    assert BoundColumns(targets, {"Q1": "8 [W]"}, model=rig()).read(log, "c")["Q1"].values[0] == pytest.approx(4.0)
    with pytest.raises(ThermidError, match="full_scale"):
        BoundColumns(targets, model=rig()).read(log, "c")


def test_two_instances_of_a_part(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text('title = "part"\n[nodes]\nchip = { capacitance = "60 [J/K]" }\n')
    deck = 'title = "two"\n[submodels]\nleft = { use = "part.toml" }\nright = { use = "part.toml" }\n'
    (tmp_path / "two.toml").write_text(deck)
    log = written(tmp_path / "d.csv", "time_s,T1 [degC],T2 [degC]", CHIP, AIR)
    record = BoundColumns({"T1": "left.chip", "T2": "right.chip"}, model=load_model(tmp_path / "two.toml")).read(log, "d")
    assert [c.target for c in record.channels.values()] == ["left.chip", "right.chip"]


@pytest.mark.parametrize(
    ("targets", "code", "match"),
    [({"T1": "chp"}, "name.unknown", "'chp'"), ({"T9": "chip"}, "name.unknown", "T9"), ({}, "record.nothing-there", "COLUMN=NODE")],
)
def test_what_is_refused(tmp_path: Path, targets: dict[str, str], code: str, match: str) -> None:
    log = written(tmp_path / "e.csv", "time_s,T1 [degC],T2 [degC]", CHIP, AIR)
    with raises_code(code, match=match):
        BoundColumns(targets, model=rig()).read(log, "e")


def test_without_a_model_temperatures_alone(tmp_path: Path) -> None:
    log = written(tmp_path / "f.csv", "time_s,T1 [degC],P [W]", CHIP, WATTS)
    record = BoundColumns().read(log, "f")
    assert [*record.channels] == ["T1"]
    np.testing.assert_allclose(record["T1"].values, np.array(CHIP) + ICE)
