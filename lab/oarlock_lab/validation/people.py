"""People against optics: seated people in a sports wheelchair. Scored by `python -m oarlock_lab.validation`.

The recordings stay where they are; only figures are published. Units and clusters of markers have clocks and axes of
their own: both are found from angular velocities, never from the track that is judged.
"""

from __future__ import annotations

import csv
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.optimize import minimize_scalar
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation, Slerp

import oarlock
from oarlock import Calibration, Config, Recording, Track
from oarlock.storage.arrays import Bools, Floats, Indices
from oarlock.storage.statistics import NORMAL_95

from . import chains
from .chains import Link
from .estimate import Missing, OrientationEstimate, Outcome, attempt
from .results import ResultRow, ResultTable, SetResult
from .rotations import quat_wxyz, rotation

NAME, FOLDER = "people", "people"
TITLE = "People against optics"
TEXT = (
    "Seated people who bend, reach, push and turn in a sports wheelchair: units on low back, upper back and upper "
    "arms, 50 Hz, each on its own clock; clusters of optical markers on the units "
    "(github.com/aagdebruijn1/Python_cleaned, no licence stated: not shipped). The reference is good to 1.5 to 3 deg. "
    "Whole recordings are tracked with the model `upper_body`, nominal lengths and units' positions by eye; mounts "
    "come from the first optical frame that shows all clusters. Scored from there on: tilt of each segment, relative "
    "orientation of neighbours after one constant heading, and with headings set in the first 0.3 s. Median and worst "
    "of all segments or pairs, deg. Bands: share of the components of the relative rotation in their 95 % bands with "
    "1.5 deg of reference noise, and mean squared error over variance. The settings of the body model were chosen on "
    "these trials. OpenSense, with accuracy 1e-4 and equal weights, puts VQF's orientations of the same start on the "
    "joints of `upper_body` without limits. These joints allow every orientation of these segments, so it returns "
    "VQF's."
)
UNIT = {"pelvis": "Chest", "thorax": "Back", "upper_arm_l": "L_arm", "upper_arm_r": "R_Arm"}
CLUSTER = {
    "pelvis": "low_back",
    "thorax": "upper_back",
    "upper_arm_l": "left_upper_arm",
    "upper_arm_r": "right_upper_arm",
}
PAIRS = (("pelvis", "thorax"), ("thorax", "upper_arm_l"), ("thorax", "upper_arm_r"))
OFFSETS_M = {
    "pelvis": [-0.10, 0.073, 0.0],
    "thorax": [-0.10, 0.07, 0.0],
    "upper_arm_l": [0.0, -0.163, -0.042],
    "upper_arm_r": [0.0, -0.163, 0.042],
}
"""Positions of the units by eye, for a stature of 1.75 m."""
HARD = ("uturn", "figure8", "slalom", "straightpush")
HARD_TITLE = "Hard movement: turns, figures of eight, slaloms"
IN_PLACE_TITLE = "Movement in place"
UP = np.array([0.0, 1.0, 0.0])
SHOULDER_TURN_RAD = np.radians(19.0)
"""From the line upper back to left arm to the line of the shoulders, where the right arm is not seen."""
REFERENCE_STD_RAD = np.radians(1.5)
BEGUN_S, OBSERVED_SHARE = 0.3, 0.3
AS_GOOD_DEG = 0.3
JOINTS = (
    Link("pelvis", "yxz"),
    Link("thorax", "zxyzxy"),
    Link("upper_arm_l", "zxy", parent="thorax"),
    Link("upper_arm_r", "zxy", parent="thorax"),
)
"""Joints of `upper_body`, for OpenSim: lumbar and thoracic hinges; three hinges where it has a free joint or a ball."""
VQF, OPENSENSE = "VQF, each unit alone", "VQF with inverse kinematics (OpenSense)"
METHODS = ("Oarlock", "Oarlock, smoothed", "Oarlock, each unit alone", VQF, OPENSENSE)
AS_GOOD = f"VQF + {AS_GOOD_DEG:g} deg"
COLUMNS = (
    "tilt",
    "worst tilt",
    "relative",
    "worst relative",
    "as tracked",
    "worst as tracked",
    AS_GOOD,
    "in bands",
    "e2/var",
)


