"""Groups streams that share a clock and selects the reference clock for `calibrate_clocks`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import Clock
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.errors import DataError

_SAME_SHARE = 0.9
"""Different clocks never give identical stamps; a stream that lost packets still shares most of its stamps."""
_AGREE_S, _AGREE_DRIFT = 0.002, 1e-5
_AGREE_STDS = 2.0
_SURE_DRIFT = 5e-5
"""A larger standard deviation makes no two clocks agree: the estimate corrects better than another clock's stamps."""


def same_stamps(one: Stream, other: Stream) -> bool:
    """True if nearly all time stamps of the shorter stream also occur in the other stream, exactly."""
    short, long = sorted((one.time_s, other.time_s), key=len)
    return float(np.mean(np.isin(short, long))) > _SAME_SHARE


def reference_streams(recording: Recording, asked: Iterable[str] | None) -> tuple[str, ...]:
    """Names of the streams that keep true time; none if that has to be found from what the clocks agree on.

    Without a wish these are the most streams that share their stamps; where all do, those that are no inertial unit.

    Raises:
        DataError: a stream is asked for that is not there.
    """
    if asked is not None:
        names = [asked] if isinstance(asked, str) else list(asked)
        if not names:
            raise DataError("calibrate_clocks: reference names no stream. Leave it out, or name one")
        return tuple(recording[name].name for name in names)
    groups = _groups(recording)
    largest = max(groups, key=len)
    if len(largest) == len(recording):
        return tuple(s.name for s in recording if not isinstance(s, ImuStream))
    return tuple(largest) if len(largest) > 1 else ()


def unknowns(recording: Recording, reference: Iterable[str]) -> list[tuple[str, ...]]:
    """Streams whose clock is estimated, grouped by clock (such as encoders that share their time stamps)."""
    rest = [s for s in recording if s.name not in set(reference)]
    units = [(s.name,) for s in rest if isinstance(s, ImuStream)]
    others = [s for s in rest if not isinstance(s, ImuStream)]
    return units + ([tuple(g) for g in _groups(Recording(others))] if others else [])


def is_one_logger(recording: Recording) -> bool:
    """Whether all streams but inertial units share their time stamps."""
    rest = [s for s in recording if not isinstance(s, ImuStream)]
    return all(same_stamps(rest[0], other) for other in rest[1:])


def most_agree(clocks: Mapping[str, Clock], middle_s: float) -> tuple[str, ...]:
    """The largest set of streams whose clocks agree in the middle of a recording and run equally fast."""
    # The surest first: an uncertain clock may agree with two that do not agree with each other.
    surest = sorted(clocks, key=lambda name: clocks[name].drift_std)
    found: list[str] = []
    for first in surest:
        group = [first]
        for name in surest:
            if name != first and all(_apart(clocks[name], clocks[n], middle_s) <= 1.0 for n in group):
                group.append(name)
        found = max(found, group, key=len)
    return tuple(name for name in clocks if name in found)


def _apart(one: Clock, other: Clock, middle_s: float) -> float:
    way = one.offset_s - other.offset_s + (one.drift - other.drift) * middle_s
    std = np.hypot(one.offset_std_s, other.offset_std_s)
    drift_std = min(np.hypot(one.drift_std, other.drift_std), _SURE_DRIFT)
    faster = abs(one.drift - other.drift) / (_AGREE_DRIFT + _AGREE_STDS * float(drift_std))
    return max(abs(way) / (_AGREE_S + _AGREE_STDS * float(std)), faster)


def _groups(recording: Recording) -> list[list[str]]:
    groups: list[list[Stream]] = []
    for stream in recording:
        for group in groups:
            if same_stamps(group[0], stream):
                group.append(stream)
                break
        else:
            groups.append([stream])
    return [[s.name for s in group] for group in groups]
