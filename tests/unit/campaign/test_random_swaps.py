"""Random swaps in random hierarchies: nothing of the old part is left in model, plan, store and values, at any level."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import thermid as td
from thermid.base.errors import IdentificationError
from thermid.model.tree import ParameterSet, identities, load_model
from unit.fit.project import write_log
from unit.fit.trees import Part, joined, leaf, record_of, record_table, stage_table, write_decks, write_logs

pytestmark = pytest.mark.usefixtures("errors_in_turn")

G, POWER = "g.conductance", "heat.power"


def random_tree(rng: np.random.Generator) -> list[Part]:
    """Two to four levels: a leaf, a unit of two leaves (twins or not), perhaps a whole and a top; some with a [set]."""
    one, other = leaf("leaf", float(rng.uniform(0.15, 0.6))), leaf("other", float(rng.uniform(0.15, 0.6)))
    twins = bool(rng.random() < 0.6)
    rows = {"q.heat.power": "1.3 [W]"} if rng.random() < 0.3 else {}
    levels = [one, joined("unit", {"p": one, "q": one if twins else other}, rng.uniform(0.2, 0.6, 3).tolist(), rows)]
    for name in ("whole", "top")[: int(rng.integers(0, 3))]:
        below = levels[-1]
        sets = {f"s.{(below.parts and 'e') or 'g'}.conductance": "0.33 [W/K]"} if rng.random() < 0.3 else {}
        levels.append(joined(name, {"s": below}, rng.uniform(0.2, 0.6, 2).tolist(), sets))
    return levels


def campaign_text(levels: list[Part], rng: np.random.Generator) -> str:
    """Stages of all levels, each inheriting fixed or as a prior, tied or untied."""
    stages = [stage_table("leaf", levels[0], [G, POWER])]
    for below, part in pairwise(levels):
        how = str(rng.choice(["fixed", "prior"]))
        places = [n for n, p in part.parts.items() if p is below]
        given = places if rng.random() < 0.7 else places[:1]
        inherit = ", ".join(f'{n} = {{ stage = "{below.definition}", as = "{how}" }}' for n in given)
        more = str(rng.choice(["", "untie = true", f'untie = ["{places[-1]}"]']))
        free = [f"{n}.conductance" for n in part.truth]
        free += [f"{places[0]}.{G}"] if below is levels[0] and rng.random() < 0.4 else []
        stages.append(stage_table(part.definition, part, free, inherit, more))
    return "\n".join(['title = "A random hierarchy"', *map(record_table, levels), *stages])


def _calibrated(folder: Path, rng: np.random.Generator) -> tuple[list[Part], td.Campaign]:
    """Return a hierarchy and its campaign; one whose logs do not determine its values is drawn again."""
    while True:
        levels = random_tree(rng)
        write_decks(folder, levels[-1])
        write_logs(folder, levels)
        path = folder / "campaign.toml"
        path.write_text(campaign_text(levels, rng))
        try:
            return levels, td.run_stages(path)
        except IdentificationError as error:
            if error.code != "fit.not-determined":
                raise


def swapped(folder: Path, seed: int) -> list[str]:
    """Swap one part, test the new one alone; return every value of the old part that is left, and where."""
    rng = np.random.default_rng([33, seed])
    levels, before = _calibrated(folder, rng)
    top = levels[-1]
    where = [prefix.rstrip(".") for prefix, part in top.every() if prefix]
    place = str(rng.choice(where))
    old = dict((prefix.rstrip("."), part) for prefix, part in top.every())[place]
    new = replace(old, definition="newer", truth={n: float(rng.uniform(0.7, 0.9)) for n in old.truth})
    text = new.text().replace('power = "1 [W]"', 'power = "6 [W]"').replace("0.30 [W/K]", "0.80 [W/K]")
    (folder / "newer.toml").write_text(text)
    deck = load_model(folder / "newer.toml")
    logs = folder / "again" / "logs"
    logs.mkdir(parents=True)
    write_log(record_of(deck, new.values(), new.nodes(), old.definition, 70 + seed, 0.02, {}), logs / f"{old.definition}.csv")
    known = before[top.definition].model
    stale = {float(v) for p, v in ParameterSet(known).evaluate({}).items() if p.startswith(f"{place}.")}
    stale -= {float(v) for v in ParameterSet(deck).evaluate({}).values()}
    below = {part.definition for prefix, part in new.every() if prefix}  # parts of the new part that are of the decks of before
    stale -= {v.value for n in below & set(before) for v in before[n].values.parameters.values()}
    model = known.replace(place, deck)
    alone, now = deck.parameter_table(), model.parameter_table()
    wrong = [f"model: {n}" for n, entry in alone.items() if now[f"{place}.{n}"].parameter != entry.parameter]
    wrong += [f"tied: {one.paths}" for one in identities(model).values() if _crosses(one.paths, place)]

    plan = td.design.plan_retune(before, place, deck)
    assert plan.watts[1] == pytest.approx(sum(v for p, v in ParameterSet(deck).evaluate({}).items() if p.endswith(POWER)))
    assert alone[POWER].parameter.text == "6 [W]"
    assert re.search(rf"\bnewer .* {re.escape(f'{plan.watts[1]:.4g}')} W ", str(plan))
    said = [line for line in str(plan).splitlines() if not line.endswith(("of the old part", "of its place"))]
    old_values = {f"{place}.{n}": f"{v:.4g} [" for n, v in _numbers(known, place).items() if v in stale}
    wrong += [f"plan: {line}" for line in said for p, v in old_values.items() if f"{p} " in line and v in line]

    made = plan.run(folder / "again", part_only=True)[top.definition]
    numbers = _numbers(made.model, place)
    states = [s for s in made.store.parameters.values() if any(p.startswith(f"{place}.") for p in s.paths)]
    tested = {*below, *(s.name for s in plan.stages if s.alone)}
    wrong += [f"fitted model: {n}" for n, v in numbers.items() if v in stale]
    wrong += [f"store, tied: {s.paths}" for s in states if _crosses(s.paths, place)]
    wrong += [f"store: {s.path} of {s.origin}" for s in states if s.origin.stage not in tested]
    assert numbers[POWER] == pytest.approx(6.0, rel=0.05)
    return wrong


def _crosses(paths: tuple[str, ...], place: str) -> bool:
    return len({p.startswith(f"{place}.") for p in paths}) > 1


def _numbers(model: td.Model, place: str) -> dict[str, float]:
    values = ParameterSet(model).evaluate({})
    return {p.removeprefix(f"{place}."): float(v) for p, v in values.items() if p.startswith(f"{place}.")}


@pytest.mark.parametrize("seed", range(2))
def test_nothing_of_the_old_part_is_left(tmp_path: Path, seed: int) -> None:
    assert swapped(tmp_path, seed) == []


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(50))
def test_fifty_swaps(tmp_path: Path, seed: int) -> None:
    assert swapped(tmp_path, seed) == []
