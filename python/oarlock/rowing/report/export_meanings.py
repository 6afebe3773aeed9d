"""`meanings`: definitions of an export's numbers that fit what its device measured, for the page of an export."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from oarlock.rowing.analysis.features import FEATURES, Feature
from oarlock.rowing.strokes.table import StrokeTable

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
