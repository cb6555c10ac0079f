"""The studio's server: answers to its own page on loopback, and to nobody else; hostile names stay text."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import urllib.parse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from by_code import raises_code

pytest.importorskip("uvicorn", reason="the studio's extra is not installed")
pytest.importorskip("starlette", reason="the studio's extra is not installed")

import uvicorn

from thermid.app.studio import server as serving
from thermid.app.studio.project import Project
from thermid.app.studio.room import Room
from thermid.app.studio.server import application, limited, serve
from thermid.base.errors import DeckError
from thermid.fit.calibration import Unknown

EXAMPLES = Path(__file__).parents[4] / "examples"
TOKEN = "a-token_of_this-test"
EVIL = '"><script>alert(1)</script><b x="'
JSON = {"content-type": "application/json", "x-thermid-studio": "1"}


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A studio on a deck with a hostile title, in a thread of this process."""
    root = tmp_path_factory.mktemp("deck")
    deck = (EXAMPLES / "01_accelerometer" / "accelerometer.toml").read_text(encoding="utf-8")
    first = deck.index("title")
    (root / "deck.toml").write_text(deck[:first] + f"title = '''{EVIL}'''\n" + deck[deck.index("\n", first) + 1 :], encoding="utf-8")
    (root / "secret.txt").write_text("not for pages", encoding="utf-8")
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen()
    taken = listener.getsockname()[1]
    server = uvicorn.Server(limited(application(Room(root, Project(root / "deck.toml")), taken, TOKEN), log_level="error"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    yield taken
    server.should_exit = True
    thread.join(10)


def asked(port: int, path: str, body: Any = None, headers: dict[str, str] | None = None) -> tuple[int, dict[str, str], str]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    text = None if body is None else body if isinstance(body, str) else json.dumps(body)
    cookie = {"cookie": f"other=1; thermid-studio-{port}={TOKEN}"}
    connection.request("GET" if body is None else "POST", path, text, cookie | (headers or ({} if body is None else JSON)))
    answer = connection.getresponse()
    found = answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read().decode()
    connection.close()
    return found


def test_the_page_and_its_policy(port: int) -> None:
    status, headers, text = asked(port, "/")
    assert status == 200
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "script-src 'self'" in headers["content-security-policy"]
    assert "http://" not in text
    assert "https://" not in text
    for name in ("studio.js", "pages.css", "plot.css"):
        status, _, text = asked(port, f"/bundle/{name}")
        assert status == 200
        assert "://" not in text.replace("http://www.w3.org/", "")


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "thermid.example"},
        {"host": "127.0.0.1"},
        {"host": "localhost:1"},
        {"origin": "http://thermid.example"},
        {"origin": "null"},
        {"origin": "https://127.0.0.1:1"},
    ],
)
def test_a_foreign_host_or_origin_is_refused(port: int, headers: dict[str, str]) -> None:
    given = {"host": f"127.0.0.1:{port}", **headers}
    for path in ("/", "/api/project", "/bundle/studio.js"):
        assert asked(port, path, None, given)[0] == 403
    assert asked(port, "/api/save", {"stage": "", "values": {}}, {**JSON, **given})[0] == 403


WITHOUT = {"": None, "of another studio": "another", "in part": TOKEN[:-1], "and more": f"{TOKEN}x", "not of letters": "é"}


@pytest.mark.parametrize("wrong", WITHOUT)
def test_a_request_without_the_token_is_refused_with_a_sentence(port: int, wrong: str) -> None:
    """Another user of the machine reaches its loopback."""
    cookie = f"thermid-studio-{port}={WITHOUT[wrong]}; thermid-studio-1={TOKEN}" if WITHOUT[wrong] else "x"
    for path in (
        "/",
        "/bundle/studio.js",
        "/api/project",
        "/api/desk?stage=x",
        "/api/nothing",
        "/?token=",
        "/?token=wrong",
        "/?Token=" + TOKEN,
    ):
        status, headers, text = asked(port, path, None, {"cookie": cookie})
        assert (status, "set-cookie" in headers) == (403, False)
        assert "`thermid studio`" in json.loads(text)["error"]
    assert asked(port, "/api/save", {"stage": EVIL, "values": {}, "name": "x"}, {**JSON, "cookie": cookie})[0] == 403


