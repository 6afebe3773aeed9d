"""A hull that turns: pitch obeys mechanics written anew here, rotations are as asked, a hull unit makes up for them."""

from typing import Any

import numpy as np
import pytest

import oarlock
from exact_recording import ELEVEN, Floats
from oarlock.rowing import (
    Boat,
    HullForm,
    HullMotion,
    HullPitch,
    HullRotation,
    Piece,
    hull_pitch,
    on_hull,
    row_piece,
)
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.rowing.simulation.hull import HULL_JOINTS, turning_hull
from oarlock.rowing.simulation.timing import stroke_timing
from oarlock.simulation.motion import Motion
from oarlock.storage.errors import DataError

GRAVITY = 9.80665
TYPICAL = HullRotation()
BOUNDS = HullRotation(np.radians(1.0), np.radians(5.0), np.radians(5.0))

LINEAR = 0.05  # pitch equation for small angles: the rower's weight above the water and 0.01 rad are left out of it
INTEGRATED = 2e-3  # trapezoids over 250 knots a second of motion up to 10 Hz
SECOND_ORDER_RAD_S = 0.03  # products of angles up to 5 deg and rates up to 0.35 rad/s
SAME_POSE = 1e-12
LOST_DEG = 0.05  # what a turning hull may cost with a unit on it
REACHED_DEG = 0.045  # on 10 s, as other short recordings here: half as much again as on 40 s

# Winter's table 4.1 once more: shares of body mass with their places between two points.
SEGMENTS = (
    (0.578, "seat", "shoulder", 0.62),
    (0.056, "shoulder", "elbow", 0.436),
    (0.032, "elbow", "wrist", 0.430),
    (0.012, "hand", "hand", 0.0),
)
THIGHS, SHANKS = 0.200, 0.093


@pytest.fixture(scope="module")
def piece() -> Piece:
    return row_piece(oarlock.load_model("sculler"), 12.0, 28.0, variation=0.0)


@pytest.fixture(scope="module")
def pitch(piece: Piece) -> HullPitch:
    assert piece.hull is not None
    return hull_pitch(
        oarlock.load_model("sculler"), piece.motion.q, piece.timing, piece.hull, Boat(), HullForm()
    )


def rower(q: Floats) -> tuple[Floats, Floats]:
    """Shares (n,) of the body and their places (K, n, 3) on the boat."""
    model = oarlock.load_model("sculler")
    poses = np.asarray(model.forward_kinematics(q))[..., :3, 3]
    names = list(model.frame_names)

    def at(part: str) -> Floats:
        if part == "seat":
            return poses[:, names.index("seat")]
        return 0.5 * (poses[:, names.index(f"r_{part}")] + poses[:, names.index(f"l_{part}")])

    shares = [share for share, *_ in SEGMENTS]
    places = [at(a) + where * (at(b) - at(a)) for _, a, b, where in SEGMENTS]
    hip = at("seat")
    for share, along in ((THIGHS, 1.0 - 0.433 / 2.0), (SHANKS, 0.5 * (1.0 - 0.433))):
        shares.append(share)
        places.append(hip * [1.0, 1.0, along])
    return np.array(shares), np.stack(places, axis=1)


def twice(values: Floats, time_s: Floats) -> Floats:
    return np.gradient(np.gradient(values, time_s, axis=0), time_s, axis=0)


def test_momentum_of_boat_and_rower_changes_by_propulsion_and_drag_alone(piece: Piece) -> None:
    hull, boat = piece.hull, Boat()
    assert hull is not None
    shares, places = rower(piece.motion.q)
    sternward = np.gradient(places[..., 2] @ shares, hull.time_s)
    momentum = boat.boat_kg * hull.speed_m_s + boat.rower_kg * (hull.speed_m_s - sternward)
    impulse = hull.propulsion_n - boat.drag_kg_m * hull.speed_m_s**2
    gained = momentum[-5] - momentum[5]
    given = np.trapezoid(impulse[5:-4], hull.time_s[5:-4])
    largest = np.abs(momentum - momentum.mean()).max()
    assert gained == pytest.approx(given, abs=INTEGRATED * largest)


