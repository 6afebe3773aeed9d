"""Magnetometers in arbitrary units ("a.u."): one unit's readings scaled to a nominal field. For readers of devices."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats

ARBITRARY = "a.u."
"""How mapping files name the unit."""

NOMINAL_FIELD_UT = 50.0
"""Total intensity of the earth's field at middle latitudes; 22 to 67 uT over the earth (World Magnetic Model)."""

SCALE_KEY = "mag_scale"
"""`Recording.meta[SCALE_KEY][stream]` is the factor, uT per unit of the file."""


def scaled_mag(mag: ArrayLike, name: str = "") -> tuple[Floats | None, str]:
    """The readings in uT, on the assumption that the median of their norms is `NOMINAL_FIELD_UT`.

    Only the direction of such readings is measured: the local field is found by `oarlock calibrate field`.

    Args:
        mag: (T, 3) readings in any unit; NaN = missing.
        name: of the stream, for the note.

    Returns:
        (T, 3) readings in uT, None if there is none or all are zero, and one sentence for the reader. `mag_factor`
        gives the factor that was used.
    """
    rows = real_array(mag, (None, 3), f"{name or 'magnetometer'}, readings in arbitrary units")
    told = f"{name}: " if name else ""
    factor = mag_factor(rows)
    if factor is None:
        return None, f"{told}the magnetometer has no reading other than zero and was left out."
    with np.errstate(over="ignore"):  # a stream refuses infinite readings by name
        mag_ut = rows * factor
    return mag_ut, (
        f"{told}the magnetometer is in arbitrary units; the median of its norms was set to "
        f"{NOMINAL_FIELD_UT:g} uT (1 unit = {factor:.4g} uT). Run `oarlock calibrate field` for the local field."
    )


def mag_factor(mag: ArrayLike) -> float | None:
    """The factor of `scaled_mag`, uT per unit; None without a reading other than zero."""
    rows = np.asarray(mag, dtype=np.float64)
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(rows[np.isfinite(rows).all(axis=1)], axis=1)
        middle = np.median(norms) if norms.size else np.float64(0.0)
        factor = float(NOMINAL_FIELD_UT / middle) if middle > 0.0 else np.inf
    return factor if 0.0 < factor < np.inf else None


def scale_meta(magnetometers: Mapping[str, ArrayLike | None]) -> Mapping[str, object]:
    """The entry of `Recording.meta` for streams by name with their readings in arbitrary units; empty without any."""
    factors = {name: mag_factor(mag) for name, mag in magnetometers.items() if mag is not None}
    known = {name: factor for name, factor in factors.items() if factor is not None}
    return MappingProxyType({SCALE_KEY: known} if known else {})
