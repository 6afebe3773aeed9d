"""How the picture of a video moves: the flow of its cells (Lucas and Kanade 1981), reduced to a few courses."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from oarlock.movement.video.reading import Grey, grey_pictures
from oarlock.movement.video.signals import Signals, even_signals, main_courses
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

WIDTH_PX = 128
CELL_PX = 8
BLUR_PX = 1.5
"""The flow is linear in the displacement up to about the width of the blur."""
LEAST_STEP_S = 0.028
"""Above 35 pictures a second every second or third one says as much."""
NOISE_GREY = 3.0
"""Differences below this count as noise: cells without texture give no flow."""
COURSES = 4


def picture_motion(file: Path, told: Callable[[float], None] | None = None) -> Signals:
    """Courses of the picture's motion in video time: four of the flow, and its size.

    A displacement of the whole picture, by a camera that is carried, is removed.

    Args:
        file: the video.
        told: called with the video time, s, of each picture.

    Raises:
        DataError: not a video, too short, or a picture in which nothing moves.
    """
    times, flows = [], []
    before: tuple[float, Grey] | None = None
    for time_s, picture in grey_pictures(file, WIDTH_PX, LEAST_STEP_S):
        smooth = gaussian_filter(picture, BLUR_PX)
        if before is not None:
            # what changed between two pictures happened halfway between them
            times.append(0.5 * (before[0] + time_s))
            flows.append(cell_flow(before[1], smooth) / (time_s - before[0]))
        before = (time_s, smooth)
        if told is not None:
            told(time_s)
    if not flows:
        raise DataError(f"{file}: fewer than two pictures; give a video of at least 4 s")
    return courses_of(np.array(times), np.stack(flows), str(file))


def courses_of(time_s: Floats, flow: Floats, what: str) -> Signals:
    """Courses of a flow (N, cells, 2) in px/s at times (N,)."""
    relative = flow - np.median(flow, axis=1, keepdims=True)
    size = np.sqrt(np.mean(relative**2, axis=(1, 2)))
    if not np.any(size > 0.0):
        raise DataError(f"{what}: nothing moves in the picture; give the offset with --offset-s")
    even = even_signals(time_s, np.column_stack([size, relative.reshape(len(flow), -1)]), what)
    moved = even.values[:, 1:]
    values = np.column_stack([even.values[:, 0], main_courses(moved, min(COURSES, moved.shape[1]))])
    return Signals(even.start_s, np.where(even.valid[:, None], values, 0.0), even.valid)


def cell_flow(first: Grey, second: Grey) -> Floats:
    """Displacement (cells, 2) in px, x right and y down, from one smooth grey picture (H, W) to the next.

    The displacement of the whole picture in whole pixels is found first, so that a quickly turned camera does no harm.
    """
    shift = whole_shift(first, second)
    second = np.roll(second, (-shift[1], -shift[0]), axis=(0, 1))
    gy, gx = np.gradient(0.5 * (first + second))
    gt = second - first
    xx, xy, yy, xt, yt = (_cell_sums(a * b) for a, b in ((gx, gx), (gx, gy), (gy, gy), (gx, gt), (gy, gt)))
    noise = NOISE_GREY**2 * CELL_PX
    xx, yy = xx + noise, yy + noise
    determinant = xx * yy - xy**2
    flow = np.stack([(xy * yt - yy * xt) / determinant, (xy * xt - xx * yt) / determinant], axis=-1)
    return flow.astype(np.float64)


def whole_shift(first: Grey, second: Grey) -> tuple[int, int]:
    """Displacement of the whole picture, whole px right and down, by the phase (Kuglin and Hines 1975)."""
    cross = np.fft.rfft2(second) * np.conj(np.fft.rfft2(first))
    peak = np.fft.irfft2(cross / (np.abs(cross) + 1e-3 * np.abs(cross).mean() + 1e-9), s=first.shape)
    row, column = np.unravel_index(int(np.argmax(peak)), peak.shape)
    height, width = first.shape
    down, right = int(row), int(column)
    return (right - width if right > width // 2 else right, down - height if down > height // 2 else down)


def _cell_sums(values: Grey) -> Floats:
    rows, columns = (size // CELL_PX for size in values.shape)
    cells = values[: rows * CELL_PX, : columns * CELL_PX].reshape(rows, CELL_PX, columns, CELL_PX)
    sums: Floats = cells.sum(axis=(1, 3)).ravel()
    return sums
