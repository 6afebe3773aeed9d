"""`oarlock view`: shows a track in a browser as a moving figure with its curves."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.terminal import UsageError, free_file, progress, say
from oarlock.cli.verbs import command

if TYPE_CHECKING:
    from collections.abc import Sequence

    from oarlock import Track
    from oarlock.report.viewer.marks import Mark

LONGEST_S = 180.0
"""Default length of the shown part of a track; a browser can display this without delay."""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    command(
        app,
        "oarlock view out",
        "oarlock view out --ghost before",
        "oarlock view out --start-s 60 --end-s 90 --out piece.html --no-open",
        "oarlock view out --video piece.mp4",
        "oarlock view out --video piece.mp4 --offset-s 7.32 --camera camera.toml",
        show=_show,
        metavars={"track": "TRACK", "ghost": "TRACK"},
    )(view)


def view(
    track: Path,
    *,
    ghost: Path | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    every_s: float | None = None,
    out: Path | None = None,
    video: Path | None = None,
    offset_s: float | None = None,
    drift_ppm: float = 0.0,
    camera: Path | None = None,
    no_open: bool = False,
    force: bool = False,
    json_output: bool = False,
) -> dict[str, Any]:
    """Write view.html and open it: one file that works offline.

    Keys in the page: space plays, arrows step, Shift with arrows turns, 1 to 9 are the views, [ and ] set a loop,
    n shows names, u uncertainty.

    Args:
        track: a folder that `oarlock track` wrote.
        ghost: another track to draw over this one.
        start_s: start of the shown interval, s.
        end_s: end of the shown interval, s.
        every_s: time between shown samples, s; default 0.025.
        out: file to write; default TRACK/view.html.
        video: a video to play beside the figure; it stays where it is.
        offset_s: time of the track at the beginning of the video, s; default: found from its motion.
        drift_ppm: by how much the track's clock runs faster.
        camera: calibration of a camera that stands still: draws the skeleton.
        no_open: write the file without opening a browser.
        force: replace what is there.
        json_output: opens no browser.
    """
    from oarlock import load_track
    from oarlock.report.viewer import page
    from oarlock.storage.folder_writer import replaced_folder
    from oarlock.storage.write_file import write_file

    of_video = {"--offset-s": offset_s, "--drift-ppm": drift_ppm or None, "--camera": camera}
    if video is None and (flags := [flag for flag, value in of_video.items() if value is not None]):
        raise UsageError(f"view: {flags[0]} needs --video FILE")
    estimate = load_track(track)
    other = load_track(ghost) if ghost is not None else None
    shown_s, cut = _stretch(estimate, start_s, end_s)
    target = out or track / "view.html"
    free_file(target, force)
    film = None if video is None else _film(estimate, video, offset_s, drift_ppm, camera, target)
    with progress("drawing"), replaced_folder(target.parent, "", force, adds=True) as stage:
        drawn = _scene(estimate, other, shown_s, every_s, str(ghost or ""))
        drawn["video"] = film
        text = page(drawn, f"{drawn['model']}: {drawn['title'] or track.resolve().name}")
        write_file(stage / target.name, text)
    opened = not (no_open or json_output) and webbrowser.open(target.resolve().as_uri())
    return {
        "view": target,
        "bytes": len(text.encode()),
        "shown_s": shown_s,
        "samples": drawn["places_m"]["rows"],
        "cut": cut,
        "opened": opened or no_open,
        "video": film
        and {
            "file": video,
            "source": film["src"],
            "offset_s": film["offset_s"],
            "drift_ppm": film["drift_ppm"],
        },
    }


def _show(result: dict[str, Any]) -> None:
    say(f"Wrote {result['view']}")
    if result["cut"]:
        begin, end = (f"{moment:z.0f}" for moment in result["shown_s"])
        say(f"It shows {begin} to {end} s of a longer track; change this with --start-s and --end-s.")
    if video := result["video"]:
        say(
            f"The video begins at {video['offset_s']:.3f} s of the track; the page plays it from {video['source']}."
        )
    if not result["opened"]:
        say("No browser could be started; open the file in one.")


def _film(
    track: Track, video: Path, offset_s: float | None, drift_ppm: float, camera: Path | None, target: Path
) -> dict[str, Any]:
    """Return what the page needs to know of the video; its offset is found if it is not given."""
    from oarlock.cli.calibrate_video import aligned
    from oarlock.movement.video import load_camera, video_info
    from oarlock.movement.video.shown import shown_video

    info = video_info(video)
    still_camera = None if camera is None else load_camera(camera)
    if offset_s is None:
        alignment = aligned(track, video, None, info)
        alignment.require_one()
        offset_s, drift_ppm = alignment.offset_s, alignment.drift_ppm
    return shown_video(
        video, target.parent, info, offset_s=offset_s, drift_ppm=drift_ppm, camera=still_camera
    )


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
