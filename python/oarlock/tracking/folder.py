"""Reads and writes a track's folder: track.parquet, sensors.parquet, beliefs.parquet, model.toml and run.toml."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from oarlock._core import Model
from oarlock.recording.calibration import load_calibration
from oarlock.recording.session_info import SESSION_KEY, read_session, without_session, write_session
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import read_manifest, replaced_folder
from oarlock.storage.parquet_table import Column, ParquetTable, Texts, read_table, write_table
from oarlock.storage.paths import place_of
from oarlock.storage.regular_file import read_text
from oarlock.storage.toml import TomlTable, write_toml
from oarlock.storage.write_file import write_file
from oarlock.tracking.columns import FIELDS, column_name, columns_of, observed_name
from oarlock.tracking.counts import StreamCount
from oarlock.tracking.estimates import Estimates
from oarlock.tracking.notes import Note
from oarlock.tracking.records import FAULT, FIELD, Beliefs, SensorInfo, SlowSeries

FORMAT = 1
CALIBRATION = "calibration.toml"
KIND = "track"
_FILES = ("run.toml", "track.parquet", "sensors.parquet", "beliefs.parquet", "model.toml", CALIBRATION)
_COUNTS = ("used", "rejected", "missing")


def write_track(track: Estimates, folder: str | PathLike[str], force: bool = False) -> None:
    """Write estimates, innovations, beliefs, model and provenance, in place of what Oarlock wrote there before.

    Samples and the engine's run are not written: `oarlock.smooth` of a loaded track needs the recording.

    Raises:
        DataError: a file that is not Oarlock's would be replaced and `force` is not set, another process writes into
            the folder, or it cannot be written.
    """
    with replaced_folder(folder, KIND, force) as place:
        write_table(columns_of(track), place / "track.parquet")
        if track.info is not None:
            write_table(_sensor_table(track.time_s, track.info), place / "sensors.parquet")
        if track.beliefs is not None:
            write_table(_belief_table(track.beliefs), place / "beliefs.parquet")
        if track.model is not None:
            write_file(place / "model.toml", track.model.text)
        if track.calibration is not None:
            track.calibration.save(place / CALIBRATION)
        session, provenance = without_session(track.provenance)
        write_toml(place / "run.toml", _description(track, provenance))
        write_session(place, session)


def read_track(folder: str | PathLike[str]) -> dict[str, Any]:
    """Read the fields of a track that `write_track` wrote.

    Raises:
        DataError: the folder contains no track, or a file in it is damaged.
    """
    place = place_of(folder)
    manifest = read_manifest(place)
    if not (place / "run.toml").is_file() or not (place / "track.parquet").is_file():
        raise DataError(
            f"{place}: contains no track (run.toml or track.parquet is missing); write one with `oarlock track`"
        )
    top = _read_description(place / "run.toml")
    session = dict(read_session(place))
    table = read_table(place / "track.parquet", _AGAIN)
    coordinates = top["coordinates"]
    names, units = tuple(coordinates["names"]), tuple(coordinates["units"])
    arrays: dict[str, Any] = {
        field: _stack(table, [column_name(n, u, field) for n, u in zip(names, units, strict=True)])
        for field in FIELDS
    }
    observed = _stack(table, [observed_name(n) for n in names]) > 0.5
    slow = {
        name: SlowSeries(table.numbers(f"{name} [{unit}]"), table.numbers(f"{name} std [{unit}]"), unit)
        for name, unit in top["slow"].items()
    }
    found = arrays | {
        "model": _model(place, top["provenance"]),
        "time_s": table.numbers("time_s"),
        "joint_names": tuple(top["joints"]["names"]),
        "joint_units": tuple(top["joints"]["units"]),
        "coordinate_names": names,
        "coordinate_units": units,
        "angle_sequences": dict(top["angle_sequences"]),
        "observed": observed,
        "slow": slow,
        "info": _info(place / "sensors.parquet", tuple(top["sensors"])),
        "beliefs": _beliefs(place / "beliefs.parquet", tuple(top["states"])),
        "calibration": load_calibration(place / CALIBRATION) if (place / CALIBRATION).is_file() else None,
        "notes": tuple(map(Note, top["notes"])),
        "provenance": _with_none_read(top["provenance"]) | ({SESSION_KEY: session} if session else {}),
        "smoothed": bool(top["smoothed"]),
        "counts": _counts(place / "run.toml", top["streams"]),
    }
    manifest.check([name for name in _FILES if (place / name).is_file()])
    return found


def _read_description(file: Path) -> Mapping[str, Any]:
    top: Mapping[str, Any] = TomlTable.read(file).values
    expected = {
        "joints": dict,
        "coordinates": dict,
        "angle_sequences": dict,
        "streams": dict,
        "slow": dict,
        "provenance": dict,
        "sensors": list,
        "states": list,
        "notes": list,
        "smoothed": bool,
    }
    for key, kind in expected.items():
        if not isinstance(top.get(key), kind):
            raise DataError(
                f"{file}: key '{key}' is missing or not a {kind.__name__}; track the recording again"
            )
    for table in ("joints", "coordinates"):
        if not {"names", "units"} <= set(top[table]):
            raise DataError(
                f"{file}: [{table}] needs the lists 'names' and 'units'; track the recording again"
            )
    return top


def _counts(file: Path, streams: Any) -> tuple[StreamCount, ...]:
    try:
        return tuple(StreamCount(name, **count) for name, count in streams.items())
    except (AttributeError, TypeError):
        raise DataError(f"{file}: [streams] is damaged{_AGAIN}") from None


def _description(track: Estimates, provenance: Mapping[str, object]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "smoothed": track.smoothed,
        "notes": list(track.notes),
        "sensors": list(track.info.sensor_names) if track.info else [],
        "states": list(track.beliefs.state_names) if track.beliefs else [],
        "joints": {"names": list(track.joint_names), "units": list(track.joint_units)},
        "coordinates": {"names": list(track.coordinate_names), "units": list(track.coordinate_units)},
        "angle_sequences": dict(track.angle_sequences),
        "slow": {name: slow.unit for name, slow in track.slow.items()},
        "streams": {count.name: count.to_dict() for count in track.counts},
        "provenance": _with_none_named(provenance),
    }


_AGAIN = "; track the recording again"
_NONE = "none"


def _with_none_named(value: Any) -> Any:
    """Replace None by the text "none", because TOML has no null."""
    if isinstance(value, Mapping):
        return {k: _with_none_named(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_with_none_named(v) for v in value]
    return _NONE if value is None else value


def _with_none_read(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _with_none_read(v) for k, v in value.items()}
    return None if isinstance(value, str) and value == _NONE else value


def _sensor_table(time_s: Floats, info: SensorInfo) -> dict[str, Column]:
    columns: dict[str, Column] = {"time_s": time_s}
    for i, name in enumerate(info.sensor_names):
        columns |= {f"{name}.{kind}": getattr(info, kind)[:, i] for kind in ("nis", *_COUNTS)}
        columns[f"{name}.field"] = Texts(info.field[:, i].astype(np.int32), FIELD)
        columns[f"{name}.fault"] = Texts(info.fault[:, i].astype(np.int32), FAULT)
    return columns | {"inertial.nis": info.inertial_nis, "inertial.used": info.inertial_used}


def _belief_table(beliefs: Beliefs) -> dict[str, Column]:
    count, n = beliefs.mean.shape
    covariance = beliefs.covariance.reshape(count, n * n)
    return {"time_s": beliefs.time_s, "mean": beliefs.mean, "covariance": covariance}


def _info(file: Path, names: tuple[str, ...]) -> SensorInfo | None:
    if not names:
        return None
    table = read_table(file, _AGAIN)
    counts: dict[str, Any] = {
        kind: _stack(table, [f"{n}.{kind}" for n in names]).astype(np.int64) for kind in _COUNTS
    }
    return SensorInfo(
        sensor_names=names,
        nis=_stack(table, [f"{n}.nis" for n in names]),
        inertial_nis=table.numbers("inertial.nis"),
        inertial_used=table.numbers("inertial.used").astype(np.int64),
        field=np.stack([_words(table, f"{n}.field", FIELD) for n in names], axis=1),
        fault=np.stack([_words(table, f"{n}.fault", FAULT) for n in names], axis=1),
        **counts,
    )


def _words(table: ParquetTable, name: str, known: tuple[str, ...]) -> Ints:
    places, words = table.texts(name)
    if not set(words) <= set(known) or (places < 0).any():
        raise DataError(
            f"{table.where}: column '{name}' has other words than {', '.join(filter(None, known))}; "
            f"the file is damaged{_AGAIN}"
        )
    return np.array([known.index(word) for word in words], dtype=np.int64)[places]


def _beliefs(file: Path, states: tuple[str, ...]) -> Beliefs | None:
    if not states:
        return None
    table, n = read_table(file, _AGAIN), len(states)
    mean, covariance = table.numbers("mean", 2), table.numbers("covariance", 2)
    if mean.shape[1] != n or covariance.shape[1] != n * n:
        raise DataError(
            f"{file}: has means of {mean.shape[1]} and covariances of {covariance.shape[1]} numbers; run.toml lists "
            f"{n} states; the file is damaged{_AGAIN}"
        )
    return Beliefs(table.numbers("time_s"), mean, covariance.reshape(-1, n, n), states)


def _model(place: Path, provenance: Mapping[str, Any]) -> Model | None:
    file = place / "model.toml"
    if not file.is_file():
        return None
    return Model.from_toml(read_text(file), str(file), dict(provenance.get("parameters", {})))


def _stack(table: ParquetTable, names: list[str]) -> Floats:
    return np.stack([table.numbers(name) for name in names], axis=1)
