"""A stretch of movement in two parts: one to search in, one to judge by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from oarlock._core import Config, Model
from oarlock.calibration import Calibration
from oarlock.errors import DataError, DivergedError
from oarlock.motion_calibration.hypothesis import Hypothesis
from oarlock.motion_calibration.searched_model import searched_model
from oarlock.tracking import track

if TYPE_CHECKING:
    from oarlock._core import Belief
    from oarlock.recording import Recording

LEAST_S = 8.0
"""Some cycles of the movement to search in, and one or two to judge by."""
SETTLED_S = 1.0
"""What comes before is the start's."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """What was recorded, and what the plain filter says of it.

    Args:
        model: as the user has it.
        known: before the search.
        whole: all of the stretch, as measured.
        first: what is searched in.
        rest: what is held out.
        azimuth_rad: of the magnetic field by the plain filter; None without magnetometers.
        posture: at the start, by the plain filter, rad or m; None if a joint has no single value.
    """

    model: Model
    known: Calibration
    whole: Recording
    first: Recording
    rest: Recording
    azimuth_rad: float | None
    posture: tuple[float, ...] | None

    @classmethod
    def of(cls, model: Model, known: Calibration, whole: Recording, held_out: float) -> Stretch:
        """The stretch, tracked once as it would be without a search.

        Raises:
            DataError: it is too short, has no inertial unit or no loop, or `held_out` is odd.
            DivergedError: the plain filter loses it.
        """
        _check(model, whole, held_out)
        cut_s = whole.end_s - held_out * whole.duration_s
        first, rest = whole.slice(end_s=cut_s), whole.slice(start_s=cut_s)
        plain = track(model, first, known)
        azimuth = plain.slow["azimuth"].value if "azimuth" in plain.slow else None
        scalar = plain.q.shape[1] == len(model.joint_names)
        begun = np.nan_to_num(plain.q[0]) if scalar else None
        return cls(
            model,
            known,
            whole,
            first,
            rest,
            None if azimuth is None else float(np.median(azimuth)),
            None if begun is None else tuple(float(x) for x in begun),
        )

    def search(self, hypothesis: Hypothesis, part: Recording) -> tuple[Model, Belief]:
        """The model with all constants as unknowns, and the belief after a part.

        Raises:
            DivergedError: the filter loses the track.
        """
        encoders = [s["name"] for s in self.model.describe()["sensors"] if s["kind"] == "encoder"]
        zeros = [name for name in encoders if name in part]
        searched = searched_model(
            self.model, self.known, hypothesis, azimuth_rad=self.azimuth_rad, zeros_of=zeros
        )
        pushes = [base["name"] for base in searched.describe()["base_acceleration"]]
        estimate = ("gyro_bias", "accel_bias", *pushes, "mounts", "lengths")
        config = Config(estimate=estimate, initial_q=self._start(searched))
        corrections = replace(
            self.known,
            parameters={},
            mounts={},
            parameter_stds={},
            mount_stds_rad={},
            mount_offset_stds_m={},
        )
        belief = track(searched, part, corrections, config).last_belief
        if belief is None:
            raise DivergedError("calibrate motion: the search ended without a belief")
        return searched, belief

    def _start(self, searched: Model) -> list[float] | None:
        if self.posture is None:
            return None
        begun = dict(zip(self.model.joint_names, self.posture, strict=True))
        return [begun.get(name, 0.0) for name in searched.joint_names]

    def judge(self, hypothesis: Hypothesis) -> Model:
        """The model under a hypothesis, its constants as the calibration says."""
        return searched_model(
            self.model, Calibration(), hypothesis, azimuth_rad=self.azimuth_rad, constants=False
        )


def nis_per_reading(judge: Model, part: Recording, calibration: Calibration) -> float:
    """Squared innovations over their variance, per reading, without learning of noise; infinite if it diverges."""
    try:
        tracked = track(judge, part, calibration, Config(learning_memory_s=None))
    except DivergedError:
        return float("inf")
    info = tracked.info
    if info is None:
        return float("inf")
    nis = info.nis[tracked.time_s >= tracked.time_s[0] + SETTLED_S]
    used = info.used[tracked.time_s >= tracked.time_s[0] + SETTLED_S]
    heard = np.isfinite(nis) & (used > 0)
    return float(nis[heard].sum() / used[heard].sum()) if heard.any() else float("inf")


def _check(model: Model, whole: Recording, held_out: float) -> None:
    described = model.describe()
    if not described["closures"]:
        raise DataError(
            f'calibrate motion: model "{model.name}" has no closure. Only a closed loop tells mounts and lengths '
            "while the body moves as it likes; see oarlock calibrate axes, joints and pose"
        )
    units = [s["name"] for s in described["sensors"] if s["kind"] == "imu" and s["name"] in whole]
    if not units:
        raise DataError(f"calibrate motion: the recording has no inertial unit of the model ({model.name})")
    if not 0.1 <= held_out <= 0.5:
        raise DataError(f"calibrate motion: held_out = {held_out:g}; expected a share of 0.1 to 0.5")
    if not whole.duration_s >= LEAST_S:
        raise DataError(
            f"calibrate motion: the stretch lasts {whole.duration_s:.1f} s; expected at least {LEAST_S:g} s of "
            "movement, better 20 s to some minutes"
        )
