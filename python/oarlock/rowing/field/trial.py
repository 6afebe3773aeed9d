"""Simulates a field recording with its ground truth, for `oarlock simulate --field`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from oarlock.model import EncoderDescription, ImuDescription, ModelDescription
from oarlock.rowing.field.anatomy import apply
from oarlock.rowing.field.effects import FieldEffects
from oarlock.rowing.field.electronics import gap, read_encoder, read_unit, stamped
from oarlock.rowing.field.placement import (
    Encoder,
    SimulatedClock,
    UnitErrors,
    clock,
    encoder,
    placed_unit,
    true_parameters,
)
from oarlock.rowing.field.session import FieldSession, rowed
from oarlock.rowing.field.signals import REACH, STEP_S, AmbientFields, ideal_readings
from oarlock.rowing.field.skin import BoneMotion, Skin, bone_force, skin_of
from oarlock.rowing.simulation.grip import SIDES
from oarlock.rowing.simulation.noise import SimulatedCondition, condition_named
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder

if TYPE_CHECKING:
    from oarlock import Calibration, Model, Recording, Track
    from oarlock.markers import Markers
    from oarlock.recording import ImuStream, ScalarStream


MARKERS = tuple(f"{side}_{joint}" for side in SIDES for joint in ("shoulder", "elbow", "wrist"))


@dataclass(frozen=True, eq=False)
class FieldTrial:
    """A simulated session.

    Attributes:
        recording: readings of the sensors.
        truth: joints over true time; its model has the true lengths. `rowing.field.anatomy` defines its angles.
        markers: true positions of shoulders, elbows and wrists, with gliding shoulders and a bent spine.
        calibration: the true lengths, rig, mounts and hard iron.
        effects: the simulated effects.
        condition: condition of Table 5.
        clocks: clocks of the inertial units, by name.
        encoders: zero and scale errors of the encoders, by name.
        units: all errors of each inertial unit, by name.
        hull_angles_rad: (T, 3) pitch, roll and yaw of the boat.
        hull_heave_m: (T,) its upward displacement.
        surge_m_s2: (T,) acceleration of the boat, stern positive.
    """

    recording: Recording
    truth: Track
    markers: Markers
    calibration: Calibration
    effects: FieldEffects
    condition: SimulatedCondition
    clocks: Mapping[str, SimulatedClock]
    encoders: Mapping[str, Encoder]
    units: Mapping[str, UnitErrors]
    hull_angles_rad: Floats
    hull_heave_m: Floats
    surge_m_s2: Floats

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the recording into a folder, with `truth/`, `markers.csv` (m) and `true_calibration.toml`."""
        with replaced_folder(folder, "recording") as place:
            self.recording.save(place)
            self.truth.save(place / "truth")
            self.calibration.save(place / "true_calibration.toml")
            self.markers.save(place / "markers.csv")


def simulate_field(
    model: Model,
    effects: FieldEffects | None = None,
    *,
    condition: str = "B-B",
    duration_s: float = 40.0,
    rate_spm: float | Sequence[float] = (20.0, 34.0),
    rate_hz: float = 125.0,
    seed: int = 0,
) -> FieldTrial:
    """Simulate sculling on the water, with errors that the model does not have.

    Kinematics and differentiation are independent of filter and engine. With `FieldEffects.off()` the signals are those
    of `simulate_sculling`, except for the noise.

    Args:
        model: the model that the user has; athlete and sensors differ from it by the effects.
        effects: strengths; None is a careful session, `FieldEffects.wild()` a poor one.
        condition: `S-NB`, `B-NB`, `S-B` or `B-B`: boat still or moving, sensors without or with Table 5's biases.
        duration_s: length, s.
        rate_spm: strokes per minute; (20, 34) increases uniformly from 20 to 34.
        rate_hz: of all sensors.
        seed: of all random numbers. Those of one effect do not depend on which others are on.

    Raises:
        ValueError: an unknown condition.
        DataError: the model is not a sculler, the hands cannot reach the handles, or an argument is out of range.
    """
    from oarlock import Recording

    chosen, effects = _checked(condition, rate_hz, duration_s), FieldEffects() if effects is None else effects
    nominal = model.describe()
    true = true_parameters(nominal, effects, seed)
    true_model = model.with_parameters(true) if true else model
    description = true_model.describe()
    session = rowed(description, nominal, effects, chosen.boat_surge, duration_s, rate_spm, seed)
    around = AmbientFields.of(nominal.world, effects, seed)
    bias = (chosen.gyro_bias_rad_s, chosen.accel_bias_m_s2)
    units = {s.name: placed_unit(s, effects, bias, seed) for s in description.inertial_units}
    encoders = {s.name: encoder(s.name, s.joint == "seat", effects, seed) for s in description.encoders}
    clocks = {name: clock(name, effects, seed) for name in units}
    time_s = _stamps(duration_s, rate_hz)
    streams: list[ImuStream | ScalarStream] = [
        _unit_stream(s, units, clocks[s.name], session, around, time_s, effects, seed)
        for s in description.inertial_units
    ]
    streams += [
        _encoder_stream(s, encoders[s.name], session, time_s, effects, seed) for s in description.encoders
    ]
    return FieldTrial(
        recording=Recording(streams, meta=_meta(effects, condition, seed)),
        truth=_truth(true_model, session, time_s),
        markers=_markers(session, time_s),
        calibration=_calibration(true_model, nominal, units, clocks, encoders),
        effects=effects,
        condition=chosen,
        clocks=MappingProxyType(clocks),
        encoders=MappingProxyType(encoders),
        units=MappingProxyType(units),
        hull_angles_rad=np.asarray(session.hull.angles_rad(time_s)),
        hull_heave_m=np.asarray(session.hull.heave_m(time_s)),
        surge_m_s2=np.asarray(session.hull.surge_m_s2(time_s)),
    )


