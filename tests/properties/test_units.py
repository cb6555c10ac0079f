"""Property 7: the unit in which a value is written changes no bit of the network."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import numpy as np
from hypothesis import strategies as st

import thermid as td
from strategies import random_models

# a slot, the decimal shift from its unit to another one, and both units as written
SLOTS = {
    "thickness": ("m", [("mm", 3), ("cm", 2), ("um", 6)]),
    "area": ("m^2", [("mm^2", 6), ("cm^2", 4)]),
    "conductivity": ("W/(m K)", [("mW/(m K)", 3), ("W/(mm K)", -3), ("kW/(m K)", -3)]),
    "mass": ("kg", [("g", 3), ("mg", 6)]),
    "specific_heat": ("J/(kg K)", [("J/(g K)", -3), ("kJ/(kg K)", -3)]),
    "power": ("W", [("mW", 3), ("kW", -3)]),
    "htc": ("W/(m^2 K)", [("mW/(m^2 K)", 3), ("W/(mm^2 K)", -6)]),
}


def _deck(values: dict[str, str]) -> dict[str, Any]:
    return {
        "title": "Plate",
        "needs": ["air"],
        "parameters": {"side": values["area"]},
        "nodes": {"plate": {"mass": values["mass"], "specific_heat": values["specific_heat"]}, "back": {}},
        "conductors": {
            "wall": {
                "kind": "conduction",
                "between": ["plate", "back"],
                "conductivity": values["conductivity"],
                "area": "side",
                "thickness": values["thickness"],
            }
        },
        "surfaces": {"skin": {"of": "back", "to": "air", "area": "2*side", "htc": values["htc"]}},
        "loads": {"heat": {"into": "plate", "power": values["power"]}},
    }


decimals = st.tuples(st.integers(1, 10**17), st.integers(-22, -12)).map(lambda d: Decimal(d[0]).scaleb(d[1]))


@random_models(
    100, numbers=st.fixed_dictionaries(dict.fromkeys(SLOTS, decimals)), pick=st.fixed_dictionaries(dict.fromkeys(SLOTS, st.integers(0, 2)))
)
def test_another_unit_is_the_same_network_bit_for_bit(numbers: dict[str, Decimal], pick: dict[str, int]) -> None:
    plain = {slot: f"{numbers[slot]} [{SLOTS[slot][0]}]" for slot in SLOTS}
    other = {}
    for slot, (_, choices) in SLOTS.items():
        unit, shift = choices[pick[slot] % len(choices)]
        other[slot] = f"{numbers[slot].scaleb(shift)} [{unit}]"
    one, two = (td.simulation.compile_network(td.model_from_dict(_deck(v))).numbers() for v in (plain, other))
    assert dict(one.values) == dict(two.values)
    assert dict(one.capacitances) == dict(two.capacitances)
    for a, b in zip((*one.conductors, *one.loads), (*two.conductors, *two.loads), strict=True):
        assert a.coefficients == b.coefficients
    assert one.values["wall.thickness"] == float(numbers["thickness"])


@random_models(100, number=st.tuples(st.integers(-5000, 500000), st.sampled_from([0, 1, 2, 3])))
def test_celsius_is_rounded_once(number: tuple[int, int]) -> None:
    celsius = max(Decimal(number[0]).scaleb(-number[1]), Decimal("-273.15"))  # below absolute zero is refused
    kelvin = celsius + Decimal("273.15")
    one = td.Scenario("a", boundaries={"air": f"{celsius} [degC]"}).boundaries["air"]
    other = td.Scenario("b", boundaries={"air": f"{kelvin} [K]"}).boundaries["air"]
    assert one == other
    assert one.value == float(kelvin)


def test_hours_and_seconds_give_the_same_bits() -> None:
    values = {slot: f"0.7 [{unit}]" for slot, (unit, _) in SLOTS.items()}
    model = td.model_from_dict(_deck(values))
    runs = [
        td.simulate(model, td.Scenario("x", boundaries={"air": "24 [degC]"}, duration=d)).temperatures
        for d in ("1.5 [h]", "5400 [s]", "90 [min]")
    ]
    assert np.array_equal(runs[0], runs[1])
    assert np.array_equal(runs[0], runs[2])
