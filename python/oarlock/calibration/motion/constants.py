"""`Constants`: estimated lengths, sensor positions, mounts and zeros with covariance. Results of `calibrate_motion`."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock._core import Model
from oarlock.calibration.motion.searched_model import PLACE, ZERO
from oarlock.calibration.static.offset_parameters import place_parameters
from oarlock.model.rotation import matrix_from_quat, quat_from_rotvec
from oarlock.recording.calibration import Calibration, EncoderScale
from oarlock.storage.arrays import Bools, Floats

if TYPE_CHECKING:
    from oarlock._core import Belief


OBSERVABLE_SHARE = 0.1
"""A constant of which the movement took less than this share of the prior variance counts as not determined."""

_MOUNT = re.compile(r"(?P<unit>.+)\.mount_r[xyz]")


@dataclass(frozen=True, eq=False)
class Constants:
    """What was found of parameters, places, mounts and zeros.

    Args:
        names: as the engine names its states.
        units: "m" or "rad" of each.
        start: (n,) where the search began: values of parameters (m), else 0.
        moved: (n,) how far from there, m or rad.
        covariance: (n, n) of it.
        prior_std: (n,) before the search.
        of_wearing: (n,) whether each says how a unit sits on its link: mounts and positions.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Floats
    moved: Floats
    covariance: Floats
    prior_std: Floats
    of_wearing: Bools

    @classmethod
    def of(cls, belief: Belief, searched: Model, samples_per_error: float) -> Constants:
        """From the last belief of a search, whose covariances weigh all samples so many times too little."""
        document = tomllib.loads(searched.text)
        found = [(i, n) for i, n in enumerate(belief.state_names) if _is_constant(n)]
        rows, names = [i for i, _ in found], tuple(n for _, n in found)
        start = np.array([_start(name, searched) for name in names])
        weight = np.sqrt(samples_per_error)
        prior = weight * np.array([_prior(name, document) for name in names])
        covariance = samples_per_error * belief.covariance[np.ix_(rows, rows)]
        units = tuple(_unit(name, document) for name in names)
        places = {f"parameters.{name}" for name in place_parameters(searched)}
        worn = np.array([bool(_MOUNT.fullmatch(name)) or name in places for name in names])
        return cls(names, units, start, belief.mean[rows] - start, covariance, prior, worn)

    @property
    def std(self) -> Floats:
        """(n,) standard deviations."""
        deviations: Floats = np.sqrt(np.diag(self.covariance))
        return deviations

    @property
    def share(self) -> Floats:
        """(n,) of the prior variance, what the movement took away."""
        share: Floats = 1.0 - np.diag(self.covariance) / self.prior_std**2
        return share

    def surprise(self) -> float:
        """Root mean square change of the determined constants, in standard deviations of the prior."""
        moved = (self.moved / self.prior_std)[self.share >= OBSERVABLE_SHARE]
        return float(np.sqrt(np.mean(moved**2))) if len(moved) else 0.0

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of those that the movement hardly determines."""
        return tuple(n for n, share in zip(self.names, self.share, strict=True) if share < OBSERVABLE_SHARE)

    def parameters(self) -> dict[str, float]:
        """Values of lengths and sensor positions, m."""
        return {n.removeprefix("parameters."): v for n, v in self._values() if n.startswith("parameters.")}

    def units_with_mounts(self) -> list[str]:
        """Names of the inertial units whose mounts were sought."""
        return list(dict.fromkeys(match["unit"] for name in self.names if (match := _MOUNT.fullmatch(name))))

    def mount_rows(self, unit: str) -> list[int]:
        """Where the three components of a unit's mount are."""
        return [self.names.index(f"{unit}.mount_r{axis}") for axis in "xyz"]

    def mount_turn(self, unit: str) -> Floats:
        """(3, 3) how far a unit's mount turned, in the sensor's axes."""
        turn: Floats = matrix_from_quat(quat_from_rotvec(self.moved[self.mount_rows(unit)]))
        return turn

    def displaced(self, factor: float) -> Constants:
        """What is left of it if units are also displaced on their links by a constant.

        The displacement's variance D is `factor` times the prior one for mounts and positions, 0 for lengths
        and zeros. The readings alone have the information L = P^-1 - P0^-1. With the displacement it is (I + L D)^-1 L,
        which takes the place of L in the mean and in the covariance.
        """
        if not factor:
            return self
        prior, own = self.prior_std**2, np.linalg.inv(self.covariance)
        alone = own - np.diag(1.0 / prior)
        less = np.linalg.inv(np.eye(len(prior)) + alone * (factor * prior * self.of_wearing))
        covariance = np.linalg.inv(np.diag(1.0 / prior) + less @ alone)
        covariance = (covariance + covariance.T) / 2.0
        return replace(self, moved=covariance @ less @ own @ self.moved, covariance=covariance)

    def inflated(self, factor: float) -> Constants:
        """With variances so many times as large, and never above the prior's."""
        spread = np.minimum(np.sqrt(factor), self.prior_std / self.std)
        return replace(self, covariance=self.covariance * np.outer(spread, spread))

    def calibration(self, searched: Model, before: Calibration, parameters: set[str]) -> Calibration:
        """What was known before, with what was found; `parameters` are those of the user's model."""
        at = {name: i for i, name in enumerate(self.names)}
        values = self.parameters()
        sized = searched.with_parameters(values)
        units = {s.name: s.mount for s in sized.describe().inertial_units}
        turns = {unit: self.mount_rows(unit) for unit in units}
        turned = {u: np.asarray(m.rotation) @ self.mount_turn(u) for u, m in units.items()}
        places = {u: [at[f"parameters.{PLACE}_{u}_{a}"] for a in "xyz"] for u in units}
        return replace(
            before,
            parameters={**before.parameters, **{n: v for n, v in values.items() if n in parameters}},
            mounts={
                **before.mounts,
                **{u: (nearest_rotation(turned[u]), np.asarray(m.offset)) for u, m in units.items()},
            },
            parameter_stds={
                **before.parameter_stds,
                **{n: float(self.std[at[f"parameters.{n}"]]) for n in values if n in parameters},
            },
            mount_stds_rad={
                **before.mount_stds_rad,
                **{
                    u: _std_in_link(turned[u], self.covariance[np.ix_(rows, rows)])
                    for u, rows in turns.items()
                },
            },
            mount_offset_stds_m={
                **before.mount_offset_stds_m,
                **{u: self.std[rows] for u, rows in places.items()},
            },
            encoders={**before.encoders, **self.encoders(before)},
        )

    def _values(self) -> list[tuple[str, float]]:
        return [(n, float(v)) for n, v in zip(self.names, self.start + self.moved, strict=True)]

    def encoders(self, before: Calibration) -> dict[str, EncoderScale]:
        """The joint stands `moved` beyond what its encoder says, after what was known of it."""
        found = {}
        for name, moved in zip(self.names, self.moved, strict=True):
            if name.startswith(f"{ZERO}_"):
                encoder = name.removeprefix(f"{ZERO}_")
                older = before.encoders.get(encoder, EncoderScale(0.0))
                found[encoder] = EncoderScale(older.zero - float(moved) / older.scale, older.scale)
        return {name: scale for name, scale in found.items() if scale != EncoderScale(0.0)}


