"""`frames` and `events` of a running session, for programs of others; docs/live.md documents the messages."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.sync.client import ClientConnection, connect

from oarlock.storage.errors import DataError

SOCKET_PATH = "/live"
_SHOWN = '{"shown": 1}'


def frames(url: str) -> Iterator[dict[str, Any]]:
    """Frames of a running session until it ends, each the newest when it is asked for.

    A program that is slower than the session misses frames and is never late.

    Args:
        url: the page's address with its token, such as `http://127.0.0.1:8123/?token=...`.

    Yields:
        `time_s`, `arrival_s`, `joints` (name -> value and standard deviation, rad or m), `angles` (the same of ball
        joints' angles) and, with a figure, its points.

    Raises:
        DataError: no session answers at this address, or it refuses.
    """
    with _connected(url) as socket, suppress(ConnectionClosed):
        for message in socket:
            told = json.loads(message)
            if told["type"] != "now":
                continue
            if "frame" in told:
                yield told["frame"]
            socket.send(_SHOWN)


def events(url: str) -> Iterator[dict[str, Any]]:
    """What happens in a running session until it ends: first the last 200 that have been, then each as it comes.

    Args:
        url: the page's address with its token, such as `http://127.0.0.1:8123/?token=...`.

    Yields:
        `type` and `time_s`; of the type "event" `text`; of a repetition that was completed `number` and `values`
        (key -> `value` and `std`).

    Raises:
        DataError: no session answers at this address, or it refuses.
    """
    # A program that acknowledges no message gets one frame only.
    with _connected(url) as socket, suppress(ConnectionClosed):
        for message in socket:
            told = json.loads(message)
            if told["type"] not in ("hello", "now", "problem"):
                yield told


def _connected(url: str) -> ClientConnection:
    try:
        return connect(socket_address(url), compression=None)
    except (OSError, InvalidHandshake, InvalidURI) as error:
        raise DataError(
            f"no session answers at {url} ({error}). "
            "Copy the whole address that `oarlock live` prints, with its token, while the session runs"
        ) from error


def socket_address(url: str) -> str:
    """Address of the WebSocket of a page: `ws://.../live`, with the page's token."""
    parts = urlsplit(url if "://" in url else f"http://{url}")
    scheme = {"http": "ws", "https": "wss"}.get(parts.scheme, parts.scheme)
    return urlunsplit((scheme, parts.netloc, SOCKET_PATH, parts.query, ""))
