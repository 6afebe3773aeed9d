"""Units that their joints contradict, from the notes of a track. For the line of trust and for movement."""

from __future__ import annotations

from collections.abc import Sequence

_CONTRADICT = ": its joints contradict the unit's own readings"
"""What follows the name of the unit in the engine's note."""


def contradicted_units(notes: Sequence[str]) -> list[str]:
    """Names of the units that the engine reports."""
    return [note.partition(_CONTRADICT)[0] for note in notes if _CONTRADICT in note]
