"""Minutes of rowing with starts, pauses, paddling, turns and changes of rate, with the true times of every reversal.

The movements are those of the simulator of strokes; only how the phase goes on, and how long the strokes are, is laid
out here. True reversals are zeros of the derivative of the splines through the movements, near where the phase says.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import brentq

import oarlock
from oarlock.rowing.simulation.stroke_shape import StrokeShape, body_and_oars
from oarlock.rowing.simulation.timing import StrokeTiming, warp
from oarlock.storage.arrays import Floats

KNOTS_HZ = 400.0
NEAR_S = 0.12
MIDDLE_RAD = np.radians(-9.5)


@dataclass(frozen=True)
class Part:
    """So many strokes at a rate; `arc` shortens them, `left` those of the left oar further; `pause_s` follows them."""

    strokes: int
    rate_per_min: float
    arc: float = 1.0
    left: float = 1.0
    pause_s: float = 0.0
    kind: str = "rowing"


@dataclass(frozen=True)
class Rowed:
    """Splines of the joints by name, and the true times (K,) of lows and highs of each oar and of the seat's lows."""

    splines: dict[str, BSpline]
    end_s: float
    lows: dict[str, Floats]
    highs: dict[str, Floats]
    parts: tuple[Part, ...]
    timing: StrokeTiming

    def recording(self, rate_hz: float, seed: int, noise_rad: float = np.radians(0.1)) -> oarlock.Recording:
        """Encoders of the oars and the seat."""
        rng = np.random.default_rng(seed)
        time_s = np.arange(rng.uniform(0.0, 1.0 / rate_hz), self.end_s, 1.0 / rate_hz)
        noise = {"seat": 0.001}
        return oarlock.Recording(
            [
                oarlock.recording.ScalarStream(
                    name,
                    time_s,
                    self.splines[name](time_s)
                    + noise.get(name, noise_rad) * rng.standard_normal(len(time_s)),
                )
                for name in ("r_oar_phi", "l_oar_phi", "seat")
            ]
        )


def ten_minutes() -> tuple[Part, ...]:
    """A session of 10 to 11 minutes with all that a session has."""
    start = [Part(1, 36.0, arc, kind="start") for arc in (0.55, 0.5, 0.7, 0.85)]
    return (
        Part(30, 20.0, pause_s=15.0),
        *start,
        Part(24, 34.0),
        Part(24, 30.0, pause_s=6.0),
        Part(30, 22.0),
        Part(8, 18.0, 0.5, kind="paddling"),
        Part(20, 26.0),
        Part(20, 36.0),
        Part(20, 20.0, pause_s=20.0),
        Part(6, 20.0, 0.8, left=0.02, pause_s=8.0, kind="turn"),
        Part(20, 28.0),
        Part(16, 32.0, pause_s=4.0),
        Part(16, 24.0),
    )


def rowed(parts: tuple[Part, ...], seed: int, variation: float = 1.0, lead_s: float = 3.0) -> Rowed:
    """The session; it begins and ends with hands away, at rest."""
    time_s, timing, arc, left = _laid_out(parts, seed, lead_s)
    streams = np.random.default_rng(seed).spawn(2)
    joints = body_and_oars(StrokeShape(), timing, variation, streams[0])
    for side in "rl":
        swing = joints[f"{side}_oar_phi"] - MIDDLE_RAD
        joints[f"{side}_oar_phi"] = MIDDLE_RAD + arc * (left if side == "l" else 1.0) * swing
    splines = {
        name: make_interp_spline(time_s, joints[name], k=5)
        for name in ("r_oar_phi", "l_oar_phi", "seat", "trunk")
    }
    lows = {name: _zeros(splines[name], timing, 0.0, 1.0) for name in ("r_oar_phi", "l_oar_phi")}
    lows["seat"] = _zeros(splines["seat"], timing, 0.0, -1.0)
    highs = {name: _zeros(splines[name], timing, 0.5, -1.0) for name in ("r_oar_phi", "l_oar_phi")}
    return Rowed(splines, float(time_s[-1]), lows, highs, parts, timing)


def _laid_out(
    parts: tuple[Part, ...], seed: int, lead_s: float
) -> tuple[Floats, StrokeTiming, Floats, Floats]:
    """Speed of the phase over time: zero in pauses, which begin and end in the middle of a recovery."""
    rng = np.random.default_rng(seed + 1000)
    step_s = 1.0 / KNOTS_HZ
    rates, arcs, lefts = (
        [np.zeros(int(lead_s / step_s))],
        [np.ones(int(lead_s / step_s))],
        [np.ones(int(lead_s / step_s))],
    )
    for part in parts:
        for stroke in range(part.strokes):
            rate = part.rate_per_min / 60.0 * (1.0 + 0.01 * rng.standard_normal())
            knots = round(KNOTS_HZ / rate)
            pause = round(KNOTS_HZ * part.pause_s) if stroke == part.strokes - 1 else 0
            rates.append(np.r_[np.full(knots, 1.0 / (knots * step_s)), np.zeros(pause)])
            arcs.append(np.full(knots + pause, part.arc))
            lefts.append(np.full(knots + pause, part.left))
    rates.append(np.zeros(int(3.0 / step_s)))
    arcs.append(np.full(len(rates[-1]), arcs[-1][-1]))
    lefts.append(np.full(len(rates[-1]), lefts[-1][-1]))
    rate, arc, left = (np.concatenate(x) for x in (rates, arcs, lefts))
    smooth = 0.12 * KNOTS_HZ
    rate, arc, left = (
        gaussian_filter1d(x, s, mode="nearest")
        for x, s in ((rate, smooth), (arc, 1.5 * smooth), (left, 1.5 * smooth))
    )
    stroke = 0.75 + np.concatenate([[0.0], np.cumsum(rate[:-1])]) * step_s
    spm = np.clip(60.0 * gaussian_filter1d(rate, KNOTS_HZ, mode="nearest"), 18.0, 36.0)
    ratio = 0.36 + 0.09 / 14.0 * (spm - 20.0)
    time_s = np.arange(len(rate)) * step_s
    return time_s, StrokeTiming(time_s, spm, ratio, stroke, warp(stroke, ratio)), arc, left


def _zeros(spline: BSpline, timing: StrokeTiming, share: float, sign: float) -> Floats:
    """Where the derivative passes zero upward (sign 1) or downward (-1), near each time at which the phase says so."""
    slope = spline.derivative()
    first, last = np.ceil(timing.phase[0] - share), np.floor(timing.phase[-1] - share)
    found = []
    for k in np.arange(first, last + 1):
        about = np.interp(k + share, timing.phase, timing.time_s)
        grid = np.arange(about - NEAR_S, about + NEAR_S, 0.002)
        rate = sign * slope(grid)
        turns = np.flatnonzero((rate[:-1] < 0.0) & (rate[1:] >= 0.0))
        if len(turns):
            i = turns[np.argmin(np.abs(grid[turns] - about))]
            found.append(brentq(slope, grid[i], grid[i + 1], xtol=1e-9))
    return np.array(found)
