"""The levels of the source document from components to the full model: areas (B10), nesting (B11), names (N1 to N4), Table 2 (B12).

Figures are those of sections 2.5 and 3 of the acceptance sheet: printed where the document prints them, assumed elsewhere. The ambient
is 24 degC. Joints outside m_PrE are one block, L/k of both halves together.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, NameNotFoundError
from thermid.model.tree import Flat, Model, ledger, load_model, model_from_dict, save_model
from thermid.simulation.runs import compile_network, modes, state_space

pytestmark = pytest.mark.document
EXAMPLES = Path(__file__).parents[2] / "examples"

# power [W], mass [kg], specific heat [J/(kg K)], area [m^2]
PARTS = {
    "ProcSISNAV": ("4.11", "1.53", "960", "0.0627"),
    "EleGFO": ("2.168", "0.737", "960", "0.082241"),
    "Acc": ("1*(15*0.015)", "0.054", "480", "0.001406 + 1.08*0.002592"),
    "AccS": ("0", "0.2", "960", "0.00921"),
    "IMUS": ("0", "", "", "0.155"),
    "FOG_h": ("2.88", "0.859", "960", "0.04"),
    "FOG_l": ("2.74", "0.743", "960", "0.0365"),
    "Disk": ("0", "4.0", "960", "0.271"),
}
# Table 2: rows and columns as printed; None is the dash, "not given"
LEVELS = ("Sd", "m_PrE", "m_IMU", "m_AccS", "component")
TABLE_2: dict[str, tuple[float | None, ...]] = {
    "ProcSISNAV": (3.5, 6.0, None, None, 6.0),
    "EleGFO": (2.1, 2.1, None, None, 2.2),
    "Acc": (6.0, None, 6.0, 6.0, 6.0),
    "AccS": (6.0, None, 6.0, None, None),
    "IMUS": (3.5, None, 5.0, None, None),
    "FOG_h": (3.8, None, 4.8, None, 4.8),
    "FOG_l": (3.0, None, 5.0, None, 5.0),
}
ASSUMED = {("AccS", "m_AccS"): 6.0, ("Disk", "Sd"): 3.5}
"""The two coefficients that Table 2 does not give and the document's model needs (E17)."""


def given(name: str, level: str) -> float | None:
    """Return the coefficient of a part at a level: Table 2's, the assumed one, or None."""
    row = TABLE_2.get(name, (None,) * len(LEVELS))
    return ASSUMED.get((name, level), row[LEVELS.index(level)])


def component(name: str, level: str = "component") -> Model:
    """Return a part with its coefficient at some level."""
    power, mass, heat, area = PARTS[name]
    htc = given(name, level)
    skin: dict[str, Any] = {"of": "case", "to": "air", "area": f"{area} [m^2]"}
    skin |= {"effective_htc": f"{htc} [W/(m^2 K)]"} if htc is not None else {}
    return model_from_dict(
        {
            "title": name,
            "needs": ["air"],
            "offers": ["case", "skin"],
            "nodes": {"case": {"mass": f"{mass} [kg]", "specific_heat": f"{heat} [J/(kg K)]"} if mass else {}},
            "surfaces": {"skin": skin},
        }
        | ({"loads": {"heat": {"into": "case", "power": f"{power} [W]"}}} if power != "0" else {})
    )


def block(one: str, other: str, area: str, resistance: str) -> dict[str, Any]:
    """Return a joint: one block of L/k [m^2 K/W] between two skins, half of it on either side of its middle."""
    return {"between": [f"{one}.skin", f"{other}.skin"], "area": f"{area} [m^2]", "contact_conductance": f"2/{resistance} [W/(m^2 K)]"}


def use(model: Model, need: str = "air") -> dict[str, Any]:
    return {"use": model, "bind": {model.needs[0]: need}}


@lru_cache(maxsize=1)
def m_pre() -> Model:
    return model_from_dict(
        {
            "title": "m_PrE",
            "needs": ["cv"],
            "offers": ["cd", "proc.case", "ele.case", "proc.skin", "ele.skin"],
            "submodels": {"proc": use(component("ProcSISNAV"), "cv"), "ele": use(component("EleGFO"), "cv")},
            "set": {"ele.skin.effective_htc": "2.1 [W/(m^2 K)]"},
            "joints": {
                "stack": {
                    "between": ["proc.skin", "ele.skin"],
                    "area": "0.00292 [m^2]",
                    "contact_conductance": "1/0.00406 [W/(m^2 K)]",
                    "gap": {"area": "0.0134 [m^2]", "htc": "4 [W/(m^2 K)]", "to": "cv"},
                    "mid": "cd",
                }
            },
            "aliases": {"PrS": "proc", "EleG": "ele"},
        }
    )


