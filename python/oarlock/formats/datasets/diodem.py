"""Reads DIODEM trials: CSV files of a chain of five links with inertial units and optical markers.

Source: the copy in github.com/simon-bachhuber/ring_supplementary_material (data/dataset/trial1), the same rig and
format as the data set DIODEM, doi:10.7910/DVN/SGJLZA, described in Scientific Data, doi:10.1038/s41597-025-05468-w.

A trial is a folder with ``imu_rigid.csv`` and ``imu_nonrigid.csv`` (units screwed on, units on foam) and ``omc.csv``
(optical). Each file states its sampling rate in a comment. The files have no time stamps and begin together. The rate
of the cameras is 30 Hz. ``seg1`` and ``seg2`` are connected by a ball joint; the next joints are hinges about x, y and
z. The axes of the units agree with those of the segments to about a degree if the units are screwed on. On foam they
differ by 5 to 12 degrees and change.
"""

import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from oarlock.evaluation.reference import Reference
from oarlock.formats.columns import read_columns
from oarlock.formats.listing import FileMatch, Listing
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats
from oarlock.storage.delimited import ColumnLayout, Dialect
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.regular_file import open_text

SEGMENTS = ("seg1", "seg2", "seg3", "seg4", "seg5")

Mounted = Literal["rigid", "foam"]
_FILES = {"rigid": "imu_rigid.csv", "foam": "imu_nonrigid.csv"}
_REFERENCE_FILE = "omc.csv"
_COMMENT_LINES = 2
_FIELDS = {"gyr": "gyro_rad_s", "acc": "accel_m_s2", "mag": "mag_ut"}
_MARKERS = ("marker1", "marker2", "marker3", "marker4")
_RATE = re.compile(r"# sampling frequency: ([0-9.]+)\s*")


def read_diodem(
    folder: str | PathLike[str], mounted: Mounted = "rigid", mag_unit_ut: float | None = None
) -> Recording:
    """Read the five inertial units of one trial.

    Args:
        folder: the trial's folder.
        mounted: which inertial units: rigid, screwed to the segments, or on foam.
        mag_unit_ut: scale of the magnetometers, uT per unit: the files contain arbitrary units. None leaves them out.

    Returns:
        The streams ``seg1`` to ``seg5``, from 0 s.

    Raises:
        DataError: A file or column is missing, a cell is not a number, or `mounted` is neither of the two.
    """
    if mounted not in _FILES:
        raise DataError(f'mounted = "{mounted}"; expected one of "rigid", "foam"')
    file = place_of(folder) / _FILES[mounted]
    layout, rate_hz = _open(file)
    scales = {"gyr": 1.0, "acc": 1.0} | ({} if mag_unit_ut is None else {"mag": mag_unit_ut})
    readings = _read(layout, {f"{s}_{quantity}": "xyz" for s in SEGMENTS for quantity in scales})
    time_s = np.arange(len(readings["seg1_gyr"])) / rate_hz
    streams = [
        ImuStream(s, time_s, **{_FIELDS[q]: readings[f"{s}_{q}"] * scale for q, scale in scales.items()})
        for s in SEGMENTS
    ]
    return Recording(streams, {"source": {"format": "diodem", "file": file.name}, "mounted": mounted})


def read_diodem_reference(folder: str | PathLike[str]) -> Reference:
    """Read orientation and position of the five optical segments, on the cameras' clock.

    Args:
        folder: the trial's folder.

    Returns:
        ``seg1`` to ``seg5``, world with z up; the position is the mean of the segment's four markers. Rows that the
        cameras did not see are NaN.

    Raises:
        DataError: As `read_diodem`.
    """
    file = place_of(folder) / _REFERENCE_FILE
    layout, rate_hz = _open(file)
    readings = _read(
        layout,
        {f"{s}_quat": "wxyz" for s in SEGMENTS} | {f"{s}_{m}": "xyz" for s in SEGMENTS for m in _MARKERS},
    )
    quats = {s: _whole_rows(readings[f"{s}_quat"]) for s in SEGMENTS}
    places = {s: np.asarray(np.mean([readings[f"{s}_{m}"] for m in _MARKERS], axis=0)) for s in SEGMENTS}
    try:
        return Reference("optical", np.arange(len(quats["seg1"])) / rate_hz, quats, places)
    except DataError as error:
        raise DataError(f"{file}: {error}") from error


def _read(layout: ColumnLayout, axes: Mapping[str, str]) -> dict[str, Floats]:
    """Quantity -> (T, number of its axes), for columns named QUANTITY_AXIS."""
    rows = read_columns(layout, [f"{name}_{axis}" for name, letters in axes.items() for axis in letters])
    ends = np.cumsum([len(letters) for letters in axes.values()])[:-1]
    return dict(zip(axes, np.split(rows, ends, axis=1), strict=True))


def _open(file: Path) -> tuple[ColumnLayout, float]:
    """The columns of a file, and its sampling rate in Hz."""
    try:
        with open_text(file, "utf-8") as stream:
            first = stream.readline()
    except UnicodeDecodeError as error:
        raise DataError(f"{file}: is not a text file ({error})") from error
    found = _RATE.fullmatch(first)
    rate_hz = float(found[1]) if found and found[1].count(".") <= 1 and found[1] != "." else 0.0
    if rate_hz <= 0.0:
        raise DataError(
            f'{file}:1: "{first.strip()[:60]}" does not state the rate; expected "# sampling frequency: 40" in Hz'
        )
    return ColumnLayout.of(file, Dialect(skip_rows=_COMMENT_LINES)), rate_hz


def _whole_rows(rows: Floats) -> Floats:
    """A row that lacks a component is missing as a whole."""
    return np.where(np.isnan(rows).any(axis=1, keepdims=True), np.nan, rows)


def find_diodem(listing: Listing) -> list[FileMatch]:
    """Trials of a place: each of the two ways of mounting is a recording."""
    found = []
    for mounted, file_name in _FILES.items():
        for one in listing.suffixed(file_name):
            if one.path.name == file_name and one.lines and _RATE.fullmatch(one.lines[0]):
                folder = one.path.parent
                name = f"{folder.name}_{mounted}"
                about = f"DIODEM trial, five units, mounted {mounted}"
                found.append(FileMatch("diodem", folder, (one.path,), name, about, {"mounted": mounted}))
    return found
