"""The scene holds what the track says, to the step of its numbers, and the page holds everything that it needs."""

import base64
import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import oarlock
from oarlock import DataError
from oarlock.model import Look, Shape
from oarlock.model.shapes import PARTS, box, ellipsoid, loft, tube
from oarlock.report.viewer import Curve, embed, joint_curves, page, player_assets, scene
from oarlock.report.viewer.marks import marks_and_spans
from oarlock.report.viewer.packing import packed, packed_times, unpacked
from oarlock.report.viewer.scene import shown_rows
from oarlock.rowing import find_strokes, rowing_look, stroke_marks
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.simulation import Motion
from oarlock.tracking.track import track_without_filter
from refusals import assert_refused

HALF_STEP = 0.5 / 65534
"""Of a column's span: what rounding to int16 costs."""
FLOAT = 1e-12
SCULLERS = ("sculler", "sculler_ball", "sculler_boat", "sculler_table2")
ROWERS = (*SCULLERS, "sweep", "sweep_starboard", "ergometer")
OTHERS = ("pendulum3", "arm7", "diodem_arm", "qmt_full_body", "broad")
LARGEST_BYTES = 1_200_000
"""Of a page of 40 s, script and data together."""


def moving(name: str, seed: int = 0, rows: int = 301) -> oarlock.Track:
    """A body that swings in every coordinate; nobody measured it."""
    model = oarlock.load_model(name)
    rng = np.random.default_rng(seed)
    time_s = np.arange(rows) * 0.01
    n = len(model.coordinate_names)
    phase, speed = rng.uniform(0, 6, n), rng.uniform(1, 5, n)
    q = 0.3 * np.sin(time_s[:, None] * speed + phase)
    return track_without_filter(model, time_s, q, provenance={})


@pytest.fixture(scope="module")
def pendulum() -> oarlock.Track:
    model = oarlock.load_model("pendulum3")
    time_s = np.linspace(0.0, 6.0, 601)
    swing = np.stack([0.5 * np.sin((2 + k) * time_s) for k in range(3)], axis=1)
    recording = oarlock.simulate(model, Motion(tuple(model.joint_names), time_s, swing), seed=1)[1]
    return oarlock.smooth(oarlock.track(model, recording))


def place_of(drawn, name: str) -> np.ndarray:
    """Places (T, 3) of a frame as the page holds them."""
    column = 0
    table = unpacked(drawn["places_m"])
    for point in drawn["points"]:
        here = point["still"]
        if name in point["frames"]:
            return np.tile(here, (len(table), 1)) if here else table[:, column : column + 3]
        column += 0 if here else 3
    raise KeyError(name)


def unpacked_times(packet):
    """Unpack the times (N,), s, of `packed_times`."""
    return np.frombuffer(base64.b64decode(packet["data"]), dtype="<f8")


@pytest.mark.parametrize("seed", [0, 7])
@pytest.mark.parametrize("name", [*ROWERS, *OTHERS])
def test_places_are_those_of_the_track(name, seed):
    track = moving(name, seed)
    drawn = scene(track, every_s=0.03)
    time_s = unpacked_times(drawn["time_s"])
    rows = np.searchsorted(track.time_s, time_s)
    assert np.array_equal(track.time_s[rows], time_s), "samples are chosen, never made"
    for frame in track.model.frame_names:
        truth = track.frame_positions(frame)[rows]
        step = HALF_STEP * np.ptp(truth, axis=0) + 1e-6  # points closer than 1 um are one
        assert np.all(np.abs(place_of(drawn, frame) - truth) <= step + FLOAT), frame


def test_samples_are_the_first_the_last_and_the_nearest_between():
    time_s = np.array([0.0, 0.004, 0.012, 0.021, 0.029, 0.038, 0.05, 0.5, 0.507])
    assert shown_rows(time_s, 0.02, None, None).tolist() == [0, 3, 5, 7, 8]
    assert shown_rows(time_s, 0.001, None, None).tolist() == list(range(9))
    assert shown_rows(time_s, 0.02, 0.01, 0.04).tolist() == [2, 4, 5]
    with pytest.raises(DataError, match=r"no sample from 1.0 to 2.0 s; the track covers 0.000 to 0.507 s"):
        shown_rows(time_s, 0.02, 1.0, 2.0)
    assert_refused(lambda: shown_rows(time_s, -1.0, None, None), "every_s is -1")


def test_numbers_keep_gaps_and_stillness():
    values = np.array([[1.0, np.nan, 5.0, np.nan], [2.0, np.nan, 5.0, 3.0], [4.0, np.nan, 5.0, 3.0]])
    read = unpacked(packed(values))
    np.testing.assert_allclose(read, values, rtol=0, atol=3.0 * HALF_STEP + FLOAT)
    assert read[:, 2].tolist() == [5.0, 5.0, 5.0]
    times = np.array([0.1, 1e6 + 1e-6])
    assert np.array_equal(unpacked_times(packed_times(times)), times)


