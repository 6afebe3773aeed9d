"""Refuses requests whose result could not fit into this machine's memory, before anything is computed."""

from __future__ import annotations

import os

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import shown_bytes

_USUAL_BYTES = 16e9


def check_memory(needed_bytes: float, what: str, advice: str) -> None:
    """Compare an estimate with the memory of the machine.

    Args:
        needed_bytes: estimate of the arrays' size.
        what: what needs them, for the error.
        advice: what to try, a sentence.

    Raises:
        DataError: it is more than the machine has.
    """
    present = _present_bytes()
    if not needed_bytes <= present:
        raise DataError(
            f"{what} would need about {shown_bytes(needed_bytes)} of memory; this machine has "
            f"{shown_bytes(present)}. {advice}"
        )


def _present_bytes() -> float:
    """Physical memory; a usual value where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return _USUAL_BYTES
