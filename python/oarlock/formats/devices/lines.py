"""Reads our own line protocol, for units that somebody built: one line a sample, as text from a serial port or by UDP.

``t_us,seq,ax,ay,az,gx,gy,gz,mx,my,mz``: microseconds since the unit was switched on, a count of samples, m/s2, rad/s,
uT. Without magnetometer a line ends after ``gz``; where it has no new reading its fields are empty.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

import numpy as np

from oarlock.formats.counters import lost_packets, probable_modulus, unwrapped
from oarlock.formats.listing import FileMatch, ListedFile, Listing
from oarlock.recording.epoch import CLOCK_KEY
from oarlock.recording.packets import META_KEY
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import LEAST_INTERVAL_S
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.regular_file import read_bytes

HEADER = "t_us,seq,ax,ay,az,gx,gy,gz,mx,my,mz"
SHORT_HEADER = HEADER.removesuffix(",mx,my,mz")
_WIDTHS = (len(SHORT_HEADER.split(",")), len(HEADER.split(",")))
_LONGEST_LINE = 4096
_CLOCK_WRAPS = 2.0**32
_LARGEST = 2.0**53
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_LOOKED_AT = 20


def read_lines(path: str | PathLike[str]) -> Recording:
    """Read a file of the line protocol.

    Lines that are no sample are left out and counted: a port is opened in the middle of a line, and bytes get lost. So
    are samples that come late or twice. The microseconds may wrap at 2^32, the count at 2^8, 2^16, 2^24 or 2^32.

    Args:
        path: the file of one unit. A first line with the names of the columns is optional.

    Returns:
        One `ImuStream`, named after the file; lost samples by the count are in ``meta["packets"]``.

    Raises:
        DataError: the file has no sample, or more damaged lines than samples.
    """
    file = place_of(path)
    rows, damaged = _samples(file)
    kept, late, wraps_at = _in_order(rows)
    rows, places = rows[kept], [f"{file}: sample {number + 1}" for number in kept]
    time_us = rows[:, 0]
    if time_us.max() < _CLOCK_WRAPS:
        time_us = unwrapped(time_us, _CLOCK_WRAPS, places)
    time_s = time_us / 1e6
    if (np.diff(time_s) < LEAST_INTERVAL_S).any():
        row = int(np.argmin(np.diff(time_s))) + 1
        raise DataError(
            f"{places[row]}: t_us is {rows[row, 0]:.0f} after {rows[row - 1, 0]:.0f}; the unit was started again, "
            "or its time is not in microseconds. Cut the file there"
        )
    count = unwrapped(rows[:, 1], wraps_at, places) if wraps_at else rows[:, 1]
    name = "_".join(file.stem.lower().split()) or "imu"
    notes = [f"{number:,} {what} left out." for number, what in _left_out(damaged, late) if number]
    source = {"format": "lines", "file": file.name, "notes": notes}
    packets = {META_KEY: {name: lost_packets(count, time_s, places)}} if len(rows) > 1 else {}
    return Recording(
        [_stream(name, time_s, rows)], {"source": source, CLOCK_KEY: {"kind": "relative"}, **packets}
    )


def find_lines(listing: Listing) -> list[FileMatch]:
    """Each file with the names of the columns, or with samples that are counted one by one, is a recording."""
    return [
        FileMatch("lines", file.path, (file.path,), file.path.stem, "one unit, line protocol t_us,seq,ax..mz")
        for file in listing.files
        if _looks_like_lines(file)
    ]


def _looks_like_lines(file: ListedFile) -> bool:
    """A head of whole samples, or all but the first of them, whose counts go up by one."""
    lines = [line.strip() for line in file.lines[: _LOOKED_AT + 1]]
    if lines and lines[0].replace(" ", "") in (HEADER, SHORT_HEADER):
        return True
    found = [sample for line in lines[1:] if (sample := sample_of(line.encode())) is not None]
    if len(found) < 2 or len(found) < len(lines) - 1:
        return False
    steps = np.diff([sample[:2] for sample in found], axis=0)
    return bool((steps[:, 1] == 1).all() and (steps[:, 0] >= 100).all())


def _samples(file: Path) -> tuple[Floats, int]:
    """(T, 11) numbers of the samples in the order of the file, and how many other lines there are."""
    content = read_bytes(file).removeprefix(_BYTE_ORDER_MARK)
    lines = [line for line in content.replace(b"\r", b"\n").split(b"\n") if line.strip()]
    if lines and lines[0].replace(b" ", b"").decode("ascii", "replace") in (HEADER, SHORT_HEADER):
        del lines[0]
    found = [sample for line in lines if (sample := sample_of(line)) is not None]
    damaged = len(lines) - len(found)
    if not found or damaged > len(found):
        raise DataError(
            f"{file}: {len(found)} of {len(lines)} lines are samples of the line protocol, such as "
            '"2500,1,0.1,0,9.8,0,0,0.02,20,0,-40" (microseconds, count, m/s2, rad/s, uT)'
        )
    return np.array(found), damaged


def sample_of(line: bytes) -> list[float] | None:
    """The numbers of a line in the order of `HEADER`, NaN where it has none; None if it is no sample."""
    cells = line.split(b",")
    if len(cells) not in _WIDTHS or len(line) > _LONGEST_LINE:
        return None
    try:
        stamps = [float(int(cell)) for cell in cells[:2]]
        values = [float(cell) if cell.strip() else math.nan for cell in cells[2:]]
    except (ValueError, OverflowError):
        return None
    if not all(0.0 <= stamp < _LARGEST for stamp in stamps) or any(math.isinf(value) for value in values):
        return None
    return stamps + values + [math.nan] * (_WIDTHS[1] - len(cells))


def _in_order(rows: Floats) -> tuple[list[int], int, float | None]:
    """Indices of the samples whose count is later than that of all before, how many are not, and where it wraps."""
    count = rows[:, 1]
    wraps_at = probable_modulus(count)
    kept, last = [0], count[0]
    for index, value in enumerate(count[1:].tolist(), 1):
        step = value - last if wraps_at is None else (value - last) % wraps_at
        if step > 0.0 and (wraps_at is None or step < 0.5 * wraps_at):
            kept.append(index)
            last = value
    return kept, len(rows) - len(kept), wraps_at


def _left_out(damaged: int, late: int) -> tuple[tuple[int, str], ...]:
    return (damaged, "lines are no whole samples and were"), (late, "samples came late or twice and were")


def _stream(name: str, time_s: Floats, rows: Floats) -> ImuStream:
    fields = {"accel_m_s2": rows[:, 2:5], "gyro_rad_s": rows[:, 5:8], "mag_ut": rows[:, 8:11]}
    return ImuStream(name, time_s, **{key: v for key, v in fields.items() if not np.isnan(v).all()})
