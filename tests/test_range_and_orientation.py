"""Distances between points and orientations of units that keep their raw signals: streams, tracking, live use, data."""

import numpy as np
import pytest

import oarlock
from local_data import local_folder
from oarlock import Config, DataError, Recording
from oarlock.evaluation.comparison.inverse_kinematics import Measured, solve
from oarlock.formats.datasets.openaxes import LINK_FROM_SENSOR, read_openaxes, read_openaxes_reference
from oarlock.model.rotation import quat_from_matrix, quat_inverse, quat_product, rotvec_from_quat
from oarlock.recording import OrientationStream, ScalarStream
from oarlock.rowing import sculling
from refusals import assert_refused

ENCODER = 'name = "seat"\nkind = "encoder"\njoint = "seat"\nstd = 0.001  # m\n'
SEAT_STD_M = 0.005
AS_ENCODER = ENCODER.replace("0.001", str(SEAT_STD_M))
# From the seat to a point of the footstretcher, which stands still in the boat.
AS_RANGE = f"""name = "seat"
kind = "range"
frame_a = "seat"
frame_b = "root"
point_b = [0, -0.25, 1.1]
std_m = {SEAT_STD_M}
"""
LEG = """
format = 1
name = "leg"
world = { up = "y", forward = "z" }
joint = [{ name = "hip", kind = "ball" }, { name = "knee", kind = "hinge" }]
frame = [
    { name = "thigh", parent = "root", joint = "hip", transform.translation = [0, 0.9, 0] },
    { name = "shank", parent = "thigh", joint = "knee", axis = "x", transform.translation = [0, -0.4, 0] },
]
[process]
hinge = { kind = "jerk", density = 8.0, start_std = [0.3, 0.5, 5.0] }
ball = { kind = "jerk", density = 8.0, start_std = [0.3, 0.5, 5.0] }
[[sensor]]
name = "thigh"
kind = "orientation"
frame = "thigh"
mount.rpy = [0.3, -0.8, 1.2]
std_rad = 0.02
[[sensor]]
name = "shank"
kind = "orientation"
frame = "shank"
mount.rpy = [0.1, 0.4, -2.0]
std_rad = 0.02
heading = "unknown"
[[sensor]]
name = "cord"
kind = "range"
frame_a = "shank"
point_a = [0, -0.4, 0]
frame_b = "root"
point_b = [0, 0.2, 1.0]
std_m = 0.004
"""


def leg():
    return oarlock.Model.from_toml(LEG, "leg.toml", {})


def moving(model, seconds=8.0):
    time_s = np.arange(0.0, seconds, 0.05)
    waves = [0.4 * np.sin(2.0 * time_s), 0.3 * np.sin(1.3 * time_s + 1.0), 0.3 * np.sin(0.7 * time_s)]
    q = np.column_stack([*waves, 0.8 + 0.5 * np.sin(2.5 * time_s)])
    return oarlock.simulation.Motion(model.coordinate_names, time_s, q)


def simulated(seed=0, heading_rad=2.5, **more):
    model = leg()
    truth, recording = oarlock.simulate(
        model, moving(model), seed=seed, rate_hz=50.0, heading_rad={"shank": heading_rad}, **more
    )
    return model, truth, recording


def quaternions(count=5):
    vectors = np.linspace(-2.0, 2.0, 3 * count).reshape(count, 3)
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.hstack([np.cos(angle / 2), vectors / angle * np.sin(angle / 2)])


