"""Deck -> Model -> deck keeps the meaning; with a pattern, comments and order too."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, OutputError
from thermid.base.files import unsealed
from thermid.model._deck.modelfile import load_model, model_from_dict, save_model
from thermid.model._parts.elements import KINDS
from thermid.model._tree.flat import Flat
from thermid.model._tree.identity import to_dict
from thermid.model._tree.model import Model
from thermid.simulation._network.rows import CONTROLS, LOADS
from thermid.simulation.runs import compile_network
from unit.model.every_kind import firsts

Decks = Callable[..., Model]
EXAMPLES = Path(__file__).parents[3] / "examples"

BOX = """# A box.
title = "Box"          # as its author calls it
needs = ["air"]
offers = ["case", "skin"]

[parameters]
scale = 2              # a plain number
area = { value = "500 [cm^2]", min = 300, max = 700, source = "measured" }

[nodes]
case = { capacitance = "900 [J/K]" }

[surfaces.skin]
of = "case"
to = "air"
area = "area"
htc = "5 [W/(m^2 K)]"
emissivity = 0.3

[loads]
heat = { into = "case", table = { points = [["0 [degC]", "2 [W]"], ["50 [degC]", "1 [W]"]] }, scale = "scale" }
"""

SINK = """# Everything that a deck may hold.
title = "Kitchen sink"
box = "dark grey"
use = "to be saved and read again"
needs = ["air", "walls"]   # two boundaries
offers = ["plate", "back", "one.case"]

[parameters]
low = { value = "20 [degC]", min = -10, max = 40.5, source = "datasheet", note = "set point", basis = "page 3" }
thick = { value = "5 [mm]", min = 1, max = 12.7 }
ratio = 0.25
derived = { value = "2*ratio", min = 0.1, max = 1 }
open = "inf [K/W]"

[nodes]
# the mass first
plate = { mass = "0.3 [kg]", specific_heat = { value = "960 [J/(kg K)]", source = "assumed" }, reference_point = true }
back = { capacitance = "120 [J/K]" }
probe = { capacitance = "1 [J/K]", test_only = true }
star = {}

[surfaces.front]
of = "plate"
to = "air"
area = "0.02 [m^2]"
htc = { coefficient = "1.42 [W/(m^2 K)]", exponent = 0.25 }
emissivity = { value = "85 [%]", min = 70, max = 95 }
radiates_to = "walls"

[surfaces.rear]
of = "back"
to = "air"
area = "120 [cm^2]"
effective_htc = { value = "6 [W/(m^2 K)]", min = 2, max = 15 }

[conductors]
slab = { kind = "conduction", between = ["plate", "star"], conductivity = "130 [W/(m K)]", area = "4 [cm^2]", thickness = "thick" }
link = { kind = "conduction", between = ["star", "back"], conductance = "0.5 [W/K]" }
cut = { kind = "conduction", between = ["plate", "back"], resistance = "open" }
touch = { kind = "contact", between = ["plate", "probe"], contact_conductance = "250 [W/(m^2 K)]", area = "1 [cm^2]", test_only = true }
still = { kind = "convection", between = ["back", "air"], htc = "2 [W/(m^2 K)]", area = "9 [cm^2]" }
free = { kind = "convection", between = ["back", "air"], htc = { coefficient = "1.3 [W/(m^2 K)]", exponent = "ratio" }, area = "9 [cm^2]" }
both = { kind = "effective", between = ["back", "air"], effective_htc = "5 [W/(m^2 K)]", area = "1 [cm^2]" }
glow = { kind = "radiation", between = ["plate", "walls"], emissivity = 0.1, area = "5 [cm^2]" }
pairs = { kind = "radiation", between = ["back", "walls"], exchange_factor = "derived", area = "5 [cm^2]" }
layer = { kind = "gas", between = ["plate", "back"], area = "2 [cm^2]", gap = "0.5 [mm]", gas = "N2" }
mount = { kind = "convection", between = ["back", "air"], htc = { length = "3 [cm]", orientation = "down" }, area = "2 [cm^2]" }
wire = { kind = "lead", between = ["plate", "walls"], conductivity = "390 [W/(m K)]", diameter = "1 [mm]", length = "40 [cm]", to = "air" }
tube = { kind = "duct", between = ["back", "air"], width = "4 [mm]", height = "2 [mm]", length = "20 [cm]", mass_flow = "0.1 [g/s]" }
still_air = { kind = "gas", between = ["plate", "back"], area = "200 [cm^2]", gap = "25 [mm]", tilt = "30 [deg]", aspect = "8" }
rail = { kind = "wedge_lock", between = ["plate", "back"], count = 2, length = "8 [cm]", resistance_length = "0.006 [m K/W]" }
stream = { kind = "flow", between = ["air", "back"], mass_flow = "0.01 [g/s]", specific_heat = "1006 [J/(kg K)]" }
valve = { kind = "table", between = ["plate", "back"], scale = 2, table = { points = [
    ["-20 [degC]", "0.1 [W/K]"],   # cold
    ["33.3 [degC]", "0.3 [W/K]"],
] } }
steep = { kind = "table", between = ["plate", "air"], table = { over = "difference", points = [
    ["-5 [K]", "1 [mW/K]"], ["0.1 [K]", "2 [mW/K]"],
] } }

