"""Measures the time of a step on chain models of growing size and compares it with eq. (19) of the paper."""

from __future__ import annotations

import math
import os
import statistics
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

import oarlock
from oarlock import Belief, Config, DivergedError, Model, Recording, load_model
from oarlock.evaluation.child_process import in_processes
from oarlock.rowing.simulation import paper
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.simulation import Motion
from oarlock.simulation.simulate import simulate
from oarlock.storage.arrays import Floats
from oarlock.storage.progress import Told
from oarlock_lab.reproduce.contents import Cell, Chart, PaperPart, Row, Table, rounded

RATE_HZ = 125.0
_HEAD = """
format = 1
name = "chain_{joints}_{units}"

[world]
up = [0, 0, 1]
forward = [1, 0, 0]
gravity_m_s2 = 9.80665
magnetic_norm_ut = 47.0
magnetic_dip_rad = 1.05
magnetic_azimuth_rad = 0.4
azimuth_fixed = true

[process]
hinge = {{ kind = "jerk", density = 11.2, start_std = [0.2, 0.5, 5.0] }}
"""
_LINK = """
[[joint]]
name = "j{k}"
kind = "hinge"
limits = [-2, 2]

[[frame]]
name = "f{k}"
parent = "{parent}"
dh = {{ a = 0.15, alpha = "{turn}", d = 0, theta = 0 }}
joint = "j{k}"
"""
_UNIT = """
[[sensor]]
name = "unit{k}"
kind = "imu"
frame = "f{frame}"
mount.offset = [0.02, 0.01, 0.0]
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.01
mag_std_ut = 1.0
"""


@dataclass(frozen=True)
class Size:
    """Number of hinges and inertial units of nine rows; a tree has arms of `arm` links, 0 is a single chain."""

    joints: int
    units: int
    arm: int = 0

    @property
    def states(self) -> int:
        """N."""
        return 3 * self.joints

    @property
    def readings(self) -> int:
        """M."""
        return 9 * self.units


def model_text(size: Size) -> str:
    """A chain or tree of hinges with alternating axes and evenly distributed units, the last one at the end."""
    parts = [_HEAD.format(joints=size.joints, units=size.units)]
    for k in range(size.joints):
        starts = k == 0 or (size.arm > 0 and k % size.arm == 0)
        turn = ("pi/2", "-pi/2", "pi/3")[k % 3]
        parts.append(_LINK.format(k=k, parent="root" if starts else f"f{k - 1}", turn=turn))
    for k in range(size.units):
        frame = ((k + 1) * size.joints) // size.units - 1 if size.units <= size.joints else k % size.joints
        parts.append(_UNIT.format(k=k, frame=max(frame, 0)))
    return "".join(parts)


def built(size: Size, samples: int, seed: int = 0) -> tuple[Model, Recording, list[float]]:
    """A model, a recording of a slow swing of all its joints, and the start posture."""
    model = Model.from_toml(model_text(size), f"chain_{size.joints}_{size.units}.toml", {})
    random = np.random.default_rng([seed, size.joints, size.units])
    time_s = np.linspace(0.0, samples / RATE_HZ + 0.1, max(8, int(25 * samples / RATE_HZ) + 8))
    phase = random.uniform(0.0, 2.0 * np.pi, size.joints)
    q = 0.3 * np.sin(2.0 * np.pi * 0.7 * time_s[:, None] + phase) + random.uniform(-0.3, 0.3, size.joints)
    motion = Motion(tuple(model.joint_names), time_s, q)
    truth, recording = simulate(model, motion, rate_hz=RATE_HZ, seed=seed)
    return model, recording, [float(v) for v in truth.q[0]]


FILTERS = ("ukf", "ekf", "factorised")
SHORT, LONG = 40, 840
"""Numbers of samples of two recordings; the difference of their processor times is that of the steps between."""
STARTING = 40
"""Number of samples before them, to which the start is fitted once: with 34 hinges as long as 15,000 steps."""
ROUNDS = 5
"""Their median scatters by 1 %, a fitted power by 0.01; both are printed to two or three digits."""
UNITS_FIXED, JOINTS_FIXED = 5, 15
JOINTS = (4, 6, 9, 13, 18, 25, 34)
UNITS = (2, 3, 5, 8, 12, 17)
BOTH = ((4, 2), (7, 3), (12, 5), (20, 8), (30, 12))
_TUNING: dict[str, Any] = {"structure": "tree", "estimate": (), "gate": False, "magnetometer": "on"}


