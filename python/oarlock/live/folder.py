"""The folder of a live session: what it was run with, its packets, and, when it has ended, the recording."""

from __future__ import annotations

import contextlib
import shutil
import time
import zlib
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.calibration.session.plan import load_session_plan
from oarlock.live.channel_tables import FOLDER as CHANNELS
from oarlock.live.channel_tables import Channels
from oarlock.live.event_log import FILE as EVENTS
from oarlock.live.guide.steps import timed
from oarlock.live.reading import Packet
from oarlock.live.recorder import Damage, read_packets, require_packets
from oarlock.live.rig import Rig, rig_document
from oarlock.live.session import COMMANDS, LiveSession, order_of, recorded
from oarlock.recording.calibration import load_calibration, parsed_calibration
from oarlock.storage.epoch import FIRST_S, LAST_S, epoch_text
from oarlock.storage.errors import DataError
from oarlock.storage.folder_writer import replaced_folder
from oarlock.storage.state import state_folder
from oarlock.storage.toml import TomlTable, write_toml

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from oarlock._core import Model
    from oarlock.calibration.session.plan import SessionPlan
    from oarlock.recording.calibration import Calibration
    from oarlock.recording.recording import Recording

FORMAT = 1
SESSION, RIG, CALIBRATION, PLAN, PACKETS, RECORDING = (
    "live.toml",
    "rig.toml",
    "calibration.toml",
    "plan.toml",
    "packets",
    "recording",
)


def dated_folder(parent: Path) -> Path:
    """A folder for a session that begins now, named by date and time of day."""
    return parent / time.strftime("live-%Y-%m-%d-%H%M%S")


@dataclass(frozen=True)
class LiveFolder:
    """The folder of a session.

    Args:
        path: of the folder.
        start_ns: the session's start by the clock of arrivals; times of the recording count from there.
        start_epoch_s: the same moment, s since 1970.
    """

    path: Path
    start_ns: int
    start_epoch_s: float

    @classmethod
    def create(
        cls,
        path: Path,
        rig: Rig,
        calibration: Calibration | None,
        start_ns: int,
        plan: SessionPlan | None = None,
    ) -> LiveFolder:
        """Write what a session is run with, before its first packet; the plan is that of its guided start.

        Raises:
            DataError: the folder has a session, or cannot be written.
        """
        if (path / SESSION).exists():
            raise DataError(f"{path}: has a live session already. Give another folder with --out")
        made = cls(path, start_ns, time.time() - (time.monotonic_ns() - start_ns) / 1e9)
        made.write(rig, calibration, plan)
        return made

    def write(self, rig: Rig, calibration: Calibration | None, plan: SessionPlan | None) -> None:
        """Write what the session is run with; again, if somebody removed its folder."""
        path = self.path
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(f"{path}: cannot be made ({error.strerror})") from error
        if calibration is not None:
            calibration.save(path / CALIBRATION)
        if plan is not None:
            plan.save(path / PLAN)
        own = replace(rig, calibration=Path(CALIBRATION) if calibration is not None else None)
        write_toml(path / RIG, rig_document(own))
        keys = {"format": FORMAT, "start_ns": self.start_ns, "start_epoch_s": self.start_epoch_s}
        write_toml(path / SESSION, keys)

    def discard(self) -> None:
        """Removes what `create` and the recorder wrote: the session could not begin."""
        shutil.rmtree(self.packets, ignore_errors=True)
        for name in (SESSION, RIG, CALIBRATION, EVENTS):
            (self.path / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # it has files of others
            self.path.rmdir()

    @classmethod
    def load(cls, path: Path) -> LiveFolder:
        """Read the folder of a session that has ended, or was killed.

        Raises:
            DataError: it is not the folder of a session.
        """
        if not (path / SESSION).is_file():
            raise DataError(f"{path}: is not the folder of a live session; it has no {SESSION}")
        table = TomlTable.read(path / SESSION)
        table.check_format(FORMAT)
        epoch_s = table.number("start_epoch_s", 0.0)
        if epoch_s and not FIRST_S <= epoch_s <= LAST_S:
            raise DataError(
                f"{path / SESSION}: start_epoch_s = {epoch_s:g} is no time of a session; expected seconds since 1970 "
                f"from {FIRST_S:.0f} to {LAST_S:.0f}, or 0 if nobody knows it"
            )
        return cls(path, table.integer("start_ns", 0), epoch_s)

    @property
    def epoch(self) -> str | None:
        """The session's start as ISO text in UTC, by this machine's clock then; None if the folder does not say."""
        return epoch_text(round(1e9 * self.start_epoch_s), "utc") if self.start_epoch_s else None

    @property
    def packets(self) -> Path:
        """The folder of the packets."""
        return self.path / PACKETS

    @property
    def second(self) -> Path:
        """Where packets go while that folder cannot be written."""
        mark = zlib.crc32(str(self.path.absolute()).encode("utf-8", "surrogateescape"))
        return state_folder() / "live" / f"{self.path.name}-{mark:08x}"

    def rig(self, model: Model | None = None) -> Rig:
        """The rig of the session."""
        return Rig.load(self.path / RIG, model)

    def read(self, damage: list[Damage] | None = None) -> Iterator[Packet]:
        """The packets in their order."""
        return read_packets(self.packets, damage, self.second)

    def session(self, model: Model) -> LiveSession:
        """A session as it was run, before its first packet; giving it the packets repeats it bit for bit."""
        file = self.path / CALIBRATION
        calibration = load_calibration(file) if file.exists() else None
        return LiveSession(self.rig(model), model, self.start_ns, calibration)

    def finish(self, model: Model) -> tuple[Recording | None, list[Damage]]:
        """Write the recording of the packets, None if they have no reading of a sensor, and what else they have.

        With a guided start it has the plan with the times of its steps, and the calibration that was found, too.

        Raises:
            DataError: the recording or the channels cannot be written.
        """
        require_packets(self.packets, self.second)
        damage: list[Damage] = []
        guided, others = Guided(), Channels()
        made: Recording | None = None
        with suppress(DataError):
            packets = guided.passing(self.read(damage))
            made = recorded(packets, self.rig(model), self.start_ns, others.take, self.epoch)
        if others:
            others.save(self.path / CHANNELS)
        if made is not None:
            self._save(made, guided)
        return made, damage

    def _save(self, made: Recording, guided: Guided) -> None:
        with replaced_folder(self.path / RECORDING, "recording") as place:
            made.save(place)
            if guided.spans_s and (self.path / PLAN).exists():
                timed(load_session_plan(self.path / PLAN), guided.spans_s).save(place / PLAN)
            if guided.calibration:
                parsed_calibration(guided.calibration).save(place / CALIBRATION)


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
