"""A rower at a steady rate, for emulated ergometers: what their monitors show at any time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

DRAG_W_S3_M3 = 2.8
"""Concept2 gives pace and power as P = 2.8 v^3."""
DRIVING, RECOVERING = 2.0, 4.0
"""States of a stroke as a PM5 counts them."""

Values = Mapping[str, float]


@dataclass(frozen=True)
class Rowing:
    """Equal strokes.

    Args:
        rate_per_min: strokes a minute.
        drive_s: duration of the drive, shorter than a stroke.
        handle_travel_m: of the handle in the drive.
        peak_force_n: of the handle; the curve is half a sine.
    """

    rate_per_min: float = 24.0
    drive_s: float = 0.8
    handle_travel_m: float = 1.4
    peak_force_n: float = 600.0

    @property
    def stroke_s(self) -> float:
        """Duration of a stroke."""
        return 60.0 / self.rate_per_min

    def force_n(self) -> tuple[float, ...]:
        """The force curve of a drive: a value each 10 ms."""
        count = round(self.drive_s / 0.01)
        return tuple(self.peak_force_n * math.sin(math.pi * (i + 0.5) / count) for i in range(count))

    def values(self, time_s: float) -> Values:
        """What the monitor shows at a time since the first drive began."""
        number, phase_s = divmod(time_s, self.stroke_s)
        mean_force_n = 2.0 / math.pi * self.peak_force_n
        work_j = mean_force_n * self.handle_travel_m
        speed_m_s = math.cbrt(work_j / self.stroke_s / DRAG_W_S3_M3)
        power_w = work_j / self.stroke_s
        return {
            "elapsed_s": time_s,
            "distance_m": speed_m_s * time_s,
            "stroke_state": DRIVING if phase_s < self.drive_s else RECOVERING,
            "drag_factor": 120.0,
            "speed_m_s": speed_m_s,
            "pace_s_per_500_m": 500.0 / speed_m_s,
            "rate_per_min": self.rate_per_min,
            "power_w": power_w,
            "energy_kcal": power_w * time_s / 1000.0,
            "energy_rate_kcal_per_h": 3.6 * power_w,
            "handle_travel_m": self.handle_travel_m,
            "drive_time_s": self.drive_s,
            "recovery_time_s": self.stroke_s - self.drive_s,
            "distance_per_stroke_m": speed_m_s * self.stroke_s,
            "peak_force_n": self.peak_force_n,
            "mean_force_n": mean_force_n,
            "work_j": work_j,
            "stroke_number": number + 1.0,
        }
