"""Reference of the command line: a page for each verb with the help of its commands, as the terminal shows it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from oarlock.cli import VERBS, load_verb

from .stage import write

WIDTH = 100


def write_pages(docs: Path) -> None:
    """Write an index, and a page for each verb."""
    folder = docs / "reference/commands"
    rows = [f"| [`oarlock {verb}`]({verb}.md) | {text} |" for verb, text in VERBS.items()]
    write(folder / "index.md", "\n".join(["# Commands\n", "| command | does |", "| --- | --- |", *rows]))
    for verb in VERBS:
        sections = [f"## {title}\n\n```text\n{text}\n```\n" for title, text in helps(verb)]
        write(folder / f"{verb}.md", f"# oarlock {verb}\n\n{VERBS[verb]}\n\n" + "\n".join(sections))


def helps(verb: str) -> Iterator[tuple[str, str]]:
    """Each command of a verb, and its help."""
    yield from _helps(load_verb(verb), f"oarlock {verb}")


def _helps(command: Any, path: str) -> Iterator[tuple[str, str]]:
    context = command.make_context(
        path, [], resilient_parsing=True, max_content_width=WIDTH, terminal_width=WIDTH
    )
    yield path, command.get_help(context).strip()
    for name, subcommand in sorted(getattr(command, "commands", {}).items()):
        yield from _helps(subcommand, f"{path} {name}")
