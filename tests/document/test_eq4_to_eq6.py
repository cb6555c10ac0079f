"""Eqs. 4 to 6, derived from the network of Fig. 19 by the program itself, against the printed ones, as symbols."""

from __future__ import annotations

from pathlib import Path

import pytest

import thermid as td

sympy = pytest.importorskip("sympy", reason="sympy is not installed (thermid[symbolic])")
pytestmark = pytest.mark.document
DECK = Path(__file__).parents[2] / "examples" / "sisnav" / "m_PrE.toml"
NAMES = {"stack.first": "R_cd1", "stack.second": "R_cd2", "proc.skin": "R_cn1", "ele.skin": "R_cn2", "stack.gap": "R_cn3"}
NAMES |= {"m_PrE_PrS": "T_1", "m_PrE_EleG": "T_2", "cd": "T_cd", "cv": "T_amb", "proc.electronics": "Q_k1", "ele.electronics": "Q_k2"}

# the printed symbols
R1, R2, N1, N2, N3, C1, C2 = sympy.symbols("R_cd1 R_cd2 R_cn1 R_cn2 R_cn3 C_1 C_2")
T1, T2, TA, Q1, Q2 = sympy.symbols("T_1 T_2 T_amb Q_k1 Q_k2")
DELTA = R1 * R2 + R1 * N3 + R2 * N3
ALPHA = R1 * N2 + N2 * N3
BETA = R2 * N1 + N1 * N3
LAMBDA = DELTA + ALPHA + BETA + N1 * N2


@pytest.fixture(scope="module")
def derived() -> td.interop.Equations:
    return td.interop.equations(td.load_model(DECK), NAMES)


def same(found: object, printed: object) -> bool:
    return sympy.simplify(found - printed) == 0


def test_eq4_both_rows_and_delta(derived: td.interop.Equations) -> None:
    one = Q1 - (T1 - TA) / N1 - (R2 * (T1 - TA) + N3 * (T1 - T2)) / DELTA
    two = Q2 - (T2 - TA) / N2 - (R1 * (T2 - TA) + N3 * (T2 - T1)) / DELTA
    assert [str(c) for c in derived.capacitances] == ["C_1", "C_2"]
    assert {str(s): e for s, e in derived.auxiliaries.items()} == {"Delta": DELTA}
    assert same(derived.expanded(derived.heat[0]), one)
    assert same(derived.expanded(derived.heat[1]), two)
    assert not same(derived.expanded(derived.heat[0]), one + (T1 - TA) / (1000 * N1))  # the comparison can fail


def test_eq4_the_massless_node(derived: td.interop.Equations) -> None:
    ((symbol, expression),) = derived.massless.items()
    assert str(symbol) == "T_cd"
    assert same(derived.expanded(expression), (R1 * R2 * TA + R1 * N3 * T2 + R2 * N3 * T1) / DELTA)


def test_eq4_without_the_gap(derived: td.interop.Equations) -> None:
    """B9: R_cn3 left out is its limit at infinity, both joints in a row; the printed text calls that negligible (E3)."""
    for k, sign in ((0, 1), (1, -1)):
        open_gap = sympy.limit(derived.expanded(derived.heat[k]), N3, sympy.oo)
        alone = (Q1 - (T1 - TA) / N1, Q2 - (T2 - TA) / N2)[k]
        assert same(open_gap, alone - sign * (T1 - T2) / (R1 + R2))


def test_eq5_matrix_and_vector(derived: td.interop.Equations) -> None:
    a = [
        [-((R2 + N3) / DELTA + 1 / N1) / C1, N3 / DELTA / C1],
        [N3 / DELTA / C2, -((R1 + N3) / DELTA + 1 / N2) / C2],
    ]
    b = [(Q1 + TA * (R2 / DELTA + 1 / N1)) / C1, (Q2 + TA * (R1 / DELTA + 1 / N2)) / C2]
    for i in range(2):
        assert same(derived.expanded(derived.vector[i]), b[i])
        for j in range(2):
            assert same(derived.expanded(derived.matrix[i, j]), a[i][j])


def test_eq6_steady_state(derived: td.interop.Equations) -> None:
    rise = [N1 / LAMBDA * (Q1 * (DELTA + ALPHA) + Q2 * N2 * N3), N2 / LAMBDA * (Q1 * N1 * N3 + Q2 * (DELTA + BETA))]
    assert [str(s) for s in derived.steady] == ["T_1", "T_2"]
    for expression, printed in zip(derived.steady.values(), rise, strict=True):
        assert same(expression, TA + printed)


def test_eq6_numbers(derived: td.interop.Equations) -> None:
    given = {**derived.values, "Q_k1": 4.11, "Q_k2": 2.168, "T_amb": 24.0}
    given |= {"R_cd1": 0.00406 / 0.00292, "R_cd2": 0.00406 / 0.00292}  # the deck rounds L/k at its sixth digit
    found = [float(e.subs(given)) for e in derived.steady.values()]
    assert found == pytest.approx([36.252540, 35.986075], abs=1e-6)


def test_eq4_as_latex(derived: td.interop.Equations) -> None:
    assert derived.latex().splitlines()[1:4] == [
        r"  C_{1} \frac{dT_{1}}{dt} &= Q_{k1} - \frac{T_{1} - T_{amb}}{R_{cn1}} - \frac{R_{cd2} \left(T_{1} - T_{amb}\right)}{\Delta} "
        r"- \frac{R_{cn3} \left(T_{1} - T_{2}\right)}{\Delta} \\",
        r"  C_{2} \frac{dT_{2}}{dt} &= Q_{k2} - \frac{T_{2} - T_{amb}}{R_{cn2}} - \frac{R_{cd1} \left(T_{2} - T_{amb}\right)}{\Delta} "
        r"- \frac{R_{cn3} \left(T_{2} - T_{1}\right)}{\Delta} \\",
        r"  \Delta &= R_{cd1} R_{cd2} + R_{cd1} R_{cn3} + R_{cd2} R_{cn3} \\",
    ]
