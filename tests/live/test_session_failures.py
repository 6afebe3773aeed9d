"""A whole session in which each system call fails once in turn, or for good: nothing is lost, all is said."""

import asyncio
import errno
import shutil
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from failing_system import REASON, System
from senders import packets_of, rig_of, with_test_format

import oarlock
from command_line import run
from oarlock.live import disk as disk_module
from oarlock.live import recorder as recorder_module
from oarlock.live.event_log import read_events
from oarlock.live.folder import LiveFolder
from oarlock.live.live import Live
from oarlock.live.live_track import live_track
from oarlock.storage.errors import DataError
from oarlock.storage.paths import state_folder
from oarlock_lab.soak.virtual import VirtualTime

SECONDS, RATE_HZ = 2.0, 25.0
AT_ONCE = 30


class Page:
    """Keeps what viewers would get."""

    def __init__(self):
        self.health, self.events, self.is_open = [], [], True

    async def start(self):
        pass

    async def stop(self):
        self.is_open = False

    def publish(self, message):
        self.health += [message["recorder"]] if message["type"] == "health" else []

    def announce(self, message):
        self.events += [message["text"]] if self.is_open else []


class Replayed:
    """Delivers packets; the clock stands still while the recorder writes them."""

    state = "replays"

    def __init__(self, session):
        self.session, self.ended = session, asyncio.Event()

    async def run(self, deliver):
        for number, packet in enumerate(self.session.sent):
            await self.session.time.until(packet.arrival_ns)
            deliver(packet)
            if number % AT_ONCE == 0:
                await self.written(number)
        for _ in range(4):
            await self.session.time.until(self.session.time.now_ns() + 5 * 10**8)
            await self.written(number)
        self.ended.set()
        await asyncio.Event().wait()

    async def written(self, number):
        recorder, log = self.session.live._recorder, self.session.live._log
        while (recorder._waiting or log._waiting) and not (
            self.session.is_hopeless and recorder.disk.problem
        ):
            await asyncio.sleep(0.001)
        self.session.meanwhile(number)


class Session:
    """A pendulum's session in a folder, and all that it said."""

    def __init__(self, model, folder, sent, rig):
        self.folder, self.sent, self.said, self.page = folder, sent, [], Page()
        self.time, self.meanwhile = VirtualTime(sent[0].arrival_ns), lambda number: None
        self.is_hopeless = False
        self.live = Live(
            *(rig, model, folder),
            server=self.page,
            time=self.time,
            is_placement_watched=False,
            on_event=self.said.append,
            transport_of=lambda source: Replayed(self),
        )

    def run(self):
        async def lived():
            running = asyncio.create_task(self.live.run())
            started = asyncio.create_task(self.live.started.wait())
            await asyncio.wait([running, started], return_when=asyncio.FIRST_COMPLETED)
            if not running.done():
                ended = asyncio.create_task(self.live.transports["radio"].ended.wait())
                await asyncio.wait([running, ended], return_when=asyncio.FIRST_COMPLETED)
                running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            if not running.cancelled() and running.exception() is not None:
                raise running.exception()

        asyncio.run(lived())
        return self

    @property
    def seconds(self):
        """Now, s from the session's start."""
        return (self.time.now_ns() - self.sent[0].arrival_ns) / 1e9

    @property
    def packets(self):
        return list(LiveFolder.load(self.folder).read())

    @property
    def track(self):
        return live_track(LiveFolder.load(self.folder), self.live.model)


def make_quick(patch):
    with_test_format(patch)
    patch.setattr(recorder_module, "PAGE_S", 0.002)
    patch.setattr(disk_module, "PATIENCE_S", 0.0)
    patch.setattr(disk_module, "PAUSE_S", 0.0)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    make_quick(monkeypatch)


@pytest.fixture(scope="module")
def session_in(pendulum):
    time_s = np.linspace(0.0, SECONDS, 200)
    motion = oarlock.simulation.Motion.from_joints(
        time_s, {name: 0.4 * np.sin(2.0 * time_s + k) for k, name in enumerate(pendulum.joint_names)}
    )
    recording = oarlock.simulate(pendulum, motion, rate_hz=RATE_HZ)[1]
    rig = replace(rig_of(pendulum, recording, ties_clocks=False), model="pendulum3")
    return lambda folder: Session(pendulum, folder, packets_of(recording), rig)


HARMLESS = ("_free_bytes", "check_replaceable", "check_free", "replaced_folder", "_locked", "_finish")
"""Functions in which a failed call changes nothing, unless it moves a file: the page says that the room is not known,
rests stay."""
LATE_S = 1.0
MOST_TRIES = 20


