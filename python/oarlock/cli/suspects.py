"""Suspects, as `oarlock track` shows them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.cli.terminal import heading, say

if TYPE_CHECKING:
    from oarlock import Calibration, Config, Model, Recording, Suspect


def look_for_suspects(
    model: Model, recording: Recording, calibration: Calibration | None, config: Config
) -> tuple[Suspect, ...]:
    """What `oarlock.suspects` finds."""
    import oarlock

    return oarlock.suspects(model, recording, calibration, config)


def write_suspects(found: Sequence[Suspect]) -> None:
    """One sentence or two for each; nothing where there is none."""
    if not found:
        return
    heading("Suspects", "sensors whose readings do not fit; nothing was repaired")
    for suspect in found:
        say(f"- {suspect}", indent=2)
    say()


@contextmanager
def explained(found: Sequence[Suspect], out: Path, title: str) -> Iterator[None]:
    """Where the data stop a run, suspects stand in the error, and in a page in the report's place."""
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