def test_angular_momentum_balance_of_the_pitching_hull(piece: Piece, pitch: HullPitch) -> None:
    """In a frame that does not turn, with the full rotation of the rower: what the small-angle equation leaves out."""
    hull, boat, form, time = piece.hull, Boat(), HullForm(), pitch.time_s
    assert hull is not None
    shares, places = rower(piece.motion.q)
    arm = places - [0.0, -form.hip_height_m, form.flotation_z_m]
    sin, cos = (f(pitch.angle_rad)[:, None] for f in (np.sin, np.cos))
    y, z = cos * arm[..., 1] - sin * arm[..., 2], sin * arm[..., 1] + cos * arm[..., 2]
    up = twice(y, time) + GRAVITY
    along = twice(z, time) + hull.acceleration_m_s2[:, None]
    needed = boat.rower_kg * (y * along - z * up) @ shares
    own = form.inertia_kg_m2 + form.added_inertia_kg_m2
    hull_side = own * np.gradient(pitch.velocity_rad_s, time)
    hull_side += pitch.damping_nm_s_rad * pitch.velocity_rad_s + pitch.stiffness_nm_rad * pitch.angle_rad
    water = form.blade_depth_m * hull.propulsion_n
    water -= form.drag_depth_m * boat.drag_kg_m * hull.speed_m_s**2
    left = (needed + hull_side - water)[20:-20]
    assert np.std(left) < LINEAR * np.std(pitch.moment_nm)


def test_energy_of_the_pitching_hull(pitch: HullPitch) -> None:
    time, rate = pitch.time_s, pitch.velocity_rad_s
    stored = 0.5 * pitch.inertia_kg_m2 * rate**2 + 0.5 * pitch.stiffness_nm_rad * pitch.angle_rad**2
    work = np.trapezoid(pitch.moment_nm * rate, time)
    lost = np.trapezoid(pitch.damping_nm_s_rad * rate**2, time)
    assert lost > 0.0
    assert stored[-1] - stored[0] == pytest.approx(work - lost, abs=INTEGRATED * lost)


def test_pitch_stiffness_is_that_of_the_waterline() -> None:
    form = HullForm()
    z = np.linspace(-0.5, 0.5, 20001) * form.length_m
    width = form.beam_m * (1.0 - 4.0 * (z / form.length_m) ** 2)
    second_moment = np.trapezoid(width * z**2, z)
    assert form.stiffness_nm_rad == pytest.approx(1000.0 * GRAVITY * second_moment, rel=1e-6)
    discs = np.trapezoid(1000.0 * np.pi / 8.0 * width**2 * z**2, z)
    assert form.added_inertia_kg_m2 == pytest.approx(discs, rel=1e-6)


def test_statics_a_rower_who_sits_further_aft_trims_the_stern_down() -> None:
    model, form = oarlock.load_model("sculler"), HullForm()
    time = np.linspace(0.0, 60.0, 15001)
    timing = stroke_timing(time, 20.0, None, 0.0, np.random.default_rng(0))
    q = np.zeros((time.size, len(model.joint_names)))
    # 20 cm in half a minute: nothing but weight and buoyancy is left.
    q[:, model.joint_names.index("seat")] = 0.2 + 0.1 * np.tanh((time - 30.0) / 5.0)
    zero = np.zeros_like(time)
    found = hull_pitch(model, q, timing, HullMotion(time, zero, zero, zero), Boat(), form)
    arms = 0.056 + 0.032 + 0.012
    moved = 0.2 * (0.578 + arms + THIGHS * (1.0 - 0.433 / 2.0) + SHANKS * 0.5 * (1.0 - 0.433))
    trim = Boat().rower_kg * GRAVITY * moved / form.stiffness_nm_rad
    assert found.angle_rad[-1] - found.angle_rad[0] == pytest.approx(trim, rel=1e-3)


@pytest.mark.parametrize("rate", [20.0, 34.0])
def test_pitch_is_within_what_is_published(rate: float) -> None:
    model = oarlock.load_model("sculler")
    rowed = row_piece(model, 8.0, rate, variation=0.0)
    assert rowed.hull is not None
    found = hull_pitch(model, rowed.motion.q, rowed.timing, rowed.hull, Boat(), HullForm())
    stroke = rowed.timing.first_stroke
    swing = np.degrees(np.ptp(found.angle_rad[stroke]))
    assert 0.5 < swing < 1.2  # "less than 1 deg" in a stroke, and a rower of 80 kg with a long slide
    assert abs(found.angle_rad[stroke].mean()) < np.radians(0.02)
    start = found.angle_rad[stroke]
    assert start[-1] == pytest.approx(start[0], abs=np.radians(0.01))  # periodic from the first stroke on


