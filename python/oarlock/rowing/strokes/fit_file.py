"""Writes strokes as a FIT activity, with developer fields that other sites and apps show.

One record is one stroke, at its end. Order and messages follow the FIT activity file: file_id, developer data, event
start, records, event stop, laps, session, activity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.rowing.strokes.fit_fields import (
    EPOCH_S,
    NATIVE,
    OWN_ID,
    PROTOCOL,
    STANDARD,
    STANDARD_ID,
    STRATEGY,
    STRATEGY_NAME,
    STROKE_BOUNDARY,
    TIMES,
    UNITS,
    FitField,
    own_field,
)
from oarlock.rowing.strokes.table import StrokeTable, running
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import moment_of
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from fit_tool.developer_field import DeveloperField
    from fit_tool.fit_file_builder import FitFileBuilder
    from fit_tool.profile.messages.record_message import RecordMessage

_MOST_FIELDS = 255
"""Developer fields of one record."""
_FIRST_S, _LAST_S = EPOCH_S + 0x10000000, EPOCH_S + 0xFFFFFFFE
"""Stamps of FIT files, s since 1970; smaller numbers would count from when a device was switched on."""
_LARGEST = 1e12
_OARS = ("catch_angle_rad", "finish_angle_rad", "arc_rad", "r_arc_rad", "l_arc_rad")
_MACHINE = ("handle_travel_m", "drag_factor")


@dataclass(frozen=True)
class _Told:
    """One developer field, with its place in the file and the numbers of all strokes in its unit, NaN where missing."""

    field: FitField
    application: int
    number: int
    values: Floats


def save_fit(table: StrokeTable, path: str | PathLike[str]) -> tuple[str, ...]:
    """Write the strokes as a FIT activity.

    Rate, heart rate, power, speed and distance are FIT's own fields. Drive and recovery time, oar angles, slip, wash,
    handle travel, force and work are developer fields of the rowing community's draft standard. All other columns, and
    the standard deviations of all as ``...Std``, are developer fields of Oarlock: floating-point numbers in the unit
    that their description names.

    Args:
        table: strokes whose `epoch` is a moment in UTC.
        path: of the file.

    Returns:
        What was left out, a sentence each.

    Raises:
        DataError: the moment or the times are not known, nothing is left to write, or fit-tool is not there.
    """
    start = moment_of(table.epoch)
    if start is None or start.kind != "utc":
        raise DataError(
            f"{path}: a FIT file needs the moment in UTC at which the recording began, and the strokes do not say it. "
            "Give it: --start 2026-05-01T07:30:00Z"
        )
    clock_s = table.clock_s
    if not _FIRST_S <= start.seconds <= _LAST_S:
        raise DataError(f"{path}: FIT files hold moments between 1998 and 2125, and not {start.text()}")
    kept = np.flatnonzero((clock_s >= 0.0) & (clock_s <= _LAST_S - start.seconds))
    if not len(kept):
        raise DataError(f"{path}: no stroke has a time, so there is nothing to write as FIT")
    left_out = len(table) - len(kept)
    notes = [f"{left_out} strokes without a time are not in the FIT file"] if left_out else []
    # Records come in whole seconds, so the session begins at one, and times count from it.
    begin_s = math.floor(start.seconds)
    try:
        from fit_tool.fit_file_builder import FitFileBuilder
    except ImportError:
        raise DataError(f"{path}: FIT files are written with fit-tool: pip install 'oarlock[fit]'") from None
    table = _on_one_clock(table, start.seconds - begin_s)
    told, dropped = _told(table)
    notes += [f"the FIT file has no room for: {', '.join(dropped)}"] if dropped else []
    builder = FitFileBuilder(auto_define=True, strict=True)
    _add(builder, table, told, kept, np.floor(start.seconds + clock_s + 0.5), begin_s)
    write_file(Path(path), builder.build_bytes())
    return tuple(notes)


def _on_one_clock(table: StrokeTable, shift_s: float) -> StrokeTable:
    """The table with times and distance that go on where the logger's began again, times later by a shift."""
    more_s = table.clock_s - table.stamp_s + shift_s
    columns = {name: values + more_s if name in TIMES else values for name, values in table.columns.items()}
    if "distance_m" in columns:
        columns["distance_m"] = running(columns["distance_m"])
    return replace(table, columns=columns)


