"""What holds of each wire format of worn units: streams may be cut anywhere, rubbish never ends a decoder."""

import itertools
import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oarlock.live.decoders import DECODERS
from oarlock.live.reading import Reading
from wire_streams import DATAGRAMS, STREAMS, label

ANY = (*STREAMS, *DATAGRAMS)
few = settings(max_examples=60, deadline=None, derandomize=True)


def parts(data, cuts):
    places = [0, *sorted(round(cut * len(data)) for cut in cuts), len(data)]
    return [data[a:b] for a, b in itertools.pairwise(places)]


def decoded(decoder, *packets):
    return [reading for packet in packets for reading in decoder.decode(packet)]


def plain(found):
    """Of readings without what counts from their first message."""
    return [(r.device, r.values) for r in found]


def test_every_format_has_a_stream_or_datagrams_here():
    ours = {"dot", "lines", "mvn", "ngimu", "nmea", "osc", "shimmer3", "vicon", "ximu3"}
    assert ours <= set(DECODERS)
    assert {wire.name for wire in ANY} == ours


@pytest.mark.parametrize("wire", ANY, ids=label)
def test_each_message_is_one_reading(wire):
    decoder = wire.decoder()
    found = decoded(decoder, *([wire.first] if wire.first else []), *wire.messages)
    assert len(found) == len(wire.messages)
    assert decoder.damaged == 0


@pytest.mark.parametrize("wire", STREAMS, ids=label)
@few
@given(cuts=st.lists(st.floats(0, 1), max_size=12))
def test_a_stream_may_be_cut_anywhere(wire, cuts):
    data = wire.first + b"".join(wire.messages)
    assert decoded(wire.decoder(), *parts(data, cuts)) == decoded(wire.decoder(), data)


@pytest.mark.parametrize("wire", STREAMS, ids=label)
@few
@given(rubbish=st.binary(max_size=200), cuts=st.lists(st.floats(0, 1), max_size=6), at=st.integers(0, 8))
def test_a_damaged_stream_may_be_cut_anywhere(wire, rubbish, cuts, at):
    data = wire.first + b"".join(wire.messages[:at]) + rubbish + b"".join(wire.messages[at:])
    whole, cut = wire.decoder(), wire.decoder()
    assert decoded(cut, *parts(data, cuts)) == decoded(whole, data)


@pytest.mark.parametrize("wire", STREAMS, ids=label)
@few
@given(rubbish=st.binary(min_size=1, max_size=300), one_by_one=st.booleans())
def test_after_rubbish_the_next_whole_message_is_decoded(wire, rubbish, one_by_one):
    decoder = wire.decoder()
    # Formats with delimiters lose what the rubbish runs into; others are found by their own form.
    data = wire.first + wire.messages[0] + rubbish + wire.end + b"".join(wire.messages[1:])
    found = decoded(decoder, *([data[k : k + 1] for k in range(len(data))] if one_by_one else [data]))
    expected = decoded(wire.decoder(), wire.first + b"".join(wire.messages))
    decided = len(expected) - wire.waiting
    missing = [one for one in plain(expected)[:decided] if one not in plain(found)]
    assert missing == []


@pytest.mark.parametrize("wire", DATAGRAMS, ids=label)
@few
@given(rubbish=st.binary(max_size=200))
def test_a_rubbish_datagram_spoils_no_other(wire, rubbish):
    decoder = wire.decoder()
    found = plain(decoded(decoder, wire.messages[0], rubbish, *wire.messages[1:]))
    assert [one for one in plain(decoded(wire.decoder(), *wire.messages)) if one not in found] == []


@pytest.mark.parametrize("wire", ANY, ids=label)
@few
@given(packets=st.lists(st.binary(max_size=120), max_size=8), channel=st.text(max_size=4))
def test_rubbish_is_never_an_error(wire, packets, channel):
    decoder = wire.decoder()
    for packet in packets:
        assert all(isinstance(one, Reading) for one in decoder.decode(packet, channel))


@pytest.mark.parametrize("wire", ANY, ids=label)
@few
@given(st.data())
def test_a_message_with_one_byte_changed_is_never_an_error(wire, data):
    message = bytearray(data.draw(st.sampled_from(wire.messages)))
    message[data.draw(st.integers(0, len(message) - 1))] ^= data.draw(st.integers(1, 255))
    decoder = wire.decoder()
    found = decoded(decoder, wire.first, bytes(message), *wire.messages)
    assert all(isinstance(one, Reading) for one in found)


@pytest.mark.parametrize("wire", STREAMS, ids=label)
@pytest.mark.parametrize("byte", [b"\0", b"A", b"{", b"M", b"MXTP01", b"\xff\x2d", b"$", b"^"])
def test_what_a_decoder_keeps_is_bounded(wire, byte):
    decoder = wire.decoder()
    decoder.decode(wire.first)
    piece = byte * (4096 // len(byte))
    tracemalloc.start()
    try:
        for _ in range(4):
            decoder.decode(piece)
        before, _ = tracemalloc.get_traced_memory()
        for _ in range(16):
            decoder.decode(piece)
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # Nothing grows with what was sent, 64 kB.
    assert after - before < 20_000
    decoder.decode(wire.end)
    assert len(plain(decoded(decoder, *wire.messages, *wire.messages))) >= len(wire.messages)
