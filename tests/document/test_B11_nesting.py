"""Row B11 and section 2.5: Sd(m_IMU(m_AccS)) and Sd(m_PrE) nested, against the flat network and the temperatures of the sheet.

The parameters are retyped from the sheet's set (its file sisnav_parameters.yaml): published where the document prints them, assumed
elsewhere. The flat networks below are written by hand from the same numbers, area by area, without thermid's ledger.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import thermid as td
from strategies import TIGHTER

pytestmark = pytest.mark.document

POWER = {"acc": 0.225, "ele": 2.168, "proc": 4.11, "fog_h": 2.88, "fog_l": 2.74}  # W
MASS = {"acc": 0.054, "accs": 0.2, "ele": 0.737, "proc": 1.53, "fog_h": 0.859, "fog_l": 0.743, "disk": 4.0}  # kg
SUPPORT_MASS = 3.0  # kg, shared by the three FOGs
HEAT = {"acc": 480.0} | dict.fromkeys(("accs", "ele", "proc", "fog_h", "fog_l", "disk"), 960.0)  # J/(kg K)
AREA = {
    "acc": 0.00420536,
    "accs": 0.00921,
    "ele": 0.082241,
    "proc": 0.0627,
    "fog_h": 0.04,
    "fog_l": 0.0365,
    "imus": 0.155,
    "disk": 0.271,
}  # m^2
HTC = {
    "component": {"acc": 6.0, "ele": 2.2, "proc": 6.0, "fog_h": 4.8, "fog_l": 5.0},
    "m_PrE": {"ele": 2.1, "proc": 6.0},
    "m_AccS": {"acc": 6.0, "accs": 6.0},
    "m_IMU": {"acc": 6.0, "accs": 6.0, "imus": 5.0, "fog_h": 4.8, "fog_l": 5.0},
    "Sd": {"acc": 6.0, "accs": 6.0, "imus": 3.5, "fog_h": 3.8, "fog_l": 3.0, "ele": 2.1, "proc": 3.5, "disk": 3.5},
}  # W/(m^2 K), Table 2; AccS in m_AccS and the disk assumed
# joints: area of each face [m^2] and L/k [m^2 K/W] of one block
ACC_FOOT, ACCS_FOOT, FOG_FOOT, DISK_FOOT, PORT = (
    (3.7e-4, 4.02e-3),
    (1.87e-3, 3.03e-3),
    (4.69e-3, 1.51e-3),
    (6.01e-3, 5.31e-3),
    (6.68e-3, 2.06e-3),
)
STACK, GAP_AREA, GAP_HTC = (2.92e-3, 4.06e-3), 0.0134, 4.0

BENCH = td.Scenario("bench", boundaries={"air": "24 [degC]"}, start="24 [degC]", duration="5 [h]")
FOGS = {"fog1": "fog_h", "fog2": "fog_l", "fog3": "fog_l"}
ACCS = ("acc1", "acc2", "acc3")


# nested ------------------------------------------------------------------------------------------------------------------------------


def _part(kind: str, level: str) -> td.Model:
    deck: dict[str, Any] = {
        "title": kind,
        "needs": ["air"],
        "offers": ["case", "skin"],
        "nodes": {"case": {"mass": f"{MASS[kind]} [kg]", "specific_heat": f"{HEAT[kind]} [J/(kg K)]"} if kind in MASS else {}},
        "surfaces": {
            "skin": {"of": "case", "to": "air", "area": f"{AREA[kind]} [m^2]", "effective_htc": f"{HTC[level][kind]} [W/(m^2 K)]"}
        },
    }
    if kind in POWER:
        deck["loads"] = {"heat": {"into": "case", "power": f"{POWER[kind]} [W]"}}
    return td.model_from_dict(deck)


def _use(model: td.Model) -> dict[str, Any]:
    return {"use": model, "bind": {"air": "air"}}


def _block(one: str, other: str, joint: tuple[float, float]) -> dict[str, Any]:
    """Return one block between two faces, half on either side of the middle."""
    return {"between": [f"{one}.skin", f"{other}.skin"], "area": f"{joint[0]} [m^2]", "contact_conductance": f"2/{joint[1]} [W/(m^2 K)]"}


def _htc(paths: dict[str, str], level: str) -> dict[str, str]:
    return {f"{path}.skin.effective_htc": f"{HTC[level][kind]} [W/(m^2 K)]" for path, kind in paths.items()}


@cache
def m_pre() -> td.Model:
    stack = {
        "between": ["proc.skin", "ele.skin"],
        "area": f"{STACK[0]} [m^2]",
        "contact_conductance": f"1/{STACK[1]} [W/(m^2 K)]",
        "mid": "cd",
    }
    stack["gap"] = {"area": f"{GAP_AREA} [m^2]", "htc": f"{GAP_HTC} [W/(m^2 K)]", "to": "air"}  # type: ignore[assignment]
    return td.model_from_dict(
        {
            "title": "m_PrE",
            "needs": ["air"],
            "offers": ["cd", "proc.case", "ele.case"],
            "submodels": {"proc": _use(_part("proc", "component")), "ele": _use(_part("ele", "component"))},
            "set": _htc({"ele": "ele", "proc": "proc"}, "m_PrE"),
            "joints": {"stack": stack},
        }
    )


@cache
def m_accs() -> td.Model:
    return td.model_from_dict(
        {
            "title": "m_AccS",
            "needs": ["air"],
            "offers": ["support.skin", "support.case"],
            "submodels": {n: _use(_part("acc", "component")) for n in ACCS} | {"support": _use(_part("accs", "m_AccS"))},
            "joints": {f"foot_{n}": _block(n, "support", ACC_FOOT) for n in ACCS},
        }
    )


@cache
def m_imu() -> td.Model:
    shared = {f"{n}.case.mass": f"{MASS[kind]} + {SUPPORT_MASS}/3 [kg]" for n, kind in FOGS.items()}
    joints = {f"foot_{n}": _block(n, "support", FOG_FOOT) for n in FOGS} | {"foot_acc": _block("acc.support", "support", ACCS_FOOT)}
    return td.model_from_dict(
        {
            "title": "m_IMU",
            "needs": ["air"],
            "offers": ["support.skin", "support.case"],
            "submodels": {n: _use(_part(kind, "component")) for n, kind in FOGS.items()}
            | {"acc": _use(m_accs()), "support": _use(_part("imus", "m_IMU"))},
            "set": shared | _htc({**FOGS, "acc.support": "accs"} | {f"acc.{n}": "acc" for n in ACCS}, "m_IMU"),
            "joints": joints,
        }
    )


@cache
def sd() -> td.Model:
    """The full model; the port `cd` of m_PrE takes its area from EleGFO and from the disk (section 3)."""
    levels = {"pre.proc": "proc", "pre.ele": "ele", "imu.support": "imus", "imu.acc.support": "accs"}
    levels |= {f"imu.{n}": kind for n, kind in FOGS.items()} | {f"imu.acc.{n}": "acc" for n in ACCS}
    smaller = {f"{path}.skin.area": f"{AREA[kind]} - {PORT[0]} [m^2]" for path, kind in (("pre.ele", "ele"), ("disk", "disk"))}
    return td.model_from_dict(
        {
            "title": "Sd",
            "needs": ["air"],
            "submodels": {"pre": _use(m_pre()), "imu": _use(m_imu()), "disk": _use(_part("disk", "Sd"))},
            "set": _htc(levels, "Sd") | smaller,
            "joints": {"foot": _block("imu.support", "disk", DISK_FOOT)},
            "conductors": {
                "port": {
                    "kind": "contact",
                    "between": ["pre.cd", "disk.case"],
                    "area": f"{PORT[0]} [m^2]",
                    "contact_conductance": f"1/{PORT[1]} [W/(m^2 K)]",
                }
            },
        }
    )


# flat --------------------------------------------------------------------------------------------------------------------------------

Link = tuple[str, str, float]


def _flat(capacities: dict[str, float], links: list[Link], powers: dict[str, float]) -> td.Model:
    return td.model_from_dict(
        {
            "title": "flat",
            "needs": ["air"],
            "nodes": {n: {"capacitance": f"{c!r} [J/K]"} if c else {} for n, c in capacities.items()},
            "conductors": {
                f"g{k}": {"kind": "conduction", "between": [a, b], "conductance": f"{g!r} [W/K]"} for k, (a, b, g) in enumerate(links)
            },
            "loads": {f"q_{n}": {"into": n, "power": f"{p!r} [W]"} for n, p in powers.items()},
        }
    )


def _pre_links(level: str, port: float = 0.0) -> list[Link]:
    taken, h = STACK[0] + GAP_AREA, HTC[level]
    return [
        ("proc", "air", h["proc"] * (AREA["proc"] - taken)),
        ("ele", "air", h["ele"] * (AREA["ele"] - taken - port)),
        ("proc", "cd", STACK[0] / STACK[1]),
        ("ele", "cd", STACK[0] / STACK[1]),
        ("cd", "air", GAP_HTC * 2 * GAP_AREA),
    ]


def _accs_links(level: str, foot: float = 0.0) -> list[Link]:
    h = HTC[level]
    out: list[Link] = [("accs", "air", h["accs"] * (AREA["accs"] - 3 * ACC_FOOT[0] - foot))]
    for n in ACCS:
        out += [(n, "air", h["acc"] * (AREA["acc"] - ACC_FOOT[0])), (n, "accs", ACC_FOOT[0] / ACC_FOOT[1])]
    return out


def _imu_links(level: str, foot: float = 0.0) -> list[Link]:
    h = HTC[level]
    out = _accs_links(level, ACCS_FOOT[0])
    out += [
        ("imus", "air", h["imus"] * (AREA["imus"] - ACCS_FOOT[0] - 3 * FOG_FOOT[0] - foot)),
        ("accs", "imus", ACCS_FOOT[0] / ACCS_FOOT[1]),
    ]
    for n, kind in FOGS.items():
        out += [(n, "air", h[kind] * (AREA[kind] - FOG_FOOT[0])), (n, "imus", FOG_FOOT[0] / FOG_FOOT[1])]
    return out


PRE_C = {"proc": 1.53 * 960, "ele": 0.737 * 960, "cd": 0.0}
ACCS_C = dict.fromkeys(ACCS, 0.054 * 480) | {"accs": 0.2 * 960}
IMU_C = ACCS_C | {"imus": 0.0} | {n: (MASS[kind] + SUPPORT_MASS / 3) * 960 for n, kind in FOGS.items()}
PRE_P = {"proc": 4.11, "ele": 2.168}
ACCS_P = dict.fromkeys(ACCS, 0.225)
IMU_P = ACCS_P | {n: POWER[kind] for n, kind in FOGS.items()}


@cache
def flat(level: str) -> td.Model:
    if level == "m_PrE":
        return _flat(PRE_C, _pre_links(level), PRE_P)
    if level == "m_AccS":
        return _flat(ACCS_C, _accs_links(level), ACCS_P)
    if level == "m_IMU":
        return _flat(IMU_C, _imu_links(level), IMU_P)
    disk: list[Link] = [
        ("disk", "air", HTC["Sd"]["disk"] * (AREA["disk"] - DISK_FOOT[0] - PORT[0])),
        ("imus", "disk", DISK_FOOT[0] / DISK_FOOT[1]),
        ("cd", "disk", PORT[0] / PORT[1]),
    ]
    return _flat(PRE_C | IMU_C | {"disk": 4.0 * 960}, _pre_links("Sd", PORT[0]) + _imu_links("Sd", DISK_FOOT[0]) + disk, PRE_P | IMU_P)


NESTED = {"m_PrE": m_pre, "m_AccS": m_accs, "m_IMU": m_imu, "Sd": sd}


def _flat_name(level: str, path: str) -> str:
    """Return the flat network's name of a nested node."""
    path = path.removeprefix("pre.").removeprefix("imu.")
    if path in ("acc.support.case", "support.case"):
        return "accs" if path == "acc.support.case" or level == "m_AccS" else "imus"
    return path.removeprefix("acc.").removesuffix(".case")


