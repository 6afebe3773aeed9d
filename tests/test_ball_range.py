"""The range of a ball joint: a cone and a twist, as prior where nothing measures it, in a note where something does."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from command_line import run
from oarlock.cli.terminal import WIDTH
from oarlock.evaluation.markers.start import body_prior
from oarlock.formats.export.angle_box import angle_box

DEG = np.pi / 180.0
REST = (0.1, -0.2, 0.05)
CONE = '{ axis = "y", swing = ["40*pi/180", "70*pi/180"], twist = ["-60*pi/180", "80*pi/180"] }'
STD_DEG = (20.0, 35.0, 35.0)
"""Half the swing about x and z, a quarter of the twist's range about y."""
BODY = """\
format = 1
name = "person"
structure = "tree"
joint = [
    {{ name = "trunk", kind = "ball" }},
    {{ name = "neck", kind = "ball", rest = [0.1, -0.2, 0.05], {limits} }},
    {{ name = "jaw", kind = "hinge", limits = ["-10*pi/180", "30*pi/180"] }},
]
frame = [
    {{ name = "thorax", parent = "root", joint = "trunk", transform.translation = [0.0, 0.1, 0.0] }},
    {{ name = "skull", parent = "thorax", joint = "neck", transform.translation = [0.0, 0.4, 0.0] }},
    {{ name = "vertex", parent = "skull", transform.translation = [0.0, 0.2, 0.0] }},
    {{ name = "chin", parent = "skull", joint = "jaw", axis = "z", transform.translation = [0.1, 0.0, 0.0] }},
]
[world]
up = "y"
forward = "x"
magnetic_norm_ut = 47.0
magnetic_dip_rad = 1.05
magnetic_azimuth_rad = 0.4
[process]
ball = {{ kind = "jerk", density = 40.0, start_std = [0.3, 0.5, 5.0] }}
[[sensor]]
name = "back"
kind = "imu"
frame = "thorax"
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.05
mag_std_ut = 0.8
[[sensor]]
name = "head"
kind = "imu"
frame = "vertex"
mount.rotation = {rotation}
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.05
mag_std_ut = 0.8
"""


def body(folder: Path, limits: str = f"limits = {CONE}", about_y_deg: float = 0.0) -> oarlock.Model:
    """The person; the head's unit is rotated about the long axis of the head."""
    rotation = Rotation.from_euler("y", about_y_deg, degrees=True).as_matrix().tolist()
    file = folder / f"person{about_y_deg:.0f}{len(limits)}.toml"
    file.write_text(BODY.format(limits=limits, rotation=rotation), encoding="utf-8")
    return oarlock.load_model(file)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("range")


def recorded(model: oarlock.Model) -> oarlock.Recording:
    """Trunk and head move by some 20 deg about their rest."""
    time_s = np.arange(0.0, 8.5, 0.02)
    phase = np.outer(time_s, [1.1, 0.7, 1.6]) + np.arange(3.0)
    wave = 0.35 * np.sin(phase)
    head = (Rotation.from_rotvec(REST) * Rotation.from_rotvec(wave)).as_quat(scalar_first=True)
    trunk = Rotation.from_rotvec(wave[:, ::-1]).as_quat(scalar_first=True)
    values = {"trunk": trunk, "neck": head, "jaw": 0.1 * np.sin(time_s)}
    return oarlock.simulate(
        model, oarlock.simulation.Motion.from_joints(time_s, values), seed=1, rate_hz=50.0
    )[1]


def range_notes(track: oarlock.Track) -> list[str]:
    return [note for note in track.notes if "beyond its range" in note]


def test_description_and_sheet(folder):
    model = body(folder)
    neck = {joint.name: joint for joint in model.describe().joints}["neck"]
    assert isinstance(neck.cone, oarlock.model.ConeDescription)
    assert neck.cone.axis == "y"
    np.testing.assert_allclose(neck.cone.swing, np.array([40, 70]) * DEG)
    np.testing.assert_allclose(neck.cone.twist, np.array([-60, 80]) * DEG)
    np.testing.assert_allclose(neck.limits, np.array([-80, 80]) * DEG)
    np.testing.assert_allclose(neck.cone.limits_about(), np.array([[-40, 40], [-60, 80], [-70, 70]]) * DEG)
    mean, std = body_prior(model)
    np.testing.assert_allclose(mean[3:6], REST)
    np.testing.assert_allclose(std[3:6], np.array(STD_DEG) * DEG)
    shown = run("model", "show", model.path).stdout
    assert "40 about x, 70 about z" in shown
    assert max(map(len, shown.splitlines())) <= WIDTH


