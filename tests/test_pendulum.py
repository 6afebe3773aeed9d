"""A chain of hinges, simulated and real: mounts from a still stretch and a swing, and what tracking makes of them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock import Calibration, Recording
from oarlock.evaluation.orientations import angles_from_orientations
from oarlock.formats.devices.apdm import read_apdm, read_apdm_orientations
from oarlock.model.chain_geometry import hinge_links, posture
from oarlock.recording import ImuStream
from oarlock.simulation import Motion
from refusals import assert_refused

FILE = Path(__file__).parents[1] / "examples/pendulum/imuData01.csv"
UNITS = ("upper", "middle", "lower")

# At rest the units of the example scatter by this much.
NOISE = {"gyro_rad_s": 0.002, "accel_m_s2": 0.02, "mag_ut": 0.3}
ACCEL_BIAS_M_S2 = 0.02

# The accelerometer's bias alone tilts a mount by 0.02 sqrt(2) / 9.8, 0.17 deg; the gyroscope's axis adds little.
MOUNT_BOUND_RAD = math.radians(0.4)
# Bias and noise of the accelerometers, over the accelerations of the swing.
PLACE_BOUND_M = 0.005
# Noise of the magnetometers, over some hundred samples; the mounts turn the field of 55 uT by 0.2 deg.
FIELD_BOUND_UT = 0.7
# Noise-free sensors leave the rounding of the differentiated motion. The stretch is named: the one that is found
# reaches a little into the swing.
EXACT_BOUND_RAD = 1e-6
STILL_S = (0.0, 1.9)

# Two filters that use accelerometers beside steel and on a shaking stand, half a degree each: see docs/mounts.md.
AGREEMENT_RAD = math.radians(1.0)
# The vendor's lower unit slips by 5 to 6 deg in the fastest turn: it agrees before, and by less than the slip after.
BEFORE_SLIP_S = 3.85
SLIP_RAD = math.radians(4.5)


@pytest.fixture(scope="module")
def model():
    return oarlock.load_model("pendulum3")


@pytest.fixture(scope="module")
def measured():
    return read_apdm(FILE)


@pytest.fixture(scope="module")
def found(model, measured):
    return oarlock.calibration.calibrate_hinge_chain(model, measured)


def swing(still_s=2.0, end_s=9.0, sign=1.0, amplitudes=(0.7, 0.3, 0.35), rest=(0.0, 0.0, 0.0)):
    """At rest, then all hinges swing; the first one starts to the positive side."""
    time_s = np.arange(0.0, end_s, 0.01)
    moving = np.clip(time_s - still_s, 0.0, None)
    rise = np.clip(moving / 1.0, 0.0, 1.0)
    envelope = rise**4 * (35 - 84 * rise + 70 * rise**2 - 20 * rise**3)
    waves = [a * np.sin(2 * np.pi * f * moving) for a, f in zip(amplitudes, (0.5, 0.8, 1.1), strict=True)]
    q = np.stack(waves, axis=1) * envelope[:, None] * sign + rest
    return Motion(joint_names=("upper_hinge", "middle_hinge", "lower_hinge"), time_s=time_s, q=q)


def wearing(seed):
    random = np.random.default_rng(seed)
    rotations = Rotation.random(3, random_state=seed).as_matrix()
    # Across the links no hinge can tell the sensors' places.
    places = random.uniform((0.05, -0.05, 0.0), (0.25, 0.05, 0.0), (3, 3))
    return Calibration(
        {"l_upper": 0.45, "l_middle": 0.55},
        dict(zip(UNITS, zip(rotations, places, strict=True), strict=True)),
    )


def recorded(true, seed=0, noise=True, bias=ACCEL_BIAS_M_S2, **motion):
    levels = {name: NOISE if noise else dict.fromkeys(NOISE, 0.0) for name in UNITS}
    sized = oarlock.load_model("pendulum3", parameters=true.parameters)
    return oarlock.simulate(
        sized,
        swing(**motion),
        seed=seed,
        calibration=true,
        noise=levels,
        gyro_bias_rad_s=0.005 if noise else 0.0,
        accel_bias_m_s2=bias if noise else 0.0,
    )


def turn_between(a, b):
    return Rotation.from_matrix(a @ b.T).magnitude()


# --- simulated ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_random_mounts_lengths_and_places_are_found(model, seed):
    true = wearing(seed)
    calibration = oarlock.calibration.calibrate_hinge_chain(model, recorded(true, seed)[1])
    for name in UNITS:
        (rotation, place), (true_rotation, true_place) = calibration.mounts[name], true.mounts[name]
        assert turn_between(rotation, true_rotation) < MOUNT_BOUND_RAD
        assert np.abs(place[:2] - true_place[:2]).max() < PLACE_BOUND_M
        assert place[2] == 0.0  # the model's own value
    assert calibration.parameters.keys() == {"l_upper", "l_middle"}
    for name, value in calibration.parameters.items():
        assert abs(value - true.parameters[name]) < PLACE_BOUND_M


def test_without_noise_the_mounts_are_exact(model):
    true = wearing(7)
    recording = recorded(true, noise=False)[1]
    calibration = oarlock.calibration.calibrate_hinge_chain(model, recording, still_s=STILL_S)
    for name in UNITS:
        assert turn_between(calibration.mounts[name][0], true.mounts[name][0]) < EXACT_BOUND_RAD


def test_posture_and_sense_are_the_users(model):
    true, rest = wearing(3), {"upper_hinge": 0.3, "middle_hinge": -0.5}
    _, recording = recorded(true, noise=False, sign=-1.0, rest=(0.3, -0.5, 0.0))
    calibration = oarlock.calibration.calibrate_hinge_chain(
        model, recording, still_s=STILL_S, rest_q=rest, first_turn_positive=False
    )
    for name in UNITS:
        assert turn_between(calibration.mounts[name][0], true.mounts[name][0]) < EXACT_BOUND_RAD
    assert calibration.noted["rest_q"] == {**rest, "lower_hinge": 0.0}


def test_a_chain_that_found_itself_is_tracked(model):
    true = wearing(1)
    truth, recording = recorded(true)
    calibration = oarlock.calibration.calibrate_hinge_chain(model, recording)
    scores = oarlock.evaluate(oarlock.track(model, recording, calibration), truth)
    # The zero of each angle is as good as the mounts are.
    assert scores.worst_rmse_deg() < math.degrees(2 * MOUNT_BOUND_RAD)


def test_magnetometer_offsets_are_found_and_subtracted(model):
    true = wearing(2)
    _, recording = recorded(true)
    offset_in_link = np.array([9.0, -7.0, 0.0])
    offset = true.mounts["upper"][0].T @ offset_in_link
    upper = replace(recording["upper"], mag_ut=recording["upper"].mag_ut + offset)
    disturbed = Recording([upper, recording["middle"], recording["lower"]])
    calibration = oarlock.calibration.calibrate_hinge_chain(model, disturbed)
    in_link = true.mounts["upper"][0] @ calibration.mag_offsets_ut["upper"]
    # Along the hinge an offset is seen as a difference between the units only.
    assert np.abs(in_link - offset_in_link)[:2].max() < FIELD_BOUND_UT
    track = oarlock.track(model, disturbed, calibration)
    by_hand = oarlock.Calibration(calibration.parameters, calibration.mounts)
    corrected = [
        replace(s, mag_ut=s.mag_ut - calibration.mag_offsets_ut.get(s.name, np.zeros(3))) for s in disturbed
    ]
    assert track.q.tobytes() == oarlock.track(model, Recording(corrected), by_hand).q.tobytes()
    assert any("magnetometer offsets of upper" in note for note in track.notes)


def test_an_undisturbed_magnetometer_keeps_its_readings(model):
    calibration = oarlock.calibration.calibrate_hinge_chain(model, recorded(wearing(4))[1])
    assert not calibration.mag_offsets_ut
    assert all(not figures["mag_offset_used"] for figures in calibration.noted["sensor"].values())


def test_magnetometers_are_not_needed(model):
    true = wearing(5)
    streams = [ImuStream(s.name, s.time_s, s.gyro_rad_s, s.accel_m_s2) for s in recorded(true)[1]]
    calibration = oarlock.calibration.calibrate_hinge_chain(model, Recording(streams))
    assert "field" not in calibration.noted
    assert turn_between(calibration.mounts["lower"][0], true.mounts["lower"][0]) < MOUNT_BOUND_RAD


def test_a_gap_leaves_the_mounts_and_gives_up_the_rest(model):
    true = wearing(0)
    recording = recorded(true)[1]
    gyro_rad_s = np.array(recording["middle"].gyro_rad_s)
    gyro_rad_s[500:550] = np.nan
    middle = replace(recording["middle"], gyro_rad_s=gyro_rad_s)
    calibration = oarlock.calibration.calibrate_hinge_chain(
        model, Recording([recording["upper"], middle, recording["lower"]])
    )
    assert turn_between(calibration.mounts["middle"][0], true.mounts["middle"][0]) < MOUNT_BOUND_RAD
    assert not calibration.parameters
    assert calibration.mounts["middle"][1].tolist() == [0.255, 0.0, 0.0]  # the model's own
    assert "middle: no gyroscope from" in calibration.noted["kept_nominal"][0]


def test_a_part_of_a_chain_is_a_chain(model):
    true = wearing(6)
    calibration = oarlock.calibration.calibrate_hinge_chain(
        model, recorded(true)[1], sensors=["middle", "upper"]
    )
    assert list(calibration.mounts) == ["upper", "middle"]
    assert calibration.noted["left_out"] == ["lower"]


# --- other axes ---------------------------------------------------------------------------------------


TILTED = """
format = 1
name = "tilted"
parameters = { a_1 = 0.4, d_2 = 0.1 }
process.hinge = { kind = "jerk", density = 40.0, start_std = [0.2, 0.5, 5.0] }
joint = [{ name = "first", kind = "hinge" }, { name = "second", kind = "hinge" }]
frame = [
    { name = "stand", parent = "root", transform = { rpy = ["pi/2", 0, 0] } },
    { name = "one", parent = "stand", joint = "first", dh = { a = "a_1", alpha = "pi/2", d = 0, theta = 0 } },
    { name = "two", parent = "one", joint = "second", sign = -1, dh = { a = 0.3, alpha = 0, d = "d_2", theta = 0 } },
]
sensor = [
    { name = "s_one", kind = "imu", frame = "one", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.1 },
    { name = "s_two", kind = "imu", frame = "two", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.1 },
]
[world]
up = "z"
forward = "x"
gravity_m_s2 = 9.81
magnetic_norm_ut = 50.0
magnetic_dip_rad = 1.0
magnetic_azimuth_rad = 0.3
"""


@pytest.fixture(scope="module")
def tilted(tmp_path_factory):
    file = tmp_path_factory.mktemp("model") / "tilted.toml"
    file.write_text(TILTED)
    return oarlock.load_model(file)


def test_hinges_of_denavit_hartenberg_rows_lie_along_z_of_the_parent(tilted):
    q = np.array([0.2, -0.4])
    poses = tilted.forward_kinematics(q)
    one, two = hinge_links(tilted, ["s_two", "s_one"], q)
    assert (one.joint, two.joint) == ("first", "second")
    np.testing.assert_allclose(one.axis_in_world, poses[1, :3, 2], atol=1e-12)
    np.testing.assert_allclose(two.axis_in_world, -poses[2, :3, 2], atol=1e-12)
    np.testing.assert_allclose(one.hinge_in_world, poses[1, :3, 3], atol=1e-12)
    # The nearest point of the second axis lies d_2 further along it than the parent's origin.
    np.testing.assert_allclose(two.hinge_in_world, poses[2, :3, 3] + 0.1 * poses[2, :3, 2], atol=1e-12)


def test_orientations_of_hinges_that_are_not_parallel_give_back_the_angles(tilted):
    time_s = np.arange(0.0, 6.0, 0.02)
    moving = np.clip(time_s - 1.0, 0.0, None)
    q = np.column_stack([2.5 * np.sin(moving), -1.2 * np.sin(1.7 * moving)])
    poses = tilted.forward_kinematics(q)
    turns = Rotation.random(2, random_state=1).as_matrix()
    mounts = {"s_one": (turns[0], np.zeros(3)), "s_two": (turns[1], np.zeros(3))}
    streams, orientations = [], {}
    for name, frame, north in (("s_one", 2, 0.4), ("s_two", 3, -1.3)):
        earth_from_sensor = Rotation.from_euler("z", north) * Rotation.from_matrix(
            poses[:, frame, :3, :3] @ mounts[name][0]
        )
        orientations[name] = earth_from_sensor.as_quat()[:, [3, 0, 1, 2]]
        streams.append(ImuStream(name, time_s, gyro_rad_s=np.zeros((len(time_s), 3))))
    orientations["s_two"][200] = np.nan
    reference = angles_from_orientations(
        tilted, Recording(streams), orientations, Calibration(mounts=mounts), still_s=(0.0, 1.0)
    )
    expected = q.copy()
    expected[200, 1] = np.nan
    np.testing.assert_allclose(reference.track.q, expected, atol=1e-9)
    assert np.nanmax(reference.off_hinge_rad["second"]) < 1e-6
    assert np.nanmax(reference.off_hinge_plain_rad["second"]) > 0.5


# --- real ---------------------------------------------------------------------------------------------


def test_the_real_pendulum_agrees_with_the_vendor(model, measured, found):
    orientations = read_apdm_orientations(FILE)
    track = oarlock.track(model, measured.only(found.mounts), found)
    whole = oarlock.evaluation.evaluate_orientations(track, measured, orientations, found)
    early = oarlock.evaluation.evaluate_orientations(
        track, measured, orientations, found, end_s=BEFORE_SLIP_S
    )
    for name in ("upper_hinge", "middle_hinge"):
        assert whole[name].rmse < AGREEMENT_RAD
        assert whole[name].correlation > 0.998
    assert early["lower_hinge"].rmse < AGREEMENT_RAD * 1.5
    assert whole["lower_hinge"].rmse < SLIP_RAD
    assert whole["lower_hinge"].correlation > 0.99
    assert whole.samples > early.samples > 0
    assert "plain 11" in whole["lower_hinge"].note


def test_the_noted_figures_are_finite_and_survive_a_file(found, tmp_path):
    assert found.noted["left_out"] == ["static"]
    assert found.noted["still_s"][1] == pytest.approx(2.37, abs=0.05)
    for figures in found.noted["sensor"].values():
        numbers = [x for v in figures.values() if not isinstance(v, str | bool) for x in np.atleast_1d(v)]
        assert len(numbers) > 25
        assert np.isfinite(numbers).all()
    found.save(tmp_path / "calibration.toml")
    again = oarlock.load_calibration(tmp_path / "calibration.toml")
    assert again.noted == found.noted
    assert {n: o.tolist() for n, o in again.mag_offsets_ut.items()} == {
        n: o.tolist() for n, o in found.mag_offsets_ut.items()
    }


def test_the_commands_of_the_page_lead_from_the_file_to_angles(tmp_path):
    rec, cal, out = (tmp_path / name for name in ("rec", "cal.toml", "out"))
    run("import", "apdm", FILE, "--out", rec)
    calibrate = ("calibrate", "chain", rec, "--model", "pendulum3", "--out", cal)
    shown = run(*calibrate).stdout
    assert "l_upper = 0.52" in shown
    assert f"--calibration {cal} --streams upper,middle,lower" in " ".join(shown.split())
    only = ("--streams", "upper,middle,lower")
    run("track", rec, "--model", "pendulum3", "--calibration", cal, *only, "--out", out)
    assert (out / "report.html").is_file()
    assert "--force" in run(*calibrate, status=2).stderr


# --- refused ------------------------------------------------------------------------------------------


def without_gyroscope(measured):
    upper = ImuStream("upper", measured["upper"].time_s, accel_m_s2=measured["upper"].accel_m_s2)
    return Recording([upper, measured["middle"], measured["lower"]])


@pytest.mark.parametrize(
    ("recorded", "asked", "words"),
    [
        (lambda measured: measured.slice(3.0), {}, ["still", "upper"]),
        (lambda measured: measured.slice(0.0, 2.3), {}, ["turns by", "deg"]),
        (lambda measured: measured, {"still_s": (2.0, 1.0)}, ["still_s", "2.0, 1.0"]),
        (lambda measured: measured, {"swing_s": {"lowr": (3, 7)}}, ['"lower"']),
        (without_gyroscope, {}, ['"upper"', "gyro_rad_s"]),
        (lambda measured: measured.only(["static"]), {}, ["upper, middle, lower", "static"]),
        (
            lambda measured: measured,
            {"sensors": ["upper", "lower"]},
            ['"lower"', "2 hinges", "middle_hinge, lower_hinge"],
        ),
    ],
    ids=["no rest", "no swing", "rest", "swing", "no gyroscope", "no sensor", "link without sensor"],
)
def test_a_chain_that_cannot_be_found(model, measured, recorded, asked, words):
    assert_refused(
        lambda: oarlock.calibration.calibrate_hinge_chain(model, recorded(measured), **asked), *words
    )


def test_what_makes_no_chain_or_posture(model):
    sculler = oarlock.load_model("sculler")
    q = posture(sculler, None)
    assert_refused(lambda: hinge_links(sculler, ["back", "r_upperarm"], q), '"back"', "slide")
    assert_refused(lambda: posture(model, {"uper_hinge": 0.1}), "upper_hinge")
    assert_refused(lambda: posture(model, [0.1, 0.2]), "(2,)", "(3,)")


def test_a_stream_that_the_model_does_not_know_is_left_out(model, measured):
    track, alone = (
        oarlock.track(model, one) for one in (measured, measured.only(["upper", "middle", "lower"]))
    )
    assert "1 stream without a sensor in this model: static; not used" in track.notes
    np.testing.assert_array_equal(track.q, alone.q)
    assert measured.only(["lower", "upper"]).names == ("upper", "lower")
    assert_refused(lambda: measured.only(["uper"]), '"upper"')


def test_orientations_without_a_still_stretch(model, measured, found):
    orientations = read_apdm_orientations(FILE)
    short = {name: rows[:-1] for name, rows in orientations.items()}
    bare = Calibration(mounts=found.mounts)
    assert_refused(lambda: angles_from_orientations(model, measured, orientations, bare), "still_s")
    assert_refused(lambda: angles_from_orientations(model, measured, short, found), "1023 rows", "1024")
