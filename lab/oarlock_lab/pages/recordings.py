"""Recordings of an independent simulator of sculling: what a user would know of the body, and the ground truth.

`nominal_lengths` and the nominal mounts of a file are what a user measured or read off. The body that moved has other
lengths and mounts in `misfit_*` and `wild_*`: those never enter a track.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import oarlock
from oarlock.model.coordinates import joint_units
from oarlock.storage.arrays import Floats

UNITS = ("back", "r_upperarm", "r_forearm", "l_upperarm", "l_forearm")
ENCODERS = ("seat", "r_oar_phi", "r_oar_alpha", "l_oar_phi", "l_oar_alpha")
PINS = {"r_0_18": "r_pin", "r_0_22": "l_pin"}
"""The file's name of each oar's pin, and that of the model's parameters."""


@dataclass(frozen=True)
class SimulatedRecording:
    """A recording with its ground truth.

    Args:
        name: of the conditions.
        recording: readings of all sensors.
        nominal: the lengths and mounts that a user would know.
        truth: joint values of the body that moved.
        surge_m_s2: (T,) true acceleration of the boat, stern positive.
        positions_m: frame -> (T, 3) true positions in root axes.
    """

    name: str
    recording: oarlock.Recording
    nominal: oarlock.Calibration
    truth: oarlock.Track
    surge_m_s2: Floats
    positions_m: dict[str, Floats]


def read_simulated(file: Path, name: str, model: oarlock.Model) -> SimulatedRecording:
    """Read one file, for the model `sculler` or one with its joints."""
    with np.load(file) as arrays:
        positions = {
            key.removeprefix("true_"): arrays[key].astype(float)
            for key in arrays.files
            if key.startswith("true_") and arrays[key].ndim == 2 and arrays[key].shape[1] == 3
        }
        return SimulatedRecording(
            name,
            _recording(arrays),
            oarlock.Calibration(parameters=nominal_lengths(arrays), mounts=_nominal_mounts(arrays)),
            _truth(arrays, model),
            arrays["true_boat_acc_m_s2"],
            positions,
        )


def nominal_lengths(arrays: Mapping[str, Any]) -> dict[str, float]:
    """The lengths and pins that the file gives a user, by the model's parameters, m."""
    lengths: dict[str, float] = {}
    for key, value in json.loads(str(arrays["nominal_lengths"])).items():
        if key in PINS:
            lengths |= {f"{PINS[key]}_{axis}": x for axis, x in zip("xyz", value, strict=True)}
        else:
            lengths[key.lower()] = value
    return lengths


def _nominal_mounts(arrays: Mapping[str, Any]) -> dict[str, tuple[Floats, Floats]]:
    rotations, offsets = arrays["nominal_mount_rotation"], arrays["nominal_mount_offset_m"]
    return {unit: (turn, at) for unit, turn, at in zip(UNITS, rotations, offsets, strict=True)}


def _recording(arrays: Mapping[str, Any]) -> oarlock.Recording:
    time_s, imu = arrays["time_s"], arrays["imu"].astype(float)
    encoders = np.column_stack([arrays["seat_m"], arrays["oar_rad"]])
    streams: list[Any] = [
        oarlock.recording.ImuStream(unit, time_s, gyro_rad_s=x[:, :3], accel_m_s2=x[:, 3:6], mag_ut=x[:, 6:])
        for unit, x in zip(UNITS, imu.transpose(1, 0, 2), strict=True)
    ]
    streams += [
        oarlock.recording.ScalarStream(n, time_s, x) for n, x in zip(ENCODERS, encoders.T, strict=True)
    ]
    return oarlock.Recording(streams)


def _truth(arrays: Mapping[str, Any], model: oarlock.Model) -> oarlock.Track:
    q, qd, qdd = (arrays[key] for key in ("true_q", "true_qd", "true_qdd"))
    return oarlock.Track(
        model=model,
        time_s=arrays["time_s"],
        joint_names=tuple(model.joint_names),
        joint_units=joint_units(model),
        q=q,
        qd=qd,
        qdd=qdd,
        **{f"{key}_std": np.full_like(q, np.nan) for key in ("q", "qd", "qdd")},
        observed=np.ones(q.shape, dtype=bool),
    )


def with_rows(recording: oarlock.Recording, rows_of: Callable[[Any], NDArray[Any]]) -> oarlock.Recording:
    """The recording with those rows of each stream that `rows_of(stream)` names."""
    streams: list[Any] = []
    for s in recording.streams:
        rows = rows_of(s)
        values = {name: v[rows] for name, v in s.values.items()}
        streams.append(type(s)(s.name, s.time_s[rows], **values))
    return oarlock.Recording(streams)


def at_rate(recording: oarlock.Recording, rate_hz: float) -> oarlock.Recording:
    """The rows nearest to an even grid, with their own stamps."""

    def rows(s: Any) -> NDArray[Any]:
        grid = np.arange(s.time_s[0], s.time_s[-1], 1.0 / rate_hz)
        after = np.clip(np.searchsorted(s.time_s, grid), 1, len(s) - 1)
        nearer_before = grid - s.time_s[after - 1] <= s.time_s[after] - grid
        return np.unique(after - nearer_before)

    return with_rows(recording, rows)
