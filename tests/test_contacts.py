"""Feet that stand: zero velocity of a contact point, found from the foot's unit."""

import numpy as np
import pytest

import oarlock
from oarlock import ModelError

NOISE = {"gyro_rad_s": 0.01, "accel_m_s2": 0.05}
STEP_S = 0.02


@pytest.fixture(scope="module")
def legs():
    return oarlock.load_model("lower_body")


@pytest.fixture(scope="module")
def squats(legs):
    """Truth and recording of somebody who squats ten times in twenty seconds, on two feet that do not move."""
    time_s = np.arange(0.0, 22.0, STEP_S)
    bend = np.where(time_s > 2.0, 0.35 * (1.0 - np.cos(np.pi * (time_s - 2.0))), 0.0)
    joints = {
        joint.name: {"hip_flexion": bend, "knee_flexion": 2.0 * bend, "ankle_dorsiflexion": bend}.get(
            joint.name[:-2], np.zeros_like(time_s)
        )
        for joint in legs.describe().joints
    }
    rows = np.zeros((len(time_s), len(legs.coordinate_names)))
    for name, values in joints.items():
        if name != "pelvis":
            rows[:, legs.coordinate_names.index(name)] = values
    foot = [frame.name for frame in legs.describe().frames].index("foot_r")
    place = legs.forward_kinematics(rows)[:, foot, :3, 3]
    joints["pelvis"] = np.hstack([place[0] - place, np.zeros((len(time_s), 3))])
    units = [unit.name for unit in legs.describe().inertial_units]
    return oarlock.simulate(
        legs,
        oarlock.simulation.Motion.from_joints(time_s, joints),
        units,
        seed=3,
        rate_hz=100.0,
        noise=dict.fromkeys(units, NOISE),
        gyro_bias_rad_s=0.005,
    )


def height_error_m(squats, track):
    truth, _ = squats
    true = np.interp(track.time_s, truth.time_s, truth.frame_positions("pelvis")[:, 1])
    off = track.frame_positions("pelvis")[:, 1] - true
    return float(np.sqrt(np.mean((off - off[0]) ** 2)))


def test_standing_feet_carry_the_pelvis(legs, squats):
    """Thirty centimetres down and up; without contacts the height is not known to a tenth of that."""
    on, off = (
        height_error_m(squats, oarlock.track(legs, squats[1], config=oarlock.Config(contacts=use)))
        for use in (True, False)
    )
    assert on < 0.02 < 0.06 < off


def test_cut_in_two_is_the_whole_bit_for_bit(legs, squats):
    """The detector's memory goes with the state estimate."""
    _, recording = squats
    whole = oarlock.track(legs, recording)
    config = oarlock.Config(**whole.provenance["config"])
    begun = oarlock.track(legs, recording.slice(end_s=9.0), config=config)
    rest = oarlock.track(legs, recording.slice(start_s=9.0), config=config, start=begun.last_belief)
    np.testing.assert_array_equal(rest.q[-1], whole.q[-1])


def test_contacts_are_mirrored(legs):
    right, left = (unit.contact for unit in legs.describe().inertial_units if unit.name.startswith("foot"))
    assert right is not None and left is not None
    assert (right.point, right.std_m_s) == (left.point, left.std_m_s)
    assert right.point[1] == pytest.approx(-0.068)


@pytest.mark.parametrize(
    ("keys", "about"),
    [
        ({"accel_std_m_s2": None, "contact": {"std_m_s": 0.1}}, "detected from gyroscope and accelerometer"),
        ({"contact": {"std_m_s": 0.1, "pont": [0, 0, 0]}}, "did you mean `point`"),
        ({"contact": {"point": [0, 0, 0]}}, "key `std_m_s` is missing"),
    ],
)
def test_mistakes_of_a_contact(legs, keys, about):
    unit = {"kind": "imu", "frame": "foot_r", "gyro_std_rad_s": 0.1, "accel_std_m_s2": 0.1} | keys
    with pytest.raises(ModelError, match=about):
        legs.with_sensor(
            "foot_r", replace=True, **{key: value for key, value in unit.items() if value is not None}
        )


def test_a_contact_needs_a_root_that_stands():
    with pytest.raises(ModelError, match="root accelerates"):
        oarlock.load_model("sculler").with_sensor("back", contact={"std_m_s": 0.1})
