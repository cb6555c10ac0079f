"""The studio's server: one page and a small interface to the project behind it, on loopback and for one visitor.

Every user of a machine reaches its loopback. So each studio has a token: it stands in the address that the command prints, the page's first
answer makes a cookie of it, and what brings neither is refused.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import threading
from collections.abc import Awaitable, Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import parse_qs

from thermid.app.studio.room import Room, as_json
from thermid.base.errors import DeckError, ThermidError, cap, optional, raising
from thermid.base.grammar import endless

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from uvicorn import Config

HOSTS = ("127.0.0.1", "localhost")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Nothing from elsewhere, no script in the page; the picture of the model brings its own style element."""
STRANGER: Final = "this studio answers those who know its token. Open the whole address that `thermid studio` printed in its terminal."
LONGEST_NAME: Final = 80
"""Characters of a file's name that an error shows."""
GUARD = "x-thermid-studio"
"""A header that a page of another origin cannot send without being asked first, and is then refused."""
REQUEST_TIMEOUT: Final = 10.0
"""Time in which a connection must bring the headers of a request, and then its body. [s]"""
CROWD: Final = 4
"""Open connections for each that the studio answers at once, beyond which one more is closed."""
NOTHING: Final = "this studio has no such thing, or no project is open. Open one on the start page."
BUNDLE: Final = "bundle"
NOT_BUILT: Final = """<!doctype html><html lang="en"><meta charset="utf-8"><title>thermid studio</title><h1>This page was not built</h1>
<p>The pages of the studio are made by <code>make setup</code>, which needs Node 20 or newer, or a registry of Python packages for the one
that it pins, and a registry of npm packages. Run it again where both can be reached, or install a wheel, which has them.</p></html>"""
"""What stands in place of a page of the bundle where there is none."""
KINDS = {".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8"}


def application(room: Room, port: int, token: str) -> Starlette:
    """Return a studio as an ASGI application.

    Parameters
    ----------
    room : Room     What is open.
    port : int      Where it will listen; requests under any other name are refused.
    token : str     What every request must bring, in its address or as the page's cookie.

    Raises
    ------
    MissingExtraError   When the extra `studio` is missing.
    """
    make_application = optional("starlette.applications", "the studio").Starlette
    Route = optional("starlette.routing", "the studio").Route  # noqa: N806  # a class
    lock = threading.Lock()

    def stored(name: str) -> Callable[[bytes], dict[str, str]]:
        """Return what keeps a log that was dropped on the page, its bytes as they are."""
        return lambda data: {"file": room.built().stored_log(name, data)}

    routes = [
        Route("/", _page(lambda: "start.html" if room.project is None else "studio.html")),
        Route("/start", _page(lambda: "start.html")),
        Route("/build", _page(lambda: "build.html")),
        # a long log is read beside what the sliders ask for, not before it
        Route("/api/bench", _writes(lambda name: room.look, threading.Lock(), _object), methods=["POST"]),
        Route("/api/draft/log/{name}", _writes(stored, lock, lambda request: _bytes(request, "unpacked")), methods=["POST"]),
        Route("/api/{name:path}", _reads(lambda name: room.answering.get(name), lock)),
        Route("/api/{name:path}", _writes(lambda name: room.ordering.get(name), lock, _object), methods=["POST"]),
        Route(f"/{BUNDLE}/{{name}}", lambda request: _file(request.path_params["name"])),
    ]
    application: Starlette = make_application(routes=routes)
    application.add_middleware(Guard, port=port, token=token)
    return application


def _page(name: Callable[[], str]) -> Callable[[Request], Response]:
    """Return an endpoint that answers with a page."""
    return lambda request: _file(name())


def _reads(answer: Callable[[str], Callable[[Mapping[str, str]], Any] | None], lock: threading.Lock) -> Callable[[Request], Response]:
    """Return an endpoint that answers with JSON, errors of ours in words; `answer` gives by name what answers the query of an address."""

    def endpoint(request: Request) -> Response:
        """Answer a request that only reads."""
        make = answer(request.path_params["name"])
        if make is None:
            return _refused(NOTHING, 404)
        with lock:
            return _answer(lambda: make(request.query_params))

    return endpoint


