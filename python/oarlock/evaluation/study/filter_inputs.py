"""Model and calibration that the filter of a study receives, with deliberate errors in lengths, mounts and noise."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock._core import Config, Model
from oarlock.evaluation.study.keys import ONE, StudyKey, Value, by_name, number_for, sized
from oarlock.evaluation.study.trial import QUANTITIES, StudyTrial
from oarlock.model.edit import document_of, model_of
from oarlock.recording.calibration import Calibration
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.track import Track

_STD_KEYS = {"gyro": ("gyro_std_rad_s",), "accel": ("accel_std_m_s2",), "mag": ("mag_std_ut",)}


def keys_of_filter_inputs(model: Model, lengths: tuple[str, ...]) -> dict[str, StudyKey]:
    """Keys for errors in the model and calibration of the filter, by name."""
    described = model.describe()
    units = tuple(s.name for s in described.inertial_units)
    parameters = tuple(p.name for p in described.parameters)
    wearers = (*units, ONE)
    turned = "each mount rotated by this angle about a random axis, new for each seed"
    moved = "each sensor position moved by this distance in a random direction"
    shown = f"standard deviation of the error of each length ({', '.join(lengths[:3])} ...)"
    scaled = "error of each parameter in units of the standard deviation that the model file gives it"
    tilt = "tilt of the root in a random direction; the filter assumes a level root"
    start = "standard deviation of the error of the initial posture for the filter; none: no initial posture"
    noise = "true: the filter is given the true noise; nominal: it uses the noise of the model file"
    return by_name(
        [
            sized("mount_error_deg", turned, wearers, most=180.0),
            sized("mount_offset_error_m", moved, wearers),
            sized("length_error_percent", shown, parameters, most=50.0),
            sized("parameter_error", scaled, parameters),
            StudyKey("vertical_error_deg", "number", 0.0, tilt, least=0.0, most=90.0),
            StudyKey("start_error_deg", "number", None, start, least=0.0, optional=True),
            StudyKey("noise_told", "choice", "true", noise, choices=("true", "nominal")),
            StudyKey("smooth", "boolean", False, "smooth over the whole recording"),
        ]
    )


def filter_model(model: Model, values: Mapping[str, Value], seed: int) -> Model:
    """The model that the filter receives: `model.*` keys applied, with the true noise and a wrong vertical.

    Raises:
        ModelError: a changed file is refused.
        DataError: a key does not exist in the file.
    """
    edits = {
        name.removeprefix("model."): value for name, value in values.items() if name.startswith("model.")
    }
    factors = _noise_factors(values) if values["noise_told"] == "true" else {}
    tilt_deg = number_for(values["vertical_error_deg"], "")
    if not edits and not factors and not tilt_deg:
        return model
    document = document_of(model)
    for path, value in edits.items():
        _set(document, path, value)
    if tilt_deg:
        _tilt(document, model, tilt_deg, seed)
    for sensor in document.get("sensor", []):
        for name, factor in factors.items():
            keys = _STD_KEYS.get(name, ("std", "std_m"))
            for key in (k for k in keys if k in sensor):
                sensor[key] = _scaled(sensor[key], factor)
    for joint in document.get("joint", []):
        if "std" in joint and "encoder" in factors:
            joint["std"] = _scaled(joint["std"], factors["encoder"])
    return model_of(document, model)


def _tilt(document: dict[str, Any], model: Model, angle_deg: float, seed: int) -> None:
    """Rotates `up` and `forward` of the file about a horizontal axis."""
    world = model.describe().world
    up, forward = np.asarray(world.up), np.asarray(world.forward)
    side = np.random.default_rng([seed, 5]).uniform(0.0, 2.0 * np.pi)
    axis = np.cos(side) * forward + np.sin(side) * np.cross(up, forward)
    turn = Rotation.from_rotvec(np.radians(angle_deg) * axis)
    document["world"] = document.get("world", {}) | {
        "up": turn.apply(up).tolist(),
        "forward": turn.apply(forward).tolist(),
    }


def check_model_key(model: Model, path: str) -> None:
    """Refuses a path that does not exist in the model file.

    Raises:
        DataError: names the nearest key.
    """
    _set(document_of(model), path, None)


def _noise_factors(values: Mapping[str, Value]) -> dict[str, float]:
    whole = number_for(values.get("noise_factor", 1.0), "", 1.0)
    factors = {
        name: whole * number_for(values.get(f"{name}_noise_factor", 1.0), "", 1.0) for name in QUANTITIES
    }
    # a filter with zero noise would divide by zero
    return {name: max(factor, 1e-3) for name, factor in factors.items() if factor != 1.0}


def _scaled(value: Any, factor: float) -> Any:
    return value * factor if isinstance(value, int | float) else f"({value}) * {factor!r}"


def _set(document: dict[str, Any], path: str, value: Value) -> None:
    """Sets a key; an entry of a list of tables is found by its name (`closure.r_grip.std_m`)."""
    here: Any = document
    *way, last = path.split(".")
    for part in way:
        if isinstance(here, list):
            names = [entry.get("name", "") for entry in here]
            if part not in names:
                raise DataError(f'the model file has no entry "{part}" there. {did_you_mean(part, names)}')
            here = here[names.index(part)]
        else:
            if part not in here:
                raise DataError(f'the model file has no "{part}" there. {did_you_mean(part, here)}')
            here = here[part]
    if not isinstance(here, dict) or last not in here:
        known = here if isinstance(here, dict) else [entry.get("name", "") for entry in here]
        raise DataError(f'the model file has no key "{last}" there. {did_you_mean(last, known)}')
    here[last] = value


def filter_calibration(
    model: Model, lengths: tuple[str, ...], values: Mapping[str, Value], seed: int
) -> Calibration | None:
    """Lengths and mounts that the filter receives; None without errors.

    Directions and signs depend only on the seed, so scenarios of one seed differ only in size.
    """
    parameters = _parameters(model, lengths, values, seed)
    mounts = _mounts(model, values, seed)
    return Calibration(parameters=parameters, mounts=mounts) if parameters or mounts else None


def _parameters(
    model: Model, lengths: tuple[str, ...], values: Mapping[str, Value], seed: int
) -> dict[str, float]:
    percent, factor = values["length_error_percent"], values["parameter_error"]
    found: dict[str, float] = {}
    for parameter in model.describe().parameters:
        name, true = parameter.name, parameter.value
        draw = np.random.default_rng([seed, 1, zlib.crc32(name.encode())]).standard_normal()
        listed = isinstance(percent, Mapping) or name in lengths
        off = 0.01 * number_for(percent, name) * true if listed else 0.0
        off += number_for(factor, name) * (parameter.std or 0.0)
        if off:
            found[name] = true + off * float(draw)
    return found


def _mounts(model: Model, values: Mapping[str, Value], seed: int) -> dict[str, tuple[Any, Any]]:
    found = {}
    for sensor in model.describe().inertial_units:
        name = sensor.name
        angle = np.radians(number_for(values["mount_error_deg"], name))
        moved = number_for(values["mount_offset_error_m"], name)
        if not (angle or moved):
            continue
        draw = np.random.default_rng([seed, 2, zlib.crc32(name.encode())]).standard_normal((2, 3))
        axis, away = draw / np.linalg.norm(draw, axis=1, keepdims=True)
        turned = np.asarray(sensor.mount.rotation) @ Rotation.from_rotvec(angle * axis).as_matrix()
        found[name] = (turned, np.asarray(sensor.mount.offset) + moved * away)
    return found


def filter_config(trial: StudyTrial, values: Mapping[str, Value], seed: int) -> Config:
    """The configuration of one run."""
    keys: dict[str, Any] = {
        name.removeprefix("config."): v for name, v in values.items() if name.startswith("config.")
    }
    error = values["start_error_deg"]
    if error is not None:
        keys["initial_q"] = start_posture(trial.truth, number_for(error, ""), seed)
    return Config(**keys)


def start_posture(truth: Track, error_deg: float, seed: int) -> list[float]:
    """The true initial posture, with a random error of hinges and balls; slides have no error."""
    angles = np.array([unit == "rad" for unit in truth.coordinate_units])
    draw = np.random.default_rng([seed, 3]).standard_normal(len(angles))
    start = truth.q[0] + np.where(angles, np.radians(error_deg) * draw, 0.0)
    return [float(value) for value in start]
