"""Joins recordings of single units, such as a table of text for each, into one recording of all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from oarlock.recording.epoch import CLOCK_KEY, PACKETS_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import Stream
from oarlock.storage.epoch import apart_s
from oarlock.storage.errors import DataError


def joined(parts: Sequence[tuple[str, Recording]]) -> Recording:
    """One recording of several that were measured at the same time.

    Where all parts tell date or time of day, their stamps are brought to one zero; else they are left as they are, and
    a note says so.

    Args:
        parts: name of each, such as that of its file, and the recording. The only inertial unit of a part takes the
            part's name; other names that repeat are put behind it.

    Raises:
        DataError: parts do not overlap in time, or two have the same name.
    """
    twice = [name for name, count in Counter(_plain(name) for name, _ in parts).items() if count > 1]
    if twice:
        raise DataError(f'two of the recordings are called "{twice[0]}": rename a file')
    late_s, is_known = _late_s(parts)
    often = Counter(stream.name for _, part in parts for stream in part.streams)
    streams, notes = [], []
    for (name, part), late in zip(parts, late_s, strict=True):
        told = part.meta.get("source")
        known = told.get("notes", ()) if isinstance(told, Mapping) else ()
        notes += [f"{_plain(name)}: {note}" for note in known if isinstance(note, str)]
        units = [stream for stream in part.streams if stream.kind == "imu"]
        for stream in part.streams:
            own = _plain(name) if units == [stream] else stream.name
            if units != [stream] and often[stream.name] > 1:
                own = f"{_plain(name)}_{stream.name}"
            streams.append(_moved(stream, own, late))
    _check_overlap(streams)
    if not is_known:
        notes.append(
            "The files do not tell the time of day, so their stamps were taken as they are. If each unit counts its "
            "own time, run `oarlock calibrate clocks`."
        )
    first = parts[0][1].meta
    packets: dict[str, object] = {}
    for (name, part), late in zip(parts, late_s, strict=True):
        packets |= _packets(_plain(name), part, late)
    meta: dict[str, object] = {"source": {"format": "together", "notes": notes}}
    if CLOCK_KEY in first:
        meta[CLOCK_KEY] = first[CLOCK_KEY]
    return Recording(streams, {**meta, **({PACKETS_KEY: packets} if packets else {})})


def _late_s(parts: Sequence[tuple[str, Recording]]) -> tuple[list[float], bool]:
    """How much later than the first each part's zero is, s; and whether the parts say so."""
    apart = [apart_s(part.epoch, parts[0][1].epoch) for _, part in parts]
    known = [late for late in apart if late is not None]
    return (known, True) if len(known) == len(parts) else ([0.0] * len(parts), False)


def _moved(stream: Stream, name: str, late_s: float) -> Stream:
    return replace(stream, name=name, time_s=stream.time_s + late_s) if late_s else replace(stream, name=name)


def _check_overlap(streams: Sequence[Stream]) -> None:
    last = max(streams, key=lambda s: s.time_s[0])
    first = min(streams, key=lambda s: s.time_s[-1])
    gap_s = float(last.time_s[0] - first.time_s[-1])
    if gap_s > 0.0:
        raise DataError(
            f'"{last.name}" begins {gap_s:.1f} s after "{first.name}" ends: they were not measured together. '
            "Import them separately with --all"
        )


def _packets(name: str, part: Recording, late_s: float) -> dict[str, object]:
    """Counted packets of the only inertial unit of a part, under its new name."""
    counted = part.meta.get(PACKETS_KEY)
    units = [stream.name for stream in part.streams if stream.kind == "imu"]
    entry = counted.get(units[0]) if isinstance(counted, Mapping) and len(units) == 1 else None
    if not isinstance(entry, Mapping):
        return {}
    after = entry.get("after_s", ())
    return {name: {**entry, "after_s": [t + late_s for t in after]}}


def _plain(name: str) -> str:
    return "_".join(name.lower().replace("-", "_").split()) or "unit"
