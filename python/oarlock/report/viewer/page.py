"""The player in a page: one file that works without a network, or a piece of another page."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from oarlock.report.markup import rendered
from oarlock.storage.errors import DataError

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:"
"""What a browser may load for the page: nothing from outside."""


def page(scene: Mapping[str, Any], title: str) -> str:
    """One HTML text with player and data in it."""
    return rendered("player", heading=title, policy=POLICY, player=embed(scene, "player"))


def embed(scene: Mapping[str, Any], element_id: str, *, with_player: bool = True) -> str:
    """A piece of a page: the place where the player appears and its data.

    Args:
        scene: what `scene` made.
        element_id: of the place, unique in the page: letters, digits, `-` and `_`.
        with_player: bring style and script along. The first piece of a page needs them, further ones do not; a page
            may also hold `player_assets()` once and all pieces without.

    Raises:
        DataError: an id that is none.
    """
    if not re.fullmatch(r"[A-Za-z][\w\-]*", element_id):
        raise DataError(f"embed: '{element_id}' is no id; begin with a letter, then letters, digits, - and _")
    text = json.dumps(scene, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    place = rendered("player_place", key=element_id, scene=text.replace("<", "\\u003c"))
    return (player_assets() if with_player else "") + place


def player_assets() -> str:
    """Style and script of the player, once for a page; the script draws every player of the page."""
    return f"<style>{_bundled('player.css')}</style><script>{_bundled('player.js')}</script>"


def _bundled(name: str) -> str:
    return files("oarlock.report.viewer").joinpath(name).read_text(encoding="utf-8")
