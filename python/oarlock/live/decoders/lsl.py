"""Decodes a stream of the Lab Streaming Layer as our transport packs it: its header once, then samples with stamps.

LSL has no standard for raw inertial channels, so units are found by labels and units of measurement, as in XDF files
(`oarlock.formats.devices.xdf`); every other channel is a value under its label. Stamps are those of the sender's clock.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from oarlock.formats.arbitrary_units import ARBITRARY
from oarlock.formats.devices.xdf_chunks import channels_of, text_of, xml_of
from oarlock.formats.labelled_channels import Triple, inertial_triples
from oarlock.live.reading import Reading, Value
from oarlock.recording.streams import MOST_STREAMS
from oarlock.storage.arrays import Floats
from oarlock.storage.units import to_held_unit

HEADER, SAMPLES, CORRECTION = "header", "samples", "correction"
"""Channels of the packets: the XML of the stream; samples, each a stamp and the channels as little-endian float64; two
float64, our time and what to add to the sender's stamps then, which stays in the recording for a better fit later."""


def decoder() -> LslDecoder:
    """A decoder of one stream."""
    return LslDecoder()


@dataclass
class LslDecoder:
    """One stream."""

    damaged: int = 0
    _width: int = 0
    _triples: tuple[Triple, ...] = ()
    _plain: tuple[tuple[int, str], ...] = ()

    def decode(self, data: bytes, channel: str = "") -> list[Reading]:
        """The readings of a packet: for each sample one of each inertial unit, and one of all other channels."""
        if channel == HEADER:
            self._take_header(data)
            return []
        if channel != SAMPLES:
            return []
        size = 8 * (1 + self._width)
        if not self._width or not data or len(data) % size:
            self.damaged += 1
            return []
        rows = np.frombuffer(data, "<f8").reshape(-1, 1 + self._width)
        self.damaged += int((~np.isfinite(rows[:, 0])).sum())
        return [r for row in rows if np.isfinite(row[0]) for r in self._readings(float(row[0]), row[1:])]

    def _take_header(self, data: bytes) -> None:
        try:
            info = xml_of(data)
            count = int(text_of(info, "channel_count"))
            if not 0 < count <= MOST_STREAMS:
                raise ValueError
            told = channels_of(info, count)
        except (ElementTree.ParseError, ValueError, struct.error):
            self.damaged += 1
            return
        triples, _ = inertial_triples([c.label for c in told], [c.unit for c in told])
        used = {place for triple in triples for place in triple.places}
        self._width, self._triples = count, tuple(triples)
        self._plain = tuple((k, c.label or str(k + 1)) for k, c in enumerate(told) if k not in used)

    def _readings(self, stamp_s: float, row: Floats) -> list[Reading]:
        units: dict[str, dict[str, Value]] = {}
        for triple in self._triples:
            value = row[list(triple.places)]
            if np.isfinite(value).all():
                is_arbitrary = triple.measured_in == ARBITRARY
                name = "mag_arbitrary" if is_arbitrary else triple.field
                held = value if is_arbitrary else to_held_unit(value, triple.measured_in)
                units.setdefault(triple.unit, {})[name] = tuple(float(x) for x in held)
        plain: dict[str, Value] = {name: float(row[k]) for k, name in self._plain if np.isfinite(row[k])}
        if plain:
            units.setdefault("", {}).update(plain)
        return [Reading(unit, stamp_s, values) for unit, values in units.items()]
