"""Reads x-io NGIMU recordings: the folders of CSV files that the vendor's software writes.

Source: the vendor's software, NgimuApi/Logging and NgimuApi/Data (xioTechnologies/NGIMU-Software-Public on GitHub).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

from oarlock.formats.columns import read_columns
from oarlock.formats.devices.several_units import common_time_notes, unit_names
from oarlock.formats.listing import FileMatch, Listing
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, OrientationStream
from oarlock.storage.array_gate import disorder_text
from oarlock.storage.arrays import Floats
from oarlock.storage.delimited import ColumnLayout, Dialect
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.regular_file import read_text
from oarlock.storage.units import to_held_unit

_SENSORS, _QUATERNION, _DEVICE = "sensors.csv", "quaternion.csv", "Device.xml"
_TIME = "Time (s)"
_COLUMNS = MappingProxyType(
    {
        "gyro_rad_s": ("Gyroscope", "deg/s"),
        "accel_m_s2": ("Accelerometer", "g"),
        "mag_ut": ("Magnetometer", "uT"),
    }
)
_HEADER = ",".join(
    (_TIME, *(f"{word} {axis} ({unit})" for word, unit in _COLUMNS.values() for axis in "XYZ"))
)


@dataclass(frozen=True)
class _NgimuFolder:
    """A folder of a unit, with what its Device.xml says."""

    folder: Path
    label: str
    serial: str
    about: Mapping[str, object]


def read_ngimu(path: str | PathLike[str]) -> Recording:
    """Read gyroscope, accelerometer and magnetometer of NGIMU units.

    Args:
        path: the folder of a session, with a folder for each unit, or the folder of one unit, with sensors.csv.

    Returns:
        One `ImuStream` per unit, named after its device name; with the serial number where names repeat. Time stamps
        are those of the files.

    Raises:
        DataError: a file is damaged, or the units have no common time.
    """
    units = _units(place_of(path))
    streams = [_stream(name, unit.folder / _SENSORS) for name, unit in units.items()]
    about = {name: {"device_name": u.label, "serial": u.serial, **u.about} for name, u in units.items()}
    source = {"format": "ngimu", "place": place_of(path).name, "units": about}
    synchronised = "with the synchronisation master of the vendor's software"
    clock = {"kind": "relative", "found": common_time_notes(streams, str(path), synchronised)}
    return Recording(streams, {"source": source, CLOCK_KEY: clock})


def read_ngimu_orientations(path: str | PathLike[str]) -> dict[str, OrientationStream]:
    """Read the orientations of the vendor's own filter.

    The files contain sensor_from_earth; its inverse is returned.

    Args:
        path: as for `read_ngimu`.

    Returns:
        Stream name -> orientations, earth_from_sensor, X north, Z up, with their own time stamps. Units without are
        left out.

    Raises:
        DataError: as `read_ngimu`.
    """
    found = {}
    for name, unit in _units(place_of(path)).items():
        if (file := unit.folder / _QUATERNION).is_file():
            time_s, quat = _rows(file, ("W", "X", "Y", "Z"))
            found[name] = OrientationStream(name, time_s, quat * [1.0, -1.0, -1.0, -1.0])
    return found


def find_ngimu(listing: Listing) -> list[FileMatch]:
    """The units whose folders are in one folder are one recording."""
    sessions: dict[Path, list[Path]] = {}
    for file in listing.files:
        if file.path.name == _SENSORS and file.lines[:1] and file.lines[0].startswith(_HEADER):
            unit = file.path.parent
            sessions.setdefault(unit.parent if listing.root in unit.parents else unit, []).append(unit)
    return [
        FileMatch(
            "ngimu",
            place,
            tuple(f for u in units for f in (u / _SENSORS, u / _QUATERNION, u / _DEVICE) if f.is_file()),
            place.name,
            f"x-io NGIMU, {len(units)} unit{'s' if len(units) != 1 else ''}, CSV",
        )
        for place, units in sessions.items()
    ]


def _units(place: Path) -> dict[str, _NgimuFolder]:
    if not place.is_dir():
        raise DataError(
            f"{place}: is no folder. Give the folder of the session or of a unit (with {_SENSORS})."
        )
    own = (place / _SENSORS).is_file()
    folders = [place] if own else [f for f in sorted(place.iterdir()) if (f / _SENSORS).is_file()]
    if not folders:
        raise DataError(f"{place}: neither it nor a folder in it has {_SENSORS}; it is no NGIMU recording")
    units = [_unit(folder) for folder in folders]
    names = unit_names([u.label for u in units], [u.serial for u in units], [str(u.folder) for u in units])
    return dict(zip(names, units, strict=True))


def _unit(folder: Path) -> _NgimuFolder:
    """Device.xml names the unit; without it the folder does, which the software calls "NAME - SERIAL"."""
    name, _, serial = folder.name.rpartition(" - ")
    file = folder / _DEVICE
    if not file.is_file():
        return _NgimuFolder(folder, name or folder.name, serial if name else "", {})
    try:
        root = ElementTree.fromstring(read_text(file, "utf-8-sig"))
    except (ValueError, ElementTree.ParseError) as error:
        raise DataError(f"{file}: is not XML ({error})") from error
    device, stamps = root.find("DeviceInformation"), root.find("TimeStamps")
    told = {} if device is None else device.attrib
    first = None if stamps is None else stamps.get("First")
    about = {"device_time": first} if first else {}
    return _NgimuFolder(folder, told.get("DeviceName") or name, told.get("SerialNumber") or serial, about)


def _stream(name: str, file: Path) -> ImuStream:
    columns = [f"{word} {axis} ({unit})" for word, unit in _COLUMNS.values() for axis in "XYZ"]
    time_s, values = _rows(file, columns)
    fields = {
        field: to_held_unit(values[:, 3 * k : 3 * k + 3], unit)
        for k, (field, (_, unit)) in enumerate(_COLUMNS.items())
    }
    return ImuStream(name, time_s, **fields)


def _rows(file: Path, columns: list[str] | tuple[str, ...]) -> tuple[Floats, Floats]:
    if file.stat().st_size == 0:
        raise DataError(f"{file}: is empty; its header is missing")
    rows = read_columns(ColumnLayout.of(file, Dialect()), (_TIME, *columns))
    time_s = rows[:, 0]
    late = (time_s[1:] <= time_s[:-1]).nonzero()[0]
    if late.size:
        raise DataError(
            f'{file}, column "{_TIME}", row {late[0] + 2} after the header: {disorder_text(time_s, int(late[0]) + 1)}'
        )
    return time_s, rows[:, 1:]
