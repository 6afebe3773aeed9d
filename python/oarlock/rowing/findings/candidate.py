"""`MetricComparison`: a difference of one number that may be a finding, and the four comparisons that make them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from oarlock.rowing.findings.at_like_rate import FITTED, RateAdjustedChange, change, robust_sd
from oarlock.rowing.findings.rowed import FEWEST_STROKES, Rowed
from oarlock.rowing.findings.watched import WATCHED, Watched
from oarlock.storage.statistics import student_quantile, student_tail

_WANDER = 0.25
"""Share of a stroke's standard deviation by which the last third may be off against the strokes before it. The rest is
the same in all strokes. Measured on 14 tracks of the field simulator (seeds 201 to 205, wild and careful, nothing
calibrated): root mean square 0.04 to 0.13 for lean, seat and oars, 0.3 for arms."""
_ALIKE = 2.3
"""Variance of a mean of strokes of which neighbours correlate by 0.4, relative to independent ones."""
_SINGLE_STROKE = 2.0
"""A single stroke must differ by so many times the smallest size; it counts that much less, too."""
_MANY = 1e6
_NO_SCATTER = 1e-9
FALSE_SHARE = 0.02
"""Probability that anything is named in a piece in which nothing differs, by chance alone."""
RACE_RATE = 28.0
"""Usual values of race rate do not apply below."""


@dataclass(frozen=True)
class MetricComparison:
    """A difference of one number, in its shown unit.

    Attributes:
        watched: the number.
        kind: as of `Finding`.
        size: now minus before, right minus left, or beyond the usual.
        sd: its standard deviation.
        chance: probability of this size or a larger one without a true difference (two-sided).
        now: value now.
        freedom: degrees of freedom of `sd`.
        tried: number of strokes of which the most unusual was taken, else 1.
        stroke: number of an odd stroke, else 0.
        like_rate: whether a difference of rate was removed.
        limit: usual value that is exceeded.
        limit_source: whose.
    """

    watched: Watched
    kind: str
    size: float
    sd: float
    chance: float
    now: float
    freedom: float = float("inf")
    tried: int = 1
    stroke: int = 0
    like_rate: bool = False
    limit: float = float("nan")
    limit_source: str = ""

    @property
    def weight(self) -> float:
        """Size relative to the smallest that is named."""
        own = abs(self.size) / self.watched.least
        return own / _SINGLE_STROKE if self.stroke else own

    def named_from(self, comparisons: int) -> float:
        """The smallest size that would be named among so many comparisons, in the shown unit."""
        rare = FALSE_SHARE / (2.0 * self.tried * comparisons)
        certain = -student_quantile(rare, min(self.freedom, _MANY)) * self.sd
        return max(certain, self.watched.least * (_SINGLE_STROKE if self.stroke else 1.0))


def within(rowed: Rowed) -> Iterator[MetricComparison]:
    """The last third against the strokes before it, and single strokes against all, at like rate."""
    columns = _columns(rowed)
    for watched in columns:
        good = rowed.good(watched.name)
        later = np.arange(good.sum()) >= good.sum() - good.sum() // 3
        scale = watched.feature.shown_scale
        values = scale * rowed.columns[watched.name][good]
        found = change(values, rowed.columns["rate_per_min"][good], later, watched.per_rate * watched.least)
        wander = _WANDER * scale * rowed.shared_std(watched.name)
        ramp = bool(np.ptp(rowed.columns["rate_per_min"][good]) > 2.0)
        now = float(values[later].mean())
        yield _of_change(watched, "drift", found, wander, now, ramp)
        yield from _odd(watched, found, wander, values, rowed.numbers[good])


def sides(rowed: Rowed) -> Iterator[MetricComparison]:
    """Right against left, of two oars."""
    if rowed.kind != "sculling":
        return
    for watched in WATCHED.values():
        good = rowed.good(watched.name)
        if not watched.sides or good.sum() < 2:
            continue
        scale = watched.feature.shown_scale
        values = scale * rowed.columns[watched.name][good]
        mean, count = float(np.median(values)), len(values)
        shared = scale * rowed.shared_std(watched.name)
        sd = float(np.hypot(values.std(ddof=1) * np.sqrt(_ALIKE / count), shared))
        freedom = max(count / _ALIKE, 2.0)
        yield MetricComparison(watched, "sides", mean, sd, chance(mean, sd, freedom), mean, freedom)


def against(rowed: Rowed, other: Rowed, kind: str) -> Iterator[MetricComparison]:
    """This piece against another one at like rate; nothing if they are not comparable."""
    if not rowed.comparable(other):
        return
    apart = rowed.rate_per_min - other.rate_per_min
    enough = {watched.name for watched in _columns(other)}
    for watched in _columns(rowed):
        if watched.name not in enough:
            continue
        both = [
            (one.columns[watched.name], one.columns["rate_per_min"], one.good(watched.name))
            for one in (other, rowed)
        ]
        scale = watched.feature.shown_scale
        values, rate = (np.concatenate([pair[k][pair[2]] for pair in both]) for k in (0, 1))
        later = np.repeat([False, True], [int(pair[2].sum()) for pair in both])
        found = change(scale * values, rate, later, watched.per_rate * watched.least)
        shared = scale * np.hypot(rowed.shared_std(watched.name), other.shared_std(watched.name))
        now = float(scale * both[1][0][both[1][2]].mean())
        yield _of_change(watched, kind, found, float(shared), now, bool(abs(apart) > 0.5))


def _of_change(
    watched: Watched, kind: str, found: RateAdjustedChange, shared: float, now: float, like_rate: bool
) -> MetricComparison:
    sd = float(np.hypot(np.hypot(found.scatter_sd, found.rate_sd), shared))
    # Welch and Satterthwaite: only the scatter is estimated from few strokes.
    freedom = found.freedom * (sd / found.scatter_sd) ** 4
    likely = chance(found.size, sd, freedom)
    return MetricComparison(watched, kind, found.size, sd, likely, now, freedom, like_rate=like_rate)


def against_usual(rowed: Rowed) -> Iterator[MetricComparison]:
    """Means beyond the targets that were chosen, or else beyond published limits."""
    for watched in _columns(rowed):
        good, scale = rowed.good(watched.name), watched.feature.shown_scale
        values = scale * rowed.columns[watched.name][good]
        low, high, source = watched.low, watched.high, watched.why.source
        target = rowed.targets.get(watched.name)
        if target is not None:
            if "race rate" in target.source and rowed.rate_per_min < RACE_RATE:
                continue
            low, high, source = scale * target.low, scale * target.high, target.source
        mean = float(np.mean(values))
        limit = low if mean < low else high if mean > high else float("nan")
        if not np.isfinite(limit):
            continue
        scatter = values.std(ddof=1) * np.sqrt(_ALIKE / len(values))
        sd = float(np.hypot(scatter, scale * rowed.shared_std(watched.name)))
        freedom = max(len(values) / _ALIKE, 2.0)
        likely = chance(mean - limit, sd, freedom)
        kind = "against usual"
        yield MetricComparison(
            watched, kind, mean - limit, sd, likely, mean, freedom, limit=limit, limit_source=source
        )


def chance(size: float, sd: float, freedom: float) -> float:
    """Two-sided probability of a size of this standard deviation by chance; Student's distribution."""
    if not (np.isfinite(size) and np.isfinite(sd)):
        return 1.0
    return 2.0 * student_tail(size / max(sd, _NO_SCATTER), min(freedom, _MANY))


