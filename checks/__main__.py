"""Runs every check, prints a line for each and what it found; the exit status is 1 if anything was found."""

import sys
from collections.abc import Callable

from checks import (
    arrows,
    budgets,
    engine_arrows,
    file_gate,
    inventory,
    links,
    names,
    portability,
    registered,
    rowing_words,
)

CHECKS: dict[str, Callable[[], list[str]]] = {
    "package arrows": arrows.findings,
    "engine arrows": engine_arrows.findings,
    "rowing words": rowing_words.findings,
    "opening of files": file_gate.findings,
    "file sizes": budgets.long_files,
    "budgets of rooms": budgets.findings,
    "file names": names.vague_names,
    "class names": names.classes_with_the_same_name,
    "machine paths": portability.machine_paths,
    "data folder": portability.data_folder,
    "registries": portability.registries,
    "pinned versions": portability.loose_pins,
    "engine test modules": registered.findings,
    "links of pages": links.findings,
    "inventory": inventory.findings,
}


def main() -> int:
    """Number of checks that found something, as an exit status."""
    failed = 0
    for name, check in CHECKS.items():
        findings = check()
        failed += bool(findings)
        print(f"{'FAILED' if findings else 'ok':6} {name}" + "".join(f"\n       {line}" for line in findings))
    print(f"{len(CHECKS) - failed} of {len(CHECKS)} checks passed")
    return int(failed > 0)


sys.exit(main())
