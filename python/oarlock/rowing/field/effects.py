"""The effects of the field simulator and their strengths, each in its physical unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import inf, isfinite, radians
from types import MappingProxyType

from oarlock.storage.errors import DataError

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "soft_tissue": (
            "skin_twist",
            "skin_tilt_rad",
            "skin_shift_m",
            "skin_wander_rad",
            "wobble_rad",
            "wobble_m",
        ),
        "shoulders": ("shoulder_protraction_m", "shoulder_elevation_m"),
        "spine": ("spine_bend_rad", "trunk_twist_rad"),
        "grip": ("grip_slip_m", "grip_turn_rad"),
        "hull": ("hull_pitch_rad", "hull_roll_rad", "hull_yaw_rad", "hull_heave_m"),
        "mounts": ("mount_error_rad", "mount_offset_m"),
        "lengths": ("length_error", "rig_error_m"),
        "encoders": ("oar_offset_rad", "oar_scale", "seat_offset_m", "seat_scale"),
        "magnetics": ("hard_iron_ut", "soft_iron", "rail_iron_ut"),
        "drift": (
            "gyro_bias_rad_s",
            "accel_bias_m_s2",
            "gyro_drift_rad_s",
            "accel_drift_m_s2",
            "gyro_scale",
            "accel_scale",
        ),
        "clocks": ("clock_offset_s", "clock_drift", "clock_jitter_s"),
        "gaps": ("packet_loss", "gap_s"),
        "noise": ("noise_factor",),
        "saturation": ("gyro_range_rad_s", "accel_range_m_s2"),
    }
)
"""Effects by cause."""

_SHARES = {"skin_twist": 1.0, "packet_loss": 0.9, "length_error": 0.3, "oar_scale": 0.5, "seat_scale": 0.5}
_SHARES |= {
    "soft_iron": 0.5,
    "gyro_scale": 0.5,
    "accel_scale": 0.5,
    "clock_drift": 0.01,
    "clock_offset_s": 1.0,
}
_RANGES = ("gyro_range_rad_s", "accel_range_m_s2")


@dataclass(frozen=True, kw_only=True)
class FieldEffects:
    """Strengths of the effects; 0 switches one off (a range: inf, the noise: 1 is Table 4's).

    The defaults are what a careful session on the water has. "Peak" is the largest magnitude during the recording,
    "random" a draw by the seed; every other strength is met exactly, with a random sign or direction.

    Attributes:
        skin_twist: share of a limb's rotation about its length that the skin does not follow. Cuffs on the upper arm
            are off by 5 to 30 deg about the humerus (Hamming et al., J. Biomechanics 45, 2012); straps near the elbow
            do better than those near the shoulder (Warner and Heller, J. Biomechanics, 2025).
        skin_tilt_rad: tilt of a unit by the muscle under it, with the elbow at 90 deg, rad; up to 4 deg in other
            directions than about the humerus (Hamming et al. 2012).
        skin_shift_m: displacement of a unit by that muscle, with the elbow at 90 deg, m.
        skin_wander_rad: slow random rotation of a unit on the skin, rms about each axis, rad.
        wobble_rad: tilt of a unit under one g of specific force, rad, through an oscillator of 10 Hz with a quarter of
            critical damping (soft tissues: Wakeling and Nigg, J. Applied Physiology 90, 2001).
        wobble_m: displacement under one g, m, through the same oscillator.
        shoulder_protraction_m: peak displacement of the shoulder centres along the trunk's forward normal, m:
            forward at the catch, back at the finish.
        shoulder_elevation_m: peak displacement along the trunk, m: raised as the handles are drawn in.
        spine_bend_rad: peak angle between the pelvis and the shoulder girdle, rad: flexed at the catch. A rower's
            lumbar spine moves through the whole stroke (Holt et al., Int. J. Sports Medicine 24, 2003).
        trunk_twist_rad: peak rotation of the shoulder girdle about the trunk's length, rad.
        grip_slip_m: peak slip of the hand along the handle, m.
        grip_turn_rad: peak angle between the handle and the axis of the fingers' grip, rad.
        hull_pitch_rad: peak; positive lowers the stern. In time with the stroke (Loschner, Smith and Galloway,
            ISBS 2000; Sinclair, Greene and Smith, ISBS 2009), rad.
        hull_roll_rad: peak, from stroke to stroke, rad.
        hull_yaw_rad: peak, rad.
        hull_heave_m: peak, m.
        mount_error_rad: angle between each unit's true and its nominal mount, rad.
        mount_offset_m: distance between each unit's true and its nominal position, m.
        length_error: share by which each length of the body differs from its nominal value.
        rig_error_m: error of each coordinate of the pins and of each inboard, m.
        oar_offset_rad: zero error of each oar encoder, rad.
        oar_scale: scale error of each oar encoder.
        seat_offset_m: zero error of the seat encoder, m.
        seat_scale: its scale error.
        hard_iron_ut: length of the constant vector that is added to each magnetometer, uT.
        soft_iron: largest stretch of the field that a magnetometer reads, as a share.
        rail_iron_ut: field of the boat's iron (rail, bolts, stretcher) at 0.3 m, uT; it decreases with the third power
            of the distance.
        gyro_bias_rad_s: bias on each axis with random sign, in addition to the condition's, rad/s.
        accel_bias_m_s2: the same for accelerometers, m/s2.
        gyro_drift_rad_s: random: standard deviation of the change of a bias in a minute, rad/s.
        accel_drift_m_s2: the same for accelerometers, m/s2.
        gyro_scale: scale error of each axis.
        accel_scale: scale error of each axis.
        clock_offset_s: offset of each unit's clock at the start, s; oars and seat have the true time.
        clock_drift: relative rate error of the clock (20e-6 is typical of a crystal).
        clock_jitter_s: random: standard deviation of its time stamps, s.
        packet_loss: random: share of each unit's samples that are lost.
        gap_s: duration of a dropout (NaN) of one unit, which the seed chooses, s.
        noise_factor: white noise relative to that of the model file; 1 is the noise at rest.
        gyro_range_rad_s: readings beyond it are clipped, rad/s.
        accel_range_m_s2: the same for accelerometers, m/s2.
    """

    skin_twist: float = 0.15
    skin_tilt_rad: float = radians(2.0)
    skin_shift_m: float = 0.004
    skin_wander_rad: float = radians(1.0)
    wobble_rad: float = radians(1.0)
    wobble_m: float = 0.002
    shoulder_protraction_m: float = 0.020
    shoulder_elevation_m: float = 0.010
    spine_bend_rad: float = radians(10.0)
    trunk_twist_rad: float = radians(1.5)
    grip_slip_m: float = 0.008
    grip_turn_rad: float = radians(4.0)
    hull_pitch_rad: float = radians(0.3)
    hull_roll_rad: float = radians(1.5)
    hull_yaw_rad: float = radians(0.5)
    hull_heave_m: float = 0.010
    mount_error_rad: float = radians(4.0)
    mount_offset_m: float = 0.010
    length_error: float = 0.03
    rig_error_m: float = 0.005
    oar_offset_rad: float = radians(0.3)
    oar_scale: float = 0.003
    seat_offset_m: float = 0.003
    seat_scale: float = 0.003
    hard_iron_ut: float = 2.0
    soft_iron: float = 0.02
    rail_iron_ut: float = 2.0
    gyro_bias_rad_s: float = 0.0
    accel_bias_m_s2: float = 0.03
    gyro_drift_rad_s: float = 0.001
    accel_drift_m_s2: float = 0.005
    gyro_scale: float = 0.003
    accel_scale: float = 0.003
    clock_offset_s: float = 0.004
    clock_drift: float = 20e-6
    clock_jitter_s: float = 0.0005
    packet_loss: float = 0.01
    gap_s: float = 0.5
    noise_factor: float = 1.5
    gyro_range_rad_s: float = radians(2000.0)
    accel_range_m_s2: float = 16 * 9.80665

    def __post_init__(self) -> None:
        for name, value in self.strengths().items():
            most = inf if name in _RANGES else _SHARES.get(name, 1e9)
            least = 1e-9 if name in _RANGES else 0.0
            if not least <= value <= most:
                raise DataError(
                    f"field effects: {name} is {value}; give a number from {least:g} to {most:g}"
                    + (" (inf switches it off)" if name in _RANGES else " (0 switches it off)")
                )

    def strengths(self) -> dict[str, float]:
        """All strengths by name."""
        return {field.name: float(getattr(self, field.name)) for field in fields(self)}

    @classmethod
    def off(cls) -> FieldEffects:
        """Everything as modelled, with only the model's white noise and the condition's biases."""
        neutral = dict.fromkeys((field.name for field in fields(cls)), 0.0)
        return cls(**neutral | {"noise_factor": 1.0} | dict.fromkeys(_RANGES, inf))

    @classmethod
    def misfit(cls) -> FieldEffects:
        """A rigid body on a rocking boat with wrong mounts (5 deg) and lengths (5 %)."""
        return replace(
            cls.off(),
            mount_error_rad=radians(5.0),
            length_error=0.05,
            hull_pitch_rad=radians(0.3),
            hull_roll_rad=radians(1.5),
            hull_yaw_rad=radians(0.5),
        )

    @classmethod
    def wild(cls) -> FieldEffects:
        """A poor session: the defaults with loose straps, a poor radio, more iron and three times the noise."""
        return replace(
            cls(),
            skin_tilt_rad=radians(3.0),
            skin_wander_rad=radians(1.5),
            wobble_rad=radians(2.0),
            wobble_m=0.004,
            hard_iron_ut=4.0,
            rail_iron_ut=4.0,
            clock_offset_s=0.008,
            clock_jitter_s=0.001,
            packet_loss=0.05,
            gap_s=1.0,
            noise_factor=3.0,
        )

    def scaled(self, strength: float) -> FieldEffects:
        """Every effect times ``strength``: 0 is `off`, 1 these.

        Raises:
            DataError: a strength that is negative or takes an effect beyond its bound.
        """
        if not (isfinite(strength) and strength >= 0.0):
            raise DataError(
                f"field effects: strength {strength}; give 0 (off) or more; 1 does not change the effects"
            )
        scaled = {name: value * strength for name, value in self.strengths().items() if name not in _RANGES}
        scaled["noise_factor"] = 1.0 + (self.noise_factor - 1.0) * strength
        cut = {name: getattr(self, name) / strength if strength > 0.0 else inf for name in _RANGES}
        return FieldEffects(**scaled | cut)

    def only(self, *names: str) -> FieldEffects:
        """These effects with all others switched off; names of effects or of `GROUPS`.

        Raises:
            DataError: no effect and no group has such a name.
        """
        kept: dict[str, float] = {}
        for name in names:
            if name not in GROUPS and name not in self.strengths():
                known = ", ".join((*GROUPS, *self.strengths()))
                raise DataError(f"field effects: no effect or group '{name}'. There are {known}")
            kept |= {effect: getattr(self, effect) for effect in GROUPS.get(name, (name,))}
        return replace(FieldEffects.off(), **kept)
