"""Units that turn slowly on their links, as on foam or skin: a state where the model file asks for it."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import oarlock
from command_line import run
from oarlock.storage.array_gate import FloatArray
from refusals import assert_refused

TURNING_STD_RAD = float(np.radians(3.0))
TURNING_TIME_S = 1.0
SEEDS = (1, 2, 3)
DURATION_S = 30.0
SETTLED_S = 2.0
COVERED = 0.85
"""Least share of the truth in bands of 95 %."""

BODY = """
format = 1
name = "padded"
description = "a link with one unit screwed on and one on foam"
[world]
up = "z"
forward = "x"
[[joint]]
name = "arm"
kind = "hinge"
[[frame]]
name = "arm"
parent = "root"
joint = "arm"
axis = "y"
transform = { translation = [0, 0, 0] }
[[sensor]]
name = "screwed"
kind = "imu"
frame = "arm"
mount = { offset = [0.2, 0, 0] }
gyro_std_rad_s = 0.02
accel_std_m_s2 = 0.2
"""
UNIT = """
[[sensor]]
name = "padded"
kind = "imu"
gyro_std_rad_s = 0.02
accel_std_m_s2 = 0.2
"""
RIGID = BODY + UNIT + 'frame = "arm"\nmount = { offset = [0.3, 0, 0] }\n'
TURNING = f"turning_std_rad = {TURNING_STD_RAD}, turning_time_s = {TURNING_TIME_S}"
SOFT = BODY + UNIT + f'frame = "arm"\nmount = {{ offset = [0.3, 0, 0], {TURNING} }}\n'
FOAM = """
[[joint]]
name = "foam"
kind = "ball"
[[frame]]
name = "foam"
parent = "arm"
joint = "foam"
transform = { translation = [0.3, 0, 0] }
"""
"""The ground truth: the unit's own joint on the link."""


def model_of(text: str) -> oarlock.Model:
    return oarlock.Model.from_toml(text, "padded.toml", {})


def slow_turning(time_s: FloatArray, seed: int) -> FloatArray:
    """(K, 3) a course with the process's own standard deviation and correlation time."""
    rng, pole, step_s = np.random.default_rng(seed), 2.0 / TURNING_TIME_S, time_s[1] - time_s[0]
    state, course = TURNING_STD_RAD * np.array([[1.0], [pole]]) * rng.standard_normal((2, 3)), []
    push = TURNING_STD_RAD * np.sqrt(4.0 * pole**3 * step_s)
    for _ in time_s:
        course.append(state[0])
        change = -2.0 * pole * state[1] - pole**2 * state[0]
        rate = state[1] + change * step_s + push * rng.standard_normal(3)
        state = np.array([state[0] + rate * step_s, rate])
    return np.array(course)


@cache
def trial(seed: int, soft: bool) -> tuple[oarlock.Track, oarlock.Recording, FloatArray]:
    """Ground truth, recording, and the true turning at the end."""
    model = model_of(BODY + FOAM + UNIT + 'frame = "foam"\n')
    time_s = np.arange(0.0, DURATION_S + 0.01, 0.02)
    turning = slow_turning(time_s, seed) * soft
    arm = 0.6 * np.sin(2.0 * time_s) + 0.3 * np.sin(3.7 * time_s + 1.0)
    names = ("arm", "foam.rx", "foam.ry", "foam.rz")
    motion = oarlock.Motion(names, time_s, np.column_stack([arm, turning]))
    truth, recording = oarlock.simulate(model, motion, seed=seed, rate_hz=100.0)
    return truth, recording, turning[-1]


def errors(text: str, seed: int, soft: bool) -> tuple[FloatArray, FloatArray, oarlock.Track]:
    """Errors of the arm and its standard deviations once settled, rad."""
    truth, recording, _ = trial(seed, soft)
    track = oarlock.track(model_of(text), recording)
    kept = track.time_s > SETTLED_S
    true = np.interp(track.time_s, truth.time_s, truth["arm"].angle_rad)
    return (track["arm"].angle_rad - true)[kept], track["arm"].std_rad[kept], track


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_turning_is_no_error_of_the_joint_and_bands_cover_it() -> None:
    for seed in SEEDS:
        rigid, _, _ = errors(RIGID, seed, soft=True)
        soft, std, track = errors(SOFT, seed, soft=True)
        covered = np.mean(np.abs(soft) < 1.96 * std)
        print(seed, np.degrees([rms(rigid), rms(soft)]), covered)
        assert rms(soft) < 0.5 * rms(rigid)
        assert covered > COVERED
        assert {"padded.mount_rx [rad]", "padded.mount_rx.velocity [rad/s]"} <= set(track.columns())
        belief = track.last_belief
        assert belief is not None
        states = [belief.state_names.index(f"padded.mount_r{axis}") for axis in "xyz"]
        *_, true = trial(seed, soft=True)
        # The screwed-on unit and the hinge give the axes of the link: gravity and the swing show all three parts.
        off = belief.mean[states] - true
        assert (np.abs(off) < 3.0 * belief.std[states]).all()
        assert (np.abs(off) < 0.5 * TURNING_STD_RAD).all()


