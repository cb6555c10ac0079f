"""Outdoors: two made-up days on a cabinet beside a pad - air, sun, sky, wind and rain as one scenario."""

from pathlib import Path

import thermid as td

here = Path(__file__).parent
cabinet = td.load_model(here / "cabinet.toml")
run = td.simulate(cabinet, td.load_scenario(here / "pad.toml"), every="15 [min]")
dark = {"walls_out.sun": "0 [W]", "roof_out.sun": "0 [W]"}
shade = td.simulate(cabinet, td.load_scenario(here / "pad.toml").with_(loads=dark), every="15 [min]")
print(run)
print(f"the sun makes the box warmer by up to {(run['box'].celsius - shade['box'].celsius).max():.1f} K")
for name, power in run.load_powers.items():
    print(f"{name}: {power.min():.0f} to {power.max():.0f} W")
