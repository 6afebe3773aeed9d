"""Draws videos of a known motion: a skeleton seen by a known camera before a pattern, written with PyAV."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import oarlock
from oarlock.movement.video import Camera
from oarlock.rowing.simulation.experiment import simulate_sculling
from oarlock.storage.arrays import Floats

WIDTH_PX, HEIGHT_PX = 320, 180
LIMB_PX = 4.0


def side_camera(width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> Camera:
    """A camera 5 m to the right of the boat, slightly before it and above, that looks at the seat."""
    eye, target = np.array([-5.0, 0.7, 0.6]), np.array([0.0, 0.2, 0.3])
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    focal = 1.05 * width_px
    return Camera(
        width_px=width_px,
        height_px=height_px,
        focal_px=(focal, focal),
        centre_px=(0.5 * width_px, 0.5 * height_px),
        distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        camera_from_root=rotation,
        root_in_camera_m=-rotation @ eye,
    )


class Motion:
    """Places of a sculler's frames at any time, by a course of the stroke's own time."""

    def __init__(
        self, seconds: float = 40.0, rate_spm: float | tuple[float, float] = 24.0, seed: int = 0
    ) -> None:
        model = oarlock.load_model("sculler")
        truth = simulate_sculling(model, "S-NB", seconds, rate_spm, seed=seed)[0]
        self.track = truth
        names = model.frame_names
        self.own_s = truth.time_s
        self.places_m = np.stack([truth.frame_positions(name) for name in names], axis=1)
        number = {name: k for k, name in enumerate(names)}
        self.bones = [(number[one.name], number[one.parent]) for one in model.describe().frames if one.parent]
        self.stroke_s = 60.0 / (rate_spm if isinstance(rate_spm, float) else rate_spm[0])

    def at(self, own_s: Floats) -> Floats:
        """Places (T, F, 3) at times of the simulation."""
        flat = self.places_m.reshape(len(self.own_s), -1)
        return np.column_stack([np.interp(own_s, self.own_s, column) for column in flat.T]).reshape(
            len(own_s), -1, 3
        )


def draw(
    pixels: Floats, bones: Sequence[tuple[int, int]], ground: Floats, grid: tuple[Floats, Floats]
) -> Floats:
    """A picture (H, W) of limbs between pixels (F, 2) over a ground."""
    picture = ground.copy()
    x, y = grid
    for one, other in bones:
        a, b = pixels[one], pixels[other]
        along = b - a
        length2 = max(float(along @ along), 1e-6)
        low, high = np.minimum(a, b) - 8, np.maximum(a, b) + 8
        c0, r0 = np.clip(low.astype(int), 0, None)
        c1, r1 = np.clip(high.astype(int), 0, None) + 1
        px, py = x[r0:r1, c0:c1] - a[0], y[r0:r1, c0:c1] - a[1]
        if not px.size:
            continue
        share = np.clip((px * along[0] + py * along[1]) / length2, 0.0, 1.0)
        off = np.hypot(px - share * along[0], py - share * along[1])
        cover = np.clip(LIMB_PX + 0.5 - off, 0.0, 1.0)
        tone = 60.0 + 120.0 * ((17 * one) % 7) / 7.0 + 30.0 * np.sin(14.0 * share)
        part = picture[r0:r1, c0:c1]
        part += cover * (tone - part)
    return picture


def write_video(
    file: Path,
    motion: Motion,
    own_s: Floats,
    stamps_s: Floats,
    *,
    camera: Camera | None = None,
    noise: float = 3.0,
    shake_px: float = 0.0,
    bit_rate: int = 400_000,
    seed: int = 0,
    sound: Floats | None = None,
) -> None:
    """Write pictures of the motion at its times `own_s` (N,) with presentation time stamps `stamps_s` (N,).

    Args:
        file: a .webm; VP8, 90,000 ticks a second rounded to milliseconds by the container.
        motion: what is drawn.
        own_s: times of the motion, s.
        stamps_s: time stamps, s, increasing.
        camera: default `side_camera()`.
        noise: standard deviation of each pixel, grey levels.
        shake_px: standard deviation of a slow displacement of the whole picture: a camera that is carried.
        bit_rate: compression, bit/s.
        seed: of pattern, noise and shaking.
        sound: sound at 48 kHz from time 0 on, full scale 1.
    """
    import av

    seen = camera or side_camera()
    rng = np.random.default_rng(seed)
    pattern = gaussian_filter(rng.standard_normal((seen.height_px + 200, seen.width_px + 200)), 3.0)
    pattern = 120.0 + 40.0 * pattern / pattern.std()
    walk = gaussian_filter(rng.standard_normal((len(own_s), 2)), (12.0, 0.0))
    shift = np.clip(shake_px * walk / walk.std(), -90, 90)
    places = motion.at(own_s)
    grid = np.meshgrid(np.arange(seen.width_px, dtype=float), np.arange(seen.height_px, dtype=float))
    with av.open(str(file), "w") as container:
        stream = container.add_stream("libvpx", rate=Fraction(len(stamps_s) - 1, 1))
        stream.width, stream.height, stream.pix_fmt = seen.width_px, seen.height_px, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 90_000)
        stream.bit_rate = bit_rate
        stream.options = {"deadline": "realtime", "cpu-used": "8"}
        ears = container.add_stream("libopus", rate=48_000) if sound is not None else None
        for k, stamp_s in enumerate(stamps_s):
            dx, dy = shift[k]
            r, c = 100 + round(float(dy)), 100 + round(float(dx))
            ground = pattern[r : r + seen.height_px, c : c + seen.width_px]
            pixels = seen.pixels(places[k]) - np.rint([dx, dy])
            picture = draw(pixels, motion.bones, ground, grid) + noise * rng.standard_normal(ground.shape)
            grey = np.clip(picture, 0, 255).astype(np.uint8)
            frame = av.VideoFrame.from_ndarray(
                np.full((seen.height_px * 3 // 2, seen.width_px), 128, np.uint8), "yuv420p"
            )
            frame.planes[0].update(np.ascontiguousarray(_padded(grey, frame.planes[0].line_size)))
            frame.pts, frame.time_base = round(90_000 * stamp_s), Fraction(1, 90_000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        if ears is not None and sound is not None:
            _write_sound(container, ears, sound)


def _padded(grey: NDArray[np.uint8], line_size: int) -> NDArray[np.uint8]:
    return np.pad(grey, ((0, 0), (0, line_size - grey.shape[1])))


def _write_sound(container, stream, sound: Floats) -> None:
    import av

    for start in range(0, len(sound), 960):
        piece = np.zeros(960, np.float32)
        piece[: len(sound[start : start + 960])] = sound[start : start + 960]
        frame = av.AudioFrame.from_ndarray(piece[None, :], "flt", "mono")
        frame.sample_rate, frame.pts, frame.time_base = 48_000, start, Fraction(1, 48_000)
        container.mux(stream.encode(frame))
    container.mux(stream.encode(None))
