"""Which numbers of a piece a page states without ±: angles of units whose mounts were assumed, not calibrated."""

from __future__ import annotations

from html import escape

from oarlock.report import fixed
from oarlock.rowing.report.averages import Average
from oarlock.rowing.report.piece import Counted, ReportPiece
from oarlock.rowing.report.shown import joined_unit, spread

_OF_UNITS = ("_lean_rad", "elbow", "shoulder", "arm_plane", "forearm")
"""Parts of the names of angles that inertial units measure. A swing is a change of an angle, in which a constant
error of a mount cancels; encoders measure oars and seat."""
NOT_CALIBRATED = '<span class="mark">not calibrated</span>'


def is_uncalibrated(piece: Counted, name: str) -> bool:
    """Whether this number is an angle of a unit that was not calibrated."""
    nominal = isinstance(piece, ReportPiece) and bool(piece.track.provenance.get("nominal_mounts"))
    return nominal and any(part in name for part in _OF_UNITS)


def about(found: Average) -> str:
    """A mean without the decimals that the error of a mount makes meaningless: `about −27°`."""
    return f"about {fixed(found.feature.shown_scale * found.over.mean, 0)}{joined_unit(found.feature)}"


def half_cell(piece: Counted, one: Average) -> str:
    """Half of the 95 % interval of a mean as markup; "not calibrated" where the error of a mount comes on top."""
    if is_uncalibrated(piece, one.feature.name):
        return NOT_CALIBRATED
    return escape(spread(one.feature, one.half))
