"""Size, names and paths of the files in the project."""

import os
import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MOST_LINES = 500
VAGUE_NAMES = {"base", "common", "factory", "helper", "helpers", "manager", "misc", "types", "util", "utils"}
BUILT = {".git", ".venv", "node_modules", "target", "dist", "out", "__pycache__"}
BUILT |= {".hypothesis", ".mypy_cache", ".pytest_cache", ".ruff_cache"}
TEXT = {
    "",
    ".cfg",
    ".css",
    ".csv",
    ".html",
    ".in",
    ".js",
    ".json",
    ".mjs",
    ".lock",
    ".md",
    ".py",
    ".pyi",
    ".rs",
    ".toml",
    ".txt",
    ".yml",
}
CODE = {".py", ".pyi", ".rs"}

# Absolute paths of one computer; Windows drives too.
MACHINE_PATH = re.compile(r"(?<![\w.:/<])/(?:home|mnt|opt|root|srv|tmp|Users|work)/|\b[A-Z]:\\\\?Users\b")
# Where packages come from is a setting of the machine, never of the project.
REGISTRY = re.compile(
    r"--(?:extra-)?index-url|--find-links|--trusted-host|\bindex-url\s*=|\breplace-with\s*="
)
CRATES_IO = "registry+https://github.com/rust-lang/crates.io-index"


@cache
def files() -> list[Path]:
    found = []
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in BUILT]
        found += [Path(folder, name) for name in names if Path(name).suffix in TEXT]
    return sorted(found)


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def code_files() -> list[Path]:
    return [path for path in files() if path.suffix in CODE]


def hits(pattern: re.Pattern[str], path: Path) -> list[str]:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return [
        f"{name_of(path)}:{number}: {line.strip()[:80]}"
        for number, line in enumerate(lines, 1)
        if pattern.search(line)
    ]


def test_the_project_was_found():
    assert {"Makefile", "LICENSE", "Cargo.toml", "tests/test_tidy.py"} <= {name_of(path) for path in files()}


@pytest.mark.parametrize("path", code_files(), ids=name_of)
def test_file_is_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES


@pytest.mark.parametrize("path", code_files(), ids=name_of)
def test_name_says_what_is_inside(path):
    names = {part.split(".")[0].lower().strip("_") for part in path.relative_to(ROOT).parts}
    assert not names & VAGUE_NAMES


def test_no_path_of_one_machine():
    ourselves = Path(__file__).resolve()
    assert not [hit for path in files() if path != ourselves for hit in hits(MACHINE_PATH, path)]


def test_only_the_makefile_knows_where_the_validation_data_lie():
    makefile = ROOT / "Makefile"
    folder = re.search(r"\$\(wildcard (\.\./\w+)\)", makefile.read_text(encoding="utf-8"))
    assert folder, "the Makefile sets OARLOCK_DATA from a folder beside the checkout"
    pattern = re.compile(rf"{re.escape(folder[1])}\b")
    assert not [hit for path in files() if path != makefile for hit in hits(pattern, path)]


def test_no_registry_is_named():
    spoken_of = {Path(__file__).resolve(), ROOT / "Makefile"}
    assert not [hit for path in files() if path not in spoken_of for hit in hits(REGISTRY, path)]


def test_lock_file_names_no_mirror():
    packages = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    assert {package.get("source", CRATES_IO) for package in packages} == {CRATES_IO}


@pytest.mark.parametrize("pins", sorted((ROOT / "requirements").glob("*.txt")), ids=name_of)
def test_every_requirement_is_pinned(pins):
    lines = [line.split("#")[0].strip() for line in pins.read_text(encoding="utf-8").splitlines()]
    loose = [line for line in lines if line and not re.fullmatch(r"[\w.\-]+==[\w.]+(?: ; .+)?", line)]
    assert not loose


def test_build_requirement_is_the_same_in_both_places():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    lines = (ROOT / "requirements/build.in").read_text(encoding="utf-8").splitlines()
    assert project["build-system"]["requires"] == [
        line for line in lines if line and not line.startswith("#")
    ]
