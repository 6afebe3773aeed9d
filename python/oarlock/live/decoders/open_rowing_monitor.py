"""Metrics of Open Rowing Monitor: JSON by MQTT, or by the WebSocket of its page.

Source: its pages docs/Integrations.md and docs/Architecture.md, and the messages that release 0.9.6 sends. By
MQTT (once a stroke, topic `OpenRowingMonitor/MACHINE/metrics`) most numbers are texts and durations are in ms.
The WebSocket sends `{"type": "metrics", "data": {...}}` with other names and durations in s.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import datetime

from oarlock.live.reading import RETAINED, Reading, Value

_MS = 0.001
_BOTH = {
    "totalMovingTime": ("elapsed_s", 1.0),
    "totalNumberOfStrokes": ("stroke_number", 1.0),
    "totalCalories": ("energy_kcal", 1.0),
    "heartrate": ("heart_rate_per_min", 1.0),
    "driveLength": ("handle_travel_m", 1.0),
}
_MQTT = _BOTH | {
    "totalDistance": ("distance_m", 1.0),
    "velocity": ("speed_m_s", 1.0),
    "pace": ("pace_s_per_500_m", 1.0),
    "power": ("power_w", 1.0),
    "driveDuration": ("drive_time_s", _MS),
    "recoveryDuration": ("recovery_time_s", _MS),
    "strokeDuration": ("stroke_time_s", _MS),
    "strokeRate": ("rate_per_min", 1.0),
    "distancePerStroke": ("distance_per_stroke_m", 1.0),
    "peakHandleForce": ("peak_force_n", 1.0),
    "averageHandleForce": ("mean_force_n", 1.0),
    "forceCurve": ("handle_force_n", 1.0),
    "velocityCurve": ("handle_speed_m_s", 1.0),
    "powerCurve": ("handle_power_w", 1.0),
    "dragfactor": ("drag_factor", 1.0),
    "dragFactor": ("drag_factor", 1.0),
}
_WEBSOCKET = _BOTH | {
    "totalLinearDistance": ("distance_m", 1.0),
    "cycleLinearVelocity": ("speed_m_s", 1.0),
    "cyclePace": ("pace_s_per_500_m", 1.0),
    "cyclePower": ("power_w", 1.0),
    "driveDuration": ("drive_time_s", 1.0),
    "recoveryDuration": ("recovery_time_s", 1.0),
    "cycleDuration": ("stroke_time_s", 1.0),
    "cycleStrokeRate": ("rate_per_min", 1.0),
    "cycleDistance": ("distance_per_stroke_m", 1.0),
    "drivePeakHandleForce": ("peak_force_n", 1.0),
    "driveAverageHandleForce": ("mean_force_n", 1.0),
    "driveHandleForceCurve": ("handle_force_n", 1.0),
    "driveHandleVelocityCurve": ("handle_speed_m_s", 1.0),
    "driveHandlePowerCurve": ("handle_power_w", 1.0),
    "dragFactor": ("drag_factor", 1.0),
}
_TEXTS = {"strokeState": "stroke_state", "sessionState": "session_state"}


def decoder() -> OpenRowingMonitorDecoder:
    """A decoder of one machine."""
    return OpenRowingMonitorDecoder()


class OpenRowingMonitorDecoder:
    """Messages of one machine, a JSON object each; the clock of readings is the wall clock of its computer."""

    def __init__(self) -> None:
        self.damaged = 0

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The reading of a message; a WebSocket message of another type than `metrics` gives none.

        Args:
            data: the message.
            channel: `retained` for one that a broker kept from before anybody listened: it gives none.
        """
        if channel == RETAINED:
            return []
        message = _parsed(data)
        if not isinstance(message, dict):
            self.damaged += 1
            return []
        if "type" not in message:
            return self._metrics(message, _MQTT)
        return self._metrics(message.get("data"), _WEBSOCKET) if message["type"] == "metrics" else []

    def _metrics(self, metrics: object, names: Mapping[str, tuple[str, float]]) -> list[Reading]:
        found = _values(metrics, names) if isinstance(metrics, dict) else {}
        if not found:
            self.damaged += 1
            return []
        return [Reading("", _clock(metrics.get("timestamp") if isinstance(metrics, dict) else None), found)]


def _parsed(data: bytes) -> object:
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def _values(metrics: Mapping[str, object], names: Mapping[str, tuple[str, float]]) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for key, (name, scale) in names.items():
        value = _curve(metrics[key]) if isinstance(metrics.get(key), list) else _number(metrics.get(key))
        if value is not None:
            values[name] = tuple(scale * v for v in value) if isinstance(value, tuple) else scale * value
    texts = {name: metrics.get(key) for key, name in _TEXTS.items()}
    return values | {name: text for name, text in texts.items() if isinstance(text, str)}


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return None
    try:
        found = float(value)
    except (ValueError, OverflowError):
        return None
    return found if math.isfinite(found) else None


def _curve(values: object) -> tuple[float, ...] | None:
    numbers = [_number(value) for value in values] if isinstance(values, list) else []
    whole = tuple(value for value in numbers if value is not None)
    return whole if whole and len(whole) == len(numbers) else None


def _clock(stamp: object) -> float | None:
    seconds = _number(stamp)
    if seconds is not None or not isinstance(stamp, str):
        return seconds
    try:
        return datetime.fromisoformat(stamp).timestamp()
    except (ValueError, OverflowError, OSError):
        return None
