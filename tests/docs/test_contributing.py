"""CONTRIBUTING.md and docs/recipes.md: recipes are carried out in a copy of the package, files exist, the reading path has its length."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace

import pytest

import thermid._kernel
from thermid.base.errors import DeckError
from thermid.base.units import value_of
from thermid.model.tree import Law

from .pages import ROOT, blocks, codes, prose

TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
EXAMPLE = {b.words[1]: b.text for b in blocks((ROOT / "docs" / "recipes.md").read_text(encoding="utf-8")) if len(b.words) > 1}
PACKAGE = ROOT / "src" / "thermid"

DECK = """
title = "plate"
needs = ["base"]
[nodes]
plate = { capacitance = "100 [J/K]" }
[conductors]
bolts = { kind = "bolt", between = ["plate", "base"], bolt_conductance = { value = "500 [mW/K]", min = 100, max = 900 }, count = 4 }
[loads]
heater = { into = "plate", power = "10 [W]" }
"""

WALKS = (
    ("model/every_kind.py", "CASES: list", "example", "\n]\n"),
    ("campaign/judge/test_metrics.py", '    sizes["p95"]', "metric-size", "\n    assert "),
)
"""What tests that walk a table take, with a line of each new row: file, where its lines stand, line of the page, end of its lines."""

USE = """
import json, sys
# an editable install answers for the package before the path is looked at
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in f"{type(finder).__module__} {type(finder).__name__}".lower()]
sys.path.insert(0, sys.argv[1])
import numpy as np
import thermid as td
from thermid.base.files import json_schema

model = td.load_model("plate.toml")
bench = td.Scenario("bench", boundaries={"base": "20 [degC]"}, start="20 [degC]", duration="10 [min]")
run = td.simulate(model, bench)
channel = td.Channel.from_array("T", run["plate"].kelvin, unit="K", role="node", target="plate", noise=0.01)
record = td.Record.from_arrays("log", run.times, {"T": channel, "base": td.Channel.from_array("base", run["base"].kelvin, unit="K")})
start = model.with_values({"bolts.bolt_conductance": "0.3 [W/K]"})
fit = td.calibrate(start, record, free=["bolts.bolt_conductance"])
try:
    td.model_from_dict({"title": "x", "needs": ["b"], "nodes": {"a": {}},
                        "conductors": {"c": {"kind": "bolt", "between": ["a", "b"], "bolt_conductance": "1 [W/K]", "cuont": 4}}})
except td.ThermidError as error:
    refusal = str(error)
print(json.dumps({"from": td.__file__, "rise": run["plate"].rise, "fitted": fit["bolts.bolt_conductance"].value,
                  "schema": "bolt_conductance" in json.dumps(json_schema("deck")), "refusal": refusal}))
