"""Session search: zero, scale and sign of encoders, from marked positions and from correlated streams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.calibration.session.checks import KEPT, PASSED, REDO, Check
from oarlock.calibration.session.plan import SessionStep
from oarlock.calibration.session.unit_rows import Span
from oarlock.recording.recording import Recording
from oarlock.recording.stream_scales import EncoderScale
from oarlock.recording.streams import ScalarStream
from oarlock.storage.errors import DataError

SAME_MARK = 1e-3
"""Marks closer than this, rad or m, determine a zero but no scale."""
SCALE_LIMIT = 0.05
REST_LIMIT = 0.005
"""Scatter of a reading at a mark, rad or m, that still is held."""
CLEAR = 0.5
"""Correlation from which on two streams surely move together."""


@dataclass(frozen=True)
class ReferenceReading:
    """A mean reading at a known value: reading, its scatter, and the value, rad or m."""

    reading: float
    scatter: float
    value: float


def encoder_scales(
    steps: Sequence[SessionStep], spans: Mapping[str, Span], recording: Recording
) -> tuple[dict[str, EncoderScale], list[Check]]:
    """Stream -> zero and scale from marks and signs, and the checks of these."""
    found: dict[str, EncoderScale] = {}
    checks: list[Check] = []
    signs = {s.stream: s for s in steps if s.kind == "sign"}
    marks: dict[str, list[tuple[SessionStep, ReferenceReading]]] = {}
    for step in steps:
        if step.kind == "mark" and step.stream in recording:
            marks.setdefault(step.stream, []).append((step, _mark(step, recording)))
        elif step.kind in ("mark", "sign") and step.stream not in recording:
            sentence = f'The recording has no stream "{step.stream}"; nothing was found for it.'
            checks.append(Check(step.name, step.stream, step.kind, "-", np.nan, np.nan, "", KEPT, sentence))
    known_signs: dict[str, int] = {}
    for stream, own in marks.items():
        if len({round(m.value / SAME_MARK) for _, m in own}) > 1:
            found[stream], check = _line(stream, own)
            known_signs[stream] = int(np.sign(found[stream].scale))
            checks.append(check)
    for stream in [n for n in signs if n in recording and n not in known_signs]:
        sign, check = _sign(signs[stream], spans, recording, known_signs)
        checks.append(check)
        known_signs[stream] = sign
    for stream, own in marks.items():
        if stream not in found:
            found[stream], check = _zero(stream, own, known_signs.get(stream))
            checks.append(check)
    for stream, sign in known_signs.items():
        if stream not in found and sign < 0:
            found[stream] = EncoderScale(0.0, -1.0)
    return found, checks


def _scalar(name: str, recording: Recording, where: str) -> ScalarStream:
    stream = recording[name]
    if not isinstance(stream, ScalarStream):
        raise DataError(f'{where}: "{name}" is a {type(stream).__name__}, not a scalar stream')
    return stream


def _mark(step: SessionStep, recording: Recording) -> ReferenceReading:
    where = f'plan, step "{step.name}"'
    part = _scalar(step.stream, recording, where).between(*(step.span_s or (0.0, 0.0)))
    values = np.zeros(0) if part is None else part.value[np.isfinite(part.value)]
    if not len(values):
        raise DataError(
            f'{where}: stream "{step.stream}" has no reading from {step.start_s} to {step.end_s} s'
        )
    return ReferenceReading(float(np.median(values)), float(np.std(values)), step.value)


def _line(stream: str, own: Sequence[tuple[SessionStep, ReferenceReading]]) -> tuple[EncoderScale, Check]:
    """Value = scale * (reading - zero) through all marks."""
    readings, values = (np.array([getattr(m, k) for _, m in own]) for k in ("reading", "value"))
    scale, constant = np.polyfit(readings, values, 1)
    left = float(np.abs(scale * readings + constant - values).max())
    held = max(m.scatter for _, m in own)
    off = abs(abs(scale) - 1.0)
    outcome = PASSED if off <= SCALE_LIMIT and held <= REST_LIMIT else REDO
    turned = "Its sign is inverted, which is corrected. " if scale < 0 else ""
    sentence = turned + (
        f"Marks and readings agree to {100 * off:.1f} %."
        if outcome == PASSED
        else f"Readings change by {100 / abs(scale):.0f} % of what the marks do: check the marked values."
    )
    names = ", ".join(s.name for s, _ in own)
    text = f"zero {-constant / scale:+.4f}, scale {scale:+.4f}"
    check = Check(
        names, stream, "zero and scale", text, max(left, held), REST_LIMIT, "rad or m", outcome, sentence
    )
    return EncoderScale(float(-constant / scale), float(scale)), check


def _zero(
    stream: str, own: Sequence[tuple[SessionStep, ReferenceReading]], sign: int | None
) -> tuple[EncoderScale, Check]:
    """Zero from one mark, with the sign from a common movement if there is one."""
    scale = float(sign or 1)
    zero = float(np.mean([m.reading - scale * m.value for _, m in own]))
    held = max(m.scatter for _, m in own)
    outcome = PASSED if held <= REST_LIMIT else REDO
    sentence = (
        "It was held still at its mark."
        if outcome == PASSED
        else "It was not held still at its mark: hold it there for two seconds and record again."
    )
    names = ", ".join(s.name for s, _ in own)
    check = Check(names, stream, "zero", f"zero {zero:+.4f}", held, REST_LIMIT, "rad or m", outcome, sentence)
    return EncoderScale(zero, scale), check


def _sign(
    step: SessionStep, spans: Mapping[str, Span], recording: Recording, known: Mapping[str, int]
) -> tuple[int, Check]:
    """Whether the stream's readings move with those of another as they should."""
    where = f'plan, step "{step.name}"'
    one = _scalar(step.stream, recording, where)
    other = _scalar(step.other, recording, where)
    start, end = spans.get(step.name, (recording.start_s, recording.end_s))
    time_s = one.time_s[(one.time_s >= start) & (one.time_s <= end)]
    values = np.stack([np.interp(time_s, *_complete(s)) for s in (one, other)])
    moved = bool((values.std(axis=1) > SAME_MARK).all()) if len(time_s) > 8 else False
    correlation = float(np.corrcoef(values)[0, 1]) if moved else 0.0
    agreed = correlation * step.sign * known.get(step.other, 1)
    found = -1 if agreed < 0 else 1
    text = f"correlation {correlation:+.2f} with {step.other}"
    if abs(agreed) < CLEAR:
        sentence = (
            "The two streams are not clearly correlated: move both through their range and record again."
        )
        return 1, Check(step.name, step.stream, "sign", text, abs(agreed), CLEAR, "", REDO, sentence)
    sentence = "Its sign is correct." if found > 0 else "Its sign is inverted, which is corrected."
    return found, Check(step.name, step.stream, "sign", text, np.nan, np.nan, "", PASSED, sentence)


def _complete(stream: ScalarStream) -> tuple[np.ndarray, np.ndarray]:
    whole = np.isfinite(stream.value)
    return stream.time_s[whole], stream.value[whole]
