"""Sixteen units on a person, no reference: does the trunk stay still when it stands still?"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from oarlock import ImuStream, Recording
from oarlock.formats.datasets.qmt import read_qmt

from . import others, ours
from .estimate import Estimate, Outcome, attempt
from .results import Collected, Curve, Panel, Plot, SetResult
from .rotations import Bools, Floats, rotation

FOLDER = "qmt_full_body"
FILE = "full_body_example_data.mat"
TRUNK = ("hip", "lower_back", "upper_back")

STILL_RAD_S = 0.1
SHORTEST_REST_S = 3.0
AVERAGED_S = 1.0

TITLE = "A person with sixteen units (qmt)"
TEXT = (
    "Units on all segments of a person, accelerometer and gyroscope, 100 Hz, 100 s. There is no "
    "reference. While the person stands still the accelerometer tells the vertical: scored are how far "
    "the estimated vertical is from it (root mean square over the rests, in the axes of each trunk unit), "
    "and how far the difference drifts from the first to the last second of the longest rest. Oarlock's mounts come "
    "from the first rest, in which the person stands with arms hanging."
)

Rest = tuple[float, float]


def run(data_folder: Path) -> SetResult:
    """Score the recording."""
    file = data_folder / FOLDER / FILE
    if not file.is_file():
        return SetResult(FOLDER, TITLE, TEXT, absent=f"no {FOLDER}/{FILE}")
    recording = read_qmt(file)
    found = rests(recording)
    if not found:
        return SetResult(FOLDER, TITLE, TEXT, absent="the trunk never rests")
    longest = max(found, key=lambda r: r[1] - r[0])
    offsets, drifts = Collected(), Collected()
    differences: dict[str, dict[str, Floats]] = {segment: {} for segment in TRUNK}
    for outcome in _outcomes(recording, found[0]):
        vectors = _differences(outcome, recording)
        offsets.add(outcome, {s: _rms_deg(v, recording, found) for s, v in vectors.items()})
        drifts.add(outcome, {s: _drift_deg(v, recording, longest) for s, v in vectors.items()})
        for segment, vector in vectors.items():
            differences[segment][outcome.name] = vector
    text = ", ".join(f"{a:.1f} to {b:.1f} s" for a, b in found)
    tables = (
        offsets.table("Vertical against the accelerometer at rest, RMS", text=f"Rests: {text}."),
        drifts.table(f"Drift over the longest rest ({longest[1] - longest[0]:.0f} s)"),
    )
    return SetResult(FOLDER, TITLE, TEXT, tables, _plots(differences, recording, longest))


def rests(recording: Recording) -> list[Rest]:
    """Spans in s in which no unit of the trunk turns."""
    turning = np.max([np.linalg.norm(_readings(recording, s)[0], axis=1) for s in TRUNK], axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], turning < STILL_RAD_S, [False]]).astype(int)))
    time_s = recording[TRUNK[0]].time_s
    spans = [(float(time_s[a]), float(time_s[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(a, b) for a, b in spans if b - a >= SHORTEST_REST_S]


def _readings(recording: Recording, segment: str) -> tuple[Floats, Floats]:
    """Gyroscope and accelerometer, each (T, 3)."""
    stream = recording[segment]
    if not isinstance(stream, ImuStream) or stream.gyro_rad_s is None or stream.accel_m_s2 is None:
        raise ValueError(f"{segment}: no gyroscope or no accelerometer")
    return np.array(stream.gyro_rad_s), np.array(stream.accel_m_s2)


def _outcomes(recording: Recording, first: Rest) -> list[Outcome]:
    trunk = recording.only(TRUNK)
    return [
        *attempt(ours.NAMES, lambda: ours.track_qmt(recording, TRUNK, first)),
        *attempt(others.VQF_WITHOUT_MAG, lambda: others.vqf(trunk, others.VQF_WITHOUT_MAG)),
        *attempt(others.IMUFUSION_WITHOUT_MAG, lambda: others.imufusion(trunk, others.IMUFUSION_WITHOUT_MAG)),
    ]


def _differences(outcome: Outcome, recording: Recording) -> dict[str, Floats]:
    """Segment -> estimated minus measured direction of up, (T, 3) in the unit's axes, at its samples."""
    if not isinstance(outcome, Estimate):
        return {}
    found = {}
    for segment in TRUNK:
        if segment not in outcome.quats:
            continue
        there = np.isfinite(outcome.quats[segment]).all(axis=1)
        up = np.full((len(outcome.time_s), 3), np.nan)
        up[there] = rotation(outcome.quats[segment][there]).inv().apply([0.0, 0.0, 1.0])
        at = np.column_stack([np.interp(recording[segment].time_s, outcome.time_s, c) for c in up.T])
        window = np.ones(_averaged(recording)) / _averaged(recording)
        accel = _readings(recording, segment)[1]
        pull = np.column_stack([np.convolve(c, window, mode="same") for c in accel.T])
        found[segment] = at - pull / np.linalg.norm(pull, axis=1, keepdims=True)
    return found


def _averaged(recording: Recording) -> int:
    """Number of samples over which the accelerometer is averaged."""
    return round(AVERAGED_S * recording[TRUNK[0]].rate_hz)


def _within(recording: Recording, rest: Rest) -> Bools:
    """Samples of a rest that are far enough from its ends for the averaged accelerometer."""
    time_s = recording[TRUNK[0]].time_s
    return (time_s >= rest[0] + AVERAGED_S / 2) & (time_s <= rest[1] - AVERAGED_S / 2)


def _rms_deg(difference: Floats, recording: Recording, found: list[Rest]) -> float:
    kept = np.logical_or.reduce([_within(recording, rest) for rest in found])
    return float(np.degrees(np.sqrt(np.nanmean(np.sum(difference[kept] ** 2, axis=1)))))


def _drift_deg(difference: Floats, recording: Recording, rest: Rest) -> float:
    rows = np.flatnonzero(_within(recording, rest))
    count = _averaged(recording)
    first, last = (difference[part].mean(axis=0) for part in (rows[:count], rows[-count:]))
    return float(np.degrees(np.linalg.norm(last - first)))


def _plots(differences: dict[str, dict[str, Floats]], recording: Recording, rest: Rest) -> tuple[Plot, ...]:
    kept = _within(recording, rest)
    time_s = recording[TRUNK[0]].time_s[kept]
    panels: list[Panel] = []
    for segment, by_name in differences.items():
        lines = tuple(
            Curve(
                n, time_s, np.degrees(np.linalg.norm(v[kept], axis=1)), "ours" if n in ours.NAMES else "other"
            )
            for n, v in by_name.items()
        )
        panels.append((f"{segment.replace('_', ' ')}, deg", lines))
    title = (
        f"Estimated vertical against the accelerometer in the longest rest, {rest[0]:.0f} to {rest[1]:.0f} s"
    )
    return (Plot("qmt-rest", title, tuple(panels)),) if differences[TRUNK[0]] else ()
