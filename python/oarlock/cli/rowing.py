"""`oarlock rowing`: strokes of a track or of another device's export, and the timing of a crew."""

from __future__ import annotations

import typer

from oarlock.cli import crew, strokes


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    group = typer.Typer(
        no_args_is_help=True,
        rich_markup_mode=None,
        help="Strokes of a track, or of another device's export; timing between the seats of one boat.",
    )
    strokes.add_to(group)
    crew.add_to(group)
    app.add_typer(group, name="rowing")
