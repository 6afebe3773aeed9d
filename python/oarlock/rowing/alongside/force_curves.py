"""Force curves of an export as one stack: over the drive by itself, or over a track's strokes after an alignment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.alongside.align import Alignment
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats, Ints

FORCES = ("handle_force_n", "gate_force_n", "r_gate_force_n", "l_gate_force_n")
LABELS = {
    "handle_force_n": "handle force",
    "gate_force_n": "gate force",
    "r_gate_force_n": "gate force, right (port)",
    "l_gate_force_n": "gate force, left (starboard)",
}
POINTS = 101
_HALF = 0.5
_FINE = 201
_TRAVEL = "handle_force_n"
"""With places, its curves are over handle travel (RP3); those of the gate are over time (Peach)."""
SPEED = "handle_speed_m_s"


@dataclass(frozen=True, eq=False)
class ForceStack:
    """Force curves of one sensor on a common axis.

    Attributes:
        name: of `FORCES`.
        at: (POINTS,) of the axis.
        axis: its name.
        unit: its unit.
        force_n: (N, POINTS); NaN where a stroke has no force.
        how: how the curves came onto the axis.
    """

    name: str
    at: Floats
    axis: str
    unit: str
    force_n: Floats
    how: str

    @property
    def count(self) -> int:
        """Strokes with a curve."""
        return int(np.isfinite(self.force_n).any(axis=1).sum())

    def mean_and_sd(self, rows: Ints | None = None) -> tuple[Floats, Floats]:
        """Mean and standard deviation between strokes (POINTS,), where at least half of the strokes have a force."""
        chosen = self.force_n if rows is None else self.force_n[rows]
        chosen = chosen[np.isfinite(chosen).any(axis=1)]
        known = np.isfinite(chosen)
        enough = known.sum(axis=0) >= max(2, _HALF * len(chosen))
        filled = np.where(known & enough, chosen, np.where(enough, np.nan, 0.0))
        mean, sd = np.nanmean(filled, axis=0), np.nanstd(filled, axis=0, ddof=1)
        return np.where(enough, mean, np.nan), np.where(enough, sd, np.nan)

    def peak_at(self) -> Floats:
        """Where each stroke's force is largest (N,), on the axis; NaN without a curve."""
        known = np.isfinite(self.force_n).any(axis=1)
        places = np.argmax(np.where(np.isfinite(self.force_n), self.force_n, -np.inf), axis=1)
        return np.where(known, self.at[places], np.nan)


def force_stacks(export: StrokeTable) -> list[ForceStack]:
    """The force curves of an export on its own axis: handle travel, time since the catch, or share of the drive."""
    return [_own_axis(export, name) for name in FORCES if _has(export, name)]


def forces_on_strokes(export: StrokeTable, track: StrokeTable, alignment: Alignment) -> list[ForceStack]:
    """The force curves over the strokes of a track, 0 % at its catch, 100 % at its next one.

    Times are those of the device, moved by the relation of the clocks. A curve over handle travel gets its times from
    the travel of the track's handle between the device's begin and end of the drive.

    Args:
        export: N strokes of a device.
        track: strokes of a track with `catch_time_s`, `end_time_s` and, for curves over travel, `handle_speed_m_s`.
        alignment: of these two.
    """
    if not alignment.is_onset:
        return []
    return [
        found
        for name in FORCES
        if _has(export, name) and (found := _on_strokes(export, track, alignment, name)).count
    ]


def _has(export: StrokeTable, name: str) -> bool:
    return any(len(curve) for curve in export.curves.get(name, ()))


def _own_axis(export: StrokeTable, name: str) -> ForceStack:
    curves = export.curves[name]
    ends = np.array([_end(curve) for curve in curves])
    if not np.isfinite(ends).any():
        at = np.linspace(0.0, 100.0, POINTS)
        points = [(np.linspace(0.0, 100.0, len(curve)), curve) for curve in curves]
        how = "The file has no time for the points of a curve: they are spread evenly over the drive."
        return ForceStack(name, at, "share of the drive", "%", _stacked(at, points, name), how)
    at = np.linspace(0.0, float(np.nanpercentile(ends, 90.0)), POINTS)
    points = [(curve[:, 0], curve[:, 1]) if curve.ndim == 2 else (curve, curve) for curve in curves]
    axis, unit = ("handle travel", "m") if name == _TRAVEL else ("time since the catch", "s")
    return ForceStack(name, at, axis, unit, _stacked(at, points, name), "")