@dataclass(frozen=True)
class PersonScore:
    """Errors of one trial, deg, by segment or pair; by pair rows, share in bands and squared error over variance."""

    tilt: dict[str, float]
    relative: dict[tuple[str, str], float]
    tracked: dict[tuple[str, str], float]
    bands: dict[tuple[str, str], tuple[int, float, float]]

    def all(self, quantity: str) -> float:
        return _rms(list(getattr(self, quantity).values()))


def run(data_folder: Path) -> SetResult:
    """Score all trials that are there."""
    folders = sorted(data_folder.glob(f"{FOLDER}/wheelchair/P*/*/optics.csv"))
    if not folders:
        return SetResult(NAME, TITLE, TEXT, absent=f"no {FOLDER}/wheelchair/P*/*/optics.csv")
    scores: dict[str, dict[str, PersonScore]] = {}
    missing: set[str] = set()
    for file in folders:
        trial = PersonTrial(file.parent)
        orientations = dict(trial.scores())
        scores[trial.name] = {m: s for m, s in orientations.items() if isinstance(s, PersonScore)}
        missing |= {f"{m}: {s.reason}." for m, s in orientations.items() if isinstance(s, Missing)}
    groups = {
        HARD_TITLE: [n for n in scores if any(h in n for h in HARD)],
        IN_PLACE_TITLE: [n for n in scores if not any(h in n for h in HARD)],
    }
    tables = tuple(_table(title, {n: scores[n] for n in names}) for title, names in groups.items() if names)
    return SetResult(NAME, TITLE, TEXT, tables, notes=(f"{len(scores)} trials.", *sorted(missing)))


def _table(title: str, scores: Mapping[str, Mapping[str, PersonScore]]) -> ResultTable:
    rows = []
    for method in METHODS:
        own = {
            trial: orientations[method] for trial, orientations in scores.items() if method in orientations
        }
        if len(own) < len(scores):
            continue
        cells: list[float | str] = []
        for quantity in ("tilt", "relative", "tracked"):
            values = [v for score in own.values() for v in getattr(score, quantity).values()]
            cells += [float(np.median(values)), float(max(values))]
        good = sum(
            all(
                score.all(quantity) <= scores[trial][VQF].all(quantity) + AS_GOOD_DEG
                for quantity in ("tilt", "relative")
            )
            for trial, score in own.items()
        )
        bands = np.array([b for score in own.values() for b in score.bands.values()])
        shares = (
            [f"{np.average(bands[:, k], weights=bands[:, 0]):.2f}" for k in (1, 2)]
            if len(bands)
            else ["", ""]
        )
        cells += [f"{good} of {len(own)}", *shares]
        rows.append(
            ResultRow(
                method, tuple(cells), ours=method.startswith("Oarlock"), online="smoothed" not in method
            )
        )
    text = (
        f"{AS_GOOD}: trials whose tilt and relative orientation are at most {AS_GOOD_DEG:g} deg above VQF's."
    )
    return ResultTable(title, COLUMNS, tuple(rows), text=text)


