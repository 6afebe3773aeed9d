"""Reads and writes calibration files (TOML) for `Calibration.save` and `load_calibration`: one table for each field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isnan
from pathlib import Path
from typing import Any

from oarlock.recording.stream_scales import Clock, EncoderScale
from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, write_toml

FORMAT = 1

ARRAYS = (
    "mag_offsets_ut",
    "mount_stds_rad",
    "mount_offset_stds_m",
    "gyro_biases_rad_s",
    "gyro_bias_stds_rad_s",
    "accel_biases_m_s2",
    "accel_scales",
    "mag_matrices",
)
OPTIONAL = ("parameter_stds", *ARRAYS, "clocks", "encoders")


def write_calibration(fields: Mapping[str, Any], file: Path) -> None:
    """Write the fields of a calibration as TOML. Empty fields are omitted."""
    write_toml(file, document_of(fields))


def document_of(fields: Mapping[str, Any]) -> dict[str, object]:
    """The fields of a calibration as a TOML document. Empty fields are omitted."""
    mounts = {n: {"rotation": r.tolist(), "offset_m": o.tolist()} for n, (r, o) in fields["mounts"].items()}
    document: dict[str, object] = {
        "format": FORMAT,
        "parameters": dict(fields["parameters"]),
        "mounts": mounts,
    }
    written: dict[str, Mapping[str, object]] = {
        "parameter_stds": dict(fields["parameter_stds"]),
        **{name: {n: v.tolist() for n, v in fields[name].items()} for name in ARRAYS},
        "clocks": {n: _known(asdict(c)) for n, c in fields["clocks"].items()},
        "encoders": {n: asdict(e) for n, e in fields["encoders"].items()},
    }
    document |= {name: values for name, values in written.items() if values}
    return document | {"noted": dict(fields["noted"])}


def read_calibration(file: Path) -> dict[str, Any]:
    """The fields of a calibration, unchecked; see `oarlock.load_calibration`."""
    return fields_of(TomlTable.read(file))


def fields_of(top: TomlTable) -> dict[str, Any]:
    """The fields of a calibration in a file's top table, unchecked."""
    top.check_format(FORMAT)
    top.check_keys({"format", "parameters", "mounts", "noted", *OPTIONAL})
    values: dict[str, Any] = {
        name: top.table(name, default={}).values
        for name in ("parameters", "noted", "parameter_stds", *ARRAYS)
    }
    values["mounts"] = {
        name: (mount.require("rotation"), mount.require("offset_m"))
        for name, mount in _tables(top, "mounts", {"rotation", "offset_m"}).items()
    }
    values["clocks"] = {
        name: _built(Clock, clock, "offset_s")
        for name, clock in _tables(top, "clocks", set(Clock.__match_args__)).items()
    }
    values["encoders"] = {
        name: _built(EncoderScale, encoder, "zero")
        for name, encoder in _tables(top, "encoders", set(EncoderScale.__match_args__)).items()
    }
    return values


def _known(clock: Mapping[str, float]) -> dict[str, float]:
    return {key: value for key, value in clock.items() if not isnan(value)}


def _tables(top: TomlTable, name: str, keys: set[str]) -> dict[str, TomlTable]:
    found = top.table(name, default={})
    tables = {key: found.table(key) for key in found.values}
    for table in tables.values():
        table.check_keys(keys)
    return tables


def _built(kind: Any, table: TomlTable, needs: str) -> Any:
    table.require(needs)
    try:
        return kind(**table.values)
    except DataError as error:
        raise DataError(f"{table.where()}: {error}") from None
