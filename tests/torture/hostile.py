"""A hostile client of the studio: bodies, headers and connections that no page sends. No answer of 500, and no memory that stays.

``python -m torture.hostile REQUESTS SEED`` in the folder tests prints one JSON object: answers by status, findings, memory measured.
"""

from __future__ import annotations

import http.client
import json
import os
import random
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from torture.mutants import VALUES, _change, by_bytes
from torture.seeds import make

PATIENCE = 60.0
"""Time in which an answer must come, on a busy machine. [s]"""
GROWTH = 64.0
"""Memory that the second half of the requests may add. [MB]"""
ASKED: Final[dict[str, Any]] = {
    "curves": {"stage": "unit", "values": {"bolt.conductance": 0.3}, "run": 0, "points": 300, "measured": True, "window": [0, 1800]},
    "picture": {"stage": "unit", "values": {}, "folded": [], "time": 600, "run": 0},
    "profile": {"stage": "unit", "course": "x", "lowest": -10, "highest": 40.0, "numbers": {"cycles": "2"}},
    "outcome": {"window": [0, 600]},
    "swap": {"part": "unit", "deck": "unit.toml"},
    "bench": {"file": "rig.csv", "rule": "3 C/h", "since": 0.1, "slowest": 1.0, "channel": "T_CASE", "window": [0, 600], "known": ""},
    "fit": {"stage": "nothing", "values": {"bolt.conductance": 0.3}, "free": ["bolt.conductance"]},
    "scenario": {"stage": "unit", "course": "x", "values": {}, "gas": "air", "chamber": [], "state": "operating", "uncertain": False},
    "run": {"stage": "nothing", "below": False},
    "save": {"stage": "nothing", "values": {}, "name": "x"},
    "stop": {},
}  # fmt: skip
TOKENS: Final[dict[int, str]] = {}
"""Token of the studio at each port."""
READ = ("project", "desk", "shelf", "job", "fresh", "logs")
QUERIES = ("", "?stage=unit", "?stage=", "?stage=%00", "?stage=" + "x" * 5000, "?stage=unit&stage=x", "?a[b]=%ff%fe", "?%", "?stage=../..")
PATHS = (
    "/", "/bundle/studio.js", "/bundle/../server.py", "/bundle/%2e%2e%2fserver.py", "//etc/passwd", "/bundle/%00", "/api/", "/api/nothing",
    "/bundle/" + "x" * 3000, "/%ff%fe", "/api/desk/", "*", "http://127.0.0.1/",
)  # fmt: skip


def request(dice: random.Random, port: int, courses: Sequence[str] = ("x",)) -> tuple[bytes, bool]:
    """Return the bytes of one hostile request, and whether it is whole, so that an answer must come."""
    kind = dice.choice(("order",) * 10 + ("question", "question", "path", "headers", "broken", "large"))
    known = f"thermid-studio-{port}={TOKENS.get(port, '') if dice.random() < 0.98 else 'wrong'}"
    host = f"host: 127.0.0.1:{port}\r\ncookie: {known}\r\n"
    if kind == "question":
        return f"GET /api/{dice.choice(READ)}{dice.choice(QUERIES)} HTTP/1.1\r\n{host}connection: close\r\n\r\n".encode(), True
    if kind == "path":
        method = dice.choice(("GET", "POST", "PUT", "DELETE", "OPTIONS", "HEAD", "TRACE", "x", "CONNECT"))
        return f"{method} {dice.choice(PATHS)} HTTP/1.1\r\n{host}connection: close\r\n\r\n".encode(), True
    name = dice.choice([*ASKED])
    body = _body(dice, name, courses)
    if kind == "large":
        body = dice.choice((b"[" * 200_000, b'{"a":' * 100_000, b" " * 1_500_000, b'{"values": {' + b'"x": 1,' * 50_000 + b'"y": 2}}'))
    head = {"host": f"127.0.0.1:{port}", "cookie": known, "x-thermid-studio": "1", "content-length": str(len(body)), "connection": "close"}
    if kind == "headers":
        key = dice.choice((*head, "origin", "cookie", "x-thermid-studio", "transfer-encoding", "expect", "upgrade", "content-type"))
        wrong = (
            "",
            "-1",
            "1e9",
            "99999999999999999999",
            "chunked",
            "null",
            "x" * 100_000,
            "\x00",
            "é",
            "http://evil.example",
            "100-continue",
            "0",
        )
        head[key] = dice.choice(wrong)
        if dice.random() < 0.2:
            head |= {f"x-{k}": "y" * 50 for k in range(2000)}
    text = "".join(f"{k}: {v}\r\n" for k, v in head.items()).encode("utf-8", "replace")
    whole = f"POST /api/{name} HTTP/1.1\r\n".encode() + text + b"\r\n" + body
    if kind == "broken":
        return dice.choice((by_bytes(dice, whole), whole[: dice.randrange(len(whole))], dice.randbytes(300), whole + whole[:40])), False
    return whole, kind == "order"