"""

CHECK = """
import sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in f"{type(finder).__module__} {type(finder).__name__}".lower()]
sys.path[:0] = sys.argv[1:2]
import pytest
sys.exit(pytest.main(["-q", "-rA", "-p", "no:cacheprovider", "-c", "empty.ini", "--import-mode=importlib", *sys.argv[2:]]))
"""


def with_bolts(source: str) -> str:
    """The table of kinds after the two edits that the page asks for."""
    before, mark, after = source.partition('_AREA = {"area": "m^2"}')
    assert mark
    table = after.index("\n}\n", after.index("KINDS: Final"))
    return f"{before}{EXAMPLE['function']}\n\n{mark}{after[:table]}\n{EXAMPLE['line'].rstrip()}{after[table:]}"


def lengthened(source: str, table: str, row: str, end_of_table: str = "\n}\n") -> str:
    """A module with one more row at the end of a table."""
    end = source.index(end_of_table, source.index(table))
    return f"{source[:end]}\n{row.rstrip()}{source[end:]}"


def added(source: str, name: str, above: str, table: str, row_above: str) -> str:
    """A module after the function of a recipe was put above a line, and its row into a table."""
    before, mark, after = source.partition(above)
    assert mark
    source = f"{before}{EXAMPLE[f'{name}-function']}\n\n{mark}{after}"
    start = source.index(row_above, source.index(table))
    return f"{source[:start]}{EXAMPLE[f'{name}-row'].rstrip()}\n{source[start:]}"


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package as the contributor leaves it."""
    folder = tmp_path_factory.mktemp("bolts")
    shutil.copytree(PACKAGE, folder / "src" / "thermid", ignore=shutil.ignore_patterns("*.so"))
    shutil.copy(str(thermid._kernel.__file__), folder / "src" / "thermid")
    kinds = folder / "src" / "thermid" / "model" / "_parts" / "elements.py"
    kinds.write_text(with_bolts(kinds.read_text(encoding="utf-8")), encoding="utf-8")
    ranges = folder / "src" / "thermid" / "model" / "_parts" / "ranges.py"
    ranges.write_text(lengthened(ranges.read_text(encoding="utf-8"), "RANGES: Final", EXAMPLE["range"]), encoding="utf-8")
    diagram = folder / "src" / "thermid" / "reporting" / "_diagrams" / "map.py"
    diagram.write_text(lengthened(diagram.read_text(encoding="utf-8"), "STYLES: Mapping", EXAMPLE["line-style"]), encoding="utf-8")
    for name, table, row, end in WALKS:
        walk = (ROOT / "tests" / "unit" / name).read_text(encoding="utf-8")
        (folder / "tests" / "unit" / name).parent.mkdir(parents=True)
        (folder / "tests" / "unit" / name).write_text(lengthened(walk, table, EXAMPLE[row], end), encoding="utf-8")
    metrics = folder / "src" / "thermid" / "campaign" / "_judge" / "verdict.py"
    source = metrics.read_text(encoding="utf-8")
    metrics.write_text(added(source, "metric", "@dataclass(frozen=True)\nclass Metric:", "METRICS: Final", "}\n"), encoding="utf-8")
    formats = folder / "src" / "thermid" / "measure" / "_readers" / "formats.py"
    source = formats.read_text(encoding="utf-8")
    formats.write_text(added(source, "reader", "FORMATS: Final = (", "FORMATS: Final", '    Format("serial capture"'), encoding="utf-8")
    channel = folder / "src" / "thermid" / "measure" / "_record" / "channel.py"
    channel.write_text(lengthened(channel.read_text(encoding="utf-8"), "ROLES: Final", EXAMPLE["role-row"]), encoding="utf-8")
    store = folder / "src" / "thermid" / "values" / "_store.py"
    source = store.read_text(encoding="utf-8").replace("\nMIDPOINTS = ", f"\n{EXAMPLE['prior-class']}\n\nMIDPOINTS = ")
    store.write_text(source.replace("Shifted, Logarithm)}", f"Shifted, Logarithm{EXAMPLE['prior-name'].strip()})}}"), encoding="utf-8")
    spreads = folder / "src" / "thermid" / "values" / "_spreads.py"
    source = spreads.read_text(encoding="utf-8").replace("Store, Uniform\n", "Store, Triangular, Uniform\n")
    spreads.write_text(added(source, "prior", "FORMS: Mapping", "FORMS: Mapping", '    "low": '), encoding="utf-8")
    cli = folder / "src" / "thermid" / "app" / "cli"
    commands = (cli / "build.py").read_text(encoding="utf-8")
    (cli / "build.py").write_text(f"{commands}\n\n{EXAMPLE['command-function']}", encoding="utf-8")
    source = (cli / "app.py").read_text(encoding="utf-8")
    at = source.index('    "identify": Place(')
    (cli / "app.py").write_text(f"{source[:at]}{EXAMPLE['command-row'].rstrip()}\n{source[at:]}", encoding="utf-8")
    for name in ("metric", "reader", "role", "prior", "command"):
        (folder / f"test_{name}.py").write_text(EXAMPLE[f"{name}-test"], encoding="utf-8")
    (folder / "plate.toml").write_text(DECK, encoding="utf-8")
    (folder / "empty.ini").write_text("[pytest]\nfilterwarnings = error\n", encoding="utf-8")
    (folder / "test_bolts.py").write_text(EXAMPLE["test"], encoding="utf-8")
    return folder


def run(copy: Path, script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", script, str(copy / "src"), *arguments]
    return subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)


def test_the_new_kind_is_simulated_and_fitted(copy: Path) -> None:
    done = run(copy, USE)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert Path(found["from"]).is_relative_to(copy)
    assert found["rise"] == pytest.approx(10 / (4 * 0.5) * (1 - 2.718281828459045 ** (-600 * 2 / 100)), abs=1e-4)
    assert found["fitted"] == pytest.approx(0.5, rel=1e-4)
    assert found["schema"]
    assert "cuont" in found["refusal"]
    assert "count" in found["refusal"]


