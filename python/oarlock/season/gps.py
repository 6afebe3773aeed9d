"""Tracks of positions cut near their start and end, which may be somebody's home.

A circle about the start itself would give the start away as its centre (Hassan et al. 2018, Analysis of privacy
protections in fitness tracking social networks). So the circle is moved by a secret distance and is wider.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

from oarlock.season.arrow_table import read_table
from oarlock.storage.errors import DataError

EARTH_RADIUS_M = 6_371_008.8
"""Mean radius (IUGG)."""
CUT_FILES = (".parquet", ".csv", ".tsv", ".txt", ".tcx", ".gpx", ".xml", ".fit")
"""Files in which `GpsCut.file` looks for positions."""
_PREFIX = r"^\W*(?:gps|start|end|position)?[\W_]*"
_LATITUDE = re.compile(_PREFIX + r"lat(?:itude)?(?![a-z])", re.IGNORECASE)
_LONGITUDE = re.compile(_PREFIX + r"(?:lng|lon|long|longitude)(?![a-z])", re.IGNORECASE)
_POINT = re.compile(
    rb"<Position>\s*<LatitudeDegrees>([^<]*)</LatitudeDegrees>\s*<LongitudeDegrees>([^<]*)</LongitudeDegrees>\s*</Position>"
)
_GPX_POINT = re.compile(rb'<(?:trkpt|rtept|wpt)\s+lat="([^"]*)"\s+lon="([^"]*)"')
_WIDER = 1.5


def kept_positions(
    latitude_deg: NDArray[np.float64], longitude_deg: NDArray[np.float64], cut_m: float, secret: bytes = b""
) -> NDArray[np.bool_]:
    """Which positions of a track may be shown, (T,); False where there is none.

    Args:
        latitude_deg: (T,), NaN where there is none.
        longitude_deg: (T,), NaN where there is none.
        cut_m: positions nearer than this to the first or the last one are cut; so are some up to twice as far.
        secret: from which the centres of the circles are moved; the same for all tracks of an athlete.
    """
    latitude_deg, longitude_deg = np.asarray(latitude_deg, float), np.asarray(longitude_deg, float)
    known = np.isfinite(latitude_deg) & np.isfinite(longitude_deg)
    if not known.any():
        return known
    first, last = np.flatnonzero(known)[[0, -1]]
    kept = known.copy()
    for name, at in ((b"start", first), (b"end", last)):
        north_m, east_m = _metres(latitude_deg, longitude_deg, at)
        move_m, angle_rad = _moved(secret, cut_m * (_WIDER - 1.0), name)
        distance_m = np.hypot(north_m - move_m * np.cos(angle_rad), east_m - move_m * np.sin(angle_rad))
        kept &= ~(distance_m <= cut_m * _WIDER)
    return kept


@dataclass(frozen=True)
class GpsCut:
    """Cuts the positions of files."""

    cut_m: float
    secret: bytes = b""

    def __post_init__(self) -> None:
        if not 0.0 < self.cut_m < 100_000.0:
            raise DataError(
                f"positions are cut by {self.cut_m:g} m; expected 1 to 100000. Is the unit right?"
            )

    def file(self, contents: bytes, where: str) -> bytes:
        """The file without the positions near start and end."""
        name = where.lower()
        if name.endswith(".fit"):
            raise DataError(f"{where}: positions in FIT files are not cut; export it as TCX or CSV first")
        if name.endswith(".parquet"):
            return self._parquet(contents, where)
        if name.endswith((".tcx", ".gpx", ".xml")):
            return self._xml(contents, where)
        return self._table(contents, where)

    def _kept(self, cells: Sequence[tuple[str, str]], where: str) -> NDArray[np.bool_]:
        degrees = np.array([(_degrees(first), _degrees(second)) for first, second in cells]).reshape(-1, 2)
        if (np.abs(degrees) > 360.0).any():
            raise DataError(f"{where}: its positions are not in degrees, so they cannot be cut")
        return kept_positions(degrees[:, 0], degrees[:, 1], self.cut_m, self.secret)

    def _xml(self, contents: bytes, where: str) -> bytes:
        if _GPX_POINT.search(contents):
            raise DataError(f"{where}: positions in GPX files are not cut; export it as TCX or CSV first")
        points = [
            (one[1].decode("ascii", "replace"), one[2].decode("ascii", "replace"))
            for one in _POINT.finditer(contents)
        ]
        if len(points) != contents.count(b"<Position>"):
            raise DataError(f"{where}: has positions that cannot be read, so they cannot be cut")
        kept = iter(self._kept(points, where))
        return _POINT.sub(lambda one: one[0] if next(kept) else b"", contents)

    def _parquet(self, contents: bytes, where: str) -> bytes:
        pairs = list(_pairs(read_table(contents, where=where, without_lists=True).column_names))
        if not pairs:
            return contents
        table = read_table(contents, "; positions beside lists are not cut", where)
        for pair in pairs:
            degrees = [table.column(k).cast(pa.float64()).to_numpy() for k in pair]
            kept = kept_positions(degrees[0], degrees[1], self.cut_m, self.secret)
            for k in pair:
                missing = pa.scalar(float("nan"), table.schema.field(k).type)
                column = pc.if_else(pa.array(kept), table.column(k), missing)
                table = table.set_column(k, table.schema.field(k), column)
        sink = pa.BufferOutputStream()
        parquet.write_table(table, sink)
        return bytes(sink.getvalue().to_pybytes())

    def _table(self, contents: bytes, where: str) -> bytes:
        text = contents.decode("utf-8", "surrogateescape")
        lines = text.splitlines(keepends=True)
        head = _header(lines)
        if head is None:
            return contents
        at, split, columns = head
        rows = [(k, next(csv.reader([lines[k]], delimiter=split), [])) for k in range(at + 1, len(lines))]
        for latitude, longitude in columns:
            shown = [(k, cells) for k, cells in rows if len(cells) > max(latitude, longitude)]
            kept = self._kept([(cells[latitude], cells[longitude]) for _, cells in shown], where)
            for (k, cells), is_kept in zip(shown, kept, strict=True):
                if not is_kept:
                    cells[latitude] = cells[longitude] = ""
                    lines[k] = _line(cells, split) + _ending(lines[k])
        return "".join(lines).encode("utf-8", "surrogateescape")


def _metres(
    latitude_deg: NDArray[np.float64], longitude_deg: NDArray[np.float64], at: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """North and east of one position; on the tangent plane, which some kilometres away is wrong by less than 1 m."""
    north_rad = np.radians(latitude_deg - latitude_deg[at])
    turned = (longitude_deg - longitude_deg[at] + 180.0) % 360.0 - 180.0
    east_rad = np.radians(turned) * np.cos(np.radians(latitude_deg[at]))
    return EARTH_RADIUS_M * north_rad, EARTH_RADIUS_M * east_rad


def _moved(secret: bytes, most_m: float, name: bytes) -> tuple[float, float]:
    """How far a centre is moved, m, and where to, rad."""
    if not secret:
        return 0.0, 0.0
    digest = hashlib.sha256(secret + name).digest()
    share, angle = (int.from_bytes(part, "big") / 2.0**64 for part in (digest[:8], digest[8:16]))
    return most_m * share**0.5, 2.0 * np.pi * angle


def _header(lines: Sequence[str]) -> tuple[int, str, list[tuple[int, int]]] | None:
    """The line of the columns' names, what separates them, and the columns of latitude and longitude."""
    for at, line in enumerate(lines):
        for split in (",", ";", "\t"):
            cells = next(csv.reader([line], delimiter=split), [])
            pairs = list(_pairs(cells))
            if pairs:
                return at, split, pairs
    return None


def _pairs(cells: Sequence[str]) -> Iterator[tuple[int, int]]:
    latitudes = [k for k, cell in enumerate(cells) if _LATITUDE.search(cell)]
    longitudes = [k for k, cell in enumerate(cells) if _LONGITUDE.search(cell)]
    yield from zip(latitudes, longitudes, strict=False)


def _degrees(text: str) -> float:
    try:
        return float(text.strip().replace(",", "."))
    except ValueError:
        return float("nan")


def _line(cells: Sequence[str], split: str) -> str:
    out = io.StringIO()
    csv.writer(out, delimiter=split, lineterminator="").writerow(cells)
    return out.getvalue()


def _ending(line: str) -> str:
    return line[len(line.rstrip("\r\n")) :]
