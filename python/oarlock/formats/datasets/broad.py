"""Reads the BROAD data set: one inertial unit with optical orientation and position, as .mat files.

Source and description: Laidig, Caruso, Cereatti, Seel, "BROAD - a benchmark for robust inertial orientation
estimation", Data 6(7):72, 2021, doi:10.3390/data6070072. The authors have synchronised and aligned both systems; the
sampling rate, 286 Hz, is in each file.

A reading is assumed to be the mean over the interval that ends at its row, as in all filters that the authors compare:
the rotation by a row's angular rate leads from the previous row to this one. A comparison of the gyroscope with the
rotation of the reference supports this: the gyroscope is late by 4.0 ms in all five examined trials, of which the
assumption explains 1.75 ms.
"""

from os import PathLike

from oarlock.evaluation.reference import Reference
from oarlock.formats.datasets.mat import matrix, read_mat, same_length, sampling_rate
from oarlock.formats.datasets.mat_names import mat_names
from oarlock.formats.listing import FileMatch, Listing
from oarlock.formats.stamps import interval_middles_s, row_times_s
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

BODY = "imu"


def read_broad(path: str | PathLike[str]) -> Recording:
    """Read the inertial unit of one trial.

    Args:
        path: the .mat file.

    Returns:
        One stream, ``imu``, with gyro, accel and mag (uT). Time stamps are interval middles: the first is
        half a step before 0 s, where the reference begins.

    Raises:
        DataError: The file is not of this format, or a part is missing or has another shape.
    """
    file = place_of(path)
    variables = read_mat(file)
    rate_hz = sampling_rate(variables, "sampling_rate", file)
    gyro, accel, mag = (matrix(variables, name, 3, file) for name in ("imu_gyr", "imu_acc", "imu_mag"))
    stream = ImuStream(
        BODY, interval_middles_s(len(gyro), rate_hz), gyro_rad_s=gyro, accel_m_s2=accel, mag_ut=mag
    )
    return Recording([stream], {"source": {"format": "broad", "file": file.name}})


def read_broad_reference(path: str | PathLike[str]) -> Reference:
    """Orientation and position of the same trial; ``scored`` marks the movement, which the authors score.

    Args:
        path: the .mat file.

    Returns:
        The body ``imu``, world axes x east, y north, z up.

    Raises:
        DataError: As `read_broad`; the reference has another length than the readings.
    """
    file = place_of(path)
    variables = read_mat(file)
    rate_hz = sampling_rate(variables, "sampling_rate", file)
    quat_wxyz = matrix(variables, "opt_quat", 4, file)
    for name, columns in (("imu_gyr", 3), ("opt_pos", 3), ("movement", 1)):
        same_length(quat_wxyz, matrix(variables, name, columns, file), ("opt_quat", name), file)
    try:
        return Reference(
            "optical",
            row_times_s(len(quat_wxyz), rate_hz),
            {BODY: quat_wxyz},
            {BODY: matrix(variables, "opt_pos", 3, file)},
            matrix(variables, "movement", 1, file)[:, 0] > 0.0,
        )
    except DataError as error:
        raise DataError(f"{file}: {error}") from error


def find_broad(listing: Listing) -> list[FileMatch]:
    """Trials among the .mat files of a place."""
    return [
        FileMatch("broad", one.path, (one.path,), one.path.stem, "BROAD trial, one unit with magnetometer")
        for one in listing.suffixed(".mat")
        if {"sampling_rate", "imu_gyr", "imu_acc", "imu_mag"} <= mat_names(one.path).keys()
    ]
