"""Options that say who was recorded, when and where, and the questions for them. For `import` and `rowing strokes`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import typer

from oarlock.cli.terminal import UsageError, say
from oarlock.cli.verbs import FunctionText

Session = Mapping[str, str]
METAVARS: Final = {"date": "DATE", **dict.fromkeys(("place", "boat", "rig", "seat", "note"), "TEXT")}
"""Placeholders of the options."""


def session_of(
    *,
    athlete: str | None = None,
    date: str | None = None,
    place: str | None = None,
    boat: str | None = None,
    rig: str | None = None,
    seat: str | None = None,
    note: str | None = None,
) -> Session:
    """Who was recorded, when and where, as `session.toml` has it; without what is None.

    Args:
        athlete: name or pseudonym of the person.
        date: date of the recording, such as 2026-05-01.
        place: place or water.
        boat: boat or boat class.
        rig: rig or setting.
        seat: seat in the boat.
        note: anything else.

    Raises:
        UsageError: a date is none, or a text cannot be stored.
    """
    from oarlock.recording.session_info import checked_session
    from oarlock.storage.errors import DataError

    texts = {
        "athlete": athlete,
        "date": date,
        "place": place,
        "boat": boat,
        "rig": rig,
        "seat": seat,
        "note": note,
    }
    try:
        return checked_session({name: text for name, text in texts.items() if text is not None}, "session")
    except DataError as error:
        raise UsageError(str(error)) from None


def asked_session(known: Session, date: str) -> Session:
    """Answers to one question for each part of the session; Enter leaves it out.

    Args:
        known: what is known already.
        date: of the recording, if its clock has one; the default of that question.
    """
    say("Who and when, for reports (Enter leaves it out):")
    session = dict(known)
    for option in FunctionText.of(session_of).options:
        while option.name not in known:
            default = date if option.name == "date" else ""
            words = f"  {option.name} ({option.about.rstrip('.').lower()})"
            try:
                answer = typer.prompt(words, default=default, show_default=bool(default))
                session |= session_of(**{option.name: answer})
                break
            except UsageError as error:
                say(str(error), indent=2)
    return session
