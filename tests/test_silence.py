"""Seconds and years in which nothing is read: the estimate is wide meanwhile, starts anew, and is soon right."""

from functools import cache

import numpy as np
import pytest

import oarlock
from oarlock import Recording, Track, rowing

FROM_S = 14.0


@cache
def body(name: str) -> tuple[oarlock.Model, Recording, Track]:
    model = oarlock.load_model(name)
    if name == "sculler":
        truth, recording = oarlock.simulate(model, rowing.sculling(model, duration_s=24.0), seed=3)
        return model, recording, truth
    random, time_s = np.random.default_rng(3), np.arange(0.0, 24.0, 0.01)
    waves = [
        0.4
        * np.minimum(time_s / 2.0, 1.0)
        * np.sin(2.0 * np.pi * random.uniform(0.3, 0.7) * time_s + random.uniform(0.0, 6.0))
        for _ in model.joint_names
    ]
    truth, recording = oarlock.simulate(
        model, oarlock.simulation.Motion(model.joint_names, time_s, np.column_stack(waves)), seed=3
    )
    return model, recording, truth


def hinges(track: Track) -> list[str]:
    """Hinges that encoders do not read."""
    return [
        n for n in track.joint_names if hasattr(track[n], "angle_rad") and "oar" not in n and "hand" not in n
    ]


def is_right(track: Track, truth: Track, from_s: float, later_s: float = 0.0) -> bool:
    """Whether the truth lies within three standard deviations, and these are no wider than a heading that is sought."""
    rows = track.time_s > from_s + later_s + 3.0
    assert rows.sum() > 200
    for name in hinges(track):
        error = track[name].angle_rad[rows] - np.interp(
            track.time_s[rows] - later_s, truth.time_s, truth[name].angle_rad
        )
        if (
            np.mean(np.abs(error) < 3.0 * track[name].std_rad[rows]) < 0.8
            or np.degrees(np.median(np.abs(error))) > 30.0
        ):
            return False
    return True


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("silence_s", [pytest.param(1.0, marks=pytest.mark.long), 5.0])
@pytest.mark.parametrize("name", ["sculler", "arm7"])
def test_seconds_without_any_reading(name: str, silence_s: float, smooth: bool) -> None:
    model, recording, truth = body(name)
    cut = Recording(
        [s.at_rows(np.flatnonzero((s.time_s < FROM_S) | (s.time_s >= FROM_S + silence_s))) for s in recording]
    )
    track = oarlock.track(model, cut)
    track = oarlock.smooth(track) if smooth else track
    within = (track.time_s > FROM_S + 0.5) & (track.time_s < FROM_S + silence_s - 0.1)
    if within.any():
        # A limb turns by about a radian in a second in which nothing reads it.
        assert float(np.degrees(np.median(track.q_std[within]))) > 15.0
    # Lost, it is 30 to 150 deg off for the rest of the recording, with bands of 2 deg.
    assert is_right(track, truth, FROM_S + silence_s)


@pytest.mark.parametrize("by_s", [pytest.param(100.0, marks=pytest.mark.long), 3.15e8])
@pytest.mark.parametrize("name", ["sculler", "arm7"])
def test_a_clock_that_was_set_splits_a_recording(name: str, by_s: float) -> None:
    model, recording, truth = body(name)
    later = [s.at_rows(slice(None), time_s=s.time_s + by_s * (s.time_s >= FROM_S)) for s in recording]
    track = oarlock.track(model, Recording(later))
    assert is_right(track, truth, FROM_S, by_s)
    notes = [note for note in track.notes if "no reading for" in note or "packets missing" in note]
    assert len(notes) == len(recording)
    if by_s > 1e6:
        assert all("no reading for 9.98 years after 14.0 s" in note for note in notes), notes


def test_each_reading_a_second_is_no_silence() -> None:
    model, recording, _ = body("arm7")
    slow = Recording([s.at_rows(slice(None, None, 50)) for s in recording])
    track = oarlock.track(model, slow)
    assert len(track.time_s) > 40
    assert np.isfinite(track.q).all()
