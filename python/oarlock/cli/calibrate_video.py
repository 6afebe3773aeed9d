"""`oarlock calibrate video | clap`: finds where a video lies in a track's time, by motion or by a clap."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.terminal import UsageError, progress
from oarlock.cli.verbs import command

if TYPE_CHECKING:
    from oarlock import Recording, Track
    from oarlock.movement.video import VideoAlignment, VideoInfo


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    command(
        group,
        "oarlock calibrate video out piece.mp4",
        metavars={"track": "TRACK", "video": "VIDEO"},
    )(video)
    command(
        group,
        "oarlock calibrate clap rec piece.mp4 --sensor r_wrist --distance-m 6",
        metavars={"video": "VIDEO"},
        bounds={"distance_m": (0.0, None)},
    )(clap)


def video(track: Path, video: Path, *, near_s: float | None = None) -> dict[str, Any]:
    """Find the offset of a video from the motion of its picture.

    The offset is the time of the track at the beginning of the video. If the movement repeats itself and nothing else
    decides, all offsets that fit are listed, and the exit status is 1.

    Args:
        track: a folder that `oarlock track` wrote.
        video: a video file, such as piece.mp4.
        near_s: search within 2 s of this offset; default: everywhere.
    """
    from oarlock import load_track

    alignment = aligned(load_track(track), video, near_s)
    alignment.require_one()
    return {
        "video": video,
        **vars(alignment),
        "next": [view_next(track, video, alignment.offset_s, alignment.drift_ppm)],
    }


def clap(
    recording: Recording, video: Path, *, sensor: str | None = None, distance_m: float = 0.0
) -> dict[str, Any]:
    """Find the offset of a video from a clap: a peak of the sound against a jolt of an inertial unit.

    Args:
        recording: the recording folder that the track was made from.
        video: a video file, such as piece.mp4.
        sensor: the inertial unit that was struck.
        distance_m: from the clap to the microphone, m: 3 ms each.
    """
    from oarlock.movement.video import clap_offset, sound_of
    from oarlock.recording.streams import ImuStream

    units = [name for name in recording.names if isinstance(recording.sensor(name), ImuStream)]
    if sensor is None and len(units) != 1:
        raise UsageError(
            f"calibrate clap: name the unit that was struck with --sensor; there are {', '.join(units)}"
        )
    stream = recording.sensor(sensor or units[0])
    if not isinstance(stream, ImuStream):
        raise UsageError(f"calibrate clap: {sensor} is not an inertial unit; there are {', '.join(units)}")
    with progress("listening"):
        alignment = clap_offset(sound_of(video), stream, distance_m=distance_m)
    return {
        "video": video,
        "sensor": stream.name,
        **vars(alignment),
        "next": [view_next(Path("TRACK"), video, alignment.offset_s, 0.0)],
    }


def aligned(track: Track, video: Path, near_s: float | None, info: VideoInfo | None = None) -> VideoAlignment:
    """The alignment of a video by motion, with drift if it is long, with progress on the terminal.

    Args:
        track: of the same movement.
        video: the file.
        near_s: search near this offset only, s; None: everywhere.
        info: of the video, if it is known; else the file is opened for it.
    """
    from oarlock.movement.video import align as align_motion
    from oarlock.movement.video import body_motion, picture_motion, video_info, with_drift

    info = info or video_info(video)
    body = body_motion(track)
    with progress("reading the video") as share:
        picture = picture_motion(
            video, lambda time_s: share(min(1.0, time_s / info.duration_s)) if info.duration_s else None
        )
    alignment = align_motion(picture, body, near_s=near_s, frame_s=info.frame_s)
    return alignment if alignment.ambiguous else with_drift(picture, body, alignment, info.frame_s)


def view_next(track: Path, video: Path, offset_s: float, drift_ppm: float) -> str:
    """The command that shows the video beside the track."""
    drift = f" --drift-ppm {drift_ppm:.1f}" if drift_ppm else ""
    return f"oarlock view {track} --video {video} --offset-s {offset_s:.3f}{drift}"
