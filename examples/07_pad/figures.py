"""The same two days as a picture: what fell on the cabinet, what its coefficients did, how warm it was. Needs matplotlib."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import thermid as td

here = Path(__file__).parent
cabinet, pad = td.load_model(here / "cabinet.toml"), td.load_scenario(here / "pad.toml")
run = td.simulate(cabinet, pad, every="10 [min]")
hours = run.times / 3600
page = Figure(figsize=(9, 9), layout="constrained")
absorbed, winds, warm = page.subplots(3, 1, sharex=True)
for name, power in run.load_powers.items():
    if name != "electronics":
        absorbed.plot(hours, power, label=name)
absorbed.set(ylabel="absorbed [W]", title="Two days beside a pad, on weather compensated this lesson")
for path, signal in pad.schedule.items():
    winds.plot(hours, signal.at(run.times), label=path)
winds.set(ylabel="htc in wind and rain [W/(m$^2$ K)]")
for name in ("ambient", "walls", "roof", "inside", "box"):
    warm.plot(hours, run[name].celsius, label=name)
warm.set(ylabel="temperature [degC]", xlabel="time from 21 March, 0 h local [h]", xticks=np.arange(0, 49, 6))
for axis in (absorbed, winds, warm):
    axis.grid(alpha=0.3)
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
(here / "out").mkdir(exist_ok=True)
page.savefig(here / "out" / "pad.png", dpi=110)
print(here / "out" / "pad.png")
