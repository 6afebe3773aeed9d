"""`frames`: the newest estimates of a running session, for programs of others; docs/live.md documents the messages."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.sync.client import connect

from oarlock.storage.errors import DataError

SOCKET_PATH = "/live"
_SHOWN = '{"shown": 1}'


def frames(url: str) -> Iterator[dict[str, Any]]:
    """Frames of a running session until it ends, each the newest when it is asked for.

    A program that is slower than the session misses frames and is never late.

    Args:
        url: the page's address with its token, such as `http://127.0.0.1:8765/?token=...`.

    Yields:
        `time_s`, `arrival_s`, `joints` (name -> value and standard deviation, rad or m) and, with a figure, its points.

    Raises:
        DataError: no session answers at this address, or it refuses.
    """
    address = socket_address(url)
    try:
        socket = connect(address, compression=None)
    except (OSError, InvalidHandshake, InvalidURI) as error:
        raise DataError(
            f"no session answers at {url} ({error}). "
            "Copy the whole address that `oarlock live` prints, with its token, while the session runs"
        ) from error
    with socket:
        try:
            for message in socket:
                told = json.loads(message)
                if told["type"] != "now":
                    continue
                if "frame" in told:
                    yield told["frame"]
                socket.send(_SHOWN)
        except ConnectionClosed:
            return


def socket_address(url: str) -> str:
    """Address of the WebSocket of a page: `ws://.../live`, with the page's token."""
    parts = urlsplit(url if "://" in url else f"http://{url}")
    scheme = {"http": "ws", "https": "wss"}.get(parts.scheme, parts.scheme)
    return urlunsplit((scheme, parts.netloc, SOCKET_PATH, parts.query, ""))
