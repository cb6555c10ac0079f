"""A proposal or a template as files: a commented deck, scenario and campaign, schemas for editors, and logs cut for fit and verdict."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import tomlkit

from thermid.base.errors import NameNotFoundError, RecordError, ThermidError, nearest
from thermid.base.files import FileKind, FileKinds, by_grammar, file_kinds, json_schema, parse_toml, read_text
from thermid.campaign._start.proposal import Proposal
from thermid.fit.calibration import LocalSpec, Request
from thermid.measure.records import Record, thinned_step
from thermid.model.tree import Parameter, model_text

SCHEMA: Final = FileKind("JSON Schema", endings=(".json",))
FOLDER: Final = "schema"
"""Folder of the schemas, in that of the project."""


def headed(text: str, kind: str, depth: int = 0) -> str:
    """Return the text of a file with its first line, `#:schema PATH`, as editors with a TOML language server read it.

    Parameters
    ----------
    text : str      The file.
    kind : str      Its kind, of `file_kinds`.
    depth : int     How many folders it lies below that of the project.
    """
    return f"#:schema {'../' * depth or './'}{_place(kind).as_posix()}\n{text}"


def may_write_schemas(folder: Path, kinds: Iterable[str]) -> None:
    """Ask whether the schemas may be written, where their folder is there.

    Raises
    ------
    OutputError   When a file is there that thermid did not write.
    """
    for kind in kinds if (folder / FOLDER).is_dir() else ():
        SCHEMA.titled(kind).may_write(folder / _place(kind))


def write_schemas(folder: Path, kinds: Iterable[str]) -> list[Path]:
    """Write the schemas of kinds of files and return their paths.

    Raises
    ------
    OutputError   When a file is there that thermid did not write.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    return [SCHEMA.titled(k).save_text(folder / _place(k), json.dumps(json_schema(k), indent=2)) for k in sorted(set(kinds))]


def head_copies(folder: Path, files: Sequence[Path]) -> list[Path]:
    """Give copied TOML files their first line, write the schemas, and return these.

    Files below a lock stay as they are: it holds their checksums.

    Parameters
    ----------
    folder : Path       Of the project.
    files : sequence    Its files.
    """
    locked = {file.parent for file in files if file.name.endswith(".lock.json")}
    texts = {f: read_text(f) for f in files if f.suffix == ".toml" and locked.isdisjoint(f.parents)}
    kind_of_file = {file: kind for file, text in texts.items() if (kind := kind_of(text))}
    for file, kind in kind_of_file.items():
        file.unlink()
        FileKinds.COPY.save_bytes(file, headed(texts[file], kind, len(file.relative_to(folder).parents) - 1).encode())
    return write_schemas(folder, kind_of_file.values()) if kind_of_file else []


def kind_of(text: str) -> str:
    """Return the kind of a TOML file: the one whose grammar it follows; empty where none does, or several do."""
    try:
        content = parse_toml(text)
    except tomllib.TOMLDecodeError:
        return ""
    kinds = [kind for kind in file_kinds() if _follows(kind, content)]
    return kinds[0] if len(kinds) == 1 else ""


def _follows(kind: str, content: object) -> bool:
    """Whether a content is one of a kind by its grammar."""
    try:
        by_grammar(kind, content, lambda key: key)
    except ThermidError:
        return False
    return True


def _place(kind: str) -> Path:
    """Return where the schema of a kind stands, in the folder of the project."""
    return Path(FOLDER, f"{kind}.schema.json")


TEMPLATE: Final = FileKind("project file")
ROOT: Final = "# This file marks the root of a thermid project: decks and logs are looked for below it.\n"

_PART = """\
# One part in a room. Replace the numbers by yours, and give the source of each.
title  = "part"
needs  = ["room"]
offers = ["case", "skin"]

[nodes.case]
mass          = { value = "0.5 [kg]", source = "assumed", note = "measure with a scale" }
specific_heat = { value = "900 [J/(kg K)]", source = "published", note = "aluminium" }

[surfaces.skin]
of            = "case"
to            = "room"
area          = { value = "300 [cm^2]", source = "assumed", note = "measure with a ruler" }
effective_htc = { value = "8 [W/(m^2 K)]", min = 2, max = 30, source = "assumed", note = "with radiation; fit to a test" }

[loads]
heat = { into = "case", power = { value = "5 [W]", source = "assumed", note = "volts times amperes" } }
"""

