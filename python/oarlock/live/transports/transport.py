"""What all transports have in common: deliver packets until they are cancelled, and connect again by themselves."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from oarlock.live.reading import Packet
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

Deliver = Callable[[Packet], None]
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 8.0


class Transport(Protocol):
    """A way of bytes to this machine.

    Args of an implementation: the source's name, and its options of the rig file.
    """

    state: str
    """How it does, for people: "listens at port 9000", "connects again in 2 s (connection refused)"."""

    async def run(self, deliver: Deliver) -> None:
        """Delivers packets until it is cancelled. Nothing that a device does ends it.

        Raises:
            DataError: it cannot work as the options say: the port is taken, a package is missing.
        """


@dataclass(frozen=True)
class Options:
    """The options of a source in a rig file, read with their types.

    Args:
        source: its name, for errors.
        values: from the file.
    """

    source: str
    values: Mapping[str, object]

    def check(self, *known: str) -> None:
        """Refuse an option that the transport does not have."""
        for key in self.values:
            if key not in known:
                raise DataError(
                    f"source '{self.source}': the option {key} is unknown. {did_you_mean(key, known)}"
                )

    def text(self, key: str, default: str | None = None) -> str:
        """A text; required without a default."""
        value = self.values.get(key, default)
        if not isinstance(value, str):
            raise self._wrong(key, value, "a text in quotes")
        return value

    def integer(self, key: str, default: int | None = None) -> int:
        """A whole number; required without a default."""
        value = self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self._wrong(key, value, "a whole number")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        values = self.values.get(key)
        if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
            raise self._wrong(key, values, "a list of texts in quotes")
        return tuple(values)

    def port(self, default: int | None = None) -> int:
        """The port of a socket."""
        port = self.integer("port", default)
        if not 0 <= port < 65536:
            raise self._wrong("port", port, "0 to 65535")
        return port

    def _wrong(self, key: str, value: object, expected: str) -> DataError:
        found = "is missing" if value is None else f"is {value!r}"
        return DataError(f"source '{self.source}': the option {key} {found}; expected {expected}")


class ToldState:
    """Of one of several links: a state, and who is told when it changes."""

    def __init__(self, state: str, told: Callable[[], None] = lambda: None) -> None:
        self._state, self.told = state, told

    @property
    def state(self) -> str:
        """How it does, for people."""
        return self._state

    @state.setter
    def state(self, text: str) -> None:
        self._state = text
        self.told()


def now_ns() -> int:
    """Now, by the clock of arrivals, ns."""
    return time.monotonic_ns()


async def again_and_again(transport: Transport, connected: Callable[[], Awaitable[None]], place: str) -> None:
    """Connects, and after a loss again, with pauses that grow to 8 s while nothing answers.

    Args:
        transport: whose state is told.
        connected: connects and reads until the connection ends; raises `OSError` where it cannot.
        place: what it connects to.
    """
    pause_s = FIRST_PAUSE_S
    while True:
        transport.state, began_s = f"connects to {place}", time.monotonic()
        try:
            await connected()
            why = "the other side closed the connection"
        except OSError as error:
            why = error.strerror or str(error) or type(error).__name__
        pause_s = FIRST_PAUSE_S if time.monotonic() - began_s > LONGEST_PAUSE_S else pause_s
        transport.state = f"lost {place} ({why}); connects again in {pause_s:g} s"
        await asyncio.sleep(pause_s)
        pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
