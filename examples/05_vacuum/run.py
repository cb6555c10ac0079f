"""Vacuum: refused where a coefficient hides radiation, predicted where it does not, and the document's way as the bound it is."""

from pathlib import Path

import thermid as td

here = Path(__file__).parent
effective = td.load_model(here.parent / "01_accelerometer" / "accelerometer.toml")
split = td.load_model(here / "accelerometer.toml")
bench = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
try:
    td.simulate(effective, bench.vacuum())
except td.ThermidError as refusal:
    print(f"refused: {refusal}")
print(td.simulate(effective, bench.vacuum(as_printed=True)))
print(td.simulate(split, bench.vacuum()))
