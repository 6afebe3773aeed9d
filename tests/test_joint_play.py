"""Hinges with play: found by the residual of the axes, tracked as two more small hinges."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock.model.joint_play import hinges_that_can_have_play
from oarlock.storage.errors import DataError
from refusals import assert_refused

RATE_HZ = 50.0
PLAY_RAD = np.radians(2.0)
SEEDS = (1, 2, 3)


@pytest.fixture(scope="module")
def model():
    """Brisk, with units apart from the hinge and good accelerometers, which show the relative heading."""
    plain = oarlock.load_model(
        "openaxes_ur5", parameters={"radius_y": -0.15, "carpus_y": 0.15, "carpus_z": 0.1}
    )
    process = {"kind": "singer", "time_s": 0.2, "density": 50.0, "start_std": [0.2, 0.5, 2.0]}
    quiet = {"accel_std_m_s2": 0.05, "accel_bias_start_std_m_s2": 0.02}
    return plain.with_tables(
        {
            "process": {"ball": process, "hinge": process},
            "sensor": [{"name": name, **quiet} for name in ("radius", "carpus")],
        }
    )


def waving(model, seed, play_rad, seconds=20.0):
    """Brisk turns about all axes; the hinge leaves its axis by `play_rad` (standard deviation) within half a second."""
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, seconds, 1.0 / RATE_HZ)

    def waves(size, fastest_hz):
        hertz, phase = random.uniform(0.1, fastest_hz, 4), random.uniform(0.0, 2.0 * np.pi, 4)
        return size * np.sin(2.0 * np.pi * hertz * time_s[:, None] + phase).sum(axis=1) / np.sqrt(2.0)

    # Everything begins at rest in the posture of the model.
    begin = np.minimum(time_s, 1.0)
    columns = [
        begin * (waves(play_rad, 1.5) if "play" in name else waves(0.5, 0.8))
        for name in model.coordinate_names
    ]
    return oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, np.column_stack(columns))


def trial(model, seed, play_rad):
    loose = oarlock.model.with_play(model, {"wrist": PLAY_RAD})
    return oarlock.simulate(loose, waving(loose, seed, play_rad), rate_hz=RATE_HZ, seed=seed)


def between(track):
    """Orientation of the second link in the first."""
    one, two = (
        Rotation.from_quat(np.array(track.frame_quat_wxyz(f, relative_to="root")), scalar_first=True)
        for f in ("radius", "carpus")
    )
    return one.inv() * two


def error_rad(model, seed, play_rad):
    """Root mean square of the whole relative orientation after 5 s: with the rigid hinge, and with play."""
    truth, recording = trial(model, seed, play_rad)
    true = between(truth)
    found = []
    for body in (model, oarlock.model.with_play(model, {"wrist": PLAY_RAD})):
        track = oarlock.track(body, recording)
        rows = np.searchsorted(truth.time_s, track.time_s - 0.5 / RATE_HZ)
        off = (true[rows].inv() * between(track)).magnitude()[track.time_s > 5.0]
        found.append(float(np.sqrt(np.mean(off**2))))
    return found


def test_play_that_is_there_is_tracked_and_play_that_is_not_costs_less_than_that(model):
    there = np.array([error_rad(model, seed, PLAY_RAD) for seed in SEEDS])
    absent = np.array([error_rad(model, seed, 0.0) for seed in SEEDS])
    print("play", np.degrees(there).round(2), "none", np.degrees(absent).round(2))
    assert there[:, 1].mean() < 0.5 * there[:, 0].mean()
    # The hinge no longer shows the relative heading, whose prior is as wide as the play; a seed is one draw of it.
    assert (absent[:, 1] - absent[:, 0]).mean() < PLAY_RAD


@pytest.mark.parametrize(("play_rad", "named"), [(PLAY_RAD, ["wrist"]), (0.0, [])])
def test_the_axes_show_play(model, play_rad, named):
    for seed in SEEDS:
        found = oarlock.calibration.calibrate_hinge_axes(model, trial(model, seed, play_rad)[1])
        joint = found.noted["joint"]["wrist"]
        print(seed, joint["residual_rad_s"], joint["hinge_rad_s"])
        assert found.noted["play"] == named


def with_rest(motion, rest_s):
    """The motion ends within its last second, and a rest follows."""
    more = np.arange(0.0, motion.time_s[-1] + rest_s, 1.0 / RATE_HZ)
    ends = np.clip(motion.time_s[-1] - motion.time_s, 0.0, 1.0)
    q = np.zeros((len(more), motion.q.shape[1]))
    q[: len(motion.q)] = motion.q * ends[:, None]
    return oarlock.simulation.Motion(motion.coordinate_names, more, q)


@pytest.mark.parametrize(("play_rad", "named"), [(PLAY_RAD, ["wrist"]), (0.0, [])])
def test_a_long_rest_hides_no_play(model, play_rad, named):
    loose = oarlock.model.with_play(model, {"wrist": PLAY_RAD})
    for seed in SEEDS:
        motion = with_rest(waving(loose, seed, play_rad), 40.0)
        _, recording = oarlock.simulate(loose, motion, rate_hz=RATE_HZ, seed=seed)
        assert oarlock.calibration.calibrate_hinge_axes(model, recording).noted["play"] == named


@pytest.mark.parametrize(("play_rad", "named"), [(PLAY_RAD, ["wrist"]), (0.0, [])])
@pytest.mark.parametrize("hinge_share", [0.03, 0.1])
def test_a_hinge_that_hardly_turns_between_brisk_links_has_play_only_if_it_has(
    model, hinge_share, play_rad, named
):
    loose = oarlock.model.with_play(model, {"wrist": PLAY_RAD})
    for seed in SEEDS:
        motion = waving(loose, seed, play_rad)
        shares = np.where(np.array(loose.coordinate_names) == "wrist", hinge_share, 1.0)
        slow = oarlock.simulation.Motion(motion.coordinate_names, motion.time_s, shares * motion.q)
        _, recording = oarlock.simulate(loose, slow, rate_hz=RATE_HZ, seed=seed)
        assert oarlock.calibration.calibrate_hinge_axes(model, recording).noted["play"] == named


def test_two_small_hinges_precede_the_joint(model):
    loose = oarlock.model.with_play(model, {"wrist": 0.05})
    assert [n for n in loose.coordinate_names if n not in model.coordinate_names] == [
        "wrist_play_1",
        "wrist_play_2",
    ]
    joints = {j.name: j for j in loose.describe().joints}
    assert tuple(joints["wrist_play_1"].limits) == (-0.1, 0.1)
    q = np.zeros((1, len(loose.coordinate_names)))
    q[0, list(loose.coordinate_names).index("wrist")] = 0.7
    bent = dict(zip(loose.frame_names, loose.forward_kinematics(q)[0], strict=True))["carpus"]
    np.testing.assert_allclose(bent[:3, :3], Rotation.from_rotvec([0.7, 0, 0]).as_matrix(), atol=1e-12)
    q[0, list(loose.coordinate_names).index("wrist_play_1")] = 0.1
    moved = dict(zip(loose.frame_names, loose.forward_kinematics(q)[0], strict=True))["carpus"]
    # Across the axis: the hinge's axis itself moves by this angle.
    assert np.arccos(moved[0, 0]) == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize(("name", "joint"), [("arm7", "elbow_flexion"), ("pendulum3", None)])
def test_without_play_in_the_angles_every_frame_stays(name, joint):
    rigid = oarlock.load_model(name)
    hinges = [j.name for j in rigid.describe().joints if j.kind == "hinge"]
    loose = oarlock.model.with_play(rigid, {joint or hinges[-1]: 0.05})
    q = np.random.default_rng(1).standard_normal((1, len(rigid.coordinate_names)))
    more = np.zeros((1, len(loose.coordinate_names)))
    more[0, [list(loose.coordinate_names).index(n) for n in rigid.coordinate_names]] = q[0]
    poses = dict(zip(loose.frame_names, loose.forward_kinematics(more)[0], strict=True))
    for frame, pose in zip(rigid.frame_names, rigid.forward_kinematics(q)[0], strict=True):
        np.testing.assert_allclose(poses[frame], pose, atol=1e-12)


def test_what_cannot_have_play_is_refused(model):
    assert_refused(lambda: oarlock.model.with_play(model, {"wrst": 0.05}), "wrst", "wrist")
    assert_refused(lambda: oarlock.model.with_play(model, {"radius": 0.05}), "radius", "wrist")
    assert_refused(lambda: oarlock.model.with_play(model, {"wrist": 0.0}), "wrist", "more than 0")
    sculler = oarlock.load_model("sculler")
    assert_refused(lambda: oarlock.model.with_play(sculler, {"trunk": 0.05}), "trunk", "2 frames")


def test_the_command_line_says_and_tracks_it(model, tmp_path):
    trial(model, SEEDS[0], PLAY_RAD)[1].save(tmp_path / "rec")
    words = [tmp_path / "rec", "--model", "openaxes_ur5"]
    assert "--play wrist=3" in run("calibrate", "axes", *words, "--out", tmp_path / "cal.toml").output
    run("track", *words, "--play", "wrist=2", "--out", tmp_path / "track")
    assert "wrist_play_1" in oarlock.load_track(tmp_path / "track").coordinate_names


@pytest.mark.parametrize("name", ["full_body", "sculler"])
def test_every_hinge_of_a_body_gets_play_or_a_reason(name):
    body = oarlock.load_model(name)
    possible = hinges_that_can_have_play(body)
    hinges = [j.name for j in body.describe().joints if j.kind == "hinge"]
    assert possible and set(possible) <= set(hinges)
    for hinge in hinges:
        if hinge in possible:
            loose = oarlock.model.with_play(body, {hinge: 0.05})
            assert len(loose.coordinate_names) == len(body.coordinate_names) + 2
            assert hinge not in hinges_that_can_have_play(loose)
        else:
            assert_refused(lambda own=hinge: oarlock.model.with_play(body, {own: 0.05}), hinge)


def test_play_given_twice_and_hinges_without_are_one_clear_refusal(model):
    loose = oarlock.model.with_play(model, {"wrist": 0.05})
    assert_refused(lambda: oarlock.model.with_play(loose, {"wrist": 0.05}), "wrist", "has play already")
    sculler = oarlock.load_model("sculler")
    with pytest.raises(DataError) as refused:
        oarlock.model.with_play(sculler, {"nothing_like_it": 0.05})
    assert "trunk" not in str(refused.value)
