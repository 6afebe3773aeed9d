"""A part of the page that somebody else wrote: a field's own tables and drawings, before those of any body."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from oarlock.report.markup import rendered
from oarlock.storage.errors import DataError

_KEY = re.compile(r"[a-z][a-z0-9-]*")


class KeyFigure(NamedTuple):
    """A number that people look for first, as text: what it is, the number with its unit, one thing to know of it."""

    name: str
    value: str
    detail: str = ""


@dataclass(frozen=True)
class Section:
    """A part of the page with what it adds above the first heading.

    Attributes:
        key: of its anchor and of everything in it that needs an id: small letters, digits and hyphens.
        name: its heading and its link at the top.
        markup: its content, HTML that is well-formed and whose ids begin with `key`.
        sentences: what it has to say first, markup each; they stand in the summary, after suspects.
        figures: shown large, below the summary.
        style: rules of its own for the page's style sheet.
        script: JavaScript without markup, run once when the page has been read. The page has to be readable without.
        folded: it shows its heading alone until somebody opens it. Links to what is inside do.
    """

    key: str
    name: str
    markup: str
    sentences: tuple[str, ...] = ()
    figures: tuple[KeyFigure, ...] = ()
    style: str = ""
    script: str = ""
    folded: bool = False

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.key):
            raise DataError(
                f"section '{self.key}': a key has small letters, digits and hyphens and begins with a letter"
            )
        if "</script" in self.script.lower():
            raise DataError(f"section '{self.key}': its script holds '</script', which would end it")


def refuse_doubles(sections: Sequence[Section], taken: Sequence[str]) -> None:
    """Raises DataError where two sections, or one and a part of the page, have one key."""
    seen = set(taken)
    for section in sections:
        if section.key in seen:
            raise DataError(f"the page already has a section '{section.key}'; give another key")
        seen.add(section.key)


def tiles(figures: Sequence[KeyFigure]) -> str:
    """Key figures as markup."""
    return rendered("tiles", figures=figures)
