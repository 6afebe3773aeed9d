"""Search for up to three changes of a recording that reduce the misfit of one second, for `suspects`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from oarlock.evaluation.suspects.changes import (
    FaultCorrection,
    LikeStreams,
    compass_changes,
    exchanges,
    exchanges_of_two,
    stuck_values,
    turns,
    unit_factors,
    unit_signs,
    value_changes,
)
from oarlock.evaluation.suspects.fit import Misfit, MisfitEvaluator, has_magnetometers, without_magnetometers
from oarlock.evaluation.suspects.rest_gravity import RestGravity
from oarlock.evaluation.suspects.suspect import USUAL
from oarlock.recording.recording import Recording

if TYPE_CHECKING:
    from oarlock._core import Model

MOST_FAULTS = 3
EXPLAINS = 1.8
"""Smallest factor by which correcting the last fault reduces the misfit."""
HELPS = 1.3
"""The same for a fault after which others remain."""
ALIKE = 1.25
"""Changes whose misfits differ by less than this factor are indistinguishable."""
STARTS = 4
FLOOR = 0.1
"""Misfits below this value count as equal."""
RATE_HZ, SCREEN_HZ = 50.0, 25.0
FINALISTS = 5
SETTLED, SETTLES = 0.7, 4.0
"""If the misfit is this far below the usual one and below its previous value, the search ends."""
UNITS_SUSPECTED, CLOSE = 3, 2.0
"""Largest number of suspicious units, and largest ratio between the misfits that remain without them."""
MOST_EXCHANGED = 8
"""Exchanges are tried among at most this number of units: those with the largest misfit."""


Ranking: TypeAlias = list[tuple[FaultCorrection, Misfit]]


@dataclass(frozen=True, eq=False)
class Second:
    """One second of readings on a fine grid, and on a coarse one for the first selection.

    `agreeing` units are not suspected. `gravity` refuses changes that contradict it.
    """

    model: Model
    fine: Recording
    coarse: Recording
    gravity: RestGravity
    agreeing: frozenset[str] = frozenset()

    @property
    def like(self) -> LikeStreams:
        """The streams that may have a fault, by kind."""
        return LikeStreams.of(self.model, [s for s in self.fine.streams if s.name not in self.agreeing])

    def applied(self, change: FaultCorrection) -> Second:
        """The second with the fault corrected."""
        return replace(self, fine=change.applied(self.fine), coarse=change.applied(self.coarse))

    def without(self, names: Sequence[str]) -> Second | None:
        """Without these streams; None if nothing is left."""
        parts = [[s for s in r.streams if s.name not in names] for r in (self.fine, self.coarse)]
        fine, coarse = parts
        return replace(self, fine=Recording(fine), coarse=Recording(coarse)) if all(parts) else None

    def without_magnetometers(self, names: Sequence[str]) -> Second | None:
        """The second without the magnetometers of these units."""
        fine, coarse = (without_magnetometers(r, names) for r in (self.fine, self.coarse))
        return replace(self, fine=fine, coarse=coarse) if fine is not None and coarse is not None else None


@dataclass(frozen=True, eq=False)
class CorrectionFit:
    """A change, the misfit before and after it, and other changes that are nearly as good."""

    change: FaultCorrection
    before: float
    after: float
    others: tuple[FaultCorrection, ...]


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The changes in order; the remaining misfit, and the stream whose removal would reduce it most."""

    found: tuple[CorrectionFit, ...]
    misfit: Misfit
    contradicts: str = ""
    without_it: float = float("nan")


def search(judge: MisfitEvaluator, second: Second) -> SearchResult:
    """Name faults one after the other until the second fits."""
    found: list[CorrectionFit] = []
    first = misfit = judge.misfit(second.fine)
    left = second
    while misfit.total > USUAL and len(found) < MOST_FAULTS:
        ranked = _ranked(judge, left, misfit)
        misfit = _from_their_starts(judge, left, misfit, ranked)
        if not found:
            first = misfit
        best = _best(misfit, ranked)
        if misfit.total <= USUAL or best is None:
            break
        found.append(best)
        left = left.applied(best.change)
        misfit = judge.misfit(left.fine)
    if first.total <= USUAL:
        return SearchResult((), first)
    if found and misfit.total <= max(USUAL, first.total / EXPLAINS ** (len(found) + 1)):
        return SearchResult(tuple(found), misfit)
    return SearchResult((), first, *_contradicting(judge, second))


def _ranked(judge: MisfitEvaluator, second: Second, misfit: Misfit) -> Ranking:
    """The changes that reduce the misfit most; rare kinds are tried only if no common one suffices."""
    ranked: Ranking = []
    for family in (_units, _usual, _rare):
        tried = family(judge, second, misfit)
        possible = [c for c in tried if not second.gravity.contradicts(c.streams, c.of_force)]
        changes = _preselected(judge, second, possible)
        fits = judge.misfits([change.applied(second.fine) for change in changes])
        ranked = sorted(
            [*ranked, *zip(changes, fits, strict=True)], key=lambda pair: pair[1].total * pair[0].rarity
        )
        if ranked and ranked[0][1].total < min(SETTLED * USUAL, misfit.total / SETTLES):
            break
    return _from_the_best_start(judge, second, ranked)


