"""What the figures of the house count, on made-up files: each counts what it should, and nothing else."""

from __future__ import annotations

import ast
import runpy
from types import SimpleNamespace

import pytest

from . import decisive, doors, public, rewording, size, warm, words
from .source import ROOT, Module, is_below_init, is_inner, room_of

additions = SimpleNamespace(**runpy.run_path(str(ROOT / "scripts" / "additions.py")))


def house(**texts: str) -> dict[str, Module]:
    """Modules by their name below `thermid`, two underscores for a dot; one that has others below it is a package."""
    names = {name.replace("__", "."): text for name, text in texts.items()}
    packages = {name for name in names if any(other.startswith(f"{name}.") for other in names)}
    return {f"thermid.{name}": Module(f"thermid.{name}", text, package=name in packages) for name, text in names.items()}


@pytest.mark.parametrize(
    ("name", "inner", "below"),
    [
        ("thermid.model", False, False),
        ("thermid.model.deck", False, True),
        ("thermid.model._laws.law", True, True),
        ("thermid.model._parts._kinds", True, True),
        ("thermid._kernel", False, False),
        ("thermid", False, False),
    ],
)
def test_inner_files(name: str, inner: bool, below: bool) -> None:
    assert is_inner(name) is inner
    assert is_below_init(name) is below


THREE = house(
    base="",
    base__units="def si(): ...",
    model="",
    model__deck="from thermid.base import units\nx = units.si() + units.other",
    model___laws__law="from thermid.base.units import si",
    fit="NAME = 'thermid.model.deck.Deck'",
    fit__fit="if TYPE_CHECKING:\n    from ..model._laws.law import Law\ndef f():\n    import thermid.model.deck as d\n    d.load()",
)


