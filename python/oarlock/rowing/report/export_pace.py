"""The sections "Pace" and "Heart rate" of an export: charts over time, the pieces that were rowed, and splits."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from oarlock.report import Axis, Column, Section, Series, course_chart, fixed, grid, plain_table
from oarlock.rowing.alongside.course import SpeedProfile, Split, pieces_of, splits_of, starts_of
from oarlock.rowing.alongside.paces import clock_text, pace_text
from oarlock.rowing.report.export_force import after_start

_PAUSE_MIN = 0.5
"""Charts over time have a gap there."""
_GAP_SHARE = 0.01
"""Drawings thin out long series to some hundred points: a gap of this share of them stays visible."""
_SMOOTH = 5
"""Strokes of a running median in charts of heart rate and pace: single outliers of receivers would set the scale."""
_MOST_PIECES = 12
_RACE_SPLITS = 4
_RACE = (
    '<p class="hint">Championship races over 2000 m: the four quarters at 103.3, 99.0, 98.3 and 99.7 % of the mean '
    "speed on the water, 101.5, 99.8, 99.0 and 99.7 % on ergometers (Garland 2005, doi 10.1136/bjsm.2003.010801)."
    "{start}</p>"
)
_AGAINST = "Rate, power and heart rate: medians. Against mean: slower (+) or faster (−) than the mean"
_AFTER = "after the start"
_WIDE = 24.0
"""Half the width of the bars, px."""
_NAMES = {
    "rate_per_min": ("rate", "/min", 1),
    "power_w": ("power", "W", 0),
    "heart_rate_per_min": ("heart rate", "/min", 0),
    "peak_force_n": ("peak force", "N", 0),
    "curve_peak_force_n": ("peak force", "N", 0),
}


def pace_section(course: SpeedProfile) -> Section | None:
    """Speed, rate and power over time, the pieces and the splits; None without speed and distance."""
    if "speed_m_s" not in course.values and not np.isfinite(course.clock.distance_m).any():
        return None
    caption = "Speed through the water" if course.through_water else "Speed"
    charts = [
        _over_time(f"pace-{name.partition('_')[0]}", title, course, name, unit)
        for name, title, unit in (
            ("speed_m_s", caption, "m/s"),
            ("rate_per_min", "Stroke rate", "1/min"),
            ("power_w", "Power", "W"),
        )
        if name in course.values
    ]
    tables = _pieces_table(course) + _splits_table(course)
    return Section("pace", "Pace", tables + grid([chart for chart in charts if chart]))


def heart_section(course: SpeedProfile) -> Section | None:
    """Heart rate over time; None without it."""
    if "heart_rate_per_min" not in course.values:
        return None
    heart = course.values["heart_rate_per_min"][course.steady]
    known = heart[np.isfinite(heart)]
    chart = _over_time("heart-rate-course", "Heart rate", course, "heart_rate_per_min", "1/min")
    if not chart:
        return None
    share = 100.0 * len(known) / len(heart)
    said = (
        f"Mean {fixed(float(known.mean()), 0)}, highest {fixed(float(known.max()), 0)} beats a minute, as the device "
        f"received it, in {fixed(share, 0)} % of the rowed {'strokes' if course.is_strokes else 'points'}"
        f"{after_start(course)}."
    )
    return Section("heart-rate", "Heart rate", f"<p>{escape(said)}</p>{grid([chart])}")


def _over_time(key: str, caption: str, course: SpeedProfile, name: str, unit: str) -> str:
    good = np.isfinite(course.time_s) & np.isfinite(course.values[name]) & course.counted
    if good.sum() < 2:
        return ""
    minutes = (course.time_s[good] - course.time_s[good][0]) / 60.0
    # a running median, whose ends repeat
    padded = np.pad(course.values[name][good], _SMOOTH // 2, mode="edge")
    middle = np.median(np.lib.stride_tricks.sliding_window_view(padded, _SMOOTH), axis=1)
    pauses = np.flatnonzero(np.diff(minutes) > _PAUSE_MIN) + 1
    gaps = np.repeat(pauses, 1 + int(_GAP_SHARE * len(minutes)))
    minutes, middle = np.insert(minutes, gaps, minutes[gaps]), np.insert(middle, gaps, np.nan)
    return course_chart(
        key, caption, [Series(caption, minutes, middle)], Axis("time", "min"), Axis("", unit, least=1.0)
    )


def _pieces_table(course: SpeedProfile) -> str:
    """What was rowed between pauses; the longest pieces if there are many."""
    pieces, starts = pieces_of(course), starts_of(course)
    if len(pieces) < 2:
        return ""
    shown = sorted(sorted(pieces, key=lambda one: -one.duration_s)[:_MOST_PIECES], key=pieces.index)
    rest = [one for one in pieces if one not in shown]
    caption = (
        "What was rowed between pauses; small: how long the pause before it was, if the clock ran. Pace is distance "
        "over time; waiting, drifting and paddling count nowhere. "
        f"{'Starts stand apart. ' if starts else ''}{_AGAINST} of all pieces{after_start(course)}."
    )
    foot = [_joined(f"{len(rest)} shorter", rest)] if rest else []
    if starts:
        foot.append(_joined(starts[0].name if len(starts) == 1 else f"{len(starts)} starts", starts))
    return _table("pace-pieces", caption, course, shown, [*foot, *_sums(pieces, starts)])


def _splits_table(course: SpeedProfile) -> str:
    """The splits of the only piece, or of the longest one."""
    splits, many = splits_of(course), len(course.stretches) > 1
    if len(splits) < 2:
        return ""
    begun = 1 if course.longest and course.longest.start else 0
    starts, steady = splits[:begun], splits[begun:]
    k = course.stretches.index(course.longest) + 1 if many and course.longest else 0
    whose = f"Piece {k}, the longest. " if many else "The rowed part. "
    caption = f"{whose}{_AGAINST} of the piece{' after its start' if starts else ''}."
    table = _table("pace-splits", caption, course, splits, _sums(steady, starts), begun)
    raced = len(steady) == _RACE_SPLITS and steady[0].name == "to 500 m"
    if not raced:
        return table
    return table + _RACE.format(start=" The first one contains the start." if starts else "")


def _sums(steady: Sequence[Split], starts: Sequence[Split]) -> list[Split]:
    """The sums below a table: what is rowed after the starts, which paces are compared with, and everything."""
    whole = _joined("together", [*starts, *steady])
    if not starts:
        return [whole]
    return [_joined(_AFTER + ("s" if len(starts) > 1 else ""), steady), whole]


def _joined(name: str, parts: Sequence[Split]) -> Split:
    return Split(
        name,
        sum(one.strokes for one in parts),
        sum(one.duration_s for one in parts),
        sum(one.distance_m for one in parts),
        {},
    )


def _table(
    key: str,
    caption: str,
    course: SpeedProfile,
    parts: Sequence[Split],
    foot: Sequence[Split],
    begun: int = 0,
) -> str:
    """Rows of parts, of which the first `begun` are starts, and of sums below."""
    held = [name for name in _NAMES if name in course.values]
    heads = [
        Column("part"),
        Column("pace", "/500 m"),
        Column("against mean", "s"),
        Column("time", "min:s"),
    ]
    heads += [Column(*_NAMES[name][:2]) for name in held]
    heads.append(Column("distance", "m"))
    if course.is_strokes:
        heads.append(Column("strokes"))
    mean_s = _pace_s(next((one for one in foot if one.name.startswith(_AFTER)), foot[-1]))
    apart_s = [np.nan if k < begun else _pace_s(one) - mean_s for k, one in enumerate(parts)]
    widest_s = max((abs(one) for one in apart_s if np.isfinite(one)), default=1.0)
    rows = [
        _row(one, held, course.is_strokes, _apart(late_s, widest_s))
        for one, late_s in zip(parts, apart_s, strict=True)
    ]
    feet = [_row(one, held, course.is_strokes, "") for one in foot]
    return plain_table(key, caption, heads, rows, foot=feet, style="splits")


def _row(part: Split, held: Sequence[str], is_strokes: bool, apart: str) -> list[str]:
    cells = [_named(part), pace_text(part.speed_m_s), apart, clock_text(part.duration_s, tenths=True)]
    cells += [fixed(part.medians[name], _NAMES[name][2]) if part.medians else "" for name in held]
    cells += [fixed(part.distance_m, 0), *([str(part.strokes)] if is_strokes else [])]
    return cells


def _named(part: Split) -> str:
    """The name of a part, and the pause before it."""
    if part.pause_s == 0.0:
        return escape(part.name)
    pause = f"after {clock_text(part.pause_s)}" if np.isfinite(part.pause_s) else "after a pause"
    return f"{escape(part.name)} <small>{pause}</small>"


def _pace_s(part: Split) -> float:
    return 500.0 / part.speed_m_s if part.speed_m_s > 0.0 else float("nan")


def _apart(late_s: float, widest_s: float) -> str:
    """Slower or faster than the mean in s for 500 m, with a bar to the right or left."""
    if not np.isfinite(late_s):
        return ""
    wide = _WIDE * min(abs(late_s) / max(widest_s, 1e-9), 1.0)
    left, sign = (_WIDE, "+") if late_s > 0.0 else (_WIDE - wide, "")
    style = "slower" if late_s > 0.0 else "faster"
    text = fixed(late_s, 1)
    return (
        f'<svg class="apart" viewBox="0 0 {2 * _WIDE:.0f} 12" width="{2 * _WIDE:.0f}" height="12" aria-hidden="true">'
        f'<rect class="{style}" x="{left:.1f}" y="2" width="{wide:.1f}" height="8"/><path d="M{_WIDE:.0f} 0V12"/></svg>'
        f" {sign if text.strip('0.') else ''}{text}"
    )
