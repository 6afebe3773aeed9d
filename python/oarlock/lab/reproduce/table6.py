"""Table 6: errors of shoulder, elbow and wrist positions relative to markers, on simulated field recordings."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from oarlock.lab.reproduce.contents import Cell, PaperPart, Row, Table, finite_mean, shown, spread
from oarlock.lab.reproduce.field_trials import NOT_PUBLIC, POINTS, RATE_HZ, SETTINGS, Setting, TrackedTrial
from oarlock.rowing.simulation import paper

TARGET_MM = 30.0


def table6(scored: Sequence[TrackedTrial], duration_s: float) -> PaperPart:
    """The paper's table with our values, then errors per axis, with bands and NEES."""
    settings = [s for s in SETTINGS if any(one.setting.key == s.key for one in scored)]
    seeds = sorted({one.seed for one in scored})
    return PaperPart(
        key="table6",
        title="Table 6: positions against optical markers",
        lead=(
            NOT_PUBLIC,
            f"{len(seeds)} simulated {'trial' if len(seeds) == 1 else 'trials'} of {duration_s:g} s at {RATE_HZ:g} Hz, "
            "20 to 34 strokes per minute, scored from 2 s on in root axes, without fitting clock or axes to the "
            "markers. Markers are at the true joint centres. The filter has nominal lengths and mounts: nothing was "
            "calibrated.",
        ),
        tables=(_main(scored, settings), *(_axes(scored, setting) for setting in settings)),
        notes=(
            paper.SLIPS["rates"],
            paper.SLIPS["axes"],
            "The paper gives one correlation for each position without a definition; ours is the mean over the axes.",
            "Target: a mean 3D error of at most 30 mm on the water, as shipped.",
        ),
        data={"table6": rows(scored)},
    )


def rows(scored: Sequence[TrackedTrial]) -> list[Row]:
    """One row for each setting, seed and point, with the printed value."""
    printed = paper.table_6()
    return [
        {
            "setting": one.setting.key,
            "condition": one.setting.condition,
            "seed": one.seed,
            "point": name,
            **one.points[name],
            "paper_rmse_m": printed[name].rmse_m,
            "paper_r": printed[name].correlation,
        }
        for one in scored
        for name in POINTS
    ]


def values(scored: Sequence[TrackedTrial], setting: str, point: str, score: str) -> list[float]:
    """One score over the seeds."""
    return [one.points[point][score] for one in scored if one.setting.key == setting]


def _main(scored: Sequence[TrackedTrial], settings: Sequence[Setting]) -> Table:
    printed = paper.table_6()
    found = []
    for point in POINTS:
        cells = [Cell(point)]
        for setting in settings:
            errors = [1e3 * v for v in values(scored, setting.key, point, "rmse_3d_m")]
            r = finite_mean(values(scored, setting.key, point, "r"))
            cells.append(
                Cell(
                    f"{shown(finite_mean(errors))}, r {r:.3f}",
                    paper=f"{1e3 * printed[point].rmse_m:.0f}, r {printed[point].correlation:.3f}",
                    spread=spread(errors),
                )
            )
        found.append(tuple(cells))
    found.append((Cell("mean"), *(_mean_cell(scored, setting) for setting in settings)))
    return Table(
        "table6-main",
        "3D RMSE in mm, with its spread over the trials, and correlation; the paper's value below.",
        ("position", *(s.label for s in settings)),
        tuple(found),
    )


def _mean_cell(scored: Sequence[TrackedTrial], setting: Setting) -> Cell:
    errors = np.array([values(scored, setting.key, point, "rmse_3d_m") for point in POINTS]) * 1e3
    mean = finite_mean(errors)
    whole = finite_mean([1e3 * p.rmse_m for p in paper.table_6().values()])
    if setting.key != "water":
        return Cell(shown(mean), paper=f"{whole:.0f}", spread=spread(errors.mean(axis=0)))
    return Cell(
        shown(mean),
        paper=f"{whole:.0f}",
        spread=spread(errors.mean(axis=0)),
        bound=f"{TARGET_MM:g}",
        mark="met" if mean <= TARGET_MM else "missed",
    )


def _axes(scored: Sequence[TrackedTrial], setting: Setting) -> Table:
    found = []
    for point in POINTS:
        of = {k: values(scored, setting.key, point, k) for k in next(iter(scored)).points[point]}
        errors = [Cell(shown(1e3 * finite_mean(of[f"rmse_{axis}_m"]))) for axis in "xyz"]
        correlations = [Cell(_r(finite_mean(of[f"r_{axis}"]))) for axis in "xyz"]
        kept = (
            Cell(f"{100 * finite_mean(of['coverage_95']):.0f} %"),
            Cell(shown(finite_mean(of["nees"]), 2)),
        )
        found.append((Cell(point), *errors, *correlations, *kept))
    return Table(
        f"table6-{setting.key.replace('_', '-')}",
        f"{setting.label[0].upper()}{setting.label[1:]}: RMSE in mm and correlation along each axis (x left, y up, z "
        "to the feet), share of samples inside the 95 % band, NEES per coordinate (1 is consistent).",
        ("position", *(f"RMSE {a}" for a in "xyz"), *(f"r {a}" for a in "xyz"), "in 95 % band", "NEES"),
        tuple(found),
        closed=setting.key not in ("indoor", "water"),
    )


def _r(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "constant"
