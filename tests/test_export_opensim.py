"""OpenSim reads what is exported, and its bodies are where ours are."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock.model.shipped_files import model_names
from oarlock.rowing import ergometer_piece, sculling, sweeping
from oarlock.tracking.places import OFF_AXIS
from oarlock.tracking.track import track_without_filter
from opensim_reader import OpensimReader, opensim
from random_tree import load_tree, random_tree
from test_docs import free_body

ROUNDING_M = 1e-12
"""Poses behind a dozen links of a metre, from numbers that are written with all their digits."""
SOLVED_M = 1e-6
"""OpenSim's inverse kinematics stops at an accuracy, here 1e-10 of its least squares, and then is this near."""

TWO_PLACES = """
format = 1
name = "two_places"
world = { up = [0.6, 0, 0.8], forward = "y" }
joint = [
    { name = "knie_é", kind = "ball", rest = [0.1, 0.2, 0.3] },
    { name = "rail", kind = "slide", rest = 0.2 },
    { name = "stiff", kind = "fixed" },
    { name = "away", kind = "free" },
]
sensor = [{ name = "unit", kind = "imu", frame = "end", gyro_std_rad_s = 0.1 }]
[[frame]]
name = "ground"
parent = "root"
joint = "away"
transform = { rpy = [0.1, -0.2, 2], translation = [0, 1, 0] }
[[frame]]
name = "links_ä"
parent = "ground"
joint = "knie_é"
transform = { rpy = [0.4, 0.2, -1], translation = [0.1, 1, 0] }
[[frame]]
name = "rechts"
parent = "links_ä"
joint = "knie_é"
transform = { translation = [0, 0.5, 0.2] }
[[frame]]
name = "up_the_rail"
parent = "rechts"
joint = "rail"
axis = "-y"
transform = { rpy = [0, 1, 0], translation = [0, 0.5, 0.2] }
[[frame]]
name = "down_the_rail"
parent = "rechts"
joint = "rail"
sign = -1
transform = { translation = [0, 0.5, 0.2] }
[[frame]]
name = "end"
parent = "down_the_rail"
joint = "stiff"
dh = { a = 0.3, alpha = 1, d = 0.2, theta = -0.4 }
"""


def waves(model: oarlock.Model, seed: int, largest: float = 0.8) -> oarlock.simulation.Motion:
    """Three seconds of sines on every coordinate."""
    random, time_s = np.random.default_rng(seed), np.linspace(0.0, 3.0, 301)
    n = len(model.coordinate_names)
    wave = np.sin(time_s[:, None] * random.uniform(1, 5, n) + random.uniform(0, 6, n))
    return oarlock.simulation.Motion(
        tuple(model.coordinate_names), time_s, wave * random.uniform(0.1, largest, n)
    )


def truth_of(model: oarlock.Model, motion: oarlock.simulation.Motion, rate_hz: float = 50.0) -> oarlock.Track:
    return oarlock.simulate(model, motion, noise=False, rate_hz=rate_hz)[0]


def apart_m(track: oarlock.Track, folder: Path, every: int = 1, **settings: object) -> float:
    """The largest distance between a body of OpenSim and our frame; ground is the root's axes."""
    written = oarlock.export(track, folder, ("mot", "osim"), axes="root", **settings)
    reader = OpensimReader(folder)
    rows = np.arange(0, len(reader.time_s), every)
    np.testing.assert_array_equal(reader.time_s, track.time_s)
    places = reader.places(dict(written.body_names), rows)
    assert set(places) == set(track.model.frame_names)
    gap = max(
        float(np.linalg.norm(p - track.frame_positions(f)[rows], axis=1).max()) for f, p in places.items()
    )
    print(f"{track.model.name}: {len(rows)} rows, {len(places)} bodies, apart {gap:.1e} m")
    return gap


@pytest.mark.parametrize("name", model_names())
def test_bodies_are_where_frames_are_in_every_shipped_model(name, tmp_path):
    model = oarlock.load_model(name)
    assert apart_m(truth_of(model, waves(model, seed=1)), tmp_path, every=5) <= ROUNDING_M


