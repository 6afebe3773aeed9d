"""Processor time until Python has imported the package, and until the command line has answered."""

from __future__ import annotations

import os
import subprocess
import sys

COMMANDS = {
    "import oarlock": ("-c", "import oarlock"),
    "oarlock --version": ("-m", "oarlock", "--version"),
    "oarlock track --help": ("-m", "oarlock", "track", "--help"),
}


def startups(repeats: int = 5) -> dict[str, float]:
    """Processor time of each, s, with Python's own start: the least of some processes."""
    return {name: min(_processor_s(*command) for _ in range(repeats)) for name, command in COMMANDS.items()}


def _processor_s(*arguments: str) -> float:
    before = os.times()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system
