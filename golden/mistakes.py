"""Wrong inputs, each with one mistake: model files, arrays, settings, command lines and files. Used by the cases."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import oarlock
from golden.values import run_command
from oarlock import Recording, rowing
from oarlock.recording import ImuStream, ScalarStream

Call = Callable[[], object]

BODY = """format = 1
name = "arm"
[world]
up = [0, 1, 0]
forward = [0, 0, 1]
magnetic_norm_ut = 47.0
magnetic_dip_rad = "60*pi/180"
[parameters]
l_ua = { default = 0.315, unit = "m", std = 0.016, label = "upper arm" }
l_fa = 0.27
[process]
hinge = { kind = "jerk", density = 11.2, start_std = [0.2, 0.5, 5.0] }
[[joint]]
name = "shoulder"
kind = "hinge"
limits = ["-60*pi/180", "120*pi/180"]
rest = 0.1
[[joint]]
name = "elbow"
kind = "hinge"
[[frame]]
name = "upperarm"
parent = "root"
dh = { a = "l_ua", alpha = "pi/2", d = 0, theta = 0 }
joint = "shoulder"
[[frame]]
name = "forearm"
parent = "upperarm"
transform = { translation = ["l_fa", 0, 0] }
joint = "elbow"
axis = "y"
[[sensor]]
name = "wrist"
kind = "imu"
frame = "forearm"
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.1
"""
"""A small body without a mistake."""

IN_MODEL_FILES = {
    "unknown_format": ("format = 1", "format = 2"),
    "unknown_table": ("[parameters]", "[[sensors]]\n[parameters]"),
    "up_missing": ("up = [0, 1, 0]\n", ""),
    "up_too_long": ("up = [0, 1, 0]", "up = [0, 2, 0]"),
    "forward_not_horizontal": ("forward = [0, 0, 1]", "forward = [0, 0.6, 0.8]"),
    "dip_in_degrees": ('"60*pi/180"\n[par', "60\n[par"),
    "field_in_gauss": ("magnetic_norm_ut = 47.0", "magnetic_norm_ut = 0.47"),
    "gravity_in_g": ("magnetic_norm_ut = 47.0", "gravity_m_s2 = 1.0\nmagnetic_norm_ut = 47.0"),
    "unknown_unit": ('unit = "m"', 'unit = "cm"'),
    "millimetres": ("default = 0.315", "default = 315"),
    "unknown_key_of_parameter": ('unit = "m"', 'units = "m"'),
    "limits_in_degrees": ('["-60*pi/180", "120*pi/180"]', "[-150, 120]"),
    "limits_exchanged": ('["-60*pi/180", "120*pi/180"]', "[1, -1]"),
    "rest_outside_limits": ("rest = 0.1", "rest = 3"),
    "unknown_kind_of_joint": ('name = "elbow"\nkind = "hinge"', 'name = "elbow"\nkind = "revolute"'),
    "misspelt_key_of_joint": ("rest = 0.1", "limit = [0, 1]"),
    "joint_twice": ('name = "elbow"', 'name = "shoulder"'),
    "no_density": ("density = 11.2", "density = 0"),
    "unknown_parent": ('parent = "upperarm"', 'parent = "uperarm"'),
    "circle_of_parents": ('parent = "root"', 'parent = "forearm"'),
    "alpha_in_degrees": ('alpha = "pi/2"', "alpha = 90"),
    "unknown_parameter": ('a = "l_ua"', 'a = "l_uaa"'),
    "unknown_joint": ('joint = "shoulder"', 'joint = "sholder"'),
    "unknown_frame_of_sensor": ('frame = "forearm"', 'frame = "forarm"'),
    "unknown_kind_of_sensor": ('kind = "imu"', 'kind = "IMU9"'),
    "unknown_key_of_sensor": ("gyro_std_rad_s = 0.01", "gyro_noise_rad_s = 0.01"),
    "no_noise": ("gyro_std_rad_s = 0.01", "gyro_std_rad_s = 0"),
    "no_toml": ("[world]", "[world"),
}
"""Mistake -> what stands in the small body, and what is written in its place."""

TIME_S = np.arange(200) / 100.0
ROWS = np.tile([0.0, 9.80665, 0.0], (200, 1))


def mistakes(folder: Path) -> Iterator[tuple[str, Call]]:
    """Key and call of every mistake; the calls write into the folder."""
    yield from in_model_files(folder)
    yield from in_arrays()
    yield from in_settings()
    yield from in_files(folder)
    yield from in_commands(folder)


def in_model_files(folder: Path) -> Iterator[tuple[str, Call]]:
    """The small body with one mistake at a time."""
    for key, (correct, wrong) in IN_MODEL_FILES.items():
        file = folder / f"{key}.toml"
        file.write_text(BODY.replace(correct, wrong, 1), encoding="utf-8")
        yield f"model/{key}", partial(oarlock.load_model, file)
    yield "model/unknown_name", partial(oarlock.load_model, "scullerr")
    yield "model/absent", partial(oarlock.load_model, folder / "absent.toml")


def in_arrays() -> Iterator[tuple[str, Call]]:
    """Streams and recordings of wrong shapes, times and units."""
    imu: Any = partial(ImuStream, "back", TIME_S)
    scalar: Any = ScalarStream
    broken = np.where(np.arange(200)[:, None] == 7, np.inf, ROWS)
    yield "array/transposed", lambda: imu(accel_m_s2=ROWS.T)
    yield "array/too_short", lambda: imu(accel_m_s2=ROWS[:-1])
    yield "array/infinite", lambda: imu(accel_m_s2=broken)
    yield "array/text", lambda: imu(accel_m_s2=[["a", "b", "c"]] * 200)
    yield "array/no_quantity", imu
    yield "array/time_backwards", lambda: ImuStream("back", TIME_S[::-1], gyro_rad_s=ROWS)
    yield "array/time_repeats", lambda: scalar("seat", [0.0, 0.1, 0.1], [0.0, 1.0, 2.0])
    yield "array/degrees", lambda: scalar("oar", TIME_S, ROWS[:, 0], unit="deg")
    yield "array/no_streams", lambda: Recording([])
    yield "array/same_name", lambda: Recording([imu(gyro_rad_s=ROWS), imu(gyro_rad_s=ROWS)])
    recording = Recording([imu(gyro_rad_s=0.0 * ROWS, accel_m_s2=ROWS)])
    yield "array/misspelt_stream", lambda: recording["bakc"]
    yield "array/outside", lambda: recording.slice(5.0, 6.0)
    sculler = oarlock.load_model("sculler")
    yield "array/recording_is_path", lambda: oarlock.track(sculler, "recording")  # type: ignore[arg-type]
    yield "array/no_sensor_of_model", lambda: oarlock.track(oarlock.load_model("arm7"), recording)
    in_g = Recording(
        [ImuStream(name, TIME_S, 0.0 * ROWS, ROWS / 9.80665) for name in ("upperarm", "forearm")]
    )
    yield "array/accelerometer_in_g", lambda: oarlock.track(oarlock.load_model("arm7"), in_g)
    yield "array/posture_too_short", lambda: sculler.forward_kinematics([0.0, 0.1])


def in_settings() -> Iterator[tuple[str, Call]]:
    """Settings of the filter and values of the model."""
    sculler = oarlock.load_model("sculler")
    wrong: dict[str, dict[str, Any]] = {
        "alpha": {"alpha": 0.0},
        "misspelt": {"structur": "tree"},
        "unknown_choice": {"structure": "forest"},
        "negative_rate": {"output_rate_hz": -1.0},
        "text_as_flag": {"gate": "yes"},
    }
    for key, keys in wrong.items():
        yield f"setting/{key}", partial(oarlock.Config, **keys)
    yield "setting/misspelt_parameter", lambda: sculler.with_parameters(l_uar=0.3)
    yield "setting/parameter_in_mm", lambda: sculler.with_parameters(l_ua_r=310.0)
    rotation = np.diag([1.0, 1.0, -1.0])
    mirrored = {"back": (rotation, np.zeros(3))}
    yield "setting/mirrored_mount", lambda: oarlock.Calibration(mounts=mirrored)
    yield "setting/negative_error", lambda: oarlock.simulation.SessionErrors(mount_rad=-1.0)


def in_files(folder: Path) -> Iterator[tuple[str, Call]]:
    """Files that are damaged, empty or of another kind."""
    contents = {
        "empty.csv": "",
        "words.csv": "time,comment\n0,hello\n1,world\n",
        "no_units.csv": "time_s,gyro_x,gyro_y,gyro_z\n0,1,2\n",
        "damaged.xdf": "XDF:\x01\x02",
        "damaged.c3d": "\x02P",
        "damaged.trc": "PathFileType\t4\n",
        "calibration.toml": "format = 1\n[parameter]\nl_ua = 0.3\n",
    }
    for name, text in contents.items():
        (folder / name).write_text(text, encoding="utf-8")
        yield f"file/import_{name}", partial(oarlock.import_recording, folder / name)
    yield "file/markers_damaged", partial(oarlock.markers.load_markers, folder / "damaged.trc")
    yield "file/calibration_key", partial(oarlock.load_calibration, folder / "calibration.toml")
    yield "file/track_absent", partial(oarlock.load_track, folder / "absent")
    yield "file/recording_absent", partial(oarlock.load_recording, folder / "absent")
    yield "file/strokes_of_words", partial(rowing.load_export, folder / "words.csv")


def in_commands(folder: Path) -> Iterator[tuple[str, Call]]:
    """Command lines; the error has the command and its output."""
    lines = {
        "misspelt_verb": "trak piece",
        "no_model": "track piece --out out",
        "absent_recording": f"track {folder}/absent --model sculler --out {folder}/out",
        "misspelt_option": f"track {folder} --modell sculler --out {folder}/out",
        "misspelt_setting": f"track {folder} --model sculler --set structur=tree --out {folder}/out",
        "unknown_format": f"export {folder} --out {folder}/out --format xlsx",
        "absent_model": "model show scullerr",
        "wrong_condition": f"simulate --condition X --out {folder}/out",
        "negative_duration": f"simulate --duration-s -3 --out {folder}/out",
        "absent_strokes": f"rowing strokes {folder}/absent.csv",
    }
    for key, line in lines.items():
        yield f"command/{key}", partial(run_command, *line.split())
