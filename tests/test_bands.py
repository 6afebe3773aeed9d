"""Bands of tracks: their bound, what a calibration may say of them, and a run that is cut in two."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import oarlock
from exact_recording import ELEVEN, SETTLED_S, UNITS, load_excerpt, sculler
from oarlock.rowing import FieldEffects, simulate_field
from refusals import assert_refused


def wild() -> oarlock.Recording:
    """Everything that is wrong with bodies and straps; clocks and radio are fine."""
    quiet = {
        "clock_offset_s": 0.0,
        "clock_drift": 0.0,
        "clock_jitter_s": 0.0,
        "packet_loss": 0.0,
        "gap_s": 0.0,
    }
    effects = replace(FieldEffects(), noise_factor=3.0, **quiet)
    trial = simulate_field(
        sculler(), effects, duration_s=20.0, rate_spm=(20.0, 34.0), condition="B-B", seed=52
    )
    return trial.recording


NOTHING_KNOWN_RAD = 2.0


@pytest.mark.parametrize("structure", ["tree", "strapdown"])
def test_no_band_is_wider_than_the_range_of_its_joint(structure: str) -> None:
    units = {unit: np.full(3, NOTHING_KNOWN_RAD) for unit in UNITS}
    known = oarlock.Calibration(mount_stds_rad=units)
    live = oarlock.track(sculler(), load_excerpt().recording, known, oarlock.Config(structure=structure))
    ranges = {joint.name: np.ptp(joint.limits) for joint in sculler().describe().joints if joint.limits}
    for track in (live, oarlock.smooth(live)):
        settled = track.time_s > SETTLED_S
        for name in ELEVEN:
            series, prior = track[name], ranges[name] / 4
            assert series.std.max() <= 2 * prior * (1 + 1e-12), name
            assert not series.observed[settled & (series.std >= prior * (1 - 1e-12))].any(), name


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"parameter_stds": {"l_ua": 0.01}}, ["parameter_stds 'l_ua'", "l_ua_r"]),
        ({"mount_stds_rad": {"chest": np.full(3, 0.01)}}, ["mount_stds_rad 'chest'", "back"]),
        ({"mount_offset_stds_m": {"seat": np.full(3, 0.01)}}, ["mount_offset_stds_m 'seat'", "back"]),
    ],
)
def test_deviations_of_what_is_not_there_are_refused(told: dict[str, Any], words: list[str]) -> None:
    assert_refused(
        lambda: oarlock.track(sculler(), load_excerpt().recording, oarlock.Calibration(**told)), *words
    )


@pytest.mark.parametrize("structure", ["tree", "strapdown"])
def test_a_run_cut_in_two_has_the_same_bands(structure: str) -> None:
    config, recording = oarlock.Config(structure=structure), wild()
    whole = oarlock.track(sculler(), recording, config=config)
    half_s = 7.0
    first = oarlock.track(sculler(), cut(recording, 0.0, half_s), config=config)
    assert first.last_belief is not None
    rest = cut(recording, half_s, 1e9)
    second = oarlock.track(sculler(), rest, config=config, start=first.last_belief)
    np.testing.assert_array_equal(second.q_std, whole.q_std[whole.time_s > half_s])


@pytest.mark.parametrize("gyro_std_rad_s, accel_std_m_s2", [(0.01, 0.05), (0.3, 0.5)])
def test_noise_that_a_model_states_is_in_the_bands(gyro_std_rad_s: float, accel_std_m_s2: float) -> None:
    noise = {"gyro_std_rad_s": gyro_std_rad_s, "accel_std_m_s2": accel_std_m_s2}
    model = oarlock.load_model("arm")
    for name in model.sensor_names:
        model = model.with_sensor(name, **noise)
    truth, recording = oarlock.simulate(model, waving(model), seed=21)
    scores = oarlock.evaluate(oarlock.track(model, recording), truth).joints
    hinges = [score for score in scores if score.name.startswith(("elbow", "wrist"))]
    # Means over 28 s of movement that lasts a second at a time: a sound filter stays below twice the expected 1.
    assert len(hinges) == 4 and max(score.nees for score in hinges) < 2.0


def waving(model: oarlock.Model) -> oarlock.simulation.Motion:
    """All joints of an arm turn by sums of sines about a bent elbow, from the rest posture on."""
    random, time_s = np.random.default_rng(21), np.arange(0.0, 30.0, 0.01)
    begin = np.clip((time_s - 1.0) / 3.0, 0.0, 1.0)

    def waves(columns: int) -> np.ndarray:
        phases = 2.0 * np.pi * random.uniform(0.1, 0.8, (4, columns)) * time_s[:, None, None]
        sines = np.sin(phases + random.uniform(0.0, 2.0 * np.pi, (4, columns)))
        return 0.15 * begin[:, None] * sines.sum(axis=1)

    joints = {}
    for joint in model.describe().joints:
        columns = {"free": 6, "ball": 3}.get(joint.kind, 1)
        joints[joint.name] = waves(columns)[:, 0] if columns == 1 else waves(columns)
    joints["elbow_flexion_r"] += 1.2 * begin
    joints["elbow_pronation_r"] += 1.4
    return oarlock.simulation.Motion.from_joints(time_s, joints)


def cut(recording: oarlock.Recording, begin_s: float, end_s: float) -> oarlock.Recording:
    streams = []
    for stream in recording.streams:
        rows = (stream.time_s > begin_s) & (stream.time_s <= end_s) | (
            (stream.time_s == 0.0) & (begin_s == 0.0)
        )
        values = {name: v[rows] for name, v in stream.values.items()}
        streams.append(type(stream)(stream.name, stream.time_s[rows], **values))
    return oarlock.Recording(streams)