def _end(curve: Floats) -> float:
    return float(curve[-1, 0]) if curve.ndim == 2 and len(curve) else float("nan")


def _stacked(at: Floats, points: list[tuple[Floats, Floats]], name: str) -> Floats:
    """Curves on one axis. Handle force is 0 outside the drive; a gate is measured all the time."""
    outside = 0.0 if name == _TRAVEL else np.nan
    stack = np.full((len(points), len(at)), np.nan)
    for row, (place, force) in enumerate(points):
        if len(place) > 1:
            stack[row] = np.interp(at, place, force, left=outside, right=outside)
    return stack


def _on_strokes(export: StrokeTable, track: StrokeTable, alignment: Alignment, name: str) -> ForceStack:
    at = np.linspace(0.0, 100.0, POINTS)
    catch_s, end_s = track["catch_time_s"], track["end_time_s"]
    drive_s = export["drive_time_s"] if "drive_time_s" in export else np.full(len(export), np.nan)
    speeds = track.curves.get(SPEED, ())
    points: list[tuple[Floats, Floats]] = []
    for row, stroke in enumerate(alignment.stroke.tolist()):
        curve = export.curves[name][row]
        lasted_s = end_s[stroke] - catch_s[stroke] if stroke >= 0 else np.nan
        if not np.isfinite(lasted_s) or not len(curve):
            points.append((np.zeros(0), np.zeros(0)))
            continue
        begin = alignment.apart_s[row] / lasted_s * 100.0
        drive = drive_s[row] / lasted_s * 100.0
        speed = speeds[stroke] if len(speeds) else np.zeros(0)
        points.append(_placed(curve, name, begin, drive, 100.0 / lasted_s, speed))
    return ForceStack(
        name, at, "share of the stroke", "%", _stacked(at, points, name), _how(export.curves[name], name)
    )


def _placed(
    curve: Floats, name: str, begin: float, drive: float, per_second: float, speed: Floats
) -> tuple[Floats, Floats]:
    """Shares of the stroke, %, and forces of one curve."""
    if curve.ndim == 1:
        return begin + drive * np.linspace(0.0, 1.0, len(curve)), curve
    if name != _TRAVEL:
        return begin + per_second * curve[:, 0], curve[:, 1]
    travelled = np.append(0.0, curve[:, 0] / curve[-1, 0])
    return begin + drive * _time_share(travelled, begin, drive, speed), np.append(0.0, curve[:, 1])


def _time_share(travelled: Floats, begin: float, drive: float, speed: Floats) -> Floats:
    """Share of the drive's time at which the track's handle has travelled these shares of its way; even without it."""
    if not np.isfinite(speed).any():
        return travelled
    percent = np.linspace(0.0, 100.0, len(speed))
    forward = np.interp(percent, percent[np.isfinite(speed)], np.maximum(speed[np.isfinite(speed)], 0.0))
    way = np.append(0.0, np.cumsum(0.5 * (forward[1:] + forward[:-1]) * np.diff(percent)))
    shares = np.linspace(0.0, 1.0, _FINE)
    own = np.interp(begin + drive * shares, percent, way)
    if not own[-1] > own[0]:
        return travelled
    return np.asarray(np.interp(travelled, (own - own[0]) / (own[-1] - own[0]), shares))


def _how(curves: tuple[Floats, ...], name: str) -> str:
    if all(curve.ndim == 1 for curve in curves if len(curve)):
        return (
            "The file has no time for the points of a curve: they are spread evenly over the device's drive."
        )
    if name == _TRAVEL:
        return "The file has force over handle travel: the time of each point is that of the track's handle."
    return ""
