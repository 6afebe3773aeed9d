"""Last steps on the built site: its search works from a disk, and no page makes a request to another server."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

SHIM = Path(__file__).parent / "iframe-worker/shim.js"
"""iframe-worker 1.0.4, MIT: a worker for pages that are opened from a disk. The builder would load it from a server."""
SHIM_URL = "https://unpkg.com/iframe-worker/shim"
REQUEST = re.compile(
    r'<(?:script|img|iframe|source|video|audio)\b[^>]*\bsrc="?(?:https?:)?//[^>]*>'
    r'|<link\b(?=[^>]*rel="?(?:stylesheet|preload|preconnect|icon|prefetch|dns-prefetch))[^>]*href="?(?:https?:)?//[^>]*>'
    r"|@import\s+(?:url\()?[\"']?https?:"
)


def finish(site: Path) -> None:
    """Make a built site free of requests to others.

    Raises:
        ValueError: a page still makes one.
    """
    shutil.copyfile(SHIM, site / "iframe-worker.js")
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        if SHIM_URL in text:
            page.write_text(
                text.replace(SHIM_URL, os.path.relpath(site / "iframe-worker.js", page.parent)), "utf-8"
            )
    if addresses := requests(site):
        raise ValueError("the site makes requests: " + "; ".join(addresses[:5]))


def requests(site: Path) -> list[str]:
    """Elements of pages and style sheets that load something from another server."""
    files = [*site.rglob("*.html"), *site.rglob("*.css")]
    return [
        f"{file.relative_to(site)}: {match[0][:120]}"
        for file in files
        for match in REQUEST.finditer(file.read_text(encoding="utf-8", errors="replace"))
    ]
