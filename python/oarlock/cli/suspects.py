"""Prints suspects (sensors that appear to be faulty) for `oarlock track`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.cli.terminal import heading, say
from oarlock.cli.track_folder import TRACK
from oarlock.storage.folder_writer import added_files

if TYPE_CHECKING:
    from oarlock.evaluation import Suspect


def write_suspects(found: Sequence[Suspect]) -> None:
    """Prints one or two sentences for each suspect."""
    if not found:
        return
    heading("Suspects", "sensors that appear to be faulty; nothing was corrected")
    for suspect in found:
        say(f"- {suspect}", indent=2)
    say()


@contextmanager
def explained(out: Path, title: str, force: bool) -> Iterator[list[Suspect]]:
    """Gives a list for suspects. If the data stop the run, adds them to the error and writes a page about them.

    The page is refused.html: a track that was in the folder before is still there, with its own report.
    """
    from oarlock import DataError, DivergedError

    found: list[Suspect] = []
    try:
        yield found
    except (DataError, DivergedError) as error:
        if found:
            from oarlock.report.refusal import write_refusal

            reason, page = str(error), out / "refused.html"
            with added_files(out, force, TRACK) as stage:
                write_refusal(stage / page.name, title, [s.note for s in found], reason)
            error.args = ("\n".join([reason, *(s.note for s in found), f"Wrote {page}"]),)
        raise
