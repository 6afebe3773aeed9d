"""Plausible sculling: hands on the handles, ranges, rhythm, symmetry, smoothness and the boat's surge."""

from typing import Any

import numpy as np
import pytest

import oarlock
from oarlock.rowing import Boat, Piece, StrokeShape, adjusted_stretcher, row_piece, sculling
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from refusals import assert_refused

HOLDS_M = 1e-6  # what a motion promises; the splines reach 1e-9
HOLDS_AXIS = 1e-6
RANGE_SLACK_RAD = np.radians(3.0)  # stroke-to-stroke variation of 0.7 deg, four deviations
SEAT_SLACK_M = 0.01  # the same, 1.5 mm a stroke
SAME_POSTURE_RAD = 1e-9  # two independent solutions of the same equations
SPLINE_RAD = 1e-7  # quintic splines at 250 knots a second
SURGE_SLACK_M_S2 = 0.4  # variation from stroke to stroke
ARM_MIRROR = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
SURGE_RANGE_M_S2 = (-4.6, 9.6)


def sculler(**parameters: float) -> Any:
    return oarlock.load_model("sculler", parameters=parameters)


@pytest.fixture(scope="module")
def race() -> Piece:
    return row_piece(sculler(), 20.0, 34.0)


def closure(model: Any, q: Floats) -> tuple[float, float]:
    poses = np.asarray(model.forward_kinematics(q))
    frames = list(model.frame_names)
    gaps = [poses[:, frames.index(f"{s}_hand")] - poses[:, frames.index(f"{s}_handle")] for s in "rl"]
    distance = max(float(np.linalg.norm(gap[:, :3, 3], axis=1).max()) for gap in gaps)
    return distance, max(float(np.linalg.norm(gap[:, :3, 2], axis=1).max()) for gap in gaps)


@pytest.mark.parametrize(
    ("rate", "duration_s", "seed", "parameters"),
    [
        (20.0, 7.0, 0, {}),
        (24.0, 40.0, 1, {}),
        ((20.0, 34.0), 20.0, 2, {}),
        (34.0, 3.3, 3, {"l_ua_r": 0.321, "l_fa_r": 0.262, "l_ha_r": 0.083}),
        ((34.0, 20.0, 28.0), 15.0, 4, {"l_b": 0.50, "l_oar_l": 0.85, "l_pin_y": 0.11}),
        (30.0, 0.5, 5, {}),
    ],
)
def test_hands_hold_the_handles_at_and_between_knots(rate, duration_s, seed, parameters):
    model = sculler(**parameters)
    motion = sculling(model, duration_s, rate, seed=seed)
    times = np.random.default_rng(seed).uniform(0.0, duration_s, 3000)
    for q in (motion.q, motion.at(times)):
        distance, axis = closure(model, q)
        assert distance < HOLDS_M
        assert axis < HOLDS_AXIS


@pytest.mark.parametrize("seed", range(8))
def test_adjusted_stretcher_lets_other_builds_row(seed):
    rng = np.random.default_rng(seed)
    default = {"l_b": 0.52, "l_oar_r": 0.84, "l_oar_l": 0.84}
    for side in "rl":
        default |= {f"l_cl_{side}": 0.195, f"l_ua_{side}": 0.315, f"l_fa_{side}": 0.27, f"l_ha_{side}": 0.085}
    model = sculler(**{name: value * (1.0 + 0.05 * rng.standard_normal()) for name, value in default.items()})
    motion = sculling(model, 6.0, 30.0, seed=seed, shape=adjusted_stretcher(model))
    assert max(closure(model, motion.q)) < HOLDS_M


def test_stretcher_stays_where_the_arms_reach_anyway():
    model = sculler(l_ua_r=0.34, l_ua_l=0.34)
    assert adjusted_stretcher(model) == StrokeShape()


def test_reported_closure_is_the_measured_one(race):
    distance, axis = closure(sculler(), race.motion.q)
    assert distance <= race.closure_m < HOLDS_M
    assert axis <= race.closure_axis < HOLDS_AXIS


