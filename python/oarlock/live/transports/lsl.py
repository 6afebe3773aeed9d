"""A stream of the Lab Streaming Layer, by pylsl."""

from __future__ import annotations

import asyncio
import struct
import threading
from importlib import import_module
from typing import Any

import numpy as np

from oarlock.live.decoders.lsl import CORRECTION, HEADER, SAMPLES
from oarlock.live.reading import Packet
from oarlock.live.transports.transport import Deliver, Options, again_and_again, now_ns
from oarlock.storage.errors import DataError

RESOLVE_S = 2.0
PULL_S = 0.05
CORRECTION_EVERY_S = 5.0
_KEYS = ("name", "type", "source_id")


class Lsl:
    """Reads a stream, and finds it again when its sender was started again. Options: `name`, `type` or `source_id`.

    Stamps stay those of the sender's clock: LSL's own corrections step, and its smoothing forgets the stamps.
    """

    def __init__(self, source: str, options: Options) -> None:
        options.check(*_KEYS)
        found = [key for key in _KEYS if key in options.values]
        if len(found) != 1:
            raise DataError(f"source '{source}': give one of the options {', '.join(_KEYS)} of its stream")
        self.source, self.key, self.value = source, found[0], options.text(found[0])
        self.state = "not started"
        try:
            self._pylsl: Any = import_module("pylsl")
        except (ImportError, RuntimeError) as error:
            raise DataError(
                f"source '{source}': LSL needs pylsl with its library: pip install 'oarlock[lsl]' ({error})"
            ) from error

    async def run(self, deliver: Deliver) -> None:
        """Delivers the header, samples as they come, and a clock correction every 5 s, until it is cancelled."""
        await again_and_again(
            self, lambda: self._connected(deliver), f'the stream with {self.key} "{self.value}"'
        )

    async def _connected(self, deliver: Deliver) -> None:
        loop, ended = asyncio.get_running_loop(), threading.Event()

        def told(channel: str, data: bytes, arrival_ns: int) -> None:
            loop.call_soon_threadsafe(deliver, Packet(self.source, self.value, channel, arrival_ns, data))

        try:
            await loop.run_in_executor(None, self._read, told, ended)
        finally:
            ended.set()

    def _read(self, told: Any, ended: threading.Event) -> None:
        """In a thread of its own, because liblsl waits."""
        lsl = self._pylsl
        found = lsl.resolve_byprop(self.key, self.value, 1, RESOLVE_S)
        if not found:
            raise OSError(f"no such stream within {RESOLVE_S:g} s")
        inlet = lsl.StreamInlet(found[0], recover=False, processing_flags=lsl.proc_none)
        try:
            info = inlet.info(RESOLVE_S)
            told(HEADER, info.as_xml().encode(), now_ns())
            self.state = f"reads {info.name()} of {info.hostname()}"
            self._pull(inlet, told, ended)
        except lsl.util.LostError as error:
            raise OSError("its sender has gone") from error
        except lsl.util.TimeoutError as error:
            raise OSError("its sender does not answer") from error
        finally:
            inlet.close_stream()

    def _pull(self, inlet: Any, told: Any, ended: threading.Event) -> None:
        due_ns = now_ns()
        while not ended.is_set():
            samples, stamps = (
                inlet.pull_chunk(PULL_S, 1) if not inlet.samples_available() else inlet.pull_chunk(0.0)
            )
            arrival_ns = now_ns()
            if stamps:
                rows = np.column_stack([stamps, np.asarray(samples, dtype=np.float64)])
                told(SAMPLES, rows.astype("<f8").tobytes(), arrival_ns)
            if arrival_ns > due_ns:
                due_ns = arrival_ns + int(1e9 * CORRECTION_EVERY_S)
                pair = struct.pack("<dd", arrival_ns / 1e9, inlet.time_correction(RESOLVE_S))
                told(CORRECTION, pair, arrival_ns)
