"""Checks every array that enters the package: type, shape, finite values, increasing time stamps."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from oarlock.storage.arrays import Floats, Indices
from oarlock.storage.errors import DataError

LEAST_INTERVAL_S = 5e-7
"""Half a microsecond. Loggers count microseconds at best, and float64 keeps stamps of the epoch to 2.4e-7 s, so two
samples of one sensor that are closer have no order that can be trusted."""
_LARGEST_EXACT_INTEGER = 2**53


def real_array(value: ArrayLike, shape: Sequence[int | None], where: str) -> Floats:
    """Read-only float64 copy of a real numeric array, converted without loss.

    Args:
        value: anything numpy reads as an array of floats or integers, in any memory layout. Entries that
            a masked array hides become NaN.
        shape: the expected shape; None stands for any length.
        where: names the array in an error, such as ``stream "back", gyro_rad_s``.

    Returns:
        C-contiguous copy that stands on `bytes`, so that nobody can change it and the engine may read it there.

    Raises:
        DataError: Not a real numeric array, a value that float64 cannot hold exactly, or another shape.
    """
    given = _as_numpy(value, where)
    _check_numeric(given, where)
    _check_shape(given.shape, shape, where)
    if type(given) is np.ndarray and given.dtype == np.float64:
        return _sealed(given)
    # What does not fit is refused below, by its place.
    with np.errstate(over="ignore"):
        result = np.array(given, dtype=np.float64, order="C", copy=True, subok=False)
    _check_exact(given, result, where)
    if isinstance(given, np.ma.MaskedArray):
        result[np.ma.getmaskarray(given)] = np.nan
    return _sealed(result)


def time_array(value: ArrayLike, where: str) -> Floats:
    """Time stamps: read-only (T,) float64 in s, T >= 1, finite and strictly increasing.

    Raises:
        DataError: As `real_array`; no stamp at all; a stamp that is NaN or infinite; unsorted or repeated
            stamps, with index and time.
    """
    time_s = real_array(value, (None,), where)
    if time_s.size == 0:
        raise DataError(f"{where}: has no samples. Leave the stream out.")
    bad = np.flatnonzero(~np.isfinite(time_s))
    if bad.size:
        raise DataError(
            f"{where}[{bad[0]}] is {time_s[bad[0]]:g}; a time stamp must be finite "
            f"({bad.size} of {time_s.size} are not). Remove these samples."
        )
    steps_s = np.diff(time_s)
    late = np.flatnonzero(steps_s <= 0.0)
    if late.size:
        raise DataError(f"{where}{disorder_text(time_s, int(late[0]) + 1)}")
    close = np.flatnonzero(steps_s < LEAST_INTERVAL_S)
    if close.size:
        raise DataError(f"{where}{_too_close_text(steps_s, close)}")
    return time_s


def _too_close_text(steps_s: Floats, close: Indices) -> str:
    first = int(close[0])
    reason = (
        "Are the stamps in another unit? They must be seconds."
        if close.size > steps_s.size // 2
        else "Two stamps of one sample were rounded apart, or samples were stamped when they arrived in a burst: "
        "keep one of them, or use the sensor's own stamps."
    )
    return (
        f"[{first + 1}] is only {steps_s[first]:.3g} s after the stamp before it; the least interval is "
        f"{LEAST_INTERVAL_S:g} s ({close.size} of {steps_s.size} intervals are smaller). {reason}"
    )


def disorder_text(time_s: Floats, index: int) -> str:
    """What is wrong with the stamp at `index`, which is not later than the one before it."""
    here, before = float(time_s[index]), float(time_s[index - 1])
    if here == before:
        return (
            f"[{index}] repeats the stamp {here!r} s. Remove the repeated sample, "
            "or export the time with more digits."
        )
    return (
        f"[{index}] is {here!r} s, earlier than {before!r} s before it. Time stamps must increase: "
        "sort the samples by time, or cut where the clock was reset."
    )


def check_no_infinity(values: Floats, time_s: Floats, where: str) -> None:
    """Refuse +-inf; NaN is a missing value and passes.

    Args:
        values: (T, ...) measured values.
        time_s: (T,) their stamps in s.
        where: names the array in an error.

    Raises:
        DataError: A value is infinite; names index and time.
    """
    bad = np.argwhere(np.isinf(values))
    if len(bad):
        index = ", ".join(str(i) for i in bad[0])
        raise DataError(
            f"{where}[{index}] is {values[tuple(bad[0])]:g} at {time_s[bad[0][0]]:g} s "
            f"({len(bad)} infinite values). Use NaN for a missing value."
        )


def _sealed(values: Floats) -> Floats:
    """The same numbers in memory that nothing can write to, not even through `base`."""
    if not values.size:  # numpy reads no array from an empty buffer
        empty = np.empty(values.shape, values.dtype)
        empty.setflags(write=False)
        return empty
    return np.frombuffer(values.tobytes(), values.dtype).reshape(values.shape)


def _as_numpy(value: ArrayLike, where: str) -> NDArray[Any]:
    try:
        return np.asanyarray(value)
    except (ValueError, TypeError, RuntimeError) as error:
        raise DataError(
            f"{where}: cannot be read as an array ({error}). "
            "Give rows of equal length, and NaN where a value is missing."
        ) from error


def _check_numeric(given: NDArray[Any], where: str) -> None:
    if given.dtype.kind in "fiu":
        return
    hint = {
        "c": "Take the real part, if that is what was measured.",
        "O": "Give floats or integers, with NaN instead of None.",
        "M": "Give seconds as floats: (t - t[0]) / np.timedelta64(1, 's').",
        "m": "Give seconds as floats: dt / np.timedelta64(1, 's').",
    }.get(given.dtype.kind, "Give floats or integers.")
    raise DataError(f"{where}: has dtype {given.dtype}, which is not real and numeric. {hint}")


def _check_shape(found: tuple[int, ...], shape: Sequence[int | None], where: str) -> None:
    if len(found) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, found, strict=True)
    ):
        return
    wanted = (
        "(" + ", ".join("T" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
    )
    hint = ""
    if len(found) == 2 and len(shape) == 2 and found[0] == shape[1]:
        hint = " Transpose it."
    raise DataError(f"{where}: has shape {found}, expected {wanted}.{hint}")


def _check_exact(given: NDArray[Any], result: Floats, where: str) -> None:
    if given.dtype.kind == "f" and given.dtype.itemsize <= 8:
        return
    plain, seen = np.asarray(given), ~np.ma.getmaskarray(given)
    if given.dtype.kind == "f":
        inexact = np.argwhere((result.astype(plain.dtype) != plain) & ~np.isnan(plain) & seen)
    else:
        large = np.argwhere(((plain > _LARGEST_EXACT_INTEGER) | (plain < -_LARGEST_EXACT_INTEGER)) & seen)
        inexact = np.array([i for i in large if int(plain[tuple(i)]) != int(result[tuple(i)])])
    if len(inexact):
        index = tuple(int(i) for i in inexact[0])
        raise DataError(
            f"{where}{list(index)} = {plain[index]!s} ({given.dtype}) cannot be held exactly by float64. "
            "Subtract an offset first, or round it yourself with .astype(np.float64)."
        )
