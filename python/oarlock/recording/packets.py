"""Counts lost packets of a stream, from the device's packet counter or from time stamps, for notes and the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from oarlock.recording.epoch import PACKETS_KEY
from oarlock.recording.streams import Stream
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

META_KEY = PACKETS_KEY
"""`Recording.meta[META_KEY][stream]` is a reader's result from the packet counter: `after_s`, `packets`, `step_s`."""

_GAP_STEPS = 1.5
_REGULAR_SHARE, _REGULAR_STEP = 0.8, 0.3
"""Time stamps show lost packets only if this share of the intervals is within this share of the typical interval."""
_SHORT, _EVEN_STEP, _EVEN_SHARE = 0.2, 0.25, 0.9
"""Or if most steps are near to multiples of the short ones, up to 1.5 times the first fifth."""
_LEAST_STEPS = 10
CLOCK_SET_S = 3600.0
"""After a longer silence the sensors were off, or a clock was set, s."""
_SLOWER_SHARE = 0.99
"""A quantity with fewer regular rows than this share of its stream has a rate of its own."""


@dataclass(frozen=True)
class Lost:
    """Lost packets of one stream.

    Args:
        after_s: (G,) time stamps after which packets are missing, s.
        packets: (G,) number of missing packets in each gap.
        silent_s: (G,) duration of each gap beyond the typical interval, s.
        by_counter: true if counted by the device's packet counter, false if detected from time stamps.
    """

    after_s: Floats
    packets: Floats
    silent_s: Floats
    by_counter: bool

    def text(self) -> str:
        """One sentence, such as "37 packets missing in 5 places, longest 80 ms at 12.3 s"; empty if none is missing."""
        if not self.after_s.size:
            return ""
        worst, places = int(np.argmax(self.silent_s)), len(self.after_s)
        length_s, count = float(self.silent_s[worst]), int(self.packets.sum())
        if length_s > CLOCK_SET_S:
            return (
                f"no reading for {_duration_text(length_s)} after {self.after_s[worst]:.1f} s: sensors were off, or a "
                "clock was set. The track starts anew there; cut the recording, or correct the time stamps."
            )
        length = f"{1e3 * length_s:.0f} ms" if length_s < 1.0 else f"{length_s:.3g} s"
        source = " by its counter" if self.by_counter else ""
        return (
            f"{count} {'packet' if count == 1 else 'packets'} missing in {places} "
            f"{'place' if places == 1 else 'places'}{source}, longest {length} at {self.after_s[worst]:.1f} s."
        )


def _duration_text(duration_s: float) -> str:
    units = ((3.156e7, "years"), (86400.0, "days"), (3600.0, "h"))
    length_s, unit = next(pair for pair in units if duration_s >= pair[0])
    return f"{duration_s / length_s:.3g} {unit}"


class RecordingSpan(Protocol):
    """What is needed of a `Recording` here: it prints its own streams' rates with these functions."""

    @property
    def meta(self) -> Mapping[str, Any]:
        """Notes of the reader."""

    @property
    def start_s(self) -> float:
        """First time stamp, s."""

    @property
    def end_s(self) -> float:
        """Last time stamp, s."""


def lost_packets(recording: RecordingSpan, stream: Stream) -> Lost | None:
    """Gaps of a stream, from the packet counter if there is one, otherwise from time stamps; None if undetermined.

    Raises:
        DataError: the entry for counted packets in the recording's `meta` is invalid.
    """
    counted = recording.meta.get(META_KEY)
    if isinstance(counted, Mapping) and isinstance(counted.get(stream.name), Mapping):
        return _counted(counted[stream.name], stream)
    return _own(stream).lost


_MOST_PACKETS, _LONGEST_STEP_S = 1e12, 1e6
"""A counter of 32 bits wraps at 4e9; a unit that sends once in eleven days is none."""


def _counted(found: Mapping[str, ArrayLike], stream: Stream) -> Lost:
    where = f'recording, meta, {META_KEY} of "{stream.name}"'
    missing = {"after_s", "packets", "step_s"} - set(found)
    if missing:
        raise DataError(f"{where}: has no {' and no '.join(sorted(missing))}; import the recording again")
    after = real_array(found["after_s"], (None,), f"{where}, after_s")
    packets = real_array(found["packets"], (len(after),), f"{where}, packets")
    (step_s,) = real_array(found["step_s"], (1,), f"{where}, step_s")
    if not (np.isfinite(after).all() and np.isfinite(packets).all() and np.isfinite(step_s)):
        raise DataError(f"{where}: contains a value that is not a number; import the recording again")
    if (packets < 0.0).any() or packets.sum() > _MOST_PACKETS or not 0.0 <= step_s <= _LONGEST_STEP_S:
        raise DataError(
            f"{where}: {packets.sum():g} packets of {step_s:g} s are missing, which cannot be; import it again"
        )
    inside = (after >= stream.time_s[0]) & (after <= stream.time_s[-1])
    return Lost(after[inside], packets[inside], packets[inside] * step_s, True)


@dataclass(frozen=True)
class _Slow:
    """Regular rows of a quantity that has readings in only some rows of its stream."""

    count: int
    first_s: float
    last_s: float


