"""Decks as people write them: comments, blank lines, dotted keys, inline tables, tables of their own, quotes of both kinds, CRLF, BOM."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator, Mapping
from typing import Any

WORDS = ("weighed", "from the drawing", 'says "A. B."', "0.5 mm?", "[nodes]", "= 3 W", "Müller, 3 °C")


def _value(value: Any, rng: random.Random) -> str:
    """Return a value as TOML writes it, tables inline."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(k, rng)} = {_value(v, rng)}" for k, v in value.items())
        return "{" + inside + "}" if rng.random() < 0.3 else "{ " + inside + " }"
    if isinstance(value, list | tuple):
        return "[" + rng.choice([", ", ","]).join(_value(v, rng) for v in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f"'{value}'" if rng.random() < 0.2 and "'" not in value else json.dumps(value, ensure_ascii=False)
    return repr(value)


def _key(name: str, rng: random.Random) -> str:
    return name if name.replace("_", "").isalnum() and rng.random() < 0.9 else json.dumps(name)


def _line(key: str, value: Any, rng: random.Random) -> str:
    note = f"{rng.choice([' ', '   '])}# {rng.choice(WORDS)}" if rng.random() < 0.3 else ""
    return f"{rng.choice(['', '', '  '])}{key}{rng.choice([' = ', '=', '   = '])}{_value(value, rng)}{note}"


def _lines(deck: Mapping[str, Any], rng: random.Random) -> Iterator[str]:
    tables = {name: v for name, v in deck.items() if isinstance(v, Mapping)}
    yield from (_line(_key(name, rng), v, rng) for name, v in deck.items() if name not in tables)
    whole = {name for name, v in tables.items() if v and rng.random() < 0.1}
    yield from (_line(name, tables[name], rng) for name in sorted(whole))
    for name, table in tables.items():
        if name in whole:
            continue
        apart = {k for k, v in table.items() if isinstance(v, Mapping) and v and rng.random() < 0.25}
        if len(apart) < len(table) or not table:
            yield f"\n[{name}]" + rng.choice(["", f" # {rng.choice(WORDS)}"])
        for k, v in table.items():
            if k in apart:
                continue
            if isinstance(v, Mapping) and v and rng.random() < 0.3:
                yield from (_line(f"{_key(k, rng)}.{_key(field, rng)}", x, rng) for field, x in v.items())
            else:
                yield _line(_key(k, rng), v, rng)
        for k in (k for k in table if k in apart):
            yield f"\n[{name}.{_key(k, rng)}]"
            yield from (_line(_key(field, rng), x, rng) for field, x in table[k].items())


def hand_written(deck: Mapping[str, Any], rng: random.Random) -> bytes:
    """Return a deck, a dictionary of texts, as one of the files that somebody might have written of it."""
    lines = []
    for line in _lines(deck, rng):
        lines += [f"# {rng.choice(WORDS)}"] * (rng.random() < 0.15) + [""] * (rng.random() < 0.1) + [line]
    ends = rng.choice(["\n", "\r\n"])
    text = "\n".join(lines).replace("\n", ends) + rng.choice(["", ends, f"{ends}# the end", f"  {ends}{ends}"])
    return rng.choice([b"", b"\xef\xbb\xbf"]) + text.encode()
