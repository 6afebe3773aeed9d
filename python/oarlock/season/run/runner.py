"""`run_season`: computes what a season lacks with an executor, and stores why a recording ends or hangs its process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from oarlock.season.run.compute import commit, failed_record
from oarlock.season.run.job import Ended, Executor, Job, Loss, versions
from oarlock.season.run.plan import Plan
from oarlock.season.run.run_log import RunLog
from oarlock.season.run_record import Setup
from oarlock.season.store import Season
from oarlock.storage.errors import DataError

Share = Callable[[float], None]


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
    told: Share = lambda share: None,
    look_again: Callable[[], Plan] | None = None,
) -> RunCounts:
    """Compute what is missing, and what is added meanwhile; the log goes into `logs/`.

    Args:
        season: which.
        executor: where it is computed; it is cancelled at the end.
        plan: what is missing.
        told: called with the share done, 0 to 1.
        look_again: what is missing then; asked when all is done.

    Raises:
        DataError: as `run_jobs`.
    """
    log, outcome, asked = RunLog(season), RunCounts(), set[str]()
    outcome.log = log.name
    log.say("begun", versions=dict(versions()), jobs=len(plan.jobs))
    try:
        while plan.jobs:
            asked |= {job.recording for job in plan.jobs}
            run_jobs(season, plan.jobs, executor, log, outcome, told)
            plan = replace(plan, jobs=()) if look_again is None else look_again().without(asked)
        log.say("finished", computed=outcome.computed, failed=len(outcome.failed))
    except BaseException as error:
        log.say("stopped", words=f"{type(error).__name__}: {error}")
        raise
    finally:
        executor.cancel()
        log.write()
    return outcome


def run_jobs(
    season: Season, jobs: Sequence[Job], executor: Executor, log: RunLog, outcome: RunCounts, told: Share
) -> None:
    """Do the jobs. What fails becomes a stored record with its reason.

    A recording whose process ended is tried once more after all others, alone and in a new process, so that none is
    blamed for what another did, or for memory that others needed.

    Args:
        season: which.
        jobs: in the order in which they begin.
        executor: where they are computed.
        log: gets a line a job.
        outcome: what became of each is added there.
        told: called with the share done, 0 to 1.

    Raises:
        DataError: the jobs cannot be done there, such as on a full disk or with another version.
    """
    suspects = list[Job]()
    total_s, done_s = sum(job.duration_s for job in jobs), 0.0
    for ended in _ended(executor, jobs):
        log.ended(ended)
        if isinstance(ended.reply, Loss) and not ended.reply.hung:
            suspects.append(ended.job)
            continue
        _count(season, ended, outcome)
        done_s += ended.job.duration_s
        told(done_s / total_s)
    for job in suspects:
        for ended in _ended(executor, [replace(job, alone=True)]):
            log.ended(ended)
            _count(season, ended, outcome)


def _ended(executor: Executor, jobs: Iterable[Job]) -> Iterable[Ended]:
    for job in jobs:
        executor.submit(job)
    return executor.as_completed()


def _count(season: Season, ended: Ended, outcome: RunCounts) -> None:
    reply, job = ended.reply, ended.job
    if isinstance(reply, Loss):
        outcome.failed[job.recording] = _stored(season, job, reply)
        return
    if reply.told == "refused":
        raise DataError(
            f"{reply.words}. All finished results are stored; run the same command again to continue"
        )
    outcome.computed_s += reply.computed_s
    if reply.told == "failed":
        outcome.failed[job.recording] = reply.words
    elif reply.told == "done":
        outcome.computed += 1
    elif reply.told == "there":
        outcome.there += 1
    else:
        outcome.removed += 1


def _stored(season: Season, job: Job, loss: Loss) -> str:
    """Stores the record of a recording that ends or hangs its process; returns why it failed."""
    words = (
        f"hangs: {loss.words}; a longer --task-limit-s with --again-failed gives it more time"
        if loss.hung
        else f"ends its process, again when it was computed alone: {loss.words}"
    )
    setup = Setup() if job.setup == Setup().name else season.load_setup(job.setup)
    commit(season, failed_record(job, setup, words), {}, setup, job.again)
    return words
