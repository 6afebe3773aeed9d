"""A synthetic season: its squad, plan, strokes and results, drawn from a seed; `oarlock lab season` writes it."""

from __future__ import annotations

import datetime
import hashlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from math import pi
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.signal import lfilter

from oarlock import _core
from oarlock.evaluation.child_process import begin_child
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.rowing import StrokeTable
from oarlock.rowing.strokes.files import strokes_parquet
from oarlock.season.add import Admission, content_name
from oarlock.season.athletes import PSEUDONYM_LENGTH, PSEUDONYM_LETTERS, Athlete
from oarlock.season.object_storage import open_storage
from oarlock.season.records import SEASON_FILE, STROKES_FILE, RunRecord, Setup
from oarlock.season.store import Season, open_season
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

_DEG = pi / 180.0
REFERENCE_RATE = 20.0


@dataclass(frozen=True)
class Spread:
    """How a number of a stroke varies; all in its own unit.

    Args:
        mean: of all athletes at `REFERENCE_RATE`.
        athletes: standard deviation between athletes.
        per_rate: change with the stroke rate, per 1/min.
        sessions: standard deviation between sessions of one athlete.
        strokes: standard deviation between strokes of a session at `REFERENCE_RATE`.
        measured: standard deviation of the measurement, of a usual stroke and session.
    """

    mean: float
    athletes: float
    per_rate: float
    sessions: float
    strokes: float
    measured: float


BASES: Mapping[str, Spread] = MappingProxyType(
    {
        "catch_angle_rad": Spread(-62.0 * _DEG, 3.0 * _DEG, 0.25 * _DEG, 0.8 * _DEG, 1.2 * _DEG, 0.6 * _DEG),
        "finish_angle_rad": Spread(41.0 * _DEG, 2.0 * _DEG, -0.05 * _DEG, 0.6 * _DEG, 0.9 * _DEG, 0.6 * _DEG),
        "seat_travel_m": Spread(0.55, 0.03, -0.001, 0.006, 0.010, 0.004),
        "legs_share": Spread(0.45, 0.03, -0.001, 0.008, 0.02, 0.01),
        "catch_lean_rad": Spread(-26.0 * _DEG, 3.0 * _DEG, 0.1 * _DEG, 1.0 * _DEG, 1.5 * _DEG, 1.2 * _DEG),
        "finish_lean_rad": Spread(27.0 * _DEG, 3.0 * _DEG, -0.1 * _DEG, 1.0 * _DEG, 1.5 * _DEG, 1.2 * _DEG),
        "catch_factor_s": Spread(-0.012, 0.008, 0.0005, 0.003, 0.008, 0.003),
        "handle_peak_speed_m_s": Spread(1.9, 0.1, 0.03, 0.04, 0.05, 0.02),
    }
)
"""Numbers that are drawn; others follow from them."""


@dataclass(frozen=True)
class SyntheticAthlete:
    """One athlete with its truth, in the units of the columns.

    Args:
        athlete: what the season stores of it.
        boat: its boat; all in one boat train together.
        seat: from the bow.
        means: of each of `BASES` at `REFERENCE_RATE`, at the beginning of the season.
        sides: right minus left oar.
        drift: change a month over the whole season.
        fatigue: change from the first stroke to the last of each session.
        late_s: catch relative to the crew, s.
        late_drift_s: its change a month.
        rig_step: change with the second rig of the boat; empty if the rig stays.
    """

    athlete: Athlete
    boat: str
    seat: str
    means: Mapping[str, float]
    sides: Mapping[str, float]
    drift: Mapping[str, float] = field(default_factory=dict)
    fatigue: Mapping[str, float] = field(default_factory=dict)
    late_s: float = 0.0
    late_drift_s: float = 0.0
    rig_step: Mapping[str, float] = field(default_factory=dict)


def synthetic_squad(seed: int, athletes: int) -> list[SyntheticAthlete]:
    """The athletes of a seed.

    Every sixth drifts in catch angle and every seventh in catch factor; every fourth tires; every third boat gets
    another rig; every ninth of a crew is later at the catch each month.
    """
    seats = _boats(athletes)
    return [_athlete(seed, index, boat, seat) for index, (boat, seat) in enumerate(seats)]


