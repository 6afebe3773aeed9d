"""Two units in each other's place are named while they are tracked, and exchanged in the session."""

import asyncio
from concurrent.futures import Future
from itertools import combinations

import numpy as np
import pytest
from senders import START_NS, packets_of, rig_of, with_test_format

import oarlock
from oarlock import rowing
from oarlock.live.live import LOOK_S
from oarlock.live.session import LiveSession, command
from oarlock.live.swaps.search import Seen, looked
from oarlock.live.swaps.swaps import CALM_AFTER, Swaps, Verdicts, suspected, swapping
from oarlock.live.swaps.window import WINDOW_S, WindowLayout
from oarlock.recording.corrections import corrected
from oarlock.rowing import FieldEffects, simulate_field
from oarlock.storage.errors import DataError

UNITS = ("back", "r_upperarm", "r_forearm", "l_upperarm", "l_forearm")
TRACKED_S = 1.0
START_S = 1.0
"""From the start of tracking to the first estimate."""
AGAIN_S = 1.2
"""From the first estimate after the exchange to the end: the looks that the window still reaches, and more."""


@pytest.fixture(autouse=True)
def _format(monkeypatch):
    with_test_format(monkeypatch)


@pytest.fixture(scope="module")
def rowed(sculler):
    return oarlock.simulate(
        sculler, rowing.sculling(sculler, 6.0, 24, surge=False, seed=4), seed=4, rate_hz=100
    )


def swapped(recording, pair):
    """The recording with two units in each other's place."""
    worn = {
        **dict(zip(recording.names, recording.names, strict=True)),
        **dict(zip(pair, pair[::-1], strict=True)),
    }
    found = [(name, recording[unit]) for name, unit in worn.items()]
    return oarlock.Recording([type(s)(name, s.time_s, **s.values) for name, s in found])


class Watched:
    """A session that is looked at as a live one is, but for the other process."""

    def __init__(self, model, recording, until_s, calibration=None):
        self.model, self.told = model, []
        self.session = LiveSession(rig_of(model, recording), model, START_NS, calibration)
        self.swaps = Swaps(self.session, lambda text: self.told.append((self.now_s, text)))
        self.looks, self.now_s, due_s = [], 0.0, TRACKED_S
        for packet in packets_of(recording):
            self.now_s = self.session.intake.seconds(packet.arrival_ns)
            if self.now_s > until_s or self.told:
                return
            if self.now_s >= TRACKED_S and self.session.tracker is None:
                self.session.take(command(packet.arrival_ns, "track"))
            self.session.take(packet)
            if self.now_s >= due_s:
                due_s += LOOK_S
                self.look()

    def look(self):
        look = self.swaps.look()
        if look is not None:
            self.looks.append(looked(look, self.model))
            self.swaps._judge(look, self.looks[-1])


@pytest.mark.parametrize(
    "pair",
    [
        ("r_forearm", "l_forearm"),
        pytest.param(("back", "r_upperarm"), marks=pytest.mark.long),
        pytest.param(("l_upperarm", "l_forearm"), marks=pytest.mark.long),
    ],
)
def test_two_swapped_units_are_named_within_a_second_of_readings(sculler, rowed, pair):
    watched = Watched(sculler, swapped(rowed[1], pair), TRACKED_S + START_S + 1.0)
    ((named_s, text),) = watched.told
    assert text.startswith(f"{pair[0]} and {pair[1]} are swapped")
    assert named_s <= TRACKED_S + START_S + 1.0
    assert watched.swaps.verdicts.named == pair


@pytest.mark.long
@pytest.mark.parametrize("pair", list(combinations(UNITS, 2)))
@pytest.mark.parametrize("seed", [1, 2])
def test_each_pair_is_named_in_spite_of_skin_mounts_and_clocks(sculler, pair, seed):
    recording = simulate_field(sculler, FieldEffects(), duration_s=6.0, rate_hz=100.0, seed=seed).recording
    watched = Watched(sculler, swapped(recording, pair), TRACKED_S + START_S + 2.0)
    ((_, text),) = watched.told
    assert text.startswith(f"{pair[0]} and {pair[1]} are swapped")


