"""`make_plan`: which recordings of a season lack the result that its setups and this version name."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from oarlock.season.compact import known_now
from oarlock.season.entry import Entry
from oarlock.season.run.job import Job, versions
from oarlock.season.run.setups import absolute_address, setup_name
from oarlock.season.run_record import Setup
from oarlock.season.store import Season

LIMIT_S, LIMIT_SHARE = 300.0, 10.0
"""A computation hangs if it is not done after so long, and so many times its recording: it usually takes a tenth."""
EXPORT_S = 0.1
"""Reading a device's export takes as long as so much of a recording."""


@dataclass(frozen=True)
class Plan:
    """What is to be computed.

    Args:
        jobs: the longest first, within a factor of two.
        there: recordings that have the result.
        failed: reasons by recording, where the same run failed before; `again` makes jobs of them.
        without_setup: recordings for which no setup was chosen.
        removed: recordings of which the raw data are gone, because retention ended.
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

    def without(self, recordings: set[str]) -> Plan:
        """The same without the jobs of these."""
        return replace(self, jobs=[job for job in self.jobs if job.recording not in recordings])


def make_plan(season: Season, again: bool = False, limit_s: float | None = None) -> Plan:
    """Compare what is stored with what should be.

    Args:
        season: which.
        again: also repeat what failed in the same run.
        limit_s: time limit of a recording, s; None is 300 s and 10 times its length.

    Raises:
        DataError: a setup that was chosen is not there.
    """
    known = known_now(season)
    status = {(record.recording, record.run): record for record in known.records}
    runs = _runs(season)
    wanted, failed, without_setup, there = [], {}, [], 0
    for entry in known.entries.values():
        name = setup_name(season, entry.athlete, entry.kind)
        if not name:
            without_setup.append(entry.recording)
            continue
        record = status.get((entry.recording, runs[name]))
        if record is None or (record.status == "failed" and again):
            wanted.append(entry)
        elif record.status == "failed":
            failed[entry.recording] = record.fault
        else:
            there += 1
    # Tables do not say whether raw data are there.
    present = [entry for entry in season.entries([one.recording for one in wanted]) if entry.files]
    jobs = [_job(season, entry, runs, again, limit_s) for entry in present]
    # The longest first, by powers of two; by chance among them, so that two runs at once share the work.
    jobs.sort(key=lambda job: (-math.frexp(job.duration_s)[1], random.random()))
    return Plan(jobs, there, failed, without_setup, len(wanted) - len(present))


def _runs(season: Season) -> dict[str, str]:
    """Names of the runs by their setups: those that were chosen, and that of exports."""
    engine = dict(versions())["oarlock"]
    setups = [Setup(), *(season.load_setup(name) for name in set(season.setup.values()))]
    return {setup.name: setup.run(engine) for setup in setups}


def _job(season: Season, entry: Entry, runs: Mapping[str, str], again: bool, limit_s: float | None) -> Job:
    setup = setup_name(season, entry.athlete, entry.kind)
    length_s = EXPORT_S if entry.duration_s is None else entry.duration_s
    limit = LIMIT_S + LIMIT_SHARE * length_s if limit_s is None else limit_s
    where = absolute_address(season)
    return Job(where, entry.recording, setup, runs[setup], versions(), length_s, limit, again)
