"""Strokes and force curves that an ergometer's monitor sent during a live session, for reports of tracks.

A monitor such as the PM5 sends the numbers of a drive when it ends, with its own time `elapsed_s`, and the force
curve behind them. The tables are those of `oarlock.live.channels`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from oarlock.live.channel_tables import FOLDER, Channel, channels
from oarlock.live.folder import SESSION, LiveFolder
from oarlock.rowing.alongside.align import Alignment
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError

ONSET = (
    "the monitor's begin of the drive: the time of its message at the end of the drive, less its drive time"
)
_TOGETHER_S = 0.5
"""Messages of one drive's end arrive within this; a recovery takes longer."""
_NEIGHBOURS = 60
"""Messages before and after, of which the fastest counts: 4 s at four messages each 250 ms."""
_STOP_S = 0.2
"""The monitor's time stopped if the least difference rises by more."""
_STATUS_S = 5.0
"""A status older than this is not the stroke's."""
_DRIVE = ("drive_time_s", "handle_travel_m", "peak_force_n", "mean_force_n", "work_j", "distance_m")
_STATUS = ("rate_per_min", "speed_m_s", "heart_rate_per_min")
_CURVE = "handle_force_n"


def monitor_strokes(folder: str | PathLike[str]) -> StrokeTable:
    """The strokes of an ergometer's monitor, on the clock of the live session that recorded it.

    `catch_time_s` is the begin of the drive, `finish_time_s` its end. What the radio delayed is removed as far as the
    monitor's own time shows it: the fastest of neighbouring messages counts. Its least delay remains.

    Args:
        folder: of a live session that has ended.

    Raises:
        DataError: it is no such folder, or no monitor sent strokes.
    """
    place = Path(folder)
    live = LiveFolder.load(place)
    if not (place / FOLDER).is_dir():
        raise DataError(f"{place}: no device sent strokes; after a kill, run `oarlock live recover {place}`")
    return _strokes(place, live.epoch or "", channels(place))


def session_near(track_folder: str | PathLike[str], epoch: str | None) -> StrokeTable | None:
    """Strokes of the monitor of the session that a track was made from, if its folder is near.

    The session's folder is the track's or contains it or stands beside it; its moment of 0 s is the track's.

    Raises:
        DataError: the session's tables are damaged.
    """
    place = Path(track_folder).resolve()
    for folder in (
        place,
        *place.parents[:2],
        *sorted(file.parent for file in place.parent.glob(f"*/{SESSION}")),
    ):
        if (folder / SESSION).is_file() and (folder / FOLDER).is_dir():
            found = LiveFolder.load(folder).epoch
            if found and found == epoch and _monitors(tables := channels(folder)):
                return _strokes(folder, found, tables)
    return None


def is_one_clock(export: StrokeTable, track: StrokeTable) -> bool:
    """Whether both count from the same moment to the microsecond, as only the streams of one live session do."""
    return export.onset == ONSET and bool(export.epoch) and export.epoch == track.epoch


def place_by_clock(export: StrokeTable, track: StrokeTable) -> Alignment:
    """Strokes of a device whose clock is the track's: each belongs to the stroke that contains the middle of its drive.

    Args:
        export: with `catch_time_s` and `drive_time_s`.
        track: with `catch_time_s` and `end_time_s`.
    """
    onset_s, middle_s = export["catch_time_s"], export["catch_time_s"] + 0.5 * export["drive_time_s"]
    places = np.flatnonzero(np.isfinite(track["catch_time_s"]))
    catch_s = track["catch_time_s"][places]
    at = np.searchsorted(catch_s, middle_s, side="right") - 1
    inside = np.isfinite(middle_s) & (at >= 0)
    inside[inside] &= middle_s[inside] < track["end_time_s"][places[at[inside]]]
    stroke, apart_s = np.full(len(export), -1), np.full(len(export), np.nan)
    stroke[inside] = places[at[inside]]
    apart_s[inside] = onset_s[inside] - catch_s[at[inside]]
    note = (
        f"{int(inside.sum())} of {len(export)} strokes of the monitor belong to strokes of the track. Both were "
        "recorded by one computer in one session, so nothing was shifted"
    )
    if inside.any():
        mean, sd = (1e3 * of(apart_s[inside]) for of in (np.mean, np.std))
        way = "after" if mean > 0.0 else "before"
        note += f"; the monitor's drive begins {abs(mean):.0f} ms {way} the catch on average (SD {sd:.0f} ms)"
    return Alignment(stroke, onset_s, np.full(len(export), np.nan), apart_s, True, (), (note, *export.notes))


def _monitors(tables: Mapping[str, Channel]) -> list[str]:
    """Names of the sources that sent drives."""
    return [
        name.removesuffix("/drive")
        for name, table in tables.items()
        if name.endswith("/drive") and {"drive_time_s", "elapsed_s"} <= set(table.values)
    ]


