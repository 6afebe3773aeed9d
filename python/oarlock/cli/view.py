"""`oarlock view`: shows a track in a browser as a moving figure with its curves."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from oarlock.cli.options import Json, Replace, example
from oarlock.cli.terminal import UsageError, free_file, print_json, progress, say, verb

if TYPE_CHECKING:
    from collections.abc import Sequence

    from oarlock import Track
    from oarlock.report.viewer.marks import Mark

LONGEST_S = 180.0
"""Default length of the shown part of a track; a browser can display this without delay."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "view",
        epilog=example(
            "oarlock view out",
            "oarlock view out --ghost before",
            "oarlock view out --start-s 60 --end-s 90 --out piece.html --no-open",
            "oarlock view out --video piece.mp4",
            "oarlock view out --video piece.mp4 --offset-s 7.32 --camera camera.toml",
        ),
    )(view)


@verb
def view(
    out: Annotated[Path, typer.Argument(metavar="TRACK", help="A folder that `oarlock track` wrote.")],
    ghost: Annotated[
        Path | None, typer.Option("--ghost", metavar="TRACK", help="Another track to draw over this one.")
    ] = None,
    start_s: Annotated[
        float | None, typer.Option("--start-s", metavar="S", help="Start of the shown interval, s.")
    ] = None,
    end_s: Annotated[
        float | None, typer.Option("--end-s", metavar="S", help="End of the shown interval, s.")
    ] = None,
    every_s: Annotated[
        float | None,
        typer.Option("--every-s", metavar="S", help="Time between shown samples, s; default 0.025."),
    ] = None,
    to: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="File to write; default TRACK/view.html.")
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(
            "--video", metavar="FILE", help="A video to play beside the figure; it stays where it is."
        ),
    ] = None,
    offset_s: Annotated[
        float | None,
        typer.Option(
            "--offset-s",
            metavar="S",
            help="Time of the track at the beginning of the video, s; default: found from its motion.",
        ),
    ] = None,
    drift_ppm: Annotated[
        float, typer.Option("--drift-ppm", metavar="PPM", help="By how much the track's clock runs faster.")
    ] = 0.0,
    camera: Annotated[
        Path | None,
        typer.Option(
            "--camera", metavar="FILE", help="Calibration of a camera that stands still: draws the skeleton."
        ),
    ] = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Write the file without opening a browser.")
    ] = False,
    force: Replace = False,
    json_output: Json = False,
) -> None:
    """Write view.html and open it: one file that works offline.

    Keys in the page: space plays, arrows step, Shift with arrows turns, 1 to 9 are the views, [ and ] set a loop,
    n shows names, u uncertainty.
    """
    from oarlock import load_track
    from oarlock.report.text import fixed
    from oarlock.report.viewer import page
    from oarlock.storage.folder_writer import added_files
    from oarlock.storage.write_file import write_file

    _check_video_options(video, offset_s, drift_ppm, camera)
    track = load_track(out)
    other = load_track(ghost) if ghost is not None else None
    shown_s, cut = _stretch(track, start_s, end_s)
    target = to or out / "view.html"
    free_file(target, force)
    film = None if video is None else _film(track, video, offset_s, drift_ppm, camera, target)
    with progress("drawing"), added_files(target.parent, force) as stage:
        drawn = _scene(track, other, shown_s, every_s, str(ghost or ""))
        drawn["video"] = film
        text = page(drawn, f"{drawn['model']}: {drawn['title'] or out.resolve().name}")
        write_file(stage / target.name, text)
    opened = not (no_open or json_output) and webbrowser.open(target.resolve().as_uri())
    if json_output:
        samples = drawn["places_m"]["rows"]
        print_json(
            {
                "view": target,
                "bytes": len(text.encode()),
                "shown_s": shown_s,
                "samples": samples,
                "cut": cut,
                "video": film
                and {"file": video, "offset_s": film["offset_s"], "drift_ppm": film["drift_ppm"]},
            }
        )
        return
    say(f"Wrote {target}")
    if cut:
        begin, end = (fixed(moment, 0) for moment in shown_s)
        say(f"It shows {begin} to {end} s of a longer track; change this with --start-s and --end-s.")
    if film is not None:
        say(
            f"The video begins at {film['offset_s']:.3f} s of the track; the page plays it from {film['src']}."
        )
    if not opened and not no_open:
        say("No browser could be started; open the file in one.")


def _check_video_options(
    video: Path | None, offset_s: float | None, drift_ppm: float, camera: Path | None
) -> None:
    given = {
        "--offset-s": offset_s is not None,
        "--drift-ppm": drift_ppm != 0.0,
        "--camera": camera is not None,
    }
    if video is None and any(given.values()):
        flag = next(flag for flag, there in given.items() if there)
        raise UsageError(f"view: {flag} needs --video FILE")


def _film(
    track: Track, video: Path, offset_s: float | None, drift_ppm: float, camera: Path | None, target: Path
) -> dict[str, Any]:
    """Return what the page needs to know of the video; its offset is found if it is not given."""
    from oarlock.cli.calibrate_video import aligned
    from oarlock.movement.video import load_camera, video_info
    from oarlock.movement.video.shown import shown_video

    info = video_info(video)
    seen = None if camera is None else load_camera(camera)
    if offset_s is None:
        found = aligned(track, video, None, info)
        found.require_one()
        offset_s, drift_ppm = found.offset_s, found.drift_ppm
    return shown_video(video, target.parent, info, offset_s=offset_s, drift_ppm=drift_ppm, camera=seen)


def _stretch(track: Track, start_s: float | None, end_s: float | None) -> tuple[tuple[float, float], bool]:
    """Return the shown interval, s, and whether it was shortened."""
    if not len(track.time_s):
        raise UsageError("view: the track has no samples")
    first = float(track.time_s[0]) if start_s is None else start_s
    last = float(track.time_s[-1]) if end_s is None else end_s
    if first >= last:
        raise UsageError(f"view: --start-s {first:g} is not before --end-s {last:g}")
    cut = end_s is None and last - first > LONGEST_S
    return (first, first + LONGEST_S if cut else last), cut


def _scene(
    track: Track, other: Track | None, shown_s: tuple[float, float], every_s: float | None, ghost_name: str
) -> dict[str, Any]:
    from oarlock.report.viewer import scene
    from oarlock.rowing import rowing_look

    ghost = None
    if other is not None:
        # The ghost shows only lines, without boat and ground.
        look = rowing_look(other)
        bare = None if look is None else look.bare()
        ghost = scene(other, marks=_marks(other), every_s=every_s, look=bare, title=ghost_name)
    start_s, end_s = shown_s
    return scene(
        track,
        marks=_marks(track),
        ghost=ghost,
        every_s=every_s,
        start_s=start_s,
        end_s=end_s,
        look=rowing_look(track),
    )


def _marks(track: Track) -> Sequence[Mark]:
    """Return a rower's strokes; nothing for other models or if no stroke is found."""
    from oarlock import DataError
    from oarlock.rowing import find_strokes, rowing_look, stroke_marks

    if rowing_look(track) is None:
        return ()
    try:
        return stroke_marks(find_strokes(track))
    except DataError:
        return ()
