"""One mass that convects: the document's Fig. 17 for the accelerometer."""

from pathlib import Path

import thermid as td

accelerometer = td.load_model(Path(__file__).parent / "accelerometer.toml")
bench = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
warm = td.simulate(accelerometer, bench)
print(warm)
print(f"rise {warm['case'].rise:.3f} K, time constant {warm.time_constants[0]:.1f} s")
print(f"heat balance closes to {warm.heat_balance().relative:.1e}")
