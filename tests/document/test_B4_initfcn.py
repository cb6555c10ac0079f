"""B4: the script of Fig. 16, as typed, becomes the accelerometer's parameters and its run.

Retyped from the source document ("Methodology for the Thermal Models Development of the Brazilian Inertial System"), Fig. 16, with the
line numbers that the figure has.
"""

from __future__ import annotations

import re

import pytest

import thermid as td

pytestmark = pytest.mark.document

FIG_16 = """\
1 % General data.
2 t_sim = 5*3600; % Simulation time [s].
3 TempC = 24; % Ambient temperature [Celsius].
4 TempK = TempC + 273.15; % Conversion to Kelvin.
5
6 % Main thermal parameters data.
7 SpH_SS = 480; % Spec. heat, st. steel [J/(kg*K)].
8
9 % SISNAV main thermal parameters.
10 Acc_SpH = SpH_SS;
11
12 % Accelerometer data.
13 Acc_pw = 1*(15*0.015); % Accelerometer power [W].
14 Acc_htc = 6; % Accel. heat transfer coef. [W/(m^2 K)].
15 Acc_m = 0.054; % Mass [kg].
16 Acc_conv_area = ... % Acc. area [m^2]
17     0.001406 + 1.08*0.002592;
"""
TYPED = "\n".join(line.lstrip("0123456789").removeprefix(" ") for line in FIG_16.splitlines())


@pytest.mark.parametrize("script", [FIG_16, TYPED], ids=["as printed", "as typed"])
def test_b4_the_script_gives_the_printed_rise(script: str) -> None:
    found = td.interop.read_initfcn(script)
    assert found.numbers["Acc_pw"] == 0.225
    assert found.numbers["Acc_conv_area"] == pytest.approx(0.00420536, rel=1e-15)
    acc = td.model_from_dict(found.block("Acc"))
    bench = td.Scenario(boundaries={"air": found.parameters["TempC"].text}, duration=found.parameters["t_sim"].text)
    assert td.steady(acc, bench)["case"] - 297.15 == pytest.approx(8.917191, abs=1e-6)
    run = td.simulate(acc, bench)
    assert run["case"].rise == pytest.approx(8.917191, abs=1e-6)
    assert run.time_constants[0] == pytest.approx(1027.2604, abs=1e-3)


def test_b4_every_line_keeps_its_unit_and_its_words() -> None:
    found = td.interop.read_initfcn(FIG_16)
    assert {n: (p.text, p.note) for n, p in found.parameters.items()} == {
        "t_sim": ("5*3600 [s]", "Simulation time"),
        "TempC": ("24 [degC]", "Ambient temperature"),
        "TempK": ("297.15", "Conversion to Kelvin"),
        "SpH_SS": ("480 [J/(kg*K)]", "Spec. heat, st. steel"),
        "Acc_SpH": ("SpH_SS", ""),
        "Acc_pw": ("1*(15*0.015) [W]", "Accelerometer power"),
        "Acc_htc": ("6 [W/(m^2 K)]", "Accel. heat transfer coef"),
        "Acc_m": ("0.054 [kg]", "Mass"),
        "Acc_conv_area": ("0.001406 + 1.08*0.002592 [m^2]", "Acc. area"),
    }
    (remark,) = found.remarks
    assert re.match(r"\w+ 4: 'TempK' .* 'TempC \+ 273\.15' .* 297\.15 ", remark)
