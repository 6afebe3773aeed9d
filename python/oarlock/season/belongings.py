"""`Belongings`: what a season holds of one athlete, as `export` and `erase` need it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import pyarrow.compute as pc

from oarlock.season.arrow_table import read_table
from oarlock.season.compact import Current
from oarlock.season.layout import ATHLETES, ENTRY_FILE, EXPORTS, RUN_FILE, recording_folder, result_folder
from oarlock.season.store import Season
from oarlock.storage.errors import DataError

_READERS = 16
_SOURCES = (ENTRY_FILE, "session.toml", "recording.toml")
"""Files of a recording that say whose it is; a folder whose writer was stopped may have the later ones only."""


@dataclass(frozen=True)
class Belongings:
    """What there is of an athlete.

    Args:
        athlete: the pseudonym.
        recordings: names of recordings, unfinished and damaged ones too.
        results: recording and run.
        setups: names of the setups of these results.
        exports: names of the notes of exports.
        rows: rows of strokes in the compacted tables.
        has_file: whether the athlete's own file is there.
    """

    athlete: str
    recordings: Sequence[str] = ()
    results: Sequence[tuple[str, str]] = ()
    setups: Sequence[str] = ()
    exports: Sequence[str] = ()
    rows: int = 0
    has_file: bool = False

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing."""
        return not (self.recordings or self.results or self.exports or self.rows or self.has_file)


def belongings(season: Season, athlete: str, known: Iterable[str] = ()) -> Belongings:
    """What a season holds of an athlete, as read from the recordings themselves.

    Args:
        season: which.
        athlete: the pseudonym.
        known: names of further recordings of this athlete, which may be gone already.
    """
    here = season.recordings()
    with ThreadPoolExecutor(_READERS) as pool:
        own = [
            name
            for name, is_own in zip(
                here, pool.map(lambda one: is_of(season, one, athlete), here), strict=True
            )
            if is_own
        ]
    whole = set(own) | set(known)
    results = [one for one in season.results() if one[0] in whole]
    setups = {record.setup for record in season.run_records(results)}
    if athlete in season.setup:
        setups.add(season.setup[athlete])
    notes = season.place.children(f"{EXPORTS}/{athlete}")
    return Belongings(
        athlete,
        sorted(own),
        results,
        sorted(setups),
        [f"{EXPORTS}/{athlete}/{name}" for name in notes],
        _rows(season, athlete),
        season.place.exists(f"{ATHLETES}/{athlete}.toml"),
    )


def is_of(season: Season, recording: str, athlete: str) -> bool:
    """Whether a recording is of an athlete, whatever state it is in."""
    line = re.compile(rb'^athlete = "' + re.escape(athlete.encode()) + rb'"\r?$', re.MULTILINE)
    for file in _SOURCES:
        try:
            return line.search(season.place.read(f"{recording_folder(recording)}/{file}")) is not None
        except FileNotFoundError:
            continue
    return False


def folders(one: Belongings) -> list[tuple[str, str]]:
    """Folders of recordings, then of results, each with its commit record."""
    recordings = [(recording_folder(name), ENTRY_FILE) for name in one.recordings]
    return recordings + [(result_folder(*pair), RUN_FILE) for pair in one.results]


def _rows(season: Season, athlete: str) -> int:
    total = 0
    try:
        names = [file for table, file in Current.read(season).files.items() if table.startswith("strokes/")]
    except DataError:
        return 0
    for name in names:
        try:
            column = read_table(season.place.on_disk([name])[0], columns=["athlete"])["athlete"]
        except (DataError, OSError, KeyError):
            continue  # damaged or gone; the next compaction makes it anew
        total += pc.sum(pc.equal(column, athlete)).as_py() or 0
    return total
