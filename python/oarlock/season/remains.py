"""`remove_remains`: what a search found outside an athlete's own folders: notes, logs, tables, half-written files."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress

from oarlock.season.belongings import Belongings, is_of
from oarlock.season.compact import Current
from oarlock.season.layout import (
    ENTRY_FILE,
    EXPORTS,
    LOGS,
    RECORDINGS,
    RESULTS,
    RUN_FILE,
    SEASON_FILE,
    TABLES,
)
from oarlock.season.place import OWN_WORK
from oarlock.season.store import Season
from oarlock.season.traces import Sought, Trace
from oarlock.storage.write_file import TEMPORARY

_TEXTS = (".toml", ".csv", ".txt", ".tsv", ".tcx", ".json", ".xml", ".jsonl", ".log", ".md")


def remove_remains(
    season: Season, sought: Sought, own: Belongings, found: Sequence[Trace]
) -> tuple[list[Trace], bool]:
    """Remove what can be removed without loss for others.

    Results of others are removed as a whole, because `run` makes them again. In texts `[erased]` takes the place of
    what was found. Files of numbers of others, setups, and files that no season has are left and named.

    Args:
        season: which.
        sought: what was searched for.
        own: what was known to be the athlete's.
        found: the traces.

    Returns:
        The traces that were removed, and whether all tables have to be made anew.
    """
    removed: set[str] = set()
    needs_tables = False
    current = set(Current.read(season).files.values())
    of_others: dict[str, list[str]] = {}
    for file in sorted({one.file for one in found}):
        top, _, rest = file.partition("/")
        second = rest.partition("/")[0]
        if top == RECORDINGS and second not in own.recordings and not is_of(season, second, own.athlete):
            of_others.setdefault(second, []).append(file)
            continue
        with suppress(FileNotFoundError):  # another writer has removed it
            if not _removed(season, sought, file, (top, second)):
                continue
        removed.add(file)
        needs_tables |= file in current
    for recording, files in of_others.items():
        # One without an entry is not finished, and its writer looks for tombstones itself.
        if season.place.exists(f"{RECORDINGS}/{recording}/{ENTRY_FILE}"):
            with suppress(FileNotFoundError):
                texts = [file for file in files if _is_text(season, file, sought)]
                _redact_recording(season, sought, recording, texts)
                removed |= set(texts)
                needs_tables |= bool(texts)  # the texts of a session are columns
    return [one for one in found if one.file in removed], needs_tables


def _removed(season: Season, sought: Sought, file: str, at: tuple[str, str]) -> bool:
    """Whether the trace is gone: with its file, its folder or its line."""
    (top, second), place = at, season.place
    if top in (OWN_WORK, RECORDINGS):
        place.remove_folder(f"{top}/{second}", ENTRY_FILE if top == RECORDINGS else "")
    elif top == RESULTS:
        place.remove_folder(f"{top}/{second}", RUN_FILE)
    elif top == TABLES or file.rpartition("/")[2].startswith(TEMPORARY):
        place.remove([file])
    elif top == LOGS:
        _without_lines(season, sought, file)
    elif file == SEASON_FILE or top == EXPORTS:
        place.write(file, sought.redacted(place.read(file)))
    else:
        return False
    return True


def _without_lines(season: Season, sought: Sought, file: str) -> None:
    """Remove the lines of a log that have a trace; a log that is no text is removed as a whole."""
    if not file.endswith(_TEXTS) or sought.found(file.encode()):
        season.place.remove([file])
        return
    lines = season.place.read(file).splitlines(keepends=True)
    season.place.write(file, b"".join(line for line in lines if not sought.found(line)))


def _is_text(season: Season, file: str, sought: Sought) -> bool:
    """Whether what is sought can be replaced in a file."""
    if not file.endswith(_TEXTS) or sought.found(file.encode()):
        return False
    return not sought.found(sought.redacted(season.place.read(file)))


def _redact_recording(season: Season, sought: Sought, recording: str, files: Sequence[str]) -> None:
    """Replace what is sought in the texts of somebody else's recording; its commit record gets their new hashes."""
    folder = f"{RECORDINGS}/{recording}"
    others = [name for name, _ in season.place.files(folder) if name.endswith(_TEXTS)]
    hashes: dict[bytes, bytes] = {}
    changed: dict[str, bytes] = {}
    # Texts first, then the manifest, which has their hashes, then the commit record, which has the manifest's.
    for name in sorted({*files, *others}, key=_last(folder)):
        before = season.place.read(name)
        after = sought.redacted(before) if name in files else before
        if name.endswith(("manifest.toml", f"/{ENTRY_FILE}")):
            for old, new in hashes.items():
                after = after.replace(old, new)
        if after != before:
            hashes[_sha(before)] = _sha(after)
            changed[name] = after
    # Written from the commit record down: an erasure that is interrupted finds the remaining texts again, and their
    # redaction is what the records name already.
    for name, after in reversed(changed.items()):
        season.place.write(name, after)


def _last(folder: str) -> Callable[[str], tuple[bool, bool, str]]:
    return lambda name: (name == f"{folder}/{ENTRY_FILE}", name.endswith("manifest.toml"), name)


def _sha(contents: bytes) -> bytes:
    return hashlib.sha256(contents).hexdigest().encode()
