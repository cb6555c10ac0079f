"""Decks edited by commands: each step is a valid deck, comments stay, one value is one line, and undo gives the bytes that were there."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, ThermidError
from thermid.base.files import command as as_command, was_read
from thermid.model.tree import DeckDocument, Edit, load_model

BOX = Path(__file__).parents[3] / "examples" / "box" / "box.toml"


def deck(rng: random.Random) -> bytes:
    """Return a random deck: comments, blank lines, dotted keys, inline tables, tables of their own, with or without CRLF and BOM."""
    count, lines = rng.randint(2, 7), ["# a deck", f'title = "unit {rng.randint(0, 99)}"  # its name', 'needs = ["air"]', ""]
    lines += ["[parameters]", 'k = "5 [W/K]" # known', ""] if rng.random() < 0.7 else []
    lines.append("[nodes]   # masses")
    for n in range(count):
        comment = rng.choice(["", "  # weighed", "\t# see drawing"])
        value = f"{rng.uniform(1, 900):.2f} [J/K]"
        lines.append(
            rng.choice(
                [
                    f'n{n} = {{ capacitance = "{value}" }}{comment}',
                    f"n{n}.capacitance = '{value}'{comment}",
                    f'"n{n}" = {{capacitance={{ value="{value}", min=0.1, source="datasheet" }}}}{comment}',
                ]
            )
        )
        lines += [rng.choice(["", "# ---"])] if rng.random() < 0.3 else []
    for n in range(1, count):
        ends, g = f'["n{n}", "n{rng.randrange(n)}"]', f'"{rng.uniform(0.1, 5):.3f} [W/K]"'
        if rng.random() < 0.5:
            lines += ["", f"[conductors.c{n}]", 'kind = "conduction"', f"between = {ends} # ends", f"conductance = {g}"]
        else:
            lines += ["", f"[conductors.c{n}] # joint", f'conductance={g}\nbetween = {ends}\nkind="conduction"']
    lines += ["", "[loads]", 'heat = { into = "n0", power = "3 [W]" } # measured', "", "# the end"]
    text = "\n".join(lines) + rng.choice(["", "\n", "\n\n"])
    text = text.replace("\n", "\r\n") if rng.random() < 0.4 else text
    return (b"\xef\xbb\xbf" if rng.random() < 0.3 else b"") + text.encode()


def command(rng: random.Random, document: DeckDocument, k: int) -> Edit:
    """Return a random command; some of them make no valid deck."""
    content = document.content
    node, link = rng.choice(list(content["nodes"])), rng.choice(list(content.get("conductors") or ["c1"]))
    value = f"{rng.uniform(1, 900):.3f} [J/K]"
    nested = isinstance(content["nodes"][node]["capacitance"], dict)
    return rng.choice(
        [
            Edit(("nodes", node, "capacitance", *(["value"] if nested else [])), value),
            Edit(("conductors", link, "conductance"), f"{rng.uniform(0.1, 9):.2f} [W/K]"),
            Edit(("title",), f"another {k}"),
            Edit(("nodes", f"new{k}"), {"capacitance": value}),
            Edit(("conductors", f"new{k}"), {"kind": "conduction", "between": [node, "air"], "conductance": "1 [W/K]"}),
            Edit(("loads", f"new{k}"), {"into": node, "power": f"{k} [W]"}),
            Edit(("parameters", f"p{k}"), "4 [W]"),
            Edit(("conductors", link, "note"), "a word"),
            Edit(("conductors", link)),
            Edit(("nodes", node)),
            Edit(("loads", rng.choice(list(content.get("loads") or ["heat"])))),
        ]
    )


@pytest.mark.parametrize("decks", [2, pytest.param(200, marks=pytest.mark.campaign)])
def test_forty_edits_and_their_undoing_give_the_same_bytes(tmp_path: Path, decks: int) -> None:
    file, done, refused = tmp_path / "deck.toml", 0, 0
    for seed in range(decks):
        rng = random.Random(seed)
        file.write_bytes(deck(rng))
        first = document = DeckDocument.opened(file)
        states = [first.text]
        for k in range(40):
            try:
                document = document.edited(command(rng, document, k))
            except ThermidError:
                refused += 1
                continue
            done += 1
            states.append(document.text)
            file.write_bytes(document.text.encode())
            load_model(file)  # every step is a deck that reads
        last = document
        for state in states[::-1]:
            assert document.text == state
            document = document.undo()
        assert document.text.encode() == first.text.encode()
        for _ in states:
            document = document.redo()
        assert document.text == last.text
    print(f"{done} edits done, {refused} refused")
    assert done > 20 * decks


@pytest.mark.parametrize("decks", [20, pytest.param(200, marks=pytest.mark.campaign)])
def test_one_value_edited_changes_one_line(tmp_path: Path, decks: int) -> None:
    file = tmp_path / "deck.toml"
    for seed in range(decks):
        file.write_bytes(deck(random.Random(seed)))
        before = DeckDocument.opened(file)
        after = before.with_values(
            {
                "n0.capacitance": "77 [J/K]",
            },
            "",
        )
        changed = [(a, b) for a, b in zip(before.text.split("\n"), after.text.split("\n"), strict=True) if a != b]
        assert len(changed) == 1
        assert "77 [J/K]" in changed[0][1]
        assert changed[0][0].partition("#")[1:] == changed[0][1].partition("#")[1:]  # with its comment, and its end of line


@pytest.mark.parametrize(
    ("known", "kept"),
    [
        ('spread = "5 [%]", min = 2, max = 9', {"min": 2, "max": 9}),
        ('min = 2, max = 9, spread = "range"', {}),
        ('min = 2, max = 9, source = "datasheet"', {}),
    ],
)
def test_a_spread_and_a_range_go_with_the_value_that_had_them(tmp_path: Path, known: str, kept: dict[str, int]) -> None:
    """The deck said of a fitted value that it has the spread of the old one, and refused one outside the old one's range."""
    file = tmp_path / "deck.toml"
    file.write_text(f'title = "One"\n\n[nodes]\nn = {{ capacitance = {{ value = "5 [J/K]", {known} }} }}\n', encoding="utf-8")
    value = "7 [J/K]" if kept else "11 [J/K]"
    after = DeckDocument.opened(file).with_values({"n.capacitance": value}, "fitted")
    assert after.content["nodes"]["n"]["capacitance"] == {"value": value, **kept, "source": "derived", "basis": "fitted"}