@lru_cache(maxsize=1)
def m_accs() -> Model:
    acc = component("Acc")
    names = ("acc1", "acc2", "acc3")
    return model_from_dict(
        {
            "title": "m_AccS",
            "needs": ["air"],
            "offers": ["support.case", "support.skin", *(f"{n}.case" for n in names)],
            "submodels": {n: use(acc) for n in names} | {"support": use(component("AccS", "m_AccS"))},
            "joints": {f"foot{k}": block(n, "support", "0.00037", "0.00402") for k, n in enumerate(names, 1)},
            "aliases": {"AccS": "support"},
        }
    )


@lru_cache(maxsize=1)
def m_imu() -> Model:
    fogs = {"fog1": component("FOG_h"), "fog2": component("FOG_l"), "fog3": component("FOG_l")}
    # the support's mass is shared by the three FOGs (Fig. 23)
    shared = {f"{n}.case.mass": f"{PARTS[m.title][1]} + 3.0/3 [kg]" for n, m in fogs.items()}
    return model_from_dict(
        {
            "title": "m_IMU",
            "needs": ["air"],
            "offers": [
                "support.case",
                "support.skin",
                "acc.support.case",
                *(f"acc.acc{k}.case" for k in (1, 2, 3)),
                *(f"{n}.case" for n in fogs),
            ],
            "submodels": {n: use(m) for n, m in fogs.items()} | {"acc": use(m_accs()), "support": use(component("IMUS", "m_IMU"))},
            "set": shared | {"acc.support.skin.effective_htc": "6 [W/(m^2 K)]"},
            "joints": {f"foot{k}": block(f"fog{k}", "support", "0.00469", "0.00151") for k in (1, 2, 3)}
            | {"block": block("acc.support", "support", "0.00187", "0.00303")},
            "aliases": {f"FOG{k}": f"fog{k}" for k in (1, 2, 3)},
        }
    )


@lru_cache(maxsize=1)
def sd() -> Model:
    """The full model. The port `cd` of m_PrE joins the disk; the area of that joint is EleGFO's, which is not a joint of two surfaces."""
    levels = {
        "pre.proc": "ProcSISNAV",
        "pre.ele": "EleGFO",
        "imu.fog1": "FOG_h",
        "imu.fog2": "FOG_l",
        "imu.fog3": "FOG_l",
        "imu.support": "IMUS",
    }
    levels |= {f"imu.acc.acc{k}": "Acc" for k in (1, 2, 3)} | {"imu.acc.support": "AccS"}
    return model_from_dict(
        {
            "title": "m_Sd",
            "needs": ["air"],
            "offers": ["disk.case"],
            "submodels": {"pre": use(m_pre()), "imu": use(m_imu()), "disk": use(component("Disk", "Sd"))},
            "parameters": {"port_area": "0.00668 [m^2]"},
            "set": {f"{path}.skin.effective_htc": f"{given(name, 'Sd')} [W/(m^2 K)]" for path, name in levels.items()}
            | {"pre.ele.skin.area": f"{PARTS['EleGFO'][3]} - 0.00668 [m^2]", "disk.skin.area": f"{PARTS['Disk'][3]} - 0.00668 [m^2]"},
            "joints": {"foot": block("imu.support", "disk", "0.00601", "0.00531")},
            "conductors": {
                "port": {
                    "kind": "contact",
                    "between": ["pre.cd", "disk.case"],
                    "contact_conductance": "1/0.00206 [W/(m^2 K)]",
                    "area": "port_area",
                }
            },
            "aliases": {
                "m_PrE": "pre",
                "PrE": "pre",
                "m_IMU": "imu",
                "m_AccS": "imu.acc",
                "m_Sd_PrS": "pre.PrS.case",
                "m_IMU_FOG1": "imu.FOG1.case",
            },
        }
    )


def steady(model: Model, ambient: float = 24.0) -> dict[str, float]:
    """Return the steady temperatures of a linear model, massless nodes too. [degC]"""
    network = compile_network(model)
    numbers, space = network.numbers(), state_space(network)
    heat = dict.fromkeys(space.nodes, 0.0)
    for row in numbers.loads:
        heat[row.node] += float(row.coefficients[0])  # type: ignore[arg-type]
    power = np.array(list(heat.values())) / space.capacitances
    found = np.linalg.solve(space.A, -(space.B_boundary.sum(axis=1) * ambient + power))
    out = dict(zip(space.nodes, found.tolist(), strict=True)) | dict.fromkeys(space.boundaries, ambient)
    for node, weights in space.recover:
        out[node] = sum(w * out[n] for n, w in weights.items())
    return out