def test_a_unit_that_does_not_turn_loses_little() -> None:
    """The states may cost what the second unit adds, a factor sqrt(2) of noise, and by half more here."""
    for seed in SEEDS:
        rigid, *_ = errors(RIGID, seed, soft=False)
        soft, std, _ = errors(SOFT, seed, soft=False)
        print(seed, np.degrees([rms(rigid), rms(soft)]))
        assert rms(soft) < 1.5 * np.sqrt(2.0) * rms(rigid)
        assert np.mean(np.abs(soft) < 1.96 * std) > COVERED


def considered(text: str) -> int:
    """Number of consider states."""
    _, recording, _ = trial(SEEDS[0], soft=True)
    belief = oarlock.track(model_of(text), recording, None, oarlock.Config(consider="always")).last_belief
    assert belief is not None
    width, n = int(belief.doubt[2]), len(belief.mean)
    slopes = belief.doubt[5 : 5 + n * width].reshape(n, width)
    return int((slopes != 0.0).any(axis=0).sum())


def test_a_mount_that_is_a_state_is_no_consider_state() -> None:
    assert considered(SOFT) == considered(RIGID) - 3


def test_description() -> None:
    screwed, padded = (s.mount for s in model_of(SOFT).describe().sensors)
    assert screwed.turning_std_rad is None and screwed.turning_time_s is None
    assert padded.turning_std_rad == pytest.approx(TURNING_STD_RAD)
    assert padded.turning_time_s == TURNING_TIME_S


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("turning_time_s = 1.0", ["turning_std_rad", "add it"]),
        ("turning_std_rad = -0.1", ["turning_std_rad", "more than 0"]),
        ("turning_std_rad = 0.1, turning_time_s = 0", ["turning_time_s", "more than 0"]),
    ],
)
def test_mistakes(keys: str, words: list[str]) -> None:
    text = BODY + UNIT + f'frame = "arm"\nmount = {{ {keys} }}\n'
    assert_refused(lambda: model_of(text), *words, error=oarlock.ModelError)


def test_soft_mounts_of_a_model() -> None:
    body = oarlock.with_soft_mounts(model_of(RIGID), {"padded": 0.1})
    screwed, padded = (s.mount for s in body.describe().sensors)
    assert screwed.turning_std_rad is None
    assert (padded.turning_std_rad, padded.turning_time_s) == (0.1, 60.0)
    kept = oarlock.with_soft_mounts(model_of(SOFT), {"padded": 0.1}).describe().sensors[1].mount
    assert (kept.turning_std_rad, kept.turning_time_s) == (0.1, TURNING_TIME_S)
    np.testing.assert_array_equal(padded.offset, [0.3, 0.0, 0.0])
    assert_refused(lambda: oarlock.with_soft_mounts(model_of(RIGID), {"paded": 0.1}), "paded", "padded")


def test_soft_mounts_from_the_command_line(tmp_path: Path) -> None:
    _, recording, _ = trial(SEEDS[0], soft=True)
    recording.slice(0.0, 3.0).save(tmp_path / "rec")
    (tmp_path / "rigid.toml").write_text(RIGID)
    words = [str(tmp_path / "rec"), "--model", str(tmp_path / "rigid.toml"), "--out", str(tmp_path / "out")]
    run("track", *words, "--soft-mount", "padded=5")
    (_, padded) = oarlock.load_track(tmp_path / "out").model.describe().sensors
    assert padded.mount.turning_std_rad == pytest.approx(np.radians(5.0))


@pytest.mark.parametrize("std_rad", [0.0, -0.1, np.nan, np.inf])
def test_a_soft_mount_has_a_positive_standard_deviation(std_rad):
    assert_refused(
        lambda: oarlock.with_soft_mounts(model_of(RIGID), {"padded": std_rad}), "padded", "more than 0"
    )


def test_a_soft_mount_has_a_positive_correlation_time():
    assert_refused(lambda: oarlock.with_soft_mounts(model_of(RIGID), {"padded": 0.1}, 0.0), "0 s")
