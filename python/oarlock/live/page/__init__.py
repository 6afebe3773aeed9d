"""The live page: its files, what it must know at first, and the server of a session that has both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from oarlock.live.frame import SCHEMA
from oarlock.live.named_angles import joints_with_names
from oarlock.live.server import PageServer
from oarlock.model.coordinates import joint_columns
from oarlock.report.viewer.sides import side_of

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.live.live import Live

FOLDER = Path(__file__).parent
BUILT = ("live.js", "live.css")
_DEG = 180.0 / np.pi


def page_server(
    live: Live,
    host: str = "127.0.0.1",
    port: int = 0,
    token: str = "",
    *,
    title: str = "",
    more: Mapping[str, Any] | None = None,
) -> PageServer:
    """The server of a session's page; it is the session's `server` from now on.

    Args:
        live: a session that does not run yet.
        host: address of this machine; 127.0.0.1 reaches no other machine.
        port: 0 for any that is free.
        token: part of the address that viewers need; "" for none.
        title: heads the page; the model's name if empty.
        more: further keys of the first message, such as columns of a table that grows in the session, docs/live.md.
    """
    live.server = PageServer(
        page_files(token),
        live.do,
        lambda: hello(live, title, more),
        host,
        port,
        token,
        clock=lambda: live.seconds,
    )
    return live.server


def page_files(token: str = "") -> dict[str, bytes]:
    """Path -> content of the page's files; the page asks for the others with its token."""
    page = (FOLDER / "index.html").read_text(encoding="utf-8")
    query = f"?token={quote(token, safe='')}" if token else ""
    files = {f"/{name}": (FOLDER / name).read_bytes() for name in BUILT}
    return {"/": page.replace("{{query}}", escape(query)).encode(), **files}


def hello(live: Live, title: str = "", more: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The first message to a viewer: what stays as it is during the session."""
    told: dict[str, Any] = {
        "type": "hello",
        "schema": SCHEMA,
        "title": title or live.model.name,
        "model": live.model.name,
        "sent_s": round(live.seconds, 4),
        "figure": None if live.picture is None else live.picture.structure,
        "joints": list(_joints(live.model)),
        "streams": [
            {"name": feed.stream, "kind": feed.kind, "rate_hz": feed.rate_hz} for feed in live.rig.feeds
        ],
    }
    guide = {} if live.lead is None else {"guide": live.lead.hello}
    return told | guide | dict(more or {})


def _joints(model: Model) -> Iterator[dict[str, Any]]:
    """Each coordinate with its words, in the unit that a coach reads: degrees, and millimetres for distances.

    The parts of a rotation vector say nothing to a coach: the named angles of its joint stand in their place.
    """
    joints = {joint.name: joint for joint in model.describe().joints}
    rotations = joints_with_names(model)
    for name, columns in joint_columns(model.coordinate_names).items():
        hint = (joints[name].label if name in joints else "") or ""
        if name not in rotations:
            is_slide = name in joints and joints[name].kind == "slide"
            yield _curve(name, is_slide, hint)
            continue
        for column in columns[:-3]:
            yield _curve(model.coordinate_names[column], True, hint)
        for angle in rotations[name].names:
            yield _curve(angle, False, hint)


def _curve(name: str, is_length: bool, hint: str) -> dict[str, Any]:
    side, stem = side_of(name)
    panel = stem.replace("_", " ").replace(".", " ")
    return {
        "name": name,
        "label": f"{side} {panel}".strip(),
        "panel": panel,
        "side": side,
        "unit": "mm" if is_length else "deg",
        "scale": 1e3 if is_length else _DEG,
        "hint": hint,
    }
