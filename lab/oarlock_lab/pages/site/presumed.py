"""What a page presumes of its reader, what is run with fewer data than shown, and what cannot be run."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from oarlock_lab.pages.record import ROOT

PSEUDONYM = "K7QMVA"
"""Stands for an athlete of the season."""
SESSION = "http://127.0.0.1:8123/?token=..."
"""Stands for the address of a live session."""
SERVERS = ("oarlock live demo", "oarlock live run")
"""Run until Ctrl-C and show a page."""
BACKGROUND = ("oarlock lab emulate ximu3",)
"""Run beside the commands that follow."""

NOT_RUN: Mapping[str, str] = {
    "pip install": "needs a package index; tests/test_release_built.py installs the wheel",
    "make ": "builds the checkout, as every run of the tests does before it begins",
    'export PATH="$PWD': "of a clone's own environment",
    "curl ": "needs a network place; the file is taken from OARLOCK_DATA",
    "oarlock live init": "needs sensors that send",
    "oarlock live doctor": "needs sensors that send",
    "oarlock live run rig.toml --out today": "needs sensors that send; the page runs it with emulated ones",
    "oarlock calibrate session today/recording": "needs somebody who presses the buttons of the guided start",
    'import oarlock\n\nfound = oarlock.live.channels("today")': "needs a GPS receiver and an ergometer",
    "oarlock lab reproduce all": "takes five minutes of processor time; tests/test_reproduce.py runs its parts",
    "oarlock lab study robustness --seeds 2": "takes many minutes; the page runs the quick variant",
    "oarlock report today/track": "needs an ergometer that sends by Bluetooth",
    "oarlock report out --with evening/erg": "needs an ergometer that sends by Bluetooth",
    "dask ": "needs other machines; tests/test_season_cluster.py starts workers on this one",
    "oarlock season run /share/season": "needs other machines",
}
"""Beginning of a command or program, and the reason why it is not run."""

ABSENT = "is absent: set OARLOCK_DATA"
"""Of a public recording, or of what a page makes of it."""
DATA: Mapping[str, str] = {
    "ngimu_data.csv": "opensimrt_upper_limb_ngimu/ngimu_data.csv",
    "data_3D_01.mat": "dfjimu/data_3D_01.mat",
    "trial1": "diodem_arm/trial1",
    "openaxes_ur5": "openaxes_ur5",
    "01_undisturbed_slow_rotation_A.mat": "broad/01_undisturbed_slow_rotation_A.mat",
    "full_body_example_data.mat": "qmt_full_body/full_body_example_data.mat",
}
"""Public recordings that a reader downloads, below `data` of OARLOCK_DATA."""

QUICKER: Mapping[str, str] = {
    "oarlock lab reproduce table5": "--seeds 1 --duration-s 10",
    "oarlock lab study which_sensors": "--seeds 1",
    "oarlock lab study examples/studies/noise_grade.toml": "--seeds 1",
    "oarlock lab study mount_error": "--seeds 1",
    "oarlock lab study robustness_quick": "--seeds 1",
    "oarlock lab season season": "--recordings 60 --athletes 3",
}
"""Beginning of a command that takes minutes, and options with which it does not: the last ones count."""

WHO = "printf 'athlete = \"Anna Muster\"\\ndate = 2026-05-01\\n'"
MADE: Mapping[str, str] = {
    "trial": "oarlock simulate --duration-s 20 --seed 11 --out trial",
    "out": "oarlock track trial --model sculler --smooth --out out",
    "field": "oarlock simulate --field careful --duration-s 20 --seed 12 --out field",
    "before": "oarlock track field --model sculler --smooth --out before",
    "rower": "oarlock simulate --calibration-session --out rower",
    "walk": "oarlock simulate --model lower_body --stature-m 1.78 --mass-kg 74 --out walk",
    "walk.zip": "{files} walk walk.zip",
    "legs.zip": "{files} legs legs.zip",
    "walk.toml": "oarlock calibrate sagittal walk --model lower_body --stature-m 1.78 --mass-kg 74 --out walk.toml",
    "reach": "oarlock simulate --model arm --sensors thorax,upper_arm_r,forearm_r --out reach",
    "reach.toml": "oarlock calibrate sagittal reach --model arm --sensors thorax,upper_arm_r,forearm_r "
    "--out reach.toml",
    "my.toml": "{files} model my.toml",
    "rec": "oarlock simulate --model my.toml --out rec",
    "bow": "{files} crew bow",
    "filmed": "{files} filmed filmed",
    "piece.mp4": "{files} film piece.mp4",
    "today": "oarlock live demo --out today --duration-s 10",
    "signed": f"cp -r out signed && {WHO} > signed/session.toml",
    "rp3.csv": "{files} rp3 rp3.csv  # out",
    "watch.fit": "{files} watch watch.fit",
    "today.csv": "cp {examples}/strokes/speedcoach_empower.csv today.csv",
    "lastweek.csv": "cp {examples}/strokes/speedcoach_empower.csv lastweek.csv",
    "rowsandall.csv": "oarlock rowing strokes {examples}/strokes/nk_logbook.csv --rowingdata rowsandall.csv",
    "strokes": "oarlock rowing strokes {examples}/strokes/rp3.csv --out strokes",
    "strokes.parquet": "cp strokes/strokes.parquet strokes.parquet",
    "trial_1": f"oarlock simulate --duration-s 20 --seed 1 --out trial_1 && {WHO} > trial_1/session.toml",
    "trial_2": f"oarlock simulate --duration-s 20 --seed 2 --out trial_2 && {WHO} > trial_2/session.toml",
    "k7.toml": "oarlock calibrate stature 1.78 --model sculler --out k7.toml",
    "season": "oarlock lab season season --recordings 60 --athletes 3",
}
"""How what a reader has is made here, from what stands above it."""

PRESUMED: Mapping[str, tuple[str, ...]] = {
    "README": ("walk.zip",),
    "bodies": ("walk", "walk.toml", "reach", "reach.toml"),
    "boat": ("trial",),
    "calibration": ("rec=rower", "trial"),
    "crew": ("bow", "two", "three", "stroke"),
    "filters": ("trial",),
    "import": ("walk.zip=legs.zip", "legs.zip"),
    "live": ("today",),
    "mounts": ("my.toml", "rec", "walk"),
    "python": ("trial", "out"),
    "report": (
        "trial",
        "out=signed",
        "after=out",
        "before",
        "monday=before",
        "record=out",
        "rp3.csv",
        "season",
    ),
    "season": (
        "trial_1",
        "track=signed",
        "trial_2",
        "rp3.csv",
        "rowsandall.csv",
        "watch.fit",
        "k7.toml",
    ),
    "season-privacy": ("season",),
    "sensor-faults": ("trial",),
    "stroke-exports": ("out", "rp3.csv", "watch.fit", "today.csv", "lastweek.csv", "season"),
    "technique": ("trial", "out"),
    "video": ("out=filmed", "piece.mp4"),
    "viewer": ("out", "before"),
}
"""What is made for a page; `before=out` is `out` under another name."""


def presume(name: str, folder: Path, pool: Path, run: Callable[[Path, str], object]) -> None:
    """Give a page's folder what the page presumes.

    Args:
        name: of the page.
        folder: where its commands will run.
        pool: shared by all pages; what is not there yet is made there.
        run: runs a command in a folder.
    """
    (folder / "examples").symlink_to(ROOT / "examples")
    for file in DATA:
        if data(file).exists():
            (folder / file).symlink_to(data(file))
    for item in PRESUMED.get(name, ()):
        target, _, source = item.partition("=")
        _make(source or target, pool, run)
        made = pool / (source or target)
        if made.is_dir():
            shutil.copytree(made, folder / target)
        else:
            shutil.copyfile(made, folder / target)


def _make(name: str, pool: Path, run: Callable[[Path, str], object]) -> None:
    if (pool / name).exists():
        return
    before = list(MADE)[: list(MADE).index(name)]
    for needed in before:
        if re.search(rf"(?<![\w./-]){re.escape(needed)}(?![\w.-])", MADE[name]):
            _make(needed, pool, run)
    run(pool, MADE[name].format(files=f"python {ROOT}/tests/presumed_files.py", examples=ROOT / "examples"))


def not_run(text: str) -> str:
    """Why a command or program is not run; empty if it is."""
    reasons = (reason for start, reason in NOT_RUN.items() if text.startswith(start))
    absent = (f"{name} {ABSENT}" for name in DATA if name in text and not data(name).exists())
    return next(reasons, "") or next(absent, "")


def data(name: str) -> Path:
    """Where a public recording lies."""
    return Path(os.environ.get("OARLOCK_DATA", ""), "data", DATA[name])


def quicker(text: str) -> str:
    """The command that is run."""
    less = next((options for start, options in QUICKER.items() if text.startswith(start)), "")
    return f"{text} {less}".rstrip()
