"""On one ball joint that stands still no reading shows the heading apart from the field's, and no band may say so."""

import numpy as np

import oarlock
from exact_recording import TREE

BALL = """
format = 1
name = "arm7_ball"
extends = "arm7"
[remove]
joint = ["shoulder_abduction", "shoulder_rotation", "shoulder_flexion"]
[process]
ball = { kind = "jerk", density = 11.2, start_std = [0.2, 0.5, 5.0] }
[[joint]]
name = "shoulder"
kind = "ball"
label = "upper arm"
angles = "YXY"
limits = ["-150*pi/180", "150*pi/180"]
[[frame]]
name = "shoulder_abducted"
replace = true
parent = "shoulder"
dh = { a = 0, alpha = "pi/2", d = 0, theta = "-pi/2" }
joint = "shoulder"
[[frame]]
name = "shoulder_rotated"
replace = true
parent = "shoulder_abducted"
dh = { a = 0, alpha = "-pi/2", d = 0, theta = "-pi/2" }
[[frame]]
name = "elbow"
replace = true
parent = "shoulder_rotated"
dh = { a = "l_ua", alpha = 0, d = 0, theta = "-pi/2" }
"""
NORTH_RAD = np.pi / 6
SETTLED_S = 2


def test_movement_shows_no_heading(tmp_path):
    file = tmp_path / "arm7_ball.toml"
    file.write_text(BALL, encoding="utf-8")
    model = oarlock.load_model(file)
    time_s = np.arange(0.0, 10.0, 0.01)
    angles = np.zeros((len(time_s), len(model.coordinate_names)))
    moves = {"shoulder.rx": (0.3, 0.2, 1.8), "shoulder.ry": (0.1, 0.35, 1.3), "shoulder.rz": (0.6, 0.5, 2.5)}
    for phase, (name, (middle, size, rate_rad_s)) in enumerate(moves.items()):
        column = list(model.coordinate_names).index(name)
        angles[:, column] = middle + size * np.sin(rate_rad_s * time_s + phase)
    motion = oarlock.simulation.Motion(tuple(model.coordinate_names), time_s, angles)
    truth, measured = oarlock.simulate(model, motion, rate_hz=100.0, seed=0)
    track = oarlock.track(model, measured, config=TREE)

    azimuth = list(track.beliefs.state_names).index("azimuth")
    std_rad = np.sqrt(track.beliefs.covariance[:, azimuth, azimuth])
    error_rad = np.abs(track.beliefs.mean[-1, azimuth] - NORTH_RAD)
    print(np.degrees(std_rad), np.degrees(error_rad))
    # The first updates span the start's 40 deg and take some of it; from then on nothing is learnt.
    assert std_rad[-1] > 0.99 * std_rad[SETTLED_S]
    assert error_rad < 3.0 * std_rad[-1]
    (shoulder,) = (j for j in oarlock.evaluate(track, truth).joints if j.name == "shoulder")
    assert shoulder.nees < 3.0
