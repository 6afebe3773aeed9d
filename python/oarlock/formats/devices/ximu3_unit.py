"""What one x-IMU3 wrote, and its stream: the form in which the readers of CSV folders and of .ximu3 files meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from oarlock.formats.arbitrary_units import scaled_mag
from oarlock.formats.merged import merged
from oarlock.recording.streams import ImuStream, OrientationStream
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.storage.units import to_held_unit

COLUMNS = MappingProxyType(
    {
        "Inertial": (
            *("Gyroscope X (deg/s)", "Gyroscope Y (deg/s)", "Gyroscope Z (deg/s)"),
            *("Accelerometer X (g)", "Accelerometer Y (g)", "Accelerometer Z (g)"),
        ),
        "Magnetometer": ("X (a.u.)", "Y (a.u.)", "Z (a.u.)"),
        "Quaternion": ("W", "X", "Y", "Z"),
    }
)
"""The messages that are read, with the columns of their CSV files. Other messages are left out."""
TIME = "Timestamp (us)"
_LATE_US = 1_000_000


@dataclass(frozen=True)
class MessageTable:
    """Messages of one kind in the order of the file: (T,) microseconds and (T, k) arguments."""

    time_us: Ints
    values: Floats


@dataclass(frozen=True)
class Ximu3Unit:
    """What one unit wrote.

    Args:
        where: its folder or file, for errors.
        label: its device name.
        serial: its serial number; empty if it is not known.
        messages: by the names of `COLUMNS`.
        commands: its settings and answers, by key.
        notes: sentences about what was left out.
    """

    where: str
    label: str
    serial: str
    messages: Mapping[str, MessageTable]
    commands: Mapping[str, object]
    notes: list[str] = field(default_factory=list)

    def in_order(self, kind: str) -> tuple[Floats, Floats] | None:
        """Time stamps in s and arguments of the messages of this kind, in the order of time; None if there is none.

        UDP may deliver a message late or twice: it is put into its place, or left out.

        Raises:
            DataError: the stamps go back by more than a second, or two messages of one stamp differ.
        """
        found = self.messages.get(kind)
        if found is None or not found.time_us.size:
            return None
        late = found.time_us - np.maximum.accumulate(found.time_us)
        if late.min() < -_LATE_US:
            raise DataError(
                f"{self.where}: the stamps of its {kind} messages go back by {-late.min() / 1e6:.1f} s. The unit was "
                "started again, or took over the time of a network, while it was recorded; record again"
            )
        order = np.argsort(found.time_us, kind="stable")
        time_us, values = found.time_us[order], found.values[order]
        twice = np.flatnonzero(np.diff(time_us) == 0)
        if not np.array_equal(values[twice], values[twice + 1], equal_nan=True):
            raise DataError(f"{self.where}: has different {kind} messages with the same stamp")
        if twice.size or late.min() < 0:
            self.notes.append(
                f"{self.label}: {np.count_nonzero(late < 0)} {kind} messages came late and were put into their places; "
                f"{twice.size} came twice."
            )
        kept = np.setdiff1d(np.arange(time_us.size), twice)
        return time_us[kept] / 1e6, values[kept]

    def stream(self, name: str) -> ImuStream | None:
        """Its readings; None if there is neither gyroscope, accelerometer nor magnetometer.

        Raises:
            DataError: as `in_order`, or a reading is not finite.
        """
        parts = []
        if (inertial := self.in_order("Inertial")) is not None:
            gyro, accel = inertial[1][:, :3], inertial[1][:, 3:]
            fields = {"gyro_rad_s": to_held_unit(gyro, "deg/s"), "accel_m_s2": to_held_unit(accel, "g")}
            parts.append((inertial[0], fields))
        if (magnetic := self.in_order("Magnetometer")) is not None:
            mag_ut, note = scaled_mag(magnetic[1], name)
            self.notes.append(note)
            if mag_ut is not None:
                parts.append((magnetic[0], {"mag_ut": mag_ut}))
        if not parts:
            self.notes.append(f"{self.label}: has no inertial messages and was left out.")
            return None
        time_s, readings = merged(parts)
        return ImuStream(name, time_s, **readings)

    def orientations(self, name: str) -> OrientationStream | None:
        """The orientations of its own filter; None if there are none."""
        found = self.in_order("Quaternion")
        return None if found is None else OrientationStream(name, *found)
