"""No signal is taken apart outside its home: who needs another one asks the algebra of `laws.signal`, which loses no property."""

from __future__ import annotations

import ast

import pytest

from .source import Module

HOME = "thermid.model._laws.signal"
DOOR = "thermid.model.tree"
WRITERS = {
    "thermid.simulation._solver.problem": "writes signals as the kernel's arrays",
    "thermid.simulation._solver.engine": "counts the samples that the kernel will meet, to choose a method",
    "thermid.interop.c99": "writes signals as C",
    "thermid.interop.modelica": "writes signals as Modelica",
    "thermid.interop.octave": "writes signals as Octave",
    "thermid.interop.spice": "writes signals as SPICE",
    "thermid.interop._decks.written": "writes signals as SINDA and ESATAN",
    "thermid.interop._wired": "lists the corners of signals for both",
}
"""Who takes signals apart to write them down for another program, and why."""
FIELDS = {"times", "values", "hold", "amplitude", "phase", "period"}
KINDS = {"TableSignal", "Sine", "Signal", "Mixed", "Drawn"}
HOLDERS = {"boundaries", "loads", "commands", "schedule", "prescribed", "pressure", "wind", "flux", "downward"}
"""Fields of scenarios, gases and skies that hold signals."""


def _kinds(node: ast.AST | None) -> set[str]:
    """Names of kinds of signals in an annotation or in the second argument of `isinstance`."""
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and n.id in KINDS} if node is not None else set()


def _is_signal(node: ast.AST, known: set[str]) -> bool:
    """Whether an expression is a signal as far as its text tells: a name that is known, an entry of a table of signals, a made one."""
    if isinstance(node, ast.Name):
        return node.id in known
    if isinstance(node, ast.Attribute):
        return ast.unparse(node) in known or (node.attr in HOLDERS - {"boundaries", "loads", "commands", "schedule", "prescribed"})
    if isinstance(node, ast.Subscript):
        inner = node.value
        return isinstance(inner, ast.Attribute) and inner.attr in HOLDERS
    if isinstance(node, ast.Call):
        called = node.func.id if isinstance(node.func, ast.Name) else node.func.attr if isinstance(node.func, ast.Attribute) else ""
        of = node.func.value if isinstance(node.func, ast.Attribute) else None
        held = of is not None and called == "get" and isinstance(of, ast.Attribute) and of.attr in HOLDERS
        return held or called in {"TableSignal", "Sine", "signal", "drawn", "shifted", "scaled", "raised", "mapped", "cut"}
    return False


def _signals_in(function: ast.AST) -> set[str]:
    """Names that hold signals in a function: by annotation, by `isinstance`, by what is assigned to them."""
    known: set[str] = set()
    for node in ast.walk(function):
        if isinstance(node, ast.arg) and _kinds(node.annotation) and "ndarray" not in ast.unparse(node.annotation or node):
            plain = ast.unparse(node.annotation)  # type: ignore[arg-type]
            known |= {node.arg} if not plain.startswith(("Mapping", "dict", "Sequence", "Iterable", "tuple", "list", "Callable")) else set()
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance" and _kinds(node.args[1]):
            known.add(ast.unparse(node.args[0]))
        elif isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation) in KINDS:
            known.add(ast.unparse(node.target))
    for _ in range(3):
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and _is_signal(node.value, known):
                known |= {ast.unparse(t) for t in node.targets if isinstance(t, ast.Name)}
            if isinstance(node, ast.comprehension | ast.For) and isinstance(node.target, ast.Tuple):
                it = ast.unparse(node.iter)
                if it.endswith(".items()") and any(it.endswith(f".{h}.items()") for h in HOLDERS):
                    known.add(ast.unparse(node.target.elts[1]))
    return known


def taken_apart(module: Module) -> list[str]:
    """Lines at which a module takes a signal apart, or draws lines between samples of one by hand."""
    if not any(i.target in (HOME, DOOR) and KINDS & set(i.names) for i in module.imports()):
        return []
    out = []
    functions = [n for n in module.nodes if isinstance(n, ast.FunctionDef)]
    for function in functions:
        known = _signals_in(function)
        for node in ast.walk(function):
            if isinstance(node, ast.Attribute) and node.attr in FIELDS and _is_signal(node.value, known):
                out.append(f"{module.name}:{node.lineno}: {ast.unparse(node)}")
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.interp", "numpy.interp"):
                used = {ast.unparse(a.value) for a in node.args if isinstance(a, ast.Attribute)} | {
                    ast.unparse(a.value) for a in node.args if isinstance(a, ast.Starred)
                }
                out += [f"{module.name}:{node.lineno}: {ast.unparse(node)}" for u in used if u in known or u.startswith("weather[")]
    return sorted(set(out))


def test_no_signal_is_taken_apart_outside_its_home(modules: dict[str, Module]) -> None:
    wrong = [line for m in modules.values() if m.name != HOME and m.name not in WRITERS for line in taken_apart(m)]
    assert not wrong, "ask the algebra of thermid.model._laws.signal:\n" + "\n".join(wrong)


def test_who_may_take_signals_apart_does_so(modules: dict[str, Module]) -> None:
    names = {m.name for m in modules.values() if taken_apart(m)}
    assert set(WRITERS) <= names, f"no longer needed: {set(WRITERS) - names}"


@pytest.mark.parametrize(
    "line",
    [
        "def f(s: Signal):\n    return s.times",
        "def f(s):\n    return s.values if isinstance(s, TableSignal) else 0",
        "def f(e):\n    return e.pressure.values.min()",
        "def f(c):\n    for name, s in c.boundaries.items():\n        print(s.amplitude)",
        "def f(c, n):\n    s = c.loads[n]\n    return s.hold",
        "def f(weather, times):\n    return np.interp(times, *weather['rain'])",
        "def f(s: TableSignal, times):\n    return np.interp(times, s.times, s.values)",
    ],
)
def test_the_walk_sees_what_it_should(line: str) -> None:
    text = f"import numpy as np\nfrom {HOME} import Signal, TableSignal\n\n\n{line}\n"
    assert taken_apart(Module("thermid.somewhere", text))