@pytest.fixture(scope="module")
def clean(session_in, tmp_path_factory):
    """A session without a failure, the calls that it makes, its packets and its track."""
    with pytest.MonkeyPatch.context() as patch:
        make_quick(patch)
        system = System(folder := tmp_path_factory.mktemp("clean"))
        with system.watched():
            session = session_in(folder / "today").run()
        assert session.live.estimates > 20 and session.live._disk.failures == 0
        return session, system.sites, session.packets, session.track


def is_harmless(site):
    """Whether no failure is counted where this call fails; a folder that is there need not be made."""
    is_move = site[0] in ("rename", "replace")
    return site[0] == "mkdir" or (site[1].split()[-1] in HARMLESS and not is_move)


def shortcomings(session, system, site, packets):
    """What is not as it must be after a session in which one call has failed."""
    disk, folder = session.live._disk, session.folder
    if session.packets != packets or session.live._recorder.lost:
        yield "packets are not those of the session without a failure"
    if len(oarlock.load_recording(folder / "recording").streams) != 3:
        yield "there is no recording"
    if disk.problem:
        yield f"there is still a problem: {disk.problem}"
    if disk.failures == 0 and is_harmless(site):
        return
    if disk.failures != 1:
        yield f"{disk.failures} failures were counted"
    events = [(one["time_s"], one["text"]) for one in read_events(folder) if REASON in one["text"]]
    if not events or events[0][0] - system.failed_s > LATE_S:
        yield f"the log says nothing of it, or too late: {events}"
    if not any(REASON in text for text in session.said):
        yield f"the terminal says nothing of it: {session.said}"
    if system.is_page_open and not any(REASON in text for text in session.page.events):
        yield f"the page says nothing of it: {session.page.events}"
    if system.is_page_open and session.page.health[-1]["failures"] != 1:
        yield f"the page does not count it: {session.page.health[-1]}"


def failed_once(session_in, folder, site):
    """A session in which this call has failed once. Its thread decides when it writes, so it may be called or not."""
    for number in range(MOST_TRIES):
        system = System(folder / str(number))
        session = session_in(folder / str(number) / "today")

        def fails(name, path, here, system=system, session=session):
            is_first = here == site and not system.failed
            if is_first:
                system.failed_s, system.is_page_open = session.seconds, session.page.is_open
            return is_first

        system.fails = fails
        with system.watched():
            session.run()
        if system.failed:
            return session, system
    raise AssertionError(f"never called: {site}")


def test_each_call_fails_once_and_costs_nothing(session_in, clean, tmp_path):
    _, sites, packets, _ = clean
    wrong = {}
    for number, site in enumerate(sites):
        try:
            session, system = failed_once(session_in, tmp_path / str(number), site)
            found = list(shortcomings(session, system, site, packets))
        except DataError as error:
            found = [str(error)]
        wrong |= {site: found} if found else {}
        shutil.rmtree(tmp_path / str(number))
    assert len(sites) > 100 and {"open", "mkdir", "write", "fsync", "rename", "start"} <= {
        s[0] for s in sites
    }
    assert not wrong


def full(name, path, site):
    return name in ("write", "fsync", "fdatasync")


def forbidden(name, path, site):
    return name in ("open", "mkdir", "unlink", "rename", "replace")


def gone(name, path, site):
    return name != "start"


def recovered(session, status=0):
    """What `oarlock live recover` prints, in one line."""
    return " ".join(run("live", "recover", session.folder, status=status).stdout.split())


def assert_same(track, other):
    for name in ("time_s", "q", "q_std"):
        np.testing.assert_array_equal(getattr(track, name), getattr(other, name))


@pytest.mark.parametrize("fails", [full, forbidden, gone])
def test_a_folder_that_fails_for_good_costs_nothing(fails, session_in, clean, tmp_path):
    _, _, packets, track = clean
    system, session = System(tmp_path / "today"), session_in(tmp_path / "today")

    def meanwhile(number):
        if number >= 60:
            system.fails = fails

    session.meanwhile = meanwhile
    with system.watched(), pytest.raises(DataError, match=r"could not be written.*oarlock live recover"):
        session.run()
    second = session.live._disk.second
    recorder = session.live._recorder
    # A file that is open is written on where none can be opened.
    assert (recorder.elsewhere > 0) is (fails is not forbidden) and recorder.lost == 0
    for texts in (
        session.said,
        session.page.events,
        [e["text"] for e in read_events(session.folder, second)],
    ):
        assert any(f"recorded elsewhere: {second}" in text and REASON in text for text in texts)
    shown = session.page.health[-1]
    assert shown["second"] == (str(second) if recorder.elsewhere else "") and shown["failures"] > 0
    assert f"recorded elsewhere: {second}" in shown["problem"]
    assert session.packets == packets
    assert "Wrote" in recovered(session)
    assert_same(session.track, track)