@pytest.mark.parametrize(
    "effects",
    [
        pytest.param(FieldEffects(), marks=pytest.mark.long),
        FieldEffects.wild(),
        pytest.param(FieldEffects.misfit(), marks=pytest.mark.long),
    ],
    ids=["field", "wild", "misfit"],
)
def test_nothing_is_named_where_every_unit_sits_in_its_place(sculler, effects):
    recording = simulate_field(sculler, effects, duration_s=5.0, rate_hz=100.0, seed=2).recording
    watched = Watched(sculler, recording, 5.0)
    assert not watched.told
    # Windows in which readings were lost are not looked at.
    assert len(watched.looks) > 4


def test_nothing_is_looked_at_where_a_pause_left_no_readings(sculler, rowed):
    watched = Watched(sculler, rowed[1], TRACKED_S + START_S + 0.4)
    watched.swaps._newest_s = dict.fromkeys(UNITS, 3.9)  # as readings that come late leave it
    assert watched.session.tracker is not None and watched.swaps.look() is None


def test_a_look_that_fails_does_not_end_the_session(sculler, rowed, monkeypatch):
    def refused(look, model):
        raise DataError("the recording is empty")

    class Here:
        """In place of the other process."""

        def submit(self, work, *given):
            future = Future()
            try:
                future.set_result(work(*given))
            except DataError as error:
                future.set_exception(error)
            return future

        def shutdown(self, **_):
            pass

    watched = Watched(sculler, rowed[1], TRACKED_S + START_S + 0.4)
    watched.swaps._looked_s = -np.inf
    monkeypatch.setattr("oarlock.live.swaps.swaps._pool", Here)
    monkeypatch.setattr("oarlock.live.swaps.swaps.looked", refused)
    asyncio.run(watched.swaps.run())
    ((_, text),) = watched.told
    assert text == "swapped units are no longer looked for: the recording is empty"


def test_exchanged_devices_are_looked_at_anew_and_fit(sculler, rowed):
    pair = ("r_forearm", "l_forearm")
    recording = swapped(rowed[1], pair)
    watched = Watched(sculler, recording, TRACKED_S + START_S + 1.0)
    rest = [p for p in packets_of(recording) if watched.session.intake.seconds(p.arrival_ns) >= watched.now_s]
    orders = swapping(watched.session, pair, rest[0].arrival_ns)
    for order in [*orders, *(command(rest[0].arrival_ns, do) for do in ("stop", "track"))]:
        watched.session.take(order)
    assert watched.swaps.look() is None
    again_s = watched.now_s
    due_s = again_s + LOOK_S
    for packet in rest:
        if watched.now_s > again_s + START_S + AGAIN_S:
            break
        watched.session.take(packet)
        watched.now_s = watched.session.intake.seconds(packet.arrival_ns)
        if watched.now_s >= due_s:
            due_s += LOOK_S
            watched.look()
    assert not watched.session.problems
    assert len(watched.told) == 1
    late = [one for one in watched.looks if one.middle_s > again_s]
    assert len(late) > 2 and not any(one.exchanged for one in late)
    assert watched.swaps.verdicts.named == ()


def test_units_of_other_sources_unknown_ones_and_one_alone_are_not_exchanged(sculler, rowed):
    session = LiveSession(rig_of(sculler, rowed[1]), sculler, START_NS)
    for packet in packets_of(rowed[1])[:200]:
        session.take(packet)
    for streams in (("back", "nobody"), ("back", "seat"), ("back", "back"), ("back",), ()):
        with pytest.raises(DataError, match="two inertial units that send"):
            swapping(session, streams, START_NS)
    session.intake.feeding()["back"].source = "another"
    with pytest.raises(DataError, match="different sources"):
        swapping(session, ("back", "r_forearm"), START_NS)


