"""Angles of hinges and balls: continuous, near the middle of the range, with a note where a hinge turns too far."""

import numpy as np
import pytest

from oarlock import load_model, load_track, simulate, smooth, track
from oarlock.model.angle_sequence import angles_from_quat, quat_from_angles
from oarlock.simulation import Motion
from oarlock.tracking.turns import Hinge, hinges_of, placed, turn_notes, without_turn_notes

TURN = 2 * np.pi
TIME_S = np.arange(200) / 100


def course(q, qd=None, middle_deg=0.0):
    """The placed angle of one hinge, deg."""
    rates = np.zeros_like(q) if qd is None else qd
    hinge = Hinge("elbow", 0, np.radians(middle_deg), None)
    return np.degrees(placed([hinge], q[:, None].copy(), lambda: rates[:, None], TIME_S[: len(q)])[:, 0])


@pytest.mark.parametrize("turns", [-2, -1, 0, 1])
def test_a_hinge_that_a_filter_follows_full_turns_away_is_near_its_middle(turns):
    q = np.radians(30 * np.sin(3 * TIME_S)) + turns * TURN
    np.testing.assert_allclose(course(q), 30 * np.sin(3 * TIME_S), atol=1e-12)


def test_an_angle_inside_its_range_keeps_its_bits():
    q = np.radians(170 * np.sin(3 * TIME_S))
    assert (np.radians(course(q)) == np.radians(np.degrees(q))).all()


def test_the_middle_of_the_limits_decides():
    q = np.full(5, np.radians(-150.0))
    assert course(q, middle_deg=75.0) == pytest.approx(210.0)
    assert course(q, middle_deg=0.0) == pytest.approx(-150.0)


def test_jumps_of_a_turn_are_removed_and_gaps_stay():
    q = np.radians(np.linspace(80, 240, 200))
    jumping = np.where(q > np.pi, q - TURN, q)
    jumping[90:110] = np.nan
    found = course(jumping)
    assert np.isnan(found[90:110]).all()
    np.testing.assert_allclose(np.delete(found, np.s_[90:110]), np.delete(np.degrees(q), np.s_[90:110]))


def test_a_wheel_at_a_low_rate_keeps_its_turns():
    rate = 1.5 * TURN * 100
    q = rate * TIME_S[:50]
    np.testing.assert_allclose(course(q, np.full(50, rate)), np.degrees(q))


def notes(q, observed=True):
    hinge = Hinge("r_pronation", 0, 0.0, (np.radians(-80), np.radians(80)))
    return turn_notes([hinge], np.radians(q)[:, None], np.full((len(q), 1), observed))


def test_a_hinge_that_turns_too_far_has_a_note_with_the_next_step():
    (note,) = notes(np.linspace(-443, 33, 200))
    assert note.startswith("r_pronation turns through 476 deg; its range is -80 to 80 deg.")
    assert "oarlock calibrate" in note
    assert without_turn_notes(["kept", note]) == ("kept",)


def test_soft_limits_and_joints_that_are_not_observed_have_no_note():
    assert notes(np.linspace(-100, 100, 200)) == ()
    assert notes(np.linspace(-443, 33, 200), observed=False) == ()
    assert notes(np.full(3, np.nan)) == ()


def test_named_angles_of_a_ball_are_continuous_and_near_zero():
    angles = np.radians(np.column_stack([np.linspace(170, 470, 300), np.full(300, 60.0), np.zeros(300)]))
    found = np.degrees(angles_from_quat(quat_from_angles(angles, "YXY"), "YXY"))
    assert np.abs(np.diff(found, axis=0)).max() < 2.0
    assert (np.abs(np.median(found, axis=0)) <= 180.0).all()
    np.testing.assert_allclose(np.ptp(found[:, 0]), 300.0)


@pytest.fixture(scope="module")
def spun():
    """A pendulum whose first link turns all round one and a half times, which its limits of +-120 deg do not allow."""
    model = load_model("pendulum3")
    time_s = np.linspace(0.0, 6.0, 61)
    turned = np.radians(540) * 0.5 * (1 - np.cos(np.pi * np.clip(time_s - 0.5, 0, 5) / 5))
    motion = Motion(model.joint_names, time_s, np.column_stack([turned, 0 * turned, 0 * turned]))
    return track(model, simulate(model, motion, seed=1)[1])


def test_a_track_says_which_hinge_turned_too_far_once_smoothed_too(spun, tmp_path):
    both = spun, smooth(spun)
    for result in both:
        (note,) = [text for text in result.notes if "turns through" in text]
        assert note.startswith("upper_hinge turns through 5")
        assert np.abs(np.diff(result["upper_hinge"].angle_rad)).max() < np.radians(10)
    both[1].save(tmp_path / "track")
    assert load_track(tmp_path / "track").notes == both[1].notes


def test_hinges_of_a_model():
    model = load_model("sculler")
    found = {h.name: h for h in hinges_of(model.describe().joints, model.coordinate_names)}
    assert "seat" not in found
    low, high = found["trunk"].limits_rad
    assert found["trunk"].middle_rad == pytest.approx((low + high) / 2)
    assert model.coordinate_names[found["trunk"].column] == "trunk"
