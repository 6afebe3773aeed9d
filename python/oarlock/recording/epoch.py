"""Stamps in seconds since 1970, as older folders have them: shifted to start at 0, the epoch kept in `meta`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from oarlock.recording.streams import Stream
from oarlock.storage.epoch import epoch_of_stamps, moment_text, shifted_text

CLOCK_KEY = "clock"
"""`Recording.meta[CLOCK_KEY]` describes the time stamps: `kind`, `zero` (the epoch), `shifted_s`, `found`."""
PACKETS_KEY = "packets"
"""`Recording.meta[PACKETS_KEY]` has the packets counted by the devices; see `recording.packets`."""


def epoch_of(meta: Mapping[str, object]) -> str | None:
    """The moment of `time_s` = 0 as ISO text; None if it is not known."""
    clock = meta.get(CLOCK_KEY)
    zero = clock.get("zero") if isinstance(clock, Mapping) else None
    return zero if isinstance(zero, str) and moment_text(zero) else None


def from_zero(
    streams: Sequence[Stream], meta: Mapping[str, object]
) -> tuple[Sequence[Stream], Mapping[str, object]]:
    """Streams and `meta` with the earliest time stamp at 0 s, if all stamps are seconds between 1990 and 2100.

    Others are not changed. The differences between float64 stamps of this size are exact, so nothing is rounded.
    """
    known = [s for s in streams if len(s)]
    if not known or epoch_of(meta) is not None:
        return streams, meta
    zero_s = min(float(s.time_s[0]) for s in known)
    zero = epoch_of_stamps(zero_s, max(float(s.time_s[-1]) for s in known))
    if zero is None:
        return streams, meta
    moved = [s.at_rows(slice(None), s.time_s - zero_s) for s in streams]
    clock = meta.get(CLOCK_KEY)
    told = dict(clock) if isinstance(clock, Mapping) else {}
    told |= {"kind": "utc", "zero": zero, "shifted_s": zero_s}
    return moved, {**meta, **_packets_from(meta, zero_s), CLOCK_KEY: told}


def shift_notes(meta: Mapping[str, object]) -> tuple[str, ...]:
    """One sentence if the stamps were shifted."""
    clock = meta.get(CLOCK_KEY)
    if not isinstance(clock, Mapping) or "shifted_s" not in clock:
        return ()
    return (shifted_text(epoch_of(meta)),)


def clock_notes(meta: Mapping[str, object]) -> tuple[str, ...]:
    """What a reader recognised in the time stamps, and whether they were shifted; one sentence each."""
    clock = meta.get(CLOCK_KEY)
    found = clock.get("found") if isinstance(clock, Mapping) else None
    sentences = found if isinstance(found, list | tuple) else ()
    return (*(text for text in sentences if isinstance(text, str)), *shift_notes(meta))


def _packets_from(meta: Mapping[str, object], zero_s: float) -> dict[str, object]:
    """Counted packets with shifted time stamps."""
    packets = meta.get(PACKETS_KEY)
    if not isinstance(packets, Mapping):
        return {}
    return {PACKETS_KEY: {name: _moved(entry, zero_s) for name, entry in packets.items()}}


def _moved(entry: object, zero_s: float) -> object:
    after_s = entry.get("after_s") if isinstance(entry, Mapping) else None
    if not isinstance(entry, Mapping) or not isinstance(after_s, list | tuple):
        return entry
    return {**entry, "after_s": [t - zero_s if isinstance(t, int | float) else t for t in after_s]}