# the tests ---------------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", NESTED)
@pytest.mark.parametrize("scenario", [BENCH, BENCH.vacuum(as_printed=True)], ids=["air", "vacuum"])
def test_B11_nested_equals_flat(level: str, scenario: td.Scenario) -> None:  # noqa: N802
    found = td.simulate(NESTED[level](), scenario, options=TIGHTER)
    other = td.simulate(_flat_in(level, scenario), BENCH, options=TIGHTER)
    compared = 0
    for path in found.nodes:
        if path.endswith(".mid"):  # the middle of a block, which the flat network writes as one resistance
            continue
        assert np.abs(found[path].kelvin - other[_flat_name(level, path)].kelvin).max() < 1e-7
        compared += 1
    assert compared == len(other.nodes)


@cache
def _without_air(level: str) -> td.Model:
    """Return the flat network in vacuum as printed: every path to the air gone."""
    model = flat(level)
    gone = {f"{n}.conductance": "0 [W/K]" for n, c in model.conductors.items() if "air" in c.between}
    return model.with_values(gone)


def _flat_in(level: str, scenario: td.Scenario) -> td.Model:
    return _without_air(level) if scenario.as_printed else flat(level)


# level, node: steady, after 5 h, after 5 h in vacuum as printed; late slope of the level in vacuum, K/h (section 2.5)
SHEET: dict[str, dict[str, tuple[float, float, float]]] = {
    "m_PrE": {"proc.case": (36.2525, 36.0778, 75.8095), "ele.case": (35.9861, 35.8215, 76.1628), "cd": (35.2787, 35.1209, 75.9861)},
    "m_AccS": {"support.case": (29.2008, 29.1979, 68.5385)} | {f"{n}.case": (30.1162, 30.1136, 70.2784) for n in ACCS},
    "m_IMU": {
        "acc.support.case": (30.6647, 30.5569, 54.4503),
        "support.case": (30.7898, 30.6755, 54.0878),
        "fog1.case": (31.3177, 31.1940, 54.0539),
        "fog2.case": (31.2982, 31.1752, 54.0688),
        "fog3.case": (31.2982, 31.1752, 54.0688),
    }
    | {f"acc.{n}.case": (31.2873, 31.1964, 56.4238) for n in ACCS},
    "Sd": {
        "pre.proc.case": (33.9771, 33.6876, 50.6186),
        "pre.ele.case": (32.1236, 31.8756, 49.3395),
        "pre.cd": (30.5143, 30.2683, 47.6450),
        "imu.acc.support.case": (31.2612, 31.0002, 48.7023),
        "imu.support.case": (31.4759, 31.1946, 48.1946),
        "imu.fog1.case": (32.0551, 31.7552, 48.3515),
        "imu.fog2.case": (32.1089, 31.8070, 48.3545),
        "imu.fog3.case": (32.1089, 31.8070, 48.3545),
        "disk.case": (29.6048, 29.3607, 46.6097),
    }
    | {f"imu.acc.{n}.case": (31.7645, 31.5467, 50.7694) for n in ACCS},
}
LATE = {"m_PrE": 10.384870, "m_AccS": 9.0080, "m_IMU": 6.0223, "Sd": 4.8284}


