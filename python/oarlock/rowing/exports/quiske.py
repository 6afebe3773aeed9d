"""Reads CSV files of Quiske pods: boat acceleration, oar angular velocity, seat speed, each as a curve in one cell."""

from __future__ import annotations

import numpy as np

from oarlock.rowing.exports.build import ColumnMap, TableBuilder
from oarlock.rowing.exports.cells import DEGREE_RAD, Cells, listed
from oarlock.rowing.exports.grid import CellGrid
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

TITLE = "Quiske, strokes (CSV)"
MARKS = ("timestamp(s)", "stroke angle (deg)", "oar angle velocity curve", "seat curve")

_WANTED = (
    ColumnMap("time_s", ("timestamp(s)",)),
    ColumnMap("distance_m", ("distance(m)",)),
    ColumnMap("rate_per_min", ("SPM (strokes per minute)",)),
    ColumnMap("speed_m_s", ("speed (m/s)",)),
    ColumnMap("arc_rad", ("stroke angle (deg)",), DEGREE_RAD),
    ColumnMap("peak_oar_rate_rad_s", ("max drive speed (deg/s)",), DEGREE_RAD),
    ColumnMap("peak_seat_drive_speed_m_s", ("max seat speed (m/s)",)),
    ColumnMap("peak_seat_recovery_speed_m_s", ("max seat recovery speed (m/s)",)),
)
_CURVES = (
    ("boat_acceleration_m_s2", "boat accelerator curve", 9.80665),
    ("oar_rate_rad_s", "oar angle velocity curve", DEGREE_RAD),
    ("seat_drive_speed_m_s", "seat curve", 1.0),
)
_RESAMPLED = 200
_RAW_HZ = 100.0
_LONGEST_CELL = 255
_FEWEST_POINTS = 20
_RATE_AGREES = 0.1
_RATE_ROUNDING_PER_MIN = 1.0


def read(grid: CellGrid, header: int) -> StrokeTable:
    """A file of Quiske.

    `arc_rad` is the device's own. `curve_arc_rad` is integrated from the curve of angular velocity: the swing of its
    integral over the stroke, its mean taken off, since the oar comes back to where it was.
    """
    rows = grid.rows(header)
    gathered = TableBuilder(rows)
    gathered.read(_WANTED)
    cut = {name: _curves(gathered, name, head, scale) for name, head, scale in _CURVES}
    duration_s = _durations_s(gathered)
    _add_swing(gathered, "oar_rate_rad_s", "curve_arc_rad", duration_s, cut)
    _add_swing(gathered, "seat_drive_speed_m_s", "seat_travel_m", duration_s, cut)
    _stamp(gathered, duration_s)
    gathered.notes += [
        "a stroke of this device goes from one minimum of the boat's acceleration, near the catch, to the next",
        "the file names no unit of boat acceleration; by its size it is g, of 9.80665 m/s2",
    ]
    return gathered.table(TITLE)


def _curves(gathered: TableBuilder, name: str, header: str, scale: float) -> Bools:
    """Reads a curve of each stroke, (K,), and marks those that were cut off when the file was saved."""
    rows, place = gathered.rows, gathered.rows.place(header)
    if place is None:
        raise DataError(f'{rows.file}: has no column "{header}"')
    cut = np.array([len(cells[place]) == _LONGEST_CELL for cells in rows.cells], dtype=bool)
    curves = tuple(np.zeros(0) if cut[row] else listed(rows, place, row) * scale for row in range(len(rows)))
    if cut.any():
        gathered.notes.append(
            f'column "{rows.names[place]}": cut off after {_LONGEST_CELL} characters in {cut.sum()} of {len(rows)} '
            "rows, as spreadsheets do; these curves are left out"
        )
    if any(len(curve) for curve in curves):
        gathered.curves[name] = curves
    return cut


def _durations_s(gathered: TableBuilder) -> Floats:
    """How long each stroke took, (N,): the raw curve at 100 Hz, else the next stamp, else the rounded rate."""
    rate = gathered.values("rate_per_min")
    by_rate_s = np.divide(60.0, rate, out=np.full(len(rate), np.nan), where=rate > 0.0)
    stamps_s = gathered.values("time_s")
    to_next_s = np.append(np.diff(stamps_s), np.nan)
    if np.array_equal(stamps_s, np.round(stamps_s)):
        to_next_s[:] = np.nan
    raw = np.array(
        [len(curve) for curve in gathered.curves.get("boat_acceleration_m_s2", ())] or [0] * len(rate)
    )
    raw_s = np.where((raw >= _FEWEST_POINTS) & (raw != _RESAMPLED), raw / _RAW_HZ, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        raw_fits = np.abs(raw_s / by_rate_s - 1.0) <= _RATE_AGREES
        next_fits = np.abs(60.0 / to_next_s - rate) <= _RATE_ROUNDING_PER_MIN
    return np.where(raw_fits, raw_s, np.where(next_fits, to_next_s, by_rate_s))


def _add_swing(
    gathered: TableBuilder, curve: str, name: str, duration_s: Floats, cut: dict[str, Bools]
) -> None:
    curves = gathered.curves.get(curve)
    if curves is None:
        return
    swings = np.full(len(curves), np.nan)
    for row, (rate, lasted_s) in enumerate(zip(curves, duration_s, strict=True)):
        if len(rate) >= _FEWEST_POINTS and np.isfinite(lasted_s):
            swings[row] = np.ptp(np.cumsum(rate - rate.mean())) * lasted_s / len(rate)
    gathered.derive(name, swings, "the curve or the duration of the stroke is missing")
    if name in gathered.columns:
        reason = f"the curve was cut off after {_LONGEST_CELL} characters when the file was saved"
        gathered.columns[name] = gathered.columns[name].but(cut[curve], reason)


def _stamp(gathered: TableBuilder, duration_s: Floats) -> None:
    """Gives each point of a curve its time from the stroke's begin; takes the first stamp off the clock."""
    for name, curves in list(gathered.curves.items()):
        pairs = zip(curves, duration_s, strict=True)
        gathered.curves[name] = tuple(
            np.column_stack([np.arange(len(points)) * lasted_s / max(len(points), 1), points])
            for points, lasted_s in pairs
        )
    gathered.derive("duration_s", duration_s, "no rate, and no curve or time stamp to compute it")
    if "time_s" in gathered.columns:
        stamps = gathered.columns["time_s"]
        first_s = np.nanmin(stamps.values)
        gathered.columns["time_s"] = Cells(stamps.values - first_s, stamps.reasons)
        gathered.notes.append(f"times count from the first stamp, {first_s:.3f} s of Unix time")
