"""Copies of notes that a recording or a calibration keeps for itself; both constructors use it."""

from __future__ import annotations

import copy
from collections.abc import Mapping

from oarlock.storage.errors import DataError


def copied_notes(notes: Mapping[str, object], where: str) -> dict[str, object]:
    """A deep copy.

    Raises:
        DataError: tables are nested so deeply that they cannot be copied.
    """
    try:
        return copy.deepcopy(dict(notes))
    except RecursionError:
        raise DataError(f"{where}: tables are nested too deeply to be copied; nest fewer of them") from None
