"""`erase_again`: applies the tombstones to a season that was restored from a backup."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from oarlock.season.erase import Erasure, erase
from oarlock.season.layout import ATHLETES
from oarlock.season.store import Season
from oarlock.season.tombstones import erased_hashes, restore_tombstones

Told = Callable[[float], None]


def came_back(season: Season, file: Path | None = None, thorough: bool = False) -> dict[str, list[str]]:
    """Who was erased and is in the season, and where.

    Args:
        season: which.
        file: a file of copies of tombstones.
        thorough: read every recording, not only the files of athletes.

    Returns:
        Names of files and folders by pseudonym.
    """
    erased = erased_hashes(season, file)
    if not erased:
        return {}
    where: dict[str, list[str]] = {
        name.removesuffix(".toml"): [f"{ATHLETES}/{name}"]
        for name in season.place.children(ATHLETES)
        if name.endswith(".toml")
    }
    if thorough:
        for entry in season.entries(season.recordings()):
            where.setdefault(entry.athlete, []).append(f"recordings/{entry.recording}")
    return {name: files for name, files in sorted(where.items()) if season.is_erased(name, erased)}


def erase_again(
    season: Season, file: Path | None = None, thorough: bool = False, told: Told = lambda share: None
) -> list[Erasure]:
    """Write lacking tombstones back, and erase those who came back.

    Args:
        season: which.
        file: a file of copies of tombstones.
        thorough: read every recording, not only the files of athletes.
        told: called with the share done, 0 to 1.

    Returns:
        An `Erasure` for each who came back.
    """
    lacking = restore_tombstones(season, file)
    back = came_back(season, file, thorough or bool(lacking))
    return [erase(season, name, tombstones=file, dry_run=False, told=told) for name in back]
