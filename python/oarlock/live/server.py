"""The page and its WebSocket: viewers get the newest frame each time they have shown the last one.

A viewer acknowledges every frame. Until it does, newer ones replace the one that waits, so a slow or stalled browser
costs nothing and sees no stale picture; sockets alone would hold minutes of frames.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import mimetypes
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from oarlock.storage.errors import DataError

SOCKET_PATH = "/live"
OWN_NAMES = ("127.0.0.1", "localhost", "::1")
LONGEST_MESSAGE = 1 << 16
MOST_RUBBISH = 100
"""A viewer that sends more messages than this that are none is disconnected."""
COMMANDS_PER_S, MOST_AT_ONCE = 5.0, 30.0
"""Commands that a viewer may send: each is recorded, and goes to all viewers."""
LONGEST_CLOSE_S = 1.0
"""A viewer that does not answer holds up the end of a session for so long."""
MOST_TOLD = 1000
MOST_KEPT = 200
"""Announcements that a viewer gets who comes later."""
_NO_TOKEN = (
    b"This address lacks the token of the session.\n"
    b"Use the whole address that the session printed when it started, from http to the last letter behind ?token=\n"
)
_SECURITY = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


@dataclass(eq=False)
class Viewer:
    """One connected viewer. It says `{"shown": 1}` for each message of type `now`."""

    number: int
    clock: Callable[[], float]
    """Seconds, sent with each message of type `now`: so the viewer knows how old a frame is."""
    skipped: int = 0
    """Messages that newer ones replaced before it had shown the last."""
    rubbish: int = 0
    allowance: float = MOST_AT_ONCE
    """Commands that it may send, as of `allowed_s`."""
    allowed_s: float = 0.0
    _newest: dict[str, str] = field(default_factory=dict)
    _is_ready: bool = True
    _news: asyncio.Event = field(default_factory=asyncio.Event)
    _told: list[str] = field(default_factory=list)

    def offer(self, kind: str, message: str) -> None:
        """How it is now; it replaces a message of this kind that still waits."""
        self.skipped += kind in self._newest
        self._newest[kind] = message
        self._news.set()

    def tell(self, message: str) -> None:
        """What changed: not replaced, up to `MOST_TOLD` for a viewer that does not read."""
        if len(self._told) < MOST_TOLD:
            self._told.append(message)
        self._news.set()

    def may_command(self) -> bool:
        """Whether a further command keeps to `COMMANDS_PER_S`; it counts as one."""
        now_s = time.monotonic()
        self.allowance = min(MOST_AT_ONCE, self.allowance + COMMANDS_PER_S * max(0.0, now_s - self.allowed_s))
        self.allowed_s = now_s
        if self.allowance < 1.0:
            return False
        self.allowance -= 1.0
        return True

    def shown(self) -> None:
        """It has shown the last frame."""
        self._is_ready = True
        self._news.set()

    async def next(self) -> list[str]:
        """What to send now; waits until there is something."""
        while True:
            await self._news.wait()
            self._news.clear()
            messages, self._told = self._told, []
            if self._is_ready and self._newest:
                parts = (f'"{kind}":{text}' for kind, text in self._newest.items())
                about = f'{{"type":"now","sent_s":{self.clock():.4f},"skipped":{self.skipped},'
                messages.append(about + ",".join(parts) + "}")
                self._newest, self._is_ready = {}, False
            if messages:
                return messages


@dataclass
class PageServer:
    """Serves the files of a page, and frames to its viewers.

    Args:
        files: path -> content, such as "/" for the page and "/live.js".
        command: is called with each command of a viewer, an object with the key `do`; its answer goes to that viewer.
        hello: the first message to a viewer.
        host: address of this machine; 127.0.0.1 reaches no other machine.
        port: 0 for any that is free.
        token: part of the address that viewers need; "" for none.
        clock: seconds by the clock of the frames' `arrival_s`.
    """

    files: Mapping[str, bytes]
    command: Callable[[Mapping[str, Any]], str | None]
    hello: Callable[[], Mapping[str, Any]]
    host: str = "127.0.0.1"
    port: int = 0
    token: str = ""
    clock: Callable[[], float] = time.monotonic
    viewers: list[Viewer] = field(default_factory=list)
    refused: int = 0
    _server: Server | None = None
    _numbers: int = 0
    _kept: deque[str] = field(default_factory=lambda: deque(maxlen=MOST_KEPT))

    async def start(self) -> None:
        """Opens the port.

        Raises:
            DataError: the port is taken, or the address is not one of this machine.
        """
        try:
            self._server = await serve(
                self._view,
                self.host,
                self.port,
                process_request=self._answer,
                compression=None,
                max_size=LONGEST_MESSAGE,
                max_queue=16,
                close_timeout=LONGEST_CLOSE_S,
            )
        except OSError as error:
            raise DataError(
                f"the page cannot be served at {self.host}:{self.port} ({error.strerror}). "
                "Another program uses the port: end it, or choose another one with --port"
            ) from error
        self.port = next(iter(self._server.sockets)).getsockname()[1]

    async def stop(self) -> None:
        """Closes the port and all connections."""
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()

    @property
    def url(self) -> str:
        """The page's address on this machine."""
        return self.url_at("127.0.0.1" if self.host in ("", "0.0.0.0") else self.host)

    def url_at(self, host: str) -> str:
        """The page's address by a name or an address of this machine."""
        return f"http://{host}:{self.port}/" + (f"?token={quote(self.token, safe='')}" if self.token else "")

    def publish(self, message: Mapping[str, Any]) -> None:
        """Offers a message to all viewers; only the newest of each `type` waits for those that are slow."""
        if self.viewers:
            text = json.dumps(message, allow_nan=False, separators=(",", ":"))
            for viewer in self.viewers:
                viewer.offer(message["type"], text)

    def announce(self, message: Mapping[str, Any]) -> None:
        """Tells all viewers something that none may miss, and those who come later."""
        text = json.dumps(message, allow_nan=False)
        self._kept.append(text)
        for viewer in self.viewers:
            viewer.tell(text)

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file of the page, a refusal, or None to let the WebSocket open."""
        try:
            return self._response_to(request)
        except ValueError:  # an address or a host that is none
            return _response(HTTPStatus.BAD_REQUEST, "text/plain", b"This is no address.\n")

    def _response_to(self, request: Request) -> Response | None:
        parts = urlsplit(request.path)
        if not self._may_enter(parts.query):
            self.refused += 1
            return _response(HTTPStatus.FORBIDDEN, "text/plain", _NO_TOKEN)
        if not self._is_named(request.headers.get("Host", "")):
            self.refused += 1
            return _response(
                HTTPStatus.FORBIDDEN, "text/plain", f"The page is at {self.url}\n".encode("ascii", "replace")
            )
        if parts.path == SOCKET_PATH:
            if self._is_foreign(request.headers):
                self.refused += 1
                return _response(
                    HTTPStatus.FORBIDDEN, "text/plain", b"Only the session's own page may connect.\n"
                )
            return None
        if parts.path not in self.files:
            return _response(HTTPStatus.NOT_FOUND, "text/plain", b"There is no such page.\n")
        kind = mimetypes.guess_type(parts.path)[0] or "text/html"
        return _response(HTTPStatus.OK, f"{kind}; charset=utf-8", self.files[parts.path])

    def _may_enter(self, query: str) -> bool:
        given = parse_qs(query).get("token", [""])[0]
        return hmac.compare_digest(given.encode(), self.token.encode()) if self.token else True

    def _is_named(self, host: str) -> bool:
        """Whether the browser asked for this machine by a name that no other site can take.

        Without a token a site whose name is made to lead to this machine would else be the session's own Origin.
        """
        return bool(self.token) or urlsplit(f"//{host}").hostname in OWN_NAMES

    def _is_foreign(self, headers: Headers) -> bool:
        """A page of another site, opened in a browser on this network; programs send no Origin."""
        origin = headers.get("Origin")
        return origin is not None and urlsplit(origin).netloc != headers.get("Host")

    async def _view(self, connection: ServerConnection) -> None:
        self._numbers += 1
        viewer = Viewer(self._numbers, self.clock)
        for text in (json.dumps(self.hello(), allow_nan=False), *self._kept):
            viewer.tell(text)
        self.viewers.append(viewer)
        sending = asyncio.create_task(_send(connection, viewer))
        try:
            async for message in connection:
                self._hear(viewer, message)
                if viewer.rubbish > MOST_RUBBISH:
                    await connection.close(1008, "too many messages that are none")
        except ConnectionClosed:
            pass
        finally:
            self.viewers.remove(viewer)
            sending.cancel()

    def _hear(self, viewer: Viewer, message: str | bytes) -> None:
        try:
            told = json.loads(message)
            if "shown" in told:
                viewer.shown()
                return
            if not isinstance(told["do"], str):
                raise TypeError
        except (ValueError, KeyError, TypeError, RecursionError):
            viewer.rubbish += 1
            viewer.tell(json.dumps({"type": "problem", "text": "a message was not understood"}))
            return
        if not viewer.may_command():
            viewer.rubbish += 1
            text = f"a command was left out: more than {COMMANDS_PER_S:g} a second"
            viewer.tell(json.dumps({"type": "problem", "text": text}))
            return
        problem = self.command(told)
        if problem:
            viewer.tell(json.dumps({"type": "problem", "text": problem}))


async def _send(connection: ServerConnection, viewer: Viewer) -> None:
    try:
        while True:
            for message in await viewer.next():
                await connection.send(message)
    except ConnectionClosed:
        return


def _response(status: HTTPStatus, kind: str, body: bytes) -> Response:
    headers = Headers(
        {"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close", **_SECURITY}
    )
    return Response(status.value, status.phrase, headers, body)
