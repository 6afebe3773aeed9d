"""Checks names that come from outside, and gives streams file names that differ wherever the names do."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

from oarlock.storage.errors import DataError

LONGEST_NAME = 80
"""Characters. Names become columns, file names and labels of pages; the longest of the shipped models has 24."""
_LONGEST_STEM = 120
_ESCAPED = re.compile(r"[^A-Za-z0-9_.-]")
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)


def check_name(name: str, where: str) -> None:
    """Refuse a name that is too long, or that no file and no page can contain.

    Args:
        name: the name.
        where: what has the name, for the error, such as "stream".

    Raises:
        DataError: it has more than `LONGEST_NAME` characters, or a lone surrogate.
    """
    if len(name) > LONGEST_NAME:
        raise DataError(
            f'{where} "{name[:24]}...": the name has {len(name)} characters; at most {LONGEST_NAME} are allowed. '
            "Choose a shorter name."
        )
    check_text(name, f"{where}, name")


def check_text(text: str, where: str) -> None:
    """Refuse a lone surrogate, which is no character: UTF-8, and so no file, can contain it.

    Raises:
        DataError: the text contains one; names its place.
    """
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise DataError(
            f"{where}: {text[:40]!a} contains half of a character (a lone surrogate) at place {error.start}, "
            "which no file can store. Read the text with its right encoding, or remove it."
        ) from None


def numbered(names: Iterable[str], joint: str = "_", taken: Iterable[str] = ()) -> list[str]:
    """The names, the second and later ones of each with a number behind the joint, and none of those taken."""
    used, last = set(taken), Counter[str]()
    found = []
    for name in names:
        one = name
        while one in used:
            last[name] += 1
            one = f"{name[: LONGEST_NAME - 6]}{joint}{last[name] + 1}"
        used.add(one)
        found.append(one)
    return found


def file_names(names: Sequence[str], suffix: str) -> list[str]:
    """One file name for each name, in order.

    Letters, digits, `_`, `-` and `.` stay; each byte of other characters becomes %XX, as in an address. So different
    names have different files on every file system. Names that differ only in capitals get a number after `~`, which
    no name contains unescaped.
    """
    taken: set[str] = set()
    found = []
    for name in names:
        stem = plain = _escaped(name)[:_LONGEST_STEM]
        number = 1
        while stem.casefold() in taken:
            number += 1
            stem = f"{plain}~{number}"
        taken.add(stem.casefold())
        found.append(f"{stem}.{suffix}")
    return found


def _escaped(name: str) -> str:
    plain = _ESCAPED.sub(lambda found: "".join(f"%{byte:02X}" for byte in found[0].encode()), name)
    # A leading point hides the file; the reserved names are devices on Windows.
    return (
        f"%{ord(plain[0]):02X}{plain[1:]}" if plain.startswith(".") or _RESERVED.fullmatch(plain) else plain
    )
