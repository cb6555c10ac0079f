"""`Building`: the view Build; a draft that the page edits by commands, with a log looked at and bound to it, run and fitted."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from thermid.app.objects import fit_object
from thermid.app.studio.desk import Desk, compared, conditions_object, curves_object, finished, number_of, text_of, texts_of
from thermid.app.studio.draft import CAMPAIGN, DECK, PLACES, VIEW, Draft, decks_in, keep, parsed_line, recalled
from thermid.app.studio.follow import WATCHED_ROLES, Follower, looked_at
from thermid.app.studio.shapes import (
    PALETTE,
    SOURCES,
    added,
    free_name,
    palette,
    removed,
    renamed,
    scheduled,
    schedules,
    sheets,
    stored,
    valued,
)
from thermid.app.studio.work import Jobs, JobState
from thermid.app.texts import with_unit
from thermid.base.errors import DeckError, MissingDataError, NameNotFoundError, ThermidError, quoted, refuse_unknown
from thermid.base.files import FileKinds, read_bytes, read_toml, resolve_inside
from thermid.base.units import from_si, short
from thermid.campaign.stages import Criteria, request_of
from thermid.campaign.start import ACCURACY, VERDICT_NOISES, VERDICT_SHARE_OF_RANGE, word
from thermid.fit.calibration import Calibration, Request, build_problem, fit
from thermid.measure.looks import clocks_of, look, offset_range, stated_offset
from thermid.measure.readers import name_and_unit, read_record
from thermid.measure.records import Record
from thermid.model.tree import Edit, Model, literal
from thermid.reporting.diagrams import card_places
from thermid.simulation.runs import Scenario, compile_network

Body = Mapping[str, Any]
PLACE_GRID: Final = 8.0
"""Places are multiples of this. [px]"""
CARD_ROOM: Final = (216.0, 80.0)
"""Room of a node on the canvas, with that for the labels beside it. [px]"""


class Building:
    """One draft and what is done with it.

    Parameters
    ----------
    path : Path     The deck, or a campaign; a deck that is not there yet is begun.
    below : callable    Return stage -> its fit, of those that are done: what the stage inherits.
    stage : int         Place of the stage in the campaign; -1 is the last one.
    """

    def __init__(self, path: Path, below: Callable[[], Mapping[str, Calibration]] = dict, stage: int = -1) -> None:
        self.path, self._below = path, below
        self.draft, self.notice = recalled(path, stage)
        self.jobs = Jobs()
        self._model: tuple[str, Model] | None = None
        self._opened = ""
        self._looks: dict[Path, tuple[Any, dict[str, Any]]] = {}
        self.fitted: dict[str, dict[str, Any]] = {}

    # ---- what the page is told -------------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """Return everything that the page shows of the draft."""
        draft, text = self.draft, self.draft.deck.text
        log = self._bound()
        content, channels = draft.deck.content, self._together(log)
        elements = [self._logged(e, channels) for e in sheets(draft.deck)]
        logged = {c.get("boundary") for c in channels}
        course = self._stage().get("scenario", {}).get("boundaries", {})
        held = {n: str(course.get(n, "")) for n in content.get("needs", []) if n not in logged}
        unseen = {t: {*v} - schedules(content) if t == "controls" else v for t, v in content.items() if isinstance(v, Mapping)}
        others = {t: len(v) for t, v in unseen.items() if t not in _SHOWN and v}
        return {
            **{"file": draft.deck.path.name, "title": content["title"], "text": text.removeprefix("\ufeff"), "notice": self.notice},
            **{"elements": elements, "others": others, "places": self._places(elements), "palette": palette(), "sources": SOURCES},
            **{"faults": self.faults(), "undo": len(draft.past), "redo": len(draft.future), "unsaved": [*draft.to_save()]},
            **{
                "changed": list(draft.moved_on()),
                "log": log,
                "records": self._records(),
                "parameters": self._parameters(),
                "decks": [d for d in decks_in(draft.deck.path.parent) if d != draft.deck.path.name],
            },
            "logs": Follower(draft.documents[CAMPAIGN].path.parent).offered()["logs"],
            "missing": sum(f["missing"] for e in elements for f in e["fields"]),
            **{"stages": [s["name"] for s in draft.documents[CAMPAIGN].content["stages"]], "stage": self._stage()["name"]},
            **{"inherited": self._inherited(), "held": held if log is not None else {}, **self._refused()},
        }

    @property
    def model(self) -> Model:
        """The model of the draft as it is."""
        text = self.draft.deck.text
        if self._model is None or self._model[0] != text:
            self._model = text, self.draft.model
        return self._model[1]

    def faults(self) -> list[dict[str, Any]]:
        """Return what `thermid check` says of the deck, each with its line."""
        return [self._fault(f.severity, f.code, f.message, f.where) for f in self.model.check()]

    def _fault(self, severity: str, code: str, message: str, where: str, text: str | None = None) -> dict[str, Any]:
        """Return a fault for a page, with the line of the text that it is about."""
        numbered = re.search(r"line (\d+)", message)
        line = int(numbered[1]) if numbered else parsed_line(self.draft.deck.text if text is None else text, where)
        return {"severity": severity, "code": code, "message": message, "where": where, "line": line}

    def _places(self, elements: Sequence[Mapping[str, Any]]) -> dict[str, tuple[float, float]]:
        """Return the place of every node: where a person put it, else where the map of reports has it or there is room."""
        placed = self.draft.documents[VIEW].content.get(PLACES, {})
        nodes = [e["name"] for e in elements if e["table"] in ("nodes", "needs", "submodels")]
        pairs = [tuple(n.partition(".")[0] for n in e["ends"][:2]) for e in elements if len(e["ends"]) > 1]
        pairs += [(e["name"], end.partition(".")[0]) for e in elements if e["table"] == "submodels" for end in e["ends"]]
        after = card_places(nodes, [(a, b) for a, b in pairs if a != b and {a, b} <= set(nodes)], CARD_ROOM)
        out = {n: (float(placed[n][0]), float(placed[n][1])) for n in nodes if n in placed}
        for name, place in after.items():
            if name not in out:
                out[name] = _beside(place, out.values())
        return out

    def _together(self, log: Mapping[str, Any] | None) -> list[Mapping[str, Any]]:
        """Return what the columns of a log are, and those of the logs of other loggers that belong to the same test."""
        if log is None:
            return []
        records = self.draft.documents[CAMPAIGN].content["records"]
        host = next((n for n in records if log["record"] in _joined(records[n])), log["record"])
        return [
            c
            for n in (host, *_joined(records[host]))
            for c in records.get(n, {"channels": {}})["channels"].values()
            if isinstance(c, Mapping)
        ]

    def _logged(self, element: dict[str, Any], channels: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """Return an element as the page shows it: the power of a load that a column of a log gives is not missing."""
        if element["table"] != "loads" or not any(t.get("load") == element["name"] for t in channels):
            return element
        return {**element, "logged": "logged", "fields": [f | {"missing": False} for f in element["fields"]]}

    def _parameters(self) -> list[dict[str, Any]]:
        """Return the values that a fit may find, and whether it is asked to."""
        free, switching = set(self._stage().get("free", [])), schedules(self.draft.deck.content)
        table = self.model.parameter_table()
        return [
            {"path": path, "text": e.parameter.text, "free": path in free}
            for path, e in table.items()
            if (literal := e.parameter.expression.literal) is not None and literal.value > 0 and path.partition(".")[0] not in switching
        ]

    def _stage(self) -> dict[str, Any]:
        """Return the table of the stage."""
        return dict(self.draft.documents[CAMPAIGN].content["stages"][self.draft.stage])

    def _inherited(self) -> list[dict[str, Any]]:
        """Return the values that the stage takes from others, in their units, or why it has none yet."""
        if not self._stage().get("inherit"):
            return []
        try:
            states = self.request().store.states.values()
        except ThermidError as error:
            return [{"path": "", "words": error.message}]
        shown = ((s.path, from_si(s.value, s.unit), s) for s in states if s.kind == "parameter")
        return [{"path": path, "words": f"{value:.4g} [{s.unit}], {s.origin}"} for path, value, s in shown]

    def _bound(self) -> dict[str, Any] | None:
        """Return the log that is looked at, at first the last one of the fit, with its columns and their bindings; None without one."""
        records = self._records()
        open_ones = [r["name"] for r in records if r["name"] == self._opened] or [r["name"] for r in records if r["use"] == "fit"][-1:]
        if not open_ones:
            return None
        table = self.draft.documents[CAMPAIGN].content["records"][open_ones[0]]
        try:
            looked = self._looked(table)
        except ThermidError as error:
            looked = {"problem": error.message, "rows": 0, "columns": [], "questions": [], "notes": [], "supplies": {}}
        columns = _with_uses(looked["columns"], looked["supplies"], table["channels"])
        shown: dict[str, Any] = {k: looked[k] for k in ("problem", "rows", "questions", "notes", "sampling", "clock") if k in looked}
        return {"record": open_ones[0], "file": table["file"], "channels": table["channels"], "columns": columns, **shown}

    def _records(self) -> list[dict[str, Any]]:
        """Return the logs of the stage: of its fit, held out with the limit of its RMSE, then those that are joined with one of these."""
        content = self.draft.documents[CAMPAIGN].content
        stage, held = self._stage(), self._verdicts()
        out = [{"name": n, "use": "fit"} for n in stage.get("records", [])]
        out += [{"name": n, "use": "held out", "limit": str(v["criteria"].get("rmse", ""))} for n, v in held.items()]
        hosts = {r["name"]: _joined(content["records"].get(r["name"], {})) for r in out}
        out += [
            {"name": n, "use": "joined", "host": host, "offset": _words(t["offset"])} for host, of in hosts.items() for n, t in of.items()
        ]
        files = {n: t["file"] for n, t in content["records"].items() if "file" in t}
        return [r | {"file": files[r["name"]]} for r in out if r["name"] in files]

    def _verdicts(self) -> dict[str, Any]:
        """Return record -> verdict on the stage, with its place in the campaign."""
        verdicts = self.draft.documents[CAMPAIGN].content.get("verdicts", [])
        name = self._stage()["name"]
        return {v["record"]: {**v, "place": k} for k, v in enumerate(verdicts) if v["model"] == name}

    def _looked(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """Return what the log of a record looks like, looked at again where it was written since."""
        path = self._inside(table["file"])
        status = path.stat() if path.exists() else None
        stamp = (table.get("time"), status and (status.st_mtime_ns, status.st_size))
        if path not in self._looks or self._looks[path][0] != stamp:
            self._looks[path] = stamp, looked_at(path, table.get("time"))
        return self._looks[path][1]

    def _inside(self, name: str) -> Path:
        """Return a log of the project; one that lies elsewhere is refused."""
        return resolve_inside(self.draft.documents[CAMPAIGN].path.parent, name, "log")

    # ---- commands -----------------------------------------------------------------------------------------------------------------

    def commanded(self, body: Body) -> dict[str, Any]:
        """Do one command and return the state after it; a text that is no deck changes nothing and comes back with its fault.

        Raises
        ------
        ThermidError   When it is refused, as all else is while a text that is no deck yet waits; nothing is changed then.
        """
        what, more = text_of(body, "do"), {}
        refuse_unknown([what], self._commands, "build", "no command '{}'.", NameNotFoundError)
        if self.draft.typed and what not in ("text", "drop text"):
            raise self._unmended()
        try:
            after = self._commands[what](self, body)
        except ThermidError:
            if what != "text":
                raise
            after = replace(self.draft, typed=text_of(body, "text"))
        if isinstance(after, tuple):
            after, more = after
        self._take(after)
        return self.state() | more

    def _unmended(self) -> DeckError:
        """Return the refusal of what would lose a text that is no deck yet."""
        at = f" at line {line}" if (line := self._refused()["refused"]["line"]) else ""
        return DeckError(f"the text has a fault{at}. Mend it in Text, or drop what was typed there.", "text", code="output.edit-refused")

    def _refused(self) -> dict[str, Any]:
        """Return a text that is no deck yet and its fault; nothing where there is none."""
        typed = self.draft.typed
        try:
            if typed:
                self.draft.rewritten(typed)
        except ThermidError as error:
            return {"typed": typed, "refused": self._fault("error", error.code, error.message, error.where, typed)}
        return {}

    def _take(self, draft: Draft) -> None:
        """Take another draft, and keep it in the journal."""
        if draft is not self.draft:
            self.draft, self.notice = draft, ""
            keep(draft)

    def _add(self, body: Body) -> tuple[Draft, dict[str, Any]]:
        """Return the draft with an element added, where the page has put it, and its name."""
        shape, ends = text_of(body, "shape"), texts_of(body, "ends")
        part = self._part(text_of(body, "use")) if shape == "submodel" else {}
        edits, name = added(self.draft.deck.content, shape, text_of(body, "name"), ends, part)
        places: list[Edit] = []
        if "x" in body and not ends:
            # the page may not know of a node that another tab put there
            x, y = _beside((number_of(body, "x"), number_of(body, "y")), self.state()["places"].values())
            places = [self._place(name, {"x": x, "y": y})]
        return self.draft.edited({DECK: edits, VIEW: places}), {"made": name, "table": PALETTE[shape].table}

    def _part(self, deck: str) -> dict[str, Any]:
        """Return what a submodel of a deck says: its needs bound to nodes of their names, or to the first one.

        Raises
        ------
        DeckError   When the deck needs a node and there is none.
        """
        content = self.draft.deck.content
        nodes = [*content.get("needs", []), *content.get("nodes", {})]
        needs = list(read_toml(resolve_inside(self.draft.deck.path.parent, deck, "palette"))[0].get("needs", []))
        if needs and not nodes:
            raise DeckError(f"'{deck}' needs {', '.join(needs)}. Add a node or boundary for it first.", "palette", code="value.incomplete")
        return {"use": deck} | ({"bind": {n: n if n in nodes else nodes[0] for n in needs}} if needs else {})

    def _place(self, name: str, body: Body) -> Edit:
        """Return the edit that puts a node's card at a place, on the grid."""
        return Edit((PLACES, name), [round(number_of(body, axis) / PLACE_GRID) * PLACE_GRID for axis in ("x", "y")])

    def _rename(self, body: Body) -> tuple[Draft, dict[str, Any]]:
        """Return the draft with an element renamed wherever it stands: deck, view, bindings of logs, free values."""
        keys, name = texts_of(body, "keys"), text_of(body, "name").strip()
        edits = renamed(self.draft.deck.content, keys, name)
        placed, bound = self.draft.documents[VIEW].content.get(PLACES, {}), self.draft.documents[CAMPAIGN].content
        places = [Edit((PLACES, keys[1])), Edit((PLACES, name), placed[keys[1]])] if keys[1] in placed else []
        channels = [
            Edit(("records", record, "channels", column, role), name)
            for record, table in bound["records"].items()
            for column, channel in table["channels"].items()
            for role in (*WATCHED_ROLES, "command")
            if isinstance(channel, Mapping) and channel.get(role) == keys[1]
        ]
        free = self._stage().get("free", [])
        new = [name + p[len(keys[1]) :] if p.startswith(f"{keys[1]}.") else p for p in free]
        freed = [Edit(("stages", self._place_of_stage(), "free"), new)] if new != free else []
        return self.draft.edited({DECK: edits, VIEW: places, CAMPAIGN: [*channels, *freed]}), {"made": name, "table": keys[0]}

    def _remove(self, body: Body) -> Draft:
        """Return the draft without an element and all that is joined to it."""
        keys = texts_of(body, "keys")
        places = [Edit((PLACES, keys[1]))] if keys[1] in self.draft.documents[VIEW].content.get(PLACES, {}) else []
        return self.draft.edited({DECK: removed(self.draft.deck.content, keys), VIEW: places})

    def _bind(self, body: Body) -> Draft:
        """Return the draft with columns of the log bound, each to nothing where no target is given.

        A thermometer that is bound for the first time gets the errors that its readings show; see `_with_errors`.

        Raises
        ------
        ThermidError   When a column cannot be what it is bound to.
        """
        log = self._bound()
        if log is None:
            raise MissingDataError("no log is open. Drop one on the page first.", "log")
        edits, record = [], self.draft.documents[CAMPAIGN].content["records"][log["record"]]
        rows = {c["key"]: c for c in log["columns"]}
        for column, table in dict(body.get("channels", {})).items():
            keys = ("records", log["record"], "channels", str(column))
            before = log["channels"].get(column)
            if table:
                made = {str(k): v for k, v in dict(table).items() if v not in ("", None)} | rows.get(column, {}).get("formula", {})
                if not _warm(made):
                    made = {k: v for k, v in made.items() if k not in ("noise", "accuracy")}
                channel = {column: made}
                channel = self._with_errors(record, channel) if not _warm(before) and not {"noise", "accuracy"} & set(table) else channel
                self._read(record, channel)
                edits.append(Edit(keys, channel[column]))
            elif before is not None:
                edits.append(Edit(keys))
        return self.draft.edited({CAMPAIGN: edits})

    def _read(self, record: Mapping[str, Any], channels: Mapping[str, Any]) -> Record:
        """Return some channels of a record's log.

        Raises
        ------
        ThermidError   When a column cannot be what it is bound to.
        """
        how = {k: record[k] for k in ("time", "units", "separator", "decimal", "clock") if k in record}
        how["units"] = {n: u for n, u in record.get("units", {}).items() if n in channels} or None
        return read_record(self._inside(record["file"]), channels, **how)

    def _with_errors(self, record: Mapping[str, Any], channels: Mapping[str, Any]) -> dict[str, Any]:
        """Return bindings with the accuracy of thermometers that `thermid init` assumes too, and the noise that readings of nodes show."""
        out = {c: t | {"accuracy": f"{ACCURACY:g} [K]"} if _warm(t) else t for c, t in channels.items()}
        nodes = {c: t for c, t in out.items() if "node" in t}
        try:
            read = self._read(record, nodes) if nodes else None
        except ThermidError:
            return out  # what is wrong with it is said where it is bound, or run
        noises = {c: round(read[c].noise_seen, 6) for c in nodes} if read is not None else {}
        return out | {c: t | {"noise": f"{short(noises[c], 2)} [K]"} for c, t in nodes.items() if noises[c]}

    def _hold(self, body: Body) -> Draft:
        """Return the draft with a boundary held at a temperature for the whole log; without a text that is taken away.

        Raises
        ------
        ThermidError   When there is no such boundary, or the text is no temperature.
        """
        name, value = text_of(body, "name"), text_of(body, "value")
        refuse_unknown([name], self.draft.deck.content.get("needs", []), "build", "no boundary '{}'.", NameNotFoundError)
        if value.strip():
            Scenario(self._stage()["name"], boundaries={name: value})
        return self.draft.edited({CAMPAIGN: valued({}, ("stages", self._place_of_stage(), "scenario", "boundaries", name), value, "")})

    def _free(self, body: Body) -> Draft:
        """Return the draft with the values that a fit may find."""
        return self.draft.edited({CAMPAIGN: [Edit(("stages", self._place_of_stage(), "free"), list(texts_of(body, "paths")))]})

    def _place_of_stage(self) -> int:
        """Return the place of the stage in the campaign, from 0."""
        return self.draft.stage % len(self.draft.documents[CAMPAIGN].content["stages"])

    def _open_stage(self, body: Body) -> Draft:
        """Return the draft of another stage of the campaign; edits of this one that were not saved stay in its journal."""
        names = [s["name"] for s in self.draft.documents[CAMPAIGN].content["stages"]]
        refuse_unknown([text_of(body, "name")], names, "campaign", "no stage '{}'.", NameNotFoundError)
        draft, self.notice = recalled(self.path, names.index(text_of(body, "name")))
        return draft

    def _log(self, body: Body) -> Draft:
        """Return the draft with a log of the folder as a record, looked at; one that is a record already stays as it is.

        The first log of a stage is fitted; until `_use` says otherwise a further one is held out, or joined with the last one of the fit
        where it has no sensor to be judged by. Its columns are bound as those of the log that was looked at before, and others as their
        names and units suggest.
        """
        file, content = text_of(body, "file"), self.draft.documents[CAMPAIGN].content
        path, folder = self._inside(file), self.draft.documents[CAMPAIGN].path.parent
        there = {n: t for n, t in content["records"].items() if "file" in t and (folder / t["file"]).resolve() == path}
        name = next(iter(there), "") or free_name(Path(file).name.partition(".")[0], content["records"])
        table, edits = there.get(name, {"file": file, "channels": {}}), []
        if not table["channels"]:
            table = {**table, "channels": self._proposed(table, self._bound())}
            edits.append(Edit(("records", name), table))
        if name not in {r["name"] for r in self._records()}:
            judged = any(isinstance(c, str) or "node" in c for c in table["channels"].values())
            further = "held out" if judged or not table["channels"] else "joined"
            host = (self._bound() or {"record": ""})["record"]
            hosts = [r["name"] for r in self._records() if r["use"] != "joined"]
            edits += self._use_edits(name, further if hosts else "fit", table, host if host in hosts else hosts[-1] if hosts else "")
        draft, self._opened = self.draft.edited({CAMPAIGN: edits}), name
        return draft

    def _time(self, body: Body) -> Draft:
        """Return the draft with the time column of a log named, and the errors that its thermometers show then."""
        name = text_of(body, "record")
        refuse_unknown([name], [r["name"] for r in self._records()], "log", "no log '{}'.", NameNotFoundError)
        table = {**self.draft.documents[CAMPAIGN].content["records"][name], "time": text_of(body, "column")}
        shown, channels = self._with_errors(table, table["channels"]), table["channels"]
        table["channels"] = {c: {**shown[c], **t} if isinstance(t, Mapping) else t for c, t in channels.items()}
        return self.draft.edited({CAMPAIGN: [Edit(("records", name), table)]})

    def _use(self, body: Body) -> Draft:
        """Return the draft with a log used by the fit, held out of it, joined with a host, or taken out with those joined with it."""
        name, how = text_of(body, "record"), text_of(body, "how")
        refuse_unknown([how], ("fit", "held out", "joined", "none"), "log", "no use '{}' of a log.", NameNotFoundError)
        refuse_unknown([name], [r["name"] for r in self._records()], "log", "no log '{}'.", NameNotFoundError)
        content = self.draft.documents[CAMPAIGN].content
        edits = self._use_edits(name, how, content["records"][name], text_of(body, "host"))
        stage = self._stage()["name"]
        others = [r for s in content["stages"] if s["name"] != stage for r in s.get("records", [])]
        others += [v["record"] for v in content.get("verdicts", []) if v["model"] != stage]
        others += [r for n, t in content["records"].items() if n != name for r in _joined(t) if r != name]
        gone = [name, *_joined(content["records"][name])] if how == "none" else []
        edits += [Edit(("records", n)) for n in gone if n not in others]
        return self.draft.edited({CAMPAIGN: edits})

    def _use_edits(self, name: str, how: str, table: Mapping[str, Any], host: str) -> list[Edit]:
        """Return the edits that make a record one of the fit, one that is held out, one that is joined with a host, or none of the stage.

        Raises
        ------
        NameNotFoundError   When there is no such host.
        DeckError           When other logs are joined with this one.
        """
        if how == "joined":
            if own := _joined(table):
                raise DeckError(f"{quoted([*own])} are joined with it. Join them with another log first.", name, code="campaign.refused")
            hosts = [r["name"] for r in self._records() if r["use"] != "joined" and r["name"] != name]
            refuse_unknown([host], hosts, "log", "no log '{}' that another one could be joined with.", NameNotFoundError)
        verdicts, records = self.draft.documents[CAMPAIGN].content.get("verdicts", []), self._stage().get("records", [])
        held, place = self._verdicts(), ("stages", self._place_of_stage(), "records")
        edits = []
        judged = [k for k, v in enumerate(verdicts) if (v["model"], v["record"]) == (self._stage()["name"], name)]
        if how != "held out" and judged:
            edits += [Edit(("verdicts",))] if len(judged) == len(verdicts) else [Edit(("verdicts", k)) for k in reversed(judged)]
        if how == "fit" and name not in records:
            edits.append(Edit(place, [*records, name]))
        if how != "fit" and name in records:
            edits.append(Edit(place, [r for r in records if r != name]))
        if how == "held out" and name not in held:
            verdict = {"model": self._stage()["name"], "record": name, "criteria": {"rmse": self._first_limit(table)}}
            edits.append(Edit(("verdicts", len(verdicts)), verdict) if verdicts else Edit(("verdicts",), [verdict]))
        return edits + self._join_edits(name, host if how == "joined" else "", table)

    def _join_edits(self, name: str, host: str, table: Mapping[str, Any]) -> list[Edit]:
        """Return the edits that join a record with another one, begun as late after it as the two logs show, or with none.

        Where nothing shows it the offset is a gap, which a page asks to fill.
        """
        records = self.draft.documents[CAMPAIGN].content["records"]
        after = {n: {k: t for k, t in _joined(r).items() if k != name} for n, r in records.items()}
        if host:
            clock = clocks_of([look(self._inside(t["file"]), time=t.get("time")) for t in (records[host], table)])[0]
            finds = host in self._stage().get("records", [])
            stated = stated_offset(clock)
            late: Any = "... [s]" if stated is None else f"{round(stated, 3):.10g} [s]"
            if finds and "at" in clock and not clock["at"]["candidate"]:
                late = [f"{end} [s]" for end in offset_range(clock)]
            after[host][name] = {"record": name, "offset": late}
        return [_join_edit(n, now) for n, now in after.items() if now != _joined(records[n])]

    def _offset(self, body: Body) -> Draft:
        """Return the draft with another time by which a joined log begins after its host, or two between which a fit finds it.

        Raises
        ------
        ThermidError   When no such log is joined, or the text is no time.
        """
        name, value = text_of(body, "record"), text_of(body, "value")
        hosts = {r["name"]: r["host"] for r in self._records() if r["use"] == "joined"}
        refuse_unknown([name], hosts, "log", "no log '{}' is joined with another.", NameNotFoundError)
        ends = [with_unit(end.strip(), "s") for end in value.split(" to ")]
        for end in ends:
            literal(end, "s", name)
        others = _joined(self.draft.documents[CAMPAIGN].content["records"][hosts[name]])
        return self.draft.edited(
            {CAMPAIGN: [_join_edit(hosts[name], {**others, name: {**others[name], "offset": ends if ends[1:] else ends[0]}})]}
        )

    def _first_limit(self, table: Mapping[str, Any]) -> str:
        """Return a limit of the RMSE that a person may change: as `thermid init` has it, of the sensor that is allowed most."""
        nodes = {c: t for c, t in table["channels"].items() if isinstance(t, Mapping) and "node" in t}
        try:
            read = self._read(table, nodes)
            sizes = [
                max(VERDICT_NOISES * c.noise_seen, VERDICT_SHARE_OF_RANGE * float(np.ptp(c.values[c.valid])))
                for c in map(read.channel, nodes)
            ]
        except (ThermidError, ValueError):
            sizes = []
        return f"{short(max(sizes, default=1.0), 2)} [K]"

    def _limit(self, body: Body) -> Draft:
        """Return the draft with another limit of the RMSE on a log that is held out.

        Raises
        ------
        ThermidError   When no such log is, or the limit is no temperature difference above zero.
        """
        held, name, value = self._verdicts(), text_of(body, "record"), text_of(body, "value")
        refuse_unknown([name], held, "log", "no log '{}' is held out.", NameNotFoundError)
        if not value.strip():
            raise DeckError("a hold-out log needs a limit of its RMSE, such as '1 [K]'.", name, code="value.incomplete")
        Criteria(rmse=value)
        return self.draft.edited({CAMPAIGN: [Edit(("verdicts", held[name]["place"], "criteria", "rmse"), value)]})

    def _proposed(self, table: Mapping[str, Any], before: Mapping[str, Any] | None) -> dict[str, dict[str, Any]]:
        """Return column -> binding: as in the log before, of columns that it has; else where a name of the deck stands in the column's."""
        looked, content = self._looked(table), self.draft.deck.content
        columns, out, kept = looked["columns"], {}, {}
        if before is not None:
            names, known = {c["name"] for c in columns}, {c["name"] for c in before["columns"]}
            own = {c["key"]: _columns_of(c["name"], before["channels"].get(c["key"])) for c in before["columns"]}
            kept = {n: before["channels"][n] for n, parts in own.items() if n in before["channels"] and parts <= names}
            columns = [c for c in columns if c["name"] not in known]
        warm = {"node": content.get("nodes", {}), "boundary": content.get("needs", [])}
        heats = {"load": content.get("loads", {})}
        # a duty is a share of the deck's power
        rooms = {"temperature": warm, "boundary": warm, "power": heats, "duty": {"command": content.get("loads", {})}}
        for column in columns:
            words, unit = word(column["name"]), column["unit"] if column["assumed"] else ""
            hits = [(len(n), role, n) for role, names in rooms.get(column["guess"], {}).items() for n in names if word(n) in words]
            if hits:
                _, role, target = max(hits)
                out[column["name"]] = {role: target} | ({"unit": unit} if unit else {})
        heated = {t[r] for t in (kept | out).values() if isinstance(t, Mapping) for r in ("load", "command") if r in t}
        cold = [n for n in content.get("loads", {}) if n not in heated]
        power = next((c for c in _with_uses(columns, looked["supplies"], kept | out) if "formula" in c), None)
        if len(cold) == 1 and power is not None:  # nothing else can be what the volts and amperes heat
            out[power["name"]] = {"load": cold[0], **power["formula"]}
        return kept | self._with_errors(table, out)

    def _take_fit(self, body: Body) -> Draft:
        """Return the draft with values that the last fit log."""
        if not self.fitted:
            raise MissingDataError("no fit exists yet. Run one first.", "build")
        values = {p: f"{v['value']:.7g} [{v['unit']}]" for p, v in self.fitted.items()}
        return self.draft.with_values(values, f"fitted to {', '.join(self._stage()['records'])}")

    _commands: Final[Mapping[str, Callable[[Building, Body], Any]]] = {
        "add": _add,
        "set": lambda s, b: s.draft.edited(
            {DECK: valued(s.draft.deck.content, texts_of(b, "keys"), text_of(b, "value"), text_of(b, "source"))}
        ),
        "stored": lambda s, b: s.draft.edited({DECK: stored(s.draft.deck.content, text_of(b, "name"), text_of(b, "how"))}),
        "schedule": lambda s, b: s.draft.edited(
            {DECK: scheduled(s.draft.deck.content, texts_of(b, "keys"), *(text_of(b, k) for k in ("on", "off", "share")))}
        ),
        "hold": _hold,
        "sensor": lambda s, b: s.draft.edited({DECK: [Edit(("nodes", text_of(b, "name"), "reference_point"), bool(b.get("on")))]}),
        "use part": lambda s, b: s.draft.edited(
            {DECK: [Edit(("submodels", text_of(b, "name"), k), v) for k, v in s._part(text_of(b, "deck")).items()]}
        ),
        "finish": lambda s, b: s.draft.edited({DECK: finished(texts_of(b, "surfaces"), text_of(b, "finish"))}),
        "bind part": lambda s, b: s.draft.edited({DECK: [Edit(("submodels", *texts_of(b, "keys")), text_of(b, "node"))]}),
        "rename": _rename,
        "remove": _remove,
        "move": lambda s, b: s.draft.edited({VIEW: [s._place(text_of(b, "name"), b)]}),
        "text": lambda s, b: replace(s.draft.rewritten(text_of(b, "text")), typed=""),
        "drop text": lambda s, b: replace(s.draft, typed=""),
        "undo": lambda s, b: s.draft.undo(),
        "redo": lambda s, b: s.draft.redo(),
        "stage": _open_stage,
        "log": _log,
        "time": _time,
        "use": _use,
        "limit": _limit,
        "bind": _bind,
        "offset": _offset,
        "free": _free,
        "take fit": _take_fit,
        "restart": lambda s, b: Draft.opened(s.path, s.draft.stage),
        "merge": lambda s, b: s.draft.merged(),
    }

    # ---- run, fit, save ---------------------------------------------------------------------------------------------------------

    def request(self) -> Request:
        """Return what the stage asks of the draft as it is, with what it inherits.

        Raises
        ------
        ThermidError   When no log is bound, it does not fit, or a stage below was not run.
        """
        return self._request_with(self.model)

    def _request_with(self, model: Model) -> Request:
        """Return what the stage asks of a model in place of its deck."""
        source, k, done = self.draft.source, self._place_of_stage(), self._below()
        stage = source.content.stages[k]
        missing = [n for i in stage.inherit.values() for n in i.stages if n not in done]
        if missing:
            raise MissingDataError(f"needs values of stage '{missing[0]}', which has not been run. Run it in Correlate first.", stage.name)
        return request_of(source, stage, k, done, model)

    def desk(self) -> Desk:
        """Return the draft ready to run: on its record, or in a room where no log is bound."""
        title, records = str(self.draft.deck.content["title"]), self.draft.documents[CAMPAIGN].content["records"]
        if any(records.get(n, {}).get("channels", True) for n in self._stage().get("records", [])):
            request = self.request()
            return Desk(title, request.model, build_problem(request))
        boundaries = dict.fromkeys(compile_network(self.model).boundaries, "24 [degC]")
        return Desk(title, self.model, None, (Scenario("24 °C, five hours", boundaries=boundaries, start="24 [degC]", duration="5 [h]"),))

    def run(self) -> dict[str, Any]:
        """Begin a run of the draft as it is."""

        def job(j: JobState) -> None:
            """Run the draft."""
            j.result = curves_object(self.desk(), {})

        return self.jobs.start("run", str(self.draft.deck.content["title"]), job)

    def fit(self) -> dict[str, Any]:
        """Begin a fit of the ticked values to the log."""
        request = self.request()

        def job(j: JobState) -> None:
            """Fit, and keep the values to be taken into the deck."""
            result = fit(request, j.tell, stoppable=True)
            shown = fit_object(result)
            self.fitted = shown["values"]
            desk = Desk(request.name, result.given_model, result.problem, (), result)
            j.result = {**shown, "fitted": self.fitted, **curves_object(desk, {})}

        return self.jobs.start("fit", request.name, job, keeps=True)

    def conditions(self) -> dict[str, Any]:
        """Return what may be changed of the draft's run."""
        return conditions_object(self.desk())

    def compared(self, body: Body) -> dict[str, Any]:
        """Return the run of the draft as it is and with other conditions."""

        def with_finish(surfaces: Sequence[str], finish: str) -> Model:
            """Return the model of the draft with a finish on surfaces."""
            model = self.draft.edited({DECK: finished(surfaces, finish)}).model
            return self._request_with(model).model if self._stage().get("inherit") else model

        return compared(self.desk(), body, with_finish)

    def difference(self) -> dict[str, Any]:
        """Return what saving would change, as a unified diff, with what somebody else changed in the files merged into it first."""
        if self.draft.typed:
            raise self._unmended()
        self._take(self.draft.merged())
        return {"diff": self.draft.diff(), "files": [d.path.name for d in self.draft.to_save().values()]}

    def save(self, confirmed: str) -> dict[str, Any]:
        """Write the files, as a diff that was shown says it.

        Raises
        ------
        DeckError   When the diff is another by now, or somebody else changed a file.
        """
        if self.draft.diff() != confirmed:
            raise DeckError(
                "the files or the model changed since the difference was shown. Look at it again.", code="output.changed-meanwhile"
            )
        self.draft = self.draft.save()
        keep(self.draft)
        return self.state()

    def stored_log(self, name: str, data: bytes) -> str:
        """Write a log that was dropped on the page into the folder ``logs`` and return its name there; nothing is replaced.

        Raises
        ------
        DeckError   When the name is none for a file.
        """
        plain = Path(name.replace("\\", "/")).name
        if not plain.strip(". ") or any(ord(c) < 32 for c in plain) or len(plain.encode()) > 200:
            raise DeckError("the log has no name for a file. Rename it.", "log", code="name.not-valid")
        folder = self.draft.documents[CAMPAIGN].path.parent / "logs"
        folder.mkdir(parents=True, exist_ok=True)
        stem, dot, ending = plain.partition(".")
        for k in range(1, 1000):
            target = folder / (plain if k == 1 else f"{stem}_{k}{dot}{ending}")
            self._inside(f"logs/{target.name}")
            if not target.exists():
                FileKinds.RESULTS_FILE.save_bytes(target, data)
            if target.is_file() and read_bytes(target) == data:
                return f"logs/{target.name}"
        raise DeckError("there are too many logs of this name.", "log", code="studio.not-now")


