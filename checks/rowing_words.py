"""The engine and the general part of the package say nothing of rowing, which is one use of them."""

import re
from pathlib import Path

from checks.arrows import PACKAGE, part_of, python_files
from checks.engine_arrows import ENGINE, UNIT_TESTS
from checks.project_files import ROOT, name_of, text_of

BINDING = ROOT / "crates/oarlock-py/src"
ROOMS_OF_ROWING = {"cli", "lab", "report", "rowing", "season"}
ROWING_WORD = re.compile(
    r"(?<![a-z])(?:boats?|coxswain|oars?|rigger|row(?:er|ers|ing)|scull(?:er|ers|ing|s)?|strokes?)(?![a-z])",
    re.I,
)
# Names, not talk: the shipped models, the package, the title of the cited source.
NAMES_WITH_ROWING_WORDS = re.compile(
    r"""["'`/]sculler\w*(?:\.toml)?\\?["'`]|oarlock[./]rowing|tracking applied in rowing"""
)
# What speaks with devices of rowers, in their makers' words.
OF_DEVICES = (("live", "decoders"), ("live", "transports"))
# Modules that draw: their strokes are lines.
DRAWS = {"pose_picture"}


def findings() -> list[str]:
    """Words of rowing in files that should not know of it."""
    package = [path for path in python_files() if not is_of_rowing(path)]
    files = [*package, *sorted(ENGINE.rglob("*.rs")), *sorted(BINDING.rglob("*.rs"))]
    return [
        f"{name_of(path)}:{line}: {word!r} belongs into oarlock.rowing or a model file"
        for path in files
        for line, word in words_of_rowing(path)
    ]


def is_of_rowing(path: Path) -> bool:
    """Whether a module of the package belongs to rowing or to its devices."""
    return part_of(path) in ROOMS_OF_ROWING or path.relative_to(PACKAGE).parts[:2] in OF_DEVICES


def words_of_rowing(path: Path) -> list[tuple[int, str]]:
    """Line and word of each; the engine's unit tests may speak of rowing."""
    text = NAMES_WITH_ROWING_WORDS.sub("", text_of(path))
    if path.is_relative_to(PACKAGE) and part_of(path) in DRAWS:
        text = text.replace("stroke", "")
    if path.suffix == ".rs":
        text = UNIT_TESTS.split(text)[0] if path.stem != "tests" else ""
    return [(text[: hit.start()].count("\n") + 1, hit[0]) for hit in ROWING_WORD.finditer(text)]
