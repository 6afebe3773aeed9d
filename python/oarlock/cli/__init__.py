"""The `oarlock` command for users: the list of verbs. Each verb has its own file in this folder.

Exit status: 0 success, 1 a problem in the data, 2 wrong usage, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

import faulthandler
import io
import sys
from contextlib import suppress

from oarlock.cli.stopped import stopped_in_words

with stopped_in_words():  # half of the time before a verb starts
    from functools import cache
    from importlib import import_module
    from typing import Annotated, Any

    import typer
    from typer.core import TyperGroup
    from typer.main import get_group

VERBS = {
    "demo": "Track a simulated sculler and a real pendulum.",
    "run": "From files of a recording to angles and a report, in one command.",
    "live": "Track sensors while they send: record, estimate, show on a page.",
    "simulate": "Simulate a rower: write a recording and its ground truth.",
    "track": "Turn a recording into joint angles with uncertainty.",
    "evaluate": "Score a track against ground truth or optical markers.",
    "report": "Write a track's report.html.",
    "export": "Write a track as CSV, Parquet and OpenSim files.",
    "view": "Show a track as a moving figure with its curves.",
    "video": "Align a video with a track, by motion or by a clap.",
    "strokes": "Show strokes of a track, or of another device's export.",
    "crew": "Timing between the seats of one boat.",
    "season": "A squad's recordings, results and questions in one place.",
    "lab": "Compare estimators, sweep settings, and tools of the project's developers.",
    "import": "Convert other formats to a recording.",
    "assign": "Find which unit sits where, from movements in a known order.",
    "markers": "Optical markers: C3D, TRC, CSV.",
    "calibrate": "Calibrate mounts, joint centres, magnetic field and clocks.",
    "model": "Show, check and copy model files.",
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
    return get_group(verbs).commands[name]


START = """\
Oarlock: joint angles with uncertainty, from wearable and mounted sensors.

  oarlock demo                                a sculler and a real pendulum, in a minute

An arm, from a recording to angles
  oarlock simulate --model arm --stature 1.78 --mass 75 --out session
  oarlock run session --body arm --session session --stature 1.78 --mass 75 --out reach

A boat, from sensors to strokes
  oarlock simulate --field careful --rate-spm 24 --duration-s 60 --out piece
  oarlock track piece --model sculler --smooth --out tracked
  oarlock strokes tracked                     or `oarlock strokes FILE`: export of another device

A body of your own, from a text file
  oarlock model copy arm7 my.toml             then change it in any editor
  oarlock model check my.toml
  oarlock model show my.toml

Your own recording: oarlock run FILE --body arm --out reach
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
