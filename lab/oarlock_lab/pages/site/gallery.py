"""The gallery: reports and moving figures that Oarlock makes of recordings that anybody can make or get again."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .crew_pieces import write_crew
from .stage import ROOT, write


@dataclass(frozen=True)
class GalleryPage:
    """One page of the gallery.

    Args:
        file: its name in the gallery.
        title: what it shows.
        text: what to look at.
        commands: that make it, without `oarlock`.
        made: the file that they write.
        needs: writes into a folder what the commands read.
    """

    file: str
    title: str
    text: str
    commands: tuple[str, ...]
    made: str
    needs: Callable[[Path], None] | None = None


def copy_exports(folder: Path) -> None:
    """The sample exports of the repository."""
    shutil.copytree(ROOT / "examples/strokes", folder / "examples/strokes")


SIMULATE = "simulate --field careful --rate-spm 24 --duration-s 60 --out piece"
PIECES = (
    GalleryPage(
        "demo-sculler.html",
        "A sculler, simulated, with ground truth",
        "Estimates, 95 % bands and the true angles in the same curves.",
        ("demo --out demo",),
        "demo/sculler/smoother/report.html",
    ),
    GalleryPage(
        "demo-pendulum.html",
        "A real pendulum of three links",
        "Three recorded units; their mounts were found from the recording itself.",
        (),
        "demo/pendulum/report.html",
    ),
    GalleryPage(
        "steady-piece.html",
        "A steady piece with the errors of a careful session",
        "Simulated: mounts and lengths are slightly wrong, packets are lost, clocks drift. "
        "The simulated rower is [no example of technique](explanation/limits.md).",
        (SIMULATE, "track piece --model sculler --smooth --out tracked"),
        "tracked/report.html",
    ),
    GalleryPage(
        "ramp.html",
        "A ramp from 20 to 34 strokes a minute",
        "What changes with the rate is not a fault of technique.",
        (
            "simulate --field careful --rate-spm 20,34 --duration-s 80 --seed 3 --out ramp",
            "track ramp --model sculler --smooth --out ramped",
        ),
        "ramped/report.html",
    ),
    GalleryPage(
        "two-pieces.html",
        "Two pieces side by side",
        "The ramp beside the steady piece.",
        ("report ramped --compare tracked --out two.html",),
        "two.html",
    ),
    GalleryPage(
        "arm.html",
        "An arm in its calibration session",
        "No rowing: joint angles with bands, and the health of each sensor.",
        (
            "simulate --model arm --stature-m 1.78 --mass-kg 75 --out session",
            "run session --model arm --session session --stature-m 1.78 --mass-kg 75 --out reach",
        ),
        "reach/track/report.html",
    ),
    GalleryPage(
        "calibration.html",
        "The page of a calibration session",
        "What was found, how certain it is, and what to repeat.",
        (),
        "reach/calibration.html",
    ),
    GalleryPage(
        "export.html",
        "An export alone",
        "A SpeedCoach with EmPower: angles, force and power of another device, without any inertial unit.",
        ("rowing strokes examples/strokes/speedcoach_empower.csv --report export.html",),
        "export.html",
        copy_exports,
    ),
    GalleryPage(
        "crew.html",
        "A crew of four",
        "Recordings of four seats with encoders on the oars, simulated: bow is 25 ms late at the catch.",
        ("rowing crew bow two three stroke --seats bow,2,3,stroke --clock-ms 0 --out crew.html",),
        "crew.html",
        write_crew,
    ),
    GalleryPage(
        "moving-figure.html",
        "The moving figure beside its curves",
        "Space plays, the mouse turns, 1 to 9 are views.",
        ("view tracked --start-s 20 --end-s 30 --every-s 0.05 --out figure.html --no-open",),
        "figure.html",
    ),
    GalleryPage(
        "season.html",
        "The season of a squad",
        "Synthetic: twelve athletes over a year.",
        ("lab season season --recordings 240 --athletes 12", "season page season --out season.html"),
        "season.html",
    ),
)


def write_pages(docs: Path, work: Path, made: bool = True) -> None:
    """Make all pages and the list of them.

    Args:
        docs: the folder of the site's pages.
        work: a folder for recordings and tracks.
        made: False lists the pages with empty files in their places.
    """
    folder = docs / "gallery"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    lines = [
        "# Gallery\n",
        "Each page is one file that works offline. Beside it stand the commands that made it.\n",
    ]
    for piece in PIECES:
        if made:
            if piece.needs:
                piece.needs(work)
            for command in piece.commands:
                run(command, work)
            shutil.copyfile(work / piece.made, folder / piece.file)
        else:
            (folder / piece.file).write_text("<!doctype html><title>not made</title>", encoding="utf-8")
        commands = "\n".join(f"oarlock {command}" for command in piece.commands)
        code = f"```sh\n{commands}\n```\n" if commands else "Made by the commands above.\n"
        lines += [
            f"## {piece.title}\n",
            f"{piece.text} [Open](gallery/{piece.file}){{target=_blank}}\n",
            code,
        ]
    write(docs / "gallery.md", "\n".join(lines))


def run(command: str, folder: Path) -> None:
    """Run a command of Oarlock.

    Raises:
        RuntimeError: it failed.
    """
    arguments = [sys.executable, "-m", "oarlock", *command.split()]
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"oarlock {command}\n{done.stdout[-1000:]}\n{done.stderr[-2000:]}")
