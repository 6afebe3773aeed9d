"""BVH, glTF, C3D and OpenSense's orientations: read back by readers of others, against the model's own kinematics."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock.model.description import pose_of
from oarlock.model.shipped_files import model_names
from oarlock.rowing import sculling
from oarlock.tracking.track import track_without_filter
from random_tree import load_tree, random_tree
from refusals import assert_refused
from skeleton_readers import bvh_positions, glb_positions
from test_export_opensim import truth_of, waves

BVH_M = 1e-6
"""Angles of BVH have six decimals: 1e-8 rad each, over twenty links of some metres."""
GLB_M = 1e-5
"""glTF stores single precision, 6e-8 of each number, over as many links."""
C3D_M = 1e-6
"""C3D stores single precision, of places within 10 m."""


def joint_centres(track: oarlock.Track) -> dict[str, np.ndarray]:
    """Each frame's joint centre over time, (T, 3) m in root axes: where `before` or a slide brings it."""
    poses, description = track.model.forward_kinematics(np.nan_to_num(track.q)), track.model.describe()
    moving = {joint.name for joint in description.joints if joint.kind != "fixed"}
    return {
        frame.name: (poses[:, k] @ np.linalg.inv(pose_of(frame.after if frame.joint in moving else None)))[
            :, :3, 3
        ]
        for k, frame in enumerate(description.frames)
    }


def assert_same_places(
    found: dict[str, np.ndarray], wanted: dict[str, np.ndarray], tolerance_m: float
) -> None:
    """Every wanted place is a joint of the file, and every joint of the file is a wanted place."""
    gaps = np.array([[np.abs(f - w).max() for w in wanted.values()] for f in found.values()])
    assert gaps.min(axis=0).max() < tolerance_m, list(wanted)[int(gaps.min(axis=0).argmax())]
    assert gaps.min(axis=1).max() < tolerance_m, list(found)[int(gaps.min(axis=1).argmax())]


def assert_animations_agree(track: oarlock.Track, folder: Path) -> None:
    oarlock.export(track, folder, ("bvh", "glb"), axes="root")
    wanted = joint_centres(track)
    step_s, found = bvh_positions(folder / "animation.bvh")
    assert step_s == pytest.approx(np.median(np.diff(track.time_s)), abs=1e-9)
    assert_same_places({n: p for n, p in found.items() if not n.endswith(".end")}, wanted, BVH_M)
    turn = Rotation.align_vectors([[0.0, 1.0, 0.0]], [track.model.describe().world.up])[0]
    nodes = glb_positions(folder / "animation.glb", track.time_s - track.time_s[0])
    assert_same_heights(nodes, {n: turn.apply(p) for n, p in wanted.items()})
    if np.allclose(track.model.describe().world.up, [0, 1, 0]):
        assert_same_places(nodes, wanted, GLB_M)


