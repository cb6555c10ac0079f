"""The four steps on record: rows K1 to K4 of the acceptance sheet, and N4."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError

pytestmark = pytest.mark.document
STUDY = Path(__file__).parents[2] / "examples" / "sisnav" / "study.toml"
ELEVEN = ("ProcSISNAV", "EleGFO", "FOG_x", "FOG_y", "FOG_z", "Acc_x", "Acc_y", "Acc_z")
ELEVEN += ("accelerometer support", "IMU support", "metallic disk")


@pytest.fixture(scope="module")
def study() -> td.design.Study:
    return td.design.load_study(STUDY)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of the study that a test may change."""
    for deck in STUDY.parent.glob("*.toml"):
        shutil.copy(deck, tmp_path)
    return tmp_path


def without(project: Path, table: str) -> Path:
    """Return the study without one of its tables."""
    lines = (project / "study.toml").read_text(encoding="utf-8").splitlines()
    begin = lines.index(f"[{table}]")
    end = next(k for k in range(begin + 1, len(lines)) if lines[k].startswith("["))
    (project / "cut.toml").write_text("\n".join(lines[:begin] + lines[end:]), encoding="utf-8")
    return project / "cut.toml"


def test_K1_the_eleven_physical_items_and_the_use(study: td.design.Study) -> None:  # noqa: N802
    assert tuple(study.components) == ELEVEN
    assert len({c.at for c in study.components.values()}) == 11
    assert "replaced" in study.content.knowledge.use
    assert study.model.title == "m_Sd"


def test_K1_it_refuses_without_components(project: Path) -> None:  # noqa: N802
    with raises_code("value.incomplete", DeckError, match="components"):
        td.design.load_study(without(project, "components"))


def test_K1_it_refuses_without_an_intended_use(project: Path) -> None:  # noqa: N802
    text = STUDY.read_text(encoding="utf-8")
    cut = "\n".join(line for line in text.splitlines() if not line.startswith("use     ="))
    (project / "cut.toml").write_text(cut, encoding="utf-8")
    with raises_code("value.incomplete", DeckError, match=r"cut\.toml:7.*knowledge\.use"):
        td.design.load_study(project / "cut.toml")


def test_K1_every_mass_is_part_of_one_item(project: Path) -> None:  # noqa: N802
    text = STUDY.read_text(encoding="utf-8")
    cut = "\n".join(line for line in text.splitlines() if not line.startswith('"metallic disk"'))
    (project / "cut.toml").write_text(cut, encoding="utf-8")
    with raises_code("campaign.refused", DeckError, match="'disk'"):
        td.design.load_study(project / "cut.toml")


def test_K2_every_node_is_light_grey(study: td.design.Study) -> None:  # noqa: N802
    assert set(study.model.node_boxes.values()) == {"light grey"}
    assert len(study.model.node_boxes) == len(td.simulation.compile_network(study.model).nodes)
    assert set(study.model.part_boxes.values()) == {"light grey"}


def test_K2_a_mixed_tag_is_kept_on_aggregation(project: Path) -> None:  # noqa: N802
    """A gyro known only by its readings makes the measurement unit and the whole mixed, and nothing else."""
    fog = project / "FOG_h.toml"
    fog.write_text(fog.read_text(encoding="utf-8").replace('box    = "light grey"', 'box    = "black"'), encoding="utf-8")
    mixed = td.design.load_study(project / "study.toml")
    assert mixed.model.part_boxes["imu.fog_x"] == "black"
    assert mixed.model.part_boxes["imu"] == mixed.model.part_boxes[""] == "light grey + black"
    assert mixed.model.part_boxes["pre"] == mixed.model.part_boxes["imu.fog_y"] == "light grey"
    assert {n for n, box in mixed.model.node_boxes.items() if box == "black"} == {"imu.fog_x.case"}


def test_K3_both_set_ups_round_trip(study: td.design.Study, project: Path) -> None:  # noqa: N802
    again = td.design.load_study(study.save(project / "again.toml"))
    assert again == study
    assert again.options.error == 1e-4
    assert "ode15s" in again.content.theory.solver
    assert "of order 4" in again.content.theory.solver  # tests/unit/kernel/test_tableau.py measures it
    sensor, channel = again.content.sensors["DS18B20"], again.content.sensors["ProcSISNAV channel"]
    assert (sensor.accuracy, sensor.resolution) == (0.5, 1 / 16)
    assert channel.accuracy == 3.0
    assert channel.range == pytest.approx((218.15, 369.15))
    assert "0 degC" in sensor.certificate


def test_K4_twelve_actions_in_their_places(study: td.design.Study) -> None:  # noqa: N802
    assert len(study.content.actions) == 12
    assert [a.state for a in study.content.actions] == ["done"] * 7 + ["with qualification"] * 5
    assert study.content.procedure.metrics == ["rmse", "max_error", "final_error"]
    assert study.content.procedure.rules


