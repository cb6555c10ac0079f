"""Two components joined: the document's m_PrE, with the area ledger and the heat flow of every conductor."""

from pathlib import Path

import thermid as td

stack = td.load_model(Path(__file__).parent / "m_PrE.toml")
for line in td.model.ledger(stack):
    parts = f"exposed {line.exposed * 1e4:.1f} + contact {line.contact * 1e4:.1f} + gap {line.gap * 1e4:.1f}"
    print(f"{line.surface}: total {line.total * 1e4:.1f} cm^2 = {parts}")
bench = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, duration="5 [h]")
run = td.simulate(stack, bench)
print(run)
for name, flow in run.heat_flows.items():
    print(f"{name}: {flow[-1]:.3f} W at the end")
steady = td.steady(stack, bench)
print(f"steady: processor {steady['proc.case'] - 273.15:.3f} degC, supply {steady['ele.case'] - 273.15:.3f} degC")
