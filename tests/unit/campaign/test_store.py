"""One store for the hierarchy: what a stage found or tuned arrives at every level above, with its errors and where they come from."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from by_code import raises_code
from thermid.base.errors import DeckError, ThermidError, code_of
from thermid.campaign._stages import Campaign, run_stages
from thermid.model.tree import Dropped, load_model
from thermid.values.store import Cut, Normal, Source, State, Store, Uniform, ValueOrigin, graft, load_store, load_values, save_store
from unit.fit.trees import joined, leaf, record_table, stage_table, write_decks, write_logs

pytestmark = pytest.mark.usefixtures("errors_in_turn")

COMPONENT = leaf("component", 0.20)
PAIR = joined("pair", {"p": COMPONENT}, (0.30, 0.30))
WHOLE = joined("whole", {"s": PAIR}, (0.30, 0.25))
G, J, E = "g.conductance", "to_p.conductance", "e.conductance"


def three_levels(folder: Path, inherit: str = 'as = "fixed"', **more: str) -> Campaign:
    """A component of truth 0.20, a joint of 0.30, a whole of 0.25 W/K; every deck says 0.30."""
    write_decks(folder, WHOLE)
    write_logs(folder, (COMPONENT, PAIR, WHOLE))
    stages = [
        stage_table("component", COMPONENT, [G]),
        stage_table("pair", PAIR, [J], f'p = {{ stage = "component", {inherit} }}'),
        stage_table("whole", WHOLE, [E], f's = {{ stage = "pair", {inherit} }}', more.get("whole", "")),
    ]
    path = folder / "campaign.toml"
    tables = [record_table(p, accuracy=more.get("accuracy", "")) for p in (COMPONENT, PAIR, WHOLE)]
    path.write_text("\n".join(['title = "Three levels"', *tables, *stages, more.get("after", "")]))
    return run_stages(path)


@pytest.mark.parametrize("how", ["fixed", "prior"])
def test_what_the_component_found_reaches_the_third_level(tmp_path: Path, how: str) -> None:
    found = three_levels(tmp_path, f'as = "{how}"')
    whole = found["whole"]
    assert whole.model.at(f"s.p.{G}").expression.literal.value == pytest.approx(0.20, abs=0.002)
    assert whole.model.at(f"s.{J}").expression.literal.value == pytest.approx(0.30, abs=0.01)
    assert abs(whole[E].value - 0.25) < 3 * whole[E].error < 0.02
    assert whole.store[f"s.p.{G}"].origin.stage == ("component" if how == "fixed" else "whole")


def test_a_fit_lists_what_it_was_given_and_by_whom(tmp_path: Path) -> None:
    text = str(three_levels(tmp_path)["whole"]).splitlines()
    assert any(line.split()[0] == f"s.p.{G}" and "'component'" in line for line in text)
    assert any(line.split()[0] == f"s.{J}" and "'pair'" in line for line in text)


def hand_tuned(folder: Path, rows: str, how: str = "fixed") -> Campaign:
    """The component tuned by hand, the pair and the whole fitted on it."""
    write_decks(folder, WHOLE)
    write_logs(folder, (PAIR, WHOLE))
    (folder / "component.hand.toml").write_text(rows)
    stages = [
        '[[stages]]\nname = "bench"\nmodel = "component.toml"\nvalues = "component.hand.toml"\n',
        stage_table("pair", PAIR, [J], f'p = {{ stage = "bench", as = "{how}" }}'),
        stage_table("whole", WHOLE, [E], f's = {{ stage = "pair", as = "{how}" }}'),
    ]
    path = folder / "campaign.toml"
    path.write_text("\n".join(['title = "By hand"', *map(record_table, (PAIR, WHOLE)), *stages]))
    return run_stages(path)


@pytest.mark.parametrize(
    ("row", "value", "sd"),
    [
        ('"0.21 [W/K]"', 0.21, 0.0),
        ('{ value = "0.21 [W/K]", sd = "0.01 [W/K]" }', 0.21, 0.01),
        ('{ value = "0.20 [W/K]", sd = "5 [%]" }', 0.20, 0.01),
        ('{ low = "0.18 [W/K]", high = "0.24 [W/K]" }', 0.21, 0.06 / np.sqrt(12.0)),
    ],
)
def test_a_stage_tuned_by_hand_is_a_stage_like_any_other(tmp_path: Path, row: str, value: float, sd: float) -> None:
    found = hand_tuned(tmp_path, f'"{G}" = {row}\n')
    assert re.match(r"bench: 1 ", str(found["bench"]))
    state = found["whole"].store[f"s.p.{G}"]
    assert (state.value, state.origin.kind, state.origin.stage) == (pytest.approx(value), "hand", "bench")
    assert found["whole"].model.at(f"s.p.{G}").expression.literal.value == pytest.approx(value)
    if sd:
        assert found["whole"].store.error(f"s.p.{G}") == pytest.approx(sd)
        # its error is the largest part of those above
        assert found["whole"][E].error > 3 * found["whole"][E].error_random
    else:
        assert not state.known
        (left_out,) = found["whole"].store.left_out
        assert re.match(rf"'{re.escape(G)}' .* 'bench' .* \{{ value, sd \}} ", left_out.what)


def test_what_was_tuned_by_hand_may_be_a_prior(tmp_path: Path) -> None:
    found = hand_tuned(tmp_path, f'title = "notes"\n[values]\n"{G}" = {{ value = "0.21 [W/K]", sd = "10 [%]" }}\n', "prior")
    whole = found["whole"]
    assert abs(whole[f"s.p.{G}"].value - 0.20) < 4 * whole[f"s.p.{G}"].error < 0.01
    assert [o.stage for o in whole.store[f"s.p.{G}"].history] == ["bench", "pair"]


@pytest.mark.parametrize(
    ("rows", "code", "data"),
    [
        ("", "file.key-missing", ""),
        ('"g.conductanc" = "0.2 [W/K]"\n', "name.unknown", "'g.conductance'"),
        ('"g.conductance" = "0.2 [kg]"\n', "unit.wrong-dimension", ""),
        ('"g.conductance" = { sd = "1 [W/K]" }\n', "value.wrong-kind", ""),
    ],
)
def test_rows_that_are_none_are_refused(tmp_path: Path, rows: str, code: str, data: str) -> None:
    with pytest.raises(ThermidError) as caught:
        hand_tuned(tmp_path, rows)
    assert code_of(str(caught.value)) == code
    assert data in str(caught.value)


@pytest.mark.parametrize("how", ["fixed", "prior"])
def test_the_file_holds_the_whole_store_to_the_bit(tmp_path: Path, how: str) -> None:
    whole = three_levels(tmp_path, f'as = "{how}"')["whole"]
    whole.save(tmp_path / "v.toml")
    store, stage = load_store(tmp_path / "v.toml")
    assert stage == "whole"
    assert store == whole.store
    assert set(store.parameters) == {E, f"s.{J}", f"s.p.{G}"}
    back = load_values(tmp_path / "v.toml")
    assert {p: back[p] for p in whole.values} == dict(whole.values)
    laid = load_model(tmp_path / "whole.toml").with_values(back.assignments, "file")
    for path in store.parameters:
        assert laid.at(path).expression.literal.value == whole.model.at(path).expression.literal.value


def test_awkward_values_come_back_too(tmp_path: Path) -> None:
    origin = ValueOrigin("fit", 'a "quoted" ä\\', ("r 1",), "k", "2026-01-01")
    states = {
        "x": State("x", 0.1 + 0.2, True, "W", (-math.inf, math.inf), origin, paths=("x", "q.x"), hidden=("q.x",), known=False),
        "sensor T": State("sensor T", -0.0, False, "K", (-1e300, 5e-324), origin, "sensor", history=(origin,), prior=(1e-300, 2.0)),
    }
    sources = (
        Source("k:0", "data", Normal()),
        Source("h", "stated", Uniform(-1.0, 1.0), "ü"),
        Source("s", "structural", Cut(Normal(), 0, 1)),
    )
    root = np.array([[0.0, 0.0, 0.0], [1 / 3, 1e-17, -2.0]])
    dropped = (Dropped("y", "1 [W]", "stage 'z'", "why"),)
    made = Store(states, sources, root, {"ab": "stage"}, {"a b": {"date": "d", "x": [1, 2.5], "y": {"é": True}}}, ("c",), dropped)
    save_store(made, tmp_path / "v.toml", "ä")
    assert load_store(tmp_path / "v.toml") == (made, "ä")
    changed = (tmp_path / "v.toml").read_text().replace(f"error = {made.error('sensor T')!r}", "error = 0.5")
    (tmp_path / "v.toml").write_text(changed)
    with raises_code("file.changed-by-hand", DeckError):
        load_store(tmp_path / "v.toml")


def test_a_value_that_the_deck_gives_otherwise_by_now_is_dropped_and_listed(tmp_path: Path) -> None:
    whole = three_levels(tmp_path)["whole"]
    deck = tmp_path / "component.toml"
    deck.write_text(deck.read_text().replace('"0.30 [W/K]"', '"300 [mW/K]"'))
    assert whole.store.matching(load_model(tmp_path / "whole.toml")) is whole.store, "another unit is no other value"
    deck.write_text(deck.read_text().replace('"300 [mW/K]"', '"0.5 [W/K]"'))
    kept = whole.store.matching(load_model(tmp_path / "whole.toml"))
    assert set(kept.parameters) == {E, f"s.{J}"}
    fitted = whole.store.parameters[f"s.p.{G}"].as_parameter().text
    deck.write_text(deck.read_text().replace('"0.5 [W/K]"', f'"{fitted}"'))
    assert whole.store.matching(load_model(tmp_path / "whole.toml")) is whole.store, "the fitted value itself is no other value"
    (gone,) = kept.dropped
    assert (gone.path, gone.origin) == (f"s.p.{G}", "stage 'component'")
    assert re.search(r"0\.5 \[W/K\], .* 0\.30 \[W/K\]", gone.why)


def test_of_two_states_of_one_value_the_nearer_to_the_root_holds_and_equals_are_refused(tmp_path: Path) -> None:
    three = three_levels(tmp_path)
    whole = load_model(tmp_path / "whole.toml")
    component, pair = three["component"].store, three["pair"].store
    both, remarks = graft(whole, [("s", pair), ("s.p", component)])
    assert (both[f"s.p.{G}"].origin.stage, remarks) == ("component", ())
    again = replace(component, states={G: replace(component.states[G], value=0.4, origin=ValueOrigin("fit", "other"))})
    both, remarks = graft(whole, [("s", pair), ("s.p", again)])
    assert both[f"s.p.{G}"].origin.stage == "component"
    (remark,) = remarks
    assert re.search(rf"'s\.p\.{re.escape(G)}': .*'component' .*'other'", remark)
    with raises_code("value.excludes-another", DeckError, match=r"'component'.*'other'.*'s\.p\.g\.conductance'"):
        graft(whole, [("s.p", component), ("s.p", again)])


def test_grafting_is_associative_and_its_order_does_not_matter(tmp_path: Path) -> None:
    three = three_levels(tmp_path)
    pair, whole = load_model(tmp_path / "pair.toml"), load_model(tmp_path / "whole.toml")
    component, own = three["component"].store, three["pair"].store.only(lambda s: s.origin.stage == "pair")
    once, _ = graft(whole, [("s", own), ("s.p", component)])
    inner, _ = graft(pair, [(".", own), ("p", component)])
    twice, _ = graft(whole, [("s", inner)])
    turned, _ = graft(whole, [("s.p", component), ("s", own)])
    for other in (twice, turned):
        assert set(other.states) == set(once.states)
        assert {p: replace(s, at="") for p, s in other.states.items()} == {p: replace(s, at="") for p, s in once.states.items()}
        assert other.covariance(once.states) == pytest.approx(once.covariance(once.states), rel=1e-12)


WAYS = {"fixed": ("fixed", "fixed"), "prior": ("prior", "prior"), "mixed": ("fixed", "prior"), "turned": ("prior", "fixed")}


def measured(folder: Path, ways: tuple[str, str], seed: int = 1, bias: dict[str, float] | None = None) -> Campaign:
    """The three levels with channels good to 0.2 K, AIR one instrument of all logs, and a second branch above the component."""
    branch = joined("branch", {"q": COMPONENT}, (0.35, 0.30))
    root = joined("root", {"s": PAIR, "t": branch}, (0.30, 0.30, 0.25))
    folder.mkdir(exist_ok=True)
    write_decks(folder, root)
    write_logs(folder, (COMPONENT, PAIR, branch, root), seed=seed, bias=bias)
    low, high = ways
    stages = [
        stage_table("component", COMPONENT, [G]),
        stage_table("pair", PAIR, [J], f'p = {{ stage = "component", as = "{low}" }}'),
        stage_table("branch", branch, ["to_q.conductance"], f'q = {{ stage = "component", as = "{high}" }}'),
        stage_table("root", root, [E], f's = {{ stage = "pair", as = "{high}" }}, t = {{ stage = "branch", as = "{low}" }}'),
    ]
    tables = [record_table(p, accuracy="0.2 [K]") for p in (COMPONENT, PAIR, branch, root)]
    (folder / "campaign.toml").write_text("\n".join(['title = "Measured"', *tables, *stages]))
    return run_stages(folder / "campaign.toml")


@pytest.mark.parametrize("ways", WAYS.values(), ids=WAYS)
def test_values_move_with_the_error_of_an_instrument_as_their_rows_say(tmp_path: Path, ways: tuple[str, str]) -> None:
    """AIR reads too much in every log: each value of each stage moves by its response to that one accuracy."""
    size = 0.02
    plain, wrong = measured(tmp_path / "a", ways), measured(tmp_path / "b", ways, bias={"AIR": size})
    compared = 0
    for stage, fit in plain.stages.items():
        names = [p for p, s in fit.store.states.items() if s.known]
        (column,) = [k for k, s in enumerate(fit.store.sources) if s.name == "accuracy: AIR error"]
        truth = np.array([size * (p == "AIR error") for p in names])
        moved = np.array([wrong[stage].store[p].fitted - fit.store[p].fitted for p in names]) - truth
        expected = -fit.store.rows(names)[:, column] * size / 0.2  # a unit of the source is what is stated, no error, less the truth
        sure = np.sqrt(np.diag(fit.store.covariance(names)))
        np.testing.assert_allclose(moved / sure, expected / sure, atol=0.01)
        compared += len(names)
    assert compared > 15


def test_priors_over_three_levels_are_as_wide_as_one_joint_fit(tmp_path: Path) -> None:
    found = three_levels(tmp_path, 'as = "prior"', accuracy="0.2 [K]", after="[joint]\n")
    joint, top = found.joint, found["whole"]
    assert joint is not None
    for path in (E, f"s.{J}", f"s.p.{G}"):
        assert top[path].error == pytest.approx(joint[path].error, rel=0.10)
        assert abs(top[path].value - joint[path].value) < joint[path].error


@pytest.mark.campaign
@pytest.mark.parametrize("ways", WAYS.values(), ids=WAYS)
def test_the_covariance_by_rows_is_that_of_repeats(tmp_path: Path, ways: tuple[str, str]) -> None:
    """150 repeats of all logs, with other noise and other instruments; one comparison in 10 000 would fail by chance."""
    from scipy.stats import chi2, norm

    rng = np.random.default_rng(5)
    sensors = ("T_n", "T_body", "T_p_n", "T_q_n", "T_s_body", "T_t_body", "T_s_p_n", "T_t_q_n", "AIR")
    last = [E, f"s.p.{G}", f"s.{J}"]
    draws, rows, count = [], [], 150
    for k in range(count):
        bias = {s: float(b) for s, b in zip(sensors, 0.2 * rng.standard_normal(len(sensors)), strict=True)}
        store = measured(tmp_path / str(k), ways, seed=10 * k + 1, bias=bias)["root"].store
        rows.append(store.covariance(last))
        draws.append([store[p].fitted for p in last])
    told, seen = np.mean(rows, axis=0), np.cov(np.array(draws).T)
    ratio = np.diag(seen) / np.diag(told)
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], count - 1) / (count - 1)
    alike = [(c / np.sqrt(np.outer(np.diag(c), np.diag(c))))[np.triu_indices(len(last), 1)] for c in (seen, told)]
    apart = (np.arctanh(alike[0]) - np.arctanh(alike[1])) * np.sqrt(count - 3)  # Fisher's z, of unit variance
    print(f"sd of repeats over sd by rows {np.sqrt(ratio)}; correlations {alike[0]}, by rows {alike[1]}")
    assert np.all((low < ratio) & (ratio < high)), ratio
    assert np.all(np.abs(apart) < norm.ppf(1.0 - 5e-5)), alike


def test_a_values_file_on_the_command_line(tmp_path: Path) -> None:
    """At every depth; without what the decks give otherwise by now; one written by hand as well."""
    from typer.testing import CliRunner

    from thermid.app.cli.app import app

    whole = three_levels(tmp_path)["whole"]
    whole.save(tmp_path / "v.toml")
    (tmp_path / "hand.toml").write_text(f'"s.p.{G}" = "{whole.store[f"s.p.{G}"].value!r} [W/K]"\n')

    def end(*more: str) -> tuple[float, str]:
        given = ["simulate", str(tmp_path / "whole.toml"), "--boundary", "air=295 [K]", "--start", "295 [K]", "--for", "1 [h]", "--json"]
        told = CliRunner().invoke(app, [*given, *more])
        assert told.exit_code in (0, 5), told.output
        return json.loads(told.stdout)["nodes"]["s.p.n"]["final_C"], told.stderr

    plain, laid, hand = end(), end("--values", str(tmp_path / "v.toml")), end("--values", str(tmp_path / "hand.toml"))
    assert plain[0] < hand[0]
    assert laid[1] == ""
    component = tmp_path / "component.toml"
    component.write_text(component.read_text().replace("0.30 [W/K]", "0.31 [W/K]"))
    without, kept = end("--values", str(tmp_path / "v.toml")), end("--values", str(tmp_path / "v.toml"), "--keep-values")
    assert kept[0] == laid[0] != without[0]
    assert f"s.p.{G} = " in without[1]
    assert re.search(r"0\.31 \[W/K\], .* 0\.30 \[W/K\]", without[1])
