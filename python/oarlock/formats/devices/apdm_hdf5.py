"""Reads the HDF5 files of APDM's Mobility Lab and Moveo, for `devices.apdm`, with h5py in a child process.

No file could be shipped or tried. The layout is that of published readers of such files (scikit-digital-health of
Pfizer, ``skdh.io.ReadApdmH5``; DAMVi_App): ``/Sensors/ID`` with ``Time`` in microseconds since 1970, ``Accelerometer``,
``Gyroscope``, ``Magnetometer`` and the attribute ``Label 0`` of ``Configuration``; ``/Processed/ID/Orientation``. Older
files, with ``/ID/Calibrated``, are refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from oarlock.formats.child_process import arrays_of
from oarlock.formats.devices.several_units import unit_names
from oarlock.formats.times import Stamps, on_one_axis
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.units import plain_unit

MAGIC = b"\x89HDF\r\n\x1a\n"
_FIELDS = MappingProxyType(
    {
        "Gyroscope": ("gyro_rad_s", ("rad/s",)),
        "Accelerometer": ("accel_m_s2", ("m/s2",)),
        "Magnetometer": ("mag_ut", ("uT", "microtesla", "microteslas")),
    }
)
_NEWEST_US = 2**62 // 1000


def hdf5_recording(file: Path) -> Recording:
    """Gyroscope, accelerometer and magnetometer of each sensor, named after its label.

    Raises:
        DataError: h5py is not installed, or the file is damaged or has another layout.
    """
    content = _content(file)
    sensors = _sensors(file, content)
    axes = [_stamps(file, f"Sensors/{number}/Time", content) for number in sensors.values()]
    times, clock = on_one_axis(axes, list(sensors))
    streams = []
    for (name, number), time_s in zip(sensors.items(), times, strict=True):
        fields = {
            field: values
            for kind, (field, units) in _FIELDS.items()
            if (values := _rows(file, f"Sensors/{number}/{kind}", 3, len(time_s), content, units)) is not None
        }
        if fields:
            streams.append(ImuStream(name, time_s, **fields))
    if not streams:
        raise DataError(f"{file}: no sensor has Gyroscope, Accelerometer or Magnetometer")
    version = {"version": str(content["@FileFormatVersion"])} if "@FileFormatVersion" in content else {}
    source = {"format": "apdm", "file": file.name, "layout": "HDF5", **version, "sensors": sensors}
    return Recording(streams, {"source": source, CLOCK_KEY: clock})


def hdf5_orientations(file: Path) -> dict[str, Floats]:
    """Stream name -> (T, 4) quat_wxyz, earth_from_sensor, for the sensors that have it, by the rows of its stream.

    Raises:
        DataError: as `hdf5_recording`.
    """
    content = _content(file)
    found = {}
    for name, number in _sensors(file, content).items():
        count = len(_stamps(file, f"Sensors/{number}/Time", content).nanoseconds)
        rows = _rows(file, f"Processed/{number}/Orientation", 4, count, content, ())
        if rows is not None:
            found[name] = rows
    return found


def _content(file: Path) -> Mapping[str, NDArray[np.generic]]:
    if find_spec("h5py") is None:
        raise DataError(f"{file}: HDF5 files are read with h5py: pip install 'oarlock[hdf5]'")
    return arrays_of("hdf5", file)


def _sensors(file: Path, content: Mapping[str, NDArray[np.generic]]) -> dict[str, str]:
    """Number of each sensor by the name of its stream."""
    numbers = list(dict.fromkeys(_numbers(content)))
    if not numbers:
        old = any("/Calibrated/" in path for path in content)
        raise DataError(
            f"{file}: has no sensors below /Sensors; "
            + (
                "it has the older layout of APDM's Motion Studio. Export it as CSV."
                if old
                else "it is no file of APDM's."
            )
        )
    labels = [str(content.get(f"Sensors/{n}/Configuration@Label 0", "")).strip("\0 ") or n for n in numbers]
    return dict(
        zip(unit_names(labels, numbers, [f"{file}, sensor {n}" for n in numbers]), numbers, strict=True)
    )


def _numbers(content: Mapping[str, NDArray[np.generic]]) -> Iterator[str]:
    for path in content:
        group, _, rest = path.partition("/")
        number, _, name = rest.partition("/")
        if group == "Sensors" and name == "Time":
            yield number


def _stamps(file: Path, path: str, content: Mapping[str, NDArray[np.generic]]) -> Stamps:
    time_us = content[path]
    if time_us.ndim != 1 or time_us.dtype.kind not in "iu" or not time_us.size:
        raise DataError(
            f"{file}, /{path}: expected a row of whole microseconds since 1970, got {_shape(time_us)}"
        )
    if int(time_us.min()) < 0 or int(time_us.max()) > _NEWEST_US:
        raise DataError(f"{file}, /{path}: {int(time_us.max())} us is no time since 1970")
    return Stamps("utc", np.zeros(0), time_us.astype(np.int64) * 1000)


def _rows(
    file: Path,
    path: str,
    width: int,
    count: int,
    content: Mapping[str, NDArray[np.generic]],
    units: tuple[str, ...],
) -> Floats | None:
    found = content.get(path)
    if found is None:
        return None
    if found.shape != (count, width):
        raise DataError(f"{file}, /{path}: expected {count} rows of {width}, got {_shape(found)}")
    unit = str(content.get(f"{path}@Units", "")).strip("\0 ")
    if units and unit and plain_unit(unit) not in units:
        raise DataError(f'{file}, /{path}: the unit is "{unit}", expected {units[0]}')
    return found.astype(np.float64)


def _shape(found: NDArray[np.generic]) -> str:
    return f"{found.dtype} of the shape {found.shape}"
