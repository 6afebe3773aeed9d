"""The page of `oarlock calibrate session`: results, their uncertainty, and the steps to repeat."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oarlock.recording.calibration import Calibration
from oarlock.report.markup import bar_legend, rendered, table
from oarlock.report.page import shell
from oarlock.report.section import KeyFigure, tiles
from oarlock.report.text import DASH, breakable, fixed, listing, number, plural
from oarlock.report.worn_picture import worn_section
from oarlock.storage.errors import DataError
from oarlock.storage.write_file import write_file

if TYPE_CHECKING:
    from oarlock._core import Model

STYLES = {"pass": "good", "redo": "bad", "kept": "open"}
WORDS = {"pass": "pass", "redo": "do again", "kept": "kept"}
MARKS = {"pass": "✓", "redo": "✗", "kept": "·"}
WIDTH, BAR, ROW = 900.0, 14.0, 24.0

Check = Mapping[str, Any]


def write_session_page(
    calibration: Calibration,
    path: str | Path,
    model: Model | None = None,
    pose: Mapping[str, float] | None = None,
) -> Path:
    """Write the page of a calibration that `oarlock.calibration.calibrate_session` made; works offline and on paper.

    Args:
        calibration: of the session.
        path: of the page.
        model: the body; with it the page has a picture of the units on the body.
        pose: the still pose of the picture by coordinate, rad and m; the others are as at rest.

    Raises:
        DataError: the calibration was not made by a session.
    """
    write_file(Path(path), session_page(calibration, model, pose))
    return Path(path)


def session_page(
    calibration: Calibration, model: Model | None = None, pose: Mapping[str, float] | None = None
) -> str:
    """The whole page as text; see `write_session_page`.

    Raises:
        DataError: the calibration was not made by a session.
    """
    session = calibration.noted.get("session")
    if not isinstance(session, Mapping):
        raise DataError(
            'this calibration was not made by a session (noted["session"] is missing). '
            "Make one with oarlock.calibration.calibrate_session"
        )
    checks: Sequence[Check] = session["check"]
    again = [c for c in checks if c["outcome"] == "redo"]
    sections = [("worn", "Units on the body", worn_section(calibration, model, pose))] if model else []
    if again:
        repeated = rendered("session_again", checks=[(check, _figures_of(check)) for check in again])
        sections.append(("again", "Steps to repeat", repeated))
    sections.append(("steps", "Steps", _steps(session)))
    sections.append(("units", "Sensors", _units(checks)))
    units = {c["subject"] for c in checks if c["what"] == "mount"}
    others = [c for c in checks if not c["subject"] or c["subject"] not in units]
    if others:
        sections.append(("others", "Streams and magnetic field", _table("others", "", others, "about")))
    sections.append(("reading", "How to read this page", rendered("session_reading")))
    steps = list(dict.fromkeys(str(c["step"]) for c in again))
    failing = list(dict.fromkeys(str(c["subject"]) for c in again if c["subject"]))
    failed = plural(len(again), "check") if again else ""
    said = rendered("session_lead", failed=failed, steps=listing(steps), units=listing(failing))
    lead = f'<div class="lead">{said}</div>{_figures(checks)}'
    return shell(f"Calibration session: {session['plan']}", lead, sections)


def _figures(checks: Sequence[Check]) -> str:
    passed = sum(c["outcome"] == "pass" for c in checks)
    cards = [KeyFigure("checks", f"{passed} of {len(checks)}", "passed")]
    for what, name, unit in (
        ("mount", "worst mount", "deg"),
        ("gyroscope's bias", "worst gyroscope", "mrad/s"),
    ):
        stds = [(c["std"], c["subject"], c["limit"]) for c in checks if c["what"] == what and "std" in c]
        if stds:
            std, subject, limit = max(stds)
            detail = f"{subject}; limit {number(limit, 2)} {unit}"
            cards.append(KeyFigure(name, f"± {number(std, 2)} {unit}", detail))
    field = next((c for c in checks if c["what"] == "magnetic field"), None)
    if field is not None:
        strength, _, direction = field["found"].partition(", ")
        cards.append(KeyFigure("magnetic field", strength, direction))
    return tiles(cards)


def _figures_of(check: Check) -> str:
    parts = [f"found {check['found']}"] if check["found"] != "-" else []
    parts += [f"± {number(check['std'], 2)} {check['unit']}"] if "std" in check else []
    parts += [f"limit {number(check['limit'], 2)} {check['unit']}"] if "limit" in check else []
    return "; ".join(parts)


# --- steps --------------------------------------------------------------------------------------------


def _steps(session: Mapping[str, Any]) -> str:
    rows = []
    for k, step in enumerate(session["step"], 1):
        times = f"{fixed(step['start_s'], 1)} to {fixed(step['end_s'], 1)}" if "start_s" in step else DASH
        asked = f'<span class="printed">{escape(step["say"])}</span>' if step["say"] else ""
        outcome_text = escape(step["sentence"]) + asked
        rows.append([f"{k}. {escape(step['name'])}", times, _outcome(step["outcome"]), outcome_text])
    listed = table(
        "steps-list",
        "In the order of the plan; times of the recording.",
        ["step", "time s", "", "result, and the instruction"],
        rows,
    )
    return f'{_timeline(session["step"])}<div class="session">{listed}</div>'


def _timeline(steps: Sequence[Mapping[str, Any]]) -> str:
    """The found steps over time, one row each; they are distinguishable without colour."""
    found = [s for s in steps if "start_s" in s]
    if not found:
        return ""
    last = max(s["end_s"] for s in found)
    left, height = 210.0, ROW * len(found) + 26.0
    scale = (WIDTH - left - 10.0) / last

    def bar(k: int, step: Mapping[str, Any]) -> str:
        x, width = left + scale * step["start_s"], max(2.0, scale * (step["end_s"] - step["start_s"]))
        style = "used" if step["kind"] in ("pose", "still") else "moving"
        y = ROW * k
        return (
            f'<text class="strip-name" x="{left - 10:.0f}" y="{y + 15:.0f}" text-anchor="end">'
            f'{escape(step["name"])}</text><rect class="{style}" x="{x:.1f}" y="{y + 4:.1f}" '
            f'width="{width:.1f}" height="{BAR:.0f}" rx="3"/>'
        )

    every = 20.0 if last < 200.0 else 60.0
    ticks = "".join(
        f'<path class="grid" d="M{left + scale * t:.1f} 0V{height - 20:.0f}"/>'
        f'<text x="{left + scale * t:.1f}" y="{height - 5:.0f}" text-anchor="middle">{t:.0f} s</text>'
        for t in (every * k for k in range(math.floor(last / every) + 1))
    )
    bars = "".join(bar(k, s) for k, s in enumerate(found))
    keys = bar_legend((("used", "held still"), ("moving", "moving")))
    return (
        f'<figure class="timeline">{keys}<svg viewBox="0 0 {WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="Time of each step">{ticks}{bars}</svg></figure>'
    )


# --- units --------------------------------------------------------------------------------------------


def _units(checks: Sequence[Check]) -> str:
    names = [c["subject"] for c in checks if c["what"] == "mount"]
    blocks = []
    for k, name in enumerate(names):
        own = [c for c in checks if c["subject"] == name]
        bad = sum(c["outcome"] == "redo" for c in own)
        word = f'<span class="verdict bad">{plural(bad, "check")} to do again</span>' if bad else ""
        blocks.append(f"<h3>{breakable(name)} {word}</h3>{_table(f'unit-{k}', '', own, 'what')}")
    return "".join(blocks)


def _table(key: str, caption: str, checks: Sequence[Check], first: str) -> str:
    rows = []
    for c in checks:
        label = c["what"] if first == "what" else f"{c['subject']} {c['what']}".strip()
        about = c["step"] if c["what"] in ("movement", "posture", "zero", "sign", "zero and scale") else ""
        head = escape(label) + (f' <span class="spread">{escape(about)}</span>' if about else "")
        found = escape(c["found"]) if c["found"] != "-" else DASH
        std, limit = (number(c[key], 2) if key in c else DASH for key in ("std", "limit"))
        end = [escape(c["unit"]), _outcome(c["outcome"]), escape(c["sentence"])]
        rows.append([head, found, std, limit, *end])
    listed = table(key, caption, [first, "found", "std", "limit", "unit", "", "in words"], rows)
    return f'<div class="session">{listed}</div>'


def _outcome(outcome: str) -> str:
    return f'<span class="verdict {STYLES[outcome]}">{MARKS[outcome]} {WORDS[outcome]}</span>'
