"""Developer fields of strokes in FIT files: those of the rowing community's draft standard, and Oarlock's own.

The draft is github.com/MoveLab-Studio/rowing-data-standard, version 0.1 of 2026-08-31, sections 5.1 to 5.3. Fields
whose scale is disputed there (AverageBoatSpeed, EffectiveLength) are not used.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from uuid import NAMESPACE_DNS, uuid5

import numpy as np

from oarlock.rowing.analysis.features import FEATURES

STANDARD_ID = uuid5(NAMESPACE_DNS, "rowingdata").bytes
"""Application of the draft standard."""
OWN_ID = uuid5(NAMESPACE_DNS, "oarlock").bytes
PROTOCOL = 1
STRATEGY, STRATEGY_NAME, STROKE_BOUNDARY = 10, "RecordingStrategy", 1
EPOCH_S = 631_065_600
"""1989-12-31 in seconds since 1970."""

UNITS: Mapping[str, float] = MappingProxyType(
    {
        **dict.fromkeys(
            ("", "1", "m", "s", "rad", "N", "J", "W", "m/s", "rad/s", "m/s2", "1/min", "m2"), 1.0
        ),
        **{"mm": 1e-3, "cm": 1e-2, "ms": 1e-3, "deg": np.pi / 180.0, "deg/s": np.pi / 180.0, "%": 1e-2},
        **{"cm2": 1e-4, "1e-6 kg m2": 1.0, "lbs": 4.4482216152605, "spm": 1.0, "bpm": 1.0, "beats/min": 1.0},
    }
)
"""A number in this unit times this is in SI or radians."""


@dataclass(frozen=True)
class FitField:
    """A developer field.

    Args:
        name: in the file.
        column: of the stroke table, or of its standard deviations.
        unit: one of `UNITS`.
        number: in the draft standard; None for Oarlock's own, which are found by name.
        scale: of the whole number in the file; 0 for floating-point numbers.
        is_std: whether it is the standard deviation of the column.
    """

    name: str
    column: str
    unit: str
    number: int | None = None
    scale: int = 0
    is_std: bool = False

    @property
    def is_signed(self) -> bool:
        """Whether the whole number has a sign: angles have."""
        return self.unit == "deg"


_ANGLES = ("Catch", "Finish", "Slip", "Wash", "PeakForceAngle")
_ANGLE_COLUMNS = ("catch_angle_rad", "finish_angle_rad", "slip_rad", "wash_rad", "peak_force_angle_rad")
STANDARD: tuple[FitField, ...] = (
    FitField("DriveLength", "handle_travel_m", "mm", 0, 1),
    FitField("StrokeDriveTime", "drive_time_s", "ms", 1, 1),
    FitField("DragFactor", "drag_factor", "", 2, 1),
    FitField("StrokeRecoveryTime", "recovery_time_s", "ms", 3, 1),
    FitField("AverageDriveForce", "mean_force_n", "N", 6, 10),
    FitField("PeakDriveForce", "peak_force_n", "N", 7, 10),
    *(
        FitField(name, column, "deg", 11 + k, 10)
        for k, (name, column) in enumerate(zip(_ANGLES, _ANGLE_COLUMNS, strict=True))
    ),
    FitField("PeakForcePositionAbs", "peak_force_position_m", "mm", 18, 1),
    FitField("StrokeWork", "work_j", "J", 19, 1),
    *(
        FitField(f"{name}{side}", f"{mark}_{column}", "deg", 200 + 2 * k + place, 10)
        for k, (name, column) in enumerate(zip(_ANGLES, _ANGLE_COLUMNS, strict=True))
        for place, (mark, side) in enumerate((("r", "Port"), ("l", "Starboard")))
    ),
)
"""Fields of the draft standard that a stroke table can fill."""
OTHER_NAMES: Mapping[str, str] = MappingProxyType(
    {
        "AverageDriveForceN": "mean_force_n",
        "PeakDriveForceN": "peak_force_n",
        "AverageDriveForceLbs": "mean_force_n",
        "PeakDriveForceLbs": "peak_force_n",
        "StrokeDistance": "distance_per_stroke_m",
    }
)
"""Columns by names of fields that earlier versions of the draft had; they are read and not written."""
NATIVE = frozenset(
    {
        *(
            "rate_per_min",
            "heart_rate_per_min",
            "power_w",
            "speed_m_s",
            "distance_m",
            "distance_per_stroke_m",
        ),
        *("stroke_number", "interval"),
    }
)
"""Columns that have a place in FIT's own messages."""
TIMES = ("catch_time_s", "finish_time_s", "end_time_s", "time_s")
"""Columns of times: as developer fields they count from the session's start, in 64 bits."""

_UNIT_END = re.compile(r"_(rad_s|m_s2|m_s|per_min|rad|m2|s|m|n|j|w)$")
_BY_COLUMN = {one.column: one.name for one in STANDARD}


def own_field(column: str, is_std: bool = False) -> FitField:
    """Oarlock's own field for a column without one in the draft standard, or for a column's standard deviation."""
    feature = FEATURES.get(column)
    unit = "s" if column in TIMES else "" if feature is None else feature.shown_unit
    name = _BY_COLUMN.get(column) or _own_name(column)
    return FitField(f"{name}Std" if is_std else name, column, "" if unit == "1" else unit, is_std=is_std)


def _own_name(column: str) -> str:
    side = {"r_": "Port", "l_": "Starboard"}.get(column[:2], "")
    stem = _UNIT_END.sub("", column[2:] if side else column)
    return "".join(part.capitalize() for part in stem.split("_")) + side


KNOWN: Mapping[str, FitField] = MappingProxyType(
    {name: FitField(name, column, "") for name, column in OTHER_NAMES.items()}
    | {one.name: one for one in STANDARD}
)
"""By name: what is read from files of any application; the unit is that of the file."""
KNOWN_OWN: Mapping[str, FitField] = MappingProxyType(
    {one.name: one for column in FEATURES for one in (own_field(column), own_field(column, is_std=True))}
)
"""By name: what is read besides from files by Oarlock. Its names are plain words, which others use otherwise."""
