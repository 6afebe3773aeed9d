"""A body of nobody: trunk and two arms that sway and are hit, with exact readings of four units on clocks of their own.

Its motion is made of rotations alone and shares nothing with the engine. Twice a second the relative rate of a joint
jumps by 10 rad/s within one sample and dies away in 0.05 s. Shoulders may slide in the thorax, as those of people do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp

import oarlock

LINKS = ("pelvis", "thorax", "upper_arm_l", "upper_arm_r")
PAIRS = (("pelvis", "thorax"), ("thorax", "upper_arm_l"), ("thorax", "upper_arm_r"))
UP = np.array([0.0, 1.0, 0.0])
GRAVITY = 9.80665
FINE_S = 0.002
SAMPLE_S = 0.02
HIT_RAD_S, HIT_DECAY_S = 10.0, 0.05


@dataclass
class HitBody:
    """Readings, what made them, and what a tracker may know."""

    model: oarlock.Model
    recording: oarlock.Recording
    calibration: oarlock.Calibration
    start_q: list[float]
    time_s: np.ndarray
    turns: dict[str, Rotation]

    def track(self, **settings) -> oarlock.Track:
        """From the true start."""
        config = oarlock.Config(magnetometer="off", initial_q=self.start_q, **settings)
        return oarlock.track(self.model, self.recording, self.calibration, config)

    def errors_deg(self, track: oarlock.Track, from_s: float = 1.0) -> tuple[dict, dict]:
        """Tilt of each link, and relative orientation of each pair, over time, deg."""
        time_s = np.arange(from_s, min(track.time_s[-1], self.time_s[-1]) - 0.1, SAMPLE_S)
        found = {
            link: Slerp(track.time_s, Rotation.from_quat(track.frame_quat_wxyz(link)[:, [1, 2, 3, 0]]))(
                time_s
            )
            for link in LINKS
        }
        true = {link: Slerp(self.time_s, turns)(time_s) for link, turns in self.turns.items()}
        tilt = {
            link: np.degrees(
                np.arccos(np.clip(np.sum(found[link].inv().apply(UP) * true[link].inv().apply(UP), 1), -1, 1))
            )
            for link in LINKS
        }
        relative = {
            pair: np.degrees(
                (
                    (true[pair[0]].inv() * true[pair[1]]).inv() * (found[pair[0]].inv() * found[pair[1]])
                ).magnitude()
            )
            for pair in PAIRS
        }
        return tilt, relative


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(list(values)))))


def hit_body(
    duration_s: float = 30.0, slide_m: float = 0.0, gyro_bias_rad_s: float = 0.0, seed: int = 0
) -> HitBody:
    random = np.random.default_rng(seed)
    fine_s = np.arange(0.0, duration_s, FINE_S)
    model = oarlock.load_model("upper_body").with_units(LINKS)
    turns = {"pelvis": Rotation.from_rotvec(_sway(random, fine_s, 0.35, 0.4))}
    turns["thorax"] = (
        turns["pelvis"] * Rotation.from_rotvec(_sway(random, fine_s, 0.3, 0.6)) * _hits(random, fine_s)
    )
    for link in LINKS[2:]:
        turns[link] = (
            turns["thorax"] * Rotation.from_rotvec(_sway(random, fine_s, 0.8, 0.9)) * _hits(random, fine_s)
        )
    units = {unit.name: unit for unit in model.describe().sensors}
    places = _places(model, turns, _sway(random, fine_s, 0.15, 0.6), slide_m, random)
    streams, mounts = [], {}
    half = int(SAMPLE_S / FINE_S / 2)
    for link in LINKS:
        offset = np.asarray(units[link].mount.offset)
        mount = Rotation.random(random_state=random)
        place = gaussian_filter1d(places[link] + turns[link].apply(offset), 1.5, axis=0)
        velocity = np.gradient(place, FINE_S, axis=0)
        at = np.arange(2 * half + random.integers(2 * half), len(fine_s) - 2 * half, 2 * half)
        # A reading is the mean over its sample, so that what a hit turns is in the readings.
        turned = (turns[link][at - half].inv() * turns[link][at + half]).as_rotvec() / SAMPLE_S
        acceleration = (velocity[at + half] - velocity[at - half]) / SAMPLE_S
        bias = gyro_bias_rad_s * random.standard_normal(3)
        force = turns[link][at].inv().apply(acceleration + GRAVITY * UP)
        streams.append(
            oarlock.recording.ImuStream(
                link,
                fine_s[at],
                gyro_rad_s=mount.inv().apply(turned) + bias,
                accel_m_s2=mount.inv().apply(force),
            )
        )
        mounts[link] = (mount.as_matrix(), offset)
    recording = oarlock.Recording(streams)
    first = int(np.ceil(max(stream.time_s[0] for stream in streams) / FINE_S))
    start_q = _start(model, {link: turn[first] for link, turn in turns.items()})
    return HitBody(model, recording, oarlock.Calibration(mounts=mounts), start_q, fine_s, turns)


def _sway(random, time_s, size, most_hz):
    """Sums of sines about each axis that begin at rest."""
    hz, phase = random.uniform(0.1, most_hz, (4, 3)), random.uniform(0.0, 2.0 * np.pi, (4, 3))
    waves = np.sin(2.0 * np.pi * hz * time_s[:, None, None] + phase).sum(axis=1) / 2.0
    return size * waves * np.minimum(1.0, time_s / 2.0)[:, None] ** 2


def _hits(random, time_s) -> Rotation:
    rate = np.zeros((len(time_s), 3))
    decay = np.exp(-np.arange(0.0, 0.5, FINE_S) / HIT_DECAY_S)[:, None]
    axis = UP
    for k, at in enumerate(np.arange(2.0, time_s[-1] - 1.0, 0.5)):
        if k % 2 == 0:
            axis = random.standard_normal(3)
            axis /= np.linalg.norm(axis)
        first = int(at / FINE_S)
        rate[first : first + len(decay)] += (-1.0) ** k * HIT_RAD_S * decay * axis
    return Rotation.from_rotvec(np.cumsum(rate, axis=0) * FINE_S)


def _places(model, turns, pelvis_m, slide_m, random):
    """Origins of the links: the lumbar segment bends in its middle, shoulders slide."""
    length = model.parameters
    middle = np.array([0.0, length["pelvis"] + 0.5 * length["lumbar"], 0.0])
    places = {"pelvis": pelvis_m}
    places["thorax"] = (
        pelvis_m + turns["pelvis"].apply(middle) + turns["thorax"].apply([0, 0.5 * length["lumbar"], 0])
    )
    for side, sign in (("l", -1.0), ("r", 1.0)):
        slide = gaussian_filter1d(random.standard_normal(pelvis_m.shape), 0.05 / FINE_S, axis=0)
        shoulder = [0.0, length["thorax"], sign * length[f"shoulder_{side}"]] + slide_m * slide / slide.std()
        places[f"upper_arm_{side}"] = places["thorax"] + turns["thorax"].apply(shoulder)
    return places


def _start(model, turn) -> list[float]:
    """Coordinates of the true start; the thoracic hinges take all of the spine's turn."""
    names = list(model.coordinate_names)
    q = np.zeros(len(names))
    z, x, y = (turn["pelvis"].inv() * turn["thorax"]).as_euler("ZXY")
    for name, value in (("flexion", -z), ("bending", x), ("rotation", y)):
        q[names.index(f"thoracic_{name}")] = value
    for joint, rotation in (
        ("pelvis", turn["pelvis"]),
        *((f"shoulder_{s}", turn["thorax"].inv() * turn[f"upper_arm_{s}"]) for s in "lr"),
    ):
        for axis, value in zip("xyz", rotation.as_rotvec(), strict=True):
            q[names.index(f"{joint}.r{axis}")] = value
    return q.tolist()
