"""Deck files: what is refused, with file, line and key path; what a deck cannot reach."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, ExpressionError, ThermidError, UnitError, code_of
from thermid.base.files import line_numbers, project_root, resolve_inside
from thermid.model._deck.modelfile import load_model, model_from_dict
from thermid.model._tree.flat import Flat
from thermid.model._tree.model import Model

Decks = Callable[..., Model]

BOX = """title = "Box"
needs = ["air"]
offers = ["case", "skin"]

[nodes]
case = { capacitance = "900 [J/K]" }

[surfaces.skin]
of = "case"
to = "air"
area = "0.05 [m^2]"
htc = "5 [W/(m^2 K)]"
"""


def using(name: str, title: str = "Main") -> str:
    return f'title = "{title}"\nneeds = ["air"]\n[submodels]\npart = {{ use = "{name}", bind = {{ air = "air" }} }}\n'


def test_a_deck_with_a_part(decks: Decks) -> None:
    model = decks(main=using("box.toml"), box=BOX)
    assert model.submodel("part").title == "Box"
    assert model.submodel("part").file == "box.toml"
    assert [c.path for c in Flat.of_model(model).conductors] == ["part.skin"]


@pytest.mark.parametrize(
    ("text", "code", "data"),
    [
        (
            BOX.replace("capacitance", "capacitanse"),
            "file.unknown-key",
            "main.toml:6, nodes.case.capacitanse: 'capacitanse'",
        ),
        (BOX.replace("htc =", "hct ="), "file.unknown-key", "main.toml:12, surfaces.skin.hct: 'hct'"),
        (BOX.replace("[nodes]", "[nods]"), "file.unknown-key", "main.toml:5"),
        (BOX.replace('title = "Box"\n', ""), "file.key-missing", "main.toml"),
        (BOX.replace('area = "0.05 [m^2]"\n', ""), "file.key-missing", "main.toml:8, surfaces.skin.area"),
        (
            BOX.replace('"5 [W/(m^2 K)]"', '{ value = "5 [W/(m^2 K)]", mn = 2 }'),
            "file.unknown-key",
            "main.toml:12, surfaces.skin.htc.mn: 'mn'",
        ),
        (
            BOX.replace('"5 [W/(m^2 K)]"', '{ coefficient = "5 [W/(m^2 K)]", exponnt = 0.25 }'),
            "file.key-missing",
            "surfaces.skin.htc.exponnt: 'exponnt'",
        ),
        (
            BOX.replace('"5 [W/(m^2 K)]"', "true"),
            "file.wrong-kind",
            "main.toml:12, surfaces.skin.htc",
        ),
        (BOX.replace('"5 [W/(m^2 K)]"', "[1, 2]"), "file.wrong-kind", "main.toml:12, surfaces.skin.htc"),
        (BOX.replace('"5 [W/(m^2 K)]"', "nan"), "value.wrong-kind", "main.toml:12, surfaces.skin.htc: nan"),
        (BOX + 'colour = "red"\n', "file.unknown-key", "main.toml:13, surfaces.skin.colour: 'colour'"),
        ('box = "purple"\n' + BOX, "file.wrong-value", "'white', 'light grey', 'dark grey' or 'black'"),
        (
            BOX + '[conductors]\nc = { kind = "conducton", between = ["case", "air"] }\n',
            "file.not-one-of",
            "main.toml:14, conductors.c.kind: 'conducton'",
        ),
        (
            BOX + '[conductors]\nc = { kind = "conduction", between = ["case"] }\n',
            "file.key-missing",
            "main.toml:14, conductors.c.between",
        ),
        (
            BOX + '[loads]\nq = { into = "case", power = "1 [W]", periodic = { period = "9 [s]", dty = 1 } }\n',
            "file.key-missing",
            "loads.q.periodic.dty: 'dty'",
        ),
    ],
)
def test_grammar(decks: Decks, text: str, code: str, data: str) -> None:
    with pytest.raises(DeckError) as caught:
        decks(main=text)
    assert code_of(str(caught.value)) == code
    assert data in str(caught.value)
    assert caught.value.where.startswith("main.toml")


def test_every_fault_is_listed(decks: Decks) -> None:
    text = BOX.replace("capacitance", "capacity").replace("htc =", "hct =").replace('title = "Box"\n', "tilte = 1\n")
    with pytest.raises(DeckError) as caught:
        decks(main=text)
    shown = str(caught.value).splitlines()
    assert sorted(line.strip().split(": ")[0] for line in shown) == [
        "main.toml, title",
        "main.toml:1, tilte",
        "main.toml:12, surfaces.skin.hct",
        "main.toml:6, nodes.case.capacity",
    ]


def test_a_title_with_a_colon_does_not_confuse_the_place() -> None:
    with pytest.raises(DeckError) as caught:
        model_from_dict({"title": "m: PrE", "nodes": {"a": {"x": 1}}})
    assert caught.value.where == "m: PrE, nodes.a.x"


def test_a_deck_without_file_or_title_has_a_place() -> None:
    with raises_code("file.key-missing", DeckError):
        model_from_dict({})


def test_elements_point_at_their_line(decks: Decks) -> None:
    with raises_code("expression.not-arithmetic", ExpressionError, match=r"main\.toml:11.*surfaces\.skin\.area.*'0\.05 m\^2'"):
        decks(main=BOX.replace("0.05 [m^2]", "0.05 m^2"))
    with raises_code("unit.wrong-dimension", ThermidError, match=r"main\.toml:6.*nodes\.case\.capacitance.*'\[K/J\]'"):
        Flat.of_model(decks(main=BOX.replace("[J/K]", "[K/J]")))


def test_duplicate_names(decks: Decks) -> None:
    with raises_code("file.not-valid", DeckError, match=r"main\.toml"):
        decks(main=BOX.replace("[surfaces", 'case = { capacitance = "1 [J/K]" }\n[surfaces'))
    with raises_code("name.taken", DeckError, match=r"main\.toml:8.*surfaces\.skin.*'skin'"):
        decks(main=BOX + "[parameters]\nskin = 1\n")


# files -------------------------------------------------------------------------------------------------------------------------------


def test_missing_file_with_the_nearest_name(tmp_path: Path) -> None:
    (tmp_path / "EleGFO.toml").write_text(BOX, encoding="utf-8")
    with raises_code("file.not-found", DeckError, match=r"'EleGOF\.toml'.*'EleGFO\.toml'"):
        load_model(tmp_path / "EleGOF.toml")
    with raises_code("file.not-found", DeckError):
        load_model(tmp_path / "nowhere" / "x.toml")
    with raises_code("file.not-found", DeckError):
        load_model(tmp_path)


def test_missing_part_with_the_nearest_name(decks: Decks) -> None:
    with raises_code("file.not-found", DeckError, match=r"'bux\.toml'.*'box\.toml'"):
        decks(main=using("bux.toml"), box=BOX)


def test_not_toml(decks: Decks) -> None:
    with raises_code("file.not-valid", DeckError, match=r"main\.toml.*'='"):
        decks(main='title = "x"\nthis is prose\n')


def test_not_utf8(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_bytes('title = "caf\xe9"'.encode("latin-1"))
    with raises_code("file.not-text", DeckError, match=r"x\.toml.*8"):
        load_model(tmp_path / "x.toml")


def test_byte_order_mark_is_fine(tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(BOX, encoding="utf-8-sig")
    assert load_model(tmp_path / "x.toml").title == "Box"


def test_huge_file(tmp_path: Path) -> None:
    with (tmp_path / "x.toml").open("wb") as file:
        file.truncate(5_000_000)
    with raises_code("cap.exceeded", DeckError, match=r"x\.toml.*5\.0"):
        load_model(tmp_path / "x.toml")


def test_a_deck_that_uses_itself(decks: Decks) -> None:
    with raises_code("model.self-reference", DeckError, match=r"main\.toml.*main\.toml.*main\.toml"):
        decks(main=using("main.toml"))
    with raises_code("model.self-reference", DeckError, match=r"main\.toml.*other\.toml.*main\.toml"):
        decks(main=using("other.toml"), other=using("main.toml", "Other"))


@pytest.mark.parametrize("name", ["../secret.toml", "a/../../secret.toml", "/etc/hosts", "//etc/hosts"])
def test_a_part_outside_the_project(decks: Decks, tmp_path: Path, name: str) -> None:
    (tmp_path.parent / "secret.toml").write_text(BOX, encoding="utf-8")
    with raises_code("file.outside-project", DeckError, match=rf"^main\.toml:4, submodels\.part\.use: '{re.escape(name)}' .*thermid\.toml"):
        decks(main=using(name))


def test_a_symbolic_link_out_of_the_project(decks: Decks, tmp_path: Path) -> None:
    outside = tmp_path.parent / "outside.toml"
    outside.write_text(BOX, encoding="utf-8")
    os.symlink(outside, tmp_path / "link.toml")
    with raises_code("file.outside-project", DeckError, match=r"'link\.toml'"):
        decks(main=using("link.toml"))


def test_a_name_with_a_null_byte(decks: Decks) -> None:
    with raises_code("file.not-found", DeckError):
        decks(main=using("box\\u0000.toml"))


def test_a_folder_below_the_root_may_use_what_lies_above_it(tmp_path: Path) -> None:
    (tmp_path / "thermid.toml").write_text("", encoding="utf-8")
    (tmp_path / "box.toml").write_text(BOX, encoding="utf-8")
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep/main.toml").write_text(using("../box.toml"), encoding="utf-8")
    assert load_model(tmp_path / "deep/main.toml").submodel("part").title == "Box"
    assert project_root(tmp_path / "deep") == tmp_path.resolve()


def test_other_roots(tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "project/thermid.toml").write_text("", encoding="utf-8")
    found = resolve_inside(tmp_path / "project", "../data/log.csv", "here", (tmp_path / "data",))
    assert found == (tmp_path / "data/log.csv").resolve()
    with raises_code("file.outside-project", DeckError, match=r"'\.\./data/log\.csv'"):
        resolve_inside(tmp_path / "project", "../data/log.csv", "here")


@pytest.mark.parametrize(
    "attack",
    [
        "__import__('os').system('touch pwned')",
        "().__class__.__mro__",
        "case.__class__",
        "open('pwned', 'w')",
        "exec(open('x').read())",
        "(lambda: 1)()",
        "1 [__import__('os').system('touch pwned')]",
        "1 [9^9^9^9^9]",
        "9**9**9**9",
        "1e99999999",
        "{case}",
        "$(touch pwned)",
        "`touch pwned`",
    ],
)
def test_a_deck_runs_no_code(decks: Decks, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attack: str) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ThermidError) as caught:
        Flat.of_model(decks(main=BOX.replace("5 [W/(m^2 K)]", attack)))
    assert caught.value.where.startswith("main.toml:12, surfaces.skin.htc")
    assert not (tmp_path / "pwned").exists()


def test_a_file_needs_a_deck_around_it() -> None:
    with raises_code("value.wrong-kind", DeckError, match=r"submodels\.a\.use"):
        model_from_dict({"title": "Main", "submodels": {"a": {"use": "box.toml"}}})


def test_line_numbers() -> None:
    text = '[a]\n# c = 1\n"x.y" = 1\nb.c = 2\n\n[[stages]]\nname = "s"\n[[stages]]\nname = "t"\n[d."e.f"]\ng = 1\n'
    lines = line_numbers(text)
    assert (lines["a"], lines["a.x.y"], lines["a.b.c"]) == (1, 3, 4)
    assert (lines["stages.0.name"], lines["stages.1.name"], lines["d.e.f.g"]) == (7, 9, 11)
    assert "a.c" not in lines


def test_values_that_cannot_be_read_are_listed_with_the_other_faults(tmp_path: Path) -> None:
    deck = tmp_path / "plate.toml"
    deck.write_text(
        'title = "plate"\nneeds = ["air"]\n\n[nodes.plate]\ncapacitance = "9 [quux]"\n\n'
        '[conductors.film]\nkind = "convection"\nbetween = ["plate", "air"]\narea = "1 [m^2]"\n'
        'htc = { value = "8 [W/(m^2 K)]", min = "9 [W/(m^2 K)]", max = "7 [W/(m^2 K)]" }\nare = 1\n'
    )
    with pytest.raises(DeckError) as caught:
        load_model(deck)
    lines = str(caught.value).split("\n  ")
    assert [line.partition(":")[2].partition(",")[0] for line in lines] == ["5", "11", "12"]
    assert "quux" in lines[0]
    assert "9 [W/(m^2 K)]" in lines[1]
    assert all(part in lines[2] for part in ("'are'", "'area'?"))
    deck.write_text('title = "plate"\n[nodes.plate]\ncapacitance = "9 [quux]"\n')
    with raises_code("unit.unknown", UnitError, match=r"plate\.toml:3.*nodes\.plate\.capacitance"):
        load_model(deck)
