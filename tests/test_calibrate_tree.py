"""Joints, hinge axes, postures and fields of whole bodies, found in simulated recordings."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock.calibration.static.link_pairs import ROOT, link_pairs
from oarlock.rowing import row_piece
from oarlock.storage.errors import DataError
from refusals import assert_refused
from tree_body import TEXT, UNITS, place, recorded, tree, turn, waving

# Three to four times the largest standard deviation that is reported.
PLACE_BOUND_M = 0.004
# A hinge axis from 40 s of motion; gravity from a bias of 0.05 m/s2 on each axis.
AXIS_BOUND_RAD = 0.004
UPRIGHT_BOUND_RAD = 0.05 * np.sqrt(3.0) / 9.8


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tree(tmp_path_factory.mktemp("tree"))


def wearing(rotations=None, **parameters):
    """Places some centimetres off the model's; a trunk's own unit defines where the trunk is."""
    off = {
        "trunk": [0, 0, 0],
        "upper": [0.03, 0.02, -0.02],
        "lower": [-0.02, 0.01, 0.02],
        "shank": [0.02, 0.03, 0.05],
    }
    mounts = {
        name: ((rotations or {}).get(name, np.eye(3)), np.add(UNITS[name], off[name])) for name in UNITS
    }
    return oarlock.Calibration(
        {"arm_x": 0.21, "arm_y": 0.04, "arm_z": -0.03, "leg": 0.36, **parameters}, mounts
    )


# --- joints -------------------------------------------------------------------------------------------


def test_geometry_of_the_joints_is_read_off_the_poses(model):
    pairs = {p.child: p for p in link_pairs(model, list(UNITS), "test")}
    assert {c: p.parent for c, p in pairs.items()} == {"upper": "trunk", "lower": "upper", "shank": "trunk"}
    np.testing.assert_allclose(pairs["upper"].center, [0.25, 0, 0, 0, 0, 0], atol=1e-12)
    assert pairs["upper"].axis is None
    np.testing.assert_allclose(np.abs(pairs["lower"].axis), [0, 1, 0, 0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(pairs["shank"].center, [0, 0, -0.3, 0, 0, 0], atol=1e-12)


def test_places_and_lengths_of_a_tree_are_found(model):
    true = wearing()
    found = oarlock.calibration.calibrate_joint_centers(model, recorded(model, true))
    assert "trunk" not in found.mounts  # lengths place all that hangs on it
    for name in found.mounts:
        assert np.abs(place(found, true, name)).max() < PLACE_BOUND_M, name
    for name in ("arm_x", "arm_y", "arm_z", "leg"):
        assert abs(found.parameters[name] - true.parameters[name]) < PLACE_BOUND_M, name
        assert found.noted["parameter_std_m"][name] < 0.5 * PLACE_BOUND_M
    joints = found.noted["joint"]
    assert joints["shoulder"]["loose"] == [] and len(joints["elbow"]["loose"]) == 1
    assert np.abs(joints["elbow"]["loose"][0]["second"])[1] > 0.7 * np.sqrt(0.5)
    assert max(max(j["left_m"]) for j in joints.values()) < PLACE_BOUND_M
    # Where the model places a hinge along its axis, a unit before it tells the one behind.
    assert found.noted["kept_nominal"] == []


def test_a_length_may_have_the_name_of_a_unit(model, tmp_path):
    (tmp_path / "tree.toml").write_text(TEXT.replace("leg =", "shank =").replace('"-leg"', '"-shank"'))
    same = oarlock.load_model(tmp_path / "tree.toml")
    recording = recorded(model, wearing())
    named, plain = (oarlock.calibration.calibrate_joint_centers(m, recording) for m in (same, model))
    assert named.parameters["shank"] == plain.parameters["leg"]
    np.testing.assert_array_equal(named.mounts["shank"][1], plain.mounts["shank"][1])


def test_mounts_carry_places_to_the_links(model):
    turns = dict(zip(UNITS, Rotation.random(4, random_state=3).as_matrix(), strict=True))
    true = wearing(turns)
    start = oarlock.Calibration(mounts={name: (r, UNITS[name]) for name, r in turns.items()})
    found = oarlock.calibration.calibrate_joint_centers(model, recorded(model, true), calibration=start)
    assert np.abs(place(found, true, "upper")).max() < PLACE_BOUND_M
    assert (found.mounts["trunk"][0] == turns["trunk"]).all()


def test_a_fixed_length_that_is_wrong_is_reported(model, tmp_path):
    true = wearing()
    longer = tmp_path / "longer.toml"
    longer.write_text(model.text.replace("[0.28, 0, 0]", "[0.34, 0, 0]"), encoding="utf-8")
    found = oarlock.calibration.calibrate_joint_centers(oarlock.load_model(longer), recorded(model, true))
    joints = found.noted["joint"]
    # Shoulder and elbow both lie beside their place in the upper arm: together the 60 mm.
    missed = max(joints["elbow"]["left_m"]) + max(joints["shoulder"]["left_m"])
    assert abs(missed - 0.06) < 0.02
    assert max(joints["knee"]["left_m"]) < PLACE_BOUND_M


def test_a_root_at_rest_counts_as_a_body():
    model = oarlock.load_model("arm7")
    true = oarlock.Calibration(
        {"l_ua": 0.29, "l_fa": 0.25},
        {
            "upperarm": (np.eye(3), [-0.13, 0.02, 0.05]),
            "forearm": (np.eye(3), [0.01, 0.08, 0.025]),
            "hand": (np.eye(3), [0.01, -0.03, 0.01]),
        },
    )
    recording = recorded(model, true)
    found = oarlock.calibration.calibrate_joint_centers(model, recording)
    assert found.noted["joint"]["shoulder_abduction+shoulder_rotation+shoulder_flexion"]["parent"] == ROOT
    for name in true.mounts:
        assert np.abs(place(found, true, name)).max() < PLACE_BOUND_M, name
    for name, value in true.parameters.items():
        assert abs(found.parameters[name] - value) < PLACE_BOUND_M
    moving = oarlock.calibration.calibrate_joint_centers(model, recording, root_at_rest=False)
    assert len(moving.noted["joint"]) == 2


def test_rowing_is_motion_enough_for_the_arms():
    true = {"l_ua_r": 0.30, "l_ua_l": 0.33}
    worn = oarlock.load_model("sculler", parameters=true)
    recording = oarlock.simulate(
        worn, row_piece(worn, 40.0, 26.0).motion, rate_hz=100.0, gyro_bias_rad_s=0.01, accel_bias_m_s2=0.03
    )[1]
    found = oarlock.calibration.calibrate_joint_centers(oarlock.load_model("sculler"), recording)
    for name, value in true.items():
        # From 15 to 18 mm off; a trunk that turns about one axis tells its shoulders less well.
        assert abs(found.parameters[name] - value) < 0.008
    # The trunk turns about one axis, along which its unit cannot be told.
    assert "back: offset along y of its link" in found.noted["kept_nominal"]


def test_without_motion_the_model_stays(model):
    recording = recorded(model, wearing(), amplitude=0.0)
    found = oarlock.calibration.calibrate_joint_centers(model, recording)
    nominal = {"upper", "lower", "shank"}
    for name in nominal:
        assert np.abs(found.mounts[name][1] - UNITS[name]).max() < 0.05
    assert len(found.noted["kept_nominal"]) == 3 * len(nominal) + 4


# --- hinge axes ---------------------------------------------------------------------------------------


def test_mounts_turn_until_the_hinges_lie_right(model):
    askew = dict(
        zip(
            UNITS,
            Rotation.from_rotvec(0.2 * np.random.default_rng(1).standard_normal((4, 3))).as_matrix(),
            strict=True,
        )
    )
    true = wearing(askew)
    found = oarlock.calibration.calibrate_hinge_axes(model, recorded(model, true))
    assert set(found.mounts) == set(UNITS)
    hinges = {"upper": [0, 1, 0], "lower": [0, 1, 0], "trunk": [1, 0, 0], "shank": [1, 0, 0]}
    for name, axis in hinges.items():
        off = turn(found, true, name)
        # About the hinge itself the mount keeps what it has.
        assert np.linalg.norm(off - np.dot(off, axis) * np.array(axis)) < AXIS_BOUND_RAD, name
        assert np.degrees(found.noted["sensor"][name]["turned_rad"]) > 1.0
    assert not any(j["ends_contradict"] for j in found.noted["joint"].values())
    assert found.noted["kept_nominal"] == []


def test_two_hinges_tell_a_mount_altogether(tmp_path, model):
    text = model.text.replace('name = "shoulder"\nkind = "ball"', 'name = "shoulder"\nkind = "hinge"')
    text = text.replace('joint = "shoulder"\n', 'joint = "shoulder"\naxis = "z"\n')
    file = tmp_path / "hinges.toml"
    file.write_text(text, encoding="utf-8")
    hinged = oarlock.load_model(file)
    true = wearing({"upper": Rotation.from_rotvec([0.2, -0.3, 0.25]).as_matrix()})
    found = oarlock.calibration.calibrate_hinge_axes(hinged, recorded(hinged, true))
    assert np.linalg.norm(turn(found, true, "upper")) < 2.0 * AXIS_BOUND_RAD


def test_an_axis_that_nothing_tells_turns_no_mount(model):
    nominal = next(s.mount for s in model.describe().inertial_units if s.name == "trunk")
    # The trunk rests, so nothing shows how the knee's axis lies in it.
    motion = waving(model)
    still = motion.q.copy()
    still[:, :3] = 0.0
    calm = oarlock.simulation.Motion(tuple(model.coordinate_names), motion.time_s, still)
    recording = oarlock.simulate(model, calm, rate_hz=100.0)[1]
    found = oarlock.calibration.calibrate_hinge_axes(model, recording, sensors=("trunk", "shank"))
    assert found.noted["kept_nominal"] == ["trunk: axis of knee"]
    assert found.noted["sensor"]["trunk"]["turned_rad"] < 0.2 * nominal.std_rad
    # The noise of a gyroscope at rest looks a little like turning.
    assert (found.mount_stds_rad["trunk"] > 0.85 * nominal.std_rad).all()


# --- a still posture ----------------------------------------------------------------------------------


def test_a_still_posture_sets_mounts_upright_and_keeps_their_heading(model):
    askew = {
        "lower": Rotation.from_rotvec([0.2, -0.1, 0.0]).as_matrix(),
        "trunk": Rotation.from_rotvec([0, 0, 0.3]).as_matrix(),
    }
    true = wearing(askew)
    recording = recorded(model, true, still_s=4.0, seconds=10.0)
    found = oarlock.calibration.calibrate_pose(model, recording)
    start, end = found.noted["still_s"]
    assert start < 0.5 and 3.5 < end < 4.5
    assert found.noted["pose"]["elbow"] == 0.4
    bend = Rotation.from_rotvec([0, 0.4, 0])
    up = {"trunk": [0, 0, 1], "upper": [0, 0, 1], "lower": bend.inv().apply([0, 0, 1]), "shank": [0, 0, 1]}
    for name, direction in up.items():
        off = turn(found, true, name)
        about_up = np.dot(off, direction)
        assert np.linalg.norm(off - about_up * np.asarray(direction)) < UPRIGHT_BOUND_RAD, name
    # Gravity does not show a heading: the trunk's error of 0.3 rad stays.
    assert turn(found, true, "trunk")[2] == pytest.approx(-0.3, abs=UPRIGHT_BOUND_RAD)
    unit = found.noted["sensor"]["lower"]
    np.testing.assert_allclose(unit["gyro_bias_rad_s"], 0.005, atol=0.001)
    assert unit["std_rad"] > np.radians(3.0) > unit["sensor_std_rad"]


def test_the_posture_is_the_users(model):
    recording = recorded(model, wearing(), still_s=4.0, seconds=6.0)
    straight = oarlock.calibration.calibrate_pose(model, recording, {"elbow": 0.0}, (0.5, 3.5))
    assert straight.noted["sensor"]["lower"]["turned_rad"] == pytest.approx(0.4, abs=UPRIGHT_BOUND_RAD)
    assert_refused(lambda: oarlock.calibration.calibrate_pose(model, recording, {"elbo": 0.0}), "elbo")
    assert_refused(
        lambda: oarlock.calibration.calibrate_pose(model, recording, None, (3.0, 2.0)), "later end"
    )
    with pytest.raises(DataError, match=r"`trunk`.*5.00 to 7.00 s"):
        oarlock.calibration.calibrate_pose(model, recording, None, (5.0, 7.0))


# --- the field, and all of them together ---------------------------------------------------------------


def test_the_field_becomes_parameters(model):
    true = wearing(field_norm_ut=52.0, field_dip_rad=1.15)
    recording = recorded(model, true, still_s=5.0, seconds=10.0)
    found = oarlock.calibration.calibrate_field(model, recording)
    assert found.parameters["field_norm_ut"] == pytest.approx(52.0, abs=0.1)
    # A bias of the accelerometer of 0.05 m/s2 tilts up.
    assert found.parameters["field_dip_rad"] == pytest.approx(1.15, abs=UPRIGHT_BOUND_RAD)
    plain = oarlock.calibration.calibrate_field(oarlock.load_model("arm7"), as_arm(recording))
    assert plain.parameters == {} and plain.noted["field"]["norm_ut"] == found.parameters["field_norm_ut"]


def as_arm(recording):
    streams = [
        oarlock.recording.ImuStream(name, s.time_s, **s.values)
        for name, s in zip(("upperarm", "forearm", "hand"), recording.streams, strict=False)
    ]
    streams.append(
        oarlock.recording.ImuStream("x", *(recording["shank"].time_s,), **recording["shank"].values)
    )
    return oarlock.Recording(streams)


def test_one_after_the_other(model, tmp_path):
    askew = dict(
        zip(
            UNITS,
            Rotation.from_rotvec(0.15 * np.random.default_rng(5).standard_normal((4, 3))).as_matrix(),
            strict=True,
        )
    )
    true = wearing(askew, field_norm_ut=50.0)
    recording = recorded(model, true, still_s=4.0, seconds=30.0)
    found = oarlock.calibration.calibrate_field(model, recording)
    found = oarlock.calibration.calibrate_pose(model, recording, calibration=found)
    found = oarlock.calibration.calibrate_hinge_axes(model, recording, calibration=found)
    found = oarlock.calibration.calibrate_joint_centers(model, recording, calibration=found)
    found.save(tmp_path / "worn.toml")
    again = oarlock.load_calibration(tmp_path / "worn.toml")
    assert again.parameters == found.parameters and again.noted == found.noted
    assert again.noted["before"]["before"]["before"]["how"] == "magnetic field in calm stretches"
    assert abs(again.parameters["arm_x"] - true.parameters["arm_x"]) < 2.0 * PLACE_BOUND_M
    assert np.linalg.norm(turn(again, true, "upper")) < 2.0 * UPRIGHT_BOUND_RAD


# --- refusals and the command line ---------------------------------------------------------------------


def test_what_cannot_be_searched_is_refused(model):
    recording = recorded(model, wearing(), seconds=5.0)
    with pytest.raises(DataError, match=r'no inertial unit "uper".*"upper"'):
        oarlock.calibration.calibrate_joint_centers(model, recording, sensors=("trunk", "uper"))
    with pytest.raises(DataError, match="no joint with a centre"):
        oarlock.calibration.calibrate_joint_centers(model, recording, sensors=("lower", "shank"))
    with pytest.raises(DataError, match="no single hinge"):
        oarlock.calibration.calibrate_hinge_axes(model, recording, sensors=("trunk", "upper"))
    bare = oarlock.Recording([oarlock.recording.ImuStream("trunk", [0.0, 0.1], gyro_rad_s=np.zeros((2, 3)))])
    assert_refused(lambda: oarlock.calibration.calibrate_pose(model, bare), "gyro_rad_s and accel_m_s2")
    assert_refused(lambda: oarlock.calibration.calibrate_field(model, bare), "recorded mag_ut")


def test_two_units_on_one_body_are_refused(model, tmp_path):
    twin = tmp_path / "twin.toml"
    sensor = model.text[model.text.index('[[sensor]]\nname = "upper"') :].split("\n\n")[0]
    twin.write_text(
        model.text + "\n" + sensor.replace('name = "upper"', 'name = "strap"', 1), encoding="utf-8"
    )
    recording = recorded(model, wearing(), seconds=5.0)
    strap = oarlock.recording.ImuStream("strap", recording["upper"].time_s, **recording["upper"].values)
    with pytest.raises(DataError, match='"upper" and "strap" sit on the same body'):
        oarlock.calibration.calibrate_joint_centers(
            oarlock.load_model(twin), oarlock.Recording([*recording.streams, strap])
        )


def test_commands(model, tmp_path):
    recorded(model, wearing(), still_s=3.0, seconds=20.0).save(tmp_path / "rec")
    (tmp_path / "tree.toml").write_text(model.text, encoding="utf-8")
    known = []
    for verb, words in (
        ("field", ["uT", "field_norm_ut"]),
        ("pose", ["stationary from", "heading stays nominal"]),
        ("axes", ["knee", "turned deg"]),
        ("joints", ["shoulder", "arm_x =", "standard deviation above 5 cm"]),
    ):
        out = tmp_path / f"{verb}.toml"
        command = [
            "calibrate",
            verb,
            tmp_path / "rec",
            "--model",
            tmp_path / "tree.toml",
            "--out",
            out,
            *known,
        ]
        done = run(*command)
        for word in ("Wrote", "oarlock track", *words):
            assert word in done.output, (verb, word)
        run(*command, status=2)
        assert run(*command, "--force", "--json").output.startswith("{")
        known = ["--calibration", out]
    assert len(oarlock.load_calibration(out).mounts) == 4
