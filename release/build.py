"""Builds a wheel that names no path of the machine, for the oldest C library that its platform promises."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from release.project import ROOT
from release.scrub import scrub

# Rust's standard library supports glibc 2.17 (manylinux2014) and musl 1.2; older Linux systems have no Python 3.11.
GLIBC, MUSL = "manylinux_2_17", "musllinux_1_2"


def build_wheel(target: str | None, out: Path) -> None:
    """Build a wheel for a target triple of Rust; none is the machine's own.

    On Linux zig links, because it links for any version of glibc and for musl on any machine.

    Raises:
        subprocess.CalledProcessError: maturin failed; it has printed why.
    """
    target = target or host()
    linux = ["--zig", "--compatibility", MUSL if "musl" in target else GLIBC] if "linux" in target else []
    begun_s = time.time()
    subprocess.run(
        [_maturin(), "build", "--release", "--target", target, *linux, "--out", str(out)],
        cwd=ROOT,
        env=os.environ | environment(),
        check=True,
    )
    for wheel in out.glob("*.whl"):
        if wheel.stat().st_mtime >= begun_s:
            scrub(wheel)


def build_source(out: Path) -> None:
    """Build the source distribution."""
    subprocess.run(
        [_maturin(), "sdist", "--out", str(out)], cwd=ROOT, env=os.environ | environment(), check=True
    )


def environment() -> dict[str, str]:
    """Variables of the build: the same sources give the same bytes, wherever they lie."""
    cargo_home = Path(os.environ.get("CARGO_HOME") or Path.home() / ".cargo")
    # separated by the unit separator, so that a folder's name may contain spaces
    flags = "\x1f".join([f"--remap-path-prefix={cargo_home}=cargo", f"--remap-path-prefix={ROOT}=oarlock"])
    scripts = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return {"CARGO_ENCODED_RUSTFLAGS": flags, "SOURCE_DATE_EPOCH": _committed_s(), "PATH": scripts}


def host() -> str:
    """Rust's name of this machine."""
    versions = subprocess.run(["rustc", "-vV"], capture_output=True, text=True, check=True).stdout
    return next(line.removeprefix("host: ") for line in versions.splitlines() if line.startswith("host: "))


def _committed_s() -> str:
    """Time of the last commit, Unix seconds; outside of a clone the first moment that a zip file can store."""
    git = ["git", "log", "-1", "--format=%ct"]
    done = subprocess.run(git, cwd=ROOT, capture_output=True, text=True) if shutil.which("git") else None
    return done.stdout.strip() if done and done.returncode == 0 and done.stdout.strip() else "315532800"


def _maturin() -> str:
    scripts = Path(sys.executable).parent
    maturin = shutil.which("maturin", path=str(scripts)) or shutil.which("maturin")
    if not maturin:
        raise SystemExit("maturin is not installed: pip install -r requirements/release.txt")
    return maturin
