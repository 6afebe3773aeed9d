"""`Trial`: the files of one recording where a maker writes one file per unit. For the readers of this folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from oarlock.formats.listing import FileMatch, ListedFile, Listing, listed
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of

MOST_NAMED = 8
"""Trials that an error lists."""


@dataclass(frozen=True)
class Trial:
    """Files of one folder that belong together.

    Args:
        folder: of the files.
        name: what their names have in common.
        files: one file per unit.
    """

    folder: Path
    name: str
    files: tuple[ListedFile, ...]

    def found(self, format_name: str, about: str) -> FileMatch:
        """As recognised in a place: a single file is read alone, several by folder and trial."""
        paths = tuple(one.path for one in self.files)
        if len(paths) == 1:
            return FileMatch(format_name, paths[0], paths, self.name, about)
        return FileMatch(format_name, self.folder, paths, self.name, about, {"trial": self.name})


def trial_at(
    path: Path, name: str | None, trials_of: Callable[[Listing], list[Trial]], exports: str
) -> Trial:
    """The trial in a folder, or one file as a trial of its own.

    Args:
        path: the file or the folder.
        name: of the trial, if the folder has several.
        trials_of: finds the trials of a place.
        exports: what is looked for, for errors, such as "exports of MT Manager".

    Raises:
        DataError: there is nothing, no such trial, or several and none is named.
    """
    place = place_of(path)
    if not place.is_dir():
        return Trial(place.parent, place.stem, listed(place).files)
    trials = [trial for trial in trials_of(listed(place)) if trial.folder == place]
    if not trials:
        raise DataError(f"{place}: has no {exports} directly inside")
    known = [trial.name for trial in trials]
    if name is None and len(trials) == 1:
        return trials[0]
    if name in known:
        return trials[known.index(name)]
    asked = "Name one with --trial" if name is None else f'There is no "{name}"'
    raise DataError(f"{place}: has {len(known)} trials. {asked}: {_shown(known)}.")


def _shown(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
