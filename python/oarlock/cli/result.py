"""What a run ends with: each angle's range with half of its 95 % band, what is not usable and why, and one link."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.cli.tables import write_contradiction
from oarlock.cli.terminal import pairs, say

if TYPE_CHECKING:
    from oarlock import Track
    from oarlock.movement.blocks import MovementAnalysis

MOST_LINES = 8
SPOILING = {
    "nominal_mounts",
    "encoder_as_read",
    "heading_undetermined",
    "no_stream",
    "filter_reset",
    "rejected",
    "stuck",
    "time_order",
    "sensor_suspect",
}


def result_of(track: Track) -> dict[str, Any]:
    """`strokes` and `figures` of a rower, else `angles`, the largest range first, as the report has them.

    An angle: `name`, `block` (None unless the movement has several), `low_deg`, `high_deg`, `range_deg`, `band_deg`
    (half of the 95 % interval of the range), `doubt`, empty if the range is measured well.
    """
    from oarlock.movement.movement import movement_of
    from oarlock.rowing.report.write import is_of_rower, rowing_front
    from oarlock.storage.errors import DataError

    if is_of_rower(track):
        try:
            _, front = rowing_front(track)
        except DataError as error:
            return {"strokes": str(error), "figures": []}
        figures = [{"name": one.name, "value": one.value, "detail": one.detail} for one in front.figures]
        return {"strokes": front.did, "figures": figures}
    if track.model is None or not len(track.time_s):
        return {"angles": []}
    movement = movement_of(track)
    return {
        "angles": [
            {
                "name": one.name,
                "block": block.number if block and movement.several else None,
                "low_deg": movement.ends(one).lowest_deg,
                "high_deg": movement.ends(one).highest_deg,
                "range_deg": one.range_deg,
                "band_deg": one.half_deg,
                "doubt": "" if one.well_measured else one.cause,
            }
            for block, one in sorted(movement.block_ranges, key=lambda pair: -pair[1].range_deg)
            if not one.hardly_moved
        ]
    }


def write_result(track: Track, page: Path | None, suspects: bool = False) -> None:
    """Prints the result, the notes that limit what it can be used for, and the place of its report."""
    from oarlock.evaluation.suspects.suspect import SUSPECT_NOTE

    write_contradiction(track.notes)
    result = result_of(track)
    if "strokes" in result:
        say(result["strokes"], style="bold")
        pairs([(one["name"], f"{one['value']}   {one['detail']}") for one in result["figures"]])
    else:
        _write_angles(track, result["angles"])
    for note in track.notes:
        if note.code in SPOILING and (suspects or not note.startswith(SUSPECT_NOTE)):
            say(note.text, style="yellow")
    if page is not None:
        say(f"\nopen {page}")


def _write_angles(track: Track, angles: list[dict[str, Any]]) -> None:
    """A line for each angle with both sides, those that are not measured well by their reason, and what a range is."""
    from oarlock.movement.angles import UNDETERMINED
    from oarlock.movement.movement import movement_of
    from oarlock.movement.ranges import CAUSES
    from oarlock.report.viewer.sides import side_of

    spans: dict[str, dict[str, list[str]]] = {"": {}}
    unusable: list[str] = []
    for one in angles:
        side, stem = side_of(one["name"])
        name = stem.replace("_", " ")
        band = f" +- {one['band_deg']:.0f}" if isfinite(one["band_deg"]) else ""
        where = f", block {one['block']}" if one["block"] else ""
        ends = f"{one['low_deg']:z.0f} to {one['high_deg']:z.0f} deg"
        span = f"{side[:1].upper()} {ends} (range {one['range_deg']:.0f}{band}{where})".strip()
        if one["doubt"] == CAUSES[UNDETERMINED]:
            unusable.append(f"{name} {side[:1].upper()}".strip())
        else:
            spans.setdefault(one["doubt"], {}).setdefault(name, []).append(span)
    for doubt, by_name in spans.items():
        if doubt:
            say(f"not measured well, {doubt}:")
        rows = [
            (name, ", ".join(sorted(own, key=lambda span: span[:1], reverse=True)))
            for name, own in by_name.items()
        ]
        pairs(rows[:MOST_LINES])
        if len(rows) > MOST_LINES:
            say(f"and {len(rows) - MOST_LINES} more in the report")
    if unusable:
        say(f"not usable, {CAUSES[UNDETERMINED]}: {', '.join(dict.fromkeys(unusable))}")
    if any(spans.values()):
        say(f"{_meaning(movement_of(track))}; +-: half of the 95 % interval of the range", style="dim")
    if not angles:
        say("No angle moved by 5 deg or more.")


def _meaning(movement: MovementAnalysis) -> str:
    """Over which time ranges and their ends are taken."""
    if movement.several:
        return "range and ends: means of the cycles of the block"
    if movement.blocks:
        return "range: mean of the cycles; ends: of all counted time"
    return "range and ends: of all counted time"