def test_ranges_are_a_scullers():
    motion = sculling(sculler(), 40.0, (20.0, 34.0))
    ranges = {
        "trunk": (-25.0, 28.0),
        "r_oar_phi": (-61.0, 42.0),
        "l_oar_phi": (-61.0, 42.0),
        "r_oar_alpha": (2.0, 8.0),
        "l_oar_alpha": (2.0, 8.0),
    }
    for name, (low, high) in ranges.items():
        values = motion.column(name)
        assert np.radians(low) - RANGE_SLACK_RAD < values.min() < np.radians(low) + RANGE_SLACK_RAD, name
        assert np.radians(high) - RANGE_SLACK_RAD < values.max() < np.radians(high) + RANGE_SLACK_RAD, name
    seat = motion.column("seat")
    assert abs(seat.min() - 0.01) < SEAT_SLACK_M
    assert abs(seat.max() - 0.62) < SEAT_SLACK_M
    for side in "rl":
        elbow = np.degrees(motion.column(f"{side}_elbow_flexion"))
        assert 5.0 < elbow.min() < 45.0
        assert 85.0 < elbow.max() < 120.0
        assert np.degrees(np.abs(motion.column(f"{side}_shoulder_rotation"))).max() < 60.0
        hand = np.degrees(motion.column(f"{side}_hand_abduction"))
        assert hand.min() > -60.0
        assert hand.max() < 30.0


def test_legs_trunk_arms_then_arms_trunk_legs():
    piece = row_piece(sculler(), 10.0, 24.0, variation=0.0, shape=StrokeShape(asymmetry=0.0))
    time = piece.motion.time_s
    _, speed, _ = piece.motion.derivatives(time)
    names = piece.motion.joint_names
    parts = (
        -speed[:, names.index("seat")],
        speed[:, names.index("trunk")],
        speed[:, names.index("r_elbow_flexion")],
    )
    drive = (piece.timing.phase > 1.0) & (piece.timing.phase < 1.5)
    recovery = (piece.timing.phase > 1.5) & (piece.timing.phase < 2.0)
    # Half of each part's way, so that small movements elsewhere do not count.
    drive_order = [_half_way(part[drive], time[drive]) for part in parts]
    recovery_order = [_half_way(-part[recovery], time[recovery]) for part in parts]
    assert drive_order == sorted(drive_order)
    assert recovery_order == sorted(recovery_order, reverse=True)


def _half_way(speed: Floats, time_s: Floats) -> float:
    way = np.cumsum(speed)
    return float(time_s[np.searchsorted(np.maximum.accumulate(way), 0.5 * way.max())])


@pytest.mark.parametrize(("rate", "drive_ratio"), [(20.0, 0.36), (27.0, 0.40), (34.0, 0.45), (24.0, 0.52)])
def test_rate_and_drive_ratio_are_as_asked(rate, drive_ratio):
    piece = row_piece(sculler(), 9.0, rate, drive_ratio=drive_ratio, variation=0.0)
    time = np.linspace(0.5, 8.9, 8401)  # ms
    motion = piece.motion
    phi_speed = motion.derivatives(time)[1][:, motion.joint_names.index("r_oar_phi")]
    turns = time[:-1][np.diff(np.sign(phi_speed)) != 0]
    catches = [t for t in turns if motion.at(t)[motion.joint_names.index("r_oar_phi")] < 0.0]
    finishes = [t for t in turns if t > catches[0] and t not in catches]
    period = 60.0 / rate
    assert np.diff(catches) == pytest.approx(period, abs=0.003)
    assert finishes[0] - catches[0] == pytest.approx(drive_ratio * period, abs=0.003)


def test_rate_ramp_goes_from_first_to_last_rate():
    timing = row_piece(sculler(), 40.0, (20.0, 34.0), variation=0.0).timing
    catches = np.interp(np.arange(1.0, 18.0), timing.stroke, timing.time_s)
    rates = 60.0 / np.diff(catches)
    assert (np.diff(rates) > 0.0).all()
    assert 20.0 < rates[0] < 22.0
    assert 32.0 < rates[-1] < 34.0


def test_variation_is_about_one_percent_of_the_period():
    timing = row_piece(sculler(), 120.0, 30.0, knots_hz=50.0).timing
    catches = np.interp(np.arange(1.0, 58.0), timing.stroke, timing.time_s)
    spread = np.diff(catches).std() / 2.0
    assert 0.004 < spread < 0.02