@pytest.mark.parametrize("file_format", ["parquet", "csv"])
def test_a_folder_gives_back_every_bit(tmp_path, file_format):
    quats = quaternions()
    quats[2] = np.nan
    given = Recording([OrientationStream("pelvis", np.arange(5) / 60.0, quats)])
    given.save(tmp_path / "trial", file_format)
    found = oarlock.load_recording(tmp_path / "trial")["pelvis"]
    assert isinstance(found, OrientationStream)
    assert found.quat_wxyz.tobytes() == given["pelvis"].quat_wxyz.tobytes()
    assert found.time_s.tobytes() == given["pelvis"].time_s.tobytes()
    assert found.missing_share == 0.2


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        (2.0 * quaternions(), "has the norm 2 at 0 s"),
        (np.zeros((5, 4)), "has the norm 0 at 0 s"),
        (quaternions()[:, :3], "expected"),
        (np.where(np.arange(20).reshape(5, 4) == 6, np.inf, quaternions()), "infinite"),
    ],
)
def test_the_gate_refuses_what_is_no_rotation(spoilt, said):
    with pytest.raises(DataError, match=said):
        OrientationStream("pelvis", np.arange(5) / 60.0, spoilt)


def test_either_sign_is_the_same_orientation():
    model, _, recording = simulated()
    flipped = [
        s
        if isinstance(s, ScalarStream)
        else OrientationStream(
            s.name, s.time_s, s.quat_wxyz * np.where(np.arange(len(s)) % 2, 1.0, -1.0)[:, None]
        )
        for s in recording
    ]
    plain, other = oarlock.track(model, recording), oarlock.track(model, Recording(flipped))
    assert plain.q.tobytes() == other.q.tobytes()
    assert plain.q_std.tobytes() == other.q_std.tobytes()


@pytest.mark.parametrize("kind", ["ukf", "ekf", "factorised"])
def test_without_noise_the_filter_finds_what_was_simulated(kind):
    # The engine's prediction and the simulator's poses have no line in common.
    model, truth, recording = simulated(noise=False)
    track = oarlock.smooth(oarlock.track(model, recording, config=Config(filter=kind)))
    knee = track["knee"].value - truth["knee"].value
    # Errors that are not there are estimated; of the prior's 0.02 rad a few per cent are left.
    assert np.sqrt(np.mean(knee[50:] ** 2)) < 0.01
    heading = track.slow["shank.heading"]
    assert np.abs(heading.value[-1] - 2.5) < 0.02


def test_an_unknown_heading_is_found_as_well_as_said():
    # 12 seeds: a ratio beyond 3.5 standard deviations would come once in 180 sets.
    for seed, heading_rad in enumerate(np.linspace(-3.0, 3.0, 12)):
        model, _, recording = simulated(seed, heading_rad)
        heading = oarlock.track(model, recording).slow["shank.heading"]
        off = (heading.value[-1] - heading_rad + np.pi) % (2.0 * np.pi) - np.pi
        assert abs(off) < 3.5 * heading.std[-1]
        assert heading.std[-1] < 0.1


def test_live_is_batch():
    model, _, recording = simulated()
    track = oarlock.track(model, recording)
    tracker = oarlock.Tracker(model)
    last = None
    for k, time_s in enumerate(recording["cord"].time_s):
        readings = {name: {"quat_wxyz": recording[name].quat_wxyz[k]} for name in ("thigh", "shank")} | {
            "cord": recording["cord"].value[k]
        }
        last, _ = tracker.step(float(time_s), readings)
    assert last.mean[: len(track.coordinate_names)].tobytes() == track.q[-1].tobytes()


def test_live_refuses_what_is_no_rotation():
    tracker = oarlock.Tracker(leg())
    assert_refused(lambda: tracker.step(0.0, {"thigh": {"quat_wxyz": [2.0, 0.0, 0.0, 0.0]}}), "norm is 2")


def test_a_negative_distance_is_refused():
    model, _, recording = simulated()
    value = recording["cord"].value.copy()
    value[7] = -0.01
    streams = [ScalarStream("cord", s.time_s, value) if s.name == "cord" else s for s in recording]
    assert_refused(lambda: oarlock.track(model, Recording(streams)), "a distance is not negative")