def beyond_chance(
    candidates: Sequence[MetricComparison], false_share: float = FALSE_SHARE
) -> list[MetricComparison]:
    """Those large enough whose probability stays below a share of all comparisons (Holm 1979)."""
    kept = []
    for left, one in zip(
        range(len(candidates), 0, -1), sorted(candidates, key=lambda one: one.chance), strict=True
    ):
        if one.chance * left > false_share:
            break
        kept.append(one)
    return [one for one in kept if one.weight > 1.0]


def _columns(rowed: Rowed) -> list[Watched]:
    return [
        rowed.own(watched)
        for watched in WATCHED.values()
        if not watched.sides
        and (not watched.kinds or rowed.kind in watched.kinds)
        and rowed.good(watched.name).sum() >= FEWEST_STROKES
    ]


def _odd(
    watched: Watched, found: RateAdjustedChange, wander: float, values: np.ndarray, numbers: np.ndarray
) -> Iterator[MetricComparison]:
    """The stroke that is farthest from what the rate and the other strokes suggest."""
    k = int(np.argmax(np.abs(found.residuals)))
    sd = float(np.hypot(robust_sd(np.delete(found.residuals, k), FITTED), wander))
    count = len(values)
    freedom = max(count - 5.0, 3.0)
    beside = found.residuals[[j for j in (k - 1, k + 1) if 0 <= j < count]].mean()
    if abs(beside) > 0.5 * abs(found.residuals[k]):
        return  # several strokes in a row are a change that the regression does not know, not an odd stroke
    yield MetricComparison(
        watched,
        "odd stroke",
        float(found.residuals[k]),
        sd,
        chance(float(found.residuals[k]), sd, freedom) * count,
        float(values[k]),
        freedom,
        count,
        stroke=int(numbers[k]),
    )