_SCENARIO = """\
# Switched on in a room of 23 degC, for four hours.
duration = "4 [h]"
start    = "23 [degC]"

[boundaries]
room = "23 [degC]"
"""

_BOX = """\
# A closed box of two boards: boards give heat to the air in the box and to the walls by their screws; the walls give it to the room.
title = "box"
needs = ["room"]

[nodes]
board_1 = { capacitance = { value = "120 [J/K]", source = "assumed", note = "mass times specific heat" } }
board_2 = { capacitance = { value = "80 [J/K]", source = "assumed" } }
air     = { capacitance = { value = "5 [J/K]", source = "assumed", note = "4 litres of air" } }
walls   = { capacitance = { value = "900 [J/K]", source = "assumed", note = "1 kg of aluminium" } }

# All conductances are assumed; fit them to a test.
[conductors]
board_1_air   = { kind = "conduction", between = ["board_1", "air"], conductance = "0.15 [W/K]" }
board_2_air   = { kind = "conduction", between = ["board_2", "air"], conductance = "0.1 [W/K]" }
board_1_walls = { kind = "conduction", between = ["board_1", "walls"], conductance = "0.3 [W/K]" } # screws and card guides
board_2_walls = { kind = "conduction", between = ["board_2", "walls"], conductance = "0.3 [W/K]" }
air_walls     = { kind = "conduction", between = ["air", "walls"], conductance = "0.6 [W/K]" }

[surfaces.outside]
of            = "walls"
to            = "room"
area          = { value = "0.15 [m^2]", source = "assumed" }
effective_htc = { value = "8 [W/(m^2 K)]", min = 2, max = 30, source = "assumed" }

[loads]
heat_1 = { into = "board_1", power = { value = "8 [W]", source = "assumed" } }
heat_2 = { into = "board_2", power = { value = "4 [W]", source = "assumed" } }
"""

_CHAMBER = """\
# Two cold and hot soaks in a chamber, switched on: the air of the chamber is the room of the part.
duration = "16 [h]"
start    = "23 [degC]"

[boundaries.room]
times  = ["0 [h]", "1 [h]", "5 [h]", "6.5 [h]", "10.5 [h]", "12 [h]", "16 [h]"]
values = ["23 [degC]", "-10 [degC]", "-10 [degC]", "50 [degC]", "50 [degC]", "23 [degC]", "23 [degC]"]
"""

TEMPLATES: Final[Mapping[str, tuple[str, Mapping[str, str]]]] = {
    "part": ("one part in a room", {"part.toml": _PART, "scenario.toml": _SCENARIO}),
    "box": ("a closed box of two boards", {"box.toml": _BOX, "scenario.toml": _SCENARIO}),
    "chamber": ("a part in a chamber test", {"part.toml": _PART, "scenario.toml": _CHAMBER}),
}
"""Name -> what it is, and its files. The fourth, `tclab`, is the shipped example of that name."""


def write_template(name: str, folder: Path) -> tuple[str, list[Path]]:
    """Write a project of a template; return its next command and its files.

    Raises
    ------
    NameNotFoundError   When there is no template of that name.
    OutputError         When a file is there that thermid did not write.
    """
    if name not in TEMPLATES:
        names = [*TEMPLATES, "tclab"]
        raise NameNotFoundError(f"no template '{name}'; there are {', '.join(names)}.{nearest(name, names)}", "--template")
    files = dict(TEMPLATES[name][1])
    folder.mkdir(parents=True, exist_ok=True)
    deck = next(iter(files))
    kinds = {file: FileKinds.DECK.titled(Path(file).stem) if file == deck else TEMPLATE.titled(Path(file).stem) for file in files}
    grammars = {file: "deck" if file == deck else "scenario" for file in files}
    for file, kind in kinds.items():
        kind.may_write(folder / file)
    may_write_schemas(folder, grammars.values())
    written = [kinds[file].save_text(folder / file, headed(text, grammars[file])) for file, text in files.items()]
    written += [*write_schemas(folder, grammars.values()), *_write_root(folder)]
    return f"thermid simulate {folder / deck} --scenario {folder / 'scenario.toml'}", written


def _write_root(folder: Path) -> list[Path]:
    """Write the file that marks the root of a project, where none is there, and return it."""
    marker = folder / "thermid.toml"
    return [] if marker.exists() else [TEMPLATE.titled("root").save_text(marker, ROOT)]


