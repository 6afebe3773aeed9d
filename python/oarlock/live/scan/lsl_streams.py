"""Streams of the Lab Streaming Layer in this network."""

from __future__ import annotations

import struct
from importlib import import_module
from typing import Any

from oarlock.live.decoders.lsl import HEADER, SAMPLES, decoder
from oarlock.live.rig import Source
from oarlock.live.scan.finding import DevicePart, ScanProblem, Sender

INFO_S = 2.0


def streams(seconds: float) -> tuple[list[Sender], list[ScanProblem]]:
    """All streams that answer within a time; this waits, so it needs a thread of its own."""
    try:
        lsl: Any = import_module("pylsl")
    except (ImportError, RuntimeError) as error:
        return [], [ScanProblem("LSL", f"needs pylsl with its library: pip install 'oarlock[lsl]' ({error})")]
    return [_finding(lsl, told) for told in lsl.resolve_streams(seconds)], []


def _finding(lsl: Any, told: Any) -> Sender:
    rate_hz = told.nominal_srate() or None
    name, source_id = told.name(), told.source_id()
    options = {"source_id": source_id} if source_id else {"name": name}
    what = f'LSL stream "{name}" ({told.type() or "no type"}) of {told.hostname()}'
    notes = [] if source_id else ["it has no source_id: it is not found again after its program restarts"]
    parts: tuple[DevicePart, ...] = ()
    try:
        parts = _parts(_header(lsl, told), told.channel_count(), rate_hz)
    except (lsl.util.TimeoutError, lsl.util.LostError):
        notes.append("its program does not answer")
    if rate_hz is None:
        notes.append("its rate is irregular")
    return Sender(
        what, next(iter(options.values())), Source("", "lsl", "lsl", options), parts, note="; ".join(notes)
    )


def _header(lsl: Any, told: Any) -> bytes:
    inlet = lsl.StreamInlet(told, recover=False)
    try:
        return str(inlet.info(INFO_S).as_xml()).encode()
    finally:
        inlet.close_stream()


def _parts(header: bytes, channels: int, rate_hz: float | None) -> tuple[DevicePart, ...]:
    """What the decoder makes of a sample of zeros."""
    own = decoder()
    own.decode(header, HEADER)
    sample = own.decode(struct.pack(f"<{1 + channels}d", *[0.0] * (1 + channels)), SAMPLES)
    return tuple(
        DevicePart(one.device, dict.fromkeys(one.values, rate_hz), last=one.values) for one in sample
    )
