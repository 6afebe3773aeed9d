"""Unwraps packet counters and device clocks and finds lost packets, for the CSV reader."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

Lost = dict[str, list[float]]
"""As in `recording.packets.META_KEY`: time stamps before lost packets, their number, duration of one packet."""


def unwrapped(values: Floats, wraps_at: float, places: Sequence[str]) -> Floats:
    """The count without wrapping, (T,).

    A step back by more than half the modulus is a wrap; a smaller one is not changed. A dropout of more than half the
    modulus cannot be detected: give time stamps of such a device in a unit that does not wrap.

    Args:
        values: (T,) as the device wrote them.
        wraps_at: the modulus, such as 65536 or 4294967296.
        places: file, line and column of each, for errors.

    Raises:
        DataError: a value below 0, or not below the modulus.
    """
    outside = np.flatnonzero((values < 0.0) | (values >= wraps_at))
    if outside.size:
        index = int(outside[0])
        raise DataError(
            f"{places[index]}: is {values[index]:.15g}, but wraps_at = {wraps_at:.15g}: expected 0 to less than that. "
            "Correct wraps_at, or leave it out"
        )
    turns = np.cumsum(np.diff(values, prepend=values[:1]) < -0.5 * wraps_at)
    return np.asarray(values + turns * wraps_at)


_REGISTERS = (2.0**8, 2.0**16, 2.0**24, 2.0**32)


def probable_modulus(values: Floats) -> float | None:
    """The register size (8, 16, 24 or 32 bit) at which a count restarts; None if it does not restart, or not so.

    Every step back must be one to three usual steps modulo the register.
    """
    steps = np.diff(values)
    back = steps[steps < 0.0]
    if not back.size:
        return None
    usual, high = float(np.median(steps)), float(values.max())
    for modulus in _REGISTERS:
        onward = back + modulus
        if high < modulus and bool(((onward > 0.0) & (onward <= 3.0 * usual)).all()):
            return modulus
    return None


def lost_packets(counter: Floats, time_s: Floats, places: Sequence[str]) -> Lost:
    """Find jumps of a packet counter, and their sizes.

    Args:
        counter: (T,) unwrapped.
        time_s: (T,) stamps in s.
        places: file, line and column of each, for errors.

    Raises:
        DataError: a count is missing, is not a whole number, or does not increase.
    """
    odd = np.flatnonzero(~(np.isfinite(counter) & (counter == np.round(counter))))
    if odd.size:
        raise DataError(
            f"{places[int(odd[0])]}: the counter reads {counter[odd[0]]:g}; expected a whole number in each row"
        )
    steps = np.diff(counter)
    back = np.flatnonzero(steps <= 0.0)
    if back.size:
        index = int(back[0]) + 1
        raise DataError(
            f"{places[index]}: the counter reads {counter[index]:.15g} after {counter[index - 1]:.15g}: a packet "
            "is duplicated or out of order. Remove it; if the counter wrapped, give wraps_at"
        )
    usual = float(np.median(steps)) if steps.size else 1.0
    missing = np.round(steps / usual) - 1.0
    gaps = np.flatnonzero(missing > 0.0)
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else float("nan")
    return {
        "after_s": [float(time_s[k]) for k in gaps],
        "packets": [float(missing[k]) for k in gaps],
        "step_s": [step_s],
    }