def test_rotations_have_the_amplitudes_asked_for() -> None:
    timing = stroke_timing(np.linspace(0.0, 240.0, 60001), 30.0, None, 1.0, np.random.default_rng(3))
    angles = BOUNDS.angles(timing, np.random.default_rng(4))
    stroke = np.floor(timing.stroke).astype(int)
    cells = np.floor((timing.stroke % 1.0) * 50).astype(int)
    for name, asked in (("pitch", 1.0), ("roll", 5.0), ("yaw", 5.0)):
        angle = np.degrees(angles[f"hull_{name}"])
        usual = np.array([angle[cells == k].mean() for k in range(50)])
        # 120 strokes whose random part is 0.3 of the amplitude: 0.03 of it is left at each end of the mean.
        assert 0.5 * np.ptp(usual) == pytest.approx(asked, rel=0.12)
        assert abs(angle.mean()) < 0.12 * asked
        residual = angle - usual[cells]
        assert residual.std() == pytest.approx(0.3 * asked, rel=0.35)
        swings = [np.ptp(angle[stroke == k]) for k in range(2, 100)]
        assert max(swings) < 2.0 * 2.0 * asked


def test_rotation_is_smooth_and_seeded() -> None:
    timing = stroke_timing(np.linspace(0.0, 20.0, 5001), 34.0, None, 1.0, np.random.default_rng(3))
    first, again, other = (TYPICAL.angles(timing, np.random.default_rng(s)) for s in (1, 1, 2))
    for name, angle in first.items():
        assert np.array_equal(angle, again[name])
        assert not np.array_equal(angle, other[name])
        fourth = np.diff(angle, 4) * 250.0**4
        assert np.abs(np.diff(fourth)).max() < 0.2 * np.abs(fourth).max()


def test_rotations_turn_the_hull_about_its_pivot_and_the_hull_unit_feels_it() -> None:
    model = oarlock.load_model("sculler_boat")
    names = list(model.joint_names)
    still = np.zeros((2001, len(names)))
    time = np.linspace(0.0, 8.0, 2001)
    timing = stroke_timing(time, 28.0, None, 1.0, np.random.default_rng(0))
    angles = BOUNDS.angles(timing, np.random.default_rng(1))
    pivot = np.array([0.0, -0.25, 0.3])
    motion = turning_hull(Motion(tuple(names), time, still), angles, pivot, np.zeros(2001))
    hull = np.asarray(model.forward_kinematics(motion.q))[:, list(model.frame_names).index("hull")]
    place = hull[:, :3, 3] + hull[:, :3, :3] @ pivot
    assert np.abs(place[:, :2] - pivot[:2]).max() < SAME_POSE
    # Along the course the root itself gives way, by its acceleration.
    assert motion.base_acceleration_m_s2 is not None
    given = twice(place[:, 2] - pivot[2], time) + motion.base_acceleration_m_s2[:, 2]
    assert np.abs(given[20:-20]).max() < 1e-3
    _, recording = oarlock.simulate(model, motion, sensors=["hull"], noise=False)
    rates = [np.gradient(angles[f"hull_{k}"], time) for k in ("pitch", "yaw", "roll")]
    stream: Any = recording["hull"]
    for axis, rate in enumerate(rates):
        felt = np.interp(time[20:-20], stream.time_s, stream.gyro_rad_s[:, axis])
        assert np.abs(felt - rate[20:-20]).max() < SECOND_ORDER_RAD_S


def test_sculler_boat_is_the_sculler_on_a_hull() -> None:
    sculler, boat = oarlock.load_model("sculler"), oarlock.load_model("sculler_boat")
    for moved in (boat, on_hull(sculler)):
        assert set(moved.joint_names) == set(sculler.joint_names) | set(HULL_JOINTS)
        q = np.random.default_rng(0).uniform(-0.6, 0.6, (20, len(moved.joint_names)))
        own = q[:, [moved.joint_names.index(name) for name in sculler.joint_names]]
        poses, plain = moved.forward_kinematics(q), sculler.forward_kinematics(own)
        hull = np.linalg.inv(poses[:, list(moved.frame_names).index("hull")])
        for k, name in enumerate(sculler.frame_names[1:], 1):
            there = hull @ poses[:, list(moved.frame_names).index(name)]
            assert np.abs(there - plain[:, k]).max() < SAME_POSE
    described, other = sculler.describe(), boat.describe()
    assert other.parameters == described.parameters
    assert tuple(s for s in other.sensors if s.name not in ("hull", "waist")) == described.sensors
    assert other.closures == described.closures
    assert [j for j in other.joints if j.name not in HULL_JOINTS] == list(described.joints)
    assert on_hull(boat) is boat


