"""Magnetic disturbances: the field is rotated, tilted or scaled for some time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.evaluation.study.faults.fault import Case, Fault, Names, of_units, with_values
from oarlock.evaluation.study.keys import ONE, StudyKey, sized
from oarlock.recording.streams import ImuStream
from oarlock.storage.arrays import Floats

LASTING = StudyKey("disturbed_s", "number", 3.0, "duration of a magnetic disturbance", 0.0)


def magnetic(names: Names) -> tuple[Fault, ...]:
    """The faults of this module: wrong heading, dip or norm of the measured field."""
    units = (*names.units, ONE)

    def key(name: str, about: str, most: float) -> StudyKey:
        return sized(name, f"{about}, for disturbed_s", units, most=most)

    heading = key("heading_turn_deg", "the field rotated about the vertical, in a random direction", 180.0)
    dip = key("dip_turn_deg", "the field tilted up or down", 90.0)
    share = key("field_error_percent", "the field stronger or weaker by this share", 99.0)
    return (
        Fault(heading, of_units(_heading, names.units)),
        Fault(dip, of_units(_dip, names.units)),
        Fault(share, of_units(_norm, names.units)),
    )


def _heading(unit: ImuStream, angle_deg: float, case: Case) -> ImuStream:
    up = case.up_in(unit.name, unit.time_s)
    return _turned(unit, up, case.sign("heading") * angle_deg, case)


def _dip(unit: ImuStream, angle_deg: float, case: Case) -> ImuStream:
    if unit.mag_ut is None:
        return unit
    level = np.cross(case.up_in(unit.name, unit.time_s), np.nan_to_num(unit.mag_ut))
    size = np.linalg.norm(level, axis=1, keepdims=True)
    return _turned(unit, level / np.where(size > 0.0, size, 1.0), case.sign("dip") * angle_deg, case)


def _turned(unit: ImuStream, axis: Floats, angle_deg: float, case: Case) -> ImuStream:
    if unit.mag_ut is None:
        return unit
    now = case.meanwhile(unit.time_s, case.number(LASTING.name))
    turned = unit.mag_ut.copy()
    turned[now] = Rotation.from_rotvec(np.radians(angle_deg) * axis[now]).apply(unit.mag_ut[now])
    return with_values(unit, mag_ut=turned)


def _norm(unit: ImuStream, percent: float, case: Case) -> ImuStream:
    if unit.mag_ut is None:
        return unit
    now = case.meanwhile(unit.time_s, case.number(LASTING.name))
    factor = 1.0 + 0.01 * percent * case.sign("field")
    return with_values(unit, mag_ut=np.where(now[:, None], factor * unit.mag_ut, unit.mag_ut))
