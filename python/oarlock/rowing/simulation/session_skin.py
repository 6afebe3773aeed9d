"""Soft-tissue artefacts in a simulated calibration session: the field simulator's skin for postures outside rowing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model import ImuDescription
from oarlock.rowing.field.anatomy import Anatomy
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.placement import placed_unit
from oarlock.rowing.field.skin import BoneMotion, skin_of
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.storage.arrays import Floats

if TYPE_CHECKING:
    from oarlock import Model

SessionSkin = Callable[[ImuDescription, Floats, Floats], Floats]


def session_skin(model: Model, effects: FieldEffects | None = None, *, seed: int = 0) -> SessionSkin:
    """Lag of the skin and swelling muscles for `oarlock.simulation.simulate_session`.

    Of `effects` (None: a careful session) only `skin_twist` and `skin_tilt_rad` apply. `seed` sets the directions in
    which muscles swell. The result maps a sensor's description, times (K,) s and coordinates (K, n) to rotation vectors
    (K, 3) of the unit relative to its link, rad in the link's axes; zero where the arms hang.

    Raises:
        DataError: the model is no sculler.
    """
    given = FieldEffects() if effects is None else effects
    chosen = replace(given, wobble_rad=0.0, wobble_m=0.0, skin_wander_rad=0.0, skin_shift_m=0.0)
    anatomy = Anatomy(model.describe())

    def turned(sensor: ImuDescription, time_s: Floats, q: Floats) -> Floats:
        posture = np.zeros((len(q), len(anatomy.joint_names)))
        posture[:, : q.shape[1]] = q
        nothing = np.zeros(len(time_s))
        timing = StrokeTiming(time_s, nothing, nothing, nothing, nothing)
        unit = placed_unit(sensor, FieldEffects.off(), (0.0, 0.0), seed)
        course = BoneMotion(timing, posture, np.zeros((len(time_s), 3)))
        return np.asarray(skin_of(sensor.name, unit, anatomy, course, chosen, seed).at(time_s)[1])

    return turned
