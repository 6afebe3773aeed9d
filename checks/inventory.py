"""All that a user could use at commit 307200ae has an answer in `inventory.toml`: the same, its new name, or a reason.

A line is NAME = ANSWER. The answer is "same"; "new", for what came since; { now = "NAME" } for a new name in the same
table, { now = "TABLE: NAME" } in another; or { gone = "A sentence that says why." }, which may name one of [reasons].
A list stands for parts of NAME that are the same, { new = [...] } for parts that came since. A changed part has a line
of its own, such as "track --model". If a verb is renamed, its options are looked up below its new name.
"""

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from checks.project_files import ROOT, text_of
from checks.public_surface import surface, texts

INVENTORY = ROOT / "checks/inventory.toml"
OWNERS = {"options": "verbs", "members": "python", "values": "settings"}
"""The table whose lines say how the owners of these parts are called now."""
TEXTS = ("headings", "notes", "events")
"""Tables whose names are pieces of text in the sources; what is added to them needs no line."""
REASON = re.compile(r"[A-Z`]\S*( \S+){3,}\.")

Tables = Mapping[str, Mapping[str, Any]]


def findings(inventory: Path = INVENTORY) -> list[str]:
    """Lines that are not true of the present package, and what it has beyond them."""
    tables = tomllib.loads(text_of(inventory))
    try:
        names = surface()
    except (ImportError, AttributeError, LookupError) as error:
        return [f"nothing was compared; run `make`, or correct checks/public_surface.py: {error}"]
    return differences(tables, names, texts())


def differences(tables: Tables, names: Mapping[str, Collection[str]], text: str) -> list[str]:
    """The same for tables of an inventory, the present names by table, and the text of all sources."""
    comparison = _Comparison(tables, names, text)
    lines = [line for table in tables if table != "reasons" for line in comparison.of(table)]
    for table in names:
        beyond = sorted(set(names[table]) - comparison.coverage.get(table, set()))
        lines += [f'{table}: "{name}" has no line; add "{name}" = "new"' for name in beyond]
    return lines


@dataclass
class _Comparison:
    """Compares tables with the present names; `coverage` has the names that lines account for, by table."""

    tables: Tables
    names: Mapping[str, Collection[str]]
    text: str
    coverage: dict[str, set[str]] = field(default_factory=dict)

    def of(self, table: str) -> Iterator[str]:
        """Lines of a table that are not true."""
        if table not in self.names and table not in TEXTS:
            yield f"{table}: no such table; see surface() in checks/public_surface.py"
            return
        for name, answer in self.tables[table].items():
            match answer:
                case "same" | "new":
                    yield from self._present((table, name), table, name)
                case list() as parts:
                    yield from self._parts(table, name, parts)
                case {"new": list() as parts, **rest} if not rest:
                    yield from self._parts(table, name, parts)
                case {"now": str() as now, **rest} if not rest:
                    place, _, present = now.rpartition(": ")
                    yield from self._present((table, name), place or table, present)
                case {"gone": str() as reason, **rest} if not rest:
                    if not REASON.fullmatch(self.tables.get("reasons", {}).get(reason, reason)):
                        yield f'{table}: "{name}" is gone without a reason; write a sentence'
                    if self._is_there(table, name):
                        yield f'{table}: "{name}" is said to be gone and is there'
                case _:
                    yield f'{table}: "{name}" has no answer: expected "same", "new", now, gone or a list'

    def _parts(self, table: str, owner: str, parts: list[str]) -> Iterator[str]:
        """Parts of an owner under its present name; those of an owner that is gone are gone with it."""
        answer = self.tables.get(OWNERS.get(table, ""), {}).get(owner, "same")
        answer = answer if isinstance(answer, dict) else {}
        if "gone" not in answer:
            for part in parts:
                yield from self._present(
                    (table, f"{owner} {part}"), table, f"{answer.get('now', owner)} {part}"
                )

    def _present(self, line: tuple[str, str], table: str, name: str) -> Iterator[str]:
        """Covers the name for a line, and says if it is not there."""
        self.coverage.setdefault(table, set()).add(name)
        if not self._is_there(table, name):
            present = "" if (table, name) == line else f', now {table}: "{name}",'
            yield f'{line[0]}: "{line[1]}"{present} is not there; write {{ now = "NAME" }} or {{ gone = "Why." }}'

    def _is_there(self, table: str, name: str) -> bool:
        return name in self.text if table in TEXTS else name in self.names.get(table, ())
