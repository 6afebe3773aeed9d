"""The text files of the project and their lines, for every check that reads them."""

import os
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
CODE = {".py", ".pyi", ".rs"}
TEXT = CODE | {
    "",
    ".cfg",
    ".css",
    ".csv",
    ".html",
    ".j2",
    ".in",
    ".js",
    ".json",
    ".lock",
    ".md",
    ".mjs",
    ".toml",
    ".txt",
    ".yml",
}
BUILT = {".git", ".venv", "node_modules", "target", "dist", "out", "__pycache__"}
BUILT |= {".hypothesis", ".mypy_cache", ".pytest_cache", ".ruff_cache"}


@cache
def text_files() -> tuple[Path, ...]:
    """Every text file that is not built; raises if the folder is not the project."""
    files = []
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in BUILT]
        files += [Path(folder, name) for name in names if Path(name).suffix in TEXT and name != ".git"]
    missing = {"Makefile", "LICENSE", "Cargo.toml", "checks/project_files.py"} - {
        name_of(path) for path in files
    }
    if missing:
        raise FileNotFoundError(f"{ROOT} is not the project: {sorted(missing)} are missing")
    return tuple(sorted(files))


def code_files() -> list[Path]:
    """Python and Rust."""
    return [path for path in text_files() if path.suffix in CODE]


def name_of(path: Path) -> str:
    """Path below the project's folder."""
    return str(path.relative_to(ROOT))


def text_of(path: Path) -> str:
    """Text of the file; bytes that are no UTF-8 are replaced."""
    return path.read_text(encoding="utf-8", errors="replace")


def hits(pattern: re.Pattern[str], path: Path) -> list[str]:
    """`file:line: text` of each line that the pattern matches."""
    return [
        f"{name_of(path)}:{number}: {line.strip()[:80]}"
        for number, line in enumerate(text_of(path).splitlines(), 1)
        if pattern.search(line)
    ]
