"""Sections that a field of application, such as rowing, adds to the report before the general ones."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from oarlock.report.markup import rendered
from oarlock.storage.errors import DataError

_KEY = re.compile(r"[a-z][a-z0-9-]*")


class KeyFigure(NamedTuple):
    """A key figure as text: its name, the number with its unit, one remark, and what it means."""

    name: str
    value: str
    detail: str = ""
    meaning: str = ""


@dataclass(frozen=True)
class Section:
    """A section of the page, with its sentences for the summary.

    Attributes:
        key: prefix of its anchor and of all ids in it: small letters, digits and hyphens.
        name: its heading and its link at the top.
        markup: its content, HTML that is well-formed and whose ids begin with `key`.
        sentences: its sentences in the summary, after suspects; markup each.
        style: additional CSS rules.
        script: JavaScript without markup, run once after the page has loaded. The page must be readable without it.
        folded: only its heading is shown until the reader opens it, or follows a link to its content. A page stays
            short on a telephone if all but one or two are folded.
        notes: what to know about its data, such as what was left out; markup each, below "How it was measured".
    """

    key: str
    name: str
    markup: str
    sentences: tuple[str, ...] = ()
    style: str = ""
    script: str = ""
    folded: bool = False
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.key):
            raise DataError(
                f"section '{self.key}': a key has small letters, digits and hyphens and begins with a letter"
            )
        if "</script" in self.script.lower():
            raise DataError(f"section '{self.key}': its script contains '</script', which would end it")


def refuse_doubles(sections: Sequence[Section], taken: Sequence[str]) -> None:
    """Raises DataError if two sections, or a section and a part of the page, have the same key."""
    seen = set(taken)
    for section in sections:
        if section.key in seen:
            raise DataError(f"the page already has a section '{section.key}'; give another key")
        seen.add(section.key)


def tiles(figures: Sequence[KeyFigure]) -> str:
    """Key figures as markup."""
    return rendered("tiles", figures=figures)
