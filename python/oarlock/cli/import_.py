"""`oarlock import`: converts other formats to a recording folder: by content, or one verb per entry of `FORMATS`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from oarlock.cli.function_verbs import made_verb
from oarlock.cli.import_path import (
    PATH_OPTIONS,
    PATH_VERB,
    SESSION_OPTIONS,
    document,
    import_path,
    say_next,
    taken_session,
    write_summary,
    written,
)
from oarlock.cli.options import Force, Json, OutFolder, example, metavar_of
from oarlock.cli.terminal import print_json
from oarlock.formats.importers import FORMATS, ImportFormat


class FormatOrPath(TyperGroup):
    """Reads `oarlock import PATH ...` where the first word is no format."""

    def parse_args(self, context: Any, words: list[str]) -> list[str]:
        """Put the verb that recognises files before words that begin with none."""
        if words and words[0] not in self.commands and words[0] not in context.help_option_names:
            words = [PATH_VERB, *words]
        return super().parse_args(context, words)


group = typer.Typer(
    cls=FormatOrPath,
    no_args_is_help=True,
    rich_markup_mode=None,
    subcommand_metavar="PATH|FORMAT [ARGS]...",
    help="Convert files of other devices and programs to a recording. PATH, a file, a folder or a zip file, is "
    "recognised by its content; a format's name in front of it reads it as that format.",
)


def add_to(app: typer.Typer) -> None:
    """Registers the verbs."""
    app.add_typer(group, name="import")


def _reader(one: ImportFormat) -> Callable[..., None]:
    """The verb of a format. Typer takes the options from the signature."""

    def run(path: Path, out: Path, force: bool, json_output: bool, **options: Any) -> None:
        session = taken_session(options)
        recording = written(one.read(path, **options), session, out, force)
        if json_output:
            print_json(document(recording, path, out, one.title))
            return
        write_summary(recording, path, out, one.title)
        say_next(out, "MODEL")

    place = typer.Argument(metavar=one.place, help=one.contents)
    wanted: list[tuple[str, Any, Any]] = [("path", Annotated[Path, place], ...), ("out", OutFolder, ...)]
    wanted += [
        (o.name, Annotated[o.kind, typer.Option(metavar=metavar_of(o.name, o.kind), help=o.about)], o.default)
        for o in one.options
    ]
    wanted += [(name, kind, None) for name, kind in SESSION_OPTIONS]
    wanted += [("force", Force, False), ("json_output", Json, False)]
    return made_verb(run, wanted)


group.command(
    PATH_VERB,
    help="Recognise the recordings of a file, a folder or a zip file by their content, and convert them.",
    epilog=example(
        "oarlock import trial.csv",
        "oarlock import session.zip --all --out monday",
        "oarlock import measurements --pick trial_03 --out rec --athlete A07",
    ),
)(made_verb(import_path, PATH_OPTIONS))
for _format in FORMATS:
    group.command(_format.name, help=_format.summary, epilog=example(_format.command))(_reader(_format))
