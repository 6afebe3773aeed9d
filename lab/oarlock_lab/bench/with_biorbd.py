"""Times biorbd's extended Kalman filter, which finds a posture from the orientations of the links.

This is a smaller problem than those of other software: no rates, biases or closures, and another filter must find the
orientations first. The chain is a trunk with two arms, with as many angles and units as the model has there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.storage.arrays import Floats
from oarlock_lab.bench.problem import RATE_HZ, BenchProblem

# name, parent, axes of its hinges
_CHAIN: Final = (
    ("trunk", "base", "x"),
    ("r_upperarm", "trunk", "xyz"),
    ("r_forearm", "r_upperarm", "xz"),
    ("l_upperarm", "trunk", "xyz"),
    ("l_forearm", "l_upperarm", "xz"),
)
# Defaults of biorbd's class.
_NOISE_FACTOR, _ERROR_FACTOR = 5e-3, 1e-10


def angles_rad(problem: BenchProblem) -> Floats:
    """Angles of the chain, (T, 11): smooth swings of realistic size at the rate of the recording."""
    phase = 2.0 * np.pi * 0.4 * problem.time_s[:, None]
    joints = np.arange(sum(len(axes) for _, _, axes in _CHAIN))
    return np.asarray(0.4 * np.sin(phase + 0.7 * joints))


def make(problem: BenchProblem) -> Callable[[], Floats]:
    """A run over all samples: angles, (T, 11), rad."""
    import biorbd

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "chain.bioMod"
        file.write_text(_model_text(), encoding="utf-8")
        model = biorbd.Model(str(file))
    units = [_units(biorbd, matrices) for matrices in _orientations(angles_rad(problem))]

    def run() -> Floats:
        param = biorbd.KalmanParam(RATE_HZ, _NOISE_FACTOR, _ERROR_FACTOR)
        kalman = biorbd.KalmanReconsIMU(model, param)
        state = (
            biorbd.GeneralizedCoordinates(model),
            biorbd.GeneralizedVelocity(model),
            biorbd.GeneralizedAcceleration(model),
        )
        times_s = []
        for unit_vector in units:
            kalman.reconstructFrame(model, unit_vector, *state)
            times_s.append(state[0].to_array())
        return np.array(times_s)

    return run


def _orientations(angles: Floats) -> Floats:
    """World from link, (T, 5, 3, 3)."""
    turns, column = {"base": Rotation.identity(len(angles))}, 0
    for name, parent, axes in _CHAIN:
        turn = turns[parent]
        for axis in axes:
            turn = turn * Rotation.from_euler(axis, angles[:, column : column + 1])
            column += 1
        turns[name] = turn
    return np.stack([turns[name].as_matrix() for name, _, _ in _CHAIN], axis=1)


def _units(biorbd, matrices: Floats):  # type: ignore[no-untyped-def]
    """The orientations of one sample in biorbd's format."""
    units = biorbd.VecBiorbdIMU()
    still = biorbd.Vector3d(0.0, 0.0, 0.0)
    for (name, _, _), matrix in zip(_CHAIN, matrices, strict=True):
        turn = biorbd.Rotation(*(float(x) for x in matrix.ravel()))
        node = biorbd.RotoTransNode(biorbd.RotoTrans(turn, still), name, name)
        units.append(biorbd.IMU(node, True, False))
    return units


def _model_text() -> str:
    parts = ["version 4", "gravity 0 0 -9.81"]
    for name, parent, axes in _CHAIN:
        parts.append(
            f"segment {name}\n parent {parent}\n RTinMatrix 0\n RT 0 0 0 xyz 0 0 0\n rotations {axes}\n"
            " mass 1\n inertia\n 0.01 0 0\n 0 0.01 0\n 0 0 0.01\n com 0 0 0\nendsegment\n"
            f"imu {name}_unit\n parent {name}\n RTinMatrix 0\n RT 0 0 0 xyz 0 0 0\n"
            " technical 1\n anatomical 0\nendimu"
        )
    return "\n".join(parts) + "\n"
