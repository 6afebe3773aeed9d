"""Reads x-io x-IMU3 recordings: the folders of CSV files of the vendor's software, and .ximu3 files of the data logger.

A unit counts microseconds since it was switched on. Units on one Wi-Fi network share the count of the one that was
switched on first (x-io Technologies, x-IMU3 User Manual, section "Synchronisation"). A message is the mean of the
samples since the one before and has the stamp of the last of them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from oarlock.formats.arbitrary_units import scale_meta
from oarlock.formats.devices.several_units import common_time_notes, unit_names
from oarlock.formats.devices.ximu3_csv import COMMANDS, folder_unit
from oarlock.formats.devices.ximu3_messages import file_units
from oarlock.formats.devices.ximu3_unit import COLUMNS, TIME, Ximu3Unit
from oarlock.formats.listing import FileMatch, ListedFile, Listing
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import OrientationStream
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

_SUFFIX = ".ximu3"
_SERIAL = re.compile(rb'"sn" *: *"([^"]+)"')


def read_ximu3(path: str | PathLike[str]) -> Recording:
    """Read gyroscope, accelerometer and magnetometer of x-IMU3 units.

    Args:
        path: the folder of one unit (with Inertial.csv), a folder of such folders or of .ximu3 files, or a .ximu3 file.

    Returns:
        One `ImuStream` per unit, named after its device name ("Right Upper Leg" gives right_upper_leg), with the time
        stamps of the file. The magnetometer has arbitrary units and its own rate, 20 Hz: it is scaled (`scaled_mag`)
        and its rows are between those of gyroscope and accelerometer.

    Raises:
        DataError: a file is damaged, or the units have no common time.
    """
    units = _units(place_of(path))
    names = _names(units)
    streams = [s for u, n in zip(units, names, strict=True) if (s := u.stream(n)) is not None]
    if not streams:
        raise DataError(f"{path}: no unit has inertial or magnetometer messages")
    arbitrary = {
        name: found.values
        for unit, name in zip(units, names, strict=True)
        if (found := unit.messages.get("Magnetometer")) is not None
    }
    source = {
        "format": "ximu3",
        "place": place_of(path).name,
        "units": {n: _about(u) for n, u in zip(names, units, strict=True)},
        "notes": [note for unit in units for note in unit.notes],
    }
    clock = {"kind": "relative", "found": common_time_notes(streams, str(path), "on one Wi-Fi network")}
    return Recording(streams, {"source": source, CLOCK_KEY: clock, **scale_meta(arbitrary)})


def read_ximu3_orientations(path: str | PathLike[str]) -> dict[str, OrientationStream]:
    """Read the orientations of the vendor's own filter.

    Args:
        path: as for `read_ximu3`.

    Returns:
        Stream name -> orientations, earth_from_sensor, with their own time stamps. The earth's axes are those of the
        unit's setting "AHRS axes convention", north-west-up unless it was changed. Units without are left out.

    Raises:
        DataError: as `read_ximu3`, or the axes of the earth point down.
    """
    units = _units(place_of(path))
    for unit in units:
        if unit.commands.get("ahrsaxesconvention") == 2:
            raise DataError(
                f"{unit.where}: its orientations are in north-east-down axes; Z must point up. "
                "Track the unit's readings instead, or record with north-west-up or east-north-up."
            )
    found = {name: unit.orientations(name) for name, unit in zip(_names(units), units, strict=True)}
    return {name: stream for name, stream in found.items() if stream is not None}


def find_ximu3(listing: Listing) -> list[FileMatch]:
    """Folders of units in one folder are one recording, and so are .ximu3 files of different units in one folder."""
    folders: dict[Path, list[ListedFile]] = {}
    logs: dict[Path, list[ListedFile]] = {}
    for file in listing.files:
        if file.path.stem in COLUMNS and file.lines[:1] == (",".join((TIME, *COLUMNS[file.path.stem])),):
            folders.setdefault(file.path.parent, []).append(file)
        elif file.path.name.lower().endswith(_SUFFIX):
            logs.setdefault(file.path.parent, []).append(file)
    sessions: dict[Path, list[Path]] = {}
    for folder in folders:
        sessions.setdefault(folder.parent if listing.root in folder.parents else folder, []).append(folder)
    found = [
        FileMatch(
            "ximu3",
            place,
            tuple(file for unit in units for file in _read_files(folders[unit], unit)),
            place.name,
            f"x-io x-IMU3, {_count(len(units), 'unit')}, CSV",
        )
        for place, units in sessions.items()
    ]
    return found + [one for folder, files in logs.items() for one in _logged(folder, files)]


def _logged(folder: Path, files: list[ListedFile]) -> list[FileMatch]:
    """Files of different units are taken for one recording; several files of one unit are one each."""
    serials = [_SERIAL.search(file.head) for file in files]
    told = {serial[1] for serial in serials if serial}
    apart = [[file] for file in files] if len(told) < len(files) else [files]
    return [
        FileMatch(
            "ximu3",
            group[0].path if len(group) == 1 else folder,
            tuple(file.path for file in group),
            group[0].path.stem if len(group) == 1 else folder.name,
            f"x-io x-IMU3, {_count(len(group), 'file')} of the data logger",
        )
        for group in apart
    ]


def _read_files(tables: Sequence[ListedFile], folder: Path) -> list[Path]:
    commands = folder / COMMANDS
    return [*(table.path for table in tables), *([commands] if commands.is_file() else [])]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' if number != 1 else ''}"


def _units(place: Path) -> list[Ximu3Unit]:
    if place.is_file():
        return file_units(place)
    if not place.is_dir():
        raise DataError(f"{place}: does not exist")
    if any((place / f"{kind}.csv").is_file() for kind in COLUMNS):
        return [folder_unit(place)]
    inside = sorted(place.iterdir())
    units = [
        folder_unit(folder)
        for folder in inside
        if folder.is_dir() and any((folder / f"{kind}.csv").is_file() for kind in COLUMNS)
    ]
    units += [unit for file in inside if file.name.lower().endswith(_SUFFIX) for unit in file_units(file)]
    if not units:
        raise DataError(
            f"{place}: is no x-IMU3 recording. Give the folder whose folders contain Inertial.csv, or a .ximu3 file."
        )
    return units


def _names(units: Sequence[Ximu3Unit]) -> list[str]:
    return unit_names([u.label for u in units], [u.serial for u in units], [u.where for u in units])


def _about(unit: Ximu3Unit) -> dict[str, object]:
    told = {"device_name": unit.label, "serial": unit.serial}
    time = unit.commands.get("time")
    return {**told, **({"device_time": time} if isinstance(time, str) else {})}
