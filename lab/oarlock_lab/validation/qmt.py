"""Sixteen units on a person, no reference: does the trunk stay still when it stands still?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from oarlock import Recording, Track
from oarlock.formats.datasets.qmt import read_qmt
from oarlock.recording import ImuStream
from oarlock.storage.arrays import Bools, Floats

from . import others, ours
from .estimate import OrientationEstimate, Outcome, attempt
from .results import Collected, Panel, Plot, ResultCurve, SetResult
from .rotations import rotation

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
    "from the first rest, in which the person stands with arms hanging. "
    "The accelerometers have errors of their own: at rest they read 9.9 to 10.1 m/s2 where gravity is 9.81. An error "
    "of 0.2 m/s2 across the vertical is 1.2 deg: this cannot compare two estimates that differ by less, and one "
    "with the right bias seems to err. Less its bias, an accelerometer reads gravity in every posture. The last table "
    "tests this; it sees the part of a bias that is along the vertical."
)
NO_BIAS = "as read"
GRAVITY_M_S2 = 9.81

Rest = tuple[float, float]


def run(data_folder: Path) -> SetResult:
    """Score the recording."""
    file = data_folder / FOLDER / FILE
    if not file.is_file():
        return SetResult(FOLDER, TITLE, TEXT, absent=f"no {FOLDER}/{FILE}")
    recording = read_qmt(file)
    still = rests(recording)
    if not still:
        return SetResult(FOLDER, TITLE, TEXT, absent="the trunk never rests")
    longest = max(still, key=lambda r: r[1] - r[0])
    offsets, drifts, norms = Collected(), Collected(), Collected()
    differences: dict[str, dict[str, Floats]] = {segment: {} for segment in TRUNK}
    tracks: dict[str, Track] = {}
    norms.put(NO_BIAS, gravity_errors_m_s2(recording, still))
    for outcome in _outcomes(recording, still[0], tracks):
        if outcome.name in tracks:
            norms.add(outcome, gravity_errors_m_s2(recording, still, tracks[outcome.name]))
        vectors = _differences(outcome, recording)
        offsets.add(outcome, {s: _rms_deg(v, recording, still) for s, v in vectors.items()})
        drifts.add(outcome, {s: _drift_deg(v, recording, longest) for s, v in vectors.items()})
        for segment, vector in vectors.items():
            differences[segment][outcome.name] = vector
    text = ", ".join(f"{a:.1f} to {b:.1f} s" for a, b in still)
    tables = (
        offsets.table("Vertical against the accelerometer at rest, RMS", text=f"Rests: {text}."),
        drifts.table(f"Drift over the longest rest ({longest[1] - longest[0]:.0f} s)"),
        norms.table("Accelerometer less its bias against gravity at rest, RMS", unit="m/s2", digits=3),
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


def gravity_errors_m_s2(
    recording: Recording, still_periods: list[Rest], track: Track | None = None
) -> dict[str, float]:
    """By how much the norm of each trunk accelerometer at rest, less the bias of the track, is not gravity, RMS."""
    errors = {}
    for segment in TRUNK:
        time_s = recording[segment].time_s
        rows = np.logical_or.reduce([_within(recording, rest) for rest in still_periods])
        accel = _readings(recording, segment)[1]
        if track is not None:
            columns = track.columns()
            biases = [columns[f"{segment}.accel_bias_{axis} [m/s2]"] for axis in "xyz"]
            accel -= np.column_stack([np.interp(time_s, track.time_s, bias) for bias in biases])
        norms = np.linalg.norm(_low_passed(accel, recording)[rows], axis=1)
        errors[segment] = float(np.sqrt(np.mean((norms - GRAVITY_M_S2) ** 2)))
    return errors


def _outcomes(recording: Recording, first: Rest, tracks: dict[str, Track]) -> list[Outcome]:
    """Also fills in the tracks by the names of their estimates."""
    trunk = recording.only(TRUNK)

    def tracked() -> Iterator[OrientationEstimate]:
        for estimate, track in ours.qmt_tracks(recording, TRUNK, first):
            tracks[estimate.name] = track
            yield estimate

    return [
        *attempt(ours.NAMES, tracked),
        *attempt(others.VQF_WITHOUT_MAG, lambda: others.vqf(trunk, others.VQF_WITHOUT_MAG)),
        *attempt(others.IMUFUSION_WITHOUT_MAG, lambda: others.imufusion(trunk, others.IMUFUSION_WITHOUT_MAG)),
    ]


def _differences(outcome: Outcome, recording: Recording) -> dict[str, Floats]:
    """Segment -> estimated minus measured direction of up, (T, 3) in the unit's axes, at its samples."""
    if not isinstance(outcome, OrientationEstimate):
        return {}
    still_periods = {}
    for segment in TRUNK:
        if segment not in outcome.quats:
            continue
        there = np.isfinite(outcome.quats[segment]).all(axis=1)
        up = np.full((len(outcome.time_s), 3), np.nan)
        up[there] = rotation(outcome.quats[segment][there]).inv().apply([0.0, 0.0, 1.0])
        at = np.column_stack([np.interp(recording[segment].time_s, outcome.time_s, c) for c in up.T])
        pull = _low_passed(_readings(recording, segment)[1], recording)
        still_periods[segment] = at - pull / np.linalg.norm(pull, axis=1, keepdims=True)
    return still_periods


def _low_passed(accel: Floats, recording: Recording) -> Floats:
    window = np.ones(_averaged(recording)) / _averaged(recording)
    return np.column_stack([np.convolve(c, window, mode="same") for c in accel.T])


def _averaged(recording: Recording) -> int:
    """Number of samples over which the accelerometer is averaged."""
    return round(AVERAGED_S * recording[TRUNK[0]].rate_hz)


def _within(recording: Recording, rest: Rest) -> Bools:
    """Samples of a rest that are far enough from its ends for the averaged accelerometer."""
    time_s = recording[TRUNK[0]].time_s
    return (time_s >= rest[0] + AVERAGED_S / 2) & (time_s <= rest[1] - AVERAGED_S / 2)


def _rms_deg(difference: Floats, recording: Recording, still: list[Rest]) -> float:
    rows = np.logical_or.reduce([_within(recording, rest) for rest in still])
    return float(np.degrees(np.sqrt(np.nanmean(np.sum(difference[rows] ** 2, axis=1)))))


def _drift_deg(difference: Floats, recording: Recording, rest: Rest) -> float:
    rows = np.flatnonzero(_within(recording, rest))
    count = _averaged(recording)
    first, last = (difference[part].mean(axis=0) for part in (rows[:count], rows[-count:]))
    return float(np.degrees(np.linalg.norm(last - first)))


def _plots(differences: dict[str, dict[str, Floats]], recording: Recording, rest: Rest) -> tuple[Plot, ...]:
    rows = _within(recording, rest)
    time_s = recording[TRUNK[0]].time_s[rows]
    panels: list[Panel] = []
    for segment, by_name in differences.items():
        lines = tuple(
            ResultCurve(
                n, time_s, np.degrees(np.linalg.norm(v[rows], axis=1)), "ours" if n in ours.NAMES else "other"
            )
            for n, v in by_name.items()
        )
        panels.append((f"{segment.replace('_', ' ')}, deg", lines))
    title = (
        f"Estimated vertical against the accelerometer in the longest rest, {rest[0]:.0f} to {rest[1]:.0f} s"
    )
    return (Plot("qmt-rest", title, tuple(panels)),) if differences[TRUNK[0]] else ()