def _boats(athletes: int) -> Sequence[tuple[str, str]]:
    """Boat and seat of each athlete: a third in singles, the others in doubles and quads."""
    rest = athletes - -(-athletes // 3)
    quads = rest // 8
    doubles = (rest - 4 * quads) // 2
    sizes = [1] * (athletes - 4 * quads - 2 * doubles) + [2] * doubles + [4] * quads
    return [
        (f"{size}x {number}", str(seat + 1))
        for number, size in enumerate(sizes, start=1)
        for seat in range(size)
    ]


def _athlete(seed: int, index: int, boat: str, seat: str) -> SyntheticAthlete:
    rng = np.random.default_rng([seed, 1, index])
    letters = rng.choice(list(PSEUDONYM_LETTERS), PSEUDONYM_LENGTH - 1)
    crew, number = boat.startswith(("2", "4")), int(boat.partition(" ")[2])
    body = {"stature_m": round(rng.normal(1.85, 0.07), 2), "mass_kg": round(rng.normal(80.0, 7.0), 1)}
    consent = {"coaching": "2025-10-01"} | ({"research": "2025-10-01"} if index % 4 != 3 else {})
    athlete = Athlete("S" + "".join(letters), body, consent, guardian=index % 15 == 0)
    means = {name: rng.normal(base.mean, base.athletes) for name, base in BASES.items()}
    sides = {name: rng.normal(0.0, 1.5 * _DEG) for name in ("catch_angle_rad", "finish_angle_rad")}
    late_s = rng.normal(0.0, 0.015) if crew else 0.0
    return SyntheticAthlete(
        athlete,
        boat,
        seat,
        means,
        sides,
        drift=({"catch_angle_rad": 0.25 * _DEG} if index % 6 == 2 else {})
        | ({"catch_factor_s": 0.002} if index % 7 == 3 else {}),
        fatigue={"catch_angle_rad": 1.2 * _DEG} if index % 4 == 1 else {},
        late_s=late_s,
        late_drift_s=0.004 if crew and index % 9 == 5 else 0.0,
        rig_step={"catch_angle_rad": 2.0 * _DEG} if number % 3 == 0 else {},
    )


BEGIN = datetime.datetime(2025, 11, 1, tzinfo=datetime.UTC)
DAYS = 365
MONTH_DAYS = DAYS / 12.0
_RIGS = ("spread 1.59", "spread 1.61")
_RIG_CHANGE = 0.6
"""Share of the season after which some boats have their second rig."""
_FAILED = 0.008
_LAST_CLASS = 0.75
"""Share of the season after which a second class of runs begins, if there is one."""


@dataclass(frozen=True)
class Planned:
    """One recording.

    Args:
        index: its number.
        member: its athlete's number.
        outing: number of the outing, which all in the boat have in common.
        start: its first sample, UTC.
        rig: of the boat on that day.
        later: whether the boat has its second rig.
        calibrated: whether its run has a calibration.
        failed: whether its run failed.
    """

    index: int
    member: int
    outing: int
    start: datetime.datetime
    rig: str
    later: bool
    calibrated: bool
    failed: bool

    @property
    def months(self) -> float:
        """Time since the beginning of the season."""
        return (self.start - BEGIN).total_seconds() / 86_400.0 / MONTH_DAYS


def plan(seed: int, squad: Sequence[SyntheticAthlete], recordings: int, classes: int = 1) -> list[Planned]:
    """All recordings of a season.

    Args:
        seed: of the season.
        squad: its athletes.
        recordings: how many.
        classes: 2 for runs of which the later ones have a calibration, so that they are not comparable.
    """
    boats = list(dict.fromkeys(planned.boat for planned in squad))
    rounds = -(-recordings // len(squad))
    rng = np.random.default_rng([seed, 2])
    hours = rng.integers(6, 18, (rounds, len(boats)))
    minutes = rng.integers(0, 60, (rounds, len(boats)))
    failed = rng.uniform(size=recordings) < _FAILED
    sessions = []
    for index in range(recordings):
        turn, member = divmod(index, len(squad))
        boat = boats.index(squad[member].boat)
        share = turn / rounds
        clock = datetime.timedelta(
            days=int(share * DAYS), hours=int(hours[turn, boat]), minutes=int(minutes[turn, boat])
        )
        later = bool(squad[member].rig_step) and share >= _RIG_CHANGE
        sessions.append(
            Planned(
                index,
                member,
                turn * len(boats) + boat,
                BEGIN + clock,
                _RIGS[later],
                later,
                classes > 1 and share >= _LAST_CLASS,
                bool(failed[index]),
            )
        )
    return sessions


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


def raw(seed: int, planned: Planned) -> Recording:
    """Noise of three units."""
    rng = np.random.default_rng([seed, 3, planned.index])
    time_s = np.arange(round(_RAW_HZ * RAW_S)) / _RAW_HZ
    streams = []
    for name in UNITS:
        gyro, accel = rng.normal(size=(2, len(time_s), 3)).astype(np.float32)
        streams.append(ImuStream(name, time_s, gyro.astype(float), accel.astype(float) + 9.8 / np.sqrt(3.0)))
    return Recording(streams, {"clock": {"kind": "utc", "zero": f"{planned.start:%Y-%m-%dT%H:%M:%SZ}"}})


def health(seed: int, planned: Planned) -> dict[str, float]:
    """Numbers about the sensors of a recording: mostly little is lost, sometimes much."""
    rng = np.random.default_rng([seed, 4, planned.index])
    lost = rng.gamma(0.5, 0.004, len(UNITS)) + (rng.uniform(size=len(UNITS)) < 0.01) * 0.2
    return {
        f"{name}.missing_share": round(float(share), 5) for name, share in zip(UNITS, lost, strict=True)
    } | {"gyro_bias_rad_s": round(float(abs(rng.normal(0.0, 0.01))), 5)}


def strokes(seed: int, planned: Planned, who: SyntheticAthlete, count: int = 300) -> StrokeTable:
    """The strokes of a session, without gaps in their numbers."""
    rate, catch_s = _outing(seed, planned.outing, count)
    rng = np.random.default_rng([seed, 5, planned.index])
    quality = float(np.exp(rng.normal(0.0, 0.3)))
    worse = quality * np.where(rng.uniform(size=count) < 0.05, 4.0, 1.0)
    columns: dict[str, Floats] = {}
    stds: dict[str, Floats] = {}
    for name, base in BASES.items():
        true = _true(rng, planned, who, name, rate)
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
    _times(rng, planned, who, (rate, catch_s), columns, stds)
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


def _true(
    rng: np.random.Generator, planned: Planned, who: SyntheticAthlete, name: str, rate: Floats
) -> Floats:
    """What a perfect measurement would find; the scatter of strokes grows with the rate."""
    base, count = BASES[name], len(rate)
    level = who.means[name] + who.drift.get(name, 0.0) * planned.months + rng.normal(0.0, base.sessions)
    level += who.rig_step.get(name, 0.0) if planned.later else 0.0
    tired = who.fatigue.get(name, 0.0) * np.arange(count) / count
    own = lfilter([np.sqrt(1.0 - _SAME**2)], [1.0, -_SAME], rng.normal(size=count))
    scatter = base.strokes * (1.0 + 0.03 * (rate - REFERENCE_RATE))
    return np.asarray(level + base.per_rate * (rate - REFERENCE_RATE) + tired + scatter * own)


def _derived(columns: dict[str, Floats], stds: dict[str, Floats], name: str, plus: str, minus: str) -> None:
    columns[name] = columns[plus] - columns[minus]
    stds[name] = np.hypot(stds[plus], stds[minus])


def _times(
    rng: np.random.Generator,
    planned: Planned,
    who: SyntheticAthlete,
    outing: tuple[Floats, Floats],
    columns: dict[str, Floats],
    stds: dict[str, Floats],
) -> None:
    rate, common_s = outing
    late_s = who.late_s + who.late_drift_s * planned.months
    catch_s = common_s + late_s + rng.normal(0.0, 0.012, len(rate)) + rng.normal(0.0, _CATCH_S, len(rate))
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


ENGINE = _core.__version__
SETUPS = (
    Setup(model=b'name = "synthetic"\n'),
    Setup(model=b'name = "synthetic"\n', calibration=b'name = "synthetic"\n'),
)
_BATCH = 20
_WAITING = 2
"""Processes for each core: half of the time each waits for the disk."""
_FAULT = (
    "trunk: 41 % of the samples are missing, so that no strokes can be found. Replace the unit's battery."
)


@dataclass(frozen=True)
class Synthetic:
    """What a synthetic season is made from.

    Args:
        recordings: how many.
        athletes: how many.
        seed: of everything that is drawn.
        classes: 2 for results of two classes that must not be compared.
        strokes: of each recording.
    """

    recordings: int
    athletes: int
    seed: int = 1
    classes: int = 1
    strokes: int = 300

    @property
    def id(self) -> str:
        """The season's id: the same parameters make the same season, byte by byte."""
        return hashlib.sha256(f"synthetic {self}".encode()).hexdigest()[:16]

    def squad(self) -> list[SyntheticAthlete]:
        """The athletes with their truth."""
        return synthetic_squad(self.seed, self.athletes)


def make_synthetic(
    address: str,
    kind: Synthetic,
    jobs: int | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> Season:
    """Make a synthetic season, or go on where that was stopped.

    Args:
        address: of the season.
        kind: what it is made from.
        jobs: number of processes; None uses two a core, 1 only this one.
        progress: called with the share done, 0 to 1.

    Raises:
        DataError: another season is there, or a process was ended from outside.
    """
    if min(kind.recordings, kind.athletes, kind.strokes) < 1 or kind.classes not in (1, 2):
        raise DataError("a synthetic season needs 1 or more recordings and athletes, and 1 or 2 classes")
    season = _begun(address, kind)
    batches = [
        range(first, min(first + _BATCH, kind.recordings)) for first in range(0, kind.recordings, _BATCH)
    ]
    jobs = jobs or _WAITING * (os.cpu_count() or 1)
    done = 0
    for count in _made(address, kind, batches, min(jobs, len(batches))):
        done += count
        progress(done / kind.recordings)
    return season


def _begun(address: str, kind: Synthetic) -> Season:
    place = open_storage(address)
    if not place.exists(SEASON_FILE):
        if place.children(""):
            raise DataError(f"{address}: holds other files; choose an empty place")
        season = Season(place, f"synthetic, seed {kind.seed}", kind.id)
        for planned in kind.squad():
            season.put_athlete(planned.athlete)
        for setup in SETUPS[: kind.classes]:
            season.put_setup(setup)
        place.write(SEASON_FILE, season.toml())
    season = open_season(address)
    if season.id != kind.id:
        raise DataError(
            f"{address}: is a season of real recordings, or a synthetic one made with other options. Choose another "
            "place, or give the same options as before."
        )
    return season


def _made(address: str, kind: Synthetic, batches: Sequence[range], jobs: int) -> Iterator[int]:
    if jobs == 1:
        writer = _Writer(address, kind)
        yield from map(writer.write, batches)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin, initargs=(address, kind))
    try:
        for future in as_completed([pool.submit(_write, batch) for batch in batches]):
            yield future.result()
        pool.shutdown()
    except BaseException as error:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        if isinstance(error, BrokenProcessPool):
            raise DataError(
                f"{address}: another program ended one of the processes; run the same command again, it continues"
            ) from None
        raise


class _Writer:
    """Writes recordings with their results in one process."""

    def __init__(self, address: str, kind: Synthetic) -> None:
        self.kind, self.season = kind, open_season(address)
        self._admission, self._squad = Admission(self.season), kind.squad()
        self._plan = plan(kind.seed, self._squad, kind.recordings, kind.classes)
        self._done = {
            planned for who in self._squad for planned in self.season.results_of(who.athlete.pseudonym)
        }

    def write(self, batch: range) -> int:
        """Write these recordings; returns how many."""
        for index in batch:
            self._athlete(self._plan[index])
        return len(batch)

    def _athlete(self, planned: Planned) -> None:
        seed, who, setup = self.kind.seed, self._squad[planned.member], SETUPS[planned.calibrated]
        recording = raw(seed, planned)
        name = content_name(recording)
        if (name, setup.run(ENGINE)) in self._done:
            return
        session = {
            "athlete": who.athlete.pseudonym,
            "boat": who.boat,
            "seat": who.seat,
            "rig": planned.rig,
        }
        self._admission.add_recording(recording, session)
        if planned.failed:
            plain = (name, setup.run(ENGINE), ENGINE, setup.name, setup.comparable(ENGINE))
            failed = RunRecord(*plain, "failed", _FAULT, health=health(seed, planned))
            self.season.put_result(who.athlete.pseudonym, failed, {}, setup)
            return
        contents = strokes_parquet(strokes(seed, planned, who, self.kind.strokes))
        record = RunRecord.done(name, setup, ENGINE, contents, self.kind.strokes, health(seed, planned))
        self.season.put_result(who.athlete.pseudonym, record, {STROKES_FILE: contents}, setup)


_OWN: _Writer | None = None


def _begin(address: str, kind: Synthetic) -> None:
    """Start of a child process."""
    global _OWN
    begin_child()
    _OWN = _Writer(address, kind)


def _write(batch: range) -> int:
    assert _OWN is not None
    return _OWN.write(batch)
