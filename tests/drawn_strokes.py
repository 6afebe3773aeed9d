"""Stroke tables of simulated rowers straight from the simulator's curves: no filter, no analysis in between."""

from functools import cache
from math import radians

import numpy as np

from oarlock.rowing.findings.rowed import Rowed
from oarlock.rowing.simulation.stroke_shape import StrokeShape, body_and_oars
from oarlock.rowing.simulation.timing import stroke_timing

STEP_S = 0.004
STD_RAD = 0.005
"""Of an encoder's zero, as `find_strokes` claims it."""


def ends(catch_deg, finish_deg):
    return radians(catch_deg), radians(finish_deg)


LATE_RIGHT = {"shape": StrokeShape(late_catch_s=(0.06, 0.0))}
LATE_LEFT = {"shape": StrokeShape(late_catch_s=(0.0, 0.06))}
LESS_LEAN_SHORT = {"shape": StrokeShape(lean_rad=ends(-21, 28), phi_rad=ends(-57.5, 42))}
LESS_LEAN_SLIDE = {"shape": StrokeShape(lean_rad=ends(-21, 28), seat_m=(0.65, 0.01), phi_rad=ends(-59, 42))}
EARLY_BACK = {"shape": StrokeShape(early_back=0.1)}
SHORT = {"shape": StrokeShape(phi_rad=ends(-57, 40), seat_m=(0.58, 0.01))}
TIRED = {"last_third": StrokeShape(phi_rad=ends(-57, 40), lean_rad=ends(-22, 26), seat_m=(0.61, 0.01))}
"""What is planted, as arguments of `row_piece`: one change each, with what the body must do for it."""


@cache
def drawn(rate_spm, seed, shape=None, last_third=None, duration_s=50.0):
    """The strokes of a piece; shape and last third are those of `row_piece`."""
    time_s = np.arange(0.0, duration_s, STEP_S)
    streams = np.random.default_rng(seed).spawn(3)
    timing = stroke_timing(time_s, rate_spm, None, 1.0, streams[0])
    joints = body_and_oars(shape or StrokeShape(), timing, 1.0, streams[1], last_third)
    rows = [_stroke(time_s, timing.phase, joints, k) for k in range(1, int(timing.phase[-1] - 0.6))]
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    stds = {name: np.full(len(rows), STD_RAD) for name in ("catch_angle_rad", "finish_angle_rad")}
    known = {name: stds.get(name, np.full(len(rows), np.nan)) for name in columns}
    return Rowed("sculling", columns, known, np.arange(1.0, len(rows) + 1.0), {}, "oars")


def _stroke(time_s, phase, joints, number):
    catches, finishes = (
        {side: _turn(time_s, phase, joints[f"{side}_oar_phi"], number + at, sign) for side in "rl"}
        for at, sign in ((0.0, -1.0), (0.5, 1.0))
    )
    following = np.mean(
        [_turn(time_s, phase, joints[f"{side}_oar_phi"], number + 1.0, -1.0)[0] for side in "rl"]
    )
    catch_s, finish_s = (np.mean([turn[0] for turn in turns.values()]) for turns in (catches, finishes))
    catch, finish = (np.mean([turn[1] for turn in turns.values()]) for turns in (catches, finishes))
    drive = slice(*np.searchsorted(time_s, [catch_s, finish_s]))
    lean = np.interp([catch_s, finish_s], time_s, joints["trunk"])
    swing = np.gradient(joints["trunk"][drive])
    cycle = slice(*np.searchsorted(time_s, [catch_s, following]))
    return {
        "rate_per_min": 60.0 / (following - catch_s),
        "rhythm": (finish_s - catch_s) / (following - catch_s),
        "catch_angle_rad": catch,
        "finish_angle_rad": finish,
        "arc_rad": finish - catch,
        "catch_time_difference_s": catches["r"][0] - catches["l"][0],
        "finish_time_difference_s": finishes["r"][0] - finishes["l"][0],
        "catch_angle_difference_rad": catches["r"][1] - catches["l"][1],
        "finish_angle_difference_rad": finishes["r"][1] - finishes["l"][1],
        "seat_travel_m": np.ptp(joints["seat"][cycle]),
        "catch_lean_rad": lean[0],
        "finish_lean_rad": lean[1],
        "lean_swing_rad": lean[1] - lean[0],
        "trunk_peak_position": np.argmax(swing) / len(swing),
    }


def _turn(time_s, phase, phi, at, sign):
    """Time and angle of a reversal: largest `sign` times the angle near a phase, by a parabola through three points."""
    near = slice(*np.searchsorted(phase, [at - 0.12, at + 0.12]))
    k = near.start + int(np.argmax(sign * phi[near]))
    before, top, after = phi[k - 1 : k + 2]
    bend = before - 2.0 * top + after
    return time_s[k] + STEP_S * 0.5 * (before - after) / bend, top
