"""Sections of a page between two marks, and tables in Markdown; for the pages and for `bench`."""

from __future__ import annotations

from collections.abc import Sequence


def marks(name: str = "figures") -> tuple[str, str]:
    """The lines between which a section stands."""
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def section(page: str, name: str = "figures") -> str:
    """What stands between the marks.

    Raises:
        ValueError: the page has no place for it.
    """
    begin, end = marks(name)
    if page.count(begin) != 1 or page.count(end) != 1:
        raise ValueError(f"the page needs one line {begin} and one line {end}")
    return page.split(begin)[1].split(end)[0].strip("\n")


def into_page(page: str, text: str, name: str = "figures") -> str:
    """The page with a section replaced.

    Raises:
        ValueError: the page has no place for it.
    """
    section(page, name)
    begin, end = marks(name)
    return page.split(begin)[0] + f"{begin}\n\n{text.strip()}\n\n{end}" + page.split(end)[1]


def table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [list(columns), ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