# temperatures of section 2.5 ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "result"), [("Acc", 32.917), ("FOG_h", 39.000), ("FOG_l", 39.014), ("EleGFO", 35.983), ("ProcSISNAV", 34.925)]
)
def test_components(name: str, result: float) -> None:
    """A1."""
    assert steady(component(name))["case"] == pytest.approx(result, abs=1e-3)


def test_pair() -> None:
    found = steady(m_pre())
    assert (found["proc.case"], found["ele.case"], found["cd"]) == pytest.approx((36.252540, 35.986075, 35.278747), abs=1e-6)


def test_submodels() -> None:
    assert steady(m_accs())["acc2.case"] == pytest.approx(30.116, abs=1e-3)
    assert steady(m_accs())["support.case"] == pytest.approx(29.201, abs=1e-3)
    found = steady(m_imu())
    wanted = {
        "fog1.case": 31.318,
        "fog2.case": 31.298,
        "fog3.case": 31.298,
        "acc.acc1.case": 31.287,
        "acc.support.case": 30.665,
        "support.case": 30.790,
    }
    assert {n: found[n] for n in wanted} == pytest.approx(wanted, abs=1e-3)


def test_full_model() -> None:
    """A5, and the balance of 15.313 W."""
    found = steady(sd())
    wanted = {
        "pre.proc.case": 33.977,
        "pre.ele.case": 32.124,
        "imu.fog1.case": 32.055,
        "imu.fog2.case": 32.109,
        "imu.fog3.case": 32.109,
        "imu.acc.acc1.case": 31.765,
        "imu.acc.support.case": 31.261,
        "imu.support.case": 31.476,
        "disk.case": 29.605,
    }
    assert {n: found[n] for n in wanted} == pytest.approx(wanted, abs=1e-3)
    numbers = compile_network(sd()).numbers()
    out = sum(float(r.coefficients[0]) * (found[r.ends[0]] - found[r.ends[1]]) for r in numbers.conductors if r.ends[1] == "air")  # type: ignore[arg-type]
    assert sum(float(r.coefficients[0]) for r in numbers.loads) == pytest.approx(15.313, abs=1e-12)  # type: ignore[arg-type]
    assert out == pytest.approx(15.313, rel=1e-11)


def test_ambient_shifts_every_steady_value() -> None:
    """A7: exactly ten kelvin, to rounding."""
    cold, warm = steady(sd()), steady(sd(), 34.0)
    assert {n: t + 10.0 for n, t in cold.items()} == pytest.approx(warm, abs=1e-10)


def test_slowest_time_constants_of_the_full_model() -> None:
    """Section 2.2 for the pair; the full model's are those of an independent computation (networks.json of the acceptance sheet)."""
    wanted = (5445.950678, 2385.825810, 1219.406259, 801.533322, 541.128736, 522.672921, 424.625280, 225.289511, 225.289511, 146.180442)
    assert modes(state_space(compile_network(sd()))).time_constants == pytest.approx(wanted, rel=1e-8)


# B10: areas --------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("build", [m_pre, m_accs, m_imu, sd], ids=lambda f: f.__name__)
def test_area_is_conserved(build: Any) -> None:
    """B10: exposed + contact + gap = total at every level, to 1e-12."""
    for line in ledger(build()):
        assert line.exposed + line.contact + line.gap == pytest.approx(line.total, rel=1e-12)
        assert sum(line.joints.values()) == pytest.approx(line.contact + line.gap, rel=1e-12)
        assert line.exposed >= 0.0


@pytest.mark.parametrize(
    ("build", "surface", "exposed"),
    [
        (m_pre, "proc.skin", 0.04638),
        (m_pre, "ele.skin", 0.065921),
        (m_accs, "acc1.skin", 0.00383536),
        (m_accs, "support.skin", 0.0081),
        (m_imu, "acc.support.skin", 0.00623),
        (m_imu, "support.skin", 0.13906),
        (m_imu, "fog1.skin", 0.03531),
        (m_imu, "fog3.skin", 0.03181),
        (sd, "pre.proc.skin", 0.04638),
        (sd, "pre.ele.skin", 0.059241),
        (sd, "imu.support.skin", 0.13305),
        (sd, "imu.acc.acc2.skin", 0.00383536),
        (sd, "disk.skin", 0.271 - 0.00601 - 0.00668),
    ],
)
def test_what_is_left_to_convect(build: Any, surface: str, exposed: float) -> None:
    lines = {line.surface: line for line in ledger(build())}
    assert lines[surface].exposed == pytest.approx(exposed, rel=1e-12)