def test_K4_a_log_of_every_step(study: td.design.Study, project: Path) -> None:  # noqa: N802
    """Each stage and each verdict leaves RMSE, largest and final error of every sensor; the document prints none (E23)."""
    times = np.arange(0.0, 18001.0, 60.0)
    rng = np.random.default_rng(3)
    part = td.load_model(project / "EleGFO.toml")
    bench = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
    truth = td.simulate(part.with_values({"skin.effective_htc": "2.5 [W/(m^2 K)]"}), bench, times=times)["case"].celsius
    for name in ("one", "two"):
        table = np.column_stack([times, truth + 0.05 * rng.standard_normal(times.size)])
        np.savetxt(project / f"{name}.csv", table, delimiter=",", header="t,T_ELE", comments="")
    record = 'file = "{}.csv"\ntime = "t"\nchannels = {{ T_ELE = {{ node = "case", noise = "0.05 [K]" }} }}\n'
    stage = '[[stages]]\nname = "EleGFO"\nmodel = "EleGFO.toml"\nrecords = ["one"]\nfree = ["skin.effective_htc"]\n'
    room = 'scenario = { boundaries = { cv = "24 [degC]" }, start = "24 [degC]" }\n'
    verdict = '[[verdicts]]\nmodel = "EleGFO"\nrecord = "two"\ncriteria = { rmse = "0.1 [K]" }\n'
    parts = ['title = "short"', "[records.one]", record.format("one"), "[records.two]", record.format("two"), stage + room, verdict]
    (project / "campaign.toml").write_text("\n".join(parts), encoding="utf-8")
    text = (project / "study.toml").read_text(encoding="utf-8")
    for stages in ('["Acc", "FOG_h", "FOG_l", "EleGFO", "ProcSISNAV"]', '["m_PrE", "m_AccS", "m_IMU"]', '["m_Sd"]'):
        text = text.replace(f"stages = {stages}", 'stages = ["EleGFO"]')
    (project / "short.toml").write_text(text, encoding="utf-8")
    log = td.design.load_study(project / "short.toml").log(td.run_stages(project / "campaign.toml"))
    assert [(s.stage, s.record, s.sensor, s.held_out) for s in log] == [
        ("EleGFO", "one", "T_ELE", False),
        ("EleGFO", "two", "T_ELE", True),
    ]
    for step in log:
        assert step.action in {a.name for a in study.content.actions}
        assert step["rmse"] == pytest.approx(0.05, rel=0.1)
        assert 2 * step["rmse"] < abs(step["max_error"]) < 5 * step["rmse"]
        assert abs(step["final_error"]) < 3 * 0.05 / np.sqrt(16)  # mean of the last 16 samples


@pytest.mark.parametrize(
    ("name", "path"),
    [
        *((whole, "") for whole in ("m_SdU", "m_Sd", "Sd")),
        *((f"{whole}_PrS", "pre.proc.case") for whole in ("m_SdU", "m_Sd", "Sd")),
        ("m_SdU.m_IMU.AccS", "imu.acc.support"),
        ("Sd.PrE", "pre"),
        ("metallic disk", "disk"),
        ("m_Sd_FOG1", "imu.fog_x.case"),
    ],
)
def test_N4_one_model_with_three_names(study: td.design.Study, name: str, path: str) -> None:  # noqa: N802
    assert study.find(name) == path


def test_N4_an_unknown_name_is_an_error(study: td.design.Study) -> None:  # noqa: N802
    with raises_code("name.unknown", NameNotFoundError, match="'m_SdU_PrX'"):
        study.find("m_SdU_PrX")


def test_B17_limits_are_flagged_with_the_time(study: td.design.Study) -> None:  # noqa: N802
    """In vacuum as printed the accelerometer alone leaves its +96 degC after 2.304 h; on the bench nothing is flagged."""
    part = td.load_model(STUDY.parent / "Acc.toml")
    bench = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
    assert study.exceeded(td.simulate(part, bench), at="imu.acc.acc_x") == ()
    (flag,) = study.exceeded(td.simulate(part, bench.vacuum(as_printed=True)), at="imu.acc.acc_x")
    assert (flag.component, flag.node) == ("Acc_x", "case")
    assert flag.limit == pytest.approx(96.0)
    assert flag.time / 3600 == pytest.approx(2.304, abs=1e-6)
    assert flag.reached == pytest.approx(180.25, abs=1e-6)


def test_B17_a_lower_limit_too(study: td.design.Study) -> None:  # noqa: N802
    cold = td.Scenario("cold", boundaries={"cv": "-80 [degC]"}, start="24 [degC]", duration="10 [h]")
    flags = study.exceeded(td.simulate(study.model, cold))
    assert {f.component for f in flags} == {"Acc_x", "Acc_y", "Acc_z"}
    assert all(f.limit == pytest.approx(-55.0) and f.reached < -55.0 and 0 < f.time < 36000 for f in flags)