RECIPES = ("test_bolts.py", "test_metric.py", "test_reader.py", "test_role.py", "test_prior.py", "test_command.py")
KINDS_WALKED = (
    "test_silent_wrongs.py::test_a_lead_and_every_other_kind_is_drawn",
    "model/test_elements.py::test_every_kind_has_a_case",
    "model/test_round_trip.py::test_the_sink_holds_every_kind",
    "model/test_round_trip.py::test_round_trip_of_everything",
)
METRICS_WALKED = "campaign/judge/test_metrics.py::test_what_each_metric_is"
WALKING = (*KINDS_WALKED, METRICS_WALKED)
BLIND = {"test_round_trip_of_everything"}
"""Of those, what passes without the line too: it walks the cases, not the table."""


def outcomes(copy: Path, script: str, *tests: str) -> dict[str, set[str]]:
    """PASSED, FAILED or ERROR -> names of the tests that ended so; all of them in one start of Python."""
    done = run(copy, script, *tests)
    words = re.findall(r"^(PASSED|FAILED|ERROR) \S*?::(\S+)", done.stdout, re.MULTILINE)
    assert len(words) == len(tests), done.stdout + done.stderr
    return {end: {name for word, name in words if word == end} for end in ("PASSED", "FAILED", "ERROR")}


@pytest.fixture(scope="module")
def with_them(copy: Path) -> dict[str, set[str]]:
    """What becomes of the tests of the page, of the package as the contributor leaves it."""
    kinds = (f"{ROOT / 'tests' / 'unit'}/{test}" for test in KINDS_WALKED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(map(str, (copy / "tests", ROOT / "tests"))))
        return outcomes(copy, CHECK, *RECIPES, *kinds, f"{copy / 'tests' / 'unit'}/{METRICS_WALKED}")


@pytest.fixture(scope="module")
def without(copy: Path) -> dict[str, set[str]]:
    """What becomes of the recipes' tests, of the package without the recipes."""
    return outcomes(copy, "import sys" + CHECK[CHECK.index("\nimport pytest") :], *RECIPES)


@pytest.fixture(scope="module")
def unchanged(copy: Path) -> dict[str, set[str]]:
    """What becomes of the tests that walk a table, left unchanged, of the package with the new rows."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT / "tests"))
        return outcomes(copy, CHECK, *(f"{ROOT / 'tests' / 'unit'}/{test}" for test in WALKING))


def test_the_tests_of_the_recipes_pass_with_them_and_fail_without(with_them: dict[str, set[str]], without: dict[str, set[str]]) -> None:
    names = {re.findall(r"def (test_\w+)", EXAMPLE[f"{kind}test"])[0] for kind in ("", "metric-", "reader-", "role-", "prior-", "command-")}
    assert with_them == {"PASSED": names | {test.partition("::")[2] for test in WALKING}, "FAILED": set(), "ERROR": set()}
    assert without == {"PASSED": set(), "FAILED": names, "ERROR": set()}


@pytest.mark.campaign
def test_what_walks_a_table_fails_without_a_line_of_the_new_row(unchanged: dict[str, set[str]]) -> None:
    names = {test.partition("::")[2] for test in WALKING}
    assert unchanged == {"PASSED": BLIND, "FAILED": names - BLIND, "ERROR": set()}


def test_its_line_is_all_that_the_nomenclature_needs(copy: Path) -> None:
    """The page with the line agrees with the code that has the kind; without the line it does not."""
    page = (ROOT / "docs" / "nomenclature.md").read_text(encoding="utf-8")
    row = next(line for line in page.splitlines() if line.startswith("| `table` | `scale`"))
    metric = next(line for line in page.splitlines() if line.startswith("| `p95` | K"))
    both = page.replace(row, f"{row}\n{EXAMPLE['nomenclature'].strip()}")
    both = both.replace(metric, f"{metric}\n{EXAMPLE['metric-nomenclature'].strip()}")
    role = next(line for line in page.splitlines() if line.startswith("| `prescribed` | | the node whose"))
    (copy / "with.md").write_text(both.replace(role, f"{role}\n{EXAMPLE['role-nomenclature'].strip()}"), encoding="utf-8")
    (copy / "without.md").write_text(page, encoding="utf-8")
    script = (
        CHECK.partition("import pytest")[0]
        + "sys.path.insert(0, sys.argv[2])\nfrom docs.vocabulary import disagreements\nfrom pathlib import Path\n"
        + "for name in ('with.md', 'without.md'):\n    print(name, list(disagreements(Path(name).read_text(encoding='utf-8'))))"
    )
    done = run(copy, script, str(ROOT / "tests"))
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first == "with.md []"
    assert all(
        text in second for text in ("'Kinds of conductor' lacks `bolt`", "'Metrics' lacks `swing`", "'Channel of a log' lacks `humidity`")
    )
    assert second.count("lacks") == 3


def test_the_guide_s_line_of_a_reader_is_that_of_its_row() -> None:
    row = re.search(r'Format\("(.*?)", "(.*?)"', EXAMPLE["reader-row"])
    assert row
    assert EXAMPLE["reader-guide"].strip() == f"| {row[1]} | {row[2]} | - |"


PROGRAM = """
#include <cstdio>
#include "network/laws.hpp"
using namespace thermid;
int main() {
    const double given[4] = {310.0, 290.0, 0.5, 7.0};
    const Conduct<double> r = conductor<true>(SATURATING, given[0], given[1], given[2], given[3], nullptr);
    std::printf("%.17g %.17g %.17g %.17g %.17g\\n", r.q, r.qa, r.qb, r.phi, r.q1);
    for (int by = 0; by < 4; ++by) {
        Dual x[4];
        for (int k = 0; k < 4; ++k) x[k] = {given[k], k == by ? 1.0 : 0.0};
        std::printf("%.17g ", conductor<true>(SATURATING, x[0], x[1], x[2], x[3], nullptr).q.e);
    }
    std::printf("%s %d", CONDUCTOR_LAWS[SATURATING].name, CONDUCTOR_LAWS[SATURATING].coefficients);
}
"""
"""Heat of the recipe's law with its derivatives, then the derivatives by dual numbers, and its row."""


