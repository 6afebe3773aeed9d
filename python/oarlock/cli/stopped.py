"""Ctrl-C while the command starts, before a verb handles it: a line on stderr and exit status 130."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

EXIT_STOPPED: Final = 130


@contextmanager
def stopped_in_words() -> Iterator[None]:
    """Within it Ctrl-C ends the process with one line on stderr instead of a traceback.

    A command that could not do a part of its work, and said so, ends with status 1.
    """
    try:
        yield
    except SystemExit as ended:
        terminal = sys.modules.get("oarlock.cli.terminal")
        if not ended.code and terminal is not None and terminal.FAULTS:
            sys.exit(1)
        raise
    except KeyboardInterrupt:
        end_by_status()
        sys.stderr.write("error: stopped by Ctrl-C\n")
        sys.exit(EXIT_STOPPED)


def end_by_status() -> None:
    """After a Ctrl-C that was handled: let the process end with its status, not by the signal.

    CPython notes a Ctrl-C inside of `exec` of a text, as a dataclass does it, and ends by the signal however it was
    handled (`run_eval_code_obj` in pythonrun.c); the next `exec` of a text clears the note.
    """
    exec("")
