"""Reads the full-body example of the toolbox qmt: a .mat file of a person with sixteen inertial units.

Source: examples/full_body_example_data.mat of github.com/dlaidig/qmt, MIT licence. A variable ``t`` (s) and one
structure for each body segment with ``acc`` (m/s2) and ``gyr`` (rad/s, offset removed by the authors). There is no
magnetometer and no reference. The field ``quat`` is not read: the toolbox's basic example does not use it, and it is
not documented.
"""

from os import PathLike

from oarlock.formats.datasets.mat import matrix, read_mat, same_length, structure
from oarlock.formats.datasets.mat_names import mat_names
from oarlock.formats.listing import FileMatch, Listing
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import time_array
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of


def read_qmt(path: str | PathLike[str]) -> Recording:
    """Read all units.

    Args:
        path: the .mat file.

    Returns:
        One stream (gyro and accel) for each segment, named as in the file: ``hip``, ``lower_back``,
        ``upper_arm_left``, ... The time stamps are those of the file.

    Raises:
        DataError: The file is not of this format, or a part is missing or has another shape.
    """
    file = place_of(path)
    variables = read_mat(file)
    time_s = time_array(matrix(variables, "t", 1, file)[:, 0], f"{file}, t")
    streams = []
    for segment in dict.fromkeys(name.partition(".")[0] for name in variables):
        if segment == "t":
            continue
        fields = structure(variables, segment, file)
        gyro, accel = (matrix(fields, f"{segment}.{name}", 3, file) for name in ("gyr", "acc"))
        same_length(time_s, gyro, ("t", f"{segment}.gyr"), file)
        streams.append(ImuStream(segment.lower(), time_s, gyro_rad_s=gyro, accel_m_s2=accel))
    if not streams:
        raise DataError(f"{file}: has a time but no segment with acc and gyr")
    return Recording(streams, {"source": {"format": "qmt", "file": file.name}})


def find_qmt(listing: Listing) -> list[FileMatch]:
    """Recordings among the .mat files of a place: a time and structures with acc and gyr only."""
    found = []
    for one in listing.suffixed(".mat"):
        variables = mat_names(one.path)
        segments = [fields for name, fields in variables.items() if name != "t"]
        if "t" in variables and segments and all({"acc", "gyr"} <= set(fields) for fields in segments):
            about = f"qmt full-body recording, {len(segments)} units"
            found.append(FileMatch("qmt", one.path, (one.path,), one.path.stem, about))
    return found
