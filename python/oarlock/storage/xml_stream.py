"""`XmlStream`: reads an XML file in blocks, without entities and within limits; for readers of XML formats."""

from __future__ import annotations

from pathlib import Path
from xml.parsers import expat

from oarlock.storage.errors import DataError
from oarlock.storage.regular_file import TABLE_LIMIT_BYTES, open_regular, shown_bytes

_AT_ONCE_BYTES = 2**20
_DEEPEST = 32


class XmlStream:
    """Base of a reader, which defines `started`, `ended` and `text_found`.

    Args:
        file: what to read.
        kind: of file, for errors, such as "TCX file".
        most_bytes: larger files are refused.

    Attributes:
        path: names of the open elements without their namespaces, the outermost first.
    """

    def __init__(self, file: Path, kind: str, most_bytes: int = TABLE_LIMIT_BYTES) -> None:
        self.file = file
        self.path: list[str] = []
        self._kind, self._most_bytes, self._skipped_lines = kind, most_bytes, 0
        self._parser = expat.ParserCreate(namespace_separator="}")
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self.ended
        self._parser.CharacterDataHandler = self.text_found
        self._parser.EntityDeclHandler = self._entity

    @property
    def line(self) -> int:
        """Line that the parser has reached, from 1."""
        return self._parser.CurrentLineNumber + self._skipped_lines

    def read(self) -> None:
        """Read the whole file.

        Raises:
            DataError: it cannot be read, is too large, is no whole XML, declares entities, or the reader refuses it.
        """
        try:
            with open_regular(self.file) as stream:
                size = 0
                while block := stream.read(_AT_ONCE_BYTES):
                    size += len(block)
                    if size > self._most_bytes:
                        raise DataError(
                            f"{self.file}: has more than the {shown_bytes(self._most_bytes)} that are read"
                        )
                    self._parser.Parse(
                        self._without_leading_space(block) if size == len(block) else block, False
                    )
                self._parser.Parse(b"", True)
        except OSError as error:
            raise DataError(f"{self.file}: cannot be read ({error.strerror})") from error
        except (expat.ExpatError, LookupError, UnicodeError) as error:
            raise self.refused(f"is no whole XML ({error}). Was it cut off? Export it again.") from error

    def refused(self, text: str) -> DataError:
        """An error at the present line."""
        return DataError(f"{self.file}:{self.line}: {text}")

    def started(self, element: str, attributes: dict[str, str]) -> None:
        """An element begins; it is the last of `path`."""
        raise NotImplementedError

    def ended(self, name: str) -> None:
        """The last element of `path` ends; the reader takes it from there."""
        raise NotImplementedError

    def text_found(self, text: str) -> None:
        """A part of an element's text."""
        raise NotImplementedError

    def _without_leading_space(self, block: bytes) -> bytes:
        # expat takes no line breaks before the declaration; some apps write them
        stripped = block.lstrip()
        self._skipped_lines = block.count(b"\n", 0, len(block) - len(stripped))
        return stripped

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        element = name.rpartition("}")[2]
        self.path.append(element)
        if len(self.path) > _DEEPEST:
            raise self.refused(f"elements are nested more than {_DEEPEST} deep; this is no {self._kind}")
        self.started(element, attributes)

    def _entity(self, *_: object) -> None:
        raise self.refused(f"declares an entity, which no {self._kind} needs. It is not read.")
