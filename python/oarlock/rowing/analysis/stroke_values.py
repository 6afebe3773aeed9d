"""Computes the numbers (N,) and curves (N, POINTS) of technique from positions and joints on the stroke grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oarlock.rowing.analysis.rower_places import RowerFrames
from oarlock.rowing.analysis.stroke_grid import (
    CATCH,
    DRIVE,
    END,
    FINISH,
    FIRST_FIFTH,
    LAST_FIFTH,
    MIDDLE,
    RECOVERY,
    STEPS,
    PhaseGrid,
)
from oarlock.storage.arrays import Floats

Values = dict[str, Floats]

BENT_RAD = np.radians(15.0)
"""With a straighter elbow upper arm and forearm span no plane."""
_FOOT, _SHOULDER_OF_PEAK = 0.85, 0.95
_SHOULDER = ("abduction", "rotation", "flexion")
EVENTS = {"catch": CATCH, "finish": FINISH}


@dataclass(frozen=True, eq=False)
class Posture:
    """What the numbers come from: places (N, POINTS, 3); speeds toward the bow (N, POINTS)."""

    rower: RowerFrames
    grid: PhaseGrid
    q: Floats
    places: dict[str, Floats]
    seat_speed_m_s: Floats
    shoulder_speed_m_s: Floats
    handle_speed_m_s: dict[str, Floats]

    def joint(self, name: str) -> Floats:
        """Values (N, POINTS) of a hinge or slide."""
        return np.asarray(self.q[..., list(self.rower.model.coordinate_names).index(name)])


def along_m(place: Floats) -> Floats:
    """Way toward the bow, in which a drive goes."""
    return np.asarray(-place[..., 2])


def shoulders(places: dict[str, Floats]) -> Floats:
    """Middle of the shoulder line."""
    return np.asarray(0.5 * (places["r_shoulder"] + places["l_shoulder"]))


def grip_names(places: dict[str, Floats]) -> dict[str, str]:
    """Of each side the frame where the hand holds: the handle's grip, or without one the hand."""
    found = {}
    for side in "rl":
        for name in (f"{side}_handle", f"{side}_hand"):
            if name in places and np.isfinite(places[name]).any():
                found[side] = name
                break
    return found


def grips(places: dict[str, Floats]) -> dict[str, Floats]:
    """Of each side where the hand holds."""
    return {side: places[name] for side, name in grip_names(places).items()}


def stroke_values(posture: Posture) -> Values:
    """Every number and curve that follows from the positions."""
    values = _seat_and_trunk(posture) | _lean(posture.places)
    held = grips(posture.places)
    if held:
        values |= _handle(posture, held)
    for side in "rl":
        if f"{side}_wrist" in posture.places:
            values |= _arm(posture, side)
        if side in held:
            values |= _hand_path(posture, side, held[side])
    if len(held) == 2 and len(posture.rower.oars) == 2:
        values |= _crossover(held["r"], held["l"])
    return values


def _seat_and_trunk(posture: Posture) -> Values:
    seat = along_m(posture.places["seat"])
    trunk = along_m(shoulders(posture.places)) - seat
    trunk_speed = posture.shoulder_speed_m_s - posture.seat_speed_m_s
    return {
        "seat_travel_m": _range(seat),
        "legs_travel_m": seat[:, FINISH] - seat[:, CATCH],
        "trunk_travel_m": trunk[:, FINISH] - trunk[:, CATCH],
        "seat_position_m": -seat,
        "legs_speed_m_s": posture.seat_speed_m_s,
        "trunk_speed_m_s": trunk_speed,
        **_peak("legs", posture.seat_speed_m_s),
        **_peak("trunk", trunk_speed),
    }


def _range(values: Floats) -> Floats:
    """Over the stroke, or its drive where there is no more."""
    drive = values[:, DRIVE].max(axis=1) - values[:, DRIVE].min(axis=1)
    whole = values.max(axis=1) - values.min(axis=1)
    return np.asarray(np.where(np.isfinite(whole), whole, drive))


