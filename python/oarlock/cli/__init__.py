"""The command line: one file a verb. It reads files, calls the package, writes one folder, says what it did.

Exit status: 0 fine, 1 the data's fault, 2 usage, 130 stopped.
"""

from __future__ import annotations

from typing import Annotated

import typer

from oarlock.cli import (
    bench,
    calibrate,
    compare,
    demo,
    evaluate,
    import_,
    markers,
    model,
    report,
    reproduce,
    simulate,
    study,
    track,
    view,
)

# plain help: examples keep their lines, and it reads the same in a file, a pager and a narrow window
app = typer.Typer(
    name="oarlock",
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


demo.add_to(app)
simulate.add_to(app)
import_.add_to(app)
markers.add_to(app)
calibrate.add_to(app)
track.add_to(app)
evaluate.add_to(app)
compare.add_to(app)
report.add_to(app)
view.add_to(app)
reproduce.add_to(app)
study.add_to(app)
model.add_to(app)
bench.add_to(app)


def main() -> None:
    """Entry point of the `oarlock` command."""
    app(prog_name="oarlock")


__all__ = ["app", "main"]
