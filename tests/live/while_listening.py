"""Sends to what listens for some seconds, in place of those seconds: no test depends on how busy the machine is."""

import asyncio
import contextlib
import socket


def while_listening(monkeypatch, *sends):
    """Scans and the doctor run these coroutine functions where they would wait."""

    async def pause(seconds):
        for send in sends:
            await send()
        for _ in range(3):  # what was sent is read, and what cannot be opened has said so
            await asyncio.sleep(0.01)

    monkeypatch.setattr("oarlock.live.scan.listening.pause", pause)


def is_bound(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind(("0.0.0.0", port))
        except OSError:
            return True
    return False


def datagrams(port, *several):
    """A coroutine function that sends lists of datagrams to a port of this machine, each from a socket of its own."""

    async def send():
        while not is_bound(port):
            await asyncio.sleep(0.005)
        with contextlib.ExitStack() as stack:
            for one in several:
                sender = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
                for data in one:
                    sender.sendto(data, ("127.0.0.1", port))
                    await asyncio.sleep(0.0)
            # Loopback is not late: what was sent waits in the socket, and is read when the loop looks next.
            for _ in range(3):
                await asyncio.sleep(0.01)

    return send