def rowed(name: str) -> oarlock.Track:
    model = oarlock.load_model(name)
    if name == "ergometer":
        motion = ergometer_piece(model, 6.0, (20.0, 34.0), seed=3).motion
    else:
        motion = (sculling if name == "sculler" else sweeping)(model, 6.0, (20.0, 34.0), seed=3)
    return truth_of(model, motion)


@pytest.mark.parametrize("name", ["sculler", "sweep", "sweep_starboard", "ergometer"])
def test_every_frame_at_every_instant_while_rowing(name, tmp_path):
    assert apart_m(rowed(name), tmp_path) <= ROUNDING_M


def test_an_estimate_of_a_real_filter(tmp_path):
    model = oarlock.load_model("sculler")
    _, recording = oarlock.simulate(model, sculling(model, 4.0, (24.0, 30.0), seed=5), seed=6)
    track = oarlock.smooth(oarlock.track(model, recording))
    # OpenSim's joints are hinges: turns off their axes have no coordinate there.
    hinges = {name: slow for name, slow in track.slow.items() if OFF_AXIS not in name}
    track = dataclasses.replace(track, slow=hinges)
    assert apart_m(track, tmp_path, every=3) <= ROUNDING_M


@pytest.mark.parametrize("seed", range(6))
def test_random_trees_with_shared_and_negated_joints(seed, tmp_path):
    model = load_tree(random_tree(seed), tmp_path)
    assert apart_m(truth_of(model, waves(model, seed)), tmp_path, every=10) <= ROUNDING_M


def two_places(tmp_path: Path) -> oarlock.Model:
    file = tmp_path / "two_places.toml"
    file.write_text(TWO_PLACES, encoding="utf-8")
    return oarlock.load_model(file)


def test_a_ball_in_two_places_negated_slides_fixed_joints_and_names_in_other_scripts(tmp_path):
    model = two_places(tmp_path)
    assert apart_m(truth_of(model, waves(model, 2)), tmp_path) <= ROUNDING_M
    reader = OpensimReader(tmp_path)
    assert "knie_e_XYZ_x_rechts" in reader.labels
    assert "away_tx" in reader.labels
    assert not any(name.startswith("stiff") for name in reader.labels)
    assert reader.model.getConstraintSet().getSize() == 4


def test_links_are_drawn_from_joint_to_joint(tmp_path):
    model = oarlock.load_model("sculler")
    track = truth_of(model, waves(model, 2))
    written = oarlock.export(track, tmp_path, ("mot", "osim"))
    reader = OpensimReader(tmp_path)
    osim, ground = opensim(), reader.model.getGround()
    frame = reader.model.getComponent("/bodyset/r_elbow/bone_1")
    drawn = osim.Cylinder.safeDownCast(reader.model.getComponent("/bodyset/r_elbow/bone_1/line"))
    half = drawn.get_half_height()
    for row in reader.along(np.array([10])):
        ends = [
            frame.findStationLocationInAnotherFrame(reader.state, osim.Vec3(0, y, 0), ground).to_numpy()
            for y in (-half, half)
        ]
        for found, name in zip(ends, ("r_shoulder", "r_elbow"), strict=True):
            assert name in written.body_names
            np.testing.assert_allclose(found, track.frame_positions(name)[row], atol=ROUNDING_M)


def test_couplers_hold_what_follows(tmp_path):
    """OpenSim's own assembly moves the second use when the first is moved."""
    model = two_places(tmp_path)
    oarlock.export(truth_of(model, waves(model, 2)), tmp_path, ("osim", "mot"))
    reader = OpensimReader(tmp_path)
    reader.coordinates["rail"].setValue(reader.state, 0.37, True)
    followed = reader.coordinates["rail_down_the_rail"].getValue(reader.state)
    assert followed == pytest.approx(0.37, abs=1e-8)  # accuracy of OpenSim's assembly


