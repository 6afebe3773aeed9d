"""What `oarlock import` says of a recording: device, units, rates, clocks, counters, what is absent."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.cli.terminal import number, pairs, say, table

if TYPE_CHECKING:
    from oarlock import Recording
    from oarlock.recording.streams import Stream

_SHORT = {"gyro_rad_s": "gyro", "accel_m_s2": "accel", "mag_ut": "mag", "quat_wxyz": "orientation"}


def document(recording: Recording, source: Path, out: Path, about: str) -> dict[str, object]:
    """The summary for `--json`."""
    from oarlock.recording.packets import missing_packets, missing_share, quantity_rates, stream_rate_hz
    from oarlock.recording.reader_notes import reader_notes
    from oarlock.recording.session_info import session_info
    from oarlock.storage.epoch import moment_text

    return {
        "recording": out,
        "source": source,
        "about": about,
        "session": dict(session_info(recording.meta)),
        "start_s": recording.start_s,
        "start": moment_text(recording.epoch, recording.start_s),
        "epoch": recording.epoch,
        "notes": reader_notes(recording.meta),
        "end_s": recording.end_s,
        "streams": [
            {
                "name": s.name,
                "kind": s.kind,
                "samples": len(s),
                "rate_hz": stream_rate_hz(recording, s),
                "quantities": quantity_rates(recording, s),
                "missing_packets": missing_packets(recording, s),
                "missing_share": missing_share(recording, s),
            }
            for s in recording.streams
        ],
    }


def write_summary(recording: Recording, source: Path, out: Path, about: str) -> None:
    """Prints the summary."""
    from oarlock.recording.packets import lost_packets
    from oarlock.recording.reader_notes import reader_notes
    from oarlock.recording.session_info import session_info, session_text
    from oarlock.storage.epoch import moment_text

    say(f"Wrote {out} from {source}", style="bold")
    units = [s for s in recording.streams if s.kind == "imu"]
    start = moment_text(recording.epoch, recording.start_s)
    pairs(
        [
            ("format", about),
            ("session", session_text(session_info(recording.meta))),
            ("duration", "" if start else f"{recording.duration_s:.1f} s"),
            ("units", f"{len(units)} inertial" if units else "none inertial"),
            ("clock", _clock(recording)),
            ("counter", _counter(recording)),
            ("absent", _absent(units)),
        ]
    )
    if start:
        say(f"start {start}, {recording.duration_s:.1f} s", indent=2)
    _write_streams(recording)
    for note in reader_notes(recording.meta):
        say(note, indent=2)
    for stream in recording.streams:
        if (lost := lost_packets(recording, stream)) is not None and lost.text():
            say(f"{stream.name}: {lost.text()}", indent=2)


def _write_streams(recording: Recording) -> None:
    from oarlock.evaluation.summary import rate_text
    from oarlock.recording.packets import missing_share, stream_rate_hz

    table(
        ["stream", "kind", ">samples", ">rate Hz", ">missing %", "measures"],
        [
            (
                s.name,
                s.kind,
                len(s),
                rate_text(stream_rate_hz(recording, s)),
                number(100 * missing_share(recording, s), ".1f"),
                _measures(recording, s),
            )
            for s in recording.streams
        ],
    )


def _measures(recording: Recording, stream: Stream) -> str:
    """The quantities of a stream, with the rate of those that are slower than its rows."""
    from oarlock.evaluation.summary import rate_text
    from oarlock.recording.packets import quantity_rates, stream_rate_hz

    whole = stream_rate_hz(recording, stream)
    rates = quantity_rates(recording, stream)
    return ", ".join(
        f"{_SHORT.get(name, name)} at {rate_text(rate)} Hz" if rate < 0.98 * whole else _SHORT.get(name, "")
        for name, rate in rates.items()
        if name in _SHORT
    )


def _clock(recording: Recording) -> str:
    """The kind of the time stamps."""
    from collections.abc import Mapping

    kinds = {
        "relative": "seconds from an unnamed start",
        "samples": "counted samples",
        "utc": "UTC",
        "local": "local time without a zone",
        "clock": "time of day without a date",
    }
    clock = recording.meta.get("clock")
    kind = clock.get("kind") if isinstance(clock, Mapping) else None
    return kinds.get(str(kind), "")


def _counter(recording: Recording) -> str:
    """The streams whose packets the device counted."""
    from collections.abc import Mapping

    counted = recording.meta.get("packets")
    names = list(counted) if isinstance(counted, Mapping) else []
    if not names:
        return ""
    return "all streams" if len(names) == len(recording.streams) else ", ".join(map(str, names))


def _absent(units: Sequence[Stream]) -> str:
    """The quantities that no unit, or only some units have."""
    lines = []
    for field in ("gyro_rad_s", "accel_m_s2", "mag_ut"):
        lack = [unit.name for unit in units if field not in unit.values]
        if lack:
            whose = "" if len(lack) == len(units) else f" of {', '.join(lack)}"
            lines.append(f"{_SHORT[field]}{whose}")
    return ", ".join(lines)