def test_a_seat_seen_by_its_distance_from_the_footstretcher():
    text = oarlock.load_model("sculler").text
    assert ENCODER in text
    errors = []
    for sensor in (AS_ENCODER, AS_RANGE):
        model = oarlock.Model.from_toml(text.replace(ENCODER, sensor), "sculler.toml", {})
        truth, recording = oarlock.simulate(model, sculling(model, duration_s=8.0), seed=3, rate_hz=100.0)
        # Strapdown links need an encoder on a slide.
        track = oarlock.track(model, recording, config=oarlock.Config(structure="tree"))
        errors.append(np.sqrt(np.mean((track["seat"].value - truth["seat"].value)[100:] ** 2)))
    print(f"seat: encoder {1000 * errors[0]:.2f} mm, range {1000 * errors[1]:.2f} mm")
    assert errors[1] < 1.5 * errors[0]


def test_a_robot_from_orientations_alone():
    """As well as inverse kinematics on the same quaternions to which the true heading was told."""
    vqf = pytest.importorskip("vqf")
    folder = local_folder("data/openaxes_ur5")
    run = "circle-250"
    recording, reference = read_openaxes(folder, run), read_openaxes_reference(folder, run)
    quats = {}
    for unit in recording:
        filter_ = vqf.VQF(1.0 / unit.rate_hz)
        quats[unit.name] = filter_.updateBatch(unit.gyro_rad_s.copy(), unit.accel_m_s2.copy())["quat6D"]
    model = oarlock.Model.from_toml(ROBOT, "robot.toml", {})
    streams = [OrientationStream(name, reference.time_s, quat) for name, quat in quats.items()]
    track = oarlock.track(model, Recording(streams))
    ours = {link: track.frame_quat_wxyz(link, relative_to="root") for link in quats}
    sensor_from_link = quat_from_matrix(np.array(LINK_FROM_SENSOR).T[None])
    headed = {
        link: headed_as(reference, link, quat_product(q, sensor_from_link)) for link, q in quats.items()
    }
    q, _ = solve(model, Measured(headed), reference.time_s)
    poses = model.forward_kinematics(q)
    fitted = {link: quat_from_matrix(poses[:, model.frame_names.index(link), :3, :3]) for link in quats}
    medians = [median_deg(found, reference) for found in (ours, fitted, headed)]
    print("median deg: ours {:.2f}, inverse kinematics {:.2f}, each unit by itself {:.2f}".format(*medians))
    assert medians[0] < 1.1 * medians[1]
    assert medians[0] < 0.8 * medians[2]


MOUNT = [list(row) for row in LINK_FROM_SENSOR]
ROBOT = f"""
format = 1
name = "robot"
world = {{ up = "z", forward = "x" }}
joint = [{{ name = "radius", kind = "ball" }}, {{ name = "wrist", kind = "hinge" }}]
frame = [
    {{ name = "radius", parent = "root", joint = "radius", transform.translation = [0, 0, 0] }},
    {{ name = "carpus", parent = "radius", joint = "wrist", axis = "x", transform.translation = [0, 0, 0] }},
]
[[sensor]]
name = "radius"
kind = "orientation"
frame = "radius"
std_rad = 0.02
mount.rotation = {MOUNT}
[[sensor]]
name = "carpus"
kind = "orientation"
frame = "carpus"
std_rad = 0.02
mount.rotation = {MOUNT}
heading = "unknown"
"""


def headed_as(reference, link, quat):
    """Turned about the vertical so that the heading is the reference's at 1 s."""
    row = np.searchsorted(reference.time_s, 1.0)
    w, _, _, z = quat_product(reference.quat_wxyz[link][row], quat_inverse(quat[row]))
    angle = np.arctan2(z, w)
    return quat_product(np.array([np.cos(angle), 0.0, 0.0, np.sin(angle)]), quat)


def median_deg(found, reference):
    """Of the relative orientation's error after 5 s."""
    relative = [quat_product(quat_inverse(q["radius"]), q["carpus"]) for q in (found, reference.quat_wxyz)]
    off = rotvec_from_quat(quat_product(quat_inverse(relative[0]), relative[1]))
    return float(np.degrees(np.median(np.linalg.norm(off, axis=1)[reference.time_s > 5.0])))
