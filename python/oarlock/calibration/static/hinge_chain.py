"""`calibrate_hinge_chain`: mounts, sensor positions and lengths of a chain of hinges, from rest and a swing.

The search itself is the engine's (`calibrate::hinge_chain`); docs/mounts.md explains it and shows an example.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from oarlock import _core
from oarlock.calibration.static.pose_mounts import Span
from oarlock.model.chain_geometry import HingeLink, hinge_links, posture
from oarlock.recording.calibration import Calibration
from oarlock.recording.inertial_units import chosen_units, readings
from oarlock.recording.plausibility import require_plausible
from oarlock.recording.recording import Recording
from oarlock.recording.streams import ImuStream
from oarlock.storage.array_gate import real_array
from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model
    from oarlock.recording.calibration import Mount


WELL_KNOWN_M = 0.05
"""A coordinate or length whose standard deviation is larger keeps the model's value."""

LONGEST_GAP_S = 0.1
"""Turning that no gyroscope saw for longer is not known well enough to tell places and fields."""

OFFSET_IS_WORTH = 0.5
"""A magnetometer's offset is used where it leaves at most this share of the residual."""


def calibrate_hinge_chain(
    model: Model,
    recording: Recording,
    *,
    sensors: Iterable[str] | None = None,
    still_s: Span | None = None,
    swing_s: Span | Mapping[str, Span] | None = None,
    rest_q: Mapping[str, float] | ArrayLike | None = None,
    first_turn_positive: bool = True,
) -> Calibration:
    """Find mounts, lever arms, lengths and magnetometer offsets of sensors on a chain of hinges.

    The first hinge is fixed in the world, every link carries one inertial unit. The chain first stands still in
    the posture `rest_q`, then swings: parallel hinges all at once, others one after the other.

    Args:
        model: the chain; its poses give each link's axes and hinge in the posture.
        recording: gyroscope and accelerometer of every sensor, magnetometers where there are any. Streams that
            the chain has no sensor for are passed over.
        sensors: the chain's sensors; None takes all inertial units of the model that were recorded.
        still_s: the still stretch (start, end); None takes the longest that all sensors share.
        swing_s: when the chain swings, (start, end) for all or by sensor; None is all but the still stretch.
        rest_q: posture of the still stretch, by coordinate or (n_coordinates,), rad; None is q = 0.
        first_turn_positive: the first clear turn of the first hinge is positive. Gravity does not show the sign.

    Returns:
        Mounts of all sensors; coordinates of their offsets, and lengths between hinges, that are known to 5 cm (the
        model's values stay for the others); magnetometer offsets that halve what is left of the field. Only the
        mounts where a gyroscope is silent for more than 0.1 s: the others rest on its integral. ``noted`` says how
        well each was found, and what was kept.

    Raises:
        DataError: no chain of hinges, a stream without gyroscope or accelerometer, no still stretch, no swing or
            one about several axes, a vertical hinge, a posture that gravity contradicts; with sensor and figures.
    """
    names = chosen_units(model, recording, sensors, "hinge chain")
    _check_spans(still_s, swing_s, names)
    require_plausible(recording.only(names))
    q = posture(model, rest_q)
    links = hinge_links(model, names, q)
    world = model.describe().world
    found = _core.find_hinge_chain(
        [_entry(link, recording[link.sensor], _swing_of(swing_s, link.sensor)) for link in links],
        world.up,
        world.gravity_m_s2,
        still_s,
        first_turn_positive,
    )
    gap = next((text for name in names if (text := _gap_text(recording[name]))), None)
    if gap is None:
        lengths, kept = _lengths(model, links, found["lever_arms"], q)
    else:
        lengths, kept = {}, [f"offsets, lengths and magnetometers ({gap})"]
        found |= {"lever_arms": [None] * len(links), "field": None}
    sized = model.with_parameters(lengths)
    mounts: dict[str, Mount] = {}
    nominal = {s.name: s.mount.offset for s in sized.describe().inertial_units}
    for link, mount, arm in zip(
        hinge_links(sized, names, q), found["mounts"], found["lever_arms"], strict=True
    ):
        offset, unknown = _offset(link, arm, nominal[link.sensor])
        kept += [f"{link.sensor}: offset along {axis} of its link" for axis in unknown]
        mounts[link.sensor] = (np.array(mount["link_from_sensor"]), offset)
    offsets = _mag_offsets(found["field"])
    left_out = [name for name in recording.names if name not in mounts]
    noted = _noted(found, links, q, model) | {"kept_nominal": kept, "left_out": left_out}
    return Calibration(lengths, mounts, noted, offsets)


