"""Sentences of findings, with sizes, for people."""

from __future__ import annotations

from oarlock.rowing.alongside.paces import PER_500_M, SPEEDS, of_pace, pace_text, slower_s, slower_text
from oarlock.rowing.findings.candidate import MetricComparison
from oarlock.rowing.findings.causes import Cause
from oarlock.rowing.findings.finding import Finding
from oarlock.rowing.findings.watched import SourcedText
from oarlock.rowing.report.shown import capital, places, with_unit

_MOST_FOLLOWED = 2
_THAN = {
    "against last": "than last time",
    "against best": "than in your best piece",
    "against other": "than in the other piece",
}


def finding(cause: Cause, kind_of_boat: str) -> Finding:
    """The finding of a cause."""
    lead = cause.lead
    watched = lead.watched
    usual, why, tries = watched.usual_of(kind_of_boat), _why(cause), _try(cause)
    size, sd, unit = _as_shown(lead)
    return Finding(
        name=watched.name,
        kind=lead.kind,
        sentence=sentence(cause),
        size=size,
        size_1sd=sd,
        unit=unit,
        usual=usual.text,
        usual_source=usual.source,
        why=why.text,
        why_source=why.source,
        advice="" if lead.stroke else tries.text,
        advice_source="" if lead.stroke else tries.source,
        weight=cause.weight,
    )


def _why(cause: Cause) -> SourcedText:
    """Why the lead matters, or else the largest of those that the sentence names with it."""
    return next(
        (one.watched.why for one in (cause.lead, *_named_with(cause)[1]) if one.watched.why.text),
        SourcedText(),
    )


def _try(cause: Cause) -> SourcedText:
    """What to try against the lead, or else against the largest of those that the sentence names with it."""
    tries = (one.watched.to_try(one.size) for one in (cause.lead, *_named_with(cause)[1]))
    return next((told for told in tries if told.text), SourcedText())


def sentence(cause: Cause) -> str:
    """What was found, with sizes."""
    lead = cause.lead
    if lead.kind == "sides":
        late, early = ("right", "left") if lead.size > 0.0 else ("left", "right")
        return lead.watched.sides.format(later=late, earlier=early, size=_size(lead))
    if lead.kind == "odd stroke":
        before = _value(lead, _before(lead))
        return (
            f"Stroke {lead.stroke} is unusual: {lead.watched.feature.label} {_value(lead, lead.now)}; "
            f"the strokes around it suggest {before}."
        )
    if lead.kind == "against usual":
        whose = f" ({lead.limit_source})" if lead.limit_source else ""
        return f"{capital(_changed(lead))} than the usual {_value(lead, lead.limit)}{whose}: {_value(lead, lead.now)}."
    start = f"In the last third {_changed(lead)} than before" if lead.kind == "drift" else ""
    start = start or f"{capital(_changed(lead))} {_THAN[lead.kind]}"
    like = " at like stroke rate" if lead.like_rate else ""
    earlier = lead.now - lead.size if _is_pace(lead) else _before(lead)
    values = f"{_value(lead, lead.now)} instead of {_value(lead, earlier)}{like}"
    return f"{start}: {values}.{_followed(cause)}"


def _followed(cause: Cause) -> str:
    start, ones = _named_with(cause)
    return f"{start} {' and '.join(_changed(one) for one in ones)}." if ones else ""


def _named_with(cause: Cause) -> tuple[str, list[MetricComparison]]:
    """Those that the sentence names after the lead, and how it begins to."""
    for start, ones in ((" With it", cause.followed), (" Besides,", cause.beside)):
        if ones:
            return start, sorted(ones, key=lambda one: -one.weight)[:_MOST_FOLLOWED]
    return "", []


def _is_pace(one: MetricComparison) -> bool:
    """Whether a difference of two speeds is given as pace, which rowers read."""
    return one.watched.name in SPEEDS and one.kind not in ("odd stroke", "against usual")


def _as_shown(one: MetricComparison) -> tuple[float, float, str]:
    """Size, its standard deviation and their unit."""
    if not _is_pace(one):
        return one.size, one.sd, one.watched.feature.shown_unit
    return slower_s(one.now, one.now - one.size), of_pace(one.now, one.sd), PER_500_M


def _changed(one: MetricComparison) -> str:
    if _is_pace(one):
        return f"{one.watched.subject} is {slower_text(one.now, one.now - one.size)}"
    word = one.watched.grew if one.size > 0.0 else one.watched.fell
    return f"{one.watched.subject} is {_size(one)} {word}"


def _size(one: MetricComparison) -> str:
    feature = one.watched.feature
    return with_unit(feature, abs(one.size) / feature.shown_scale)


def _before(one: MetricComparison) -> float:
    """The value without the difference, so that the rounded numbers of a sentence add up."""
    digits = places(one.watched.feature)
    return round(one.now, digits) - round(one.size, digits)


def _value(one: MetricComparison, value: float) -> str:
    if _is_pace(one):
        return pace_text(value)
    feature, sign = one.watched.feature, -1.0 if one.watched.flipped else 1.0
    return with_unit(feature, sign * value / feature.shown_scale)
