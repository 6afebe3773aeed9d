"""`oarlock lab`: comparisons and studies of estimators, and the verbs of oarlock-lab if that is installed.

oarlock-lab has the project's own tools: the reproduction of the paper, benchmarks, emulated devices, synthetic seasons.
It registers its verbs as entry points of the group `oarlock.verbs`; each is a function that adds a verb to a typer.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any, Final

import typer
from typer.core import TyperGroup

from oarlock.cli import compare, study

IN_OARLOCK_LAB: Final = ("bench", "emulate", "reproduce", "season")


class LabVerbs(TyperGroup):
    """Says how to install a verb of oarlock-lab that is missing."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[Any, Any, list[str]]:
        """Return the name of the verb, its command and the remaining arguments."""
        if args[0] in IN_OARLOCK_LAB and args[0] not in self.commands:
            ctx.fail(
                f"`oarlock lab {args[0]}` comes with oarlock-lab, which is not installed here. "
                "Try `pip install oarlock-lab`, or `make demo` in a clone of the project."
            )
        return super().resolve_command(ctx, args)


group = typer.Typer(
    cls=LabVerbs,
    no_args_is_help=True,
    rich_markup_mode=None,
    help=f"Compare estimators, sweep settings. `pip install oarlock-lab` adds {', '.join(IN_OARLOCK_LAB)}.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    compare.add_to(group)
    study.add_to(group)
    for verb in entry_points(group="oarlock.verbs"):
        verb.load()(group)
    app.add_typer(group, name="lab")
