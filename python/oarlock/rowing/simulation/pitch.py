"""Pitch of the simulated hull under the moving rower, in addition to surge. Heave (1 to 2 mm) is left out.

Moments about the centre of flotation C at the waterline; theta positive with the stern down, y up from the water, z
toward the stern; point masses m_i of the rower, hull acceleration a toward the stern:

    (I_hull + I_rower + A) theta'' + B theta' + K theta = g sum m_i z_i  - sum m_i (y_i z_i'' - z_i y_i'')
                                                          - a sum m_i y_i + d_blade F - d_drag c v |v|   (less its mean)

K = rho g integral z^2 b dz of a parabolic waterline b = beam (1 - 4 z^2 / length^2); A is the added mass of half discs
of that width (strip theory: Newman, Marine Hydrodynamics, 1977), B a share of critical damping. The mean moment is trim
and is subtracted. After Formaggia, Miglio, Mola and Montano, Int. J. Numerical Methods in Fluids 61, 2009; Mola,
Virginia Tech, 2010, finds pitch below 1 deg within a stroke. The legs are at the height of the hips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import lsim

from oarlock.rowing.simulation.boat import Boat, HullMotion, rower_segments
from oarlock.rowing.simulation.grip import ArmKinematics
from oarlock.rowing.simulation.timing import StrokeTiming
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError

WATER_KG_M3 = 1000.0
GRAVITY_M_S2 = 9.80665
_RUN_IN_STROKES = 8


@dataclass(frozen=True)
class HullForm:
    """Dimensions of a hull that determine its pitch; the defaults are those of a single scull.

    Attributes:
        length_m: of the waterline, m.
        beam_m: of the waterline amidships, m.
        inertia_kg_m2: of the hull without rower about its middle, kg m2.
        damping_ratio: share of critical damping.
        hip_height_m: root (the hip pivot at seat 0) above the waterline, m.
        flotation_z_m: centre of flotation toward the stern from the root, m.
        blade_depth_m, drag_depth_m: where propulsion and drag act, below the waterline, m.
        rowers: who share the hull and row together; each has an equal part of its stiffness and inertia.
    """

    length_m: float = 8.0
    beam_m: float = 0.29
    inertia_kg_m2: float = 70.0
    damping_ratio: float = 0.3
    hip_height_m: float = 0.25
    flotation_z_m: float = 0.30
    blade_depth_m: float = 0.12
    drag_depth_m: float = 0.05
    rowers: int = 1

    def __post_init__(self) -> None:
        for name in ("length_m", "beam_m", "inertia_kg_m2", "damping_ratio"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise DataError(f"hull form: {name} is {getattr(self, name)}; it must be positive and finite")
        for name in ("hip_height_m", "flotation_z_m", "blade_depth_m", "drag_depth_m"):
            if not np.isfinite(getattr(self, name)):
                raise DataError(f"hull form: {name} is {getattr(self, name)}; give a finite number of metres")
        if self.rowers < 1:
            raise DataError(f"hull form: rowers is {self.rowers}; give 1 or more")

    @property
    def stiffness_nm_rad(self) -> float:
        """Hydrostatic moment per angle of the hull, N m/rad; a parabola's second moment is beam length^3 / 30."""
        return WATER_KG_M3 * GRAVITY_M_S2 * self.beam_m * self.length_m**3 / 30.0

    @property
    def added_inertia_kg_m2(self) -> float:
        """Of the water that moves along: half discs of the waterline's width, kg m2."""
        return WATER_KG_M3 * np.pi / 8.0 * self.beam_m**2 * self.length_m**3 * 2.0 / 105.0


@dataclass(frozen=True, eq=False)
class HullPitch:
    """Pitch over time; all arrays (K,). Angles are positive with the stern down, zero at the mean trim.

    ``moment_nm`` is what drives it; ``inertia_kg_m2``, ``damping_nm_s_rad`` and ``stiffness_nm_rad`` what resists.
    """

    time_s: Floats
    angle_rad: Floats
    velocity_rad_s: Floats
    moment_nm: Floats
    inertia_kg_m2: float
    damping_nm_s_rad: float
    stiffness_nm_rad: float


def hull_pitch(
    model: ArmKinematics, q: Floats, timing: StrokeTiming, hull: HullMotion, boat: Boat, form: HullForm
) -> HullPitch:
    """Pitch of the hull for a rower's motion q (K, n_joints) and a given surge.

    It starts as if the first stroke had been rowed before.
    """
    mass, place = rower_segments(model, q)
    height = place[..., 0] + form.hip_height_m
    along = place[..., 1] - form.flotation_z_m
    shares = boat.rower_kg * mass
    moment = _moment(shares, height, along, hull, boat, form)
    moment = moment - _stroke_mean(timing, moment)
    inertia = (form.inertia_kg_m2 + form.added_inertia_kg_m2) / form.rowers
    inertia += float((shares * (height**2 + along**2)).sum(axis=-1).mean())
    stiffness = form.stiffness_nm_rad / form.rowers
    damping = 2.0 * form.damping_ratio * float(np.sqrt(stiffness * inertia))
    angle, velocity = _response(timing, moment, inertia, damping, stiffness)
    return HullPitch(timing.time_s, angle, velocity, moment, inertia, damping, stiffness)


def _moment(
    shares: Floats, height: Floats, along: Floats, hull: HullMotion, boat: Boat, form: HullForm
) -> Floats:
    time = hull.time_s
    rise, run = (make_interp_spline(time, x, k=5)(time, 2) for x in (height, along))
    weight = GRAVITY_M_S2 * (along @ shares)
    swing = (height * run - along * rise) @ shares
    carried = hull.acceleration_m_s2 * (height @ shares)
    drag = boat.drag_kg_m * hull.speed_m_s * np.abs(hull.speed_m_s)
    water = form.blade_depth_m * hull.propulsion_n - form.drag_depth_m * drag
    return np.asarray(weight - swing - carried + water, dtype=np.float64)


def _stroke_mean(timing: StrokeTiming, moment: Floats) -> float:
    whole = timing.stroke < timing.stroke[0] + max(1.0, np.floor(timing.stroke[-1] - timing.stroke[0]))
    return float(moment[whole].mean())


def _response(
    timing: StrokeTiming, moment: Floats, inertia: float, damping: float, stiffness: float
) -> tuple[Floats, Floats]:
    """Exact for a moment that is straight between knots."""
    first = timing.first_stroke
    step = float(timing.time_s[1] - timing.time_s[0])
    before = np.tile(moment[first][:-1], _RUN_IN_STROKES)
    force = np.concatenate([before, moment])
    system = ([[0.0, 1.0], [-stiffness / inertia, -damping / inertia]], [[0.0], [1.0 / inertia]], np.eye(2))
    _, state, _ = lsim(
        (*system, np.zeros((2, 1))), force, step * np.arange(force.size), X0=[force[0] / stiffness, 0.0]
    )
    return state[before.size :, 0], state[before.size :, 1]