[conductors.sink]
kind = "heat_sink"
between = ["back", "air"]
width = "2 [mm]"
height = "9 [mm]"
length = "6 [cm]"
count = 8
fin_thickness = "1 [mm]"
fin_conductivity = "180 [W/(m K)]"
volume_flow = "60 [l/min]"

[conductors.screws]
kind = "bolted"
between = ["plate", "back"]
count = 4
torque = "1.2 [N m]"
diameter = "4 [mm]"
washer = "8 [mm]"
thickness = "2 [mm]"
conductivity = "130 [W/(m K)]"
hardness = "1.1 [GPa]"
roughness = "2 [um]"
slope = 0.1
area = "20 [cm^2]"
filler_conductivity = "1.5 [W/(m K)]"
filler_thickness = "0.2 [mm]"

[conductors.chip]
kind = "spreading"
between = ["plate", "back"]
source_area = "1 [cm^2]"
plate_area = "25 [cm^2]"
thickness = "5 [mm]"
conductivity = "180 [W/(m K)]"

[conductors.pipe]
kind = "heat_pipe"
between = ["plate", "back"]
on_conductance = "5 [W/K]"
off_conductance = "0.1 [W/K]"
start_temperature = "40 [degC]"
transition = "4 [K]"

[joints.weld]
between = ["front", "one.skin"]
area = "3 [cm^2]"
contact_conductance = { value = "246 [W/(m^2 K)]", min = 50, max = 1000 }
gap = { area = { value = "4 [cm^2]", note = "each face" }, htc = "4 [W/(m^2 K)]", to = "air" }
mid = "seam"

[joints.glue]
between = ["rear", "two.skin"]
area = "2 [cm^2]"
conductivity = "0.2 [W/(m K)]"
thickness = "0.1 [mm]"

[loads]
steady = { into = "plate", power = { value = "2 [W]", min = 1, max = 3 } }
curve = { into = "back", scale = 1.5, table = { points = [["0 [degC]", "1 [W]"], ["60 [degC]", "0.5 [W]"]] } }
pulse = { into = "back", power = "1 [W]", periodic = { period = "10 [min]", duty = "30 [%]" } }
shape = { into = "back", power = "1 [W]", cycle = { times = ["0 [s]", "2 [min]", "5 [min]"], values = [1, 0.3, 1], hold = true } }
wave = { into = "back", power = "1 [W]", sine = { amplitude = "0.5 [W]", period = "1 [h]" } }
stat = { into = "back", power = "5 [W]", thermostat = { sensor = "plate", on_below = "low", off_above = "25 [degC]" } }
prop = { into = "back", power = "5 [W]", proportional = { gain = "0.5 [W/K]", setpoint = "low" } }

[loads.bend]
into = "plate"
power = "1 [W]"
temperature_coefficient = "0.4 [%/K]"
quadratic_coefficient = "0 [1/K^2]"
reference_temperature = "low"

[loads.runaway]
into = "plate"
power = "1 [mW]"
exponential_coefficient = "0.05 [1/K]"
reference_temperature = "25 [degC]"
command_curve = 0.1

