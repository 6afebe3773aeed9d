"""Bytes of worn units with wounds and with rubbish between them, at the decoders of live sources: none may raise."""

import pytest
from hypothesis import strategies as st

from fuzz_campaign import campaign
from fuzz_wounds import byte_wounds, wounded_bytes
from wire_streams import DATAGRAMS, STREAMS, assert_sound, label


@pytest.mark.parametrize("wire", STREAMS, ids=label)
def test_streams(wire):
    def check(harm, size):
        data = wounded_bytes(wire.first + b"".join(wire.messages), harm)
        whole, cut = wire.decoder(), wire.decoder()
        found = whole.decode(data)
        assert_sound(found)
        assert [r for k in range(0, len(data), size) for r in cut.decode(data[k : k + size])] == found
        # A wound may have changed what it must know before.
        again = whole.decode(wire.end + (wire.first + b"".join(wire.messages)) * 3)
        assert len(again) >= len(wire.messages)

    campaign(check, byte_wounds, st.integers(1, 40))


@pytest.mark.parametrize("wire", DATAGRAMS, ids=label)
def test_datagrams(wire):
    def check(harm, rubbish):
        decoder = wire.decoder()
        for packet in wire.messages:
            assert_sound(decoder.decode(wounded_bytes(packet, harm)))
            assert_sound(decoder.decode(rubbish))
        assert len(decoder.decode(wire.messages[-1])) == 1

    campaign(check, byte_wounds, st.binary(max_size=300))