class TestDoors:
    def test_arrows_are_pairs_of_files(self) -> None:
        arrows = doors.arrows_between_files(THREE)
        assert {(a.source, a.target) for a in arrows} == {
            ("thermid.model.deck", "thermid.base.units"),
            ("thermid.model._laws.law", "thermid.base.units"),
            ("thermid.fit", "thermid.model.deck"),
            ("thermid.fit.fit", "thermid.model._laws.law"),
            ("thermid.fit.fit", "thermid.model.deck"),
        }

    def test_map(self) -> None:
        figures = doors.map_of_rooms(THREE, doors.arrows_between_files(THREE))
        assert list(figures.values()) == [3, 3, 2, 5]

    def test_rooms_in_a_circle_are_one_floor(self) -> None:
        assert doors.floors({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == 3

    def test_imports_of_inner_files(self) -> None:
        arrows = doors.arrows_between_files(THREE)
        assert doors.inner_imports(arrows) == {"fit": 1}
        assert doors.inner_imports(arrows, is_below_init) == {"model": 2, "fit": 3}

    def test_names_used_outside_count_attributes_and_texts(self) -> None:
        names = doors.names_used_outside(doors.arrows_between_files(THREE))
        assert {name for _, name in names["base"]} == {"si", "other"}
        assert {name for _, name in names["model"]} == {"Deck", "Law", "load"}
        assert set(names) == {"base", "model"}

    def test_what_stands_outside(self) -> None:
        modules = house(model="from thermid import _kernel\nNAME = 'thermid._kernel'", fit="import thermid as td\ntd.calibrate()")
        modules["thermid"] = Module("thermid", "from thermid.model import x", package=True)
        assert doors.arrows_between_files(modules) == []

    def test_stubs_are_no_arrows(self) -> None:
        modules = {"thermid.model": Module("thermid.model", "", True, "from thermid.fit import x"), **house(fit="")}
        assert doors.arrows_between_files(modules) == []


class TestSize:
    def test_statements_and_tokens(self) -> None:
        modules = house(fit__a='"""Doc."""\n# note\nX = 1\n"""What X is."""\ndef f():\n    """Doc."""\n    return X\n')
        assert size.statements(modules) == {"fit": 3}
        # X = 1, def f ( ) :, return X and three texts
        assert size.tokens(modules) == {"fit": 3 + 5 + 2 + 3}

    def test_functions_with_one_use(self) -> None:
        used = "\nx = _once() + _twice() + _twice() + self._method + shared() + shown() + _long()"
        text = (
            "def _once():\n    return 1\ndef _twice(): ...\ndef _never(): ...\ndef shown(): ...\ndef by_text(): ...\n"
            "class A:\n    def _method(self): ...\n    def __len__(self): ...\n    def shared(self): ...\n"
            "def shared(): ...\nNAME = 'cli.by_text'\nby_text()\ndef _long():\n" + size.SMALL * "    x = 1\n" + "    return x" + used
        )
        assert size.functions_with_one_use(house(fit__a=text)) == {"fit": 2}  # _once and _method: the door's `shown` may have one use
        assert size.functions_with_one_use(house(fit___a=text)) == {"fit": 3}


class TestWords:
    def test_names_by_a_word_of_the_dialect_alone(self) -> None:
        modules = house(fit__a="def _told(): ...\nclass Kept: ...\ndef told_values(): ...\nMOST, FAR_OFF = 1, 2\ndef f():\n    _SURE = 3")
        assert words.dialect_functions(modules) == {"fit": 2}
        assert words.dialect_constants(modules) == {"fit": 2}

    def test_functions_with_dialect_variables(self) -> None:
        text = (
            "def a():\n    found = 1\ndef b(given): ...\nclass C:\n    def c(self):\n        def inner(known): ...\n"
            "def d(x):\n    return found, x.kept\ndef e():\n    return [each for each in ()]\nseen = 1"
        )
        assert words.functions_with_dialect_variables(house(fit__a=text)) == {"fit": 4}

    @pytest.mark.parametrize(
        ("text", "times"),
        [
            ("assert 'the fit did not end so well' in text", 1),
            ("assert text == f'{x}: the fit did not end so well'", 1),
            ("with raises(E, match='the fit did not end so well'): ...", 1),
            ("assert 'short text' in text", 0),
            ("assert 'fit.capacitance-and-a-very-long-path' in text", 0),
            ("assert x, g('a', 'a message of the test itself for its reader')", 0),
            ("f('the fit did not end so well')", 0),
        ],
    )
    def test_quoted_prose(self, text: str, times: int) -> None:
        assert words.quoted_prose({"unit/fit/test_a.py": text}) == ({"unit/fit": times} if times else {})
        assert words.quoted_prose({"docs/test_messages.py": text}) == {}


class TestDecisive:
    TEXT = (
        "LIMIT = 0.3\nROWS = {'a': (2, 4.5)}\n"
        "def f(x, least=1, most=7):\n"
        "    if x < 3 and x is not None:\n        return a[4] + round(x, 2) + x**2 - 1 + 1e-9\n"
        "    raise Error(f'{x:.3f} of {12}, {x > 5!r}')\n"
    )

    def test_numbers_and_comparisons(self) -> None:
        every = decisive.sites(Module("thermid.fit.a", self.TEXT))
        assert [(s.owner, s.text) for s in every if s.number] == [("LIMIT", "0.3"), ("ROWS", "2"), ("ROWS", "4.5"), ("f", "7"), ("f", "3")]
        assert [s.text for s in every if not s.number] == ["x < 3", "x is not None"]

    def test_published_numbers_are_apart(self) -> None:
        modules = house(fit__a=self.TEXT, physics__a=self.TEXT, _units_table=self.TEXT, base___units_table=self.TEXT)
        assert decisive.numbers_that_decide(modules) == {"fit": 5}

    def test_a_place_is_told_by_what_it_is_and_not_by_where(self) -> None:
        first, second = (decisive.sites(Module("thermid.fit.a", text))[0] for text in ("X = 2", "# moved\n\nX = 2"))
        assert (first.owner, first.text, first.nth) == (second.owner, second.text, second.nth)


class TestDrawing:
    @pytest.mark.parametrize(
        ("text", "changed"),
        [("X = 3", "X = 4"), ("X = 20", "X = 24"), ("X = -0.5", "X = -0.6"), ("X = 1e-3", "X = 0.0012")],
    )
    def test_a_number_moves_by_a_fifth_and_at_least_by_one(self, text: str, changed: str) -> None:
        (site,) = decisive.sites(Module("thermid.fit.a", text))
        assert site.applied(text) == changed

    def test_a_comparison_is_negated_where_it_stands(self) -> None:
        text = "def f(x):\n    é = (0 <\n        x\n        < g(x)) or x in (7,)\n    return é\n"
        first, second, _ = decisive.sites(Module("thermid.fit.a", text))
        space: dict = {"g": lambda x: 2 * x}
        exec(first.applied(text), space)
        assert (space["f"](1), space["f"](-1)) == (False, True)
        exec(second.applied(text), space)
        assert (space["f"](-1), space["f"](7)) == (True, True)

    def test_the_seed_and_what_things_are_make_the_order(self) -> None:
        text = "\n".join(f"A{k} = {k + 0.5} if x < {k + 2} else y" for k in range(20))
        moved = "import numpy\n\n" + "\n".join(reversed(text.split("\n")))

        def order(text: str, seed: int) -> list[tuple[str, str]]:
            return [(site.owner, site.text) for site in decisive.in_order(house(fit__a=text).values(), seed)]

        assert order(text, 1) == order(moved, 1)
        assert order(text, 1) != order(text, 2)
        assert len(order(text, 1)) == 60

    def test_a_draw_takes_half_of_each_kind_and_no_table_of_units(self) -> None:
        modules = house(fit__a="A = 1 < 2 < 3", model__b="B = 4\nC = x < y\nD = 7 == z", _units_table="E = 5")
        kinds = [site.number for site in decisive.in_order(modules.values(), 1)]
        assert kinds == [True, False, True, False, True, False, True, True]
        assert all("units" not in site.module for site in decisive.in_order(modules.values(), 1))

    def test_what_is_drawn_can_be_changed(self, modules: dict[str, Module]) -> None:
        """Every room, both kinds: the text is what the tree says, and the mutant is Python."""
        sites = decisive.in_order(modules.values(), 1)
        assert {room_of(site.module) for site in sites} >= {"fit", "model", "physics", "reporting"}
        for site in sites[:20]:
            mutant = site.applied(modules[site.module].text)
            assert ast.dump(ast.parse(mutant)) != ast.dump(modules[site.module].tree)


class TestRewording:
    @pytest.mark.parametrize(
        ("text", "other"),
        [
            ("the mass 'case' of 12.5 kg is colder than ambient.", "the ssam 'case' of 12.5 kg is redloc naht tneibma."),
            (
                "set film.htc or {place}, `fit` and [K] of https://a.b/fit.md",
                "set film.htc or {place}, `fit` and [K] of https://a.b/fit.md",
            ),
            ("check: the deck's mass of 'case' is large", "check: the kced's ssam of 'case' is egral"),
            ("give it noise = '0.1 [K]'; the rest follows", "evig it noise = '0.1 [K]'; the tser swollof"),
        ],
    )
    def test_words_are_reversed_names_and_numbers_stay(self, text: str, other: str) -> None:
        assert rewording.reworded(text) == other

    def test_texts_of_a_module(self) -> None:
        text = (
            'def f(x):\n    """The words of a docstring stay as they are."""\n'
            "    option('--x', help='the words of a help text stay')\n    key = 'one key.path'\n"
            "    kinds = 'open loss fault overrange'.split()\n    line = 'static const double loads[]'\n"
            "    law = 'share of power * speed / rated'\n"
            "    ratio = 'size*flow*(length - other)/width'\n    example = 'thermid calibrate box.toml --values best.toml'\n"
            "    program = 'from package import serve; serve()'\n    start = 'import sys; from package import serve; serve(1)'\n"
            "    pattern = r'the (?:words|texts) of a pattern'\n"
            "    other = 'one more (motors?|engines?) of the pattern'\n    raise E(f'the node {x!r} has no {x:.3f} mass at all')\n"
            "    raise E(f'give it by `thermid look {x} --cut` with this part')\n"
        )
        same, changed = text.split("    raise")[0], ast.unparse(ast.parse(rewording.otherwise(text)))
        assert changed.startswith(ast.unparse(ast.parse(same)))
        assert "edon {x!r} has no" in changed
        assert "look {x} --cut` htiw" in changed


class TestPublic:
    def test_fields_are_counted_with_those_of_records_that_no_other_has(self) -> None:
        text = (
            "@dataclass\nclass Base:\n    a: int\n@dataclass(frozen=True)\nclass Part:\n    b: int\n    c: int\n"
            "@dataclass\nclass Shared:\n    d: int\n    e: int\nclass Plain:\n    x: int\n"
            "@dataclass\nclass Result(Base):\n    part: Part | None\n    shared: Shared\n"
            "    rows: tuple[Part, ...]\n    k: ClassVar[int] = 1\n"
            "@dataclass\nclass Other:\n    shared: Shared\n"
        )
        records = public.record_fields(house(fit__a=text))
        assert list(records["Result"]) == ["a", "part", "shared", "rows"]
        assert "Plain" not in records
        assert public.nested_fields(records, "Result") == 5

    def test_parameters_of_a_command(self) -> None:
        modules = house(app__cli__watch="def watch(log, channel=[], *, once=False): ...", fit__a="def watch(x): ...")
        assert public.parameters(modules, "watch") == [3]


def test_a_walk_counts_lines_functions_and_crossings(monkeypatch: pytest.MonkeyPatch) -> None:
    files = {
        "/thermid/fit/a.py": "def outer():\n    if False:\n        pass\n    return [inner() for _ in (1, 2)]\n",
        "/elsewhere.py": "def inner():\n    return deep()\n",
        "/thermid/model/b.py": "def deep():\n    return (lambda: 1)()\n",
    }
    space: dict = {}
    for name, text in files.items():
        exec(compile(text, name, "exec"), space)
    monkeypatch.setattr(warm, "PACKAGE", "/thermid/")
    assert warm.walk(space["outer"]) == warm.Walk(files=2, functions=2, lines=3, crossings=2)


class TestAdditions:
    def test_every_row_is_there_and_no_statement_counts_twice(self, modules: dict[str, Module]) -> None:
        rows = additions.rows()
        assert all(additions.statements_of(row, modules) > 0 for row in rows)
        whole = [row["module"] for row in rows if "names" not in row]
        parts = [f"{row['module']}.{name}" for row in rows for name in row.get("names", ())]
        places = [f"{place}." for place in whole + parts]
        assert not [(a, b) for a in places for k, b in enumerate(places) if b.startswith(a) and places.index(a) != k]

    def test_a_row_counts_its_names_less_what_they_replace(self) -> None:
        modules = house(fit__a="X = 1\nclass A:\n    '''Doc.'''\n    def f(self):\n        return 1\ndef g():\n    return 2")
        assert additions.statements_of({"module": "fit.a"}, modules) == 6
        assert additions.statements_of({"module": "fit", "replaces": 2}, modules) == 4
        assert additions.statements_of({"module": "fit.a", "names": ["A.f", "g"]}, modules) == 4
        with pytest.raises(KeyError):
            additions.statements_of({"module": "fit.a", "names": ["h"]}, modules)
        with pytest.raises(KeyError):
            additions.statements_of({"module": "fit.b"}, modules)
