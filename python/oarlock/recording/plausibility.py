"""Checks a recording for wrong units, stuck and clipped signals and gaps. Used by `track` and the searches.

Nothing is repaired. A finding states the sensor, the number and what to change.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from oarlock.recording.frozen_signals import STUCK_ROWS, clipped_texts, moves, stuck_texts
from oarlock.recording.gyro_scale import gyro_per_gravity_turn, row_norms
from oarlock.recording.packets import expected_quantity_rows, lost_packets
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream, ScalarStream, Stream
from oarlock.storage.arrays import Bools, Floats
from oarlock.storage.errors import DataError

Severity: TypeAlias = Literal["error", "warning", "note"]

STILL_S = 1.0
ACCEL_EXPECTED_M_S2 = (5.0, 20.0)
# Beyond the range of wearable units: 2000 deg/s is 34.9 rad/s.
GYRO_MAX_RAD_S = 40.0
GYRO_P99_RAD_S = 35.0
# Median rate of a limb that rotates faster than two turns per second half of the time.
GYRO_MEDIAN_RAD_S = 15.0
# The earth's field is 22 to 67 uT; nearby iron halves or triples it.
MAG_EXPECTED_UT = (1.0, 200.0)
MAG_USUAL_UT = (10.0, 150.0)
SCALAR_MAX = 20.0
# A reading that is so far from the median of those around it has jumped, rad/s.
JUMP_ROWS, GYRO_JUMP_RAD_S = 7, 10.0
# Streams that begin or end so much later or earlier than the recording are named, s.
OUTSIDE_S = 1.0
GAP_STEPS = 5.0
GAP_S = 0.1

# lowest and highest |accel| at rest if it were in another unit; 2 % either way covers biases and latitude
_ACCEL_UNITS = (
    (0.0078, 0.0118, "km/s2, that is m/s2 divided by 1000 once too often", 'scale = 1000 with unit = "m/s2"'),
    (0.8, 1.2, "g", 'unit = "g"'),
    (961.0, 990.0, "cm/s2", 'scale = 10 with unit = "mm/s2"'),
    (990.0, 1200.0, "mg (thousandths of g)", 'unit = "mg"'),
    (7845.0, 11768.0, "mm/s2", 'unit = "mm/s2"'),
)
_MAG_UNITS = (
    (1e-5, 2e-4, "T", 'unit = "T"'),
    (0.15, 0.8, "gauss, or units of the maker's own", 'unit = "gauss"'),
    (0.8, 1.0, "units of the maker's own, in which the local field is 1", "scale = the local field in uT"),
    (200.0, 1500.0, "mG", 'unit = "mG"'),
    (15_000.0, 150_000.0, "nT", 'unit = "nT"'),
)


@dataclass(frozen=True)
class SignalFinding:
    """One result of the plausibility checks.

    Args:
        sensor: the stream's name.
        severity: "error" stops a run, "warning" is shown, "note" reports missing data.
        message: one or more sentences: number, unit, and what to do.
        kind: "stuck", "clipped" or "jumps" for these faults; otherwise empty.
        missing: the field with missing readings, such as "mag_ut"; empty for other findings.
    """

    sensor: str
    severity: Severity
    message: str
    kind: str = ""
    missing: str = ""

    def __str__(self) -> str:
        return f"{self.sensor}: {self.message}"


def plausibility(recording: Recording) -> list[SignalFinding]:
    """Findings on wrong units, dead sensors and gaps, errors first. The recording is not modified."""
    # Overflowing sums are no numpy warning here: the checks report such readings.
    with np.errstate(over="ignore", invalid="ignore"):
        findings = [f for stream in recording.streams for f in _stream_findings(recording, stream)]
        findings += _frozen_findings(recording)
    return sorted(findings, key=lambda f: ("error", "warning", "note").index(f.severity))


def require_plausible(recording: Recording) -> list[SignalFinding]:
    """The warnings and notes of `plausibility`.

    Raises:
        DataError: At least one finding is an error. The text contains all errors.
    """
    findings = plausibility(recording)
    errors = [str(f) for f in findings if f.severity == "error"]
    if errors:
        raise DataError("\n".join(errors))
    return findings


def _stream_findings(recording: Recording, stream: Stream) -> list[SignalFinding]:
    findings = _gap_findings(recording, stream) + _missing_findings(recording, stream)
    if isinstance(stream, ImuStream):
        findings += _accel_findings(stream) + _gyro_findings(stream) + _mag_findings(stream)
    elif isinstance(stream, ScalarStream):
        findings += _scalar_findings(stream)
    return findings


def _frozen_findings(recording: Recording) -> list[SignalFinding]:
    units = [stream for stream in recording.streams if isinstance(stream, ImuStream)]
    moving = {unit.name: moves(unit) for unit in units}
    findings = []
    for unit in units:
        others_move = any(moved for name, moved in moving.items() if name != unit.name)
        texts = {"stuck": stuck_texts(unit, others_move), "clipped": clipped_texts(unit)}
        findings += [
            SignalFinding(unit.name, "warning", text, kind) for kind, found in texts.items() for text in found
        ]
    scalars = [stream for stream in recording.streams if isinstance(stream, ScalarStream)]
    still = [stream for stream in scalars if len(stream) >= STUCK_ROWS and np.ptp(stream.value) == 0.0]
    if any(moving.values()) or len(still) < len(scalars):
        findings += [
            SignalFinding(
                stream.name,
                "warning",
                f"reads {stream.value[0]:.5g} throughout while others move: it is stuck, or what it reads does not "
                "move. Check it; a sensor that is stuck is better left out.",
                "stuck",
            )
            for stream in still
        ]
    return findings


def _accel_findings(stream: ImuStream) -> list[SignalFinding]:
    norms, rows = _norms(stream.accel_m_s2)
    if norms.size == 0 or stream.accel_m_s2 is None:
        return []
    if not norms.any():
        return [
            _error(stream, "accel_m_s2 is zero throughout: the accelerometer has no readings. Leave it out.")
        ]
    middle = float(np.median(norms))
    rest = float(np.median(norms[_stillest(stream.time_s[rows], stream.accel_m_s2[rows])]))
    for low, high, unit, change in _ACCEL_UNITS:
        if low <= rest <= high and low <= middle <= high:
            return [
                _error(
                    stream, f"|accel| at rest is {rest:.4g}, expected about 9.8 m/s2. {_looks(unit, change)}"
                )
            ]
    low, high = ACCEL_EXPECTED_M_S2
    if low <= rest <= high:
        return []
    return [
        _warning(
            stream,
            f"|accel| in the stillest second is {rest:.4g} m/s2, expected {low:g} to {high:g}. "
            "Check the unit, and check that gravity was not removed.",
        )
    ]


def _gyro_findings(stream: ImuStream) -> list[SignalFinding]:
    norms, _ = _norms(stream.gyro_rad_s)
    if norms.size == 0:
        return []
    top, most, middle = float(norms.max()), float(np.quantile(norms, 0.99)), float(np.median(norms))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(norms, JUMP_ROWS // 2, "edge"), JUMP_ROWS)
    jumps = norms - np.median(around, axis=1)
    if (lasting := norms[jumps <= GYRO_JUMP_RAD_S]).size and lasting.max() <= GYRO_P99_RAD_S < top:
        text = (
            f"|gyro| jumps to {top:.4g} rad/s for single readings ({norms.size - lasting.size} of {norms.size}); "
            "they are not used. Check cable, radio and firmware."
        )
        return [SignalFinding(stream.name, "warning", text, "jumps")]
    looks = _looks("deg/s", 'unit = "deg/s"')
    if top > GYRO_MAX_RAD_S or most > GYRO_P99_RAD_S or middle > GYRO_MEDIAN_RAD_S:
        return [
            _error(
                stream,
                f"|gyro| reaches {top:.4g} rad/s (99 % below {most:.4g}, half below {middle:.4g}); "
                f"the range of wearable units ends at about {GYRO_P99_RAD_S:g} rad/s. {looks}",
            )
        ]
    ratio = gyro_per_gravity_turn(stream)
    if ratio is not None and 0.6 < ratio * np.pi / 180.0 < 1.6:
        return [
            _error(
                stream,
                f"the gyroscope rotates {ratio:.3g} times as fast as gravity in the accelerometer. {looks}",
            )
        ]
    if top == 0.0:
        return [
            _warning(stream, "gyro_rad_s is zero throughout. If the gyroscope has no readings, leave it out.")
        ]
    return []


def _mag_findings(stream: ImuStream) -> list[SignalFinding]:
    norms, _ = _norms(stream.mag_ut)
    if norms.size == 0:
        return []
    middle = float(np.median(norms))
    if not norms.any():
        return [_error(stream, "mag_ut is zero throughout: the magnetometer has no readings. Leave mag out.")]
    low, high = MAG_EXPECTED_UT
    if not low <= middle <= high:
        fits = [_looks(unit, change) for a, b, unit, change in _MAG_UNITS if a <= middle <= b]
        advice = fits[0] if fits else 'Check the unit of "mag" in the mapping file.'
        return [
            _error(stream, f"the median of |mag| is {middle:.4g} uT, expected 22 to 67 uT on earth. {advice}")
        ]
    if not MAG_USUAL_UT[0] <= middle <= MAG_USUAL_UT[1]:
        return [
            _warning(
                stream,
                f"the median of |mag| is {middle:.4g} uT, expected 22 to 67 uT on earth. "
                "Check its unit (manufacturers' own units are near 1), its calibration, and nearby iron.",
            )
        ]
    return []


def _scalar_findings(stream: ScalarStream) -> list[SignalFinding]:
    finite = stream.value[np.isfinite(stream.value)]
    if finite.size == 0 or (top := float(np.abs(finite).max())) <= SCALAR_MAX:
        return []
    unit = stream.unit or "rad or m"
    guess = {"m": '"mm" or "cm"', "rad": '"deg"'}.get(unit, '"deg", "mm" or "cm"')
    return [
        _warning(
            stream,
            f"the reading reaches {top:.4g} {unit}. If it is in {guess}, set this unit in the mapping file.",
        )
    ]


def _missing_findings(recording: Recording, stream: Stream) -> list[SignalFinding]:
    findings = []
    if isinstance(stream, ImuStream):
        # A track says in one line for all units which of its model's magnetometers are absent.
        absent = [f for f in ("gyro_rad_s", "accel_m_s2") if f not in stream.values]
        if absent:
            findings.append(_note(stream, f"has no {' and no '.join(absent)}."))
    for field, rows in stream.values.items():
        if not np.isnan(rows.sum()):
            continue  # a NaN would have made the sum NaN
        missing = np.isnan(rows).reshape(len(rows), -1)
        if missing.all():
            text = f"{field} has no reading (all NaN)."
            findings.append(SignalFinding(stream.name, "warning", text, missing=field))
        elif missing.any() and (text := _missing_text(recording, stream, field, missing)):
            findings.append(SignalFinding(stream.name, "note", text, missing=field))
    return findings


def _missing_text(recording: Recording, stream: Stream, field: str, missing: Bools) -> str:
    """Empty if a quantity that is slower than the rows of its stream has all readings of its own rate."""
    expected = expected_quantity_rows(recording, stream)[field]
    received = int(np.logical_or.reduce(~missing, axis=1).sum())
    axes_gone = received * missing.shape[1] > int(np.count_nonzero(~missing))
    if expected < len(missing) and not axes_gone:
        gone = expected - received
        return f"{field} is missing in {gone} of {expected} samples of its own rate." if gone > 0 else ""
    return _rows_text(stream, field, missing)


def _rows_text(stream: Stream, field: str, missing: Bools) -> str:
    gone = np.logical_and.reduce(missing, axis=0)
    axes = [axis for axis, never in zip("xyz", gone, strict=False) if never]
    rows = np.logical_or.reduce(missing[:, ~gone], axis=1)
    parts = [f"{field} has no {' and no '.join(axes)} axis"] if axes else []
    if rows.any():
        first, stop = _longest_run(rows)
        parts.append(
            f"{field} is missing in {int(rows.sum())} of {len(rows)} samples, "
            f"longest from {stream.time_s[first]:.3f} to {stream.time_s[stop - 1]:.3f} s"
        )
    return "; ".join(parts) + "."


def _gap_findings(recording: Recording, stream: Stream) -> list[SignalFinding]:
    findings = []
    late_s, early_s = stream.time_s[0] - recording.start_s, recording.end_s - stream.time_s[-1]
    if late_s > OUTSIDE_S:
        findings.append(
            _note(stream, f"its first reading is missing until {late_s:.3g} s after the recording's begin.")
        )
    if early_s > OUTSIDE_S:
        findings.append(_note(stream, f"its readings end {early_s:.3g} s before the recording does."))
    lost = lost_packets(recording, stream)
    if lost is not None:
        return findings + ([_note(stream, text)] if (text := lost.text()) else [])
    if len(stream) < 3:
        return findings
    steps = np.diff(stream.time_s)
    gaps = np.flatnonzero((steps > GAP_STEPS * np.median(steps)) & (steps > GAP_S))
    if gaps.size:
        worst = int(gaps[np.argmax(steps[gaps])])
        text = (
            f"has {gaps.size} gaps in time, longest {steps[worst]:.3g} s after {stream.time_s[worst]:.3f} s."
        )
        findings.append(_note(stream, text))
    return findings


def _norms(rows: Floats | None) -> tuple[Floats, Bools]:
    """Norms of the rows without NaN, and a mask of these rows. An axis without any reading counts as absent."""
    if rows is None:
        return np.zeros(0), np.zeros(0, dtype=np.bool_)
    whole: Bools = np.logical_and.reduce(np.isfinite(rows), axis=1)
    return row_norms(rows[whole]), whole


def _stillest(time_s: Floats, rows: Floats) -> slice:
    """The second with the least scatter of the readings; the whole stream if it is shorter."""
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else STILL_S
    width = max(2, round(STILL_S / step))
    if len(rows) <= width:
        return slice(0, len(rows))
    centred = rows - np.median(rows, axis=0)
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), centred]), axis=0)
    squares = np.cumsum(np.concatenate([[0.0], np.einsum("ij,ij->i", centred, centred)]))
    mean = (sums[width:] - sums[:-width]) / width
    spread = (squares[width:] - squares[:-width]) / width - np.einsum("ij,ij->i", mean, mean)
    first = int(np.argmin(spread))
    return slice(first, first + width)


def _longest_run(flags: Bools) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return int(starts[longest]), int(stops[longest])


def _looks(unit: str, change: str) -> str:
    return f"It looks like {unit}: set {change} in the mapping file, or convert the array."


def _error(stream: Stream, message: str) -> SignalFinding:
    return SignalFinding(stream.name, "error", message)


def _warning(stream: Stream, message: str) -> SignalFinding:
    return SignalFinding(stream.name, "warning", message)


def _note(stream: Stream, message: str) -> SignalFinding:
    return SignalFinding(stream.name, "note", message)