@dataclass(frozen=True)
class CostCase:
    """One size with its recordings, and the state from which every filter continues."""

    sweep: str
    size: Size
    model: Model
    short: Recording
    long: Recording
    start: Belief | None


def cost(processes: int | None, progress: Told | None) -> PaperPart:
    """Measures every size with every filter, in turn, and fits powers.

    Several processes fit the starts; one measures, when they have ended.
    """
    tasks = sorted(_sizes(), key=lambda task: -task[1].joints)
    made = dict(in_processes(_job, None, tasks, processes or os.cpu_count() or 1))
    jobs = [made[task] for task in _sizes()]
    times = _measured(jobs, progress)
    rows = [_row(job, times) for job in jobs]
    sculler = _sculler_rate()
    return PaperPart(
        key="cost",
        title="Equation (19): the time of a step",
        lead=(
            "The paper counts O(m^3 + n m^2 + m n^2 + n^3 + n f + n s) for n states, m readings, f frames and s "
            f"units, and measures {paper.STEPS_PER_S:.0f} steps/s at n = {paper.STATES}, m = {paper.MEASUREMENTS}. "
            "Here chains and trees of hinges are generated as model files and tracked; a time is the median over "
            f"{ROUNDS} rounds, each with all sizes and filters in turn, of the difference in processor "
            f"time between a recording of {LONG} and one of {SHORT} samples.",
            f"The sculler with 72 states and 58 readings takes {1e6 / sculler:,.0f} us/step as a tree, {sculler:,.0f} "
            f"steps/s on one core: {sculler / paper.STEPS_PER_S:,.0f} times the paper's 116.",
        ),
        tables=(_exponents(rows), _times(rows)),
        charts=tuple(_chart(rows, sweep) for sweep in ("joints", "units", "both")),
        notes=(
            paper.SLIPS["states"],
            paper.SLIPS["measurements"],
            "A fitted power is valid for this range of sizes, not a limit: in small models constant parts dominate. "
            "The measured powers are below those of (19): where it has n^3, most columns are linear and need no sigma "
            "points, and where it has m^3, the filter factors in the smaller of two spaces.",
        ),
        data={"cost": rows},
    )


def _sizes() -> list[tuple[str, Size]]:
    sizes = [("joints", Size(joints, UNITS_FIXED)) for joints in JOINTS]
    sizes += [("units", Size(JOINTS_FIXED, units)) for units in UNITS]
    sizes += [("both", Size(joints, units)) for joints, units in BOTH]
    return sizes + [("tree", Size(joints, units, arm=4)) for joints, units in BOTH[1:]]


def _job(_: None, task: tuple[str, Size]) -> CostCase:
    sweep, size = task
    model, whole, posture = built(size, STARTING + LONG)
    starting_s, short_s = (whole.start_s + (count - 0.5) / RATE_HZ for count in (STARTING, STARTING + SHORT))
    config = Config(initial_q=posture, **_TUNING)
    start = oarlock.track(model, whole.slice(end_s=starting_s), config=config).last_belief
    long = whole.slice(starting_s)
    return CostCase(sweep, size, model, long.slice(end_s=short_s), long, start)


def _measured(jobs: list[CostCase], progress: Told | None) -> dict[tuple[str, Size, str], float]:
    """Median time of a step, s; NaN where the filter loses the chain."""
    times_s: dict[tuple[str, Size, str], list[float]] = {}
    for turn in range(ROUNDS):
        for k, job in enumerate(jobs):
            for name in FILTERS:
                times_s.setdefault((job.sweep, job.size, name), []).append(_step_s(job, name))
            if progress is not None:
                progress((turn * len(jobs) + k + 1) / (ROUNDS * len(jobs)))
    return {key: statistics.median(times) for key, times in times_s.items()}


def _step_s(job: CostCase, name: Any) -> float:
    config = Config(filter=name, **_TUNING)
    spans = []
    try:
        for recording in (job.short, job.long):
            began = time.process_time()
            oarlock.track(job.model, recording, config=config, start=job.start)
            spans.append(time.process_time() - began)
    except DivergedError:
        return math.nan
    return (spans[1] - spans[0]) / (LONG - SHORT)


def formula(states: int, readings: int, frames: int, units: int) -> int:
    """The sum inside eq. (19)."""
    n, m = states, readings
    return m**3 + n * m**2 + m * n**2 + n**3 + n * frames + n * units


