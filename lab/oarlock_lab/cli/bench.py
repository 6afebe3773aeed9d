"""`oarlock lab bench`: measures speed and latency on this machine, for users and developers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from oarlock.cli.show import show_document
from oarlock.cli.terminal import UsageError, progress
from oarlock.cli.verbs import command

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
    command(
        app,
        "oarlock lab bench",
        "oarlock lab bench --duration-s 60",
        "oarlock lab bench --json | jq .ukf_ratio_to_textbook",
        epilog=f"\b\n{_KEYS}",
        show=_show,
    )(bench)


def bench(*, duration_s: float = 20.0) -> Bench:
    """Measure steps per second, latency and threads, and compare with a textbook filter and other software.

    Args:
        duration_s: approximate total time of all measurements.
    """
    from oarlock_lab.bench.measure import measure

    if not 0.0 < duration_s < 3600.0:
        raise UsageError(
            f"--duration-s {duration_s:g}: expected more than 0 and less than 3600, for example 20"
        )
    return measure(duration_s, progress)


def _show(bench: Bench) -> None:
    from oarlock_lab.bench.measure import PAPER, REFERENCE_TEXTBOOK_US

    figures, joints = bench.to_dict(), bench.joints
    missing = figures["missing"]
    timed = (
        (joints, bench.latency, bench.whole),
        (bench.with_biases, bench.latency_with_biases, bench.whole_with_biases),
    )
    software = [("Oarlock, ukf", figures["ukf_steps_s"], f"{joints.n} states, {joints.m} readings")]
    software += [
        (f"{timing.name} ({timing.package})", timing.steps_s, timing.problem) for timing in bench.others
    ]
    paper = f"{PAPER.n} states, {PAPER.m} readings; {PAPER.machine}"
    software.append((f"the paper, {PAPER.program}", PAPER.steps_s, paper))
    software.sort(key=lambda row: -row[1])
    show_document(
        {
            **figures["machine"],
            "cores": bench.threads.cores,
            "real time": f"{figures['times_real_time']:.0f} times faster than sensors at {figures['rate_hz']:g} Hz",
            **{f"a sculler, {race.n} states, {race.m} readings, one core": _race(race) for race, *_ in timed},
            "live step from Python": [
                {
                    "states": race.n,
                    **{name.replace("p99_9", "p99.9"): us for name, us in vars(latency).items()},
                }
                for race, latency, _ in timed
            ],
            "whole recordings, a sample": [
                {
                    "states": race.n,
                    "track_us": whole.track_us,
                    "of a step": whole.track_us / race.filters["ukf"].us_p10,
                    "smooth_us": whole.smooth_us,
                    "of track": whole.smooth_us / whole.track_us,
                }
                for race, _, whole in timed
            ],
            "full body, live": {"states": figures["full_body"].pop("n"), **figures["full_body"]},
            f"two threads, {bench.with_biases.n} states": {
                "samples/s of one": bench.threads.single_steps_s,
                "samples/s of two": bench.threads.two_steps_s,
                "times faster": bench.threads.ratio,
            },
            "other software": [
                {"software": name, "steps/s": steps_s, "problem": problem}
                for name, steps_s, problem in software
            ],
            "notes": [
                f"The textbook's UKF is the same filter with dense matrices; {REFERENCE_TEXTBOOK_US:.0f} us at "
                "41 states on one core of a 3.7 GHz Zen 4. If it is slower on this machine, compare times instead of "
                "ratios.",
                *(
                    f"{failure.package} {failure.version} does not run: {failure.reason}"
                    for failure in bench.failed
                ),
                *(
                    [f"Not installed: {', '.join(missing)}; {figures['install']} adds them"]
                    if missing
                    else ()
                ),
            ],
        }
    )


def _race(race: Race) -> list[dict[str, Any]]:
    return [
        {
            "filter": name.replace("_", " "),
            "steps/s": 1e6 / step.us,
            "us": step.us,
            "us p10": step.us_p10,
            "times textbook": race.textbook.us / step.us,
            "times textbook p10": race.textbook.us_p10 / step.us_p10,
        }
        for name, step in {**race.filters, "textbook's UKF": race.textbook}.items()
    ]
