"""Registry of the estimators of `compare`: name, assumptions, source and function of each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from oarlock._core import Config, Tracker
from oarlock.evaluation.comparison.filter_names import LIMB_FILTER, ORIENTATION_FILTERS, TREE_FILTERS
from oarlock.evaluation.comparison.limb_track import track_independent_chains
from oarlock.evaluation.comparison.orientation_track import track_orientations
from oarlock.recording.calibration import Calibration
from oarlock.recording.recording import Recording
from oarlock.storage.errors import DataError
from oarlock.storage.progress import Progress
from oarlock.storage.suggest import did_you_mean
from oarlock.tracking.track import Track
from oarlock.tracking.tracking import track

if TYPE_CHECKING:
    from oarlock._core import Model

TREE, LIMBS, UNITS = "tree", "limbs", "single units"
OPEN, PLAIN = "_open", "_plain"


@dataclass(frozen=True)
class Estimator:
    """A method that computes joint coordinates from a recording.

    Args:
        name: name for `--filter`.
        family: `tree`, `limbs` or `single units`: the part that one filter covers.
        title: a short description.
        assumes: assumptions, and data that it cannot use.
        source: publication.
        package: the optional package that it needs; "" for none.
        config: settings of the engine's filter; None for filters of single units.
    """

    name: str
    family: str
    title: str
    assumes: str
    source: str
    package: str = ""
    config: Config | None = None

    @property
    def live(self) -> bool:
        """Whether it can run live, sample by sample."""
        return self.family == TREE

    def track(
        self,
        model: Model,
        recording: Recording,
        calibration: Calibration | None = None,
        *,
        progress: Progress = None,
    ) -> Track:
        """Track a recording.

        Raises:
            DataError: as `oarlock.track`, `track_independent_chains` and `track_orientations`.
        """
        if self.config is None:
            return track_orientations(model, recording, self.name, calibration, progress=progress)
        way = track_independent_chains if self.family == LIMBS else track
        return way(model, recording, calibration, self.config, progress=progress)

    def tracker(self, model: Model, calibration: Calibration | None = None) -> Tracker:
        """A tracker for live steps.

        Raises:
            DataError: this estimator needs the whole recording.
        """
        if not self.live:
            raise DataError(
                f"{self.name}: needs a whole recording and cannot step live. "
                f"Use one of: {', '.join(e.name for e in estimators() if e.live)}"
            )
        return Tracker(model, calibration, self.config)


_TREE_TITLES = {
    "ukf": ("unscented Kalman filter on the tree", "E. A. Wan and R. van der Merwe (2000); the default"),
    "ekf": (
        "extended Kalman filter on the tree",
        "Y. Bar-Shalom, X. R. Li and T. Kirubarajan (2001), section 10.3",
    ),
    "factorised": (
        "small coupled filters along the tree",
        "E. Ruffaldi, L. Peppoloni, A. Filippeschi and C. A. Avizzano (2014)",
    ),
}
_UNIT_TITLES = {
    "vqf": ("VQF", "D. Laidig and T. Seel (2023)", "vqf", "finds biases at rest and in motion"),
    "madgwick": ("Madgwick's gradient descent", "S. O. H. Madgwick (2010)", "ahrs", "no biases"),
    "quaternion_ekf": (
        "extended Kalman filter on the quaternion",
        "A. M. Sabatini (2011), as in ahrs",
        "ahrs",
        "no biases",
    ),
    "quest_ekf": (
        "QUEST, then a Kalman filter on rates and quaternion",
        "after X. Yun and E. R. Bachmann (2006)",
        "ahrs",
        "no biases",
    ),
    "vector_kf": (
        "linear Kalman filter on the vectors of gravity and field",
        "after R. Zhu and Z. Zhou (2004)",
        "",
        "no biases",
    ),
}


def estimators() -> tuple[Estimator, ...]:
    """All estimators of this version, including those whose packages are not installed.

    Filters of trees and limbs have four variants: with closures and slow states; `_open` without closures; `_plain`
    without biases and base acceleration; `_open_plain` without both.
    """
    found: list[Estimator] = []
    for name in TREE_FILTERS:
        title, source = _TREE_TITLES[name]
        settings: dict[str, Any] = {"structure": TREE, "filter": name}
        found += _four(Estimator(name, TREE, title, "", source, config=Config(**settings)))
    source = "after L. Peppoloni, A. Filippeschi, E. Ruffaldi and C. A. Avizzano (2013)"
    limbs = Estimator(
        LIMB_FILTER, LIMBS, "an unscented Kalman filter on each limb", "", source, config=Config()
    )
    found += _four(limbs)
    for name in ORIENTATION_FILTERS:
        title, source, package, own = _UNIT_TITLES[name]
        assumes = f"{own}; heading given; no lengths, no closures, no base acceleration"
        found.append(Estimator(name, UNITS, title, assumes, source, package))
    return tuple(found)


def estimator(name: str) -> Estimator:
    """The estimator of this name.

    Raises:
        DataError: there is none.
    """
    known = {e.name: e for e in estimators()}
    if name not in known:
        raise DataError(f"no filter '{name}'. {did_you_mean(name, list(known))}")
    return known[name]


def usual_estimators() -> tuple[Estimator, ...]:
    """The default selection of `compare`: one filter of each family, and all variants of the default filter."""
    left_out = {name + suffix for name in TREE_FILTERS if name != "ukf" for suffix in _SUFFIXES}
    left_out |= {LIMB_FILTER + suffix for suffix in (PLAIN, OPEN + PLAIN)}
    return tuple(e for e in estimators() if e.name not in left_out)


_SUFFIXES = (OPEN, PLAIN, OPEN + PLAIN)


def _four(whole: Estimator) -> Iterable[Estimator]:
    assert whole.config is not None
    keys = whole.config.to_dict()
    yield replace(whole, assumes="closures, biases and base acceleration as states")
    yield replace(
        whole, name=whole.name + OPEN, assumes="no closures", config=Config(**keys | {"closures": False})
    )
    yield replace(
        whole,
        name=whole.name + PLAIN,
        assumes="no biases, no base acceleration",
        config=Config(**keys | {"estimate": ()}),
    )
    yield replace(
        whole,
        name=whole.name + OPEN + PLAIN,
        assumes="no closures, no biases, no base acceleration",
        config=Config(**keys | {"closures": False, "estimate": ()}),
    )