def _from_the_best_start(judge: MisfitEvaluator, second: Second, ranked: Ranking) -> Ranking:
    """Repeats the best changes from the start posture of the best one, so that only the change differs."""
    if not ranked or not ranked[0][1].posture:
        return ranked
    rivals = [pair[0] for pair in ranked[1 : 1 + STARTS]]
    fits = judge.misfits_from([c.applied(second.fine) for c in rivals], ranked[0][1].posture)
    better = {id(c): fit for c, fit in zip(rivals, fits, strict=True)}
    again = [(c, min(fit, better.get(id(c), fit), key=lambda one: one.total)) for c, fit in ranked]
    return sorted(again, key=lambda pair: _weighed(*pair))


def _from_their_starts(judge: MisfitEvaluator, second: Second, misfit: Misfit, ranked: Ranking) -> Misfit:
    """The misfit without any change, from the start postures to which changes led."""
    starts = [fit.posture for _, fit in ranked[:STARTS] if fit.total < misfit.total and fit.posture]
    tried = [fit for posture in starts for fit in judge.misfits_from([second.fine], posture)]
    return min([misfit, *tried], key=lambda fit: fit.total)


def _best(misfit: Misfit, ranked: Ranking) -> CorrectionFit | None:
    if not ranked:
        return None
    best, fit = ranked[0]
    needed = EXPLAINS if fit.total <= USUAL else HELPS
    if not fit.total * needed * best.rarity < misfit.total:
        return None
    near = [
        c for c, f in ranked[1:] if _weighed(c, f) < ALIKE * _weighed(best, fit) and not _more_than(best, c)
    ]
    return CorrectionFit(best, misfit.total, fit.total, tuple(near))


def _weighed(change: FaultCorrection, fit: Misfit) -> float:
    return (FLOOR + fit.total) * change.rarity


def _more_than(one: FaultCorrection, other: FaultCorrection) -> bool:
    """True if `other` is the same fault on additional streams."""
    return one.fault == other.fault and set(one.streams) < set(other.streams)


def _units(judge: MisfitEvaluator, second: Second, misfit: Misfit) -> Iterator[FaultCorrection]:
    like = second.like
    yield from unit_factors(like.units)
    yield from value_changes(like.angles, like.places, units=True)


def _usual(judge: MisfitEvaluator, second: Second, misfit: Misfit) -> Iterator[FaultCorrection]:
    like = second.like
    names = [s.name for s in like.units]
    worst = sorted(names, key=lambda name: -misfit.by_source.get(name, 0.0))[:MOST_EXCHANGED]
    groups = [[n for n in names if n in worst], [s.name for s in like.angles], [s.name for s in like.places]]
    yield from exchanges(groups)
    yield from value_changes(like.angles, like.places, units=False)
    yield from stuck_values([*like.angles, *like.places])
    yield from unit_signs(names, together=False)
    if len(names) > 1:
        yield from unit_signs(names, together=True)


def _rare(judge: MisfitEvaluator, second: Second, misfit: Misfit) -> Iterator[FaultCorrection]:
    names = [s.name for s in second.like.units]
    yield from exchanges_of_two([names, [s.name for s in second.like.angles]])
    yield from turns(_most_suspicious(judge, second, names, Second.without))
    plain = second.without_magnetometers(names)
    if has_magnetometers(second.fine) and plain and judge.misfit(plain.fine).total <= USUAL:
        suspicious = _most_suspicious(judge, second, names, lambda s, cut: s.without_magnetometers(cut))
        yield from compass_changes(suspicious, together=False)
        if len(names) > 1:
            yield from compass_changes(names, together=True)


def _most_suspicious(
    judge: MisfitEvaluator,
    second: Second,
    units: Sequence[str],
    cut: Callable[[Second, Sequence[str]], Second | None],
) -> list[str]:
    """Units whose removal reduces the misfit most."""
    left = [(name, rest.coarse) for name in units if (rest := cut(second, [name])) is not None]
    fits = judge.preselected([recording for _, recording in left])
    ranked = sorted(zip(left, fits, strict=True), key=lambda pair: pair[1].total)
    close = [name for (name, _), fit in ranked if fit.total <= CLOSE * ranked[0][1].total]
    return close[:UNITS_SUSPECTED] if left else list(units)


def _preselected(
    judge: MisfitEvaluator, second: Second, changes: Sequence[FaultCorrection]
) -> list[FaultCorrection]:
    fits = judge.preselected([change.applied(second.coarse) for change in changes])
    order = np.argsort([fit.total * c.rarity for fit, c in zip(fits, changes, strict=True)], kind="stable")
    return [changes[i] for i in order[:FINALISTS] if np.isfinite(fits[i].total)]


def _contradicting(judge: MisfitEvaluator, second: Second) -> tuple[str, float]:
    cuts = [(s.name, second.without([s.name])) for s in second.fine.streams]
    left = [(name, cut.fine) for name, cut in cuts if cut is not None]
    if len(left) < 2:
        return "", float("nan")
    fits = judge.misfits([recording for _, recording in left])
    best = min(range(len(left)), key=lambda i: fits[i].total)
    return left[best][0], fits[best].total
