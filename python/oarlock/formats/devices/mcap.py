"""Reads inertial units from MCAP files of ROS 2, with the library mcap in a child process.

Messages: ``sensor_msgs/msg/Imu`` and ``sensor_msgs/msg/MagneticField`` (ros2/common_interfaces) in the encoding CDR
(OMG, "DDS Interoperability Wire Protocol"): values are aligned to their size, counted from behind four bytes that
give the byte order.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.child_process import arrays_of
from oarlock.formats.listing import FileMatch, Listing
from oarlock.formats.merged import merged
from oarlock.formats.times import Stamps, on_one_axis
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.storage.names import LONGEST_NAME
from oarlock.storage.paths import place_of
from oarlock.storage.units import to_held_unit

MAGIC = b"\x89MCAP0\r\n"
_IMU = "sensor_msgs/msg/Imu cdr"
_LARGEST_NS = 2**62
# Imu: orientation and its covariance, angular velocity and its covariance, acceleration and its covariance.
_IMU_DOUBLES, _FIELD_DOUBLES = 37, 12
_GYRO, _ACCEL = 13, 25


@dataclass(frozen=True)
class _TopicReadings:
    """The messages of a topic: (T,) ns since 1970 in increasing order, readings by field, the frame of the sensor."""

    topic: str
    frame: str
    time_ns: Ints
    fields: Mapping[str, Floats]


def read_mcap(path: str | PathLike[str]) -> Recording:
    """Read inertial units and magnetometers of an MCAP file.

    Args:
        path: the file.

    Returns:
        One `ImuStream` for each topic of `Imu` messages, named after the topic; the messages of a magnetometer belong
        to the unit of the same frame. Time stamps are those of the messages' headers, or those of the recorder where
        the headers have none. A quantity that the message marks as not measured (covariance -1) is left out.

    Raises:
        DataError: mcap is not installed, the file is damaged, or it has no such messages.
    """
    file = place_of(path)
    if find_spec("mcap") is None:
        raise DataError(f"{file}: MCAP files are read with mcap: pip install 'oarlock[mcap]'")
    content = arrays_of("mcap", file)
    others = [str(text) for text in content["others"]]
    channels = [_channel(file, content, place) for place in range(len(content) // 5)]
    units = [channel for channel in channels if "mag_ut" not in channel.fields]
    magnetic = [channel for channel in channels if "mag_ut" in channel.fields]
    notes = [f"{topic}: was not imported." for topic in others]
    groups = [[unit, *(m for m in magnetic if _owner(m, units) is unit)] for unit in units]
    groups += [[m] for m in magnetic if _owner(m, units) is None]
    groups = [group for group in groups if any(channel.fields for channel in group)]
    if not groups:
        raise DataError(
            f"{file}: has no messages sensor_msgs/msg/Imu or MagneticField in the encoding cdr"
            + (f", only {', '.join(others[:5])}" if others else "")
        )
    flat = [channel for group in groups for channel in group]
    times, clock = on_one_axis([Stamps("utc", np.zeros(0), c.time_ns) for c in flat], [c.topic for c in flat])
    axis = {id(channel): time_s for channel, time_s in zip(flat, times, strict=True)}
    streams = []
    for group in groups:
        name = group[0].topic.strip("/").replace("/", "_")[:LONGEST_NAME] or "imu"
        time_s, fields = merged([(axis[id(c)], c.fields) for c in group if c.fields])
        streams.append(ImuStream(name, time_s, **fields))
    source = {"format": "mcap", "file": file.name, "topics": [c.topic for c in flat], "notes": notes}
    return Recording(streams, {"source": source, CLOCK_KEY: clock})


def find_mcap(listing: Listing) -> list[FileMatch]:
    """Each MCAP file is a recording."""
    return [
        FileMatch("mcap", file.path, (file.path,), file.path.stem, "MCAP, inertial units of ROS 2")
        for file in listing.files
        if file.head.startswith(MAGIC)
    ]


def _owner(magnetic: _TopicReadings, units: list[_TopicReadings]) -> _TopicReadings | None:
    """The only unit of the same frame."""
    same = [unit for unit in units if unit.frame == magnetic.frame]
    return same[0] if len(same) == 1 else None


def _channel(file: Path, content: Mapping[str, NDArray[np.generic]], place: int) -> _TopicReadings:
    topic, is_imu = str(content[f"{place}.topic"]), str(content[f"{place}.schema"]) == _IMU
    log_ns, data = content[f"{place}.log_ns"], content[f"{place}.data"].tobytes()
    ends = np.cumsum(content[f"{place}.sizes"])
    count = _IMU_DOUBLES if is_imu else _FIELD_DOUBLES
    stamps, frames, rows = [], [], []
    for number, end in enumerate(ends.tolist()):
        body = data[ends[number - 1] if number else 0 : end]
        try:
            stamp, frame, doubles = _message(body, count)
        except (struct.error, ValueError) as error:
            raise DataError(f"{file}: message {number + 1} of {topic} is damaged ({error})") from error
        stamps.append(stamp or int(log_ns[number]))
        frames.append(frame)
        rows.append(doubles)
    if len(set(frames)) > 1:
        raise DataError(
            f"{file}: the messages of {topic} are of {len(set(frames))} frames ({', '.join(sorted(set(frames))[:4])}); "
            "record each unit with a topic of its own"
        )
    if max(stamps) > _LARGEST_NS:
        raise DataError(f"{file}: a stamp of {topic} is {max(stamps)} ns, which is no time since 1970")
    time_ns, values = np.array(stamps, dtype=np.int64), np.array(rows)
    _check_order(file, topic, time_ns)
    return _TopicReadings(topic, frames[0], time_ns, _imu_fields(values) if is_imu else _mag_fields(values))


def _check_order(file: Path, topic: str, time_ns: Ints) -> None:
    late = np.flatnonzero(np.diff(time_ns) <= 0)
    if late.size:
        raise DataError(
            f"{file}: the stamp of message {late[0] + 2} of {topic} is not later than that of the one before "
            f"({late.size} messages). Record one sender a topic"
        )


def _message(body: bytes, count: int) -> tuple[int, str, tuple[float, ...]]:
    """Stamp in ns, frame, and the numbers of a message."""
    if len(body) < 16 or body[0] != 0 or body[1] not in (0, 1):
        raise ValueError(f"its {len(body)} bytes do not begin as CDR does")
    order, body = "<" if body[1] else ">", body[4:]
    seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", body)
    if seconds < 0 or length > len(body):
        raise ValueError(f"stamp {seconds} s, a frame of {length} letters")
    frame = body[12 : 12 + length].rstrip(b"\0").decode("utf-8", "replace")
    begin = -(-(12 + length) // 8) * 8
    return seconds * 10**9 + nanoseconds, frame, struct.unpack_from(f"{order}{count}d", body, begin)


def _imu_fields(values: Floats) -> dict[str, Floats]:
    fields = {}
    for field, place in (("gyro_rad_s", _GYRO), ("accel_m_s2", _ACCEL)):
        if not (values[:, place + 3] == -1.0).all():
            fields[field] = values[:, place : place + 3]
    return fields


def _mag_fields(values: Floats) -> dict[str, Floats]:
    return {"mag_ut": to_held_unit(values[:, :3], "T")}