def _peak(part: str, speed: Floats) -> Values:
    """Largest speed of the drive, and where it is: a flat top has no single highest point, but a middle."""
    drive = speed[:, DRIVE]
    top = drive.max(axis=1)
    near = np.clip((drive / top[:, None] - _FOOT) / (_SHOULDER_OF_PEAK - _FOOT), 0.0, 1.0)
    share = np.linspace(0.0, 1.0, STEPS + 1)
    place = np.where(top > 0.0, np.sum(near * share, axis=1) / np.sum(near, axis=1), np.nan)
    return {f"{part}_peak_speed_m_s": top, f"{part}_peak_position": place}


def _lean(places: dict[str, Floats]) -> Values:
    line = shoulders(places) - places["seat"]
    lean = np.arctan2(-line[..., 2], line[..., 1])
    catch, finish = lean[:, CATCH], lean[:, FINISH]
    return {
        "catch_lean_rad": catch,
        "finish_lean_rad": finish,
        "lean_swing_rad": finish - catch,
        "lean_rad": lean,
    }


def _handle(posture: Posture, held: dict[str, Floats]) -> Values:
    own = {side: along_m(place) for side, place in held.items()}
    handle = np.mean(list(own.values()), axis=0)
    speed = np.mean([posture.handle_speed_m_s[side] for side in held], axis=0)
    seat, shoulder = along_m(posture.places["seat"]), along_m(shoulders(posture.places))
    travel = handle[:, FINISH] - handle[:, CATCH]
    legs, reach = seat[:, FINISH] - seat[:, CATCH], handle - shoulder
    trunk = (shoulder - seat)[:, FINISH] - (shoulder - seat)[:, CATCH]
    arms = reach[:, FINISH] - reach[:, CATCH]
    arms_speed = speed - posture.shoulder_speed_m_s
    first = seat[:, FIRST_FIFTH] - seat[:, CATCH]
    values = {
        "handle_travel_m": travel,
        "arms_travel_m": arms,
        "legs_share": legs / travel,
        "trunk_share": trunk / travel,
        "arms_share": arms / travel,
        "style_factor": first / (handle[:, FIRST_FIFTH] - handle[:, CATCH]),
        "handle_speed_m_s": speed,
        "arms_speed_m_s": arms_speed,
        "handle_peak_speed_m_s": speed[:, DRIVE].max(axis=1),
        **_peak("arms", arms_speed),
    }
    for side, place in own.items():
        values[f"{side}_handle_travel_m"] = place[:, FINISH] - place[:, CATCH]
    return values


def _arm(posture: Posture, side: str) -> Values:
    shoulder, elbow, wrist = (posture.places[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist"))
    upper, fore = _unit(elbow - shoulder), _unit(wrist - elbow)
    across = np.cross(upper, fore)
    flexion = np.arctan2(np.linalg.norm(across, axis=-1), np.sum(upper * fore, axis=-1))
    bent = np.where(flexion < BENT_RAD, np.nan, 1.0)
    plane = np.arcsin(np.clip(-arm_normal(shoulder, elbow, wrist)[..., 0], -1.0, 1.0)) * bent
    outward = np.arcsin(np.clip(upper[..., 0], -1.0, 1.0)) * (1.0 if side == "l" else -1.0)
    rise = np.arcsin(np.clip(fore[..., 1], -1.0, 1.0))
    values = {
        f"{side}_arm_plane_rad": plane[:, LAST_FIFTH].mean(axis=1),
        f"{side}_finish_arm_plane_rad": plane[:, FINISH],
        f"{side}_elbow_out_rad": outward[:, LAST_FIFTH].mean(axis=1),
        f"{side}_forearm_rise_rad": rise[:, LAST_FIFTH].mean(axis=1),
        f"{side}_elbow_flexion_rad": flexion,
    }
    for event, place in EVENTS.items():
        values[f"{side}_{event}_elbow_flexion_rad"] = flexion[:, place]
        values |= _shoulder_angles(posture, side, event, place)
    return values


def arm_normal(shoulder: Floats, elbow: Floats, wrist: Floats) -> Floats:
    """Unit normal (..., 3) of the plane of upper arm and forearm, (E - S) x (W - E); NaN of an arm that is a line."""
    return _unit(np.cross(elbow - shoulder, wrist - elbow))


def _shoulder_angles(posture: Posture, side: str, event: str, place: int) -> Values:
    found = {}
    for angle in _SHOULDER:
        name = f"{side}_shoulder_{angle}"
        if name in posture.rower.model.coordinate_names:
            sign = -1.0 if side == "l" and angle == "rotation" else 1.0
            found[f"{side}_{event}_shoulder_{angle}_rad"] = sign * posture.joint(name)[:, place]
    return found


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.full_like(vectors, np.nan), where=length > 1e-12))


