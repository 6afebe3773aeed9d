"""What the viewer's page needs to know of a video: where the file is, where it lies in time, and its camera."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any
from urllib.parse import quote

from oarlock.movement.video.camera import Camera
from oarlock.movement.video.reading import VideoInfo
from oarlock.storage.errors import DataError

LARGEST_DRIFT_PPM = 1e5
SAME_SHAPE = 0.01


def shown_video(
    file: Path,
    page_folder: Path,
    info: VideoInfo,
    *,
    offset_s: float,
    drift_ppm: float = 0.0,
    camera: Camera | None = None,
) -> dict[str, Any]:
    """The entry `video` of a scene. The page refers to the file by its place relative to the page and holds no picture.

    Args:
        file: the video.
        page_folder: folder of the page.
        info: facts of the video.
        offset_s: track time at video time 0, s.
        drift_ppm: by how many millionths the track's clock runs faster than the video's.
        camera: draws the skeleton over the video; None: no skeleton.

    Raises:
        DataError: a number is not finite, or the camera was calibrated for a picture of another shape.
    """
    if not math.isfinite(offset_s) or not abs(drift_ppm) < LARGEST_DRIFT_PPM:
        raise DataError(
            f"video: offset {offset_s} s, drift {drift_ppm} ppm; "
            f"give a finite offset and a drift below {LARGEST_DRIFT_PPM:g} ppm"
        )
    if camera is not None:
        _require_shape(camera, info)
    return {
        "src": _source(file, page_folder),
        "name": file.name,
        "offset_s": float(offset_s),
        "drift_ppm": float(drift_ppm),
        "frame_s": info.frame_s,
        "sound": info.sound,
        "camera": None if camera is None else camera.described(),
    }


def _source(file: Path, page_folder: Path) -> str:
    try:
        relative = os.path.relpath(file.resolve(), page_folder.resolve())
    except ValueError:  # another drive
        return file.resolve().as_uri()
    return quote(Path(relative).as_posix())


def _require_shape(camera: Camera, info: VideoInfo) -> None:
    own, theirs = camera.width_px / camera.height_px, info.width_px / info.height_px
    if abs(own / theirs - 1.0) > SAME_SHAPE:
        raise DataError(
            f"video: the camera was calibrated for {camera.width_px} x {camera.height_px} px, the video shows "
            f"{info.width_px} x {info.height_px} px; a picture of another shape was cropped. "
            "Calibrate with the same setting of the camera"
        )