class PersonTrial:
    """Units, optics and start pose of one trial. At the start pose all segments count as parallel."""

    def __init__(self, folder: Path) -> None:
        self.name, self._folder = f"{folder.parent.name}/{folder.name}", folder
        self._units: dict[str, tuple[Floats, Floats, Floats]] = {}
        turns: dict[str, Floats] = {}
        places: dict[str, Floats] = {}
        cluster_from_unit: dict[str, Rotation] = {}
        late = []
        for segment, cluster in CLUSTER.items():
            time_s, quat, place = _optics(folder, cluster)
            if quat is None or np.isfinite(quat).all(axis=1).mean() < OBSERVED_SHARE:
                continue
            self._units[segment] = _readings(folder, UNIT[segment])
            lag_s, cluster_from_unit[segment] = _aligned(time_s, quat, *self._units[segment][:2])
            turns[segment], places[segment] = quat, place
            late.append(lag_s)
        self.segments = list(self._units)
        self._late_s = float(np.mean(late))
        spans = [unit[0] for unit in self._units.values()]
        finite = np.all([np.isfinite(q).all(axis=1) for q in turns.values()], axis=0)
        finite &= (time_s > max(t[0] for t in spans) + self._late_s) & (
            time_s < min(t[-1] for t in spans) + self._late_s
        )
        first = int(np.flatnonzero(finite)[0])
        start = _start_pose({s: places[s][first] for s in self.segments})
        at_start = {s: Rotation.from_quat(turns[s][first]) for s in self.segments}
        self.mounts = {s: start.inv() * at_start[s] * cluster_from_unit[s] for s in self.segments}
        self._time_s = time_s[finite]
        self._true = {
            s: Rotation.from_quat(turns[s][finite]) * at_start[s].inv() * start for s in self.segments
        }

    def scores(self) -> Iterator[tuple[str, PersonScore | Missing]]:
        """The score of each method, or why there is none."""
        model = oarlock.load_model("upper_body").with_units(self.segments)
        calibration = Calibration(
            mounts={s: (self.mounts[s].as_matrix(), np.array(OFFSETS_M[s])) for s in self.segments}
        )
        recording = self._recording()
        live = oarlock.track(model, recording, calibration, Config(magnetometer="off"))
        alone = oarlock.track(model, recording, calibration, Config(magnetometer="off", closures=False))
        for method, track in zip(METHODS, (live, oarlock.smooth(live), alone), strict=False):
            poses = {s: Rotation.from_quat(track.frame_quat_wxyz(s)[:, [1, 2, 3, 0]]) for s in self.segments}
            yield method, self._score(track.time_s, poses, track)
        time_s, poses = self._vqf()
        yield VQF, self._score(time_s, poses, None)
        for outcome in self._opensense(time_s, poses):
            if isinstance(outcome, OrientationEstimate):
                poses = {s: rotation(quat) for s, quat in outcome.quats.items()}
                yield OPENSENSE, self._score(time_s, poses, None)
            else:
                yield OPENSENSE, outcome

    def _recording(self) -> Recording:
        with tempfile.TemporaryDirectory() as place:
            for segment in self.segments:
                unit = next((self._folder / "imu").glob(f"{UNIT[segment]}*"))
                shutil.copytree(unit, Path(place) / segment)
            return oarlock.import_recording(place)

    def _vqf(self) -> tuple[Floats, dict[str, Rotation]]:
        from vqf import VQF

        y_up = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        begin, end = max(u[0][0] for u in self._units.values()), min(u[0][-1] for u in self._units.values())
        ticks = np.arange(begin, end, 0.02)
        poses = {}
        for segment, (time_s, gyro, accel) in self._units.items():
            both = [
                np.column_stack([np.interp(ticks, time_s, v[:, k]) for k in range(3)]) for v in (gyro, accel)
            ]
            quat = VQF(0.02).updateBatch(*map(np.ascontiguousarray, both))["quat6D"]
            poses[segment] = y_up * Rotation.from_quat(quat[:, [1, 2, 3, 0]]) * self.mounts[segment].inv()
        return ticks, poses

    def _opensense(self, time_s: Floats, poses: Mapping[str, Rotation]) -> list[Outcome]:
        """Inverse kinematics from orientations of the segments."""
        source = OrientationEstimate(OPENSENSE, time_s, {s: quat_wxyz(pose) for s, pose in poses.items()})
        joints = [link for link in JOINTS if link.name in poses]
        return attempt([OPENSENSE], lambda: (p.estimate for p in chains.opensim(source, joints)))

    def _score(self, time_s: Floats, poses: Mapping[str, Rotation], track: Track | None) -> PersonScore:
        inside = (self._time_s - self._late_s > time_s[0]) & (self._time_s - self._late_s < time_s[-1])
        at_s = self._time_s[inside] - self._late_s
        orientations = {s: Slerp(time_s, pose)(at_s) for s, pose in poses.items()}
        true = {s: turn[inside] for s, turn in self._true.items()}
        tilt = {
            s: _rms(_angle_deg(orientations[s].inv().apply(UP), true[s].inv().apply(UP)))
            for s in orientations
        }
        score = PersonScore(tilt, {}, {}, {})
        begun, sparse = np.flatnonzero(at_s < at_s[0] + BEGUN_S), np.arange(0, len(at_s), 6)
        for pair in PAIRS:
            if not set(pair) <= set(orientations):
                continue
            expected = true[pair[0]].inv() * true[pair[1]]
            set_rad = _heading(orientations, pair, expected, begun)
            score.tracked[pair] = _rms(_turn_deg(orientations, pair, expected, set_rad))
            score.relative[pair] = _rms(
                _turn_deg(orientations, pair, expected, _heading(orientations, pair, expected, sparse))
            )
            if track is not None:
                std = track.frame_rotation_stds(pair[1], pair[0])
                std = np.column_stack([np.interp(at_s, time_s, std[:, k]) for k in range(3)])
                score.bands[pair] = _band(_relative(orientations, pair, set_rad), expected, std)
        return score