def test_seed_makes_the_motion_and_no_variation_repeats_strokes():
    model = sculler()
    first, again, other = (sculling(model, 6.0, 24.0, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first.q, again.q)
    assert np.abs(first.q - other.q).max() > 1e-3
    steady = sculling(model, 8.0, 24.0, variation=0.0)
    times = np.linspace(0.1, 5.0, 50)
    assert np.abs(steady.at(times) - steady.at(times + 2.5)).max() < SAME_POSTURE_RAD


def test_sides_mirror_without_asymmetry():
    model = sculler(l_pin_y=0.08)
    motion = sculling(model, 6.0, 28.0, shape=StrokeShape(asymmetry=0.0))
    assert np.abs(motion.q[:, 9:16] - ARM_MIRROR * motion.q[:, 2:9]).max() < SAME_POSTURE_RAD
    assert np.array_equal(motion.q[:, 16:19], motion.q[:, 19:22])


def test_asymmetry_is_slight():
    motion = sculling(sculler(), 10.0, 28.0)
    apart = np.degrees(np.abs(motion.q[:, 16:18] - motion.q[:, 19:21])).max(axis=0)
    assert (apart > 0.2).all()
    assert (apart < 4.0).all()


def test_smooth_up_to_the_fourth_derivative():
    """Finer knots change no derivative: nothing is resolved by the knots that is not in the motion."""
    model = sculler()
    coarse, fine = (sculling(model, 6.0, 34.0, knots_hz=hz) for hz in (250.0, 500.0))
    middle = slice(100, -100)
    step = np.diff(fine.time_s[:2])[0]
    same = coarse.at(fine.time_s) - fine.q
    assert np.abs(same).max() < SPLINE_RAD
    fourth = np.diff(fine.q, 4, axis=0)[middle] / step**4
    assert np.abs(fourth).max() < 5e5  # rad/s4: 8 deg at 10 Hz
    jumps = np.abs(np.diff(fourth, axis=0)).max(axis=0) / np.abs(fourth).max(axis=0)
    assert jumps.max() < 0.2


def test_feathering_turns_the_top_toward_the_rower():
    piece = row_piece(sculler(), 6.0, 24.0, variation=0.0)
    theta = piece.motion.column("r_oar_theta")
    phase = piece.timing.phase % 1.0
    assert np.abs(theta[(phase > 0.02) & (phase < 0.4)]).max() < np.radians(1.0)
    assert theta[(phase > 0.62) & (phase < 0.78)].max() < np.radians(-84.0)


def test_surge_is_in_the_published_range_at_race_rate(race):
    base = race.motion.base_acceleration_m_s2
    assert base is not None
    assert np.abs(base[:, :2]).max() == 0.0
    low, high = SURGE_RANGE_M_S2
    assert low - SURGE_SLACK_M_S2 < base[:, 2].min() < low + 1.0
    assert high - 2.5 < base[:, 2].max() < high + SURGE_SLACK_M_S2
    # The hull is checked at the catch, where the rower reverses.
    at_peak = float(race.timing.phase[np.argmax(base[:, 2])]) % 1.0
    assert min(at_peak, 1.0 - at_peak) < 0.05


def test_hull_speed_is_periodic_and_agrees_with_its_acceleration():
    piece = row_piece(sculler(), 30.0, 30.0, variation=0.0)
    hull = piece.hull
    assert hull is not None
    strokes = np.interp(np.arange(0.0, 14.0) * 2.0, hull.time_s, hull.speed_m_s)
    assert np.ptp(strokes) < 1e-3
    assert 4.0 < hull.speed_m_s.mean() < 5.0
    slope = np.gradient(hull.speed_m_s, hull.time_s)[2:-2]
    assert np.abs(slope + hull.acceleration_m_s2[2:-2]).max() < 0.02
    boat = Boat()
    drag = boat.drag_kg_m * np.mean(hull.speed_m_s**2)
    assert np.mean(hull.propulsion_n[:7500]) == pytest.approx(drag, rel=0.01)


def test_no_surge_leaves_the_base_at_rest():
    motion = sculling(sculler(), 2.0, surge=False)
    assert motion.base_acceleration_m_s2 is None
    assert not motion.base_acceleration_at([0.5, 1.0]).any()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (
            {"l_ua_r": 0.2},
            ("right (port oar)", "mm beyond the stretched arm", "recovery", "adjusted_stretcher"),
        ),
        ({"l_fa_l": 0.2}, ("left (starboard oar)", "mm beyond", "phi_rad")),
        ({"l_ua_r": 0.29, "l_fa_r": 0.255, "l_ua_l": 0.33}, ("right (port oar)", "mm", "along the handle")),
    ],
)
def test_unreachable_rig_says_side_place_and_distance(parameters, words):
    assert_refused(lambda: sculling(sculler(**parameters), 5.0, 24.0, variation=0.0), *words)