def _hand_path(posture: Posture, side: str, grip: Floats) -> Values:
    height = grip[..., 1] - posture.places["seat"][..., 1]
    along, up = grip[..., 2], grip[..., 1]
    twice = np.sum(along * np.roll(up, -1, axis=1) - np.roll(along, -1, axis=1) * up, axis=1)
    return {
        f"{side}_catch_handle_height_m": height[:, CATCH],
        f"{side}_finish_handle_height_m": height[:, FINISH],
        f"{side}_drive_handle_height_m": height[:, MIDDLE[0]].mean(axis=1),
        f"{side}_recovery_handle_height_m": height[:, MIDDLE[1]].mean(axis=1),
        f"{side}_handle_path_area_m2": np.abs(0.5 * twice),
        f"{side}_handle_along_m": along,
        f"{side}_handle_height_m": height,
    }


def _crossover(right: Floats, left: Floats) -> Values:
    overlap = right[..., 0] - left[..., 0]
    values = {}
    rows = np.arange(len(overlap))
    for name, part in (("drive", DRIVE), ("recovery", RECOVERY)):
        own = overlap[:, part]
        known = np.isfinite(own).all(axis=1)
        place = np.argmax(np.where(np.isfinite(own), own, -np.inf), axis=1)
        apart = (left - right)[:, part][rows, place]
        values[f"{name}_crossover_height_m"] = np.where(known, apart[:, 1], np.nan)
        values[f"{name}_crossover_lead_m"] = np.where(known, apart[:, 2], np.nan)
        if name == "drive":
            values["hand_overlap_m"] = np.where(known, own[rows, place], np.nan)
    return values


def boat_values(grid: PhaseGrid, surge_m_s2: Floats, mean_speed_m_s: float | None) -> Values:
    """Of the hull, from its acceleration (N, POINTS), stern positive as in the model."""
    bow = -surge_m_s2
    steps = np.diff(grid.time_s, axis=1)
    gained = np.cumsum(0.5 * (bow[:, 1:] + bow[:, :-1]) * steps, axis=1)
    speed = np.concatenate([np.zeros((len(bow), 1)), gained], axis=1)
    speed = speed - grid.phase * speed[:, END:]
    whole = grid.time_s[:, END] - grid.time_s[:, CATCH]

    def mean(of: Floats) -> Floats:
        return np.asarray(np.sum(0.5 * (of[:, 1:] + of[:, :-1]) * steps, axis=1) / whole)

    speed = speed - mean(speed)[:, None]
    sd = np.sqrt(mean(speed**2))
    lost = np.full(len(bow), np.nan)
    if len(bow) > 1:
        follows = np.abs(grid.time_s[1:, CATCH] - grid.time_s[:-1, END]) < 1e-9
        fell = speed[:-1, RECOVERY].max(axis=1) - speed[:-1, END]
        lost[1:] = np.where(follows, fell + speed[1:, CATCH] - speed[1:, DRIVE].min(axis=1), np.nan)
    known = np.nan if mean_speed_m_s is None else mean_speed_m_s
    return {
        "boat_speed_range_m_s": speed.max(axis=1) - speed.min(axis=1),
        "boat_speed_sd_m_s": sd,
        "boat_speed_cv": sd / known,
        "check_m_s": lost,
        "check_factor": lost / known,
        "boat_peak_deceleration_m_s2": bow.min(axis=1),
        "boat_acceleration_m_s2": bow,
        "boat_speed_m_s": speed,
    }
