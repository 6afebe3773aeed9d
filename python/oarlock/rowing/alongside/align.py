"""`align_strokes`: which stroke of a track each stroke of an export is, and its onset on the track's clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.alongside.clock_match import FEWEST_PAIRS, ClockMatch, match_clocks
from oarlock.rowing.strokes.table import StrokeTable
from oarlock.storage.arrays import Floats, Ints
from oarlock.storage.epoch import apart_s
from oarlock.storage.errors import DataError

ONSET = "catch_time_s"
NO_ONSET = (
    "The device does not say at which instant of a stroke it takes its time stamp: strokes may be one off, and "
    "curves are not placed within the stroke"
)


@dataclass(frozen=True, eq=False)
class Alignment:
    """The strokes of an export on a track's clock.

    Attributes:
        stroke: (N,) number of the track's stroke from 0; -1 without one.
        onset_s: (N,) the device's onset on the track's clock, s; NaN where the clock's relation is not known.
        onset_std_s: (N,) standard deviation of the relation at that onset, s.
        apart_s: (N,) onset minus the catch of the track's stroke, s; NaN without one.
        is_onset: whether the device says when its strokes begin; otherwise its time stamps stand for onsets.
        matches: one for each run of the device's clock that was aligned.
        notes: plain sentences: how the clocks relate, and what could not be aligned.
    """

    stroke: Ints
    onset_s: Floats
    onset_std_s: Floats
    apart_s: Floats
    is_onset: bool
    matches: tuple[ClockMatch, ...]
    notes: tuple[str, ...]

    @property
    def count(self) -> int:
        """Strokes that both have."""
        return int((self.stroke >= 0).sum())


def align_strokes(export: StrokeTable, track: StrokeTable, offset_s: float | None = None) -> Alignment:
    """Relate the clock of an export to that of a track by the sequence of stroke onsets.

    Constant differences between the definitions of onset (handle reversal, force threshold, flywheel) cannot be
    distinguished from an offset of the clocks: the device's onset is placed at the catch on average. Where intervals
    alone do not decide, because all strokes took equally long, the moments of 0 s of both decide if they are known.

    Args:
        export: strokes of a device, with `catch_time_s`, or else `time_s`. Where its clock restarts, each run is
            aligned by itself.
        track: strokes of a track, with `catch_time_s`.
        offset_s: what to add to the export's times, s, if it is known; it need be right to half a stroke.

    Raises:
        DataError: one of them has no times.
    """
    if ONSET not in track:
        raise DataError("align: the track's strokes have no catch_time_s")
    is_onset = ONSET in export and bool(np.isfinite(export[ONSET]).any())
    if not is_onset and "time_s" not in export:
        raise DataError(
            f"{export.source or 'export'}: has no times, so its strokes cannot be aligned with a track"
        )
    stamps_s = export[ONSET] if is_onset else export["time_s"]
    catch_places = np.flatnonzero(np.isfinite(track[ONSET]))
    catch_s = track[ONSET][catch_places]
    near_s = apart_s(export.epoch, track.epoch) if offset_s is None else offset_s
    found = _StrokeMatches.empty(len(export))
    notes = [] if is_onset else [NO_ONSET]
    for run in _runs(stamps_s):
        notes += _align_run(found, run, stamps_s, (catch_places, catch_s), near_s)
    return Alignment(
        found.stroke,
        found.onset_s,
        found.onset_std_s,
        found.apart_s,
        is_onset,
        tuple(found.matches),
        tuple(notes),
    )


@dataclass
class _StrokeMatches:
    stroke: Ints
    onset_s: Floats
    onset_std_s: Floats
    apart_s: Floats
    matches: list[ClockMatch]

    @classmethod
    def empty(cls, count: int) -> _StrokeMatches:
        onset_s, std_s, apart_s = (np.full(count, np.nan) for _ in range(3))
        return cls(np.full(count, -1), onset_s, std_s, apart_s, [])


def _runs(stamps_s: Floats) -> list[Ints]:
    """Ints of known stamps, a list for each run of a clock that restarts; a stamp that repeats is left out."""
    known = np.flatnonzero(np.isfinite(stamps_s))
    step_s = np.diff(stamps_s[known])
    runs = np.split(known, np.flatnonzero(step_s < 0.0) + 1)
    return [run[np.append(True, np.diff(stamps_s[run]) > 0.0)] for run in runs if len(run)]


def _align_run(
    found: _StrokeMatches,
    run: Ints,
    stamps_s: Floats,
    catches: tuple[Ints, Floats],
    near_s: float | None,
) -> list[str]:
    """Fill in the rows of a run; notes."""
    places, catch_s = catches
    which = f"strokes {run[0] + 1} to {run[-1] + 1}"
    match = match_clocks(stamps_s[run], catch_s, near_s)
    if match is None:
        return [
            f"{which}: not aligned, fewer than {FEWEST_PAIRS} strokes are common to the export and the track"
        ]
    if match.rivals_s:
        others = ", ".join(f"{s:.1f}" for s in match.rivals_s[:3])
        return [
            f"{which}: not aligned. They were too regular to decide between offsets of {match.offset_s:.1f} s and "
            f"{others} s, and the moments of 0 s of export and track do not decide either. Give the offset"
        ]
    own, theirs = run[match.pairs[:, 0]], places[match.pairs[:, 1]]
    found.onset_s[run] = match.on_track(stamps_s[run])
    found.onset_std_s[run] = match.std_s(stamps_s[run])
    found.stroke[own] = theirs
    found.apart_s[own] = found.onset_s[own] - catch_s[match.pairs[:, 1]]
    found.matches.append(match)
    return [_in_words(match, which, len(run))]


def _in_words(match: ClockMatch, which: str, strokes: int) -> str:
    drift = f", drift {1e6 * match.drift:+.0f} ppm" if match.drift else ""
    return (
        f"{which}: {len(match.pairs)} of {strokes} aligned; the device's clock + {match.offset_s:.3f} s is the track's "
        f"(standard deviation {1e3 * match.offset_std_s:.0f} ms{drift}); single onsets differ from the catch by "
        f"{1e3 * match.apart_std_s:.0f} ms (SD)"
    )