[submodels]
one = { use = "Box.toml", bind = { air = "air" } }
two = { use = "Box.toml", bind = { air = "air" } }

[set]
"two.area" = { value = "510 [cm^2]", source = "assumed" }   # the second one is larger
"one.skin.htc" = "4.5 [W/(m^2 K)]"

[aliases]
first = "one"
"""


def inline(value: Any) -> str:
    """A value of a deck as TOML on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {inline(each)}" for key, each in value.items()) + " }"
    return f"[{', '.join(map(inline, value))}]" if isinstance(value, list) else json.dumps(value)


def others() -> str:
    """Conductors of the kinds that the text above does not use, as they stand among the cases."""
    used = {fields["kind"] for fields in tomllib.loads(SINK)["conductors"].values()}
    tables = {kind: {**fields, "between": ["plate", "back"]} for kind, fields in firsts().items() if kind not in used}
    return "".join(f"\n[conductors.{k}]\n" + "".join(f"{key} = {inline(v)}\n" for key, v in fields.items()) for k, fields in tables.items())


def numbers(model: Model) -> Any:
    found = compile_network(model).numbers()
    return (
        found.capacitances,
        [(r.name, r.form, r.ends, r.coefficients, r.curve) for r in (*found.conductors,)],
        [(r.name, r.form, r.node, r.sensor, r.coefficients, r.curve, r.signal, r.control) for r in found.loads],
    )


@pytest.fixture
def sink(decks: Decks) -> Model:
    return decks(main=SINK, Box=BOX)


@pytest.fixture
def every(decks: Decks) -> Model:
    return decks(main=SINK + others(), Box=BOX)


def test_the_sink_holds_every_kind(every: Model) -> None:
    assert {c.kind for c in every.conductors.values()} == set(KINDS)
    loads = compile_network(every).numbers().loads
    assert {r.form for r in loads} == set(LOADS)
    assert {r.control for r in loads} == {"", *CONTROLS}