@pytest.mark.parametrize("is_in_the_way", [False, True])
def test_a_folder_that_is_removed_costs_nothing(is_in_the_way, session_in, clean, tmp_path):
    _, _, packets, track = clean
    session = session_in(tmp_path / "today")

    def meanwhile(number):
        if number == 60:
            # at once, before the log is written again
            shutil.rmtree(session.folder.rename(tmp_path / "rubbish"))
            while is_in_the_way and not session.folder.is_file():
                with suppress(IsADirectoryError):  # the log was quicker
                    session.folder.write_text("x")
                    break
                shutil.rmtree(session.folder, ignore_errors=True)

    session.meanwhile = meanwhile
    if is_in_the_way:
        with pytest.raises(DataError, match="could not be written"):
            session.run()
        session.folder.unlink()
        assert "Wrote" in recovered(session)
    else:
        session.run()
        assert (session.folder / "recording").is_dir()
    assert session.packets == packets
    assert_same(session.track, track)


def test_a_disk_that_never_comes_back_leaves_what_the_second_place_has(session_in, clean, tmp_path):
    _, _, packets, _ = clean
    system, session = System(tmp_path / "today"), session_in(tmp_path / "today")

    def meanwhile(number):
        system.fails = gone if number >= 60 else system.fails

    session.meanwhile = meanwhile
    with system.watched(), pytest.raises(DataError):
        session.run()
    shutil.rmtree(session.folder)
    assert "0001.packets is missing" in recovered(session, status=1)
    assert session.packets == packets[-len(session.packets) :] and len(session.packets) > 50


def test_two_places_that_fail_are_said_with_the_number_of_lost_packets(session_in, tmp_path):
    session = session_in(tmp_path / "today")
    system = System(session.folder, state_folder())

    def meanwhile(number):
        if number >= 120:
            system.fails, session.is_hopeless = full, True

    session.meanwhile = meanwhile
    with (
        system.watched(),
        pytest.raises(DataError, match=r"\d+ packets found no room.*recorder: nothing is recorded"),
    ):
        session.run()
    assert len(session.packets) + session.live._recorder.lost == len(session.sent) + 2
    assert any("nothing is recorded at this time" in text for text in session.page.events)


def test_a_terminal_that_is_closed_ends_no_session(session_in, clean, tmp_path):
    def say(text):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    session = session_in(tmp_path / "today")
    session.live.on_event = say
    session.run()
    assert session.packets == clean[2]
    assert session.page.events.count("terminal: cannot be written: Broken pipe") == 1


def test_a_process_or_a_thread_that_cannot_be_started_ends_no_session(
    session_in, clean, tmp_path, monkeypatch
):
    def refused(*given):
        raise OSError(errno.EAGAIN, REASON)

    def no_thread(start):
        raise RuntimeError(REASON)

    monkeypatch.setattr("oarlock.live.live.child_pool", refused)
    session = session_in(tmp_path / "today")
    session.live.follower = SimpleNamespace(work=dict, step=lambda time_s, belief: None)
    output = SimpleNamespace(way=SimpleNamespace(name="UDP"), start=no_thread, problem="")
    output.put = output.tell = output.close = lambda *given: None
    output.health = lambda: {"name": "UDP", "problem": output.problem, "sent": 0, "skipped": 0}
    session.live.outputs = [output]
    session.run()
    assert session.packets == clean[2] and output.problem == f"cannot be started: {REASON}"
    for what in ("UDP", "another process"):
        assert f"{what}: {REASON}; it was given up" in session.page.events
        assert what in session.page.health[-1]["problem"]


def test_a_filter_that_loses_the_track_begins_again_live_and_from_the_packets(
    session_in, tmp_path, monkeypatch
):
    class Losing:
        """A tracker that loses the track once."""

        def __init__(self, *given):
            self.tracker, self.pushed = Tracker(*given), 0

        def push(self, *given):
            self.pushed += 1
            if self.pushed == 20:
                raise oarlock.DivergedError("the filter lost the track")
            return self.tracker.push(*given)

        def __getattr__(self, name):
            return getattr(self.tracker, name)

    Tracker = oarlock.Tracker
    monkeypatch.setattr(oarlock, "Tracker", Losing)
    session = session_in(tmp_path / "today").run()
    assert session.said.count("tracking begins again: the filter lost the track") >= 1
    again = LiveFolder.load(session.folder).session(session.live.model)
    assert sum(len(again.take(packet)) for packet in session.packets) == session.live.estimates
