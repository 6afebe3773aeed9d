"""The `oarlock` command for users: the list of verbs. Each verb has its own file in this folder.

Exit status: 0 success, 1 a problem in the data, 2 wrong usage, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

import faulthandler
import io
import sys
from collections.abc import Callable
from contextlib import suppress

from oarlock.cli.stopped import stopped_in_words

with stopped_in_words():  # half of the time before a verb starts
    from functools import cache
    from importlib import import_module
    from typing import Annotated, Any

    import typer
    from typer.core import TyperGroup
    from typer.main import get_command, get_group

VERBS = {
    "demo": "Track a simulated sculler and a real pendulum.",
    "run": "From files of a recording to angles and a report, in one command.",
    "import": "Convert other formats to a recording.",
    "calibrate": "Calibrate mounts, lengths, magnetic field and clocks; which unit sits where.",
    "track": "Turn a recording into joint angles with uncertainty.",
    "evaluate": "Score a track against ground truth or optical markers.",
    "report": "Write a track's report.html.",
    "view": "Show a track as a moving figure with its curves.",
    "export": "Write a track as CSV, Parquet and OpenSim files.",
    "model": "Show, check and copy model files.",
    "simulate": "Simulate a rower, or any body's calibration session, with its ground truth.",
    "live": "Track sensors while they send: record, estimate, show on a page.",
    "rowing": "Strokes of a track or of another device's export; timing of a crew.",
    "season": "A squad's recordings, results and questions in one place.",
    "markers": "Optical markers: C3D, TRC, CSV.",
    "lab": "Compare estimators, sweep settings, and tools of the project's developers.",
}
"""All verbs with one line of help. `cli/NAME.py` defines a verb and is imported only when the verb is used."""
MODULES = {"import": "import_"}


class LazyVerbs(TyperGroup):
    """Lists all verbs, but imports only the module of the verb in use."""

    # Typer would end without a word on Ctrl-C.

    def make_context(self, *args: Any, **kwargs: Any) -> Any:
        """Read the command line."""
        with stopped_in_words():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:
        """Import and run the verb."""
        with stopped_in_words():
            return super().invoke(ctx)

    def resolve_command(self, *args: Any) -> tuple[Any, Any, list[str]]:
        """Return the name of the verb, its command and the remaining arguments."""
        name, command, rest = super().resolve_command(*args)
        return name, command and load_verb(command.name or ""), rest


@cache
def load_verb(name: str) -> Any:
    """Import the module of a verb and build its command, once: typer takes a fifth of a second for those of seasons."""
    verbs = typer.Typer(rich_markup_mode=None)
    import_module(f"oarlock.cli.{MODULES.get(name, name)}").add_to(verbs)
    command = get_group(verbs).commands[name]
    _add_verbosity(command)
    return command


def _add_verbosity(command: Any) -> None:
    """`--quiet` and `--verbose` for a verb, or for all of a group."""
    for inner in getattr(command, "commands", {}).values():
        _add_verbosity(inner)
    if not hasattr(command, "commands"):
        command.params += _verbosity_options()


@cache
def _verbosity_options() -> list[Any]:
    def level(number: int) -> Callable[[bool], None]:
        def chosen(given: bool) -> None:
            if given:
                from oarlock.cli.terminal import set_verbosity

                set_verbosity(number)

        return chosen

    quiet = typer.Option(
        "--quiet", help="Print errors only, and JSON if asked for.", callback=level(0), expose_value=False
    )
    verbose = typer.Option(
        "--verbose", help="Also print notes, sensors and next steps.", callback=level(2), expose_value=False
    )

    def options(quiet: bool = False, verbose: bool = False) -> None:
        """Typer makes options of a signature."""

    options.__annotations__ = {"quiet": Annotated[bool, quiet], "verbose": Annotated[bool, verbose]}
    owner = typer.Typer()
    owner.command()(options)
    return [option for option in get_command(owner).params if option.name in ("quiet", "verbose")]


START = """\
Oarlock: joint angles with uncertainty, from wearable and mounted sensors.

  oarlock demo                                a sculler and a real pendulum, in a minute

An arm, from a recording to angles
  oarlock simulate --model arm --stature-m 1.78 --mass-kg 75 --out session
  oarlock run session --model arm --session session --stature-m 1.78 --mass-kg 75 --out reach

A boat, from sensors to strokes
  oarlock simulate --field careful --rate-spm 24 --duration-s 60 --out piece
  oarlock track piece --model sculler --smooth --out tracked
  oarlock rowing strokes tracked              or FILE, an export of another device

A body of your own, from a text file
  oarlock model copy arm7 my.toml             then change it in any editor
  oarlock model check my.toml
  oarlock model show my.toml

Your own recording: oarlock run FILE --model arm --out reach
All commands: oarlock --help
"""
"""What `oarlock` alone prints: three ways to a first result."""

# Plain help text keeps the line breaks of examples in files, pagers and narrow windows.
app = typer.Typer(
    name="oarlock",
    cls=LazyVerbs,
    invoke_without_command=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(asked: bool) -> None:
    if asked:
        from oarlock import __version__

        typer.echo(f"oarlock {__version__}")
        raise typer.Exit


@app.callback(epilog="\b\n`oarlock` alone shows how to begin.")
def root(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Track articulated bodies from wearable and mounted sensors, with uncertainty."""
    if terminal := sys.modules.get("oarlock.cli.terminal"):
        terminal.set_verbosity(terminal.NORMAL)
    if context.invoked_subcommand is None:
        typer.echo(START, nl=False)


def _unused() -> None:
    """Placeholder for a verb until it is used."""


for _name, _short_help in VERBS.items():
    app.command(_name, short_help=_short_help)(_unused)


def main() -> None:
    """Entry point of the `oarlock` command."""
    with suppress(AttributeError, RuntimeError, OSError, ValueError):  # stderr is no file, or there is none
        faulthandler.enable()  # a crash of compiled code prints where it was
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A terminal of another encoding shows escapes where it lacks a character.
            stream.reconfigure(errors="backslashreplace")
    with stopped_in_words():
        app(prog_name="oarlock")


__all__ = ["app", "main"]