def test_round_trip_of_everything(every: Model, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    save_model(every, tmp_path / "out/sink.toml")
    again = load_model(tmp_path / "out/sink.toml")
    assert again == every
    assert again.identity() == every.identity()
    assert numbers(again) == numbers(every)
    save_model(again, tmp_path / "out/twice.toml")
    assert (tmp_path / "out/twice.toml").read_text() == (tmp_path / "out/sink.toml").read_text()


def test_the_twin_in_python(tmp_path: Path) -> None:
    box = model_from_dict(tomllib.loads(BOX))
    assert model_from_dict(to_dict(box)) == box
    data = tomllib.loads(SINK)
    for entry in data["submodels"].values():
        entry["use"] = box
    twin = model_from_dict(data)
    save_model(twin, tmp_path / "twin.toml")
    assert load_model(tmp_path / "twin.toml") == twin


@pytest.mark.parametrize("deck", sorted(EXAMPLES.glob("0[12]_*/*.toml")), ids=lambda p: p.stem)
def test_round_trip_of_the_examples(deck: Path, tmp_path: Path) -> None:
    model = load_model(deck)
    save_model(model, tmp_path / deck.name)
    assert load_model(tmp_path / deck.name) == model
    save_model(model, tmp_path / deck.name, like=deck)
    assert unsealed((tmp_path / deck.name).read_text(encoding="utf-8")) == deck.read_text(encoding="utf-8")


def test_like_keeps_the_text_where_nothing_changed(sink: Model, tmp_path: Path) -> None:
    save_model(sink, tmp_path / "same.toml", like=tmp_path / "main.toml")
    assert unsealed((tmp_path / "same.toml").read_text(encoding="utf-8")) == SINK
    assert load_model(tmp_path / "same.toml") == sink
    assert (tmp_path / "Box.toml").read_text(encoding="utf-8") == BOX  # it says the same: it stays as its author wrote it
    save_model(sink.with_values({"thick": "6 [mm]"}), tmp_path / "main.toml", like=tmp_path / "main.toml")
    assert load_model(tmp_path / "main.toml").parameters["thick"].text == "6 [mm]"


def test_like_changes_what_differs_and_keeps_the_rest(sink: Model, tmp_path: Path) -> None:
    warm = sink.with_values({"steady.power": "2.5 [W]", "first.skin.htc": "4.75 [W/(m^2 K)]", "thick": "6 [mm]"}, origin="stage")
    save_model(warm, tmp_path / "warm.toml", like=tmp_path / "main.toml")
    text = (tmp_path / "warm.toml").read_text(encoding="utf-8")
    for comment in ("# Everything that a deck may hold.", "# two boundaries", "# the mass first", "# the second one is larger"):
        assert comment in text
    heads = ["[parameters]", "[nodes]", "[conductors]", "[joints.weld]", "[loads]", "[set]", "[aliases]"]
    assert [text.index(h) for h in heads] == sorted(text.index(h) for h in heads)
    again = load_model(tmp_path / "warm.toml")
    assert numbers(again) == numbers(warm)
    assert again.layers == ()
    assert again.loads["steady"].fields["power"].maximum == 3.0


def test_layers_become_values_with_their_bounds(sink: Model, tmp_path: Path) -> None:
    """Bounds are numbers in the value's own unit: a value in another unit must take them along."""
    warm = sink.with_values({"thick": "0.6 [cm]", "one.area": "0.06 [m^2]", "weld.gap.htc": "3 [W/(m^2 K)]", "front.htc.exponent": 0.3})
    (tmp_path / "out").mkdir()
    save_model(warm, tmp_path / "out/warm.toml")
    again = load_model(tmp_path / "out/warm.toml")
    assert numbers(again) == numbers(warm)
    thick = again.parameters["thick"]
    assert (thick.text, thick.minimum, thick.maximum) == ("0.6 [cm]", 0.001, 0.0127)
    assert Flat.of_model(again).parameters.table["one.area"].parameter.maximum == pytest.approx(0.07)


def test_like_drops_what_is_gone_and_adds_what_is_new(sink: Model, tmp_path: Path) -> None:
    flight = sink.without_test_only()
    save_model(flight, tmp_path / "flight.toml", like=tmp_path / "main.toml")
    text = (tmp_path / "flight.toml").read_text(encoding="utf-8")
    assert "probe" not in text
    assert "# the mass first" in text
    assert load_model(tmp_path / "flight.toml") == flight
    save_model(sink, tmp_path / "back.toml", like=tmp_path / "flight.toml")
    assert load_model(tmp_path / "back.toml") == sink


def test_a_part_that_its_author_changed_is_not_written_over(sink: Model, tmp_path: Path) -> None:
    changed = BOX.replace("900", "901")
    (tmp_path / "Box.toml").write_text(changed, encoding="utf-8")
    with raises_code("output.over-another-file", OutputError):
        save_model(sink, tmp_path / "again.toml")
    assert not (tmp_path / "again.toml").exists()
    assert (tmp_path / "Box.toml").read_text(encoding="utf-8") == changed


def test_like_a_deck_without_tables(sink: Model, tmp_path: Path) -> None:
    (tmp_path / "bare.toml").write_text('# nothing yet\ntitle = "Kitchen sink"\n', encoding="utf-8")
    save_model(sink, tmp_path / "full.toml", like=tmp_path / "bare.toml")
    assert (tmp_path / "full.toml").read_text(encoding="utf-8").startswith("# nothing yet\n")
    assert load_model(tmp_path / "full.toml") == sink


def test_two_parts_of_one_title_that_differ(sink: Model, tmp_path: Path) -> None:
    other = sink.submodels["two"].model.with_values({"area": "0.055 [m^2]"})
    with raises_code("name.taken", DeckError, match=r"'Box\.toml'"):
        save_model(sink.replace("two", other), tmp_path / "out.toml")


def test_identity_is_of_the_meaning(sink: Model, decks: Decks) -> None:
    reordered = decks(
        other=SINK.replace("# two boundaries", "").replace("ratio = 0.25\n", "").replace("[parameters]\n", "[parameters]\nratio = 0.25\n"),
        Box=BOX,
    )
    assert reordered.identity() == sink.identity()
    assert sink.with_values({"ratio": 0.3}).identity() != sink.identity()
    assert decks(third=SINK.replace("0.02 [m^2]", "0.021 [m^2]"), Box=BOX).identity() != sink.identity()
    assert decks(fourth=SINK, Box=BOX.replace("900", "901")).identity() != sink.identity()