@dataclass(frozen=True)
class _Own:
    """What a stream's time stamps show: gaps, and of each quantity its rows if it has readings in only some."""

    lost: Lost | None
    slow: Mapping[str, _Slow | None]


# A stream is immutable, and a recording asks for these several times.
_OWN: WeakKeyDictionary[Stream, _Own] = WeakKeyDictionary()


def _own(stream: Stream) -> _Own:
    if stream not in _OWN:
        slow = {name: _slow(stream, values) for name, values in stream.values.items()}
        is_whole = all(np.isfinite(values).all() for values in stream.values.values())
        _OWN[stream] = _Own(_by_steps(stream.time_s, is_whole), slow)
    return _OWN[stream]


def _slow(stream: Stream, values: Floats) -> _Slow | None:
    read = np.isfinite(values)
    if read.all():
        return None
    own = stream.time_s[read.reshape(len(values), -1).any(axis=1)]
    lost = _by_steps(own) if own.size < len(stream) else None
    return None if lost is None else _Slow(own.size + int(lost.packets.sum()), float(own[0]), float(own[-1]))


def _by_steps(time_s: Floats, may_be_thin: bool = False) -> Lost | None:
    steps = np.diff(time_s)
    if steps.size < _LEAST_STEPS:
        return None
    usual = float(np.median(steps))
    if np.mean(np.abs(steps - usual) < _REGULAR_STEP * usual) < _REGULAR_SHARE:
        # Many packets may be missing from an even clock: then steps are multiples of the short ones.
        short = steps[steps < _GAP_STEPS * np.quantile(steps, _SHORT)]
        usual = float(np.median(short)) if short.size and may_be_thin else 0.0
        if (
            usual <= 0.0
            or np.mean(np.abs(steps / usual - np.round(steps / usual)) < _EVEN_STEP) < _EVEN_SHARE
        ):
            return None
    gaps = np.flatnonzero(steps > _GAP_STEPS * usual)
    packets = np.round(steps[gaps] / usual) - 1.0
    return Lost(time_s[gaps], packets, steps[gaps] - usual, False)


def own_rate_hz(recording: RecordingSpan, stream: Stream) -> float:
    """Rate of a stream without its lost packets, Hz; NaN for a single row."""
    if len(stream) < 2:
        return float("nan")
    rows = len(stream) + (missing_packets(recording, stream) or 0)
    return (rows - 1) / float(stream.time_s[-1] - stream.time_s[0])


def expected_rows(recording: RecordingSpan, stream: Stream) -> int:
    """Rows of a stream that has its own rate from the recording's first to its last time stamp.

    They are the rows received, the lost packets, and the rows before the stream's first and after its last one. Packets
    are not counted as lost where that is undetermined.
    """
    steps = own_rate_hz(recording, stream) * np.array(
        [stream.time_s[0] - recording.start_s, recording.end_s - stream.time_s[-1]]
    )
    outside = int(np.floor(steps[steps > _GAP_STEPS]).sum())
    return len(stream) + (missing_packets(recording, stream) or 0) + outside


def missing_share(recording: RecordingSpan, stream: Stream) -> float:
    """Share of the expected values of a stream that are absent or NaN, each quantity against its own rate."""
    received = sum(np.count_nonzero(np.isfinite(v)) for v in stream.values.values())
    rows = expected_quantity_rows(recording, stream)
    return 1.0 - received / sum(rows[name] * (v.size // len(v)) for name, v in stream.values.items())


def expected_quantity_rows(recording: RecordingSpan, stream: Stream) -> dict[str, int]:
    """`expected_rows` of each quantity. A slow one, such as a magnetometer at 20 Hz beside 100 Hz, has fewer."""
    return {name: rows for name, (rows, _) in _quantities(recording, stream).items()}


def quantity_rates(recording: RecordingSpan, stream: Stream) -> dict[str, float]:
    """Rate of each quantity of a stream, Hz; that of its rows unless the quantity has a slower rate of its own."""
    return {name: rate_hz for name, (_, rate_hz) in _quantities(recording, stream).items()}


def stream_rate_hz(recording: RecordingSpan, stream: Stream) -> float:
    """Rate of the fastest quantity, Hz. Where each quantity has rows of its own, the rows come more often."""
    return max(quantity_rates(recording, stream).values())


def _quantities(recording: RecordingSpan, stream: Stream) -> dict[str, tuple[int, float]]:
    """Expected rows and rate in Hz of each quantity."""
    rows, rows_hz = expected_rows(recording, stream), own_rate_hz(recording, stream)
    found = {}
    for name, own in _own(stream).slow.items():
        found[name] = rows, rows_hz
        if own is not None:
            rate_hz = (own.count - 1) / (own.last_s - own.first_s)
            steps = rate_hz * np.array([own.first_s - recording.start_s, recording.end_s - own.last_s])
            expected = own.count + int(np.floor(steps[steps > _GAP_STEPS]).sum())
            if expected < min(_SLOWER_SHARE * rows, rows - 2):
                found[name] = expected, rate_hz
    return found


def missing_packets(recording: RecordingSpan, stream: Stream) -> int | None:
    """Number of missing packets of a stream; None if undetermined."""
    lost = lost_packets(recording, stream)
    return None if lost is None else int(lost.packets.sum())
