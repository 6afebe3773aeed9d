"""Opens the sources of a rig for some seconds and says of each source and stream what arrived."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

from oarlock.live.doctor.arrivals import Arrivals, DeviceArrivals
from oarlock.live.doctor.check import NOTE, OK, PROBLEM, Diagnosis
from oarlock.live.doctor.stream_checks import stream_checks
from oarlock.live.rig import Rig, Source
from oarlock.live.scan.finding import OWN_STATE, sends
from oarlock.live.scan.listening import Hearing
from oarlock.live.scan.recognition import recognised

if TYPE_CHECKING:
    from oarlock._core import Model

_FEW_DAMAGED = 0.01
_LOW_BATTERY = 20.0
_SILENT_TRIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "udp": (
            "Is the sensor on, in this network, and set to send to the address and port above?",
            "oarlock live scan: it lists what arrives at other ports.",
        ),
        "tcp": ("Is the device on? Are host and port right? oarlock live scan lists what announces itself.",),
        "serial": (
            "Is baud right? Does the device send by itself? Try: oarlock live scan --source serial:DEVICE@BAUD",
        ),
        "ble": ("Is the device awake, near, and not connected to another program or phone?",),
        "lsl": (
            "Is its program running, in this network and with the same SessionID? oarlock live scan --places lsl",
        ),
        "websocket": ("It is connected: does the device send only while somebody rows?",),
        "mqtt": (
            'Does the device publish to this topic? With topic = "#" everything that the broker has arrives.',
            "Is the device connected to this broker?",
        ),
        "replay": ("Does the folder have packets of this source? Give its name there with `of`.",),
    }
)


_LOST_TRIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "websocket": (
            "Is the device on, and in this network? Try the address of url in a browser, with http:// in place of ws://.",
        ),
        "mqtt": (
            "Does the broker run, are host and port right, and may other machines connect? mosquitto listens to others "
            "only with a line listener 1883 in its configuration.",
        ),
    }
)
"""Where nobody answers, by transport."""


def rig_checks(rig: Rig, model: Model, hearings: Sequence[Hearing], seconds: float) -> list[Diagnosis]:
    """Findings on each source, stream and device.

    Args:
        rig: as it was read.
        model: of the rig.
        hearings: one for each source, which were opened for some time.
        seconds: how long.
    """
    found = Arrivals.of(rig, [one for one in hearings if not one.problem])
    checks = [check for hearing in hearings for check in _source(hearing, found, seconds)]
    # A source that delivers nothing is one finding, not one for each of its streams.
    dumb = {one.source.name for one in hearings if not found.readings.get(one.source.name)}
    for feed in rig.feeds:
        if feed.source not in dumb:
            checks += stream_checks(found, feed, model, rig.wait_s)
    idle = [s for feed in rig.feeds if feed.source in dumb for s in (feed.stream,)]
    if idle:
        checks.append(
            Diagnosis(
                "streams", PROBLEM, f"{', '.join(idle)}: get nothing, because their sources send nothing"
            )
        )
    if not rig.feeds:
        tries = ("oarlock live init writes a rig file of what is heard.",)
        text = "the rig feeds no stream of the model: what its devices send is shown and recorded, nothing is tracked"
        checks.append(Diagnosis("streams", NOTE, text, tries))
    return [*checks, *_idle_devices(found), *_batteries(found)]


def _source(hearing: Hearing, found: Arrivals, seconds: float) -> Iterator[Diagnosis]:
    source, about = hearing.source, f"source {hearing.source.name}"
    if hearing.problem:
        yield Diagnosis(about, PROBLEM, hearing.problem.partition(": ")[2] or hearing.problem)
        return
    if not hearing.count:
        text = f"nothing arrived in {seconds:g} s; it {hearing.state}" if hearing.state else "nothing arrived"
        yield Diagnosis(about, PROBLEM, text, _tries(hearing))
        return
    readings, damaged = found.readings.get(source.name, 0), found.damaged.get(source.name, 0)
    if not readings:
        yield _unreadable(hearing, about)
        return
    size = sum(len(packet.data) for packet in hearing.packets) / max(seconds, 0.1)
    devices = len(found.of_source(source.name))
    text = (
        f"{hearing.count:,} packets, {size / 1e3:.1f} kB/s, of {devices} device{'s' if devices > 1 else ''}"
    )
    yield Diagnosis(about, OK, text)
    if damaged > _FEW_DAMAGED * readings:
        share = 100.0 * damaged / (damaged + readings)
        yield Diagnosis(
            about,
            NOTE,
            f"{damaged:,} messages ({share:.0f} %) could not be decoded",
            (f"Does every device of this source send the format {source.format}?",),
        )


def _tries(hearing: Hearing) -> tuple[str, ...]:
    """What to try where nothing arrives."""
    transport = hearing.source.transport
    is_there = hearing.state.startswith(("listens", "connected"))
    silent = _SILENT_TRIES.get(transport, ())
    return silent if is_there else _LOST_TRIES.get(transport, silent)


def _unreadable(hearing: Hearing, about: str) -> Diagnosis:
    """Bytes that the rig's format does not read; another one may."""
    source = hearing.source
    plain = Source(source.name, "", source.transport)
    fits = [
        r.format for packets in hearing.by_address().values() if (r := recognised(packets, plain)) is not None
    ]
    tries = (
        (f'They look like another format: write format = "{fits[0]}".',)
        if fits
        else ("oarlock live scan shows the first bytes. Is the sensor set to the format of the rig?",)
    )
    text = f"{hearing.count:,} packets arrived, and none is a message of the format {source.format}"
    return Diagnosis(about, PROBLEM, text, tries)


def _idle_devices(found: Arrivals) -> Iterator[Diagnosis]:
    """Devices that feed nothing, by source."""
    for source, own in found.rig.sources.items():
        # In its first second a unit that is named has not announced itself yet.
        if "units" in own.options:
            continue
        idle = [s for s in found.of_source(source) if not s.streams and _measures(s)]
        if idle:
            text = ", ".join(f"{s.name} ({sends(tuple(s.tally.last))})" for s in idle)
            yield Diagnosis(
                f"source {source}",
                NOTE,
                f"feed nothing: {text}",
                ("Name it as the device of a stream, or leave it: it is recorded.",),
            )


def _measures(sender: DeviceArrivals) -> bool:
    return bool(sender.tally.last.keys() - OWN_STATE)


def _batteries(found: Arrivals) -> Iterator[Diagnosis]:
    for sender in found.senders.values():
        charge = sender.tally.battery_percent
        if charge is not None and charge < _LOW_BATTERY:
            text = f"{sender.name}: battery {charge:.0f} %"
            yield Diagnosis(f"source {sender.source}", NOTE, text, ("Charge it before the session.",))