def _relative(orientations: Mapping[str, Rotation], pair: tuple[str, str], heading_rad: float) -> Rotation:
    return orientations[pair[0]].inv() * Rotation.from_rotvec(UP * heading_rad) * orientations[pair[1]]


def _turn_deg(
    orientations: Mapping[str, Rotation],
    pair: tuple[str, str],
    expected: Rotation,
    heading_rad: float,
    rows: Indices | slice = slice(None),
) -> Floats:
    relative = _relative({s: orientations[s][rows] for s in pair}, pair, heading_rad)
    return np.asarray(np.degrees((expected[rows].inv() * relative).magnitude()))


def _heading(
    orientations: Mapping[str, Rotation], pair: tuple[str, str], expected: Rotation, rows: Indices
) -> float:
    """The constant heading between two segments that fits best over some rows, rad."""

    def error(heading_rad: float) -> float:
        return _rms(_turn_deg(orientations, pair, expected, heading_rad, rows))

    best = min(np.radians(np.arange(-180.0, 180.0, 2.0)), key=error)
    return float(minimize_scalar(error, bounds=(best - 0.04, best + 0.04), method="bounded").x)


def _band(orientations: Rotation, expected: Rotation, std: Floats) -> tuple[int, float, float]:
    error, variance = (orientations.inv() * expected).as_rotvec(), std**2 + REFERENCE_STD_RAD**2
    return len(error), float(np.mean(error**2 < NORMAL_95**2 * variance)), float(np.mean(error**2 / variance))


