"""`Job`, `Reply`, `Loss` and `Ended`: what a recording's computation is given and what comes back; `Executor`.

They are small, and name places, because they travel between processes and machines.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Literal, Protocol, TypeAlias

Told: TypeAlias = Literal["done", "failed", "there", "removed", "refused"]


@dataclass(frozen=True)
class Job:
    """One recording to compute.

    Args:
        season: address of the season; absolute, because other processes open it.
        recording: name of the recording.
        setup: name of the setup.
        run: name of the run.
        versions: of the packages that results depend on; a process with others refuses the job.
        duration_s: length of the recording; longer ones go first.
        limit_s: time after which the computation counts as hanging, s.
        again: replace the record of an earlier failure of the same run.
        alone: the second attempt after the process of the first one ended, in a new process.
    """

    season: str
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
    """What a task says of a job.

    Args:
        told: ``done`` and ``failed`` are stored; ``there``: the result was stored before; ``removed``: the raw data
            are gone; ``refused``: the job cannot be done here, and no recording is to blame.
        words: why, a sentence; empty if it was done or there.
        computed_s: time of the computation, s; 0 where there was none.
    """

    told: Told
    words: str = ""
    computed_s: float = 0.0


@dataclass(frozen=True)
class Loss:
    """A job without a reply.

    Args:
        hung: the time limit ended its process; else the process ended by itself, or was killed.
        words: how, without what differs from machine to machine.
        detail: the last that the process wrote as errors.
    """

    hung: bool
    words: str
    detail: str = ""


@dataclass(frozen=True)
class Ended:
    """A job that ended, where, and after how long."""

    job: Job
    reply: Reply | Loss
    host: str = ""
    process: int = 0
    seconds: float = 0.0


Task: TypeAlias = Callable[[Job], Reply]


class Executor(Protocol):
    """Where jobs are computed. Jobs begin in the order in which they are submitted."""

    def submit(self, job: Job) -> None:
        """Take a job."""

    def as_completed(self) -> Iterator[Ended]:
        """Jobs as they end, until none is left; more may be submitted meanwhile.

        Raises:
            DataError: what computes is gone.
        """

    def cancel(self) -> None:
        """Stop at once; nothing further comes from `as_completed`."""


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Versions of the packages that the bytes of a result depend on."""
    from oarlock import _core

    others = ((name, importlib.metadata.version(name)) for name in ("numpy", "pyarrow"))
    return (("oarlock", _core.__version__), *others)
