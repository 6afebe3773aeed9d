"""Strapdown links read what is no gyroscope or accelerometer: encoders, inputs, positions, magnetometers, loops.

The readings are simulated along a known motion by the model's own kinematics, which strapdown links do not use.
"""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock

BODY = """
format = 1
name = "two_arms"
structure = "strapdown"
links = { joints = "hand_rig", start_std_rad = 0.05 }
joint = [
    { name = "trunk", kind = "free" },
    { name = "shoulder_r", kind = "ball" },
    { name = "shoulder_l", kind = "ball" },
    { name = "elbow", kind = "hinge", limits = [-2.6, 2.6]INPUT },
]
frame = [
    { name = "trunk", parent = "root", transform = {}, joint = "trunk" },
    { name = "arm_r", parent = "trunk", transform = { translation = [0, 0.2, 0.3] }, joint = "shoulder_r" },
    { name = "arm_l", parent = "trunk", transform = { translation = [0, -0.2, 0.3] }, joint = "shoulder_l" },
    { name = "forearm", parent = "arm_r", transform = { translation = [0, 0, -0.3] }, joint = "elbow", axis = "y" },
]
sensor = [
    { name = "trunk", kind = "imu", frame = "trunk", gyro_std_rad_s = 0.003, accel_std_m_s2 = 0.03MAG },
    { name = "arm_r", kind = "imu", frame = "arm_r", gyro_std_rad_s = 0.003, accel_std_m_s2 = 0.03MAG },
    { name = "arm_l", kind = "imu", frame = "arm_l", gyro_std_rad_s = 0.003, accel_std_m_s2 = 0.03MAG },SENSOR
]
world = { up = [0, 0, 1], forward = [1, 0, 0]FIELD }
"""
FIELD = ", magnetic_norm_ut = 50.0, magnetic_dip_rad = 1.1, magnetic_azimuth_rad = 0.4"
TIME_S = np.arange(0.0, 40.0, 0.1)


def read(text):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two_arms.toml"
        file.write_text(text)
        return oarlock.load_model(file)


def model(**parts):
    text = BODY
    for key in ("INPUT", "MAG", "SENSOR", "FIELD"):
        text = text.replace(key, parts.get(key.lower(), ""))
    return read(text + parts.get("more", ""))


def sway(phase, size, hz):
    """Rotation vectors of slow and quick turns that begin at none."""
    rise = np.minimum(TIME_S / 3.0, 1.0)
    waves = [size * rise * np.sin(2.0 * np.pi * hz * (1.0 + 0.13 * k) * TIME_S + phase + k) for k in range(3)]
    return np.column_stack(waves)


def motion(elbow=None):
    return oarlock.simulation.Motion.from_joints(
        TIME_S,
        {
            "trunk": np.column_stack([0.1 * sway(0.0, 1.0, 0.2), sway(0.4, 0.3, 0.3)]),
            "shoulder_r": sway(1.0, 0.6, 0.4),
            "shoulder_l": sway(2.0, 0.6, 0.5),
            "elbow": 1.0 * np.sin(2.0 * np.pi * 0.4 * TIME_S) if elbow is None else elbow,
        },
    )


def errors_deg(track, truth, name, parent="trunk"):
    """Angle between tracked and true rotation of a frame against another, deg."""

    def relative(one):
        own, other = (Rotation.from_quat(one.frame_quat_wxyz(f)[:, [1, 2, 3, 0]]) for f in (name, parent))
        return other.inv() * own

    rows = np.searchsorted(truth.time_s, track.time_s - 1e-6)
    return np.degrees((relative(truth)[rows].inv() * relative(track)).magnitude())


ENCODER = '\n    { name = "elbow_angle", kind = "encoder", joint = "elbow", std = 0.01 },'


@pytest.mark.parametrize("is_input", [False, True])
def test_an_encoder_holds_a_link_without_a_unit(is_input):
    body = model(sensor=ENCODER, input=", input = true, std = 0.01" if is_input else "")
    truth, recording = oarlock.simulate(body, motion(), seed=1)
    track = oarlock.track(body, recording)
    for result in (track, oarlock.smooth(track)):
        # The encoder's noise of 0.6 deg, once more than the angle is filtered.
        assert np.sqrt(np.mean(errors_deg(result, truth, "forearm", "arm_r") ** 2)) < 1.0
    if not is_input:
        std = np.degrees(track["elbow"].std)
        assert 0.1 < std[100:].max() < 3.0


def test_without_its_encoder_the_elbow_has_a_wide_band():
    body = model(sensor=ENCODER)
    _, recording = oarlock.simulate(body, motion(), ("trunk", "arm_r", "arm_l"), seed=1)
    assert np.degrees(oarlock.track(body, recording)["elbow"].std).min() > 10.0


