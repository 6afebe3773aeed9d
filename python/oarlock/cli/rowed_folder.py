"""`track_or_recording`: what a folder contains, for verbs that take either."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from oarlock import Recording, Track


def track_or_recording(folder: Path) -> Track | Recording:
    """The recording or the track of a folder.

    Raises:
        DataError: it contains neither, or what it contains is damaged.
    """
    from oarlock import load_recording, load_track
    from oarlock.storage.errors import DataError

    if (folder / "recording.toml").exists():
        return load_recording(folder)
    if not any((folder / name).exists() for name in ("run.toml", "track.parquet")):
        why = "contains neither a track nor a recording" if folder.exists() else "does not exist"
        raise DataError(f"{folder}: {why}; give a folder that `oarlock track` or `oarlock import` wrote")
    return load_track(folder)