def _body(dice: random.Random, name: str, courses: Sequence[str]) -> bytes:
    tree = json.loads(json.dumps(ASKED[name]))
    how = dice.random()
    if how < 0.1:
        tree = dice.choice(VALUES)
    elif how < 0.9:
        if "course" in tree and dice.random() < 0.5:
            tree["course"] = dice.choice(courses)
        for _ in range(dice.choice((1, 1, 2, 3))):
            _change(dice, tree)
        if isinstance(tree, dict) and "stage" in ASKED[name] and name not in ("run", "save", "fit") and dice.random() < 0.9:
            tree["stage"] = "unit"
    data = json.dumps(tree, default=str).encode()
    if how > 0.95:
        data = data.replace(b"0", b"1" + b"0" * 400)
    return by_bytes(dice, data) if dice.random() < 0.15 else data


def asked(port: int, data: bytes, whole: bool) -> int:
    """Return the status of the answer to some bytes; 0 where the connection was closed without a word, -1 where nothing came.

    What is not whole ends with the client's end of the connection, and need not be answered.
    """
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as s:
        with suppress(OSError):
            s.sendall(data)
            if not whole:
                s.shutdown(socket.SHUT_WR)
        first = b""
        try:
            while len(first) < 12 and (part := s.recv(65536)):
                first += part
            while s.recv(1 << 20):
                pass
        except TimeoutError:
            return -1
        except OSError:
            pass
    return int(first[9:12]) if first[:5] == b"HTTP/" else 0


def memory(pid: int) -> float:
    """Return the memory of a process. [MB]"""
    return float(next(row.split()[1] for row in Path(f"/proc/{pid}/status").read_text().splitlines() if row.startswith("VmRSS"))) / 1024.0


@contextmanager
def studio(folder: Path) -> Iterator[tuple[int, int]]:
    """Yield process and port of a studio of its own on the project of the seeds."""
    make(folder)
    command = [sys.executable, "-m", "torture.hostile", "serve", str(folder)]
    tests = str(Path(__file__).parents[1])
    more = {**os.environ, "PYTHONPATH": os.pathsep.join([tests, *filter(None, [os.environ.get("PYTHONPATH")])])}
    with (folder.parent / "said").open("w") as said:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=said, text=True, cwd=tests, env=more)
    assert process.stdout is not None
    try:
        address = urllib.parse.urlparse(process.stdout.readline().strip())
        assert address.port is not None
        TOKENS[address.port] = urllib.parse.parse_qs(address.query)["token"][0]
        yield process.pid, address.port
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def _why(said: Path) -> str:
    """Return where the last error of the studio came from."""
    lines = said.read_text(encoding="utf-8", errors="replace").splitlines()
    at = next((x.strip().rpartition("/")[2] for x in reversed(lines) if "/thermid/" in x), "?")
    return f"{at}: {next((x for x in reversed(lines) if 'Error' in x), '?')[:150]}"


def read(port: int, name: str) -> Any:
    """Return what the studio answers to a question."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.request("GET", f"/api/{name}?token={TOKENS[port]}")
    answer = json.loads(connection.getresponse().read())
    connection.close()
    return answer


def ready(port: int) -> list[str]:
    """Wait until the studio has looked at its stages; return keys of what can be run."""
    while not read(port, "job").get("ended"):
        time.sleep(0.2)
    return [c["key"] for c in read(port, "shelf")["courses"]]


def campaign(number: int, seed: int, first: int = 0) -> dict[str, Any]:
    """Send hostile requests; return answers by status, findings, and the memory of the studio on the way. [MB]"""
    counts: Counter[int] = Counter()
    found: dict[str, int] = {}
    sizes = []
    with tempfile.TemporaryDirectory() as place, studio(Path(place) / "p") as (pid, port):
        courses = ready(port)
        for k in range(first, first + number):
            if (k - first) % max(number // 10, 1) == 0:
                sizes.append(memory(pid))
            data, whole = request(random.Random(f"hostile {seed} {k}"), port, courses)
            status = asked(port, data, whole)
            counts[status] += 1
            if status >= 500 or status == -1 or (status == 0 and whole):
                found.setdefault(f"{status} to {data[:60]!r}: {_why(Path(place) / 'said')}" if status else f"no answer to {data[:60]!r}", k)
        sizes.append(memory(pid))
    if sizes[-1] - sizes[len(sizes) // 2] > GROWTH:
        found[f"memory grows: {sizes[len(sizes) // 2]:.0f} MB halfway, {sizes[-1]:.0f} MB at the end"] = 0
    measured = {"memory of the studio": f"{sizes[len(sizes) // 2]:.0f} MB halfway, {sizes[-1]:.0f} MB at the end"}
    return {"counts": dict(sorted(counts.items())), "measured": measured, "findings": found}


def serve(folder: Path) -> None:
    """Serve the project of the seeds, and say where."""
    from thermid.app.studio.project import Project
    from thermid.app.studio.room import Room
    from thermid.app.studio.server import serve as serving

    serving(Room(folder, Project(folder / "campaign.toml")), 0, lambda address: print(address, flush=True))


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(Path(sys.argv[2]))
    else:
        print(json.dumps(campaign(*map(int, sys.argv[1:])), indent=1))
