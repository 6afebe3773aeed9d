"""What decoders make of bytes, for their tests."""

import pytest

from oarlock.live.decoders import DECODERS

G = 9.80665


def decoder_of(name, transport="", **options):
    """As a session makes it for a source with this transport."""
    return DECODERS[name].decoder(transport, **options)


def readings(name, *packets, channel="", **options):
    """Of packets that arrive one after the other; none may be damaged."""
    decoder = decoder_of(name, **options)
    found = [reading for packet in packets for reading in decoder.decode(as_bytes(packet), channel)]
    assert decoder.damaged == 0
    return found


def one(name, *packets, **options):
    """The only reading."""
    (found,) = readings(name, *packets, **options)
    return found


def damaged(name, *packets, channel="", **options):
    """How much is damaged, of packets that give no reading."""
    decoder = decoder_of(name, **options)
    assert [r for packet in packets for r in decoder.decode(as_bytes(packet), channel)] == []
    return decoder.damaged


def as_bytes(packet):
    return packet if isinstance(packet, bytes) else bytes.fromhex(packet)


def near(values, abs=0.0, rel=1e-6):
    """Of float32."""
    return pytest.approx(values, abs=abs, rel=rel)