def test_the_law_of_the_page_is_compiled_and_is_its_formula(tmp_path: Path) -> None:
    compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("there is no C++ compiler (Debian package g++)")
    source = (ROOT / "src" / "kernel" / "network" / "laws.hpp").read_text(encoding="utf-8")
    end = source.index("\n", source.index("ROW(HINGE_DIFF"))
    source = f"{source[:end]} \\\n{EXAMPLE['law-row'].rstrip()}{source[end:]}"
    doc, mark, enum = source.partition("// How a conductor stands in a network")
    assert mark
    (tmp_path / "network").mkdir()
    (tmp_path / "network" / "laws.hpp").write_text(f"{doc}{EXAMPLE['law-function']}\n{mark}{enum}", encoding="utf-8")
    (tmp_path / "law.cpp").write_text(PROGRAM, encoding="utf-8")
    options = ["-std=c++17", f"-I{tmp_path}", f"-I{ROOT / 'src' / 'kernel'}", "-o", "law"]
    subprocess.run([compiler, *options, "law.cpp"], cwd=tmp_path, check=True)
    values, *rest = subprocess.run([tmp_path / "law"], capture_output=True, text=True, check=True).stdout.splitlines()
    *dual, name, coefficients = rest[0].split()
    heat, *slopes = map(float, values.split())
    body = textwrap.dedent(EXAMPLE["law-reference"])
    k, spelled = SimpleNamespace(SATURATING=1), {}
    exec(f"def formula(k, kind, g, d, c, slots):\n{textwrap.indent(body, '    ')}", spelled)
    assert heat == pytest.approx(spelled["formula"](k, 1, 0.5, 20.0, [0.5, 7.0], [0, 1]), rel=1e-14)
    assert slopes == pytest.approx([float(x) for x in dual], rel=1e-13)
    assert f'Law("{name}", (' in EXAMPLE["law-kind"]
    assert int(coefficients) == 2


def test_the_kind_of_the_page_s_law_is_a_function_of_kinds() -> None:
    """What it takes and what it refuses; the kernel here does not have its law."""
    names = {"Fields": dict, "Law": Law, "value_of": value_of, "DeckError": DeckError}
    exec(EXAMPLE["law-kind"], names)
    law = names["_wick"]({"conductance": 5.0, "heat_limit": 20.0})
    assert (law.form, law.coefficients) == ("saturating", (5.0, 4.0))
    with pytest.raises(DeckError, match="needs a conductance and a heat limit above zero"):
        names["_wick"]({"conductance": -5.0, "heat_limit": -20.0})


