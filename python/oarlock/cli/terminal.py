"""Terminal output of all verbs: tables, progress, JSON documents, errors, output folders."""

from __future__ import annotations

import dataclasses
import functools
import json
import logging
import math
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Final, NoReturn, ParamSpec, TypeVar

import typer
from rich import box
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from oarlock.cli.stopped import EXIT_STOPPED, end_by_status
from oarlock.storage.extras import missing

WIDTH: Final = 100
EXIT_DATA: Final = 1
EXIT_USAGE: Final = 2
EXIT_PIPE: Final = 141
TRACEBACK_VARIABLE: Final = "OARLOCK_TRACEBACK"

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
Told = Callable[[float], None]


class UsageError(Exception):
    """The command line is wrong: a missing, unknown or contradictory argument."""


# --- what is printed ----------------------------------------------------------------------------------


def page(stderr: bool = False) -> Console:
    """A console of at most 100 columns. It is new on each call, so that it follows a redirected stream."""
    console = Console(stderr=stderr, highlight=False, soft_wrap=False)
    console.width = min(WIDTH, console.width) if console.is_terminal else WIDTH
    return console


def say(text: str = "", style: str = "", indent: int = 0) -> None:
    """Prints a text without markup; further lines are indented like the first."""
    _print_trimmed(Padding(Text(text, style=style), (0, 0, 0, indent)))


def heading(text: str, remark: str = "") -> None:
    """Prints a blank line, then a bold heading with an optional remark."""
    say()
    _print_trimmed(Text.assemble((text, "bold"), (f"   {remark}" if remark else "", "dim")))


QUIET, NORMAL, VERBOSE = range(3)
_VERBOSITY = ContextVar("verbosity", default=NORMAL)


def set_verbosity(level: int) -> None:
    """`QUIET`: errors, and JSON if it is asked for; `NORMAL`: results; `VERBOSE`: what is printed in `details`, too."""
    _VERBOSITY.set(level)
    LOG_HANDLER.setLevel({QUIET: logging.ERROR, NORMAL: logging.WARNING, VERBOSE: logging.INFO}[level])


@contextmanager
def details() -> Iterator[None]:
    """Within it text is printed only with --verbose."""
    token = _VERBOSITY.set(NORMAL if _VERBOSITY.get() == VERBOSE else QUIET)
    try:
        yield
    finally:
        _VERBOSITY.reset(token)


def steps(*lines: str) -> None:
    """Prints the suggested next commands, one a line, however long: a command that is broken cannot be copied."""
    if _VERBOSITY.get() == QUIET:
        return
    heading("Next")
    for line in lines:
        page().print(Text(f"  {line}"), soft_wrap=True)


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], indent: int = 2) -> None:
    """Prints rows under a header; a column whose header starts with `>` is aligned right.

    Columns that are empty in every row are left out.
    """
    grid = Table(
        box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="dim", padding=(0, 1, 0, 0)
    )
    kept = [k for k in range(len(columns)) if any(str(row[k]) for row in rows)]
    for k in kept:
        right = columns[k].startswith(">")
        last = k == kept[-1] and not right
        grid.add_column(
            columns[k].removeprefix(">"),
            justify="right" if right else "left",
            no_wrap=not last and k != kept[0],  # Text that does not fit is never cut: labels wrap first.
            overflow="fold",
        )
    for row in rows:
        grid.add_row(*(cell if isinstance(cell := row[k], Text) else Text(str(cell)) for k in kept))
    _print_trimmed(Padding(grid, (0, 0, 0, indent)))


def number(value: float | None, style: str, none: str = "-") -> str:
    """A number in a format such as `.3f`; `none` where there is no number."""
    return none if value is None or not math.isfinite(value) else format(value, style)


def pairs(rows: Sequence[tuple[str, object]]) -> None:
    """Prints `name  value` lines, aligned; an empty value is left out."""
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim", no_wrap=True)
    grid.add_column(overflow="fold")
    for name, value in rows:
        if str(value):
            grid.add_row(name, Text(str(value)))
    _print_trimmed(grid)


