"""`Strokes`: times and kinds of strokes, and their table with rate, rhythm, oar angles and side differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.strokes.events import Stroke
from oarlock.rowing.strokes.kinds import StrokeInterval
from oarlock.rowing.strokes.signals import KINDS
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Bools, Floats

Column = tuple[Floats, Floats]

ZERO_STD = 0.005
"""Of an encoder, rad or m: standard deviation of its zero where nobody calibrated it."""


@dataclass(frozen=True, eq=False)
class Strokes:
    """Strokes in time, (N,) each; see `oarlock.rowing.FEATURES` for what a catch and a finish are.

    Attributes:
        source: signal from which they were found: `oars`, `handle` (ergometer), `seat`, `trunk` or `trunk_gyro`.
        strokes: each with its sides.
        kinds: of each: `rowing`, `start`, `paddling`, `turn`.
        left_out: why a stroke counts in no average; "" if it does.
        stretches: strokes of one kind in a row, and pauses.
        zero_std: standard deviation of the encoders' zeros, rad or m: it is in the angles' deviations.
        notes: plain sentences.
        epoch: the moment of 0 s, as `Recording.epoch`; "" if it is not known.
    """

    source: str
    strokes: tuple[Stroke, ...]
    kinds: tuple[str, ...]
    paused: Bools
    left_out: tuple[str, ...]
    stretches: tuple[StrokeInterval, ...]
    zero_std: float = ZERO_STD
    notes: tuple[str, ...] = ()
    epoch: str = ""

    def __len__(self) -> int:
        return len(self.strokes)

    @property
    def catch_time_s(self) -> Floats:
        """(N,) s."""
        return np.array([stroke.catch[0] for stroke in self.strokes])

    @property
    def catch_time_std_s(self) -> Floats:
        """(N,) s."""
        return np.array([stroke.catch[1] for stroke in self.strokes])

    @property
    def finish_time_s(self) -> Floats:
        """(N,) s."""
        return np.array([stroke.finish[0] for stroke in self.strokes])

    @property
    def finish_time_std_s(self) -> Floats:
        """(N,) s."""
        return np.array([stroke.finish[1] for stroke in self.strokes])

    @property
    def end_time_s(self) -> Floats:
        """(N,) s: the next catch; NaN where a pause, a silence or the end of the recording came first."""
        return np.array(
            [np.nan if still else s.end[0] for s, still in zip(self.strokes, self.paused, strict=True)]
        )

    @property
    def end_time_std_s(self) -> Floats:
        """(N,) s."""
        return np.array(
            [np.nan if still else s.end[1] for s, still in zip(self.strokes, self.paused, strict=True)]
        )

    @property
    def in_averages(self) -> Bools:
        """(N,) which strokes count in averages."""
        return np.array([not reason for reason in self.left_out], dtype=bool)

    def table(self) -> StrokeTable:
        """Times, rate, rhythm and angles as a table, with standard deviations and reasons."""
        return _table(self)

    def __repr__(self) -> str:
        parts = [f"{s.kind} {s.start_s:.1f} to {s.end_s:.1f} s ({s.strokes})" for s in self.stretches]
        return f"Strokes({len(self)} from {KINDS[self.source].words}: {', '.join(parts)})"


def _table(strokes: Strokes) -> StrokeTable:
    columns = _times(strokes)
    if strokes.source == "oars":
        columns |= _angles(strokes)
    elif strokes.source == "handle":
        columns["handle_travel_m"] = _travel(strokes)
    columns["in_averages"] = (strokes.in_averages.astype(float), np.zeros(len(strokes)))
    reasons = {name: _reasons(strokes, name, values) for name, (values, _) in columns.items()}
    reasons["in_averages"] = strokes.left_out
    return StrokeTable(
        {name: values for name, (values, _) in columns.items()},
        {name: std for name, (_, std) in columns.items() if name != "in_averages"},
        {name: rows for name, rows in reasons.items() if any(rows)},
        source=f"strokes from {strokes.source}",
        notes=strokes.notes,
        epoch=strokes.epoch,
    )


def _times(strokes: Strokes) -> dict[str, Column]:
    catch, finish, end = (
        (strokes.catch_time_s, strokes.catch_time_std_s),
        (strokes.finish_time_s, strokes.finish_time_std_s),
        (strokes.end_time_s, strokes.end_time_std_s),
    )
    drive, recovery = _minus(finish, catch), _minus(end, finish)
    cycle = _minus(end, catch)
    rhythm = drive[0] / cycle[0]
    # Of drive / (drive + recovery); both hold the finish's error, with opposite signs.
    parts = [(1.0 - rhythm) * catch[1], finish[1], rhythm * end[1]]
    rhythm_std = np.sqrt(sum(part**2 for part in parts)) / cycle[0]
    columns = {
        "catch_time_s": catch,
        "finish_time_s": finish,
        "end_time_s": end,
        "rate_per_min": (60.0 / cycle[0], 60.0 * cycle[1] / cycle[0] ** 2),
        "drive_time_s": drive,
        "recovery_time_s": recovery,
        "rhythm": (rhythm, rhythm_std),
    }
    if any(len(stroke.sides) == 2 for stroke in strokes.strokes):
        for event in ("catch", "finish"):
            right, left = (_side(strokes, side, event, _time) for side in "rl")
            columns |= {f"r_{event}_time_s": right, f"l_{event}_time_s": left}
            columns[f"{event}_time_difference_s"] = _minus(right, left)
    return columns


def _minus(one: Column, other: Column) -> Column:
    return one[0] - other[0], np.hypot(one[1], other[1])


def _time(stroke: Stroke, side: str, event: str) -> tuple[float, float]:
    told = getattr(stroke.sides[side], event)
    return told.time_s, told.time_std_s


def _angle(stroke: Stroke, side: str, event: str) -> tuple[float, float]:
    reversal = getattr(stroke.sides[side], event).reversal
    return reversal.value, reversal.value_std


def _side(strokes: Strokes, side: str, event: str, of: object) -> Column:
    assert callable(of)
    rows = [of(s, side, event) if side in s.sides else (np.nan, np.nan) for s in strokes.strokes]
    values = np.array(rows, dtype=np.float64).reshape(-1, 2)
    return values[:, 0], values[:, 1]


def _angles(strokes: Strokes) -> dict[str, Column]:
    """Angles carry their zero's uncertainty; an arc does not."""
    present = [side for side in ("r", "l", "") if any(side in stroke.sides for stroke in strokes.strokes)]
    own, zero = {}, strokes.zero_std
    for side in present:
        catch, finish = (_side(strokes, side, event, _angle) for event in ("catch", "finish"))
        own[side] = {
            "catch_angle_rad": (catch[0], np.hypot(catch[1], zero)),
            "finish_angle_rad": (finish[0], np.hypot(finish[1], zero)),
            "arc_rad": _minus(finish, catch),
        }
    if present == ["r", "l"]:
        return _both_oars(own["r"], own["l"])
    columns = {f"{side}_{name}": column for side in present if side for name, column in own[side].items()}
    return columns | (own[present[0]] if present else {})


