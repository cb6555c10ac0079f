"""A part is replaced: everything else keeps its value, and what the joint takes from the new part is in the ledger."""

from pathlib import Path

import thermid as td

here = Path(__file__).parent
stack = td.load_model(here.parent / "02_stack" / "m_PrE.toml")
swapped = stack.replace("ele", td.load_model(here / "EleGFO_v2.toml"))
bench = td.Scenario("bench", boundaries={"cv": "24 [degC]"}, duration="5 [h]")
before, after = td.steady(stack, bench), td.steady(swapped, bench)
for node in ("proc.case", "ele.case"):
    print(f"{node}: {before[node] - 273.15:.2f} -> {after[node] - 273.15:.2f} degC")
print("bonds of the new part:", ", ".join(stack.interfaces()))
try:
    stack.replace("ele", td.model_from_dict({"title": "bare board", "needs": ["air"], "nodes": {"case": {"capacitance": "300 [J/K]"}}}))
except td.ThermidError as refusal:
    print(f"refused: {refusal}")
