"""Definitions of all numbers of a stroke, for tables, reports and docs; read from two TOML files in this folder."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from math import pi
from types import MappingProxyType

SIDES = {"r": "right hand (port)", "l": "left hand (starboard)"}
"""A side is a prefix of a column's name: the rower faces the stern."""
_SCALES = {
    ("rad", "deg"): 180.0 / pi,
    ("rad/s", "deg/s"): 180.0 / pi,
    ("s", "ms"): 1e3,
    ("m", "cm"): 1e2,
    ("m", "mm"): 1e3,
    ("1", "%"): 1e2,
    ("m2", "cm2"): 1e4,
    ("1/min", "beats/min"): 1.0,
}


@dataclass(frozen=True)
class Feature:
    """Definition of a number of a stroke.

    Attributes:
        name: of the column, with its unit.
        label: for people, short.
        unit: unit in arrays and files: SI and radians, "1" for shares.
        shown_unit: unit in pages and on the terminal: "deg", "ms", "%".
        sign: the positive direction; "" without a sign.
        definition: how it is found.
        source: who defined it; "own" where nobody else did.
    """

    name: str
    label: str
    unit: str
    shown_unit: str
    sign: str
    definition: str
    source: str

    @property
    def shown_scale(self) -> float:
        """A value times this is in `shown_unit`."""
        return 1.0 if self.unit == self.shown_unit else _SCALES[self.unit, self.shown_unit]

    @property
    def in_words(self) -> str:
        """All of it in one line, but for the name."""
        unit = "" if self.shown_unit == "1" else f", {self.shown_unit}"
        sign = f" Positive: {self.sign}." if self.sign else ""
        return f"{self.label}{unit}. {self.definition}{sign} Source: {self.source}."


_FILES = ("features.toml", "logger_features.toml")


def _features() -> Iterator[tuple[str, Feature]]:
    """Kind and feature."""
    here = files("oarlock.rowing.analysis")
    texts = [here.joinpath(file).read_text(encoding="utf-8") for file in _FILES]
    for name, table in (item for text in texts for item in tomllib.loads(text).items()):
        sides, kind = table.pop("sides", "no"), table.pop("kind", "")
        table.setdefault("shown_unit", table["unit"])
        table.setdefault("sign", "")
        if sides != "only":
            yield kind, Feature(name, **table)
        if sides != "no":
            for side, who in SIDES.items():
                yield kind, Feature(f"{side}_{name}", **table | {"label": f"{table['label']}, {who}"})


_KINDS = tuple(_features())
FEATURES: Mapping[str, Feature] = MappingProxyType({feature.name: feature for _, feature in _KINDS})
"""By the name of the column; a side is a prefix: `r_` and `l_` are the rower's right (port) and left (starboard)."""
NUMBERS = tuple(feature.name for kind, feature in _KINDS if kind == "technique")
"""Columns of every table of technique."""
CURVES = tuple(feature.name for kind, feature in _KINDS if kind == "curve")
"""Curves of technique over the stroke."""