def _told(table: StrokeTable) -> tuple[list[_Told], list[str]]:
    """The developer fields that have a number, and names of those beyond what a file can have."""
    told = []
    standard = {one.column: one for one in STANDARD}
    for column, one in standard.items():
        if column in table and np.isfinite(table[column]).any():
            told.append(_Told(one, 0, one.number or 0, _sensible(table[column] / UNITS[one.unit])))
    own = [
        _Told(one, 1, 0, _sensible(table[name] / UNITS[one.unit]))
        for name in table.columns
        if name not in standard and name not in NATIVE
        for one in [own_field(name)]
    ]
    stds = [(own_field(name, is_std=True), table.stds[name]) for name in table.stds]
    own += [_Told(one, 1, 0, _sensible(std / UNITS[one.unit])) for one, std in stds]
    own = [one for one in own if np.isfinite(one.values).any()]
    room = _MOST_FIELDS - len(told)
    numbered = [_Told(one.field, 1, number, one.values) for number, one in enumerate(own[:room])]
    return told + numbered, [one.field.name for one in own[room:]]


def _sensible(values: Floats) -> Floats:
    """The numbers; NaN where they are larger than any of a stroke, and than 32 bits can hold."""
    return np.where(np.abs(values) <= _LARGEST, values, np.nan)


def _add(
    builder: FitFileBuilder,
    table: StrokeTable,
    told: list[_Told],
    kept: np.ndarray[tuple[int], np.dtype[np.intp]],
    ends_s: Floats,
    begin_s: int,
) -> None:
    for message in _head(told, begin_s):
        builder.add(message)
    for place, stroke in enumerate(kept):
        builder.add(_record(table, told, int(stroke), place + 1, int(ends_s[stroke])))
    for message in _tail(table, kept, ends_s, begin_s):
        builder.add(message)


def _head(told: list[_Told], begin_s: int) -> Iterator[Any]:
    from fit_tool.profile.messages.developer_data_id_message import DeveloperDataIdMessage
    from fit_tool.profile.messages.field_description_message import FieldDescriptionMessage
    from fit_tool.profile.messages.file_id_message import FileIdMessage
    from fit_tool.profile.profile_type import FileType, Manufacturer

    first = FileIdMessage()
    first.type, first.manufacturer, first.product = FileType.ACTIVITY, Manufacturer.DEVELOPMENT.value, 0
    first.serial_number, first.time_created = 0, 1000 * begin_s
    yield first
    for index, application in enumerate((STANDARD_ID, OWN_ID)):
        message = DeveloperDataIdMessage()
        message.application_id, message.developer_data_index = application, index
        message.application_version = PROTOCOL
        yield message
    strategy = FitField(STRATEGY_NAME, "", "", STRATEGY, 1)
    for one in [_Told(strategy, 0, STRATEGY, np.zeros(0)), *told]:
        described = FieldDescriptionMessage()
        described.developer_data_index, described.field_definition_number = one.application, one.number
        described.fit_base_type_id = _base_type(one.field).value
        described.field_name, described.units = one.field.name, one.field.unit
        if one.field.scale:
            described.scale, described.offset = one.field.scale, 0
        yield described
    yield _event(begin_s, is_start=True)


def _record(table: StrokeTable, told: list[_Told], stroke: int, count: int, at_s: int) -> RecordMessage:
    from fit_tool.profile.messages.record_message import RecordMessage

    fields = [_developer_field(one, one.values[stroke]) for one in told if np.isfinite(one.values[stroke])]
    record = RecordMessage(developer_fields=[one for one in fields if one is not None])
    record.timestamp, record.total_cycles = 1000 * at_s, count
    rate = _value(table, "rate_per_min", stroke, 254.0)
    if rate is not None:
        record.cadence, record.cadence256 = round(rate), rate
    heart = _value(table, "heart_rate_per_min", stroke, 254.0)
    if heart is not None:
        record.heart_rate = round(heart)
    power = _value(table, "power_w", stroke, 65534.0)
    if power is not None:
        record.power = round(power)
    for name, column, most in _PLAIN:
        value = _value(table, column, stroke, most)
        if value is not None:
            setattr(record, name, value)
    return record


_PLAIN = (
    ("enhanced_speed", "speed_m_s", 1e5),
    ("distance", "distance_m", 4e7),
    ("cycle_length16", "distance_per_stroke_m", 655.0),
)


def _value(table: StrokeTable, column: str, stroke: int, most: float) -> float | None:
    """A number that FIT can write, else None."""
    value = float(table[column][stroke]) if column in table else np.nan
    return value if 0.0 <= value <= most else None


