"""`simulate_from_markers`: simulated sensors along a motion that markers recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from oarlock.evaluation.markers.attachments import GivenAttachments, attachments_of
from oarlock.evaluation.markers.gaps import FilledMarkers, Gap, fill_gaps, gaps_text
from oarlock.evaluation.markers.inverse_kinematics import inverse_kinematics
from oarlock.evaluation.markers.low_pass import low_pass
from oarlock.evaluation.markers.posture_fit import PostureFit
from oarlock.evaluation.markers.trajectories import Markers
from oarlock.recording.recording import Recording
from oarlock.simulation.simulate import simulate
from oarlock.tracking.track import Track

if TYPE_CHECKING:
    from oarlock._core import Model


@dataclass(frozen=True, eq=False)
class MarkerStudy:
    """Virtual sensors on a measured movement, and what led to them.

    Args:
        filled: the markers with their gaps, before the filter.
        markers: what the postures were fitted to: filled, filtered, in root axes.
        fit: the postures.
        truth: the movement as a track.
        recording: what the model's sensors would have measured.
    """

    filled: FilledMarkers
    markers: Markers
    fit: PostureFit
    truth: Track
    recording: Recording

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """Every gap of the markers that were used, filled or not."""
        return self.filled.gaps

    def save(self, folder: Path) -> None:
        """Write the recording, the truth into `truth/`, the markers into `markers.trc`, the gaps into `gaps.csv`."""
        self.recording.save(folder)
        self.truth.save(folder / "truth")
        self.markers.save(folder / "markers.trc")
        (folder / "gaps.csv").write_text(gaps_text(self.gaps), encoding="utf-8")


def simulate_from_markers(
    model: Model,
    markers: Markers,
    attachments: GivenAttachments,
    *,
    longest_s: float = 0.2,
    cutoff_hz: float | None = 10.0,
    root_from_markers: ArrayLike | None = None,
    start_q: Mapping[str, float] | ArrayLike | None = None,
    sensors: Iterable[str] | None = None,
    seed: int = 0,
    rate_hz: float = 125.0,
    noise: bool | Mapping[str, Mapping[str, float]] = True,
    gyro_bias_rad_s: Mapping[str, Any] | float = 0.0,
    accel_bias_m_s2: Mapping[str, Any] | float = 0.0,
    progress: Callable[[float], object] | None = None,
) -> MarkerStudy:
    """What inertial units would have measured while the markers were recorded: section 4.1 of the published method.

    Gaps up to `longest_s` are filled by splines, positions filtered at `cutoff_hz` without delay, joint values fitted
    on the model's tree, and the model's sensors simulated on the resulting movement with noise and biases. The truth
    is the fitted movement: what the fit got wrong about the person is not in the errors of a track.

    Args:
        model: with the person's lengths and the sensors to be simulated.
        markers: of the session; those that are not attached are passed over.
        attachments: where markers sit on the model.
        longest_s: of a gap that is filled, and of a stretch without enough markers that is bridged, s.
        cutoff_hz: of the low-pass; None leaves the positions as they are.
        root_from_markers: as `inverse_kinematics`; `start_q` too.
        start_q: a posture near the one where the search begins.
        sensors: as `oarlock.simulate`, like those that follow.
        seed: of the noise.
        rate_hz: of the sensors.
        noise: white noise as the model says, none, or by sensor.
        gyro_bias_rad_s: of all units, or by name.
        accel_bias_m_s2: of all units, or by name.
        progress: told the share that is done, 0 to 1.

    Raises:
        DataError: as the functions that it calls; a joint that the markers lose for longer than `longest_s`.
    """
    wanted = [a.marker for a in attachments_of(attachments) if a.marker in markers.names]
    filled = fill_gaps(markers.select(wanted) if wanted else markers, longest_s)
    smooth = filled.markers if cutoff_hz is None else low_pass(filled.markers, cutoff_hz)
    placed = smooth if root_from_markers is None else smooth.moved(root_from_markers)
    fit = inverse_kinematics(
        model, placed, attachments, added_std_m=filled.std_m, start_q=start_q, progress=progress
    )
    truth, recording = simulate(
        model,
        fit.motion(longest_s),
        sensors,
        seed,
        rate_hz=rate_hz,
        noise=noise,
        gyro_bias_rad_s=gyro_bias_rad_s,
        accel_bias_m_s2=accel_bias_m_s2,
    )
    source = {"format": "markers", "markers": list(fit.rmse_m), "cutoff_hz": cutoff_hz or 0.0, "seed": seed}
    return MarkerStudy(filled, placed, fit, truth, Recording(recording.streams, {"source": source}))
