"""Assembles the report page of a track, for `oarlock.report.write_page`; and the frame of every page."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from html import escape
from importlib.resources import files

from markupsafe import Markup

from oarlock.evaluation.consistency import sensor_scores
from oarlock.evaluation.interval import Interval
from oarlock.evaluation.scores import Evaluation, SensorScore
from oarlock.evaluation.summary import observed_joints
from oarlock.recording.session_info import session_info
from oarlock.report import curves, health, slow, tables, verdict
from oarlock.report.front import Front, belief_markup, front_markup, who_and_when
from oarlock.report.markup import bar_legend, notes_list, rendered
from oarlock.report.section import Section, refuse_doubles, tiles
from oarlock.report.text import capital, day_text
from oarlock.report.trust import Trust, doubtful, trust
from oarlock.storage.epoch import moment_text
from oarlock.tracking.track import Track

POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""Content-Security-Policy of pages without scripts: a browser loads nothing from outside."""
WITH_SCRIPT = f"{POLICY} blob:; script-src 'unsafe-inline'"
"""The same for a page with scripts."""
FOLDED = ("positions", "slow", "provenance")
"""Sections that are folded."""
MEASURED = "How it was measured"
OWN_KEYS = ("measured", "points", "compared")
"""Keys of the page's own parts beside the general sections."""


def render(
    track: Track,
    evaluation: Evaluation | None,
    truth: Track | None,
    title: str | None,
    handed: Sequence[Section] = (),
    front: Front | None = None,
) -> str:
    """The whole page as text; `handed` sections come before "How it was measured", which has the general ones."""
    sensors = sensors_of(track, evaluation)
    own = _sections(track, evaluation, truth, sensors, [note for section in handed for note in section.notes])
    refuse_doubles(handed, [*(key for key, _, _ in own), *OWN_KEYS])
    sentences = [sentence for section in handed for sentence in section.sentences]
    front = front or Front()
    belief = trust(track, evaluation, sensors, front.direct, front.caution)
    heading, rest = heading_of(track, title)
    anchor = "measured-in" if handed else "measured"
    suspects = verdict.suspect_sentences(track.notes)
    answers = front_markup(front, suspects, sentences)
    line = belief_markup(belief, anchor)
    lead = line + rest if belief.level == "bad" else rest + line
    beside = bool(handed) and not handed[0].folded
    # The drawings of a field of application are more useful than the curves of all joints.
    folded = [key for key, _, _ in own if key in FOLDED or (handed and key == "curves")]
    measured = rendered(
        "measured",
        sentences=verdict.sentences(track, evaluation, sensors),
        trust=belief,
        tiles=tiles(verdict.key_figures(track, evaluation)),
        sections=own,
        folded=folded,
    )
    return shell(
        heading,
        lead if beside else lead + answers,
        [
            *((section.key, section.name, section.markup) for section in handed),
            ("measured", MEASURED, measured),
        ],
        definitions(),
        folded=[*(section.key for section in handed if section.folded), *(["measured"] if handed else [])],
        style="\n".join(dict.fromkeys(section.style for section in handed)),
        scripts=tuple(dict.fromkeys(section.script for section in handed if section.script)),
        answers=answers if beside else "",
    )


def sensors_of(track: Track, evaluation: Evaluation | None) -> tuple[SensorScore, ...]:
    """The scores of all sensors, over the time of the evaluation if there is one."""
    return evaluation.sensors if evaluation else sensor_scores(track, Interval.after(track.time_s, 0.0))


def belief_of(track: Track, direct: str = "", caution: str = "") -> Trust:
    """Whether a track without a reference can be believed; `direct` and `caution` as of `trust`."""
    return trust(track, None, sensors_of(track, None), direct, caution)


def doubtful_sensors(track: Track) -> list[str]:
    """Names of the sensors that differ from the prediction by more than twice what is expected."""
    return [one.name for one in doubtful(sensors_of(track, None))]


def who_in_words(provenance: Mapping[str, object]) -> str:
    """The athlete and the day as people write it, such as "A07, 1 May 2026"; "" if neither is known."""
    info = session_info(provenance)
    return ", ".join(filter(None, (info.get("athlete", ""), day_text(info.get("date", "")))))


