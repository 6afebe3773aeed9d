"""`simulate_from_markers`: simulated sensors along a motion that markers recorded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
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
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.progress import Progress
from oarlock.storage.write_file import write_file
from oarlock.tracking.track import Track

if TYPE_CHECKING:
    from oarlock._core import Model


@dataclass(frozen=True, eq=False)
class MarkerStudy:
    """Simulated sensors on a measured movement, with the intermediate results.

    Args:
        filled: the markers after filling of gaps, before the low-pass filter.
        markers: the markers to which the postures were fitted: filled, filtered, in root axes.
        fit: the postures.
        truth: the movement as a track.
        recording: the simulated readings of the model's sensors.
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
        with replaced_folder(folder, "recording") as place:
            self.recording.save(place)
            self.truth.save(place / "truth")
            self.markers.save(place / "markers.trc")
            write_file(place / "gaps.csv", gaps_text(self.gaps))


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
    progress: Progress = None,
) -> MarkerStudy:
    """Simulate inertial units on a movement recorded with markers, after section 4.1 of the paper.

    Gaps up to `longest_s` are filled by splines, positions are filtered at `cutoff_hz` without delay, joint values are
    fitted on the model's tree, and the model's sensors are simulated on this movement with noise and biases. The ground
    truth is the fitted movement, so errors of the fit are not part of a track's errors.

    Args:
        model: with the person's lengths and the sensors to be simulated.
        markers: the recorded markers; those without attachment are ignored.
        attachments: positions of the markers on the model.
        longest_s: longest gap that is filled, and longest stretch without enough markers that is bridged, s.
        cutoff_hz: cut-off of the low-pass filter, Hz; None does not filter.
        root_from_markers: as for `inverse_kinematics`.
        start_q: as for `inverse_kinematics`.
        sensors: as for `oarlock.simulate`, as are the following arguments.
        seed: seed of the noise.
        rate_hz: sampling rate of the sensors, Hz.
        noise: white noise of the model file, none, or standard deviations by sensor.
        gyro_bias_rad_s: bias of all units, or by name.
        accel_bias_m_s2: bias of all units, or by name.
        progress: True shows a bar or lines; a function is called regularly with the share done, 0 to 1.

    Raises:
        DataError: as in the functions that it calls; or a joint is undetermined for longer than `longest_s`.
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
