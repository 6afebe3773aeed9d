"""`Calibration`: lengths, mounts and corrections of sensors and clocks of one session. Used by searches and `track`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

from oarlock.recording.calibration_file import document_of, fields_of, read_calibration, write_calibration
from oarlock.recording.calibration_html import calibration_html
from oarlock.recording.calibration_values import (
    Mount,
    accel_scale,
    checked_mount,
    finite_parameter,
    finite_three,
    mag_matrix,
    parameter_std,
    std_three,
)
from oarlock.recording.corrections import CORRECTING, corrected
from oarlock.recording.reader_notes import copied_notes
from oarlock.recording.stream_scales import Clock, EncoderScale
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.toml import TomlTable, toml_text

if TYPE_CHECKING:
    from oarlock.recording.recording import Recording

__all__ = ["Calibration", "Clock", "EncoderScale", "Mount", "load_calibration"]

BySensor: TypeAlias = Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Values that replace the nominal ones of the model; a wrong shape or range is a DataError.

    Args:
        parameters: by parameter, m or rad.
        mounts: by sensor: link_from_sensor (3, 3), and offset (3,) in the link's axes, m.
        noted: how the values were obtained, for the report.
        mag_offsets_ut: hard iron by sensor, (3,), sensor axes.
        parameter_stds: standard deviations, m or rad; of estimated lengths at the start.
        mount_stds_rad: (3,) about the link's axes.
        mount_offset_stds_m: (3,) along them.
        gyro_biases_rad_s: (3,), sensor axes.
        gyro_bias_stds_rad_s: (3,).
        accel_biases_m_s2: (3,), sensor axes.
        accel_scales: (3,): ``true = (reading - bias) / scale``.
        mag_matrices: soft iron, (3, 3): ``true = matrix @ (reading - offset)``.
        clocks: by stream, `Clock`.
        encoders: by stream: ``value = scale * (reading - zero)``.
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    mounts: Mapping[str, Mount] = field(default_factory=dict)
    noted: Mapping[str, object] = field(default_factory=dict)
    mag_offsets_ut: BySensor = field(default_factory=dict)
    parameter_stds: Mapping[str, float] = field(default_factory=dict)
    mount_stds_rad: BySensor = field(default_factory=dict)
    mount_offset_stds_m: BySensor = field(default_factory=dict)
    gyro_biases_rad_s: BySensor = field(default_factory=dict)
    gyro_bias_stds_rad_s: BySensor = field(default_factory=dict)
    accel_biases_m_s2: BySensor = field(default_factory=dict)
    accel_scales: BySensor = field(default_factory=dict)
    mag_matrices: BySensor = field(default_factory=dict)
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    encoders: Mapping[str, EncoderScale] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, check in _CHECKS.items():
            values = {str(k): check(v, str(k)) for k, v in _mapping(getattr(self, name), name).items()}
            object.__setattr__(self, name, MappingProxyType(values))
        noted = copied_notes(_mapping(self.noted, "noted"), "calibration, noted")
        object.__setattr__(self, "noted", MappingProxyType(noted))

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        return Calibration, tuple(dict(getattr(self, f.name)) for f in fields(self))

    def corrected(self, recording: Recording) -> Recording:
        """The recording with corrected time stamps and readings, except for `mag_offsets_ut`; not resampled.

        `track` and `Tracker` correct by themselves: give them recordings as measured.
        """
        return corrected(recording, self)

    def for_corrected(self) -> Calibration:
        """The calibration for a `corrected` recording."""
        return replace(self, **{name: {} for name in CORRECTING})

    def _repr_html_(self) -> str:
        return calibration_html({f.name: getattr(self, f.name) for f in fields(self)})

    def save(self, file: str | PathLike[str]) -> None:
        """Write a TOML file for `load_calibration`."""
        write_calibration({f.name: getattr(self, f.name) for f in fields(self)}, Path(file))


def load_calibration(file: str | PathLike[str]) -> Calibration:
    """Read a calibration file.

    Raises:
        DataError: an unreadable file, an unknown key or a wrong value.
    """
    return Calibration(**read_calibration(place_of(file)))


def parsed_calibration(text: str) -> Calibration:
    """The calibration in the text of a calibration file.

    Raises:
        DataError: as `load_calibration`.
    """
    return Calibration(**fields_of(TomlTable.parsed(text, Path("calibration"))))


def calibration_text(calibration: Calibration) -> str:
    """The text of a calibration's file; `parsed_calibration` gives back identical values."""
    return toml_text(document_of({f.name: getattr(calibration, f.name) for f in fields(calibration)}))


def _three(check: Callable[..., Floats], name: str, unit: str) -> Callable[[Any, str], Floats]:
    return lambda value, sensor: check(value, name, sensor, unit)


def _instance(kind: type, field_name: str, value: object, name: str) -> object:
    if not isinstance(value, kind):
        raise DataError(
            f'calibration, {field_name} of "{name}": expected oarlock.recording.{kind.__name__}(...), got {value!r}'
        )
    return value


def _mapping(value: object, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise DataError(f"calibration, {name}: expected a table keyed by name, got {type(value).__name__}")
    return value


_CHECKS: dict[str, Callable[[Any, str], object]] = {
    "parameters": finite_parameter,
    "mounts": checked_mount,
    "mag_offsets_ut": _three(finite_three, "mag_offsets_ut", "uT"),
    "parameter_stds": parameter_std,
    "mount_stds_rad": _three(std_three, "mount_stds_rad", "rad"),
    "mount_offset_stds_m": _three(std_three, "mount_offset_stds_m", "m"),
    "gyro_biases_rad_s": _three(finite_three, "gyro_biases_rad_s", "rad/s"),
    "gyro_bias_stds_rad_s": _three(std_three, "gyro_bias_stds_rad_s", "rad/s"),
    "accel_biases_m_s2": _three(finite_three, "accel_biases_m_s2", "m/s2"),
    "accel_scales": accel_scale,
    "mag_matrices": mag_matrix,
    "clocks": partial(_instance, Clock, "clocks"),
    "encoders": partial(_instance, EncoderScale, "encoders"),
}
