"""Time stamps of two tracks from one zero, by their epochs. Used by `evaluate` and by reports with ground truth."""

from __future__ import annotations

from dataclasses import replace

from oarlock.storage.epoch import apart_s
from oarlock.tracking.track import Track


def on_clock_of(track: Track, other: Track) -> Track:
    """The other track with time stamps from the zero of `track`, if both know their epochs; else as it is."""
    later_s = apart_s(other.epoch, track.epoch)
    if not later_s:
        return other
    beliefs = other.beliefs
    return replace(
        other,
        time_s=other.time_s + later_s,
        beliefs=None if beliefs is None else replace(beliefs, time_s=beliefs.time_s + later_s),
        provenance={**other.provenance, "epoch": track.epoch},
    )
