"""The ready questions: macros and views of `views.sql`, with one line each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Question:
    """A ready question.

    Args:
        name: of the macro or view.
        line: what it answers.
        of_metric: whether it is asked of one metric, and of a range of stroke rates.
        compares: whether it brings numbers of several recordings together, so that they must be comparable.
        is_macro: whether it is called with parentheses.
    """

    name: str
    line: str
    of_metric: bool = True
    compares: bool = True
    is_macro: bool = True

    def sql(self, metric: str | None = None, low: float | None = None, high: float | None = None) -> str:
        """The statement that asks it; the metric is the name of a column."""
        if not self.is_macro:
            return f"FROM {self.name}"
        if not self.of_metric:
            return f"FROM {self.name}()"
        assert metric is not None
        given = {"rate_from": low, "rate_to": high}
        rates = "".join(f", {name} := {value!r}" for name, value in given.items() if value is not None)
        return f"FROM {self.name}('{metric}'{rates})"


QUESTIONS = (
    Question("trend", "Mean of each month, with its band; one row an athlete and month."),
    Question("changes", "Change a month over the time asked for, with its band; one row an athlete."),
    Question("drift", "Last third of a session against its first, at equal rate; one row an athlete."),
    Question("consistency", "Standard deviation within a piece against the rate, in classes of 2/min."),
    Question("same_rate", "Athletes compared at the same rate, in classes of 2/min."),
    Question("sides", "Right against left; one row an athlete."),
    Question("rig", "After a change of rig against before, 60 days each; one row an athlete and change."),
    Question("crew", "Catch relative to the stroke seat; one row a seat and month.", of_metric=False),
    Question(
        "sensor_health",
        "Numbers about the sensors by athlete and month.",
        of_metric=False,
        compares=False,
        is_macro=False,
    ),
    Question(
        "failed",
        "Recordings without a result, and why.",
        of_metric=False,
        compares=False,
        is_macro=False,
    ),
    Question(
        "classes",
        "Classes of runs: numbers are compared only within one.",
        of_metric=False,
        compares=False,
        is_macro=False,
    ),
    Question("sessions", "Mean, standard error and scatter; one row a recording."),
    Question("session_drifts", "Last third against first; one row a recording."),
    Question("outings", "Catch relative to the stroke seat; one row a recording.", of_metric=False),
)
"""All ready questions that a season answers, with one line each."""
