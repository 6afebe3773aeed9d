"""Changes of an athlete's attributes and consent, and of the file of names beside the season."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from oarlock.season.athletes import Athlete, NamesFile, check_scope, checked_day, new_pseudonym
from oarlock.season.store import Season, not_in_season
from oarlock.storage.errors import DataError

_RANGES = {"stature_m": (0.5, 2.5), "mass_kg": (10.0, 250.0)}


def changed_athlete(
    season: Season,
    pseudonym: str | None,
    attributes: Mapping[str, float],
    consent: Sequence[str] = (),
    *,
    withdrawn: bool = False,
    guardian: bool = False,
    on: str | None = None,
) -> Athlete:
    """Store a new athlete, or what changed about one.

    Args:
        season: where.
        pseudonym: of the athlete who changes; None makes one.
        attributes: ``stature_m`` and ``mass_kg``.
        consent: scopes to which the athlete consents now.
        withdrawn: whether all consent is withdrawn.
        guardian: whether a guardian consents.
        on: day of the consent or of its withdrawal, such as 2026-05-01; None is today.

    Raises:
        DataError: the pseudonym or a scope is unknown, a number is no person's, or the day is none.
    """
    known = season.athletes()
    if pseudonym is not None and pseudonym not in known:
        raise not_in_season("athlete", pseudonym, known)
    day = datetime.date.today().isoformat() if on is None else checked_day(on, "--on")
    one = Athlete(new_pseudonym(known)) if pseudonym is None else known[pseudonym]
    for scope in consent:
        check_scope(scope)
    for key, value in attributes.items():
        low, high = _RANGES[key]
        if not low <= value <= high:
            raise DataError(f"{key} is {value:g}; expected {low:g} to {high:g}. Is the unit right?")
    changed = replace(
        one,
        attributes={**one.attributes, **attributes},
        consent={**one.consent, **dict.fromkeys(consent, day)},
        withdrawn=day if withdrawn else "" if consent else one.withdrawn,
        guardian=one.guardian or guardian,
    )
    season.put_athlete(changed)
    return changed


def keep_name(season: Season, pseudonym: str, name: str | None, file: Path | None) -> None:
    """Write who stands behind a pseudonym into the file of names.

    Raises:
        DataError: a name without a file or the reverse, a file inside the season, or a name that is there.
    """
    if name is None or file is None:
        raise DataError(
            "give --name and --names together: the name, and the file outside the season that keeps it"
        )
    inside = Path(season.place.address).resolve() if "://" not in season.place.address else None
    if inside is not None and (inside == file.resolve() or inside in file.resolve().parents):
        raise DataError(
            f"{file}: lies inside the season; names of people stay outside. Choose another place."
        )
    names = NamesFile.read(file)
    if names.pseudonyms.get(name, pseudonym) != pseudonym:
        raise DataError(
            f"{file}: {name} has the pseudonym {names.pseudonyms[name]} already. "
            f"To change that athlete: --athlete {names.pseudonyms[name]}"
        )
    names.with_name(name, pseudonym).write()
