"""Errors are those that a Python programmer expects, too: a wrong value is a `ValueError`, and so on; all travel in a pickle."""

from __future__ import annotations

import pickle

import pytest

import thermid as td
from by_code import raises_code
from thermid import errors

KINDS = {
    "UnitError": ValueError,
    "ExpressionError": ValueError,
    "NameNotFoundError": KeyError,
    "DeckError": ValueError,
    "OutputError": OSError,
    "ScenarioError": ValueError,
    "RecordError": ValueError,
    "MissingDataError": ValueError,
    "MissingExtraError": ImportError,
    "SolverError": RuntimeError,
    "IdentificationError": ValueError,
    "StoppedError": RuntimeError,
}


def test_every_error_has_a_standard_one() -> None:
    made = {n for n, e in vars(errors).items() if isinstance(e, type) and issubclass(e, errors.ThermidError)} - {"ThermidError"}
    assert made == set(KINDS)
    assert td.errors is errors


@pytest.mark.parametrize("name", KINDS)
def test_it_is_one_and_keeps_its_words(name: str) -> None:
    kind = getattr(td.errors, name)
    error = kind("the unit is unknown.", "deck.toml:3")
    assert isinstance(error, KINDS[name])
    assert str(error) == "deck.toml:3: the unit is unknown."
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), again.message) == (kind, "the unit is unknown.")
    assert error.located("x") is error
    assert kind("m").located("here").where == "here"


def test_a_user_catches_it_without_thermid() -> None:
    with raises_code("unit.wrong-dimension", ValueError, match=r"boundaries\.air.*'\[furlong\]'.*\[degC\]"):
        td.Scenario("s", boundaries={"air": "20 [furlong]"})
    with pytest.raises(KeyError):
        td.errors.look_up("b", {"a": 1}, "no '{}'.")
