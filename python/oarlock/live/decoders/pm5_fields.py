"""Fields of the PM5's notifications, for its decoder.

Source: Concept2, "PM Bluetooth Smart Communication Interface Definition", revision 1.30. Deviations in
monitors' traces are described in docs/PM5_Interface.md of Open Rowing Monitor: the last split's time counts
hundredths, not tenths, of a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from oarlock.live.decoders.fields import Field

POUND_FORCE_N = 4.4482216152605

_ELAPSED = Field("elapsed_s", 3, 0.01)
_DISTANCE = Field("distance_m", 3, 0.1)
_AVERAGE_POWER = Field("average_power_w", 2)
_WORK = Field("work_j", 2, 0.1)

_STATUS = (
    _ELAPSED,
    _DISTANCE,
    Field("workout_type", 1),
    Field("interval_type", 1),
    Field("workout_state", 1),
    Field("rowing_state", 1),
    Field("stroke_state", 1),
    Field("work_distance_m", 3),
    Field("workout_duration", 3),
    Field("workout_duration_type", 1),
    Field("drag_factor", 1),
)
_PACE = (
    _ELAPSED,
    Field("speed_m_s", 2, 0.001),
    Field("rate_per_min", 1),
    Field("heart_rate_per_min", 1, absent=255),
    Field("pace_s_per_500_m", 2, 0.01),
    Field("average_pace_s_per_500_m", 2, 0.01),
    Field("rest_distance_m", 2),
    Field("rest_time_s", 3, 0.01),
)
_MACHINE = Field("machine_type", 1)
_INTERVAL = (_ELAPSED, Field("interval", 1))
_SPLIT = (
    Field("energy_kcal", 2),
    Field("split_pace_s_per_500_m", 2, 0.01),
    Field("split_power_w", 2),
    Field("split_energy_rate_kcal_per_h", 2),
    Field("last_split_time_s", 3, 0.01),
    Field("last_split_distance_m", 3),
)
_STROKE = (
    _ELAPSED,
    _DISTANCE,
    Field("handle_travel_m", 1, 0.01),
    Field("drive_time_s", 1, 0.01),
    Field("recovery_time_s", 2, 0.01),
    Field("distance_per_stroke_m", 2, 0.01),
    Field("peak_force_n", 2, POUND_FORCE_N / 10.0),
    Field("mean_force_n", 2, POUND_FORCE_N / 10.0),
)
_NUMBER = Field("stroke_number", 2)
_STROKE_POWER = (
    _ELAPSED,
    Field("power_w", 2),
    Field("energy_rate_kcal_per_h", 2),
    _NUMBER,
    Field("projected_time_s", 3),
    Field("projected_distance_m", 3),
)
_STATE = (
    Field("operational_state", 1),
    Field("verification_state", 1),
    Field("screen", 2),
    Field("last_error", 2),
    Field("calibration_mode", 1),
    Field("calibration_state", 1),
    Field("calibration_status", 1),
    Field("game", 1),
    Field("game_score", 2),
)

ALONE: Mapping[int, tuple[Field, ...]] = MappingProxyType(
    {
        0x31: _STATUS,
        0x32: (*_PACE, _MACHINE),
        0x33: (*_INTERVAL, _AVERAGE_POWER, *_SPLIT),
        0x35: (*_STROKE, _WORK, _NUMBER),
        0x36: _STROKE_POWER,
        0x3E: _STATE,
    }
)
"""Fields of the characteristics' own notifications."""

MULTIPLEXED: Mapping[int, tuple[Field, ...]] = MappingProxyType(
    {
        0x31: _STATUS,
        0x32: (*_PACE, _AVERAGE_POWER, _MACHINE),
        0x33: (*_INTERVAL, *_SPLIT),
        0x35: (*_STROKE, _NUMBER),
        0x36: (*_STROKE_POWER, _WORK),
        0x3E: _STATE,
    }
)
"""Fields behind the first byte of the multiplexed characteristic 0x0080."""
