"""Compares a gyroscope's rate with the rotation of gravity in the accelerometer, to find a wrong unit (deg/s)."""

import numpy as np

from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats

# Accelerations of the body average out over this time, while gravity still rotates visibly.
SMOOTHING_S = 0.25
# The accelerometer points along gravity only where |accel| is near its median.
NEAR_REST = 0.15
LEAST_ROWS = 50
# Below this rate, accelerometer noise would dominate.
LEAST_TURN_PER_S = 0.05
LEAST_CORRELATION = 0.8


def gyro_per_gravity_turn(stream: ImuStream) -> float | None:
    """Ratio of the gyroscope's rate to the rotation rate of gravity in the accelerometer: 1 if both units are correct.

    In sensor axes a direction u that is fixed in the world changes by -gyro x u. Least squares compares the change of
    the accelerometer's direction over a quarter of a second with the mean of that product.

    Args:
        stream: an inertial unit; unit and sign of its accelerometer have no effect.

    Returns:
        The ratio, near 57.3 for a gyroscope in deg/s. None if it cannot be determined: a quantity is absent, there is
        little motion, or accelerations mask gravity.
    """
    if stream.gyro_rad_s is None or stream.accel_m_s2 is None:
        return None
    # Rows of another quantity, such as a magnetometer with a rate of its own, are no gaps.
    both = np.logical_or.reduce(np.isfinite(np.hstack([stream.gyro_rad_s, stream.accel_m_s2])), axis=1)
    stream = stream if np.all(both) or np.sum(both) < LEAST_ROWS else stream.at_rows(both)
    if stream.gyro_rad_s is None or stream.accel_m_s2 is None or len(stream) < LEAST_ROWS:
        return None
    width = max(2, round(SMOOTHING_S * stream.rate_hz))
    norm = row_norms(stream.accel_m_s2)
    there = norm[np.isfinite(norm)]
    if len(norm) <= 2 * width or not there.size or (middle := float(np.median(there))) == 0.0:
        return None
    direction = stream.accel_m_s2 / np.where(norm > 0.0, norm, np.nan)[:, None]
    at_rest = np.abs(norm / middle - 1.0) < NEAR_REST
    duration_s = (stream.time_s[width:] - stream.time_s[:-width])[:, None]
    seen = (direction[width:] - direction[:-width]) / duration_s
    told = _running_mean(_cross(direction, stream.gyro_rad_s), width)
    usable = at_rest[width:] & at_rest[:-width] & np.isfinite(seen + told).all(axis=1)
    return _slope(seen[usable], told[usable])


def row_norms(rows: Floats) -> Floats:
    """Norm of each row: (T,) of (T, 3)."""
    lengths: Floats = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    return lengths


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product row by row; faster than `numpy.cross`, which handles arbitrary axes."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _running_mean(rows: Floats, width: int) -> Floats:
    """Mean over each `width` steps by the trapezoid rule; NaN only where one of these steps is NaN."""
    middle = 0.5 * (rows[1:] + rows[:-1])
    gone = np.isnan(middle)
    if not gone.any():
        sums = np.cumsum(np.vstack([np.zeros((1, 3)), middle]), axis=0)
        return np.asarray((sums[width:] - sums[:-width]) / width)
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), np.where(gone, 0.0, middle)]), axis=0)
    holes = np.cumsum(np.vstack([np.zeros((1, 3)), gone]), axis=0)
    mean = (sums[width:] - sums[:-width]) / width
    return np.where(holes[width:] > holes[:-width], np.nan, mean)


def _slope(seen: Floats, told: Floats) -> float | None:
    """Least-squares ratio told / seen; None if either is too small or their correlation is too low."""
    if len(seen) < LEAST_ROWS or float(np.sqrt((seen**2).mean())) < LEAST_TURN_PER_S:
        return None
    product, seen_squared, told_squared = (
        float((a * b).sum()) for a, b in ((seen, told), (seen, seen), (told, told))
    )
    if told_squared == 0.0 or product / np.sqrt(seen_squared * told_squared) < LEAST_CORRELATION:
        return None
    return told_squared / product
