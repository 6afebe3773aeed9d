"""Formats numbers of strokes for the report and the terminal: units, decimals, signs."""

from __future__ import annotations

import math

from oarlock.report import capital as capital
from oarlock.report import fixed
from oarlock.rowing.analysis.features import Feature

DECIMALS = {
    "deg": 1,
    "ms": 0,
    "s": 2,
    "%": 1,
    "m": 2,
    "cm": 1,
    "mm": 0,
    "cm2": 0,
    "1/min": 1,
    "beats/min": 0,
    "N": 0,
    "J": 0,
    "W": 0,
    "s per 500 m": 1,
}
"""Decimals of numbers in tables by shown unit."""
PLUS_MINUS = "\N{PLUS-MINUS SIGN}"


def places(feature: Feature) -> int:
    """Decimals of a number of this feature."""
    return DECIMALS.get(feature.shown_unit, 2)


def shown(feature: Feature, value: float, signed: bool = False) -> str:
    """A value in the feature's unit as text in its shown unit, without the unit; a dash for NaN."""
    text = fixed(value * feature.shown_scale, places(feature))
    return f"+{text}" if signed and value > 0 and text.strip("0.") else text


def spread(feature: Feature, value: float) -> str:
    """A standard deviation as text, with one more decimal if it would be 0; a dash if unknown."""
    scaled = value * feature.shown_scale
    digits = places(feature)
    if math.isfinite(scaled) and 0 < scaled < 0.5 * 10.0**-digits:
        digits += 1
    return fixed(scaled, digits)


def apart(feature: Feature, now: float, then: float) -> float:
    """`now` minus `then` as a reader computes it from the two shown numbers, in the feature's unit."""
    digits, scale = places(feature), feature.shown_scale
    return (round(now * scale, digits) - round(then * scale, digits)) / scale


def unit_of(feature: Feature) -> str:
    """The shown unit; empty for a number without unit."""
    unit = feature.shown_unit
    return "" if unit == "1" else unit.replace("2", "\N{SUPERSCRIPT TWO}")


def joined_unit(feature: Feature) -> str:
    """The unit after a number in a sentence: `°`, `/min`, ` cm`."""
    unit = unit_of(feature)
    return {"deg": "°", "1/min": "/min"}.get(unit, f" {unit}" if unit else "")


def with_unit(feature: Feature, value: float) -> str:
    """A value with its unit: `-62.1°`, `24.1/min`, `33 %`."""
    return shown(feature, value) + (joined_unit(feature) if math.isfinite(value) else "")
