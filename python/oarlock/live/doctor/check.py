"""What the doctor says: one finding, how bad it is, and what to try."""

from __future__ import annotations

from dataclasses import dataclass

OK, NOTE, PROBLEM = "ok", "note", "problem"
"""All is well; something to know; something that prevents a session."""


@dataclass(frozen=True)
class Diagnosis:
    """One finding.

    Args:
        about: what was looked at, such as "disk" or "stream back".
        state: `OK`, `NOTE` or `PROBLEM`.
        text: what was found.
        tries: what to do, one step each.
    """

    about: str
    state: str
    text: str
    tries: tuple[str, ...] = ()


def prevents(is_needed: bool) -> str:
    """`PROBLEM` for what a rig needs, else `NOTE`."""
    return PROBLEM if is_needed else NOTE
