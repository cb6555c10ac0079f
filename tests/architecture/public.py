"""How wide the public interface is, counted: fields of a result, arguments of a function, options of a command."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Mapping
from importlib import import_module

import thermid

from .source import Module, room_of

APP = {"app", "cli", "studio"}
"""Rooms that people start rather than call."""


def signatures(modules: Mapping[str, Module]) -> dict[str, int]:
    """Fields of the largest public record; most arguments of a public function outside the app; parameters of `thermid watch`."""
    places = {name: f"thermid.{module}" for name, module in thermid._PUBLIC.items()}
    things = [getattr(import_module(module), name) for name, module in places.items() if room_of(module) not in APP]
    classes = [thing.__name__ for thing in things if inspect.isclass(thing)]
    functions = [thing for thing in things if inspect.isfunction(thing)]
    records = record_fields(modules)
    return {
        "fields of the largest public record": max(len(records.get(name, ())) for name in classes),
        "with records that no other has": max(nested_fields(records, name) for name in classes),
        "most arguments of a public function": max(len(inspect.signature(function).parameters) for function in functions),
        "parameters of thermid watch": max(parameters(modules, "watch"), default=0),
    }


def record_fields(modules: Mapping[str, Module]) -> dict[str, dict[str, str]]:
    """Dataclass -> its fields with their types as written, inherited ones first; class names are unique in the package."""
    every = (node for m in modules.values() for node in m.nodes if isinstance(node, ast.ClassDef))
    classes = {node.name: node for node in every if any("dataclass" in ast.unparse(d) for d in node.decorator_list)}

    def fields(node: ast.ClassDef) -> dict[str, str]:
        inherited = [fields(classes[base.id]) for base in node.bases if isinstance(base, ast.Name) and base.id in classes]
        own = {
            row.target.id: ast.unparse(row.annotation)
            for row in node.body
            if isinstance(row, ast.AnnAssign) and isinstance(row.target, ast.Name) and "ClassVar" not in ast.unparse(row.annotation)
        }
        return {name: kind for every in (*inherited, own) for name, kind in every.items()}

    return {name: fields(node) for name, node in classes.items()}


def nested_fields(records: Mapping[str, Mapping[str, str]], name: str) -> int:
    """Fields of a record, where a field that is one record that no other has counts as the fields of that."""
    holders: dict[str, int] = {}
    for fields in records.values():
        for kind in fields.values():
            holders[bare(kind)] = holders.get(bare(kind), 0) + 1
    fields = records.get(name, {})
    return sum(nested_fields(records, bare(k)) if bare(k) in records and holders[bare(k)] == 1 else 1 for k in fields.values())


def bare(kind: str) -> str:
    """A type without its alternative of None."""
    return kind.removesuffix(" | None")


def parameters(modules: Mapping[str, Module], command: str) -> list[int]:
    """How many parameters each function of the app has that is named as a command."""
    functions = (node for m in modules.values() if m.room in APP for node in m.nodes if isinstance(node, ast.FunctionDef))
    return [len([*node.args.args, *node.args.kwonlyargs]) for node in functions if node.name == command]
