"""Recordings of a crew with planted delays, for tests of `oarlock rowing crew`. Uses nothing of the analysis."""

import numpy as np

from oarlock import Recording
from oarlock.recording import ImuStream, ScalarStream

PHI_RAD = (-1.1, 0.6)


def crew_recordings(
    late_s, rate=24.0, duration_s=90.0, jitter_s=0.0, noise_rad=0.001, gap=None, seed=0, hz=100.0
):
    """A recording a seat: both oars as encoders, each seat with its own stamps and noise, on one clock.

    A stroke is a cosine whose drive takes 45 % of the time; periods vary by 1.5 %, and each seat by `jitter_s`
    a stroke.
    `gap`: a seat's place, and from when to when it has no readings.
    """
    rng = np.random.default_rng(seed)
    count = int(duration_s * rate / 60.0) + 4
    catch_s = -1.0 + np.cumsum(60.0 / rate * (1.0 + 0.015 * rng.normal(size=count)))
    return [
        _recording(rng, catch_s + late + jitter_s * rng.normal(size=count), duration_s, noise_rad, hz, k, gap)
        for k, late in enumerate(late_s)
    ]


def _recording(rng, catch_s, duration_s, noise_rad, hz, place, gap):
    time_s = np.arange(rng.uniform(0.0, 1.0 / hz), duration_s, 1.0 / hz)
    streams = []
    finish_s = catch_s[:-1] + 0.45 * np.diff(catch_s)
    turns = np.sort(np.concatenate([catch_s, finish_s]))
    half = np.interp(time_s, turns, np.arange(len(turns)))
    if gap and gap[0] == place:
        half = np.where((time_s > gap[1]) & (time_s < gap[2]), np.nan, half)
    middle, reach = 0.5 * sum(PHI_RAD), 0.5 * (PHI_RAD[1] - PHI_RAD[0])
    for side in "rl":
        phi = middle - reach * np.cos(np.pi * half) + noise_rad * rng.normal(size=len(time_s))
        streams.append(ScalarStream(f"{side}_oar_phi", time_s, phi))
    return Recording(streams)


def on_other_clock(recording, offset_s, drift=0.0, more=()):
    """The recording as a logger would have it whose clock is late by `offset_s` and fast by `drift`."""
    moved = [
        ScalarStream(one.name, one.time_s * (1.0 + drift) + offset_s, one.value) for one in recording.streams
    ]
    return Recording([*moved, *more], dict(recording.meta))


def hull_units(duration_s, offset_s, drift, seed=0, hz=100.0):
    """Units on one hull with two loggers: differently turned, own noise, the second on another clock."""
    rng = np.random.default_rng(seed)
    fine_s = np.arange(-5.0, duration_s + 5.0, 0.005)
    surge = 3.0 * np.sin(2.0 * np.pi * 0.4 * fine_s + np.cumsum(rng.normal(size=len(fine_s))) * 0.01)
    surge += np.convolve(rng.normal(size=len(fine_s)), np.hanning(40), "same") * 0.3
    units = []
    for turned, late, fast in ((0.0, 0.0, 0.0), (2.0, offset_s, drift)):
        time_s = np.arange(0.0, duration_s, 1.0 / hz)
        along = np.interp(time_s, fine_s, surge)
        axes = np.stack([np.cos(turned) * along, np.sin(turned) * along, np.full(len(along), 9.81)], axis=1)
        readings = axes + 0.05 * rng.normal(size=axes.shape)
        units.append(ImuStream("hull", time_s * (1.0 + fast) + late, accel_m_s2=readings))
    return units