def test_a_missing_reading_leaves_a_hole():
    track = moving("sculler")
    q = track.q.copy()
    column = track.coordinate_names.index("r_oar_phi")
    q[10:20, column] = np.nan
    drawn = scene(replace(track, q=q), every_s=0.01)
    assert np.isnan(place_of(drawn, "r_handle")[10:20]).all()
    assert np.isfinite(place_of(drawn, "l_handle")).all()
    assert np.isfinite(place_of(drawn, "r_hand")).all()


def test_ellipsoids_are_the_covariances_of_the_places(pendulum):
    drawn = scene(pendulum)
    spread = drawn["spread"]
    assert spread["source"] == "beliefs"
    few_s = unpacked_times(spread["time_s"])
    rows = np.searchsorted(pendulum.time_s, few_s)
    assert 0.08 < np.median(np.diff(few_s)) < 0.12
    factors = unpacked(spread["factors_m"]).reshape(len(rows), -1, 6)
    for k, point in enumerate(spread["points"]):
        frame = drawn["points"][point]["frames"][0]
        lower = np.zeros((len(rows), 3, 3))
        lower[:, *np.tril_indices(3)] = factors[:, k]
        covariance = pendulum.frame_position_spread(frame).covariance_m2[rows]
        close = (
            1e-3 * np.abs(covariance).max() + 1e-13
        )  # int16 steps, and the 1e-7 m that keep factors unique
        np.testing.assert_allclose(lower @ lower.transpose(0, 2, 1), covariance, rtol=0, atol=close)
    assert scene(moving("arm7"))["spread"] is None


def test_curves_have_values_and_deviations_in_the_shown_unit(pendulum):
    drawn = scene(pendulum)
    assert [panel["key"] for panel in drawn["panels"]] == list(pendulum.joint_names)
    rows = np.searchsorted(pendulum.time_s, unpacked_times(drawn["time_s"]))
    for panel in drawn["panels"]:
        series = pendulum[panel["key"]]
        value = np.rad2deg(series.value[rows])
        shown = unpacked(panel["series"][0]["value"])[:, 0]
        np.testing.assert_allclose(shown, value, rtol=0, atol=np.ptp(value) * HALF_STEP + FLOAT)
        std = unpacked(panel["series"][0]["std"])[:, 0]
        np.testing.assert_allclose(std, np.rad2deg(series.std[rows]), rtol=0, atol=1e-4)


def test_right_and_left_share_a_panel_and_the_look_says_which_come_first():
    track = moving("sculler")
    panels = {panel["key"]: panel for panel in scene(track, look=rowing_look(track))["panels"]}
    assert list(panels)[:4] == ["oar_phi", "seat", "trunk", "elbow_flexion"]
    assert [series["side"] for series in panels["elbow_flexion"]["series"]] == ["right", "left"]
    assert "bent" in panels["elbow_flexion"]["series"][0]["hint"]
    assert panels["seat"]["unit"] == "mm" and [p["open"] for p in panels.values()].count(True) == 4


def test_own_curves(pendulum):
    speed = Curve("speed", "speed", "m/s", np.arange(len(pendulum.time_s), dtype=float))
    assert [panel["key"] for panel in scene(pendulum, curves=[speed])["panels"]] == ["speed"]
    assert scene(pendulum, curves=[])["panels"] == []
    with pytest.raises(DataError, match=r'curve "speed": 3 values; the track has'):
        scene(pendulum, curves=[replace(speed, value=np.zeros(3))])
    assert_refused(lambda: scene(pendulum, curves=[speed, speed]), "two with this key")


def test_marks_become_spans():
    marks, spans = marks_and_spans([(2.0, "catch"), (1.0, "catch"), (1.5, "finish"), (3.5, "catch")])
    assert [mark["time_s"] for mark in marks] == [1.0, 1.5, 2.0, 3.5]
    assert [(s["start_s"], s["end_s"], s["label"]) for s in spans] == [
        (1.0, 2.0, "catch 1"),
        (2.0, 3.5, "catch 2"),
    ]
    assert marks_and_spans([(1.0, 2.0, "one"), (0.0, "catch"), (3.0, "catch")])[1] == [
        {"start_s": 1.0, "end_s": 2.0, "label": "one"}
    ]
    for odd in [(2.0, 1.0, "backwards"), (1.0,), "catch"]:
        assert_refused(partial(marks_and_spans, [odd]), "is neither")


def test_odd_requests_are_refused(pendulum):
    assert_refused(lambda: scene(replace(pendulum, model=None)), "without its model")
    solid = Shape("nowhere", *box([0, 0, 0], [1, 1, 1]), label="crate")
    with pytest.raises(DataError, match=r'"crate" is attached to frame "nowhere"'):
        scene(pendulum, look=Look(shapes=(solid,)))
    assert_refused(lambda: Shape("root", np.zeros((3, 3)), [[0, 1, 3]]), "triangles name vertices 0 to 2")
    assert_refused(lambda: Shape("root", np.zeros((3, 3)), [[0, 1, 2]], part="leg"), "no part 'leg'")
    for odd in ("", "1st", 'a"b', "a b"):
        assert_refused(partial(embed, scene(pendulum), odd), "is not a valid id")