def _writes(
    order: Callable[[str], Callable[[Any], Any] | None], lock: threading.Lock, read: Callable[[Request], Awaitable[Any]]
) -> Callable[[Request], Awaitable[Response]]:
    """Return the same for a request with a body, which `read` makes of it; one order is done at a time."""

    async def endpoint(request: Request) -> Response:
        """Answer a request with a body."""
        from starlette.concurrency import run_in_threadpool

        make = order(request.path_params.get("name", ""))
        if make is None:
            return _refused(NOTHING, 404)
        try:
            body = await read(request)
        except _RefusedError as refused:
            return _refused(str(refused), refused.status)

        def locked() -> Response:
            """Do what was ordered."""
            with lock:
                return _answer(lambda: make(body))

        return await run_in_threadpool(locked)

    return endpoint


class _RefusedError(Exception):
    """A request that is not answered: why, and with which status."""

    def __init__(self, why: str, status: int = 400) -> None:
        super().__init__(why)
        self.status = status


async def _object(request: Request) -> dict[str, Any]:
    """Return the JSON object that the page sent.

    Raises
    ------
    _RefusedError   When it is none, is too large or slow, or does not come from the page.
    """
    try:
        body = json.loads(await _bytes(request, "body"))
    except (ValueError, RecursionError):
        raise _RefusedError("the body is not JSON.") from None
    if not isinstance(body, dict):
        raise _RefusedError("the body is not a JSON object.")
    fault = endless(body)
    if fault:
        raise _RefusedError(f"{fault[0]}: {fault[1]}")
    return body


async def _bytes(request: Request, most: str) -> bytes:
    """Return the body that the page sent, up to a cap.

    Raises
    ------
    _RefusedError   When it is too large or slow, or does not come from the page.
    """
    from starlette.requests import ClientDisconnect

    if request.headers.get(GUARD) != "1":
        raise _RefusedError("requests that change something must come from the studio's page.")
    body, limit = bytearray(), cap(most)
    try:
        async with asyncio.timeout(REQUEST_TIMEOUT):
            async for part in request.stream():
                body += part
                if len(body) > limit:  # as soon as it is larger than anything that the page sends
                    raise _RefusedError(f"the body has more than {limit / 1e6:.3g} MB.{raising(most)}", 413)
    except ClientDisconnect:
        raise _RefusedError("the connection was closed before the body came.") from None
    except TimeoutError:  # it comes by drops
        raise _RefusedError(f"the body did not come within {REQUEST_TIMEOUT:g} s.", 408) from None
    return bytes(body)


class Guard:
    """Refuses what was not asked of this server by its own page, and tells the browser to load nothing else."""

    def __init__(self, app: Any, port: int, token: str) -> None:
        self.app = app
        self.hosts = {f"{host}:{port}" for host in HOSTS}
        self.cookie, self.token = f"thermid-studio-{port}", token.encode()  # a browser keeps cookies by host alone

    def _is_token(self, brought: str) -> bool:
        """Whether a text is the token of this studio."""
        return secrets.compare_digest(brought.encode(), self.token)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on when its Host, and its Origin where it has one, are this server's, and it brings the token."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = {k.decode("latin-1"): v.decode("latin-1") for k, v in scope["headers"]}
        origin = headers.get("origin")
        if headers.get("host") not in self.hosts or (origin is not None and origin.removeprefix("http://") not in self.hosts):
            await _refused("this studio accepts requests of its own page only.", 403)(scope, receive, send)
            return
        in_address = any(map(self._is_token, parse_qs(scope["query_string"].decode("latin-1")).get("token", [])))
        cookies = [pair.strip().partition("=") for pair in headers.get("cookie", "").split(";")]
        if not in_address and not any(name == self.cookie and self._is_token(value) for name, _, value in cookies):
            await _refused(STRANGER, 403)(scope, receive, send)
            return

        async def guarded(message: Any) -> None:
            """Send an answer with the headers that tell the browser to load nothing else."""
            if message["type"] == "http.response.start":
                extra = {"content-security-policy": POLICY, "x-content-type-options": "nosniff", "referrer-policy": "no-referrer"}
                if in_address:
                    extra["set-cookie"] = f"{self.cookie}={self.token.decode()}; Path=/; HttpOnly; SameSite=Strict"
                message["headers"] = [*message["headers"], *((k.encode(), v.encode()) for k, v in extra.items())]
            await send(message)

        await self.app(scope, receive, guarded)


