"""Inverse kinematics of other software: orientations of the links, forced onto a chain of joints.

Inertial toolboxes usually work in two steps: orientations from each unit by itself, then the posture of a chain
that comes closest to them. The second step is biorbd's Kalman filter for orientations or OpenSim's inverse
kinematics solver.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.storage.arrays import Floats

from .estimate import NotRunError, OrientationEstimate, Outcome, attempt
from .rotations import quat_wxyz, rotation


@dataclass(frozen=True)
class Link:
    """A link of an open chain, hanging on the one before it or on another one.

    Args:
        name: the body.
        axes: the hinges between its parent and this link, in order: "x", or "yxz" for three in a row.
        parent: the link that it hangs on; "" for the one before it, or the root.
    """

    name: str
    axes: str
    parent: str = ""


@dataclass(frozen=True, eq=False)
class ChainPosture:
    """What inverse kinematics found: the links' orientations, and hinge angles (T, n) in the chain's order, rad."""

    estimate: OrientationEstimate
    angles_rad: Floats


Chain = Sequence[Link]
Solver = Callable[[OrientationEstimate, Chain], Iterator[ChainPosture]]


def world_from_links(
    chain: Chain, angles_rad: Floats, world_from_root: Rotation | None = None
) -> dict[str, Floats]:
    """Link -> quat_wxyz (T, 4) of a chain with these hinge angles (T, n), on a root that stands still."""
    turn = Rotation.identity(len(angles_rad)) if world_from_root is None else world_from_root
    orientations: dict[str, Rotation] = {}
    column = 0
    for link in chain:
        turn = orientations[link.parent] if link.parent else turn
        for axis in link.axes:
            turn = turn * Rotation.from_euler(axis, angles_rad[:, column : column + 1])
            column += 1
        orientations[link.name] = turn
    return {name: quat_wxyz(turn) for name, turn in orientations.items()}


def biorbd(
    source: OrientationEstimate, chain: Chain, noise_factor: float = 5e-3, error_factor: float = 1e-10
) -> Iterator[ChainPosture]:
    """biorbd's `KalmanReconsIMU`; the factors are those that the class itself defaults to."""
    from biorbd import (
        IMU,
        GeneralizedAcceleration,
        GeneralizedCoordinates,
        GeneralizedVelocity,
        KalmanParam,
        KalmanReconsIMU,
        Model,
        RotoTrans,
        RotoTransNode,
        VecBiorbdIMU,
        Vector3d,
    )
    from biorbd import Rotation as Matrix

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "chain.bioMod"
        file.write_text(_biorbd_text(chain), encoding="utf-8")
        model = Model(str(file))
    rate_hz = 1.0 / float(np.median(np.diff(source.time_s)))
    kalman = KalmanReconsIMU(model, KalmanParam(rate_hz, noise_factor, error_factor))
    state = GeneralizedCoordinates(model), GeneralizedVelocity(model), GeneralizedAcceleration(model)
    matrices = {link.name: _complete(source, link.name).as_matrix() for link in chain}
    angles = np.empty((len(source.time_s), model.nbQ()))
    for i in range(len(angles)):
        units = VecBiorbdIMU()
        for link in chain:
            turn = Matrix(*(float(x) for x in matrices[link.name][i].ravel()))
            units.append(
                IMU(
                    RotoTransNode(RotoTrans(turn, Vector3d(0.0, 0.0, 0.0)), link.name, link.name), True, False
                )
            )
        kalman.reconstructFrame(model, units, *state)
        angles[i] = state[0].to_array()
    yield _posture(source, chain, angles)


def _biorbd_text(chain: Chain) -> str:
    parts, parent = ["version 4", "gravity 0 0 -9.81"], "base"
    for link in chain:
        parts.append(
            f"segment {link.name}\n parent {link.parent or parent}\n RTinMatrix 0\n RT 0 0 0 xyz 0 0 0\n"
            f" rotations {link.axes}\n"
            " mass 1\n inertia\n 0.01 0 0\n 0 0.01 0\n 0 0 0.01\n com 0 0 0\nendsegment\n"
            f"imu {link.name}_unit\n parent {link.name}\n RTinMatrix 0\n RT 0 0 0 xyz 0 0 0\n"
            " technical 1\n anatomical 0\nendimu"
        )
        parent = link.name
    return "\n".join(parts) + "\n"