def _both_oars(right: dict[str, Column], left: dict[str, Column]) -> dict[str, Column]:
    columns: dict[str, Column] = {}
    for name in right:
        columns[name] = _mean(right[name], left[name])
        columns[f"r_{name}"], columns[f"l_{name}"] = right[name], left[name]
    for name in ("catch_angle_rad", "finish_angle_rad"):
        columns[name.replace("_rad", "_difference_rad")] = _minus(right[name], left[name])
    (r, r_std), (ll, l_std) = right["arc_rad"], left["arc_rad"]
    half = 0.5 * (r + ll)
    columns["arc_symmetry"] = ((r - ll) / half, np.hypot(r_std * ll, l_std * r) / half**2)
    return columns


def _mean(one: Column, other: Column) -> Column:
    """Of both oars; of one where the other did not row."""
    both = np.stack([one[0], other[0]]), np.stack([one[1], other[1]])
    known = np.isfinite(both[0]).sum(axis=0)
    return np.nansum(both[0], axis=0) / known, np.sqrt(np.nansum(both[1] ** 2, axis=0)) / known


def _travel(strokes: Strokes) -> Column:
    catch, finish = (_side(strokes, "", event, _angle) for event in ("catch", "finish"))
    return _minus(finish, catch)


def _reasons(strokes: Strokes, name: str, values: Floats) -> tuple[str, ...]:
    return tuple(
        _reason(stroke, bool(paused), name) if np.isnan(value) else ""
        for stroke, paused, value in zip(strokes.strokes, strokes.paused, values, strict=True)
    )


def _reason(stroke: Stroke, paused: bool, name: str) -> str:
    if name in ("end_time_s", "rate_per_min", "recovery_time_s", "rhythm"):
        return "a pause followed: no next catch" if paused else "no next catch was recorded"
    missing = {"r": "right (port)", "l": "left (starboard)"}
    silent = [words for side, words in missing.items() if side not in stroke.sides]
    return f"the {silent[0]} oar did not row this stroke, or was not read" if silent else "not known"