def test_the_model_stands_at_rest_by_default(tmp_path):
    model = two_places(tmp_path)
    written = oarlock.export(truth_of(model, waves(model, 2)), tmp_path, ("osim", "mot"), axes="root")
    reader = OpensimReader(tmp_path)
    reader.model.realizePosition(reader.state)
    rest = np.concatenate([np.atleast_1d(joint.rest) for joint in model.describe().joints])
    poses = model.forward_kinematics(rest)
    for k, frame in enumerate(model.frame_names):
        body = reader.model.getBodySet().get(written.body_names[frame])
        place = body.getPositionInGround(reader.state).to_numpy()
        assert np.linalg.norm(place - poses[k, :3, 3]) <= 1e-8  # accuracy of OpenSim's assembly


def test_the_free_body_of_the_page_on_model_files(tmp_path):
    file = tmp_path / "body.toml"
    file.write_text(free_body(), encoding="utf-8")
    model = oarlock.load_model(file)
    assert apart_m(truth_of(model, waves(model, 4)), tmp_path) <= ROUNDING_M


def tumbling(model: oarlock.Model, spin_rad_s: tuple[float, float, float]) -> oarlock.Track:
    """The one body goes round by several turns; a shift keeps it where places tell something."""
    time_s = np.linspace(0.0, 4.0, 401)
    speeds = dict(zip(("rx", "ry", "rz"), spin_rad_s, strict=True))
    speed = np.array([speeds.get(name.rpartition(".")[2], 0.5) for name in model.coordinate_names])
    return truth_of(
        model, oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, time_s[:, None] * speed)
    )


@pytest.mark.parametrize("spin_rad_s", [(0.0, 4.0, 0.0), (0.3, 4.0, 0.2), (2.0, 3.0, -2.0)])
def test_tumbling_by_poles_keeps_orientations_right_and_angles_continuous(spin_rad_s, tmp_path):
    model = oarlock.load_model("broad")
    track = tumbling(model, spin_rad_s)
    written = oarlock.export(track, tmp_path, ("mot", "osim"), axes="root")
    reader = OpensimReader(tmp_path)
    body = reader.model.getBodySet().get(written.body_names["imu"])
    ours = Rotation.from_quat(track.frame_quat_wxyz("imu"), scalar_first=True).as_matrix()
    for row in reader.along(np.arange(len(track.time_s))):
        found = body.getTransformInGround(reader.state).R().asMat33()
        turned = np.array([[found.get(i, k) for k in range(3)] for i in range(3)])
        np.testing.assert_allclose(turned, ours[row], atol=1e-12)
    near = track["imu"].near_singular("XYZ")
    clear = ~(near[1:] | near[:-1])
    steps = np.abs(np.diff(reader.si()[:, :3], axis=0)).max(axis=1)
    assert steps[clear].max() < 1.0, "an angle jumps far from a pole"
    assert any("pole of the angles XYZ" in note for note in written.notes) == near.any()


def test_angles_count_turns_through_a_pole(tmp_path):
    track = tumbling(oarlock.load_model("broad"), (0.0, 4.0, 0.0))
    oarlock.export(track, tmp_path, ("mot", "osim"))
    reader = OpensimReader(tmp_path)
    angle = reader.si()[:, reader.labels.index("imu_XYZ_y")]
    # rounding of the rotation grows towards the pole like its square root
    np.testing.assert_allclose(np.diff(angle), 4.0 * np.diff(track.time_s), atol=1e-6)
    assert np.ptp(angle) > 2 * np.pi


