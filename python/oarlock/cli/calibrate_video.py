"""`oarlock calibrate video | clap`: finds where a video lies in a track's time, by motion or by a clap."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Json, example
from oarlock.cli.terminal import UsageError, heading, pairs, print_json, progress, say, steps, table, verb

if TYPE_CHECKING:
    from oarlock import Track
    from oarlock.movement.video import VideoAlignment, VideoInfo

TrackFolder = Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")]
VideoFile = Annotated[Path, typer.Argument(metavar="VIDEO", help="A video file, such as piece.mp4.")]
RecordingFolder = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="The recording folder that the track was made from.")
]


def add_to(group: typer.Typer) -> None:
    """Registers the verbs."""
    group.command("video", epilog=example("oarlock calibrate video out piece.mp4"))(align)
    group.command(
        "clap", epilog=example("oarlock calibrate clap rec piece.mp4 --sensor r_wrist --distance-m 6")
    )(clap)


@verb
def align(
    track: TrackFolder,
    video: VideoFile,
    near_s: Annotated[
        float | None,
        typer.Option("--near-s", metavar="S", help="Search within 2 s of this offset; default: everywhere."),
    ] = None,
    json_output: Json = False,
) -> None:
    """Find the offset of a video from the motion of its picture.

    The offset is the time of the track at the beginning of the video. If the movement repeats itself and nothing else
    decides, all offsets that fit are listed, and the exit status is 1.
    """
    from oarlock import load_track

    found = aligned(load_track(track), video, near_s)
    if json_output:
        found.require_one()
        print_json({"video": video, **vars(found)})
        return
    heading("Offset", "time of the track at the beginning of the video")
    pairs(
        [
            ("offset", f"{found.offset_s:.3f} s, standard deviation {1e3 * found.std_s:.0f} ms"),
            ("likeness of motion", f"{found.correlation:.3f} (1: picture and track move alike)"),
            ("in common", f"{found.overlap_s:.1f} s"),
            ("clock of the track", _drift_words(found)),
        ]
    )
    if found.ambiguous:
        heading("Other offsets that fit as well")
        table(
            [">offset s", ">worse by"],
            [[f"{one.offset_s:.3f}", f"{one.worse_by:.1f}"] for one in found.candidates],
        )
        say("Worse by: 2 log of the likelihood ratio; 25 would exclude an offset.")
    found.require_one()
    steps(view_next(track, video, found.offset_s, found.drift_ppm))


@verb
def clap(
    recording: RecordingFolder,
    video: VideoFile,
    unit: Annotated[
        str | None, typer.Option("--sensor", metavar="NAME", help="The inertial unit that was struck.")
    ] = None,
    distance_m: Annotated[
        float,
        typer.Option(
            "--distance-m", metavar="M", min=0.0, help="From the clap to the microphone, m: 3 ms each."
        ),
    ] = 0.0,
    json_output: Json = False,
) -> None:
    """Find the offset of a video from a clap: a peak of the sound against a jolt of an inertial unit."""
    from oarlock import load_recording
    from oarlock.movement.video import clap_offset, sound_of
    from oarlock.recording.streams import ImuStream

    read = load_recording(recording)
    units = [name for name in read.names if isinstance(read.sensor(name), ImuStream)]
    if unit is None and len(units) != 1:
        raise UsageError(
            f"calibrate clap: name the unit that was struck with --sensor; there are {', '.join(units)}"
        )
    stream = read.sensor(unit or units[0])
    if not isinstance(stream, ImuStream):
        raise UsageError(f"calibrate clap: {unit} is not an inertial unit; there are {', '.join(units)}")
    with progress("listening"):
        found = clap_offset(sound_of(video), stream, distance_m=distance_m)
    if json_output:
        print_json({"video": video, **vars(found)})
        return
    heading("Offset", "time of the track at the beginning of the video")
    pairs(
        [
            ("offset", f"{found.offset_s:.3f} s, standard deviation {1e3 * found.std_s:.0f} ms"),
            ("claps that agree", str(found.claps)),
            ("heard", ", ".join(f"{one:.2f} s" for one in found.sound_s)),
            (f"felt by {stream.name}", ", ".join(f"{one:.2f} s" for one in found.jolt_s)),
        ]
    )
    steps(view_next(Path("TRACK"), video, found.offset_s, 0.0))


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
    with progress("reading the video") as told:
        picture = picture_motion(
            video, lambda time_s: told(min(1.0, time_s / info.duration_s)) if info.duration_s else None
        )
    found = align_motion(picture, body, near_s=near_s, frame_s=info.frame_s)
    return found if found.ambiguous else with_drift(picture, body, found, info.frame_s)


def view_next(track: Path, video: Path, offset_s: float, drift_ppm: float) -> str:
    """The command that shows the video beside the track."""
    drift = f" --drift-ppm {drift_ppm:.1f}" if drift_ppm else ""
    return f"oarlock view {track} --video {video} --offset-s {offset_s:.3f}{drift}"


def _drift_words(found: VideoAlignment) -> str:
    if found.drift_ppm:
        return f"{found.drift_ppm:+.0f} ppm against the video's, standard deviation {found.drift_std_ppm:.0f} ppm"
    return "as the video's" if found.drift_std_ppm == found.drift_std_ppm else "not compared: under 3 minutes"
