"""The front of a report: who did what, what stands out, against earlier, and whether it can be believed.

A field of application fills a `Front`; the page, its one-page summary and its picture for a chat show the same one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from oarlock.recording.session_info import session_info, session_text
from oarlock.report.markup import rendered
from oarlock.report.section import KeyFigure, tiles
from oarlock.report.trust import Trust

MOST_POINTS = 3
HALF = "±"
"""In a key figure: half of its 95 % interval."""
_TITLE = ("athlete", "date")


@dataclass(frozen=True)
class Sourced:
    """A sentence and where it comes from."""

    text: str
    source: str = ""


@dataclass(frozen=True)
class Point:
    """One thing that stands out, as text.

    Attributes:
        head: what kind it is, in two or three words.
        sentence: what was found.
        size: its size with its 95 % interval; "" if it has none.
        usual: usual values; None without a source.
        why: why it matters; None without a source.
        advice: one thing to try; None without a source.
        meaning: definition of the number.
    """

    head: str
    sentence: str
    size: str = ""
    usual: Sourced | None = None
    why: Sourced | None = None
    advice: Sourced | None = None
    meaning: str = ""

    @property
    def details(self) -> list[tuple[str, Sourced]]:
        """Its named parts that are known, in their order."""
        parts = (("Usual", self.usual), ("Why it matters", self.why), ("Try", self.advice))
        return [(name, part) for name, part in parts if part is not None and part.text]


@dataclass(frozen=True)
class Course:
    """Mean curves over a stroke or a cycle, with one standard deviation either side."""

    name: str
    unit: str
    across: str
    curves: Mapping[str, tuple[Sequence[float], Sequence[float], Sequence[float], Sequence[float]]]


@dataclass(frozen=True)
class Front:
    """What a page shows first, without markup but for `compared` and `drawings`.

    Attributes:
        did: what was done in one sentence: "27 strokes in 60 s at 27.9/min."
        points: what stands out, the most important first; only the first three are shown.
        quiet: what is said if nothing stands out.
        limits: the differences that would have been named, below it.
        remark: a sentence below what stands out, such as usual values that differ.
        checked: everything that was compared, folded; markup.
        next_step: what to do next, in the words of whoever moves.
        sensors_step: what to do next with the equipment.
        caution: a reason of the field to read with care, for the line of trust.
        direct: what encoders measure, in the words of the field: it does not depend on how units sit.
        commands: what each further step is for, and its command; folded.
        figures: key figures, each with its definition.
        by_rate: the key figures by stroke rate, or by another condition that changes; markup.
        compared: against earlier ones, or a second one; markup.
        compared_head: its heading.
        compared_first: whether it stands above what stands out, and instead of the key figures.
        changes: the same in sentences, for the picture; text.
        drawings: for the summary on paper; markup of drawings.
        course: of the picture: name, unit, and by name the share in percent, mean, lower and upper bound.
    """

    did: str = ""
    points: Sequence[Point] = ()
    quiet: str = ""
    limits: str = ""
    remark: str = ""
    checked: str = ""
    next_step: str = ""
    sensors_step: str = ""
    caution: str = ""
    direct: str = ""
    commands: Sequence[tuple[str, str]] = ()
    figures: Sequence[KeyFigure] = ()
    by_rate: str = ""
    compared: str = ""
    compared_head: str = "Compared with earlier"
    compared_first: bool = False
    changes: Sequence[str] = ()
    drawings: Sequence[str] = ()
    course: Course | None = None


def who_and_when(provenance: Mapping[str, object]) -> tuple[str, str]:
    """The athlete and the date, and the rest of the session; both "" if nothing is known."""
    info = session_info(provenance)
    first = {key: info[key] for key in _TITLE if key in info}
    return session_text(first), session_text({key: info[key] for key in info if key not in first})


def date_of(provenance: Mapping[str, object]) -> str:
    """The day of the session, such as 2026-05-01; "" if unknown."""
    return session_info(provenance).get("date", "")


def named_file(provenance: Mapping[str, object], ending: str) -> str:
    """The name of a file to send on: `A07-2026-05-01-report.html`; only `ending` if nobody is named."""
    who, _ = who_and_when(provenance)
    kept = "".join(letter if letter.isalnum() or letter in "-_" else "-" for letter in who)
    stem = "-".join(part for part in kept.split("-") if part)
    return f"{stem}-{ending}" if stem else ending


def belief_markup(trust: Trust, anchor: str) -> str:
    """Whether the track can be believed, in one line with a link."""
    return rendered("belief", trust=trust, anchor=anchor)


def front_markup(front: Front, warnings: Sequence[str] = (), sentences: Sequence[str] = ()) -> str:
    """What was done: `warnings` and `sentences` (markup), figures, what stands out, against earlier."""
    told = [*warnings, *([escape(front.did)] if front.did else []), *sentences]
    return rendered(
        "front",
        sentences=told,
        tiles=tiles(front.figures),
        points=list(front.points)[:MOST_POINTS],
        more=max(len(front.points) - MOST_POINTS, 0),
        front=front,
        explains=any(
            HALF in figure.detail and "from stroke" not in figure.detail for figure in front.figures
        ),
    )