@pytest.mark.parametrize("is_known", [False, True])
def test_magnetometers_hold_headings_that_gyroscopes_lose(is_known):
    """Biases of 0.01 rad/s turn an arm without joints by 23 deg in 40 s."""
    field = FIELD + (", azimuth_fixed = true" if is_known else "")
    body = model(mag=", mag_std_ut = 0.5, gyro_bias_start_std_rad_s = 0.02", field=field)
    truth, recording = oarlock.simulate(body, motion(), seed=2, gyro_bias_rad_s={"arm_l": [0.01, 0.01, 0.01]})
    last = {}
    for use in ("gated", "off"):
        track = oarlock.track(body, recording, config=oarlock.Config(magnetometer=use, closures=False))
        last[use] = float(np.sqrt(np.mean(errors_deg(track, truth, "arm_l")[-500:] ** 2)))
    assert last["gated"] < 4.0 and last["off"] > 2.0 * last["gated"]


def test_a_magnet_that_passes_leaves_nothing():
    """A field bent for 8 s is not used, and is used again when it is right."""
    body = model(mag=", mag_std_ut = 0.5", field=FIELD)
    truth, recording = oarlock.simulate(body, motion(), seed=3)
    arm = recording["arm_l"]
    bent = np.array(arm.mag_ut)
    near = (arm.time_s > 15.0) & (arm.time_s < 23.0)
    bent[near] += [40.0, 10.0, 0.0]
    part = oarlock.recording.ImuStream(
        "arm_l", arm.time_s, gyro_rad_s=arm.gyro_rad_s, accel_m_s2=arm.accel_m_s2, mag_ut=bent
    )
    with_magnet = oarlock.Recording([*(s for s in recording if s.name != "arm_l"), part])
    plain, magnetic = oarlock.track(body, recording), oarlock.track(body, with_magnet)
    after = plain.time_s > 25.0
    apart = np.abs(errors_deg(magnetic, truth, "arm_l") - errors_deg(plain, truth, "arm_l"))
    assert apart[after].max() < 1.0
    ratio = magnetic.q_std[plain.time_s > 28.0] / plain.q_std[plain.time_s > 28.0]
    assert ratio.min() > 0.9 and ratio.max() < 1.1
    assert any("arm_l" in note for note in magnetic.notes)


def test_a_marker_says_where_a_body_is():
    marker = (
        '\n    { name = "marker", kind = "position", frame = "trunk", point = [0.1, 0, 0.2], std_m = 0.01 },'
    )
    body = model(sensor=marker)
    truth, recording = oarlock.simulate(body, motion(), seed=4)
    track = oarlock.track(body, recording)
    place, true = (one.frame_positions("trunk") for one in (track, truth))
    off_m = np.linalg.norm(place - true[-len(track.time_s) :], axis=1)
    assert np.sqrt(np.mean(off_m**2)) < 0.02


def test_a_loop_holds_what_two_units_alone_lose():
    """Both arms swing alike about one axis and a rod along it joins them: it finds a heading that begins 17 deg off."""
    rod = """
[[closure]]
name = "rod"
frame_a = "arm_r"
point_a = [0, 0, -0.3]
frame_b = "arm_l"
point_b = [0, 0.4, -0.3]
axis_a = "y"
axis_b = "y"
std_m = 0.005
std_axis = 0.02
"""
    own = sway(1.0, 0.6, 0.4) * [0.0, 1.0, 0.0]
    moved = oarlock.simulation.Motion.from_joints(
        TIME_S,
        {
            "trunk": np.column_stack([0.1 * sway(0.0, 1.0, 0.2), sway(0.4, 0.3, 0.3)]),
            "shoulder_r": own,
            "shoulder_l": own,
            "elbow": np.zeros(len(TIME_S)),
        },
    )
    start = oarlock.Config(initial_q=[0.0] * 6 + [0.0] * 3 + [0.0, 0.0, 0.3] + [0.0])
    last = {}
    for name, more in (("without", ""), ("with", rod)):
        body = model(more=more)
        truth, recording = oarlock.simulate(body, moved, seed=5)
        track = oarlock.track(body, recording, config=start)
        last[name] = np.sqrt(np.mean(errors_deg(track, truth, "arm_l", "arm_r")[375:625] ** 2))
    assert last["with"] < 0.5 * last["without"]
    assert last["with"] < 2.5


def test_a_body_that_nothing_holds_is_named():
    text = BODY.replace("joint = [", 'joint = [ { name = "rod", kind = "free" },', 1).replace(
        "frame = [", 'frame = [ { name = "rod", parent = "root", transform = {}, joint = "rod" },', 1
    )
    for key in ("INPUT", "MAG", "SENSOR", "FIELD"):
        text = text.replace(key, "")
    _, recording = oarlock.simulate(model(), motion(), seed=1)
    with pytest.raises(oarlock.DataError, match="nothing tells how 'rod' moves"):
        oarlock.track(read(text), recording)