def assert_same_heights(nodes: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> None:
    """Y of glTF is up, whatever way the turn to it takes about the vertical."""
    assert_same_places({n: p[:, 1] for n, p in nodes.items()}, {n: p[:, 1] for n, p in wanted.items()}, GLB_M)


@pytest.mark.parametrize("name", model_names())
def test_joints_move_as_in_every_shipped_model(name, tmp_path):
    model = oarlock.load_model(name)
    assert_animations_agree(truth_of(model, waves(model, seed=1)), tmp_path)


@pytest.mark.parametrize("seed", range(4))
def test_joints_move_as_in_random_trees(seed, tmp_path):
    model = load_tree(random_tree(seed), tmp_path)
    assert_animations_agree(truth_of(model, waves(model, seed)), tmp_path)


def without_filter(track: oarlock.Track, time_s: np.ndarray, q: np.ndarray) -> oarlock.Track:
    return track_without_filter(track.model, time_s, q, provenance={})


@pytest.fixture(scope="module")
def sculler() -> oarlock.Track:
    model = oarlock.load_model("sculler")
    return truth_of(model, sculling(model, 2.0, 26.0, seed=1))


def test_joints_of_one_centre_are_one_node_with_the_words_that_they_share(sculler, tmp_path):
    oarlock.export(sculler, tmp_path, "bvh")
    lines = (tmp_path / "animation.bvh").read_text(encoding="utf-8").split("MOTION")[0]
    names = [line.split()[1] for line in lines.splitlines() if line.split()[:1] in (["JOINT"], ["ROOT"])]
    assert {"seat", "trunk", "r_shoulder", "r_elbow", "l_shoulder", "l_elbow"} <= set(names)
    assert not any("flexion" in name for name in names)
    assert len(names) == len(set(names))


def test_leaves_of_bvh_end_at_their_frames(sculler, tmp_path):
    oarlock.export(sculler, tmp_path, "bvh", axes="root")
    ends = [p for n, p in bvh_positions(tmp_path / "animation.bvh")[1].items() if n.endswith(".end")]
    for frame in ("r_hand", "l_hand"):
        assert min(np.abs(p - sculler.frame_positions(frame)).max() for p in ends) < BVH_M


def test_bvh_of_uneven_rows_is_interpolated_and_says_so(sculler, tmp_path):
    kept = np.flatnonzero(np.arange(len(sculler.time_s)) % 7 != 3)
    uneven = without_filter(sculler, sculler.time_s[kept], sculler.q[kept])
    note = " ".join(oarlock.export(uneven, tmp_path, "bvh", axes="root").notes)
    assert "even steps of" in note and f"{len(kept)} rows" in note
    step_s, found = bvh_positions(tmp_path / "animation.bvh")
    wanted = sculler.frame_positions("r_elbow")[: len(found["r_elbow"])]
    # Over two steps of 20 ms a limb that accelerates at 50 m/s2 departs by 50 * 0.02**2 / 2 from a straight line.
    assert np.abs(found["r_elbow"] - wanted).max() < 50.0 * step_s**2 / 2.0


def test_rows_without_a_reading_are_left_out_of_animations(sculler, tmp_path):
    q = sculler.q.copy()
    q[10:14, 0] = np.nan
    gappy = without_filter(sculler, sculler.time_s, q)
    notes = oarlock.export(gappy, tmp_path, "glb").notes
    assert any("4 of" in note and "left out of animations" in note for note in notes)


def test_c3d_holds_the_frames(sculler, tmp_path):
    pytest.importorskip("ezc3d")
    oarlock.export(sculler, tmp_path, ("c3d", "trc"))
    points, markers = (oarlock.markers.load_markers(tmp_path / f"frames.{kind}") for kind in ("c3d", "trc"))
    assert points.names == markers.names[1:]
    np.testing.assert_allclose(points.position_m, markers.position_m[:, 1:], atol=C3D_M, rtol=0.0)
    np.testing.assert_allclose(np.diff(points.time_s), np.diff(markers.time_s), rtol=1e-6)


def test_a_frame_without_a_place_is_no_point_of_c3d(sculler, tmp_path):
    pytest.importorskip("ezc3d")
    q = sculler.q.copy()
    q[10:14, 0] = np.nan
    oarlock.export(without_filter(sculler, sculler.time_s, q), tmp_path, "c3d")
    hidden = np.isnan(oarlock.markers.load_markers(tmp_path / "frames.c3d").position_m).any(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(hidden), range(10, 14))


def test_c3d_of_uneven_rows_is_refused(sculler, tmp_path):
    pytest.importorskip("ezc3d")
    kept = np.flatnonzero(np.arange(len(sculler.time_s)) % 7 != 3)
    uneven = without_filter(sculler, sculler.time_s[kept], sculler.q[kept])
    assert_refused(lambda: oarlock.export(uneven, tmp_path, "c3d"), "even steps", "--output-rate-hz")
    whole = oarlock.export(uneven, tmp_path / "all")
    assert "frames.c3d" not in whole.files and "frames.trc" in whole.files
    assert any(
        note.startswith("frames.c3d is not written: C3D files have even steps") for note in whole.notes
    )


def test_orientations_for_opensense_are_those_of_bodies_with_units(sculler, tmp_path):
    oarlock.export(sculler, tmp_path, "opensense", axes="root")
    lines = (tmp_path / "orientations.sto").read_text(encoding="utf-8").splitlines()
    start = lines.index("endheader") + 1
    labels, rows = lines[start].split("\t")[1:], [line.split("\t") for line in lines[start + 1 :]]
    description = sculler.model.describe()
    assert labels == [
        f"{f.name}_imu"
        for f in description.frames
        if f.name in {s.frame for s in description.sensors if s.kind == "imu"}
    ]
    poses = sculler.model.forward_kinematics(sculler.q)
    for k, label in enumerate(labels, start=1):
        quats = np.array([[float(x) for x in row[k].split(",")] for row in rows])
        found = Rotation.from_quat(quats[:, [1, 2, 3, 0]])
        wanted = Rotation.from_matrix(
            poses[:, sculler.model.frame_names.index(label.removesuffix("_imu")), :3, :3]
        )
        assert (found * wanted.inv()).magnitude().max() < 1e-7  # arccos of a number that is 1 to 1e-16


def test_opensim_reads_the_orientations(sculler, tmp_path):
    from opensim_reader import opensim

    osim = opensim()
    oarlock.export(sculler, tmp_path, "opensense")
    table = osim.TimeSeriesTableQuaternion(str(tmp_path / "orientations.sto"))
    assert table.getNumRows() == len(sculler.time_s)
    assert table.getColumnLabel(0).endswith("_imu")


@pytest.mark.long
def test_blender_shows_joints_where_the_track_has_them(tmp_path):
    if find_spec("bpy") is None:
        pytest.skip("NOT RUN: bpy is absent: pip install bpy==4.4.0")
    model = oarlock.load_model("sculler")
    track = truth_of(model, sculling(model, 2.0, 26.0, seed=1))
    oarlock.export(track, tmp_path, ("bvh", "glb"), axes="root")
    script = Path(__file__).with_name("blender_reader.py")
    done = subprocess.run(
        [sys.executable, script, tmp_path, str(len(track.time_s))], capture_output=True, text=True, check=True
    )
    assert "joints:" in done.stdout
    places = np.load(tmp_path / "places.npz")
    frames = {"r_shoulder": "r_shoulder", "r_elbow": "r_elbow", "l_hand": "l_wrist"}
    for kind in ("bvh", "glb"):
        for joint, frame in frames.items():
            gap = places[f"{kind}_{joint}"] - track.frame_positions(frame)
            assert np.abs(gap).max() < GLB_M, (kind, joint)  # Blender calculates in single precision