@pytest.mark.parametrize("name", ["sculler", "qmt_full_body", "broad"])
def test_speeds_make_opensims_bodies_turn_as_ours_do(name, tmp_path):
    """OpenSim differentiates its own kinematics: the child's rate in the parent, in the child's axes, is ours."""
    model = oarlock.load_model(name)
    track = truth_of(model, waves(model, 7))
    written = oarlock.export(track, tmp_path, ("mot", "sto", "osim"), axes="root")
    reader, speeds = OpensimReader(tmp_path), OpensimReader(tmp_path, "velocities.sto")
    assert reader.labels == speeds.labels
    last = reader.model.getBodySet().get(written.body_names[model.frame_names[-1]])
    step_s = 1e-5
    motion = waves(model, 7)
    for row in reader.along(np.arange(0, len(track.time_s), 25)):
        for column, label in enumerate(speeds.labels):
            reader.coordinates[label].setSpeedValue(reader.state, float(speeds.si()[row, column]))
        reader.model.realizeVelocity(reader.state)
        found = last.getLinearVelocityInGround(reader.state).to_numpy()
        around = motion.at(track.time_s[row] + np.array([-step_s, step_s]))
        order = [motion.coordinate_names.index(c) for c in model.coordinate_names]
        places = model.forward_kinematics(around[:, order])[:, -1, :3, 3]
        expected = (places[1] - places[0]) / (2 * step_s)
        # central differences: step^2 / 6 of the third derivative, and rounding over the step
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_gravity_and_axes(tmp_path):
    """Y up by default: z-up models are turned about x, y-up ones not at all."""
    for name, rotated in (("broad", True), ("sculler", False)):
        model = oarlock.load_model(name)
        track = truth_of(model, waves(model, 1))
        written = oarlock.export(track, tmp_path / name)
        reader = OpensimReader(tmp_path / name)
        g = model.describe().world.gravity_m_s2
        np.testing.assert_allclose(reader.model.getGravity().to_numpy(), [0, -g, 0], atol=1e-14)
        rows = np.arange(0, len(track.time_s), 20)
        for frame, places in reader.places(dict(written.body_names), rows).items():
            ours = track.frame_positions(frame)[rows]
            turned = ours[:, [0, 2, 1]] * [1, 1, -1] if rotated else ours
            np.testing.assert_allclose(places, turned, atol=ROUNDING_M)


@pytest.mark.parametrize("seed", range(3))
def test_any_up_becomes_y(seed, tmp_path):
    model = load_tree(random_tree(seed), tmp_path)
    oarlock.export(truth_of(model, waves(model, seed)), tmp_path)
    g = model.describe().world.gravity_m_s2
    np.testing.assert_allclose(OpensimReader(tmp_path).model.getGravity().to_numpy(), [0, -g, 0], atol=1e-12)


def test_radians_say_so_and_mean_the_same(tmp_path):
    model = oarlock.load_model("arm7")
    track = truth_of(model, waves(model, 3))
    assert apart_m(track, tmp_path / "rad", every=10, degrees=False) <= ROUNDING_M
    assert apart_m(track, tmp_path / "deg", every=10, degrees=True) <= ROUNDING_M
    in_rad, in_deg = OpensimReader(tmp_path / "rad"), OpensimReader(tmp_path / "deg")
    assert (in_rad.in_degrees, in_deg.in_degrees) == (False, True)
    np.testing.assert_allclose(np.degrees(in_rad.values), in_deg.values, rtol=1e-14)


def test_storage_reads_the_motion_too(tmp_path):
    """The older of OpenSim's two readers."""
    model = oarlock.load_model("sculler_ball")
    track = truth_of(model, waves(model, 3))
    oarlock.export(track, tmp_path, ("mot", "sto"))
    storage = opensim().Storage(str(tmp_path / "coordinates.mot"))
    assert storage.getSize() == len(track.time_s)
    assert storage.isInDegrees()
    assert storage.getColumnLabels().getSize() == 1 + len(labels_of(tmp_path))
    row = storage.getStateVector(17)
    assert row.getTime() == track.time_s[17]
    assert row.getData().get(0) == track.q[17, 0], "the seat, m"


def labels_of(folder: Path) -> tuple[str, ...]:
    return tuple(opensim().TimeSeriesTable(str(folder / "coordinates.mot")).getColumnLabels())


