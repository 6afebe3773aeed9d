"""The table of docs/sensor-faults.md: thirty kinds of faults in simulated recordings, and what is said of them.

Half of the runs are a sculler of the field simulator (`careful`), half a machine's arm with three units. A run is
certain but wrong if the error of a hinge is above three of its standard deviations in a fifth of the rows. Oars are
left out: their bands know no error of an encoder.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import DataError, DivergedError, Recording, Track
from oarlock.recording import ImuStream, ScalarStream
from oarlock.recording.streams import Stream
from oarlock.rowing import FieldEffects, simulate_field
from oarlock.storage.arrays import Bools, Floats
from oarlock.tracking.joint_series import HingeSeries

from .record import Record, made_text
from .sections import table

SEEDS = range(301, 306)
"""Not used while the tests were built; 21, 22 and 1 to 5 were."""
BODIES = ("sculler", "arm7")
DURATION_S = 30.0
SETTLED_S = 3.0
CERTAIN_STDS, CERTAIN_SHARE = 3.0, 0.2
GRAVITY_M_S2 = 9.80665
VECTORS = ("gyro_rad_s", "accel_m_s2", "mag_ut")

Rows = Callable[[Floats, Floats, np.random.Generator], Floats]
Spoil = Callable[[Recording, str, np.random.Generator], Recording]


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault.

    Args:
        name: for the table.
        spoil: puts it into the stream of a name.
        right: what a note that begins with the stream or a suspect of it must say, a regular expression.
        of: "unit", "encoder", or "all" streams.
    """

    name: str
    spoil: Spoil
    right: str
    of: str = "unit"


def _stream(change: Callable[[Stream, np.random.Generator], Stream]) -> Spoil:
    return lambda recording, name, random: Recording(
        [change(s, random) if name in (s.name, "") else s for s in recording]
    )


def _values(*fields: str, by: Rows) -> Spoil:
    def change(s: Stream, random: np.random.Generator) -> Stream:
        t = s.time_s - s.time_s[0]
        values = {k: by(v.copy(), t, random) if k in fields else v for k, v in s.values.items()}
        return type(s)(s.name, s.time_s, **values)  # type: ignore[arg-type]

    return _stream(change)


def _stamps(by: Callable[[Floats], Floats]) -> Spoil:
    return _stream(lambda s, _: s.at_rows(slice(None), time_s=s.time_s[0] + by(s.time_s - s.time_s[0])))


def _rows(keep: Callable[[Floats, np.random.Generator], Bools]) -> Spoil:
    return _stream(lambda s, random: s.at_rows(np.flatnonzero(keep(s.time_s - s.time_s[0], random))))


def _rotated(matrix: Floats, from_s: float = 0.0) -> Spoil:
    return _values(*VECTORS, by=lambda v, t, _: np.where(t[:, None] >= from_s, v @ matrix.T, v))


def _exchanged(recording: Recording, name: str, random: np.random.Generator) -> Recording:
    others = [s.name for s in recording if isinstance(s, ImuStream) and s.name != name]
    two = {name: (other := str(random.choice(others))), other: name}
    return Recording([type(s)(two.get(s.name, s.name), s.time_s, **s.values) for s in recording])  # type: ignore[arg-type]


def _frozen(from_s: float, to_s: float) -> Rows:
    def by(v: Floats, t: Floats, _: np.random.Generator) -> Floats:
        rows = np.flatnonzero((t >= from_s) & (t < to_s))
        v[rows] = v[rows[0]]
        return v

    return by


def _lost(v: Floats, t: Floats, _: np.random.Generator) -> Floats:
    v[(t >= 10.0) & (t < 16.0)] = np.nan
    return v


def _jumping(v: Floats, _: Floats, random: np.random.Generator) -> Floats:
    rows = random.random(len(v)) < 0.02
    v[rows] += random.normal(0.0, 40.0, (int(rows.sum()), 3))
    return v


def _axis(angle_deg: float) -> Floats:
    return np.asarray(Rotation.from_rotvec(np.radians(angle_deg) * np.array([0.6, -0.64, 0.48])).as_matrix())