def _row(job: CostCase, times: dict[tuple[str, Size, str], float]) -> Row:
    size = job.size
    return {
        "sweep": job.sweep,
        "joints": size.joints,
        "units": size.units,
        "n": size.states,
        "m": size.readings,
        "frames": size.joints + 1,
        "formula_19": formula(size.states, size.readings, size.joints + 1, size.units),
        **{f"{name}_us": 1e6 * times[job.sweep, size, name] for name in FILTERS},
    }


def power(x: Floats, y: Floats) -> float:
    """Slope of log y over log x for positive points; NaN for fewer than three."""
    good = np.isfinite(y) & (y > 0.0)
    if good.sum() < 3:
        return math.nan
    return float(np.polyfit(np.log(x[good]), np.log(y[good]), 1)[0])


_SWEEPS = {
    "joints": ("n", f"joints, {UNITS_FIXED} units"),
    "units": ("m", f"units, {JOINTS_FIXED} joints"),
    "both": ("n", "joints and units together, a chain"),
    "tree": ("n", "the same, trees with arms of four links"),
}


def _columns(rows: list[Row], sweep: str, *names: str) -> list[Floats]:
    own = [row for row in rows if row["sweep"] == sweep]
    return [np.array([row[name] for row in own], dtype=np.float64) for name in names]


def _exponents(rows: list[Row]) -> Table:
    table_rows = []
    for sweep, (axis, label) in _SWEEPS.items():
        x, expected = _columns(rows, sweep, axis, "formula_19")
        cells = [Cell(rounded(power(x, _columns(rows, sweep, f"{name}_us")[0]), 2)) for name in FILTERS]
        grown = Cell(f"{axis} {x[0]:g} to {x[-1]:g}")
        table_rows.append((Cell(label), grown, Cell(rounded(power(x, expected), 2)), *cells))
    return Table(
        "cost-powers",
        "Power of n (or m) with which the time grows in the measured range: in (19), and for each filter.",
        ("what grows", "range", "(19)", *FILTERS),
        tuple(table_rows),
    )


def _times(rows: list[Row]) -> Table:
    reference = next(row for row in rows if row["sweep"] == "both" and row["joints"] == 12)
    table_rows = []
    for row in rows:
        relative = row["formula_19"] / reference["formula_19"]
        cells = [
            Cell(
                f"{rounded(row[f'{name}_us'])} us",
                spread=f"x {rounded(row[f'{name}_us'] / reference[f'{name}_us'], 2)}",
            )
            for name in FILTERS
        ]
        sizes = [Cell(str(row[key])) for key in ("joints", "units", "n", "m")]
        table_rows.append((Cell(row["sweep"]), *sizes, Cell(f"x {rounded(relative, 2)}"), *cells))
    return Table(
        "cost-times",
        "Median time of a step, and its ratio to that of 12 joints with 5 units (n = 36, m = 45); "
        "(19) as the same ratio.",
        ("sweep", "joints", "units", "n", "m", "(19)", *FILTERS),
        tuple(table_rows),
        closed=True,
    )


def _chart(rows: list[Row], sweep: str) -> Chart:
    axis, label = _SWEEPS[sweep]
    x, expected = _columns(rows, sweep, axis, "formula_19")
    series = {name: (x, _columns(rows, sweep, f"{name}_us")[0]) for name in FILTERS}
    # (19) has no constant: it is drawn through the middle of the first filter's times
    middle = len(x) // 2
    series["(19)"] = (x, expected * series[FILTERS[0]][1][middle] / expected[middle])
    return Chart(f"cost-{sweep}", label, "states n" if axis == "n" else "readings m", "us per step", series)


def _sculler_rate() -> float:
    """Steps per second of processor time as a tree: the median of three differences between long and short."""
    model = load_model("sculler")
    _, recording = simulate_sculling(model, "B-B", 12.0, seed=0)
    short = recording.slice(end_s=2.0)
    steps = round((recording.end_s - short.end_s) * RATE_HZ)
    tree = Config(structure="tree")
    spans = []
    for _ in range(3):
        each = []
        for part in (short, recording):
            began = time.process_time()
            oarlock.track(model, part, config=tree)
            each.append(time.process_time() - began)
        spans.append(each[1] - each[0])
    return steps / statistics.median(spans)
