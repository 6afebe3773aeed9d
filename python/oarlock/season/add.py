"""Brings athletes, recordings and devices' exports into a season, under pseudonyms and named by their contents."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import gettempdir

import numpy as np

from oarlock.recording.recording import Recording, load_recording
from oarlock.recording.session_info import SESSION_KEY, checked_session, read_session, session_info
from oarlock.season.athletes import Athlete, NamesFile, check_scope, checked_day, new_pseudonym
from oarlock.season.gps import GpsCut
from oarlock.season.records import Entry, named_by
from oarlock.season.store import Season, not_in_season
from oarlock.storage.epoch import moment_of
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import scratch_folder
from oarlock.storage.regular_file import read_bytes
from oarlock.storage.write_file import unwritable

EXPORT_STEM = "export"
"""An export's own file name may be a person's."""
_UTC = datetime.UTC
_TEXTS = (".csv", ".txt", ".tsv", ".tcx", ".json", ".toml", ".xml")
"""Exports that are text, in which a name can be replaced."""
_RANGES = {"stature_m": (0.5, 2.5), "mass_kg": (10.0, 250.0)}


@dataclass(frozen=True)
class Added:
    """Result of adding one recording: its entry, and whether it is new in the season."""

    entry: Entry
    is_new: bool


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
        self._athlete, self._names = athlete, dict(names or {})
        self._cut_gps_m = cut_gps_m
        self._known, self._owners = season.athletes(), season.recordings()

    def add(self, path: Path, session: Mapping[str, str] | None = None) -> Added:
        """Store a recording's folder or a device's export.

        Args:
            path: the folder, or the file.
            session: further texts, such as ``date``, ``boat``, ``seat`` and ``rig``; they replace those of the source.

        Raises:
            DataError: it cannot be read, is nobody's, or names a person without a mapping.
        """
        told = checked_session(session or {}, "session")
        if path.is_dir() or path.name == "recording.toml":
            folder = path if path.is_dir() else path.parent
            return self.add_recording(load_recording(path), {**read_session(folder), **told}, str(path))
        return self._add_export(path, told)

    def add_recording(
        self, recording: Recording, session: Mapping[str, str], where: str = "recording"
    ) -> Added:
        """Store a recording with the texts of its session; errors begin with `where`."""
        info = {**session_info(recording.meta), **session}
        info["athlete"] = self.pseudonym(info.get("athlete"), where)
        meta = {key: value for key, value in recording.meta.items() if key not in (SESSION_KEY, "athlete")}
        self._refuse_names(meta, where)
        entry = Entry(
            content_name(recording),
            info["athlete"],
            "recording",
            start_of(self.season, recording.epoch, recording.start_s, info),
            recording.duration_s,
            info,
        )
        try:
            files = _saved(Recording(recording.streams, {**meta, SESSION_KEY: info}))
        except OSError as error:  # the disk of temporary files is full
            raise unwritable(Path(gettempdir()), error) from error
        return self._put(entry, files)

    def pseudonym(self, given: str | None, where: str) -> str:
        """The pseudonym under which something is stored.

        Raises:
            DataError: nobody is named, or the name is no pseudonym and has no mapping.
        """
        asked = self._athlete if self._athlete is not None else given
        if asked is None:
            raise DataError(f"{where}: does not say who was recorded; give --athlete PSEUDONYM")
        found = asked if asked in self._known else self._names.get(asked, asked)
        if found in self._known:
            return found
        if found != asked:
            raise DataError(
                f"{where}: the file of names gives the pseudonym {found}, which this season does not have. "
                "Correct the file, or give the file of this season"
            )
        raise DataError(
            f'{where}: the athlete "{asked}" is not a pseudonym of this season, and a season stores no names of '
            "people. Give --names FILE, which lists the pseudonym of each name, or --athlete PSEUDONYM. "
            "`oarlock season athlete` makes a pseudonym."
        )

    def _add_export(self, file: Path, session: Mapping[str, str]) -> Added:
        from oarlock.rowing import load_export

        found = load_export(file)  # nothing is stored that cannot be read
        info = {**read_session(file.parent), **session}
        info["athlete"] = self.pseudonym(info.get("athlete"), str(file))
        contents = self._without_names(read_bytes(file), file)
        if self._cut_gps_m is not None:
            cut = GpsCut(self._cut_gps_m, f"{self.season.id} {info['athlete']}".encode())
            contents = cut.file(contents, str(file))
        start = start_of(self.season, found.epoch or None, 0.0, info)
        entry = Entry(named_by(contents), info["athlete"], "export", start, found.duration_s, info)
        return self._put(entry, {f"{EXPORT_STEM}{file.suffix.lower()}": contents})

    def _put(self, entry: Entry, files: Mapping[str, bytes]) -> Added:
        """Store it, unless it is there, perhaps of another athlete."""
        owner = self._owners.get(entry.recording, entry.athlete)
        before = self.season.entry(owner, entry.recording)
        if before is not None:
            return Added(before, False)
        whole = self.season.put_recording(entry, files)
        self._owners[entry.recording] = entry.athlete
        if whole is None:  # another writer was first
            return Added(self.season.entry(entry.athlete, entry.recording) or entry, False)
        return Added(whole, True)

    def _refuse_names(self, meta: Mapping[str, object], where: str) -> None:
        text = repr(meta).casefold()
        for name in self._names:
            if name.casefold() in text:
                raise DataError(
                    f'{where}: its recording.toml contains the name "{name}"; take it out there first'
                )

    def _without_names(self, contents: bytes, file: Path) -> bytes:
        """The contents with every name of the mapping replaced by its pseudonym, in files that are text."""
        for name, stands_for in self._names.items():
            if name.encode() not in contents:
                continue
            if file.suffix.lower() not in _TEXTS:
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
    """Write who stands behind a pseudonym into the file of names."""
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


def content_name(recording: Recording) -> str:
    """Name of a recording: a hash of its numbers and its start time, independent of the file format."""
    parts = [(recording.epoch or "").encode()]
    for stream in sorted(recording.streams, key=lambda stream: stream.name):
        arrays = {"time_s": stream.time_s, **stream.values}
        for name, values in arrays.items():
            plain = np.ascontiguousarray(values, dtype="<f8")
            where_missing = np.where(np.isnan(plain), np.nan, plain)
            parts += [f"{stream.kind} {stream.name} {name} {plain.shape}".encode(), where_missing.tobytes()]
    return named_by(*parts)


def start_of(
    season: Season, epoch: str | None, at_s: float, session: Mapping[str, str]
) -> datetime.datetime | None:
    """The moment of a recording's first sample in UTC: of its clock, or else of the session's date."""
    moment = moment_of(epoch, at_s)
    if moment is not None and moment.kind != "clock":
        zone = _UTC if moment.kind == "utc" else season.zone()
        plain = datetime.datetime(1970, 1, 1) + datetime.timedelta(seconds=moment.seconds)
        return plain.replace(tzinfo=zone).astimezone(_UTC)
    if "date" not in session:
        return None
    day = datetime.datetime.fromisoformat(session["date"])
    if moment is not None:  # a time of day; the session has the day
        day = datetime.datetime.combine(day.date(), datetime.time()) + datetime.timedelta(
            seconds=moment.seconds
        )
    elif day.time() == datetime.time():
        day = day.replace(hour=12)  # a day only: its noon is on this day in UTC too
    return (day if day.tzinfo else day.replace(tzinfo=season.zone())).astimezone(_UTC)


def _saved(recording: Recording) -> dict[str, bytes]:
    """The files of the recording's folder."""
    with scratch_folder() as scratch:
        folder = scratch / "recording"
        recording.save(folder)
        names = (file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())
        return {name: read_bytes(folder / name) for name in sorted(names)}
