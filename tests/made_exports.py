"""Exports of a piece in the layouts of RP3, Painsled for the desktop and Peach PowerLine, with known force."""

import datetime
from pathlib import Path

import numpy as np

from oarlock.storage.arrays import Floats

PEAK_N = 600.0
DRIVE_SHARE = 0.42
"""Of each stroke."""
SPEED_M_S = 4.2
"""Of the boat or the flywheel, all the time: its distance is 0 at 0 s."""
ZERO = datetime.datetime(2026, 5, 1, 7, 30, tzinfo=datetime.UTC)


def force_n(share: Floats) -> Floats:
    """Force over the share of the drive's time: a skewed arch, the same in every stroke."""
    inside = np.clip(share, 0.0, 1.0)
    return np.asarray(PEAK_N * np.sin(np.pi * inside**0.8) ** 1.5)


def travelled(share: Floats) -> Floats:
    """Share of the handle's way at a share of the drive's time: slow at both ends."""
    return np.asarray(share - np.sin(2.0 * np.pi * share) / (2.0 * np.pi))


def drives_s(catch_s: Floats) -> Floats:
    """Duration of each drive but that of the last stroke."""
    return np.asarray(DRIVE_SHARE * np.diff(catch_s))


def painsled_desktop(file: Path, catch_s: Floats) -> Path:
    """The device's own clock starts at 0 s; a curve has 48 points, even in time."""
    head = "stroke.driveStartMs,stroke.strokeNumber,stroke.strokeType,stroke.driveMs,stroke.strokeTimeMs"
    ways = "stroke.startWorkoutMeter,stroke.strokeMeters"
    lines = [f"{head},stroke.strokesPerMin,workout.rowStartMs,{ways},stroke.forceMap"]
    pounds = " ".join(f"{n / 4.4482216:.3f}" for n in force_n(np.linspace(0.0, 1.0, 48)))
    for k, (begin_s, lasted_s, drive_s) in enumerate(
        zip(catch_s, np.diff(catch_s), drives_s(catch_s), strict=False)
    ):
        moments = [
            (ZERO + datetime.timedelta(seconds=float(s))).isoformat(timespec="milliseconds")
            for s in (begin_s, 0.0)
        ]
        times = f"{1e3 * drive_s:.0f},{1e3 * lasted_s:.0f},{60.0 / lasted_s:.0f}"
        far = f"{SPEED_M_S * begin_s:.2f},{SPEED_M_S * lasted_s:.2f}"
        lines.append(f"{moments[0]},{k + 1},0,{times},{moments[1]},{far},[{pounds}]")
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def rp3(file: Path, catch_s: Floats, way_m: float = 1.32) -> Path:
    """Rows at the end of the drive, to 0.01 s; force every 2.2 cm."""
    at_m = 0.022 * np.arange(1, round(way_m / 0.022) + 1)
    fine = np.linspace(0.0, 1.0, 2001)
    forces = force_n(np.interp(at_m / way_m, travelled(fine), fine))
    curve = ",".join(f"{n:.0f}" for n in forces)
    head = (
        "workout_interval_id,stroke_number,stroke_rate,time,stroke_length,drive_time,recover_time,peak_force"
    )
    lines = [f"{head},peak_force_pos,distance,curve_data"]
    for k, (begin_s, lasted_s, drive_s) in enumerate(
        zip(catch_s, np.diff(catch_s), drives_s(catch_s), strict=False)
    ):
        times = f"{60.0 / lasted_s:.2f},{begin_s + drive_s:.2f},{100 * way_m:.1f},{drive_s:.2f},1.00"
        peak = f"{forces.max():.0f},{100 * at_m[forces.argmax()]:.0f}"
        lines.append(f'7,{k + 1},{times},{peak},{SPEED_M_S * (begin_s + drive_s):.2f},"{curve}"')
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def peach(file: Path, catch_s: Floats, seats: tuple[int, ...] = (1,), encoding: str = "utf-8") -> Path:
    """Gate angle, gate force and speed at 50 Hz; angles by a cosine in drive and recovery."""
    time_s = np.arange(catch_s[0] - 0.5, catch_s[-1] + 0.5, 0.02)
    place = np.clip(np.searchsorted(catch_s, time_s, side="right") - 1, 0, len(catch_s) - 2)
    lasted_s, after_s = np.diff(catch_s)[place], time_s - catch_s[place]
    drive_s = DRIVE_SHARE * lasted_s
    up = 0.5 - 0.5 * np.cos(np.pi * np.clip(after_s / drive_s, 0.0, 1.0))
    down = 0.5 + 0.5 * np.cos(np.pi * (after_s - drive_s) / (lasted_s - drive_s))
    angle_deg = -60.0 + 100.0 * np.where(after_s < drive_s, up, down)
    pulled_kg = np.where(after_s < drive_s, force_n(after_s / drive_s), 0.0) / 9.80665
    names = [
        "Time",
        *[n for _ in seats for n in ("P GateAngle", "S GateAngle", "P GateForceX", "S GateForceX")],
        "Speed",
        "Distance",
    ]
    owners = ["", *[str(seat) for seat in seats for _ in range(4)], "Boat", "Boat"]
    rows = [
        [
            f"{1e3 * t:.0f}",
            *[f"{v:.3f}" for _ in seats for v in (a, a, f, f)],
            f"{SPEED_M_S}",
            f"{SPEED_M_S * t:.3f}",
        ]
        for t, a, f in zip(time_s, angle_deg, pulled_kg, strict=True)
    ]
    table = [["=====", "Crew Info"], ["Position", "Name"], ["=====", "Periodic"], names, owners, *rows]
    file.write_text("\n".join("\t".join(row) for row in table) + "\n", encoding=encoding)
    return file