FITTED, HOLDOUT_NAME = 0.7, "holdout"
"""Part of a single log that is fitted; the rest judges."""
VERDICT_NOISES, VERDICT_SHARE_OF_RANGE = 4.0, 0.03
"""Limit of the first verdict: so many noises, or so much of the range of the readings, whichever is more."""


@dataclass(frozen=True, eq=False)
class Written:
    """What was written.

    Parameters
    ----------
    folder : Path
    files : tuple of Path
    proposal : Proposal
    fixed : tuple of str        Values that the log does not tell; the campaign keeps them fixed.
    left_out : tuple of str     Ways of heat that were left out because the log does not show them.
    masked : tuple of str       Readings that are no temperatures and were left out, in words.
    """

    folder: Path
    files: tuple[Path, ...]
    proposal: Proposal
    fixed: tuple[str, ...]
    left_out: tuple[str, ...]
    masked: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return what is proposed, what is open, and the files, as plain numbers for JSON: [K] where a key ends so."""
        p = self.proposal
        return {
            "masses": p.chosen.masses,
            "cannot_tell": sorted(p.search.orders) if len(p.search.orders) > 1 else [],
            "changes": [c.name for c in p.chosen.changes],
            "rmse_K": p.chosen.rmse,
            "assumed": p.assumed,
            "powers": p.powers_text or p.shares_text,
            "masked": list(self.masked),
            "not_used": dict(p.roles.ignored),
            "unexplained": p.unexplained,
            "not_physical": [c.to_dict() for c in p.not_physical],
            "depends_on_structure": [{"path": path, "low": low, "high": high} for path, (low, high) in p.depending.items()],
            "offsets_K": {c: {"value": v, "error": e} for c, (v, e) in p.offsets.items()},
            "questions": list(p.roles.questions),
            **{"fixed": list(self.fixed), "left_out": list(self.left_out)},
            "files": [str(f) for f in self.files],
        }

    def __str__(self) -> str:
        """Return the proposal, the files, and the next command."""
        answer, *tried = str(self.proposal).split("\n")
        unused = [f"Not used: {column}: {why}" for column, why in self.proposal.roles.ignored.items()]
        lines = [answer, *unused, *self.masked, *tried]
        lines += [f"Left out, because the log does not determine them: {', '.join(self.left_out)}"] if self.left_out else []
        lines += [f"Fixed, because the log does not determine them: {', '.join(self.fixed)}"] if self.fixed else []
        lines += [f"wrote {file}" for file in self.files]
        campaign = self.folder / "campaign.toml"
        return "\n".join([*lines, f"next: thermid check {campaign}; thermid report {campaign} --to {self.folder / 'report.html'}"])


def parted(records: Sequence[Record]) -> tuple[list[Record], Record, list[str]]:
    """Return what is fitted and what judges: of several logs the last one judges, of a single one its last three tenths.

    A channel without a reading in a part of a single log is left out there; the third names it.
    """
    if len(records) > 1:
        return list(records[:-1]), replace(records[-1], name=HOLDOUT_NAME), []
    (one,) = records
    early = one.times <= float(one.times[0]) + FITTED * one.duration
    fitted, holdout = (replace(one, channels={n: c for n, c in one.channels.items() if c.valid[part].any()}) for part in (early, ~early))
    fitted = replace(fitted.trim("start", float(one.times[early][-1])), name="fit")
    holdout = replace(holdout.trim(float(one.times[~early][0]), "end").shift_start(), name=HOLDOUT_NAME)
    parts = {"fitted part": fitted, "hold-out record": holdout}
    remarks = [
        f"{n} has no reading in the {part} and is left out there" for part, r in parts.items() for n in one.channels if n not in r.channels
    ]
    return [fitted], holdout, remarks


def may_write_project(folder: Path, title: str) -> dict[str, tuple[str, FileKind]]:
    """Return file -> grammar and kind of a project that may be written; ask before a search.

    Raises
    ------
    OutputError   When a file is there that thermid did not write.
    OSError       When the folder is a file, or a file is a folder or read-only.
    """
    kinds = {f"{title}.toml": ("deck", FileKinds.DECK.titled(title))}  # in the order in which they are written
    kinds |= {f"{k}.toml": (k, TEMPLATE.titled(k)) for k in ("scenario", "campaign")}
    for name, (_, kind) in kinds.items() if folder.exists() and [*folder.iterdir()] else ():
        kind.may_write(folder / name)
    may_write_schemas(folder, (grammar for grammar, _ in kinds.values()))
    return kinds


def write_project(
    folder: Path, proposal: Proposal, fitted: Sequence[Record], holdout: Record, source: str, title: str, masked: Sequence[str] = ()
) -> Written:
    """Write a proposal as a project that `check`, `calibrate` and `report` take as it is.

    Parameters
    ----------
    folder : Path           Where; files that thermid did not write there are never replaced.
    proposal : Proposal
    fitted : sequence       The logs in full that are fitted.
    holdout : Record        The log that judges.
    source : str            Where they came from, in words.
    title : str             Of the model.
    masked : sequence       Readings that are no temperatures and are left out of the logs, in words.

    Raises
    ------
    OutputError     When a file is there that thermid did not write.
    """
    request, fixed, left_out = proposal.first_fit.request, proposal.first_fit.fixed, proposal.first_fit.left_out
    texts = (
        _deck(proposal, request, fixed, left_out, source, title),
        _scenario(proposal, fitted),
        _campaign(proposal, request, fitted, holdout, f"{title}.toml", source, title, masked),
    )
    kinds, logs = may_write_project(folder, title), folder / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    files = [folder / name for name in kinds]
    shares = [p.share for p in proposal.roles.powers if p.share == p.channel]  # the log has the whole power
    for record in (*fitted, holdout):
        replace(record, channels={n: c for n, c in record.channels.items() if n not in shares}).to_csv(logs / f"{record.name}.csv")
        files.append(logs / f"{record.name}.csv")
    for (name, (grammar, kind)), text in zip(kinds.items(), texts, strict=True):
        kind.save_text(folder / name, headed(text, grammar))
    files += [*write_schemas(folder, (grammar for grammar, _ in kinds.values())), *_write_root(folder)]
    return Written(folder, tuple(files), proposal, fixed, left_out, tuple(masked))


def _as_comments(lines: Sequence[str]) -> str:
    """Return lines as comments of TOML."""
    return "".join(f"# {line}\n" for line in lines)


def _deck(proposal: Proposal, request: Request, fixed: Sequence[str], left_out: Sequence[str], source: str, title: str) -> str:
    """Return the deck with a comment for each element."""
    document = tomlkit.parse(model_text(replace(request.model, title=title, use=f"First model of {source}")))
    parts = {node: column for column, node in proposal.roles.parts.items()}
    measured = {c.target for r in request.records for c in r.channels.values()}
    for name, item in document.get("nodes", {}).items():
        held = "; fixed: the log does not determine it" if f"{name}.capacitance" in fixed else ""
        if name in parts and name in measured:
            item.comment(f"measured: column {parts[name]}{held}")
        elif name in measured:
            item.comment("the sensor itself, which lags behind its part; its heat capacity is small")
        else:
            item.comment(
                "hidden: no sensor, proposed because the readings are likelier with it" if name not in parts else "read through its sensor"
            )
    for name, item in document.get("conductors", {}).items():
        path = next((f for f in fixed if f.partition(".")[0] == name), "")
        item.comment("fixed: the log does not determine it" if path else "fitted by the campaign")
    for name, item in document.get("loads", {}).items():
        power = next((p for p in proposal.roles.powers if p.load == name), None)
        item.comment(f"column {power.column}" if power else "proposed")
    head = [
        f"First model of {source}, proposed by thermid init: {proposal.chosen.masses} masses, RMSE {proposal.chosen.rmse:.3g} K.",
        "Replace values that you know better: masses from a scale, areas from a drawing, powers from a data sheet.",
        *proposal.findings,
    ]
    head += [f"Left out, because the log does not determine them: {', '.join(left_out)}."] if left_out else []
    return _as_comments(head) + tomlkit.dumps(document)


def _scenario(proposal: Proposal, records: Sequence[Record]) -> str:
    """Return a scenario to play with: the powers of the log on for as long as the log."""
    longest = max(records, key=lambda r: r.duration)
    around = _ambient(proposal, longest)
    lines = ["Scenario for thermid simulate. Change powers, surroundings and duration as needed."]
    duties = [f'{p.load} = "100 [%]"\n' for p in proposal.roles.powers if p.anchored]
    out = [
        _as_comments(lines),
        f'duration = "{longest.duration / 3600.0:.3g} [h]"\n',
        f'start    = "{around:.4g} [degC]"\n',
        f'\n[boundaries]\n{proposal.roles.boundary} = "{around:.4g} [degC]"\n',
    ]
    powers = [p for p in proposal.roles.powers if not p.anchored]
    out += ["\n[loads]\n"] if powers else []
    for p in powers:
        watts = longest[p.column].values if p.column in longest.channels else np.zeros(1)
        share = proposal.share(p)
        of = f"{100 * share:.3g} % of " if p.share else ""
        out.append(f'{p.load} = "{share * float(np.nanmax(watts)):.4g} [W]"  # {of}the highest of column {p.column}\n')
    return "".join([*out, *(["\n[commands]\n", *duties] if duties else [])])


def _ambient(proposal: Proposal, record: Record) -> float:
    """Return a temperature of the surroundings: the median of their log, else the one stated, else the lowest first reading. [degC]"""
    roles = proposal.roles
    if roles.logged and roles.surroundings in record.channels:
        channel = record[roles.surroundings]
        return float(np.median(channel.values[channel.valid])) - 273.15
    if roles.surroundings:
        return float(Parameter.read(roles.surroundings).expression.literal.value) - 273.15  # type: ignore[union-attr]
    return min(float(record[c].values[record[c].valid][0]) for c in roles.parts if c in record.channels) - 273.15


def _campaign(
    proposal: Proposal,
    request: Request,
    fitted: Sequence[Record],
    holdout: Record,
    deck: str,
    source: str,
    title: str,
    masked: Sequence[str],
) -> str:
    """Return the campaign: the logs, one stage, one verdict."""
    seats = {c.name: str(c.target) for c in request.records[0].channels.values() if c.role == "node"}
    channels = _channels(proposal, request, seats)
    whole = {p.channel: p.column for p in proposal.roles.powers if p.share}
    step = thinned_step(max(r.duration for r in fitted)) if max(r.times.size for r in fitted) > 600 else 0.0
    prepare = {"prepare": [{"resample": {"step": f"{step:g} [s]"}}]} if step else {}
    records = {
        r.name: {
            "file": f"logs/{r.name}.csv",
            **prepare,
            **_gases(r),
            "channels": _written(r, channels, whole),
            **({"local": starts} if (starts := _local(request.record_local.get(r.name, {}))) else {}),
        }
        for r in (*fitted, holdout)
    }
    local, priors = _local(request.local), {path: {"mean": mean, "sd": sd} for path, (mean, sd) in request.priors.items()}
    stage: dict[str, Any] = {"name": "first fit", "model": deck, "records": [r.name for r in fitted], "free": list(request.free)}
    stage["structural_errors"] = True  # one of several structures that the log allows
    stage |= {k: v for k, v in (("scenario", _stage_scenario(proposal, request)), ("priors", priors), ("local", local)) if v}
    criteria = {"sensors": {c: {"rmse": f"{_limit(proposal, fitted, c):.2g} [K]"} for c in seats if c in holdout.channels}}
    unseen = {**{k: v for k, v in local.items() if not k.startswith("initial.")}, **_hidden_starts(request, fitted, seats)}
    verdict = {
        "name": "hold-out",
        "model": "first fit",
        "record": HOLDOUT_NAME,
        "criteria": criteria,
        **({"local": unseen} if unseen else {}),
    }
    document = tomlkit.document()
    document.add("title", f"{title}: first fit and hold-out")
    document.add("note", f"Written by thermid init from {source}.")
    for key, content in (("records", records), ("stages", [stage]), ("verdicts", [verdict])):
        document.add(key, tomlkit.item(content))
    head = [
        f"Campaign for the logs of {source}. The hold-out record is not fitted; it validates the model.",
        f"Of a single log its last {100 * (1 - FITTED):.0f} % validate the model; a second test with other powers is a stronger "
        "validation.",
        f"Limits of the verdict: {VERDICT_NOISES:g} noises or {100 * VERDICT_SHARE_OF_RANGE:g} % of the range of the readings. "
        "Replace them by yours.",
        "The noise is estimated from second differences of the readings.",
        *([proposal.powers_text] if proposal.powers_text else []),
        proposal.offsets_text,
        *([proposal.instants_text] if proposal.instants_text else []),
        *(f"{reason}; empty in the logs beside this file." for reason in masked),
    ]
    return _as_comments(head) + tomlkit.dumps(document)


def _written(record: Record, channels: Mapping[str, Mapping[str, Any]], whole: Mapping[str, str]) -> dict[str, Any]:
    """Return the table of a record's channels by their columns; shares of a power have names of their own, `whole` is their column."""
    inside = {}
    for name, channel in channels.items():
        if name in record.channels:
            column = record[whole.get(name, name)].column or whole.get(name, name)
            inline = inside[name if name in whole else column] = tomlkit.inline_table()
            inline.update({k: v for k, v in channel.items() if k not in ("unit", "full_scale", "power")})
            inline.update({"power": column if column.isidentifier() else f"`{column}`"} if name in whole else {})
    return inside