def opensim(source: OrientationEstimate, chain: Chain) -> Iterator[ChainPosture]:
    """OpenSim's `InverseKinematicsSolver` as its OpenSense tool runs it: accuracy 1e-4, equal weights."""
    import opensim as osim

    osim.Logger.setLevelString("Off")
    model = _opensim_model(chain)
    orientations = osim.OrientationsReference(_opensim_table(source, chain))
    state = model.initSystem()
    solver = osim.InverseKinematicsSolver(
        model, osim.MarkersReference(), orientations, osim.SimTKArrayCoordinateReference()
    )
    solver.setAccuracy(1e-4)
    times_s = _opensim_times(source.time_s)
    state.setTime(float(times_s[0]))
    solver.assemble(state)
    names = [f"{link.name}_{i}" for link in chain for i in range(len(link.axes))]
    coordinates = [model.getCoordinateSet().get(name) for name in names]
    angles = np.empty((len(times_s), len(names)))
    for i, time_s in enumerate(times_s):
        state.setTime(float(time_s))
        solver.track(state)
        angles[i] = [coordinate.getValue(state) for coordinate in coordinates]
    yield _posture(source, chain, angles)


def _opensim_model(chain: Chain):  # type: ignore[no-untyped-def]
    """Pin joints in rows; those within a link have bodies of their own between them, next to weightless."""
    import opensim as osim

    # A pin turns about z of its two frames; these turns (body-fixed x, y, z) take z to the hinge's axis.
    pin_turn = {"x": (0.0, np.pi / 2, 0.0), "y": (-np.pi / 2, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}
    model = osim.Model()
    parent = model.getGround()
    for link in chain:
        parent = model.getBodySet().get(link.parent) if link.parent else parent
        for i, axis in enumerate(link.axes):
            last = i == len(link.axes) - 1
            body = osim.Body(
                link.name if last else f"{link.name}_{i}_turned", 1.0, osim.Vec3(0), osim.Inertia(0.01)
            )
            model.addBody(body)
            turn, none = osim.Vec3(*pin_turn[axis]), osim.Vec3(0)
            joint = osim.PinJoint(f"{link.name}_{i}_pin", parent, none, turn, body, none, turn)
            joint.updCoordinate().setName(f"{link.name}_{i}")
            model.addJoint(joint)
            parent = body
        parent.addComponent(osim.PhysicalOffsetFrame(f"{link.name}_unit", parent, osim.Transform()))
    model.finalizeConnections()
    return model


def _opensim_table(source: OrientationEstimate, chain: Chain):  # type: ignore[no-untyped-def]
    import opensim as osim

    quats = {link.name: quat_wxyz(_complete(source, link.name)) for link in chain}
    head = ["DataRate=100", "DataType=Quaternion", "version=3", "OpenSimVersion=4.6", "endheader"]
    rows = ["\t".join(["time", *(f"{link.name}_unit" for link in chain)])]
    for i, time_s in enumerate(_opensim_times(source.time_s)):
        cells = (",".join(repr(float(x)) for x in quats[link.name][i]) for link in chain)
        rows.append("\t".join([repr(float(time_s)), *cells]))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "orientations.sto"
        file.write_text("\n".join(head + rows) + "\n", encoding="utf-8")
        table = osim.TimeSeriesTableQuaternion(str(file))
    return osim.OpenSenseUtilities.convertQuaternionsToRotations(table)


def _opensim_times(time_s: Floats) -> Floats:
    return np.asarray(time_s - time_s[0])


def _complete(source: OrientationEstimate, body: str) -> Rotation:
    if np.isnan(source.quats[body]).any():
        raise NotRunError(f"{source.name} has no orientation of {body} at some times")
    return rotation(source.quats[body])


def _posture(source: OrientationEstimate, chain: Chain, angles_rad: Floats) -> ChainPosture:
    return ChainPosture(replace(source, quats=world_from_links(chain, angles_rad)), angles_rad)


# With its defaults biorbd's filter is soon lost in the chain's fast turns. These factors are the best of four that were
# tried on that recording.
SOLVERS: dict[str, Solver] = {
    "biorbd": biorbd,
    "biorbd tuned": partial(biorbd, noise_factor=1e-5, error_factor=1e-2),
    "OpenSim": opensim,
}


def on_chain(source: OrientationEstimate, chain: Chain) -> Iterator[tuple[Outcome, ChainPosture | None]]:
    """The orientations of one software forced onto a chain by each of the others, where they are installed."""
    for label, solve in SOLVERS.items():
        name = f"{source.name} + {label}"
        postures: list[ChainPosture] = []

        def estimates(
            solve: Solver = solve, name: str = name, postures: list[ChainPosture] = postures
        ) -> Iterator[OrientationEstimate]:
            postures += solve(source, chain)
            return (replace(posture.estimate, name=name) for posture in postures)

        for i, outcome in enumerate(attempt([name], estimates)):
            yield outcome, postures[i] if isinstance(outcome, OrientationEstimate) else None
