"""Every command that a page or a text of the package names exists, with the options that it names."""

import re
from pathlib import Path
from typing import Any

import pytest

from oarlock.cli import VERBS, load_verb

ROOT = Path(__file__).parents[1]
WHERE = ("README.md", "docs/**/*.md", "python/oarlock/**/*.py", "lab/**/*.py")
TEXTS = sorted(path for pattern in WHERE for path in ROOT.glob(pattern))
COMMAND = re.compile(r"`oarlock ([a-z][^`\n]*)`|^ *(?:\$ )?oarlock ([a-z][^\n`]*)$", re.M)
END = {"|", "||", ">", "#", "&&", r"\|\|"}


def commands() -> list[tuple[str, str]]:
    """Text after `oarlock`, and the file that names it. Strings of Python that follow each other are one."""
    named: dict[str, str] = {}
    for file in TEXTS:
        for found in COMMAND.finditer(re.sub(r'"\s*\n\s*f?"', "", file.read_text("utf-8"))):
            named.setdefault(found[1] or found[2], str(file.relative_to(ROOT)))
    return sorted(named.items())


def options(command: Any) -> set[str]:
    """Of a verb, or of all in a group."""
    below = getattr(command, "commands", {}).values()
    own = {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
    return own.union({"--help"}, *map(options, below))


def mistake(words: list[str]) -> str | None:
    if words[0] not in VERBS:
        return f"no verb {words[0]}"
    command, rest = load_verb(words[0]), words[1:]
    while rest and rest[0] in getattr(command, "commands", {}):
        command, rest = command.commands[rest[0]], rest[1:]
    end = next((k for k, word in enumerate(rest) if word in END), len(rest))
    named = (re.match("--[a-z][a-z0-9-]*", word) for word in rest[:end])
    return next((f"no option {o[0]}" for o in named if o and o[0] not in options(command)), None)


def test_commands_that_are_named_exist() -> None:
    wrong = {f"{file}: {text}": why for text, file in commands() if (why := mistake(text.split()))}
    assert not wrong


@pytest.mark.parametrize(
    ("text", "why"), [("tracc rec", "no verb tracc"), ("evaluate out --markers m.c3d", "no option --markers")]
)
def test_what_does_not_exist_is_a_mistake(text: str, why: str) -> None:
    assert len(commands()) > 250
    assert mistake(text.split()) == why
