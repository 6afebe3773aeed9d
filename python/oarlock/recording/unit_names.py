"""Which inertial unit sits where: names and device ids in files matched with the sensors of a model.

`assign_units` compares body segments and sides, in the spellings of makers and of anatomy. What is not clear is an
error that lists the choices.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from types import MappingProxyType

from oarlock.recording.epoch import PACKETS_KEY
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable

UNITS_FILE = "units.toml"
_SEGMENTS: Mapping[str, str] = MappingProxyType(
    {
        "head": "head|skull|forehead",
        "thorax": "thorax|chest|sternum|upper back|upper spine|upper trunk|spine 3|spine 2",
        "lumbar": "lumbar|lower back|lower spine|lower trunk|abdomen|spine 1",
        "pelvis": "pelvis|hips?|sacrum|waist",
        "trunk": "trunk|torso|back|spine",
        "shoulder": "shoulder|clavicle|scapula",
        "upper_arm": "upper arm|upperarm|humerus|uarm|up arm",
        "forearm": "fore arm|forearm|lower arm|lowerarm|low arm|radius|ulna|larm|wrist",
        "hand": "hand|carpus|palm",
        "thigh": "thigh|upper leg|upperleg|up leg|femur",
        "shank": "shank|lower leg|lowerleg|low leg|tibia|calf",
        "foot": "foot|feet|calcn|shoe|instep",
        # Makers whose upper arm is "Arm" and whose shank is "Leg"; longer names above come first.
        "arm": "arm",
        "leg": "leg",
    }
)
_SHORT_SEGMENTS = MappingProxyType(
    {
        "ua": "upper_arm",
        "la": "forearm",
        "fa": "forearm",
        "h": "hand",
        "ul": "thigh",
        "th": "thigh",
        "ll": "shank",
        "sh": "shank",
        "f": "foot",
        "ft": "foot",
    }
)
_VERTEBRAE = MappingProxyType({"c": "thorax", "t": "thorax", "l": "lumbar", "s": "pelvis"})
_ALSO = MappingProxyType(
    {"arm": ("upper_arm",), "leg": ("shank",), "trunk": ("thorax",), "thorax": ("trunk",)}
)
"""Segments that a name may mean if the model has none of its own."""
_SIDES = MappingProxyType({"r": "r", "rt": "r", "right": "r", "l": "l", "lt": "l", "left": "l"})


@dataclass(frozen=True)
class SegmentSide:
    """Segment and side that a name means; empty if it says none."""

    segment: str
    side: str


@dataclass(frozen=True)
class Assignment:
    """Streams of a recording matched with sensors of a model.

    Args:
        units: sensor -> stream.
        reasons: sensor -> why.
        unused: streams that no sensor has.
        free: sensors that no stream has.
    """

    units: Mapping[str, str]
    reasons: Mapping[str, str]
    unused: tuple[str, ...] = ()
    free: tuple[str, ...] = field(default=())

    def renamed(self, recording: Recording) -> Recording:
        """The recording with its streams named as the sensors, and their orientations with them; others keep theirs."""
        names = {stream: sensor for sensor, stream in self.units.items()}
        for stream, owner in _orientations(recording).items():
            if owner in names:
                names[stream] = names[owner] + stream.removeprefix(owner)
        return renamed(recording, names)


def place_of_name(name: str) -> SegmentSide:
    """Segment and side in a name such as "r_forearm", "RightForeArm", "LLA" or "Right Upper Leg 64F61C2E"."""
    words = _words(name)
    if vertebra := re.search(r"(?<![a-z0-9])([ctls]) \d(?!\d)", " ".join(words)):
        return SegmentSide(_VERTEBRAE[vertebra[1]], "")
    sides = [_SIDES[word] for word in words if word in _SIDES]
    side = sides[0] if len(set(sides)) == 1 else ""
    rest = " ".join(word for word in words if word not in _SIDES)
    for segment, spellings in _SEGMENTS.items():
        if re.search(rf"(?<![a-z0-9])(?:{spellings})(?![a-z])", rest):
            return SegmentSide(segment, side)
    for word in words:
        short = re.fullmatch(rf"([rl])({'|'.join(_SHORT_SEGMENTS)})", word)
        if short:
            return SegmentSide(_SHORT_SEGMENTS[short[2]], short[1])
    return SegmentSide("", side)


def assign_units(
    sensors: Sequence[str],
    streams: Sequence[str],
    by_hand: Mapping[str, str] | None = None,
    ids: Mapping[str, str] | None = None,
) -> Assignment:
    """Match the streams of a recording with the sensors of a model.

    Args:
        sensors: names of the model's inertial units, such as `Model.describe().inertial_units` has.
        streams: names in the recording.
        by_hand: sensor -> stream, or a part of its name such as a device's id. It comes before all others.
        ids: device's id -> segment or sensor, as `units.toml` has it.

    Returns:
        The assignment. Streams and sensors without a partner are listed in it: a model may have more sensors.

    Raises:
        DataError: a name given by hand does not exist, two streams mean the same sensor, or a stream without a side
            could be left or right. The text lists the choices.
    """
    units: dict[str, str] = {}
    reasons: dict[str, str] = {}
    for sensor, part in (by_hand or {}).items():
        stream = _stream_with(part, streams)
        _known(sensor, sensors)
        _take(units, reasons, sensor, stream, "by hand")
    for stream in (name for name in streams if name not in units.values()):
        found, reason = _sensor_of(stream, [s for s in sensors if s not in (by_hand or {})], ids or {})
        if found:
            _take(units, reasons, found, stream, reason)
    ordered = {sensor: units[sensor] for sensor in sensors if sensor in units}
    return Assignment(
        ordered,
        {sensor: reasons[sensor] for sensor in ordered},
        tuple(name for name in streams if name not in units.values()),
        tuple(name for name in sensors if name not in units),
    )


def parsed_units(texts: Iterable[str] | None) -> dict[str, str] | Path | None:
    """`["thorax=00B421E6,pelvis=00B421ED"]` as sensor -> unit, `["units.toml"]` as a file; None without a text.

    Raises:
        DataError: a part has no "=", or a sensor is given twice.
    """
    texts = list(texts or ())
    if len(texts) < 2 and all(text.endswith(".toml") for text in texts):
        return Path(texts[0]) if texts else None
    units: dict[str, str] = {}
    for part in (part.strip() for text in texts for part in text.split(",")):
        sensor, equals, unit = (piece.strip() for piece in part.partition("="))
        if not (sensor and equals and unit):
            raise DataError(
                f'--units "{part}": expected SENSOR=UNIT, such as thorax=00B421E6, or one units.toml'
            )
        if sensor in units:
            raise DataError(f'--units: the sensor "{sensor}" is given twice')
        units[sensor] = unit
    return units


def units_of(
    units: Mapping[str, str] | str | PathLike[str] | None, place: Path | None = None
) -> tuple[dict[str, str], dict[str, str]]:
    """An assignment as sensor -> unit and as device's id -> segment or sensor, one of them empty.

    Args:
        units: sensor -> unit, or a units.toml; None: that beside `place`, if there is one.
        place: file or folder of the recording.

    Raises:
        DataError: the file cannot be read.
    """
    if isinstance(units, Mapping):
        return dict(units), {}
    if units is None and place is not None:
        beside = (place if place.is_dir() else place.parent) / UNITS_FILE
        units = beside if beside.is_file() else None
    return {}, {} if units is None else read_units_file(Path(units))


def read_units_file(file: Path) -> dict[str, str]:
    """Device's id -> segment or sensor: the keys and texts of a `units.toml`, at its top or in a table [units].

    Raises:
        DataError: the file is no TOML, or a value is no text.
    """
    top = TomlTable.read(file)
    table = top.table("units") if "units" in top.values else top
    return {key: table.string(key) for key in table.values}


def renamed(recording: Recording, names: Mapping[str, str]) -> Recording:
    """The recording with other names of streams.

    Args:
        recording: a recording.
        names: old name -> new name.

    Raises:
        DataError: there is no stream of an old name, or two streams would have one name.
    """
    for name in names:
        recording.sensor(name)
    streams = [replace(stream, name=names.get(stream.name, stream.name)) for stream in recording.streams]
    meta = {
        key: _renamed_keys(value, names) if key in _BY_STREAM else value
        for key, value in recording.meta.items()
    }
    return Recording(streams, meta)


_BY_STREAM = (PACKETS_KEY, "mag_scale")
"""Entries of `Recording.meta` by name of stream."""


def _orientations(recording: Recording) -> dict[str, str]:
    """Orientation streams beside the inertial unit that computed them, whose name theirs begins with."""
    units = [stream.name for stream in recording.streams if stream.kind == "imu"]
    return {
        stream.name: max(owners, key=len)
        for stream in recording.streams
        if stream.kind == "orientation" and (owners := [u for u in units if stream.name.startswith(u)])
    }


def _renamed_keys(entry: object, names: Mapping[str, str]) -> object:
    if not isinstance(entry, Mapping):
        return entry
    return {names.get(key, key): value for key, value in entry.items()}


def _sensor_of(stream: str, sensors: Sequence[str], ids: Mapping[str, str]) -> tuple[str, str]:
    """The sensor that a stream means and the reason; empty texts if it means none."""
    if stream in sensors:
        return stream, "same name"
    # A whole name comes first: "sensor1" is also a part of "sensor10".
    for unit_id, meaning in [(stream, ids[stream])] if stream in ids else ids.items():
        if unit_id.casefold() in stream.casefold():
            if meaning in sensors:
                return meaning, f"id {unit_id}"
            found = _by_place(stream, place_of_name(meaning), sensors)
            return found, f'id {unit_id} is "{meaning}"' if found else ""
    place = place_of_name(stream)
    found = _by_place(stream, place, sensors)
    return found, f"{_words_of(place)} in its name" if found else ""


def _by_place(stream: str, place: SegmentSide, sensors: Sequence[str]) -> str:
    if not place.segment:
        return ""
    places = {sensor: place_of_name(sensor) for sensor in sensors}
    for segment in (place.segment, *_ALSO.get(place.segment, ())):
        there = [sensor for sensor, own in places.items() if own.segment == segment]
        fits = [
            sensor for sensor in there if place.side in ("", places[sensor].side) or not places[sensor].side
        ]
        if len(fits) == 1:
            return fits[0]
        if len(fits) > 1:
            choices = " or ".join(f"--units {sensor}={stream}" for sensor in fits)
            raise DataError(
                f'stream "{stream}": its name says {_words_of(place)}, which several sensors may be. Give {choices}.'
            )
    return ""


def _words_of(place: SegmentSide) -> str:
    side = {"r": "right ", "l": "left "}.get(place.side, "")
    return f'"{side}{place.segment.replace("_", " ")}"'


def _stream_with(part: str, streams: Sequence[str]) -> str:
    if part in streams:
        return part
    found = [name for name in streams if part.casefold() in name.casefold()]
    if len(found) == 1:
        return found[0]
    if found:
        raise DataError(
            f'--units: several streams contain "{part}": {", ".join(found)}. Give the whole name.'
        )
    raise DataError(f'--units: no stream contains "{part}". {did_you_mean(part, streams)}')


def _known(sensor: str, sensors: Sequence[str]) -> None:
    if sensor not in sensors:
        raise DataError(
            f'--units: the model has no inertial unit "{sensor}". {did_you_mean(sensor, sensors)}'
        )


def _take(units: dict[str, str], reasons: dict[str, str], sensor: str, stream: str, reason: str) -> None:
    if sensor in units:
        raise DataError(
            f'streams "{units[sensor]}" ({reasons[sensor]}) and "{stream}" ({reason}) both mean the sensor "{sensor}". '
            f"Give --units {sensor}={stream} or --units {sensor}={units[sensor]}."
        )
    if stream in units.values():
        raise DataError(f'--units: the stream "{stream}" is given to two sensors')
    units[sensor], reasons[sensor] = stream, reason


def _words(name: str) -> list[str]:
    """Words in small letters: separators, capitals and digits divide; ids of devices are left out."""
    kept = [
        word for word in re.findall(r"[^\W_]+", name) if not re.fullmatch(r"(?=.*\d)[0-9A-Fa-f]{6,}", word)
    ]
    parts = (part for word in kept for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", word))
    return [part.lower() for part in parts]


def with_unit_names(
    recording: Recording,
    sensors: Sequence[str] | None = None,
    by_hand: Mapping[str, str] | None = None,
    ids: Mapping[str, str] | None = None,
) -> tuple[Recording, Assignment]:
    """The recording with its inertial units named as the sensors of a model, and the assignment.

    Args:
        recording: a recording.
        sensors: names of the model's inertial units; None: the names of `by_hand` and `ids` are used as they are.
        by_hand: sensor -> stream, or a part of its name.
        ids: device's id -> segment or sensor.

    Raises:
        DataError: as `assign_units`, or no stream could be matched.
    """
    owned = _orientations(recording)
    streams = [s.name for s in recording.streams if s.kind in ("imu", "orientation") and s.name not in owned]
    hand, known = dict(by_hand or {}), dict(ids or {})
    wanted = list(dict.fromkeys([*hand, *known.values()])) if sensors is None else list(sensors)
    found = assign_units(wanted, streams, hand, known)
    if sensors is not None and not found.units:
        raise DataError(
            f"no stream ({', '.join(streams) or 'none is inertial'}) has the name of a sensor of the model "
            f"({', '.join(wanted)}). Say which is which: --units {wanted[0] if wanted else 'SENSOR'}="
            f"{streams[0] if streams else 'STREAM'},... or a units.toml with id = segment, or let "
            "`oarlock calibrate units` find it from movements."
        )
    return found.renamed(recording), found