BIAS = np.array([0.6, -0.6, 0.53])
GYRO, ACCEL, MAG = ("gyro_rad_s",), ("accel_m_s2",), ("mag_ut",)
CLOCK = r"clock of|clock was set"
KINDS = (
    FaultKind(
        "nothing is read for 5 s", _rows(lambda t, _: (t < 14.0) | (t >= 19.0)), "missing|no reading", "all"
    ),
    FaultKind(
        "all clocks set by ten years", _stamps(lambda t: t + 3.15e8 * (t >= 15.0)), "clock was set", "all"
    ),
    FaultKind("one clock set by an hour", _stamps(lambda t: t + 3601.0 * (t >= 15.0)), CLOCK),
    FaultKind("0.2 s late", _stamps(lambda t: t + 0.2), CLOCK),
    FaultKind("2 s late", _stamps(lambda t: t + 2.0), CLOCK),
    FaultKind("clock 1 % fast", _stamps(lambda t: 1.01 * t), CLOCK),
    FaultKind(
        "30 % of the packets lost", _rows(lambda t, random: random.random(len(t)) > 0.3), "packets missing"
    ),
    FaultKind("silent for 8 s", _rows(lambda t, _: (t < 12.0) | (t >= 20.0)), "missing"),
    FaultKind("ends after 15 s", _rows(lambda t, _: t < 15.0), "readings end"),
    FaultKind("begins after 10 s", _rows(lambda t, _: t >= 10.0), "first reading is missing"),
    FaultKind("no numbers for 6 s", _values(*VECTORS, by=_lost), "missing"),
    FaultKind("stuck for 8 s", _values(*VECTORS, by=_frozen(12.0, 20.0)), "stuck"),
    FaultKind("gyroscope reads zero", _values(*GYRO, by=lambda v, t, _: 0.0 * v), "zero"),
    FaultKind(
        "gyroscope clipped at 40 %",
        _values(*GYRO, by=lambda v, t, _: np.clip(v, *(0.4 * np.nanmax(np.abs(v)) * np.array([-1.0, 1.0])))),
        "clipped",
    ),
    FaultKind(
        "vibration of 25 m/s2 at 37 Hz",
        _values(
            *ACCEL, by=lambda v, t, _: v + 25.0 * np.sin(2.0 * np.pi * 37.0 * t[:, None] + np.arange(3.0))
        ),
        "vibrated",
    ),
    FaultKind("2 % of the readings jump", _values(*GYRO, *ACCEL, by=_jumping), "jumps"),
    FaultKind("gyroscope in deg/s", _values(*GYRO, by=lambda v, t, _: np.degrees(v)), "deg/s"),
    FaultKind("gyroscope converted twice", _values(*GYRO, by=lambda v, t, _: np.radians(v)), "twice"),
    FaultKind(
        "accelerometer in g", _values(*ACCEL, by=lambda v, t, _: v / GRAVITY_M_S2), r"looks like g\b|in g\b"
    ),
    FaultKind("gravity reversed", _values(*ACCEL, by=lambda v, t, _: -v), "sign of gravity"),
    FaultKind(
        "an axis of the gyroscope reversed",
        _values(*GYRO, by=lambda v, t, _: v * [-1.0, 1.0, 1.0]),
        "x reversed",
    ),
    FaultKind(
        "mounted 35 deg off",
        _rotated(_axis(35.0)),
        r"Suspect.*(against its mount|mounted)|its joints contradict",
    ),
    FaultKind("upside down", _rotated(np.diag([1.0, -1.0, -1.0])), r"Suspect.*(turned|upside down)"),
    FaultKind("exchanged with another", _exchanged, "Suspect.*exchanged"),
    FaultKind(
        "slips by 30 deg",
        _rotated(_axis(30.0), 12.0),
        r"Suspect.*(against its mount|mounted)|its joints contradict",
    ),
    FaultKind(
        "gyroscope biased by 8 deg/s", _values(*GYRO, by=lambda v, t, _: v + np.radians(8.0) * BIAS), "biased"
    ),
    FaultKind(
        "its bias steps by 6 deg/s",
        _values(*GYRO, by=lambda v, t, _: v + np.radians(6.0) * BIAS * (t[:, None] > 15.0)),
        "bias",
    ),
    FaultKind("gyroscope 15 % too much", _values(*GYRO, by=lambda v, t, _: 1.15 * v), r"reads 1\.\d+ times"),
    FaultKind("accelerometer biased by 2 m/s2", _values(*ACCEL, by=lambda v, t, _: v + 2.0 * BIAS), "biased"),
    FaultKind(
        "a magnet for 8 s",
        _values(
            *MAG, by=lambda v, t, _: v + np.array([40.0, -30.0, 20.0]) * ((t > 10.0) & (t < 18.0))[:, None]
        ),
        "magnet|field",
    ),
)


@cache
def body(name: str, seed: int) -> tuple[oarlock.Model, Recording, Track, oarlock.Calibration | None]:
    """Model, recording, truth, and the calibration of a careful session."""
    model = oarlock.load_model(name)
    if name == "sculler":
        trial = simulate_field(model, FieldEffects(), duration_s=DURATION_S, rate_spm=26.0, seed=seed)
        return model, trial.recording, trial.truth, trial.calibration
    random, time_s = np.random.default_rng(seed), np.arange(0.0, DURATION_S, 0.01)
    limits = {joint.name: joint.limits for joint in model.describe().joints}
    q = []
    for joint in model.joint_names:
        frequency_hz, phase_rad = random.uniform(0.1, 0.8, 4), random.uniform(0.0, 2.0 * np.pi, 4)
        waves = np.sin(2.0 * np.pi * frequency_hz * time_s[:, None] + phase_rad).sum(axis=1) / np.sqrt(2.0)
        low, high = limits[joint]
        size = min(0.4 * (high - low), 0.5)
        middle = float(np.clip(0.0, low + size, high - size))
        q.append(np.minimum(time_s / 2.0, 1.0) * (middle + size * np.tanh(waves / 1.5)))
    truth, recording = oarlock.simulate(
        model, oarlock.simulation.Motion(tuple(model.joint_names), time_s, np.column_stack(q)), seed=seed
    )
    return model, recording, truth, None


