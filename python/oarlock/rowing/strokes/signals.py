"""Selects the signal from which strokes are found: oars, handle, seat or trunk; each is lowest at the catch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians

import numpy as np

from oarlock import Model, Recording, Track
from oarlock.recording import ImuStream, ScalarStream
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

SOURCES = ("oars", "handle", "seat", "trunk", "trunk_gyro")
"""In the order of preference."""
_LEAK_S = 20.0
_HALF_WINDOW_S = 0.15
_ENOUGH_SHARE = 0.02
_NO_OAR_RAD = 3.5
_SIDED = {"r_oar_phi": "r", "l_oar_phi": "l", "oar_phi": ""}


@dataclass(frozen=True)
class SignalKind:
    """Properties of the movement of a source.

    Attributes:
        unit: of the movement.
        least: smallest movement that is a stroke.
        usual: a movement that surely is whole; shorter ones count as whole where all of a session are short.
        rests: where it stands still for a while, see `ReversalFinder`.
        sign: 1 if it grows toward the finish.
        words: for notes.
    """

    unit: str
    least: float
    usual: float
    rests: str
    sign: float
    words: str


KINDS: Mapping[str, SignalKind] = {
    "oars": SignalKind("rad", radians(30.0), radians(60.0), "", 1.0, "the oars' horizontal angles"),
    "handle": SignalKind("m", 0.40, 0.80, "", 1.0, "the handle's way along the chain"),
    "seat": SignalKind("m", 0.15, 0.30, "high", -1.0, "the seat"),
    "trunk": SignalKind("rad", radians(15.0), radians(30.0), "low", 1.0, "the trunk's lean"),
    "trunk_gyro": SignalKind("rad", radians(15.0), radians(30.0), "low", 1.0, "the gyroscope on the back"),
}


@dataclass(frozen=True, eq=False)
class Signal:
    """One movement, (K,) each: low at the catch, high at the finish; only what was read.

    `rate_std` is what the velocity may be off by beside noise that a fit sees; 0 of plain readings.
    """

    source: str
    side: str
    time_s: Floats
    value: Floats
    rate_std: Floats


def signals_of(data: Track | Recording, source: str | None, model: Model | None) -> list[Signal]:
    """The signals of the asked source, or of the first that is there; one an oar.

    Raises:
        DataError: no such source, or no signal from which strokes can be found.
    """
    if source is not None and source not in SOURCES:
        raise DataError(f"strokes: no source '{source}'; choose one of {', '.join(SOURCES)}")
    tried = SOURCES if source is None else (source,)
    for name in tried:
        found = [s for s in _of_source(data, name, model) if len(s.time_s) >= 10]
        if found:
            return found
    held = data.joint_names if isinstance(data, Track) else data.names
    raise DataError(
        f"strokes: nothing of {', '.join(tried)} in {', '.join(held)}. Strokes are found from r_oar_phi and l_oar_phi, "
        "oar_phi, handle, seat, the joint trunk, or an inertial unit 'back'; give such a stream, or name another source"
    )


def moving(signals: list[Signal]) -> tuple[list[Signal], list[Signal]]:
    """Those that move, and, of two oars, one that stands still while the other rows."""
    if len(signals) < 2:
        return signals, []
    swings = [float(np.ptp(np.percentile(s.value, [1.0, 99.0]))) for s in signals]
    still = [s for s, swing in zip(signals, swings, strict=True) if swing < KINDS[s.source].least / 10.0]
    if len(still) != 1 or max(swings) < KINDS[signals[0].source].least:
        return signals, []
    return [s for s in signals if s is not still[0]], still


def _of_source(data: Track | Recording, source: str, model: Model | None) -> list[Signal]:
    if source == "trunk_gyro":
        return _trunk_gyro(data, model) if isinstance(data, Recording) else []
    if source == "trunk" and isinstance(data, Recording):
        return []
    names = _SIDED if source == "oars" else {source: ""}
    return [signal for name, side in names.items() for signal in _read(data, source, name, side)]


def _read(data: Track | Recording, source: str, name: str, side: str) -> list[Signal]:
    if isinstance(data, Track):
        return _of_track(data, source, name, side)
    return _of_recording(data, source, name, side)


def _of_track(track: Track, source: str, name: str, side: str) -> list[Signal]:
    if name not in track.coordinate_names:
        return []
    column = track.coordinate_names.index(name)
    rows = np.isfinite(track.q[:, column]) & track.observed[:, column]
    if rows.mean() < _ENOUGH_SHARE:
        return []
    rate_std = slope_std(track.q_std[rows, column], track.qd_std[rows, column])
    return [Signal(source, side, track.time_s[rows], KINDS[source].sign * track.q[rows, column], rate_std)]


def slope_std(value_std: Floats, rate_std: Floats) -> Floats:
    """What an estimate's slope over the readings around a turn may be off by; 0 where it is no estimate.

    At most what the estimate's own rate may be off by, and at most what an error of the value's size, in the worst case
    a ramp through the window, makes of a fitted slope: sqrt(3) over half the window.
    """
    ramp = np.sqrt(3.0) / _HALF_WINDOW_S * value_std
    return np.nan_to_num(np.where(np.isnan(rate_std), np.nan, np.fmin(ramp, rate_std)))


def _of_recording(recording: Recording, source: str, name: str, side: str) -> list[Signal]:
    if name not in recording:
        return []
    stream = recording[name]
    if not isinstance(stream, ScalarStream):
        raise DataError(f"strokes: the stream '{name}' is {stream.kind}, expected one number over time")
    rows = np.isfinite(stream.value)
    value = KINDS[source].sign * stream.value[rows]
    if source == "oars" and len(value) and float(np.percentile(np.abs(value), 95)) > _NO_OAR_RAD:
        raise DataError(
            f"strokes: the stream '{name}' goes to {np.abs(value).max():.3g} rad; an oar stays within 1.6. Degrees? "
            "Convert them to rad"
        )
    return [Signal(source, side, stream.time_s[rows], value, np.zeros(len(value)))]


def _trunk_gyro(recording: Recording, model: Model | None) -> list[Signal]:
    if "back" not in recording:
        return []
    stream = recording["back"]
    if not isinstance(stream, ImuStream) or stream.gyro_rad_s is None:
        return []
    rows = np.isfinite(stream.gyro_rad_s).all(axis=1)
    time_s, gyro = stream.time_s[rows], stream.gyro_rad_s[rows]
    if len(time_s) < 10:
        return []
    axis = trunk_axis(model) if model is not None else _found_axis(time_s, gyro)
    lean = LeakySum()
    value = np.array([lean.step(t, w) for t, w in zip(time_s.tolist(), (gyro @ axis).tolist(), strict=True)])
    return [Signal("trunk_gyro", "", time_s, value, np.zeros(len(value)))]


@dataclass
class LeakySum:
    """Integral of a rate that forgets within 20 s: a swing keeps its size, a gyroscope's bias becomes an offset."""

    time_s: float = np.nan
    total: float = 0.0

    def step(self, time_s: float, rate: float) -> float:
        """The integral after a reading."""
        if not np.isnan(rate):
            step_s = 0.0 if np.isnan(self.time_s) else time_s - self.time_s
            self.total += step_s * (rate - self.total / _LEAK_S)
            self.time_s = time_s
        return self.total


