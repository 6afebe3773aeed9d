"""Reads and writes recording folders: recording.toml and one Parquet or CSV file for each stream, ``time_s`` first."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Literal, cast

import numpy as np

from oarlock.recording.session_info import SESSION_KEY, read_session, without_session, write_session
from oarlock.recording.streams import (
    ImuStream,
    OrientationStream,
    ScalarStream,
    ScalarUnit,
    Stream,
    VectorStream,
)
from oarlock.storage.arrays import Floats
from oarlock.storage.csv_cells import plain_columns, write_csv
from oarlock.storage.delimited import ColumnLayout, Dialect, numbers
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import read_manifest, replaced_folder
from oarlock.storage.names import file_names
from oarlock.storage.parquet_table import Texts, read_table, write_table
from oarlock.storage.paths import place_of
from oarlock.storage.suggest import did_you_mean
from oarlock.storage.toml import TomlTable, toml_text
from oarlock.storage.write_file import write_file

FORMAT = 1
INDEX_FILE = "recording.toml"
KIND = "recording"

# field -> (key in units, unit, columns)
_IMU_FIELDS: Mapping[str, tuple[str, str, tuple[str, ...]]] = MappingProxyType(
    {
        "gyro_rad_s": ("gyro", "rad/s", ("gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s")),
        "accel_m_s2": ("accel", "m/s2", ("accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2")),
        "mag_ut": ("mag", "uT", ("mag_x_ut", "mag_y_ut", "mag_z_ut")),
    }
)
_KINDS = ("imu", "scalar", "vector", "orientation")
_VECTOR_COLUMNS = ("x_m", "y_m", "z_m")
_QUATERNION_COLUMNS = ("quat_w", "quat_x", "quat_y", "quat_z")


def write_folder(
    streams: Sequence[Stream],
    meta: Mapping[str, object],
    folder: str | PathLike[str],
    file_format: Literal["parquet", "csv"] = "parquet",
    force: bool = False,
) -> None:
    """Write a recording, in place of the recording that Oarlock wrote into the folder before.

    Args:
        streams: the recording's streams.
        meta: the recording's `meta`.
        folder: created if it does not exist.
        file_format: of the stream files. Both formats are exact.
        force: replace files that are not Oarlock's, too.

    Raises:
        DataError: The folder cannot be written, another process writes into it, a file that is not Oarlock's would be
            replaced, or `meta` contains a value that TOML cannot store. The folder is unchanged then.
    """
    if file_format not in ("parquet", "csv"):
        raise DataError(f'file_format is {file_format!r}; expected "parquet" or "csv"')
    files = file_names([stream.name for stream in streams], file_format)
    session, others = without_session(meta)
    document = {
        "format": FORMAT,
        "stream": [_entry(s, f) for s, f in zip(streams, files, strict=True)],
        "meta": others,
    }
    text = toml_text(document)
    with replaced_folder(folder, KIND, force) as root:
        for stream, file in zip(streams, files, strict=True):
            (write_table if file_format == "parquet" else write_csv)(_columns_of(stream), root / file)
        write_file(root / INDEX_FILE, text)
        write_session(root, session)


def read_folder(path: str | PathLike[str]) -> tuple[list[Stream], Mapping[str, object]]:
    """Read the streams and `meta` of a folder that `write_folder` or a person wrote.

    Args:
        path: the folder, or its recording.toml.

    Raises:
        DataError: A file, column or key is missing or unknown, or a unit is not the required one.
    """
    index = _index_of(path)
    manifest = read_manifest(index.parent)
    top = _read_index(index)
    tables = top.tables("stream")
    streams = [_read_stream(table, index.parent) for table in tables]
    manifest.check([index.name, *(table.string("file") for table in tables)])
    meta = top.table("meta", default={}).values
    session = read_session(index.parent)
    return streams, {**meta, SESSION_KEY: dict(session)} if session else meta


def _index_of(path: str | PathLike[str]) -> Path:
    place = place_of(path)
    return place / INDEX_FILE if place.is_dir() else place


def _read_index(index: Path) -> TomlTable:
    if not index.is_file():
        folder = index.parent if index.name == INDEX_FILE else index
        raise DataError(
            f'{index}: does not exist, so "{folder}" is not a recording. '
            "Create one from sensor files with `oarlock import`, or with Recording.save."
        )
    top = TomlTable.read(index)
    top.check_format(FORMAT)
    top.check_keys({"format", "stream", "meta"})
    return top


def _entry(stream: Stream, file: str) -> dict[str, object]:
    entry: dict[str, object] = {"name": stream.name, "kind": stream.kind, "file": file, "rows": len(stream)}
    if isinstance(stream, ImuStream):
        entry["units"] = {_IMU_FIELDS[f][0]: _IMU_FIELDS[f][1] for f in stream.values}
    elif isinstance(stream, VectorStream):
        entry["units"] = {"value": "m"}
    elif isinstance(stream, ScalarStream) and stream.unit is not None:
        entry["units"] = {"value": stream.unit}
    return entry


def _columns_of(stream: Stream) -> dict[str, Floats]:
    columns = {"time_s": stream.time_s}
    if isinstance(stream, ScalarStream):
        return {**columns, "value": stream.value}
    for field, rows in stream.values.items():
        if isinstance(stream, ImuStream):
            names = _IMU_FIELDS[field][2]
        else:
            names = _VECTOR_COLUMNS if isinstance(stream, VectorStream) else _QUATERNION_COLUMNS
        columns.update({name: rows[:, i] for i, name in enumerate(names)})
    return columns


def _read_stream(table: TomlTable, root: Path) -> Stream:
    table.check_keys({"name", "kind", "file", "rows", "units"})
    name, kind = table.string("name"), table.string("kind")
    units = table.table("units", default={})
    columns = _expected_columns(table, kind, units)
    found = _read_columns(table, root, ["time_s", *(c for group in columns.values() for c in group)])
    rows = table.integer("rows", len(found["time_s"]))
    if rows != len(found["time_s"]):
        raise DataError(
            f'{table.where("rows")}: says {rows} rows, "{table.string("file")}" has {len(found["time_s"])}. '
            "The file was truncated or edited. If the edit is intended, correct the number."
        )
    fields = {f: np.column_stack([found[c] for c in group]) for f, group in columns.items()}
    if kind == "imu":
        return ImuStream(name, found["time_s"], **fields)
    if kind == "vector":
        return VectorStream(name, found["time_s"], fields["value"])
    if kind == "orientation":
        return OrientationStream(name, found["time_s"], fields["quat_wxyz"])
    unit = units.string("value") if "value" in units.values else None
    return ScalarStream(name, found["time_s"], fields["value"][:, 0], cast("ScalarUnit | None", unit))


def _expected_columns(table: TomlTable, kind: str, units: TomlTable) -> dict[str, tuple[str, ...]]:
    """The columns of each field that has a unit in the stream's table."""
    if kind not in _KINDS:
        raise DataError(
            f"{table.where('kind')}: the kind {kind!r} is not known. {did_you_mean(kind, _KINDS)}"
        )
    if kind == "imu":
        units.check_keys({key for key, _, _ in _IMU_FIELDS.values()})
        announced = {f: entry for f, entry in _IMU_FIELDS.items() if entry[0] in units.values}
        for key, unit, _ in announced.values():
            _check_unit(units, key, (unit,))
        if not announced:
            raise DataError(f'{table.where()}: units are empty; expected, e.g., units = {{ gyro = "rad/s" }}')
        return {field: entry[2] for field, entry in announced.items()}
    if kind == "orientation":
        units.check_keys(set())
        return {"quat_wxyz": _QUATERNION_COLUMNS}
    units.check_keys({"value"})
    if kind == "vector":
        _check_unit(units, "value", ("m",))
        return {"value": _VECTOR_COLUMNS}
    if "value" in units.values:
        _check_unit(units, "value", ("m", "rad"))
    return {"value": ("value",)}


