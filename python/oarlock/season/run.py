"""Computes the results that a season lacks: `make_plan`, `run_season`, its log; `Job`, `Reply`, `Executor`."""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import math
import os
import random
import secrets
import socket
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Literal, Protocol, TypeAlias

from oarlock import _core
from oarlock.season.records import Entry, RunRecord, Setup, run_name
from oarlock.season.store import ErasedError, Season
from oarlock.season.tables import catalogue
from oarlock.storage.errors import DataError

LIMIT_S, LIMIT_SHARE = 300.0, 10.0
"""A computation hangs if it is not done after so long, and so many times its recording: it usually takes a tenth."""
_EXPORT_S = 0.1
"""Reading a device's export takes as long as so much of a recording."""
_LONGEST_FAULT = 600
_LOG_EVERY_S = 5.0


@dataclass(frozen=True)
class Job:
    """One recording to compute. It is small, because it travels between processes and machines.

    Args:
        season: address of the season; absolute, because other processes open it.
        versions: of the packages that results depend on; a process with others refuses the job.
        duration_s: length of the recording; longer ones go first.
        limit_s: time after which the computation counts as hanging, s.
        again: replace the record of an earlier failure of the same run.
        alone: the second attempt after the process of the first one ended, in a new process.
    """

    season: str
    athlete: str
    recording: str
    setup: str
    run: str
    versions: tuple[tuple[str, str], ...]
    duration_s: float
    limit_s: float
    again: bool = False
    alone: bool = False


@dataclass(frozen=True)
class Reply:
    """What became of a job, with the reason in words.

    ``done`` and ``failed`` are stored; ``there``: the result was stored before; ``removed``: the raw data are gone;
    ``refused``: the job cannot be done here, and no recording is to blame; ``lost``: its process ended; ``hung``: the
    time limit ended its process. Words do not differ from machine to machine; `detail` is the last of its error output.
    """

    status: Literal["done", "failed", "there", "removed", "refused", "lost", "hung"]
    words: str = ""
    computed_s: float = 0.0
    detail: str = ""


@dataclass(frozen=True)
class Ended:
    """A job that ended, where, and after how long."""

    job: Job
    reply: Reply
    host: str = ""
    process: int = 0
    seconds: float = 0.0


Task: TypeAlias = Callable[[Job], Reply]