def trunk_axis(model: Model) -> Floats:
    """Direction (3,) in the unit `back`'s axes of the rate of a trunk that leans back.

    Raises:
        DataError: the model has no trunk with a unit `back`.
    """
    names = list(model.measurement_names)
    rows = [names.index(name) for name in ("back.gyro_x", "back.gyro_y", "back.gyro_z") if name in names]
    if len(rows) < 3 or "trunk" not in model.coordinate_names:
        raise DataError(
            f"strokes: the model '{model.name}' has no joint 'trunk' with an inertial unit 'back' on it"
        )
    still = np.zeros(len(model.coordinate_names))
    leaning = still.copy()
    leaning[model.coordinate_names.index("trunk")] = 1.0
    read = model.predict_measurements(still, leaning, still)[rows]
    return np.asarray(read / np.linalg.norm(read))


def _found_axis(time_s: Floats, gyro: Floats) -> Floats:
    """The axis that the trunk swings about most; backward is what is followed sooner by its opposite."""
    centred = gyro - np.median(gyro, axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    rate = centred @ axis
    backward, forward = _quickest(time_s, rate), _quickest(time_s, -rate)
    after = _median_wait(backward, forward)
    before = _median_wait(forward, backward)
    return np.asarray(axis if after <= before else -axis)


def _quickest(time_s: Floats, rate: Floats) -> Floats:
    """When each swing one way is quickest, s."""
    level = 0.4 * float(np.percentile(rate, 98))
    quick = np.concatenate([[False], rate > level, [False]]).astype(int)
    starts, ends = np.flatnonzero(np.diff(quick) == 1), np.flatnonzero(np.diff(quick) == -1)
    return np.array([time_s[a + int(np.argmax(rate[a:b]))] for a, b in zip(starts, ends, strict=True)])


def _median_wait(first: Floats, then: Floats) -> float:
    """From each time of `first` to the next of `then`, s."""
    following = np.searchsorted(then, first)
    known = following < len(then)
    return float(np.median(then[following[known]] - first[known])) if known.any() else np.inf
