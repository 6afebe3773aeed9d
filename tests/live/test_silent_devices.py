"""Devices that feed no sensor are named when they fall silent and when they are back."""

import json

import pytest

from oarlock.live.decoders import DECODERS
from oarlock.live.health import Watch
from oarlock.live.intake import Intake
from oarlock.live.live import LOOK_S
from oarlock.live.reading import Packet
from oarlock.live.rig import Feed, Rig, Source
from oarlock.live.silent_devices import GAPS, LEAST_S, LONGEST_S

ENDS_S, FAILS_S, BACK_S = 60.0, 20.0, 45.0
SOURCES = {name: Source(name, "lines", "udp") for name in ("radio", "belt", "gps", "erg")}


def sent(source, address, every_s, from_s=0.0, to_s=ENDS_S, gap_s=(FAILS_S, BACK_S)):
    """Packets of a device, none within a gap."""
    count = round((to_s - from_s) / every_s)
    times = [from_s + every_s * k for k in range(count)]
    line = json.dumps({"device": "", "bpm": 61.0}).encode() + b"\n"
    return [
        Packet(source, address, "", int(1e9 * at_s), line) for at_s in times if not gap_s[0] < at_s < gap_s[1]
    ]


def told_of(packets, feeds=()):
    """Events with their times."""
    intake = Intake(
        Rig("sculler", None, SOURCES, tuple(feeds)),
        0,
        lambda source: DECODERS["lines"].decoder(source.transport),
    )
    watch, told, look_s = Watch(intake), [], 0.0
    for packet in sorted(packets, key=lambda packet: packet.arrival_ns):
        while look_s < packet.arrival_ns / 1e9:
            told += [(look_s, text) for text in watch.events(look_s)]
            look_s += LOOK_S
        intake.take(packet)
    return told


@pytest.mark.parametrize(
    ("every_s", "patience_s"), [(0.1, LEAST_S), (1.0, GAPS * 1.0), (2.5, GAPS * 2.5), (5.0, LONGEST_S)]
)
def test_a_belt_is_named_when_it_falls_silent_and_when_it_is_back(every_s, patience_s):
    (silent_s, silent), (back_s, back) = told_of(
        [*sent("belt", "AA:01", every_s), *sent("radio", "", 0.05, gap_s=(ENDS_S, ENDS_S))]
    )
    assert (silent, back) == ("belt is silent", "belt is back")
    last_s = FAILS_S - FAILS_S % every_s if FAILS_S % every_s > 1e-6 else FAILS_S
    assert patience_s < silent_s - last_s <= patience_s + every_s + LOOK_S
    assert BACK_S <= back_s <= BACK_S + every_s + LOOK_S


def test_of_two_devices_of_a_source_the_address_is_told():
    gone = sent("gps", "10.0.0.7:9000", 0.2)
    stays = [one for name in ("10.0.0.8:9000",) for one in sent("gps", name, 0.2, gap_s=(ENDS_S, ENDS_S))]
    assert [text for _, text in told_of([*gone, *stays])] == [
        "gps 10.0.0.7:9000 is silent",
        "gps 10.0.0.7:9000 is back",
    ]


def test_who_was_heard_a_few_times_only_is_not_awaited():
    few = [
        one
        for k in range(40)
        for one in sent("erg", f"10.0.0.9:{5000 + k}", 0.1, from_s=k, to_s=k + 0.1 * GAPS)
    ]
    assert told_of([*few, *sent("radio", "", 0.05, gap_s=(ENDS_S, ENDS_S))]) == []


def test_a_unit_that_fed_a_sensor_is_told_of_by_its_sensor_alone():
    feed = Feed("heart", "scalar", "belt", "", ("bpm",), 1.0)
    told = told_of([*sent("belt", "AA:01", 1.0), *sent("radio", "", 0.05, gap_s=(ENDS_S, ENDS_S))], [feed])
    assert [text for _, text in told] == ["heart is silent", "heart is back"]