def _check_unit(units: TomlTable, key: str, held: tuple[str, ...]) -> None:
    found = units.string(key)
    if found not in held:
        raise DataError(
            f'{units.where(key)}: the unit is "{found}"; a recording folder requires {" or ".join(held)}. '
            "Convert the numbers, or import the file with `oarlock import csv`."
        )


def _read_columns(table: TomlTable, root: Path, names: list[str]) -> dict[str, Floats]:
    """The named columns of the stream's file. Missing and additional columns are errors."""
    given = table.string("file")
    file = place_of(root / given)
    if Path(given).is_absolute() or ".." in Path(given).parts:
        raise DataError(f'{table.where("file")}: "{given}" is not inside the recording\'s folder')
    if not file.is_file():
        raise DataError(f'{table.where("file")}: there is no file "{file}"')
    read = {".parquet": _read_parquet, ".csv": _read_csv}.get(file.suffix)
    if read is None:
        raise DataError(f'{table.where("file")}: "{given}" is neither .parquet nor .csv')
    return read(file, names)


def _check_columns(file: Path, found: list[str], names: list[str]) -> None:
    for name in names:
        if name not in found:
            raise DataError(f'{file}: has no column "{name}". {did_you_mean(name, found)}')
    for name in found:
        if name not in names:
            raise DataError(
                f'{file}: recording.toml does not list the column "{name}". {did_you_mean(name, names)}'
            )


def _read_parquet(file: Path, names: list[str]) -> dict[str, Floats]:
    table = read_table(file)
    _check_columns(file, list(table.columns), names)
    for name in names:
        column = table.columns[name]
        if isinstance(column, Texts) or column.dtype.kind not in "if" or column.ndim > 1:
            kind = "string" if isinstance(column, Texts) else "list" if column.ndim > 1 else column.dtype
            raise DataError(f'{file}: column "{name}" is of type {kind}; expected numbers')
    return {name: table.numbers(name) for name in names}


def _read_csv(file: Path, names: list[str]) -> dict[str, Floats]:
    layout = ColumnLayout.of(file, Dialect())
    _check_columns(file, list(layout.names), names)
    plain = plain_columns(file, layout.names)
    if plain is not None:
        return plain
    wanted = [layout.index(name) for name in names]
    parts: list[list[Floats]] = [[] for _ in names]
    for batch in layout.batches(wanted):
        for position, index in enumerate(wanted):
            parts[position].append(numbers(layout, batch, position, index))
    return {n: np.concatenate(p) if p else np.zeros(0) for n, p in zip(names, parts, strict=True)}
