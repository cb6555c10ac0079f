"""Row W3 of the acceptance sheet: a launch campaign with known weather, first as T_amb(t), then with sun, sky, wind and rain."""

from __future__ import annotations

import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import thermid as td

pytestmark = pytest.mark.document
EXAMPLES = Path(__file__).parents[2] / "examples"
ALCANTARA = td.site.Site(-2.373, -44.396, "40 [m]", -3.0, "Alcantara")
HEAD = "time,dry_bulb [degC],humidity [%],wind [m/s],direct_normal [W/m^2],diffuse [W/m^2],rain [mm/h]"


@pytest.fixture
def weather(tmp_path: Path) -> td.site.Weather:
    """Two hourly days, made up."""
    rows = [HEAD]
    for k in range(49):
        day = np.sin((k - 9) / 12 * np.pi)
        up = max(0.0, np.sin((k % 24 - 6) / 12 * np.pi))
        rain = 8 if k in (15, 16) else 0
        stamp = f"2026-03-{21 + k // 24} {k % 24:02d}:00"
        rows.append(f"{stamp},{27 + 4 * day:.3f},{75 - 10 * day:.1f},{5 + 3 * day:.2f},{750 * up:.1f},{180 * up:.1f},{rain}")
    path = tmp_path / "weather.csv"
    path.write_text("\n".join(rows) + "\n", encoding="ascii")
    return td.site.read_weather(path)


def test_W3_a_series_of_weather_is_T_amb(weather: td.site.Weather) -> None:  # noqa: N802
    """The accelerometer of Fig. 16 in the open air: hour by hour the closed form of one mass in air that warms along a straight line."""
    model = td.load_model(EXAMPLES / "01_accelerometer" / "accelerometer.toml")
    series = td.site.pad_scenario(ALCANTARA, weather, air="air", sun=False, sky=False, start="24 [degC]")
    run = td.simulate(model, series, every="1 [h]")
    tau, rise = float(run.time_constants[0]), 8.917191
    air = weather["dry_bulb"].values
    exact = [297.15]
    for a, b in pairwise(air):
        slope = (b - a) / 3600.0
        at_rest = b - slope * tau + rise
        exact.append(at_rest + (exact[-1] - (a - slope * tau + rise)) * np.exp(-3600.0 / tau))
    assert tau == pytest.approx(1027.2604, rel=1e-6)
    assert np.abs(run["case"].kelvin - exact).max() < 1e-5


def test_W3_a_launch_campaign_with_its_whole_environment(weather: td.site.Weather, tmp_path: Path) -> None:  # noqa: N802
    """The unit on its host: weather, sun on the shell, a cold sky, wind and rain."""
    model = _outdoors(tmp_path)
    wind = {"shell_skin.htc": {"length": "1.4 [m]", "calm": "4 [W/(m^2 K)]", "rain": "wall"}}
    given = {"boundaries": {"supply": "18 [degC]", "stage": "28 [degC]"}, "start": "steady"}
    pad = td.site.pad_scenario(
        ALCANTARA, weather, air="weather", sky={"sky": 90}, wind=wind, begin="2026-03-21 06:00", duration="30 [h]", **given
    )
    run = td.simulate(model, pad)
    assert run.heat_balance().relative < 1e-6
    assert np.array_equal(run["weather"].kelvin, pad.boundaries["weather"].at(run.times))
    # by day the shell is warmer than the air, at night it is colder, and what it sees is always colder than the air
    noon, night = 6 * 3600.0, 21 * 3600.0
    assert run["shell"].at(noon) > run["weather"].at(noon)
    assert run["shell"].at(night) < run["weather"].at(night)
    assert (run["sky"].kelvin < run["weather"].kelvin - 2.0).all()
    sun = run.load_powers["shell_skin.sun"]
    assert sun.min() == 0.0
    assert sun[np.abs(run.times - noon).argmin()] > 100.0
    # without the weather of the pad the answer is another one
    dull = td.simulate(
        model, td.site.pad_scenario(ALCANTARA, weather, air="weather", sun=False, sky={"sky": 90}, duration="30 [h]", **given)
    )
    assert run["shell"].highest > dull["shell"].highest + 1.0
    assert run["unit.disk"].highest > dull["unit.disk"].highest


def _outdoors(folder: Path) -> td.Model:
    """The macro model with what a shell in the sun needs: absorptance of white paint, all around."""
    shutil.copytree(EXAMPLES / "sisnav", folder / "sisnav", ignore=shutil.ignore_patterns("logs", "results", "__pycache__"))
    shutil.copy(EXAMPLES / "thermid.toml", folder)
    path = folder / "sisnav" / "macro" / "macro.toml"
    text = path.read_text(encoding="utf-8")
    if "absorptance" not in text:
        paint = '[surfaces.shell_skin]\nabsorptance = { value = 0.3, source = "assumed", basis = "white paint" }\nfacing = { tilt = 90 }\n'
        assert "[surfaces.shell_skin]\n" in text
        path.write_text(text.replace("[surfaces.shell_skin]\n", paint), encoding="utf-8")
    return td.load_model(path)