def _tail(
    table: StrokeTable, kept: np.ndarray[tuple[int], np.dtype[np.intp]], ends_s: Floats, begin_s: int
) -> Iterator[Any]:
    from fit_tool.profile.messages.activity_message import ActivityMessage
    from fit_tool.profile.messages.lap_message import LapMessage
    from fit_tool.profile.messages.session_message import SessionMessage
    from fit_tool.profile.profile_type import Activity, Event, EventType, Intensity, Sport, SubSport

    end_s = int(ends_s[kept].max())
    yield _event(end_s, is_start=False)
    laps = _laps(table, kept)
    lap_begin_s = begin_s
    for index, strokes in enumerate(laps):
        lap = LapMessage()
        lap_end_s = int(ends_s[strokes].max())
        lap.message_index, lap.intensity, lap.sport = index, Intensity.ACTIVE, Sport.ROWING
        _span(lap, lap_begin_s, lap_end_s)
        lap.event, lap.event_type, lap.total_cycles = Event.LAP, EventType.STOP, len(strokes)
        lap_begin_s = lap_end_s
        yield lap
    strategy = _Told(FitField(STRATEGY_NAME, "", "", STRATEGY, 1), 0, STRATEGY, np.zeros(0))
    session = SessionMessage(developer_fields=[_developer_field(strategy, STROKE_BOUNDARY)])
    _span(session, begin_s, end_s)
    session.message_index, session.first_lap_index, session.num_laps = 0, 0, len(laps)
    session.sport = Sport.ROWING
    session.sub_sport = SubSport.INDOOR_ROWING if _is_machine(table) else SubSport.GENERIC
    session.event, session.event_type, session.total_cycles = Event.SESSION, EventType.STOP, len(kept)
    distance = _value(table, "distance_m", int(kept[-1]), 4e7)
    if distance is not None:
        session.total_distance = distance
    yield session
    activity = ActivityMessage()
    activity.timestamp, activity.total_timer_time = 1000 * end_s, float(end_s - begin_s)
    activity.num_sessions, activity.type = 1, Activity.MANUAL
    activity.event, activity.event_type = Event.ACTIVITY, EventType.STOP
    yield activity


def _span(message: Any, begin_s: int, end_s: int) -> None:
    message.timestamp, message.start_time = 1000 * end_s, 1000 * begin_s
    message.total_elapsed_time = message.total_timer_time = float(end_s - begin_s)


def _laps(table: StrokeTable, kept: np.ndarray[tuple[int], np.dtype[np.intp]]) -> list[Any]:
    """Strokes of each interval; all in one without intervals."""
    if "interval" not in table:
        return [kept]
    interval = np.nan_to_num(table["interval"][kept], nan=-1.0)
    return np.split(kept, np.flatnonzero(np.diff(interval) != 0.0) + 1)


def _is_machine(table: StrokeTable) -> bool:
    """Whether the strokes look like an ergometer's: travel of a handle, or a drag factor, and no oar."""
    return any(name in table for name in _MACHINE) and not any(name in table for name in _OARS)


def _event(at_s: int, is_start: bool) -> Any:
    from fit_tool.profile.messages.event_message import EventMessage
    from fit_tool.profile.profile_type import Event, EventType

    event = EventMessage()
    event.event, event.timestamp = Event.TIMER, 1000 * at_s
    event.event_type = EventType.START if is_start else EventType.STOP_ALL
    return event


def _base_type(one: FitField) -> Any:
    from fit_tool.base_type import BaseType

    if not one.scale:
        return BaseType.FLOAT64 if one.column in TIMES else BaseType.FLOAT32
    if one.name == STRATEGY_NAME:
        return BaseType.UINT8
    return BaseType.SINT16 if one.is_signed else BaseType.UINT16


def _developer_field(one: _Told, value: float) -> DeveloperField | None:
    """The field with its number; None where the number does not fit into it."""
    from fit_tool.developer_field import DeveloperField
    from fit_tool.exceptions import FitEncodingError

    kind = _base_type(one.field)
    made = DeveloperField(
        developer_data_index=one.application,
        field_id=one.number,
        size=kind.size,
        name=one.field.name,
        base_type=kind,
        scale=float(one.field.scale) if one.field.scale else None,
        offset=0.0 if one.field.scale else None,
        units=one.field.unit,
    )
    scale = one.field.scale
    try:
        made.set_value(0, round(value * scale) / scale if scale else float(value))
    except FitEncodingError:
        return None
    return made
