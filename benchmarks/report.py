"""Tables of results for people."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import Any


def duration(seconds: float) -> str:
    """Return a time with a unit that suits it."""
    for size, unit in ((1.0, "s"), (1e-3, "ms")):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} us"


def show(document: dict[str, Any]) -> None:
    """Print the tables of a document of `run.py`."""
    from rich.console import Console
    from rich.table import Table

    console = Console()
    if not console.is_terminal:
        console = Console(width=160)
    machine = document["machine"]
    console.print(
        f"[bold]{document['case']}[/bold]  {document['date']}  {machine['cpu']}, {machine['cores']} cores, Python {machine['python']}"
    )
    console.print(f"floor of one core: copy {document['floor']['copy_GB_s']} GB/s, multiply-add {document['floor']['fma_GFLOP_s']} GFLOP/s")
    for section, rows in sections(document):
        table = Table(title=section.get("work", ""), title_justify="left")
        columns = list(dict.fromkeys(key for row in rows for key in shown(row)))
        for name in columns:
            table.add_column(name, justify="left" if name in ("name", "setting", "") else "right")
        for row in rows:
            cells = shown(row)
            table.add_row(*(cells.get(name, "") for name in columns))
        console.print(table)
        for line in remarks(section):
            console.print(line)
    for name, why in document["missing"].items():
        console.print(f"missing: {name} ({why})")


def sections(document: dict[str, Any]) -> Iterator[tuple[dict[str, Any], list[dict[str, Any]]]]:
    """Yield what each contest was about and its rows."""
    rows = groupby(document["results"], key=lambda row: (row.get("part"), row.get("room")))
    for section, (_, group) in zip(document["sections"], rows, strict=True):
        yield section, list(group)


def shown(row: dict[str, Any]) -> dict[str, str]:
    """Return the columns of a row as text."""
    out = {"name": row["name"], "setting": row.get("setting", ""), "time": duration(row["seconds"])}
    if "cpu_seconds" in row:
        out["cpu"] = duration(row["cpu_seconds"])
    if row.get("max_error_K") is not None:
        out["error [K]"] = f"{row['max_error_K']:.1e}"
    if "max_error_sensitivity" in row:
        out["of sens. [K]"] = f"{row['max_error_sensitivity']:.1e}"
    if "right" in row:
        out["right"] = "yes" if row["right"] else "no"
    if "ratio" in row:
        out["ratio"] = f"{row['ratio']:.3g}"
    if "target_seconds" in row:
        out["target"] = duration(row["target_seconds"])
    return out | {key: str(value) for key, value in row.get("columns", {}).items()}


def remarks(section: dict[str, Any]) -> Iterator[str]:
    """Yield what else is to be said of a contest."""
    if "reference_checked_K" in section:
        yield f"reference against scipy on the sample grid: {section['reference_checked_K']:.1e} K"
    yield from section.get("remarks", ())