def nearest_rotation(matrix: Floats) -> Floats:
    """The rotation nearest to a matrix that is nearly one."""
    return np.asarray(Rotation.align_vectors(matrix.T, np.eye(3))[0].as_matrix())


def _std_in_link(rotation: Floats, covariance: Floats) -> Floats:
    deviations: Floats = np.sqrt(np.diag(rotation @ covariance @ rotation.T))
    return deviations


def _is_constant(name: str) -> bool:
    return name.startswith("parameters.") or bool(_MOUNT.fullmatch(name)) or name.startswith(f"{ZERO}_")


def _unit(name: str, document: dict[str, Any]) -> str:
    kinds = {joint["name"]: joint["kind"] for joint in document["joint"]}
    return "m" if name.startswith("parameters.") or kinds.get(name) == "slide" else "rad"


def _start(name: str, searched: Model) -> float:
    parameter = name.removeprefix("parameters.")
    return searched.parameters[parameter] if parameter != name else 0.0


def _prior(name: str, document: dict[str, Any]) -> float:
    if name.startswith("parameters."):
        return float(document["parameters"][name.removeprefix("parameters.")]["std"])
    if match := _MOUNT.fullmatch(name):
        units = {s["name"]: s for s in document["sensor"]}
        return float(units[match["unit"]]["mount"]["std_rad"])
    return next(float(j["process"]["start_std"][0]) for j in document["joint"] if j["name"] == name)
