"""The definitions of a page's numbers: their table, and those of an export that fit what its device measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from html import escape

from oarlock.report import plain_table
from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.report.shown import unit_of
from oarlock.rowing.report.tables import anchor
from oarlock.rowing.strokes.table import StrokeTable


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


_TWO_OARS = " Mean of two oars."
_AT_THE_GATE = (
    "The EmPower oarlock measures force at the gate (the pin of the rigger), horizontally, on one oar; NK's Logbook "
    "calls it handle force. In sculling it stands for both oars: BioRow (2017) doubled one side to compare with it."
)
_EMPOWER = {
    "peak_force_n": f"Largest force in the drive, as the device gives it. {_AT_THE_GATE}",
    "mean_force_n": f"Mean force over the drive, as the device gives it. {_AT_THE_GATE}",
    "work_j": f"Work in a stroke, as the device gives it. {_AT_THE_GATE}",
    "power_w": f"Work over the time of the stroke, as the device gives it. {_AT_THE_GATE}",
    "effective_arc_rad": "Arc minus slip and wash: the part with load on the blade.",
}


def meanings(export: StrokeTable) -> Mapping[str, Feature]:
    """The definitions of its columns, by name."""
    has_sides = any(name.startswith(("r_", "l_")) for name in (*export.columns, *export.curves))
    whose = " Of the oar that carries the sensor." if "arc_rad" in export else ""
    own = _EMPOWER if is_empower(export) else {}
    found = {}
    for name in export.columns:
        if name in FEATURES:
            text = own.get(name, FEATURES[name].definition)
            found[name] = replace(
                FEATURES[name], definition=text if has_sides else text.replace(_TWO_OARS, whose)
            )
    return found


def is_empower(export: StrokeTable) -> bool:
    """Whether one oarlock of NK measured it."""
    return export.source.partition(": ")[2].startswith("NK") and "arc_rad" in export
