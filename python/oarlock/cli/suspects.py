"""Prints suspects (sensors that appear to be faulty) for `oarlock track`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.cli.terminal import heading, say

if TYPE_CHECKING:
    from oarlock import Suspect


def write_suspects(found: Sequence[Suspect]) -> None:
    """Prints one or two sentences for each suspect; nothing without suspects."""
    if not found:
        return
    heading("Suspects", "sensors that appear to be faulty; nothing was corrected")
    for suspect in found:
        say(f"- {suspect}", indent=2)
    say()


@contextmanager
def explained(found: Sequence[Suspect], out: Path, title: str) -> Iterator[None]:
    """If the data stop a run, adds suspects to the error and writes a page instead of the report."""
    from oarlock import DataError, DivergedError

    try:
        yield
    except (DataError, DivergedError) as error:
        if found:
            from oarlock.report.refusal import write_refusal

            reason = str(error)
            report = write_refusal(out / "report.html", title, [s.note for s in found], reason)
            error.args = ("\n".join([reason, *(s.note for s in found), f"Wrote {report}"]),)
        raise
