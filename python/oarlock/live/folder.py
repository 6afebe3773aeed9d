"""The folder of a live session: what it was run with, its packets, and, when it has ended, the recording."""

from __future__ import annotations

import glob
import shutil
import time
import zlib
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.calibration.session.plan import load_session_plan, plan_text
from oarlock.live.channel_tables import FOLDER as CHANNELS
from oarlock.live.channel_tables import Channels
from oarlock.live.disk import SessionDisk, is_failure
from oarlock.live.event_log import FILE as EVENTS
from oarlock.live.guide.steps import timed
from oarlock.live.reading import Packet
from oarlock.live.recorder import PACKETS, SUFFIX, Damage, numbered_packets, packet_files, read_packets
from oarlock.live.rig import Rig, rig_document
from oarlock.live.session import COMMANDS, LiveSession, order_of, recorded
from oarlock.recording.calibration import calibration_text, load_calibration, parsed_calibration
from oarlock.storage.epoch import FIRST_S, LAST_S, epoch_text
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.paths import state_folder
from oarlock.storage.toml import TomlTable, toml_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from oarlock._core import Model
    from oarlock.calibration.session.plan import SessionPlan
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.recording import Recording

FORMAT = 1
SESSION, RIG, CALIBRATION, PLAN, RECORDING = (
    "live.toml",
    "rig.toml",
    "calibration.toml",
    "plan.toml",
    "recording",
)


def dated_folder(parent: Path) -> Path:
    """A folder for a session that begins now, named by date and time of day."""
    return parent / time.strftime("live-%Y-%m-%d-%H%M%S")


@dataclass(frozen=True)
class Ending:
    """What the end of a session, or `oarlock live recover`, has made of its packets.

    Args:
        recording: None if the packets have no reading of a sensor.
        damage: stretches of the files of packets that cannot be read.
        refused: sentences about commands that cannot be carried out, with file and number.
        missing: sentences about packets that were received and are not there.
    """

    recording: Recording | None
    damage: list[Damage]
    refused: list[str]
    missing: list[str]


@dataclass(frozen=True)
class LiveFolder:
    """The folder of a session.

    Args:
        disk: the folder, and a second place for what it does not take.
        start_ns: the session's start by the clock of arrivals; times of the recording count from there.
        start_epoch_s: the same moment, s since 1970.
    """

    disk: SessionDisk
    start_ns: int
    start_epoch_s: float

    @classmethod
    def new(
        cls,
        path: Path,
        rig: Rig,
        calibration: Calibration | None,
        start_ns: int,
        plan: SessionPlan | None = None,
    ) -> LiveFolder:
        """The folder of a session that begins, not written yet; the plan is that of its guided start."""
        start_epoch_s = time.time() - (time.monotonic_ns() - start_ns) / 1e9
        second = _second_place(path, start_epoch_s)
        own = replace(rig, calibration=Path(CALIBRATION) if calibration is not None else None)
        keys: dict[str, object] = {"format": FORMAT, "start_ns": start_ns, "start_epoch_s": start_epoch_s}
        keys |= {"second": str(second)} if second is not None else {}
        files = {RIG: toml_text(rig_document(own)), SESSION: toml_text(keys)}
        if calibration is not None:
            files[CALIBRATION] = calibration_text(calibration)
        if plan is not None:
            files[PLAN] = plan_text(plan)
        return cls(SessionDisk(path, second, files), start_ns, start_epoch_s)

    @classmethod
    def create(cls, *about: Any) -> LiveFolder:
        """As `new`, and written.

        Raises:
            DataError: as `check_free`, or it cannot be written.
        """
        made = cls.new(*about)
        made.check_free()
        made.disk.prepare(made.path)
        return made

    def check_free(self) -> None:
        """Refuse a folder that has a session.

        Raises:
            DataError: it has one.
            OSError: nobody knows.
        """
        if (self.path / SESSION).exists():
            raise DataError(f"{self.path}: has a live session already. Give another folder with --out")

    def discard(self) -> None:
        """Removes what was written: the session could not begin."""
        for place in (self.disk.first, self.disk.second):
            if place is not None:
                shutil.rmtree(place / PACKETS, ignore_errors=True)
                for name in (*self.disk.files, EVENTS):
                    with suppress(OSError):
                        (place / name).unlink()
                with suppress(OSError):  # it has files of others
                    place.rmdir()

    @classmethod
    def load(cls, path: Path) -> LiveFolder:
        """Read the folder of a session that has ended, or was killed.

        Raises:
            DataError: it is not the folder of a session.
        """
        file = next((file for file in (path / SESSION, *_second_files(path)) if file.is_file()), None)
        if file is None:
            raise DataError(f"{path}: is not the folder of a live session; it has no {SESSION}")
        table = TomlTable.read(file)
        table.check_format(FORMAT)
        epoch_s = table.number("start_epoch_s", 0.0)
        if epoch_s and not FIRST_S <= epoch_s <= LAST_S:
            raise DataError(
                f"{file}: start_epoch_s = {epoch_s:g} is no time of a session; expected seconds since 1970 "
                f"from {FIRST_S:.0f} to {LAST_S:.0f}, or 0 if nobody knows it"
            )
        second = Path(text) if (text := table.string("second", "")) else None
        if second == path.absolute():
            second = None
        return cls(SessionDisk(path, second), table.integer("start_ns", 0), epoch_s)

    @property
    def path(self) -> Path:
        """The folder itself."""
        return self.disk.first

    @property
    def epoch(self) -> str | None:
        """The session's start as ISO text in UTC, by this machine's clock then; None if the folder does not say."""
        return epoch_text(round(1e9 * self.start_epoch_s), "utc") if self.start_epoch_s else None

    def rig(self, model: Model | None = None) -> Rig:
        """The rig of the session."""
        return Rig.load(self._file(RIG), model)

    def read(self, damage: list[Damage] | None = None) -> Iterator[Packet]:
        """The packets in their order."""
        return read_packets(self.path, damage, self.disk.second)

    def session(self, model: Model) -> LiveSession:
        """A session as it was run, before its first packet; giving it the packets repeats it bit for bit."""
        file = self._file(CALIBRATION)
        calibration = load_calibration(file) if file.exists() else None
        return LiveSession(self.rig(model), model, self.start_ns, calibration)

    def finish(self, model: Model) -> Ending:
        """Write the recording of the packets, and what else they have.

        With a guided start it has the plan with the times of its steps, and the calibration that was found, too.

        Raises:
            DataError: the packets cannot be read, or the recording or the channels cannot be written.
        """
        ending, guided, others = self.disk.insist("packets", lambda: self._ending(model))
        if others:
            self.disk.insist("channels", lambda: others.save(self.path / CHANNELS))
        if ending.recording is not None:
            made = ending.recording
            self.disk.insist("recording", lambda: self._save(made, guided))
        return ending

    def _ending(self, model: Model) -> tuple[Ending, Guided, Channels]:
        files = packet_files(self.path, self.disk.second)
        guided, others, damage, refused = Guided(), Channels(), list[Damage](), list[str]()
        rig, at = self.rig(model), [""]

        def packets() -> Iterator[Packet]:
            for at[0], packet in numbered_packets(self.path, damage, self.disk.second):
                yield packet

        made: Recording | None = None
        try:
            made = recorded(
                guided.passing(packets()),
                rig,
                self.start_ns,
                others.take,
                self.epoch,
                lambda error: refused.append(f"{at[0]}: the command was skipped: {error}"),
            )
        except DataError as error:
            if is_failure(error):
                raise
        return Ending(made, damage, refused, list(_missing(files, damage))), guided, others

    def _save(self, made: Recording, guided: Guided) -> None:
        with replaced_folder(self.path / RECORDING, "recording") as place:
            made.save(place)
            plan = self._file(PLAN)
            if guided.spans_s and plan.exists():
                timed(load_session_plan(plan), guided.spans_s).save(place / PLAN)
            if guided.calibration:
                parsed_calibration(guided.calibration).save(place / CALIBRATION)

    def _file(self, name: str) -> Path:
        """A file that both places have."""
        own, second = self.path / name, self.disk.second
        return own if second is None or own.exists() else second / name


