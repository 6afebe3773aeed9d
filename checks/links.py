"""Links of the pages lead to files and titles that exist."""

import re
from pathlib import Path

from checks.project_files import ROOT, name_of, text_of

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").rglob("*.md")])

MADE = ("docs/reference/", "docs/gallery.md", "docs/moving-sculler.svg")
"""What `make site` makes; its strict build checks these links."""


def findings() -> list[str]:
    """Links of all pages that lead nowhere."""
    return [f"{name_of(page)}: {target}" for page in PAGES for target in broken_links(page)]


def broken_links(page: Path) -> list[str]:
    """Targets of the page whose file or title does not exist."""
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if "://" in target:
            continue
        if file.is_relative_to(ROOT) and file.relative_to(ROOT).as_posix().startswith(MADE):
            continue
        if not file.exists():
            broken.append(f"{target} does not exist")
        elif anchor and anchor not in anchors(file):
            broken.append(f"no title for #{anchor} in {file.name}")
    return broken


def anchors(page: Path) -> set[str]:
    """What a link may name after `#`: titles as GitHub writes them."""
    titles = re.findall(r"^#+ (.+)$", text_of(page), re.M)
    return {re.sub(r"[^\w\- ]", "", title).strip().lower().replace(" ", "-") for title in titles}