@pytest.mark.parametrize("level", SHEET)
def test_A5_temperatures_of_every_level(level: str) -> None:  # noqa: N802
    model = NESTED[level]()
    steady = td.steady(model, BENCH)
    warm, cold = (td.simulate(model, s) for s in (BENCH, BENCH.vacuum(as_printed=True)))
    for path, (settled, air, vacuum) in SHEET[level].items():
        assert steady[path] - 273.15 == pytest.approx(settled, abs=1e-3)
        assert warm[path].final == pytest.approx(air, abs=1e-3)
        assert cold[path].final == pytest.approx(vacuum, abs=1e-3)
    assert warm.heat_balance().relative < 1e-6


@pytest.mark.parametrize(
    ("kind", "settled", "air", "vacuum"),
    [
        ("acc", 32.9172, 32.9172, 180.25),
        ("fog_h", 39.0, 38.7730, 86.8638),
        ("fog_l", 39.0137, 38.8636, 93.1454),
        ("ele", 35.9825, 35.8624, 79.1560),
        ("proc", 34.9250, 34.8163, 74.3676),
    ],
)
def test_A1_temperatures_of_the_components(kind: str, settled: float, air: float, vacuum: float) -> None:  # noqa: N802
    model = _part(kind, "component")
    assert td.steady(model, BENCH)["case"] - 273.15 == pytest.approx(settled, abs=1e-3)
    assert td.simulate(model, BENCH)["case"].final == pytest.approx(air, abs=1e-3)
    assert td.simulate(model, BENCH.vacuum(as_printed=True))["case"].final == pytest.approx(vacuum, abs=1e-3)