def test_over_allocation_is_refused_at_any_depth() -> None:
    with raises_code(
        "value.contradicts", DeckError, match=r"'imu\.acc\.support\.skin'.*92\.1.*cm\^2.*'imu\.block'.*85.*cm\^2.*'imu\.acc\.foot1'.*3\.7"
    ):
        ledger(sd().with_values({"imu.block.area": "85 [cm^2]"}))


def test_component_parameters_stay_but_for_the_convective_area() -> None:
    """A3: what a submodel changes of a part is the area that convects, and what its deck sets."""
    alone, inside = Flat.of_model(component("ProcSISNAV")).parameters.evaluate({}), Flat.of_model(m_pre()).parameters.evaluate({})
    assert {p: inside[f"proc.{p}"] for p in alone} == alone


# B11: nesting ------------------------------------------------------------------------------------------------------------------------


def flat_twin(model: Model) -> Model:
    """Return a model of one level with the same nodes, conductors and loads, written from the rows."""
    network = compile_network(model)
    numbers = network.numbers()
    under = {n: n.replace(".", "_") for n in (*network.nodes, *network.boundaries)}
    return model_from_dict(
        {
            "title": "flat",
            "needs": list(network.boundaries),
            "nodes": {under[n]: {} if c is None else {"capacitance": f"{float(c)!r} [J/K]"} for n, c in numbers.capacitances.items()},  # type: ignore[arg-type]
            "conductors": {
                f"g{k}": {"kind": "conduction", "between": [under[e] for e in r.ends], "conductance": f"{float(r.coefficients[0])!r} [W/K]"}  # type: ignore[arg-type]
                for k, r in enumerate(numbers.conductors)
            },
            "loads": {f"q{k}": {"into": under[r.node], "power": f"{float(r.coefficients[0])!r} [W]"} for k, r in enumerate(numbers.loads)},  # type: ignore[arg-type]
        }
    )


def test_nested_equals_flat() -> None:
    """B11: m_Sd(m_IMU(m_AccS)) is the flat network."""
    nested, flat = state_space(compile_network(sd())), state_space(compile_network(flat_twin(sd())))
    assert [n.replace(".", "_") for n in nested.nodes] == list(flat.nodes)
    np.testing.assert_allclose(nested.A, flat.A, rtol=1e-12, atol=1e-18)
    assert list(steady(sd()).values()) == pytest.approx(list(steady(flat_twin(sd())).values()), rel=1e-12)


def test_support_mass_shared_or_its_own() -> None:
    """B11: steady values do not depend on where the support's mass is put; the slowest time constant does."""
    own = component("IMUS", "m_IMU")
    heavy = model_from_dict(
        {
            "title": "IMUS",
            "needs": ["air"],
            "offers": ["case", "skin"],
            "nodes": {"case": {"mass": "3 [kg]", "specific_heat": "960 [J/(kg K)]"}},
            "surfaces": {"skin": {"of": "case", "to": "air", "area": "0.155 [m^2]", "effective_htc": "5 [W/(m^2 K)]"}},
        }
    )
    shared = m_imu()
    apart = shared.replace("support", heavy).with_values(
        {f"fog{k}.case.mass": f"{m} [kg]" for k, m in ((1, "0.859"), (2, "0.743"), (3, "0.743"))}
    )
    assert own.needs == heavy.needs
    assert steady(apart) == pytest.approx(steady(shared), abs=1e-9)
    slow = [modes(state_space(compile_network(m))).time_constants[0] for m in (shared, apart)]
    # m_IMU FOG_l reaches 99 % after 5.64 h and 5.36 h: the slowest constants differ by a few per cent in the same sense
    assert slow[1] < slow[0]


@pytest.mark.parametrize("level", [m_pre, m_imu, sd], ids=lambda f: f.__name__)
def test_levels_survive_their_files(level: Any, tmp_path: Path) -> None:
    """Titles repeat at no level with two contents, so every part has its own file."""
    save_model(level(), tmp_path / "top.toml")
    again = load_model(tmp_path / "top.toml")
    assert again.identity() == level().identity()
    assert steady(again) == steady(level())


