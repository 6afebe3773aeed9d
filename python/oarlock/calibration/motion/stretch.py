"""`CalibrationData`: a part of a recording, split into data for `calibrate_motion` to fit and data to score it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from oarlock._core import Config, Model
from oarlock.calibration.motion.constants import Constants
from oarlock.calibration.motion.hypothesis import Hypothesis
from oarlock.calibration.motion.restart import joined, restarted
from oarlock.calibration.motion.searched_model import searched_model
from oarlock.recording.calibration import Calibration, EncoderScale
from oarlock.storage.errors import DataError, DivergedError
from oarlock.storage.progress import Told, share
from oarlock.tracking.tracking import track

if TYPE_CHECKING:
    from oarlock._core import Belief
    from oarlock.recording.recording import Recording
    from oarlock.tracking.track import Track

LEAST_S = 8.0
"""Some cycles of the movement to search in, and one or two to judge by."""
SETTLED_S = 1.0
"""What comes before is the start's."""


Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class CalibrationData:
    """What was recorded, and what the plain filter says of it.

    Args:
        model: as the user has it.
        known: before the search.
        whole: all of the stretch, as measured.
        first: what is searched in.
        rest: what is held out.
        azimuth_rad: of the magnetic field by the plain filter; None without magnetometers.
        postures: at the start and where the held-out part begins, by the plain filter, rad or m; None if a joint has
            no single value.
        told: called with the share done of the current search; None is never called.
    """

    model: Model
    known: Calibration
    whole: Recording
    first: Recording
    rest: Recording
    azimuth_rad: float | None
    postures: tuple[tuple[float, ...], tuple[float, ...]] | None
    told: Told | None = None

    @classmethod
    def of(
        cls, model: Model, known: Calibration, whole: Recording, held_out: float, told: Told | None
    ) -> CalibrationData:
        """The stretch, tracked once as it would be without a search.

        Raises:
            DataError: it is too short, has no inertial unit or no loop, or `held_out` is odd.
            DivergedError: the plain filter loses it.
        """
        _check(model, whole, held_out)
        cut_s = whole.end_s - held_out * whole.duration_s
        first, rest = whole.slice(end_s=cut_s), whole.slice(start_s=cut_s)
        plain = track(model, whole, known, Config(structure="tree"), progress=told)
        azimuth = plain.slow["azimuth"].value if "azimuth" in plain.slow else None
        scalar = plain.q.shape[1] == len(model.joint_names)
        rows = (0, min(int(np.searchsorted(plain.time_s, cut_s)), len(plain.time_s) - 1))
        begun, cut = (tuple(float(x) for x in np.nan_to_num(plain.q[row])) for row in rows)
        return cls(
            model,
            known,
            whole,
            first,
            rest,
            None if azimuth is None else float(np.median(azimuth)),
            (begun, cut) if scalar else None,
        )

    def search(self, hypothesis: Hypothesis, part: Recording) -> tuple[Model, Constants]:
        """The model with all constants as unknowns, and what was found after a part, searched twice.

        If the filter loses the track about what the first search found, that is the result.

        Raises:
            DivergedError: the filter loses the track in the first search.
        """
        searched = self._searched(hypothesis, part)
        weight = hypothesis.samples_per_error
        first = Constants.of(
            self._searched_through(searched, part, self.known.encoders, (0.0, 0.4)), searched, weight
        )
        again = restarted(searched, first)
        encoders = {**self.known.encoders, **first.encoders(self.known)}
        try:
            belief = self._searched_through(again, part, encoders, (0.4, 0.8))
        except DivergedError:
            return searched, first
        return searched, joined(first, Constants.of(belief, again, weight))

    def _searched(self, hypothesis: Hypothesis, part: Recording) -> Model:
        encoders = [s.name for s in self.model.describe().encoders]
        zeros = [name for name in encoders if name in part]
        return searched_model(
            self.model, self.known, hypothesis, azimuth_rad=self.azimuth_rad, zeros_of=zeros
        )

    def _searched_through(
        self, searched: Model, part: Recording, encoders: Mapping[str, EncoderScale], done: Span
    ) -> Belief:
        """The belief after a part, with these zeros of encoders as start; `done`: shares of the search."""
        pushes = [base.name for base in searched.describe().base_acceleration]
        estimate = ("gyro_bias", "accel_bias", *pushes, "mounts", "lengths")
        config = Config(estimate=estimate, initial_q=self._posture(searched, 0))
        corrections = replace(
            self.known,
            parameters={},
            mounts={},
            parameter_stds={},
            mount_stds_rad={},
            mount_offset_stds_m={},
            encoders=encoders,
        )
        belief = track(searched, part, corrections, config, progress=share(self.told, *done)).last_belief
        if belief is None:
            raise DivergedError("calibrate motion: the search ended without a belief")
        return belief

    def _posture(self, searched: Model, part: int) -> list[float] | None:
        if self.postures is None:
            return None
        begun = dict(zip(self.model.joint_names, self.postures[part], strict=True))
        return [begun.get(name, 0.0) for name in searched.joint_names]

    def held_out_nis(
        self, hypothesis: Hypothesis, calibration: Calibration, done: Span = (0.8, 1.0)
    ) -> float:
        """Squared innovations over their variance, per reading of the held-out part; infinite if the filter is lost.

        Noise is what the hypothesis says, so that calibrations compare.
        """
        judge = searched_model(
            self.model, Calibration(), hypothesis, azimuth_rad=self.azimuth_rad, constants=False
        )
        config = Config(initial_q=self._posture(judge, 1))
        try:
            tracked = track(judge, self.rest, calibration, config, progress=share(self.told, *done))
        except DivergedError:
            return float("inf")
        return _nis_per_reading(tracked)


def _nis_per_reading(tracked: Track) -> float:
    info, settled = tracked.info, tracked.time_s >= tracked.time_s[0] + SETTLED_S
    if info is None:
        return float("inf")
    nis, used = info.nis[settled], info.used[settled]
    heard = np.isfinite(nis) & (used > 0)
    return float(nis[heard].sum() / used[heard].sum()) if heard.any() else float("inf")


def _check(model: Model, whole: Recording, held_out: float) -> None:
    described = model.describe()
    if not described.closures:
        raise DataError(
            f'calibrate motion: model "{model.name}" has no closure. Free movement determines mounts and lengths '
            "only with a closed loop. Use oarlock calibrate axes, joints or pose"
        )
    units = [s.name for s in described.inertial_units if s.name in whole]
    if not units:
        raise DataError(f"calibrate motion: the recording has no inertial unit of the model ({model.name})")
    if not 0.1 <= held_out <= 0.5:
        raise DataError(f"calibrate motion: held_out = {held_out:g}; expected a share of 0.1 to 0.5")
    if not whole.duration_s >= LEAST_S:
        raise DataError(
            f"calibrate motion: the stretch lasts {whole.duration_s:.1f} s; expected at least {LEAST_S:g} s of "
            "movement, better 20 s to some minutes"
        )
