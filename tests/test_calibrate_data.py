"""Joints, hinge axes and fields of real recordings against what cameras and encoders say of them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from local_data import local_folder
from oarlock.formats.datasets.broad import read_broad, read_broad_reference
from oarlock.formats.datasets.dfjimu import read_dfjimu
from oarlock.formats.datasets.diodem import read_diodem, read_diodem_reference
from oarlock.formats.datasets.openaxes import LINK_FROM_SENSOR, openaxes_runs, read_openaxes

pytestmark = pytest.mark.data

# Four trials of one rig: every coordinate of three rich ones repeats itself to 1.5 mm.
REPEATS_M = 0.003
# What the files state differs by 10 mm from trial to trial; a point of a cluster of markers is no accelerometer.
STATED_M = 0.015
# The units' axes lie within a degree of the segments', and the hinges have play.
HINGE_RAD = np.radians(2.5)
LENGTH_M = 0.01
# One magnetometer in a room: its own constant error and the room's steel, 2 uT and 2 deg.
FIELD_UT, DIP_RAD = 2.5, np.radians(2.0)

WORLD = """
format = 1
name = "bodies"
[world]
up = "z"
forward = "x"
magnetic_norm_ut = "norm"
magnetic_dip_rad = "dip"
[parameters]
norm = 47.0
dip = 1.0
[process]
ball = { kind = "jerk", density = 100.0, start_std = [0.2, 2.0, 20.0] }
[[base_acceleration]]
name = "push"
axis = "z"
density = 50.0
start_std = 5.0
"""
BODY = """
[[joint]]
name = "{name}"
kind = "{kind}"
[[frame]]
name = "{name}"
parent = "{parent}"
joint = "{name}"
transform = {{ translation = {at} }}
{axis}
[[sensor]]
name = "{name}"
kind = "imu"
frame = "{name}"
mount = {{ rotation = {rotation} }}
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.1
mag_std_ut = 1.0
"""
SQUARE = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def chain(file, *links, rotation=SQUARE):
    """A model of bodies on one another: (name, kind or hinge axis) each, lengths as parameters."""
    text, parent = WORLD, "root"
    for name, kind in links:
        lengths = "".join(
            f"{name}_{a} = {{ default = {d}, unit = 'm' }}\n"
            for a, d in zip("xyz", (0.25, 0.0, 0.0), strict=True)
        )
        text = text.replace("[process]", f"{lengths}[process]")
        hinge = kind in ("x", "y", "z")
        text += BODY.format(
            name=name,
            kind="hinge" if hinge else kind,
            parent=parent,
            at=[f"{name}_{a}" for a in "xyz"] if parent != "root" else [0, 0, 0],
            axis=f'axis = "{kind}"' if hinge else "",
            rotation=[list(row) for row in rotation],
        )
        parent = name
    path = file / "bodies.toml"
    path.write_text(text, encoding="utf-8")
    return oarlock.load_model(path)


# --- a ball joint -------------------------------------------------------------------------------------


def test_trials_of_one_rig_agree_about_its_ball_joint():
    model, levers = oarlock.load_model("dfjimu"), {}
    for file in sorted(local_folder("data/dfjimu").glob("*.mat")):
        recording = read_dfjimu(file)
        found = oarlock.calibration.calibrate_joint_centers(model, recording)
        # The model file writes them as parameters, which can be states.
        assert found.mounts == {}
        levers[file.stem] = np.array([found.parameters[f"r{b}_{a}"] for b in (1, 2) for a in "xyz"])
        stated = -np.concatenate([recording.meta["joint_in_sensor_m"][b] for b in ("body1", "body2")])
        std = np.concatenate([found.noted["offset_std_m"][b] for b in ("body1", "body2")])
        print(file.stem, np.round(1e3 * levers[file.stem], 1), "stated", np.round(1e3 * stated, 1))
        assert np.abs(levers[file.stem] - stated).max() < STATED_M
        if "1D" in file.stem:
            # It was turned about one axis, near y of both units.
            assert std[[1, 4]].min() > 5.0 * std[[0, 2, 3, 5]].max()
    rich = np.array([lever for name, lever in levers.items() if "1D" not in name])
    assert np.ptp(rich, axis=0).max() < REPEATS_M


# --- a chain with hinges --------------------------------------------------------------------------------


def optical_axis(reference, parent, child):
    """Principal direction of the child's turning against the parent, in the child's axes, unit vector."""
    there = reference.there(parent) & reference.there(child)
    turns = [
        Rotation.from_quat(np.array(reference.quat_wxyz[b])[there][:, [1, 2, 3, 0]]) for b in (parent, child)
    ]
    between = turns[0].inv() * turns[1]
    steps = (between[:-1].inv() * between[1:]).as_rotvec()
    return np.linalg.eigh(steps.T @ steps)[1][:, -1]


def optical_centers(reference, parent, child):
    """(6,) the point of each body that moves least in the other, in their axes, m; along a hinge anywhere."""
    there = reference.there(parent) & reference.there(child)
    turns = [
        Rotation.from_quat(np.array(reference.quat_wxyz[b])[there][:, [1, 2, 3, 0]]).as_matrix()
        for b in (parent, child)
    ]
    rows = np.concatenate([turns[0], -turns[1]], axis=2).reshape(-1, 6)
    apart = (reference.position_m[child][there] - reference.position_m[parent][there]).reshape(-1)
    return np.linalg.lstsq(rows, apart, rcond=1e-3)[0]


@pytest.fixture(scope="module")
def diodem(tmp_path_factory):
    links = [("seg1", "ball"), ("seg2", "ball"), ("seg3", "x"), ("seg4", "y"), ("seg5", "z")]
    trial = local_folder("data/diodem_arm") / "trial1"
    return chain(tmp_path_factory.mktemp("diodem"), *links), trial, read_diodem_reference(trial)


def test_hinges_of_a_chain_lie_where_the_cameras_see_them(diodem):
    model, trial, reference = diodem
    found = oarlock.calibration.calibrate_hinge_axes(model, read_diodem(trial))
    # The cameras too see the first one turn off its axis, by 2 deg (standard deviation).
    play = {"seg3": 3.0 * HINGE_RAD, "seg4": HINGE_RAD, "seg5": HINGE_RAD}
    for parent, child in (("seg2", "seg3"), ("seg3", "seg4"), ("seg4", "seg5")):
        hinge = found.noted["joint"][child]
        axis = np.asarray(hinge["axis_in_child_sensor"])
        off = np.arccos(abs(axis @ optical_axis(reference, parent, child)))
        print(child, "off by", np.degrees(off), "deg, std", np.degrees(hinge["std_rad"]))
        assert off < play[child]
        assert not hinge["ends_contradict"]


@pytest.mark.parametrize(
    ("mounted", "window_s", "bound_m"), [("rigid", 0.2, LENGTH_M), ("foam", 0.4, 2.0 * LENGTH_M)]
)
def test_lengths_of_a_chain_are_those_that_the_cameras_see(diodem, mounted, window_s, bound_m):
    model, trial, reference = diodem
    found = oarlock.calibration.calibrate_joint_centers(model, read_diodem(trial, mounted), window_s=window_s)
    centers = {
        c: optical_centers(reference, p, c)
        for p, c in (("seg1", "seg2"), ("seg2", "seg3"), ("seg3", "seg4"), ("seg4", "seg5"))
    }
    # The hinge between seg2 and seg3 runs along both, so only both together have a length.
    two = centers["seg3"][:3] - centers["seg2"][3:] + centers["seg4"][:3] - centers["seg3"][3:]
    four = centers["seg5"][:3] - centers["seg4"][3:]
    lengths = {"seg2 and seg3": (two[0], found.parameters["seg3_x"] + found.parameters["seg4_x"])}
    lengths["seg4"] = (four[0], found.parameters["seg5_x"])
    for name, (optical, inertial) in lengths.items():
        print(mounted, name, f"cameras {1e3 * optical:.1f} mm, units {1e3 * inertial:.1f} mm")
        assert abs(inertial - optical) < bound_m


# --- a robot ------------------------------------------------------------------------------------------


def test_a_robots_wrist_is_one_hinge_and_its_slow_runs_tell_only_half_of_it(tmp_path):
    data = local_folder("data/openaxes_ur5")
    model = chain(tmp_path, ("radius", "ball"), ("carpus", "x"), rotation=LINK_FROM_SENSOR)
    for run in openaxes_runs(data):
        recording = read_openaxes(data, run)
        found = oarlock.calibration.calibrate_hinge_axes(model, recording)
        assert found.noted["kept_nominal"] == []
        hinge = found.noted["joint"]["carpus"]
        axis = np.array(LINK_FROM_SENSOR) @ hinge["axis_in_parent_sensor"]
        print(run, "axis in the radius", np.round(axis, 4), "std deg", np.degrees(hinge["std_rad"]))
        assert np.arccos(abs(axis[0])) < np.radians(1.5)
        # After its first seconds the carpus keeps upright and only pans: then no gyroscope tells how its hinge lies.
        later = oarlock.calibration.calibrate_hinge_axes(model, recording.slice(0.25 * recording.duration_s))
        assert later.noted["kept_nominal"] == ["carpus: axis of carpus"]
        assert later.noted["sensor"]["carpus"]["turned_rad"] < np.radians(1.0)
        center = oarlock.calibration.calibrate_joint_centers(model, recording)
        # At 0.3 rad/s a lever of 10 cm pulls with 10 mm/s2.
        assert len(center.noted["joint"]["carpus"]["loose"]) >= 3
        assert center.noted["kept_nominal"] != []


# --- a field ------------------------------------------------------------------------------------------


def test_norm_and_dip_are_those_that_the_cameras_turn_to_the_world(tmp_path):
    fields = {}
    for file in sorted(local_folder("data/broad").glob("*undisturbed*.mat")):
        recording, reference = read_broad(file), read_broad_reference(file)
        (name,), (body,) = recording.names, reference.quat_wxyz
        model = chain(tmp_path, (name, "ball"))
        found = oarlock.calibration.calibrate_field(model, recording)
        fields[file.stem] = (found.parameters["norm"], found.parameters["dip"])
        rows = reference.there(body)
        turns = Rotation.from_quat(np.array(reference.quat_wxyz[body])[rows][:, [1, 2, 3, 0]])
        field = np.nanmedian(turns.apply(np.array(recording[name].mag_ut)[rows]), axis=0)
        norm, dip = np.linalg.norm(field), np.arcsin(-field[2] / np.linalg.norm(field))
        print(file.stem, "units", np.round(fields[file.stem], 3), "cameras", round(norm, 3), round(dip, 3))
        assert abs(fields[file.stem][0] - norm) < FIELD_UT
        assert abs(fields[file.stem][1] - dip) < DIP_RAD
        assert found.noted["field"]["departing_share"] < 0.05
    assert len(fields) >= 3
    assert np.ptp(list(fields.values()), axis=0)[0] < 1.5
    assert np.ptp(list(fields.values()), axis=0)[1] < np.radians(1.0)