def _check_spans(still_s: object, swing_s: object, names: Sequence[str]) -> None:
    spans = {"still_s": still_s}
    if isinstance(swing_s, Mapping):
        for name, span in swing_s.items():
            if name not in names:
                raise DataError(
                    f'swing_s: "{name}" is no sensor of the chain. {did_you_mean(str(name), names)}'
                )
            spans[f'swing_s of "{name}"'] = span
    else:
        spans["swing_s"] = swing_s
    for where, span in spans.items():
        pair = real_array(span, (2,), where) if span is not None else np.array([0.0, 1.0])  # type: ignore[arg-type]
        if not (np.isfinite(pair).all() and pair[0] < pair[1]):
            raise DataError(f"{where}: is {pair.tolist()}; expected a start and a later end in s")


def _gap_text(stream: object) -> str | None:
    assert isinstance(stream, ImuStream) and stream.gyro_rad_s is not None
    time_s = stream.time_s[np.isfinite(stream.gyro_rad_s).all(axis=1)]
    steps = np.diff(time_s)
    if not len(steps) or steps.max() <= LONGEST_GAP_S:
        return None
    at = int(np.argmax(steps))
    return f"{stream.name}: no gyroscope from {time_s[at]:.2f} to {time_s[at + 1]:.2f} s"


def _swing_of(swing_s: Span | Mapping[str, Span] | None, name: str) -> Span | None:
    return swing_s.get(name) if isinstance(swing_s, Mapping) else swing_s


def _entry(link: HingeLink, stream: object, swing_s: Span | None) -> dict[str, Any]:
    return readings(stream) | {
        "world_from_link": link.world_from_link.tolist(),
        "hinge_axis_in_world": link.axis_in_world.tolist(),
        "swing_s": swing_s,
    }


# --- lengths and offsets ------------------------------------------------------------------------------


def _lengths(
    model: Model, links: Sequence[HingeLink], arms: Sequence[Mapping[str, Any]], q: Floats
) -> tuple[dict[str, float], list[str]]:
    """Parameters that are the distance between two hinges, and the distances for which there is no such one."""
    names = [link.sensor for link in links]
    distances = _distances(links)
    slopes = {
        name: _slopes(model, names, q, name, value)
        for name, value in model.parameters.items()
        if len(links) > 1
    }
    moved = {p: [i for i, s in enumerate(per) if np.linalg.norm(s) > 1e-6] for p, per in slopes.items()}
    values: dict[str, float] = {}
    kept = []
    for i, distance in enumerate(distances):
        where = f"distance from {links[i].joint} to {links[i + 1].joint}"
        candidates = [p for p in moved if i in moved[p]]
        if len(candidates) != 1 or len(moved[candidates[0]]) != 1:
            why = f"depends on {', '.join(candidates)}" if candidates else "no parameter"
            kept.append(f"{where} ({why})")
            continue
        slope = slopes[candidates[0]][i]
        per_unit = float(np.linalg.norm(slope))
        found, std = (np.asarray(part) for part in arms[i]["to_next_hinge_m"])
        if np.linalg.norm(slope * std) / per_unit > WELL_KNOWN_M:
            kept.append(f"{where} (known to {np.linalg.norm(slope * std) / per_unit:.2f} m only)")
            continue
        values[candidates[0]] = model.parameters[candidates[0]] + float(
            slope @ (found - distance) / per_unit**2
        )
    return values, kept


