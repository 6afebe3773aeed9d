"""What a reader recognised in a file and did with it: sentences in a recording's `meta`. For `oarlock import`."""

from __future__ import annotations

import copy
from collections.abc import Mapping

from oarlock.recording.epoch import clock_notes
from oarlock.storage.errors import DataError


def reader_notes(meta: Mapping[str, object]) -> tuple[str, ...]:
    """Sentences on the time stamps, then those of ``meta["source"]["notes"]``; each once."""
    source = meta.get("source")
    told = source.get("notes") if isinstance(source, Mapping) else None
    own = told if isinstance(told, list | tuple) else ()
    return tuple(dict.fromkeys((*clock_notes(meta), *(text for text in own if isinstance(text, str)))))


def copied_notes(notes: Mapping[str, object], where: str) -> dict[str, object]:
    """A deep copy.

    Raises:
        DataError: tables are nested so deeply that they cannot be copied.
    """
    try:
        return copy.deepcopy(dict(notes))
    except RecursionError:
        raise DataError(f"{where}: tables are nested too deeply to be copied; nest fewer of them") from None