def test_joints_without_a_number(tmp_path):
    """As tracks of older versions have them: a gap is nan for what it moves and for nothing else."""
    model = oarlock.load_model("sculler")
    truth, _ = oarlock.simulate(model, sculling(model, 3.0, 24.0, seed=2), seed=2)
    q = truth.q.copy()
    q[:, truth.coordinate_names.index("l_oar_alpha")] = np.nan
    q[40:60, truth.coordinate_names.index("r_oar_phi")] = np.nan
    track = track_without_filter(model, truth.time_s, q, provenance={})
    written = oarlock.export(track, tmp_path)
    assert any(note.startswith("l_oar_alpha: no stream measured it") for note in written.notes)
    assert any(note.startswith("r_oar_phi: no reading in 20 of") for note in written.notes)
    reader = OpensimReader(tmp_path)
    assert np.isnan(reader.values).sum() == 20
    assert (reader.values[:, reader.labels.index("l_oar_alpha")] == 0.0).all()
    rows = np.arange(30, 70)
    for frame, places in reader.places(dict(written.body_names), rows).items():
        ours = track.frame_positions(frame)[rows]
        gap = np.isnan(places).all(axis=1)
        assert not (np.isnan(ours).any(axis=1) & ~gap).any()
        assert gap.sum() == (20 if frame in ("r_oar_swung", "r_oar_raised", "r_handle") else 0)
        np.testing.assert_allclose(places[~gap], ours[~gap], atol=ROUNDING_M)
    oarlock.export(track, tmp_path, ("mot", "osim"), missing="drop")
    assert len(OpensimReader(tmp_path).time_s) == len(track.time_s) - 20


def test_lost_encoders_leave_no_gap(tmp_path):
    """One is absent and one silent for a while: the hands on the handles tell their joints."""
    model = oarlock.load_model("sculler")
    _, recording = oarlock.simulate(model, sculling(model, 3.0, 24.0, seed=2), seed=2)
    silent = recording.sensor("r_oar_phi")
    kept = np.r_[0:40, 60 : len(silent.time_s)]
    others = recording.without(["l_oar_alpha", "r_oar_phi"]).streams
    part = oarlock.recording.ScalarStream(silent.name, silent.time_s[kept], silent.value[kept])
    oarlock.export(oarlock.track(model, oarlock.Recording([*others, part])), tmp_path)
    assert np.isfinite(OpensimReader(tmp_path).values).all()


@pytest.mark.parametrize("name", ["sculler", "qmt_full_body"])
def test_inverse_kinematics_of_opensim_finds_the_markers(name, tmp_path):
    """Model and markers belong together: unit, axes and names."""
    osim = opensim()
    model = oarlock.load_model(name)
    track = truth_of(model, waves(model, 8, largest=0.4), rate_hz=20.0)
    written = oarlock.export(track, tmp_path, ("osim", "trc", "mot"))
    tool, body = osim.InverseKinematicsTool(), osim.Model(str(tmp_path / "model.osim"))
    tool.setModel(body)  # which does not keep it alive
    tool.setMarkerDataFileName(str(tmp_path / "frames.trc"))
    tool.setOutputMotionFileName(str(tmp_path / "solved.mot"))
    tool.setStartTime(float(track.time_s[0]))
    tool.setEndTime(float(track.time_s[10]))
    tool.set_report_errors(False)
    tool.set_accuracy(1e-10)
    assert tool.run()
    solved, told = OpensimReader(tmp_path, "solved.mot"), OpensimReader(tmp_path)
    rows = np.arange(len(solved.time_s))
    assert len(rows) == 11
    bodies = dict(written.body_names)
    expected = told.places(bodies, rows)
    for frame, places in solved.places(bodies, rows).items():
        np.testing.assert_allclose(places, expected[frame], atol=SOLVED_M)


def test_trc_as_opensim_reads_it(tmp_path):
    model = oarlock.load_model("qmt_full_body")
    track = truth_of(model, waves(model, 1))
    oarlock.export(track, tmp_path, ("trc",), axes="root")
    table = opensim().TimeSeriesTableVec3(str(tmp_path / "frames.trc"))
    assert table.getTableMetaDataString("Units") == "mm"
    assert tuple(table.getColumnLabels()) == tuple(model.frame_names)
    alone = table.flatten()  # its matrix does not keep it alive
    flat = alone.getMatrix().to_numpy().reshape(len(track.time_s), -1, 3)
    for k, frame in enumerate(model.frame_names):
        np.testing.assert_allclose(flat[:, k], 1000 * track.frame_positions(frame), atol=1e-9)