def _distances(links: Sequence[HingeLink]) -> list[Floats]:
    """From each hinge to the next, square to both axes, in axes of the first one's link, m."""
    found = []
    for link, following in pairwise(links):
        # Along its axis a hinge may be placed anywhere.
        axes = np.column_stack([link.axis_in_world, following.axis_in_world])
        free = axes @ np.linalg.pinv(axes)
        between = following.hinge_in_world - link.hinge_in_world
        found.append(np.asarray(link.world_from_link.T @ (between - free @ between)))
    return found


def _slopes(model: Model, names: Sequence[str], q: Floats, parameter: str, value: float) -> list[Floats]:
    """Change of each distance per unit of a parameter; distances are linear in lengths."""
    step = 0.01
    low, high = (model.with_parameters({parameter: value + h}) for h in (-0.5 * step, 0.5 * step))
    pairs = zip(_distances(hinge_links(low, names, q)), _distances(hinge_links(high, names, q)), strict=True)
    return [(b - a) / step for a, b in pairs]


def _offset(
    link: HingeLink, arm: Mapping[str, Any] | None, nominal: Sequence[float]
) -> tuple[Floats, list[str]]:
    """The sensor in its frame's axes, m, and the axes along which the model's value is kept."""
    if arm is None:
        return np.asarray(nominal), []
    known = np.asarray(arm["offset_std_m"]) < WELL_KNOWN_M
    frame_from_hinge = link.world_from_link.T @ (link.origin_in_world - link.hinge_in_world)
    found = np.asarray(arm["offset_m"]) - frame_from_hinge
    return np.where(known, found, nominal), [axis for axis, k in zip("xyz", known, strict=True) if not k]


def _mag_offsets(field: Mapping[str, Any] | None) -> dict[str, Floats]:
    return {o["name"]: np.asarray(o["offset_ut"]) for o in (field or {}).get("offsets", ()) if _is_worth(o)}


def _is_worth(offset: Mapping[str, Any]) -> bool:
    return bool(offset["residual_ut"] <= OFFSET_IS_WORTH * offset["residual_without_ut"])


# --- what is noted ------------------------------------------------------------------------------------


def _noted(found: Mapping[str, Any], links: Sequence[HingeLink], q: Floats, model: Model) -> dict[str, Any]:
    """Texts, numbers and tables only, so that a file can hold them."""
    field = found["field"]
    noted: dict[str, Any] = {
        "how": "a still stretch and a swing of a chain of hinges",
        "still_s": list(found["mounts"][0]["still_s"]),
        "rest_q": {name: float(value) for name, value in zip(model.coordinate_names, q, strict=True)},
    }
    if field is not None:
        noted["field"] = {key: list(field[key]) for key in ("field_in_world_ut", "field_std_ut")}
    magnetic = {o["name"]: o for o in (field or {}).get("offsets", ())}
    noted["sensor"] = {
        link.sensor: {"joint": link.joint} | _figures(mount, arm, magnetic.get(link.sensor))
        for link, mount, arm in zip(links, found["mounts"], found["lever_arms"], strict=True)
    }
    return noted


def _figures(
    mount: Mapping[str, Any], arm: Mapping[str, Any] | None, offset: Mapping[str, Any] | None
) -> dict[str, Any]:
    left_out = {"name", "link_from_sensor", "still_s", "offset_m", "to_next_hinge_m"}
    parts = (mount, arm or {})
    figures = {k: v for part in parts for k, v in part.items() if k not in left_out and v is not None}
    if arm is not None:
        figures["hinge_to_sensor_m"] = arm["offset_m"]
        figures["hinge_to_sensor_std_m"] = figures.pop("offset_std_m")
    if arm is not None and arm["to_next_hinge_m"] is not None:
        figures["to_next_hinge_m"], figures["to_next_hinge_std_m"] = arm["to_next_hinge_m"]
    if offset is not None:
        figures |= {f"mag_{k}": v for k, v in offset.items() if k != "name"}
        figures["mag_offset_used"] = _is_worth(offset)
    return {k: list(v) if isinstance(v, tuple) else v for k, v in figures.items()}
