"""Irregular clocks. Offset and drift are keys of every stream: `delay_s`, `clock_drift_ppm`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from oarlock.evaluation.study.faults.fault import Case, Fault, Names, of_streams
from oarlock.evaluation.study.keys import ONE, sized
from oarlock.recording.streams import ImuStream, Stream

MOST_OF_A_STEP = 0.45
"""Largest jitter in steps, so that time stamps always increase."""


def stamps(names: Names) -> tuple[Fault, ...]:
    """The fault of this module: jitter of time stamps."""
    about = "jitter (standard deviation) of the time stamps of all inertial units, or by stream; at most 0.45 steps"
    jitter = sized("clock_jitter_s", about, (*names.streams, ONE))
    return (Fault(jitter, of_streams(_scattered, names.units)),)


def _scattered(stream: Stream, std_s: float, case: Case) -> Stream:
    if len(stream) < 2:
        return stream
    most = MOST_OF_A_STEP * float(np.diff(stream.time_s).min())
    off = std_s * case.random(f"jitter {stream.name}").standard_normal(len(stream))
    time_s = stream.time_s + np.clip(off, -most, most)
    if isinstance(stream, ImuStream):
        return ImuStream(stream.name, time_s, **stream.values)
    return replace(stream, time_s=time_s)