def test_a_level_hull_changes_nothing() -> None:
    model = oarlock.load_model("sculler")
    truth, recording = simulate_sculling(model, "B-B", 4.0, seed=2)
    same, level = simulate_sculling(model, "B-B", 4.0, seed=2, hull_rotation=HullRotation(0.0, 0.0, 0.0))
    assert np.array_equal(truth.q, same.q)
    assert truth.joint_names == same.joint_names
    unit, other = recording["l_forearm"], level["l_forearm"]
    for quantity, rounding in (("gyro_rad_s", 1e-9), ("accel_m_s2", 1e-6), ("mag_ut", 1e-9)):
        assert np.abs(getattr(unit, quantity) - getattr(other, quantity)).max() < rounding


def without(recording: oarlock.Recording, *names: str) -> oarlock.Recording:
    return oarlock.Recording([stream for stream in recording if stream.name not in names])


def mean_deg(
    model: Any, rotation: HullRotation | None, seed: int, drop: tuple[str, ...] = ()
) -> tuple[float, Any]:
    truth, recording = simulate_sculling(model, "B-B", 10.0, (20.0, 34.0), seed, hull_rotation=rotation)
    # Exact bodies: the structure that takes mounts and lengths as they are.
    config = oarlock.Config(structure="tree")
    scores = oarlock.evaluate(oarlock.track(model, without(recording, *drop), config=config), truth)
    return scores.mean_rmse_deg(ELEVEN), scores


@pytest.mark.parametrize(
    ("rotation", "seed"),
    [
        pytest.param(TYPICAL, 11, id="typical"),
        pytest.param(BOUNDS, 12, id="bounds", marks=pytest.mark.long),
    ],
)
def test_with_a_hull_unit_a_turning_hull_costs_nothing(rotation: HullRotation, seed: int) -> None:
    plain, _ = mean_deg(oarlock.load_model("sculler"), None, seed)
    found, scores = mean_deg(oarlock.load_model("sculler_boat"), rotation, seed, ("waist",))
    assert found < plain + LOST_DEG
    assert found < REACHED_DEG
    # What the hull itself does is told to a fraction of a degree, the heading least well.
    for joint, most_deg in (("hull_pitch", 0.3), ("hull_roll", 0.5), ("hull_yaw", 1.0)):
        assert np.degrees(scores[joint].rmse) < most_deg


def test_a_unit_on_a_hull_that_keeps_its_rate_for_a_while_does_not_rest() -> None:
    # Rest would make a bias of the rate at which the hull rolls in a part of each stroke.
    model = oarlock.load_model("sculler_boat")
    truth, recording = simulate_sculling(model, "B-B", 15.0, (24.0, 24.0), 0, hull_rotation=TYPICAL)
    track = oarlock.track(model, recording)
    assert not [note for note in track.notes if "contradict" in note]
    assert np.degrees(oarlock.evaluate(track, truth)["hull_roll"].rmse) < 0.2


def test_without_a_hull_unit_the_body_still_tells_and_the_plain_sculler_does_not() -> None:
    boat, sculler = oarlock.load_model("sculler_boat"), oarlock.load_model("sculler")
    told, _ = mean_deg(boat, TYPICAL, 11, ("hull", "waist"))
    unaware, _ = mean_deg(sculler, TYPICAL, 11)
    assert told < 2.0 * REACHED_DEG
    assert unaware > 10.0 * told


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: HullRotation(roll_rad=2.0), "roll_rad is 2.0; give an amplitude"),
        (lambda: HullRotation(yaw_rad=-0.1), "yaw_rad is -0.1"),
        (lambda: HullRotation(pitch_rad=float("nan")), "pitch_rad is nan"),
        (lambda: HullRotation(irregular=5.0), "irregular is 5.0"),
        (lambda: HullForm(length_m=0.0), "length_m is 0.0"),
        (lambda: HullForm(rowers=0), "rowers is 0"),
    ],
)
def test_nonsense_is_refused(make: Any, words: str) -> None:
    with pytest.raises(DataError, match=words):
        make()


def test_a_boat_that_stands_still_does_not_pitch() -> None:
    with pytest.raises(ValueError, match="stationary"):
        simulate_sculling(oarlock.load_model("sculler"), "S-B", 3.0, pitching=True)
