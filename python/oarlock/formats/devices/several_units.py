"""Names and common time of several units of one recording, for the readers of makers that write a folder a unit."""

from __future__ import annotations

from collections.abc import Sequence

from oarlock.recording.streams import Stream
from oarlock.storage.errors import DataError

_TOGETHER_S = 1.0


def unit_names(labels: Sequence[str], serials: Sequence[str], places: Sequence[str]) -> list[str]:
    """Names for streams: device names in lower case with "_" for spaces; with the serial number where they repeat.

    Args:
        labels: device names.
        serials: serial numbers; empty where they are not known.
        places: folder or file of each unit, for the error.

    Raises:
        DataError: two units have the same device name and the same serial number.
    """
    plain = ["_".join(label.lower().split()) or "unit" for label in labels]
    names = [
        name if plain.count(name) == 1 else f"{name}_{serial.lower()}"
        for name, serial in zip(plain, serials, strict=True)
    ]
    for index, name in enumerate(names):
        if (first := names.index(name)) != index:
            raise DataError(
                f'{places[first]} and {places[index]}: both are of a unit "{name}". Import them separately.'
            )
    return names


def common_time_notes(streams: Sequence[Stream], place: str, synchronised: str) -> list[str]:
    """One sentence on whether the units share a time base, by the stamps of their first readings; none for one unit.

    Args:
        streams: one for each unit.
        place: of the recording, for the error.
        synchronised: when units of this maker share a time base, such as "on one Wi-Fi network".

    Raises:
        DataError: a unit starts after another one has ended.
    """
    starts, ends = [float(s.time_s[0]) for s in streams], [float(s.time_s[-1]) for s in streams]
    if max(starts) > min(ends):
        late, early = streams[starts.index(max(starts))].name, streams[ends.index(min(ends))].name
        raise DataError(
            f'{place}: "{late}" starts {max(starts) - min(ends):.1f} s after "{early}" ends: their clocks were not '
            "synchronised, or they are different recordings. Import each unit alone."
        )
    if len(streams) < 2:
        return []
    apart_s = max(starts) - min(starts)
    if apart_s <= _TOGETHER_S:
        return [
            f"The units share one time base, as they do {synchronised}: their first readings are within "
            f"{1e3 * apart_s:.0f} ms."
        ]
    return [
        f"The first readings of the units are {apart_s:.1f} s apart. They share a time base only {synchronised}: "
        "if that was not so, run `oarlock calibrate clocks`."
    ]
