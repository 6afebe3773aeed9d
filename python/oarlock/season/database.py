"""`Database`: the tables of a season as views of DuckDB, in memory, with the ready questions as macros."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from oarlock.rowing.crew.matching import delays
from oarlock.rowing.crew.seats import seat_place
from oarlock.season.athletes import check_scope
from oarlock.season.store import Season, in_threads, not_in_season
from oarlock.season.tables import KEYS, Catalogue, athlete_rows, recording_rows, run_rows, update_tables
from oarlock.storage.errors import DataError
from oarlock.storage.suggest import did_you_mean

if TYPE_CHECKING:
    import pyarrow as pa

_SETTINGS: dict[str, Any] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "allow_community_extensions": False,
    "python_enable_replacements": False,
    "temp_directory": "",
}
SIDED = " right minus left"
"""Ends the name of a metric of which both sides are compared."""
_UNIT = re.compile(r"_(rad|deg|per_min|m_s2|m_s|rad_s|m2|s|m|w|n|j)$")
_RATES = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*(?:-|to|\.\.)\s*(\d+(?:\.\d+)?)\s*$")
_LEAST_VARIANCE = 1e-24


@dataclass(frozen=True)
class Selection:
    """Which rows of a season are asked; None does not restrict.

    Args:
        athlete: pseudonym.
        boat: as in `session.toml`.
        comparable: class of runs.
        since: first day, UTC.
        until: last day, UTC.
        scope: only athletes who consent to this use: `coaching`, `research` or `sharing`.
    """

    athlete: str | None = None
    boat: str | None = None
    comparable: str | None = None
    since: datetime.date | None = None
    until: datetime.date | None = None
    scope: str | None = None

    def __str__(self) -> str:
        named = {"boat": self.boat, "class": self.comparable, "since": self.since, "until": self.until}
        parts = [self.athlete, *(f"{name} {value}" for name, value in named.items() if value is not None)]
        return ", ".join(part for part in parts if part) or "the season"


def rate_range(text: str | None) -> tuple[float | None, float | None]:
    """Stroke rates of a text such as "20-24", 1/min, both included; None does not restrict."""
    if text is None:
        return None, None
    ends = _RATES.match(text)
    if ends is None or float(ends[1]) >= float(ends[2]):
        raise DataError(f'"{text}" is no range of stroke rates; expected one such as 20-24')
    return float(ends[1]), float(ends[2])


def metric_named(text: str, metrics: Sequence[str]) -> str:
    """The metric of a name, which may lack its unit: `Catch angle` and `catch_angle_rad` are the same."""
    name = re.sub(r"[\s\-]+", "_", text.strip()).casefold()
    if name in metrics:
        return name
    alike = [metric for metric in metrics if _UNIT.sub("", metric) == _UNIT.sub("", name)]
    if len(alike) == 1:
        return alike[0]
    if alike:
        raise DataError(f'"{text}" may be {" or ".join(alike)}; give one of them')
    known = (_UNIT.sub("", metric) for metric in metrics)
    raise DataError(f'no stroke that was asked about has the metric "{text}". {did_you_mean(name, known)}')


class Database:
    """The tables of a season, or of a part of it. Close it, or use it in a `with`.

    Args:
        season: which.
        selection: which rows.
        tables: what is in the tables; None brings those of the season up to date first.

    Raises:
        DataError: DuckDB is not installed, the selection names somebody or something that is not there, or a table
            is damaged.
    """

    def __init__(
        self, season: Season, selection: Selection | None = None, tables: Catalogue | None = None
    ) -> None:
        self.season, self.selection = season, selection or Selection()
        try:
            import duckdb
        except ImportError:
            raise DataError(
                f'{season.place.address}: questions need one more package: pip install "oarlock[season]"'
            ) from None
        self._duckdb, self._connection = duckdb, duckdb.connect(":memory:", config=_SETTINGS)
        try:
            self._open(update_tables(season, self.selection.athlete) if tables is None else tables)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Database:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End it."""
        self._connection.close()

    def table(self, sql: str) -> pa.Table:
        """The answer to one statement that only reads.

        Raises:
            DataError: the statement is wrong, would change something, or reads what is no table of the season.
        """
        kinds = (self._duckdb.StatementType.SELECT, self._duckdb.StatementType.EXPLAIN)
        try:
            statements = self._connection.extract_statements(sql)
            if len(statements) != 1 or statements[0].type not in kinds:
                raise DataError(
                    "a question is one statement that reads, such as SELECT, DESCRIBE or SUMMARIZE; got "
                    + (", then ".join(statement.type.name for statement in statements) or "none")
                )
            return self._connection.sql(sql).to_arrow_table()
        except self._duckdb.Error as error:
            raise DataError(f"the question cannot be answered: {error}{self._advice(error)}") from None

    def rows(self, sql: str) -> list[dict[str, Any]]:
        """As `table`, a dictionary a row."""
        rows: list[dict[str, Any]] = self.table(sql).to_pylist()
        return rows

    def metric(self, text: str) -> str:
        """The column of a metric's name.

        Raises:
            DataError: there is none.
        """
        if not self.metrics:
            raise DataError(
                f"{self.season.place.address}: has no strokes yet; compute them: `oarlock season run`"
            )
        return metric_named(text, self.metrics)

    def classes(self) -> dict[str, tuple[str, int]]:
        """Engine and number of recordings of each class of runs among the strokes, most recordings first."""
        return {row["comparable"]: (row["engine"], row["recordings"]) for row in self.rows("FROM classes")}

    def _advice(self, error: BaseException) -> str:
        """What to do where DuckDB could not read a file; empty for other errors."""
        kinds = ("Parser", "Binder", "Catalog", "Permission")
        if isinstance(error, tuple(getattr(self._duckdb, f"{kind}Exception") for kind in kinds)):
            return ""
        return f". If a table is damaged: `oarlock season check {self.season.place.address} --repair`"

    def _run(self, sql: str, *values: object) -> None:
        try:
            self._connection.execute(sql, values or None)
        except self._duckdb.Error as error:
            raise DataError(f"{self.season.place.address}: {error}{self._advice(error)}") from error

    def _open(self, tables: Catalogue) -> None:
        here = in_threads(self._path, [data.file for data in tables.of])
        # An athlete whose table is gone was erased meanwhile.
        stored = Catalogue([data for data, path in zip(tables.of, here, strict=True) if path is not None])
        self._check_athlete(stored)
        scope = self.selection.scope
        stored = Catalogue([data for data in stored.of if scope is None or data.athlete.allows(scope)])
        self._run("SET TimeZone = 'UTC'")
        for name, rows in (("athletes", athlete_rows), ("recordings", recording_rows), ("runs", run_rows)):
            self._create(name, rows(stored))
        self._select()
        paths = ", ".join(_quoted(str(path)) for path in here if path is not None)
        self._strokes(
            f"read_parquet([{paths}], union_by_name = true, hive_partitioning = false)" if paths else ""
        )
        self._run(f"SET allowed_paths = [{paths}]")
        self._run("SET enable_external_access = false")
        self._run("SET lock_configuration = true")

    def _path(self, file: str) -> Path | None:
        with suppress(FileNotFoundError):
            return self.season.place.on_disk(file)
        return None

    def _check_athlete(self, stored: Catalogue) -> None:
        athlete, scope = self.selection.athlete, self.selection.scope
        if scope is not None:
            check_scope(scope)
        if athlete is not None and not stored.of:
            raise not_in_season("athlete", athlete, self.season.athletes())
        if athlete is not None and scope and not stored.of[0].athlete.allows(scope):
            raise DataError(f"{athlete} has not consented to {scope}")

    def _create(self, name: str, rows: pa.Table) -> None:
        self._connection.register("rows", rows)
        self._run(f"CREATE TABLE {name} AS FROM rows")
        self._connection.unregister("rows")

    def _select(self) -> None:
        """Keep only the recordings of the selection, and the runs over these."""
        selection = self.selection
        boats, classes = "FROM recordings SELECT boat", "FROM runs SELECT comparable"
        for what, name, known in (
            ("boat", selection.boat, boats),
            ("class of runs", selection.comparable, classes),
        ):
            names = {next(iter(row.values())) for row in self.rows(known)} if name is not None else {name}
            if name not in names:
                raise not_in_season(what, str(name), filter(None, names))
        for condition, value in (
            ("boat = ?", selection.boat),
            ("comparable = ?", selection.comparable),
            ("started::DATE >= ?", selection.since),
            ("started::DATE <= ?", selection.until),
        ):
            if value is not None:
                self._run(f"DELETE FROM recordings WHERE NOT coalesce({condition}, false)", value)
        self._run("DELETE FROM runs WHERE recording NOT IN (SELECT recording FROM recordings)")

    def _strokes(self, files_: str) -> None:
        """The view of strokes, and all questions."""
        # A macro is bound when it is made; on an empty table that needs no file. The view replaces it.
        if files_:
            self._run(f"CREATE TABLE strokes AS FROM {files_} LIMIT 0")
        else:
            self._create("strokes", KEYS.empty_table())
        columns = [row["column_name"] for row in self.rows("DESCRIBE strokes")]
        self.metrics = [name for name in columns if not name.endswith("_std") and name not in KEYS.names]
        self._run(_stroke_values(set(columns), self.metrics))
        add_functions(self._connection)
        self._run(files("oarlock.season").joinpath("views.sql").read_text(encoding="utf-8"))
        if files_:
            self._run("DROP TABLE strokes")
            only = "" if self.selection == Selection() else "SEMI JOIN recordings USING (recording)"
            self._run(f"CREATE VIEW strokes AS FROM {files_} {only}")