def test_a_unit_in_anothers_place_is_turned_as_that_one_is_mounted(sculler, rowed):
    """With other mounts in the calibration the readings in nominal axes are the same."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    nominal = {unit.name: np.array(unit.mount.rotation) for unit in sculler.describe().inertial_units}
    calibration = oarlock.Calibration(mounts={"back": (nominal["back"] @ turn, np.zeros(3))})
    turned = oarlock.Recording(
        [
            oarlock.recording.ImuStream(
                s.name, s.time_s, gyro_rad_s=s.gyro_rad_s @ turn, accel_m_s2=s.accel_m_s2 @ turn
            )
            if s.name == "back"
            else s
            for s in rowed[1].streams
        ]
    )
    plain, worn = WindowLayout.of(sculler, None), WindowLayout.of(sculler, calibration)
    one, other = plain.seen(rowed[1], 2.0), worn.seen(corrected(turned, calibration), 2.0)
    np.testing.assert_allclose(one, other, atol=1e-9)
    pair = ("back", "r_forearm")
    sits_elsewhere = plain.exchanged(one, [pair])[0][:, plain.columns["r_forearm"]]
    np.testing.assert_allclose(sits_elsewhere, one[:, plain.columns["back"]])
    np.testing.assert_allclose(
        worn.exchanged(other, [pair])[0][:, worn.columns["back"]].reshape(-1, 3),
        one[:, plain.columns["r_forearm"]].reshape(-1, 3) @ turn.T,
        atol=1e-9,
    )


CLEAR = Seen(1.0, 4.0, ("a", "b"), 0.5, 3.0)
LIKELY = Seen(1.0, 1.0, ("a", "b"), 0.5, 0.9)


def test_one_clear_look_or_two_likely_ones_name_a_pair_once():
    verdicts = Verdicts()
    assert verdicts.take(CLEAR) == ("a", "b")
    assert verdicts.take(CLEAR) == ()
    verdicts = Verdicts()
    assert verdicts.take(LIKELY) == ()
    assert verdicts.take(Seen(1.2, 1.0, ("a", "c"), 0.5, 0.9)) == ()
    assert verdicts.take(LIKELY) == ()
    assert verdicts.take(LIKELY) == ("a", "b")
    for _ in range(CALM_AFTER):
        assert verdicts.take(Seen(2.0, 0.1)) == ()
    assert verdicts.named == ()


@pytest.mark.parametrize(
    "seen",
    [
        Seen(1.0, 9.0),
        Seen(1.0, 9.0, ("a", "b"), 2.5, 9.0),
        Seen(1.0, 0.6, ("a", "b"), 0.5, 2.0),
        Seen(1.0, 9.0, ("a", "b"), 0.5, 0.6),
    ],
    ids=["nothing helps", "too much is left", "as it is fits as well", "another pair fits as well"],
)
def test_what_is_not_clear_is_not_suspected(seen):
    assert suspected(seen) == ((), False)


def test_a_window_has_all_readings_of_its_time(sculler, rowed):
    layout = WindowLayout.of(sculler, None)
    seen = layout.seen(rowed[1], 2.0)
    assert np.isfinite(seen).all()
    back = rowed[1]["back"]
    rows = (back.time_s >= 2.0 - 0.5 * WINDOW_S) & (back.time_s < 2.0 + 0.5 * WINDOW_S)
    np.testing.assert_allclose(
        seen[:, layout.columns["back"]].mean(axis=0)[:3], back.gyro_rad_s[rows].mean(axis=0), atol=1e-12
    )
    later = layout.seen(rowed[1], 100.0)
    closures = len(layout.rows) - sum(len(own) for own in layout.columns.values())
    assert np.count_nonzero(np.isfinite(later).all(axis=0)) == closures
