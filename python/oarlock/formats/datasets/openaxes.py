"""Reads OpenAXES runs: CSV files of two links of a UR5 robot with inertial units.

Source: Webering et al. 2023, data repository of the Leibniz University Hannover, doi:10.25835/psqqs9w0, in the form
of the copy in github.com/simon-bachhuber/ring_supplementary_material (data/openaxes_dataset).
``synced_imu/RUN/LINK_adx.csv`` has the units' readings on the robot's clock, ``groundtruth/robot-RUN/LINK.csv`` has
that clock (us) and the links' orientations from the joint encoders. There is no magnetometer. The accelerometers are
not calibrated: they read 9.4 to 9.5 m/s2 at rest.
"""

from os import PathLike
from pathlib import Path

import numpy as np

from oarlock.evaluation.reference import Reference
from oarlock.formats.columns import read_columns
from oarlock.formats.listing import FileMatch, Listing
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import time_array
from oarlock.storage.arrays import Floats
from oarlock.storage.delimited import ColumnLayout, Dialect
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

LINKS = ("radius", "carpus")

LINK_FROM_SENSOR = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
"""Mount of the units on both links in all runs: a rotation by -90 deg about y.

Found from the recordings, by rotating the readings to the world with the encoders' orientations; it is accurate to 0.6
deg.
"""


def openaxes_runs(folder: str | PathLike[str]) -> tuple[str, ...]:
    """Names of the runs in a copy of the data, such as "circle-100" (shape and speed in mm/s).

    Raises:
        DataError: The folder contains no run.
    """
    root = place_of(folder) / "synced_imu"
    runs = tuple(sorted(run.name for run in root.glob("*") if (run / f"{LINKS[0]}_adx.csv").is_file()))
    if not runs:
        raise DataError(
            f"{folder}: contains no run; expected files such as synced_imu/circle-100/radius_adx.csv"
        )
    return runs


def read_openaxes(folder: str | PathLike[str], run: str) -> Recording:
    """Read the inertial units of one run.

    Args:
        folder: the data folder, which contains ``synced_imu`` and ``groundtruth``.
        run: name of the run, such as circle-100; see `openaxes_runs`.

    Returns:
        The streams ``radius`` and ``carpus`` (gyro and accel) from 0 s, in the sensors' own axes: see
        `LINK_FROM_SENSOR`.

    Raises:
        DataError: No such run, a missing file or column, a cell that is not a number, or readings and clock of
            different length.
    """
    streams = []
    for link in LINKS:
        file = _readings_file(folder, run, link)
        layout = ColumnLayout.of(file, Dialect())
        readings = read_columns(layout, [f"{q}_{axis}" for q in ("gyr", "acc") for axis in "xyz"])
        time_s, _ = _clock_and_orientation(folder, run, link)
        if len(time_s) != len(readings):
            clock = _reference_file(folder, run, link)
            raise DataError(f"{file}: has {len(readings)} rows, but its clock {clock} has {len(time_s)}")
        streams.append(ImuStream(link, time_s, gyro_rad_s=readings[:, :3], accel_m_s2=readings[:, 3:]))
    return Recording(streams, {"source": {"format": "openaxes", "run": run}})


def read_openaxes_reference(folder: str | PathLike[str], run: str) -> Reference:
    """Orientations of the two links from the robot's encoders, on the clock of the readings.

    Args:
        folder: as `read_openaxes`.
        run: as `read_openaxes`.

    Returns:
        ``radius`` and ``carpus``, world_from_link with z up.

    Raises:
        DataError: As `read_openaxes`; the two links' clocks differ.
    """
    links = {link: _clock_and_orientation(folder, run, link) for link in LINKS}
    (first, _), (second, _) = links.values()
    if not np.array_equal(first, second):
        raise DataError(f"{folder}, run {run}: the clocks of {LINKS[0]} and {LINKS[1]} differ")
    return Reference("encoders", first, {link: quat_wxyz for link, (_, quat_wxyz) in links.items()})


def _clock_and_orientation(folder: str | PathLike[str], run: str, link: str) -> tuple[Floats, Floats]:
    """Time stamps of the robot in s, (T,) from 0, and world_from_link as quat_wxyz, (T, 4)."""
    file = _reference_file(folder, run, link)
    rows = read_columns(ColumnLayout.of(file, Dialect()), ["TIME", *(f"QUATERNION_{i}" for i in range(4))])
    return time_array((rows[:, 0] - rows[0, 0]) * 1e-6, f"{file}, TIME"), rows[:, 1:]


def _readings_file(folder: str | PathLike[str], run: str, link: str) -> Path:
    file = _readings_name(folder, run, link)
    if not file.is_file():
        raise DataError(
            f'there is no run "{run}": {file} is missing. Runs: {", ".join(openaxes_runs(folder))}'
        )
    return file


def _readings_name(folder: str | PathLike[str], run: str, link: str) -> Path:
    return place_of(folder) / "synced_imu" / run / f"{link}_adx.csv"


def _reference_file(folder: str | PathLike[str], run: str, link: str) -> Path:
    return place_of(folder) / "groundtruth" / f"robot-{run}" / f"{link}.csv"


def find_openaxes(listing: Listing) -> list[FileMatch]:
    """Runs of the data folders of a place."""
    found = []
    for one in listing.suffixed(f"{LINKS[0]}_adx.csv"):
        run = one.path.parent
        root = run.parent.parent
        files = [_readings_name(root, run.name, link) for link in LINKS]
        files += [_reference_file(root, run.name, link) for link in LINKS]
        if run.parent.name == "synced_imu" and all(file.is_file() for file in files):
            about = "OpenAXES run, two units on a robot"
            found.append(FileMatch("openaxes", root, tuple(files), run.name, about, {"run": run.name}))
    return found