def _channels(proposal: Proposal, request: Request, seats: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Return column -> its table: thermometers at the nodes that they read, powers that changed between their samples marked so."""
    accuracy = {c.name: c.accuracy for r in request.records for c in r.channels.values() if c.accuracy}
    channels = proposal.roles.channels(proposal.noise, accuracy)
    for column, node in seats.items():
        channels[column]["node"] = node
    for c in (c for r in request.records for c in r.channels.values() if c.prompt is False):
        channels[c.name]["prompt"] = False
    return channels


def _hidden_starts(request: Request, records: Sequence[Record], seats: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return starts of masses without a sensor in a record that begins warm: near the first reading, within the range of the readings."""
    column = next(iter(seats))
    values = records[0][column].values[records[0][column].valid]
    spread = f"{max(0.5 * float(np.ptp(values)), 1.0):.2g} [K]"
    hidden = [n for n in request.model.nodes if n not in seats.values()]
    return {f"initial.{n}": {"start": column, "sd": spread} for n in hidden}


def _limit(proposal: Proposal, records: Sequence[Record], column: str) -> float:
    """Return the limit of a sensor for the verdict, rounded up to 0.01 K: by noise and range. [K]

    max(`VERDICT_NOISES` noise, `VERDICT_SHARE_OF_RANGE` range), with a noise of 0.1 K where none is known.
    """
    values = [r[column].values[r[column].valid] for r in records if column in r.channels]
    spread = max((float(np.ptp(v)) for v in values), default=1.0)
    size = max(VERDICT_NOISES * proposal.noise.get(column, 0.1), VERDICT_SHARE_OF_RANGE * spread)
    return float(math.ceil(size * 100.0) / 100.0)


def _gases(record: Record) -> dict[str, Any]:
    """Return what a record states of its gases as its table in a campaign has it.

    Raises
    ------
    RecordError   When a pressure changes in time: only a campaign written by hand can name its column.
    """
    for gas, state in record.environment.items():
        if state.pressure.bounds[0] != state.pressure.bounds[1]:
            raise RecordError(
                f"its pressure changes in time ({state}), which is not written here. Leave it out and name its column in the campaign.",
                f"record '{record.name}', environment.{gas}",
                code="output.not-expressible",
            )
    gases = {gas: {"pressure": f"{s.pressure.bounds[0]:g} [Pa]", "gas": s.gas} for gas, s in record.environment.items()}
    return {"environment": gases} if gases else {}


def _stage_scenario(proposal: Proposal, request: Request) -> dict[str, Any]:
    """Return what the stage says beside the logs: surroundings that are not logged, and starts."""
    roles, out = proposal.roles, {}
    if roles.surroundings and not roles.logged:
        out["boundaries"] = {roles.boundary: roles.surroundings}
    scenario_of_record = next(iter([*(request.scenarios.get(r.name) for r in request.records), request.scenarios.get("*")]), None)
    initial = {n: c if isinstance(c, str) else f"{c!r} [K]" for n, c in (scenario_of_record.initial if scenario_of_record else {}).items()}
    return {**out, **({"initial": initial} if initial else {})}


def _local(specs: Mapping[str, LocalSpec]) -> dict[str, dict[str, str]]:
    """Return what a record has for itself, as tables of a campaign."""
    return {name: {"start": spec.start, **({"sd": f"{spec.sd:.3g} [K]"} if math.isfinite(spec.sd) else {})} for name, spec in specs.items()}
