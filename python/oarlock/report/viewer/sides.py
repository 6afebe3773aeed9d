"""Which side of a body a name is of: `r_elbow`, `elbow_right`."""

from __future__ import annotations

from typing import Literal

Side = Literal["right", "left", ""]

_BEFORE: dict[str, Side] = {"r_": "right", "l_": "left"}
_BEHIND: dict[str, Side] = {"_right": "right", "_left": "left"}


def side_of(name: str) -> tuple[Side, str]:
    """Side and the name without it: `("right", "elbow")`; an empty side where the name says none."""
    for mark, side in _BEFORE.items():
        if name.startswith(mark):
            return side, name.removeprefix(mark)
    for mark, side in _BEHIND.items():
        if name.endswith(mark):
            return side, name.removesuffix(mark)
    return "", name