@pytest.mark.parametrize("level", LATE)
def test_V1_late_slope_in_vacuum(level: str) -> None:  # noqa: N802
    """The sum of powers over the sum of capacitances, at every node, once the differences have settled."""
    late = BENCH.vacuum(as_printed=True).with_(duration="40 [h]")
    solution = td.simulate(NESTED[level](), late, times=[39 * 3600.0, 40 * 3600.0], options=TIGHTER)
    rises = [solution[n].rise for n in solution.nodes if n != "air"]
    assert rises == pytest.approx([LATE[level]] * len(rises), abs=6e-5)
    model = flat(level)
    numbers = td.simulation.compile_network(model).numbers()
    slope = 3600 * sum(float(r.coefficients[0]) for r in numbers.loads) / sum(float(c or 0) for c in numbers.capacitances.values())  # type: ignore[arg-type]
    assert rises == pytest.approx([slope] * len(rises), rel=1e-9)


def test_A5_energy_balance_of_the_full_model() -> None:  # noqa: N802
    """15.313 W in and, once settled, 15.313 W out."""
    solution = td.simulate(sd(), BENCH.with_(duration="200 [h]"), times=[200 * 3600.0], options=TIGHTER)
    assert sum(p[-1] for p in solution.load_powers.values()) == pytest.approx(15.313, abs=1e-12)
    network = td.simulation.compile_network(sd())
    out = sum(float(solution.heat_flow(c.path)[-1]) for c in network.flat.conductors if c.ends[1] == "air")
    assert out == pytest.approx(15.313, abs=1e-6)


def test_E19_mass_of_the_support_does_not_change_steady_values() -> None:  # noqa: N802
    heavy = m_imu().with_values({f"{n}.case.mass": f"{MASS[kind]} + 10*{SUPPORT_MASS}/3 [kg]" for n, kind in FOGS.items()})
    assert td.steady(heavy, BENCH) == pytest.approx(td.steady(m_imu(), BENCH), abs=1e-9)
    assert td.simulate(heavy, BENCH)["fog2.case"].final == pytest.approx(27.64, abs=5e-3)