def _stroke_values(columns: set[str], metrics: Sequence[str]) -> str:
    """The macro that gives one metric of each stroke that counts; DuckDB reads just the columns of the metric."""
    values, stds = {}, {}
    for name in metrics:
        values[name], stds[name] = f'"{name}"', f'"{name}_std"' if f"{name}_std" in columns else "NULL"
        right, left = f"r_{name}", f"l_{name}"
        if {right, left} <= columns:
            values[name + SIDED] = f'"{right}" - "{left}"'
            known = {f"{right}_std", f"{left}_std"} <= columns
            square = f'"{right}_std" * "{right}_std" + "{left}_std" * "{left}_std"'
            stds[name + SIDED] = f"sqrt({square})" if known else "NULL"
    rate = "rate_per_min" if "rate_per_min" in columns else "NULL::FLOAT"
    counts = "coalesce(in_averages, 1) > 0" if "in_averages" in columns else "true"
    return (
        "CREATE MACRO stroke_values(metric, rate_from := NULL, rate_to := NULL) AS TABLE "
        f"SELECT recording, comparable, athlete, boat, seat, rig, started, stroke, {rate}::DOUBLE AS rate, "
        f"({_choice(values)})::DOUBLE AS value, ({_choice(stds)})::DOUBLE AS std FROM strokes WHERE {counts} "
        f"AND (rate_from IS NULL OR {rate} >= rate_from) AND (rate_to IS NULL OR {rate} <= rate_to)"
    )


