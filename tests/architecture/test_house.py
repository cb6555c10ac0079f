"""Small rooms, no circle of any sort, one class name for one thing: what offends is listed, all else has a budget, and both only shrink."""

from __future__ import annotations

from pathlib import Path

import pytest

from .house import BUDGETS, CROWD, GUARDS, against_the_list, listed, lowered, over_budget, shrunk
from .size import SCREEN
from .source import Module


def package(**texts: str) -> dict[str, Module]:
    """Modules of one made-up room, by name."""
    return {f"thermid.model.{name}": Module(f"thermid.model.{name}", text) for name, text in texts.items()}


ROOT = Path(__file__).parents[2]
KERNEL = ROOT / "src" / "kernel"
ONE = "from thermid.model.two import two"
CROWDED = {f"f{k}": "" for k in range(CROWD + 1)}
PLANTED = [
    ("circles", {"one": ONE, "two": "from thermid.model.one import one"}, "model.one model.two", 1),
    ("circles", {"one": ONE, "two": "def f():\n    from .one import one"}, "model.one model.two", 1),
    ("circles", {"one": ONE, "two": "if TYPE_CHECKING:\n    from .one import one"}, "model.one model.two", 1),
    ("circles", {"one": ONE, "two": "NAME = 'thermid.model.one.One'"}, "model.one model.two", 1),
    ("circles", {"one": ONE, "two": "PARTS = {'key': ('thermid.model', 'one', 'f')}"}, "model.one model.two", 1),
    (
        "circles",
        {"one": ONE, "two": "NAMES = ['one.f']\ng = lambda name: import_module(f'thermid.model.{name}')"},
        "model.one model.two",
        1,
    ),
    ("imports_in_functions", {"one": "def f():\n    import thermid.model.two\n    import numpy", "two": ""}, "model.one", 1),
    ("imports_in_functions", {"one": f"class A:\n    def f(self):\n        {ONE}", "two": ""}, "model.one", 1),
    ("one_importer", {"one": ONE, "two": ""}, "model.two", 1),
    ("doubled_classes", {"one": "class Step: ...", "two": "def f():\n    class Step: ..."}, "Step", 2),
    ("crowded_packages", CROWDED, "model", CROWD + 1),
    ("without_docstring", {"_one": "class A:\n    'Doc.'\n    def f(self):\n        return 1"}, "model._one.A.f", 1),
    ("long_functions", {"one": "def f():\n" + SCREEN * "    x = 1\n"}, "model.one.f", SCREEN + 1),
    ("constants_of_several_numbers", {"one": "A, B = 1.0, 2", "two": "B: Final = -3.0"}, "B", 2),
]
HARMLESS = [
    ("circles", {"one": ONE, "two": "from thermid.model.three import x", "three": ""}),
    ("circles", {"one": ONE, "two": "NAME = 'thermid.model.three'\nOTHER = 'one.f'"}),
    ("imports_in_functions", {"one": f"{ONE}\ndef f():\n    import numpy", "two": ""}),
    ("one_importer", {"one": ONE, "two": "", "three": ONE}),
    ("doubled_classes", {"one": "class Step: ...", "two": "from thermid.model.one import Step"}),
    ("crowded_packages", dict(list(CROWDED.items())[1:])),
    ("without_docstring", {"_one": "def _f():\n    return 1\n@overload\ndef g(): ...\nclass _A:\n    def f(self):\n        return 1"}),
    ("long_functions", {"one": "def f():\n" + (SCREEN - 1) * "    x = 1\n"}),
    ("constants_of_several_numbers", {"one": "A = 1.0", "two": "A = 1\nB = 2\nC = f(3)", "three": "B = 'x'\nC = 4"}),
]


@pytest.mark.parametrize("guard", GUARDS)
def test_what_offends_is_on_the_list_and_nothing_else(modules: dict[str, Module], guard: str) -> None:
    problems = against_the_list(GUARDS[guard](modules), listed()[guard])
    assert not problems, "\n" + "\n".join(problems)


def test_the_list_has_a_table_for_every_guard() -> None:
    assert set(listed()) == set(GUARDS)


@pytest.mark.parametrize(("guard", "texts", "name", "times"), PLANTED)
def test_a_planted_offender_is_seen(modules: dict[str, Module], guard: str, texts: dict[str, str], name: str, times: int) -> None:
    alone = GUARDS[guard](package(**texts))
    assert alone == {name: times}
    assert against_the_list(alone, {}) == [f"new: {name} ({times}; allowed 0)"]


@pytest.mark.parametrize(("guard", "texts"), HARMLESS)
def test_the_harmless_is_let_pass(guard: str, texts: dict[str, str]) -> None:
    assert GUARDS[guard](package(**texts)) == {}


@pytest.mark.parametrize("guard", GUARDS)
def test_a_listed_offender_that_was_mended_is_seen(modules: dict[str, Module], guard: str) -> None:
    today = GUARDS[guard](modules)
    assert any("shrink the list: model.mended (1 listed, 0 today)" in line for line in against_the_list(today, {"model.mended": 1}))


def test_shrinking_never_adds() -> None:
    assert shrunk({"a": 1, "b": 3, "c": 1}, {"a": 2, "b": 2, "d": 1}) == {"a": 1, "b": 2}
    assert shrunk({"a b": 1, "x y": 1}, {"a b c": 1}) == {"a b": 1}


def test_the_kernel_stands_in_folders_by_concept() -> None:
    folders = {folder.name: len(list(folder.iterdir())) for folder in KERNEL.iterdir()}
    assert folders["network"] >= 5
    assert {name: n for name, n in folders.items() if n > CROWD} == {}


@pytest.mark.parametrize("table", listed(BUDGETS))
def test_there_is_no_more_than_its_budget(there_is: dict[str, dict[str, int]], table: str) -> None:
    problems = over_budget({row: n for row, n in there_is[table].items() if not row.startswith("crossings")}, listed(BUDGETS)[table])
    assert not problems, "less, or a decision that raises it in budgets.toml:\n" + "\n".join(problems)


def test_every_amount_has_a_budget(there_is: dict[str, dict[str, int]]) -> None:
    assert set(listed(BUDGETS)) == set(there_is)


def test_more_than_a_budget_and_what_has_none_are_seen() -> None:
    allowed = {"model": 5, "fit": 3, "gone": 2}
    assert over_budget({"model": 5, "fit": 2}, allowed) == []
    assert [line.partition(":")[0] for line in over_budget({"model": 6, "kitchen": 1, "fit": 3}, allowed)] == ["model", "kitchen"]
    assert lowered({"model": 6, "fit": 2, "kitchen": 1}, allowed) == {"model": 5, "fit": 2}
