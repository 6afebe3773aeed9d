"""Copies the written pages to where the site is built from. Each of their links then leads to a page of the site."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

from latex2mathml.converter import convert

ROOT = Path(__file__).parents[4]
ABOVE = ("ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "CONVENTIONS.md", "README.md")
"""Pages beside docs/ that are part of the site; the README's place is the home page."""
FILES = "files"
"""Folder of the site with files of the repository that pages link to."""
LINK = re.compile(r"(\]\()([^)\s]+)(\))|((?:src|href)=\")([^\"]+)(\")")
FENCE = re.compile(r"^(```.*?^```$)", re.M | re.S)
EQUATION = re.compile(r"\$\$(.+?)\$\$", re.S)
INLINE = re.compile(r"(?<![\\$\w])\$([^$\n`]+?)\$(?!\w)")


def stage(docs: Path) -> None:
    """Write all pages of docs/ and those above it into a folder."""
    for source in sorted((ROOT / "docs").rglob("*")):
        if source.is_file() and source.suffix != ".py" and "figures" not in source.parts:
            _copy(source, docs / source.relative_to(ROOT / "docs"), docs)
    for name in ABOVE[:-1]:
        _copy(ROOT / name, docs / name.lower(), docs)


def write(page: Path, text: str) -> None:
    """Write a page, with its folder."""
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text.rstrip() + "\n", encoding="utf-8")


def _copy(source: Path, target: Path, docs: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.suffix != ".md":
        shutil.copyfile(source, target)
        return
    parts = FENCE.split(source.read_text(encoding="utf-8"))
    parts[::2] = [_equations(linked(part, source, target, docs)) for part in parts[::2]]
    write(target, "".join(parts))


def linked(text: str, source: Path, target: Path, docs: Path) -> str:
    """Text of a page of the repository with links that are right where it goes in the site."""

    def relocated(match: re.Match[str]) -> str:
        before, link, after = (part for part in match.groups() if part is not None)
        path, mark, anchor = link.partition("#")
        if not path or "://" in link or path.startswith("mailto:"):
            return match[0]
        place = _place((source.parent / path).resolve(), docs)
        return f"{before}{os.path.relpath(place, target.parent)}{mark}{anchor}{after}" if place else match[0]

    return LINK.sub(relocated, text)


def _place(file: Path, docs: Path) -> Path | None:
    """Where a file of the repository lies in the site; pages that are made at build lie there already."""
    inside = file.relative_to(ROOT) if file.is_relative_to(ROOT) else None
    if inside is None:
        return None
    if inside.parts[0] == "docs":
        return docs / inside.relative_to("docs")
    if inside.name in ABOVE and len(inside.parts) == 1:
        return docs / ("index.md" if inside.name == "README.md" else inside.name.lower())
    if file.is_dir():
        file = file / "README.txt" if (file / "README.txt").exists() else sorted(file.iterdir())[0]
        inside = file.relative_to(ROOT)
    place = docs / FILES / inside.with_name(inside.name + ".txt")
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(file, place)
    return place


def _equations(text: str) -> str:
    text = EQUATION.sub(
        lambda match: f'<div class="equation" tabindex="0">{_mathml(match[1], "block")}</div>', text
    )
    return INLINE.sub(lambda match: f"<span>{_mathml(match[1], 'inline')}</span>", text)


def _mathml(latex: str, display: str) -> str:
    return str(convert(latex.strip(), display=display)).replace("\n", "")
