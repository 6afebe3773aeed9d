"""Writes the viewer as one HTML file that works offline, or as a part of another page."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from oarlock.report.markup import rendered
from oarlock.storage.errors import DataError

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:"
"""Content-Security-Policy of the page: a browser loads nothing from outside."""
VIDEO_POLICY = f"{POLICY}; media-src 'self' file: blob:"
"""The same for a page with a video, a file beside it or one that the reader chooses."""


def page(scene: Mapping[str, Any], title: str) -> str:
    """The HTML page with player and data."""
    policy = VIDEO_POLICY if scene.get("video") else POLICY
    return rendered("player", heading=title, policy=policy, player=embed(scene, "player"))


def embed(scene: Mapping[str, Any], element_id: str, *, with_player: bool = True) -> str:
    """A part of a page: the element of the player and its data.

    Args:
        scene: the result of `scene`.
        element_id: id of the element, unique in the page: letters, digits, `-` and `_`.
        with_player: include style and script. The first part of a page needs them, further ones do not. A page may
            also contain `player_assets()` once and all parts without them.

    Raises:
        DataError: the id is invalid.
    """
    if not re.fullmatch(r"[A-Za-z][\w\-]*", element_id):
        raise DataError(
            f"embed: '{element_id}' is not a valid id; begin with a letter, then letters, digits, - and _"
        )
    text = json.dumps(scene, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    place = rendered("player_place", key=element_id, scene=text.replace("<", "\\u003c"))
    return (player_assets() if with_player else "") + place


def player_assets() -> str:
    """Style and script of the player, once for a page; the script draws every player of the page."""
    style, script = (files(__package__).joinpath(f"player.{end}").read_text("utf-8") for end in ("css", "js"))
    return f"<style>{style}</style><script>{script}</script>"