def test_the_address_brings_the_token_and_the_page_keeps_it(port: int) -> None:
    status, headers, _ = asked(port, f"/?token={TOKEN}", None, {"cookie": "x"})
    assert status == 200
    assert headers["set-cookie"] == f"thermid-studio-{port}={TOKEN}; Path=/; HttpOnly; SameSite=Strict"
    kept = {"cookie": headers["set-cookie"].partition(";")[0]}
    assert asked(port, "/api/project", None, kept)[0] == 200
    assert asked(port, "/api/project", None, {"cookie": f"{kept['cookie']}x; {kept['cookie']}"})[0] == 200


def test_a_name_too_long_for_a_file_is_refused_with_a_sentence(port: int) -> None:
    path = next(s["path"] for s in json.loads(asked(port, f"/api/desk?stage={urllib.parse.quote(EVIL)}")[2])["sliders"])
    status, _, text = asked(port, "/api/save", {"stage": EVIL, "values": {path: 1.0}, "name": "x" * 500})
    assert (status, "name too long" in json.loads(text)["error"].lower()) == (200, True)
    assert len(json.loads(text)["where"]) < 100


def test_no_argument_of_the_browser_shows_the_token(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arguments of processes are seen by every user of a machine."""
    from thermid.app.cli import studio as command

    opened: list[tuple[str, str, int]] = []
    address = "http://127.0.0.1:1/?token=secret"

    def browse(what: str) -> None:
        page = Path(urllib.parse.urlparse(what).path)
        opened.append((what, page.read_text(encoding="utf-8"), page.parent.stat().st_mode & 0o777))

    monkeypatch.setattr(command.webbrowser, "open", browse)
    monkeypatch.setattr(command, "serve", lambda room, port, ready: ready(address))
    command.studio(EXAMPLES / "01_accelerometer" / "accelerometer.toml", None, None, None, 0, True)
    ((what, page, mode),) = opened
    assert ("secret" in what, address in page, mode) == (False, True, 0o700)
    assert not Path(urllib.parse.urlparse(what).path).exists()


def test_a_request_without_the_pages_header_changes_nothing(port: int) -> None:
    status, _, text = asked(port, "/api/save", {"stage": "x", "values": {}}, {"content-type": "application/json"})
    assert status == 400
    assert json.loads(text).get("error")


@pytest.mark.parametrize(
    "path",
    [
        "/bundle/../project.py",
        "/bundle/%2e%2e/project.py",
        "/bundle/..%2f..%2fsecret.txt",
        "/bundle/secret.txt",
        "/secret.txt",
        "//etc/passwd",
    ],
)
def test_no_file_but_the_pages_own_is_read(port: int, path: str) -> None:
    status, _, text = asked(port, path)
    assert status == 404
    assert "not for pages" not in text


def test_a_hostile_name_stays_text(port: int) -> None:
    _, headers, text = asked(port, "/api/project")
    assert headers["content-type"].startswith("application/json")
    assert json.loads(text)["title"] == EVIL
    assert "<script" not in text
    _, _, drawn = asked(port, "/api/picture", {"stage": EVIL, "values": {}})
    svg = json.loads(drawn)["svg"]
    assert "<script" not in svg
    assert "&lt;script&gt;" in svg


@pytest.mark.parametrize(
    ("path", "body", "code", "part"),
    [
        ("/api/curves", {"stage": EVIL, "values": {"area": "wide"}}, "value.wrong-kind", ""),
        ("/api/curves", {"stage": EVIL, "values": {"area": True}}, "value.wrong-kind", ""),
        ("/api/curves", {"stage": EVIL, "values": {}, "run": 7}, "value.wrong-kind", ""),
        ("/api/curves", {"stage": 3, "values": {}}, "value.wrong-kind", "'stage'"),
        ("/api/curves", {"stage": "other", "values": {}}, "name.unknown", "'other'"),
        ("/api/curves", {"stage": EVIL, "values": {"area": 1e400}}, "value.wrong-kind", ""),
        ("/api/picture", {"stage": EVIL, "values": {}, "folded": ["engine"]}, "name.unknown", "'engine'"),
        ("/api/picture", {"stage": EVIL, "values": {}, "run": "first"}, "value.wrong-kind", ""),
        ("/api/swap", {"part": "case", "deck": "../secret.txt"}, "campaign.not-run", ""),
        ("/api/save", {"stage": EVIL, "values": {}, "name": "x"}, "studio.not-now", ""),
        ("/api/fit", "{", None, "JSON"),
        ("/api/fit", [1], None, "JSON"),
    ],
)
def test_what_makes_no_sense_is_answered_in_words(port: int, path: str, body: Any, code: str | None, part: str) -> None:
    status, _, text = asked(port, path, body)
    assert status in (200, 400)
    found = json.loads(text)
    assert found.get("code") == code
    assert part in found["error"]


def test_a_fit_without_logs_ends_with_its_reason(port: int) -> None:
    asked(port, "/api/fit", {"stage": EVIL, "values": {}, "free": ["area"]})
    for _ in range(100):
        job = json.loads(asked(port, "/api/job")[2])
        if job["what"] == "fit" and job["ended"]:
            break
        threading.Event().wait(0.05)
    assert job["error"]
    assert not job.get("result")


def test_a_taken_port_is_said(port: int) -> None:
    with raises_code("studio.not-now", DeckError, match=f"{port} is in use"):
        serve(Room(EXAMPLES, Project(EXAMPLES / "01_accelerometer" / "accelerometer.toml")), port)


def test_a_body_beyond_measure_is_not_read(port: int) -> None:
    status, _, text = asked(port, "/api/fit", '{"stage": "' + "x" * 2_000_000 + '"}')
    assert status == 413
    assert all(part in json.loads(text)["error"] for part in ("1 MB", "1e+06", "THERMID_CAPS=body="))
    status, _, text = asked(port, "/api/fit", "[" * 100_000)
    assert status == 400
    assert "JSON" in json.loads(text)["error"]


def raw(port: int, data: bytes, more: bytes = b"") -> bytes:
    """Return the first line of the answer to some bytes; nothing where the studio closes without a word."""
    with socket.create_connection(("127.0.0.1", port), timeout=20) as s:
        s.sendall(data)
        if more:
            s.sendall(more)
        return s.recv(1000).partition(b"\r\n")[0]


def test_who_brings_no_request_in_time_is_let_go(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A connection that stays silent, headers without an end, a body by drops, headers beyond measure."""
    monkeypatch.setattr(serving, "REQUEST_TIMEOUT", 0.3)
    host = f"host: 127.0.0.1:{port}\r\ncookie: thermid-studio-{port}={TOKEN}\r\n".encode()
    begun = b"POST /api/fit HTTP/1.1\r\n" + host
    assert raw(port, b"") == b""
    assert raw(port, begun + b"x-") == b""
    assert raw(port, begun + b"x-thermid-studio: 1\r\ncontent-length: 100\r\n\r\n", b'{"st').startswith(b"HTTP/1.1 408")
    assert raw(port, begun + b"x-long: " + b"y" * 60_000 + b"\r\n\r\n").startswith(b"HTTP/1.1 400")


def test_more_at_once_than_the_studio_answers_wait_for_another_time(port: int) -> None:
    """32 connections that say nothing; the next one is told that the service is not there, and works once they are gone."""
    silent = [socket.create_connection(("127.0.0.1", port), timeout=20) for _ in range(32)]
    assert asked(port, "/api/job")[0] == 503
    for each in silent:
        each.close()
    assert any(asked(port, "/api/job")[0] == 200 for _ in range(50))


@pytest.mark.parametrize(
    ("order", "body", "code", "part"),
    [
        ("curves", {"stage": "deck", "window": [0, 10**400]}, None, ""),
        ("picture", {"stage": "deck", "folded": 3}, "value.wrong-kind", "'folded'"),
        ("picture", {"stage": "deck", "values": {"file": 1.0}}, "name.unknown", "'file'"),
        ("picture", {"stage": "deck", "time": float("nan")}, "value.wrong-kind", ""),
        ("curves", {"stage": "deck", "values": {"x": float("inf")}}, "value.wrong-kind", ""),
        ("fit", {"stage": "deck", "free": 1.5}, "value.wrong-kind", "'free'"),
        ("curves", {"values": [[[0]]] * 2 + [json.loads("[" * 80 + "]" * 80)]}, None, ""),
    ],
)
def test_what_a_hostile_client_made_of_an_order_is_answered_in_words(port: int, order: str, body: Any, code: str | None, part: str) -> None:
    stage = json.loads(asked(port, "/api/project")[2])["stages"][0]["name"]
    status, _, text = asked(port, f"/api/{order}", body | ({"stage": stage} if "stage" in body else {}))
    assert status in (200, 400)
    found = json.loads(text)
    assert found.get("code") == code
    assert part in found["error"]


def test_a_value_without_a_logarithm_is_refused_with_its_name() -> None:
    """A slider of a hostile client at -1: math domain error, an answer of 500."""
    unknown = Unknown("skin.htc", "parameter", (), 5.0, log=True)
    for value in (-1.0, 0.0, float("nan")):
        with raises_code("value.outside-range", DeckError, match=r"skin\.htc"):
            unknown.to_fitted(value)
    assert unknown.to_fitted(1.0) == 0.0


def test_the_pages_that_are_built_come_under_the_same_policy(port: int) -> None:
    for path in ("/start", "/build", "/bundle/build.js", "/bundle/pages.css"):
        status, headers, _ = asked(port, path)
        assert status == 200
        assert "script-src 'self'" in headers["content-security-policy"]
        assert asked(port, path, None, {"cookie": "x"})[0] == 403
    assert asked(port, "/bundle/sources.txt")[0] == 404
    assert asked(port, "/bundle/..%2Fserver.py")[0] == 404


def test_a_log_is_taken_from_the_page_alone_and_stays_in_its_folder(port: int) -> None:
    assert asked(port, "/api/draft/log/a.csv", "t,T\n", {"content-type": "text/plain"})[0] == 400
    assert asked(port, "/api/draft/log/a.csv", "t,T\n", {"x-thermid-studio": "1", "cookie": "x"})[0] == 403
    status, _, text = asked(port, "/api/draft/log/..%5C..%5Cup.csv", "t,T\n", {"x-thermid-studio": "1"})
    assert (status, json.loads(text)) == (200, {"file": "logs/up.csv"})


@pytest.mark.parametrize("name", ["../up.toml", "/etc/passwd", "a\0.toml", "link/up.toml"])
def test_nothing_is_opened_outside_the_folder(tmp_path: Path, name: str) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "up.toml").write_text('title = "x"', encoding="utf-8")
    (home / "link").symlink_to(tmp_path)
    with pytest.raises(DeckError) as refused:
        Room(home).open(name)
    assert refused.value.code == "file.outside-project"


def test_recent_files_are_remembered_and_forgotten(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('title = "a"\n[nodes]\nn = { capacitance = "1 [J/K]" }\n', encoding="utf-8")
    room = Room(tmp_path)
    room.open("a.toml")
    assert Room(tmp_path).front()["recent"] == ["a.toml"]
    assert Room(tmp_path / "elsewhere").front()["recent"] == []
    assert room.forget()["recent"] == []
    assert [f["file"] for f in room.front()["files"]] == ["a.toml"]
    with pytest.raises(DeckError) as refused:
        room.new("a")
    assert refused.value.code == "output.over-another-file"