def _rms(values: Sequence[float] | Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _angle_deg(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.degrees(np.arccos(np.clip(np.sum(first * second, axis=-1), -1.0, 1.0))))


def _optics(folder: Path, cluster: str) -> tuple[Floats, Floats | None, Floats]:
    """Times, quaternions xyzw (room from cluster) and positions; NaN where the cluster is not seen."""
    with (folder / "optics.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    values = np.array([[float(x or "nan") for x in row] for row in rows])
    column = dict(zip(head, values.T, strict=True))
    if f"{cluster}_seen" not in column:
        return values[:, 0], None, np.empty((0, 3))
    quat = np.column_stack([column[f"{cluster}_q{k}"] for k in "xyzw"])
    quat[~(column[f"{cluster}_seen"] >= 0.5)] = np.nan
    return values[:, 0], quat, np.column_stack([column[f"{cluster}_p{k}_m"] for k in "xyz"])


def _readings(folder: Path, unit: str) -> tuple[Floats, Floats, Floats]:
    """Times, rad/s and m/s2 of one x-IMU3."""
    file = next((folder / "imu").glob(f"{unit}*")) / "Inertial.csv"
    rows = np.genfromtxt(file, delimiter=",", skip_header=1)
    return rows[:, 0] / 1e6, np.radians(rows[:, 1:4]), 9.80665 * rows[:, 4:7]


def _start_pose(places: Mapping[str, Floats]) -> Rotation:
    """Room from segments at the start: y up, z along the line of the shoulders, to the right."""
    left = places["upper_arm_l"]
    if "upper_arm_r" in places:
        right = places["upper_arm_r"] - left
    else:
        right = Rotation.from_rotvec(UP * SHOULDER_TURN_RAD).apply((places["thorax"] - left) * (1.0 - UP))
    right = right * (1.0 - UP) / np.linalg.norm(right * (1.0 - UP))
    return Rotation.from_matrix(np.column_stack([np.cross(UP, right), UP, right]))


def _low_passed(values: Floats, rate_hz: float, cut_hz: float = 6.0) -> Floats:
    return np.asarray(sosfiltfilt(butter(2, cut_hz, fs=rate_hz, output="sos"), values, axis=0))


def _aligned(optics_s: Floats, quat: Floats, unit_s: Floats, gyro: Floats) -> tuple[float, Rotation]:
    """Optics' time minus the unit's, s, and the rotation cluster from unit, both from angular velocities."""
    rate, valid = _rates(optics_s, quat)
    optics = _low_passed(np.where(valid[:, None], rate, 0.0), 1.0 / float(np.median(np.diff(optics_s))))
    unit = _low_passed(gyro, 1.0 / float(np.median(np.diff(unit_s))))
    grid_s = 0.01
    at = [np.arange(t[0], t[-1], grid_s) for t in (optics_s, unit_s)]
    both = zip(at, (optics_s, unit_s), (optics, unit), strict=True)
    norms = [np.interp(t, s, np.linalg.norm(v, axis=1)) for t, s, v in both]
    there = np.interp(at[0], optics_s, valid.astype(float)) > 0.99
    rough = min(
        (_mismatch(norms[0], norms[1], there, shift), shift)
        for shift in range(200 - len(norms[1]), len(norms[0]) - 200)
    )
    rough_s = rough[1] * grid_s + at[0][0] - at[1][0]
    lags = rough_s + np.linspace(-0.06, 0.06, 61)
    fits = [_turn_at(lag_s, optics_s, optics, valid, unit_s, unit) for lag_s in lags]
    return min(fits, key=lambda fit: fit[0])[1:]


def _rates(time_s: Floats, quat: Floats, half: int = 2) -> tuple[Floats, Bools]:
    """Angular velocity in the cluster's axes by central differences, and where it is known."""
    finite = np.asarray(np.isfinite(quat).all(axis=1))
    turn = Rotation.from_quat(np.where(finite[:, None], quat, [0.0, 0.0, 0.0, 1.0]))
    rate = np.zeros((len(time_s), 3))
    rate[half:-half] = (turn[: -2 * half].inv() * turn[2 * half :]).as_rotvec() / (
        time_s[2 * half :] - time_s[: -2 * half]
    )[:, None]
    valid = ~binary_dilation(~finite, iterations=2 * half + 2)
    valid[:half] = valid[-half:] = False
    return rate, valid


def _mismatch(optics: Floats, unit: Floats, there: Floats, shift: int) -> float:
    low, high = max(0, shift), min(len(optics), shift + len(unit))
    use = there[low:high]
    if high - low < max(400, 0.55 * min(len(optics), len(unit))) or use.sum() < 300:
        return float("inf")
    return float(np.mean((optics[low:high][use] - unit[low - shift : high - shift][use]) ** 2))


def _turn_at(
    late_s: float, optics_s: Floats, optics: Floats, valid: Bools, unit_s: Floats, unit: Floats
) -> tuple[float, float, Rotation]:
    """Residual rate, the lag, and cluster from unit at it; a constant bias of the gyroscope is left out."""
    time_s = unit_s + late_s
    use = (time_s > optics_s[0] + 0.1) & (time_s < optics_s[-1] - 0.1)
    use &= np.interp(time_s, optics_s, valid.astype(float)) > 0.99
    expected = np.column_stack([np.interp(time_s[use], optics_s, optics[:, k]) for k in range(3)])
    bias = np.zeros(3)
    for _ in range(3):
        turn, _ = Rotation.align_vectors(expected, unit[use] - bias)
        bias = np.mean(unit[use] - turn.inv().apply(expected), axis=0)
    left = np.linalg.norm(expected - turn.apply(unit[use] - bias), axis=1)
    return _rms(left), late_s, turn
