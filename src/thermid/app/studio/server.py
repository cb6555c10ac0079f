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

from thermid.app.studio.follow import Follower
from thermid.app.studio.live import LiveWatch
from thermid.app.studio.orders import as_json, orders, questions
from thermid.app.studio.project import Project
from thermid.app.studio.work import Work
from thermid.base.errors import DeckError, MissingExtraError, ThermidError, cap, raising
from thermid.base.extensions import missing
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
PATIENCE: Final = 10.0
"""Time in which a connection must bring the headers of a request, and then its body. [s]"""
CROWD: Final = 4
"""Open connections for each that the studio answers at once, beyond which one more is closed."""
KINDS = {".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8"}


def application(project: Project, port: int, token: str, log: Path | None = None) -> Starlette:
    """Return the studio of a project as an ASGI application.

    Parameters
    ----------
    project : Project   What is open.
    port : int          Where it will listen; requests under any other name are refused.
    token : str         What every request must bring, in its address or as the page's cookie.
    log : Path or None  A log that grows, to be followed.

    Raises
    ------
    DeckError   When the extra `studio` is missing.
    """
    try:
        from starlette.applications import Starlette
        from starlette.routing import Route
    except ImportError:
        raise MissingExtraError(missing(["starlette", "uvicorn"], "the studio")) from None
    work, lock = Work(project), threading.Lock()
    follower = Follower(project.path.parent, log, LiveWatch(project.subject))
    answers, asked = questions(project, work, follower), orders(project, work)
    routes = [Route("/", _page), Route("/static/{name}", _page)]
    routes += [Route(f"/api/{name}", _reads(answer, lock)) for name, answer in answers.items()]
    routes += [Route(f"/api/{name}", _writes(order, lock), methods=["POST"]) for name, order in asked.items()]
    # a long log is read beside what the sliders ask for, not before it
    routes.append(Route("/api/bench", _writes(follower.look, threading.Lock()), methods=["POST"]))
    application = Starlette(routes=routes)
    application.add_middleware(Guard, port=port, token=token)
    return application


def _page(request: Request) -> Response:
    """Answer with a file of the page."""
    return _file(request.path_params.get("name", "index.html"))


def _reads(make: Callable[[Mapping[str, str]], Any], lock: threading.Lock) -> Callable[[Request], Response]:
    """Return an endpoint that answers with JSON, errors of ours in words."""

    def endpoint(request: Request) -> Response:
        with lock:
            return _answer(lambda: make(request.query_params))

    return endpoint


def _writes(make: Callable[[Mapping[str, Any]], Any], lock: threading.Lock) -> Callable[[Request], Awaitable[Response]]:
    """Return the same for a request with a body of JSON."""

    async def endpoint(request: Request) -> Response:
        from starlette.concurrency import run_in_threadpool

        try:
            body = await _object(request)
        except _RefusedError as refused:
            return _refused(str(refused), refused.status)

        def locked() -> Response:
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
    from starlette.requests import ClientDisconnect

    if request.headers.get(GUARD) != "1":
        raise _RefusedError("requests that change something must come from the studio's page.")
    try:
        body = json.loads(await _body(request))
    except OverflowError:
        raise _RefusedError(f"the body has more than {cap('body') / 1e6:.3g} MB.{raising('body')}", 413) from None
    except ClientDisconnect:
        raise _RefusedError("the connection was closed before the body came.") from None
    except TimeoutError:
        raise _RefusedError(f"the body did not come within {PATIENCE:g} s.", 408) from None
    except (ValueError, RecursionError):
        raise _RefusedError("the body is not JSON.") from None
    if not isinstance(body, dict):
        raise _RefusedError("the body is not a JSON object.")
    fault = endless(body)
    if fault:
        raise _RefusedError(f"{fault[0]}: {fault[1]}")
    return body


