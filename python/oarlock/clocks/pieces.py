"""Short pieces of a recording, tracked and smoothed, and what they say of delays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from oarlock._core import Config, Model
from oarlock.calibration import Calibration
from oarlock.clocks.delays import Delay, Row, delays
from oarlock.errors import DataError
from oarlock.parallel_tracking import track_many
from oarlock.recording import ImuStream, Recording, Stream
from oarlock.track import Track

Floats = NDArray[np.float64]
Span = tuple[float, float]
Sight = tuple[str, str, str]
"""Held against the track of "all" or of the "others", then as `Row`."""

PIECE_S = 20.0
SETTLE_S = 3.0
"""The fit of a start may be poor; smoothing mends it, but for these."""
LEAST_S = 8.0
RATE_HZ = 30.0
PUSH_S = 0.01
RESPONSE_S = 14.0
ESTIMATE = ("gyro_bias", "surge", "mounts")
"""With mounts among the states a unit that sits askew bends the track far less; they explain its biases too."""


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
    tracked: Tracked, recording: Recording, pieces: Sequence[Span], sought: Sequence[str]
) -> list[dict[Sight, list[Delay]]]:
    """Delays of the streams that are sought, in windows, one table for each piece whose track did not fail.

    Each stream is held against the track of all, and against one that was not told of it.
    """
    found = []
    for start, end in pieces:
        part = recording.slice(start, end)
        thin = thinned(part)
        left_out = [name for name in sought if name in part and len(part) > 1]
        jobs = [thin, *(thin.only([n for n in thin.names if n != name]) for name in left_out)]
        window = start + SETTLE_S, end - 0.5
        whole, *others = tracked.tracks(jobs)
        table: dict[Sight, list[Delay]] = {}
        if whole is not None:
            told = delays(tracked.model, whole, [part[n] for n in left_out], *window)
            table |= {("all", *row): windows for row, windows in told.items()}
        for name, track in zip(left_out, others, strict=True):
            if track is not None:
                told = delays(tracked.model, track, [part[name]], *window)
                table |= {("others", *row): windows for row, windows in told.items()}
        if table:
            found.append(table)
    return found


def response(
    tracked: Tracked, recording: Recording, piece: Span, clocks: Sequence[tuple[str, ...]]
) -> dict[Sight, Floats]:
    """By how much the delay of each quantity grows, (clocks,), when a clock is late: a track follows its own sensors.

    Empty where a track failed.
    """
    middle = 0.5 * sum(piece)
    half = 0.5 * min(RESPONSE_S, piece[1] - piece[0])
    part = recording.slice(middle - half, middle + half)
    pushed = [part, *(_late(part, dict.fromkeys(names, PUSH_S)) for names in clocks)]
    window = middle - half + SETTLE_S, middle + half - 0.5
    streams = [n for names in clocks for n in names if n in part]
    columns: list[dict[Row, float]] = []
    for moved, track in zip(pushed, tracked.tracks([thinned(p) for p in pushed]), strict=True):
        if track is None:
            return {}
        told = delays(tracked.model, track, [moved[n] for n in streams], *window)
        columns.append({row: _mean(windows) for row, windows in told.items() if windows})
    still, *others = columns
    rows = [row for row in still if all(row in c for c in others)]
    return {("all", *row): np.array([(c[row] - still[row]) / PUSH_S for c in others]) for row in rows}


def thinned(recording: Recording) -> Recording:
    """Every so many samples of each stream, about `RATE_HZ`: enough to track by, and quick."""
    streams: list[Stream] = []
    for stream in recording:
        step = max(1, int(stream.rate_hz / RATE_HZ + 0.01)) if len(stream) > 1 else 1
        time_s, values = stream.time_s[::step], {n: rows[::step] for n, rows in stream.values.items()}
        if isinstance(stream, ImuStream):
            streams.append(ImuStream(stream.name, time_s, **values))
        else:
            streams.append(replace(stream, time_s=time_s, value=values["value"]))
    return Recording(streams, recording.meta)


def _mean(windows: Sequence[Delay]) -> float:
    return float(np.average([w.delay_s for w in windows], weights=[w.std_s**-2 for w in windows]))


def _late(recording: Recording, delays_s: Mapping[str, float]) -> Recording:
    streams: list[Stream] = [
        replace(s, time_s=s.time_s + delays_s[s.name]) if s.name in delays_s else s for s in recording
    ]
    return Recording(streams, recording.meta)
