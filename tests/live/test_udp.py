"""Datagrams: stamped when the kernel received them, even if the program was busy then."""

import asyncio
import socket
import struct
import sys
import time

import pytest

from oarlock.live.transports.transport import Options
from oarlock.live.transports.udp import _SO_TIMESTAMPNS, Udp, free_port


@pytest.fixture
def stamping():
    """A kernel that stamps datagrams: it begins a moment after the first socket asked for it, or later."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        own.bind(("127.0.0.1", 0))
        is_stamped = False
        while not is_stamped:
            own.sendto(b"x", own.getsockname())
            sent_ns = time.time_ns()
            time.sleep(0.01)
            ((_, _, stamp),) = own.recvmsg(1, 100)[1]
            seconds, nanoseconds = struct.unpack("@ll", stamp)
            is_stamped = seconds * 10**9 + nanoseconds <= sent_ns
        yield


@pytest.mark.usefixtures("stamping")
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says when it received a datagram")
def test_a_busy_program_delays_no_stamp():
    async def work():
        transport, got, port = None, [], free_port()
        transport = Udp("radio", Options("radio", {"port": port, "host": "127.0.0.1"}))
        running = asyncio.create_task(transport.run(got.append))
        while transport.state == "not started":
            await asyncio.sleep(0.001)
        sent_ns = []
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number in range(3):
                sent_ns.append(time.monotonic_ns())
                sender.sendto(bytes([number]), ("127.0.0.1", port))
                time.sleep(0.3)  # the loop cannot run
            address = f"127.0.0.1:{sender.getsockname()[1]}"
        read_ns = time.monotonic_ns()
        while len(got) < 3:
            await asyncio.sleep(0.001)
        running.cancel()
        return got, sent_ns, read_ns, address, transport.dropped

    got, sent_ns, read_ns, address, dropped = asyncio.run(asyncio.wait_for(work(), 30))
    assert [(p.data, p.address) for p in got] == [(bytes([n]), address) for n in range(3)]
    assert dropped in (0, None)
    for packet, at_ns in zip(got, sent_ns, strict=True):
        # Two clocks are read one after the other, which takes microseconds; a thread may be held up between.
        assert at_ns - 10**6 <= packet.arrival_ns <= read_ns - 2 * 10**8


class Queued:
    """A socket that holds datagrams with the times at which the kernel received them."""

    def __init__(self, received_ns):
        self.waiting = list(received_ns)

    def recvmsg(self, *_):
        if not self.waiting:
            raise BlockingIOError
        stamp = struct.pack("@ll", *divmod(self.waiting.pop(0), 10**9))
        return b"x", [(socket.SOL_SOCKET, _SO_TIMESTAMPNS, stamp)], 0, ("127.0.0.1", 7)


@pytest.mark.parametrize("set_s", [-3600.0, -2.0, 0.0, 2.0, 3600.0])
def test_a_clock_of_the_day_that_is_set_moves_no_stamp(set_s):
    transport, got = Udp("radio", Options("radio", {"port": 9})), []
    before_ns, day_ns = time.monotonic_ns(), time.time_ns()
    transport._receive(Queued([day_ns]), got.append)
    # These were received before the clock was set, and are read after it.
    waited = Queued([day_ns - round(1e9 * set_s) + 1000 * number for number in range(5)])
    transport._receive(waited, got.append)
    stamps = [packet.arrival_ns for packet in got]
    assert len(stamps) == 6 and stamps == sorted(stamps)
    # A clock is read twice for each stamp, which takes microseconds.
    assert before_ns - 10**6 <= stamps[0] and stamps[-1] <= time.monotonic_ns()