# --- the page -----------------------------------------------------------------------------------------


def test_the_page_needs_nothing_from_outside(pendulum):
    text = page(scene(pendulum, title="</script><b>"), "<i>swing</i> & 'more'")
    assert "<title>&lt;i&gt;swing&lt;/i&gt; &amp;" in text
    assert not re.findall(r'(?:src|href)\s*=\s*"?(?:https?:)?//', text)
    data = re.search(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.S)[1]
    assert json.loads(data)["title"] == "</script><b>"
    assert "default-src 'none'" in text
    assert "Permission is hereby granted" in text, "the licences of what is inside travel with the page"


def test_pieces_of_a_page_share_one_player(pendulum):
    drawn = scene(pendulum)
    first, second = embed(drawn, "one"), embed(drawn, "two", with_player=False)
    assert first.startswith(player_assets()) and len(first) - len(second) == len(player_assets())
    assert 'id="two"' in second and "<style>" not in second


def test_a_page_of_forty_seconds_is_small():
    track = moving("sculler", rows=5001)
    track = replace(track, time_s=np.arange(5001) * 0.008, q_std=np.full(track.q.shape, 1e-3))
    text = page(scene(track, look=rowing_look(track)), "40 s")
    assert len(text.encode()) < LARGEST_BYTES


# --- shapes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "solid",
    [
        box([1, 2, 3], [1, 2, 3]),
        ellipsoid([0, 0, 1], [1, 2, 3]),
        tube([[0, 0, 0], [0, 0, 1], [0, 1, 2]], [0.1, 0.2, 0.1]),
        loft(np.array([[[1, 0, h], [0, 1, h], [-1, 0, h], [0, -1, h]] for h in (0.0, 1.0, 2.0)])),
    ],
)
def test_solids_are_closed_and_face_outwards(solid):
    vertices, triangles = solid
    edges = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1], strict=True)}
    assert len(edges) == 3 * len(triangles) and all((b, a) in edges for a, b in edges)
    corners = vertices[triangles] - vertices.mean(axis=0)
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume > 0


@pytest.mark.parametrize("name", ROWERS)
def test_every_rower_has_a_look(name):
    track = moving(name)
    look = rowing_look(track)
    drawn = scene(track, look=look)
    assert {shape["part"] for shape in drawn["shapes"]} <= set(PARTS)
    labels = {shape.label for shape in look.shapes}
    assert {"shape of the trunk", "head", "seat", "stretcher"} <= labels
    assert ("flywheel" if name == "ergometer" else "hull") in labels
    assert look.ground == ("ground" if name == "ergometer" else "water")
    assert [strand.label for strand in look.strands][2:] == ["chain"] * (name == "ergometer")
    for leg in look.strands[:2]:
        assert leg.places_m.shape == (len(track.time_s), 4, 3)


@pytest.mark.parametrize("name", OTHERS)
def test_other_bodies_have_none(name):
    assert rowing_look(moving(name)) is None


@pytest.fixture(scope="module")
def piece() -> oarlock.Track:
    return simulate_sculling(oarlock.load_model("sculler"), "B-B", 12.0, seed=4)[0]


def test_legs_keep_their_lengths_and_blades_meet_the_water(piece):
    look = rowing_look(piece)
    for leg in look.strands:
        hip, knee, ankle = (leg.places_m[:, k] for k in range(3))
        for one, other in ((hip, knee), (knee, ankle)):
            lengths = np.linalg.norm(one - other, axis=1)
            assert np.ptp(lengths) < 0.005, "rods, not rubber"
        assert np.all(knee[:, 1] > np.minimum(hip[:, 1], ankle[:, 1]))
        assert np.ptp(ankle, axis=0).max() < FLOAT
    assert -0.35 < look.ground_m < 0.0


def test_strokes_become_marks(piece):
    strokes = find_strokes(piece)
    drawn = scene(piece, marks=stroke_marks(strokes))
    ended = np.isfinite(strokes.end_time_s)
    assert len(drawn["spans"]) == ended.sum() > 2
    assert [span["start_s"] for span in drawn["spans"]] == pytest.approx(strokes.catch_time_s[ended])
    assert {mark["label"] for mark in drawn["marks"]} == {"catch", "finish"}


def test_a_joint_that_is_never_observed_has_no_curve():
    track = moving("pendulum3", rows=11)
    observed = np.ones(track.q.shape, dtype=bool)
    observed[:, 1] = observed[3:, 2] = False
    first, _, last = track.joint_names
    assert [curve.key for curve in joint_curves(replace(track, observed=observed))] == [first, last]


def test_a_point_is_named_as_the_joint_that_it_is():
    """A segment's origin is the joint that moves it: `right upper arm` would mark the shoulder."""
    points = scene(moving("arm"))["points"]
    labels = {frame: point["label"] for point in points for frame in point["frames"]}
    assert labels["upper_arm_r"] == "right shoulder" and labels["forearm_r"] == "right elbow"
    assert labels["hand_r"] == "right wrist"
    assert labels["thorax"] == labels["fingertip_r"] == "", "no joint with a name: the frame's name is shown"
