"""Shipped bodies: left and right, lengths of a person, parts and units, angles."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock.model.anthropometry import LENGTH_PER_STATURE, radius_m

BODIES = ("trunk", "arm", "arm_left", "upper_body", "lower_body", "full_body")
REFLECTION = np.diag([1.0, 1.0, -1.0])
ROUNDED_M = 6e-4


@pytest.fixture(scope="module")
def full() -> oarlock.Model:
    return oarlock.load_model("full_body")


def other_side(name: str) -> str:
    return name[:-2] + {"_r": "_l", "_l": "_r"}.get(name[-2:], name[-2:])


def coordinate_sides(model: oarlock.Model) -> tuple[list[int], np.ndarray]:
    """Column of the other side of each coordinate, and -1 where a reflection across z changes its sign."""
    names = list(model.coordinate_names)
    joints = [name.rpartition(".") for name in names]
    twins = [f"{other_side(joint)}.{label}" if joint else other_side(label) for joint, _, label in joints]
    middle = ("_bending", "_rotation")
    signs = [
        -1.0
        if name in ("pelvis.z", "pelvis.rx", "pelvis.ry") or label in ("rx", "ry")
        else -1.0
        if not joint and twin == name and name.endswith(middle)
        else 1.0
        for name, twin, (joint, _, label) in zip(names, twins, joints, strict=True)
    ]
    return [names.index(twin) for twin in twins], np.array(signs)


def test_left_is_right_mirrored_in_every_posture(full):
    random = np.random.default_rng(0)
    q = random.uniform(-1.0, 1.0, (20, len(full.coordinate_names)))
    columns, signs = coordinate_sides(full)
    poses, mirrored = full.forward_kinematics(q), full.forward_kinematics(q[:, columns] * signs)
    twins = [full.frame_names.index(other_side(name)) for name in full.frame_names]
    assert sum(other_side(name) != name for name in full.frame_names) == 2 * 16
    expected = REFLECTION @ poses[..., :3, :3] @ REFLECTION
    np.testing.assert_allclose(mirrored[:, twins][..., :3, :3], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        mirrored[:, twins][..., :3, 3], poses[..., :3, 3] @ REFLECTION, rtol=0, atol=1e-12
    )


def test_left_and_right_have_equal_limits_units_and_lengths(full):
    described = full.describe()
    joints = {joint.name: joint for joint in described.joints}
    sensors = {sensor.name: sensor for sensor in described.inertial_units}
    for name, joint in joints.items():
        assert joints[other_side(name)].limits == joint.limits, name
    for name, sensor in sensors.items():
        twin = np.array(sensors[other_side(name)].mount.offset)
        np.testing.assert_array_equal(
            twin, REFLECTION @ np.array(sensor.mount.offset) if name[-2:] == "_r" else twin
        )
    for name, value in full.parameters.items():
        assert full.parameters[other_side(name)] == value


@pytest.mark.parametrize("name", BODIES)
def test_lengths_are_those_of_a_person_of_175_cm(name):
    model = oarlock.load_model(name)
    person = oarlock.load_model(name, stature_m=1.75, mass_kg=70.0)
    for parameter, value in model.parameters.items():
        assert person.parameters[parameter] == pytest.approx(value, abs=ROUNDED_M), parameter


def test_lengths_follow_stature_and_radii_mass():
    person = oarlock.load_model("full_body", stature_m=1.92, mass_kg=95.0)
    assert person.parameters["thigh_l"] == pytest.approx(0.245 * 1.92)
    # a cylinder of 0.1 of the mass and 1050 kg/m3
    volume_m3 = np.pi * person.parameters["thigh_radius_r"] ** 2 * 0.245 * 1.92
    assert volume_m3 * 1050.0 == pytest.approx(9.5)
    stds = {p.name: p.std for p in person.describe().parameters}
    assert stds["forearm_r"] == pytest.approx(0.05 * 0.146 * 1.92)
    assert stds["hip_r"] == pytest.approx(0.10 * LENGTH_PER_STATURE["hip"] * 1.92)
    assert radius_m("thigh", 1.92, 95.0) == person.parameters["thigh_radius_l"]


def test_standing_is_as_tall_as_the_person():
    model = oarlock.load_model("full_body", stature_m=1.80)
    poses = model.forward_kinematics(np.zeros(len(model.coordinate_names)))
    height = {name: pose[1, 3] for name, pose in zip(model.frame_names, poses, strict=True)}
    assert height["head_top"] - height["toe_r"] == pytest.approx((0.530 + 0.288 + 0.052 + 0.130) * 1.80)
    assert height["upper_arm_l"] - height["thigh_l"] == pytest.approx(0.288 * 1.80)


def test_a_measured_length_has_precedence():
    model = oarlock.load_model("arm", {"upper_arm_r": 0.30}, stature_m=1.78)
    assert model.parameters["upper_arm_r"] == 0.30


@pytest.mark.parametrize(
    ("asked", "about"),
    [
        ({"stature_m": 178.0}, "expected 1 to 2.4 m"),
        ({"mass_kg": 74.0}, "give stature_m too"),
        ({"stature_m": 1.78, "mass_kg": 7400.0}, "expected 15 to 250 kg"),
    ],
)
def test_a_stature_in_another_unit_is_refused(asked, about):
    with pytest.raises(oarlock.DataError, match=about):
        oarlock.load_model("arm", **asked)


def test_a_model_without_a_body_has_no_stature():
    with pytest.raises(oarlock.DataError, match="none of the lengths"):
        oarlock.load_model("pendulum3", stature_m=1.78)


@pytest.mark.parametrize("name", [name for name in BODIES if name != "full_body"])
def test_a_part_moves_as_in_the_whole_body(name, full):
    part = oarlock.load_model(name)
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (5, len(part.coordinate_names)))
    whole = np.zeros((5, len(full.coordinate_names)))
    for column, coordinate in enumerate(part.coordinate_names):
        if coordinate in full.coordinate_names:
            whole[:, full.coordinate_names.index(coordinate)] = q[:, column]
    root = part.frame_names[1]
    ours, theirs = part.forward_kinematics(q), full.forward_kinematics(whole)
    for frame in part.frame_names[1:]:
        np.testing.assert_allclose(
            np.linalg.inv(ours[:, 1]) @ ours[:, part.frame_names.index(frame)],
            np.linalg.inv(theirs[:, full.frame_names.index(root)]) @ theirs[:, full.frame_names.index(frame)],
            rtol=0,
            atol=1e-12,
            err_msg=frame,
        )


def test_arms_are_mirrored_and_lower_body_has_no_arm():
    assert oarlock.load_model("arm_left").coordinate_names == [
        other_side(name) if name[-2:] == "_r" else name.replace("_r.", "_l.")
        for name in oarlock.load_model("arm").coordinate_names
    ]
    lower = oarlock.load_model("lower_body")
    assert not [name for name in (*lower.frame_names, *lower.parameters) if "arm" in name]
    assert lower.sensor_names == ["pelvis", "thigh_r", "shank_r", "foot_r", "thigh_l", "shank_l", "foot_l"]


def test_units_cut_the_body_to_what_they_measure(full):
    leg = full.with_units(["shank_l", "thigh_l"])
    assert leg.sensor_names == ["thigh_l", "shank_l"]
    assert [joint.name for joint in leg.describe().joints] == [
        "thigh_l",
        "knee_flexion_l",
        "knee_adduction_l",
        "knee_rotation_l",
    ]
    assert leg.describe().joints[0].kind == "free"
    assert set(leg.parameters) == {"thigh_l", "thigh_radius_l", "shank_l", "shank_radius_l"}
    both = full.with_units(["thigh_l", "thigh_r"])
    assert both.frame_names[:2] == ["root", "pelvis"]
    assert full.with_units(full.sensor_names).coordinate_names == full.coordinate_names


def test_units_of_a_body_on_a_boat_only_take_sensors_away():
    sculler = oarlock.load_model("sculler")
    fewer = sculler.with_units(["back", "seat"])
    assert fewer.coordinate_names == sculler.coordinate_names
    assert fewer.sensor_names == ["back", "seat"]


@pytest.mark.parametrize(("units", "about"), [(["shin_r"], "no sensor"), ([], "none is named")])
def test_unknown_units_are_refused(full, units, about):
    with pytest.raises(oarlock.DataError, match=about):
        full.with_units(units)


# Parent and child, and the angles of the society's sequence ZXY in the order of that sequence, with their signs; a
# number where the joint has no such hinge.
CARRYING_RAD = 0.175
JOINT_TRIPLES = {
    ("pelvis", "thigh"): (("hip_flexion", 1), ("hip_adduction", 1), ("hip_rotation", 1)),
    ("thigh", "shank"): (("knee_flexion", -1), ("knee_adduction", 1), ("knee_rotation", 1)),
    ("shank", "foot"): (("ankle_dorsiflexion", 1), ("ankle_inversion", 1), 0.0),
    ("upper_arm", "forearm"): (("elbow_flexion", 1), -CARRYING_RAD, ("elbow_pronation", 1)),
    ("forearm", "hand"): (("wrist_flexion", 1), ("wrist_deviation", 1), 0.0),
    ("pelvis", "lumbar"): (("lumbar_flexion", -1), ("lumbar_bending", 1), ("lumbar_rotation", 1)),
    ("lumbar", "thorax"): (("thoracic_flexion", -1), ("thoracic_bending", 1), ("thoracic_rotation", 1)),
    ("thorax", "head"): (("neck_flexion", -1), ("neck_bending", 1), ("neck_rotation", 1)),
}


def segment(model, poses, name, side):
    sided = f"{name}_{side}"
    return poses[:, model.frame_names.index(sided if sided in model.frame_names else name)]


def as_right(relative, side):
    """The society reports a left limb as if it were a right one, by its mirror image in the sagittal plane."""
    return REFLECTION @ relative @ REFLECTION if side == "l" else relative


@pytest.mark.parametrize("side", ["r", "l"])
@pytest.mark.parametrize(("parent", "child"), JOINT_TRIPLES)
def test_joints_are_the_society_s_sequence_z_x_y(full, parent, child, side):
    q = np.random.default_rng(2).uniform(-1.0, 1.0, (10, len(full.coordinate_names)))
    poses = full.forward_kinematics(q)[..., :3, :3]
    relative = np.swapaxes(segment(full, poses, parent, side), 1, 2) @ segment(full, poses, child, side)
    sided = f"{child}_{side}" in full.frame_names
    angles = Rotation.from_matrix(as_right(relative, side if sided else "r")).as_euler("ZXY")
    for k, expected in enumerate(JOINT_TRIPLES[parent, child]):
        if isinstance(expected, float):
            np.testing.assert_allclose(angles[:, k], expected, rtol=0, atol=1e-12)
            continue
        name, sign = expected
        column = full.coordinate_names.index(f"{name}_{side}" if sided else name)
        np.testing.assert_allclose(angles[:, k], sign * q[:, column], rtol=0, atol=1e-12, err_msg=name)


def turned_back(first_rad, middle_rad, last_rad, sequence):
    """The rotation of angles about the axes of a sequence."""
    angles = np.column_stack([first_rad, middle_rad, last_rad])
    return Rotation.from_euler(sequence, angles).as_matrix()


def moving(model, seed=3, count=60, reach_rad=0.5):
    """Smooth movement of all joints about their rest, as a ground truth without a recording."""
    random = np.random.default_rng(seed)
    time_s = np.linspace(0.0, 6.0, count)
    joints = {}
    for joint in model.describe().joints:
        waves = [
            0.5 * random.uniform(0.3, 1.0) * np.sin(random.uniform(1.0, 2.5) * time_s + random.uniform(0, 6))
            for _ in joint.coordinates
        ]
        low, high = joint.limits if joint.kind == "hinge" else (-2 * reach_rad, 2 * reach_rad)
        rest = np.ravel(joint.rest)
        scale = [
            0.1 if name.endswith((".x", ".y", ".z")) else min(reach_rad, (high - low) / 3)
            for name in joint.coordinates
        ]
        start = np.minimum(1.0, time_s / 1.5) ** 2 * (3 - 2 * np.minimum(1.0, time_s / 1.5))
        values = rest[:, None] + start * np.array(scale)[:, None] * np.array(waves)
        joints[joint.name] = values[0] if len(values) == 1 else values.T
    return oarlock.simulation.Motion.from_joints(time_s, joints)


@pytest.fixture(scope="module")
def moved(full):
    return oarlock.simulate(full, moving(full), sensors=["pelvis"], noise=False)[0]


@pytest.mark.parametrize("side", ["r", "l"])
def test_shoulder_angles_are_the_society_s(full, moved, side):
    angles = oarlock.joint_angles(moved)
    plane, elevation, rotation = (
        angles[f"shoulder_{name}_{side}"].angle_rad for name in ("plane", "elevation", "rotation")
    )
    poses = full.forward_kinematics(moved.q)[..., :3, :3]
    relative = np.swapaxes(segment(full, poses, "thorax", side), 1, 2) @ segment(
        full, poses, "upper_arm", side
    )
    # Wu et al. 2005: Y (plane of elevation), X (elevation, negative), Y (axial rotation)
    expected = turned_back(plane, -elevation, rotation, "YXY")
    np.testing.assert_allclose(expected, as_right(relative, side), rtol=0, atol=1e-9)


@pytest.mark.parametrize("side", ["r", "l"])
@pytest.mark.parametrize(
    ("sequence", "names", "signs"),
    [
        ("XZY", ("abduction", "flexion", "rotation"), (-1, 1, 1)),
        ("ZXY", ("flexion", "abduction", "rotation"), (1, -1, 1)),
    ],
)
def test_other_sequences_of_the_shoulder(full, moved, side, sequence, names, signs):
    angles = oarlock.joint_angles(moved, shoulder=sequence)
    three = [
        sign * angles[f"shoulder_{name}_{side}"].angle_rad for name, sign in zip(names, signs, strict=True)
    ]
    poses = full.forward_kinematics(moved.q)[..., :3, :3]
    relative = np.swapaxes(segment(full, poses, "thorax", side), 1, 2) @ segment(
        full, poses, "upper_arm", side
    )
    np.testing.assert_allclose(turned_back(*three, sequence), as_right(relative, side), rtol=0, atol=1e-9)


@pytest.mark.parametrize("side", ["r", "l"])
def test_a_raised_arm_has_the_clinic_s_signs(full, side):
    """Sideways is plane 0, forward is plane 90 deg; palm in is internal rotation."""
    inward = {"r": 1.0, "l": -1.0}[side]
    for about, plane_deg in (([-inward, 0.0, 0.0], 0.0), ([0.0, 0.0, 1.0], 90.0)):
        time_s = np.linspace(0.0, 1.0, 20)
        turn = np.radians(70.0) * np.array(about) * np.linspace(0.9, 1.0, 20)[:, None]
        joints = {joint.name: np.tile(np.ravel(joint.rest), (20, 1)) for joint in full.describe().joints}
        joints = {name: values[:, 0] if values.shape[1] == 1 else values for name, values in joints.items()}
        motion = oarlock.simulation.Motion.from_joints(time_s, joints | {f"shoulder_{side}": turn})
        angles = oarlock.joint_angles(oarlock.simulate(full, motion, sensors=["pelvis"], noise=False)[0])
        assert np.degrees(angles[f"shoulder_elevation_{side}"].angle_rad[-1]) == pytest.approx(70.0, abs=0.5)
        assert np.degrees(angles[f"shoulder_plane_{side}"].angle_rad[-1]) == pytest.approx(plane_deg, abs=0.5)


def test_pelvis_angles_are_rotation_obliquity_tilt(full, moved):
    angles = oarlock.joint_angles(moved)
    rotation, obliquity, tilt = (
        angles[f"pelvis_{name}"].angle_rad for name in ("rotation", "obliquity", "tilt")
    )
    pelvis = full.forward_kinematics(moved.q)[:, full.frame_names.index("pelvis"), :3, :3]
    np.testing.assert_allclose(turned_back(rotation, -obliquity, -tilt, "YXZ"), pelvis, rtol=0, atol=1e-9)


def test_hinges_keep_their_names_and_unknown_sequences_are_refused(full, moved):
    angles = oarlock.joint_angles(moved)
    assert set(full.joint_names) - set(angles) == {"pelvis", "shoulder_r", "shoulder_l"}
    np.testing.assert_array_equal(angles["knee_flexion_l"].angle_rad, moved["knee_flexion_l"].angle_rad)
    with pytest.raises(oarlock.DataError, match="expected YXY"):
        oarlock.joint_angles(moved, shoulder="XYX")


def test_limits_are_wider_than_walking_and_narrower_than_a_turn(full):
    limits = {
        joint.name: np.degrees(joint.limits) for joint in full.describe().joints if joint.kind == "hinge"
    }
    assert limits["knee_flexion_r"] == pytest.approx([-10, 145])
    assert limits["elbow_flexion_l"] == pytest.approx([-10, 150])
    assert all(high - low <= 180 for low, high in limits.values())


@pytest.mark.parametrize("name", ["lower_body", "upper_body"])
def test_simulated_movement_is_found_again(name):
    """Units as the model says, no magnetometers. Bands and errors of the second half, after headings have settled."""
    model = oarlock.load_model(name, stature_m=1.72, mass_kg=66.0)
    quiet = {sensor: {"gyro_rad_s": 0.01, "accel_m_s2": 0.1} for sensor in model.sensor_names}
    truth, recording = oarlock.simulate(model, moving(model), seed=4, rate_hz=50.0, noise=quiet)
    track = oarlock.track(model, recording)
    late = track.time_s > 3.0
    for joint in model.describe().joints:
        if joint.kind == "hinge":
            error = np.degrees(track[joint.name].angle_rad - truth[joint.name].angle_rad)[late]
            rms = np.sqrt(np.mean(error**2))
            assert rms < np.degrees(np.sqrt(np.mean(track[joint.name].std_rad[late] ** 2))), joint.name
            # the heading between two units, as hip rotation: 4.3 to 5.2 with seeds 4 to 6
            assert rms < 6.0, joint.name
    assert not [note for note in track.notes if "beyond" in note]


def test_low_pass_removes_vibration_and_keeps_turning():
    time_s = np.arange(0.0, 10.0, 0.01)
    slow, fast = np.sin(2 * np.pi * time_s), 15.0 * np.sin(2 * np.pi * 25.0 * time_s)
    gyro = np.column_stack([slow, slow + fast, fast])
    gyro[400:420] = np.nan
    mixed = oarlock.Recording([oarlock.recording.ImuStream("thigh_r", time_s, gyro_rad_s=gyro)])
    calm = mixed.low_passed(6.0).sensor("thigh_r")
    assert len(calm.time_s) == 250
    inner = slice(25, 90)
    expected = np.sin(2 * np.pi * calm.time_s[inner])
    np.testing.assert_allclose(calm.gyro_rad_s[inner, 0], expected, rtol=0, atol=2e-3)
    # fourth order: 25 Hz falls to 1 / (1 + 4.2**4), times 15
    np.testing.assert_allclose(calm.gyro_rad_s[inner, 1], expected, rtol=0, atol=0.08)
    assert np.isnan(calm.gyro_rad_s[(calm.time_s > 4.0) & (calm.time_s < 4.19)]).all()
    with pytest.raises(oarlock.DataError, match="25 Hz or less"):
        mixed.low_passed(30.0)


def test_the_command_line_chooses_a_person_and_units():
    asked = [
        "model",
        "show",
        "full_body",
        "--stature-m",
        "1.92",
        "--mass-kg",
        "95",
        "--sensors",
        "thigh_l,shank_l",
        "--json",
    ]
    shown = json.loads(run(*asked).stdout)
    assert [sensor["name"] for sensor in shown["sensors"]] == ["thigh_l", "shank_l"]
    lengths = {parameter["name"]: parameter["value"] for parameter in shown["parameters"]}
    assert lengths["shank_l"] == pytest.approx(0.246 * 1.92)


def test_the_command_line_tracks_with_fewer_units(tmp_path):
    body = oarlock.load_model("lower_body")
    _, recording = oarlock.simulate(body, moving(body), seed=5, rate_hz=50.0)
    recording.save(tmp_path / "rec")
    asked = [
        "track",
        str(tmp_path / "rec"),
        "--model",
        "lower_body",
        "--stature-m",
        "1.75",
        "--sensors",
        "thigh_r,shank_r",
    ]
    run(*asked, "--low-pass-hz", "6", "--no-suspects", "--out", tmp_path / "out")
    tracked = oarlock.load_track(tmp_path / "out")
    assert tracked.coordinate_names[-3:] == ("knee_flexion_r", "knee_adduction_r", "knee_rotation_r")
    assert len(tracked.coordinate_names) == 9


MIRRORED = """format = 1
name = "pair"
mirror = { from = "_r", to = "_l", across = "z" }
[world]
up = "y"
forward = "x"
[[joint]]
name = "swing_r"
kind = "hinge"
[[frame]]
name = "arm_r"
parent = "root"
joint = "swing_r"
axis = "x"
transform = { translation = [0, 1, "2*0.1"] }
"""


def test_a_file_of_one_s_own_is_mirrored(tmp_path):
    file = tmp_path / "pair.toml"
    file.write_text(MIRRORED)
    pair = oarlock.load_model(file)
    assert pair.joint_names == ["swing_r", "swing_l"]
    right, left = pair.forward_kinematics([0.3, 0.3])[1:]
    np.testing.assert_allclose(left[:3, :3], REFLECTION @ right[:3, :3] @ REFLECTION, rtol=0, atol=1e-15)
    assert left[:3, 3] == pytest.approx([0.0, 1.0, -0.2])


@pytest.mark.parametrize(
    ("changed", "to", "about"),
    [
        ('across = "z"', 'across = "w"', "mirror.across"),
        ('across = "z" }', 'across = "z", by = 1 }', "mirror: expected"),
        (
            'transform = { translation = [0, 1, "2*0.1"] }',
            "dh = { a = 1, alpha = 0, d = 0, theta = 0 }",
            "dh row",
        ),
        ("[world]", 'part = { root = "leg_r", frames = [] }\n[world]', "part"),
        ("[world]", 'part = { root = "arm_r", frames = ["arm_l"] }\n[world]', "does not hang on"),
        ("[world]", 'part = { root = "root", frames = ["leg_r"] }\n[world]', 'no frame "leg_r"'),
    ],
)
def test_what_cannot_be_mirrored_or_cut_is_refused(tmp_path, changed, to, about):
    file = tmp_path / "pair.toml"
    file.write_text(MIRRORED.replace(changed, to))
    with pytest.raises(oarlock.ModelError, match=about):
        oarlock.load_model(file)


def test_a_magnetometer_that_the_body_does_not_use_adds_no_samples():
    body = oarlock.load_model("trunk")
    _, recording = oarlock.simulate(body, moving(body), seed=6, rate_hz=50.0)
    plain = oarlock.track(body, recording)
    with_field = []
    for stream in recording.streams:
        time_s = np.sort(np.concatenate([stream.time_s, stream.time_s[:-1:3] + 0.007]))
        rows = np.searchsorted(time_s, stream.time_s)
        gyro, accel, field = np.full((3, len(time_s), 3), np.nan)
        gyro[rows], accel[rows] = stream.gyro_rad_s, stream.accel_m_s2
        field[np.setdiff1d(np.arange(len(time_s)), rows)] = 30.0
        with_field.append(
            oarlock.recording.ImuStream(stream.name, time_s, gyro_rad_s=gyro, accel_m_s2=accel, mag_ut=field)
        )
    track = oarlock.track(body, oarlock.Recording(with_field))
    np.testing.assert_array_equal(track.time_s, plain.time_s)
    np.testing.assert_array_equal(track.q, plain.q)


def test_mistakes_of_a_mirrored_file_name_its_own_lines(tmp_path):
    file = tmp_path / "pair.toml"
    file.write_text(MIRRORED.replace('kind = "hinge"', 'kind = "hing"'))
    with pytest.raises(oarlock.ModelError) as refused:
        oarlock.load_model(file)
    assert f"{file}:9:" in str(refused.value)
