"""`oarlock lab bench`: measures speed and latency on this machine, for users and developers."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Annotated

import typer

from oarlock.cli.options import Json, example
from oarlock.cli.terminal import UsageError, heading, pairs, print_json, progress, say, table, verb

if TYPE_CHECKING:
    from oarlock_lab.bench.measure import Bench
    from oarlock_lab.bench.own import Race

_KEYS = """\
Keys of --json (times in us are medians, each filter's steps are 1e6 / time):
  n, m                         states and readings of the sculler, joints and azimuth alone
  ukf_steps_s, ekf_steps_s, factorised_steps_s    steps per second inside the engine, one core
  ukf_us, ukf_us_p10, ...      time of a step: median and 10 % quantile
  bare_ukf_steps_s, ...        the same without gates, like the textbook filter
  textbook_us, textbook_us_p10                 the textbook unscented filter, same process
  ukf_ratio_to_textbook, ...   textbook_us divided by the filter's
  ukf_ratio_to_textbook_p10, ...               the same for the 10 % quantiles, more stable on a busy machine
  p50_us, p99_us, p99_9_us     of Tracker.step called from Python, default filter
  track_us, smooth_us          processor time of a sample of a whole recording: tracked; one smoothing pass after that
  times_real_time, rate_hz     ukf_steps_s divided by the rate of the sensors
  with_biases                  the same keys with biases and surge as states
  full_body                    a person with 16 units, live: n states, units, step_us, times_real_time; start_us,
                               start_times_real_time: the mean of its first 30 s, with all start hypotheses
  one_thread_steps_s, two_threads_steps_s, two_threads_ratio, cores    by track_many
  paper, usual_textbook_us     the paper's figure; the textbook filter on a 3.7 GHz Zen 4, us
  others, failed               other software: results, and packages that do not run
  missing, install             packages not found, and how to install them
  machine                      processor, system, versions"""


def add_to(app: typer.Typer) -> None:
    """Registers the verb."""
    app.command(
        "bench",
        epilog=example(
            "oarlock lab bench",
            "oarlock lab bench --duration-s 60",
            "oarlock lab bench --json | jq .ukf_ratio_to_textbook",
        )
        + "\n\n\b\n"
        + _KEYS,
    )(bench)


@verb
def bench(
    seconds: Annotated[
        float, typer.Option("--duration-s", metavar="S", help="Approximate total time of all measurements.")
    ] = 20.0,
    json_output: Json = False,
) -> None:
    """Measure steps per second, latency and threads, and compare with a textbook filter and other software."""
    from oarlock_lab.bench.measure import measure

    if not 0.0 < seconds < 3600.0:
        raise UsageError(f"--duration-s {seconds:g}: expected more than 0 and less than 3600, for example 20")
    found = measure(seconds, _told)
    if json_output:
        print_json(found.to_dict())
        return
    _write(found)


def _told(what: str) -> AbstractContextManager[object]:
    return progress(what)


def _write(found: Bench) -> None:
    from oarlock_lab.bench.measure import machine

    here = machine()
    say("Performance of this machine", style="bold")
    pairs(
        [
            *((key, here[key]) for key in ("processor", "system", "python", "oarlock")),
            ("cores", found.threads.cores),
        ]
    )
    for timed in (found.joints, found.with_biases):
        _write_race(timed)
    _write_live(found)
    _write_whole(found)
    _write_others(found)


def _write_race(timed: Race) -> None:
    heading(
        f"A sculler, {timed.n} states, {timed.m} readings",
        "one core, inside the engine; medians, and 10 % quantiles (p10)",
    )
    rows = [
        (name.replace("_", " "), step, f"{timed.ratio(name):.1f} ({timed.ratio_p10(name):.1f}) times")
        for name, step in timed.filters.items()
    ]
    table(
        ["filter", ">steps/s", ">us", ">us p10", ">faster than textbook (p10)"],
        [
            (name, f"{1e6 / step.us:.0f}", f"{step.us:.1f}", f"{step.us_p10:.1f}", ratio)
            for name, step, ratio in (*rows, ("textbook's UKF", timed.textbook, ""))
        ],
    )


def _write_live(found: Bench) -> None:
    from oarlock_lab.bench.measure import USUAL_TEXTBOOK_US

    say(
        f"textbook's UKF: the same filter with dense matrices; {USUAL_TEXTBOOK_US:.0f} us at 41 states on one core\n"
        "of a 3.7 GHz Zen 4. If it is slower on this machine, compare times instead of ratios.",
        style="dim",
        indent=2,
    )
    heading("Live step from Python", "Tracker.step, including belief and report, us")
    table(
        [">states", ">p50", ">p99", ">p99.9", ">steps"],
        [
            (timed.n, f"{x.p50_us:.1f}", f"{x.p99_us:.1f}", f"{x.p99_9_us:.1f}", x.steps)
            for timed, x in ((found.joints, found.latency), (found.with_biases, found.latency_with_biases))
        ],
    )


def _write_whole(found: Bench) -> None:
    from oarlock_lab.bench.problem import RATE_HZ

    heading(
        "Whole recordings",
        "oarlock.track, then one pass of oarlock.smooth; us a sample",
    )
    table(
        [">states", ">track", ">of a step", ">smooth", ">of track"],
        [
            (
                timed.n,
                f"{one.track_us:.1f}",
                f"{one.track_us / timed.filters['ukf'].us_p10:.2f}",
                f"{one.smooth_us:.1f}",
                f"{one.smooth_us / one.track_us:.2f}",
            )
            for timed, one in ((found.joints, found.whole), (found.with_biases, found.whole_with_biases))
        ],
    )
    say()
    body = found.body
    speed = 1e6 / found.joints.filters["ukf"].us
    pairs(
        [
            ("real time", f"{speed / RATE_HZ:.0f} times faster than sensors at {RATE_HZ:.0f} Hz"),
            (
                "full body",
                f"{body.units} units, {body.n} states: {body.step_us:.0f} us a step, {body.times_real_time:.1f} times "
                f"faster than real time, {body.start_times_real_time:.1f} times over its start",
            ),
            (
                "two threads",
                f"{found.threads.two_steps_s:.0f} samples/s, one: {found.threads.one_steps_s:.0f}; "
                f"{found.threads.ratio:.2f} times (track_many, {found.with_biases.n} states)",
            ),
        ]
    )


def _write_others(found: Bench) -> None:
    from oarlock_lab.bench.measure import PAPER
    from oarlock_lab.bench.others import INSTALL

    heading("Other software")
    timed = found.joints
    rows = [("Oarlock, ukf", 1e6 / timed.filters["ukf"].us, f"{timed.n} states, {timed.m} readings")]
    rows += [(f"{one.name} ({one.package} {one.version})", one.steps_s, one.problem) for one in found.others]
    asked = f"{PAPER.n} states, {PAPER.m} readings; {PAPER.machine}"
    rows.append((f"the paper, {PAPER.program}", PAPER.steps_s, asked))
    rows.sort(key=lambda row: -row[1])
    table(["software", ">steps/s", "problem"], [(name, f"{rate:.0f}", asked) for name, rate, asked in rows])
    for failure in found.failed:
        say(f"{failure.package} {failure.version} does not run: {failure.reason}", style="dim", indent=2)
    if found.missing:
        names = ", ".join(software.package for software in found.missing)
        say(f"not installed: {names}; {INSTALL} adds them", style="dim", indent=2)