_STATES: Final = {"ok": "green", "note": "yellow", "problem": "bold red"}


def checklist(rows: Sequence[tuple[str, str, str, Sequence[str]]]) -> None:
    """Prints findings: `ok`, `note` or `problem`, what was looked at, the finding, and below it what to try."""
    grid = Table.grid(padding=(0, 2, 0, 0))
    for _ in range(2):
        grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for state, about, text, tries in rows:
        grid.add_row(Text(state, style=_STATES[state]), Text(about, style="dim"), Text(text))
        for one in tries:
            grid.add_row("", "", Text(f"-> {one}"))
    _print_trimmed(Padding(grid, (0, 0, 0, 2)))


def _print_trimmed(what: RenderableType) -> None:
    # Tables and wrapped lines end in spaces, which are removed.
    if _VERBOSITY.get() == QUIET:
        return
    console = page()
    with console.capture() as capture:
        console.print(what)
    console.file.write("".join(f"{line.rstrip()}\n" for line in capture.get().splitlines()))
    console.file.flush()


def print_json(document: object) -> None:
    """Prints one JSON document on stdout; NaN and infinity become null."""
    sys.stdout.write(json.dumps(json_ready(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def json_ready(value: object) -> Any:
    """Convert a value to dictionaries, lists, texts, finite numbers and None."""
    if hasattr(value, "tolist"):  # of numpy, which help does not import
        return json_ready(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "to_dict"):
        return json_ready(value.to_dict())
    if isinstance(value, Mapping):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [json_ready(item) for item in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: json_ready(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


# --- progress -----------------------------------------------------------------------------------------


def progress(text: str) -> AbstractContextManager[Told]:
    """Progress on stderr; the block calls it with the completed share, 0 to 1.

    A bar on a terminal; elsewhere a line after some seconds, then one at intervals.
    """
    from oarlock.storage.progress import display

    return display(text)


# --- errors -------------------------------------------------------------------------------------------


def verb(function: Callable[Parameters, Result], continues: bool = False) -> Callable[Parameters, Result]:
    """Wraps a verb: its errors become one block on stderr and an exit status, not a traceback.

    Status 1: a problem in the data. 2: wrong usage. 130: stopped by Ctrl-C. With `--json` the error is also the
    document on stdout.

    Args:
        function: the verb.
        continues: what is finished is kept when it is stopped, and it continues there.
    """
    kept = "nothing unfinished is in the output folders"
    if continues:
        kept = "what is finished is kept; the same command continues from there"

    @functools.wraps(function)
    def run(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        as_json = bool(kwargs.get("json_output", False))
        try:
            return function(*args, **kwargs)
        except (typer.Exit, typer.Abort, typer.BadParameter):
            raise
        except UsageError as error:
            fail("usage", str(error), EXIT_USAGE, as_json)
        except KeyboardInterrupt:
            end_by_status()
            fail("stopped", f"stopped by Ctrl-C; {kept}", EXIT_STOPPED, as_json)
        except BrokenPipeError:
            # The reader of the pipe (such as `head`) has closed it. Without this Python prints a second error at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(EXIT_PIPE) from None
        except ModuleNotFoundError as error:
            text = missing(error, "this command")
            fail("fault" if text is None else "data", text or _fault(error), EXIT_DATA, as_json)
        except OSError as error:
            fail("file", _sentence(error), EXIT_DATA, as_json)
        except Exception as error:
            # Only these are about what the user gave.
            if kind := _kind(error):
                fail(kind, str(error) or type(error).__name__, EXIT_DATA, as_json)
            if os.environ.get(TRACEBACK_VARIABLE):
                traceback.print_exc()
            fail("fault", _fault(error), EXIT_DATA, as_json)

    return run


def fail(kind: str, message: str, status: int, as_json: bool) -> NoReturn:
    """Prints the error and exits."""
    if as_json:
        print_json({"error": {"kind": kind, "message": message}})
    write_error(message)
    raise typer.Exit(status)


def write_error(message: str) -> None:
    """Prints an error on stderr; further lines are indented."""
    first, *rest = message.strip().splitlines() or ["(no message)"]
    console = page(stderr=True)
    console.print(Text.assemble(("error: ", "bold red"), first), soft_wrap=True)
    for line in rest:
        console.print(Text(f"  {line.strip()}"), soft_wrap=True)


KINDS = {"ModelError": "model", "DataError": "data", "DivergedError": "diverged"}
"""Kinds of errors about what a user gave, by the name of their class."""


def _kind(error: Exception) -> str:
    """Empty for a fault of the program, such as a matrix that cannot be inverted (a ValueError, too)."""
    if type(error) is ValueError:
        return "data"
    return next((KINDS[own.__name__] for own in type(error).__mro__ if own.__name__ in KINDS), "")


def _sentence(error: OSError) -> str:
    if error.strerror and error.filename:
        return f"{error.filename}: {error.strerror.lower()}"
    return str(error) or type(error).__name__


FAULTS: list[str] = []
"""What could not be done while a command went on: it ends with status 1."""


class _TerminalLog(logging.Handler):
    """Prints records of the package on stderr. An error is something that could not be done while a command goes on."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print it; an error counts as a fault."""
        text, error = record.getMessage(), record.exc_info[1] if record.exc_info else None
        if record.levelno >= logging.ERROR:
            FAULTS.append(text)
        if error is not None and os.environ.get(TRACEBACK_VARIABLE):
            traceback.print_exception(error)
        cause = f": {_fault(error)}" if isinstance(error, Exception) else ""
        page(stderr=True).print(Text(f"{record.levelname.lower()}: {text}{cause}"), soft_wrap=True)


LOG_HANDLER: Final = _TerminalLog(logging.WARNING)
logging.getLogger("oarlock").addHandler(LOG_HANDLER)
logging.getLogger("oarlock").setLevel(logging.INFO)


def _fault(error: Exception) -> str:
    return (
        f"a fault in oarlock itself: {type(error).__name__}: {error}\n"
        f"Set {TRACEBACK_VARIABLE}=1 and run again for the traceback; please report it with that text."
    )


def asks_questions(no_questions: bool, json_output: bool) -> bool:
    """Whether a person sits at the terminal."""
    return not (no_questions or json_output) and sys.stdin.isatty() and sys.stdout.isatty()


# --- files and folders --------------------------------------------------------------------------------


def free_file(file: Path, force: bool) -> None:
    """Check that a file can be written: nothing is there, or what Oarlock wrote into a folder of its own.

    Raises:
        UsageError: something else is there, and `force` is not set; or it is a folder or a device.
        DataError: its folder cannot be written or made.
    """
    from oarlock.storage.errors import DataError
    from oarlock.storage.folder_writer import read_manifest
    from oarlock.storage.write_file import check_writable

    try:
        read_manifest(file.parent).check_free(file.name, force)
    except DataError as error:
        raise UsageError(str(error)) from None
    check_writable(file.parent)


@contextmanager
def output_folder(folder: Path, kind: str, force: bool, beside: str = "") -> Iterator[Path]:
    """Context that gives the folder to write into; at its end its files are in `folder`, and never a part of them.

    Args:
        folder: as the user named it.
        kind: what it will hold, as its manifest says.
        force: write into a folder that has files, and replace files of the same names.
        beside: name of a file that does not count.

    Raises:
        UsageError: it contains files, and `force` is not set.
        DataError: another run is writing into it.
    """
    from oarlock.storage.folder_writer import replaced_folder

    check_folder(folder, force, beside)
    with replaced_folder(folder, kind, force) as stage:
        yield stage


def check_folder(folder: Path, force: bool, beside: str = "") -> None:
    """Check that a folder can be written.

    Raises:
        UsageError: it contains files, but for `beside`, and `force` is not set; or it is a file.
    """
    from oarlock.storage.errors import DataError
    from oarlock.storage.write_file import check_empty

    try:
        check_empty(folder, force, beside)
    except DataError as error:
        raise UsageError(str(error)) from None