def heading_of(track: Track, title: str | None) -> tuple[str, str]:
    """The title of a page, who and when first, and the rest of the session as markup."""
    what = (
        title or f"Track of {getattr(track.model, 'name', None) or track.provenance.get('model', 'a model')}"
    )
    day = moment_text(track.provenance.get("epoch"), float(track.time_s[0]))[:10]
    session = {**({"date": day} if day else {}), **session_info(track.provenance)}
    who, (_, rest) = who_in_words({"session": session}), who_and_when(track.provenance)
    if not session.get("athlete"):
        rest = ", ".join(filter(None, (rest, "athlete not named")))
    rest = capital(rest)
    return (f"{who}: {what}" if who else what), f'<p class="about">{escape(rest)}</p>' if rest else ""


def shell(
    heading: str,
    lead: str,
    sections: Sequence[tuple[str, str, str]],
    definitions: str = "",
    style: str = "",
    scripts: Sequence[str] = (),
    folded: Collection[str] = (),
    answers: str = "",
) -> str:
    """A page with a heading, a summary, and sections (key, name, markup) with links to them.

    Sections whose key is in `folded` show only their heading until the reader opens them. `answers`, markup, stands
    beside the first section where the page is wide, and before it on a telephone.
    """
    policy = WITH_SCRIPT if scripts or any("<script" in content for _, _, content in sections) else POLICY
    return rendered(
        "page",
        heading=heading,
        lead=_unbroken(lead),
        sections=[(key, name, _unbroken(content)) for key, name, content in sections],
        folded=folded,
        answers=_unbroken(answers),
        definitions=definitions,
        style=files(__package__).joinpath("style.css").read_text(encoding="utf-8") + style,
        scripts=scripts,
        policy=policy,
    )


def _unbroken(markup: str) -> str:
    """Prevent line breaks between a number and its percent sign, except in scripts."""
    pieces = re.split(r"(<script\b.*?</script>)", markup, flags=re.S)
    return "".join(
        piece if piece.startswith("<script") else piece.replace(" %", "\N{NO-BREAK SPACE}%")
        for piece in pieces
    )


def _sections(
    track: Track,
    evaluation: Evaluation | None,
    truth: Track | None,
    sensors: tuple[SensorScore, ...],
    notes: Sequence[str],
) -> list[tuple[str, str, str]]:
    nees = tables.states_sentence(evaluation.states if evaluation else None)
    sections = [
        ("notes", "Notes", _notes(track, notes)),
        ("joints", "Joints", tables.joints_table(track, evaluation) + nees),
        ("curves", "Curves", curves.curves_section(track, truth, evaluation)),
    ]
    if sensors:
        explanation = (
            '<p class="hint">NIS per reading over time, averaged over 0.5 s, on a logarithmic scale. '
            "If the model is right, it is inside the tinted band around 1 for 95 % of the time."
            f"{' The values are those of the filter, before smoothing.' if track.smoothed else ''}</p>"
        )
        legend = bar_legend((style, style) for style in ("used", "rejected", "missing"))
        drawings = health.health_section(track, sensors)
        content = health.health_table(sensors) + legend + explanation + drawings
        sections.append(("health", "Sensor health", content))
    if evaluation and evaluation.positions:
        sections.append(("positions", "Positions", tables.positions_table(evaluation.positions)))
    if track.slow:
        hint = '<p class="hint">Biases and other slowly changing quantities, each with its 95 % band.</p>'
        sections.append(("slow", "Slow states", hint + slow.slow_section(track, truth)))
    provenance = tables.provenance_list(track.provenance) if track.provenance else "<p>None recorded.</p>"
    sections.append(("provenance", "Provenance", provenance))
    return sections


def _notes(track: Track, others: Sequence[str]) -> str:
    notes: list[str] = list(track.notes)
    nominal = [str(name) for name in track.provenance.get("nominal_mounts", ())]
    if nominal and not any("nominal" in note for note in notes):
        notes.append(
            f"Nominal mounts are assumed (not calibrated): {', '.join(nominal)}. Run oarlock calibrate."
        )
    seen = observed_joints(track)
    unobserved = [n for n in track.joint_names if n not in seen and not any(n in note for note in notes)]
    if unobserved:
        notes.append(f"Not observed: {', '.join(unobserved)}.")
    return notes_list([*map(Markup, others), *notes]) if notes or others else "<p>No notes.</p>"


def definitions() -> str:
    """Hidden drawings for reference by others: hatching, clipping rectangles."""
    hatch = (
        '<svg class="definitions" width="0" height="0" aria-hidden="true">'
        '<pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
        '<path class="hatch" d="M0 0V6"/></pattern></svg>'
    )
    return hatch + curves.clip_definition() + slow.clip_definition()
