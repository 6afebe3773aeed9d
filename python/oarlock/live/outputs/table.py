"""The `[outputs]` table of a rig file: where estimates and events go beside the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable


@dataclass(frozen=True)
class Outputs:
    """Destinations of a session's messages.

    Args:
        udp: `HOST:PORT` of programs that get JSON lines.
        osc: `HOST:PORT` of programs that get bundles of Open Sound Control.
        lsl: names of streams of the Lab Streaming Layer.

    Raises:
        DataError: a destination is no `HOST:PORT`.
    """

    udp: tuple[str, ...] = ()
    osc: tuple[str, ...] = ()
    lsl: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for kind, text in self.destinations():
            if kind != "lsl":
                destination(text, kind)

    @classmethod
    def read(cls, table: TomlTable) -> Outputs:
        """The table of a rig file; a single destination may be a text in place of a list."""
        table.check_keys(field.name for field in fields(cls))
        return cls(**{key: _texts(table, key) for key in table.values})

    def destinations(self) -> Iterator[tuple[str, str]]:
        """Each destination with its kind, "udp", "osc" or "lsl"."""
        for field in fields(self):
            for text in getattr(self, field.name):
                yield field.name, text

    def document(self) -> Mapping[str, list[str]]:
        """The table as plain data, which `read` reads back."""
        return {
            field.name: list(getattr(self, field.name)) for field in fields(self) if getattr(self, field.name)
        }


def destination(text: str, option: str) -> tuple[str, int]:
    """Host and port of `HOST:PORT`, or of a port of this machine.

    Raises:
        DataError: it is neither.
    """
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or not 0 < int(port) < 65536:
        raise DataError(f"{option}: '{text}' is no HOST:PORT; expected a text such as 192.168.1.20:9000")
    return host.strip("[]") or "127.0.0.1", int(port)


def _texts(table: TomlTable, key: str) -> tuple[str, ...]:
    value = table.values[key]
    texts = (value,) if isinstance(value, str) else value
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) and text for text in texts):
        raise DataError(f"{table.where(key)}: is {value!r}; expected a text in quotes, or a list of texts")
    return tuple(texts)
