"""The section of definitions in a rower's report: definition, unit, sign and source of each number."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

from oarlock.report import plain_table
from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.report.shown import unit_of
from oarlock.rowing.report.tables import anchor


def definitions(names: Iterable[str], features: Mapping[str, Feature] = FEATURES) -> str:
    """A table of the features with these names; both sides of one share a row."""
    rows, seen = [], set()
    wanted = [name for name in dict.fromkeys(names) if name in features]
    for name in wanted:
        plain = name[2:] if name.startswith(("r_", "l_")) else name
        if plain in seen:
            continue
        seen.add(plain)
        same = [n for n in wanted if n == plain or n in (f"r_{plain}", f"l_{plain}")]
        rows.append(_row(features[same[0]], same))
    caption = (
        "In the order of the tables. Small type: the name of the column in the CSV file of strokes, "
        "in SI units and radians; r_ is the rower's right hand (port), l_ the left (starboard)."
    )
    return plain_table("defined", caption, ["number", "definition", "unit", "positive", "source"], rows)


def _row(feature: Feature, names: list[str]) -> list[str]:
    anchors = "".join(f'<span id="{anchor(name)}"></span>' for name in names)
    columns = "<br>".join(f"<code>{escape(name).replace('_', '_<wbr>')}</code>" for name in names)
    label = feature.label.rpartition(",")[0] if names[0].startswith(("r_", "l_")) else feature.label
    unit = unit_of(feature) or "–"
    held = (
        f"<br><small>in the file {feature.unit}</small>"
        if feature.unit not in {feature.shown_unit, "1"}
        else ""
    )
    return [
        f"{anchors}{escape(label)}<br>{columns}",
        escape(feature.definition),
        escape(unit) + held,
        escape(feature.sign or "–"),
        escape(feature.source),
    ]
