"""Why a number of technique is not known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from oarlock import Track
from oarlock.rowing.strokes.strokes import Strokes
from oarlock.storage.arrays import Floats

_WHOLE_STROKE = ("recovery", "path_area", "boat_", "check")
_ARM = ("elbow", "shoulder", "arm_plane", "forearm")
_HANDLE = ("handle", "arms_", "_share", "style_factor")
_OARS = ("catch_angle", "finish_angle", "arc_", "time_difference")
_SIDE_TIMES = ("r_catch_time", "l_catch_time", "r_finish_time", "l_finish_time")


def reasons(track: Track, found: Strokes, columns: Mapping[str, Floats]) -> dict[str, tuple[str, ...]]:
    """By column, a sentence for each stroke in which it is NaN, "" elsewhere."""
    told = {}
    for name, values in columns.items():
        never = _never(track, found, name)
        told[name] = tuple(
            "" if np.isfinite(value) else never or _not_this_time(found, name, row)
            for row, value in enumerate(values)
        )
    return told


def _never(track: Track, found: Strokes, name: str) -> str:
    """Why nobody can know it of this track; "" if one may."""
    joints = track.coordinate_names
    oars: list[str] = [n for n in ("r_oar_phi", "l_oar_phi", "oar_phi") if n in joints]
    if any(part in name for part in ("boat_", "check")) and "surge" not in track.slow:
        return "the boat's acceleration is not in the track: estimate surge"
    if any(part in name for part in _OARS) or name.startswith(_SIDE_TIMES):
        return _no_oars(found, name, oars)
    if "crossover" in name or "overlap" in name:
        return "" if len(oars) == 2 else "hands cross over only in sculling"
    if "_shoulder_" in name and not any(n.startswith(f"{name[:2]}shoulder_abduction") for n in joints):
        return "the model's shoulder is not three hinges; its named angles are in the track"
    if name in ("catch_factor_s", "finish_factor_s") and found.source not in ("oars", "handle"):
        return "it needs the handle's own turn, and no oar or handle was read"
    return ""


def _no_oars(found: Strokes, name: str, oars: list[str]) -> str:
    if not oars:
        return "there are no oars"
    if found.source != "oars":
        return "the oars were not read"
    if len(oars) == 1 and (name.startswith(("r_", "l_")) or "difference" in name or "symmetry" in name):
        return "there is one oar"
    return ""


def _not_this_time(found: Strokes, name: str, row: int) -> str:
    if name in ("boat_speed_cv", "check_factor"):
        return "the boat's mean speed was not given"
    incomplete = np.isnan(found.end_time_s[row])
    if incomplete and any(part in name for part in _WHOLE_STROKE):
        return "a pause followed: no next catch" if found.paused[row] else "no next catch was recorded"
    if name.startswith("check"):
        return "no recovery went before"
    if "arm_plane" in name:
        return "the elbow is straighter than 15 deg in the finish window, or no sensor tells the arm"
    if any(part in name for part in _ARM):
        return "no sensor tells the arm in this stroke"
    if any(part in name for part in (*_HANDLE, "crossover", "overlap")):
        return "the handle was not read throughout this stroke"
    if name.endswith("factor_s"):
        return "no turn was found near the event"
    return "no sensor tells it in this stroke"
