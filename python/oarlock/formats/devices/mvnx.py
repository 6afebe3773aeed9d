"""Reads MVNX exports of Xsens MVN: orientations of segments and sensors, specific force and magnetic field of sensors.

Frames, elements and axes as in the MVN user manual (MV0319P, sections 14.4 and 19): `orientation` and
`sensorOrientation` take the segment's or sensor's axes to the global ones, whose z points up; `sensorMagneticField` is
in the sensor's axes, in arbitrary units. `sensorFreeAcceleration` is in m/s2, in global axes and without gravity: with
`sensorOrientation` it gives back the specific force that the unit measured, f = R' (a + g up); without, it is left out.
No gyroscope is in a file of today; units of `sensorAcceleration` and `sensorAngularVelocity` of old versions could not
be verified. They are left out, and the recording says so. The tests read files that were made by hand from the manual.
"""

from __future__ import annotations

import re
from os import PathLike

import numpy as np

from oarlock.formats.counters import Lost, lost_packets
from oarlock.formats.devices.exported_table import single_file
from oarlock.formats.devices.mvnx_parser import MvnxContents, parsed_mvnx
from oarlock.formats.devices.unit_readings import UnitReadings, check_quaternions, recording_of, stream_name
from oarlock.formats.listing import FileMatch, Listing
from oarlock.model.rotation import matrix_from_quat
from oarlock.recording.recording import Recording
from oarlock.storage.array_gate import disorder_text
from oarlock.storage.arrays import Floats
from oarlock.storage.epoch import epoch_text
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.units import STANDARD_GRAVITY_M_S2

SENSOR = "_sensor"
"""Ends the names of the streams of a sensor, which has the label of its segment."""
FULL_BODY = (
    *("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head"),
    *(f"Right{part}" for part in ("Shoulder", "UpperArm", "ForeArm", "Hand")),
    *(f"Left{part}" for part in ("Shoulder", "UpperArm", "ForeArm", "Hand")),
    *(f"Right{part}" for part in ("UpperLeg", "LowerLeg", "Foot", "Toe")),
    *(f"Left{part}" for part in ("UpperLeg", "LowerLeg", "Foot", "Toe")),
)
"""Labels of the 23 segments in their fixed order, for exports without labels."""
FREE_ACCELERATION = "sensorFreeAcceleration"
_LEFT_OUT = ("sensorAcceleration", "sensorAngularVelocity")
_ROUNDING_S = 1.01e-3
"""Allowed difference of a time in whole milliseconds and the exact one; the first frame may be rounded, too."""
_WHOLE = re.compile(r"\d{1,15}", re.ASCII)
_START = re.compile(r"<(?:\w+:)?(mvnx|mvn|subject|frames)[\s>]")


def read_mvnx(path: str | PathLike[str]) -> Recording:
    """Read the frames of type "normal" of an MVNX export.

    Args:
        path: the file.

    Returns:
        An `OrientationStream` per segment, named after its label: `RightForeArm` becomes `right_fore_arm`. Streams of
        sensors end in `_sensor`. Time stamps are the frames' index divided by the frame rate if the
        frames' milliseconds agree, else these; ``meta["clock"]`` has the start if stated.

    Raises:
        DataError: no MVNX file, a second subject, or a frame that differs from the first; names file and line.
    """
    found = parsed_mvnx(single_file(place_of(path)).path)
    if not found.lines:
        raise DataError(f'{found.file}: has no frames of type "normal"; it is no MVNX export of a recording')
    time_s, from_index = _times(found)
    lost = _lost(found, time_s)
    units = []
    turns = _turns(found, "orientation")
    if turns is not None:
        labels = _labels(found, found.segments, turns.shape[1], "segment")
        units += [
            UnitReadings(stream_name(label), time_s, quat_wxyz=turns[:, k], lost=lost)
            for k, label in enumerate(labels)
        ]
    units += _sensors(found, time_s, lost)
    if not units:
        raise DataError(
            f"{found.file}: its frames have no orientation. Choose orientation in MVN for the export."
        )
    return recording_of(units, _source(found), _clock(found, from_index), True, _notes(found))


def find_mvnx(listing: Listing) -> list[FileMatch]:
    """The `.mvnx` files of a place, and XML files that begin as such."""
    found = []
    for one in listing.suffixed(".mvnx", ".xml"):
        start = "\n".join(one.lines) or one.head.decode("utf-8", "replace")
        if _START.search(start) and (one.path.suffix.lower() == ".mvnx" or "mvnx" in start):
            found.append(FileMatch("mvnx", one.path, (one.path,), one.path.stem, "Xsens MVN export (MVNX)"))
    return found


def _turns(found: MvnxContents, element: str) -> Floats | None:
    """(T, n, 4) quaternions of an element."""
    turns = found.rows(element)
    if turns is not None:
        for k in range(turns.shape[1]):
            check_quaternions(turns[:, k], found.places())
    return turns


