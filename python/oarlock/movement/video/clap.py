"""Aligns a video by a clap: a peak of its sound against a jolt of an inertial unit that was struck."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError

WINDOW_S = 0.004
"""Time in which the sound's energy is summed."""
AROUND_S = 0.5
"""The background of an impulse is the median over this time either side."""
APART_S = 0.15
LOUD = 30.0
"""A clap has at least this many times the background's energy, 15 dB."""
JOLT_M_S2 = 15.0
"""Least change of the specific force's size against the median around it."""
SHARE = 0.4
"""Impulses of at least this share of the largest one count beside it."""
MOST = 8
AGREE_S = 0.03
SOUND_M_S = 343.0
"""Speed of sound in air of 20 degC."""


@dataclass(frozen=True)
class ClapOffset:
    """Offset by a clap, track time at video time 0.

    Attributes:
        offset_s: the offset, s.
        std_s: its standard deviation, s.
        claps: how many claps agree.
        sound_s: video times of all claps that were heard.
        jolt_s: recording times of all jolts of the unit.
    """

    offset_s: float
    std_s: float
    claps: int
    sound_s: tuple[float, ...]
    jolt_s: tuple[float, ...]


def clap_offset(sound: tuple[Floats, Floats], unit: ImuStream, *, distance_m: float = 0.0) -> ClapOffset:
    """Find the offset of a video from claps that were heard and felt.

    Args:
        sound: video times (N,) s and sound (N,), of `oarlock.movement.video.reading.sound_of`.
        unit: the inertial unit that was struck, in the recording's time, which is the track's.
        distance_m: from the clap to the microphone, m: sound needs 3 ms for a metre.

    Raises:
        DataError: no clap in one of them, or several that fit equally well.
    """
    heard = claps_heard(*sound) - distance_m / SOUND_M_S
    felt = jolts_felt(unit)
    offsets = (felt[None, :] - heard[:, None]).ravel()
    agreeing = [np.flatnonzero(np.abs(offsets - one) <= AGREE_S) for one in offsets]
    most = max(len(group) for group in agreeing)
    groups = {tuple(group): float(np.mean(offsets[group])) for group in agreeing if len(group) == most}
    distinct = sorted(groups.values())
    if distinct[-1] - distinct[0] > AGREE_S:
        listed = ", ".join(f"{one:.2f}" for one in distinct)
        raise DataError(
            f"clap: {len(heard)} in the sound (at {_listed(heard)} s of the video), {len(felt)} in {unit.name} (at "
            f"{_listed(felt)} s): the offsets {listed} s fit equally well. "
            "Look which one is right and give it as --offset-s"
        )
    step_s = float(np.median(np.diff(unit.time_s)))
    return ClapOffset(
        offset_s=float(np.median(distinct)),
        std_s=float(np.hypot(step_s, WINDOW_S) / np.sqrt(12.0 * most)),
        claps=most,
        sound_s=tuple(float(one) for one in heard),
        jolt_s=tuple(float(one) for one in felt),
    )


def claps_heard(time_s: Floats, sound: Floats) -> Floats:
    """Times of sudden loud sounds, s, in order.

    Raises:
        DataError: none stands out of the background.
    """
    step_s = (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
    width = max(1, round(WINDOW_S / step_s))
    # differences weaken wind, water and voices, which are lower than a clap
    energy = np.add.reduceat(np.diff(sound, prepend=sound[:1]) ** 2, np.arange(0, len(sound), width))
    times = time_s[::width]
    around = max(3, round(AROUND_S / WINDOW_S))
    ratio = energy / (_median_around(energy, around) + 1e-6 * float(energy.max()) + 1e-15)
    peaks = _impulses(times, np.where(ratio >= LOUD, np.sqrt(energy), 0.0))
    if not peaks.size:
        raise DataError(
            f"clap: no sudden sound of {LOUD:g} times the background's energy in the video; "
            "clap closer to the microphone, "
            "or align by motion with `oarlock calibrate video`"
        )
    return times[peaks] + 0.5 * WINDOW_S


def jolts_felt(unit: ImuStream) -> Floats:
    """Times of jolts of an inertial unit, s, in order.

    Raises:
        DataError: no accelerometer, or no jolt.
    """
    if unit.accel_m_s2 is None:
        raise DataError(f"clap: {unit.name} has no accelerometer; choose another unit")
    size = np.linalg.norm(unit.accel_m_s2, axis=1)
    known = np.isfinite(size)
    times, size = unit.time_s[known], size[known]
    if len(times) < 8:
        raise DataError(
            f"clap: {unit.name} has {len(times)} readings of its accelerometer; choose another unit"
        )
    around = max(3, round(AROUND_S / float(np.median(np.diff(times)))))
    jolt = np.abs(size - _median_around(size, around))
    peaks = _impulses(times, np.where(jolt >= JOLT_M_S2, jolt, 0.0))
    if not peaks.size:
        raise DataError(
            f"clap: {unit.name} felt no jolt of {JOLT_M_S2:g} m/s2 (the largest is {float(jolt.max()):.1f}); "
            "name the unit "
            "that was struck with --sensor"
        )
    return np.asarray(times[peaks])


def _impulses(times: Floats, strength: Floats) -> Ints:
    """Rows of the strongest samples, `APART_S` apart, each the first of its impulse that has half of its strength."""
    found: list[int] = []
    for row in np.argsort(-strength):
        if strength[row] <= 0.0 or strength[row] < SHARE * strength.max() or len(found) >= MOST:
            break
        if all(abs(times[row] - times[one]) > APART_S for one in found):
            found.append(int(row))
    onsets = []
    for row in found:
        near = np.flatnonzero((times >= times[row] - 0.5 * APART_S) & (times <= times[row]))
        onsets.append(int(near[np.argmax(strength[near] >= 0.5 * strength[row])]))
    return np.sort(np.array(onsets, dtype=np.int64))


def _median_around(values: Floats, half: int) -> Floats:
    """Medians of blocks of `half` samples, interpolated: the background."""
    blocks = max(1, len(values) // half)
    parts = np.array_split(values, blocks)
    middles = np.cumsum([len(part) for part in parts]) - np.array([len(part) / 2 for part in parts])
    background: Floats = np.interp(
        np.arange(len(values)), middles, [float(np.median(part)) for part in parts]
    )
    return background


def _listed(times: Floats) -> str:
    return ", ".join(f"{one:.2f}" for one in times)
