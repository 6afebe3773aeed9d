"""Faults without new readings: dropouts and repeated readings."""

from __future__ import annotations

import numpy as np

from oarlock.evaluation.study.faults.fault import Case, Fault, Names, of_streams, rows_kept
from oarlock.evaluation.study.keys import ONE, sized
from oarlock.recording.streams import Stream


def dropout(names: Names) -> tuple[Fault, ...]:
    """The faults of this module: dropouts and repeated readings."""
    choices = (*names.streams, ONE)
    gap = sized("gap_s", "duration of a dropout of all streams, or of those named", choices)
    stuck = sized("stuck_s", "duration for which all streams, or those named, repeat one reading", choices)
    return (
        Fault(gap, of_streams(_silent, names.streams)),
        Fault(stuck, of_streams(_stuck, names.streams)),
    )


def _silent(stream: Stream, lasting_s: float, case: Case) -> Stream | None:
    return rows_kept(stream, ~case.meanwhile(stream.time_s, lasting_s))


def _stuck(stream: Stream, lasting_s: float, case: Case) -> Stream:
    rows = np.arange(len(stream))
    held = case.meanwhile(stream.time_s, lasting_s)
    rows[held] = rows[held].min(initial=len(stream))
    return stream.at_rows(rows, stream.time_s)