def test_stretcher_cannot_mend_everything():
    with pytest.raises(DataError, match=r"mm toward the stern is not enough, the right .* lacks \d+ mm"):
        adjusted_stretcher(sculler(l_ua_r=0.1))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"rate_spm": 5.0}, "strokes per minute"),
        ({"rate_spm": float("nan")}, "strokes per minute"),
        ({"rate_spm": (20.0, 90.0)}, "strokes per minute"),
        ({"drive_ratio": 0.9}, "drive_ratio is 0.9"),
        ({"duration_s": 0.0}, "duration must be"),
        ({"knots_hz": 10.0}, "at least 50"),
        ({"variation": -1.0}, "variation is -1"),
    ],
)
def test_arguments_out_of_range_are_refused(arguments, words):
    with pytest.raises(DataError, match=words):
        sculling(sculler(), **arguments)


def test_shape_and_boat_refuse_nonsense():
    assert_refused(lambda: StrokeShape(lean_rad=(0.4, -0.4)), "lean_rad")
    assert_refused(lambda: StrokeShape(late_catch_s=(0.5, 0.0)), "late_catch_s")
    assert_refused(lambda: StrokeShape(early_back=-0.1), "early_back")
    assert_refused(lambda: Boat(drag_kg_m=0.0), "drag_kg_m")


def test_model_without_arms_is_refused():
    class Bare:
        joint_names = ("seat",)
        frame_names = ("root",)

        def forward_kinematics(self, q: Any, /) -> Floats:
            raise AssertionError("not reached")

    assert_refused(lambda: sculling(Bare(), 1.0), "no joint 'trunk'")


def test_motion_gives_exact_derivatives_of_a_polynomial():
    time = np.linspace(0.0, 2.0, 41)
    motion = Motion(("hinge",), time, (time**4 - time)[:, None], np.stack([0 * time, 0 * time, time], axis=1))
    at = np.array([0.013, 1.234, 1.999])
    q, qd, qdd = motion.derivatives(at)
    assert q[:, 0] == pytest.approx(at**4 - at, abs=1e-12)
    assert qd[:, 0] == pytest.approx(4 * at**3 - 1, abs=1e-10)
    assert qdd[:, 0] == pytest.approx(12 * at**2, abs=1e-8)
    assert motion.base_acceleration_at(at)[:, 2] == pytest.approx(at, abs=1e-12)
    assert motion.at(1.0).shape == (1,)


@pytest.mark.parametrize(
    ("time_s", "q", "words"),
    [
        (np.arange(5.0), np.zeros((5, 1)), "at least 6"),
        (np.arange(8.0), np.zeros((8, 2)), r"q has shape \(8, 2\)"),
        (np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0]), np.zeros((6, 1)), "knot 3 is at 2.0"),
        (np.arange(8.0), np.full((8, 1), np.nan), r"q\[0, 0\] is nan"),
    ],
)
def test_motion_refuses_what_no_spline_passes(time_s, q, words):
    with pytest.raises(DataError, match=words):
        Motion(("hinge",), time_s, q)


def test_motion_answers_only_inside():
    motion = Motion(("hinge",), np.arange(8.0), np.zeros((8, 1)))
    assert motion.at(-0.5).shape == (1,)  # a step of slack for central differences
    with pytest.raises(DataError, match=r"lasts from 0\.0+ to 7\.0+ s"):
        motion.at([1.0, 9.0])
    assert_refused(lambda: motion.column("knee"), "no joint 'knee'")
