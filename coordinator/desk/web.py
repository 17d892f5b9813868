"""The HTTP shell: routes, statuses, server-sent events, and a server in a thread of its own.

Decides: what each path answers, and that bodies are short.  Must not know: what commands do
(commands.py), what they are (api.py).  It uses Starlette and uvicorn.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from importlib.metadata import version
from typing import Any, Final

import h11
import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from coordinator.base.errors import InputError
from coordinator.desk.answers import Problem
from coordinator.desk.api import ENDPOINTS, Endpoint
from coordinator.desk.bodies import read_body
from coordinator.desk.commands import Commands, Refused
from coordinator.desk.events import events
from coordinator.desk.line import Line
from coordinator.desk.metrics import CONTENT_TYPE, Metrics
from coordinator.desk.openapi import openapi
from coordinator.desk.rights import Party, Right, is_foreign, party_of
from protocol.key_files import KeyFiles

_MOST_BYTES: Final = 100_000
"""No body may be longer."""

_LOOK_S: Final = 0.01

_MOST_CONNECTIONS: Final = 500
_MOST_KEPT: Final = 400
"""With more connections than this, the oldest one ends for a new one, first those without a whole
request: a STOP gets in while others hold requests that they never finish, or event streams."""

_QUIET: Final = ("asyncio", "uvicorn.error")
"""They warn of every browser that has left, and of every request that is no HTTP."""

_HEADERS: Final = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}


def page_app(page: Callable[[], str]) -> Starlette:
    """Return an app that serves a page to this machine, and nothing else."""

    async def show(_: Request) -> Response:
        return HTMLResponse(page(), headers=_HEADERS)

    return _app([Route("/", _local(show))])


class Desk:
    """The app of one fleet's desk.

    `page` makes the page, told whether who asks may command.  `may_command`: whether the link lets
    this desk command at all.  `is_local`: whether it serves this machine without TLS.  `valid`:
    with TLS, the common names that are let in.
    """

    def __init__(
        self,
        line: Line,
        page: Callable[[bool], str],
        *,
        may_command: bool,
        is_local: bool = True,
        valid: frozenset[str] = frozenset(),
    ) -> None:
        self._line = line
        self._page = page
        self._may_command = may_command
        self._is_local = is_local
        self._valid = valid
        self._commands = Commands(line)
        self.answers: Counter[int] = Counter()
        self._metrics = Metrics(line, self.answers)
        self._document = msgspec.json.encode(openapi(version("splinefleet")))

    def app(self) -> Starlette:
        """Return the app."""

        @asynccontextmanager
        async def lives(_: Starlette) -> AsyncIterator[None]:
            self._line.listen()
            self._commands.previews.start()
            yield
            self._commands.previews.stop()

        routes = [
            Route("/", self._looks(self._show)),
            Route("/api/events", self._looks(self._stream)),
            Route("/api/openapi.json", self._looks(self._openapi)),
            Route("/metrics", self._looks(self._measure)),
        ]
        routes += [Route(one.path, self._handler(one), methods=[one.method]) for one in ENDPOINTS]
        return _app(routes, lives, self.answers)

    def _party(self, request: Request) -> Party:
        """Return who asks; raise HTTPException if it may not even look."""
        name = request.scope.get("common_name")
        if is_foreign(request.headers, is_local=self._is_local):
            raise HTTPException(403, "this page is for the machine that serves it, and for itself")
        if name is not None and name not in self._valid:
            raise HTTPException(401, "this key is not valid")
        party = party_of(name, may_command=self._may_command)
        if party.right < Right.LOOK:
            raise HTTPException(401, "this takes the key of an operator or an observer")
        return party

    def _looks(
        self, handler: Callable[[Request, Party], Awaitable[Response]]
    ) -> Callable[[Request], Awaitable[Response]]:
        async def look(request: Request) -> Response:
            return await handler(request, self._party(request))

        return look

    def _handler(self, endpoint: Endpoint) -> Callable[[Request], Awaitable[Response]]:
        async def handle(request: Request) -> Response:
            party = self._party(request)
            if party.right < endpoint.right:
                raise HTTPException(403, "this takes the key of an operator")
            try:
                data = await _read(request)
                body = read_body(endpoint.body, b"" if endpoint.takes_any else data)
                name = str(request.path_params.get("name", ""))
                answer = await endpoint.handler(self._commands, name, body, party.name)
            except InputError as error:
                return _problem(400, *error.problems)
            except Refused as refused:
                return _problem(refused.status, *refused.problems)
            return _json(endpoint.status, answer)

        return handle

    async def _show(self, _: Request, party: Party) -> Response:
        return HTMLResponse(self._page(party.right is Right.COMMAND), headers=_HEADERS)

    async def _openapi(self, _: Request, __: Party) -> Response:
        return Response(self._document, media_type="application/json", headers=_HEADERS)

    async def _measure(self, _: Request, __: Party) -> Response:
        return Response(self._metrics.text(), media_type=CONTENT_TYPE, headers=_HEADERS)

    async def _stream(self, request: Request, _: Party) -> Response:
        with_scenes = request.query_params.get("scenes") == "1"

        async def lines() -> AsyncIterator[str]:
            async for event, data in events(self._line, with_scenes=with_scenes):
                if request.app.state.is_ending:
                    return
                yield f"event: {event}\ndata: {data}\n\n" if event else ": still here\n\n"

        return StreamingResponse(lines(), media_type="text/event-stream", headers=_HEADERS)


@contextmanager
def served(
    app: Starlette, host: str = "127.0.0.1", port: int = 0, files: KeyFiles | None = None
) -> Iterator[str]:
    """Serve an app and yield its address; port 0 takes a free one.

    `files`: with these keys over TLS; then both sides show certificates of one authority.  Raise
    InputError if the port is in use or the host is not this machine's.
    """
    try:
        listener = socket.create_server((host, port))
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError([f"the page cannot be served at {host}:{port}: {why}"]) from None
    locks: dict[str, Any] = {}
    if files is not None:
        locks = {
            "ssl_certfile": files.certificate,
            "ssl_keyfile": files.private,
            "ssl_ca_certs": str(files.authority),
            "ssl_cert_reqs": ssl.CERT_REQUIRED,
        }
    for name in _QUIET:
        logging.getLogger(name).setLevel(logging.ERROR)
    config = uvicorn.Config(
        app,
        http=_Connection,
        ws="none",
        log_config=None,
        access_log=False,
        server_header=False,
        limit_concurrency=_MOST_CONNECTIONS,
        timeout_graceful_shutdown=1,
        **locks,
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
    thread.start()
    while thread.is_alive() and not server.started:
        time.sleep(_LOOK_S)
    try:
        shown = f"[{host}]" if ":" in host else host
        scheme = "http" if files is None else "https"
        yield f"{scheme}://{shown}:{listener.getsockname()[1]}/"
    finally:
        app.state.is_ending = server.should_exit = True
        thread.join()
        listener.close()


class _Connection(H11Protocol):
    """A connection that tells the app the common name of the other side's certificate.

    What is no HTTP is answered with 400, and counted in `answers` of the app's state.
    """

    since = 0.0
    """When [s] of the loop it was made."""

    def _all(self) -> list[_Connection]:
        return [one for one in self.connections if isinstance(one, _Connection)]

    def send_400_response(self, msg: str) -> None:
        answers = getattr(self.config.app, "answers", None)
        if answers is not None:
            answers[400] += 1
        super().send_400_response(msg)

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        kept = [one for one in self._all() if not one.transport.is_closing()]
        unfinished = [one for one in kept if one.conn.their_state in (h11.IDLE, h11.SEND_BODY)]
        if len(kept) >= _MOST_KEPT:
            min(unfinished or kept, key=lambda one: one.since).transport.abort()
        self.since = self.loop.time()
        super().connection_made(transport)
        tls = transport.get_extra_info("ssl_object")
        if tls is None:
            return
        app, name = self.app, _common_name(tls.getpeercert() or {})

        async def named(scope: Scope, receive: Receive, send: Send) -> None:
            await app({**scope, "common_name": name}, receive, send)

        self.app = named


def _common_name(certificate: dict[str, Any]) -> str:
    """Return the common name of a certificate; "" if it has none."""
    names = [
        value
        for part in certificate.get("subject", ())
        for key, value in part
        if key == "commonName"
    ]
    return names[0] if names else ""


def _app(
    routes: list[Route],
    lifespan: Callable[[Starlette], Any] | None = None,
    answers: Counter[int] | None = None,
) -> Starlette:
    """Return an app that answers what is wrong in JSON, and counts its answers by status."""

    async def problem(_: Request, error: Exception) -> Response:
        status, text = 500, "the desk has failed at this request"
        if isinstance(error, ClientDisconnect):
            status, text = 400, "the body has not come to its end"
        if isinstance(error, HTTPException):
            status, text = error.status_code, error.detail
        return _problem(status, text)

    handlers = dict.fromkeys((HTTPException, ClientDisconnect, 500), problem)
    inner = Starlette(routes=routes, lifespan=lifespan, exception_handlers=handlers)
    inner.router.redirect_slashes = False
    inner.state.is_ending = False
    if answers is not None:
        inner.add_middleware(_Counted, answers=answers)
        inner.answers = answers  # type: ignore[attr-defined]
    return inner


class _Counted:
    """Counts answers by status."""

    def __init__(self, app: ASGIApp, answers: Counter[int]) -> None:
        self._app, self._answers = app, answers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def count(message: Message) -> None:
            if message["type"] == "http.response.start":
                self._answers[message["status"]] += 1
            await send(message)

        await self._app(scope, receive, count if scope["type"] == "http" else send)


def _local(
    handler: Callable[[Request], Awaitable[Response]],
) -> Callable[[Request], Awaitable[Response]]:
    async def handle(request: Request) -> Response:
        if is_foreign(request.headers, is_local=True):
            raise HTTPException(403, "this machine only")
        return await handler(request)

    return handle


async def _read(request: Request) -> bytes:
    """Return a request's body; raise HTTPException if it is too long or no JSON."""
    data = bytearray()
    if int(request.headers.get("content-length", "0")) > _MOST_BYTES:
        raise HTTPException(413, f"the body is longer than {_MOST_BYTES} bytes")
    async for chunk in request.stream():
        data += chunk
        if len(data) > _MOST_BYTES:
            raise HTTPException(413, f"the body is longer than {_MOST_BYTES} bytes")
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if data and kind != "application/json":
        raise HTTPException(415, "the body has to be application/json")
    return bytes(data)


def _json(status: int, answer: object) -> Response:
    data = msgspec.json.encode(answer)
    return Response(data, status, media_type="application/json", headers=_HEADERS)


def _problem(status: int, *problems: str) -> Response:
    return _json(status, Problem("; ".join(problems), list(problems)))
