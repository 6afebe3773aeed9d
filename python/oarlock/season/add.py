"""Brings athletes, recordings and devices' exports into a season, under pseudonyms and named by their contents."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

import numpy as np

from oarlock.recording.recording import Recording, load_recording
from oarlock.recording.session_info import SESSION_KEY, checked_session, read_session, session_info
from oarlock.season.athletes import ATTRIBUTES, Athlete, NamesFile, check_scope, checked_day, new_pseudonym
from oarlock.season.gps import GpsCut
from oarlock.season.records import Entry, named_by
from oarlock.season.store import Season, not_in_season
from oarlock.storage.epoch import moment_of
from oarlock.storage.errors import DataError
from oarlock.storage.paths import STAGED
from oarlock.storage.regular_file import read_bytes
from oarlock.storage.write_file import unwritable

EXPORT_STEM = "export"
"""An export's own file name may be a person's."""
_UTC = datetime.UTC
_MIDNIGHT = datetime.time()
_TEXTS = (".csv", ".txt", ".tsv", ".tcx", ".json", ".toml", ".xml")
"""Exports that are text, in which a name can be replaced."""


@dataclass(frozen=True)
class Added:
    """Result of adding one recording: its entry, whether it is new in the season, and sentences on what differs."""

    entry: Entry
    is_new: bool
    notes: Sequence[str] = ()


class Admission:
    """Brings recordings into a season, one after the other.

    Args:
        athlete: the pseudonym of all of them; None takes each one's session.
        names: pseudonym by name: the explicit mapping by which names are replaced.
        cut_gps_m: positions of exports that are so near to the start or the end of a track are not stored, m.
    """

    def __init__(
        self,
        season: Season,
        athlete: str | None = None,
        names: Mapping[str, str] | None = None,
        cut_gps_m: float | None = None,
    ) -> None:
        self.season = season
        self._athlete, self._names, self._cut_gps_m = athlete, dict(names or {}), cut_gps_m
        self._known, self._owners = season.athletes(), season.recordings()

    def add(self, path: Path, session: Mapping[str, str] | None = None) -> Added:
        """Store a recording's folder or a device's export.

        Args:
            path: the folder, or the file.
            session: further texts, such as ``date``, ``boat``, ``seat`` and ``rig``; they replace those of the source.

        Raises:
            DataError: it cannot be read, is nobody's, or names a person without a mapping.
        """
        folder = path if path.is_dir() else path.parent
        texts = {**read_session(folder), **checked_session(session or {}, "session")}
        if not path.is_dir() and path.name != "recording.toml":
            return self._add_export(path, texts)
        return self.add_recording(load_recording(path), texts, str(path), folder.resolve().name)

    def add_recording(
        self, recording: Recording, session: Mapping[str, str], where: str = "recording", file: str = ""
    ) -> Added:
        """Store a recording with the texts of its session; errors begin with `where`, `file` names its source."""
        info = {**session_info(recording.meta), **session}
        info["athlete"] = self.pseudonym(info.get("athlete"), where)
        meta = {key: value for key, value in recording.meta.items() if key not in (SESSION_KEY, "athlete")}
        text = repr(meta).casefold()
        for name in self._names:
            if name.casefold() in text:
                raise DataError(
                    f'{where}: its recording.toml contains the name "{name}"; take it out there first'
                )
        source = meta.get("source")
        device = str(source.get("format", "")) if isinstance(source, Mapping) else ""
        entry = Entry(content_name(recording), info["athlete"], "recording", None, recording.duration_s, info)
        try:
            files = _saved(Recording(recording.streams, {**meta, SESSION_KEY: info}))
        except OSError as error:  # the disk of temporary files is full
            raise unwritable(Path(gettempdir()), error) from error
        clock = recording.epoch, recording.start_s
        return self._put(replace(entry, device=device, file=file), files, *clock)

    def pseudonym(self, athlete: str | None, where: str) -> str:
        """The pseudonym under which something is stored.

        Raises:
            DataError: nobody is named, or the name is no pseudonym and has no mapping.
        """
        name = self._athlete if self._athlete is not None else athlete
        if name is None:
            raise DataError(f"{where}: does not say who was recorded; give --athlete PSEUDONYM")
        pseudonym = name if name in self._known else self._names.get(name, name)
        if pseudonym in self._known:
            return pseudonym
        if pseudonym != name:
            raise DataError(
                f"{where}: the file of names gives the pseudonym {pseudonym}, which this season does not have. "
                "Correct the file, or give the file of this season"
            )
        raise DataError(
            f'{where}: the athlete "{name}" is not a pseudonym of this season, and a season stores no names of '
            "people. Give --names FILE, which lists the pseudonym of each name, or --athlete PSEUDONYM. "
            "`oarlock season athlete` makes a pseudonym."
        )

    def _add_export(self, file: Path, info: dict[str, str]) -> Added:
        from oarlock.rowing import load_export
        from oarlock.rowing.report.export_piece import device_of

        export = load_export(file)  # nothing is stored that cannot be read
        info["athlete"] = self.pseudonym(info.get("athlete"), str(file))
        contents = self._without_names(read_bytes(file), file)
        if self._cut_gps_m is not None:
            cut = GpsCut(self._cut_gps_m, f"{self.season.id} {info['athlete']}".encode())
            contents = cut.file(contents, str(file))
        entry = Entry(named_by(contents), info["athlete"], "export", None, export.duration_s, info)
        entry = replace(entry, device=device_of(export.source), file=file.name)
        return self._put(entry, {f"{EXPORT_STEM}{file.suffix.lower()}": contents}, export.epoch)

    def _put(
        self, entry: Entry, files: Mapping[str, bytes], epoch: str | None, start_s: float = 0.0
    ) -> Added:
        """Store it, unless it is there, perhaps of another athlete."""
        owner = self._owners.get(entry.recording, entry.athlete)
        before = self.season.entry(owner, entry.recording)
        if before is None:
            start, own = (start_of(self.season, epoch, start_s, texts) for texts in (entry.session, {}))
            file = entry.file if self._is_nameless(entry) else ""
            whole = self.season.put_recording(replace(entry, start=start, file=file), files)
            self._owners[entry.recording] = entry.athlete
            if whole is not None:
                date = f"its date is {entry.session.get('date')}, not that of its clock"
                notes = [] if own in (None, start) else [f"{date}, {own:%Y-%m-%d %H:%M} UTC"]
                return Added(whole, True, notes)
            before = self.season.entry(entry.athlete, entry.recording) or entry  # another writer was first
        others = sorted(key for key, text in entry.session.items() if before.session.get(key) != text)
        return Added(before, False, [f"was there before; not changed: {', '.join(others)}"] if others else [])

    def _is_nameless(self, entry: Entry) -> bool:
        """Whether the file's name can be stored: the athlete's own name is known, and no name has a word in it."""
        words = [word for name in self._names for word in name.casefold().split()]
        is_known = entry.athlete in self._names.values()
        return is_known and not any(word in entry.file.casefold() for word in words)

    def _without_names(self, contents: bytes, file: Path) -> bytes:
        """The contents with every name of the mapping replaced by its pseudonym, in files that are text."""
        for name, stands_for in self._names.items():
            if name.encode() in contents and file.suffix.lower() not in _TEXTS:
                raise DataError(
                    f'{file}: contains the name "{name}", which cannot be replaced in a {file.suffix} file. Export '
                    "it again without the name, or as text."
                )
            contents = contents.replace(name.encode(), stands_for.encode())
        return contents


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
    athlete = Athlete(new_pseudonym(known)) if pseudonym is None else known[pseudonym]
    for scope in consent:
        check_scope(scope)
    for key, value in attributes.items():
        low, high = ATTRIBUTES[key]
        if not low <= value <= high:
            raise DataError(f"{key} is {value:g}; expected {low:g} to {high:g}. Is the unit right?")
    changed = replace(
        athlete,
        attributes={**athlete.attributes, **attributes},
        consent={**athlete.consent, **dict.fromkeys(consent, day)},
        withdrawn=day if withdrawn else "" if consent else athlete.withdrawn,
        guardian=athlete.guardian or guardian,
    )
    season.put_athlete(changed)
    return changed


def keep_name(season: Season, pseudonym: str, name: str | None, file: Path | None) -> None:
    """Write who stands behind a pseudonym into the file of names."""
    if name is None or file is None:
        raise DataError(
            "give --name and --names together: the name, and the file outside the season that keeps it"
        )
    check_outside(season, file, "names of people stay outside. Choose another place")
    names = NamesFile.read(file)
    if names.pseudonyms.get(name, pseudonym) != pseudonym:
        raise DataError(
            f"{file}: {name} has the pseudonym {names.pseudonyms[name]} already. "
            f"To change that athlete: --athlete {names.pseudonyms[name]}"
        )
    names.with_name(name, pseudonym).write()


def check_outside(season: Season, place: Path, advice: str) -> None:
    """Raises a DataError with the advice if a file or folder lies inside the season."""
    if "://" not in season.place.address and place.resolve().is_relative_to(
        Path(season.place.address).resolve()
    ):
        raise DataError(f"{place}: lies inside the season; {advice}")


def content_name(recording: Recording) -> str:
    """Name of a recording: a hash of its numbers and its start time, independent of the file format."""
    parts = [(recording.epoch or "").encode()]
    for stream in sorted(recording.streams, key=lambda stream: stream.name):
        for name, values in {"time_s": stream.time_s, **stream.values}.items():
            plain = np.ascontiguousarray(values, dtype="<f8")
            where_missing = np.where(np.isnan(plain), np.nan, plain)
            parts += [f"{stream.kind} {stream.name} {name} {plain.shape}".encode(), where_missing.tobytes()]
    return named_by(*parts)


def start_of(
    season: Season, epoch: str | None, at_s: float, session: Mapping[str, str]
) -> datetime.datetime | None:
    """The moment of a recording's first sample, UTC; None if neither its clock nor its session has the day.

    The session's date was given by a person, so a clock with another date gives only the time of day.
    """
    zone, moment = season.zone(), moment_of(epoch, at_s)
    day = datetime.datetime.fromisoformat(session["date"]) if "date" in session else None
    clock = datetime.timedelta(hours=12)  # without a clock noon: it is on this day in UTC, too
    if moment is not None:
        clock = datetime.timedelta(seconds=moment.seconds)
        if moment.kind != "clock":
            start = datetime.datetime(1970, 1, 1, tzinfo=_UTC if moment.kind == "utc" else zone) + clock
            local = start.astimezone(zone)
            days = (local.date(), start.astimezone(_UTC).date())
            if day is None or (day.time() == _MIDNIGHT and day.date() in days):
                return start.astimezone(_UTC)
            clock = local.replace(tzinfo=None) - datetime.datetime.combine(local.date(), _MIDNIGHT)
    if day is None:
        return None
    if day.time() == _MIDNIGHT:
        day += clock
    return (day if day.tzinfo else day.replace(tzinfo=zone)).astimezone(_UTC)


def _saved(recording: Recording) -> dict[str, bytes]:
    """The files of the recording's folder."""
    with TemporaryDirectory() as scratch:
        folder = Path(scratch, STAGED)  # what is staged is not synced
        recording.save(folder)
        names = (file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())
        return {name: read_bytes(folder / name) for name in sorted(names)}
