"""A model with the values of a calibration applied (`Worn`), and the result of a search as a new calibration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.calibration.static.link_pairs import ROOT, LinkPair
from oarlock.recording.calibration import Calibration
from oarlock.recording.inertial_units import readings
from oarlock.recording.recording import Recording
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Mount

EXACT_STD_RAD = 1e-6
"""Standard deviation of what is known exactly: the root's own axes, and of mounts without any."""


@dataclass(frozen=True, eq=False)
class Worn:
    """A model and the mounts of all its inertial units.

    Args:
        model: with the calibration's parameters.
        rotations: unit, and `ROOT` -> (3, 3), link from sensor.
        offsets: unit -> (3,) m, in the link's axes.
        mount_stds_rad: unit -> (3,) standard deviations of the rotation about the link's axes.
        before: what was known.
    """

    model: Model
    rotations: Mapping[str, Floats]
    offsets: Mapping[str, Floats]
    mount_stds_rad: Mapping[str, Floats]
    before: Calibration

    @classmethod
    def of(cls, model: Model, calibration: Calibration | None) -> Worn:
        """The model's own mounts where the calibration has none."""
        before = Calibration() if calibration is None else calibration
        sized = model.with_parameters(before.parameters)
        mounts = {s.name: s.mount for s in model.describe(before).inertial_units}
        own = {name: np.full(3, mount.std_rad) for name, mount in mounts.items()}
        given = {**own, **before.mount_stds_rad}
        stds: dict[str, Floats] = {name: np.maximum(std, EXACT_STD_RAD) for name, std in given.items()}
        rotations = {name: np.asarray(m.rotation) for name, m in mounts.items()}
        offsets = {name: np.asarray(m.offset) for name, m in mounts.items()}
        rotations[ROOT], offsets[ROOT] = np.eye(3), np.zeros(3)
        return cls(sized, rotations, offsets, stds, before)

    def levers(self, pair: LinkPair) -> tuple[Floats, Floats]:
        """(3,) each: from the joint of a pair to both of its units, in their own axes, m."""
        assert pair.center is not None
        both = np.concatenate([self.offsets[name] for name in pair.units]) - pair.center
        first, second = (self.rotations[n].T @ both[3 * i : 3 * i + 3] for i, n in enumerate(pair.units))
        return np.asarray(first), np.asarray(second)

    def read(self, pair: LinkPair, recording: Recording) -> tuple[dict[str, Any], dict[str, Any]]:
        """The columns of both units of a pair; the root's are those of a unit at rest."""
        child = readings(recording[pair.child])
        if pair.parent != ROOT:
            return readings(recording[pair.parent]), child
        world = self.model.describe().world
        rest = np.zeros((len(child["time_s"]), 3))
        up = rest + np.asarray(world.up) * world.gravity_m_s2
        return child | {"name": ROOT, "gyro_rad_s": rest, "accel_m_s2": up, "mag_ut": None}, child

    def calibrated(
        self,
        mounts: Mapping[str, Mount],
        noted: Mapping[str, Any],
        parameters: Mapping[str, float] | None = None,
        *,
        mount_stds_rad: Mapping[str, Floats] | None = None,
        mount_offset_stds_m: Mapping[str, Floats] | None = None,
    ) -> Calibration:
        """What was known before, with what was found in its place; `noted` keeps the older notes under ``before``.

        Standard deviations of what is replaced by another value go with it, unless new ones are given.
        """
        before, sized = self.before, parameters or {}
        older = {"before": dict(before.noted)} if before.noted else {}
        turned = {n for n, (r, _) in mounts.items() if not np.array_equal(r, self.rotations[n])}
        moved = {n for n, (_, o) in mounts.items() if not np.array_equal(o, self.offsets[n])}
        return replace(
            before,
            parameters={**before.parameters, **sized},
            mounts={**before.mounts, **mounts},
            noted={**noted, **older},
            parameter_stds={n: s for n, s in before.parameter_stds.items() if n not in sized},
            mount_stds_rad={n: s for n, s in before.mount_stds_rad.items() if n not in turned}
            | dict(mount_stds_rad or {}),
            mount_offset_stds_m={n: s for n, s in before.mount_offset_stds_m.items() if n not in moved}
            | dict(mount_offset_stds_m or {}),
        )
