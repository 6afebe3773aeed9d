"""Quintic smoothing spline with maximum-likelihood smoothness, to fill gaps in marker trajectories."""

from __future__ import annotations

from typing import Final

import numpy as np

from oarlock.storage.arrays import Floats

_SHARES: Final = np.logspace(-13, 3, 97)
"""Range of the noise variance relative to the largest variance of the spline: from rounding errors to a parabola."""


def smoothed_at(time_s: Floats, value: Floats, at_s: Floats) -> tuple[Floats, Floats]:
    """The smoothing spline through (T, c) noisy values, read at other stamps: (N, c), and its standard deviation (N,).

    It minimises the squared distance to the points plus a multiple of the integral of its squared third derivative.
    This is the best estimate of a path with white jerk that is measured with white noise. The multiple is the same for
    all columns and maximises the restricted likelihood, so the spline meets exact points and passes between noisy ones.
    The standard deviation is that of this estimate.

    Source: G. Wahba 1985, "A comparison of GCV and GML for choosing the smoothing parameter in the generalized spline
    smoothing problem", Annals of Statistics 13; the random path: G. Wahba 1978, J. R. Statist. Soc. B 40.

    Args:
        time_s: (T,) stamps, increasing, at least 4.
        value: (T, c).
        at_s: (N,) time stamps inside the range.
    """
    origin, span = time_s[0], time_s[-1] - time_s[0]
    t, at = (time_s - origin) / span, (at_s - origin) / span
    kernel, level = _kernel(t, t), value.mean(axis=0)
    own, rest = np.split(np.linalg.qr(_parabola(t), mode="complete")[0], [3], axis=1)
    size, shapes = np.linalg.eigh(rest.T @ kernel @ rest)
    heights = shapes.T @ rest.T @ (value - level)
    noise = _noise(size, heights)
    # weight of each point in each interpolated value
    bend = rest @ shapes @ ((shapes.T @ rest.T) / (size + noise)[:, None])
    bent = (kernel + noise * np.eye(len(t))) @ bend
    trend = np.linalg.solve(own.T @ _parabola(t), own.T @ (np.eye(len(t)) - bent))
    reading, near = _kernel(at, t), _parabola(at) @ trend
    share = near + reading @ bend
    drive = float(np.mean(heights**2 / (size + noise)[:, None]))
    spread = at**5 / 20.0 - 2.0 * np.sum(share * reading, axis=1)
    spread = spread + np.einsum("ni,ij,nj->n", share, kernel + noise * np.eye(len(t)), share)
    return np.asarray(level + share @ (value - level)), np.sqrt(np.maximum(drive * spread, 0.0))


def _parabola(t: Floats) -> Floats:
    return np.stack([np.ones_like(t), t, t * t], axis=1)


def _kernel(t: Floats, s: Floats) -> Floats:
    """Covariance of a path whose third derivative is white, at rest at 0: the integral of (t-u)^2 (s-u)^2 / 4."""
    a = np.minimum(t[:, None], s)
    apart = np.abs(t[:, None] - s)
    return np.asarray(a**3 * (a * a / 5.0 + a * apart / 2.0 + apart * apart / 3.0) / 4.0)


def _noise(size: Floats, heights: Floats) -> float:
    """The noise variance relative to the kernel that maximises the restricted likelihood."""
    candidates = _SHARES * float(size.max())
    total = np.maximum(size, 0.0) + candidates[:, None]
    squares = (np.sum(heights**2, axis=1) / total).sum(axis=1)
    count, columns = heights.shape
    cost = columns * (count * np.log(np.maximum(squares, 1e-300)) + np.log(total).sum(axis=1))
    return float(candidates[int(np.argmin(cost))])