FOREARM = """
    { name = "forearm", kind = "imu", frame = "forearm", gyro_std_rad_s = 0.003, accel_std_m_s2 = 0.03 },"""


def elbow_at(angle_rad, limits_rad, start_rad):
    """An arm and forearm with units whose elbow sways about an angle; tracked from a start that says another one."""
    text = BODY.replace("limits = [-2.6, 2.6]INPUT", f"limits = {limits_rad}")
    text = text.replace("start_std_rad = 0.05", "start_std_rad = 0.25").replace('axis = "y"', 'axis = "z"')
    for key, value in (("SENSOR", FOREARM), ("MAG", ""), ("FIELD", "")):
        text = text.replace(key, value)
    body = read(text.replace("translation = [0, 0, -0.3] }, joint", "translation = [0.01, 0, 0] }, joint"))
    still = np.zeros((len(TIME_S), 3))
    moves = {"trunk": np.column_stack([still, still]), "shoulder_r": still, "shoulder_l": still}
    elbow = angle_rad + 0.02 * np.sin(2.0 * np.pi * 0.4 * TIME_S)
    _, recording = oarlock.simulate(
        body, oarlock.simulation.Motion.from_joints(TIME_S, {**moves, "elbow": elbow}), seed=4
    )
    start = np.zeros(len(body.coordinate_names))
    start[body.coordinate_names.index("elbow")] = start_rad
    track = oarlock.track(body, recording, config=oarlock.Config(initial_q=start.tolist()))
    return track["elbow"].angle_rad


def test_a_joint_far_beyond_its_limits_is_drawn_back():
    """A heading 0.6 rad wrong, which only the elbow's limits contradict, and they differ by 0.18 rad between people."""
    bounded, free = (elbow_at(0.0, limits, 0.6) for limits in ([-0.2, 0.2], [-2.6, 2.6]))
    assert bounded[-1] < 0.2 + 0.18 + 0.05 and free[-1] > 0.55


def test_a_joint_somewhat_beyond_its_limits_stays():
    """A true elbow 9 deg beyond the file's limits stays there."""
    bounded, free = (elbow_at(0.35, limits, 0.35) for limits in ([-0.2, 0.2], [-2.6, 2.6]))
    assert np.degrees(np.abs(bounded - free)).max() < 0.5


WORST_DEG = 2.0
"""Mounts are nominal within 0.1 rad by default; the units determine both hinges, the encoder the turret."""
TURRET = """
format = 1
name = "turret"
structure = "strapdown"
joint = [
    { name = "turret", kind = "hinge", limits = [-3, 3] },
    { name = "shoulder", kind = "hinge", limits = [-1.5, 1.5] },
    { name = "elbow", kind = "hinge", limits = [-2.6, 2.6] },
]
frame = [
    { name = "column", parent = "root", transform = {}, joint = "turret", axis = "z" },
    { name = "upper", parent = "column", transform = { translation = [0, 0, 0.2] }, joint = "shoulder", axis = "y" },
    { name = "fore", parent = "upper", transform = { translation = [0.4, 0, 0] }, joint = "elbow", axis = "y" },
]
sensor = [
    { name = "encoder", kind = "encoder", joint = "turret", std = 0.002 },
    { name = "upper", kind = "imu", frame = "upper", gyro_std_rad_s = 0.005, accel_std_m_s2 = 0.05 },
    { name = "fore", kind = "imu", frame = "fore", gyro_std_rad_s = 0.005, accel_std_m_s2 = 0.05 },
]
world = { up = [0, 0, 1], forward = [1, 0, 0] }
"""


def test_a_link_that_an_encoder_alone_places_has_no_turn_off_its_axis(tmp_path):
    body = read(TURRET)
    rise = np.clip((TIME_S - 1.5) / 2.0, 0.0, 1.0)
    waves = {"turret": (0.8, 0.08), "shoulder": (0.5, 0.14), "elbow": (0.6, 0.2)}
    angles = {name: size * np.sin(2.0 * np.pi * hz * TIME_S) * rise for name, (size, hz) in waves.items()}
    truth, recording = oarlock.simulate(body, oarlock.simulation.Motion.from_joints(TIME_S, angles), seed=4)
    for smooth in (False, True):
        track = oarlock.track(body, recording, smooth=smooth)
        turned = {name.partition(".")[0] for name in track.slow if ".off_axis_" in name}
        assert turned == {"upper", "fore"}
        track.save(tmp_path / str(smooth))
        scores = oarlock.evaluate(track, truth)
        assert scores.worst_rmse_deg() < WORST_DEG
