"""A page for a recording that could not be tracked: which sensors are suspect, and why tracking stopped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from oarlock.report.page import shell
from oarlock.report.verdict import suspect_sentences

__all__ = ["write_refusal"]


def write_refusal(path: str | Path, title: str, notes: Sequence[str], reason: str) -> Path:
    """Write a page that works offline, in the place of a report.

    Args:
        path: the file to write; missing parents are made.
        title: heading.
        notes: sentences on suspects, as `Suspect.note` gives them.
        reason: why there is no track; its lines become paragraphs.

    Returns:
        Path: the file written.
    """
    sentences = [*suspect_sentences(notes), "<strong>Not tracked.</strong>"]
    sentences += [escape(line) for line in reason.strip().splitlines()]
    lead = f'<div class="lead">{"".join(f"<p>{sentence}</p>" for sentence in sentences)}</div>'
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(shell(title, lead, []), encoding="utf-8")
    return target