def run(job: tuple[str, int, int]) -> dict[str, Any]:
    """One run: kind, body, what is said, how wrong it is."""
    name, seed, k = job
    kind, (model, recording, truth, calibration) = KINDS[k], body(name, seed)
    random = np.random.default_rng([seed, k])
    units = [s.name for s in recording if isinstance(s, ImuStream if kind.of != "encoder" else ScalarStream)]
    stream = "" if kind.of == "all" else str(random.choice(units))
    spoilt = kind.spoil(recording, stream, random)
    result: dict[str, Any] = {"kind": kind.name, "body": name, "seed": seed, "stream": stream}
    begin_s = time.monotonic()
    suspects = oarlock.evaluation.find_suspects(model, spoilt, calibration)
    result["search_s"] = time.monotonic() - begin_s
    result["sized"] = any(np.isfinite(s.error_rad) for s in suspects)
    try:
        track = oarlock.track(model, spoilt, calibration)
    except (DataError, DivergedError) as error:
        notes, certain = [f"{line}" for line in str(error).splitlines()], False
        result["diverged" if isinstance(error, DivergedError) else "refused"] = True
    else:
        notes, certain = [*track.notes], is_certain(track, truth)
    notes += [s.note for s in suspects]
    about = [n for n in notes if n.startswith(stream) or (n.startswith("Suspect") and stream in n)]
    named = [n for n in about if re.search(kind.right, n)]
    return result | {
        "named": bool(named),
        "certain": certain,
        "silent": certain and not about,
        "note": (named or [""])[0],
    }


def is_certain(track: Track, truth: Track) -> bool:
    """Whether a hinge that is said to be observed is off by three standard deviations in a fifth of the rows."""
    time_s = np.where(track.time_s > 1e8, track.time_s - 3.15e8, track.time_s)
    rows = (time_s > SETTLED_S) & (time_s < truth.time_s[-1])
    for name in track.joint_names:
        joint = track[name]
        true_series = truth[name]
        if not isinstance(joint, HingeSeries) or "oar" in name or not rows.any():
            continue
        assert isinstance(true_series, HingeSeries)
        true = np.interp(time_s[rows], truth.time_s, true_series.angle_rad)
        error = np.abs((joint.angle_rad[rows] - true + np.pi) % (2.0 * np.pi) - np.pi)
        bad = (error > CERTAIN_STDS * joint.std_rad[rows]) & joint.observed[rows]
        if bad.mean() > CERTAIN_SHARE:
            return True
    return False


def measured(seeds: Sequence[int] | None = None, jobs: int | None = None) -> dict[str, Any]:
    """All kinds on both bodies."""
    tasks = [(name, seed, k) for seed in seeds or SEEDS for name in BODIES for k in range(len(KINDS))]
    with ProcessPoolExecutor(jobs) as pool:
        runs = list(pool.map(run, tasks))
    for fault_run in runs:
        if not fault_run["named"]:
            print(f"not named: {fault_run}", flush=True)
    kinds = {kind.name: _pooled([r for r in runs if r["kind"] == kind.name]) for kind in KINDS}
    figures = {"kinds": kinds, "all": _pooled(runs)}
    print(figures["all"], flush=True)
    return figures


def _pooled(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    example = next((r["note"] for r in runs if r["note"]), "")
    counts = {
        key: sum(bool(r.get(key)) for r in runs)
        for key in ("named", "certain", "silent", "sized", "refused", "diverged")
    }
    search_s = float(np.max([r["search_s"] for r in runs]))
    return {"runs": len(runs), **counts, "search_s": search_s, "example": example}


def sections(record: Record) -> Mapping[str, Mapping[str, str]]:
    """The section of docs/sensor-faults.md."""
    rows = [[name, k["named"], k["certain"]] for name, k in record["kinds"].items()]
    every = record["all"]
    columns = ("fault", "named", "certain but wrong")
    made = f"{made_text(record)}; `make pages PAGES=faults` measures it anew."
    text = (
        f"Of {every['runs']} runs {every['named']} name the right kind and stream; {every['refused']} are refused, "
        f"{every['diverged']} diverge. {every['certain']} are certain but wrong: a hinge is off by more than three "
        f"standard deviations in a fifth of the rows, in {every['silent']} of these without a note on the stream. "
        f"The longest search took {every['search_s']:.1f} s."
    )
    return {"docs/sensor-faults.md": {"faults": f"{text}\n\n{table(columns, rows)}\n\n{made}"}}
