"""A recording as notebooks show it (`Recording._repr_html_`): who and when, its streams, its notes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from oarlock.recording.packets import RecordingSpan, missing_share, stream_rate_hz
from oarlock.recording.session_info import session_info, session_text
from oarlock.storage.errors import DataError
from oarlock.storage.notebook_html import card, html_table

if TYPE_CHECKING:
    from oarlock.recording.streams import Stream


def recording_html(recording: RecordingSpan, streams: Sequence[Stream], epoch: str | None) -> str:
    """HTML of a recording with its streams and the moment of `time_s` = 0."""
    duration_s = recording.end_s - recording.start_s
    facts = [
        f"{len(streams)} streams, {recording.start_s:.6g} to {recording.end_s:.6g} s ({duration_s:.4g} s)",
        session_text(session_info(recording.meta)),
        epoch or "",
    ]
    rows = [
        (
            stream.name,
            stream.kind,
            *rate_and_missing(recording, stream),
            len(stream),
            ", ".join(stream.values),
        )
        for stream in streams
    ]
    header = ["stream", "kind", "rate, Hz", "missing, %", "samples", "readings"]
    return card("Recording", ", ".join(fact for fact in facts if fact), html_table(header, rows))


def rate_and_missing(recording: RecordingSpan, stream: Stream) -> tuple[str, str]:
    """Rate, Hz, and share of missing readings, percent, as text; a dash where there is none."""
    try:
        rate_hz, missing = stream_rate_hz(recording, stream), missing_share(recording, stream)
    except DataError:  # an invalid note on packets, which is refused where it is used
        return "–", "–"
    return ("–" if math.isnan(rate_hz) else f"{rate_hz:.4g}"), f"{100.0 * missing:.1f}"
