"""Result of inverse kinematics from markers: coordinates, residuals, and undetermined coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from oarlock import _core
from oarlock.evaluation.markers.attachments import Attachment
from oarlock.evaluation.markers.gaps import stretches
from oarlock.model.coordinates import coordinate_units, parts
from oarlock.model.rotation import continuous_quat, quat_from_rotvec, rotvec_from_quat
from oarlock.simulation.motion import Motion
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError
from oarlock.tracking.track import Track, track_without_filter

if TYPE_CHECKING:
    from oarlock._core import Model


@dataclass(frozen=True, eq=False)
class PostureFit:
    """Result of `inverse_kinematics`: joint values over time.

    Args:
        model: the fitted model.
        time_s: (T,) stamps of the markers, s.
        q: (T, n_coordinates) in the model's order, rad or m; always finite: undetermined coordinates stay near their
            neighbours or in the middle of their soft limits.
        q_std: standard deviations from the normal equations with the attachments' `std_m`, enlarged if the residuals
            are larger; for a rotation, those of the error about the child's axes.
        determined: (T, n_coordinates) whether the markers of that frame determine the coordinate at least five times
            better than its soft limits do.
        settled: (T,) whether the iteration converged.
        attachments: the attachments that were used.
        residual_m: (T, n, 3) marker minus model point, root axes, m; NaN where not visible.
        noise_scale: root mean square of the residuals in their standard deviations; 1 if `std_m` are right.
    """

    model: Model
    time_s: Floats
    q: Floats
    q_std: Floats
    determined: Bools
    settled: Bools
    attachments: tuple[Attachment, ...]
    residual_m: Floats
    noise_scale: float

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the columns of `q`."""
        return tuple(self.model.coordinate_names)

    @property
    def rmse_m(self) -> dict[str, float]:
        """Root mean square distance of each marker from its point on the model, m; NaN if never visible."""
        squares = np.sum(self.residual_m**2, axis=2)
        seen = np.isfinite(squares)
        count = np.maximum(seen.sum(axis=0), 1)
        mean = np.where(seen.any(axis=0), np.where(seen, squares, 0.0).sum(axis=0) / count, np.nan)
        return {a.marker: float(np.sqrt(m)) for a, m in zip(self.attachments, mean, strict=True)}

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on joints that are undetermined, always or at times, and on frames without convergence."""
        never = [
            name for name, d in zip(self.coordinate_names, self.determined.T, strict=True) if not d.any()
        ]
        found = [f"not determined by these markers: {', '.join(never)}"] if never else []
        for name, d in zip(self.coordinate_names, self.determined.T, strict=True):
            if d.any() and not d.all():
                found.append(
                    f"{name}: not determined in {int((~d).sum())} of {len(d)} frames{self._where(~d)}"
                )
        if not self.settled.all():
            where = self._where(~self.settled)
            found.append(
                f"no convergence in {int((~self.settled).sum())} of {len(self.settled)} frames{where}"
            )
        return tuple(found)

    def motion(self, longest_s: float = 0.2) -> Motion:
        """A motion for simulated sensors. It interpolates the frames unchanged: filter the markers first.

        Args:
            longest_s: stretches up to this length in which a coordinate is undetermined are bridged by a spline, s.
                A coordinate that is never determined has the values of `q`.

        Raises:
            DataError: a coordinate is undetermined for longer, or at an end; the message says which and when. Cut the
            markers there.
        """
        q = np.array(self.q)
        for part in parts(self.coordinate_names):
            columns = list(part.columns)
            lost = np.asarray(~self.determined[:, columns].all(axis=1))
            if not lost.any() or lost.all():
                continue
            self._check_short(part.name, lost, longest_s)
            if part.kind == "rotation":
                quat = continuous_quat(quat_from_rotvec(q[:, columns]))[~lost]
                q[:, columns] = rotvec_from_quat(
                    CubicSpline(self.time_s[~lost], continuous_quat(quat))(self.time_s)
                )
            else:
                q[:, columns] = CubicSpline(self.time_s[~lost], q[~lost][:, columns])(self.time_s)
        return Motion(self.coordinate_names, self.time_s, q)

    def track(self) -> Track:
        """The values as a `Track`, NaN where undetermined, for evaluation or display."""
        q = np.where(self.determined, self.q, np.nan)
        provenance: dict[str, Any] = {
            "oarlock": _core.__version__,
            "model": self.model.name,
            "parameters": self.model.parameters,
            "markers": [a.marker for a in self.attachments],
        }
        return track_without_filter(self.model, self.time_s, q, provenance=provenance)

    def rows(self) -> tuple[dict[str, Any], ...]:
        """One row for each coordinate, in deg or mm: range, median standard deviation, share of determined frames."""
        found = []
        units = coordinate_units(self.model)
        for k, name in enumerate(self.coordinate_names):
            determined = self.determined[:, k]
            factor, unit = (180.0 / np.pi, "deg") if units[k] == "rad" else (1e3, "mm")
            q, std = factor * self.q[determined, k], factor * self.q_std[determined, k]
            low, high = (float(q.min()), float(q.max())) if determined.any() else (np.nan, np.nan)
            middle = float(np.median(std)) if determined.any() else np.nan
            share = float(determined.mean())
            found.append(
                {
                    "joint": name,
                    "unit": unit,
                    "lowest": low,
                    "highest": high,
                    "std": middle,
                    "determined": share,
                }
            )
        return tuple(found)

    def _check_short(self, name: str, lost: Bools, longest_s: float) -> None:
        for first, last in stretches(lost):
            start, end = self.time_s[first], self.time_s[min(last, len(lost) - 1)]
            at_end = first == 0 or last == len(lost)
            if at_end or end - start > longest_s * (1.0 + 1e-9):
                raise DataError(
                    f"motion from markers: {name} is not determined from {start:.3f} to {self.time_s[last - 1]:.3f} s"
                    + (", at an end of the trial" if at_end else f", which is longer than {longest_s:g} s")
                    + ". Cut the markers to a stretch in which it is determined (between), or attach more markers."
                )

    def _where(self, rows: Bools) -> str:
        first, last = next(stretches(rows))
        return f", first from {self.time_s[first]:.3f} to {self.time_s[last - 1]:.3f} s"
