"""The command line: one file a verb. It reads files, calls the package, writes one folder, says what it did.

Exit status: 0 fine, 1 the data's fault, 2 usage, 130 stopped.
"""

from __future__ import annotations

from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_group

VERBS = {
    "demo": "Track a simulated sculler and a real pendulum.",
    "simulate": "Write a simulated rower's recording and its truth.",
    "track": "Turn a recording into joint angles with uncertainty.",
    "evaluate": "Score a track against truth, or against optical markers.",
    "compare": "Set estimators side by side on one recording.",
    "report": "Write a track's report.html.",
    "export": "Write a track as CSV, Parquet and OpenSim files.",
    "view": "Show a track as a moving figure beside its curves.",
    "reproduce": "Run the paper's tables and figures again, ours beside them.",
    "strokes": "Show strokes of a track, or of another device's export.",
    "study": "Sweep sensors, noise, mounts, rates or settings over seeds.",
    "bench": "Measure what this machine reaches, beside other software.",
    "import": "Turn other formats into a recording.",
    "markers": "Optical markers: C3D, TRC, CSV.",
    "calibrate": "Find mounts, joint centres, the magnetic field and clock errors.",
    "model": "Look at, check and start model files.",
}
"""All verbs with one line of help. `cli/NAME.py` defines a verb; it is imported when the verb is used."""
MODULES = {"import": "import_"}


class LazyVerbs(TyperGroup):
    """Lists all verbs, and imports the module of the one that is used."""

    def resolve_command(self, *args: Any) -> tuple[Any, Any, list[str]]:
        """The name, the command and what follows it on the command line."""
        name, command, rest = super().resolve_command(*args)
        return name, command and load_verb(command.name or ""), rest


def load_verb(name: str) -> Any:
    """Import the module of a verb and build its command."""
    verbs = typer.Typer(rich_markup_mode=None)
    import_module(f"oarlock.cli.{MODULES.get(name, name)}").add_to(verbs)
    return get_group(verbs).commands[name]


# plain help: examples keep their lines, and it reads the same in a file, a pager and a narrow window
app = typer.Typer(
    name="oarlock",
    cls=LazyVerbs,
    no_args_is_help=True,
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


@app.callback(
    epilog="\b\nStart here:\n"
    "  oarlock demo                        a sculler and a real pendulum, tracked in a minute\n"
    "  oarlock model show sculler          what a model holds\n"
    "  oarlock track trial --model sculler --out out"
)
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Track articulated bodies from wearable and mounted sensors, with uncertainty."""


def _unused() -> None:
    """Stands for a verb until it is used."""


for _name, _short_help in VERBS.items():
    app.command(_name, short_help=_short_help)(_unused)


def main() -> None:
    """Entry point of the `oarlock` command."""
    app(prog_name="oarlock")


__all__ = ["app", "main"]