def test_values_go_to_their_places_with_their_basis(tmp_path: Path) -> None:
    file = tmp_path / "deck.toml"
    file.write_bytes(deck(random.Random(11)))
    before = DeckDocument.opened(file)
    nested = next(n for n, x in before.content["nodes"].items() if isinstance(x["capacitance"], dict))
    values = {f"{nested}.capacitance": "500 [J/K]", "c1.conductance": "2 [W/K]", "heat.power": "4 [W]"}
    after = before.with_values(values, "fitted, stage 'unit'")
    assert after.content["nodes"][nested]["capacitance"] == {
        "value": "500 [J/K]",
        "min": 0.1,
        "source": "derived",
        "basis": "fitted, stage 'unit'",
    }
    assert after.content["conductors"]["c1"]["conductance"] == "2 [W/K]"
    lines = after.diff(before).splitlines()
    assert [sum(x.startswith(s) for x in lines) for s in ("-", "+")] == [4, 4]  # three lines each, and the two of the head
    assert after.undo().text == before.text


def test_an_edit_that_makes_no_deck_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "deck.toml"
    file.write_bytes(deck(random.Random(1)))
    document = DeckDocument.opened(file)
    for bad in (Edit(("nodes", "n0")), Edit(("nodes", "n0", "capacitance"), "5 [m]"), Edit(("nodes", "none")), Edit(("title", "x"), 1)):
        with pytest.raises(ThermidError):
            document.edited(bad)
    assert document.undo() == document
    assert document.redo() == document


def test_a_file_that_somebody_changed_meanwhile_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "deck.toml"
    file.write_bytes(deck(random.Random(2)))
    document = DeckDocument.opened(file).with_values({"n0.capacitance": "5 [J/K]"})
    document.save()
    assert file.read_bytes() == document.text.encode()
    document.undo().save()  # the file says what was undone
    with as_command():
        document = DeckDocument.opened(file).with_values({"n0.capacitance": "6 [J/K]"})
        was_read(file)
        document.save()  # a file that was read is written over: it is the document's own
    assert file.read_bytes() == document.text.encode()
    file.write_bytes(file.read_bytes() + b"# mine\n")
    with raises_code("output.changed-meanwhile", DeckError):
        document.save()


@pytest.mark.parametrize(
    "rows", ['[[rows]]\nname = "a" # mine\n\n[[rows]]\nname = "b"\n\n[after]\nx = 1\n', 'rows = [{ name = "a" }, { name = "b" }]\n']
)
def test_entries_are_added_to_a_list_and_taken_from_it(rows: str) -> None:
    document = DeckDocument(Path("list.toml"), rows, check=lambda path, content: None)
    longer = document.edited(Edit(("rows", 2), {"name": "c", "limits": {"rmse": "1 [K]"}}))
    assert [r["name"] for r in longer.content["rows"]] == ["a", "b", "c"]
    other = longer.edited(Edit(("rows", 1), {"name": "d"}))
    assert [r["name"] for r in other.content["rows"]] == ["a", "d", "c"]
    shorter = other.edited(Edit(("rows", 0)))
    assert [r["name"] for r in shorter.content["rows"]] == ["d", "c"]
    assert shorter.undo().undo().undo().text == rows
    for wrong in (Edit(("rows", 3), {"name": "e"}), Edit(("rows", 2)), Edit(("rows", -1), {"name": "e"})):
        with raises_code("output.edit-refused", DeckError):
            document.edited(wrong)
