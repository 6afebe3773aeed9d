"""Options and questions for session.toml: who was recorded, and when. For the verbs of `oarlock import`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Annotated, Any

import typer

from oarlock.cli.terminal import UsageError, say

_MEANINGS = {
    "athlete": "Name or pseudonym of the person.",
    "date": "Date of the recording, such as 2026-05-01.",
    "place": "Place or water.",
    "boat": "Boat or boat class.",
    "rig": "Rig or setting.",
    "seat": "Seat in the boat.",
    "note": "Anything else.",
}
_METAVARS = {"athlete": "NAME", "date": "DATE"}
SESSION_OPTIONS: list[tuple[str, Any]] = [
    (name, Annotated[str | None, typer.Option(f"--{name}", metavar=_METAVARS.get(name, "TEXT"), help=about)])
    for name, about in _MEANINGS.items()
]
"""Name and annotation of each option, for session.toml."""
NoQuestions = Annotated[bool, typer.Option("--no-questions", help="Ask nothing, on a terminal too.")]


def taken_session(options: dict[str, Any]) -> dict[str, str]:
    """The session among the options of a verb, which are removed from them.

    Raises:
        UsageError: a date is none, or a text cannot be stored.
    """
    from oarlock.recording.session_info import checked_session
    from oarlock.storage.errors import DataError

    given = {name: text for name in _MEANINGS if (text := options.pop(name, None)) is not None}
    try:
        return dict(checked_session(given, "option"))
    except DataError as error:
        raise UsageError(str(error)) from None


def asks_questions(no_questions: bool, json_output: bool) -> bool:
    """Whether a person sits at the terminal."""
    return not (no_questions or json_output) and sys.stdin.isatty() and sys.stdout.isatty()


def asked_session(known: Mapping[str, str], date: str) -> dict[str, str]:
    """Answers to one question for each part of the session; Enter leaves it out.

    Args:
        known: what is known already.
        date: of the recording, if its clock has one; the default of that question.
    """
    from oarlock.recording.session_info import checked_session
    from oarlock.storage.errors import DataError

    say("Who and when, for reports (Enter leaves it out):")
    found = dict(known)
    for name, about in _MEANINGS.items():
        while name not in known:
            default = date if name == "date" else ""
            words = f"  {name} ({about.rstrip('.').lower()})"
            answer = typer.prompt(words, default=default, show_default=bool(default))
            try:
                found |= checked_session({name: answer}, "answer")
                break
            except DataError as error:
                say(str(error), indent=2)
    return {name: found[name] for name in _MEANINGS if name in found}