def test_an_error_names_file_line_and_key(folder):
    with pytest.raises(
        oarlock.ModelError, match=r"person.*\.toml:6: joint `neck`: limits\.swing: 40\.0000 rad; expected"
    ):
        body(folder, 'limits = { axis = "y", swing = 40 }')


@pytest.mark.parametrize("kind", ["ukf", "ekf", "factorised"])
def test_an_unmeasured_ball_stays_at_its_prior(folder, kind):
    model = body(folder)
    track = oarlock.track(model, recorded(model).without(["head"]), config=oarlock.Config(filter=kind))
    late = track.time_s > 6.0
    columns = [track.coordinate_names.index(f"neck.r{axis}") for axis in "xyz"]
    np.testing.assert_allclose(track.q[late][:, columns], np.tile(REST, (late.sum(), 1)), atol=1e-3)
    assert not track["neck"].observed.any()
    assert track["trunk"].observed.all()
    # Within 6 s the springs have taken the start's distribution to within 2 % of the prior.
    np.testing.assert_allclose(
        track.q_std[late][:, columns], np.tile(STD_DEG, (late.sum(), 1)) * DEG, rtol=0.02
    )
    assert not range_notes(track)


def test_a_ball_in_its_range_has_no_note_and_the_prior_does_not_bend_it(folder):
    coned, plain = body(folder), body(folder, 'limits = ["-150*pi/180", "150*pi/180"]')
    recording = recorded(coned)
    tracks = [oarlock.track(model, recording) for model in (coned, plain)]
    assert not any(map(range_notes, tracks))
    apart = np.abs(tracks[0].q - tracks[1].q)[tracks[0].time_s > 1.0]
    # The start has another prior; its trace after a second is far below the 0.2 deg of the noise.
    assert np.nanmax(apart[:, :6]) < 0.02 * DEG


def test_a_note_asks_about_the_sensor_on_the_segment(folder):
    recording = recorded(body(folder, about_y_deg=130.0))
    (note,) = range_notes(oarlock.track(body(folder), recording))
    assert note.startswith("neck: beyond its range (swing up to 40 and 70 deg, twist -60 to 80 deg) in ")
    assert "is head mounted as in the model? Run `oarlock calibrate motion`" in note
    (note,) = range_notes(oarlock.track(body(folder, 'limits = ["-60*pi/180", "60*pi/180"]'), recording))
    assert note.startswith("neck: beyond its range (60 deg about each axis) in ")
    assert not range_notes(oarlock.track(body(folder, ""), recording))


def test_the_box_of_angles_contains_the_cone(folder):
    neck = {joint.name: joint for joint in body(folder).describe().joints}["neck"]
    box = angle_box(neck.cone, np.zeros(3))
    # Twist first, then a swing: about x alone it is the angle x, about y alone the angle y.
    assert box[0, 0] == pytest.approx(-box[0, 1])
    assert box[1, 0] <= -60 * DEG * (1 - 1e-9)
    assert box[1, 1] >= 80 * DEG * (1 - 1e-9)
    random = np.random.default_rng(1)
    share, around = np.sqrt(random.uniform(size=500)), random.uniform(0, 2 * np.pi, 500)
    radius = share / np.hypot(np.cos(around) / neck.cone.swing[0], np.sin(around) / neck.cone.swing[1])
    swing = np.column_stack([radius * np.cos(around), np.zeros(500), radius * np.sin(around)])
    twist = np.outer(random.uniform(*neck.cone.twist, 500), [0, 1, 0])
    inside = Rotation.from_rotvec(REST) * Rotation.from_rotvec(swing) * Rotation.from_rotvec(twist)
    angles = inside.as_euler("XYZ")
    box = angle_box(neck.cone, np.array(REST))
    # The box comes from a grid of 10 deg, whose corners may miss the extremes by 2 deg.
    assert (angles >= box[:, 0] - 2 * DEG).all()
    assert (angles <= box[:, 1] + 2 * DEG).all()


def test_opensim_gets_the_range(folder, tmp_path):
    model = body(folder)
    track = oarlock.track(model, recorded(model).slice(end_s=1.0))
    oarlock.export(track, tmp_path, ("osim",))
    written = ElementTree.parse(tmp_path / "model.osim")
    neck = {joint.name: joint for joint in model.describe().joints}["neck"]
    spans = {c.get("name"): c.findtext("range") for c in written.iter("Coordinate")}
    for row, axis in zip(angle_box(neck.cone, np.array(REST)), "xyz", strict=True):
        (span,) = [text for name, text in spans.items() if name and name.endswith(f"neck_XYZ_{axis}")]
        np.testing.assert_allclose([float(x) for x in (span or "").split()], row, atol=1e-12)
