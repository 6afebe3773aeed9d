"""Suggests the most similar valid name, for error texts."""

import difflib
from collections.abc import Iterable


def did_you_mean(name: str, valid: Iterable[str]) -> str:
    """Sentence that names the nearest valid name, or else all of them.

    Args:
        name: the name that was not found.
        valid: the names that exist.
    """
    known = list(dict.fromkeys(valid))
    if not known:
        return "There is none."
    by_fold = {candidate.casefold(): candidate for candidate in reversed(known)}
    close = difflib.get_close_matches(name.casefold(), by_fold, n=1, cutoff=0.6)
    if close:
        return f'Did you mean "{by_fold[close[0]]}"?'
    shown = ", ".join(known[:20]) + (f" and {len(known) - 20} more" if len(known) > 20 else "")
    return f"Valid: {shown}."