# B12: Table 2 ------------------------------------------------------------------------------------------------------------------------


def test_B12_table_2_as_printed() -> None:  # noqa: N802
    """Five columns, seven rows; a dash is "not given" and never zero."""
    assert len(TABLE_2) == 7
    assert all(len(row) == len(LEVELS) == 5 for row in TABLE_2.values())
    assert sum(cell is None for row in TABLE_2.values() for cell in row) == 15
    assert all(cell is None or cell > 0 for row in TABLE_2.values() for cell in row)


@pytest.mark.parametrize(
    ("build", "level", "paths"),
    [
        (m_pre, "m_PrE", {"proc": "ProcSISNAV", "ele": "EleGFO"}),
        (m_accs, "m_AccS", {"acc1": "Acc", "support": "AccS"}),
        (m_imu, "m_IMU", {"acc.acc3": "Acc", "acc.support": "AccS", "support": "IMUS", "fog1": "FOG_h", "fog2": "FOG_l"}),
        (
            sd,
            "Sd",
            {
                "pre.proc": "ProcSISNAV",
                "pre.ele": "EleGFO",
                "imu.acc.acc1": "Acc",
                "imu.acc.support": "AccS",
                "imu.support": "IMUS",
                "imu.fog1": "FOG_h",
                "imu.fog3": "FOG_l",
            },
        ),
    ],
)
def test_B12_table_2_per_level(build: Any, level: str, paths: dict[str, str]) -> None:  # noqa: N802
    """The value that holds at each level is the table's, whoever set it: the outermost deck wins."""
    values = Flat.of_model(build()).parameters.evaluate({})
    assert {p: values[f"{p}.skin.effective_htc"] for p in paths} == {p: given(n, level) for p, n in paths.items()}


def test_levels_are_a_shadow_list() -> None:
    """At the full model, every coefficient shows which lower levels it hides."""
    table = Flat.of_model(sd()).parameters.table
    assert table["pre.ele.skin.effective_htc"].shadowed == (("EleGFO", "2.2 [W/(m^2 K)]"), ("[set] of m_PrE", "2.1 [W/(m^2 K)]"))
    assert table["pre.ele.skin.effective_htc"].origin == "[set] of m_Sd"
    assert table["imu.acc.support.skin.effective_htc"].shadowed == (("AccS", "6.0 [W/(m^2 K)]"), ("[set] of m_IMU", "6 [W/(m^2 K)]"))


@pytest.mark.parametrize(
    ("name", "level"), [("AccS", "component"), ("IMUS", "component"), ("IMUS", "m_AccS"), ("Disk", "component"), ("Disk", "m_IMU")]
)
def test_B12_a_dash_is_asked_for(name: str, level: str) -> None:  # noqa: N802
    """B12: where the table has no value, the part is refused and says what to give; the disk has no row at all."""
    with raises_code("value.incomplete", DeckError, match=rf"{name}, surfaces\.skin: .*Give htc, effective_htc, "):
        component(name, level)


# N1 to N4: names ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("written", "canonical"),
    [
        ("m_Sd_PrS", "pre.proc.case"),
        ("m_IMU_FOG1", "imu.fog1.case"),
        ("PrE.EleG.case", "pre.ele.case"),
        ("m_PrE.PrS.case", "pre.proc.case"),
        ("m_AccS.AccS.case", "imu.acc.support.case"),
    ],
)
def test_names_of_the_document(written: str, canonical: str) -> None:
    assert Flat.of_model(sd()).names.find(written) == canonical


def test_names_of_the_example() -> None:
    names = Flat.of_model(load_model(EXAMPLES / "02_stack/m_PrE.toml")).names
    assert names.find("m_PrE_PrS") == names.find("PrS.case") == "proc.case"
    assert names.find("m_PrE_EleG") == names.find("EleG.case") == "ele.case"
    with raises_code("name.unknown", NameNotFoundError, match="m_PrE.*'m_PrE_PrX'"):
        names.find("m_PrE_PrX")


def test_pair_is_not_processor() -> None:
    """PrE is the submodel, PrS the processor in it; AccS alone is the support, m_AccS the submodel."""
    assert isinstance(sd().at("PrE"), Model)
    assert sd().submodel("PrE").title == "m_PrE"
    assert sd().submodel("PrE.PrS").title == "ProcSISNAV"
    assert sd().submodel("m_AccS").title == "m_AccS"
    assert sd().submodel("m_AccS.AccS").title == "AccS"
