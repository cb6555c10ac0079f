"""Formulas of the pages, written as arithmetic of Python, as MathML: what is shown is what a test evaluates."""

from __future__ import annotations

import ast

__all__ = ["mathml"]

GREEK = {"lam": "&lambda;"}
GREEK |= {name: f"&{name};" for name in "alpha beta gamma epsilon eta theta kappa mu nu rho sigma tau phi omega Delta pi".split()}
SYMBOLS = {ast.Add: "+", ast.Sub: "&minus;"}
POWER = {ast.Add: 1, ast.Sub: 1, ast.Mult: 2, ast.Div: 2, ast.USub: 3, ast.Pow: 4}


def mathml(line: str) -> str:
    """Return `left = right` as a formula on a line of its own.

    Raises
    ------
    ValueError
        If it is not arithmetic on names.
    """
    sides = [_show(ast.parse(side.strip(), mode="eval").body) for side in line.split(" = ")]
    return f'<math display="block" xmlns="http://www.w3.org/1998/Math/MathML"><mrow>{"<mo>=</mo>".join(sides)}</mrow></math>'


def _show(tree: ast.expr) -> str:
    if isinstance(tree, ast.Constant):
        return _number(tree.value)
    if isinstance(tree, ast.Name):
        return _name(tree.id)
    if isinstance(tree, ast.UnaryOp):
        return f"<mrow><mo>&minus;</mo>{_inside(tree.operand, 3)}</mrow>"
    if isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name):
        return _call(tree.func.id, tree.args)
    if isinstance(tree, ast.BinOp):
        return _binary(tree)
    raise ValueError(f"{ast.unparse(tree)}: a formula is arithmetic on names")


def _binary(tree: ast.BinOp) -> str:
    if isinstance(tree.op, ast.Div):
        return f"<mfrac>{_row(tree.left)}{_row(tree.right)}</mfrac>"
    if isinstance(tree.op, ast.Pow):
        power = tree.right
        small = isinstance(power, ast.BinOp) and isinstance(power.op, ast.Div)
        shown = f"<mrow>{_show(power.left)}<mo>/</mo>{_show(power.right)}</mrow>" if small and isinstance(power, ast.BinOp) else _row(power)
        return f"<msup>{_row(tree.left, 5)}{shown}</msup>"
    level = POWER[type(tree.op)]
    left, right = _inside(tree.left, level), _inside(tree.right, level + (0 if isinstance(tree.op, ast.Add | ast.Mult) else 1))
    sign = SYMBOLS.get(type(tree.op))
    if sign is None:  # a product: a sign before a number, a thin space before a name
        sign = "&middot;" if _starts_with_number(tree.right) else ""
    between = f"<mo>{sign}</mo>" if sign else '<mspace width="0.17em"/>'
    return f"<mrow>{left}{between}{right}</mrow>"


def _starts_with_number(tree: ast.expr) -> bool:
    while isinstance(tree, ast.BinOp) and not isinstance(tree.op, ast.Div):
        tree = tree.left
    return isinstance(tree, ast.Constant)


def _inside(tree: ast.expr, level: int) -> str:
    """Return an operand, in parentheses where it binds less than what it stands in."""
    bare = isinstance(tree, ast.BinOp) and not isinstance(tree.op, ast.Div) and POWER[type(tree.op)] < level
    bare = bare or (isinstance(tree, ast.UnaryOp) and level > 1)
    return f"<mrow><mo>(</mo>{_show(tree)}<mo>)</mo></mrow>" if bare else _show(tree)


def _row(tree: ast.expr, level: int = 0) -> str:
    bare = level and isinstance(tree, ast.BinOp | ast.UnaryOp)
    return f"<mrow><mo>(</mo>{_show(tree)}<mo>)</mo></mrow>" if bare else f"<mrow>{_show(tree)}</mrow>"


def _call(name: str, arguments: list[ast.expr]) -> str:
    shown = [_show(a) for a in arguments]
    if name == "sqrt":
        # a sign that must grow around a fraction does so only where a font for mathematics is installed
        half = "<mrow><mn>1</mn><mo>/</mo><mn>2</mn></mrow>"
        grows = any(isinstance(part, ast.Div) for part in ast.walk(arguments[0]))
        return f"<msup><mrow><mo>(</mo>{shown[0]}<mo>)</mo></mrow>{half}</msup>" if grows else f"<msqrt>{shown[0]}</msqrt>"
    if name == "diff":
        return f"<mfrac><mrow><mi>d</mi>{shown[0]}</mrow><mrow><mi>d</mi>{shown[1]}</mrow></mfrac>"
    inside = "<mo>,</mo>".join(shown)
    return f"<mrow>{_name(name)}<mo>(</mo>{inside}<mo>)</mo></mrow>"


def _name(text: str) -> str:
    head, _, below = text.partition("_")
    shown = f"<mi>{GREEK.get(head, head)}</mi>"
    if head.startswith("d") and len(head) > 1 and head[1:] in ("T", "t", "p", "x"):
        shown = f"<mrow><mi>&Delta;</mi><mi>{head[1:]}</mi></mrow>"
    return f"<msub>{shown}<mi>{GREEK.get(below, below.replace('_', ' '))}</mi></msub>" if below else shown


def _number(value: object) -> str:
    mantissa, _, exponent = str(value).partition("e")
    shown = f"<mn>{mantissa}</mn>"
    return f"<mrow>{shown}<mo>&middot;</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup></mrow>" if exponent else shown
