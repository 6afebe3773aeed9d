"""`Calibration`: lengths, mounts and corrections of sensors and clocks of one session. Used by searches and `track`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

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
from oarlock.storage.array_gate import FloatArray
from oarlock.storage.errors import DataError
from oarlock.storage.paths import place_of
from oarlock.storage.toml import TomlTable, toml_text

if TYPE_CHECKING:
    from oarlock.recording.recording import Recording

__all__ = ["Calibration", "Clock", "EncoderScale", "Mount", "load_calibration"]


@dataclass(frozen=True, eq=False)
class Calibration:
    """Values that replace the nominal ones of the model. Parameters and sensors without an entry keep theirs.

    Args:
        parameters: parameter name -> value, in the parameter's unit (m, rad).
        mounts: sensor name -> (link_from_sensor (3, 3) rotation, offset (3,) in m in the link's axes).
        noted: how the values were found, for the report; free keys.
        mag_offsets_ut: sensor name -> (3,) constant part of a magnetometer's readings, uT in sensor axes (hard
            iron). `oarlock.track` and a live `Tracker` subtract it; the recording itself is not changed.
        parameter_stds: parameter name -> standard deviation, in the parameter's unit (m, rad). For a length that the
            filter estimates, this is the initial standard deviation.
        mount_stds_rad: sensor name -> (3,) standard deviations of the mount's rotation about the link's axes, rad.
        mount_offset_stds_m: sensor name -> (3,) standard deviations of the mount's offset along these axes, m.
        gyro_biases_rad_s: sensor name -> (3,) constant part of a gyroscope's readings, rad/s in sensor axes.
        gyro_bias_stds_rad_s: sensor name -> (3,) standard deviations of the gyroscope biases, rad/s.
        accel_biases_m_s2: sensor name -> (3,) constant part of an accelerometer's readings, m/s2 in sensor axes.
        accel_scales: sensor name -> (3,) scale factors: ``true = (reading - bias) / scale``, per axis.
        mag_matrices: sensor name -> (3, 3) correction of soft iron: ``true = matrix @ (reading - mag_offset)``. It
            mixes the axes, so a reading with one missing axis counts as missing.
        clocks: stream name -> `Clock`: offset and drift of the time stamps.
        encoders: stream name -> `EncoderScale`: ``value = scale * (reading - zero)``.

    Raises:
        DataError: A value is not a finite number or has the wrong shape, a mount is not a rotation, or a standard
            deviation is negative.
    """

    parameters: Mapping[str, float] = field(default_factory=dict)
    mounts: Mapping[str, Mount] = field(default_factory=dict)
    noted: Mapping[str, object] = field(default_factory=dict)
    mag_offsets_ut: Mapping[str, FloatArray] = field(default_factory=dict)
    parameter_stds: Mapping[str, float] = field(default_factory=dict)
    mount_stds_rad: Mapping[str, FloatArray] = field(default_factory=dict)
    mount_offset_stds_m: Mapping[str, FloatArray] = field(default_factory=dict)
    gyro_biases_rad_s: Mapping[str, FloatArray] = field(default_factory=dict)
    gyro_bias_stds_rad_s: Mapping[str, FloatArray] = field(default_factory=dict)
    accel_biases_m_s2: Mapping[str, FloatArray] = field(default_factory=dict)
    accel_scales: Mapping[str, FloatArray] = field(default_factory=dict)
    mag_matrices: Mapping[str, FloatArray] = field(default_factory=dict)
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
        """The recording with the corrections of this calibration applied to time stamps and readings.

        `oarlock.track` and `oarlock.Tracker` apply the corrections themselves: give them the recording as measured.
        This function applies clocks, encoders, biases and scales of gyroscopes and accelerometers, and `mag_matrices`.
        It does not subtract `mag_offsets_ut`. It does not resample. It ignores streams without an entry, and entries
        without a stream.

        Args:
            recording: as measured. It is not modified.

        Returns:
            The corrected recording, or the same object if nothing is corrected.

        Raises:
            DataError: an entry does not fit its stream, such as a gyroscope's bias for an encoder.
        """
        return corrected(recording, self)

    def for_corrected(self) -> Calibration:
        """This calibration without the corrections that `corrected` applies: use it with the corrected recording."""
        return replace(self, **{name: {} for name in CORRECTING})

    def _repr_html_(self) -> str:
        return calibration_html({f.name: getattr(self, f.name) for f in fields(self)})

    def save(self, file: str | PathLike[str]) -> None:
        """Write as a TOML file. `load_calibration` reads back identical values."""
        write_calibration({f.name: getattr(self, f.name) for f in fields(self)}, Path(file))


def load_calibration(file: str | PathLike[str]) -> Calibration:
    """Read a calibration file.

    Raises:
        DataError: The file cannot be read, a key is unknown, or `Calibration` refuses a value.
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


def _three(check: Callable[..., FloatArray], name: str, unit: str) -> Callable[[Any, str], FloatArray]:
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