def _choice(by_name: dict[str, str]) -> str:
    cases = " ".join(f"WHEN {_quoted(name)} THEN {value}" for name, value in by_name.items())
    return f"CASE metric {cases} END" if by_name else "NULL"


def _quoted(text: str) -> str:
    """A text of SQL."""
    return "'" + text.replace("'", "''") + "'"


def add_functions(connection: Any) -> None:
    """Registers the functions that `views.sql` calls with DuckDB."""
    nulls = {"null_handling": "special"}
    lists = ["DOUBLE[]", "DOUBLE[]"]
    connection.create_function("seat_place", _place, ["VARCHAR"], "DOUBLE", **nulls)
    connection.create_function("delays", _delays, [*lists, "DOUBLE"], "DOUBLE[]")
    connection.create_function("pooled", pooled, lists, "STRUCT(mean DOUBLE, se DOUBLE)")
    for name, share in (("t95", 0.975), ("t999", 0.9995)):
        connection.create_function(name, partial(_student, share), ["DOUBLE"], "DOUBLE", **nulls)
    connection.create_function("chance", _chance, ["DOUBLE", "DOUBLE"], "DOUBLE")


def _student(share: float, df: float | None) -> float | None:
    """Quantile of Student's t by degrees of freedom; None below 1."""
    from scipy.special import stdtrit

    return float(stdtrit(df, share)) if df is not None and df >= 1.0 else None


def _chance(t: float, df: float) -> float:
    """Probability that Student's t is larger than this, on either side."""
    from scipy.special import stdtr

    return 2.0 * float(stdtr(df, -t))


def pooled(means: list[float], ses: list[float]) -> dict[str, float]:
    """Mean of several sessions with its standard error, from the mean and the standard error of each.

    A model of random effects (DerSimonian and Laird 1986), the variance between sessions by Hedges' moments.
    """
    mean, variance = np.asarray(means), np.square(ses)
    between = max(np.var(mean, ddof=1) - variance.mean(), 0.0) if len(mean) > 1 else 0.0
    weight = 1.0 / np.maximum(variance + between, _LEAST_VARIANCE)
    return {"mean": float((weight * mean).sum() / weight.sum()), "se": float(weight.sum() ** -0.5)}


def _place(seat: str | None) -> float | None:
    """Counted from the bow; None for what names no seat."""
    with suppress(DataError):
        return seat_place(seat) if seat else None
    return None


def _delays(leader_s: list[float], own_s: list[float], after_s: float) -> list[float | None]:
    """How much later than the leader's each catch is, s; None without a partner.

    Times are of the own recording each, which starts `after_s` after the leader's.
    """
    late_s = delays(np.asarray(leader_s), np.asarray(own_s) + after_s)
    return [None if np.isnan(late) else float(late) for late in late_s]
