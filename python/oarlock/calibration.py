"""What is known of one wearing: lengths, rig, and how the sensors sit on the body."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias, cast

import numpy as np

from oarlock.array_gate import FloatArray, real_array
from oarlock.errors import DataError

Mount: TypeAlias = tuple[FloatArray, FloatArray]

# Rotations typed by hand carry four to six digits; a wrong one is off by far more.
ROTATION_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class Calibration:
    """Values that replace the model's nominal ones. What is not named keeps its default.

    Args:
        parameters: parameter name -> value, in the parameter's unit (m, rad).
        mounts: sensor name -> (link_from_sensor (3, 3) rotation, offset (3,) in m in the link's axes).
        noted: how the values were found, for the report; free keys.
        mag_offsets_ut: sensor name -> (3,) constant part of a magnetometer's readings, uT in sensor axes (hard
            iron). `oarlock.track` subtracts it; the recording keeps what was measured. A live `Tracker` takes
            readings as they are given.

    Raises:
        DataError: A value that is not a finite number, another shape, or a matrix that is no rotation.
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    mounts: Mapping[str, Mount] = field(default_factory=dict)
    noted: Mapping[str, object] = field(default_factory=dict)
    mag_offsets_ut: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        parameters = {k: _finite(v, k) for k, v in _table(self.parameters, "parameters").items()}
        mounts = {k: _mount(v, k) for k, v in _table(self.mounts, "mounts").items()}
        offsets = {
            str(k): _mag_offset(v, k) for k, v in _table(self.mag_offsets_ut, "mag_offsets_ut").items()
        }
        object.__setattr__(self, "parameters", MappingProxyType(parameters))
        object.__setattr__(self, "mounts", MappingProxyType(mounts))
        object.__setattr__(self, "noted", MappingProxyType(copy.deepcopy(dict(self.noted))))
        object.__setattr__(self, "mag_offsets_ut", MappingProxyType(offsets))

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        fields = (self.parameters, self.mounts, self.noted, self.mag_offsets_ut)
        return Calibration, tuple(dict(f) for f in fields)

    def save(self, file: str | PathLike[str]) -> None:
        """Write as TOML; `load_calibration` reads it back exactly."""
        from oarlock.io.toml import write_toml

        mounts = {n: {"rotation": r.tolist(), "offset_m": o.tolist()} for n, (r, o) in self.mounts.items()}
        document: dict[str, object] = {"format": 1, "parameters": dict(self.parameters), "mounts": mounts}
        if self.mag_offsets_ut:
            document["mag_offsets_ut"] = {n: o.tolist() for n, o in self.mag_offsets_ut.items()}
        write_toml(Path(file), document | {"noted": dict(self.noted)})


def load_calibration(file: str | PathLike[str]) -> Calibration:
    """Read a calibration file.

    Raises:
        DataError: The file cannot be read, a key is unknown, or a value is refused by `Calibration`.
    """
    from oarlock.io.paths import place_of
    from oarlock.io.toml import TomlTable

    top = TomlTable.read(place_of(file))
    top.check_format(1)
    top.check_keys({"format", "parameters", "mounts", "mag_offsets_ut", "noted"})
    mounts = {}
    for name in (found := top.table("mounts", default={})).values:
        mount = found.table(name)
        mount.check_keys({"rotation", "offset_m"})
        mounts[name] = (mount.require("rotation"), mount.require("offset_m"))
    parameters, noted, offsets = (
        top.table(k, default={}).values for k in ("parameters", "noted", "mag_offsets_ut")
    )
    # The constructor checks every value.
    return Calibration(
        cast(Mapping[str, float], parameters),
        cast(Mapping[str, Mount], mounts),
        noted,
        cast(Mapping[str, FloatArray], offsets),
    )


def _table(value: object, key: str) -> dict[str, object]:
    if not isinstance(value, Mapping):
        raise DataError(f"calibration, {key}: is {value!r:.60}; expected names and their values, a dict")
    return {str(name): entry for name, entry in value.items()}


def _finite(value: object, name: str) -> float:
    number = real_array(value, (), f'calibration, parameter "{name}"').item()  # type: ignore[arg-type]
    if not np.isfinite(number):
        raise DataError(f'calibration, parameter "{name}": is {number}; expected a finite number')
    return float(number)


def _mag_offset(value: object, name: str) -> FloatArray:
    where = f'calibration, mag_offsets_ut of "{name}"'
    offset_ut = real_array(value, (3,), where)  # type: ignore[arg-type]
    if not np.isfinite(offset_ut).all():
        raise DataError(f"{where}: is {offset_ut.tolist()}; expected three finite numbers in uT")
    return offset_ut


def _mount(value: object, name: str) -> Mount:
    where = f'calibration, mount of "{name}"'
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise DataError(f"{where}: expected (link_from_sensor 3x3, offset_m 3), got {value!r}")
    rotation, offset = value
    link_from_sensor = real_array(rotation, (3, 3), f"{where}, rotation")
    offset_m = real_array(offset, (3,), f"{where}, offset_m")
    if not np.isfinite(offset_m).all():
        raise DataError(f"{where}: offset_m is {offset_m.tolist()}; expected finite numbers")
    _check_rotation(link_from_sensor, where)
    return link_from_sensor, offset_m


def _check_rotation(matrix: FloatArray, where: str) -> None:
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max()) if np.isfinite(matrix).all() else np.inf
    if not error <= ROTATION_TOLERANCE:
        raise DataError(
            f"{where}: rows are not orthonormal (R R^T is off by {error:.3g}, "
            f"allowed {ROTATION_TOLERANCE:g}). "
            "Give more digits, or use the nearest rotation."
        )
    if np.linalg.det(matrix) < 0:
        raise DataError(f"{where}: is a mirror (determinant -1), not a rotation. Check the sign of one axis.")
