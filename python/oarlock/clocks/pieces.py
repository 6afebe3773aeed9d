"""Short pieces of a recording, tracked and smoothed, and what they say of delays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from oarlock._core import Config, Model
from oarlock.calibration import Calibration
from oarlock.clocks.delays import Delay, delays, row_names
from oarlock.errors import DataError
from oarlock.parallel_tracking import track_many
from oarlock.recording import Recording, Stream
from oarlock.track import Track

Floats = NDArray[np.float64]
Span = tuple[float, float]

PIECE_S = 24.0
SETTLE_S = 3.0
"""The fit of a start may be poor; smoothing mends it, but for these."""
LEAST_S = 8.0
PUSH_S = 0.01
RESPONSE_S = 14.0
ESTIMATE = ("gyro_bias", "accel_bias", "surge", "mounts")
"""With mounts among the states a unit that sits askew bends the track far less."""


@dataclass(frozen=True)
class Tracked:
    """What delays are seen through: the body, what is known of its wearing but for clocks, and who is told of it."""

    model: Model
    known: Calibration
    threads: int | None

    def tracks(self, recordings: Sequence[Recording]) -> list[Track | None]:
        """Smoothed tracks; None where one failed."""
        config = Config(filter="ekf", estimate=ESTIMATE)
        found = track_many(
            self.model, recordings, self.known, config, smooth=True, threads=self.threads, on_error="return"
        )
        refused = next((f for f in found if isinstance(f, DataError)), None)
        if refused is not None:
            raise refused
        return [f if isinstance(f, Track) else None for f in found]


def spans(recording: Recording, most: int) -> list[Span]:
    """Pieces evenly over the time that all streams share.

    Raises:
        DataError: less than `LEAST_S` is shared.
    """
    start = max(float(s.time_s[0]) for s in recording)
    end = min(float(s.time_s[-1]) for s in recording)
    if end - start < LEAST_S:
        raise DataError(
            f"calibrate_clocks: the streams share {max(0.0, end - start):.1f} s (from {start:.2f} to {end:.2f} s); "
            f"at least {LEAST_S:g} s of movement are needed. Leave out a stream that is too short with "
            "recording.only(...)"
        )
    length = min(PIECE_S, end - start)
    count = max(1, min(most, int((end - start) / length)))
    starts = np.linspace(start, end - length, count)
    return [(float(first), float(first + length)) for first in starts]


def seen(
    tracked: Tracked, recording: Recording, pieces: Sequence[Span], told: Callable[[float], object]
) -> list[dict[str, list[Delay]]]:
    """Delays by stream and window, one table for each piece whose track did not fail."""
    parts = [recording.slice(*piece) for piece in pieces]
    found = []
    for k, (part, track) in enumerate(zip(parts, tracked.tracks(parts), strict=True)):
        if track is not None:
            start, end = pieces[k]
            found.append(delays(tracked.model, track, _by_name(part), start + SETTLE_S, end - 0.5))
    told(1.0)
    return found


def telling(model: Model, recording: Recording) -> list[str]:
    """Streams whose delay against a track can be told at all."""
    return [s.name for s in recording if row_names(model, s)]


def response(
    tracked: Tracked, recording: Recording, piece: Span, clocks: Sequence[tuple[str, ...]], rows: Sequence[str]
) -> Floats | None:
    """(rows, clocks) by how much each row's delay grows when a clock is late: the track follows its own sensors.

    None where a track failed.
    """
    middle = 0.5 * sum(piece)
    half = 0.5 * min(RESPONSE_S, piece[1] - piece[0])
    part = recording.slice(middle - half, middle + half)
    pushed = [part, *(_late(part, {name: PUSH_S for name in names}) for names in clocks)]
    columns = []
    for moved, track in zip(pushed, tracked.tracks(pushed), strict=True):
        if track is None:
            return None
        window = middle - half + SETTLE_S, middle + half - 0.5
        found = delays(tracked.model, track, _by_name(moved), *window)
        columns.append([_mean(found.get(name, [])) for name in rows])
    still = np.array(columns[0])
    return np.stack([(np.array(c) - still) / PUSH_S for c in columns[1:]], axis=1)


def _mean(windows: Sequence[Delay]) -> float:
    if not windows:
        return 0.0
    return float(np.average([w.delay_s for w in windows], weights=[w.std_s**-2 for w in windows]))


def _late(recording: Recording, delays_s: Mapping[str, float]) -> Recording:
    streams: list[Stream] = [
        replace(s, time_s=s.time_s + delays_s[s.name]) if s.name in delays_s else s for s in recording
    ]
    return Recording(streams, recording.meta)


def _by_name(recording: Recording) -> dict[str, Stream]:
    return {s.name: s for s in recording}
