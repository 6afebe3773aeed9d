"""Sensors that fail are named within a second: silent ones, stuck ones, and those that send nothing of use."""

import json
import math

import numpy as np
import pytest

from oarlock.live.decoders import DECODERS
from oarlock.live.health import Watch
from oarlock.live.intake import Intake
from oarlock.live.live import LOOK_S
from oarlock.live.reading import Packet
from oarlock.live.rig import Feed, Rig, Source

FAILS_S, BACK_S, ENDS_S = 5.0, 8.0, 10.0
IMU = ("gyro_rad_s", "accel_m_s2")


def reading(name, step, fault):
    """What a device sends as its reading of a step; None for nothing."""
    rng = np.random.default_rng([step, len(name)])
    told = {"device": name, "t_us": 10_000 * step, "seq": step}
    if fault == "silent":
        return None
    if fault == "stuck":
        return {**told, "gyro_rad_s": [0.01, 0.0, 0.02], "accel_m_s2": [0.0, 0.0, 9.8]}
    if fault == "battery":
        return {**told, "battery_percent": 55.0}
    values = {"gyro_rad_s": rng.normal(size=3).tolist(), "accel_m_s2": rng.normal(size=3).tolist()}
    if fault == "nan":
        values["gyro_rad_s"] = [math.nan] * 3
    return {**told, **values} if name != "seat" else {**told, "value": 0.2}


def watched(transport, fault):
    """Events with their times; of two units and an encoder at rest, a unit fails for three seconds."""
    feeds = [Feed(name, "imu", "radio", name, IMU, 100.0) for name in ("back", "hand")]
    feeds.append(Feed("seat", "scalar", "radio", "seat", ("value",), 100.0))
    rig = Rig("sculler", None, {"radio": Source("radio", "lines", transport)}, tuple(feeds))
    intake = Intake(rig, 0, lambda source: DECODERS[source.format].decoder(source.transport))
    watch, told, used, look_s = Watch(intake), [], {}, 0.0
    for step in range(int(ENDS_S * 100)):
        now_s = step / 100
        is_failing = FAILS_S <= now_s < BACK_S
        for name in ("back", "hand", "seat"):
            sent = reading(name, step, fault if is_failing and name == "hand" else "")
            if sent is not None:
                data = json.dumps(sent).encode() + b"\n"
                for one in intake.take(Packet("radio", "", "", int(1e9 * now_s), data)):
                    used.setdefault(one.stream, []).append(one.time_s)
        if now_s >= look_s:
            look_s += LOOK_S
            told += [(now_s, text) for text in watch.events(now_s)]
    return told, used


@pytest.mark.parametrize("transport", ["udp", "tcp", "serial"])
@pytest.mark.parametrize(
    ("fault", "text", "back"),
    [
        ("silent", "hand is silent", "hand is back"),
        ("nan", "hand is silent", "hand is back"),
        ("battery", "hand sends no readings that can be used", "hand is back"),
        ("stuck", "hand is stuck", "hand measures again"),
    ],
)
def test_the_failing_sensor_alone_is_named_within_a_second_and_when_it_is_back(transport, fault, text, back):
    told, _ = watched(transport, fault)
    # A line with NaN is no JSON: it is counted as damaged, too.
    (failed_s, failed), (back_s, returned) = [one for one in told if "could not be decoded" not in one[1]]
    assert failed.startswith(text)
    assert returned == back
    assert FAILS_S < failed_s <= FAILS_S + 1.0
    assert BACK_S <= back_s <= BACK_S + 1.0


def test_readings_of_a_stuck_unit_are_not_used_and_nothing_else_is_lost():
    _, used = watched("udp", "stuck")
    hand = np.array(used["hand"])
    assert len(used["back"]) == len(used["seat"]) == ENDS_S * 100
    assert not ((hand > FAILS_S + 0.6) & (hand < BACK_S - 0.1)).any()
    assert np.count_nonzero(hand < FAILS_S) == pytest.approx(FAILS_S * 100, abs=1)
    assert np.count_nonzero(hand >= BACK_S - 0.005) == pytest.approx((ENDS_S - BACK_S) * 100, abs=1)


def test_a_magnet_is_named_when_it_comes_and_when_it_goes():
    rig = Rig("sculler", None, {"radio": Source("radio", "lines", "udp")}, ())
    watch, said = Watch(Intake(rig, 0, lambda source: DECODERS[source.format].decoder(source.transport))), []
    for look in range(60):
        now_s = 0.25 * look
        # 0.5 s of disturbance at 2 s are too short; the magnet is there from 5 to 9 s.
        is_near = 2.0 <= now_s < 2.5 or 5.0 <= now_s < 9.0
        judged = {"back": {"field": "norm" if is_near else "undisturbed"}, "seat": {}}
        said += [(now_s, text) for text in watch.fields(judged, now_s)]
    assert [(now_s, text.split(":")[0]) for now_s, text in said] == [
        (6.25, "a magnet or iron is near back"),
        (10.25, "the magnetic field at back is right again and used"),
    ]
