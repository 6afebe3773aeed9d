"""`erase`: removes the folder of an athlete; a listing of it, and of its former versions on S3, is the proof."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from oarlock.season.exports import export_notes, remove_export
from oarlock.season.object_storage import FormerVersions
from oarlock.season.records import ATHLETE_FILE, athlete_folder
from oarlock.season.store import Season, not_in_season

_ROUNDS = 3
"""Removals after which what other writers still add is left to be named."""


@dataclass(frozen=True)
class Erasure:
    """What an erasure removed, and what it could not.

    Args:
        removed: how many of what were removed, or would be.
        left: files and versions of the athlete that are still there, and why versions could not be seen.
        elsewhere: copies that are out of reach, each with what to do.
    """

    athlete: str
    is_dry_run: bool
    removed: Mapping[str, int]
    left: Sequence[str] = ()
    elsewhere: Sequence[str] = ()

    @property
    def is_proven(self) -> bool:
        """Whether the listings have nothing of the athlete."""
        return not self.is_dry_run and not self.left


def erase(season: Season, athlete: str, *, dry_run: bool = True) -> Erasure:
    """Erase an athlete, or say what would be removed. An erasure that was interrupted continues when it is repeated."""
    place, folder = season.place, athlete_folder(athlete)
    versions, notes = FormerVersions(place, folder), export_notes(season, athlete)
    removed = {
        "recordings": len(season.recordings_of(athlete)),
        "results": len(season.results_of(athlete)),
        "files": sum(1 for _ in place.files(folder)),
        "exports": len(notes),
        "object versions": len(versions.names()),
    }
    if "/" in athlete or (athlete not in season.folders() and not any(removed.values())):
        raise not_in_season("athlete", athlete, season.folders())
    if dry_run:
        return Erasure(athlete, True, removed)
    # First of all: whoever stores something looks for this file afterwards, and removes what is stored.
    place.remove([f"{folder}/{ATHLETE_FILE}"])
    elsewhere = [words for note in notes for words in remove_export(season, athlete, note)]
    for _ in range(_ROUNDS):
        place.remove_folder(folder)
        if not (left := [name for name, _ in place.files(folder)]):
            break
    others = [athlete_folder(name) for name in season.folders() if name != athlete]
    removed["copies in the cache"] = place.forget_copies(others)
    removed["object versions"] = versions.remove()
    left += [f"{key}, version {version}" for key, version in versions.names()]
    left += [f"{place.address}: former versions {versions.unseen}"] if versions.unseen else []
    return Erasure(athlete, False, removed, left, elsewhere)