class Executor(Protocol):
    """Where jobs are computed."""

    def run(self, jobs: Sequence[Job]) -> Iterator[Ended]:
        """Begin jobs in this order; gives them as they end. DataError if what computes is gone."""

    def cancel(self) -> None:
        """Stop at once; nothing further comes from `run`."""


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Versions of the packages that the bytes of a result depend on."""
    others = ((name, importlib.metadata.version(name)) for name in ("numpy", "pyarrow"))
    return (("oarlock", _core.__version__), *others)


@dataclass(frozen=True)
class Plan:
    """What is to be computed, the longest first; how many results are there; what failed before in the same run.

    `removed` counts recordings of which the raw data are gone, because retention ended.
    """

    jobs: Sequence[Job]
    there: int
    failed: Mapping[str, str]
    without_setup: Sequence[str]
    removed: int

    @property
    def hours(self) -> float:
        """Length of the recordings to compute, h."""
        return sum(job.duration_s for job in self.jobs) / 3600.0


def make_plan(season: Season, again: bool = False, limit_s: float | None = None) -> Plan:
    """Compare what is stored with what should be.

    `again` also repeats what failed in the same run. The time limit of a recording, s, is by default 300 s and 10 times
    its length.
    """
    jobs, failed, without_setup, there, removed = list[Job](), dict[str, str](), list[str](), 0, 0
    for data in catalogue(season).of:
        records = {(record.recording, record.run): record for record in data.records}
        setups = {"export": Setup().name} | ({"recording": data.setup} if data.setup else {})
        runs = {kind: run_name(_core.__version__, setup) for kind, setup in setups.items()}
        due = []
        for name, entry in data.entries.items():
            if entry.kind not in setups:
                without_setup.append(name)
                continue
            record = records.get((name, runs[entry.kind]))
            if record is None or (record.status == "failed" and again):
                due.append(name)
            elif record.status == "failed":
                failed[name] = record.fault
            else:
                there += 1
        # Tables do not say whether raw data are there.
        present = [entry for entry in season.entries(data.athlete.pseudonym, due) if entry.files]
        removed += len(due) - len(present)
        jobs += [_job(season, e, setups[e.kind], runs[e.kind], again, limit_s) for e in present]
    # The longest first, by powers of two; by chance among them, so that two runs at once share the work.
    jobs.sort(key=lambda job: (-math.frexp(job.duration_s)[1], random.random()))
    return Plan(jobs, there, failed, without_setup, removed)


def _job(season: Season, entry: Entry, setup: str, run: str, again: bool, limit_s: float | None) -> Job:
    address = season.place.address
    where = address if "://" in address else str(Path(address).absolute())
    length_s = _EXPORT_S if entry.duration_s is None else entry.duration_s
    limit = LIMIT_S + LIMIT_SHARE * length_s if limit_s is None else limit_s
    return Job(where, entry.athlete, entry.recording, setup, run, versions(), length_s, limit, again)


@dataclass
class RunCounts:
    """What became of the jobs: how many were computed, or stored by others meanwhile, and why the others failed."""

    computed: int = 0
    there: int = 0
    removed: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    computed_s: float = 0.0
    log: str = ""


def run_season(
    season: Season,
    executor: Executor,
    plan: Plan,
    progress: Callable[[float], None] = lambda share: None,
    look_again: Callable[[], Plan] | None = None,
) -> RunCounts:
    """Compute what is missing, and what is added meanwhile. What fails becomes a stored record with its reason.

    A recording whose process ended is tried once more after all others, alone and in a new process, so that none is
    blamed for what another did, or for memory that others needed.

    The executor is cancelled at the end. `look_again` says what is missing when all is done.
    """
    log = RunLog(season)
    counts, begun = RunCounts(log=log.name), set[str]()
    log.add("begun", versions=dict(versions()), jobs=len(plan.jobs))
    try:
        jobs = plan.jobs
        while jobs:
            begun |= {job.recording for job in jobs}
            total_s, done_s, suspects = sum(job.duration_s for job in jobs), 0.0, list[Job]()
            for part in chain([jobs], ([replace(job, alone=True)] for job in suspects)):
                for ended in executor.run(part):
                    log.add_job(ended)
                    if ended.reply.status == "lost" and not ended.job.alone:
                        suspects.append(ended.job)
                        continue
                    _count(season, ended, counts)
                    done_s += ended.job.duration_s
                    progress(done_s / total_s)
            more = () if look_again is None else look_again().jobs
            jobs = [job for job in more if job.recording not in begun]
        log.add("finished", computed=counts.computed, failed=len(counts.failed))
    except BaseException as error:
        log.add("stopped", words=type(error).__name__)  # its words may name an athlete
        raise
    finally:
        executor.cancel()
        log.write()
    return counts


def _count(season: Season, ended: Ended, counts: RunCounts) -> None:
    reply, job, words = ended.reply, ended.job, ended.reply.words
    if reply.status == "refused":
        raise DataError(f"{words}. All finished results are stored; run the same command again to continue")
    counts.computed_s += reply.computed_s
    if reply.status in ("lost", "hung"):
        words = f"ends its process, again when it was computed alone: {words}"
        if reply.status == "hung":
            words = f"hangs: {reply.words}; a longer --task-limit-s with --again-failed gives it more time"
        setup = season.load_setup(job.setup, job.athlete)
        commit(season, job, failed_record(job, setup, words), {}, setup)
    if reply.status in ("lost", "hung", "failed"):
        counts.failed[job.recording] = words
    else:
        counts.computed += reply.status == "done"
        counts.there += reply.status == "there"
        counts.removed += reply.status == "removed"


def commit(season: Season, job: Job, record: RunRecord, files: Mapping[str, bytes], setup: Setup) -> bool:
    """Store a result; False if another writer was first, or the athlete was erased meanwhile.

    A record of a failure gives way to a result, and to another failure if it is computed again.
    """
    try:
        before = season.run_record(job.athlete, record.recording, record.run)
        is_failure = before is not None and before.status == "failed"
        gives_way = is_failure and (job.again or record.status == "done")
    except DataError:  # damaged
        gives_way = True
    return season.put_result(job.athlete, record, files, setup, replaces=gives_way)


def failed_record(job: Job, setup: Setup, fault: str) -> RunRecord:
    """The record of a run without a result, and why."""
    engine = dict(job.versions)["oarlock"]
    comparable = setup.comparable(engine)
    fault = fault[:_LONGEST_FAULT]
    return RunRecord(job.recording, job.run, engine, job.setup, comparable, "failed", fault)


class RunLog:
    """JSON lines of one run.

    `logs/` says when it began and ended; the `logs/` of an athlete say when, where and for how long each recording was
    computed. Results have none of this, so that they are the same bytes wherever they were computed. Files are
    written every few seconds as a whole, because an object store cannot append.
    """

    def __init__(self, season: Season) -> None:
        self._season = season
        now = datetime.datetime.now(datetime.UTC)
        self.name = f"logs/run-{now:%Y%m%dT%H%M%SZ}-{secrets.token_hex(4)}.jsonl"
        self._lines: dict[str, list[str]] = {}
        self._changed: set[str] = set()
        self._written_s = -_LOG_EVERY_S

    def add(self, event: str, athlete: str = "", **about: object) -> None:
        """Add a line about a recording of an athlete, or about the run; with the time, this host and process."""
        at = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        line = {"at": at, "event": event, "host": socket.gethostname(), "process": os.getpid(), **about}
        self._lines.setdefault(athlete, []).append(json.dumps(line, ensure_ascii=False) + "\n")
        self._changed.add(athlete)
        if time.monotonic() - self._written_s > _LOG_EVERY_S:
            self.write()

    def add_job(self, ended: Ended) -> None:
        """Add the line of a job."""
        reply, job = ended.reply, ended.job
        about = {"recording": job.recording, "run": job.run, "host": ended.host, "process": ended.process}
        about |= {"seconds": round(ended.seconds, 3), "computed_s": round(reply.computed_s, 3)}
        self.add(reply.status, job.athlete, **about, words=reply.words, detail=reply.detail)

    def write(self) -> None:
        """Write what has new lines; nothing of athletes who were erased meanwhile."""
        for athlete in sorted(self._changed):
            contents = "".join(self._lines[athlete]).encode()
            if not athlete:
                self._season.place.write(self.name, contents)
            elif self._season.is_here(athlete):
                with suppress(ErasedError):
                    self._season.write(athlete, self.name, contents)
        self._changed.clear()
        self._written_s = time.monotonic()
