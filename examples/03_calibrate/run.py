"""A log meets a model: one parameter fitted, a second one refused because the log cannot tell it from the first. The log is synthetic."""

from pathlib import Path

import numpy as np

import thermid as td

model = td.load_model(Path(__file__).parent.parent / "01_accelerometer" / "accelerometer.toml")
bench = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
truth = td.simulate(model.with_values({"area": "0.0044 [m^2]"}), bench)
noise = np.random.default_rng(7).normal(0.0, 0.1, truth.times.size)
record = td.Record.from_arrays(
    "synthetic bench",
    truth.times,
    {
        "ACC_X": td.Channel.from_array(
            "ACC_X", truth["case"].kelvin + noise, unit="K", role="node", target="case", noise=0.1, accuracy=3.0
        ),
        "T_AMB": td.Channel.from_array("T_AMB", truth["air"].kelvin, unit="K", role="boundary", target="air", accuracy=0.5),
    },
)
print(td.calibrate(model, record, free=["area"]))
try:
    td.calibrate(model, record, free=["skin.effective_htc", "area"])
except td.ThermidError as refusal:
    print(f"refused: {refusal}")
