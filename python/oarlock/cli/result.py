"""What a run ends with: each angle's range with half of its 95 % band, what is not usable and why, and one link."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.cli.tables import write_contradiction
from oarlock.cli.terminal import pairs, say

if TYPE_CHECKING:
    from oarlock import Track
    from oarlock.movement.ranges import MotionRange

MOST_LINES = 8
SPOILING = {
    "nominal_mounts",
    "no_stream",
    "filter_reset",
    "rejected",
    "stuck",
    "time_order",
    "sensor_suspect",
}


def result_of(track: Track) -> dict[str, Any]:
    """`strokes` and `figures` of a rower, else `angles`, the largest range first.

    An angle: `name`, `low_deg`, `high_deg`, `band_deg` (half of the 95 % interval of both), `doubt`, empty if usable.
    """
    from oarlock.movement.movement import movement_of
    from oarlock.rowing.report.write import is_of_rower, rowing_front

    if is_of_rower(track):
        _, front = rowing_front(track)
        figures = [{"name": one.name, "value": one.value, "detail": one.detail} for one in front.figures]
        return {"strokes": front.did, "figures": figures}
    if track.model is None or not len(track.time_s):
        return {"angles": []}
    ranges = sorted(movement_of(track).ranges.values(), key=lambda one: -one.range_deg)
    return {"angles": [_angle(one) for one in ranges if not one.hardly_moved]}


def _angle(one: MotionRange) -> dict[str, Any]:
    """A wide band alone does not make an angle useless: it is printed, unless it exceeds half of the range."""
    from oarlock.evaluation.errors import BAND_95
    from oarlock.movement.ranges import WIDE

    band_deg = BAND_95 * max(one.lowest_std_deg, one.highest_std_deg)
    is_usable = one.well_measured or (one.doubt in ("", WIDE) and band_deg <= 0.5 * one.range_deg)
    return {
        "name": one.name,
        "low_deg": one.lowest_deg,
        "high_deg": one.highest_deg,
        "band_deg": band_deg,
        "doubt": "" if is_usable else one.cause,
    }


def write_result(track: Track, page: Path | None, suspects: bool = False) -> None:
    """Prints the result, the notes without which it would be believed too much, and the place of its report."""
    write_contradiction(track.notes)
    result = result_of(track)
    if "strokes" in result:
        say(result["strokes"], style="bold")
        pairs([(one["name"], f"{one['value']}   {one['detail']}") for one in result["figures"]])
    else:
        _write_angles(result["angles"])
    for note in track.notes:
        if note.code in SPOILING and (suspects or not note.startswith("Suspect: ")):
            say(note.text, style="yellow")
    if page is not None:
        say(f"\nopen {page}")


def _write_angles(angles: list[dict[str, Any]]) -> None:
    """A line for each angle with both sides, then those that are not usable, by their reason."""
    from oarlock.report.viewer.sides import side_of

    usable: dict[str, list[str]] = {}
    unusable: dict[str, list[str]] = {}
    for one in angles:
        side, stem = side_of(one["name"])
        name, mark = stem.replace("_", " "), side[:1].upper()
        if one["doubt"]:
            unusable.setdefault(one["doubt"], []).append(f"{name} {mark}".strip())
            continue
        band = f" (+- {one['band_deg']:.0f})" if isfinite(one["band_deg"]) else ""
        span = f"{mark} {one['low_deg']:.0f} to {one['high_deg']:.0f} deg{band}".strip()
        usable.setdefault(name, []).append(span)
    pairs(
        [(name, ", ".join(sorted(spans, reverse=True))) for name, spans in list(usable.items())[:MOST_LINES]]
    )
    if len(usable) > MOST_LINES:
        say(f"and {len(usable) - MOST_LINES} more in the report")
    for doubt, names in unusable.items():
        say(f"not usable, {doubt}: {', '.join(names)}")
    if not angles:
        say("No angle moved by 5 deg or more.")
