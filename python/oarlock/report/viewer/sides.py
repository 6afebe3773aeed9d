"""Finds the side of the body in a name such as `r_elbow`, `elbow_r` or `elbow_right`, for colours and comparisons."""

from __future__ import annotations

from typing import Literal

Side = Literal["right", "left", ""]

_BEFORE: dict[str, Side] = {"r_": "right", "l_": "left"}
_BEHIND: dict[str, Side] = {"_right": "right", "_left": "left", "_r": "right", "_l": "left"}


def side_of(name: str) -> tuple[Side, str]:
    """Side and the name without it: `("right", "elbow")`; an empty side if the name contains none."""
    for mark, side in _BEFORE.items():
        if name.startswith(mark):
            return side, name.removeprefix(mark)
    for mark, side in _BEHIND.items():
        if name.endswith(mark):
            return side, name.removesuffix(mark)
    return "", name
