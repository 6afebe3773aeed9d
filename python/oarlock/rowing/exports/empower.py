"""Columns of NK's EmPower oarlock, for the SpeedCoach and Logbook readers; its signs of angles equal ours."""

from __future__ import annotations

import numpy as np

from oarlock.rowing.exports.build import TableBuilder, many

_BEYOND_SHARE = 0.02
"""More strokes than this with the peak of force beyond the finish, and its angle is none of the oar."""


def told_angles(gathered: TableBuilder) -> None:
    """Checks signs and the meaning of the angle of peak force.

    NK counts oar angles from the oar across the boat, catch negative, finish positive, as Oarlock does. LiNK 1.26 wrote
    the angle of peak force as travel from the catch: then strokes have it beyond their finish.
    """
    catch, finish = gathered.values("catch_angle_rad"), gathered.values("finish_angle_rad")
    if (catch > 0.0).sum() > (catch < 0.0).sum():
        gathered.notes.append(
            "catch angles are positive in most strokes, against NK's sign: check how the oarlock sits"
        )
    peak = gathered.values("peak_force_angle_rad")
    beyond = peak > finish
    if beyond.sum() > _BEYOND_SHARE * np.isfinite(peak).sum():
        gathered.columns["peak_force_travel_rad"] = gathered.columns.pop("peak_force_angle_rad")
        gathered.notes.append(
            f"the angle of peak force lies beyond the finish in {many(beyond.sum(), 'stroke')}, so it is no oar "
            "angle; it is taken as travel from the catch, peak_force_travel_rad"
        )


def add_arcs(gathered: TableBuilder) -> None:
    """Arc, and arc without slip and wash."""
    arc = gathered.values("finish_angle_rad") - gathered.values("catch_angle_rad")
    effective = arc - gathered.values("slip_rad") - gathered.values("wash_rad")
    gathered.derive("arc_rad", arc, "an angle is missing")
    gathered.derive(
        "effective_arc_rad", effective, "slip or wash is missing: force stayed below the threshold"
    )
