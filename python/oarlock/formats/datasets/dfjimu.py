"""Reads the .mat files of the software dfjimu: two inertial units on two bodies connected by a ball joint.

Format: one structure ``data`` with ``rate`` (Hz), ``sensorData`` (N, 12), ``ref`` (N, 17) and the vectors ``r_12``
and ``r_21`` (m), as the evaluation script of the software reads it (github.com/daniel-om-weber/dfjimu). The recordings
were made for this method: Weygers and Kok, "Drift-free inertial sensor-based joint kinematics for long-term
arbitrary movements", IEEE Sensors Journal 20(14), 2020.

A reading is assumed to be the mean over the interval that ends at its row. A comparison of the gyroscopes with the
rotation of the reference supports this: they are late by 14 to 19 ms, of which the assumption explains 10 ms. The
software's own script moves the reference by a whole row.
"""

from os import PathLike

from oarlock.evaluation.reference import Reference
from oarlock.formats.datasets.mat import matrix, read_mat, same_length, sampling_rate, structure
from oarlock.formats.datasets.mat_names import mat_names
from oarlock.formats.listing import FileMatch, Listing
from oarlock.formats.stamps import interval_middles_s, row_times_s
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

BODIES = ("body1", "body2")

_SENSOR_COLUMNS = {"body1": (slice(0, 3), slice(3, 6)), "body2": (slice(6, 9), slice(9, 12))}
_REFERENCE_COLUMNS = {"body1": slice(0, 4), "body2": slice(4, 8)}
_JOINT = {"body1": "data.r_12", "body2": "data.r_21"}


def read_dfjimu(path: str | PathLike[str]) -> Recording:
    """Read the inertial units.

    Args:
        path: the .mat file.

    Returns:
        The streams ``body1`` and ``body2`` (gyro and accel, no magnetometer). Time stamps are interval middles:
        the first is half a step before 0 s, where the reference begins.
        ``meta["joint_in_sensor_m"]`` contains for each the joint's centre in sensor axes, m, as in the file. (The
        authors' lever arm is the negative of this vector: from the joint to the sensor.)

    Raises:
        DataError: Not such a file; a part of it is missing or has another shape.
    """
    file = place_of(path)
    data = structure(read_mat(file), "data", file)
    rate_hz = sampling_rate(data, "data.rate", file)
    readings = matrix(data, "data.sensorData", 12, file)
    time_s = interval_middles_s(len(readings), rate_hz)
    streams = [
        ImuStream(body, time_s, gyro_rad_s=readings[:, gyro], accel_m_s2=readings[:, accel])
        for body, (accel, gyro) in _SENSOR_COLUMNS.items()
    ]
    joint = {body: matrix(data, name, 3, file)[0].tolist() for body, name in _JOINT.items()}
    return Recording(streams, {"source": {"format": "dfjimu", "file": file.name}, "joint_in_sensor_m": joint})


def read_dfjimu_reference(path: str | PathLike[str]) -> Reference:
    """Read the orientations of the two optical clusters, one row for each sample of the units.

    The clusters are mounted on the units; their axes agree within a few degrees, and their clock within a few samples.

    Args:
        path: the .mat file.

    Returns:
        ``body1`` and ``body2``, world with z up.

    Raises:
        DataError: As `read_dfjimu`; the reference has another length than the readings.
    """
    file = place_of(path)
    data = structure(read_mat(file), "data", file)
    rate_hz = sampling_rate(data, "data.rate", file)
    reference = matrix(data, "data.ref", 17, file)
    same_length(reference, matrix(data, "data.sensorData", 12, file), ("data.ref", "data.sensorData"), file)
    quats = {body: reference[:, columns] for body, columns in _REFERENCE_COLUMNS.items()}
    try:
        return Reference("optical", row_times_s(len(reference), rate_hz), quats)
    except DataError as error:
        raise DataError(f"{file}: {error}") from error


def find_dfjimu(listing: Listing) -> list[FileMatch]:
    """Recordings among the .mat files of a place."""
    return [
        FileMatch(
            "dfjimu", one.path, (one.path,), one.path.stem, "dfjimu recording, two units on a ball joint"
        )
        for one in listing.suffixed(".mat")
        if {"rate", "sensorData", "r_12", "r_21"} <= set(mat_names(one.path).get("data", ()))
    ]
