"""Reads FIT files: strokes where a file has developer fields of strokes, otherwise an activity of points in time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.rowing.exports.activity import COLUMNS, Activity, known_columns
from oarlock.rowing.exports.build import many
from oarlock.rowing.exports.cells import MOST
from oarlock.rowing.exports.rowingdata import follow_by_strokes
from oarlock.rowing.exports.starts import epoch_of_seconds
from oarlock.rowing.strokes.fit_fields import (
    EPOCH_S,
    KNOWN,
    KNOWN_OWN,
    OWN_ID,
    STRATEGY_NAME,
    STROKE_BOUNDARY,
    TIMES,
    UNITS,
)
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import begins_with, read_bytes

if TYPE_CHECKING:
    from fitdecode import FitDataMessage

TITLE = "FIT file"
_MOST_BYTES = 200_000_000
_ABSOLUTE_S = 0x10000000
"""Smaller time stamps count from when the device was switched on (FIT profile, date_time)."""
_SEMICIRCLE_DEG = 180.0 / 2**31
_NATIVE = (
    ("latitude_deg", ("position_lat",), _SEMICIRCLE_DEG),
    ("longitude_deg", ("position_long",), _SEMICIRCLE_DEG),
    ("distance_m", ("distance",), 1.0),
    ("speed_m_s", ("enhanced_speed", "speed"), 1.0),
    ("heart_rate_per_min", ("heart_rate",), 1.0),
    ("rate_per_min", ("cadence256", "cadence"), 1.0),
    ("power_w", ("power",), 1.0),
    ("distance_per_stroke_m", ("cycle_length16",), 1.0),
    ("stroke_number", ("total_cycles",), 1.0),
)
_ZERO_IS_MISSING = ("heart_rate_per_min", "rate_per_min")
_NO_STROKE_RATE = {1: "running", 2: "cycling", 5: "swimming", 11: "walking", 17: "hiking"}
"""Sports whose cadence counts other things (FIT profile, sport)."""
_NOT_IN_RECORD = "not in the file's record"


@dataclass
class _FitContents:
    """What has been read so far of one file."""

    rows: list[dict[str, float]] = field(default_factory=list)
    stds: list[dict[str, float]] = field(default_factory=list)
    scales: dict[tuple[int, int], tuple[float, float]] = field(default_factory=dict)
    own: set[int] = field(default_factory=set)
    unknown: dict[str, None] = field(default_factory=dict)
    start_s: float = np.nan
    strategy: float = np.nan
    sport: int = -1


def is_fit(file: Path) -> bool:
    """Whether a file begins as FIT files do."""
    return begins_with(file, b".FIT", 8)


def read_fit(file: Path) -> StrokeTable | Activity:
    """The strokes of a file, or its points in time.

    A record is a stroke only if it has developer fields of a stroke, such as a drive time or a catch angle, and the
    file counts strokes or says that each record is one. Cadence alone makes no stroke.

    Raises:
        DataError: the file cannot be read, is damaged (with the byte), or has no records; or fitdecode is not there.
    """
    found = _FitContents()
    for message in _messages(file):
        if message.name == "developer_data_id":
            _take_application(found, message)
        elif message.name == "field_description":
            _describe(found, message)
        elif message.name == "session":
            _take_session(found, message)
        elif message.name == "record":
            _take_record(found, message)
    if not found.rows:
        raise DataError(f"{file}: is a {TITLE}, but contains no records of an activity")
    return _strokes(file, found) or _activity(file, found)


def _messages(file: Path) -> Iterator[FitDataMessage]:
    try:
        import fitdecode
    except ImportError:
        raise DataError(f"{file}: FIT files are read with fitdecode: pip install 'oarlock[fit]'") from None
    contents = read_bytes(file, _MOST_BYTES)
    place = 0
    options = {"check_crc": fitdecode.CrcCheck.RAISE, "error_handling": fitdecode.ErrorHandling.RAISE}
    try:
        with fitdecode.FitReader(contents, processor=None, keep_raw_chunks=True, **options) as reader:
            for frame in reader:
                place = frame.chunk.offset
                if isinstance(frame, fitdecode.FitDataMessage):
                    yield frame
    except fitdecode.FitCRCError as error:
        raise DataError(f"{file}: its checksum is wrong: the file is damaged. Export it again.") from error
    except Exception as error:  # of damaged bytes fitdecode raises whatever Python does
        raise DataError(
            f"{file}: is no whole FIT file after byte {place} ({error}). Was it cut off? Export it again."
        ) from error


def _take_application(found: _FitContents, message: FitDataMessage) -> None:
    index, application = (
        message.get_raw_value(name, fallback=None) for name in ("developer_data_index", "application_id")
    )
    found.own.discard(index)
    if application == tuple(OWN_ID):
        found.own.add(index)


def _describe(found: _FitContents, message: FitDataMessage) -> None:
    """Keep the scale of a developer field, which fitdecode does not apply."""
    known = [_number(message.get_value(name, fallback=None)) for name in ("scale", "offset")]
    scale, offset = (
        default if np.isnan(one) else one for one, default in zip(known, (1.0, 0.0), strict=True)
    )
    key = message.get_value("developer_data_index"), message.get_value("field_definition_number")
    found.scales[key] = (scale or 1.0, offset)


def _take_session(found: _FitContents, message: FitDataMessage) -> None:
    start = _number(message.get_raw_value("start_time", fallback=None))
    found.start_s = start if np.isnan(found.start_s) else found.start_s
    found.strategy = _number(message.get_value(STRATEGY_NAME, fallback=None))
    sport = message.get_raw_value("sport", fallback=None)
    found.sport = sport if isinstance(sport, int) else -1


def _take_record(found: _FitContents, message: FitDataMessage) -> None:
    row = {"stamp": _number(message.get_raw_value("timestamp", fallback=None))}
    for column, names, scale in _NATIVE:
        values = (_number(message.get_value(name, fallback=None)) for name in names)
        row[column] = next((value * scale for value in values if np.isfinite(value)), np.nan)
    std: dict[str, float] = {}
    for one in message.fields:
        developer = one.field
        if getattr(developer, "field_type", "") != "devfield":
            continue
        name, unit = str(developer.name), str(developer.units or "")
        known = KNOWN.get(name) or (KNOWN_OWN.get(name) if developer.dev_data_index in found.own else None)
        if known is None or unit not in UNITS:
            found.unknown[name] = None
            continue
        scale, offset = found.scales.get((developer.dev_data_index, developer.def_num), (1.0, 0.0))
        into = std if known.is_std else row
        into[known.column] = (_number(one.raw_value) / scale - offset) * UNITS[unit]
    found.rows.append(row)
    found.stds.append(std)


def _number(value: Any) -> float:
    """A finite number of sensible size, else NaN."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return float("nan")
    return float(value) if abs(value) <= MOST else float("nan")


