"""Writes files that pages presume and no command makes: `python tests/presumed_files.py KIND FILE`."""

import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT))
FILM_S, FRAME_S, FILM_STARTS_S = 12.0, 0.04, 7.32


def crew(file: Path) -> None:
    """Recordings of four seats, beside the file."""
    from oarlock_lab.pages.site.crew_pieces import write_crew

    write_crew(file.parent)


def model(file: Path) -> None:
    """The model of the tutorial."""
    from oarlock_lab.pages.site.steps import steps

    page = (ROOT / "docs/tutorials/own-body.md").read_text(encoding="utf-8")
    file.write_text(next(step.text for step in steps(page) if step.file), encoding="utf-8")


def legs(file: Path) -> None:
    """A zip file of MT Manager: one leg that moves after the other, units whose numbers say nothing."""
    from test_assign import moved

    _, recording, units = moved("lower_body", "right_leg,left_leg", 0)
    with zipfile.ZipFile(file, "w") as packed:
        for stream in recording.streams:
            unit = "00B421E6" if stream.name == units["pelvis"] else stream.name
            packed.writestr(f"MT_012005D6_031-000_{unit}.txt", _mt_manager(stream))


def walk(file: Path) -> None:
    """The recording `walk` as a zip file with one table of all units."""
    import oarlock

    streams = oarlock.load_recording(file.parent / "walk").streams
    columns = ("acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z")
    head = ["time", *(f"{stream.name}_{column}" for stream in streams for column in columns)]
    rows = np.column_stack([streams[0].time_s, *(np.hstack([s.accel_m_s2, s.gyro_rad_s]) for s in streams)])
    lines = [",".join(head), *(",".join(f"{value:.6f}" for value in row) for row in rows)]
    with zipfile.ZipFile(file, "w") as packed:
        packed.writestr("walk.csv", "\n".join(lines) + "\n")


def _mt_manager(stream) -> str:
    rate_hz = 1.0 / np.median(np.diff(stream.time_s))
    head = "PacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"
    rows = np.column_stack([stream.accel_m_s2, stream.gyro_rad_s])
    lines = ["\t".join([f"{k:05d}", *(f"{value:.6f}" for value in row)]) for k, row in enumerate(rows)]
    return "\n".join([f"// Update Rate: {rate_hz:.1f}Hz", head, *lines]) + "\n"


def film(file: Path) -> None:
    """A drawing of a rower from the side."""
    from video_drawing import side_camera, write_video

    stamps_s = np.arange(0.0, FILM_S, FRAME_S)
    small = replace(side_camera(160, 90), focal_px=(240.0, 240.0))
    drawn = file.with_suffix(".webm")
    write_video(drawn, _filmed(), FILM_STARTS_S + stamps_s, stamps_s, camera=small)
    drawn.rename(file)


def filmed(file: Path) -> None:
    """The track of the rower who is drawn."""
    _filmed().track.save(file)


def rp3(file: Path) -> None:
    """Force of an RP3 beside the track `out` of the same folder."""
    import made_exports
    import oarlock
    from oarlock.rowing import find_strokes

    catch_s = find_strokes(oarlock.load_track(file.parent / "out")).table()["catch_time_s"]
    made_exports.rp3(file, catch_s + 200.0)


def watch(file: Path) -> None:
    """Two minutes of a watch."""
    from fit_bytes import fit_file
    from fit_bytes import watch as messages

    file.write_bytes(fit_file(messages(120)))


def _filmed():
    from video_drawing import Motion

    return Motion(30.0, (20.0, 32.0), seed=1)


if __name__ == "__main__":
    globals()[sys.argv[1]](Path(sys.argv[2]).resolve())