def _answer(make: Callable[[], Any]) -> Response:
    """Return an answer as JSON; what is refused, in words."""
    from starlette.responses import Response

    try:
        return Response(as_json(make()), media_type="application/json")
    except ThermidError as error:
        # an answer in words is no failure of the transport, and a browser would note one as an error of the page
        problem = {"error": error.message, "where": error.where, "code": error.code}
    except OSError as error:
        name = Path(str(error.filename or "")).name
        problem = {"error": f"{error.strerror or error}.", "where": name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."}
    return Response(as_json(problem), media_type="application/json")


def _refused(why: str, status: int = 400) -> Response:
    """Return a refusal as JSON."""
    from starlette.responses import Response

    return Response(as_json({"error": why, "where": "studio"}), status, media_type="application/json")


def _file(name: str) -> Response:
    """Return a file of the bundle, or what to do where it was not built."""
    from starlette.responses import Response

    home = files("thermid.app.studio").joinpath(BUNDLE)
    parts = {f.name: f for f in home.iterdir()} if home.is_dir() else {}
    if name in parts and Path(name).suffix in KINDS:
        kind = KINDS[Path(name).suffix]
        return Response(parts[name].read_text(encoding="utf-8"), media_type=kind, headers={"cache-control": "no-store"})
    if not parts:
        return Response(NOT_BUILT, 503, media_type=KINDS[".html"])
    return _refused("this page does not exist.", 404)


def serve(room: Room, port: int, ready: Callable[[str], None] | None = None) -> None:
    """Serve a studio on loopback until it is interrupted.

    Parameters
    ----------
    room : Room         What is open.
    port : int          A free one is taken where it is 0.
    ready : callable    Called with the address once it answers; it holds the token.

    Raises
    ------
    MissingExtraError   When the extra `studio` is missing.
    DeckError           When the port is taken.
    """
    import socket

    uvicorn = optional("uvicorn", "the studio")
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
    except OSError:
        listener.close()
        raise DeckError(
            f"port {port} is in use. Give another with --port, or 0 for any free one.", "studio", code="studio.not-now"
        ) from None
    taken = int(listener.getsockname()[1])
    listener.listen()
    token = secrets.token_urlsafe()
    if ready is not None:
        ready(f"http://127.0.0.1:{taken}/?token={token}")
    uvicorn.Server(limited(application(room, taken, token), log_level="warning")).run(sockets=[listener])


def limited(app: Any, **more: Any) -> Config:
    """Return the settings of a server with the studio's limits: of headers, of requests at once, of connections and of their silence.

    Parameters
    ----------
    app : ASGI application
    more : dict     Further settings of uvicorn.
    """
    import uvicorn
    from uvicorn.protocols.http.h11_impl import H11Protocol

    clients = int(cap("clients"))

    class PatientProtocol(H11Protocol):
        """A connection that is closed when no request comes of it."""

        waited: asyncio.TimerHandle | None = None

        def connection_made(self, transport: Any) -> None:
            """Begin to wait; where too many are open, close at once."""
            super().connection_made(transport)
            if len(self.connections) > CROWD * clients:
                transport.close()
                return
            self._wait()

        def data_received(self, data: bytes) -> None:
            """Wait on from the first byte of the next request, not from each."""
            if self.waited is None and self._idle():
                self._wait()
            super().data_received(data)

        def connection_lost(self, exc: Exception | None) -> None:
            """Wait for nothing more."""
            if self.waited is not None:
                self.waited.cancel()
            super().connection_lost(exc)

        def _idle(self) -> bool:
            """Whether no request is being answered."""
            return self.cycle is None or self.cycle.response_complete

        def _wait(self) -> None:
            """Begin to wait for a request."""
            self.waited = self.loop.call_later(REQUEST_TIMEOUT, self._over)

        def _over(self) -> None:
            """Close the connection where none came."""
            self.waited = None
            if self._idle() and not self.transport.is_closing():
                self.transport.close()

    return uvicorn.Config(
        app,
        http=PatientProtocol,
        ws="none",
        h11_max_incomplete_event_size=int(cap("headers")),
        limit_concurrency=clients,
        **{"access_log": False} | more,
    )
