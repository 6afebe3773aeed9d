"""Reads a video file: its facts, small grey pictures with their time stamps, and its sound..

Video time is the presentation time stamp of a picture, s. A variable frame rate needs nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from oarlock.storage.arrays import Floats
from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import open_regular

if TYPE_CHECKING:
    from av.container import InputContainer

Grey = NDArray[np.float32]

SOUND_HZ = 16_000
LOOKED_AT = 100
_MOST_PIXELS = 7680 * 4320
"""Of a picture (8K): a few bytes of a damaged file announce 16 times as many, and decoders keep 16 pictures."""


@dataclass(frozen=True)
class VideoInfo:
    """Facts of a video file.

    Attributes:
        width_px: width of the picture as it is shown, after the rotation that the file asks for.
        height_px: height as shown.
        frame_s: usual time from picture to picture, s: the median of the first ones.
        duration_s: length, s; 0 if the file does not say it.
        sound: whether there is a sound track.
        codec: name of the picture's codec.
    """

    width_px: int
    height_px: int
    frame_s: float
    duration_s: float
    sound: bool
    codec: str


def video_info(file: Path) -> VideoInfo:
    """Facts of a video file.

    Raises:
        DataError: not a video, or the package `av` is missing.
    """
    with _opened(file) as container:
        stream = container.streams.video[0]
        width, height = stream.codec_context.width, stream.codec_context.height
        first = [(frame.time, frame.rotation) for frame in islice(container.decode(stream), LOOKED_AT)]
        if len(first) < 2:
            raise DataError(f"{file}: fewer than two pictures can be decoded; convert it again")
        if abs(first[0][1]) % 180 == 90:
            width, height = height, width
        steps = np.diff([time_s for time_s, _ in first])
        length = 1e-6 * container.duration if container.duration else 0.0
        return VideoInfo(
            width_px=width,
            height_px=height,
            frame_s=float(np.median(steps)),
            duration_s=float(length),
            sound=bool(container.streams.audio),
            codec=stream.codec_context.name,
        )


def grey_pictures(file: Path, width_px: int, least_step_s: float = 0.0) -> Iterator[tuple[float, Grey]]:
    """Pictures in order of time as `(video time in s, grey values 0 to 255 (height, width))`.

    Args:
        file: the video.
        width_px: width to reduce to; the height follows.
        least_step_s: pictures that follow sooner than this are left out.

    Raises:
        DataError: not a video, or the package `av` is missing.
    """
    with _opened(file) as container:
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        source = stream.codec_context
        height_px = max(8, round(width_px * source.height / max(source.width, 1)))
        before = -np.inf
        for frame in container.decode(stream):
            time_s = frame.time
            if time_s <= before or time_s - before < least_step_s:
                continue
            before = time_s
            small = frame.reformat(width=width_px, height=height_px, format="gray", interpolation="AREA")
            yield float(time_s), small.to_ndarray().astype(np.float32)


def sound_of(file: Path) -> tuple[Floats, Floats]:
    """The sound track, mixed to one channel at 16 kHz: video times (N,) s and pressure (N,), full scale 1.

    Raises:
        DataError: no sound track, not a video, or the package `av` is missing.
    """
    with _opened(file) as container:
        if not container.streams.audio:
            raise DataError(f"{file}: the video has no sound; give the offset with --offset-s")
        return _mixed(container, file)


def _mixed(container: InputContainer, file: Path) -> tuple[Floats, Floats]:
    import av

    resampler = av.AudioResampler(format="flt", layout="mono", rate=SOUND_HZ)
    parts: list[NDArray[Any]] = []
    start_s: float | None = None
    for frame in container.decode(container.streams.audio[0]):
        if start_s is None:
            start_s = frame.time
        parts += [piece.to_ndarray()[0] for piece in resampler.resample(frame)]
    parts += [piece.to_ndarray()[0] for piece in resampler.resample(None)]
    if not parts or start_s is None:
        raise DataError(f"{file}: the sound track is empty; give the offset with --offset-s")
    sound = np.concatenate(parts).astype(np.float64)
    return start_s + np.arange(len(sound)) / SOUND_HZ, sound


@contextmanager
def _opened(file: Path) -> Iterator[InputContainer]:
    """The file opened for reading; what FFmpeg refuses becomes a DataError."""
    try:
        import av
    except ImportError:
        raise DataError('reading a video needs the package av: pip install "oarlock[video]"') from None
    if not file.exists():
        raise DataError(f"{file}: no such file; give the path of a video, such as piece.mp4")
    open_regular(file).close()
    try:
        with av.open(str(file), metadata_errors="replace") as container:
            if not container.streams.video or container.streams.video[0].codec_context is None:
                raise DataError(f"{file}: no picture in it; give a video file, such as piece.mp4")
            container.streams.video[0].codec_context.options = {"max_pixels": str(_MOST_PIXELS)}
            yield container
    except av.FFmpegError as error:
        raise DataError(
            f"{file}: cannot be read as a video ({error.strerror}); convert it, for example to MP4 or WebM"
        ) from None
