"""Ctrl-C while the command starts, before a verb handles it: a line on stderr and exit status 130."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

EXIT_STOPPED: Final = 130


@contextmanager
def stopped_in_words() -> Iterator[None]:
    """Within it Ctrl-C ends the process with one line on stderr instead of a traceback."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stderr.write("error: stopped by Ctrl-C\n")
        sys.exit(EXIT_STOPPED)
