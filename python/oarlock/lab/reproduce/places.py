"""Positions of frames with their standard deviations from a track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock import Track
from oarlock.lab.reproduce.contents import Floats

NO_BAND_M = 1e-9


@dataclass(frozen=True)
class PlaceBand:
    """A frame's position at the track's beliefs: mean (K, 3) and covariance (K, 3, 3), m, in root axes."""

    time_s: Floats
    position_m: Floats
    covariance_m2: Floats

    def half_band(self, time_s: Floats) -> Floats:
        """Half of the 95 % band (T, 3), m, linear between beliefs."""
        std = np.sqrt(np.einsum("kii->ki", self.covariance_m2))
        return np.stack([1.96 * np.interp(time_s, self.time_s, std[:, axis]) for axis in range(3)], axis=1)

    def nees(self, truth_m: Floats) -> float:
        """Mean of (error / std)^2 over beliefs and axes (Bar-Shalom et al. 2001, section 5.4); truth (K, 3).

        Axes along which the frame cannot move in the model (a shoulder sideways) have no band and are left out.
        """
        return float(np.nanmean(self._ratio(truth_m) ** 2))

    def coverage(self, truth_m: Floats) -> float:
        """Share of beliefs and axes inside the 95 % band, of those that have one; truth (K, 3)."""
        ratio = self._ratio(truth_m)
        return float(np.mean(np.abs(ratio[np.isfinite(ratio)]) <= 1.96))

    def _ratio(self, truth_m: Floats) -> Floats:
        std = np.sqrt(np.einsum("kii->ki", self.covariance_m2))
        error = self.position_m - truth_m
        return np.asarray(np.divide(error, std, out=np.full_like(std, np.nan), where=std > NO_BAND_M))


def place_band(track: Track, frame: str, start_s: float) -> PlaceBand:
    """Position and covariance to first order around each belief.

    Input coordinates and lengths that are not states count as exact.
    """
    beliefs, model = track.beliefs, track.model
    if beliefs is None or model is None:
        raise ValueError("a track without beliefs has no bands")
    names = [name for name in track.coordinate_names if name in beliefs.state_names]
    columns = [track.coordinate_names.index(name) for name in names]
    states = [beliefs.state_names.index(name) for name in names]
    kept = beliefs.time_s >= track.time_s[0] + start_s
    q = np.zeros((int(kept.sum()), len(track.coordinate_names)))
    q[:, columns] = beliefs.mean[kept][:, states]
    place = model.forward_kinematics(q)[:, model.frame_names.index(frame), :3, 3]
    slopes = model.frame_jacobian(q, [frame]).by_coordinate[:, 0, :3][..., columns]
    covariance = beliefs.covariance[kept][:, states][:, :, states]
    return PlaceBand(
        np.asarray(beliefs.time_s[kept]), place, np.einsum("kia,kab,kjb->kij", slopes, covariance, slopes)
    )
