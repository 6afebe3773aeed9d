"""Speed as rowers say it, time for 500 m, and durations, as text. For pages and findings."""

from __future__ import annotations

import numpy as np

SPEEDS = ("speed_m_s", "impeller_speed_m_s")
"""Columns that people read as pace."""
PER_500_M = "s per 500 m"
_STANDS_M_S = 0.5


def pace_text(speed_m_s: float) -> str:
    """Time for 500 m, such as 2:03.4; a dash if the boat stands or the speed is not known."""
    if not np.isfinite(speed_m_s) or speed_m_s < _STANDS_M_S:
        return "–"
    return clock_text(500.0 / speed_m_s, tenths=True)


def clock_text(duration_s: float, tenths: bool = False) -> str:
    """A duration such as 7:05, 7:04.8 with tenths, or 1:02:03; a dash if it is not known."""
    if not np.isfinite(duration_s):
        return "–"
    whole = round(10.0 * duration_s) if tenths else 10 * round(duration_s)
    seconds, tenth = divmod(whole, 10)
    hours, rest = divmod(seconds, 3600)
    end = f".{tenth}" if tenths else ""
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}{end}" if hours else f"{rest // 60}:{rest % 60:02d}{end}"


def slower_s(now_m_s: float, before_m_s: float) -> float:
    """How much longer 500 m take now, s; the difference of both paces as they are shown."""
    return round(500.0 / now_m_s, 1) - round(500.0 / before_m_s, 1)


def slower_text(now_m_s: float, before_m_s: float) -> str:
    """The difference of two paces in words: `3.2 s per 500 m slower`."""
    late_s = slower_s(now_m_s, before_m_s)
    return f"{abs(late_s):.1f} {PER_500_M} {'slower' if late_s > 0.0 else 'faster'}"


def of_pace(speed_m_s: float, of_speed_m_s: float) -> float:
    """A small difference or a standard deviation of speed as one of pace, s for 500 m, without its sign."""
    return abs(500.0 * of_speed_m_s / speed_m_s**2)
