"""Mutants of files: by bytes, lines, tokens and, for TOML and JSON, by the tree of what they say. Seeded: a number names a mutant."""

# ruff: noqa: E501  # lines of files and tables

from __future__ import annotations

import copy
import json
import random
import re
import tomllib
from collections.abc import Callable
from typing import Any

NUMBERS = ("0", "-1", "1e308", "-1e308", "1e-320", "nan", "inf", "-inf", "1" * 400, "0x7fffffffffffffff", "1e999", "true", "9" * 20, "1.5")
TEXTS = (
    '""', '"5"', '"1 [K]"', '"1 [cm^2e9]"', '"[K]"', '"1e400 [W]"', '"2**99 [W]"', '"a.b.c"', '"nan [W]"', '"inf [s]"', '"-300 [degC]"',
    '"../../etc/passwd"', '"\\u0000"', '"case"', '"' + "x" * 3000 + '"', '"1/0 [W]"', '"(((((1)))))"', '"air"', '"unit.toml"', '"0 [s]"',
    '"1e-7 [h]"', '"1e15 [h]"', "[]", "{}", "[[]]", "[1, 2]", '["0 [s]"]', '{ value = "1 [W]" }', "1979-05-27", "3.0", "7", "false",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 3, 10**20, 1.5, float("nan"), float("inf"), -1e308, 1e-320, "", "x", "5", "1 [K]", "-300 [degC]", "1 [W]",
    "1e-7 [h]", "1e15 [h]", "case", "air", "inf [W]", "nan [s]", "\x00", "é", "a" * 500, [], {}, [1], ["x"], [[1, 2], [3]], [None], {"x": 1},
    {"value": "1 [W]"}, {"times": ["0 [s]"], "values": []}, {"mean": 1, "amplitude": 1, "period": 0}, {"file": "rig.csv", "column": "ROOM"},
    {"file": "nothing.csv", "column": 3}, {"file": 3},
)  # fmt: skip
Mutate = Callable[[random.Random, bytes], bytes]


def by_bytes(dice: random.Random, data: bytes) -> bytes:
    out = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 5, 20))):
        at = dice.randrange(len(out) + 1) if out else 0
        how = dice.randrange(5)
        if how == 0 and out:
            out[min(at, len(out) - 1)] = dice.randrange(256)
        elif how == 1:
            out[at:at] = bytes(dice.randrange(256) for _ in range(dice.choice((1, 3, 40))))
        elif how == 2:
            del out[at : at + dice.choice((1, 4, 60))]
        elif how == 3:
            out[at:at] = out[at : at + dice.choice((3, 30, 300))]
        else:
            out[at : at + 1] = dice.choice((b"\0", b"\xff", b"\r", b"\n", b'"', b"[", b"]", b"{", b"=", b",", b";", b"\xef\xbb\xbf", b"#"))
    return bytes(out)


def by_lines(dice: random.Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    for _ in range(dice.choice((1, 1, 3))):
        a, b = (dice.randrange(len(lines)) for _ in range(2))
        how = dice.randrange(5)
        if how == 0:
            del lines[a]
        elif how == 1:
            lines.insert(b, lines[a])
        elif how == 2:
            lines[a], lines[b] = lines[b], lines[a]
        elif how == 3:
            lines = lines[: a + 1]
        else:
            lines[a:a] = lines[a : a + 1] * dice.choice((2, 50))
        lines = lines or [b""]
    return b"\n".join(lines)


_TOKEN = re.compile(rb'"[^"\n]*"|-?\d+(?:\.\d+)?(?:e-?\d+)?|[A-Za-z_]\w*')


def by_tokens(dice: random.Random, data: bytes) -> bytes:
    for _ in range(dice.choice((1, 1, 2, 4))):
        found = list(_TOKEN.finditer(data))
        if not found:
            return data
        token = dice.choice(found)
        old = token[0]
        if old[:1] == b'"' or dice.random() < 0.3:
            new = dice.choice(TEXTS).encode()
        elif old[:1].isdigit() or old[:1] == b"-":
            new = dice.choice(NUMBERS).encode()
        else:
            new = dice.choice((old[:-1] or b"x", old + b"x", dice.choice(found)[0], b"x", b"value", b"file"))
        data = data[: token.start()] + new + data[token.end() :]
    return data


def by_tree(dice: random.Random, data: bytes) -> bytes:
    try:
        text = data.decode()
        as_json = text.lstrip()[:1] in "{["
        tree = json.loads(text) if as_json and "\n[" not in text[:3] else tomllib.loads(text)
        as_json = as_json and isinstance(tree, dict | list) and text.lstrip()[:1] == json.dumps(tree)[:1]
    except (ValueError, UnicodeDecodeError):
        return by_tokens(dice, data)
    for _ in range(dice.choice((1, 1, 2, 3))):
        _change(dice, tree)
    return json.dumps(tree, default=str).encode() if as_json else _toml(tree).encode()


def _change(dice: random.Random, tree: Any) -> None:
    """Put something else into a random place of a tree, take a key away, rename one, or add one."""
    here, places = tree, []
    while isinstance(here, dict | list) and here:
        key = dice.choice(list(here)) if isinstance(here, dict) else dice.randrange(len(here))
        places.append((here, key))
        if dice.random() < 0.25:
            break
        here = here[key]
    if not places:
        return
    holder, key = places[-1]
    how = dice.random()
    value = copy.deepcopy(dice.choice(VALUES))
    if how < 0.65:
        holder[key] = value
    elif how < 0.8:
        del holder[key]
    elif isinstance(holder, list):
        holder.append(value)
    elif how < 0.9:
        holder[str(key)[:-1]] = holder.pop(key)
    else:
        holder[dice.choice(("x", "file", "value", "schema", "kind", "between", "table", "", "a b"))] = value


def _toml(value: Any, top: bool = True) -> str:
    """Return a tree as TOML, tables inline."""
    if isinstance(value, dict):
        rows = [f"{json.dumps(str(k))} = {_toml(v, False)}" for k, v in value.items()]
        return "\n".join(rows) + "\n" if top else "{ " + ", ".join(rows) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v, False) for v in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if value is None:
        return '""'
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value) if isinstance(value, int | float) else json.dumps(str(value))


WAYS: tuple[Mutate, ...] = (by_tree, by_tree, by_tree, by_tokens, by_tokens, by_lines, by_bytes)


def mutant(seed: str, data: bytes) -> bytes:
    """Return the mutant of a seed."""
    dice = random.Random(seed)
    return dice.choice(WAYS)(dice, data)