class Guard:
    """Refuses what was not asked of this server by its own page, and tells the browser to load nothing else."""

    def __init__(self, app: Any, port: int, token: str) -> None:
        self.app = app
        self.hosts = {f"{host}:{port}" for host in HOSTS}
        self.cookie, self.token = f"thermid-studio-{port}", token.encode()  # a browser keeps cookies by host alone

    def _known(self, brought: str) -> bool:
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
        asked = any(map(self._known, parse_qs(scope["query_string"].decode("latin-1")).get("token", [])))
        kept = [pair.strip().partition("=") for pair in headers.get("cookie", "").split(";")]
        if not asked and not any(name == self.cookie and self._known(value) for name, _, value in kept):
            await _refused(STRANGER, 403)(scope, receive, send)
            return

        async def guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                extra = {"content-security-policy": POLICY, "x-content-type-options": "nosniff", "referrer-policy": "no-referrer"}
                if asked:
                    extra["set-cookie"] = f"{self.cookie}={self.token.decode()}; Path=/; HttpOnly; SameSite=Strict"
                message["headers"] = [*message["headers"], *((k.encode(), v.encode()) for k, v in extra.items())]
            await send(message)

        await self.app(scope, receive, guarded)


def _answer(make: Callable[[], Any]) -> Response:
    from starlette.responses import Response

    try:
        return Response(as_json(make()), media_type="application/json")
    except ThermidError as error:
        # an answer in words is no failure of the transport, and a browser would note one as an error of the page
        said = {"error": error.message, "where": error.where, "code": error.code}
    except OSError as error:
        name = Path(str(error.filename or "")).name
        said = {"error": f"{error.strerror or error}.", "where": name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."}
    return Response(as_json(said), media_type="application/json")


async def _body(request: Request) -> bytes:
    """Return the body of a request.

    Raises
    ------
    OverflowError   As soon as it is larger than anything that the page sends.
    TimeoutError    When it comes by drops.
    """
    body = bytearray()
    async with asyncio.timeout(PATIENCE):
        async for part in request.stream():
            body += part
            if len(body) > cap("body"):
                raise OverflowError
    return bytes(body)


def _refused(why: str, status: int = 400) -> Response:
    from starlette.responses import Response

    return Response(as_json({"error": why, "where": "studio"}), status, media_type="application/json")


def _file(name: str) -> Response:
    """Return a file of the page."""
    from starlette.responses import Response

    known = {f.name: f for f in files("thermid.app.studio").joinpath("static").iterdir()}
    if name not in known:
        return _refused("this page does not exist.", 404)
    return Response(known[name].read_text(encoding="utf-8"), media_type=KINDS[Path(name).suffix], headers={"cache-control": "no-store"})


def serve(project: Project, port: int, ready: Callable[[str], None] | None = None, log: Path | None = None) -> None:
    """Serve the studio of a project on loopback until it is interrupted.

    Parameters
    ----------
    project : Project   What is open.
    port : int          A free one is taken where it is 0.
    ready : callable    Called with the address once it answers; it holds the token.
    log : Path or None  A log that grows, to be followed.

    Raises
    ------
    DeckError   When the extra `studio` is missing.
    DeckError           When the port is taken.
    """
    import socket

    try:
        import uvicorn
    except ImportError:
        raise MissingExtraError(missing(["starlette", "uvicorn"], "the studio")) from None
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
    except OSError:
        listener.close()
        raise DeckError(f"port {port} is in use. Give another with --port, or 0 for any free one.", "studio") from None
    taken = int(listener.getsockname()[1])
    listener.listen()
    token = secrets.token_urlsafe()
    if ready is not None:
        ready(f"http://127.0.0.1:{taken}/?token={token}")
    server = uvicorn.Server(limited(application(project, taken, token, log), log_level="warning"))
    server.run(sockets=[listener])


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
            return self.cycle is None or self.cycle.response_complete

        def _wait(self) -> None:
            self.waited = self.loop.call_later(PATIENCE, self._over)

        def _over(self) -> None:
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
