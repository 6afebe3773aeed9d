"""What one software says of one recording, and what it could not say."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from scipy.spatial.transform import Rotation

from oarlock.storage.arrays import Floats

from .rotations import quat_wxyz, rotation


@dataclass(frozen=True, eq=False)
class OrientationEstimate:
    """Orientations of bodies over time, by one software in one mode.

    Args:
        name: software and mode, as tables call it.
        time_s: (T,) on the recording's clock, s.
        quats: body -> (T, 4) quat_wxyz, world_from_body, world with z up; NaN where there is none. Where a software has
            no common heading, each body has a north of its own.
        online: whether an estimate rests on readings up to its own time only.
        note: what a reader of the table must know.
    """

    name: str
    time_s: Floats
    quats: Mapping[str, Floats]
    online: bool = True
    note: str = ""

    @property
    def ours(self) -> bool:
        """Whether Oarlock made it."""
        return self.name.startswith("Oarlock")

    def rotated(self, body_from_other: Mapping[str, Rotation]) -> OrientationEstimate:
        """The same of other axes on the bodies: world_from_other = world_from_body body_from_other."""
        quats = {b: quat_wxyz(rotation(q) * body_from_other[b]) for b, q in self.quats.items()}
        return replace(self, quats=quats)

    def headed(self, world_from_own: Mapping[str, Rotation], note: str) -> OrientationEstimate:
        """The same with each body's own world turned into the common one."""
        quats = {b: quat_wxyz(world_from_own[b] * rotation(q)) for b, q in self.quats.items()}
        return replace(self, quats=quats, note="; ".join(t for t in (self.note, note) if t))


@dataclass(frozen=True)
class Missing:
    """A software that did not run."""

    name: str
    reason: str

    @property
    def ours(self) -> bool:
        """Whether it is Oarlock."""
        return self.name.startswith("Oarlock")


Outcome = OrientationEstimate | Missing


class NotRunError(RuntimeError):
    """A software cannot run on this recording; its text is the reason."""


def attempt(names: Iterable[str], run: Callable[[], Iterable[OrientationEstimate]]) -> list[Outcome]:
    """The estimates of a run, or one `Missing` for each name if it cannot run.

    Only what may happen to a stranger's computer is caught: a package that is not installed, a model or mode that
    is not there. Anything else is a mistake of ours and shall be seen.
    """
    try:
        return list(run())
    except ImportError as error:
        return [Missing(name, f"not installed ({error.name or error})") for name in names]
    except NotRunError as error:
        return [Missing(name, f"not run: {error}") for name in names]
