"""Tracks of positions cut near their start and end, which may be somebody's home.

A circle about the start itself would give the start away as its centre (Hassan et al. 2018, Analysis of privacy
protections in fitness tracking social networks). So the circle is moved by a secret distance and is wider.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

EARTH_RADIUS_M = 6_371_008.8
"""Mean radius (IUGG)."""
CUT_FILES = (".csv", ".tsv", ".txt", ".tcx", ".xml", ".fit")
"""Exports, in which `GpsCut.file` looks for positions; recordings and results have none."""
_PREFIX = r"^\W*(?:gps|start|end|position)?[\W_]*"
_LATITUDE = re.compile(_PREFIX + r"lat(?:itude)?(?![a-z])", re.IGNORECASE)
_LONGITUDE = re.compile(_PREFIX + r"(?:lng|lon|long|longitude)(?![a-z])", re.IGNORECASE)
_POINT = re.compile(
    rb"<Position>\s*<LatitudeDegrees>([^<]*)</LatitudeDegrees>\s*<LongitudeDegrees>([^<]*)</LongitudeDegrees>\s*</Position>"
)
_WIDER = 1.5


def far_from_ends(latitude_deg: Floats, longitude_deg: Floats, cut_m: float, secret: bytes = b"") -> Bools:
    """Which positions of a track may be shown, (T,); False where there is none.

    Args:
        latitude_deg: (T,), NaN where there is none.
        longitude_deg: (T,), NaN where there is none.
        cut_m: positions nearer than this to the first or the last one are cut; so are some up to twice as far.
        secret: from which the centres of the circles are moved; the same for all tracks of an athlete.
    """
    latitude_deg, longitude_deg = np.asarray(latitude_deg, float), np.asarray(longitude_deg, float)
    far = np.isfinite(latitude_deg) & np.isfinite(longitude_deg)
    for name, end in zip((b"start", b"end"), np.flatnonzero(far)[[0, -1]] if far.any() else (), strict=False):
        # On the tangent plane, which some kilometres away is wrong by less than 1 m.
        north_m = EARTH_RADIUS_M * np.radians(latitude_deg - latitude_deg[end])
        turned_deg = (longitude_deg - longitude_deg[end] + 180.0) % 360.0 - 180.0
        east_m = EARTH_RADIUS_M * np.radians(turned_deg) * np.cos(np.radians(latitude_deg[end]))
        if secret:
            digest = hashlib.sha256(secret + name).digest()
            share, angle = (int.from_bytes(part, "big") / 2.0**64 for part in (digest[:8], digest[8:16]))
            move_m, angle_rad = cut_m * (_WIDER - 1.0) * share**0.5, 2.0 * np.pi * angle
            north_m, east_m = north_m - move_m * np.cos(angle_rad), east_m - move_m * np.sin(angle_rad)
        far &= ~(np.hypot(north_m, east_m) <= cut_m * _WIDER)
    return far


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
        return (self._xml if name.endswith((".tcx", ".xml")) else self._csv)(contents, where)

    def _far(self, positions: Sequence[Sequence[str]], where: str) -> Bools:
        degrees = np.array([[_degrees(text) for text in position] for position in positions]).reshape(-1, 2)
        if (np.abs(degrees) > 360.0).any():
            raise DataError(f"{where}: its positions are not in degrees, so they cannot be cut")
        return far_from_ends(degrees[:, 0], degrees[:, 1], self.cut_m, self.secret)

    def _xml(self, contents: bytes, where: str) -> bytes:
        points = [[text.decode("ascii", "replace") for text in pair] for pair in _POINT.findall(contents)]
        if len(points) != contents.count(b"<Position>"):
            raise DataError(f"{where}: has positions that cannot be read, so they cannot be cut")
        far = iter(self._far(points, where))
        return _POINT.sub(lambda point: point[0] if next(far) else b"", contents)

    def _csv(self, contents: bytes, where: str) -> bytes:
        lines = contents.decode("utf-8", "surrogateescape").splitlines(keepends=True)
        if (head := _header(lines)) is None:
            return contents
        first, split, columns = head
        rows = [(k, next(csv.reader([lines[k]], delimiter=split), [])) for k in range(first + 1, len(lines))]
        for pair in columns:
            whole = [(k, cells) for k, cells in rows if len(cells) > max(pair)]
            far = self._far([[cells[column] for column in pair] for _, cells in whole], where)
            for (k, cells), is_far in zip(whole, far, strict=True):
                if not is_far:
                    cells[pair[0]] = cells[pair[1]] = ""
                    text = io.StringIO()
                    ending = lines[k][len(lines[k].rstrip("\r\n")) :]
                    csv.writer(text, delimiter=split, lineterminator=ending).writerow(cells)
                    lines[k] = text.getvalue()
        return "".join(lines).encode("utf-8", "surrogateescape")


def _header(lines: Sequence[str]) -> tuple[int, str, list[tuple[int, int]]] | None:
    """The line of the columns' names, what separates them, and the columns of latitude and longitude."""
    for k, line in enumerate(lines):
        for split in (",", ";", "\t"):
            if pairs := _pairs(next(csv.reader([line], delimiter=split), [])):
                return k, split, pairs
    return None


def _pairs(names: Sequence[str]) -> list[tuple[int, int]]:
    columns = [[k for k, name in enumerate(names) if kind.search(name)] for kind in (_LATITUDE, _LONGITUDE)]
    return list(zip(*columns, strict=False))


def _degrees(text: str) -> float:
    try:
        return float(text.strip().replace(",", "."))
    except ValueError:
        return float("nan")
