"""Time of tracking sensors that do not tick together beside that of sensors that do, with the same information.

The tests of such recordings use the same simulation.
"""

from __future__ import annotations

from collections.abc import Mapping
from time import process_time

import numpy as np

import oarlock
from oarlock import rowing
from oarlock.storage.arrays import Bools, Floats

Stream = oarlock.recording.ImuStream | oarlock.recording.ScalarStream

RATES_HZ = {
    "back": 100.0,
    "r_upperarm": 120.0,
    "r_forearm": 60.0,
    "l_upperarm": 286.0,
    "l_forearm": 100.0,
    "seat": 50.0,
    "r_oar_phi": 20.0,
    "r_oar_alpha": 20.0,
    "l_oar_phi": 97.3,
    "l_oar_alpha": 97.3,
}
COMMON_HZ = RATES_HZ | {
    "r_upperarm": 100.0,
    "l_upperarm": 300.0,
    "l_oar_phi": 100.0,
    "l_oar_alpha": 100.0,
}
"""The same information, as far as rates go that divide one another."""
JITTER_S = 1e-3
_REPEATS = 7


def recorded(
    model: oarlock.Model,
    motion: oarlock.simulation.Motion,
    rates_hz: Mapping[str, float],
    seed: int,
    jitter_s: float = 0.0,
    drifts: Mapping[str, float] | None = None,
    loss: float = 0.05,
) -> oarlock.Recording:
    """Each sensor simulated at its own rate; jitter and drift in its stamps, some readings lost."""
    rng, streams = np.random.default_rng(seed), []
    for number, (name, rate_hz) in enumerate(rates_hz.items()):
        _, recording = oarlock.simulate(model, motion, [name], 100 * seed + number, rate_hz=rate_hz)
        stream = recording.streams[0]
        assert isinstance(stream, oarlock.recording.ImuStream | oarlock.recording.ScalarStream)
        stamps = np.asarray(stream.time_s) + rng.normal(0, jitter_s, len(stream.time_s))
        stamps = stamps * (1 + (drifts or {}).get(name, 0.0))
        rising = np.r_[True, np.diff(np.maximum.accumulate(stamps)) > 1e-4]
        streams.append(_part(stream, stamps, rising & (rng.random(len(stamps)) > loss)))
    return oarlock.Recording(streams)


def _part(stream: Stream, stamps: Floats, rows: Bools) -> Stream:
    values = {name: value[rows] for name, value in stream.values.items()}
    if isinstance(stream, oarlock.recording.ScalarStream):
        return oarlock.recording.ScalarStream(stream.name, stamps[rows], values["value"], stream.unit)
    return oarlock.recording.ImuStream(stream.name, stamps[rows], **values)


def costs(duration_s: float = 10.0) -> dict[str, float]:
    """Processor time, ms, of tracking one second of each recording, in turn, medians; and their ratio."""
    model = oarlock.load_model("sculler")
    motion = rowing.sculling(model, duration_s, 24, surge=False, seed=1)
    recordings = {
        "together": recorded(model, motion, COMMON_HZ, seed=1),
        "apart": recorded(model, motion, RATES_HZ, seed=1, jitter_s=JITTER_S),
    }
    spent: dict[str, list[float]] = {name: [] for name in recordings}
    for _ in range(_REPEATS):
        for name, recording in recordings.items():
            begun = process_time()
            oarlock.track(model, recording)
            spent[name].append(1e3 * (process_time() - begun) / duration_s)
    ratio = np.median(np.divide(spent["apart"], spent["together"]))
    return {f"{name}_ms": float(np.median(each)) for name, each in spent.items()} | {"ratio": float(ratio)}