def _second_name(path: Path) -> str:
    """How names of second places of a folder begin; the start of the session follows."""
    mark = zlib.crc32(str(path.absolute()).encode("utf-8", "surrogateescape"))
    return f"{path.name.encode('ascii', 'replace').decode()}-{mark:08x}-"


def _second_place(path: Path, start_epoch_s: float) -> Path | None:
    """Where packets go while a folder cannot be written; None if the user's state folder has no plain address."""
    with suppress(RuntimeError, UnicodeError):
        place = state_folder() / "live" / f"{_second_name(path)}{start_epoch_s:.0f}"
        str(place).encode()
        return place
    return None


def _second_files(path: Path) -> list[Path]:
    """What second places of a folder say of their sessions, the last one first: for a folder that is gone."""
    with suppress(OSError, RuntimeError):
        return sorted((state_folder() / "live").glob(f"{glob.escape(_second_name(path))}*/{SESSION}"))[::-1]
    return []


def _missing(files: list[Path], damage: list[Damage]) -> Iterator[str]:
    """Sentences about packets that were received and are not there; the page that a kill tore is none."""
    numbers, last = {int(file.stem) for file in files}, [file for file in files if file.stat().st_size][-1:]
    for number in sorted(set(range(1, max(numbers))) - numbers):
        yield f"{number:04d}{SUFFIX} is missing: its packets are lost, unless you find the file and put it back"
    within = [d for d in damage if [d.file] != last or d.at_byte + d.length < d.file.stat().st_size]
    if within:
        yield f"{len(within)} stretches within files of packets are not whole: their packets are lost"


@dataclass
class Guided:
    """What commands of a guided start say: when its steps were done, and the calibration.

    Args:
        spans_s: step -> from and to, s.
        calibration: text of its file; empty if there is none.
    """

    spans_s: dict[str, tuple[float, float]] = field(default_factory=dict)
    calibration: str = ""

    def passing(self, packets: Iterable[Packet]) -> Iterator[Packet]:
        """The same packets; their commands are noted on the way."""
        for packet in packets:
            if packet.source == COMMANDS:
                with suppress(DataError):
                    self._note(order_of(packet.data))
            yield packet

    def _note(self, order: Mapping[str, Any]) -> None:
        if order["do"] == "calibrate":
            parsed_calibration(order["toml"])
            self.calibration = order["toml"]
        elif order["do"] == "step" and None in (order.get("begin_s"), order.get("end_s")):
            self.spans_s.pop(order["name"], None)
        elif order["do"] == "step":
            self.spans_s[order["name"]] = (float(order["begin_s"]), float(order["end_s"]))
