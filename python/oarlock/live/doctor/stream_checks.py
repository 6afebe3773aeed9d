"""What arrived for one stream of a rig: at which rate, how late, with values that can be right."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from oarlock.live.doctor.arrivals import Arrivals, StreamHeard
from oarlock.live.doctor.check import NOTE, OK, PROBLEM, Diagnosis
from oarlock.live.rig import Feed
from oarlock.live.scan.finding import sends
from oarlock.live.scan.joint_read import joint_read, unit_read
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    from oarlock._core import Model

_RATE_OFF, _MUCH_LOST, _LATE_SHARE = 0.1, 2.0, 0.99
_REST_M_S2 = (5.0, 20.0)
"""Of the median specific force; a body that moves for some seconds stays within."""


def stream_checks(found: Arrivals, feed: Feed, model: Model, wait_s: float) -> Iterator[Diagnosis]:
    """Findings on one stream whose source delivers.

    Args:
        found: what arrived.
        feed: of the stream.
        model: of the rig.
        wait_s: how long estimates wait for readings that come late.
    """
    about, heard = f"stream {feed.stream}", found.streams[feed.stream]
    if not heard.senders:
        yield _nothing(found, feed, about)
        return
    yield _rate(heard, about)
    if feed.kind == "imu":
        yield from _quantities(found, heard, about)
    if len(heard.senders) > 1:
        yield Diagnosis(
            about, NOTE, f"{len(heard.senders)} devices feed it", ("Name one of them with device = ...",)
        )
    yield from _lateness(heard, about, wait_s)
    yield from _values(heard, about, model)


def _nothing(found: Arrivals, feed: Feed, about: str) -> Diagnosis:
    """Why nothing comes although its source delivers."""
    senders = found.of_source(feed.source)
    named = [s for s in senders if feed.stream in s.streams]
    if named:
        sent = sends(tuple(dict.fromkeys(name for s in named for name in s.tally.last))) or "nothing measured"
        needed = sends(feed.values) if feed.kind == "imu" else feed.values[0]
        return Diagnosis(
            about, PROBLEM, f"{named[0].name} sends {sent}, and not {needed}", _other_value(feed, sent)
        )
    known = did_you_mean(feed.device, list(dict.fromkeys(s.name for s in senders)))
    return Diagnosis(
        about,
        PROBLEM,
        f'no device "{feed.device}" of the source {feed.source} was heard',
        (f"Is it on? {known}",),
    )


def _other_value(feed: Feed, sent: str) -> tuple[str, ...]:
    if feed.kind == "imu":
        return ("Set the device to send raw gyroscope and accelerometer.",)
    return (f'Write value = "..." with one of: {sent}.',)


def _rate(heard: StreamHeard, about: str) -> Diagnosis:
    rate_hz, expected = heard.rate_hz, heard.feed.rate_hz
    lost = heard.tally.lost_percent() or 0.0
    told = "fewer than three readings" if rate_hz is None else f"{rate_hz:.4g} Hz"
    missing = f", {lost:.1f} % lost" if lost > 0.05 else ""
    if rate_hz is None or expected is None:
        tries = () if rate_hz is None else (f"Write rate_hz = {rate_hz:.4g} into the rig file.",)
        return (
            Diagnosis(about, NOTE, f"{told}{missing}; the rig file expects no rate", tries)
            if rate_hz
            else Diagnosis(about, NOTE, told, ("Listen longer: --duration-s 20.",))
        )
    if abs(rate_hz - expected) > _RATE_OFF * expected:
        text = f"{told}{missing}, and rate_hz says {expected:g}"
        return Diagnosis(
            about, NOTE, text, (f"Set the device to {expected:g} Hz, or write rate_hz = {rate_hz:.4g}.",)
        )
    if lost > _MUCH_LOST:
        return Diagnosis(
            about, NOTE, f"{told}{missing}", ("Move the receiver nearer, or use another radio channel.",)
        )
    return Diagnosis(about, OK, f"{told}{missing}")


def _quantities(found: Arrivals, heard: StreamHeard, about: str) -> Iterator[Diagnosis]:
    missing = [name for name in heard.feed.values if name not in heard.tally.last]
    if not missing:
        return
    sent = {
        name
        for s in found.of_source(heard.feed.source)
        if heard.feed.stream in s.streams
        for name in s.tally.last
    }
    text = f"no {sends(missing)}"
    if missing == ["mag_ut"]:
        if "mag_arbitrary" in sent:
            text += ": the device sends its magnetic field without a unit"
        yield Diagnosis(about, NOTE, f"{text}; headings are less certain without it")
    else:
        yield Diagnosis(about, PROBLEM, text, ("Set the device to send raw gyroscope and accelerometer.",))


def _lateness(heard: StreamHeard, about: str, wait_s: float) -> Iterator[Diagnosis]:
    late_s = heard.late_s(_LATE_SHARE)
    if late_s is not None and late_s > wait_s:
        text = (
            f"1 of 100 readings comes more than {1e3 * late_s:.0f} ms behind the fastest; estimates wait "
            f"{1e3 * wait_s:g} ms"
        )
        yield Diagnosis(
            about, NOTE, text, (f"Write wait_ms = {1e3 * late_s:.0f}, or improve the radio link.",)
        )


def _values(heard: StreamHeard, about: str, model: Model) -> Iterator[Diagnosis]:
    """Whether the values can be in the right unit."""
    if not heard.values:
        return
    usual = float(np.median(heard.values))
    if heard.feed.kind == "imu":
        low, high = _REST_M_S2
        if not low < usual < high:
            text = f"its acceleration is {usual:.3g} m/s2 in the middle; at rest it must be 9.8"
            yield Diagnosis(about, NOTE, text, ("Does the device send m/s2, and not multiples of gravity?",))
        return
    joint = joint_read(model, heard.feed.stream)
    if joint is None:
        return
    low, high = joint.limits
    room = high - low
    if not low - room < usual < high + room:
        unit = unit_read(model, heard.feed.stream)
        text = f"its value is {usual:.4g} {unit}; the joint has a range of {low:.3g} to {high:.3g} {unit}"
        yield Diagnosis(
            about, NOTE, text, (f"Write scale and offset, so that scale * value + offset is {unit}.",)
        )
