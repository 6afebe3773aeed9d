"""Reads the analogue channels of C3D files: inertial units of wireless EMG systems beside a camera system, and others.

Source: The C3D File Format, a technical user guide (Motion Lab Systems 2021), parameter section ANALOG. Labels are the
choice of each laboratory ("ACCX1", "L_TA: GYRO.X"): what an inertial unit is, label and unit together decide.
"""

from __future__ import annotations

from importlib.util import find_spec
from os import PathLike

import numpy as np

from oarlock.formats.arbitrary_units import scale_meta
from oarlock.formats.child_process import arrays_of
from oarlock.formats.labelled_channels import inertial_fields, inertial_triples
from oarlock.formats.listing import FileMatch, Listing
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, Stream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.names import LONGEST_NAME, numbered
from oarlock.storage.paths import place_of

_SIGNATURE = b"\x50"


def read_c3d(path: str | PathLike[str]) -> Recording:
    """Read the analogue channels of a C3D file.

    Args:
        path: the file.

    Returns:
        One `ImuStream` for each inertial unit whose channels have labels such as "ACCX1" and a unit of measurement.
        Every other channel is a `ScalarStream` of its label. Time stamps are those of the trial: a cut file keeps its
        time. Markers are not imported; see `oarlock.markers.load_markers`.

    Raises:
        DataError: ezc3d is not installed, or the file cannot be read or has no analogue channels.
    """
    file = place_of(path)
    if find_spec("ezc3d") is None:
        raise DataError(f"{file}: C3D files are read with ezc3d: pip install 'oarlock[c3d]'")
    content = arrays_of("c3d_analogue", file)
    values, rate_hz = content["channels"].T, float(content["rate_hz"])
    if not values.size:
        raise DataError(
            f"{file}: has no analogue channels. Its markers are read by `oarlock markers show` and "
            "`oarlock evaluate TRACK FILE`."
        )
    if not rate_hz > 0.0:
        raise DataError(f"{file}: the rate of its analogue channels is {rate_hz:g} Hz (ANALOG:RATE)")
    time_s = float(content["start_s"]) + np.arange(len(values)) / rate_hz
    labels = _padded(content["labels"], values.shape[1])
    units = _padded(content["units"], values.shape[1])
    triples, notes = inertial_triples(labels, units)
    streams: list[Stream] = []
    scales: dict[str, Floats] = {}
    for unit in dict.fromkeys(triple.unit for triple in triples):
        name = f"imu_{unit}" if not unit or unit.isdigit() else unit
        name = name.rstrip("_")[:LONGEST_NAME]
        fields, arbitrary, said = inertial_fields([t for t in triples if t.unit == unit], values, name)
        notes += said
        scales |= {} if arbitrary is None else {name: arbitrary}
        streams += [ImuStream(name, time_s, **fields)] if fields else []
    if not streams:
        notes.append(
            'No inertial unit was found: that needs channels with labels such as "ACCX1" and a unit. '
            "All channels are kept as plain numbers."
        )
    taken = {place for triple in triples for place in triple.places}
    names = _distinct(labels, [stream.name for stream in streams])
    streams += [ScalarStream(names[k], time_s, values[:, k]) for k in range(len(names)) if k not in taken]
    measured_in = {name: unit for name, unit in zip(names, units, strict=True) if unit}
    source = {"format": "c3d", "file": file.name, "units": measured_in, "notes": notes}
    return Recording(streams, {"source": source, CLOCK_KEY: {"kind": "relative"}, **scale_meta(scales)})


def find_c3d(listing: Listing) -> list[FileMatch]:
    """Each C3D file is a recording."""
    return [
        FileMatch("c3d", file.path, (file.path,), file.path.stem, "C3D, analogue channels")
        for file in listing.suffixed(".c3d")
        if file.head[1:2] == _SIGNATURE
    ]


def _padded(texts: np.ndarray, count: int) -> list[str]:
    found = [str(text) for text in texts[:count]]
    return found + [""] * (count - len(found))


def _distinct(labels: list[str], taken: list[str]) -> list[str]:
    """Names for the channels: their labels, the second and later ones of each with a number."""
    plain = (
        "_".join(label.split())[: LONGEST_NAME - 6] or f"channel_{place}"
        for place, label in enumerate(labels, 1)
    )
    return numbered(plain, taken=taken)
