"""Fills a season with synthetic recordings and results, on several processes; what is there is left as it is."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass

from oarlock import _core
from oarlock.evaluation.child_process import begin_child
from oarlock.rowing.strokes.files import strokes_parquet
from oarlock.season.add import Admission, content_name
from oarlock.season.object_storage import open_storage
from oarlock.season.records import SEASON_FILE, STROKES_FILE, RunRecord, Setup
from oarlock.season.store import Season, open_season
from oarlock.season.synthetic.draw import health, raw, strokes
from oarlock.season.synthetic.plan import Planned, plan
from oarlock.season.synthetic.squad import SyntheticAthlete, synthetic_squad
from oarlock.storage.errors import DataError

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
    address: str, what: Synthetic, jobs: int | None = None, told: Callable[[float], None] = lambda share: None
) -> Season:
    """Make a synthetic season, or go on where that was stopped.

    Args:
        address: of the season.
        what: what it is made from.
        jobs: number of processes; None uses two a core, 1 only this one.
        told: called with the share done, 0 to 1.

    Raises:
        DataError: another season is there, or a process was ended from outside.
    """
    if min(what.recordings, what.athletes, what.strokes) < 1 or what.classes not in (1, 2):
        raise DataError("a synthetic season needs 1 or more recordings and athletes, and 1 or 2 classes")
    season = _begun(address, what)
    batches = [
        range(first, min(first + _BATCH, what.recordings)) for first in range(0, what.recordings, _BATCH)
    ]
    jobs = jobs or _WAITING * (os.cpu_count() or 1)
    done = 0
    for count in _made(address, what, batches, min(jobs, len(batches))):
        done += count
        told(done / what.recordings)
    return season


def _begun(address: str, what: Synthetic) -> Season:
    place = open_storage(address)
    if not place.exists(SEASON_FILE):
        if place.children(""):
            raise DataError(f"{address}: holds other files; choose an empty place")
        season = Season(place, f"synthetic, seed {what.seed}", what.id)
        for one in what.squad():
            season.put_athlete(one.athlete)
        for setup in SETUPS[: what.classes]:
            season.put_setup(setup)
        place.write(SEASON_FILE, season.toml())
    season = open_season(address)
    if season.id != what.id:
        raise DataError(
            f"{address}: is a season of real recordings, or a synthetic one made with other options. Choose another "
            "place, or give the same options as before."
        )
    return season


def _made(address: str, what: Synthetic, batches: Sequence[range], jobs: int) -> Iterator[int]:
    if jobs == 1:
        writer = _Writer(address, what)
        yield from map(writer.write, batches)
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin, initargs=(address, what))
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

    def __init__(self, address: str, what: Synthetic) -> None:
        self.what, self.season = what, open_season(address)
        self._admission, self._squad = Admission(self.season), what.squad()
        self._plan = plan(what.seed, self._squad, what.recordings, what.classes)
        self._done = {one for who in self._squad for one in self.season.results_of(who.athlete.pseudonym)}

    def write(self, batch: range) -> int:
        """Write these recordings; returns how many."""
        for index in batch:
            self._one(self._plan[index])
        return len(batch)

    def _one(self, one: Planned) -> None:
        seed, who, setup = self.what.seed, self._squad[one.member], SETUPS[one.calibrated]
        recording = raw(seed, one)
        name = content_name(recording)
        if (name, setup.run(ENGINE)) in self._done:
            return
        session = {
            "athlete": who.athlete.pseudonym,
            "boat": who.boat,
            "seat": who.seat,
            "rig": one.rig,
        }
        self._admission.add_recording(recording, session)
        if one.failed:
            plain = (name, setup.run(ENGINE), ENGINE, setup.name, setup.comparable(ENGINE))
            failed = RunRecord(*plain, "failed", _FAULT, health=health(seed, one))
            self.season.put_result(who.athlete.pseudonym, failed, {}, setup)
            return
        contents = strokes_parquet(strokes(seed, one, who, self.what.strokes))
        record = RunRecord.done(name, setup, ENGINE, contents, self.what.strokes, health(seed, one))
        self.season.put_result(who.athlete.pseudonym, record, {STROKES_FILE: contents}, setup)


_OWN: _Writer | None = None


def _begin(address: str, what: Synthetic) -> None:
    """Start of a child process."""
    global _OWN
    begin_child()
    _OWN = _Writer(address, what)


def _write(batch: range) -> int:
    assert _OWN is not None
    return _OWN.write(batch)
