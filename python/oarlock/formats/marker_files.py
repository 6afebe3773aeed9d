"""`load_markers`: reads marker trajectories from C3D, TRC, CSV, and exports of Vicon Nexus and Qualisys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from oarlock.evaluation.markers.trajectories import Markers, NamedAxes
from oarlock.formats.c3d import read_c3d
from oarlock.formats.marker_csv import read_marker_csv
from oarlock.formats.trc import read_trc
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.units import LENGTH, plain_unit, unknown_unit_text

ENDINGS = (".c3d", ".trc", ".csv", ".tsv", ".txt")


def load_markers(
    path: str | PathLike[str],
    unit: str | None = None,
    names: Iterable[str] | Mapping[str, str] | None = None,
    *,
    axes: NamedAxes | ArrayLike | None = None,
) -> Markers:
    """Read marker trajectories.

    Args:
        path: `.c3d` (needs the extra `oarlock[c3d]`), `.trc`, or a text table `.csv`, `.tsv`, `.txt`: columns `time`,
            `name_x`, `name_y`, `name_z`, or an export of Vicon Nexus (Trajectories) or Qualisys (TSV).
        unit: unit of length, `m`, `cm` or `mm`, instead of that in the file; required if the file names none.
        names: markers to read; None reads all; a mapping `{name in the file: new name}` renames them. A subject's
            prefix (`Anna:LELB`) may be left out and is removed from the result, unless two names would become equal.
        axes: rotates the points, see `Markers.turned`; None keeps the file's axes.

    Returns:
        Positions in m, NaN where a marker was not visible: in C3D a negative residual, or all three coordinates 0 or
        NaN; in text an empty cell or NaN. Time stamps are those of the file; in C3D they count from the number of the
        first frame.

    Raises:
        DataError: the file cannot be read or understood; the text names the place and a remedy.
    """
    file = place_of(path)
    if not file.is_file():
        raise DataError(f"{file}: there is no such file")
    markers = _read(file, _checked_unit(unit))
    chosen = markers if names is None else markers.select(_full_names(markers, names))
    return chosen if axes is None else chosen.turned(axes)


def _read(file: Path, unit: str | None) -> Markers:
    ending = file.suffix.lower()
    if ending == ".c3d":
        return read_c3d(file, unit)
    if ending == ".trc":
        return read_trc(file, unit)
    if ending in ENDINGS:
        return read_marker_csv(file, unit)
    raise DataError(f'{file}: markers are not read from "{ending}" files. Known: {", ".join(ENDINGS)}.')


def _checked_unit(unit: str | None) -> str | None:
    if unit is None:
        return None
    if plain_unit(unit) not in LENGTH:
        raise DataError(f"load_markers: {unknown_unit_text(unit, LENGTH)}")
    return plain_unit(unit)


def _full_names(markers: Markers, names: Iterable[str] | Mapping[str, str]) -> dict[str, str]:
    """The requested names with the prefixes of the file, and the names in the result."""
    chosen = dict(names) if isinstance(names, Mapping) else {name: name for name in names}
    found = {}
    for name, wanted in chosen.items():
        plain = name if name in markers.names else name.rpartition(":")[2]
        if plain not in markers.names:
            raise DataError(f'markers: the file has no "{name}". {did_you_mean(name, markers.names)}')
        found[plain] = wanted if isinstance(names, Mapping) else name
    return found
