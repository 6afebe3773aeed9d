"""Makes unique names for OpenSim: ASCII letters, digits and underscores."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable


class PlainNames:
    """Makes names unique by appending a number."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)

    def give(self, wanted: str) -> str:
        """The name in plain letters, with a number if it is not unique: `bein`, `bein_2`."""
        plain = plain_name(wanted)
        numbered = (plain if k == 1 else f"{plain}_{k}" for k in range(1, len(self._taken) + 2))
        found = next(name for name in numbered if name not in self._taken)
        self._taken.add(found)
        return found


def plain_name(name: str) -> str:
    """Removes accents (`é` becomes `e`), replaces other letters by their number (`u0436`) and other signs by `_`."""
    parts = unicodedata.normalize("NFKD", name)
    kept = (letter for letter in parts if not unicodedata.combining(letter))
    spelled = "".join(letter if letter.isascii() else f"u{ord(letter):04x}" for letter in kept)
    return re.sub(r"\W", "_", spelled, flags=re.ASCII) or "_"
