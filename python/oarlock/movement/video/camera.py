"""A calibrated camera: its file, and where it sees a place of the track. The viewer draws the skeleton with it.

Pinhole and lens as in OpenCV (Brown 1971): camera axes are x right, y down, z into the picture.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import UnreadableFileError, read_text

KEYS = ("width_px", "height_px", "fx", "fy", "cx", "cy")
EXAMPLE = """width_px = 1920
height_px = 1080
fx = 1400.0
fy = 1400.0
cx = 960.0
cy = 540.0
distortion = [0.0, 0.0, 0.0, 0.0, 0.0]
rotation_vector = [0.0, 1.57, 0.0]
translation_m = [0.0, 0.3, 5.0]
"""


@dataclass(frozen=True)
class Camera:
    """A camera that stands still in a track's root axes.

    Attributes:
        width_px: width of the picture that was calibrated, as shown.
        height_px: its height.
        focal_px: fx and fy, px.
        centre_px: cx and cy, px from the middle of the upper left pixel.
        distortion: k1, k2, p1, p2, k3.
        camera_from_root: rotation (3, 3).
        root_in_camera_m: origin of the root in camera axes (3,), m.
    """

    width_px: int
    height_px: int
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, float, float, float, float]
    camera_from_root: Floats
    root_in_camera_m: Floats

    def pixels(self, places_m: Floats) -> Floats:
        """Pixels (..., 2), right and down, of places (..., 3), m in root axes; NaN behind the camera."""
        seen = places_m @ self.camera_from_root.T + self.root_in_camera_m
        depth = np.where(seen[..., 2] > 1e-6, seen[..., 2], np.nan)
        x, y = seen[..., 0] / depth, seen[..., 1] / depth
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x**2 + y**2
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        right = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x**2)
        down = y * radial + p1 * (r2 + 2.0 * y**2) + 2.0 * p2 * x * y
        return np.stack(
            [self.focal_px[0] * right + self.centre_px[0], self.focal_px[1] * down + self.centre_px[1]],
            axis=-1,
        )

    def described(self) -> dict[str, Any]:
        """The camera as the viewer needs it."""
        return {
            "width_px": self.width_px,
            "height_px": self.height_px,
            "focal_px": list(self.focal_px),
            "centre_px": list(self.centre_px),
            "distortion": list(self.distortion),
            "camera_from_root": self.camera_from_root.tolist(),
            "root_in_camera_m": self.root_in_camera_m.tolist(),
        }


def load_camera(file: Path) -> Camera:
    """Read a camera file, TOML or JSON.

    Raises:
        DataError: no such file, not TOML or JSON, or a value is missing or impossible.
    """
    try:
        text = read_text(file)
        read = json.loads(text) if file.suffix.lower() == ".json" else tomllib.loads(text)
    except UnreadableFileError as error:
        raise DataError(f"{error}; a camera file is needed, TOML or JSON") from None
    except DataError:
        raise
    except ValueError as error:
        raise DataError(f"{file}: {error}; a camera file looks like this:\n{EXAMPLE}") from None
    if not isinstance(read, dict):
        raise DataError(f"{file}: the keys of a camera are needed; it looks like this:\n{EXAMPLE}")
    width, height, fx, fy, cx, cy = (_numbers(file, read, key, 1)[0] for key in KEYS)
    if min(width, height, fx, fy) <= 0.0:
        raise DataError(
            f"{file}: width_px {width:g}, height_px {height:g}, fx {fx:g}, fy {fy:g} must be above 0 (px)"
        )
    k1, k2, p1, p2, k3 = _numbers(file, read, "distortion", 5) if "distortion" in read else (0.0,) * 5
    return Camera(
        width_px=round(width),
        height_px=round(height),
        focal_px=(fx, fy),
        centre_px=(cx, cy),
        distortion=(k1, k2, p1, p2, k3),
        camera_from_root=_rotation(file, read),
        root_in_camera_m=np.array(_numbers(file, read, "translation_m", 3)),
    )


def _numbers(file: Path, read: Mapping[str, Any], key: str, count: int) -> list[float]:
    value = read.get(key)
    values = value if isinstance(value, list) else [value]
    numbers = [float(one) for one in values if isinstance(one, int | float) and not isinstance(one, bool)]
    if not len(values) == len(numbers) == count or not np.isfinite(numbers).all():
        wanted = "a number" if count == 1 else f"a list of {count} numbers"
        raise DataError(
            f"{file}: {key} is {value!r}; give {wanted}. A camera file looks like this:\n{EXAMPLE}"
        )
    return numbers


def _rotation(file: Path, read: Mapping[str, Any]) -> Floats:
    """Rotation (3, 3) from `rotation`, three rows, or `rotation_vector`, rad."""
    if ("rotation" in read) == ("rotation_vector" in read):
        raise DataError(f"{file}: give either rotation, three rows of three numbers, or rotation_vector, rad")
    if "rotation_vector" in read:
        turned: Floats = Rotation.from_rotvec(_numbers(file, read, "rotation_vector", 3)).as_matrix()
        return turned
    rows = read["rotation"]
    if not isinstance(rows, list) or len(rows) != 3:
        raise DataError(f"{file}: rotation is {rows!r}; give three rows of three numbers")
    matrix = np.array([_numbers(file, {"rotation": row}, "rotation", 3) for row in rows])
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if off > 1e-3 or np.linalg.det(matrix) < 0.0:
        raise DataError(
            f"{file}: rotation is not one: rows are off being perpendicular unit vectors by {off:.3g}, determinant "
            f"{np.linalg.det(matrix):.3f}; give rows as OpenCV's Rodrigues writes them"
        )
    return matrix
