"""Harm to files, as hypothesis draws and shrinks it: what a hand, a bad disk or a bad merge does."""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from fuzz_campaign import EXAMPLES, answered, campaign

Wound = tuple[str, float, float, str]

_TOKEN = re.compile(r"[\w.+-]+")
_SCRAPS = (
    *(
        "",
        "0",
        "-1",
        "1e308",
        "-1e309",
        "1e-320",
        "nan",
        "NaN",
        "inf",
        "9" * 20,
        "9" * 400,
        "9007199254740993",
    ),
    *("true", "false", '""', "[]", "{}", '"x"', "x", "²", "١", "1_0", "0x10", "1,5", "-", "--", "1 2 3"),
    *("[1, 2]", "[[1]]", ",", ";", "\t", "\n", "\r", "\r\n", " ", "\x00", '"', "'", "[", "]", "[[", "="),
    *("#", "\\", "é", "\u2028", "\ufeff", "\U0001f6a3", "2026-02-30T25:00:00", "1979-05-27", "time_s"),
    *("../x", "/", "mm", "inch", "rad/s"),
)
_KINDS = (
    *("token", "token", "token", "swap", "insert", "delete", "cut", "repeat"),
    *("line away", "line twice", "lines swapped"),
)
_SHARE = st.floats(0, 1, exclude_max=True)

wounds = st.lists(
    st.tuples(st.sampled_from(_KINDS), _SHARE, _SHARE, st.sampled_from(_SCRAPS) | st.text(max_size=4)),
    min_size=1,
    max_size=5,
)
"""For `wounded`: kind, two places as shares of the file's length, and what is put there."""

# What counts and lengths may say.
_COUNTS = [
    number.to_bytes(width, order)
    for width in (1, 2, 4, 8)
    for order in ("little", "big")
    for number in {0, 1, 255, 2 ** (8 * width - 1), 2 ** (8 * width) - 1, 50_000 % 2 ** (8 * width)}
]

byte_wounds = st.lists(
    st.tuples(
        st.sampled_from(("flip", "flip", "set", "set", "delete", "insert", "cut", "again")),
        _SHARE,
        st.binary(min_size=1, max_size=4) | st.sampled_from(_COUNTS),
    ),
    min_size=1,
    max_size=6,
)
"""For `wounded_bytes`: kind, place as a share of the file's length, and bytes."""


def feed(file: Path, content: str | bytes, *reads: Callable[[Path], object], count: int = EXAMPLES) -> None:
    """Write the content into the file with many wounds; each reader must read it or refuse it."""

    def check(harm: Any) -> None:
        text = isinstance(content, str)
        file.write_bytes(as_bytes(wounded(content, harm)) if text else wounded_bytes(content, harm))
        for read in reads:
            answered(partial(read, file))

    campaign(check, wounds if isinstance(content, str) else byte_wounds, count=count)


def as_bytes(text: str) -> bytes:
    """UTF-8, of lone surrogates too."""
    return text.encode("utf-8", errors="surrogatepass")


def wounded(text: str, harm: Sequence[Wound]) -> str:
    """The text after each wound in turn."""
    for kind, first, second, scrap in harm:
        text = (
            _line_wound(text, kind, first, second)
            if "line" in kind
            else _wound(text, kind, first, second, scrap)
        )
    return text


def _wound(text: str, kind: str, first: float, second: float, scrap: str) -> str:
    start, stop = int(first * len(text)), int(second * len(text))
    if kind in ("token", "swap"):
        tokens = [m.span() for m in _TOKEN.finditer(text)]
        if not tokens:
            return text
        start, stop = tokens[int(first * len(tokens))]
        other = tokens[int(second * len(tokens))]
        return text[:start] + (scrap if kind == "token" else text[slice(*other)]) + text[stop:]
    if kind == "insert":
        return text[:start] + scrap + text[start:]
    if kind == "delete":
        stop = start + 1 + int(second**4 * len(text))
        return text[:start] + text[stop:]
    if kind == "cut":
        return text[:start]
    return text[:start] + text[start : start + 3] * int(1 + 3000 * second**3) + text[start:]


def _line_wound(text: str, kind: str, first: float, second: float) -> str:
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    a, b = int(first * len(lines)), int(second * len(lines))
    if kind == "line away":
        del lines[a]
    elif kind == "line twice":
        lines.insert(b, lines[a])
    else:
        lines[a], lines[b] = lines[b], lines[a]
    return "".join(lines)


def wounded_bytes(content: bytes, harm: Sequence[tuple[str, float, bytes]]) -> bytes:
    """The content after each wound in turn."""
    data = bytearray(content)
    for kind, share, scrap in harm:
        at = int(share * len(data))
        if kind == "flip" and data:
            data[at] ^= 1 << (scrap[0] % 8)
        elif kind == "set":
            data[at : at + len(scrap)] = scrap
        elif kind == "delete":
            del data[at : at + scrap[0]]
        elif kind == "insert":
            data[at:at] = scrap
        elif kind == "again":
            data[at:at] = data[at : at + 1 + 64 * scrap[0]] * len(scrap)
        elif kind == "cut":
            del data[at:]
    return bytes(data)
