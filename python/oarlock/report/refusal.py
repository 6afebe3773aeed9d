"""The page that replaces the report if tracking failed: suspect sensors and the reason."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from oarlock.report.markup import rendered
from oarlock.report.page import shell
from oarlock.report.verdict import suspect_sentences
from oarlock.storage.write_file import write_file


def write_refusal(path: str | Path, title: str, notes: Sequence[str], reason: str) -> Path:
    """Write a page that works offline, instead of a report.

    Args:
        path: the file to write; missing parents are made.
        title: heading.
        notes: sentences about suspects, from `Suspect.note`.
        reason: why there is no track; its lines become paragraphs.

    Returns:
        Path: the file written.
    """
    lead = rendered("refusal", suspects=suspect_sentences(notes), lines=reason.strip().splitlines())
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    write_file(target, shell(title, lead, []))
    return target