def _strokes(folder: Path, epoch: str, tables: Mapping[str, Channel]) -> StrokeTable:
    found = Counter(
        {
            (name, address): count
            for name in _monitors(tables)
            for address, count in Counter(tables[f"{name}/drive"].address.tolist()).items()
        }
    )
    if not found:
        raise DataError(f"{folder}: no monitor of an ergometer sent strokes; it has {', '.join(tables)}")
    (name, address), *others = (one for one, _ in found.most_common())
    own = {
        key.removeprefix(f"{name}/"): _of(table, address)
        for key, table in tables.items()
        if key.startswith(f"{name}/")
    }
    drive, rows, curves = own["drive"], *_drives(own["drive"])
    if not len(rows):
        raise DataError(f"{folder}: the monitor {name} sent no complete stroke")
    finish_s = _sent_s(own, drive["time_s"][rows], drive["elapsed_s"][rows])
    columns = {"catch_time_s": finish_s - drive["drive_time_s"][rows], "finish_time_s": finish_s}
    columns |= {key: drive[key][rows] for key in _DRIVE if key in drive}
    if "power_w" in drive:
        columns["power_w"] = _nearest(drive, "power_w", drive["time_s"][rows], _TOGETHER_S)
    status = own.get("status", {})
    columns |= {key: _nearest(status, key, finish_s, _STATUS_S) for key in _STATUS if key in status}
    held = {_CURVE: tuple(curves)} if any(map(len, curves)) else {}
    notes = [f"the monitor {other[0]} {other[1]} is not shown".replace("  ", " ") for other in others]
    if held and (missing := sum(not len(curve) for curve in curves)):
        notes.append(f"{missing} of {len(rows)} strokes have no force curve")
    source = f"{name} in the live session {folder.name}"
    return StrokeTable(columns, curves=held, source=source, notes=tuple(notes), epoch=epoch, onset=ONSET)


def _of(table: Channel, address: str) -> dict[str, Floats]:
    """Numbers and curves of one device, in the order of arrival."""
    rows = np.flatnonzero((table.address == address) & np.isfinite(table.time_s))
    rows = rows[np.argsort(table.time_s[rows], kind="stable")]
    numbers = {name: values[rows] for name, values in table.values.items() if values.dtype.kind == "f"}
    return {"time_s": table.time_s[rows], **numbers}


def _drives(drive: Mapping[str, Floats]) -> tuple[Ints, list[Floats]]:
    """Rows of the drives, and their curves; empty where one was lost.

    If the first of a stroke's two messages was lost, the second, at the end of the recovery, was taken for it: then no
    power and no curve arrived near it.
    """
    time_s = drive["time_s"]
    is_drive = (
        np.isfinite(drive["drive_time_s"]) & np.isfinite(drive["elapsed_s"]) & (drive["drive_time_s"] > 0.0)
    )
    curve_at = (
        np.flatnonzero(np.isfinite(drive[_CURVE]).any(axis=1)) if _CURVE in drive else np.zeros(0, np.int64)
    )
    power_at = np.flatnonzero(np.isfinite(drive["power_w"])) if "power_w" in drive else np.zeros(0, np.int64)
    rows, curves = [], []
    for row in np.flatnonzero(is_drive).tolist():
        near = curve_at[np.abs(time_s[curve_at] - time_s[row]) < _TOGETHER_S]
        if not len(near) and not (np.abs(time_s[power_at] - time_s[row]) < _TOGETHER_S).any():
            continue
        rows.append(row)
        force = drive[_CURVE][near[0]] if len(near) else np.zeros(0)
        curves.append(force[np.isfinite(force)])
    return np.array(rows, dtype=np.int64), curves


def _sent_s(own: Mapping[str, Mapping[str, Floats]], at_s: Floats, elapsed_s: Floats) -> Floats:
    """When messages were sent, s: the monitor's time plus the least difference of both clocks among neighbours.

    Where the monitor's time stops or restarts, the difference rises: there the larger of the least before and after
    counts.
    """
    parts = [(table["time_s"], table["elapsed_s"]) for table in own.values() if "elapsed_s" in table]
    arrival_s, monitor_s = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.argsort(arrival_s, kind="stable")
    order = order[np.isfinite(monitor_s[order])]
    apart_s = arrival_s[order] - monitor_s[order]
    padded = np.pad(apart_s, _NEIGHBOURS, constant_values=np.inf)
    least = np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS + 1).min(axis=1)
    before_s, after_s = least[: len(apart_s)], least[_NEIGHBOURS:]
    goes_on = np.abs(after_s - before_s) < _STOP_S
    offset_s = np.where(goes_on, np.minimum(before_s, after_s), np.maximum(before_s, after_s))
    return np.asarray(elapsed_s + offset_s[np.searchsorted(arrival_s[order], at_s).clip(0, len(order) - 1)])


def _nearest(table: Mapping[str, Floats], name: str, at_s: Floats, within_s: float) -> Floats:
    """The value nearest in time; NaN if none is within so long."""
    known = np.isfinite(table[name])
    time_s, values = table["time_s"][known], table[name][known]
    if not len(time_s):
        return np.full(len(at_s), np.nan)
    after = np.searchsorted(time_s, at_s).clip(0, len(time_s) - 1)
    before = (after - 1).clip(0)
    nearest = np.where(np.abs(time_s[before] - at_s) < np.abs(time_s[after] - at_s), before, after)
    return np.where(np.abs(time_s[nearest] - at_s) <= within_s, values[nearest], np.nan)
