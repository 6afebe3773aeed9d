"""The player of a rower's report: moving figure, curves, strokes to repeat, a second piece as a ghost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any

from oarlock.report import fixed, folded_help
from oarlock.report.viewer import SHOWN_EVERY_S, Curve, embed, joint_curves, scene
from oarlock.rowing.figure.shapes import rowing_look, stroke_marks
from oarlock.rowing.report.piece import ReportPiece
from oarlock.rowing.report.tables import is_uncalibrated

LONGEST_S = 180.0
"""Longest part in the page."""
_SAMPLES = 2400
"""Samples of a piece in the page, about 1 MB; longer pieces have them farther apart. 180 s at 13 Hz still have 20 to 40
samples a stroke, between which the player interpolates."""
SHOWN = ("oar_phi", "handle", "seat", "trunk", "elbow_flexion", "shoulder_flexion", "shoulder_abduction")
"""Joints with curves beside the figure; all joints are in the section Curves."""
HELP = (
    "Figure and curves share one cursor. Drag to rotate, wheel or + and − to zoom; space plays, arrows step. Loop "
    "repeats a stroke, Ghost draws another one over it; aligned by phase, both have the same length. Uncertainty shows "
    "where each joint is with 95 % probability. Closed loop: the constraint that keeps the hand on the handle."
)
NAMES = {"oar_phi": "oar angle"}
"""Labels of joints that differ from those of the model file."""


def player(pieces: Sequence[ReportPiece]) -> str:
    """HTML with figure, curves and strokes; a second piece is drawn as the ghost."""
    start_s, end_s = _stretch(pieces[0])
    ghost = _scene(pieces[1], *_stretch(pieces[1]), bare=True) if len(pieces) > 1 else None
    shown = _scene(pieces[0], start_s, end_s, ghost)
    hint = _hint(pieces, start_s, end_s)
    shown_hint = f'<p class="hint">{hint}</p>' if hint else ""
    return shown_hint + embed(shown, "player") + folded_help(HELP)


def _scene(piece: ReportPiece, start_s: float, end_s: float, ghost: Any = None, bare: bool = False) -> Any:
    track, look = piece.track, rowing_look(piece.track)
    if look is not None:
        look = replace(look, first_curves=tuple(NAMES.get(name, name) for name in look.first_curves))
    curves = [_as_elsewhere(curve) for curve in joint_curves(track) if _stem(curve) in SHOWN]
    return scene(
        track,
        marks=stroke_marks(piece.technique.found),
        curves=curves,
        ghost=ghost,
        every_s=max(SHOWN_EVERY_S, (end_s - start_s) / _SAMPLES),
        start_s=start_s,
        end_s=end_s,
        look=look.bare() if look is not None and bare else look,
        title=piece.name,
    )


def _stem(curve: Curve) -> str:
    return curve.key.removeprefix("r_").removeprefix("l_")


def _as_elsewhere(curve: Curve) -> Curve:
    """The curves with the names and units of the page's tables."""
    name = NAMES.get(_stem(curve))
    if name is not None:
        curve = replace(curve, panel=name, label=curve.side or name)
    if curve.unit != "mm":
        return curve
    std = None if curve.std is None else 0.1 * curve.std
    return replace(curve, unit="cm", value=0.1 * curve.value, std=std)


def _stretch(piece: ReportPiece) -> tuple[float, float]:
    """The whole of a track of up to three minutes; so much of a longer one, from its first counted stroke."""
    first, last = float(piece.track.time_s[0]), float(piece.track.time_s[-1])
    if last - first <= LONGEST_S:
        return first, last
    counted = piece.table["catch_time_s"][piece.counted]
    start = float(counted[0]) if len(counted) else first
    start = min(start, last - LONGEST_S)
    return start, start + LONGEST_S


def _left_out(piece: ReportPiece, start_s: float, end_s: float) -> str:
    """What of a long piece the player lacks."""
    before, after = start_s - float(piece.track.time_s[0]), float(piece.track.time_s[-1]) - end_s
    parts = [
        f"the {which} {fixed(length, 0)} s"
        for which, length in (("first", before), ("last", after))
        if length >= 0.5
    ]
    return f"{' and '.join(parts)} are left out to keep the page small"


def _hint(pieces: Sequence[ReportPiece], start_s: float, end_s: float) -> str:
    first, text = pieces[0], ""
    if end_s - start_s < float(first.track.time_s[-1] - first.track.time_s[0]) - 1e-9:
        text += f"It shows {fixed(start_s, 0)} to {fixed(end_s, 0)} s of the piece; {_left_out(first, start_s, end_s)}."
    if len(pieces) > 1:
        text += (
            f" <b>{escape(first.name)}</b> in colours; as the ghost, one usual stroke of "
            f"<b>{escape(pieces[1].name)}</b>, stretched to the same length."
        )
        if any(is_uncalibrated(one, "catch_lean_rad") for one in pieces):
            text += " Trunk and arms of both cannot be compared: not both were calibrated."
    return text.strip()
