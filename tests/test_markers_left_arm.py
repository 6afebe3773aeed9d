"""The marker pipeline on a real left arm: closed form, least squares, virtual units on the movement, tracked."""

from pathlib import Path

import numpy as np
import pytest

import oarlock
from exact_recording import ARM
from real_left_arm import real_left_arm

MODEL = Path(__file__).parents[1] / "examples/markers/arm.toml"
ARCCOS_DEG = 0.02  # their elbow from positions rounded to single precision; near 0 deg arccos magnifies that
SOFT_TISSUE_DEG = 2.0  # the shoulder's cluster moves 5 mm against 0.36 m of upper arm
MISS_M = 0.02
BENT_RAD = np.radians(20.0)  # a straighter arm hardly tells the turn of the upper arm
SIMULATED_DEG = 0.4  # noise and biases, of the model's units alone

pytestmark = pytest.mark.data


def test_their_elbow_angle_follows_from_their_positions():
    """The file's positions stand one sample before its angles; with that, the law of cosines gives its angle."""
    arm = real_left_arm()
    elbow, wrist = arm.own_positions_m
    upper, fore = (float(np.linalg.norm(v, axis=1).mean()) for v in (elbow, wrist - elbow))
    model = oarlock.load_model("arm7", parameters={"l_ua": upper, "l_fa": fore})
    found = oarlock.markers.Arm(model, "shoulder", "wrist").solve(wrist, elbow)
    assert found.reachable.mean() > 0.99
    bend = np.degrees(np.abs(found.q[1:-1, 3]))
    np.testing.assert_allclose(bend, np.abs(arm.elbow_deg[2:]), atol=ARCCOS_DEG)


def test_real_trajectories_through_the_whole_pipeline():
    arm = real_left_arm()
    model = oarlock.load_model(MODEL, parameters=arm.lengths)
    closed = oarlock.markers.Arm(model, "shoulder", "wrist")
    # the forearm counts as untwisted in the first frame in which the elbow is bent
    plain = closed.solve(arm.wrist_m, arm.elbow_m)
    first = int(np.argmax(plain.q[:, 3] > BENT_RAD))
    straight = np.concatenate([plain.q[first], np.zeros(3)])
    wrist = model.forward_kinematics(straight)[model.frame_names.index("wrist"), :3, :3]
    untwisted = arm.forearm[first].T @ wrist
    found = closed.solve(arm.wrist_m, arm.elbow_m, tip_rotation=arm.forearm @ untwisted)
    # skin moves: now and then the wrist is a few millimetres further from the shoulder than the mean lengths allow
    print(
        f"\nout of reach in {1 - found.reachable.mean():.1%} of frames, by {1e3 * found.miss_m.max():.1f} mm at most"
    )
    assert found.reachable.mean() > 0.8
    assert found.miss_m.max() < MISS_M
    assert (found.stretched == ~found.reachable).all()
    bent = found.q[:, 3] > BENT_RAD
    markers = arm.markers
    attachments = arm.attachments(model, np.pad(found.q, ((0, 0), (0, 2))), bent)
    study = oarlock.markers.simulate_from_markers(
        model,
        markers,
        attachments,
        sensors=("upperarm", "forearm"),
        gyro_bias_rad_s=0.005,
        accel_bias_m_s2=0.05,
    )
    assert study.gaps == ()
    apart = np.degrees(found.q[:, :5] - study.fit.q[:, :5])[bent]
    print("lengths m", arm.lengths, "elbow centre misses mm", round(1e3 * arm.elbow_miss_m, 1))
    print("residuals mm", {name: round(1e3 * v, 1) for name, v in study.fit.rmse_m.items()})
    print("closed form against least squares, RMSE deg", np.sqrt(np.mean(apart**2, axis=0)).round(2))
    flexion = np.degrees(study.fit.q[:, 3])
    print("elbow deg", flexion.min().round(1), flexion.max().round(1))
    theirs = np.abs(arm.elbow_deg)
    print("their filter's elbow: RMSE deg", np.sqrt(np.mean((theirs - flexion)[50:] ** 2)).round(1),
          "r", np.corrcoef(theirs[50:], flexion[50:])[0, 1].round(3))  # fmt: skip
    assert np.sqrt(np.mean(apart[:, 3] ** 2)) < SOFT_TISSUE_DEG
    assert "not determined by these markers: hand_abduction, hand_flexion" in study.fit.notes
    track = oarlock.track(model, study.recording)
    scores = oarlock.evaluate(track, study.truth)
    print("tracked, RMSE deg", [round(float(np.degrees(scores[name].rmse)), 3) for name in ARM])
    assert scores.mean_rmse_deg(ARM) < SIMULATED_DEG
    points = oarlock.markers.evaluate_markers(track, markers, {"elbow": "elbow", "wrist": "wrist"})
    print(points, points.clock_offset_s)
    assert abs(points.clock_offset_s) < 1.0 / 100.0
    assert points.mean_rmse_3d_m < 0.02