def _checked(condition: str, rate_hz: float, duration_s: float) -> SimulatedCondition:
    chosen = condition_named(condition)
    if not (np.isfinite(rate_hz) and 1.0 <= rate_hz <= 2000.0):
        raise DataError(f"field simulator: rate_hz is {rate_hz}; give 1 to 2000 samples per second")
    if not (np.isfinite(duration_s) and 1.0 <= duration_s <= 3600.0):
        raise DataError(f"field simulator: duration_s is {duration_s}; give 1 to 3600 s")
    return chosen


def _stamps(duration_s: float, rate_hz: float) -> Floats:
    """Sampling times as in `oarlock.simulate`: all differentiated poses are inside the motion."""
    room = REACH * STEP_S
    count = int(np.floor((duration_s - 2.0 * room) * rate_hz + 1e-9)) + 1
    return np.asarray(room + np.arange(count) / rate_hz)


def _unit_stream(
    sensor: ImuDescription,
    units: Mapping[str, UnitErrors],
    own_clock: SimulatedClock,
    session: FieldSession,
    around: AmbientFields,
    time_s: Floats,
    effects: FieldEffects,
    seed: int,
) -> ImuStream:
    """The stream of a unit, sampled when its own clock shows the time stamps, within the motion."""
    name, unit = sensor.name, units[sensor.name]
    true = own_clock.true(time_s)
    inside = (true >= time_s[0] - 1e-9) & (true <= time_s[-1] + 1e-9)
    sampled = stamped(name, true[inside], time_s[inside], effects, seed)
    skin = _skin(name, unit, session, around, effects, seed)
    clean = ideal_readings(session, around, unit, skin, sampled.time_s)
    dropout = gap(name, list(units), sampled.time_s, effects, seed)
    return read_unit(sensor, unit, clean, sampled, dropout, effects, seed)


def _skin(
    name: str,
    unit: UnitErrors,
    session: FieldSession,
    around: AmbientFields,
    effects: FieldEffects,
    seed: int,
) -> Skin:
    if effects.only("soft_tissue") == FieldEffects.off() or not session.anatomy.wears(unit.frame):
        return Skin(None)
    time = session.timing.time_s
    rotation, origin = session.anatomy.bone(unit.frame, unit.offset_m, session.posture)
    carrier_rotation, carrier_place = session.carrier.pose(time)
    place = carrier_place + apply(carrier_rotation, origin + apply(rotation, unit.offset_m))
    force = bone_force(time, place, carrier_rotation @ rotation, around.up, around.gravity_m_s2)
    return skin_of(
        name, unit, session.anatomy, BoneMotion(session.timing, session.posture, force), effects, seed
    )


def _encoder_stream(
    sensor: EncoderDescription,
    error: Encoder,
    session: FieldSession,
    time_s: Floats,
    effects: FieldEffects,
    seed: int,
) -> ScalarStream:
    value = np.asarray(session.spline(time_s))[:, session.anatomy.columns([sensor.joint])[0]]
    return read_encoder(sensor, error, value, time_s, effects, seed)


def _truth(model: Model, session: FieldSession, time_s: Floats) -> Track:
    from oarlock import Track

    own = session.anatomy.own_joint_names
    q, qd, qdd = (np.asarray(session.spline(time_s, order))[:, : len(own)] for order in range(3))
    unknown = np.full_like(q, np.nan)
    units = tuple("m" if joint.kind == "slide" else "rad" for joint in model.describe().joints)
    return Track(
        model=model,
        time_s=time_s,
        joint_names=own,
        joint_units=units,
        q=q,
        qd=qd,
        qdd=qdd,
        q_std=unknown,
        qd_std=unknown,
        qdd_std=unknown,
        observed=np.ones(q.shape, dtype=bool),
        provenance={
            "model": model.name,
            "parameters": dict(model.parameters),
            "simulated": True,
            "field": True,
        },
    )


def _markers(session: FieldSession, time_s: Floats) -> Markers:
    found = session.anatomy.poses(np.asarray(session.spline(time_s)), MARKERS)
    boat = session.boat(time_s)
    boat_from_root = np.swapaxes(boat[0], -1, -2)
    places = [apply(boat_from_root, found[name][1] - boat[1]) for name in MARKERS]
    from oarlock.markers import Markers

    return Markers(MARKERS, time_s, np.stack(places, axis=1))


def _meta(effects: FieldEffects, condition: str, seed: int) -> dict[str, object]:
    strengths = {name: value for name, value in effects.strengths().items() if np.isfinite(value)}
    return {"source": "oarlock field simulator", "condition": condition, "seed": seed, "effects": strengths}


def _calibration(
    model: Model,
    nominal: ModelDescription,
    units: Mapping[str, UnitErrors],
    clocks: Mapping[str, SimulatedClock],
    encoders: Mapping[str, Encoder],
) -> Calibration:
    from oarlock import Calibration

    was = {p.name: p.value for p in nominal.parameters}
    return Calibration(
        parameters={name: value for name, value in dict(model.parameters).items() if value != was[name]},
        mounts={name: (unit.link_from_sensor, unit.offset_m) for name, unit in units.items()},
        mag_offsets_ut={name: unit.hard_iron_ut for name, unit in units.items()},
        noted={
            "clocks": {name: asdict(value) for name, value in clocks.items()},
            "encoders": {name: asdict(value) for name, value in encoders.items()},
        },
    )