def _columns(rows: list[dict[str, float]]) -> dict[str, Floats]:
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}


def _timed(found: _FitContents, by_stamp: bool) -> tuple[dict[str, Floats], str]:
    """The columns with the time since the start, of the stamps or of the file's own fields; the epoch of the start."""
    columns = _columns(found.rows)
    stamp = columns.pop("stamp")
    first_s = float(np.nanmin(stamp)) if np.isfinite(stamp).any() else np.nan
    start_s = found.start_s if found.start_s <= first_s else first_s
    if by_stamp or not any(name in columns for name in TIMES):
        columns["time_s"] = stamp - start_s
    for name in _ZERO_IS_MISSING:
        columns[name] = np.where(columns[name] == 0.0, np.nan, columns[name])
    return columns, epoch_of_seconds(start_s + EPOCH_S) if start_s >= _ABSOLUTE_S else ""


def _activity(file: Path, found: _FitContents) -> Activity:
    columns, epoch = _timed(found, by_stamp=True)
    notes = []
    if found.sport in _NO_STROKE_RATE:
        columns.pop("rate_per_min")
        notes.append(f"the sport is {_NO_STROKE_RATE[found.sport]}: its cadence is no stroke rate")
    if not np.isfinite(columns["time_s"]).any():
        raise DataError(f"{file}: is a {TITLE} whose records have no time")
    wanted = {name: columns[name] for name in COLUMNS if name in columns}
    return Activity(known_columns(wanted), f"{file.name}: {TITLE}, points in time", epoch, tuple(notes))


def _strokes(file: Path, found: _FitContents) -> StrokeTable | None:
    columns, epoch = _timed(found, by_stamp=False)
    number = columns["stroke_number"]
    of_strokes = [name for name in columns if name not in {*(name for name, _, _ in _NATIVE), "time_s"}]
    if not of_strokes:
        return None
    stamps = np.array([row["stamp"] for row in found.rows])
    # Some programs write the strategy into every file, whatever its rows are.
    if found.strategy == STROKE_BOUNDARY and follow_by_strokes(stamps, columns["rate_per_min"]):
        kept = np.arange(len(number))
    elif np.isfinite(number).any():
        kept = np.flatnonzero(np.isfinite(number))
        kept = kept[np.append(np.diff(number[kept]) != 0.0, True)]
    else:
        return None
    notes = [f"fields that are not known: {', '.join(found.unknown)}"] if found.unknown else []
    if len(kept) < len(number):
        notes.append(
            f"{many(len(number), 'record')} contain {many(len(kept), 'stroke')}: the last of each is taken"
        )
    lost = int(np.nansum(np.clip(np.diff(number[kept]) - 1.0, 0.0, None)))
    if lost:
        notes.append(f"the device's count leaves out {many(lost, 'stroke')}, not in the file")
    drop = ("latitude_deg", "longitude_deg")
    held = known_columns({name: values[kept] for name, values in columns.items() if name not in drop})
    stds = known_columns(
        {name: values[kept] for name, values in _columns(found.stds).items() if name in held}
    )
    reasons = {
        name: tuple("" if known else _NOT_IN_RECORD for known in np.isfinite(values))
        for name, values in held.items()
        if not np.isfinite(values).all()
    }
    return StrokeTable(
        held, stds, reasons, source=f"{file.name}: {TITLE}, strokes", notes=tuple(notes), epoch=epoch
    )
