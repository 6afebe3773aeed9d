"""Technique of strokes as they are rowed equals that of the whole track."""

import numpy as np

import oarlock
from oarlock import rowing
from refusals import assert_refused


def test_each_stroke_has_the_numbers_of_the_whole_track_soon_after_the_next_catch(sculler):
    motion = rowing.sculling(sculler, 11.0, 28, surge=False, seed=3)
    model = sculler
    _, recording = oarlock.simulate(model, motion, seed=3, rate_hz=100)
    config = oarlock.Config(inputs=[], sample_rate_hz=100, output_rate_hz=100, stamp_std_s={})
    whole = rowing.technique(oarlock.track(model, recording, config=config))
    tracker, finder, strokes, told_s = (
        oarlock.Tracker(model, config=config),
        rowing.LiveTechnique(model),
        [],
        [],
    )
    for sample in tracker.samples(recording):
        belief, info = tracker.step(sample)
        stretch = None if belief is None else finder.step(info.time_s, belief)
        if stretch is not None:
            strokes.append(rowing.live_stroke(stretch, model))
            told_s.append(info.time_s)
    catches = np.array([stroke.time_s for stroke in strokes])
    assert len(strokes) >= 2
    rows = [int(np.argmin(np.abs(whole.found.catch_time_s - time_s))) for time_s in catches]
    assert (np.array(told_s) - whole.found.end_time_s[rows]).max() < 0.35
    for column in ("rate_per_min", "drive_time_s", "catch_lean_rad", "r_arm_plane_rad"):
        values, stds = np.array([stroke.values[column] for stroke in strokes]).T
        # Angles at the catch are read at a time that is found in a shorter stretch.
        np.testing.assert_allclose(
            values, whole.strokes[column][rows], rtol=5e-3
        )  # live, how units sit is decided later
        np.testing.assert_allclose(stds, whole.strokes.stds[column][rows], rtol=0.25)


def test_a_body_without_a_joint_that_tells_strokes_is_refused():
    assert_refused(lambda: rowing.LiveTechnique(oarlock.load_model("lower_body")), "lower_body", "seat")