def _sensors(found: MvnxContents, time_s: Floats, lost: Lost | None) -> list[UnitReadings]:
    turns, field = _turns(found, "sensorOrientation"), found.rows("sensorMagneticField")
    free = found.rows(FREE_ACCELERATION) if turns is not None else None
    counts = {rows.shape[1] for rows in (turns, field, free) if rows is not None}
    if not counts:
        return []
    if len(counts) > 1:
        raise DataError(
            f"{found.file}: its sensor elements, such as sensorOrientation, have different numbers of sensors"
        )
    labels = _labels(found, found.sensors, counts.pop(), "sensor")
    return [
        UnitReadings(
            f"{stream_name(label)}{SENSOR}",
            time_s,
            accel_m_s2=None if turns is None or free is None else _specific_force(turns[:, k], free[:, k]),
            mag_arbitrary=None if field is None else field[:, k],
            quat_wxyz=None if turns is None else turns[:, k],
            lost=lost,
        )
        for k, label in enumerate(labels)
    ]


def _specific_force(quat_wxyz: Floats, free_m_s2: Floats) -> Floats:
    """What an accelerometer reads, in its axes, from free acceleration in global axes; their z points up."""
    lifted = free_m_s2 + np.array([0.0, 0.0, STANDARD_GRAVITY_M_S2])
    return np.asarray(np.einsum("tji,tj->ti", matrix_from_quat(quat_wxyz), lifted))


def _labels(found: MvnxContents, labels: list[str], count: int, what: str) -> list[str]:
    if not any(labels):
        return list(FULL_BODY) if what == "segment" and count == len(FULL_BODY) else _numbered(what, count)
    if len(labels) != count or not all(stream_name(label) for label in labels):
        raise DataError(f"{found.file}: names {len(labels)} {what}s, but its frames have {count}")
    return labels


def _numbered(what: str, count: int) -> list[str]:
    return [f"{what}_{k + 1}" for k in range(count)]


def _times(found: MvnxContents) -> tuple[Floats, bool]:
    """Seconds since the start, and whether they are index / rate.

    The milliseconds of the frames are rounded: where they fit, the index divided by the frame rate is exact.
    """
    odd = next((k for k, text in enumerate(found.time) if not _WHOLE.fullmatch(text)), None)
    places = found.places()
    if odd is not None:
        raise DataError(f'{places[odd]}: time is "{found.time[odd]}"; expected whole milliseconds')
    time_s = np.array([int(text) for text in found.time]) / 1e3
    exact_s = _by_index(found)
    by_index = exact_s is not None and bool((np.abs(exact_s - time_s) <= _ROUNDING_S).all())
    stamps = exact_s if by_index and exact_s is not None else time_s
    late = np.flatnonzero(np.diff(stamps) <= 0.0)
    if late.size:
        index = int(late[0]) + 1
        raise DataError(f"{places[index]}: time_s{disorder_text(stamps, index)}")
    return stamps, by_index


def _by_index(found: MvnxContents) -> Floats | None:
    rate = found.subject.get("frameRate", "")
    if not _WHOLE.fullmatch(rate) or int(rate) == 0 or not all(map(_WHOLE.fullmatch, found.index)):
        return None
    return np.array([int(text) for text in found.index]) / float(rate)


def _lost(found: MvnxContents, time_s: Floats) -> Lost | None:
    """Frames that are missing by their index; None if frames have none."""
    if not all(_WHOLE.fullmatch(text) for text in found.index):
        return None
    return lost_packets(np.array([float(text) for text in found.index]), time_s, found.places())


def _clock(found: MvnxContents, from_index: bool) -> dict[str, object]:
    source: dict[str, object] = {"from": "index" if from_index else "time"}
    if not _WHOLE.fullmatch(found.first_ms) or int(found.first_ms) < int(found.time[0]) + 1:
        return {"kind": "relative"} | source
    zero_ns = (int(found.first_ms) - int(found.time[0])) * 10**6
    known: dict[str, object] = {"kind": "relative"}
    if zero_ns < 2**62:
        known = {"kind": "utc", "zero": epoch_text(zero_ns, "utc")}
    return known | source


def _source(found: MvnxContents) -> dict[str, object]:
    said = {"software": found.software, "rate_hz": found.subject.get("frameRate", "")}
    said |= {
        "recorded": found.subject.get("recDate", ""),
        "configuration": found.subject.get("configuration", ""),
    }
    return {
        "format": "mvnx",
        "files": [found.file.name],
        "left_out": list(found.others),
        **{key: value for key, value in said.items() if value},
    }


def _notes(found: MvnxContents) -> list[str]:
    notes = []
    if FREE_ACCELERATION in found.numbers:
        if "sensorOrientation" in found.numbers:
            notes.append(
                "The accelerometers' readings were computed from sensorFreeAcceleration and sensorOrientation; their "
                "gyroscopes are not in the file. To track with gyroscopes, export the units with MT Manager."
            )
        else:
            notes.append(
                "sensorFreeAcceleration was left out: without sensorOrientation it does not give the readings of the "
                "accelerometers. Choose sensor orientation in MVN for the export, too."
            )
    if old := [name for name in _LEFT_OUT if name in found.others]:
        notes.append(f"{' and '.join(old)} were left out: their units are not documented.")
    return notes