def test_files_of_the_map_exist() -> None:
    """Paths between backticks that begin in a room."""
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir()}
    named = [word for word in codes(prose(TEXT)) if word.partition("/")[0] in rooms and "/" in word]
    assert len(named) > 20
    assert [word for word in named if not (PACKAGE / word).is_dir() and not (PACKAGE / f"{word}.py").is_file()] == []
    recipes = (ROOT / "docs" / "recipes.md").read_text(encoding="utf-8")
    paths = [
        word
        for word in (*EXAMPLE["quick-check"].split(), *codes(prose(recipes)))
        if word.startswith(("tests/", "src/", "docs/", "scripts/"))
    ]
    assert len(paths) > 12
    assert [path for path in paths if not (ROOT / path).exists()] == []


WALK = """
import json, sys
from pathlib import Path
import numpy as np

entered = set()

def note(frame, event, argument):
    if event == "call" and frame.f_code.co_name != "<module>":
        entered.add(frame.f_code.co_filename)

sys.setprofile(note)
import thermid as td
from thermid.app.objects import calibration_object

part = td.load_model("plate.toml")
bench = td.Scenario("bench", boundaries={"air": "20 [degC]"}, start="20 [degC]", duration="30 [min]")
run = td.simulate(part.with_values({"film.htc": "7 [W/(m^2 K)]"}), bench)
read = run["plate"].celsius + np.random.default_rng(1).normal(0.0, 0.05, run.times.size)
np.savetxt("log.csv", np.column_stack([run.times, read]), delimiter=",", header="time_s,T plate [degC]", comments="")
fit = td.calibrate(part, td.read_record("log.csv", {"plate": "T plate"}, noise={"plate": "0.05 [K]"}), ["film.htc"], scenario=bench)
calibration_object(fit)
fit.values.save("plate.values.toml")
sys.setprofile(None)
root = Path(td.__file__).parent
print(json.dumps(sorted(Path(f).relative_to(root).with_suffix("").as_posix() for f in entered if Path(f).is_relative_to(root))))
"""
WALKED = """
title = "plate"
needs = ["air"]
nodes = { plate = { capacitance = "100 [J/K]" } }
loads = { heater = { into = "plate", power = "2 [W]" } }
[conductors.film]
kind = "convection"
between = ["plate", "air"]
htc = { value = "8 [W/(m^2 K)]", min = 2, max = 20 }
area = "0.02 [m^2]"
"""
AT_THE_BENCH = {"bench/_wire", "bench/logger", "bench/benchlog"}


def test_the_walks_are_those_of_a_running_fit(tmp_path: Path) -> None:
    """Each file that the walks of a parameter and of a line of a log name has a function that such a fit calls."""
    (tmp_path / "plate.toml").write_text(WALKED, encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", WALK], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    entered = set(json.loads(done.stdout))
    for title in ("One parameter", "One line of a log"):
        walk = TEXT.partition(f"**{title}**")[2].partition("\n\n")[0]
        named = [word for word in codes(walk) if "/" in word and not word.startswith(("src/", "htc"))]
        assert len(named) > 7
        asleep = [w for w in named if w not in entered | AT_THE_BENCH and not any(e.startswith(f"{w}/") for e in entered)]
        assert not asleep, f"'{title}' names files that do nothing there"
    kernel = [word for word in codes(prose(TEXT)) if word.startswith("src/kernel/")]
    assert kernel
    assert all((ROOT / word).is_file() for word in kernel)


def lines(module: str) -> int:
    return len((PACKAGE / f"{module}.py").read_text(encoding="utf-8").splitlines())


def test_the_reading_path_is_as_long_as_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    section = prose(TEXT).partition("## Reading the code")[2]
    path = codes(section)
    stated = re.search(r"about (\d+) lines", section)
    assert stated
    assert (path[0], path[-1]) == ("__init__", "campaign/_stages")
    counts = {module: lines(module) for module in path}
    total = sum(counts.values())
    below = ["base/errors", "base/_units", "base/_expression", "base/linear_algebra"]
    inside = [p for room in ("model", "simulation") for p in sorted((PACKAGE / room).rglob("*.py"))]
    below += [p.relative_to(PACKAGE).with_suffix("").as_posix() for p in inside]
    whole = sum(map(lines, dict.fromkeys([*path, *below])))
    with capsys.disabled():
        print(f"\nreading path: {total} lines in {len(path)} modules ({counts}); with all that these rooms hold: {whole}")
    assert abs(total - int(stated[1])) <= 100
    assert whole > 2 * total  # "more than as much again"
