"""The summary sentences of a fault study page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from oarlock.evaluation.study.costs import Dose, middle
from oarlock.report.fault_charts import cost_text
from oarlock.report.text import number, percent

MOST_ERRORS, MOST_NAMED, EXAMPLES = 8, 12, 3
NOTABLE_RATIO = 1.5
"""A safeguard is mentioned if the error without it is larger or smaller by this factor."""

Curves = Mapping[str, Mapping[str, Sequence[Dose]]]
"""Strengths by fault and setting, the most harmful fault first."""


def findings(clean: Mapping[str, Dose], curves: Curves) -> list[tuple[str, str]]:
    """The summary: headings with their sentences."""
    first = next(iter(clean))
    own = [doses[first] for doses in curves.values()]
    usual = [dose for doses in own for dose in doses if dose.fault and dose.index == dose.fault.usual_index]
    found = [
        ("Without a fault", _clean(clean[first])),
        (
            "Largest errors at typical strength:",
            _listed(
                [f"{_sentence(dose)} ({cost_text(dose)})" for dose in usual if dose.noticed], MOST_ERRORS
            ),
        ),
        ("No measurable effect:", _listed(_free(own), MOST_NAMED)),
        ("Track lost in at least one seed:", _listed(_breaking(own), MOST_NAMED) or "no fault."),
    ]
    found += [_setting(name, first, curves) for name in clean if name != first]
    return [(head, text) for head, text in found if text]


def _clean(dose: Dose) -> str:
    inside = middle(dose.coverage)
    least, greatest = dose.range_deg
    bands = f", and {percent(inside)} of them lie inside their 95 % bands" if math.isfinite(inside) else ""
    return (
        f"the error of the angles is {number(dose.median_deg, 2)} deg "
        f"({number(least, 2)} to {number(greatest, 2)} over the seeds){bands}."
    )


def _breaking(own: Sequence[Sequence[Dose]]) -> list[str]:
    """The smallest strength of each fault at which a seed is lost."""
    broken = (next((dose for dose in doses if dose.lost), None) for doses in own)
    return [f"{_sentence(dose)} ({dose.lost} of {len(dose.error_deg)})" for dose in broken if dose]


def _free(own: Sequence[Sequence[Dose]]) -> list[str]:
    """The largest strength of each fault without measurable effect."""
    quiet = [(doses, next((k for k, d in enumerate(doses) if d.noticed), len(doses))) for doses in own]
    return [_sentence(doses[count - 1]) for doses, count in reversed(quiet) if count]


def _setting(name: str, first: str, curves: Curves) -> tuple[str, str]:
    """The faults at which a setting differs most from the first one, in both directions."""
    pairs = [
        (other, usual)
        for doses in curves.values()
        for other, usual in zip(doses[name], doses[first], strict=True)
        if math.isfinite(usual.median_deg)
    ]
    texts = []
    for word, sign in (("worse", 1.0), ("better", -1.0)):
        if most := _most(pairs, sign):
            texts.append(f"{word} under {_listed([_against(pair) for pair in most], EXAMPLES)}")
    text = " ".join(f"{t[0].upper()}{t[1:]}" if k else t for k, t in enumerate(texts))
    return f"{name[0].upper()}{name[1:]}:", text or "no relevant difference with any fault."


def _most(pairs: Sequence[tuple[Dose, Dose]], sign: float) -> list[tuple[Dose, Dose]]:
    """The pairs that differ most, one for each fault."""

    def ratio(pair: tuple[Dose, Dose]) -> float:
        other, usual = pair
        return sign * math.log(min(other.median_deg, 1e9) / max(usual.median_deg, 1e-9))

    found: dict[str, tuple[Dose, Dose]] = {}
    for pair in sorted(pairs, key=ratio, reverse=True):
        if ratio(pair) < math.log(NOTABLE_RATIO):
            break
        found.setdefault(pair[0].fault.name if pair[0].fault else "", pair)
    return list(found.values())[:EXAMPLES]


def _against(pair: tuple[Dose, Dose]) -> str:
    other, usual = pair
    left = f"{number(other.median_deg, 2)} deg" if math.isfinite(other.median_deg) else "lost"
    return f"{_sentence(other)} ({left} instead of {number(usual.median_deg, 2)})"


def _sentence(dose: Dose) -> str:
    return dose.fault.sentence(dose.index) if dose.fault else ""


def _listed(texts: Iterable[str], most: int) -> str:
    given = list(texts)
    more = f"; and {len(given) - most} more" if len(given) > most else ""
    return "; ".join(given[:most]) + more + "." if given else ""
