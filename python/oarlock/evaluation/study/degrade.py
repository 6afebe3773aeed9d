"""Degrades a simulated recording: removes, delays or thins streams, or inserts dropouts. Used by study trials."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping

import numpy as np

from oarlock._core import Model
from oarlock.evaluation.study.faults.fault import Names
from oarlock.evaluation.study.keys import ONE, StudyKey, Value, by_name, number_for, sized
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, Stream
from oarlock.storage.errors import DataError

_QUANTITIES = ("gyro_rad_s", "accel_m_s2", "mag_ut")


def keys_of_streams(model: Model) -> dict[str, StudyKey]:
    """Keys that change the streams of a model, by name."""
    streams = (*Names.of(model).streams, ONE)
    delay = "delay of time stamps, s: of all inertial units relative to the other streams, or by stream"
    drift = "clock drift, ppm: of all inertial units, or by stream"
    lost = "share of lost samples: of all inertial units, or by stream"
    thinned = "keep one sample in this many"
    recorded = "streams that are recorded; none is all"
    unmeasured = "quantities that inertial units do not measure"
    return by_name(
        [
            StudyKey("sensors", "names", None, recorded, choices=streams, optional=True),
            StudyKey("without", "names", [], "streams that are not recorded", choices=streams),
            StudyKey("without_quantity", "names", [], unmeasured, choices=_QUANTITIES),
            sized("delay_s", delay, streams, -math.inf),
            sized("clock_drift_ppm", drift, streams, -math.inf),
            StudyKey("keep_every", "by_name", 1.0, thinned, least=1.0, choices=streams),
            sized("packet_loss", lost, streams, most=0.99),
            StudyKey("packet_samples", "integer", 1, "samples in one lost packet", least=1.0, most=10_000.0),
        ]
    )


def degraded(recording: Recording, values: Mapping[str, Value], seed: int) -> Recording:
    """The recording as the filter receives it.

    Raises:
        DataError: nothing would be left.
    """
    kept = values["sensors"] if values["sensors"] is not None else recording.names
    dropped = values["without"]
    assert isinstance(kept, list | tuple) and isinstance(dropped, list)
    streams = []
    for stream in recording.streams:
        if stream.name in kept and stream.name not in dropped:
            left = _stream(stream, values, seed)
            streams += [] if left is None else [left]
    if not streams:
        raise DataError("the study leaves no stream: check sensors, without and without_quantity")
    return Recording(streams, recording.meta)


def _stream(stream: Stream, values: Mapping[str, Value], seed: int) -> Stream | None:
    inertial = isinstance(stream, ImuStream)

    def of(key: str, usual: float) -> float:
        """A number without a name applies to inertial units; for thinning it applies to all streams."""
        value = values[key]
        if not isinstance(value, Mapping) and not inertial and key != "keep_every":
            return usual
        return number_for(value, stream.name, usual)

    rows = np.arange(len(stream))[:: max(1, round(of("keep_every", 1.0)))]
    loss = of("packet_loss", 0.0)
    if loss > 0.0:
        size = values["packet_samples"]
        assert isinstance(size, int)
        rows = rows[
            ~_lost(len(rows), loss, size, np.random.default_rng([seed, zlib.crc32(stream.name.encode())]))
        ]
    if not len(rows):
        return None
    scale = 1.0 + 1e-6 * of("clock_drift_ppm", 0.0)
    first = float(stream.time_s[0])
    time_s = first + scale * (stream.time_s[rows] - first) + of("delay_s", 0.0)
    if not isinstance(stream, ImuStream):
        return stream.at_rows(rows, time_s)
    absent = values["without_quantity"]
    assert isinstance(absent, list)
    left = {name: rows_of[rows] for name, rows_of in stream.values.items() if name not in absent}
    return ImuStream(stream.name, time_s, **left) if left else None


def _lost(count: int, share: float, together: int, random: np.random.Generator) -> np.ndarray:
    """Mask of the lost samples, (count,), in whole packets."""
    packets = random.random(-(-count // together)) < share
    return np.repeat(packets, together)[:count]