def _joined(record: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return record -> how it is joined with one."""
    tables = record.get("joined", [])
    return {t["record"]: {"offset": "0 [s]", **t} for t in ([tables] if isinstance(tables, Mapping) else tables)}


def _join_edit(host: str, joined: Mapping[str, Mapping[str, Any]]) -> Edit:
    """Return the edit that joins a record with these alone."""
    keys, tables = ("records", host, "joined"), [*joined.values()]
    return Edit(keys, tables if tables[1:] else tables[0]) if tables else Edit(keys)


def _words(offset: Any) -> str:
    """Return the offset of a joined log as a page shows it, in seconds; a range has two ends."""
    return " to ".join(end.removesuffix(" [s]") for end in ([offset] if isinstance(offset, str) else offset))


def _warm(binding: Any) -> bool:
    """Whether a column is bound as a thermometer."""
    return isinstance(binding, Mapping) and bool({"node", "boundary"} & set(binding))


def _columns_of(name: str, binding: Any) -> set[str]:
    """Return the columns that a channel is read from: its own, the one that it names, or those of its formula."""
    if not isinstance(binding, Mapping):
        return {binding or name}
    power = binding.get("power")
    return {name} if power is None else set(re.findall(r"`([^`]+)`", str(power))) if isinstance(power, str) else {*map(str, power.values())}


def _with_uses(
    columns: Sequence[Mapping[str, Any]], supplies: Mapping[str, Sequence[str]], channels: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return the columns of a log as rows, each with the channels that use it, then a row per power computed from several columns.

    `supplies` is name -> its columns of volts and amperes; a pair that no channel uses yet is proposed as such a power.

    A channel has the name of its column, or its heading as written; `key` is the one in use.
    """
    names = {c["name"] for c in columns}
    formula = {n: t["power"] for n, t in channels.items() if isinstance(t, Mapping) and "power" in t}
    for wanted, pair in supplies.items():
        if {*pair} <= names and not any({*pair} <= _columns_of(n, channels[n]) for n in channels if n in formula):
            free = wanted if wanted not in {*names, *channels} else free_name(wanted, {*names, *channels})
            formula[free] = dict(zip(("volts", "amperes"), pair, strict=True))
    why = {n: p if isinstance(p, str) else ", ".join(f"{k} = {c}" for k, c in p.items()) for n, p in formula.items()}
    row = {"unit": "W", "assumed": False, "open": False, "guess": "power", "roles": ("load",), "used": []}
    own = [{"name": n, "key": n, **row, "why": why[n], "formula": {"power": p}} for n, p in formula.items()]
    keys = {name_and_unit(n)[0]: n for n in channels} | {n: n for n in channels}
    out = []
    for column in (c for c in columns if c["name"] not in formula):
        key = keys.get(column["name"], column["name"])
        users = [n for n, t in channels.items() if n != key and {column["name"], key} & _columns_of(n, t)]
        out.append({**column, "key": key, "used": users})
    return [*out, *own]


_SHOWN: Final = ("nodes", "surfaces", "conductors", "loads", "submodels")
"""Tables that the canvas draws."""


def _beside(place: tuple[float, float], taken: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """Return a place of a card, or the first one to its right where no other card lies. [px]"""
    others = tuple(taken)
    while any(abs(place[0] - x) < CARD_ROOM[0] and abs(place[1] - y) < CARD_ROOM[1] for x, y in others):
        place = place[0] + CARD_ROOM[0] + 8.0 * PLACE_GRID, place[1]
    return place
