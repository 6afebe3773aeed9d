"""Raw data and strokes of one recording of a synthetic season, drawn from its seed and its number."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.rowing import StrokeTable
from oarlock.season.synthetic.plan import Planned
from oarlock.season.synthetic.squad import BASES, REFERENCE_RATE, SyntheticAthlete

Floats = NDArray[np.float64]
UNITS: Final = ("seat", "trunk", "oar")
RAW_S: Final = 2.0
_RAW_HZ: Final = 50.0
_PIECES: Final = (18.0, 20.0, 22.0, 24.0, 28.0, 32.0)
"""Stroke rates of the pieces of a session, 1/min; a session has them in an order of its own."""
_REST_S: Final = 90.0
_CATCH_S: Final = 0.004
"""Standard deviation of a catch's measured moment, s."""
_SAME: Final = 0.4
"""Correlation of a stroke with the one before."""


def raw(seed: int, one: Planned) -> Recording:
    """Noise of three units."""
    rng = np.random.default_rng([seed, 3, one.index])
    time_s = np.arange(round(_RAW_HZ * RAW_S)) / _RAW_HZ
    streams = []
    for name in UNITS:
        gyro, accel = rng.normal(size=(2, len(time_s), 3)).astype(np.float32)
        streams.append(ImuStream(name, time_s, gyro.astype(float), accel.astype(float) + 9.8 / np.sqrt(3.0)))
    return Recording(streams, {"clock": {"kind": "utc", "zero": f"{one.start:%Y-%m-%dT%H:%M:%SZ}"}})


def health(seed: int, one: Planned) -> dict[str, float]:
    """Numbers about the sensors of a recording: mostly little is lost, sometimes much."""
    rng = np.random.default_rng([seed, 4, one.index])
    lost = rng.gamma(0.5, 0.004, len(UNITS)) + (rng.uniform(size=len(UNITS)) < 0.01) * 0.2
    return {
        f"{name}.missing_share": round(float(share), 5) for name, share in zip(UNITS, lost, strict=True)
    } | {"gyro_bias_rad_s": round(float(abs(rng.normal(0.0, 0.01))), 5)}


def strokes(seed: int, one: Planned, who: SyntheticAthlete, count: int = 300) -> StrokeTable:
    """The strokes of a session, without gaps in their numbers."""
    rate, catch_s = _outing(seed, one.outing, count)
    rng = np.random.default_rng([seed, 5, one.index])
    quality = float(np.exp(rng.normal(0.0, 0.3)))
    worse = quality * np.where(rng.uniform(size=count) < 0.05, 4.0, 1.0)
    columns: dict[str, Floats] = {}
    stds: dict[str, Floats] = {}
    for name, base in BASES.items():
        true = _true(rng, one, who, name, rate)
        sides = ("r_", "l_") if name in who.sides else ("",)
        std = base.measured * worse * np.sqrt(len(sides))
        for sign, side in zip((0.5, -0.5), sides, strict=False):
            columns[side + name] = (
                true + (sign * who.sides.get(name, 0.0) if side else 0.0) + rng.normal(size=count) * std
            )
            stds[side + name] = std
        if sides != ("",):
            columns[name] = (columns[f"r_{name}"] + columns[f"l_{name}"]) / 2.0
            stds[name] = std / np.sqrt(2.0)
    _derived(columns, stds, "arc_rad", "finish_angle_rad", "catch_angle_rad")
    _derived(columns, stds, "lean_swing_rad", "finish_lean_rad", "catch_lean_rad")
    _times(rng, one, who, (rate, catch_s), columns, stds)
    unknown = rng.uniform(size=count) < 0.01
    columns["catch_lean_rad"] = np.where(unknown, np.nan, columns["catch_lean_rad"])
    return StrokeTable(_short(columns), _short(stds), source="synthetic")


def _outing(seed: int, outing: int, count: int) -> tuple[Floats, Floats]:
    """Rate and moment of the catch of each stroke, which a crew has in common."""
    rng = np.random.default_rng([seed, 6, outing])
    piece = np.arange(count) * len(_PIECES) // count
    rate = rng.permutation(_PIECES)[piece] + rng.normal(0.0, 0.4, count)
    rest = np.where(np.diff(piece, prepend=0) > 0, _REST_S, 0.0)
    catch_s = 5.0 + np.cumsum(rest + np.concatenate(([0.0], 60.0 / rate[:-1])))
    return rate, catch_s


def _true(rng: np.random.Generator, one: Planned, who: SyntheticAthlete, name: str, rate: Floats) -> Floats:
    """What a perfect measurement would find; the scatter of strokes grows with the rate."""
    base, count = BASES[name], len(rate)
    level = who.means[name] + who.drift.get(name, 0.0) * one.months + rng.normal(0.0, base.sessions)
    level += who.rig_step.get(name, 0.0) if one.later else 0.0
    tired = who.fatigue.get(name, 0.0) * np.arange(count) / count
    own = lfilter([np.sqrt(1.0 - _SAME**2)], [1.0, -_SAME], rng.normal(size=count))
    scatter = base.strokes * (1.0 + 0.03 * (rate - REFERENCE_RATE))
    return np.asarray(level + base.per_rate * (rate - REFERENCE_RATE) + tired + scatter * own)


def _derived(columns: dict[str, Floats], stds: dict[str, Floats], name: str, plus: str, minus: str) -> None:
    columns[name] = columns[plus] - columns[minus]
    stds[name] = np.hypot(stds[plus], stds[minus])


def _times(
    rng: np.random.Generator,
    one: Planned,
    who: SyntheticAthlete,
    outing: tuple[Floats, Floats],
    columns: dict[str, Floats],
    stds: dict[str, Floats],
) -> None:
    rate, together_s = outing
    late_s = who.late_s + who.late_drift_s * one.months
    catch_s = together_s + late_s + rng.normal(0.0, 0.012, len(rate)) + rng.normal(0.0, _CATCH_S, len(rate))
    cycle_s = 60.0 / rate
    drive_s = cycle_s * (0.36 + 0.008 * (rate - REFERENCE_RATE) + rng.normal(0.0, 0.008, len(rate)))
    columns |= {
        "catch_time_s": catch_s,
        "finish_time_s": catch_s + drive_s,
        "end_time_s": catch_s + cycle_s,
        "rate_per_min": rate,
        "drive_time_s": drive_s,
        "recovery_time_s": cycle_s - drive_s,
        "rhythm": drive_s / cycle_s,
        "in_averages": np.ones(len(rate)),
    }
    stds |= dict.fromkeys(("catch_time_s", "finish_time_s"), np.full(len(rate), _CATCH_S))


def _short(columns: dict[str, Floats]) -> dict[str, Floats]:
    """Times to the microsecond, others to the digits of float32: what is beyond them is no measurement."""
    return {
        name: np.round(values, 6) if name.endswith("time_s") else values.astype(np.float32).astype(np.float64)
        for name, values in columns.items()
    }
