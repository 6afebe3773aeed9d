"""`UnitReadings` of one inertial unit as a device's file has them, and `recording_of`: their recording. For readers."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.formats.arbitrary_units import scale_meta, scaled_mag
from oarlock.formats.counters import Lost
from oarlock.formats.devices.exported_table import ExportedTable
from oarlock.model.rotation import quat_from_matrix, quat_from_rotvec, quat_product
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.packets import META_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, OrientationStream, Stream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

ORIENTATION = "_orientation"
"""Ends the name of the stream of orientations that a unit computed itself, beside the stream of its readings."""
_ROTATION_TOLERANCE = 0.01
"""Allowed error of a norm and of an element of R R'. Files have six digits; a larger one shows no rotation."""
_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")


@dataclass(frozen=True)
class UnitReadings:
    """What one unit measured. Quantities that it lacks are None.

    Args:
        name: of its streams.
        time_s: (T,) s.
        gyro_rad_s: (T, 3) rad/s.
        accel_m_s2: (T, 3) m/s2.
        mag_ut: (T, 3) uT.
        mag_arbitrary: (T, 3) in an unknown unit, instead of `mag_ut`.
        quat_wxyz: (T, 4) the unit's own orientation, reference-from-sensor, z of the reference up.
        lost: lost packets, if the unit counts them.
    """

    name: str
    time_s: Floats
    gyro_rad_s: Floats | None = None
    accel_m_s2: Floats | None = None
    mag_ut: Floats | None = None
    mag_arbitrary: Floats | None = None
    quat_wxyz: Floats | None = None
    lost: Lost | None = None

    def streams(self, orientations: bool) -> tuple[list[Stream], list[str]]:
        """The unit's streams, and sentences for the reader.

        Orientations are left out if there is a gyroscope, unless they are asked for.
        """
        mag_ut, said = self.mag_ut, []
        if self.mag_arbitrary is not None:
            mag_ut, sentence = scaled_mag(self.mag_arbitrary, self.name)
            said.append(sentence)
        fields = {"gyro_rad_s": self.gyro_rad_s, "accel_m_s2": self.accel_m_s2, "mag_ut": mag_ut}
        present = {name: rows for name, rows in fields.items() if rows is not None}
        streams: list[Stream] = [ImuStream(self.name, self.time_s, **present)] if present else []
        if self.quat_wxyz is not None and (orientations or self.gyro_rad_s is None):
            name = f"{self.name}{ORIENTATION}" if present else self.name
            streams.append(OrientationStream(name, self.time_s, self.quat_wxyz))
        return streams, said


def recording_of(
    units: Sequence[UnitReadings],
    source: Mapping[str, object],
    clock: Mapping[str, object],
    orientations: bool,
    notes: Sequence[str] = (),
) -> Recording:
    """The streams of all units.

    Args:
        units: the units.
        source: for ``meta["source"]``: format, files, devices.
        clock: for ``meta["clock"]``.
        orientations: whether orientations are wanted of units that have a gyroscope.
        notes: sentences for the reader, for ``meta["source"]["notes"]``.

    Raises:
        DataError: no unit has a reading, or two have one name.
    """
    streams: list[Stream] = []
    said = list(notes)
    lost: dict[str, object] = {}
    for unit in units:
        found, sentences = unit.streams(orientations)
        streams += found
        said += sentences
        if unit.lost is not None:
            lost |= {stream.name: unit.lost for stream in found}
    if not streams:
        raise DataError(
            f"{source.get('files')}: no unit has gyroscope, accelerometer, magnetometer or orientation"
        )
    meta: dict[str, object] = {
        "source": {**source, **({"notes": said} if said else {})},
        CLOCK_KEY: dict(clock),
    }
    meta |= scale_meta({unit.name: unit.mag_arbitrary for unit in units})
    return Recording(streams, meta | ({META_KEY: lost} if lost else {}))


def source_of(
    format_name: str,
    trial: str,
    tables: Sequence[ExportedTable],
    said: Mapping[str, Mapping[str, object]],
    read: Container[str],
) -> dict[str, object]:
    """For ``meta["source"]``: the format, the files, what each says of its unit, and the columns that were not read."""
    names = dict.fromkeys(
        name for table in tables for name in table.layout.names if name and name not in read
    )
    return {
        "format": format_name,
        "files": [table.file.name for table in tables],
        "trial": trial,
        "units": {name: dict(entry) for name, entry in said.items()},
        "left_out": list(names),
    }


def stream_name(label: str) -> str:
    """A label of a file in lower case, with "_" between words: "RightForeArm" gives "right_fore_arm"."""
    parts = [part for text in re.split(r"[^\w]+|_", label) for part in _parts(text)]
    return "_".join(part.lower() for part in parts)


def _parts(text: str) -> list[str]:
    """The words of a CamelCase label; any other text is one word, such as a device's number."""
    camel = text.isascii() and text.isalpha() and not text.isupper()
    return _WORD.findall(text) if camel else [text] if text else []


def quat_from_matrices(matrices: Floats, places: Sequence[str]) -> Floats:
    """(T, 4) quaternions of (T, 3, 3) rotations; NaN where an element is missing.

    Raises:
        DataError: a matrix is no rotation; names its place.
    """
    there = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    if not there.any():
        return np.full((len(matrices), 4), np.nan)
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        proper = (error <= _ROTATION_TOLERANCE) & (np.linalg.det(matrices) > 0.0)
    bad = np.flatnonzero(there & ~proper)
    if bad.size:
        raise DataError(
            f"{places[int(bad[0])]}: the matrix of this row is no rotation ({bad.size} of {len(matrices)} rows)"
        )
    # Matrices of a few digits are not quite rotations: the nearest ones.
    left, _, right = np.linalg.svd(np.where(there[:, None, None], matrices, np.eye(3)))
    return np.where(there[:, None], quat_from_matrix(left @ right), np.nan)


def check_quaternions(quat_wxyz: Floats, places: Sequence[str]) -> Floats:
    """The same (T, 4), none of which may be other than a unit quaternion; errors name its place."""
    with np.errstate(over="ignore"):
        norm = np.linalg.norm(quat_wxyz, axis=1)
    bad = np.flatnonzero(np.abs(norm - 1.0) > _ROTATION_TOLERANCE)
    if bad.size:
        row = int(bad[0])
        raise DataError(
            f"{places[row]}: the quaternion of this row has the norm {norm[row]:.4g}; expected 1 "
            f"({bad.size} of {len(norm)} rows)"
        )
    return quat_wxyz


def quat_from_roll_pitch_yaw(angles_deg: Floats) -> Floats:
    """(T, 4) quaternions of (T, 3) roll, pitch, yaw in deg, R = Rz(yaw) Ry(pitch) Rx(roll); NaN where any is."""
    roll, pitch, yaw = (
        quat_from_rotvec(np.radians(angles_deg[:, k, None]) * axis) for k, axis in enumerate(np.eye(3))
    )
    return quat_product(quat_product(yaw, pitch), roll)
