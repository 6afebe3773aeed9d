"""Nothing in the project depends on one computer: its paths, its registries, versions that are not pinned."""

import re
import tomllib
from pathlib import Path

from checks.project_files import ROOT, hits, name_of, text_files, text_of

HERE = Path(__file__).resolve()
MAKEFILE = ROOT / "Makefile"
# Absolute paths of one computer; Windows drives too.
MACHINE_PATH = re.compile(r"(?<![\w.:/<])/(?:home|mnt|opt|root|srv|tmp|Users|work)/|\b[A-Z]:\\\\?Users\b")
# Where packages come from is a setting of the machine, never of the project.
REGISTRY = re.compile(
    r"--(?:extra-)?index-url|--find-links|--trusted-host|\bindex-url\s*=|\breplace-with\s*="
)
CRATES_IO = "registry+https://github.com/rust-lang/crates.io-index"


def machine_paths() -> list[str]:
    """Lines with an absolute path."""
    return [hit for path in text_files() if path != HERE for hit in hits(MACHINE_PATH, path)]


def data_folder() -> list[str]:
    """Files other than the Makefile that name the folder of the validation data."""
    folder = re.search(r"\$\(wildcard (\.\./\w+)\)", text_of(MAKEFILE))
    if not folder:
        return ["Makefile: does not set OARLOCK_DATA from a folder beside the checkout"]
    pattern = re.compile(rf"{re.escape(folder[1])}\b")
    return [hit for path in text_files() if path != MAKEFILE for hit in hits(pattern, path)]


def registries() -> list[str]:
    """Lines that say where packages come from."""
    named = [hit for path in text_files() if path not in {HERE, MAKEFILE} for hit in hits(REGISTRY, path)]
    packages = tomllib.loads(text_of(ROOT / "Cargo.lock"))["package"]
    mirrors = {package.get("source", CRATES_IO) for package in packages} - {CRATES_IO}
    return named + [f"Cargo.lock: {mirror}" for mirror in sorted(mirrors)]


def loose_pins() -> list[str]:
    """Requirements without one version or hashes, and a build requirement that differs between its two places."""
    loose_lines = [
        f"{name_of(pins)}: {line}"
        for pins in sorted((ROOT / "requirements").glob("*.txt"))
        for line in loose(text_of(pins))
    ]
    built = (tomllib.loads(text_of(ROOT / name)) for name in ("pyproject.toml", "lab/pyproject.toml"))
    project = [
        requirement for project_file in built for requirement in project_file["build-system"]["requires"]
    ]
    lines = text_of(ROOT / "requirements/build.in").splitlines()
    if project != [line for line in lines if line and not line.startswith("#")]:
        loose_lines.append(
            "requirements/build.in: differs from build-system.requires of pyproject.toml, lab/pyproject.toml"
        )
    return loose_lines


def loose(requirements: str) -> list[str]:
    """Packages of a requirements file without one version and hashes of its files."""
    lines = re.sub(r" *\\\n *", " ", requirements).splitlines()
    pinned = re.compile(r"[\w.\-]+==[\w.!]+( ; .+?)?( --hash=sha256:[0-9a-f]{64})+")
    return [
        line[:80]
        for line in lines
        if line and not line.lstrip().startswith("#") and not pinned.fullmatch(line)
    ]
